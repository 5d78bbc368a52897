//! The pages of one column in one group of rows.
//!
//! Levels say what is missing and where lists begin: a value's definition level is below the highest where it or a
//! list around it is missing; its repetition level is 0 where a row begins (Dremel, Melnik et al. 2010).

use std::ops::ControlFlow;

use super::encoding::{byte_streams, deltas, hybrid, plain};
use super::schema::{Leaf, Physical};
use super::thrift::Value;
use super::{Cells, damaged};
use crate::budget::Budget;
use crate::front::Front;
use crate::problem::FormatProblem;
use crate::unpack::Packing;
use crate::windows::Windows;

/// Values for each byte of a page for which room is made before they are there.
const MOST_PER_BYTE: usize = 64;
/// Bytes that are tried first for a page's header, and then.
const HEADS: [usize; 2] = [1 << 10, 1 << 24];

/// What is done with the rows of a page or more: the number of the first, and the cells. It may have had enough.
pub type Sink<'s> = &'s mut dyn FnMut(usize, &Cells) -> Result<ControlFlow<()>, FormatProblem>;

/// Reads a column that `about` describes, page by page.
pub fn read(
    windows: &Windows<'_>,
    about: &Value<'_>,
    leaf: &Leaf,
    rows: usize,
    budget: &Budget,
    sink: Sink<'_>,
) -> Result<(), FormatProblem> {
    if !leaf.is_numeric() {
        return Err(damaged("a column that holds no numbers was asked for"));
    }
    let packing = packing(about.int(4))?;
    let place = || {
        let count = about.size(5)?;
        let dictionary = about.size(11).filter(|&place| place > 0);
        let from = about.size(9)?.min(dictionary.unwrap_or(usize::MAX));
        let end = from.checked_add(about.size(7)?).filter(|&end| end as u64 <= windows.length())?;
        Some((count, from, end))
    };
    let (count, at, end) = place().ok_or_else(|| damaged("a column's pages are not where it says"))?;
    // A row has a value or a place for one; a list may have many.
    if count < rows {
        return Err(damaged("a column has fewer values than rows"));
    }
    // What is given back page by page would have no end otherwise.
    let all = count.saturating_add(rows).saturating_mul(size_of::<f64>());
    budget.unpack(all)?;
    budget.give_back(all);
    let (dictionary, cells) = (Vec::new(), Cells::default());
    let mut column = Column { leaf, packing, budget, dictionary, cells, held: 0, first: 0, windows, at, end };
    let mut left = count;
    while left > 0 {
        left = column.page(left)?;
        if column.first + column.cells.ends.len() > rows {
            return Err(damaged(OTHER_ROWS));
        }
        if column.pass_on(left == 0, sink)?.is_break() {
            column.first = rows;
            break;
        }
    }
    budget.give_back(column.held + column.dictionary.len() * size_of::<f64>());
    if column.first == rows { Ok(()) } else { Err(damaged(OTHER_ROWS)) }
}

const OTHER_ROWS: &str = "a column has other rows than its group";

fn packing(codec: Option<i64>) -> Result<Packing, FormatProblem> {
    let name = match codec {
        Some(0) => return Ok(Packing::Plain),
        Some(1) => return Ok(Packing::Snappy),
        Some(2) => return Ok(Packing::Gzip),
        Some(6) => return Ok(Packing::Zstd),
        Some(7) => return Ok(Packing::Lz4),
        Some(3) => "LZO",
        Some(4) => "brotli",
        Some(5) => "LZ4 in Hadoop's frames",
        _ => return Err(damaged("a column does not say how it is packed")),
    };
    Err(FormatProblem::NotRead {
        found: format!("it is packed by {name}"),
        help:
            "in Python: `import pyarrow.parquet as pq; pq.write_table(pq.read_table(OLD), NEW, compression=\"snappy\")`"
                .to_owned(),
    })
}

struct Column<'a> {
    leaf: &'a Leaf,
    packing: Packing,
    budget: &'a Budget,
    dictionary: Vec<f64>,
    /// The rows of the last page, and the row before it if that may go on.
    cells: Cells,
    /// Bytes that are taken for them.
    held: usize,
    /// The number of the first.
    first: usize,
    windows: &'a Windows<'a>,
    /// Where the next page begins, and where the last ends.
    at: usize,
    end: usize,
}

/// The levels of a page, and the values that follow.
struct Page<'a> {
    count: usize,
    encoding: i64,
    repetition: Option<Front<'a>>,
    definition: Option<Front<'a>>,
    values: &'a [u8],
}

impl Column<'_> {
    /// Reads one page; how many values are left of `left`.
    fn page(&mut self, left: usize) -> Result<usize, FormatProblem> {
        let windows = self.windows;
        let mut bytes = windows.passing(self.at as u64, HEADS[0].min(self.end - self.at));
        if Value::read(&mut Front(&bytes)).is_none() {
            bytes = windows.passing(self.at as u64, HEADS[1].min(self.end - self.at));
        }
        let mut front = Front(&bytes);
        let head = Value::read(&mut front).ok_or_else(|| damaged("a page's header"))?;
        let begun = bytes.len() - front.0.len();
        let sizes = || Some((head.size(2)?, head.size(3)?));
        let (size, packed) = sizes().ok_or_else(|| damaged("a page does not say its size"))?;
        self.at += begun;
        let ends_early = || damaged("a page ends early");
        let end = self.at.checked_add(packed).filter(|&end| end <= self.end).ok_or_else(ends_early)?;
        let packed = windows.passing(self.at as u64, packed);
        if packed.len() < end - self.at {
            return Err(ends_early());
        }
        self.at = end;
        match head.int(1) {
            Some(0) => {
                let about = head.field(5).ok_or_else(|| damaged("a page does not describe its values"))?;
                let unpacked = self.unpack(&packed, size)?;
                let mut front = Front(&unpacked);
                let mut levels = |most: u32| match most {
                    0 => Some(None),
                    _ => {
                        let length = front.u32()? as usize;
                        front.take(length).map(|levels| Some(Front(levels)))
                    }
                };
                let read = || Some((levels(self.leaf.lists)?, levels(self.leaf.optional)?));
                let (repetition, definition) = { read }().ok_or_else(|| damaged("a page's levels end early"))?;
                if [(repetition, 4), (definition, 3)]
                    .iter()
                    .any(|&(there, at)| there.is_some() && about.int(at) != Some(3))
                {
                    return Err(damaged("levels in an encoding that nobody writes"));
                }
                let page = page(about, 2, repetition, definition, front.0)?;
                self.take(&page, left)?;
                self.budget.give_back(unpacked.len());
                Ok(left - page.count)
            }
            Some(3) => {
                let about = head.field(8).ok_or_else(|| damaged("a page does not describe its values"))?;
                let mut front = Front(&packed);
                let mut levels = |at: i64| front.take(about.size(at)?);
                let read = || Some((levels(6)?, levels(5)?));
                let (repetition, definition) = { read }().ok_or_else(|| damaged("a page's levels end early"))?;
                let size = size.checked_sub(repetition.len() + definition.len());
                let size = size.ok_or_else(|| damaged("a page is smaller than its levels"))?;
                let plain = about.field(7) == Some(&Value::Bool(false));
                let unpacked = if plain { front.0.into() } else { self.unpack(front.0, size)? };
                let repetition = (self.leaf.lists > 0).then_some(Front(repetition));
                let definition = (self.leaf.optional > 0).then_some(Front(definition));
                let page = page(about, 4, repetition, definition, &unpacked)?;
                self.take(&page, left)?;
                self.budget.give_back(if plain { 0 } else { unpacked.len() });
                Ok(left - page.count)
            }
            Some(2) => {
                let about = head.field(7).ok_or_else(|| damaged("a dictionary does not say its size"))?;
                let count = about.size(1).ok_or_else(|| damaged("a dictionary does not say its size"))?;
                let unpacked = self.unpack(&packed, size)?;
                self.budget.take_values::<f64>(count)?;
                self.dictionary.clear();
                plain(self.leaf, &unpacked, count, &mut self.dictionary)
                    .ok_or_else(|| damaged("a dictionary ends early"))?;
                self.budget.give_back(unpacked.len());
                Ok(left)
            }
            // An index page holds nothing that is needed.
            Some(1) => Ok(left),
            _ => Err(damaged("a page of an unknown kind")),
        }
    }

    fn unpack<'b>(&self, packed: &'b [u8], size: usize) -> Result<std::borrow::Cow<'b, [u8]>, FormatProblem> {
        self.budget.unpack(size)?;
        self.packing.unpack(packed, size).ok_or_else(|| damaged("a page does not unpack to what it says"))
    }

    /// Appends the values of a page to the rows.
    fn take(&mut self, page: &Page<'_>, left: usize) -> Result<(), FormatProblem> {
        if page.count > left {
            return Err(damaged("a page has more values than its column"));
        }
        let (leaf, budget) = (self.leaf, self.budget);
        let broken = || damaged("a page's levels");
        // The budget stands for a level each, a value each, and a place in a list each.
        let taken = page.count.saturating_mul(16);
        budget.take(taken)?;
        let levels = |front: Option<Front<'_>>, most: u32| -> Result<Option<Vec<u8>>, FormatProblem> {
            let Some(front) = front else { return Ok(None) };
            let mut levels = Vec::new();
            hybrid(front, u32::BITS - most.leading_zeros(), page.count, |level| levels.push(level as u8))
                .ok_or_else(broken)?;
            if levels.iter().any(|&level| u32::from(level) > most) { Err(broken()) } else { Ok(Some(levels)) }
        };
        let repetition = levels(page.repetition, leaf.lists)?;
        let definition = levels(page.definition, leaf.optional)?;
        let full = leaf.optional as u8;
        let there =
            definition.as_ref().map_or(page.count, |levels| levels.iter().filter(|&&level| level == full).count());
        let held = page.count.saturating_mul(size_of::<f64>() + size_of::<usize>());
        budget.take(held)?;
        self.held += held;
        let first = self.cells.values.len();
        // What is promised beyond that may be true, as dictionaries pack well, but has to show first.
        if there / MOST_PER_BYTE <= page.values.len() {
            self.cells.values.reserve_exact(there);
        }
        self.values(page, there)?;
        if repetition.is_none() && there == page.count {
            self.cells.ends.extend(first + 1..=first + page.count);
        } else {
            self.place(first, page.count, repetition.as_deref(), definition.as_deref())?;
        }
        budget.give_back(taken);
        Ok(())
    }

    /// Passes on the rows that are whole: of lists all but the last, unless it was the last page.
    fn pass_on(&mut self, last: bool, sink: Sink<'_>) -> Result<ControlFlow<()>, FormatProblem> {
        let cells = &mut self.cells;
        let whole = cells.ends.len().saturating_sub(usize::from(self.leaf.lists > 0 && !last));
        if whole == 0 {
            return Ok(ControlFlow::Continue(()));
        }
        let begun = cells.ends.len() > whole;
        let rest = cells.values.split_off(cells.ends[whole - 1]);
        cells.ends.truncate(whole);
        let done = sink(self.first, cells)?;
        self.first += whole;
        cells.values.clear();
        cells.values.extend(&rest);
        cells.ends.clear();
        cells.ends.extend(begun.then_some(rest.len()));
        let kept = cells.taken();
        self.budget.give_back(self.held.saturating_sub(kept));
        self.held = kept;
        Ok(done)
    }

    /// Decodes the values that are there behind those of the pages before.
    fn values(&mut self, page: &Page<'_>, count: usize) -> Result<(), FormatProblem> {
        let (leaf, out) = (self.leaf, &mut self.cells.values);
        let boolean = leaf.physical == Physical::Boolean;
        let read = match page.encoding {
            0 => plain(leaf, page.values, count, out),
            2 | 8 => {
                let mut front = Front(page.values);
                let mut missing = false;
                let dictionary = &self.dictionary;
                let read = front.u8().filter(|&width| width <= 32).or((count == 0).then_some(0)).and_then(|width| {
                    hybrid(front, width.into(), count, |index| match dictionary.get(index as usize) {
                        Some(value) => out.push(*value),
                        None => missing = true,
                    })
                });
                read.filter(|()| !missing)
            }
            3 if boolean => {
                let mut front = Front(page.values);
                front.u32().and_then(|_| hybrid(front, 1, count, |bit| out.push(f64::from(bit))))
            }
            5 if matches!(leaf.physical, Physical::Int32 | Physical::Int64) => deltas(leaf, page.values, count, out),
            9 if !boolean => byte_streams(leaf, page.values, count, out),
            _ => return Err(damaged("values in an encoding that does not fit their kind")),
        };
        read.ok_or_else(|| damaged("a page's values"))
    }

    /// Spreads the values behind `first` over `count` places, of which some are empty, and finds where rows end.
    fn place(
        &mut self,
        first: usize,
        count: usize,
        repetition: Option<&[u8]>,
        definition: Option<&[u8]>,
    ) -> Result<(), FormatProblem> {
        let cells = &mut self.cells;
        let full = self.leaf.optional as u8;
        let packed = cells.values.split_off(first);
        let mut packed = packed.into_iter();
        for place in 0..count {
            let begins = repetition.is_none_or(|levels| levels[place] == 0);
            if begins {
                // The row before ends here, unless this is the first of all; it is set again with each value.
                cells.ends.push(cells.values.len());
            }
            let value = match definition.map(|levels| levels[place]) {
                Some(level) if level < full => {
                    // An empty list has a place but no value; that of a missing one, too.
                    (u32::from(level) >= self.leaf.inner).then_some(f64::NAN)
                }
                _ => packed.next(),
            };
            cells.values.extend(value);
            match cells.ends.last_mut() {
                Some(end) => *end = cells.values.len(),
                None => return Err(damaged("a list begins before its row")),
            }
        }
        Ok(())
    }
}

/// What a page's description says; the encoding is in field `encoding`.
fn page<'a>(
    about: &Value<'_>,
    encoding: i64,
    repetition: Option<Front<'a>>,
    definition: Option<Front<'a>>,
    values: &'a [u8],
) -> Result<Page<'a>, FormatProblem> {
    let count = about.size(1).ok_or_else(|| damaged("a page does not say how many values it has"))?;
    let encoding = about.int(encoding).ok_or_else(|| damaged("a page does not say its encoding"))?;
    Ok(Page { count, encoding, repetition, definition, values })
}
