//! Every reader of the program, on any bytes. A message is made of whatever is refused.
//!
//! Each function must come back whatever it is given, and must not panic: what it asserts holds for all data that are read.

use std::path::Path;

use scrnn::dataset::Dataset;
use scrnn_data::{FileError, Selection, parse_as, read_part};
use scrnn_run::experiment::{self, Override};

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
            let _ = (resolved.plan(), resolved.topology(2));
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

/// Makes a message, and renders one of sixteen as the program would: that takes longer than all reading.
fn show(bytes: &[u8], error: impl Into<miette::Report>) {
    let report = error.into();
    assert!(!report.to_string().is_empty());
    if crc32fast::hash(bytes).is_multiple_of(16) {
        assert!(!format!("{report:?}").is_empty());
    }
}
