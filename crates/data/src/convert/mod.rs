//! Data as files of any format that can be written.
//!
//! | name | what is written |
//! |---|---|
//! | `.csv`, `.tsv`, `.txt`, `.dat`, `.npy`, `.npz` | as everywhere else |
//! | `.mcap` | a recording: `foxglove.JointStates` on `/joint_states` |
//! | a name without an extension | the folder of a LeRobot data set, version 3.0 |
//! | `.parquet` | the frames of such a data set alone |

use std::path::{Path, PathBuf};

use scrnn::dataset::Dataset;

use crate::format::Format;
use crate::{Field, FileError, lerobot, replace};

mod mcap;

/// What the samples do not say themselves.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Conversion<'a> {
    /// Seconds between samples. Recordings and LeRobot data sets need them.
    pub period: Option<f64>,
    /// What LeRobot calls the task: a sentence about what is done.
    pub task: Option<&'a str>,
}

/// The files that hold the data, to be written to `path`: their paths and bytes. Writes nothing.
///
/// # Errors
/// [`FileError::NoPeriod`], [`FileError::OnlyRead`], and what [`crate::write`] says.
pub fn convert(path: &Path, data: &Dataset, about: &Conversion<'_>) -> Result<Vec<(PathBuf, Vec<u8>)>, FileError> {
    let name = path.display().to_string();
    let one = |bytes| Ok(vec![(path.to_owned(), bytes)]);
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    let task = about.task.unwrap_or("move");
    match extension.as_deref() {
        None => {
            let files = lerobot::write::files(&name, data, about.period, task)?;
            Ok(files.into_iter().map(|(place, bytes)| (path.join(place), bytes)).collect())
        }
        Some("parquet") => {
            let files = lerobot::write::files(&name, data, about.period, task)?;
            let mut frames = files.into_iter().filter(|(place, _)| place.starts_with("data/"));
            match (frames.next(), frames.next()) {
                (Some((_, bytes)), None) => one(bytes),
                // More than fits into one file of theirs.
                _ => Err(FileError::OnlyRead { path: name }),
            }
        }
        Some("mcap") => one(mcap::recording(&name, data, about.period)?),
        Some(_) => match Format::of(path)?.write {
            Some(write) => one(write(&name, &[Field { name: "", data }])?),
            None => Err(FileError::OnlyRead { path: name }),
        },
    }
}

/// Writes the files of [`convert`], each as a whole or not at all, and makes the folders that they need.
///
/// # Errors
/// Those of [`convert`], and [`FileError::Disk`].
pub fn write_converted(path: &Path, data: &Dataset, about: &Conversion<'_>) -> Result<Vec<PathBuf>, FileError> {
    let files = convert(path, data, about)?;
    let mut written = Vec::with_capacity(files.len());
    for (file, bytes) in files {
        if let Some(folder) = file.parent().filter(|folder| *folder != Path::new("")) {
            std::fs::create_dir_all(folder).map_err(|source| FileError::disk("make the folder of", &file, source))?;
        }
        replace(&file, &bytes)?;
        written.push(file);
    }
    Ok(written)
}

#[cfg(test)]
mod tests;
