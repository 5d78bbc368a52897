//! One numpy array: `.npy`.
//!
//! ```text
//! 93 "NUMPY" major minor, length of the header, {'descr': '<f8', 'fortran_order': False, 'shape': (12, 1000, 2), }, data
//! ```
//!
//! An array of three axes is sequences x steps x channels, of two steps x channels, of one the steps of one channel; see
//! [`crate::arrays`]. The fields of a structured array are arrays side by side. Nothing is allocated on the word of a header:
//! its promise is compared with the bytes that are there.

use std::io::Read;

use scrnn::dataset::Sequence;

use crate::arrays::{Array, Texts, shape_text, to_samples};
use crate::budget::{Budget, OverBudget};
use crate::literal::Literal;
use crate::samples::Samples;
use crate::source::Source;
use crate::{ArrayProblem, Field, FileError, Selection};

const MAGIC: &[u8] = b"\x93NUMPY";
/// numpy itself refuses to read a longer header.
const LONGEST_HEADER: usize = 10_000;

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Contents {
    /// An array, or one for each field of a structured one.
    Arrays(Vec<Array>),
    /// Texts.
    Texts(Vec<String>),
    /// Something that is neither: the type as numpy names it.
    Other(String),
}

/// Why a file cannot be read.
#[derive(Debug)]
pub enum Refused {
    /// It is not what it should be.
    Array(ArrayProblem),
    /// It would fill the memory.
    Budget(OverBudget),
    /// The disk, or what it is packed in, does not give its bytes.
    Unread(std::io::Error),
}

impl From<ArrayProblem> for Refused {
    fn from(problem: ArrayProblem) -> Self {
        Self::Array(problem)
    }
}

impl From<OverBudget> for Refused {
    fn from(problem: OverBudget) -> Self {
        Self::Budget(problem)
    }
}

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let path = source.name();
    let parsed = match source.file()? {
        Some((mut file, length)) => parse(&mut file, Length::Exact(length), source.budget()),
        None => {
            let bytes = source.bytes()?;
            parse(&mut &*bytes, Length::Exact(bytes.len() as u64), source.budget())
        }
    };
    let contents = parsed.map_err(|refused| match refused {
        Refused::Unread(error) => FileError::disk("read", source.path(), error),
        refused => file_error(path, path, refused),
    })?;
    let wrong = |found: String| file_error(path, path, ArrayProblem::Type { found }.into());
    match contents {
        Contents::Arrays(arrays) => {
            if let [Array { shape, .. }] = arrays.as_slice()
                && shape.is_empty()
            {
                let needed = "at least one axis";
                return Err(file_error(path, path, ArrayProblem::Shape { found: shape_text(shape), needed }.into()));
            }
            to_samples((path, source.budget()), arrays, &[] as &[Texts], selection)
        }
        Contents::Texts(_) => Err(wrong("text".to_owned())),
        Contents::Other(found) => Err(wrong(found)),
    }
}

/// The bytes of a file of the only field.
pub fn write(path: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    let [field] = fields else {
        return Err(FileError::SeveralFields { path: path.to_owned(), found: fields.len() });
    };
    let sequences = field.data.sequences();
    let lengths = || sequences.iter().map(Sequence::len);
    let (shortest, longest) = (lengths().min().unwrap_or(0), lengths().max().unwrap_or(0));
    if shortest != longest {
        return Err(FileError::Ragged { path: path.to_owned(), shortest, longest });
    }
    let values = sequences.iter().flat_map(|sequence| sequence.values().iter().copied());
    Ok(array_bytes(&[sequences.len(), longest, field.data.channels().len()], values))
}

/// The problem with a hint at its cure. `file` is the file that the array at `path` is in.
pub fn file_error(file: &str, path: &str, refused: Refused) -> FileError {
    let problem = match refused {
        Refused::Array(problem) => problem,
        Refused::Budget(problem) => return FileError::OverBudget { path: path.to_owned(), problem },
        Refused::Unread(source) => {
            return FileError::Archive { path: file.to_owned(), source: zip::result::ZipError::Io(source) };
        }
    };
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let help = match &problem {
        ArrayProblem::Type { found } if found.contains('O') => {
            let member = path.strip_prefix(file).and_then(|rest| rest.split('`').nth(1));
            let member = member.map_or(String::new(), |name| format!("[\"{}\"]", name.trim_end_matches(".npy")));
            let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
            Some(format!(
                "these are Python objects, which only Python can read: `import numpy; \
                 d = numpy.load(\"{name}\", allow_pickle=True){member}`, then `numpy.savez(\"{stem}_arrays.npz\", *d)` for \
                 a list of arrays, `numpy.savez(\"{stem}_arrays.npz\", **d.item())` for a dictionary of them"
            ))
        }
        ArrayProblem::Type { found } if found.contains(['M', 'm']) => {
            Some("these are dates; save numbers, e.g. array.astype(\"int64\")".to_owned())
        }
        ArrayProblem::Type { found } if found.contains('c') => {
            Some("these are complex numbers; save numpy.stack([array.real, array.imag], axis=-1)".to_owned())
        }
        ArrayProblem::Type { .. } => Some("save numbers, e.g. by array.astype(float)".to_owned()),
        ArrayProblem::Shape { .. } => Some("axes are sequences x steps x channels, or steps x channels".to_owned()),
        ArrayProblem::Size { .. } => Some("the file may be cut off, or hold more than one array".to_owned()),
        _ => None,
    };
    FileError::Array { path: path.to_owned(), problem, help }
}

/// An array of float64, as numpy.save writes it.
pub fn array_bytes(shape: &[usize], values: impl Iterator<Item = f64>) -> Vec<u8> {
    let mut bytes = beginning("<f8", shape);
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

/// The bytes of an array of texts, as wide as the longest.
pub fn text_bytes(texts: &[String]) -> Vec<u8> {
    let width = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
    let mut bytes = beginning(&format!("<U{width}"), &[texts.len()]);
    for text in texts {
        let letters = text.chars().map(u32::from).chain(std::iter::repeat(0));
        bytes.extend(letters.take(width).flat_map(u32::to_le_bytes));
    }
    bytes
}

/// Magic, version and header.
fn beginning(kind: &str, shape: &[usize]) -> Vec<u8> {
    let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let lengths = if shape.len() == 1 { lengths.trim_end() } else { lengths.trim_end_matches(", ") };
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({lengths}), }}");
    let unpadded = MAGIC.len() + 4 + header.len() + 1;
    header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    // Three lengths of twenty digits are far from 65535.
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes
}

/// What is known of the length of an array's bytes before they are read.
#[derive(Debug, Clone, Copy)]
pub enum Length {
    /// There are so many.
    Exact(u64),
    /// There are at most so many: what is packed unpacks to no more.
    AtMost(u64),
}

/// Bytes that are read at a time.
const PIECE: usize = 1 << 18;

/// Reads an array that fills what is read from `from`, in one pass into its place.
pub fn parse(from: &mut dyn Read, length: Length, budget: &Budget) -> Result<Contents, Refused> {
    let header = Header::read(from, length)?;
    let Some((Header { kind, shape, column_major }, begun)) = header else { return Err(ArrayProblem::NotNumpy.into()) };
    let count = shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
    let size = match &kind {
        Kind::Plain(element) => element.size,
        Kind::Record(record) => record.size,
        Kind::Other(name) => return Ok(Contents::Other(name.clone())),
    };
    let promised = count.and_then(|count| count.checked_mul(size));
    let mut data = Data { from, left: promised.unwrap_or(0), piece: Vec::new() };
    let differs = |held: u64| {
        let promised = promised.map_or_else(|| "over 2^64".to_owned(), |promised| promised.to_string());
        Refused::Array(ArrayProblem::Size { promised, held: usize::try_from(held).unwrap_or(usize::MAX) })
    };
    // What is surely not there is not tried.
    let likely = match length {
        Length::Exact(all) if promised.map(|size| size as u64) != Some(all.saturating_sub(begun)) => {
            return Err(differs(all.saturating_sub(begun)));
        }
        Length::AtMost(most) if promised.is_none_or(|size| size as u64 > most) => {
            data.left = 0;
            return Err(differs(data.rest(budget)?));
        }
        _ => promised.unwrap_or(0),
    };
    let count = count.unwrap_or(0);
    if count == 0 || likely == 0 {
        return Err(match data.rest(budget)? {
            0 => ArrayProblem::Shape { found: shape_text(&shape), needed: "at least one sample" }.into(),
            more => differs(more),
        });
    }
    let contents = match kind {
        Kind::Other(name) => return Ok(Contents::Other(name)),
        Kind::Plain(Element { kind: Number::Text(letter), .. }) => {
            budget.take(likely.saturating_add(64_usize.saturating_mul(count)))?;
            let mut texts = Vec::new();
            data.pieces(size, &mut |bytes| texts.extend(bytes.chunks_exact(size).map(|bytes| text(bytes, letter))))?;
            Contents::Texts(texts)
        }
        Kind::Plain(element) => {
            budget.take_values::<f64>(count)?;
            // Whether a long double is one of Intel's shows from all of them together.
            let piece = if matches!(element.kind, Number::Long) { likely } else { size };
            let mut values = Vec::with_capacity(count);
            if column_major {
                values.resize(count, 0.0);
                let mut at = Turned::new(&shape);
                data.pieces(piece, &mut |bytes| {
                    element.numbers(bytes).into_iter().for_each(|value| values[at.next()] = value);
                })?;
            } else {
                data.pieces(piece, &mut |bytes| element.append(bytes, &mut values))?;
            }
            Contents::Arrays(vec![Array { name: String::new(), shape, values }])
        }
        Kind::Record(record) => {
            let mut fields = Vec::new();
            for field in record.fields {
                let each: usize = field.shape.iter().product();
                if each > 0 && !matches!(field.element.kind, Number::Text(_)) {
                    budget.take_values::<f64>(count.saturating_mul(each))?;
                    fields.push((each, Vec::with_capacity(count.saturating_mul(each)), field));
                }
            }
            let long = fields.iter().any(|(_, _, field)| matches!(field.element.kind, Number::Long));
            data.pieces(if long { likely } else { size }, &mut |bytes| {
                for (each, values, RecordField { element, offset, .. }) in &mut fields {
                    for row in bytes.chunks_exact(size) {
                        let cells = offset.checked_add(*each * element.size).and_then(|end| row.get(*offset..end));
                        element.append(cells.unwrap_or_default(), values);
                    }
                }
            })?;
            let array = |(_, values, field): (usize, Vec<f64>, RecordField)| Array {
                name: field.name,
                shape: shape.iter().copied().chain(field.shape).collect(),
                values,
            };
            Contents::Arrays(fields.into_iter().map(array).collect())
        }
    };
    let missing = data.left as u64;
    match data.rest(budget)? {
        more if missing > 0 || more > 0 => Err(differs(likely as u64 - missing + more)),
        _ => Ok(contents),
    }
}

/// The bytes behind a header.
struct Data<'r> {
    from: &'r mut dyn Read,
    /// Bytes that are promised and were not read.
    left: usize,
    piece: Vec<u8>,
}

impl Data<'_> {
    /// Calls `each` with all bytes that are promised, in pieces of a multiple of `size` bytes; with fewer if they end early.
    fn pieces(&mut self, size: usize, each: &mut dyn FnMut(&[u8])) -> Result<(), Refused> {
        let piece = (PIECE - PIECE % size.max(1)).max(size);
        while self.left > 0 {
            let wanted = piece.min(self.left);
            self.piece.clear();
            self.from.take(wanted as u64).read_to_end(&mut self.piece).map_err(Refused::Unread)?;
            self.left -= self.piece.len();
            each(&self.piece);
            if self.piece.len() < wanted {
                break;
            }
        }
        Ok(())
    }

    /// How many bytes there are yet, but no more than the budget has.
    fn rest(&mut self, budget: &Budget) -> Result<u64, Refused> {
        let mut all = self.from.take(budget.left().saturating_add(1));
        std::io::copy(&mut all, &mut std::io::sink()).map_err(Refused::Unread)
    }
}

/// The places of values that come with the first axis fastest (Fortran's order), where the last is to be fastest.
struct Turned<'s> {
    shape: &'s [usize],
    strides: Vec<usize>,
    index: Vec<usize>,
    at: usize,
}

impl<'s> Turned<'s> {
    fn new(shape: &'s [usize]) -> Self {
        let strides = (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()).collect();
        Self { shape, strides, index: vec![0; shape.len()], at: 0 }
    }

    /// The place of the next value; behind the last, again that of the first.
    fn next(&mut self) -> usize {
        let at = self.at;
        for axis in 0..self.shape.len() {
            self.index[axis] += 1;
            self.at += self.strides[axis];
            if self.index[axis] < self.shape[axis] {
                break;
            }
            self.at -= self.strides[axis] * self.index[axis];
            self.index[axis] = 0;
        }
        at
    }
}

/// numpy's texts: of bytes (`S`) or of code points in four bytes (`U`), filled up with zeros.
fn text(bytes: &[u8], letter: u8) -> String {
    let clean = match letter {
        b'S' => String::from_utf8_lossy(bytes).into_owned(),
        _ => {
            let points = bytes.as_chunks::<4>().0.iter().map(|point| u32::from_le_bytes(*point));
            points.map(|point| char::from_u32(point).unwrap_or('\u{fffd}')).collect()
        }
    };
    clean.trim_end_matches('\0').to_owned()
}

/// What the dictionary in a header says.
struct Header {
    kind: Kind,
    shape: Vec<usize>,
    column_major: bool,
}

/// What an array's elements are.
enum Kind {
    Plain(Element),
    Record(Record),
    Other(String),
}

/// Fields side by side.
struct Record {
    fields: Vec<RecordField>,
    size: usize,
}

struct RecordField {
    name: String,
    element: Element,
    shape: Vec<usize>,
    offset: usize,
}

impl Header {
    /// Reads magic, version and header, and how many bytes they are; None if the magic is missing.
    fn read(from: &mut dyn Read, length: Length) -> Result<Option<(Self, u64)>, Refused> {
        let ends_early = ArrayProblem::Header("it ends early");
        let mut head = Vec::new();
        let mut more = |head: &mut Vec<u8>, count: usize| {
            from.take(count as u64).read_to_end(head).map_err(Refused::Unread).map(|read| read == count)
        };
        if !more(&mut head, MAGIC.len())? || head != MAGIC {
            return Ok(None);
        }
        let early = || Err(Refused::Array(ends_early.clone()));
        if !more(&mut head, 2)? {
            return early();
        }
        let (major, minor) = (head[6], head[7]);
        if !matches!((major, minor), (1..=3, 0)) {
            return Err(ArrayProblem::Version { major, minor }.into());
        }
        let width = if major == 1 { 2 } else { 4 };
        if !more(&mut head, width)? {
            return early();
        }
        let size = head[8..].iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte));
        if size > LONGEST_HEADER {
            return Err(ArrayProblem::Header("it is longer than 10000 bytes").into());
        }
        let begun = head.len();
        let (Length::Exact(all) | Length::AtMost(all)) = length;
        if all < (begun + size) as u64 || !more(&mut head, size)? {
            return early();
        }
        let text = std::str::from_utf8(&head[begun..]).map_err(|_| ArrayProblem::Header("it is not text"))?;
        Ok(Some((Self::parse(text)?, head.len() as u64)))
    }

    fn parse(text: &str) -> Result<Self, ArrayProblem> {
        let damaged = ArrayProblem::Header;
        let header = Literal::parse(text).ok_or(damaged("it is no dictionary of Python"))?;
        let descr = header.get("descr").ok_or(damaged("it has no `descr`"))?;
        let order = header.get("fortran_order").ok_or(damaged("it has no `fortran_order`"))?;
        let Literal::Truth(column_major) = *order else {
            return Err(damaged("`fortran_order` is neither True nor False"));
        };
        let shape = header.get("shape").ok_or(damaged("it has no `shape`"))?;
        let shape = shape.list().and_then(|_| shape.lengths()).ok_or(damaged("`shape` is not a tuple of lengths"))?;
        if shape.len() > 32 {
            return Err(damaged("`shape` has more than 32 axes"));
        }
        Ok(Self { kind: kind(descr)?, shape, column_major })
    }
}

fn kind(descr: &Literal) -> Result<Kind, ArrayProblem> {
    if let Some(name) = descr.text() {
        return Ok(Element::of(name).map_or_else(|| Kind::Other(name.to_owned()), Kind::Plain));
    }
    let fields = descr.list().ok_or(ArrayProblem::Header("`descr` is neither a type nor a list of fields"))?;
    let mut record = Record { fields: Vec::new(), size: 0 };
    for field in fields {
        let parts = field.list().unwrap_or_default();
        // A title may stand before the name.
        let name = parts.first().and_then(|name| name.text().or_else(|| name.list()?.last()?.text()));
        let (Some(name), Some(of)) = (name, parts.get(1)) else {
            return Err(ArrayProblem::Header("a field has no name or no type"));
        };
        let Some(of) = of.text() else { return Ok(Kind::Other("records within records".to_owned())) };
        let shape = match parts.get(2) {
            Some(shape) => shape
                .lengths()
                .filter(|lengths| lengths.len() <= 32)
                .ok_or(ArrayProblem::Header("a field's shape is not a tuple of up to 32 lengths"))?,
            None => Vec::new(),
        };
        let each = shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
        let size = |element: usize| {
            each.and_then(|each| each.checked_mul(element)).and_then(|size| size.checked_add(record.size))
        };
        let too_large = ArrayProblem::Header("a field's shape is too large");
        // Padding between fields.
        if let Some(length) = of.trim_start_matches(['<', '>', '|', '=']).strip_prefix('V') {
            let length = length.parse().map_err(|_| ArrayProblem::Header("a field's length is no number"))?;
            record.size = size(length).ok_or(too_large)?;
            continue;
        }
        let Some(element) = Element::of(of) else { return Ok(Kind::Other(format!("{of} in field {name}"))) };
        let next = size(element.size).ok_or(too_large)?;
        record.fields.push(RecordField { name: name.to_owned(), element, shape, offset: record.size });
        record.size = next;
    }
    if record.fields.is_empty() {
        Ok(Kind::Other("a record without fields".to_owned()))
    } else {
        Ok(Kind::Record(record))
    }
}

/// An element's type as numpy names it: `<f8` is a float of 8 bytes, the lowest first.
#[derive(Debug, Clone, Copy)]
struct Element {
    kind: Number,
    size: usize,
    big_endian: bool,
}

/// How the bytes of one element, the lowest first, make a number.
#[derive(Debug, Clone, Copy)]
enum Number {
    One(fn([u8; 1]) -> f64),
    Two(fn([u8; 2]) -> f64),
    Four(fn([u8; 4]) -> f64),
    Eight(fn([u8; 8]) -> f64),
    /// A float of more than 8 bytes.
    Long,
    /// Text, of this letter.
    Text(u8),
}

impl Element {
    fn of(name: &str) -> Option<Self> {
        let bare = name.trim_start_matches(['<', '>', '|', '=']);
        let (kind, size) = match bare {
            "f2" => (Number::Two(|bytes| half(u16::from_le_bytes(bytes))), 2),
            "f4" => (Number::Four(|bytes| f32::from_le_bytes(bytes).into()), 4),
            "f8" => (Number::Eight(f64::from_le_bytes), 8),
            "f12" => (Number::Long, 12),
            "f16" => (Number::Long, 16),
            "i1" => (Number::One(|bytes| i8::from_le_bytes(bytes).into()), 1),
            "i2" => (Number::Two(|bytes| i16::from_le_bytes(bytes).into()), 2),
            "i4" => (Number::Four(|bytes| i32::from_le_bytes(bytes).into()), 4),
            "i8" => (Number::Eight(|bytes| i64::from_le_bytes(bytes) as f64), 8),
            "u1" | "b1" => (Number::One(|[byte]| byte.into()), 1),
            "u2" => (Number::Two(|bytes| u16::from_le_bytes(bytes).into()), 2),
            "u4" => (Number::Four(|bytes| u32::from_le_bytes(bytes).into()), 4),
            "u8" => (Number::Eight(|bytes| u64::from_le_bytes(bytes) as f64), 8),
            _ => {
                let (letter, length) = bare.split_at_checked(1)?;
                let length: usize = length.parse().ok().filter(|length| *length > 0)?;
                match letter {
                    "S" => (Number::Text(b'S'), length),
                    "U" => (Number::Text(b'U'), length.checked_mul(4)?),
                    _ => return None,
                }
            }
        };
        Some(Self { kind, size, big_endian: name.starts_with('>') })
    }

    fn numbers(&self, data: &[u8]) -> Vec<f64> {
        let mut numbers = Vec::with_capacity(data.len() / self.size.max(1));
        self.append(data, &mut numbers);
        numbers
    }

    /// Appends the numbers that these bytes are.
    fn append(&self, data: &[u8], into: &mut Vec<f64>) {
        fn all<const N: usize>(data: &[u8], big_endian: bool, number: fn([u8; N]) -> f64, into: &mut Vec<f64>) {
            let ordered = |mut bytes: [u8; N]| {
                if big_endian {
                    bytes.reverse();
                }
                number(bytes)
            };
            into.extend(data.as_chunks::<N>().0.iter().copied().map(ordered));
        }
        match self.kind {
            Number::One(number) => all(data, self.big_endian, number, into),
            Number::Two(number) => all(data, self.big_endian, number, into),
            Number::Four(number) => all(data, self.big_endian, number, into),
            Number::Eight(number) => all(data, self.big_endian, number, into),
            Number::Long => into.extend(long(data, self.size, self.big_endian)),
            Number::Text(_) => {}
        }
    }
}

/// IEEE 754's binary16: a sign, 5 bits of exponent, 10 of fraction.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2.0_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2.0_f64.powi(exponent - 15),
    }
}

/// C's `long double`: of 80 bits with an explicit leading one where Intel made the processor, else of 128 (binary128). The
/// leading one is there in all numbers, or it is not.
fn long(data: &[u8], size: usize, big_endian: bool) -> Vec<f64> {
    let mut wide: Vec<[u8; 16]> = Vec::with_capacity(data.len() / size);
    for bytes in data.chunks_exact(size) {
        let mut all = [0; 16];
        all[..size].copy_from_slice(bytes);
        if big_endian {
            all[..size].reverse();
        }
        wide.push(all);
    }
    let bits = |bytes: &[u8; 16]| {
        (u64::from_le_bytes(bytes[..8].try_into().unwrap_or_default()), u16::from_le_bytes([bytes[8], bytes[9]]))
    };
    let leading_one = |bytes: &[u8; 16]| {
        let (mantissa, exponent) = bits(bytes);
        (mantissa >> 63 == 1) == (exponent & 0x7fff != 0)
    };
    let padded = wide.iter().all(|bytes| bytes[10..] == [0; 6]);
    let filled = wide.iter().any(|bytes| bits(bytes).0 != 0);
    let is_80 = padded || filled && wide.iter().all(leading_one);
    let number = |sign: bool, exponent: i32, fraction: f64| {
        // In two steps: 2^exponent alone may be beyond all that can be held.
        let half = exponent / 2;
        let size = fraction * 2.0_f64.powi(half) * 2.0_f64.powi(exponent - half);
        if sign { -size } else { size }
    };
    let of_80 = |bytes: &[u8; 16]| {
        let (mantissa, exponent) = bits(bytes);
        let (sign, exponent) = (exponent >> 15 == 1, i32::from(exponent & 0x7fff));
        match exponent {
            0x7fff if mantissa << 1 == 0 => number(sign, 0, f64::INFINITY),
            0x7fff => f64::NAN,
            _ => number(sign, exponent - 16383 - 63, mantissa as f64),
        }
    };
    let of_128 = |bytes: &[u8; 16]| {
        let all = u128::from_le_bytes(*bytes);
        let (sign, exponent, fraction) = (all >> 127 == 1, (all >> 112 & 0x7fff) as i32, all & ((1 << 112) - 1));
        match exponent {
            0x7fff if fraction == 0 => number(sign, 0, f64::INFINITY),
            0x7fff => f64::NAN,
            0 => number(sign, -16382 - 112, fraction as f64),
            _ => number(sign, exponent - 16383 - 112, (fraction | 1 << 112) as f64),
        }
    };
    wide.iter().map(|bytes| if is_80 { of_80(bytes) } else { of_128(bytes) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with this header and data.
    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    /// As a file, and as what is unpacked piece by piece: that must be one.
    fn parse(bytes: &[u8], budget: &Budget) -> Result<Contents, Refused> {
        let length = bytes.len() as u64;
        let exact = super::parse(&mut &*bytes, Length::Exact(length), budget);
        let packed = super::parse(&mut &*bytes, Length::AtMost(length + 100), &Budget::of_file(length));
        if let (Ok(exact), Ok(packed)) = (&exact, &packed) {
            assert_eq!(exact, packed);
        } else {
            assert_eq!(format!("{exact:?}"), format!("{packed:?}"));
        }
        exact
    }

    fn arrays(bytes: &[u8]) -> Vec<Array> {
        match parse(bytes, &Budget::of_file(bytes.len() as u64)).unwrap() {
            Contents::Arrays(arrays) => arrays,
            other => panic!("{other:?}"),
        }
    }

    fn problem(bytes: &[u8]) -> ArrayProblem {
        match parse(bytes, &Budget::of_file(bytes.len() as u64)) {
            Err(Refused::Array(problem)) => problem,
            other => panic!("{other:?}"),
        }
    }

    fn values(descr: &str, data: &[u8], count: usize) -> Vec<f64> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({count},), }}\n");
        arrays(&file(&header, data)).remove(0).values
    }

    #[test]
    fn every_type_is_read_in_both_byte_orders() {
        assert_eq!(values("<f8", &1.1_f64.to_le_bytes(), 1), [1.1]);
        assert_eq!(values(">f8", &1.1_f64.to_be_bytes(), 1), [1.1]);
        assert_eq!(values(">f4", &1.5_f32.to_be_bytes(), 1), [1.5]);
        assert_eq!(values("<i2", &(-2_i16).to_le_bytes(), 1), [-2.0]);
        assert_eq!(values(">i4", &(-70_000_i32).to_be_bytes(), 1), [-70_000.0]);
        assert_eq!(values("<i8", &(-5_000_000_000_i64).to_le_bytes(), 1), [-5e9]);
        assert_eq!(values("<u2", &65_535_u16.to_le_bytes(), 1), [65_535.0]);
        assert_eq!(values("<u4", &4_000_000_000_u32.to_le_bytes(), 1), [4e9]);
        assert_eq!(values("<u8", &u64::MAX.to_le_bytes(), 1), [2.0_f64.powi(64)]);
        assert_eq!(values("|i1", &[255, 1], 2), [-1.0, 1.0]);
        assert_eq!(values("|u1", &[255, 1], 2), [255.0, 1.0]);
        assert_eq!(values("|b1", &[0, 1], 2), [0.0, 1.0]);
    }

    #[test]
    fn fortran_order_is_turned_around() {
        // Element (s, t, i) of shape (2, 3, 2) is 100 s + 10 t + i.
        let mut data = Vec::new();
        for i in 0..2_u8 {
            for t in 0..3_u8 {
                data.extend((0..2_u8).map(|s| 100 * s + 10 * t + i));
            }
        }
        let array = arrays(&file("{'descr':'|u1','fortran_order':True,'shape':(2,3,2)}", &data)).remove(0);
        assert_eq!(array.shape, [2, 3, 2]);
        assert_eq!(array.values, [0., 1., 10., 11., 20., 21., 100., 101., 110., 111., 120., 121.]);
    }

    #[test]
    fn the_header_may_be_written_in_other_ways() {
        let header = "{\"shape\": (1L, 2L), 'fortran_order' : False, \"descr\": \"|u1\"}";
        let array = arrays(&file(header, &[7, 8])).remove(0);
        assert_eq!((array.shape, array.values), (vec![1, 2], vec![7.0, 8.0]));
    }

    #[test]
    fn a_promise_that_the_file_does_not_keep_is_refused() {
        let header = |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
        let problem = |shape: &str, data: &[u8]| problem(&file(&header(shape), data)).to_string();
        assert_eq!(problem("(3,)", &[0; 16]), "the array's header promises 24 bytes, but 16 follow");
        assert_eq!(problem("(1,)", &[0; 16]), "the array's header promises 8 bytes, but 16 follow");
        assert!(problem("(1000000000000, 1000000, 1)", &[0; 8]).contains("promises 8000000000000000000 bytes"));
        assert!(problem("(18446744073709551615, 2)", &[0; 8]).contains("over 2^64"));
        assert!(problem("(0, 2)", &[]).starts_with("an array of shape (0, 2)"));
    }

    #[test]
    fn what_is_not_numbers_is_named() {
        let of_type = |descr: &str| {
            let bytes = file(&format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (1,)}}"), &[0; 8]);
            parse(&bytes, &Budget::of(1000)).unwrap()
        };
        assert_eq!(of_type("'<M8[D]'"), Contents::Other("<M8[D]".into()));
        assert_eq!(of_type("[('a', '|O')]"), Contents::Other("|O in field a".into()));
        assert_eq!(problem(b"y1,y2\n"), ArrayProblem::NotNumpy);
        assert_eq!(problem(b"\x93NUMPY\x01"), ArrayProblem::Header("it ends early"));
        assert_eq!(problem(b"\x93NUMPY\x04\x00"), ArrayProblem::Version { major: 4, minor: 0 });
        assert_eq!(
            problem(b"\x93NUMPY\x02\x00\xff\xff\xff\xff"),
            ArrayProblem::Header("it is longer than 10000 bytes")
        );
        let objects = ArrayProblem::Type { found: "|O".into() }.into();
        let help = miette::Diagnostic::help(&file_error("a/x.npy", "a/x.npy", objects)).unwrap().to_string();
        assert!(
            help.contains("numpy.load(\"x.npy\", allow_pickle=True)`, then `numpy.savez(\"x_arrays.npz\", *d)`"),
            "{help}"
        );
        let objects = ArrayProblem::Type { found: "|O".into() }.into();
        let help = file_error("a/x.npz", "a/x.npz, array `data.npy`", objects);
        let help = miette::Diagnostic::help(&help).unwrap().to_string();
        assert!(help.contains("allow_pickle=True)[\"data\"]`") && help.contains("**d.item()"), "{help}");
    }

    #[test]
    fn floats_of_other_sizes_are_read() {
        let halves: Vec<u8> =
            [0x3c00_u16, 0xc000, 0x0001, 0x3555, 0x7c00].iter().flat_map(|bits| bits.to_le_bytes()).collect();
        assert_eq!(values("<f2", &halves, 5), [1.0, -2.0, 2.0_f64.powi(-24), 0.333_251_953_125, f64::INFINITY]);
        // -0.5 and 3, of 80 bits in 16 bytes.
        let mut intel = [0; 32];
        intel[7] = 0x80;
        intel[8..10].copy_from_slice(&0xbffe_u16.to_le_bytes());
        intel[23] = 0xc0;
        intel[24..26].copy_from_slice(&0x4000_u16.to_le_bytes());
        assert_eq!(values("<f16", &intel, 2), [-0.5, 3.0]);
        let quad = [(0xbffe_u128 << 112), (0x4000_u128 << 112) + (1 << 111)];
        let quad: Vec<u8> = quad.iter().flat_map(|bits| bits.to_le_bytes()).collect();
        assert_eq!(values("<f16", &quad, 2), [-0.5, 3.0]);
    }

    #[test]
    fn the_fields_of_records_are_arrays() {
        let header = "{'descr': [('t', '<f8'), ('name', '<U2'), ('', '|V2'), ('q', '<i2', (2,))], 'fortran_order': False, 'shape': (2,)}";
        let mut data = Vec::new();
        for row in 0..2_i16 {
            data.extend(f64::from(row).to_le_bytes());
            data.extend([0; 10]);
            data.extend((10 + row).to_le_bytes());
            data.extend((20 + row).to_le_bytes());
        }
        let fields = arrays(&file(header, &data));
        assert_eq!(fields[0], Array { name: "t".into(), shape: vec![2], values: vec![0.0, 1.0] });
        assert_eq!(fields[1], Array { name: "q".into(), shape: vec![2, 2], values: vec![10.0, 20.0, 11.0, 21.0] });
        assert_eq!(fields.len(), 2);
        let huge = "{'descr': [('q', '<f8', (4611686018427387904, 4))], 'fortran_order': False, 'shape': (1,)}";
        assert_eq!(problem(&file(huge, &[0; 8])), ArrayProblem::Header("a field's shape is too large"));
        let zero = "{'descr': [('q', '<f8', (0,))], 'fortran_order': False, 'shape': (4611686018427387904,)}";
        assert!(parse(&file(zero, &[]), &Budget::of(1000)).is_err());
    }

    #[test]
    fn texts_are_read_as_texts() {
        let header = "{'descr': '<U2', 'fortran_order': False, 'shape': (2,)}";
        let data: Vec<u8> = ['a', 'b', 'c', '\0'].iter().flat_map(|&c| u32::from(c).to_le_bytes()).collect();
        assert_eq!(
            parse(&file(header, &data), &Budget::of(10_000)).unwrap(),
            Contents::Texts(vec!["ab".into(), "c".into()])
        );
    }
}
