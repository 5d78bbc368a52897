//! MATLAB's files: version 5 (what `save` and scipy write), and 7.3, which is HDF5.
//!
//! ```text
//! 128 bytes of text, version and byte order, then elements
//! element   type, size (4 bytes each; together in 4 if at most 4 bytes follow), contents, padded to 8 bytes
//! matrix    flags and class, lengths, name, numbers: the first axis fastest
//! ```
//!
//! What the matrices are together, [`crate::arrays`] tells, as it does for numpy's archives. A cell of matrices is a
//! sequence for each. (MATLAB, "MAT-File Format", R2019b.)

use crate::arrays::{Array, Texts, to_samples};
use crate::budget::Budget;
use crate::problem::FormatProblem;
use crate::samples::Samples;
use crate::source::Source;
use crate::unpack::zlib_to_its_end;
use crate::windows::Windows;
use crate::{FileError, Remark, Selection, hdf5};

const KIND: &str = "MATLAB";
/// Cells in cells that are followed.
const DEEPEST: usize = 4;

fn damaged(what: &'static str) -> FormatProblem {
    FormatProblem::Damaged { kind: KIND, what }
}

/// Reads a file of either version.
///
/// # Errors
/// [`FileError`].
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let windows = Windows::of(source)?;
    if *windows.passing(0, 10) == *b"MATLAB 7.3" || *windows.passing(0, 4) == *b"\x89HDF" {
        return hdf5::of_windows(windows, source, selection);
    }
    let bytes = windows.passing(0, usize::MAX);
    let at = |problem: FormatProblem| problem.at(source.name());
    let contents = Contents::read(&bytes, source.budget()).map_err(at)?;
    if contents.arrays.is_empty() {
        let there =
            contents.others.iter().map(|(name, what)| format!("{name} ({what})")).collect::<Vec<_>>().join(", ");
        let found =
            if there.is_empty() { "it holds no variables".to_owned() } else { format!("it holds only {there}") };
        let help = "in MATLAB, save matrices of steps x channels: `q = s.q; save('file.mat', 'q')`; in Python, \
                    `scipy.io.loadmat(FILE, simplify_cells=True)` gives a dictionary, whose arrays `numpy.savez` saves";
        return Err(at(FormatProblem::NotRead { found, help: help.to_owned() }));
    }
    let count: usize = contents.arrays.iter().map(|array| array.values.len()).sum();
    // What stands side by side is copied.
    source.budget().take_values::<f64>(count).map_err(|problem| at(problem.into()))?;
    let mut samples = to_samples((source.name(), source.budget()), contents.arrays, &contents.texts, selection)?;
    let left_out = contents.others.into_iter().map(|(column, what)| Remark::LeftOut { column, what: what.to_owned() });
    samples.remarks.extend(left_out);
    Ok(samples)
}

/// What a file holds.
#[derive(Debug, Default)]
struct Contents {
    arrays: Vec<Array>,
    texts: Vec<Texts>,
    others: Vec<(String, &'static str)>,
}

/// Bytes in the order of the machine that wrote them.
#[derive(Clone, Copy)]
struct Reader<'a> {
    bytes: &'a [u8],
    big_endian: bool,
    budget: &'a Budget,
}

/// The type of an element's contents, and the contents.
type Element<'a> = (u32, &'a [u8]);

mod of {
    pub const MATRIX: u32 = 14;
    pub const PACKED: u32 = 15;
}

impl Contents {
    fn read(bytes: &[u8], budget: &Budget) -> Result<Self, FormatProblem> {
        let not = |why| FormatProblem::NotThis { kind: KIND, why };
        let (head, rest) = bytes.split_at_checked(128).ok_or_else(|| not("it is shorter than its header"))?;
        let big_endian = match &head[126..] {
            b"IM" => false,
            b"MI" => true,
            _ if bytes[..4].contains(&0) => {
                let help = "in MATLAB: `load` it, then `save('file.mat', 'name', '-v7')`".to_owned();
                return Err(FormatProblem::NotRead { found: "it may be a MATLAB file of version 4".to_owned(), help });
            }
            _ => return Err(not("its header does not tell the byte order")),
        };
        let mut contents = Self::default();
        let mut reader = Reader { bytes: rest, big_endian, budget };
        while !reader.bytes.is_empty() {
            let (kind, data) = reader.element().ok_or_else(|| damaged("an element ends early"))?;
            match kind {
                of::MATRIX => contents.matrix(Reader { bytes: data, ..reader }, None, DEEPEST)?,
                of::PACKED => {
                    let most = usize::try_from(budget.left() / 4).unwrap_or(usize::MAX);
                    let unpacked = zlib_to_its_end(data, most).ok_or_else(|| damaged("a packed variable"))?;
                    budget.take(unpacked.len())?;
                    let mut inner = Reader { bytes: &unpacked, ..reader };
                    match inner.element() {
                        Some((of::MATRIX, data)) => contents.matrix(Reader { bytes: data, ..inner }, None, DEEPEST)?,
                        Some(_) => {}
                        None => return Err(damaged("a packed variable ends early")),
                    }
                    budget.give_back(unpacked.len());
                }
                _ => {}
            }
        }
        Ok(contents)
    }

    /// Reads one variable; an element of a cell gets its name from outside.
    fn matrix(&mut self, mut reader: Reader<'_>, outer: Option<&str>, deeper: usize) -> Result<(), FormatProblem> {
        let cut = || damaged("a variable ends early");
        reader.budget.take(128)?;
        if reader.bytes.is_empty() {
            return Ok(());
        }
        let (_, flags) = reader.element().ok_or_else(cut)?;
        let flags = reader.number(flags.get(..4).ok_or_else(cut)?) as u32;
        let (_, lengths) = reader.element().ok_or_else(cut)?;
        let shape: Vec<usize> = lengths.chunks_exact(4).map(|length| reader.number(length) as usize).collect();
        if shape.len() > 32 {
            return Err(damaged("a variable has too many axes"));
        }
        let (_, name) = reader.element().ok_or_else(cut)?;
        let name = match outer {
            Some(name) => name.to_owned(),
            None => reader.budget.text(&String::from_utf8_lossy(name))?,
        };
        let count = shape.iter().try_fold(1_usize, |all, &length| all.checked_mul(length)).ok_or_else(cut)?;
        let complex = flags & 0x0800 != 0;
        let other = match flags & 0xff {
            1 if deeper == 0 => "cells in cells",
            1 => return self.cell(reader, &name, count, deeper - 1),
            2 | 3 => "a structure",
            4 => {
                let (kind, data) = reader.element().ok_or_else(cut)?;
                let texts = rows_of_text(&reader, kind, data, &shape)?;
                self.texts.push(Texts { name, texts });
                return Ok(());
            }
            5 => "a sparse matrix",
            6..=15 if complex => "complex numbers",
            6..=15 if count == 0 => "no numbers",
            6..=15 => {
                let (kind, data) = reader.element().ok_or_else(cut)?;
                let values = reader.numbers(kind, data, count)?;
                self.arrays.push(row_major(name, shape, values));
                return Ok(());
            }
            _ => "a function or an object",
        };
        if outer.is_none() || !self.others.iter().any(|(known, _)| *known == name) {
            self.others.push((name, other));
        }
        Ok(())
    }

    /// Reads a cell: matrices are sequences `name_1`, ..., texts are names.
    fn cell(&mut self, mut reader: Reader<'_>, name: &str, count: usize, deeper: usize) -> Result<(), FormatProblem> {
        let (arrays, texts) = (self.arrays.len(), self.texts.len());
        for number in 1..=count {
            let (kind, data) = reader.element().ok_or_else(|| damaged("a cell ends early"))?;
            if kind != of::MATRIX {
                return Err(damaged("a cell holds something strange"));
            }
            let inner = reader.budget.text(&format!("{name}_{number}"))?;
            self.matrix(Reader { bytes: data, ..reader }, Some(&inner), deeper)?;
        }
        // A cell of one matrix is that matrix.
        if let ([only], 1) = (&mut self.arrays[arrays..], count) {
            name.clone_into(&mut only.name);
        }
        let words: Vec<String> = self.texts.drain(texts..).flat_map(|texts| texts.texts).collect();
        if !words.is_empty() {
            self.texts.push(Texts { name: name.to_owned(), texts: words });
        }
        Ok(())
    }
}

impl<'a> Reader<'a> {
    /// The number in up to eight bytes.
    fn number(&self, bytes: &[u8]) -> u64 {
        let join = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        if self.big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (front, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(front)
    }

    fn element(&mut self) -> Option<Element<'a>> {
        let tag = self.take(4)?;
        let kind = self.number(tag) as u32;
        if kind >> 16 != 0 {
            let data = self.take(4)?;
            return Some((kind & 0xffff, data.get(..(kind >> 16) as usize)?));
        }
        let size = self.take(4)?;
        let size = self.number(size) as usize;
        let data = self.take(size)?;
        // What is packed has no padding, and the last may lack it.
        if kind != of::PACKED {
            let padding = (8 - size % 8) % 8;
            self.take(padding.min(self.bytes.len()))?;
        }
        Some((kind, data))
    }

    /// The numbers of an element: they may be stored in a smaller type than they have.
    fn numbers(&self, kind: u32, data: &[u8], count: usize) -> Result<Vec<f64>, FormatProblem> {
        let size = match kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            9 | 12 | 13 => 8,
            _ => return Err(damaged("numbers of an unknown type")),
        };
        let data = count.checked_mul(size).and_then(|length| data.get(..length));
        let data = data.ok_or_else(|| damaged("a variable has fewer numbers than its lengths say"))?;
        let unused = 64 - 8 * size;
        let value = |bytes: &[u8]| {
            let low = self.number(bytes);
            match kind {
                7 => f32::from_bits(low as u32).into(),
                9 => f64::from_bits(low),
                1 | 3 | 5 | 12 => ((low << unused) as i64 >> unused) as f64,
                _ => low as f64,
            }
        };
        let mut values = self.budget.vec(count)?;
        values.extend(data.chunks_exact(size).map(value));
        Ok(values)
    }
}

/// The rows of a matrix of characters.
fn rows_of_text(reader: &Reader<'_>, kind: u32, data: &[u8], shape: &[usize]) -> Result<Vec<String>, FormatProblem> {
    let size = match kind {
        1 | 2 | 16 => 1,
        3 | 4 | 17 => 2,
        _ => 4,
    };
    reader.budget.take(data.len().saturating_mul(4))?;
    let letters = data.chunks_exact(size).map(|letter| char::from_u32(reader.number(letter) as u32).unwrap_or('?'));
    let letters: Vec<char> = letters.collect();
    let rows = shape.first().copied().unwrap_or(0).min(letters.len());
    let row = |row: usize| letters.iter().skip(row).step_by(rows.max(1)).collect::<String>().trim_end().to_owned();
    Ok((0..rows).map(row).collect())
}

/// From the first axis fastest to the last. A single number and a row or column lose the axes of length one.
fn row_major(name: String, shape: Vec<usize>, values: Vec<f64>) -> Array {
    let long: Vec<usize> = shape.iter().copied().filter(|&length| length != 1).collect();
    if long.len() < 2 {
        return Array { name, shape: long, values };
    }
    let mut strides = vec![1; shape.len()];
    for axis in 1..shape.len() {
        strides[axis] = strides[axis - 1] * shape[axis - 1];
    }
    let mut at = vec![0; shape.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        out.push(values[at.iter().zip(&strides).map(|(place, stride)| place * stride).sum::<usize>()]);
        for axis in (0..shape.len()).rev() {
            at[axis] += 1;
            if at[axis] < shape[axis] {
                break;
            }
            at[axis] = 0;
        }
    }
    Array { name, shape, values: out }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::{Reading, inspect_bytes};

    /// What tests/python/write_formats.py wrote with scipy.
    fn fixture(name: &str) -> Vec<u8> {
        let all = std::env::var_os("SCRNN_FIXTURES").map(PathBuf::from);
        let folder = all.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures"));
        std::fs::read(folder.join("mat").join(name)).unwrap()
    }

    fn read(name: &str, arrays: &[&str]) -> Result<Reading, FileError> {
        let arrays = arrays.iter().map(|name| (*name).to_owned()).collect();
        inspect_bytes(Path::new("x.mat"), &fixture(name), &Selection { arrays, ..Selection::default() })
    }

    #[test]
    fn matrices_of_one_length_are_one_recording() {
        for name in ["packed.mat", "plain.mat"] {
            let reading = read(name, &[]).unwrap();
            let channels = reading.data.channels();
            assert_eq!((channels[0].as_str(), channels[3].as_str(), channels[6].as_str()), ("q.0", "dq.0", "counts"));
            let row = reading.data.sequences()[0].sample(7).to_vec();
            assert_eq!(row[..3], [1.75, 1.78125, 1.8125], "{name}");
            assert_eq!(row[3..], [17.75, 17.78125, 17.8125, 7.0], "{name}");
            // t tells the time.
            assert!((reading.period.unwrap() - 0.02).abs() < 1e-9, "{name}");
            let said: Vec<String> = reading.remarks.iter().map(ToString::to_string).collect();
            assert!(said.iter().any(|remark| remark.contains("`info` holds a structure")), "{said:?}");
        }
    }

    #[test]
    fn a_cell_of_matrices_is_a_sequence_for_each() {
        let reading = read("cells.mat", &[]).unwrap();
        assert_eq!(reading.data.sequences().iter().map(|one| one.len()).collect::<Vec<_>>(), [5, 6]);
        assert_eq!(reading.data.sequences()[1].sample(5), [17.25, 17.28125, 17.3125]);
    }

    #[test]
    fn what_is_not_read_says_what_to_do() {
        let help = |name: &str| {
            let error = read(name, &[]).unwrap_err();
            format!("{error}: {}", miette::Diagnostic::help(&error).unwrap())
        };
        assert!(help("v4.mat").contains("-v7"), "{}", help("v4.mat"));
        assert!(help("structure.mat").contains("simplify_cells"), "{}", help("structure.mat"));
        assert!(help("sideways.mat").contains("axes"), "{}", help("sideways.mat"));
    }

    #[test]
    fn damaged_bytes_never_panic() {
        for name in ["packed.mat", "plain.mat", "cells.mat", "structure.mat"] {
            let bytes = fixture(name);
            crate::tests_random::damage(&bytes, 500, 16 << 20, |bytes| {
                let _ = Contents::read(bytes, &Budget::of(16 << 20));
                let _ = inspect_bytes(Path::new("x.mat"), bytes, &Selection::default());
            });
        }
    }
}
