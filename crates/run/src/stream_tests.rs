//! Lines of every kind, good and bad.

use super::*;

fn all(text: &str) -> Result<Vec<Arrival>> {
    let mut stream = Stream::new(text.as_bytes(), &["a".to_owned(), "b".to_owned()]);
    std::iter::from_fn(|| stream.next().transpose()).collect()
}

/// As text, because NaN is not equal to itself.
fn told(text: &str) -> String {
    format!("{:?}", all(text).unwrap())
}

#[test]
fn channels_are_found_by_name_or_place() {
    let samples = [Arrival::Sample(vec![1.0, 2.0]), Arrival::Gap, Arrival::Sample(vec![3.0, 4.0])];
    for text in [
        "1,2\n\n3,4\n",
        "# noise\na,b\n1,2\n\n3 4\n",
        "time;b;a\n0;2;1\n\n1;4;3\n",
        "y1\ty2\n1\t2\n\n3\t4\n",
        "sequence,step,\"a\",b\none,1,1,2\ntwo,1,3,4\n",
        "{\"a\": 1, \"b\": 2}\n\n{\"b\": 4.0, \"a\": 3, \"time\": 7}\n",
        "{\"header\": {}, \"name\": [\"b\", \"a\"], \"position\": [2, 1]}\n\n{\"name\": [\"a\", \"b\"], \"position\": [3, 4]}\n",
    ] {
        assert_eq!(all(text).unwrap(), samples, "{text:?}");
    }
}

#[test]
fn a_missing_value_moves_no_other() {
    for text in [
        "1,2\n,9\n3,\n",
        "1\t2\n\t9\n3\t\n",
        "1;2\nNaN;9\n3;null\n",
        "b,a\n2,1\n9,\n,3\n",
        "{\"a\":1,\"b\":2}\n{\"b\":9}\n{\"a\":3,\"b\":NaN}\n",
    ] {
        assert_eq!(told(text), "[Sample([1.0, 2.0]), Sample([NaN, 9.0]), Sample([3.0, NaN])]", "{text:?}");
    }
}

#[test]
fn a_bad_line_is_named_by_number_and_channel() {
    for (text, message) in [
        ("1,2\n3\n", "line 2 has 1 fields, needed are 2"),
        ("1,2\n3,x\n", "line 2, b is `x`"),
        ("5,1,2\n", "line 1 of the stream, `5` `1` `2`, has 3 fields"),
        ("0x1,2\n1,2\n", "line 1 of the stream, `0x1` `2`, is neither all numbers nor all names"),
        ("a,b,c\n1,2,3\n", "line 1 of the stream, `a` `b` `c`, has `c`, which the network did not learn"),
        ("a,a\n1,2\n", "line 1 of the stream, `a` `a`, has no channel `b`, and has `a` more than once"),
        ("a\u{1b}[31m,b\n", "line 1 of the stream, `a\\u{1b}[31m` `b`, has no channel `a`"),
        ("{\"a\":1}\n", "line 1 has no channel `b`"),
        ("{\"a\":1,\"b\":\"2\"}\n", "line 1 has b as \"2\""),
        ("1,2\n{\"a\":1,\"b\":2}\n", "line 2 is a JSON object, the lines before it were none"),
        ("{\"name\":[\"a\"],\"position\":[1,2]}\n", "line 1 has 1 names and 2 positions"),
        ("{\"a\":1,\"b\":2}\n{\"a\":1,\"b\":2,\"a\":3}\n", "line 2 has `a` more than once"),
        ("{\"a\":1,\"a\":null,\"b\":2}\n", "line 1 has `a` more than once"),
        ("{\"a\":1,\"a\":NaN,\"b\":2}\n", "line 1 has `a` more than once"),
        ("{\"name\":[\"a\",\"b\"],\"name\":[\"b\",\"a\"],\"position\":[1,2]}\n", "line 1 has `name` more than once"),
        ("{\"name\":[\"a\",\"b\",\"a\"],\"position\":[1,2,3]}\n", "line 1 has `a` more than once"),
        ("{\"name\":[\"a\",7],\"position\":[1,2]}\n", "line 1 has no channel `b`, and has ``"),
        ("{\"a\":1,\"b\":2\n", "line 1 is no JSON object"),
        ("{\"a\":1,\"b\":nan}\n", "line 1 is no JSON object"),
    ] {
        let found = all(text).unwrap_err().to_string();
        assert!(found.starts_with(message), "{text:?}: {found}");
    }
}

#[test]
fn numbers_beyond_all_numbers_are_missing_and_end_nothing() {
    for text in ["1,2\n1e400,9\n3,-1e999\n", "{\"a\":1,\"b\":2}\n{\"a\":1e400,\"b\":9}\n{\"b\":-1e999,\"a\":3}\n"] {
        let values: Vec<f64> = all(text)
            .unwrap()
            .into_iter()
            .flat_map(|arrival| match arrival {
                Arrival::Sample(values) => values,
                Arrival::Gap => Vec::new(),
            })
            .collect();
        assert!(!values[2].is_finite() && !values[5].is_finite(), "{text:?}: {values:?}");
        assert_eq!([values[0], values[1], values[3], values[4]], [1.0, 2.0, 9.0, 3.0], "{text:?}");
    }
    // Words within names stay what they are.
    let line = r#"{"NaN \" 1e999":NaN,"b":[-Infinity,1e400]}"#;
    assert_eq!(without_non_finite(line), r#"{"NaN \" 1e999":null,"b":[null,null]}"#);
}

#[test]
fn a_mark_of_the_byte_order_is_no_part_of_the_first_name() {
    assert_eq!(all("\u{feff}b,a\n2,1\n").unwrap(), [Arrival::Sample(vec![1.0, 2.0])]);
    assert!(all("1,2\n\u{feff}1,2\n").is_err());
}

#[test]
fn the_longest_lines_are_read_or_refused_at_once() {
    let keys: Vec<String> = (0..80_000).map(|k| format!("\"k{k}\":1")).collect();
    let names: Vec<String> = (0..100_000).map(|k| format!("n{k}")).collect();
    let numbers = "1,".repeat(LONGEST / 2 - 1) + "1\n";
    let texts = [
        format!("{{{}}}\n", keys.join(",")),
        names.join(",") + "\n",
        numbers,
        format!("{{\"a\":{}\n", "[".repeat(LONGEST - 100)),
        format!("{{\"{}\n", "\\\"".repeat(LONGEST / 2 - 10)),
        format!("{{\"a\":NaN{}\n", "-1e400,".repeat(LONGEST / 8)),
    ];
    for text in texts {
        assert!(text.len() <= LONGEST + 1);
        let quickest = (0..3).map(|_| {
            let begin = std::time::Instant::now();
            let told = all(&text).unwrap_err().to_string();
            assert!(told.starts_with("line 1") && told.len() < 10_000, "{} bytes are said", told.len());
            begin.elapsed()
        });
        let quickest = quickest.min().unwrap();
        assert!(quickest.as_secs_f64() < 1.0, "{}: {quickest:?}", &text[..20]);
    }
}

#[test]
fn a_line_without_its_end_is_no_sample() {
    let mut stream = Stream::new("1,2\n3,4".as_bytes(), &["a".to_owned(), "b".to_owned()]);
    assert!(stream.next().unwrap().is_some() && !stream.is_unfinished());
    assert!(stream.next().unwrap().is_none() && stream.is_unfinished());
}

#[test]
fn a_line_without_end_is_refused_at_a_bound_and_bytes_that_are_no_text_too() {
    let endless = std::io::BufReader::new(std::io::repeat(b'1'));
    let mut stream = Stream::new(endless, &["a".to_owned()]);
    assert!(stream.next().unwrap_err().to_string().contains("longer than 1048576 bytes"));
    assert!(stream.line.capacity() <= 4 * LONGEST);
    let mut stream = Stream::new(&b"\xff\xfe\n"[..], &["a".to_owned()]);
    let failure = stream.next().unwrap_err();
    assert!(failure.code() == 2 && failure.to_string().contains("line 1 of the stream is not text"), "{failure}");
}

/// Bytes one at a time, and nothing in between.
struct Trickle(&'static [u8], bool);

impl Read for Trickle {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.1 = !self.1;
        match self.1 {
            true => Err(ErrorKind::WouldBlock.into()),
            false => self.0.read(&mut buffer[..1]),
        }
    }
}

#[test]
fn a_pipe_that_does_not_wait_is_waited_for() {
    let mut stream = Stream::new(std::io::BufReader::new(Trickle(b"1,2\n3,4\n", false)), &["a".into(), "b".into()]);
    let samples = [stream.next().unwrap(), stream.next().unwrap(), stream.next().unwrap()];
    assert_eq!(samples, [Some(Arrival::Sample(vec![1.0, 2.0])), Some(Arrival::Sample(vec![3.0, 4.0])), None]);
}
