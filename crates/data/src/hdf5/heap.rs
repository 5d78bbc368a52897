//! Heaps: where names and long values are kept (III.D to III.G).

use super::file::{File, bytes_for, damaged};
use crate::front::Front;
use crate::problem::FormatProblem;

/// Indirect blocks in indirect blocks that are followed.
const DEEPEST: usize = 16;

/// The names of an old group.
pub struct Local<'a>(&'a [u8]);

impl<'a> Local<'a> {
    /// Reads the heap at an address.
    pub fn read(file: &File<'a>, address: u64) -> Result<Self, FormatProblem> {
        let mut front = file.signed(address, b"HEAP")?;
        let mut place = || {
            front.take(4)?;
            let size = file.length(&mut front)?;
            file.length(&mut front)?;
            Some((file.address(&mut front)??, size))
        };
        let (address, size) = place().ok_or_else(|| damaged("a heap of names ends early"))?;
        Ok(Self(file.bytes(address, size)?))
    }

    /// The name at an offset.
    pub fn name(&self, offset: u64) -> Option<&'a str> {
        let rest = self.0.get(usize::try_from(offset).ok()?..)?;
        let end = rest.iter().position(|&byte| byte == 0)?;
        std::str::from_utf8(&rest[..end]).ok()
    }
}

/// The object of an index in the collection of long values at an address.
pub fn global<'a>(file: &File<'a>, address: u64, index: u32) -> Result<&'a [u8], FormatProblem> {
    let broken = || damaged("a heap of long values");
    let mut front = file.signed(address, b"GCOL")?;
    front.take(4).ok_or_else(broken)?;
    let size = file.length(&mut front).ok_or_else(broken)?;
    let mut front = file.signed_front(address, b"GCOL", size)?;
    front.take(4 + file.lengths).ok_or_else(broken)?;
    let mut rest = Front(front.0.get(..size.saturating_sub(8 + file.lengths)).ok_or_else(broken)?);
    loop {
        file.budget.take(8)?;
        let found = rest.u16().ok_or_else(broken)?;
        rest.take(6).ok_or_else(broken)?;
        let size = file.length(&mut rest).ok_or_else(broken)?;
        if found == 0 {
            return Err(broken());
        }
        let object = rest.take(size).ok_or_else(broken)?;
        if u32::from(found) == index {
            return Ok(object);
        }
        rest.take((8 - size % 8) % 8).ok_or_else(broken)?;
    }
}

/// A heap of many small objects, e.g. the links of a large group (III.G).
pub struct Fractal<'f, 'a> {
    file: &'f File<'a>,
    /// Whether blocks have checksums.
    offset_size: usize,
    length_size: usize,
    width: usize,
    start: u64,
    largest: u64,
    root: u64,
    /// Rows of the root block; none if it holds objects itself.
    rows: usize,
}

impl<'f, 'a> Fractal<'f, 'a> {
    /// Reads the header at an address.
    pub fn read(file: &'f File<'a>, address: u64) -> Result<Self, FormatProblem> {
        let mut front = file.signed(address, b"FRHP")?;
        let (o, l) = (file.offsets, file.lengths);
        let mut read = || {
            front.take(1 + 2)?;
            let filters = front.u16()?;
            front.take(1)?;
            let largest_object = front.u32()?;
            // Huge objects, free space, statistics.
            front.take(l + o + l + o + 8 * l)?;
            let width = usize::from(front.u16()?);
            let (start, largest) = (front.number(l)?, front.number(l)?);
            let bits = usize::from(front.u16()?);
            front.take(2)?;
            let root = file.address(&mut front)??;
            let rows = usize::from(front.u16()?);
            let length_size = bytes_for(largest).min(bytes_for(largest_object.into()));
            let fractal = Self { file, offset_size: bits.div_ceil(8), length_size, width, start, largest, root, rows };
            Some((filters, fractal))
        };
        let (filters, fractal) = read().ok_or_else(|| damaged("a heap of links ends early"))?;
        let sizes = [fractal.start, fractal.largest];
        if filters > 0
            || fractal.width == 0
            || fractal.offset_size > 8
            || sizes.iter().any(|size| !size.is_power_of_two())
        {
            return Err(damaged("a heap of links"));
        }
        Ok(fractal)
    }

    /// The object that an identifier names.
    pub fn object(&self, id: &[u8]) -> Result<&'a [u8], FormatProblem> {
        let broken = || damaged("a heap of links");
        let mut front = Front(id);
        match front.u8().ok_or_else(broken)? {
            0 => {}
            0x10 | 0x20 => {
                return Err(FormatProblem::NotRead {
                    found: "a link of an unusual length".to_owned(),
                    help: "give its groups and data sets shorter names".to_owned(),
                });
            }
            _ => return Err(broken()),
        }
        let offset = front.number(self.offset_size).ok_or_else(broken)?;
        let length =
            front.number(self.length_size).and_then(|length| usize::try_from(length).ok()).ok_or_else(broken)?;
        if self.rows == 0 {
            return self.in_block(self.root, offset, length);
        }
        self.below(self.root, self.rows, offset, length, DEEPEST)
    }

    fn in_block(&self, address: u64, offset: u64, length: usize) -> Result<&'a [u8], FormatProblem> {
        self.file.signed(address, b"FHDB")?;
        let place = address.checked_add(offset).ok_or_else(|| damaged("a heap of links"))?;
        self.file.bytes(place, length)
    }

    /// Size of the blocks in a row of an indirect block.
    fn size(&self, row: usize) -> Option<u64> {
        u32::try_from(row.saturating_sub(1))
            .ok()
            .and_then(|power| 1_u64.checked_shl(power))
            .and_then(|times| self.start.checked_mul(times))
    }

    /// Follows an indirect block of so many rows down to the object.
    fn below(
        &self,
        address: u64,
        rows: usize,
        offset: u64,
        length: usize,
        deeper: usize,
    ) -> Result<&'a [u8], FormatProblem> {
        let broken = || damaged("a heap of links");
        let deeper = deeper.checked_sub(1).ok_or_else(broken)?;
        let pointers = rows.saturating_mul(self.width).saturating_mul(self.file.offsets);
        let mut front = self.file.signed_front(address, b"FHIB", pointers.saturating_add(32))?;
        front.take(1 + self.file.offsets + self.offset_size).ok_or_else(broken)?;
        let mut before = 0_u64;
        for row in 0..rows {
            let size = self.size(row).ok_or_else(broken)?;
            let whole = size.checked_mul(self.width as u64).ok_or_else(broken)?;
            if offset - before >= whole {
                front.take(self.width * self.file.offsets).ok_or_else(broken)?;
                before = before.checked_add(whole).ok_or_else(broken)?;
                continue;
            }
            let column = (offset - before) / size;
            front.take(column as usize * self.file.offsets).ok_or_else(broken)?;
            let block = self.file.address(&mut front).flatten().ok_or_else(broken)?;
            let inside = (offset - before) % size;
            if size <= self.largest {
                return self.in_block(block, inside, length);
            }
            // An indirect block in this place has as many rows as cover its size.
            let rows = (size / self.start / self.width as u64).checked_ilog2().ok_or_else(broken)? as usize + 1;
            return self.below(block, rows, inside, length, deeper);
        }
        Err(broken())
    }
}
