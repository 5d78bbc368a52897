//! What a run came to, in files beside its checkpoints.
//!
//! | file | what it holds |
//! |---|---|
//! | `outcome.json` | how the training ended, and all measures; the same to the byte whoever did it. It is there once the run is finished |
//! | `failed.json` | why a run could not be finished; the next call tries again |
//! | `times.json` | seconds, threads and the machine: the only file that differs from one time to the next |

use std::collections::BTreeMap;
use std::path::Path;

use scrnn_run::failure::{Failure, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// How a finished run ended.
pub const OUTCOME: &str = "outcome.json";
/// Why one could not be finished.
pub const FAILED: &str = "failed.json";
/// How long it took, and where.
pub const TIMES: &str = "times.json";

/// How a run ended that will not be trained again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// With its last epoch.
    Finished,
    /// Before, since nothing got better on the sequences that are held out.
    OutOfPatience,
    /// A value left the finite numbers.
    Diverged,
    /// Whoever worked on it was killed, again and again, and nobody got any further.
    Killed,
}

impl Ended {
    /// As tables have it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::OutOfPatience => "out of patience",
            Self::Diverged => "diverged",
            Self::Killed => "killed",
        }
    }

    /// Whether there is a network to measure.
    #[must_use]
    pub fn is_whole(self) -> bool {
        matches!(self, Self::Finished | Self::OutOfPatience)
    }
}

/// All of `outcome.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Grows when a key changes its meaning.
    pub format: u32,
    /// How it ended.
    pub outcome: Ended,
    /// What there is to say about that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// A digest of the experiment and of what is done with the network: a run that was decided by something else is not finished.
    pub decided_by: String,
    /// Numbers by the names of [`MEASURES`](crate::measures::MEASURES); those that are not finite are left out.
    pub measures: BTreeMap<String, f64>,
}

impl Outcome {
    /// Without measures.
    #[must_use]
    pub fn new(outcome: Ended, message: Option<String>, decided_by: String) -> Self {
        Self { format: 1, outcome, message, decided_by, measures: BTreeMap::new() }
    }
}

/// Why a run could not be finished.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failed {
    /// The exit code that `scrnn train` would have ended with.
    pub code: u8,
    /// The error, with what the system said.
    pub message: String,
}

impl Failed {
    /// Of an error.
    #[must_use]
    pub fn of(failure: &Failure) -> Self {
        let mut message = failure.to_string();
        let mut cause = std::error::Error::source(failure);
        while let Some(error) = cause {
            let text = error.to_string();
            if !message.contains(&text) {
                message += &format!(": {text}");
            }
            cause = error.source();
        }
        Self { code: failure.code(), message }
    }
}

/// How long it took, and where.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Seconds of training, those of earlier processes included.
    pub training: f64,
    /// Seconds of what was done with the network.
    pub then: f64,
    /// Threads, at the end.
    pub threads: usize,
    /// Vector instructions, at the end.
    pub instruction_set: String,
}

/// Reads one of the files of the run in `folder`; none if it is not there, or is no such file.
#[must_use]
pub fn read<T: DeserializeOwned>(folder: &Path, name: &str) -> Option<T> {
    serde_json::from_slice(&std::fs::read(folder.join(name)).ok()?).ok()
}

/// Writes one of the files.
///
/// # Errors
/// [`Failure::Disk`].
pub fn write<T: Serialize>(folder: &Path, name: &str, content: &T) -> Result<()> {
    let text = serde_json::to_string_pretty(content).expect("strings and finite numbers become JSON") + "\n";
    Ok(scrnn_data::replace(&folder.join(name), text.as_bytes())?)
}

/// Removes one of the files, if it is there.
pub fn remove(folder: &Path, name: &str) {
    let _ = std::fs::remove_file(folder.join(name));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back_and_what_is_no_such_file_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let mut outcome = Outcome::new(Ended::OutOfPatience, Some("enough".into()), "0".into());
        outcome.measures.insert("nll".into(), -1.25e-7);
        write(folder.path(), OUTCOME, &outcome).unwrap();
        assert_eq!(read::<Outcome>(folder.path(), OUTCOME), Some(outcome));
        assert_eq!(read::<Failed>(folder.path(), OUTCOME), None);
        std::fs::write(folder.path().join(OUTCOME), "{").unwrap();
        assert_eq!(read::<Outcome>(folder.path(), OUTCOME), None);
    }

    #[test]
    fn a_failure_is_told_with_its_causes() {
        let error = std::io::Error::other("no space left on device");
        let failed = Failed::of(&Failure::disk("write", Path::new("a/b"), error));
        assert_eq!(failed.code, 4);
        assert!(failed.message.contains("no space left") && failed.message.contains("a/b"), "{failed:?}");
    }
}
