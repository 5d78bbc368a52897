//! Data in and out, by the file's extension.
//!
//! | extension | what it holds | more |
//! |---|---|---|
//! | `.csv`, `.txt`, `.dat`, `.tsv` | lines of numbers, with or without a header | [`text`] |
//! | `.npy` | one numpy array: sequences x steps x channels, steps x channels, or steps | [`npy`] |
//! | `.npz` | one numpy array for each sequence, or a single one of three axes | [`npz`] |
//! | `.mcap` | a recording; messages of one topic are samples. Only read | [`mcap`] |
//!
//! Sequences may differ in length everywhere but in `.npy`. A number is written so that reading it gives the same bits.
//! The program counts sequences and steps from 1, as the thesis does.

use std::path::Path;

use scrnn::dataset::{Dataset, Sequence};

mod error;
mod excerpt;
mod fields;
mod mcap;
mod npy;
mod npz;
mod replace;
mod text;
mod text_out;

pub use error::{ArrayProblem, FileError, LineError, LineProblem, RecordingProblem, disk_help};
pub use replace::{HALF_WRITTEN, replace};

/// Something known of each sample, to be written beside others: the mean, the variance, the contexts, ...
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Goes before the channels' names (`mean_y1`) and the arrays' numbers (`mean_000`); nothing does if it is empty.
    pub name: &'a str,
    /// The values.
    pub data: &'a Dataset,
}

/// Which part of a file is meant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// The topic of a recording.
    pub topic: Option<String>,
    /// Seconds between samples, to which a recording's messages are brought. Positive and finite.
    pub period: Option<f64>,
    /// Names of the channels to take, in this order. Default: all there are.
    pub channels: Option<Vec<String>>,
}

impl Selection {
    /// The period, to the nanosecond.
    fn period_in_nanoseconds(&self) -> Option<u64> {
        self.period.map(|period| ((period * 1e9).round() as u64).max(1))
    }

    /// The wanted channels of a file that was read as a whole.
    fn of(&self, path: &str, data: Dataset) -> Result<Dataset, FileError> {
        let Some(wanted) = &self.channels else { return Ok(data) };
        let columns = wanted.iter().map(|name| {
            data.channels().iter().position(|channel| channel == name).ok_or_else(|| FileError::NoSuchChannel {
                path: path.to_owned(),
                found: name.clone(),
                channels: data.channels().join(", "),
            })
        });
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let part = |sequence: &Sequence| {
            let rows = sequence.values().chunks_exact(data.channels().len());
            let values = rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect();
            (sequence.name.clone(), values)
        };
        collect(path, wanted.clone(), data.sequences().iter().map(part).collect())
    }
}

/// How a file is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Text,
    Tsv,
    Npy,
    Npz,
    Mcap,
}

impl Format {
    fn of(path: &Path) -> Result<Self, FileError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("txt" | "dat") => Ok(Self::Text),
            Some("tsv") => Ok(Self::Tsv),
            Some("npy") => Ok(Self::Npy),
            Some("npz") => Ok(Self::Npz),
            Some("mcap") => Ok(Self::Mcap),
            _ => Err(FileError::Extension { path: path.display().to_string() }),
        }
    }

    /// Reads what stands in a file called `path`.
    fn parse(self, path: &str, bytes: &[u8], selection: &Selection) -> Result<Dataset, FileError> {
        if self != Self::Mcap && (selection.topic.is_some() || selection.period.is_some()) {
            let option = if selection.topic.is_some() { "topic" } else { "period" };
            return Err(FileError::NotARecording { path: path.to_owned(), option });
        }
        let data = match self {
            Self::Csv | Self::Text => text::read(path, bytes, text::DetectionOrder::CommaFirst)?,
            Self::Tsv => text::read(path, bytes, text::DetectionOrder::TabFirst)?,
            Self::Npy => npy::read(path, bytes)?,
            Self::Npz => npz::read(path, bytes)?,
            Self::Mcap => return mcap::read(path, bytes, selection),
        };
        selection.of(path, data)
    }
}

/// Reads a data set.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn read(path: &Path) -> Result<Dataset, FileError> {
    read_part(path, &Selection::default())
}

/// Reads the part of a data set that is meant.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn read_part(path: &Path, selection: &Selection) -> Result<Dataset, FileError> {
    // The name is judged first: the mistake may be in it.
    Format::of(path)?;
    let bytes = std::fs::read(path).map_err(|source| FileError::disk("read", path, source))?;
    parse_as(path, &bytes, selection)
}

/// Reads the part of a data set that is meant, from the bytes of the file called `path`.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn parse_as(path: &Path, bytes: &[u8], selection: &Selection) -> Result<Dataset, FileError> {
    Format::of(path)?.parse(&path.display().to_string(), bytes, selection)
}

/// Writes the fields side by side, as a whole or not at all. All need the same number of sequences, of the same lengths.
///
/// # Errors
/// [`FileError::Extension`], [`FileError::Disk`], [`FileError::FieldsDiffer`]; for `.npy`, which holds one array,
/// [`FileError::SeveralFields`] and [`FileError::Ragged`].
pub fn write(path: &Path, fields: &[Field<'_>]) -> Result<(), FileError> {
    let format = Format::of(path)?;
    let name = path.display().to_string();
    let Some(first) = fields.first() else {
        return Err(FileError::Empty { path: name });
    };
    let lengths = |field: &Field<'_>| field.data.sequences().iter().map(Sequence::len).collect::<Vec<_>>();
    if let Some(other) = fields[1..].iter().find(|other| lengths(other) != lengths(first)) {
        return Err(FileError::FieldsDiffer { path: name, first: first.name.into(), other: other.name.into() });
    }
    let bytes = match format {
        Format::Csv => csv(fields).into_bytes(),
        Format::Tsv => text_out::csv(fields, '\t').into_bytes(),
        Format::Text => text_out::blocks(fields).into_bytes(),
        Format::Npy => npy::write(&name, fields)?,
        Format::Npz => npz::write(&name, fields)?,
        Format::Mcap => return Err(FileError::OnlyRead { path: name }),
    };
    replace(path, &bytes)
}

/// The fields as a table with commas and a header, for the standard output.
pub fn csv(fields: &[Field<'_>]) -> String {
    text_out::csv(fields, ',')
}

/// Collects sequences of numbered channels, and names the place of a value that is not finite.
fn numbered(path: &str, channels: usize, sequences: Vec<(String, Vec<f64>)>) -> Result<Dataset, FileError> {
    let names = Dataset::numbered_channels(channels);
    for (name, values) in &sequences {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(FileError::NotFinite {
                path: path.to_owned(),
                sequence: name.clone(),
                sample: index / channels + 1,
                channel: names[index % channels].clone(),
                value: values[index],
            });
        }
    }
    collect(path, names, sequences)
}

/// Makes a data set of values that were checked.
fn collect(path: &str, channels: Vec<String>, sequences: Vec<(String, Vec<f64>)>) -> Result<Dataset, FileError> {
    let rows = sequences.into_iter().map(|(name, values)| Sequence::new(name, channels.len(), values));
    let set = rows.collect::<Result<Vec<_>, _>>().and_then(|rows| Dataset::new(channels.clone(), rows));
    set.map_err(|source| FileError::Data { path: path.to_owned(), source })
}

#[cfg(test)]
mod memory_tests;
#[cfg(test)]
mod tests;
