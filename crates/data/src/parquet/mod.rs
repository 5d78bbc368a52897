//! Parquet: tables in columns, as pyarrow, pandas and polars write them.
//!
//! ```text
//! PAR1, pages, footer, length of the footer (4 bytes), PAR1
//! ```
//!
//! The footer tells the columns (a tree whose leaves hold values), and for each group of rows where the pages of each
//! leaf are. Read here are columns of numbers, also of lists of numbers, in every encoding and packing that the common
//! writers use (format 2.11: PLAIN, dictionaries, DELTA_BINARY_PACKED, BYTE_STREAM_SPLIT; snappy, gzip, zstd, LZ4_RAW).
//! A reader of our own, because the `parquet` crate panics on some damaged files and has no bound on memory.

use crate::budget::Budget;
use crate::front::Front;
use crate::problem::FormatProblem;
use crate::windows::Windows;

mod chunk;
mod encoding;
mod schema;
mod thrift;
pub mod write;

pub use chunk::Sink;
pub use encoding::half;
pub use schema::Leaf;

use thrift::Value;

const MAGIC: &[u8] = b"PAR1";
const KIND: &str = "parquet";

fn damaged(what: &'static str) -> FormatProblem {
    FormatProblem::Damaged { kind: KIND, what }
}

/// A parquet file whose footer was read.
#[derive(Debug)]
pub struct Parquet<'a> {
    windows: &'a Windows<'a>,
    footer: Value<'a>,
    /// The columns that hold values, in the order of the file.
    pub leaves: Vec<Leaf>,
}

/// Values of one column in some rows. A missing value is NaN.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cells {
    /// The values of all rows.
    pub values: Vec<f64>,
    /// Where the values of each row end.
    pub ends: Vec<usize>,
}

impl Cells {
    /// The values in a row, counted from 0.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f64] {
        let from = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.values[from..self.ends[row]]
    }

    /// Bytes that were taken for it from a budget, to be given back with it.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.values.len() * size_of::<f64>() + self.ends.len() * size_of::<usize>()
    }
}

impl<'a> Parquet<'a> {
    /// Reads the footer.
    ///
    /// # Errors
    /// [`FormatProblem`].
    pub fn open(windows: &'a Windows<'a>, budget: &Budget) -> Result<Self, FormatProblem> {
        let front = windows.passing(0, 32);
        if front.starts_with(b"PARE") {
            let help = "write it without encryption".to_owned();
            return Err(FormatProblem::NotRead { found: "it is encrypted".to_owned(), help });
        }
        if front.starts_with(b"version https://git-lfs") {
            let help = "`git lfs pull` in its folder fetches the data".to_owned();
            return Err(FormatProblem::NotRead {
                found: "it is a pointer that Git LFS left in place of the data".to_owned(),
                help,
            });
        }
        if !front.starts_with(MAGIC) {
            return Err(FormatProblem::NotThis { kind: KIND, why: "it does not begin with PAR1" });
        }
        let cut = || damaged("its end, where its columns are described, is missing");
        let last = windows.length().checked_sub(8).ok_or_else(cut)?;
        let tail = windows.passing(last, 8);
        let (length, _) = tail.strip_suffix(MAGIC).and_then(<[u8]>::split_first_chunk).ok_or_else(cut)?;
        let length = u32::from_le_bytes(*length);
        let start = last.checked_sub(length.into()).ok_or_else(cut)?;
        let footer = windows.kept(start, length as usize, budget)?.get(..length as usize).ok_or_else(cut)?;
        // Each byte makes at most one value of the tree.
        budget.take(footer.len().saturating_mul(2 * size_of::<Value<'_>>()))?;
        let footer = Value::read(&mut Front(footer)).ok_or_else(|| damaged("the description of its columns"))?;
        let elements = footer.list(2).ok_or_else(|| damaged("it describes no columns"))?;
        let leaves = schema::leaves(elements, budget)?;
        Ok(Self { windows, footer, leaves })
    }

    /// How many groups of rows there are.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.footer.list(4).map_or(0, <[_]>::len)
    }

    /// How many rows a group says that it has.
    ///
    /// # Errors
    /// [`FormatProblem::Damaged`].
    pub fn rows(&self, group: usize) -> Result<usize, FormatProblem> {
        let group = self.footer.list(4).and_then(|groups| groups.get(group));
        group.and_then(|group| group.size(3)).ok_or_else(|| damaged("a group of rows does not say how many"))
    }

    /// The leaf with this path (`a.b` or, for a list called a, `a`).
    #[must_use]
    pub fn leaf(&self, name: &str) -> Option<usize> {
        self.leaves.iter().position(|leaf| leaf.name == name)
    }

    /// Reads one column of a group of rows, page by page.
    ///
    /// # Errors
    /// [`FormatProblem`].
    pub fn each(&self, group: usize, leaf: usize, budget: &Budget, sink: Sink<'_>) -> Result<(), FormatProblem> {
        let rows = self.rows(group)?;
        let columns = self.footer.list(4).and_then(|groups| groups.get(group)).and_then(|group| group.list(1));
        let column = columns.and_then(|columns| columns.get(leaf)).and_then(|column| column.field(3));
        let column = column.ok_or_else(|| damaged("a group of rows lacks a column"))?;
        let leaf = self.leaves.get(leaf).ok_or_else(|| damaged("a column is not described"))?;
        chunk::read(self.windows, column, leaf, rows, budget, sink)
    }
}

#[cfg(test)]
mod tests;
