//! Things worth saying about data that were read: what was taken for a clock, left out, joined, or looks wrong.
//!
//! A remark never stops anything: what must stop is an error.

use scrnn::dataset::Dataset;
use serde::Serialize;

/// How much it matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// What the reader did.
    Note,
    /// What is probably not meant, and spoils what is learned.
    Warning,
}

/// One thing worth saying. Its `Display` is one sentence without a full stop; [`Self::help`] tells what to type.
///
/// Counts of sequences and steps begin at 1.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Remark {
    /// A column that tells the time was not taken as a channel.
    #[error("`{column}` is a clock, no channel")]
    Clock {
        /// The column.
        column: String,
    },
    /// A column that counts rows was not taken as a channel.
    #[error("`{column}` counts rows, it is no channel")]
    Counter {
        /// The column.
        column: String,
    },
    /// A column tells the sequences apart.
    #[error("`{column}` tells {sequences} sequences apart, it is no channel")]
    Label {
        /// The column.
        column: String,
        /// How many.
        sequences: usize,
    },
    /// A column that is called like a clock does not behave like one.
    #[error("`{column}` does not rise from row to row, so it is no clock; it was taken as a channel")]
    NoClock {
        /// The column.
        column: String,
    },
    /// A counter passes over numbers: rows were lost.
    #[error("`{column}` passes over {lost} numbers: rows may be lost")]
    NumbersLeftOut {
        /// The column.
        column: String,
        /// How many.
        lost: usize,
    },
    /// Words that stand still for many rows, and change at times: perhaps they tell sequences apart.
    #[error("`{column}` holds words that stand still for {runs} stretches of rows; they were taken as one sequence")]
    MayBeLabel {
        /// The column.
        column: String,
        /// How many stretches.
        runs: usize,
    },
    /// A column that holds no numbers was left out.
    #[error("`{column}` holds {what}, it is no channel")]
    LeftOut {
        /// The column, field, array or topic.
        column: String,
        /// What it holds.
        what: String,
    },
    /// Samples were brought to even times.
    #[error("resampled to {period} s from {found}")]
    Resampled {
        /// Seconds between samples now.
        period: f64,
        /// What they were.
        found: String,
    },
    /// The clock began again: a new sequence.
    #[error("`{clock}` begins again, first at row {row}: {sequences} sequences")]
    Restart {
        /// The clock.
        clock: String,
        /// The first row after a restart, from 1.
        row: usize,
        /// How many sequences there are now.
        sequences: usize,
    },
    /// Times are not even, and were not looked at because that was asked for.
    #[error("{found}; the rows were taken as even steps")]
    Uneven {
        /// What was found.
        found: String,
    },
    /// Times of logging come in bursts.
    #[error("{topic}: {messages} messages were logged in bursts of about {burst}")]
    Bursts {
        /// The topic.
        topic: String,
        /// How many messages.
        messages: usize,
        /// How many come at once.
        burst: usize,
    },
    /// A value is held for several samples: it was recorded faster than it changes.
    #[error("channel {channel} changes at every {every}th sample only: a staircase")]
    Staircase {
        /// The channel.
        channel: String,
        /// Samples for each new value.
        every: usize,
    },
    /// Which times a recording was read by.
    #[error("{topic}: by the times of {source_name}")]
    TimeSource {
        /// The topic.
        topic: String,
        /// `the header stamp`, `publishing`, `logging`.
        source_name: String,
    },
    /// Which topic, array or data set was taken though others were there.
    #[error("took {taken}; there {} also {others}", if others.contains(", ") { "are" } else { "is" })]
    Chosen {
        /// What was taken.
        taken: String,
        /// What there is besides.
        others: String,
    },
    /// Channels of a file without names were taken by their places.
    #[error("{path} names no channels; its columns were taken as {channels}, by their places")]
    ByPlace {
        /// The file.
        path: String,
        /// The names they got.
        channels: String,
    },
    /// Missing values.
    #[error("channel {channel}: {missing} of {samples} samples are missing")]
    MissingValues {
        /// The channel.
        channel: String,
        /// How many.
        missing: usize,
        /// Out of how many.
        samples: usize,
    },
    /// A channel without a single value.
    #[error("channel {channel} was never observed: all its samples are missing")]
    NeverObserved {
        /// The channel.
        channel: String,
    },
    /// Something in the text was understood that could have meant something else.
    #[error("{what}")]
    Understood {
        /// What it was and how it was taken.
        what: String,
    },
    /// Names stood there twice and were numbered.
    #[error("several columns are called `{name}`; they are now {now}")]
    NamesNumbered {
        /// The name.
        name: String,
        /// What they are called.
        now: String,
    },
    /// Something that looks wrong in the numbers.
    #[error("{suspicion}")]
    Suspicion {
        /// What it is.
        #[serde(flatten)]
        suspicion: crate::suspicions::Suspicion,
    },
}

impl Remark {
    /// What is missing in `data`, a remark for each channel of which something is.
    #[must_use]
    pub fn of_missing(data: &Dataset) -> Vec<Self> {
        let n = data.channels().len();
        let mut missing = vec![0; n];
        for sequence in data.sequences().iter().filter(|sequence| sequence.missing() > 0) {
            for (index, _) in sequence.values().iter().enumerate().filter(|(_, value)| value.is_nan()) {
                missing[index % n] += 1;
            }
        }
        Self::of_counts(data.channels(), &missing, data.total_samples())
    }

    /// The same, from how many of so many samples each channel lacks.
    pub(crate) fn of_counts(channels: &[String], missing: &[usize], samples: usize) -> Vec<Self> {
        let of = |(channel, &missing): (&String, &usize)| match missing == samples {
            true => Self::NeverObserved { channel: channel.clone() },
            false => Self::MissingValues { channel: channel.clone(), missing, samples },
        };
        channels.iter().zip(missing).filter(|(_, missing)| **missing > 0).map(of).collect()
    }

    /// How much it matters.
    #[must_use]
    pub fn level(&self) -> Level {
        match self {
            Self::Uneven { .. }
            | Self::Bursts { .. }
            | Self::Staircase { .. }
            | Self::ByPlace { .. }
            | Self::NoClock { .. }
            | Self::MayBeLabel { .. }
            | Self::NumbersLeftOut { .. }
            | Self::NeverObserved { .. }
            | Self::Suspicion { .. } => Level::Warning,
            Self::MissingValues { missing, samples, .. } if 2 * missing > *samples => Level::Warning,
            _ => Level::Note,
        }
    }

    /// What to do about it, if anything.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Clock { column } | Self::Counter { column } | Self::Label { column, .. } => {
                Some(format!("`channels = [\"{column}\", ...]` takes it as a channel"))
            }
            Self::MayBeLabel { .. } => Some("call it `sequence` if it tells sequences apart".to_owned()),
            Self::Uneven { .. } => Some("`period = SECONDS` brings them to even times".to_owned()),
            Self::Bursts { .. } => Some("`time = \"header\"` goes by the stamps in the messages".to_owned()),
            Self::Suspicion { suspicion } => suspicion.help(),
            Self::NeverObserved { .. } => Some("leave it out: `channels = [...]` names what to learn".to_owned()),
            _ => None,
        }
    }

    /// For `--json`: the fields by name, with `kind`, `level`, `message`, and `help` where there is one.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(object) = value.as_object_mut() {
            object.insert("level".into(), if self.level() == Level::Warning { "warning" } else { "note" }.into());
            object.insert("message".into(), self.to_string().into());
            if let Some(help) = self.help() {
                object.insert("help".into(), help.into());
            }
        }
        value
    }
}
