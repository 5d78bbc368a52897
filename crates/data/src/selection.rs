//! Which part of a file is meant, and how it is to be taken.

use serde::{Deserialize, Serialize};

/// Which part of a file is meant. Write `Selection { channels, ..Selection::default() }`: fields are added with time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// Topics of a recording, joined in this order. Empty: the only one that can be meant.
    pub topics: Vec<String>,
    /// Seconds between samples, to which messages and rows with a clock are brought. Positive and finite.
    pub period: Option<f64>,
    /// What tells when a sample was taken. Default: the best there is.
    pub time: Option<TimeSource>,
    /// Names of the channels to take, in this order. Default: all there are. What is named here is a channel, even if it
    /// looks like a clock or a counter.
    pub channels: Option<Vec<String>>,
    /// Arrays or data sets of a file that holds several, by name or path, in this order. Empty: the reader chooses.
    pub arrays: Vec<String>,
    /// What the axes of an array are.
    pub axes: Option<Axes>,
    /// Channels that are angles, in radians or degrees: their jumps of a whole turn are taken out.
    pub unwrap: Vec<String>,
    /// What is done about missing values.
    pub missing: Missing,
}

/// What tells when a sample was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TimeSource {
    /// The stamp inside of a message.
    Header,
    /// When a message was published.
    Publish,
    /// When a message was logged.
    Log,
    /// Nothing: rows and messages are steps, whatever their clocks say.
    Rows,
}

/// What the axes of an array are: `n` sequences, `t` steps, `c` channels, in the order of the letters, e.g. `nct`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes {
    /// Where the sequences are, if anywhere.
    pub sequences: Option<usize>,
    /// Where the steps are.
    pub steps: usize,
    /// Where the channels are, if anywhere.
    pub channels: Option<usize>,
}

impl Axes {
    /// How many there are.
    #[must_use]
    pub fn count(self) -> usize {
        1 + usize::from(self.sequences.is_some()) + usize::from(self.channels.is_some())
    }
}

impl std::str::FromStr for Axes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = || {
            format!(
                "`{text}` does not tell the axes; give one letter for each, as `nct` or `tc`: `n` sequences, `t` steps, `c` channels"
            )
        };
        let place = |letter: char| text.find(letter);
        let known =
            text.chars().all(|c| "ntc".contains(c)) && ['n', 't', 'c'].iter().all(|&c| text.matches(c).count() < 2);
        match place('t') {
            Some(steps) if known => Ok(Self { sequences: place('n'), steps, channels: place('c') }),
            _ => Err(refused()),
        }
    }
}

impl std::fmt::Display for Axes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for axis in 0..self.count() {
            f.write_str(match axis {
                _ if self.sequences == Some(axis) => "n",
                _ if self.steps == axis => "t",
                _ => "c",
            })?;
        }
        Ok(())
    }
}

/// What is done about missing values: NaN, an empty cell, null.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Missing {
    /// They are passed on as missing.
    #[default]
    Accept,
    /// The file is refused.
    Refuse,
}

/// Whether a data set can hold missing values. Until it can, they are refused whatever the policy.
const KNOWN_TO_DATASETS: bool = false;

impl Selection {
    /// Whether a missing value is an error.
    #[must_use]
    pub fn refuses_missing(&self) -> bool {
        !KNOWN_TO_DATASETS || self.missing == Missing::Refuse
    }

    /// Whether rows and messages are steps, whatever their clocks say.
    #[must_use]
    pub fn ignores_time(&self) -> bool {
        self.time == Some(TimeSource::Rows)
    }

    /// The period, to the nanosecond.
    pub(crate) fn period_in_nanoseconds(&self) -> Option<u64> {
        self.period.map(|period| ((period * 1e9).round() as u64).max(1))
    }

    /// The options that are set and that not every format knows, by their names in the experiment file.
    pub(crate) fn special(&self) -> Vec<&'static str> {
        let recording_time = matches!(self.time, Some(time) if time != TimeSource::Rows);
        [
            ("topics", !self.topics.is_empty()),
            ("time", recording_time),
            ("arrays", !self.arrays.is_empty()),
            ("axes", self.axes.is_some()),
            ("period", self.period.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, set)| set.then_some(name))
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_go_by_letters() {
        let read = |text: &str| text.parse::<Axes>();
        assert_eq!(read("nct"), Ok(Axes { sequences: Some(0), steps: 2, channels: Some(1) }));
        assert_eq!(read("t"), Ok(Axes { sequences: None, steps: 0, channels: None }));
        for text in ["nct", "ntc", "tc", "ct", "t", "nt", "tn"] {
            assert_eq!(read(text).unwrap().to_string(), text);
        }
        for text in ["", "nc", "ntt", "xyz", "nctx"] {
            assert!(read(text).unwrap_err().contains("as `nct`"), "{text}");
        }
    }
}
