//! Sequences from files and to files.
//!
//! | extension | what it holds | more |
//! |---|---|---|
//! | `.csv`, `.txt`, `.dat`, `.tsv` | lines of numbers, with or without a header | `table` |
//! | `.npy` | one numpy array: sequences x steps x channels, steps x channels, or steps | `npy` |
//! | `.npz` | numpy arrays: sequences, or groups of channels | `npz` |
//! | `.mcap`, `.db3`, folders of bags | a recording; messages are samples. Only read | `recording` |
//! | `.parquet`, folders of LeRobot | a data set of demonstrations, or a table in columns | `lerobot` |
//! | `.hdf5`, `.h5` | demonstrations, or any data sets | `hdf5` |
//! | `.mat` | MATLAB's matrices (version 5, or 7.3, which is HDF5) | `mat` |
//! | `.bvh` | motion capture: a skeleton's angles | `bvh` |
//! | `.ts` | labelled series | `series` |
//!
//! A format is one file and one line in [`format::FORMATS`]. Each reader gets a [`source::Source`] with a
//! [`budget::Budget`] and makes [`samples::Samples`]; from there [`samples::Samples::finish`] is the one way to a
//! [`Reading`]: channels are chosen, times held to even steps or resampled, missing values refused or passed on.
//!
//! Sequences may differ in length everywhere but in `.npy`. A number is written so that reading it gives the same bits.
//! The program counts sequences and steps from 1, as the thesis does.

use std::path::Path;

use scrnn::dataset::{Dataset, Sequence};

pub mod angles;
pub mod arrays;
pub mod budget;
mod bvh;
mod convert;
mod elsewhere;
mod error;
mod excerpt;
mod files;
pub mod format;
mod front;
mod hdf5;
mod joining;
mod lerobot;
mod literal;
mod mat;
pub mod memory;
mod natural;
mod npy;
mod npz;
mod parquet;
mod problem;
mod reading;
mod recording;
mod remark;
mod replace;
pub mod samples;
mod selection;
mod series;
pub mod source;
pub mod suspicions;
mod table;
pub mod times;
mod unpack;
mod windows;

pub use convert::{Conversion, convert, write_converted};
pub use error::{ArrayProblem, ChannelsError, FileError, LineError, LineProblem, disk_help};
pub use files::expand;
pub use joining::read_all;
pub use natural::natural;
pub use problem::FormatProblem;
pub use reading::{Facts, Gap, Reading, Topic};
pub use recording::{RecordingProblem, Told, play};
pub use remark::{Level, Remark};
pub use replace::{HALF_WRITTEN, is_one_file, replace, sweep};
pub use selection::{Axes, Missing, Selection, TimeSource};
pub use source::read_bytes;
pub use table::unguarded;

use format::Format;
use source::Source;

/// Something known of each sample, to be written beside others: the mean, the variance, the contexts, ...
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Goes before the channels' names (`mean_y1`) and the arrays' numbers (`mean_000`); nothing does if it is empty.
    pub name: &'a str,
    /// The values.
    pub data: &'a Dataset,
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
    Ok(inspect(path, selection)?.data)
}

/// Reads the part of a file, or of a folder that is one data set, that is meant, with what is worth knowing of it.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn inspect(path: &Path, selection: &Selection) -> Result<Reading, FileError> {
    // The name is judged first: the mistake may be in it.
    let format = Format::of(path)?;
    read_source(format, &Source::at(path)?, selection)
}

/// Reads the part of a data set that is meant, from the bytes of the file called `path`.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn parse_as(path: &Path, bytes: &[u8], selection: &Selection) -> Result<Dataset, FileError> {
    Ok(inspect_bytes(path, bytes, selection)?.data)
}

/// As [`inspect`], from the bytes of the file called `path`.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn inspect_bytes(path: &Path, bytes: &[u8], selection: &Selection) -> Result<Reading, FileError> {
    read_source(Format::of(path)?, &Source::of_bytes(path, bytes), selection)
}

fn read_source(format: &Format, source: &Source<'_>, selection: &Selection) -> Result<Reading, FileError> {
    format.check(source.name(), selection)?;
    let mut samples = (format.read)(source, selection)?;
    if samples.facts.format.is_empty() {
        samples.facts.format = format.name.to_owned();
    }
    if samples.facts.files.is_empty() {
        samples.facts.files = vec![source.name().to_owned()];
    }
    samples.finish(source.name(), selection)
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
    let Some(write) = format.write else { return Err(FileError::OnlyRead { path: name }) };
    replace(path, &write(&name, fields)?)
}

/// The fields as a table with commas and a header, for the standard output.
pub fn csv(fields: &[Field<'_>]) -> String {
    table::writing::csv(fields, ',')
}

#[cfg(test)]
mod memory_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_random;
