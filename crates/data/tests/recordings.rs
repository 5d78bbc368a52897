//! Recordings of the kinds that people have, with the values that should come of them. The files lie in tests/cases.

use std::path::{Path, PathBuf};

use scrnn_data::{Level, Reading, Selection, TimeSource, inspect, read};

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn with(topics: &[&str], period: Option<f64>, channels: Option<&[&str]>, time: Option<TimeSource>) -> Selection {
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    Selection { topics: owned(topics), period, channels: channels.map(owned), time, ..Selection::default() }
}

fn ready(name: &str, selection: &Selection) -> Reading {
    inspect(&case(name), selection).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn refused(name: &str, selection: &Selection) -> (String, String) {
    let error = inspect(&case(name), selection).unwrap_err();
    let help = miette::Diagnostic::help(&error).map(|help| help.to_string()).unwrap_or_default();
    (error.to_string(), help)
}

fn values(reading: &Reading) -> &[f64] {
    let [sequence] = reading.data.sequences() else { panic!("{} sequences", reading.data.sequences().len()) };
    sequence.values()
}

fn says(reading: &Reading, part: &str) -> Option<Level> {
    reading.remarks.iter().find(|remark| remark.to_string().contains(part)).map(|remark| remark.level())
}

/// The movement of most of them as a table: shoulder and elbow.
fn truth() -> Vec<f64> {
    let table = read(&case("33-mixed-rates/held.csv")).unwrap();
    table.sequences()[0].values().chunks_exact(3).flat_map(|row| &row[..2]).copied().collect()
}

#[test]
fn two_publishers_on_one_topic_are_merged_by_name() {
    let reading = ready("10-two-publishers/arm.mcap", &with(&[], None, None, None));
    assert_eq!(reading.data.channels(), ["shoulder", "elbow", "gripper"]);
    assert_eq!((values(&reading).len(), reading.period), (3 * 119, Some(0.02)));
    let second = [0.09490968019566891, 0.5237970900969059];
    assert_eq!(values(&reading)[..2], second);
    // Thirteen twentieths of the way between the messages of the other.
    let (before, after) = (0.794764010495201, 0.8035406926500904);
    assert!((values(&reading)[2] - (before + 0.65 * (after - before))).abs() < 1e-12);
    assert_eq!(says(&reading, "2 kinds of messages"), Some(Level::Note));
    let only = ready("10-two-publishers/arm.mcap", &with(&["/joint_states"], None, Some(&["gripper"]), None));
    assert_eq!((values(&only).len(), values(&only)[0]), (120, before));
    let (message, help) = refused("10-two-publishers/arm.mcap", &with(&[], None, Some(&["gripper", "knee"]), None));
    assert!(message.ends_with("topic /joint_states: there is no channel `knee`"), "{message}");
    assert!(help.contains("shoulder"), "{help}");
}

#[test]
fn joints_without_positions_are_read_by_their_velocities() {
    let reading = ready("11-position-empty/wheels.mcap", &with(&[], None, None, None));
    assert_eq!(reading.data.channels(), ["left_wheel", "right_wheel"]);
    assert_eq!(
        (values(&reading).len(), &values(&reading)[..2]),
        (240, &[0.001257302210933933, 0.44963133243347064][..])
    );
    assert_eq!(says(&reading, "no positions; the velocity"), Some(Level::Note));
    let (message, _) = refused("11-position-empty/wheels.mcap", &with(&["/joint_states.position"], None, None, None));
    assert!(message.ends_with("holds 2 names, but 0 positions"), "{message}");
    let chosen = ready("11-position-empty/wheels.mcap", &with(&["/joint_states.velocity"], None, None, None));
    assert_eq!(values(&chosen), values(&reading));
    let named = ready("11-position-empty/wheels.mcap", &with(&[], None, Some(&["velocity.right_wheel"]), None));
    assert_eq!((named.data.channels()[0].as_str(), values(&named)[0]), ("velocity.right_wheel", 0.44963133243347064));
}

#[test]
fn a_whole_number_that_tells_the_time_is_a_clock_and_no_channel() {
    let reading = ready("12-json-timestamp/custom.mcap", &with(&[], None, None, None));
    assert_eq!(reading.data.channels(), ["shoulder", "elbow"]);
    assert_eq!((values(&reading).len(), reading.period), (240, Some(0.02)));
    assert_eq!(values(&reading)[2..4], [0.09490968019566891, 0.5237970900969059]);
    assert_eq!(says(&reading, "`timestamp` is a clock"), Some(Level::Note));
    let asked = ready("12-json-timestamp/custom.mcap", &with(&[], None, Some(&["timestamp"]), None));
    assert_eq!(values(&asked)[0], 1_766_147_454_233_218_075_i64 as f64);
}

#[test]
fn a_recording_in_twelve_files_is_one_in_the_order_of_its_folder() {
    let reading = ready("13-split-bag/rosbag2_demo", &with(&[], None, None, None));
    assert_eq!((values(&reading), reading.period), (&truth()[..], Some(0.02)));
    assert_eq!(reading.facts.topics[0].count, 300);
    let part = ready("13-split-bag/rosbag2_demo/rosbag2_demo_10.mcap", &with(&[], None, None, None));
    assert_eq!(values(&part), &truth()[2 * 250..2 * 275]);
}

#[test]
fn ros_2_messages_are_read_from_mcap_and_sqlite() {
    for name in ["14-cdr-jointstate/bag", "14-cdr-jointstate/bag/bag.mcap"] {
        let reading = ready(name, &with(&[], None, None, None));
        assert_eq!(reading.data.channels(), ["shoulder", "elbow"]);
        assert_eq!((values(&reading), reading.period), (&truth()[..240], Some(0.02)));
        assert_eq!(says(&reading, "/joint_states: by the times of the header stamp"), Some(Level::Note));
    }
    for name in ["14-cdr-jointstate/bag3", "14-cdr-jointstate/bag3/bag3.db3"] {
        let reading = ready(name, &with(&[], None, None, None));
        let shoulder: Vec<f64> = truth().iter().step_by(2).take(30).copied().collect();
        assert_eq!((reading.data.channels(), values(&reading)), (&["shoulder".to_owned()][..], &shoulder[..]));
    }
}

#[test]
fn stamps_are_taken_where_messages_were_logged_in_bursts() {
    let name = "15-burst-log-times/burst.mcap";
    for period in [None, Some(0.02)] {
        let reading = ready(name, &with(&[], period, None, None));
        assert_eq!((values(&reading), reading.period), (&truth()[..400], Some(0.02)));
        assert_eq!(says(&reading, "logged in bursts of about 5"), Some(Level::Note));
    }
    let published = ready(name, &with(&[], None, None, Some(TimeSource::Publish)));
    assert_eq!(values(&published), &truth()[..400]);
    let (message, help) = refused(name, &with(&[], None, None, Some(TimeSource::Log)));
    assert!(message.contains("logged in bursts of about 5"), "{message}");
    assert!(help.contains("rows"), "{help}");
    let rows = ready(name, &with(&[], None, None, Some(TimeSource::Rows)));
    assert_eq!(values(&rows), &truth()[..400]);
    let stairs = ready(name, &with(&[], Some(0.02), None, Some(TimeSource::Log)));
    assert_eq!(says(&stairs, "in bursts of about 5"), Some(Level::Warning));
}

#[test]
fn topics_of_different_rates_are_joined_to_one_period() {
    let name = "33-mixed-rates/two_topics.mcap";
    let reading = ready(name, &with(&["/arm/joint_states", "/gripper"], None, None, None));
    assert_eq!(
        (reading.data.channels(), reading.period),
        (&["shoulder", "elbow", "gripper"].map(String::from)[..], Some(0.02))
    );
    let held = read(&case("33-mixed-rates/held.csv")).unwrap();
    let held = &held.sequences()[0];
    assert_eq!(values(&reading).len(), 3 * 295);
    let mut late = 0;
    for index in 0..295 {
        // The gripper's first message comes after that of the arm.
        let (found, expected) = (&values(&reading)[3 * index..3 * index + 3], held.sample(index + 1));
        assert_eq!(found[..2], expected[..2], "{index}");
        assert!(found[2] == 0.0 || found[2] == 1.0);
        late += usize::from(found[2] != expected[2]);
    }
    // The nearest message of a gripper at 10 Hz is up to half a period away, the one before up to a whole one.
    assert!(late < 20, "{late}");
    let (message, help) = refused(name, &with(&[], None, None, None));
    assert!(message.ends_with("it is not clear which topic is meant"), "{message}");
    assert!(help.contains("--topic /arm/joint_states") && help.contains("/gripper (60 messages"), "{help}");
    let (message, _) = refused(name, &with(&["/arm"], None, None, None));
    assert!(message.ends_with("there is no topic `/arm`"), "{message}");
    let slow = ready(name, &with(&["/gripper"], None, None, None));
    assert_eq!((slow.data.channels(), values(&slow).len(), slow.period), (&["data".to_owned()][..], 60, Some(0.1)));
    let by_name = ready(name, &with(&["/arm/joint_states", "/gripper"], Some(0.1), Some(&["gripper", "elbow"]), None));
    assert_eq!(
        (by_name.data.channels(), values(&by_name).len()),
        (&["gripper", "elbow"].map(String::from)[..], 2 * 59)
    );
}

#[test]
fn a_bag_of_ros_1_gets_the_way_out_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.bag");
    std::fs::write(&path, b"#ROSBAG V2.0\n").unwrap();
    let error = inspect(&path, &Selection::default()).unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(help.contains("rosbags-convert --src") && help.contains("walk.bag --dst"), "{help}");
}

#[test]
fn a_bag_that_is_not_whole_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    std::fs::write(bag.join("metadata.yaml"), "rosbag2_bagfile_information:\n  relative_file_paths:\n  - a_0.mcap\n")
        .unwrap();
    let error = inspect(&bag, &Selection::default()).unwrap_err().to_string();
    assert!(
        error.ends_with("metadata.yaml: this is no whole bag: it names `a_0.mcap`, which is not in the folder"),
        "{error}"
    );
    // A database whose newest messages are in a journal.
    std::fs::copy(case("14-cdr-jointstate/bag3/bag3.db3"), bag.join("b.db3")).unwrap();
    std::fs::write(bag.join("b.db3-wal"), "x").unwrap();
    let error = inspect(&bag.join("b.db3"), &Selection::default()).unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(error.to_string().contains("b.db3-wal") && help.contains("wal_checkpoint"), "{error} {help}");
    std::fs::write(bag.join("c.db3"), "not a database").unwrap();
    let error = inspect(&bag.join("c.db3"), &Selection::default()).unwrap_err().to_string();
    assert!(error.ends_with("this is not an SQLite database"), "{error}");
}

#[test]
fn small_files_that_would_become_large_are_refused_at_once() {
    let begin = std::time::Instant::now();
    let mut outcome = String::new();
    let held =
        allocation_counter::measure(|| outcome = refused("attack/blow.mcap", &with(&[], None, None, None)).0).bytes_max;
    assert!(outcome.contains("holds more than"), "{outcome}");
    assert!(held < 40 << 20, "{held}");
    assert!(begin.elapsed().as_secs_f64() < 5.0, "an attack that took 50 s");
    let (message, _) = refused("attack/times.mcap", &with(&[], Some(1e-9), None, None));
    assert!(message.contains("2 messages would become"), "{message}");
}
