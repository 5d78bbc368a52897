//! Tables and arrays as people have them, recreated in `tests/cases`: what is taken, with values, and what is refused how.

use std::path::{Path, PathBuf};

use miette::Diagnostic;
use scrnn_data::suspicions::{Suspicion, look};
use scrnn_data::{FileError, Reading, Remark, Selection, TimeSource, read_all};

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn with(name: &str, selection: Selection) -> Result<Reading, FileError> {
    read_all(&[case(name)], &selection)
}

fn read(name: &str) -> Reading {
    with(name, Selection::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The message and what to do.
fn refused(name: &str, selection: Selection) -> (String, String) {
    let error = with(name, selection).map(|reading| reading.data.channels().join(", ")).expect_err(name);
    (error.to_string(), error.help().map(|help| help.to_string()).unwrap_or_default())
}

/// Names of the channels, lengths of the sequences.
fn shape(reading: &Reading) -> (Vec<&str>, Vec<usize>) {
    let channels = reading.data.channels().iter().map(String::as_str).collect();
    (channels, reading.data.sequences().iter().map(|sequence| sequence.len()).collect())
}

fn first(reading: &Reading) -> &[f64] {
    reading.data.sequences()[0].sample(0)
}

fn last(reading: &Reading) -> &[f64] {
    let sequence = &reading.data.sequences()[reading.data.sequences().len() - 1];
    sequence.sample(sequence.len() - 1)
}

fn channels(names: &[&str]) -> Selection {
    Selection { channels: Some(names.iter().map(|&name| name.to_owned()).collect()), ..Selection::default() }
}

fn says(reading: &Reading, what: &str) -> bool {
    reading.remarks.iter().any(|remark| remark.to_string().contains(what))
}

const START: &[f64] = &[0.001257302210933933, 0.44963133243347064];

#[test]
fn a_commented_header_of_numpy_names_the_channels_and_the_clock() {
    let reading = read("01-savetxt-header/demo.csv");
    assert_eq!(shape(&reading), (vec!["shoulder", "elbow"], vec![120]));
    assert_eq!((first(&reading), reading.period), (START, Some(0.02)));
    assert_eq!(reading.remarks, [Remark::Clock { column: "time".into() }]);
    // What is asked for is a channel.
    let asked = with("01-savetxt-header/demo.csv", channels(&["time", "elbow"])).unwrap();
    assert_eq!(
        (shape(&asked).0, asked.data.sequences()[0].sample(1)),
        (vec!["time", "elbow"], &[0.02, 0.530_202_785_000_047_4][..])
    );
}

#[test]
fn numbered_columns_of_pandas_are_a_header() {
    let reading = read("02-pandas-integer-header/demo.csv");
    assert_eq!(shape(&reading), (vec!["0", "1", "2"], vec![120]));
    assert_eq!(first(&reading), [0.001257302210933933, 0.44963133243347064, 0.794764010495201]);
    // A first row of whole numbers from which the next follows is a row.
    let path = Path::new("x.csv");
    let circle: String = (0..50).map(|k| f64::from(k) * 0.1).map(|t| format!("{},{}\n", t.sin(), t.cos())).collect();
    assert_eq!(scrnn_data::parse_as(path, circle.as_bytes(), &Selection::default()).unwrap().total_samples(), 50);
}

#[test]
fn stamps_since_1970_are_clocks_in_any_unit() {
    let now = read("03-plotjuggler-timestamp/dense.csv");
    assert_eq!((shape(&now), now.period), ((vec!["arm/shoulder", "arm/elbow"], vec![120]), Some(0.02)));
    assert_eq!(read("03-plotjuggler-timestamp/later.csv").data, now.data);
    let seconds = read("03-plotjuggler-timestamp/pj.csv");
    assert_eq!((seconds.period, seconds.facts.clock.as_deref()), (Some(0.02), Some("__time")));
}

#[test]
fn episodes_are_sequences_and_their_counters_no_channels() {
    let reading = read("05-lerobot-table/episodes.csv");
    let state = ["observation.state.shoulder", "observation.state.elbow", "observation.state.gripper"];
    assert_eq!(shape(&reading), (state.to_vec(), vec![60, 70, 80, 90]));
    assert_eq!(reading.data.sequences()[3].name, "3");
    assert_eq!(last(&reading)[2], 0.0);
    assert!((reading.period.unwrap() - 1.0 / 30.0).abs() < 1e-8);
}

#[test]
fn columns_that_are_not_wanted_may_hold_anything() {
    let all = read("06-rostopic-echo-p/joint_states.csv");
    assert_eq!(shape(&all), (vec!["field.position0", "field.position1"], vec![120]));
    assert_eq!((first(&all), all.facts.clock.as_deref()), (START, Some("field.header.stamp")));
    let one = with("06-rostopic-echo-p/joint_states.csv", channels(&["field.position1"])).unwrap();
    assert_eq!((shape(&one).0, first(&one)), (vec!["field.position1"], &START[1..]));
    assert_eq!(read("06-rostopic-echo-p/joint_states_nostr.csv").data, all.data);
    let (message, _) = refused("06-rostopic-echo-p/joint_states.csv", channels(&["field.name0"]));
    assert!(message.contains("`shoulder` in column field.name0 is not a number"), "{message}");
}

#[test]
fn decimal_commas_are_read_where_they_are_certain() {
    for (name, columns) in [
        ("two.csv", vec!["shoulder", "elbow"]),
        ("comma_comma.csv", vec!["shoulder", "elbow"]),
        ("one.csv", vec!["shoulder"]),
    ] {
        let reading = read(&format!("07-decimal-comma/{name}"));
        let start = &[40.038, 53.489][..columns.len()];
        assert_eq!(shape(&reading), (columns, vec![120]), "{name}");
        assert_eq!(first(&reading), start, "{name}");
        assert!(says(&reading, "comma"), "{name}");
    }
    let thousands = read("07-decimal-comma/thousands.csv");
    assert_eq!(first(&thousands), [1274.54, 2399.09]);
    let (message, _) = refused("07-decimal-comma/one_noheader.csv", Selection::default());
    assert!(message.contains("line 1") && message.contains("Write decimals with a point"), "{message}");
    let (message, _) = refused("07-decimal-comma/tab.txt", Selection::default());
    assert!(message.contains("before decimals or thousands"), "{message}");
}

#[test]
fn more_channels_than_steps_are_asked_about() {
    let (message, help) = refused("08-axis-order/basic_motions.npy", Selection::default());
    assert!(message.contains("shape (8, 6, 100) would be 100 channels of 6 steps"), "{message}");
    assert!(help.contains("`axes = \"nct\"`"), "{help}");
    let axes = |text: &str| Selection { axes: Some(text.parse().unwrap()), ..Selection::default() };
    let turned = with("08-axis-order/basic_motions.npy", axes("nct")).unwrap();
    assert_eq!((shape(&turned).0.len(), shape(&turned).1), (6, vec![100; 8]));
    assert_eq!(first(&turned)[..2], *START);
    let matlab = with("08-axis-order/one_matlab.npy", axes("ct")).unwrap();
    assert_eq!((shape(&matlab).1, &first(&matlab)[..2]), (vec![1000], START));
    let as_it_is = with("08-axis-order/basic_motions.npy", axes("ntc")).unwrap();
    assert_eq!((shape(&as_it_is).0.len(), shape(&as_it_is).1), (100, vec![6; 8]));
    let (message, _) = refused("08-axis-order/basic_motions.npy", axes("tc"));
    assert!(message.contains("does not fit an array of shape (8, 6, 100)"), "{message}");
}

#[test]
fn arrays_of_one_length_are_groups_of_channels() {
    let aloha = read("09-motion-npz/aloha.npz");
    let (names, lengths) = shape(&aloha);
    assert_eq!((names.len(), names[0], names[20], lengths), (21, "qpos.0", "action.6", vec![90]));
    assert_eq!(first(&aloha)[..2], *START);
    let arrays = |names: &[&str]| Selection {
        arrays: names.iter().map(|&name| name.to_owned()).collect(),
        ..Selection::default()
    };
    let chosen = with("09-motion-npz/aloha.npz", arrays(&["action", "qpos"])).unwrap();
    assert_eq!((shape(&chosen).0[0], first(&chosen)[7]), ("action.0", START[0]));
    let (message, help) = refused("09-motion-npz/aloha.npz", arrays(&["effort"]));
    assert!(message.contains("no array `effort`") && help.contains("qpos (90, 7)"), "{message} {help}");
    let motion = read("09-motion-npz/motion.npz");
    assert_eq!((shape(&motion).0.len(), motion.period), (12, Some(1.0 / 30.0)));
    assert_eq!(shape(&read("09-motion-npz/withnames.npz")).0, ["shoulder", "elbow"]);
    let clocked = read("09-motion-npz/xyz.npz");
    assert_eq!((shape(&clocked), clocked.period), ((vec!["x", "y"], vec![90]), Some(0.02)));
    let slower = with("09-motion-npz/xyz.npz", Selection { period: Some(0.04), ..Selection::default() }).unwrap();
    assert_eq!(slower.data.sequences()[0].sample(1), clocked.data.sequences()[0].sample(2));
}

#[test]
fn numbered_arrays_are_sequences_in_the_order_people_mean() {
    let reading = read("28-robomimic/converted.npz");
    let names: Vec<&str> = reading.data.sequences().iter().map(|sequence| sequence.name.as_str()).collect();
    assert_eq!((names.len(), &names[1..4], names[11]), (12, &["demo_1", "demo_2", "demo_3"][..], "demo_11"));
    let two = read("19-numpy-dtypes/comp.npz");
    assert_eq!(shape(&two).1, [60, 40]);
}

#[test]
fn all_types_of_numpy_that_are_numbers_are_read() {
    let plain = read("19-numpy-dtypes/fortran.npy");
    assert_eq!((shape(&plain).1, first(&plain)), (vec![60], START));
    for name in ["big.npy", "four.npy", "squeezed.npy", "longdouble.npy", "mac.npz", "withmeta.npz"] {
        assert_eq!(
            read(&format!("19-numpy-dtypes/{name}")).data.sequences()[0].values(),
            plain.data.sequences()[0].values(),
            "{name}"
        );
    }
    assert_eq!(first(&read("19-numpy-dtypes/half.npy")), [0.0012569427490234375, 0.44970703125]);
    assert_eq!(first(&read("19-numpy-dtypes/int_and_bool.npz")), [0.0, 44.0]);
    let record = read("19-numpy-dtypes/record.npy");
    assert_eq!((shape(&record), record.period), ((vec!["shoulder", "elbow"], vec![60]), Some(0.02)));
    assert_eq!(first(&record), [f64::from(START[0] as f32), f64::from(START[1] as f32)]);
    let help = |name: &str| refused(&format!("19-numpy-dtypes/{name}"), Selection::default()).1;
    assert!(help("ragged_obj.npy").contains(
        "numpy.load(\"ragged_obj.npy\", allow_pickle=True)`, then `numpy.savez(\"ragged_obj_arrays.npz\", *d)`"
    ));
    assert!(help("list_T_J_3.npy").contains("(120, 15) by array.reshape(len(array), -1)"));
    assert!(help("dt.npy").contains("dates"));
    assert!(help("scalar.npy").contains("axes"));
}

#[test]
fn headers_of_several_lines_are_joined() {
    let tracked = read("20-deeplabcut/videoDLC.csv");
    assert_eq!(shape(&tracked).0, ["hand.x", "hand.y", "elbow.x", "elbow.y"]);
    assert_eq!(first(&tracked), [200.126, 244.963, 279.476, 277.794]);
    assert!(says(&tracked, "`hand.likelihood` holds how sure the tracker is"));
    let sure = with("20-deeplabcut/videoDLC.csv", channels(&["hand.likelihood"])).unwrap();
    assert_eq!(first(&sure), [0.9836]);
    // The marker is lost in line 38.
    let strict = Selection { missing: scrnn_data::Missing::Refuse, ..Selection::default() };
    let (message, _) = refused("22-optitrack/take.csv", strict);
    assert!(message.contains("line 38: sequence 1, step 31, channel Rotation.X is missing"), "{message}");
    let lost = read("22-optitrack/take.csv");
    assert!(lost.data.missing() > 0 && lost.data.sequences()[0].sample(30)[0].is_nan());
    assert!(says(&lost, "channel Rotation.X: "));
}

#[test]
fn doubled_names_are_numbered() {
    let reading = with("22-optitrack/take_cut.csv", Selection { period: Some(0.01), ..Selection::default() }).unwrap();
    assert_eq!(shape(&reading).0, ["X.1", "Y.1", "Z.1", "W", "X.2", "Y.2", "Z.2"]);
    assert_eq!(first(&reading)[3..6], [1.0, 0.000629, 0.224816]);
    let (message, help) = refused("22-optitrack/take_cut.csv", channels(&["X", "Y"]));
    assert!(message.contains("no channel `X`") && help.contains("X.1"), "{message} {help}");
}

#[test]
fn times_are_held_to_even_steps() {
    let (message, help) = refused("26-uneven-time/uneven.csv", Selection::default());
    assert!(message.contains("0.2035") && message.contains("16 of 299 intervals"), "{message}");
    assert!(help.contains("`period = 0.0222`") && help.contains("`time = \"rows\"`"), "{help}");
    let even = read("26-uneven-time/even.csv");
    let resampled =
        with("26-uneven-time/uneven.csv", Selection { period: Some(0.02), ..Selection::default() }).unwrap();
    assert_eq!((shape(&resampled), resampled.period), (shape(&even), Some(0.02)));
    for (a, b) in resampled.data.sequences()[0].values().iter().zip(even.data.sequences()[0].values()) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
    assert_eq!(resampled.facts.gaps.len(), 16);
    let rows =
        with("26-uneven-time/uneven.csv", Selection { time: Some(TimeSource::Rows), ..Selection::default() }).unwrap();
    assert_eq!(shape(&rows).1, [300]);
    assert!(says(&rows, "the rows were taken as even steps"));
    let (message, _) = refused("29-csv-oddities/bool.csv", Selection { period: Some(0.02), ..Selection::default() });
    assert!(message.contains("does not tell when its samples were taken"), "{message}");
}

#[test]
fn odd_tables_are_understood() {
    let names = ["shoulder", "elbow"];
    let without_names = ["y1", "y2"];
    let cases: &[(&str, &[&str], Option<f64>)] = &[
        ("bom_semicolon.csv", &names, Some(0.02)),
        ("crcrlf.csv", &names, None),
        ("date_time.csv", &names, Some(0.02)),
        ("double_spaced.csv", &names, None),
        ("inline_comment.txt", &without_names, None),
        ("iso.csv", &names, Some(0.02)),
        ("iso_time.csv", &names, Some(0.02)),
        ("latin1.csv", &["Drehung_\u{b0}", "H\u{f6}he_\u{b5}m"], None),
        ("list_cell.csv", &["state.0", "state.1"], Some(0.02)),
        ("matlab_percent.txt", &names, Some(0.02)),
        ("numpy_cell.csv", &["state.0", "state.1"], None),
        ("quoted.csv", &names, None),
        ("sep_line.csv", &names, None),
        ("unicode_minus.csv", &names, None),
        ("unit_row.csv", &names, Some(0.02)),
        ("utf16.csv", &names, None),
    ];
    for (name, columns, period) in cases {
        let reading = read(&format!("29-csv-oddities/{name}"));
        assert_eq!((shape(&reading), reading.period), ((columns.to_vec(), vec![60]), *period), "{name}");
        assert_eq!((first(&reading), last(&reading)), (&[0.0013, 0.4496][..], &[0.1023, -0.35][..]), "{name}");
    }
    assert_eq!(first(&read("29-csv-oddities/fortran.csv")), [1.2573e-3, 4.4963e-1]);
    assert_eq!(first(&read("29-csv-oddities/int_noheader_first.csv")), [0.0, 0.0]);
    assert_eq!(last(&read("29-csv-oddities/bool.csv")), [0.1023, -0.35, 1.0]);
    assert_eq!(read("29-csv-oddities/unit_row.csv").facts.units, [Some("deg".to_owned()), Some("deg".to_owned())]);
    assert_eq!(shape(&read("29-csv-oddities/header_repeat.csv")).1, [30, 30]);
    let echo = read("29-csv-oddities/ros2_topic_echo.csv");
    assert_eq!((first(&echo), echo.period), (&[0.0013, 0.4496, 0.0, 0.0][..], Some(0.02)));
    let (message, help) = refused("29-csv-oddities/short_header.csv", Selection::default());
    assert!(
        message.contains("line 2: 3 fields; needed: 2") && help.contains("give each of the 3 a name"),
        "{message} {help}"
    );
}

#[test]
fn files_are_joined_by_the_names_of_their_channels() {
    let files = |names: &[&str]| {
        let paths: Vec<PathBuf> = names.iter().map(|name| case(&format!("31-column-order/{name}.csv"))).collect();
        read_all(&paths, &Selection::default())
    };
    let joined = files(&["train", "swapped"]).unwrap();
    let [a, b] = joined.data.sequences() else { panic!("two files") };
    assert_eq!((a.values(), a.name.as_str(), b.name.as_str()), (b.values(), "train/1", "swapped/1"));
    let error = files(&["train", "other_names"]).unwrap_err();
    assert!(error.to_string().contains("are knee, hip; those of"), "{error}");
    let error = files(&["train", "unit"]).unwrap_err();
    assert!(error.help().unwrap().to_string().contains("differ in capitals, spaces or units only"));
    assert!(matches!(files(&["train", "extra"]), Err(FileError::ChannelsDiffer(_))));
    let by_place = files(&["train", "nohead_swapped"]).unwrap();
    assert!(says(&by_place, "names no channels; its columns were taken as shoulder, elbow, by their places"));
}

#[test]
fn what_looks_wrong_is_named() {
    let found = |name: &str| look(&read(name).data);
    assert!(matches!(&found("30-training/outliers.csv")[..], [Suspicion::Spikes { count: 3, step: 201, .. }]));
    assert!(matches!(
        &found("30-training/offset.csv")[..],
        [Suspicion::HardlyMoves { .. }, Suspicion::HardlyMoves { .. }]
    ));
    assert_eq!(found("30-training/clean.csv"), []);
    assert!(matches!(&found("17-angle-wrap/wrapped.csv")[..], [Suspicion::Turns { count: 2, .. }]));
    assert!(matches!(&found("17-angle-wrap/around180.csv")[..], [Suspicion::Turns { .. }]));
    let unwrapped =
        with("17-angle-wrap/wrapped.csv", Selection { unwrap: vec!["yaw".into()], ..Selection::default() }).unwrap();
    assert_eq!(look(&unwrapped.data), []);
    assert!((last(&unwrapped)[0] - (2.4002872746280453 + 2.0 * std::f64::consts::TAU)).abs() < 1e-12);
    // A folder with a file in degrees and one in radians; two files named one by one.
    let mixed = read("36-deg-or-rad");
    assert!(
        matches!(&look(&mixed.data)[..], [Suspicion::DegreesAndRadians { in_degrees, .. }] if in_degrees == "lerobot_deg/1")
    );
    let paths = ["even", "deg"].map(|name| case(&format!("26-uneven-time/{name}.csv")));
    let mixed = read_all(&paths, &Selection::default()).unwrap();
    assert!(look(&mixed.data).iter().any(|found| matches!(found, Suspicion::DegreesAndRadians { .. })));
}

#[test]
fn remarks_are_json_with_a_message() {
    let json = read("01-savetxt-header/demo.csv").remarks[0].json();
    assert_eq!(json["kind"], "clock");
    assert_eq!((&json["column"], &json["level"]), (&"time".into(), &"note".into()));
    assert_eq!(json["message"], "`time` is a clock, no channel");
    assert!(json["help"].as_str().unwrap().contains("channels"));
}

/// A table of 40 rows that `row` writes, behind `head`, read as a file of this name.
fn table(name: &str, head: &str, row: impl Fn(usize) -> String) -> Reading {
    let rows: String = (0..40).map(|k| row(k) + "\n").collect();
    let text = format!("{head}{rows}");
    scrnn_data::inspect_bytes(Path::new(name), text.as_bytes(), &Selection::default())
        .unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// A movement.
fn moves(k: usize) -> String {
    format!("{:.4},{:.4}", (k as f64 * 0.1).sin(), (k as f64 * 0.1).cos())
}

#[test]
fn other_recorders_tables_are_read() {
    let phone = table("x.csv", "time,seconds_elapsed,z,y\n", |k| {
        format!("{},{},{}", 1_698_501_144_401_265_200_i64 + 10_000_000 * k as i64, k as f64 * 0.01, moves(k))
    });
    assert_eq!((shape(&phone).0, phone.period), (vec!["z", "y"], Some(0.01)));
    let tum = table("x.txt", "# ground truth\n# timestamp tx ty\n", |k| {
        format!("{:.4} {}", 1_305_031_102.175_8 + 0.01 * k as f64, moves(k).replace(',', " "))
    });
    assert_eq!((shape(&tum).0, tum.period), (vec!["tx", "ty"], Some(0.01)));
    let r = table("x.txt", "\"a\" \"b\"\n", |k| format!("\"{}\" {}", k + 1, moves(k).replace(',', " ")));
    assert_eq!((shape(&r).0, first(&r)), (vec!["a", "b"], &[0.0, 1.0][..]));
    let closed = table("x.txt", "", |k| format!("{};", moves(k)));
    assert_eq!(shape(&closed).0, ["y1", "y2"]);
    let german = table("x.csv", "Zeit [s];Winkel [Grad]\n", |k| {
        format!("{:.2};{:.4}", k as f64 * 0.01, (k as f64).sin()).replace('.', ",")
    });
    assert_eq!((shape(&german).0, german.period), (vec!["Winkel [Grad]"], Some(0.01)));
    let pair = table("x.csv", "/j/header/stamp/sec,/j/header/stamp/nanosec,/j/a,/j/b\n", |k| {
        format!("{},{},{}", 1_700_000_000 + k / 10, k % 10 * 100_000_000, moves(k))
    });
    assert_eq!((shape(&pair).0, pair.period), (vec!["/j/a", "/j/b"], Some(0.1)));
}

#[test]
fn sequences_are_told_apart_by_labels_and_restarts() {
    let names =
        |reading: &Reading| reading.data.sequences().iter().map(|sequence| sequence.name.clone()).collect::<Vec<_>>();
    let trials = table("x.csv", "subject,trial,x,y\n", |k| format!("S{},{},{}", k / 20, k / 10 % 2, moves(k)));
    assert_eq!(names(&trials), ["S0/0", "S0/1", "S1/0", "S1/1"]);
    let restart = table("x.csv", "time,x,y\n", |k| format!("{},{}", (k % 20) as f64 * 0.01, moves(k)));
    assert_eq!((names(&restart), restart.period), (vec!["1".to_owned(), "2".into()], Some(0.01)));
    assert!(says(&restart, "`time` begins again, first at row 21: 2 sequences"));
    let frames = table("x.csv", "frame,x,y\n", |k| format!("{},{}", k % 10, moves(k)));
    assert_eq!(shape(&frames).1, [10; 4]);
    // A trial that changes at each row counts rows; words that stand still are said.
    let counted = table("x.csv", "trial,x,y\n", |k| format!("{k},{}", moves(k)));
    assert_eq!(shape(&counted), (vec!["x", "y"], vec![40]));
    let gestures =
        table("x.csv", "gesture,x,y\n", |k| format!("{},{}", if k < 20 { "wave" } else { "point" }, moves(k)));
    assert!(says(&gestures, "stand still for 2 stretches"), "{:?}", gestures.remarks);
}

#[test]
fn a_name_alone_does_not_make_a_clock() {
    let reading = table("x.csv", "time,x\n", moves);
    assert_eq!(shape(&reading).0, ["time", "x"]);
    assert!(says(&reading, "`time` does not rise"));
    let ticks = table("x.csv", "count,x,y\n", |k| format!("{},{}", [0, 1, 2, 1][k % 4], moves(k)));
    assert_eq!(shape(&ticks).0, ["count", "x", "y"]);
    let values = table("x.csv", "t,x,y\n", |k| format!("{},{}", 20 - (k as i64 - 20).abs(), moves(k)));
    assert_eq!(shape(&values).0, ["t", "x", "y"]);
}
