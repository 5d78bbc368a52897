//! What comes of reading: the data, and what is known of them.

use scrnn::dataset::Dataset;
use serde::Serialize;

use crate::remark::Remark;

/// Data that were read, and what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The sequences.
    pub data: Dataset,
    /// Seconds between two samples, where that is known.
    pub period: Option<f64>,
    /// What is worth saying.
    pub remarks: Vec<Remark>,
    /// What `inspect` shows besides.
    pub facts: Facts,
}

/// What is known of a file besides its samples.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Facts {
    /// What kind of file it is, e.g. `CSV table`.
    pub format: String,
    /// The files that were read, in this order.
    pub files: Vec<String>,
    /// Whether the channels have names of their own, by which they can be matched.
    pub named: bool,
    /// The channels' units where the file tells them; as many as channels, or empty.
    pub units: Vec<Option<String>>,
    /// All channels that could be asked for, if they are more than were taken.
    pub available: Vec<String>,
    /// What told the time, e.g. the name of a column.
    pub clock: Option<String>,
    /// Where time was lost.
    pub gaps: Vec<Gap>,
    /// Topics of a recording; arrays or data sets of an archive.
    pub topics: Vec<Topic>,
}

/// An interval in which samples are missing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gap {
    /// Name of the sequence.
    pub sequence: String,
    /// Number of the sample before it, from 1.
    pub after: usize,
    /// Seconds between the samples on its sides.
    pub seconds: f64,
}

/// A topic of a recording, or an array of an archive.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// The type of its messages or elements.
    pub of: String,
    /// How its messages are encoded; empty for arrays.
    pub encoding: String,
    /// Messages, or elements along the first axis.
    pub count: usize,
    /// Messages per second, where that is known.
    pub rate: Option<f64>,
    /// Whether it was taken.
    pub taken: bool,
}
