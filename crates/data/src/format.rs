//! The table of formats: what tells a format, who reads it, who writes it. A format is one file and one line here.

use std::path::Path;

use crate::samples::Samples;
use crate::source::Source;
use crate::{Field, FileError, Selection, bvh, hdf5, lerobot, mat, npy, npz, recording, series, table};

/// One format.
pub struct Format {
    /// Its name, for people.
    pub name: &'static str,
    /// Extensions of its files, in small letters. The first that fits decides.
    pub extensions: &'static [&'static str],
    /// Tells whether a folder is one of its data sets. Folders that no format knows are folders of files.
    pub folder: Option<fn(&Path) -> bool>,
    /// Options of a [`Selection`] that only some formats know, and this one does: of `topics`, `time`, `arrays`, `axes`,
    /// `period`.
    pub options: &'static [&'static str],
    /// Reads all there is, or what the selection wants of it: see [`Samples::channels`].
    pub read: fn(&Source<'_>, &Selection) -> Result<Samples, FileError>,
    /// Makes the bytes of a file, if it can be written. Takes the file's name for messages.
    pub write: Option<Writer>,
}

/// Makes the bytes of a file of this name.
pub type Writer = fn(&str, &[Field<'_>]) -> Result<Vec<u8>, FileError>;

/// All formats. Data sets that are folders come before the files in them are looked at.
pub const FORMATS: &[Format] = &[
    Format {
        name: "CSV table",
        extensions: &["csv"],
        folder: None,
        options: &["period"],
        read: table::read_csv,
        write: Some(table::writing::write_csv),
    },
    Format {
        name: "text table",
        extensions: &["txt", "dat", "mot", "sto"],
        folder: None,
        options: &["period"],
        read: table::read_csv,
        write: Some(table::writing::write_blocks),
    },
    Format {
        name: "TSV table",
        extensions: &["tsv"],
        folder: None,
        options: &["period"],
        read: table::read_tsv,
        write: Some(table::writing::write_tsv),
    },
    Format {
        name: "numpy array",
        extensions: &["npy"],
        folder: None,
        options: &["axes", "period"],
        read: npy::read,
        write: Some(npy::write),
    },
    Format {
        name: "numpy archive",
        extensions: &["npz"],
        folder: None,
        options: &["arrays", "axes", "period"],
        read: npz::read,
        write: Some(npz::write),
    },
    Format {
        name: "MCAP recording",
        extensions: &["mcap"],
        folder: None,
        options: &["topics", "time", "period"],
        read: recording::read,
        write: None,
    },
    Format {
        name: "ROS 2 bag",
        extensions: &["db3"],
        folder: Some(recording::is_bag),
        options: &["topics", "time", "period"],
        read: recording::read,
        write: None,
    },
    Format {
        name: "ROS 1 bag",
        extensions: &["bag"],
        folder: None,
        options: &["topics", "time", "period"],
        read: recording::refuse_ros1,
        write: None,
    },
    Format {
        name: "LeRobot data set or parquet table",
        extensions: &["parquet"],
        folder: Some(lerobot::is_folder),
        options: &["arrays", "period"],
        read: lerobot::read,
        write: None,
    },
    Format {
        name: "HDF5 file",
        extensions: &["hdf5", "h5", "he5"],
        folder: None,
        options: &["arrays", "axes", "period"],
        read: hdf5::read,
        write: None,
    },
    Format {
        name: "MATLAB file",
        extensions: &["mat"],
        folder: None,
        options: &["arrays", "axes", "period"],
        read: mat::read,
        write: None,
    },
    Format {
        name: "motion capture (BVH)",
        extensions: &["bvh"],
        folder: None,
        options: &["period"],
        read: bvh::read,
        write: None,
    },
    Format {
        name: "labelled series (.ts)",
        extensions: &["ts"],
        folder: None,
        options: &["period"],
        read: series::read,
        write: None,
    },
];

impl Format {
    /// The format of what stands at `path`.
    ///
    /// # Errors
    /// [`FileError::Extension`].
    pub fn of(path: &Path) -> Result<&'static Self, FileError> {
        let is_folder = path.is_dir();
        if is_folder && let Some(format) = FORMATS.iter().find(|format| format.folder.is_some_and(|is| is(path))) {
            return Ok(format);
        }
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        let known = extension
            .filter(|_| !is_folder)
            .and_then(|extension| FORMATS.iter().find(|format| format.extensions.contains(&extension.as_str())));
        known.ok_or_else(|| {
            crate::elsewhere::refusal(path)
                .unwrap_or_else(|| FileError::Extension { path: path.display().to_string(), known: known_extensions() })
        })
    }

    /// Whether the name of a file tells that it holds data.
    #[must_use]
    pub fn knows(path: &Path) -> bool {
        Self::of(path).is_ok()
    }

    /// Refuses options that this format does not know.
    pub(crate) fn check(&self, path: &str, selection: &Selection) -> Result<(), FileError> {
        match selection.special().into_iter().find(|option| !self.options.contains(option)) {
            None => Ok(()),
            Some(option) => {
                let knowing = FORMATS.iter().filter(|format| format.options.contains(&option));
                let extensions = knowing.flat_map(|format| format.extensions).map(|extension| format!(".{extension}"));
                let known = extensions.collect::<Vec<_>>().join(", ");
                Err(FileError::UnknownOption { path: path.to_owned(), format: self.name, option, known })
            }
        }
    }
}

/// `.csv, .txt, ... or .mcap`.
fn known_extensions() -> String {
    let all: Vec<String> =
        FORMATS.iter().flat_map(|format| format.extensions).map(|extension| format!(".{extension}")).collect();
    match all.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => all.concat(),
    }
}
