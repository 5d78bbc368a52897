//! Numpy arrays in a zip archive: `.npz`.
//!
//! Each array is a sequence: steps x channels, or the steps of one channel. A single array of three axes holds all
//! sequences instead. Sequences are in the order of the archive and have the arrays' names.

use std::io::{Cursor, Read, Write};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::npy::{Array, array_bytes, file_error, parse};
use crate::format::Source;
use crate::samples::Samples;
use crate::{ArrayProblem, Field, FileError, Selection};

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, _: &Selection) -> Result<Samples, FileError> {
    let (path, bytes) = (source.name(), source.bytes()?);
    let broken = |source| FileError::Archive { path: path.to_owned(), source };
    let mut archive = ZipArchive::new(Cursor::new(&*bytes)).map_err(broken)?;
    let alone = archive.len() == 1;
    let mut channels = None;
    let mut sequences = Vec::new();
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).map_err(broken)?;
        let file_name = member.name().map_err(broken)?.into_owned();
        let place = format!("{path}, array `{}`", super::excerpt::shortened(&file_name));
        let wrong = |problem| file_error(&place, problem);
        let mut contents = Vec::new();
        member.read_to_end(&mut contents).map_err(|error| broken(ZipError::Io(error)))?;
        let Array { axes, shape: [_, steps, found], values } = parse(&contents).map_err(wrong)?;
        let needed = *channels.get_or_insert(found);
        if found != needed {
            return Err(wrong(ArrayProblem::Channels { found, needed }));
        }
        let name = file_name.strip_suffix(".npy").unwrap_or(&file_name);
        match axes {
            3 if alone => {
                let all = values.chunks_exact(steps * found).map(<[f64]>::to_vec);
                sequences.extend(all.enumerate().map(|(s, values)| ((s + 1).to_string(), values)));
            }
            3 => {
                let found = "of three axes beside other arrays".to_owned();
                return Err(wrong(ArrayProblem::Shape { found, needed: "steps x channels for each sequence" }));
            }
            _ => sequences.push((name.to_owned(), values)),
        }
    }
    match channels {
        Some(channels) => Ok(Samples::numbered(channels, sequences)),
        None => Err(FileError::Empty { path: path.to_owned() }),
    }
}

/// The bytes of an archive with one array for each sequence of each field: `sequence_000`, ..., `mean_000`, ...
///
/// The same data give the same bytes: there is no compression, and no time of day.
pub fn write(path: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    let pack = || -> Result<Vec<u8>, ZipError> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for field in fields {
            let stem = if field.name.is_empty() { "sequence" } else { field.name };
            let count = field.data.sequences().len();
            let digits = (count - 1).to_string().len().max(3);
            for (index, sequence) in field.data.sequences().iter().enumerate() {
                let shape = [sequence.len(), field.data.channels().len()];
                let bytes = array_bytes(&shape, sequence.values().iter().copied());
                let options = SimpleFileOptions::default()
                    .compression_method(CompressionMethod::Stored)
                    .last_modified_time(DateTime::default())
                    .large_file(u32::try_from(bytes.len()).is_err());
                archive.start_file(format!("{stem}_{index:0digits$}.npy"), options)?;
                archive.write_all(&bytes)?;
            }
        }
        Ok(archive.finish()?.into_inner())
    };
    pack().map_err(|source| FileError::Archive { path: path.to_owned(), source })
}
