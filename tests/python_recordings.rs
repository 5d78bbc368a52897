//! Recordings that software which is not ours wrote: rosbags, mcap-ros2-support, mcap-protobuf-support.
//!
//! The interpreter is that of tests/python/interpreter.rs.

use std::path::PathBuf;
use std::process::Command;

use scrnn_data::{Selection, inspect};

#[path = "python/interpreter.rs"]
mod interpreter;

use interpreter::root;

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    interpreter::python("numpy, mcap, mcap_protobuf, mcap_ros2, rosbags, foxglove_schemas_protobuf")
}

/// What cases.json says of a file.
#[derive(serde::Deserialize)]
struct Case {
    file: PathBuf,
    topics: Vec<String>,
    period: Option<f64>,
    wanted: Option<Vec<String>>,
    channels: Vec<String>,
    values: Vec<Vec<f64>>,
    read_period: Option<f64>,
}

#[test]
fn recordings_of_other_programs_hold_what_they_wrote() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = root().join("tests/python/write_recordings.py");
    let output = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let cases = std::fs::read(folder.path().join("cases.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_slice(&cases).unwrap();
    assert!(cases.len() > 40, "{}", cases.len());
    for Case { file, topics, period, wanted, channels, values, read_period } in cases {
        let of = format!("{} {topics:?} {wanted:?} {period:?}", file.display());
        let selection = Selection { topics, period, channels: wanted, ..Selection::default() };
        let reading = inspect(&folder.path().join(file), &selection).unwrap_or_else(|error| panic!("{of}: {error}"));
        assert_eq!(reading.data.channels(), channels, "{of}");
        let [sequence] = reading.data.sequences() else { panic!("{of}: {} sequences", reading.data.sequences().len()) };
        assert_eq!(sequence.len(), values.len(), "{of}");
        for (index, expected) in values.iter().enumerate() {
            for (found, expected) in sequence.sample(index).iter().zip(expected) {
                // numpy rounds what lies on a line between two messages in another order.
                let near = (found - expected).abs() <= 1e-9 * expected.abs().max(1.0);
                assert!(near, "{of}, sample {index}: {found} for {expected}");
            }
        }
        if let Some(expected) = read_period {
            let found = reading.period.unwrap();
            assert!((found - expected).abs() < 1e-9, "{of}: {found}");
        }
    }
}
