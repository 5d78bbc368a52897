//! Numpy arrays in a zip archive: `.npz`. What they are together, [`crate::arrays`] tells.
//!
//! Members that are no arrays (notes, what other systems leave) are passed over. Members must not share bytes: else a small
//! archive could unpack to anything.

use std::collections::HashSet;
use std::io::{BufReader, Cursor, Write};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use scrnn::dataset::Dataset;

use super::npy::{Contents, Length, Refused, array_bytes, file_error, parse, text_bytes};
use crate::arrays::{CHANNELS, SEQUENCES, Texts, to_samples};
use crate::excerpt::shortened;
use crate::remark::Remark;
use crate::samples::Samples;
use crate::source::{ReadSeek, Source};
use crate::{ArrayProblem, Field, FileError, Selection};

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let (path, budget) = (source.name(), source.budget());
    // Member by member; what is no file on the disk is read as a whole.
    let (reader, length): (Box<dyn ReadSeek + '_>, u64) = match source.file()? {
        Some((file, length)) => (Box::new(BufReader::new(file)), length),
        None => {
            let bytes = source.bytes()?;
            let length = bytes.len() as u64;
            (Box::new(Cursor::new(bytes)), length)
        }
    };
    let broken = |source| FileError::Archive { path: path.to_owned(), source };
    let over = |problem| FileError::OverBudget { path: path.to_owned(), problem };
    let mut archive = ZipArchive::new(reader).map_err(broken)?;
    let packed = archive.len() as u64;
    budget.take(archive.len().saturating_mul(256)).map_err(over)?;
    let (mut arrays, mut texts, mut remarks) = (Vec::new(), Vec::new(), Vec::new());
    let (mut objects, mut not_numpy) = (None, None);
    let (mut spent, mut starts) = (0_u64, HashSet::new());
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).map_err(broken)?;
        spent = spent.saturating_add(member.compressed_size());
        if spent > length || !starts.insert(member.header_start()) {
            return Err(FileError::Overlap { path: path.to_owned() });
        }
        let file_name = member.name().map_err(broken)?.into_owned();
        let hidden = file_name.starts_with("__MACOSX/")
            || file_name.rsplit('/').next().is_some_and(|last| last.starts_with("._"));
        if hidden || member.is_dir() {
            continue;
        }
        // Deflate packs to a thousandth at most.
        let most = Length::AtMost(member.compressed_size().saturating_mul(1040).saturating_add(1 << 10));
        let name = file_name.strip_suffix(".npy").unwrap_or(&file_name).to_owned();
        let place = format!("{path}, array `{}`", shortened(&file_name));
        let named = file_name.len() > name.len();
        match parse(&mut member, most, budget) {
            Ok(Contents::Arrays(parts)) if parts.len() == 1 && parts[0].name.is_empty() => {
                arrays.extend(parts.into_iter().map(|array| crate::arrays::Array { name: name.clone(), ..array }));
            }
            Ok(Contents::Arrays(parts)) => {
                budget.take(parts.len().saturating_mul(name.len() + 64)).map_err(over)?;
                arrays.extend(parts.into_iter().map(|mut array| {
                    array.name = format!("{name}.{}", array.name);
                    array
                }));
            }
            Ok(Contents::Texts(all)) => texts.push(Texts { name, texts: all }),
            Ok(Contents::Other(found)) => {
                remarks.push(Remark::LeftOut { column: name, what: format!("elements of type {found}") });
                objects.get_or_insert((place, found));
            }
            Err(Refused::Unread(error)) => return Err(broken(ZipError::Io(error))),
            Err(_) if !named => {
                remarks.push(Remark::LeftOut { column: shortened(&file_name), what: "no array".to_owned() });
                not_numpy.get_or_insert(place);
            }
            Err(refused) => return Err(file_error(path, &place, refused)),
        }
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
    let mut samples = to_samples((path, budget), arrays, &texts, selection)?;
    samples.remarks.extend(remarks);
    Ok(samples)
}

/// Most bytes of an array of names: texts are as wide as the longest.
const LONGEST_NAMES: usize = 1 << 24;

/// The bytes of an archive with one array for each sequence of each field: `sequence_000`, ..., `mean_000`, ...; and with the
/// names of sequences and channels.
///
/// The same data give the same bytes: there is no compression, and no time of day.
pub fn write(path: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    let pack = || -> Result<Vec<u8>, ZipError> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let mut member = |name: &str, bytes: &[u8]| {
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Stored)
                .last_modified_time(DateTime::default())
                .large_file(u32::try_from(bytes.len()).is_err());
            archive.start_file(format!("{name}.npy"), options)?;
            archive.write_all(bytes).map_err(ZipError::Io)
        };
        for field in fields {
            let stem = if field.name.is_empty() { "sequence" } else { field.name };
            let count = field.data.sequences().len();
            let digits = (count - 1).to_string().len().max(3);
            for (index, sequence) in field.data.sequences().iter().enumerate() {
                let shape = [sequence.len(), field.data.channels().len()];
                let bytes = array_bytes(&shape, sequence.values().iter().copied());
                member(&format!("{stem}_{index:0digits$}"), &bytes)?;
            }
        }
        for (name, texts) in names(fields) {
            member(&name, &text_bytes(&texts))?;
        }
        Ok(archive.finish()?.into_inner())
    };
    pack().map_err(|source| FileError::Archive { path: path.to_owned(), source })
}

/// Arrays of names, with what they are called.
fn names(fields: &[Field<'_>]) -> Vec<(String, Vec<String>)> {
    let Some(first) = fields.first() else { return Vec::new() };
    let sequences = first.data.sequences().iter().map(|sequence| sequence.name.clone()).collect();
    let mut all: Vec<(String, Vec<String>)> = vec![(SEQUENCES.to_owned(), sequences)];
    for (index, field) in fields.iter().enumerate() {
        let channels = field.data.channels();
        let named = channels != Dataset::numbered_channels(channels.len());
        if named && all.iter().skip(1).all(|(_, others)| others != channels) {
            let own = if index == 0 { String::new() } else { format!("_{}", field.name) };
            all.push((format!("{CHANNELS}{own}"), channels.to_vec()));
        }
    }
    // Numpy drops zeros at the end of a text, and nobody is told by a name that is not there.
    let fits = |texts: &Vec<String>| {
        let longest = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0);
        longest > 0 && longest.saturating_mul(4).saturating_mul(texts.len()) <= LONGEST_NAMES
    };
    all.retain(|(_, texts)| fits(texts));
    all
}
