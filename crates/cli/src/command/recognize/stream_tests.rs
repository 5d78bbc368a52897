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
    ] {
        let found = all(text).unwrap_err().to_string();
        assert!(found.starts_with(message), "{text:?}: {found}");
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
