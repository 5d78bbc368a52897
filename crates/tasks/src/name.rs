//! The tasks by their names.

use std::fmt;
use std::str::FromStr;

use scrnn_sim::error::{Error, Result};
use scrnn_sim::reach::tutor::Tutoring;

use crate::{Task, interact, limit_cycle, lissajous, patterns, sinusoid};

/// The tasks of the thesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
pub enum TaskName {
    /// Twelve Lissajous curves, each with noise of its own variance (3.1-3.3, C.1-C.12)
    Lissajous,
    /// The Lissajous curves in twelve variants each, 144 patterns in all (6.2.3)
    Patterns,
    /// One sine wave with noise whose variance changes over time (3.6, 3.7)
    Sinusoid,
    /// A random dynamical system with noise whose variance depends on its state (3.8-3.12)
    LimitCycle,
    /// NAO's head and arm, as a tutor teaches it to touch a sphere, in simulation (thesis 4.2)
    Reach,
    /// Two robots in a simulated world: one moves an object left and right, the other follows (thesis 5.2)
    Interact,
}

impl TaskName {
    /// All of them, in the order of the thesis.
    pub const ALL: [Self; 6] =
        [Self::Lissajous, Self::Patterns, Self::Sinusoid, Self::LimitCycle, Self::Reach, Self::Interact];

    /// As it is written in experiment files and on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Lissajous => "lissajous",
            Self::Patterns => "patterns",
            Self::Sinusoid => "sinusoid",
            Self::LimitCycle => "limit-cycle",
            Self::Reach => "reach",
            Self::Interact => "interact",
        }
    }

    /// What it is, in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Lissajous => "Twelve Lissajous curves, each with noise of its own variance (3.1-3.3, C.1-C.12)",
            Self::Patterns => "The Lissajous curves in twelve variants each, 144 patterns in all (6.2.3)",
            Self::Sinusoid => "One sine wave with noise whose variance changes over time (3.6, 3.7)",
            Self::LimitCycle => "A random dynamical system with noise whose variance depends on its state (3.8-3.12)",
            Self::Reach => "NAO's head and arm, as a tutor teaches it to touch a sphere, in simulation (thesis 4.2)",
            Self::Interact => "Two robots in a simulated world: one moves an object, the other follows (thesis 5.2)",
        }
    }

    /// Whether a simulated robot makes the data.
    #[must_use]
    pub fn has_robot(self) -> bool {
        matches!(self, Self::Reach | Self::Interact)
    }

    /// Number of sequences and of samples in each, as in the thesis.
    #[must_use]
    pub fn size(self) -> (usize, usize) {
        match self {
            Self::Lissajous => {
                let lissajous::Options { sequences, steps } = lissajous::Options::default();
                (sequences, steps)
            }
            Self::Patterns => {
                let patterns::Options { sequences, steps } = patterns::Options::default();
                (sequences, steps)
            }
            Self::Sinusoid => {
                let sinusoid::Options { sequences, steps } = sinusoid::Options::default();
                (sequences, steps)
            }
            Self::LimitCycle => {
                let limit_cycle::Options { sequences, steps } = limit_cycle::Options::default();
                (sequences, steps)
            }
            Self::Interact => interact::size(),
            Self::Reach => {
                let Tutoring { sequences, samples, .. } = Tutoring::default();
                (sequences, samples)
            }
        }
    }
}

impl fmt::Display for TaskName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for TaskName {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        Self::ALL.into_iter().find(|name| name.word() == text).ok_or_else(|| {
            let words = Self::ALL.map(Self::word).join(", ");
            format!("there is no task `{text}`; there are {words}")
        })
    }
}

/// The data of a task with known truth: so many sequences of so many samples. Simulated worlds run on `threads` threads,
/// which change no bit.
///
/// # Errors
/// [`Error::Setting`] for a size that the task does not have, and for [`TaskName::Reach`], whose truth is unknown:
/// [`scrnn_sim::reach::tutor::demonstrate`] makes its demonstrations.
pub fn make(task: TaskName, (sequences, steps): (usize, usize), seed: u64, threads: usize) -> Result<Task> {
    Ok(match task {
        TaskName::Lissajous => lissajous::generate(&lissajous::Options { sequences, steps }, seed)?,
        TaskName::Patterns => patterns::generate(&patterns::Options { sequences, steps }, seed)?,
        TaskName::Sinusoid => sinusoid::generate(&sinusoid::Options { sequences, steps }, seed)?,
        TaskName::LimitCycle => limit_cycle::generate(&limit_cycle::Options { sequences, steps }, seed)?.task,
        TaskName::Reach => {
            return Err(Error::Setting {
                what: "the task",
                found: "reach, whose demonstrations have no known truth".to_owned(),
                needed: "a task of chapter 3 or 5",
            });
        }
        TaskName::Interact => interact::make((sequences, steps), seed, threads)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_is_found_by_its_word() {
        for name in TaskName::ALL {
            assert_eq!(name.word().parse(), Ok(name));
        }
        assert!("lisajous".parse::<TaskName>().unwrap_err().contains("lissajous, patterns"));
    }
}
