//! Where the chunks of a data set are, by the six kinds of index that there are (IV.A.2.i, layouts; VII).

use super::file::{File, damaged};
use super::tree;
use crate::front::Front;
use crate::problem::FormatProblem;

/// Chunks that an array of addresses may have room for.
const MOST_CHUNKS: u64 = 1 << 60;

/// How a data set is cut into chunks.
#[derive(Debug)]
pub struct Grid {
    /// Elements of the whole along each axis, and the most that it may grow to.
    pub shape: Vec<usize>,
    pub most: Vec<Option<u64>>,
    /// Elements of a chunk along each axis.
    pub chunk: Vec<usize>,
    /// Bytes of a chunk.
    pub size: usize,
}

/// What tells where chunks are.
#[derive(Debug, Clone, Copy)]
pub enum Index {
    Tree { address: u64 },
    Single { address: u64, packed: Option<(usize, u32)> },
    Implicit { address: u64 },
    Fixed { address: u64 },
    Extensible { address: u64 },
    NewTree { address: u64 },
}

/// One chunk: where it begins along each axis, its address, its bytes in the file, and the filters that were left out.
pub struct Chunk<'c> {
    pub origin: &'c [usize],
    pub address: u64,
    pub packed: usize,
    pub mask: u32,
}

type Each<'e> = &'e mut dyn FnMut(Chunk<'_>) -> Result<(), FormatProblem>;

fn broken() -> FormatProblem {
    damaged("the index of a data set's chunks")
}

impl Grid {
    /// Calls `each` with every chunk that was written.
    pub fn each(&self, file: &File<'_>, index: Index, each: Each<'_>) -> Result<(), FormatProblem> {
        let rank = self.shape.len();
        match index {
            Index::Tree { address } => tree::old(file, address, 1, 8 + 8 * (rank + 1), &mut |key, address| {
                let mut front = Front(key);
                let (packed, mask) = front.u32().zip(front.u32()).ok_or_else(broken)?;
                let origin = (0..rank).map(|_| front.u64().and_then(|place| usize::try_from(place).ok()));
                let origin = origin.collect::<Option<Vec<_>>>().ok_or_else(broken)?;
                each(Chunk { origin: &origin, address, packed: packed as usize, mask })
            }),
            Index::NewTree { address } => tree::new(file, address, &mut |record| {
                let mut front = Front(record);
                let address = file.address(&mut front).flatten().ok_or_else(broken)?;
                let scaled = 8 * rank;
                let (packed, mask) = match record.len().checked_sub(file.offsets + scaled).ok_or_else(broken)? {
                    0 => (self.size, 0),
                    more => self.packed(&mut front, more).ok_or_else(broken)?,
                };
                let origin = self.chunk.iter().map(|&chunk| usize::try_from(front.u64()?).ok()?.checked_mul(chunk));
                let origin = origin.collect::<Option<Vec<_>>>().ok_or_else(broken)?;
                each(Chunk { origin: &origin, address, packed, mask })
            }),
            Index::Single { address, packed } => {
                let (packed, mask) = packed.unwrap_or((self.size, 0));
                each(Chunk { origin: &vec![0; rank], address, packed, mask })
            }
            Index::Implicit { address } => {
                let order = self.order(None)?;
                let count =
                    order.counts.iter().try_fold(1_u64, |all, &count| all.checked_mul(count)).ok_or_else(broken)?;
                for number in 0..count {
                    file.budget.take(8)?;
                    let address = number.checked_mul(self.size as u64).and_then(|place| address.checked_add(place));
                    let address = address.ok_or_else(broken)?;
                    self.numbered(&order, number, address, (self.size, 0), each)?;
                }
                Ok(())
            }
            Index::Fixed { address } => self.fixed(file, address, each),
            Index::Extensible { address } => self.extensible(file, address, each),
        }
    }

    /// The bytes of a packed chunk and its mask, which take `size` bytes together.
    fn packed(&self, front: &mut Front<'_>, size: usize) -> Option<(usize, u32)> {
        let packed = usize::try_from(front.number(size.checked_sub(4)?)?).ok()?;
        Some((packed, front.u32()?))
    }

    /// The order in which chunks are numbered: row by row, but with the axis that grows first of all.
    fn order(&self, grows: Option<usize>) -> Result<Order, FormatProblem> {
        let mut axes: Vec<usize> = (0..self.shape.len()).collect();
        if let Some(grows) = grows {
            axes.remove(grows);
            axes.insert(0, grows);
        }
        let count = |&axis: &usize| {
            let most = self.most[axis].unwrap_or(self.shape[axis] as u64);
            most.max(self.shape[axis] as u64).div_ceil(self.chunk[axis].max(1) as u64)
        };
        let counts: Vec<u64> = axes.iter().map(count).collect();
        if counts.contains(&0) { Err(broken()) } else { Ok(Order { axes, counts }) }
    }

    /// Calls `each` with the chunk of a number, if it lies within the whole.
    fn numbered(
        &self,
        order: &Order,
        number: u64,
        address: u64,
        (packed, mask): (usize, u32),
        each: Each<'_>,
    ) -> Result<(), FormatProblem> {
        let mut origin = vec![0; self.shape.len()];
        let mut rest = number;
        for (place, (&axis, &count)) in order.axes.iter().zip(&order.counts).enumerate().rev() {
            // The first axis may have grown beyond what the header said.
            let index = if place == 0 { rest } else { rest % count };
            rest /= count;
            let begin = usize::try_from(index).ok().and_then(|index| index.checked_mul(self.chunk[axis]));
            origin[axis] = begin.ok_or_else(broken)?;
        }
        if origin.iter().zip(&self.shape).any(|(begin, length)| begin >= length) {
            return Ok(());
        }
        each(Chunk { origin: &origin, address, packed, mask })
    }

    /// Calls `each` with the elements of an array of addresses; `first` is the number of the first chunk.
    fn entries(
        &self,
        file: &File<'_>,
        entries: &[u8],
        entry: usize,
        order: &Order,
        first: u64,
        each: Each<'_>,
    ) -> Result<(), FormatProblem> {
        for (entry, number) in entries.chunks_exact(entry).zip(first..) {
            file.budget.take(8)?;
            let mut front = Front(entry);
            let Some(address) = file.address(&mut front).ok_or_else(broken)? else { continue };
            let packed = match front.0.len() {
                0 => (self.size, 0),
                more => self.packed(&mut front, more).ok_or_else(broken)?,
            };
            self.numbered(order, number, address, packed, each)?;
        }
        Ok(())
    }

    /// An array whose length is known from the beginning.
    fn fixed(&self, file: &File<'_>, address: u64, each: Each<'_>) -> Result<(), FormatProblem> {
        let mut front = file.signed(address, b"FAHD")?;
        let mut head = || {
            let [_, _, entry, page_bits] = front.array()?;
            Some((usize::from(entry), u32::from(page_bits), file.length(&mut front)?, file.address(&mut front)?))
        };
        let (entry, page_bits, count, block) = head().ok_or_else(broken)?;
        let Some(block) = block else { return Ok(()) };
        let order = self.order(None)?;
        let page = 1_usize.checked_shl(page_bits).ok_or_else(broken)?;
        if entry < file.offsets {
            return Err(broken());
        }
        let mut front = file.signed_front(block, b"FADB", block_size(count, page, entry))?;
        front.take(2 + file.offsets).ok_or_else(broken)?;
        if count <= page {
            let entries = count.checked_mul(entry).and_then(|size| front.take(size)).ok_or_else(broken)?;
            return self.entries(file, entries, entry, &order, 0, each);
        }
        let written = front.take(count.div_ceil(page).div_ceil(8)).ok_or_else(broken)?;
        front.take(4).ok_or_else(broken)?;
        self.pages(file, front, written, (count, page, entry), &order, 0, each)
    }

    /// Pages of an array, each with a checksum behind it; a bit tells whether a page was written, the highest first.
    #[expect(clippy::too_many_arguments, reason = "an array in pages is told by all of these")]
    fn pages(
        &self,
        file: &File<'_>,
        mut front: Front<'_>,
        written: &[u8],
        (count, page, entry): (usize, usize, usize),
        order: &Order,
        first: u64,
        each: Each<'_>,
    ) -> Result<(), FormatProblem> {
        for number in 0..count.div_ceil(page) {
            let here = page.min(count - number * page);
            let size = here.checked_mul(entry).ok_or_else(broken)?;
            let bit = written.get(number / 8).ok_or_else(broken)? >> (7 - number % 8) & 1;
            let entries = front.take(size).ok_or_else(broken)?;
            front.take(4).ok_or_else(broken)?;
            if bit == 1 {
                self.entries(file, entries, entry, order, first + (number * page) as u64, each)?;
            }
        }
        Ok(())
    }

    /// An array that grows along one axis: a few elements in its index block, then blocks of rising sizes.
    fn extensible(&self, file: &File<'_>, address: u64, each: Each<'_>) -> Result<(), FormatProblem> {
        let mut front = file.signed(address, b"EAHD")?;
        let mut head = || {
            let numbers = front.array::<8>()?;
            front.take(6 * file.lengths)?;
            Some((numbers, file.address(&mut front)?))
        };
        let ([_, _, entry, bits, in_index, least, least_pointers, page_bits], block) = head().ok_or_else(broken)?;
        let Some(block) = block else { return Ok(()) };
        let grows = self.most.iter().position(Option::is_none).ok_or_else(broken)?;
        let blocks = Blocks {
            entry: entry.into(),
            offset: usize::from(bits).div_ceil(8),
            least: least.into(),
            page: 1_usize.checked_shl(page_bits.into()).ok_or_else(broken)?,
            order: self.order(Some(grows))?,
        };
        let (least, pointers) = (usize::from(least), usize::from(least_pointers));
        if blocks.entry < file.offsets || !least.is_power_of_two() || !pointers.is_power_of_two() || bits > 64 {
            return Err(broken());
        }
        // Some hundred pointers at most.
        let mut front = file.signed_front(block, b"EAIB", usize::from(in_index) * blocks.entry + (1 << 13))?;
        front.take(2 + file.offsets).ok_or_else(broken)?;
        let entries = front.take(usize::from(in_index) * blocks.entry).ok_or_else(broken)?;
        self.entries(file, entries, blocks.entry, &blocks.order, 0, each)?;
        let mut first = u64::from(in_index);
        // Blocks come in groups: group k has 2^(k / 2) blocks of `least` 2^((k + 1) / 2) elements. The first groups' blocks
        // stand in the index block, those of the others in secondary blocks.
        let groups = (1 + u32::from(bits)).checked_sub(least.ilog2()).ok_or_else(broken)?;
        let direct = 2 * pointers.ilog2();
        for group in 0..groups {
            let (count, length) = (1_usize << (group / 2).min(60), blocks.length(group).ok_or_else(broken)?);
            let many =
                u64::try_from(length).ok().and_then(|length| length.checked_mul(count as u64)).ok_or_else(broken)?;
            let next = first.checked_add(many).filter(|&next| next < MOST_CHUNKS).ok_or_else(broken)?;
            if group < direct {
                for number in 0..count as u64 {
                    let block = file.address(&mut front).ok_or_else(broken)?;
                    if let Some(block) = block {
                        self.block(file, &blocks, block, length, first + number * length as u64, None, each)?;
                    }
                }
            } else if let Some(secondary) = file.address(&mut front).ok_or_else(broken)? {
                self.secondary(file, &blocks, secondary, (count, length), first, each)?;
            }
            first = next;
            if front.0.len() < file.offsets {
                break;
            }
        }
        Ok(())
    }

    /// A block that tells where further blocks are.
    fn secondary(
        &self,
        file: &File<'_>,
        blocks: &Blocks,
        address: u64,
        (count, length): (usize, usize),
        first: u64,
        each: Each<'_>,
    ) -> Result<(), FormatProblem> {
        let bitmap = if length > blocks.page { length.div_ceil(blocks.page).div_ceil(8) } else { 0 };
        let least = count.saturating_mul(bitmap + file.offsets).saturating_add(32);
        let mut front = file.signed_front(address, b"EASB", least)?;
        front.take(2 + file.offsets + blocks.offset).ok_or_else(broken)?;
        let written = count.checked_mul(bitmap).and_then(|size| front.take(size)).ok_or_else(broken)?;
        for number in 0..count {
            if let Some(block) = file.address(&mut front).ok_or_else(broken)? {
                let written = (bitmap > 0).then(|| &written[number * bitmap..(number + 1) * bitmap]);
                let first = (number as u64).checked_mul(length as u64).and_then(|more| first.checked_add(more));
                self.block(file, blocks, block, length, first.ok_or_else(broken)?, written, each)?;
            }
        }
        Ok(())
    }

    /// A block of `length` elements.
    #[expect(clippy::too_many_arguments, reason = "a block of an array is told by all of these")]
    fn block(
        &self,
        file: &File<'_>,
        blocks: &Blocks,
        address: u64,
        length: usize,
        first: u64,
        written: Option<&[u8]>,
        each: Each<'_>,
    ) -> Result<(), FormatProblem> {
        let least = block_size(length, blocks.page, blocks.entry);
        let mut front = file.signed_front(address, b"EADB", least)?;
        front.take(2 + file.offsets + blocks.offset).ok_or_else(broken)?;
        if let Some(written) = written {
            front.take(4).ok_or_else(broken)?;
            return self.pages(file, front, written, (length, blocks.page, blocks.entry), &blocks.order, first, each);
        }
        let entries = length.checked_mul(blocks.entry).and_then(|size| front.take(size)).ok_or_else(broken)?;
        self.entries(file, entries, blocks.entry, &blocks.order, first, each)
    }
}

/// Bytes of a block of so many entries, at most, with what stands before them and a checksum for each page.
fn block_size(count: usize, page: usize, entry: usize) -> usize {
    let pages = count / page.max(1) + 1;
    count.saturating_mul(entry).saturating_add(pages.saturating_mul(5)).saturating_add(64)
}

/// How chunks are numbered.
struct Order {
    axes: Vec<usize>,
    counts: Vec<u64>,
}

/// How the blocks of a growing array are made.
struct Blocks {
    entry: usize,
    offset: usize,
    least: usize,
    page: usize,
    order: Order,
}

impl Blocks {
    /// Elements in a block of a group.
    fn length(&self, group: u32) -> Option<usize> {
        1_usize.checked_shl(group.div_ceil(2)).and_then(|times| times.checked_mul(self.least))
    }
}

/// Reads what a layout message of version 4 says about its index; None if nothing was written.
pub fn index(file: &File<'_>, front: &mut Front<'_>, kind: u8, flags: u8) -> Result<Option<Index>, FormatProblem> {
    let mut packed = None;
    match kind {
        1 if flags & 2 != 0 => {
            packed = Some(file.length(front).zip(front.u32()).ok_or_else(broken)?);
        }
        1 | 2 => {}
        3 => {
            front.take(1).ok_or_else(broken)?;
        }
        4 => {
            front.take(5).ok_or_else(broken)?;
        }
        5 => {
            front.take(6).ok_or_else(broken)?;
        }
        _ => return Err(broken()),
    }
    let address = file.address(front).ok_or_else(broken)?;
    Ok(address.map(|address| match kind {
        1 => Index::Single { address, packed },
        2 => Index::Implicit { address },
        3 => Index::Fixed { address },
        4 => Index::Extensible { address },
        _ => Index::NewTree { address },
    }))
}
