//! Conversions: what is written reads as what went in.

use std::path::Path;

use scrnn::dataset::Sequence;

use super::*;
use crate::{Reading, Selection, inspect, inspect_bytes};

fn data(channels: &[&str], value: impl Fn(usize) -> f64) -> Dataset {
    let channels: Vec<String> = channels.iter().map(|name| (*name).to_owned()).collect();
    let sequence = |(number, length): (usize, usize)| {
        let values = (0..length * channels.len()).map(|k| value(100 * number + k)).collect();
        Sequence::new(format!("walk {number}"), channels.len(), values).unwrap()
    };
    let sequences = [7, 4, 9].into_iter().enumerate().map(sequence).collect();
    Dataset::new(channels.clone(), sequences).unwrap()
}

fn values(data: &Dataset) -> Vec<&[f64]> {
    data.sequences().iter().map(Sequence::values).collect()
}

const ABOUT: Conversion<'static> = Conversion { period: Some(0.02), task: Some("walk on") };

fn written(folder: &Path, name: &str, data: &Dataset) -> Reading {
    let path = folder.join(name);
    write_converted(&path, data, &ABOUT).unwrap();
    inspect(&path, &Selection::default()).unwrap()
}

#[test]
fn every_bit_comes_back_from_a_data_set_and_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let data = data(&["shoulder", "elbow \"2\""], |k| (k as f64 * 0.7).sin());
    let reading = written(folder.path(), "set", &data);
    assert_eq!(values(&reading.data), values(&data));
    assert_eq!(reading.data.channels(), ["observation.state.shoulder", "observation.state.elbow \"2\""]);
    assert_eq!(reading.period, Some(0.02));
    let reading = written(folder.path(), "walk.mcap", &data);
    assert_eq!((values(&reading.data), reading.data.channels()), (values(&data), data.channels()));
    let names: Vec<&str> = reading.data.sequences().iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["walk 0", "walk 1", "walk 2"]);
    assert!(reading.period.is_none_or(|period| (period - 0.02).abs() < 1e-9), "{:?}", reading.period);
    let reading = written(folder.path(), "walk.parquet", &data);
    assert_eq!(values(&reading.data), values(&data));
}

#[test]
fn states_and_actions_become_features_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let channels = ["action.0", "observation.state.x", "action.1", "observation.state.y"];
    let data = data(&channels, |k| k as f64 / 4.0);
    let reading = written(folder.path(), "set", &data);
    assert_eq!(reading.data.channels(), ["observation.state.x", "observation.state.y", "action.0", "action.1"]);
    assert_eq!(reading.data.sequences()[0].sample(1), [1.25, 1.75, 1.0, 1.5]);
    let info = std::fs::read_to_string(folder.path().join("set/meta/info.json")).unwrap();
    assert!(info.contains("\"float32\"") && !info.contains("\"float64\""), "{info}");
    // The same data give the same bytes.
    assert_eq!(convert(Path::new("x"), &data, &ABOUT).unwrap(), convert(Path::new("x"), &data, &ABOUT).unwrap());
}

#[test]
fn a_data_set_that_was_read_is_written_with_the_same_names() {
    let folder = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/lerobot_v3");
    let first = inspect(&fixtures, &Selection::default()).unwrap();
    let second = written(folder.path(), "again", &first.data);
    assert_eq!(first.data, second.data);
}

#[test]
fn a_recording_of_many_chunks_is_read_by_another_reader() {
    let channels = ["a", "b"].map(str::to_owned).to_vec();
    let values = (0..60_000).map(|k| f64::from(k) / 7.0).collect();
    let data = Dataset::new(channels, vec![Sequence::new("long", 2, values).unwrap()]).unwrap();
    let files = convert(Path::new("x.mcap"), &data, &ABOUT).unwrap();
    let bytes = &files[0].1;
    let summary = ::mcap::Summary::read(bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 30_001);
    assert!(summary.chunk_indexes.len() > 1, "{}", summary.chunk_indexes.len());
    let mut count = 0;
    for message in ::mcap::MessageStream::new(bytes).unwrap() {
        count += usize::from(message.unwrap().channel.topic == "/joint_states");
    }
    assert_eq!(count, 30_000);
    let reading = inspect_bytes(Path::new("x.mcap"), bytes, &Selection::default()).unwrap();
    assert_eq!(reading.data.sequences()[0].values(), data.sequences()[0].values());
}

#[test]
fn what_is_missing_is_asked_for() {
    let data = data(&["a"], |k| k as f64);
    for name in ["x.mcap", "set", "x.parquet"] {
        let error = convert(Path::new(name), &data, &Conversion::default()).unwrap_err();
        assert!(matches!(error, FileError::NoPeriod { .. }), "{error}");
        assert!(miette::Diagnostic::help(&error).unwrap().to_string().contains("--period"));
    }
    assert!(convert(Path::new("x.csv"), &data, &Conversion::default()).is_ok());
    assert!(matches!(convert(Path::new("x.h5"), &data, &ABOUT), Err(FileError::OnlyRead { .. })));
    assert!(matches!(convert(Path::new("x.xyz"), &data, &ABOUT), Err(FileError::Extension { .. })));
}
