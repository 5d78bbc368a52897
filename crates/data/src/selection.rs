//! Which part of a file is meant, and how it is to be taken.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::format::Format;

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

impl TimeSource {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Header, Self::Publish, Self::Log, Self::Rows];

    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Publish => "publish",
            Self::Log => "log",
            Self::Rows => "rows",
        }
    }

    /// What it is, for help.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Header => "the stamp inside of a message",
            Self::Publish => "when a message was published",
            Self::Log => "when a message was logged",
            Self::Rows => "nothing: rows and messages are steps",
        }
    }
}

impl std::str::FromStr for TimeSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|time| time.word() == text);
        found.ok_or_else(|| format!("`{text}` is no clock; there are {}", Self::ALL.map(Self::word).join(", ")))
    }
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

impl Selection {
    /// Whether a missing value is an error.
    #[must_use]
    pub fn refuses_missing(&self) -> bool {
        self.missing == Missing::Refuse
    }

    /// Whether rows and messages are steps, whatever their clocks say.
    #[must_use]
    pub fn ignores_time(&self) -> bool {
        self.time == Some(TimeSource::Rows)
    }

    /// This selection, for the file at `path`; where it is silent, what a network's `learned` data were selected by, as far as
    /// it makes sense for this kind of file.
    #[must_use]
    pub fn or_as_learned(self, path: &Path, learned: Self) -> Self {
        // A folder of files, or a pattern, is what its first file is.
        let first = || crate::expand(path).ok()?.into_iter().find_map(|file| Format::of(&file).ok());
        let format = Format::of(path).ok().or_else(first);
        let knows = |option: &str| format.is_some_and(|format| format.options.contains(&option));
        let or = |own: Vec<String>, option: &str, learned: Vec<String>| {
            if own.is_empty() && knows(option) { learned } else { own }
        };
        // What tells the time in a recording is no matter of tables.
        let recording = knows("topics");
        Self {
            topics: or(self.topics, "topics", learned.topics),
            time: self.time.or(learned.time.filter(|time| recording && *time != TimeSource::Rows)),
            period: self.period.or(learned.period.filter(|_| recording)),
            channels: self.channels.or(learned.channels),
            arrays: or(self.arrays, "arrays", learned.arrays),
            axes: self.axes,
            unwrap: if self.unwrap.is_empty() { learned.unwrap } else { self.unwrap },
            missing: if self.missing == Missing::Refuse { self.missing } else { learned.missing },
        }
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
    fn what_was_learned_fills_in_where_nothing_is_said_and_the_format_knows_it() {
        let learned = Selection {
            topics: vec!["/a".into()],
            period: Some(0.5),
            time: Some(TimeSource::Log),
            arrays: vec!["qpos".into()],
            channels: Some(vec!["x".into()]),
            ..Selection::default()
        };
        let of = |path: &str, own: Selection| own.or_as_learned(Path::new(path), learned.clone());
        let bag = of("x.mcap", Selection::default());
        assert_eq!(bag, Selection { arrays: Vec::new(), ..learned.clone() });
        let table = of("x.csv", Selection { channels: Some(vec!["y".into()]), ..Selection::default() });
        assert_eq!(table, Selection { channels: Some(vec!["y".into()]), ..Selection::default() });
        assert_eq!(of("x.npz", Selection::default()).arrays, ["qpos"]);
        assert_eq!(of("x.mcap", Selection { topics: vec!["/b".into()], ..Selection::default() }).topics, ["/b"]);
        for time in TimeSource::ALL {
            assert_eq!(time.word().parse(), Ok(time));
        }
        assert!("stamp".parse::<TimeSource>().unwrap_err().contains("header, publish, log, rows"));
    }

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
