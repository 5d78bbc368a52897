//! Writes parquet files: plain pages without packing.

use std::ops::Range;

use super::MAGIC;
use super::thrift::Writer;

/// How a column is called and what it holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub of: Type,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// Whole numbers of 64 bits.
    Int64,
    /// Floats of 32 bits, so many in a row: a list if there are several.
    Float(usize),
    /// Floats of 64 bits, as many.
    Double(usize),
    /// Text.
    Text,
    /// A list of one text.
    Texts,
}

/// Values of one column in one group of rows.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// For [`Type::Int64`].
    Whole(&'a [i64]),
    /// For floats: rows x width.
    Floats(&'a [f64]),
    /// For text.
    Text(&'a [&'a str]),
}

/// A file that is being written.
#[derive(Debug)]
pub struct File {
    bytes: Vec<u8>,
    columns: Vec<Column>,
    groups: Vec<Group>,
}

#[derive(Debug)]
struct Group {
    rows: usize,
    chunks: Vec<Chunk>,
}

/// Where the page of a column is.
#[derive(Debug)]
struct Chunk {
    place: usize,
    size: usize,
    values: usize,
}

/// Values of a page, about.
const VALUES_OF_A_PAGE: usize = 1 << 16;

impl Type {
    fn is_list(self) -> bool {
        matches!(self, Self::Float(2..) | Self::Double(2..) | Self::Texts)
    }

    /// The type's number in the format.
    fn physical(self) -> i32 {
        match self {
            Self::Int64 => 2,
            Self::Float(_) => 4,
            Self::Double(_) => 5,
            Self::Text | Self::Texts => 6,
        }
    }

    fn is_text(self) -> bool {
        self.physical() == 6
    }
}

impl File {
    /// A file of these columns.
    #[must_use]
    pub fn new(columns: Vec<Column>) -> Self {
        Self { bytes: MAGIC.to_vec(), columns, groups: Vec::new() }
    }

    /// Bytes so far.
    #[must_use]
    pub fn size(&self) -> usize {
        self.bytes.len()
    }

    /// Writes a group of rows, with the values of each column.
    pub fn group(&mut self, rows: usize, values: &[Values<'_>]) {
        let mut chunks = Vec::with_capacity(values.len());
        let columns = std::mem::take(&mut self.columns);
        for (column, values) in columns.iter().zip(values) {
            let count = match values {
                Values::Whole(values) => values.len(),
                Values::Floats(values) => values.len(),
                Values::Text(values) => values.len(),
            };
            let (place, width) = (self.bytes.len(), count / rows.max(1));
            // Whoever reads it holds a page at a time.
            let each = (VALUES_OF_A_PAGE / width.max(1)).max(1);
            let mut first = 0;
            while first < rows || first == 0 {
                let here = each.min(rows - first);
                self.page(column, values, here, first * width..(first + here) * width);
                first += here.max(1);
            }
            chunks.push(Chunk { place, size: self.bytes.len() - place, values: count });
        }
        self.columns = columns;
        self.groups.push(Group { rows, chunks });
    }

    /// Writes a page of so many rows, with the values of this range.
    fn page(&mut self, column: &Column, values: &Values<'_>, rows: usize, range: Range<usize>) {
        let (mut page, count) = (Vec::new(), range.len());
        if column.of.is_list() {
            levels(&mut page, rows, count / rows.max(1));
        }
        match values {
            Values::Whole(values) => page.extend(values[range].iter().flat_map(|value| value.to_le_bytes())),
            Values::Floats(values) if matches!(column.of, Type::Float(_)) => {
                page.extend(values[range].iter().flat_map(|value| (*value as f32).to_le_bytes()));
            }
            Values::Floats(values) => page.extend(values[range].iter().flat_map(|value| value.to_le_bytes())),
            Values::Text(values) => {
                for text in &values[range] {
                    page.extend((text.len() as u32).to_le_bytes());
                    page.extend(text.as_bytes());
                }
            }
        }
        let head = Writer::of(|head| {
            head.i32(1, 0);
            head.i32(2, page.len() as i32);
            head.i32(3, page.len() as i32);
            head.inner(5, |data| {
                data.i32(1, count as i32);
                // PLAIN; levels by RLE.
                data.i32(2, 0);
                data.i32(3, 3);
                data.i32(4, 3);
            });
        });
        self.bytes.extend(head);
        self.bytes.extend(page);
    }

    /// The bytes of the file, with notes for those who read it.
    #[must_use]
    pub fn finish(mut self, notes: &[(&str, &str)]) -> Vec<u8> {
        let rows: usize = self.groups.iter().map(|group| group.rows).sum();
        let footer = Writer::of(|footer| {
            footer.i32(1, 2);
            let mut elements = vec![Element { name: "schema", of: None, part: Part::Root(self.columns.len()) }];
            for column in &self.columns {
                let element = |name, part| Element { name, of: Some(column.of), part };
                if column.of.is_list() {
                    elements.push(element(&column.name, Part::List));
                    elements.push(element("list", Part::Repeated));
                    elements.push(element("element", Part::Leaf));
                } else {
                    elements.push(element(&column.name, Part::Leaf));
                }
            }
            footer.structs(2, &elements, |writer, element| element.write(writer));
            footer.i64(3, rows as i64);
            footer.structs(4, &self.groups, |writer, group| self.describe(writer, group));
            footer.structs(5, notes, |writer, (key, value)| {
                writer.text(1, key);
                writer.text(2, value);
            });
            footer.text(6, concat!("scrnn-data version ", env!("CARGO_PKG_VERSION")));
        });
        let length = (footer.len() as u32).to_le_bytes();
        self.bytes.extend(footer);
        self.bytes.extend(length);
        self.bytes.extend(MAGIC);
        self.bytes
    }

    fn describe(&self, writer: &mut Writer, group: &Group) {
        let pairs: Vec<(&Column, &Chunk)> = self.columns.iter().zip(&group.chunks).collect();
        writer.structs(1, &pairs, |writer, (column, chunk)| {
            writer.i64(2, 0);
            writer.inner(3, |about| {
                about.i32(1, column.of.physical());
                about.numbers(2, &[0, 3]);
                let list = [column.name.as_str(), "list", "element"];
                about.texts(3, if column.of.is_list() { &list } else { &list[..1] });
                about.i32(4, 0);
                about.i64(5, chunk.values as i64);
                about.i64(6, chunk.size as i64);
                about.i64(7, chunk.size as i64);
                about.i64(9, chunk.place as i64);
            });
        });
        writer.i64(2, group.chunks.iter().map(|chunk| chunk.size as i64).sum());
        writer.i64(3, group.rows as i64);
    }
}

/// The levels of lists that all have `width` elements: a list begins at each, and nothing is missing.
fn levels(page: &mut Vec<u8>, rows: usize, width: usize) {
    let count = rows * width;
    let mut repetition = Vec::new();
    varint(&mut repetition, (count.div_ceil(8) as u64) << 1 | 1);
    let mut bits = vec![0_u8; count.div_ceil(8)];
    for place in (0..count).filter(|place| place % width.max(1) != 0) {
        bits[place / 8] |= 1 << (place % 8);
    }
    repetition.extend(bits);
    let mut definition = Vec::new();
    varint(&mut definition, (count as u64) << 1);
    definition.push(1);
    for levels in [repetition, definition] {
        page.extend((levels.len() as u32).to_le_bytes());
        page.extend(levels);
    }
}

fn varint(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// An element of the tree that describes the columns.
struct Element<'a> {
    name: &'a str,
    of: Option<Type>,
    part: Part,
}

enum Part {
    Root(usize),
    List,
    Repeated,
    Leaf,
}

impl Element<'_> {
    fn write(&self, writer: &mut Writer) {
        let leaf = matches!(self.part, Part::Leaf);
        if let Some(of) = self.of.filter(|_| leaf) {
            writer.i32(1, of.physical());
        }
        match self.part {
            Part::Root(_) => {}
            Part::Repeated => writer.i32(3, 2),
            Part::List | Part::Leaf => writer.i32(3, 0),
        }
        writer.text(4, self.name);
        match self.part {
            Part::Root(children) => writer.i32(5, children as i32),
            Part::List | Part::Repeated => writer.i32(5, 1),
            Part::Leaf => {}
        }
        let is_text = leaf && self.of.is_some_and(Type::is_text);
        match self.part {
            Part::List => {
                writer.i32(6, 3);
                writer.inner(10, |logical| logical.inner(3, |_| ()));
            }
            _ if is_text => {
                writer.i32(6, 0);
                writer.inner(10, |logical| logical.inner(1, |_| ()));
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::parquet::Parquet;

    #[test]
    fn what_is_written_is_read() {
        let column = |name: &str, of| Column { name: name.to_owned(), of };
        let mut file = File::new(vec![
            column("state", Type::Double(3)),
            column("short", Type::Float(2)),
            column("one", Type::Float(1)),
            column("number", Type::Int64),
            column("task", Type::Text),
            column("tasks", Type::Texts),
        ]);
        for group in 0..2 {
            let state: Vec<f64> = (0..15).map(|k| f64::from(k) + 0.1 + f64::from(group)).collect();
            let texts = ["a", "b", "", "d", "e"];
            file.group(
                5,
                &[
                    Values::Floats(&state),
                    Values::Floats(&state[..10]),
                    Values::Floats(&[1.0, 2.0, f64::NAN, 4.0, 5.0]),
                    Values::Whole(&[1, -2, 3, 4, i64::from(group)]),
                    Values::Text(&texts),
                    Values::Text(&texts),
                ],
            );
        }
        let bytes = file.finish(&[("key", "value")]);
        let budget = Budget::of(1 << 20);
        let windows = crate::windows::Windows::whole(bytes);
        let file = Parquet::open(&windows, &budget).unwrap();
        let names: Vec<&str> = file.leaves.iter().map(|leaf| leaf.name.as_str()).collect();
        assert_eq!(names, ["state", "short", "one", "number", "task", "tasks"]);
        let cells = |group, leaf| crate::parquet::tests::cells(&file, group, leaf, &budget).unwrap();
        assert_eq!((file.groups(), cells(1, 0).row(4)), (2, [13.1, 14.1, 15.1].as_slice()));
        assert_eq!(cells(0, 1).row(0), [f64::from(0.1_f32), f64::from(1.1_f32)]);
        assert_eq!(cells(1, 3).values, [1., -2., 3., 4., 1.]);
        assert!(cells(0, 2).row(2)[0].is_nan() && cells(0, 2).row(3) == [4.0]);
    }
}
