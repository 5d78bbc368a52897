//! Numpy arrays in a zip archive: `.npz`. What they are together, [`crate::arrays`] tells.
//!
//! Members that are no arrays (notes, what other systems leave) are passed over. Members must not share bytes: else a small
//! archive could unpack to anything.

use std::collections::HashSet;
use std::io::{Cursor, Read, Write};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::npy::{Contents, array_bytes, file_error, parse};
use crate::arrays::{Texts, to_samples};
use crate::excerpt::shortened;
use crate::remark::Remark;
use crate::samples::Samples;
use crate::source::Source;
use crate::{ArrayProblem, Field, FileError, Selection};

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let (path, bytes, budget) = (source.name(), source.bytes()?, source.budget());
    let broken = |source| FileError::Archive { path: path.to_owned(), source };
    let over = |problem| FileError::OverBudget { path: path.to_owned(), problem };
    let mut archive = ZipArchive::new(Cursor::new(&*bytes)).map_err(broken)?;
    let packed = archive.len() as u64;
    budget.take(archive.len().saturating_mul(256)).map_err(over)?;
    let (mut arrays, mut texts, mut remarks) = (Vec::new(), Vec::new(), Vec::new());
    let (mut objects, mut not_numpy) = (None, None);
    let (mut spent, mut starts) = (0_u64, HashSet::new());
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).map_err(broken)?;
        spent = spent.saturating_add(member.compressed_size());
        if spent > bytes.len() as u64 || !starts.insert(member.header_start()) {
            return Err(FileError::Overlap { path: path.to_owned() });
        }
        let file_name = member.name().map_err(broken)?.into_owned();
        let hidden = file_name.starts_with("__MACOSX/")
            || file_name.rsplit('/').next().is_some_and(|last| last.starts_with("._"));
        if hidden || member.is_dir() {
            continue;
        }
        let mut contents = Vec::new();
        // One byte more shows that there is more.
        let left = budget.left();
        member.by_ref().take(left + 1).read_to_end(&mut contents).map_err(|error| broken(ZipError::Io(error)))?;
        budget.take(contents.len()).map_err(over)?;
        let name = file_name.strip_suffix(".npy").unwrap_or(&file_name).to_owned();
        let place = format!("{path}, array `{}`", shortened(&file_name));
        let named = file_name.len() > name.len();
        match parse(&contents, budget) {
            Ok(Contents::Arrays(parts)) if parts.len() == 1 && parts[0].name.is_empty() => {
                arrays.extend(parts.into_iter().map(|array| crate::arrays::Array { name: name.clone(), ..array }));
            }
            Ok(Contents::Arrays(parts)) => arrays.extend(parts.into_iter().map(|mut array| {
                array.name = format!("{name}.{}", array.name);
                array
            })),
            Ok(Contents::Texts(all)) => texts.push(Texts { name, texts: all }),
            Ok(Contents::Other(found)) => {
                remarks.push(Remark::LeftOut { column: name, what: format!("elements of type {found}") });
                objects.get_or_insert((place, found));
            }
            Err(_) if !named => {
                remarks.push(Remark::LeftOut { column: shortened(&file_name), what: "no array".to_owned() });
                not_numpy.get_or_insert(place);
            }
            Err(refused) => return Err(file_error(path, &place, refused)),
        }
        budget.give_back(contents.len());
    }
    if arrays.is_empty() {
        return Err(match (objects, not_numpy) {
            (Some((place, found)), _) => file_error(path, &place, ArrayProblem::Type { found }.into()),
            (None, Some(place)) => file_error(path, &place, ArrayProblem::NotNumpy.into()),
            (None, None) => FileError::Empty { path: path.to_owned() },
        });
    }
    budget.take(packed.try_into().unwrap_or(usize::MAX)).map_err(over)?;
    // What stands side by side is copied.
    let count = arrays.iter().map(|array| array.values.len()).sum();
    budget.take_values::<f64>(count).map_err(over)?;
    let mut samples = to_samples(path, arrays, &texts, selection)?;
    samples.remarks.extend(remarks);
    Ok(samples)
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
