//! Data sets: arrays of numbers, whole or in chunks.

use super::chunks::{Chunk, Grid, Index, index};
use super::file::{File, damaged};
use super::filters::{self, Filter};
use super::kind::{self, Kind};
use super::object::{Object, kind as message};
use crate::front::Front;
use crate::problem::FormatProblem;

/// Axes that an array may have.
const MOST_AXES: usize = 32;

/// A data set's type and shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// The type of its elements.
    pub kind: Kind,
    /// Its lengths. None for a data set without elements; empty for a single one.
    pub shape: Option<Vec<usize>>,
    most: Vec<Option<u64>>,
}

impl Description {
    /// Reads the description of an object; None if it is no data set.
    pub fn of<'a>(file: &File<'a>, object: &Object<'a>) -> Result<Option<Self>, FormatProblem> {
        let (Some(kind), Some(space)) =
            (object.message(file, message::DATATYPE)?, object.message(file, message::DATASPACE)?)
        else {
            return Ok(None);
        };
        if !object.has(message::LAYOUT) {
            return Ok(None);
        }
        let (shape, most) = space_of(file, space)?;
        Ok(Some(Self { kind: Kind::read(kind)?, shape, most }))
    }

    /// How many elements there are.
    pub fn count(&self) -> Result<usize, FormatProblem> {
        let lengths = self.shape.as_deref().unwrap_or(&[0]);
        let count = lengths.iter().try_fold(1_usize, |all, &length| all.checked_mul(length));
        count.ok_or_else(|| damaged("a data set is larger than any file"))
    }
}

/// The lengths of a data space (IV.A.2.b), and those that they may grow to.
type Space = (Option<Vec<usize>>, Vec<Option<u64>>);

fn space_of(file: &File<'_>, message: &[u8]) -> Result<Space, FormatProblem> {
    let mut front = Front(message);
    let mut read = || {
        let [version, rank, flags, kind] = front.array()?;
        front.take(if version == 1 { 4 } else { 0 })?;
        if version == 2 && kind == 2 {
            return Some((None, Vec::new()));
        }
        let rank = usize::from(rank);
        if rank > MOST_AXES {
            return None;
        }
        let shape = (0..rank).map(|_| file.length(&mut front)).collect::<Option<Vec<_>>>()?;
        let unlimited = u64::MAX >> (64 - 8 * file.lengths);
        let most = if flags & 1 == 0 {
            shape.iter().map(|&length| Some(length as u64)).collect()
        } else {
            let most = (0..rank).map(|_| front.number(file.lengths));
            most.collect::<Option<Vec<_>>>()?.into_iter().map(|most| (most != unlimited).then_some(most)).collect()
        };
        Some((Some(shape), most))
    };
    read().ok_or_else(|| damaged("the shape of a data set"))
}

/// Reads all numbers of a data set, the last axis fastest.
pub fn numbers<'a>(file: &File<'a>, object: &Object<'a>, about: &Description) -> Result<Vec<f64>, FormatProblem> {
    let broken = || damaged("the layout of a data set");
    let count = about.count()?;
    if count == 0 || !about.kind.is_numeric() {
        return Ok(Vec::new());
    }
    let size = count.checked_mul(about.kind.size).ok_or_else(broken)?;
    if object.has(message::EXTERNAL) {
        return Err(FormatProblem::NotRead {
            found: "the numbers stand in another file".to_owned(),
            help: "`h5repack OLD NEW` brings all into one".to_owned(),
        });
    }
    let layout = object.message(file, message::LAYOUT)?.ok_or_else(broken)?;
    let mut front = Front(layout);
    let (version, class) = front.u8().zip(front.u8()).ok_or_else(broken)?;
    if !(3..=5).contains(&version) {
        return Err(FormatProblem::NotRead {
            found: "the layout of a data set is of a version before 2005 or of the future".to_owned(),
            help: "`h5repack OLD NEW` writes it in today's".to_owned(),
        });
    }
    match class {
        0 => {
            let length = front.u16().ok_or_else(broken)?;
            let data = front.take(length.into()).and_then(|data| data.get(..size)).ok_or_else(broken)?;
            let mut out = file.budget.vec(count)?;
            about.kind.numbers(data, |number| out.push(number));
            Ok(out)
        }
        1 => match file.address(&mut front).ok_or_else(broken)? {
            Some(address) => stretch(file, about.kind, count, address, size),
            None => filled(file, object, about, count),
        },
        2 => chunked(file, object, about, count, version, front),
        _ => Err(FormatProblem::NotRead {
            found: "the data set is put together from others (virtual)".to_owned(),
            help: "`h5repack OLD NEW`, or read the files that it is made of".to_owned(),
        }),
    }
}

/// Bytes that are read at a time of numbers that stand in one stretch.
const PIECE: usize = 1 << 20;

/// Numbers that stand in one stretch of `size` bytes.
fn stretch(file: &File<'_>, kind: Kind, count: usize, address: u64, size: usize) -> Result<Vec<f64>, FormatProblem> {
    file.check(address, size)?;
    let mut out = file.budget.vec(count)?;
    let piece = (PIECE - PIECE % kind.size).max(kind.size);
    let mut done = 0;
    while done < size {
        let bytes = file.passing(address.saturating_add(done as u64), piece.min(size - done))?;
        kind.numbers(&bytes, |number| out.push(number));
        done += bytes.len();
    }
    Ok(out)
}

/// The value that stands where nothing was written, everywhere.
fn filled<'a>(
    file: &File<'a>,
    object: &Object<'a>,
    about: &Description,
    count: usize,
) -> Result<Vec<f64>, FormatProblem> {
    let mut fill = 0.0;
    if let Some(value) = fill_value(file, object)? {
        about.kind.numbers(value.get(..about.kind.size).unwrap_or_default(), |number| fill = number);
    }
    file.budget.take_values::<f64>(count)?;
    Ok(vec![fill; count])
}

fn fill_value<'a>(file: &File<'a>, object: &Object<'a>) -> Result<Option<&'a [u8]>, FormatProblem> {
    let sized = |mut front: Front<'a>| front.u32().and_then(|size| front.take(size as usize));
    if let Some(message) = object.message(file, message::FILL)? {
        return Ok(match *message {
            [1, _, _, _, ref rest @ ..] | [2, _, _, 1, ref rest @ ..] => sized(Front(rest)),
            [3, flags, ref rest @ ..] if flags & 0x20 != 0 => sized(Front(rest)),
            _ => None,
        });
    }
    Ok(object.message(file, message::OLD_FILL)?.and_then(|message| sized(Front(message))))
}

fn chunked<'a>(
    file: &File<'a>,
    object: &Object<'a>,
    about: &Description,
    count: usize,
    version: u8,
    mut front: Front<'_>,
) -> Result<Vec<f64>, FormatProblem> {
    let broken = || damaged("the layout of a data set");
    let shape = about.shape.clone().ok_or_else(broken)?;
    let rank = shape.len();
    let flags = if version == 3 { 0 } else { front.u8().ok_or_else(broken)? };
    if front.u8().map(usize::from) != Some(rank + 1) || rank == 0 {
        return Err(broken());
    }
    let (index, chunk) = if version == 3 {
        let address = file.address(&mut front).ok_or_else(broken)?;
        (address.map(|address| Index::Tree { address }), lengths(&mut front, rank, 4).ok_or_else(broken)?)
    } else {
        let width = front.u8().ok_or_else(broken)?;
        let chunk = lengths(&mut front, rank, width.into()).ok_or_else(broken)?;
        front.take(width.into()).ok_or_else(broken)?;
        let kind = front.u8().ok_or_else(broken)?;
        (index(file, &mut front, kind, flags)?, chunk)
    };
    let size = chunk.iter().try_fold(about.kind.size, |all, &length| all.checked_mul(length)).filter(|&size| size > 0);
    let grid = Grid { shape, most: about.most.clone(), chunk, size: size.ok_or_else(broken)? };
    let filters = match object.message(file, message::FILTERS)? {
        Some(message) => filters::read(message, about.kind.size)?,
        None => Vec::new(),
    };
    let mut out = filled(file, object, about, count)?;
    // Chunks at the edge that reach beyond may be left as they are (a flag of the layout).
    let plain_edges = version > 3 && flags & 1 != 0;
    if let Some(index) = index {
        grid.each(file, index, &mut |chunk| {
            let at_edge = chunk
                .origin
                .iter()
                .zip(&grid.chunk)
                .zip(&grid.shape)
                .any(|((a, b), length)| a.saturating_add(*b) > *length);
            let filters: &[Filter] = if plain_edges && at_edge { &[] } else { &filters };
            place(file, &grid, about.kind, filters, &chunk, &mut out)
        })?;
    }
    Ok(out)
}

fn lengths(front: &mut Front<'_>, rank: usize, width: usize) -> Option<Vec<usize>> {
    (0..rank).map(|_| usize::try_from(front.number(width)?).ok().filter(|&length| length > 0)).collect()
}

/// Puts the numbers of a chunk where they belong.
fn place(
    file: &File<'_>,
    grid: &Grid,
    kind: Kind,
    filters: &[Filter],
    chunk: &Chunk<'_>,
    out: &mut [f64],
) -> Result<(), FormatProblem> {
    let before = file.budget.left();
    let packed = file.passing(chunk.address, chunk.packed)?;
    let data = filters::undo(file, filters, chunk.mask, &packed, grid.size)?;
    let rank = grid.shape.len();
    if chunk.origin.iter().zip(&grid.shape).any(|(begin, length)| begin >= length) {
        return Ok(());
    }
    // What of the chunk lies within the whole.
    let inside: Vec<usize> =
        (0..rank).map(|axis| grid.chunk[axis].min(grid.shape[axis] - chunk.origin[axis])).collect();
    let (last, rows) = (inside[rank - 1], inside[..rank - 1].iter().product::<usize>());
    let mut at = vec![0; rank - 1];
    for _ in 0..rows {
        let (mut from, mut to) = (0, 0);
        for (axis, place) in at.iter().enumerate() {
            from = (from + place) * grid.chunk[axis + 1];
            to = (to + chunk.origin[axis] + place) * grid.shape[axis + 1];
        }
        to += chunk.origin[rank - 1];
        let row = &data[from * kind.size..(from + last) * kind.size];
        let mut target = out[to..to + last].iter_mut();
        kind.numbers(row, |number| {
            if let Some(target) = target.next() {
                *target = number;
            }
        });
        for axis in (0..rank - 1).rev() {
            at[axis] += 1;
            if at[axis] < inside[axis] {
                break;
            }
            at[axis] = 0;
        }
    }
    // The unpacked bytes are gone; the visit itself stays paid.
    file.budget.give_back(usize::try_from(before - file.budget.left()).unwrap_or(0).saturating_sub(32));
    Ok(())
}

/// The value of an attribute: a number, or text.
#[derive(Debug, Clone, PartialEq)]
pub enum Attribute {
    Number(f64),
    Text(String),
}

/// The attribute of a name, if it is a single number or a text, and stands in the header.
pub fn attribute<'a>(file: &File<'a>, object: &Object<'a>, wanted: &str) -> Option<Attribute> {
    object.messages(message::ATTRIBUTE).find_map(|message| {
        let mut front = Front(message);
        let [version, flags] = front.array()?;
        let sizes = [front.u16()?, front.u16()?, front.u16()?].map(usize::from);
        front.take(if version == 3 { 1 } else { 0 })?;
        let padded = |size: usize| if version == 1 { size.next_multiple_of(8) } else { size };
        let [name, kind, space] = sizes.map(|size| front.take(padded(size)).and_then(|part| part.get(..size)));
        let name = name?.split(|&byte| byte == 0).next()?;
        if name != wanted.as_bytes() {
            return None;
        }
        let shared = version > 1 && flags & 1 != 0;
        let kind = if shared { super::object::shared(file, kind?, message::DATATYPE).ok()? } else { kind? };
        let kind = Kind::read(kind).ok()?;
        let (shape, _) = space_of(file, space?).ok()?;
        if shape?.iter().any(|&length| length != 1) {
            return None;
        }
        if kind.is_numeric() {
            let mut number = None;
            kind.numbers(front.0.get(..kind.size)?, |found| number = Some(found));
            return number.map(Attribute::Number);
        }
        kind::text(file, kind, front.0).map(Attribute::Text)
    })
}
