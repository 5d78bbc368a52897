//! A page of a table's tree, the rows on it, and a row's values.

use super::{Problem, damaged};

/// A value of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value<'r> {
    /// None.
    Null,
    /// A whole number.
    Whole(i64),
    /// A number.
    Number(f64),
    /// Text in UTF-8.
    Text(&'r [u8]),
    /// Bytes.
    Bytes(&'r [u8]),
}

/// What is on a page.
pub struct Cells<'p> {
    page: &'p [u8],
    /// Where its header begins: behind the file's header on the first page.
    at: usize,
    inner: bool,
    count: usize,
}

/// A row as it stands on a page.
pub struct Cell<'p> {
    /// Its number.
    pub number: i64,
    /// Bytes of all its values.
    pub size: u64,
    /// Those that stand here.
    pub here: &'p [u8],
    /// The page where the others are.
    pub overflow: u32,
}

impl<'p> Cells<'p> {
    pub fn of(page: &'p [u8], number: u32) -> Result<Self, Problem> {
        let at = if number == 1 { 100 } else { 0 };
        let inner = match page.get(at) {
            Some(5) => true,
            Some(13) => false,
            _ => return Err(damaged("a page is none of a table's tree")),
        };
        let count = short(page, at + 3).ok_or_else(|| damaged("a page without a header"))?;
        Ok(Self { page, at, inner, count: usize::from(count) })
    }

    /// Whether it leads to other pages.
    pub fn is_inner(&self) -> bool {
        self.inner
    }

    /// Where the cell of an index begins.
    fn cell(&self, index: usize) -> Option<usize> {
        let header = if self.inner { 12 } else { 8 };
        short(self.page, self.at + header + 2 * index).map(usize::from)
    }

    /// The pages to which an inner one leads, in order.
    pub fn children(&self) -> impl Iterator<Item = Result<u32, Problem>> + '_ {
        let left = (0..self.count).map(|index| self.cell(index).and_then(|at| long(self.page, at)));
        let right = std::iter::once_with(|| long(self.page, self.at + 8));
        left.chain(right).map(|page| page.ok_or_else(|| damaged("a page leads nowhere")))
    }

    /// The rows on a leaf.
    pub fn rows(&self, usable: u32) -> impl Iterator<Item = Result<Cell<'p>, Problem>> + '_ {
        (0..self.count)
            .map(move |index| self.row(index, usable).ok_or_else(|| damaged("a row does not fit on its page")))
    }

    fn row(&self, index: usize, usable: u32) -> Option<Cell<'p>> {
        let mut rest = self.page.get(self.cell(index)?..)?;
        let size = varint(&mut rest)?;
        let number = varint(&mut rest)? as i64;
        let size = u64::try_from(size as i64).ok()?;
        // What stands here of a row that does not fit, by the file format's rules.
        let (usable, most) = (u64::from(usable), u64::from(usable) - 35);
        if size <= most {
            return Some(Cell { number, size, here: rest.get(..size as usize)?, overflow: 0 });
        }
        let least = (usable - 12) * 32 / 255 - 23;
        let wanted = least + (size - least) % (usable - 4);
        let here = if wanted <= most { wanted } else { least } as usize;
        Some(Cell { number, size, here: rest.get(..here)?, overflow: long(rest, here)? })
    }
}

/// The values of a row.
pub fn values(row: &[u8]) -> Option<Vec<Value<'_>>> {
    let mut header = row;
    let length = usize::try_from(varint(&mut header)?).ok()?;
    let body = row.get(length..)?;
    let mut types = row.get(row.len() - header.len()..length)?;
    let (mut values, mut at) = (Vec::new(), 0_usize);
    while !types.is_empty() {
        if values.len() > super::MOST {
            return None;
        }
        let kind = varint(&mut types)?;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((kind - 12) / 2).ok()?,
        };
        let bytes = body.get(at..at.checked_add(size)?)?;
        at += size;
        values.push(match kind {
            0 => Value::Null,
            8 => Value::Whole(0),
            9 => Value::Whole(1),
            7 => Value::Number(f64::from_bits(whole(bytes) as u64)),
            1..=6 => Value::Whole(whole(bytes)),
            kind if kind % 2 == 0 => Value::Bytes(bytes),
            _ => Value::Text(bytes),
        });
    }
    Some(values)
}

/// Up to eight bytes with a sign.
fn whole(bytes: &[u8]) -> i64 {
    let start = if bytes.first().is_some_and(|first| first & 0x80 != 0) { -1 } else { 0 };
    bytes.iter().fold(start, |value, &byte| (value << 8) | i64::from(byte))
}

/// A number of one to nine bytes, the greatest first.
fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for index in 0..9 {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        if index == 8 {
            return Some(value << 8 | u64::from(byte));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn short(page: &[u8], at: usize) -> Option<u16> {
    page.get(at..at + 2)?.try_into().ok().map(u16::from_be_bytes)
}

fn long(page: &[u8], at: usize) -> Option<u32> {
    page.get(at..at + 4)?.try_into().ok().map(u32::from_be_bytes)
}
