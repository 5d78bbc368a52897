//! LeRobot data sets: episodes, names, several files, damage.

use std::path::{Path, PathBuf};

use crate::{FileError, Reading, Selection, inspect};

fn fixtures() -> PathBuf {
    let all = std::env::var_os("SCRNN_FIXTURES").map(PathBuf::from);
    all.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures"))
}

fn read(name: &str) -> Reading {
    inspect(&fixtures().join(name), &Selection::default()).unwrap()
}

/// A data set's folder with this info.json and copies of the fixture's files.
fn data_set(info: &str, files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("meta")).unwrap();
    std::fs::create_dir_all(folder.path().join("data/chunk-000")).unwrap();
    std::fs::write(folder.path().join("meta/info.json"), info).unwrap();
    for (to, from) in files {
        std::fs::copy(fixtures().join(from), folder.path().join("data/chunk-000").join(to)).unwrap();
    }
    folder
}

const STATE: [&str; 3] = ["observation.state.shoulder", "observation.state.elbow", "observation.state.gripper"];

#[test]
fn episodes_of_several_files_and_chunks_come_in_order() {
    let reading = read("lerobot_v3");
    let sequences = reading.data.sequences();
    let lengths: Vec<usize> = sequences.iter().map(|sequence| sequence.len()).collect();
    assert_eq!(lengths, [5, 4, 6, 3, 7]);
    assert_eq!(sequences.iter().map(|sequence| sequence.name.as_str()).collect::<Vec<_>>(), ["0", "1", "2", "3", "4"]);
    assert_eq!(reading.data.channels()[..3], STATE);
    assert_eq!(reading.data.channels()[3..], ["action.shoulder", "action.elbow", "action.gripper"]);
    assert_eq!(reading.period, Some(0.02));
    // 16 e + t / 4 + c / 32, and its negative.
    assert_eq!(sequences[4].sample(6), [65.5, 65.53125, 65.5625, -65.5, -65.53125, -65.5625]);
    assert_eq!((reading.facts.files.len(), reading.facts.named), (3, true));
    assert_eq!(reading.facts.format, "LeRobot data set");
}

#[test]
fn a_single_file_finds_the_names_of_its_data_set() {
    let reading = read("lerobot_v3/data/chunk-001/file-000.parquet");
    assert_eq!(reading.data.channels()[..3], STATE);
    assert_eq!(reading.data.sequences().iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["3", "4"]);
    let alone = read("parquet/snappy.parquet");
    assert_eq!(alone.data.channels()[..2], ["observation.state.0", "observation.state.1"]);
    assert_eq!(alone.data.sequences().len(), 3);
    // Without info.json the clock tells the period.
    assert!((alone.period.unwrap() - 0.02).abs() < 1e-8, "{:?}", alone.period);
    assert_eq!(alone.facts.clock.as_deref(), Some("timestamp"));
}

#[test]
fn features_and_channels_can_be_asked_for() {
    let folder = fixtures().join("lerobot_v3");
    let arrays = vec!["action".to_owned()];
    let reading = inspect(&folder, &Selection { arrays, ..Selection::default() }).unwrap();
    assert_eq!(reading.data.channels(), ["action.shoulder", "action.elbow", "action.gripper"]);
    let channels =
        ["action.elbow", "next.done", "observation.state.shoulder", "task_index"].map(str::to_owned).to_vec();
    let reading = inspect(&folder, &Selection { channels: Some(channels.clone()), ..Selection::default() }).unwrap();
    assert_eq!(reading.data.channels(), channels);
    assert_eq!(reading.data.sequences()[1].sample(1), [-16.28125, 0.0, 16.25, 0.0]);
    let refused = |selection| inspect(&folder, &selection).unwrap_err();
    let error = refused(Selection { channels: Some(vec!["knee".into()]), ..Selection::default() });
    assert!(
        matches!(&error, FileError::NoSuchChannel { channels, .. } if channels.contains("action.gripper")),
        "{error}"
    );
    let error = refused(Selection { arrays: vec!["effort".into()], ..Selection::default() });
    assert!(error.to_string().ends_with("it has no feature `effort`"), "{error}");
}

#[test]
fn another_period_is_resampled_to() {
    let folder = fixtures().join("lerobot_v3");
    let reading = inspect(&folder, &Selection { period: Some(0.01), ..Selection::default() }).unwrap();
    assert_eq!((reading.period, reading.data.sequences()[0].len()), (Some(0.01), 9));
    assert_eq!(reading.data.sequences()[0].sample(1)[0], 0.125);
}

#[test]
fn what_does_not_fit_is_said() {
    let twice = data_set(
        "{\"fps\": 50}",
        &[("file-000.parquet", "parquet/snappy.parquet"), ("file-001.parquet", "parquet/v2.parquet")],
    );
    let error = inspect(twice.path(), &Selection::default()).unwrap_err();
    assert!(error.to_string().contains("frame 0 of episode 0 comes twice"), "{error}");
    let part = data_set(
        r#"{"fps": 50, "total_episodes": 9, "total_frames": 90}"#,
        &[("file-000.parquet", "parquet/snappy.parquet")],
    );
    let reading = inspect(part.path(), &Selection::default()).unwrap();
    let said: Vec<String> = reading.remarks.iter().map(ToString::to_string).collect();
    assert!(
        said.iter().any(|remark| remark.contains("says 9 episodes of 90 frames in all; here are 3 of 30")),
        "{said:?}"
    );
    let broken = data_set("{\"fps\": 50", &[]);
    let error = inspect(broken.path(), &Selection::default()).unwrap_err().to_string();
    assert!(error.contains("info.json") && error.contains("line 1"), "{error}");
    let empty = data_set("{\"fps\": 50}", &[]);
    assert!(matches!(inspect(empty.path(), &Selection::default()), Err(FileError::Empty { .. })));
}

#[test]
fn a_table_of_frames_is_the_same_as_parquet_and_as_text() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/05-lerobot-table");
    let columns = inspect(&case.join("lerobot_v3"), &Selection::default()).unwrap();
    assert_eq!(columns.data.sequences().len(), 4);
    assert_eq!(columns.data.channels(), STATE);
    assert!((columns.period.unwrap() - 1.0 / 30.0).abs() < 1e-12);
    let first = columns.data.sequences()[0].sample(1);
    assert_eq!(first, [0.100_264_905_528_571_34, 0.530_202_785_000_047_4, 0.0]);
    let text = inspect(&case.join("episodes.csv"), &Selection::default()).unwrap();
    assert_eq!(text.data, columns.data);
}
