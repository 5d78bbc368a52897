//! Tests of the text reader: how researchers' files look, and what is said of broken ones.

use super::*;
use miette::SourceCode;
use scrnn::dataset::{Dataset, Sequence};

/// Names of the channels, then name and values of each sequence.
type Contents = (Vec<String>, Vec<(String, Vec<f64>)>);

fn read_text(text: &str) -> Result<Dataset, FileError> {
    read_bytes("data.csv", text.as_bytes())
}

fn read_bytes(path: &str, bytes: &[u8]) -> Result<Dataset, FileError> {
    crate::parse_as(std::path::Path::new(path), bytes, &Selection::default())
}

fn contents(text: &str) -> Contents {
    let set = read_text(text).unwrap_or_else(|error| panic!("{error}: {text:?}"));
    let sequences = set.sequences().iter().map(|s| (s.name.clone(), s.values().to_vec())).collect();
    (set.channels().to_vec(), sequences)
}

fn expected(channels: &[&str], sequences: &[(&str, &[f64])]) -> Contents {
    let sequences = sequences.iter().map(|(name, values)| (name.to_string(), values.to_vec())).collect();
    (channels.iter().map(|name| name.to_string()).collect(), sequences)
}

/// The message, and what the caret points at.
fn complaint(text: &str) -> (String, String) {
    match read_text(text).unwrap_err() {
        FileError::Line(error) => {
            let marked = error.text.inner().read_span(&error.span, 0, 0).unwrap().data().to_vec();
            (error.to_string(), String::from_utf8(marked).unwrap())
        }
        other => (other.to_string(), String::new()),
    }
}

#[test]
fn plain_numbers_are_one_sequence_whatever_stands_between_them() {
    let plain = expected(&["y1", "y2"], &[("1", &[1.0, -2.5, 3e-3, 4.0])]);
    for text in
        ["1,-2.5\n3e-3,4\n", "1 -2.5\n3e-3\t4", "1;-2.5\n3e-3; 4\n", "1\t-2.5\n3e-3\t4\t\n", "  1   -2.5 \n 3e-3 4\n"]
    {
        assert_eq!(contents(text), plain, "{text:?}");
    }
    assert_eq!(contents("0\n1\n"), expected(&["y1"], &[("1", &[0.0, 1.0])]));
}

#[test]
fn blank_lines_separate_sequences_of_any_length() {
    let text = "\n\n# a comment\n1 2\n3 4\n\n \t\n5 6\n# another\n7 8\n9 0\n\n";
    assert_eq!(contents(text), expected(&["y1", "y2"], &[("1", &[1., 2., 3., 4.]), ("2", &[5., 6., 7., 8., 9., 0.])]));
}

#[test]
fn a_column_of_labels_separates_sequences_too() {
    let text = "left,Sequence,step,right\n1,b,1,2\n3,a 1,1,4\n\n5,b,2,6\n";
    assert_eq!(contents(text), expected(&["left", "right"], &[("b", &[1., 2., 5., 6.]), ("a 1", &[3., 4.])]));
}

#[test]
fn a_header_names_the_channels() {
    let named = expected(&["left hand", "a \"b\", c"], &[("1", &[1.0, 2.0])]);
    assert_eq!(contents("left hand,\"a \"\"b\"\", c\"\n1,2\n"), named);
    assert_eq!(contents("\"left hand\" \"a \"\"b\"\", c\"\n1 2\n"), named);
    assert_eq!(contents("# from the lab\nleft hand; \"a \"\"b\"\", c\"\n1;2\n"), named);
    assert_eq!(contents("TIME,0,\n10,1,2\n"), expected(&["0", "y2"], &[("1", &[1.0, 2.0])]));
}

#[test]
fn the_index_that_pandas_writes_is_skipped() {
    let plain = expected(&["0", "1"], &[("1", &[0.5, 1.5, 2.5, 3.5])]);
    assert_eq!(contents(",0,1\n0,0.5,1.5\n1,2.5,3.5\n"), plain);
    assert_eq!(contents("Unnamed: 0,0,1\n0,0.5,1.5\n1,2.5,3.5\n"), plain);
    assert_eq!(contents("\t0\t1\na\t0.5\t1.5\nb\t2.5\t3.5\n"), plain);
    assert_eq!(contents("\"\",\"0\",\"1\"\n\"1\",0.5,1.5\n\"2\",2.5,3.5\n"), plain);
}

#[test]
fn windows_and_old_mac_files_read_alike() {
    let plain = expected(&["a", "b"], &[("1", &[1.0, 2.0]), ("2", &[3.0, 4.0])]);
    assert_eq!(contents("\u{feff}a,b\r\n1,2\r\n\r\n3,4\r\n"), plain);
    assert_eq!(contents("a,b\r1,2\r\r3,4\r"), plain);
    let latin = read_bytes("x.txt", b"K\xf6rper\n1\n").unwrap();
    assert_eq!(latin.channels(), ["K\u{f6}rper"]);
}

#[test]
fn comments_can_give_names() {
    let text = "# columns: time \"left hand\"\n# sequence: wave 1\n0 1\n1 2\n# sequence: wave 2\n0 3\n\n0 4\n";
    let named: &[(&str, &[f64])] = &[("wave 1", &[1.0, 2.0]), ("wave 2", &[3.0]), ("3", &[4.0])];
    assert_eq!(contents(text), expected(&["left hand"], named));
    // A remark that does not fit the columns is a remark.
    assert_eq!(contents("# columns: are in metres\n1\n"), expected(&["y1"], &[("1", &[1.0])]));
}

#[test]
fn another_number_of_fields_is_shown_with_its_line() {
    let (message, marked) = complaint("# x\na,b\n1,2\n\n3\n4,5\n");
    assert_eq!(message, "data.csv, line 5: 1 fields; needed: 2, as in line 2");
    assert_eq!(marked, "3");
}

#[test]
fn a_field_that_is_no_number_is_shown() {
    let (message, marked) = complaint("a,b\r\n1,2\r\n3, oops \r\n");
    assert_eq!(message, "data.csv, line 3: `oops` in column b is not a number");
    assert_eq!(marked, "oops");
}

#[test]
fn a_typing_error_in_the_first_line_does_not_make_it_a_header() {
    let (message, marked) = complaint("0.5,1.5x\n1,2\n");
    assert_eq!((message.as_str(), marked.as_str()), ("data.csv, line 1: `1.5x` in column y2 is not a number", "1.5x"));
    let first = read_text(",0.5\n1,2\n").unwrap().sequences()[0].values().to_vec();
    assert!(first[0].is_nan() && first[1..] == [0.5, 1.0, 2.0], "{first:?}");
}

#[test]
fn an_infinite_sample_is_named_by_its_place_and_a_missing_one_where_it_is_refused() {
    let text = |field: &str| format!("sequence,a,b\nx,1,2\nw,3,4\nw,5,{field}\n");
    for field in ["-inf", "1e999"] {
        let (message, marked) = complaint(&text(field));
        assert_eq!(message, format!("data.csv, line 4: sequence w, step 2, channel b is {field}"));
        assert_eq!(marked, field);
    }
    let refuse = Selection { missing: crate::Missing::Refuse, ..Selection::default() };
    for (field, found) in [("nan", "nan"), ("", "missing"), ("NA", "NA")] {
        let read = |selection: &Selection| {
            crate::inspect_bytes(std::path::Path::new("data.csv"), text(field).as_bytes(), selection)
        };
        let message = read(&refuse).unwrap_err().to_string();
        assert_eq!(message, format!("data.csv, line 4: sequence w, step 2, channel b is {found}"));
        let reading = read(&Selection::default()).unwrap();
        let values = reading.data.sequences()[1].values();
        assert!(values[..3] == [3.0, 4.0, 5.0] && values[3].is_nan(), "{values:?}");
        let told: Vec<String> = reading.remarks.iter().map(ToString::to_string).collect();
        assert!(told.contains(&"channel b: 1 of 3 samples are missing".to_owned()), "{told:?}");
    }
}

#[test]
fn channels_that_are_missing_by_more_than_half_or_altogether_are_warned_of() {
    let text = "a,b,c\n1,,NaN\n2,,NaN\n3,5,NaN\n4,6,NaN\n5,,NaN\n";
    let selection = Selection { channels: Some(["a", "b", "c"].map(str::to_owned).to_vec()), ..Selection::default() };
    let reading = crate::inspect_bytes(std::path::Path::new("data.csv"), text.as_bytes(), &selection).unwrap();
    let warned: Vec<String> = reading
        .remarks
        .iter()
        .filter(|remark| remark.level() == crate::Level::Warning)
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        warned,
        ["channel b: 3 of 5 samples are missing", "channel c was never observed: all its samples are missing"]
    );
}

#[test]
fn decimal_commas_get_a_hint() {
    let error = read_text("1.5;2.5\n1,5;2,5\n1.5;2,5\n".replace("1,5;2,5", "1.5;1,25.5").as_str()).unwrap_err();
    assert!(error.to_string().contains("is not a number"), "{error}");
    assert_eq!(contents("1,5;2,5\n"), expected(&["y1", "y2"], &[("1", &[1.5, 2.5])]));
}

#[test]
fn files_without_samples_say_so() {
    for text in ["", "\n\n", "# nothing\n", "a,b\n", "\u{feff}"] {
        assert_eq!(complaint(text).0, "data.csv holds no samples; needed: at least one", "{text:?}");
    }
    assert!(complaint("sequence,step\n1,1\n").0.starts_with("data.csv has no column of samples"));
}

#[test]
fn binary_files_are_told_from_text() {
    let message = |bytes: &[u8]| read_bytes("x.csv", bytes).unwrap_err().to_string();
    assert_eq!(message(b"\xff\xfe1\0\0"), "x.csv is not plain text: it is damaged UTF-16");
    assert_eq!(message(b"PK\x03\x04\0\0"), "x.csv is not plain text: it holds zero bytes");
}

#[test]
fn a_large_file_keeps_its_line_numbers_in_the_message() {
    let text = "1,2\n".repeat(300_000) + "3\n";
    let Err(FileError::Line(error)) = read_text(&text) else { panic!("the last line is short") };
    assert_eq!(error.line, 300_001);
    assert!(error.text.inner().len() < 1000);
}

#[test]
fn names_that_a_spreadsheet_would_run_are_written_apart_and_read_back() {
    let names = ["=cmd|'/c calc'!A1", "@SUM(1)", "-1+cmd", "+x", "plain"].map(str::to_owned).to_vec();
    let sequence = Sequence::new("=1+1", 5, vec![0.5; 10]).unwrap();
    let data = Dataset::new(names, vec![sequence]).unwrap();
    let text = crate::csv(&[crate::Field { name: "", data: &data }]);
    let cells = text.lines().flat_map(|line| line.split(',')).map(|cell| cell.trim_start_matches('"'));
    assert!(
        cells.clone().count() > 10 && !cells.into_iter().any(|cell| cell.starts_with(['=', '@', '+', '-'])),
        "{text}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    crate::write(&path, &[crate::Field { name: "", data: &data }]).unwrap();
    let again = crate::read(&path).unwrap();
    assert_eq!((again.channels(), &again.sequences()[0].name), (data.channels(), &data.sequences()[0].name));
}

#[test]
fn rows_that_close_with_semicolons_are_numbers_between_spaces() {
    let rows = "0.00D+00  1.5D-1  2.0D+0;\n2.00D-02  1.6D-1  2.5D+0;\n4.00D-02  1.7D-1  3.0D+0;\n";
    let set = read_bytes("log.dat", format!("% time x y\n{rows}").as_bytes()).unwrap();
    assert_eq!(set.channels(), ["x", "y"]);
    assert_eq!(set.sequences()[0].values(), [0.15, 2.0, 0.16, 2.5, 0.17, 3.0]);
    // One number to a row, and names with spaces in them.
    assert_eq!(contents("a b;\n1;\n2;\n"), expected(&["a b"], &[("1", &[1.0, 2.0])]));
}

#[test]
fn a_stamp_without_a_name_is_a_clock() {
    // `ros2 topic echo --csv /joint_states`: seconds, nanoseconds, frame, names, positions.
    let row = |k: u64| {
        let nanoseconds = 900_000_000 + 20_000_000 * k;
        format!(
            "{},{},base,shoulder,elbow,{}.5,-{k}.25\n",
            1_700_000_000 + nanoseconds / 1_000_000_000,
            nanoseconds % 1_000_000_000,
            k
        )
    };
    let text: String = (0..12).map(row).collect();
    let reading =
        crate::inspect_bytes(std::path::Path::new("echo.csv"), text.as_bytes(), &Selection::default()).unwrap();
    assert_eq!((reading.data.channels().len(), reading.period), (2, Some(0.02)));
    assert_eq!(reading.data.sequences()[0].sample(7), [7.5, -7.25]);
    assert_eq!(reading.facts.clock.as_deref(), Some("stamp.sec and stamp.nanosec"));
    // Two channels of whole numbers are no stamp.
    for text in ["1,2\n2,3\n3,4\n4,5\n5,6\n", "5,1000000,1\n4,2000000,1\n3,3000000,2\n2,4000000,3\n1,5000000,4\n"] {
        assert!(contents(text).0.len() > 1 && contents(text).0[0] == "y1", "{text}");
    }
}

/// A hundred samples a tenth of a second apart, with one pause after the fiftieth.
fn paused(pause: f64) -> String {
    let time = |k: usize| 0.1 * k as f64 + if k > 49 { pause } else { 0.0 };
    let rows = (0..100).map(|k| format!("{:.1},{}\n", time(k), (k as f64).sin()));
    format!("time,a\n{}", rows.collect::<String>())
}

#[test]
fn what_a_message_about_uneven_times_suggests_is_not_refused_in_turn() {
    use miette::Diagnostic;
    let parse = |text: &str, period: Option<f64>| {
        let selection = Selection { period, ..Selection::default() };
        crate::parse_as(std::path::Path::new("data.csv"), text.as_bytes(), &selection)
    };
    for (pause, bridged) in [(0.5, true), (0.8, true), (1.2, false), (300.0, false)] {
        let text = paused(pause);
        let help = parse(&text, None).unwrap_err().help().unwrap().to_string();
        assert_eq!(help.contains("`period = 0.1`"), bridged, "{pause} s: {help}");
        assert_eq!(parse(&text, Some(0.1)).is_ok(), bridged, "{pause} s");
        // The other way out is one: two sequences, each with even steps.
        let named = |(k, row): (usize, &str)| match k {
            0 => format!("sequence,{row}\n"),
            1..=50 => format!("a,{row}\n"),
            _ => format!("b,{row}\n"),
        };
        let cut: String = text.lines().enumerate().map(named).collect();
        assert!(bridged || help.contains("a column `sequence` that changes there"), "{help}");
        assert_eq!(parse(&cut, None).unwrap().sequences().len(), 2);
    }
}
