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

mod chunk;
mod encoding;
mod schema;
mod thrift;
pub mod write;

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
    bytes: &'a [u8],
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
    pub fn open(bytes: &'a [u8], budget: &Budget) -> Result<Self, FormatProblem> {
        if bytes.starts_with(b"PARE") {
            let help = "write it without encryption".to_owned();
            return Err(FormatProblem::NotRead { found: "it is encrypted".to_owned(), help });
        }
        if bytes.starts_with(b"version https://git-lfs") {
            let help = "`git lfs pull` in its folder fetches the data".to_owned();
            return Err(FormatProblem::NotRead {
                found: "it is a pointer that Git LFS left in place of the data".to_owned(),
                help,
            });
        }
        if !bytes.starts_with(MAGIC) {
            return Err(FormatProblem::NotThis { kind: KIND, why: "it does not begin with PAR1" });
        }
        let cut = || damaged("its end, where its columns are described, is missing");
        let rest = bytes.strip_suffix(MAGIC).ok_or_else(cut)?;
        let (rest, length) = rest.split_last_chunk().ok_or_else(cut)?;
        let start = rest.len().checked_sub(u32::from_le_bytes(*length) as usize).ok_or_else(cut)?;
        let footer = &rest[start..];
        // Each byte makes at most one value of the tree.
        budget.take(footer.len().saturating_mul(2 * size_of::<Value<'_>>()))?;
        let footer = Value::read(&mut Front(footer)).ok_or_else(|| damaged("the description of its columns"))?;
        let elements = footer.list(2).ok_or_else(|| damaged("it describes no columns"))?;
        let leaves = schema::leaves(elements, budget)?;
        Ok(Self { bytes, footer, leaves })
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

    /// Reads one column of a group of rows.
    ///
    /// # Errors
    /// [`FormatProblem`].
    pub fn cells(&self, group: usize, leaf: usize, budget: &Budget) -> Result<Cells, FormatProblem> {
        let rows = self.rows(group)?;
        let columns = self.footer.list(4).and_then(|groups| groups.get(group)).and_then(|group| group.list(1));
        let column = columns.and_then(|columns| columns.get(leaf)).and_then(|column| column.field(3));
        let column = column.ok_or_else(|| damaged("a group of rows lacks a column"))?;
        let leaf = self.leaves.get(leaf).ok_or_else(|| damaged("a column is not described"))?;
        let cells = chunk::read(self.bytes, column, leaf, rows, budget)?;
        if cells.ends.len() != rows {
            return Err(damaged("a column has other rows than its group"));
        }
        Ok(cells)
    }
}

#[cfg(test)]
mod tests;
