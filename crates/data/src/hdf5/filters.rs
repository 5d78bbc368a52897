//! What was done to a chunk before it was written (IV.A.2.l), undone.

use std::borrow::Cow;

use super::file::{File, damaged};
use crate::front::Front;
use crate::problem::FormatProblem;
use crate::unpack::Packing;

/// A filter, in the order of writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// zlib.
    Deflate,
    /// First all elements' first bytes, then all second bytes, and so on; bytes of an element.
    Shuffle(usize),
    /// Four bytes of a checksum at the end.
    Fletcher,
    /// LZF, as h5py has it.
    Lzf,
}

/// The filters that a message describes.
pub fn read(message: &[u8], element: usize) -> Result<Vec<Filter>, FormatProblem> {
    let broken = || damaged("the filters of a data set");
    let mut front = Front(message);
    let (version, count) = front.u8().zip(front.u8()).ok_or_else(broken)?;
    front.take(if version == 1 { 6 } else { 0 }).ok_or_else(broken)?;
    let mut filters = Vec::new();
    for _ in 0..count {
        let mut next = || {
            let id = front.u16()?;
            let name = if version == 1 || id >= 256 { usize::from(front.u16()?) } else { 0 };
            let (_, values) = (front.u16()?, usize::from(front.u16()?));
            let name = front.take(name)?;
            let padding = if version == 1 && values % 2 == 1 { 4 } else { 0 };
            let values = front.take(4 * values)?;
            front.take(padding)?;
            Some((id, name, values))
        };
        let (id, name, values) = next().ok_or_else(broken)?;
        filters.push(match id {
            1 => Filter::Deflate,
            2 => {
                let size = values.first_chunk().map_or(element, |&size| u32::from_le_bytes(size) as usize);
                Filter::Shuffle(size)
            }
            3 => Filter::Fletcher,
            32000 => Filter::Lzf,
            _ => {
                let known = match id {
                    4 => "szip",
                    5 => "n-bit",
                    6 => "scale and offset",
                    32001 => "blosc",
                    32004 => "LZ4",
                    32008 => "bitshuffle",
                    32015 => "zstd",
                    _ => "",
                };
                let name = String::from_utf8_lossy(name);
                let name = if known.is_empty() { name.trim_end_matches('\0') } else { known };
                return Err(FormatProblem::NotRead {
                    found: format!("its data are packed by filter {id} ({name})"),
                    help: "`h5repack -f GZIP=4 OLD NEW` packs it in the common way".to_owned(),
                });
            }
        });
    }
    Ok(filters)
}

/// Undoes the filters of a chunk, but for those that `mask` says were left out, to exactly `size` bytes.
pub fn undo<'a>(
    file: &File<'_>,
    filters: &[Filter],
    mask: u32,
    packed: &'a [u8],
    size: usize,
) -> Result<Cow<'a, [u8]>, FormatProblem> {
    let broken = || damaged("a chunk does not unpack to its size");
    let applied = |index: usize| index >= 32 || mask >> index & 1 == 0;
    let mut data = Cow::Borrowed(packed);
    for (index, filter) in filters.iter().enumerate().rev().filter(|(index, _)| applied(*index)) {
        // What a filter further back has added to the size.
        let checksums = filters[..index]
            .iter()
            .enumerate()
            .filter(|(index, filter)| **filter == Filter::Fletcher && applied(*index));
        let size = size.saturating_add(4 * checksums.count());
        data = match filter {
            Filter::Fletcher => {
                let length = data.len().checked_sub(4).ok_or_else(broken)?;
                match data {
                    Cow::Borrowed(data) => Cow::Borrowed(&data[..length]),
                    Cow::Owned(mut data) => {
                        data.truncate(length);
                        Cow::Owned(data)
                    }
                }
            }
            Filter::Deflate => {
                file.budget.unpack(size)?;
                Cow::Owned(Packing::Zlib.unpack(&data, size).ok_or_else(broken)?.into_owned())
            }
            Filter::Lzf => {
                file.budget.unpack(size)?;
                Cow::Owned(lzf(&data, size).ok_or_else(broken)?)
            }
            Filter::Shuffle(element) => {
                file.budget.unpack(data.len())?;
                Cow::Owned(unshuffled(&data, *element))
            }
        };
    }
    if data.len() == size { Ok(data) } else { Err(broken()) }
}

fn unshuffled(data: &[u8], element: usize) -> Vec<u8> {
    let count = data.len().checked_div(element).unwrap_or(0);
    let mut out = data.to_vec();
    for value in 0..count {
        for byte in 0..element {
            out[value * element + byte] = data[byte * count + value];
        }
    }
    out
}

/// Unpacks LZF: stretches of bytes, and copies of what came before.
fn lzf(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut front = Front(packed);
    let mut out: Vec<u8> = Vec::new();
    while let Some(control) = front.u8() {
        let control = usize::from(control);
        if control < 32 {
            out.extend(front.take(control + 1)?);
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(front.u8()?);
            }
            let distance = ((control & 0x1f) << 8 | usize::from(front.u8()?)) + 1;
            let from = out.len().checked_sub(distance)?;
            for at in from..from + length + 2 {
                out.push(out[at]);
            }
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}
