//! Every reader of the program, on any bytes. A message is made of whatever is refused.
//!
//! Each function must come back whatever it is given, and must not panic: what it asserts holds for all data that are read.

use std::path::Path;
use std::sync::LazyLock;

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::{Dataset, Sequence};
use scrnn_data::{FileError, Selection, parse_as, read_part};
use scrnn_run::experiment::{self, Override};
use scrnn_run::notes::Notes;
use scrnn_run::stream::{Arrival, Stream};
use scrnn_run::{history, resume};

/// What an experiment's network may be for.
static TWO_CHANNELS: LazyLock<Dataset> = LazyLock::new(|| {
    let sequence = Sequence::new("1", 2, vec![0.0, 1.0, 0.5, -1.0, 0.0, 1.0]).expect("three samples");
    Dataset::new(Dataset::numbered_channels(2), vec![sequence]).expect("a data set")
});

/// A data file of this name. With `resampled`, a recording's joints every twentieth of a second.
pub fn data(name: &str, bytes: &[u8], resampled: bool) {
    let selection = match resampled {
        true => Selection { topics: vec!["/joint_states".to_owned()], period: Some(0.05), ..Selection::default() },
        false => Selection::default(),
    };
    judge(bytes, parse_as(Path::new(name), bytes, &selection));
}

/// A folder that may be one recording.
pub fn folder(path: &Path) {
    judge(&[], read_part(path, &Selection::default()));
}

fn judge(bytes: &[u8], outcome: Result<Dataset, FileError>) {
    match outcome {
        Ok(data) => {
            assert!(data.total_samples() > 0 && !data.channels().is_empty());
            assert!(data.sequences().iter().all(|s| s.values().iter().all(|value| !value.is_infinite())));
        }
        Err(error) => show(bytes, error),
    }
}

/// An experiment file. One that is read can be written, and is read again.
pub fn experiment(text: &str) {
    match experiment::read_text("x.toml", text, &[]).and_then(|read| read.resolved(Path::new("/"))) {
        Ok(resolved) => {
            let again = toml::to_string(&resolved).expect("what was read can be written");
            assert!(experiment::read_text("again.toml", &again, &[]).is_ok(), "{again}");
            let _ = (resolved.plan(), resolved.topology(&TWO_CHANNELS));
        }
        Err(failure) => show(text.as_bytes(), failure),
    }
}

/// An experiment file with a change on the command line.
pub fn changed_experiment(text: &str, change: &str) {
    if let Ok(change) = change.parse::<Override>()
        && let Err(failure) = experiment::read_text("x.toml", text, &[change])
    {
        show(text.as_bytes(), failure);
    }
}

/// Samples line by line, for a network on these channels. Each has a value for each channel, be it missing.
pub fn stream(bytes: &[u8], channels: &[&str]) {
    let channels: Vec<String> = channels.iter().map(|&name| name.to_owned()).collect();
    let mut stream = Stream::new(bytes, &channels);
    loop {
        match stream.next() {
            Ok(None) => break,
            Ok(Some(Arrival::Gap)) => {}
            Ok(Some(Arrival::Sample(sample))) => assert_eq!(sample.len(), channels.len()),
            Err(failure) => return show(bytes, failure),
        }
    }
    let lines = bytes.iter().filter(|byte| **byte == b'\n').count();
    assert!(stream.line_number() <= lines + 1);
}

/// A history that is cut to go on at an epoch. What is kept is kept again, and is what learning curves are drawn from.
pub fn history(bytes: &[u8], epoch: u64) {
    let found = history::cut(bytes, epoch);
    let epochs: Vec<u64> = found.kept.lines().map(|row| row.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(epochs.windows(2).all(|pair| pair[0] < pair[1]) && epochs.iter().all(|&row| row <= epoch));
    assert_eq!(found.last.map(|last| last.0), epochs.last().copied());
    let again = format!("head\n{}", found.kept);
    assert_eq!(history::cut(again.as_bytes(), epoch), history::Cut { damaged: None, ..found });
    assert_eq!(history::rows(again.as_bytes()).len(), epochs.len());
}

/// Notes as they are read, and compared before a run goes on.
pub fn notes(bytes: &[u8]) {
    static GOLDEN: LazyLock<Checkpoint> = LazyLock::new(|| {
        let bytes = include_bytes!("../../tests/golden/run/checkpoint.safetensors");
        Checkpoint::from_bytes(bytes).expect("a good checkpoint")
    });
    let Ok(value) = serde_json::from_slice(bytes) else { return };
    let now = Notes::of(&GOLDEN).expect("notes of this program");
    let experiment = now.experiment().expect("a good experiment");
    let crafted = Checkpoint { notes: value, ..GOLDEN.clone() };
    if let Some(notes) = Notes::of(&crafted) {
        if let Ok(experiment) = notes.experiment() {
            let _ = (experiment.data.selection(), experiment.plan(), experiment.topology(&TWO_CHANNELS));
        }
        assert_eq!(Notes::of(&Checkpoint { notes: notes.to_value(), ..GOLDEN.clone() }), Some(notes));
    }
    if let Err(failure) = resume::check(&crafted, now, &experiment, Path::new("run")) {
        show(bytes, failure);
    }
}

/// Makes a message, and renders one of sixteen as the program would: that takes longer than all reading.
fn show(bytes: &[u8], error: impl Into<miette::Report>) {
    let report = error.into();
    assert!(!report.to_string().is_empty());
    if crc32fast::hash(bytes).is_multiple_of(16) {
        assert!(!format!("{report:?}").is_empty());
    }
}
