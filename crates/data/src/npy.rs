//! One numpy array: `.npy`.
//!
//! ```text
//! 93 "NUMPY" major minor, length of the header, {'descr': '<f8', 'fortran_order': False, 'shape': (12, 1000, 2), }, data
//! ```
//!
//! An array of three axes is sequences x steps x channels, of two steps x channels, of one the steps of one channel.
//! Nothing is allocated on the word of a header: its promise is compared with the bytes that are there.

use scrnn::dataset::Sequence;

use crate::format::Source;
use crate::samples::Samples;
use crate::{ArrayProblem, Field, FileError, Selection};

const MAGIC: &[u8] = b"\x93NUMPY";
/// numpy itself refuses to read a longer header.
const LONGEST_HEADER: usize = 10_000;

/// Numbers on up to three axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// How many axes the file has.
    pub axes: usize,
    /// Sequences, steps, channels; missing axes have length 1.
    pub shape: [usize; 3],
    /// The last axis varies fastest.
    pub values: Vec<f64>,
}

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, _: &Selection) -> Result<Samples, FileError> {
    let Array { shape: [_, steps, channels], values, .. } =
        parse(&source.bytes()?).map_err(|problem| file_error(source.name(), problem))?;
    let sequences = values.chunks_exact(steps * channels).map(<[f64]>::to_vec);
    let sequences = sequences.enumerate().map(|(s, values)| ((s + 1).to_string(), values));
    Ok(Samples::numbered(channels, sequences.collect()))
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

/// The problem with a hint at its cure.
pub fn file_error(path: &str, problem: ArrayProblem) -> FileError {
    let help = match &problem {
        ArrayProblem::Type { found } if found.contains('O') => {
            Some("these are Python objects; save sequences of different lengths by numpy.savez(path, *sequences)")
        }
        ArrayProblem::Type { .. } => Some("convert it by array.astype(float)"),
        ArrayProblem::Shape { .. } => Some("axes are sequences x steps x channels, or steps x channels"),
        ArrayProblem::Size { .. } => Some("the file may be cut off, or hold more than one array"),
        _ => None,
    };
    FileError::Array { path: path.to_owned(), problem, help }
}

/// An array of float64, as numpy.save writes it.
pub fn array_bytes(shape: &[usize], values: impl Iterator<Item = f64>) -> Vec<u8> {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", lengths.join(", "));
    let unpadded = MAGIC.len() + 4 + header.len() + 1;
    header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    // Three lengths of twenty digits are far from 65535.
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

/// Reads an array that fills `bytes`.
pub fn parse(bytes: &[u8]) -> Result<Array, ArrayProblem> {
    let after_magic = bytes.strip_prefix(MAGIC).ok_or(ArrayProblem::NotNumpy)?;
    let ends_early = ArrayProblem::Header("it ends early");
    let (length, rest) = match *after_magic {
        [1, 0, a, b, ref rest @ ..] => (usize::from(u16::from_le_bytes([a, b])), rest),
        [2 | 3, 0, a, b, c, d, ref rest @ ..] => (u32::from_le_bytes([a, b, c, d]) as usize, rest),
        [1..=3, 0, ..] => return Err(ends_early),
        [major, minor, ..] => return Err(ArrayProblem::Version { major, minor }),
        _ => return Err(ends_early),
    };
    if length > LONGEST_HEADER {
        return Err(ArrayProblem::Header("it is longer than 10000 bytes"));
    }
    let (header, data) = rest.split_at_checked(length).ok_or(ends_early)?;
    let header = std::str::from_utf8(header).map_err(|_| ArrayProblem::Header("it is not text"))?;
    let Header { kind, shape: lengths, column_major } = Header::parse(header)?;

    let shape = match *lengths {
        [t] => [1, t, 1],
        [t, i] => [1, t, i],
        [s, t, i] => [s, t, i],
        _ => return Err(shape_problem(&lengths, "one, two or three axes")),
    };
    let element = kind.element().ok_or_else(|| ArrayProblem::Type { found: kind.name.to_owned() })?;
    let promised = shape.iter().try_fold(element.size(), |product, &length| product.checked_mul(length));
    if promised != Some(data.len()) {
        let promised = promised.map_or_else(|| "over 2^64".to_owned(), |promised| promised.to_string());
        return Err(ArrayProblem::Size { promised, held: data.len() });
    }
    if data.is_empty() {
        return Err(shape_problem(&lengths, "at least one sample"));
    }
    let values = element.numbers(data, kind.big_endian());
    let values = if column_major { row_major(shape, &values) } else { values };
    Ok(Array { axes: lengths.len(), shape, values })
}

fn shape_problem(lengths: &[usize], needed: &'static str) -> ArrayProblem {
    let found: Vec<String> = lengths.iter().map(usize::to_string).collect();
    ArrayProblem::Shape { found: format!("({})", found.join(", ")), needed }
}

/// From the first axis fastest (Fortran's order) to the last axis fastest.
fn row_major([sequences, steps, channels]: [usize; 3], values: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(values.len());
    for s in 0..sequences {
        for t in 0..steps {
            out.extend((0..channels).map(|i| values[s + sequences * (t + steps * i)]));
        }
    }
    out
}

/// What the dictionary in a header says.
struct Header<'a> {
    kind: Kind<'a>,
    shape: Vec<usize>,
    column_major: bool,
}

impl<'a> Header<'a> {
    fn parse(text: &'a str) -> Result<Self, ArrayProblem> {
        let entry = |key: &str, problem| {
            let found = ['\'', '"'].into_iter().find_map(|quote| text.split_once(&format!("{quote}{key}{quote}")));
            let value = found.and_then(|(_, rest)| rest.trim_start().strip_prefix(':')).map(str::trim_start);
            value.ok_or(ArrayProblem::Header(problem))
        };
        let descr = entry("descr", "it has no `descr`")?;
        let name = ['\'', '"'].into_iter().find_map(|quote| descr.strip_prefix(quote)?.split_once(quote));
        let Some((name, _)) = name else {
            return Err(ArrayProblem::Type { found: "a record".to_owned() });
        };
        let order = entry("fortran_order", "it has no `fortran_order`")?;
        let column_major = order.starts_with("True");
        if !column_major && !order.starts_with("False") {
            return Err(ArrayProblem::Header("`fortran_order` is neither True nor False"));
        }
        let shape = entry("shape", "it has no `shape`")?;
        let shape = shape.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(lengths, _)| lengths);
        let damaged = ArrayProblem::Header("`shape` is not a tuple of lengths");
        let lengths = shape.ok_or_else(|| damaged.clone())?.split(',').map(str::trim).filter(|part| !part.is_empty());
        // Python 2 wrote long integers as 12L.
        let lengths = lengths.map(|length| length.trim_end_matches('L').parse()).collect::<Result<_, _>>();
        Ok(Self { kind: Kind { name }, shape: lengths.map_err(|_| damaged)?, column_major })
    }
}

/// An element's type as numpy names it: `<f8` is a float of 8 bytes, the lowest first.
#[derive(Debug, Clone, Copy)]
struct Kind<'a> {
    name: &'a str,
}

impl Kind<'_> {
    fn big_endian(&self) -> bool {
        self.name.starts_with('>')
    }

    fn element(&self) -> Option<Element> {
        Some(match self.name.trim_start_matches(['<', '>', '|', '=']) {
            "f4" => Element::Four(|bytes| f32::from_le_bytes(bytes).into()),
            "f8" => Element::Eight(f64::from_le_bytes),
            "i1" => Element::One(|bytes| i8::from_le_bytes(bytes).into()),
            "i2" => Element::Two(|bytes| i16::from_le_bytes(bytes).into()),
            "i4" => Element::Four(|bytes| i32::from_le_bytes(bytes).into()),
            "i8" => Element::Eight(|bytes| i64::from_le_bytes(bytes) as f64),
            "u1" | "b1" => Element::One(|[byte]| byte.into()),
            "u2" => Element::Two(|bytes| u16::from_le_bytes(bytes).into()),
            "u4" => Element::Four(|bytes| u32::from_le_bytes(bytes).into()),
            "u8" => Element::Eight(|bytes| u64::from_le_bytes(bytes) as f64),
            _ => return None,
        })
    }
}

/// How the bytes of one element, the lowest first, make a number.
enum Element {
    One(fn([u8; 1]) -> f64),
    Two(fn([u8; 2]) -> f64),
    Four(fn([u8; 4]) -> f64),
    Eight(fn([u8; 8]) -> f64),
}

impl Element {
    fn size(&self) -> usize {
        match self {
            Self::One(_) => 1,
            Self::Two(_) => 2,
            Self::Four(_) => 4,
            Self::Eight(_) => 8,
        }
    }

    fn numbers(&self, data: &[u8], big_endian: bool) -> Vec<f64> {
        fn all<const N: usize>(data: &[u8], big_endian: bool, number: fn([u8; N]) -> f64) -> Vec<f64> {
            let ordered = |mut bytes: [u8; N]| {
                if big_endian {
                    bytes.reverse();
                }
                number(bytes)
            };
            data.as_chunks::<N>().0.iter().copied().map(ordered).collect()
        }
        match *self {
            Self::One(number) => all(data, big_endian, number),
            Self::Two(number) => all(data, big_endian, number),
            Self::Four(number) => all(data, big_endian, number),
            Self::Eight(number) => all(data, big_endian, number),
        }
    }
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

    fn values(descr: &str, data: &[u8], count: usize) -> Vec<f64> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({count},), }}\n");
        parse(&file(&header, data)).unwrap().values
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
        let array = parse(&file("{'descr':'|u1','fortran_order':True,'shape':(2,3,2)}", &data)).unwrap();
        assert_eq!((array.axes, array.shape), (3, [2, 3, 2]));
        assert_eq!(array.values, [0., 1., 10., 11., 20., 21., 100., 101., 110., 111., 120., 121.]);
    }

    #[test]
    fn the_header_may_be_written_in_other_ways() {
        let header = "{\"shape\": (1L, 2L), 'fortran_order' : False, \"descr\": \"|u1\"}";
        let array = parse(&file(header, &[7, 8])).unwrap();
        assert_eq!((array.axes, array.shape, array.values), (2, [1, 1, 2], vec![7.0, 8.0]));
    }

    #[test]
    fn a_promise_that_the_file_does_not_keep_is_refused() {
        let header = |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
        let problem = |shape: &str, data: &[u8]| parse(&file(&header(shape), data)).unwrap_err().to_string();
        assert_eq!(problem("(3,)", &[0; 16]), "the array's header promises 24 bytes, but 16 follow");
        assert_eq!(problem("(1,)", &[0; 16]), "the array's header promises 8 bytes, but 16 follow");
        assert!(problem("(1000000000000, 1000000, 1)", &[0; 8]).contains("promises 8000000000000000000 bytes"));
        assert!(problem("(18446744073709551615, 2)", &[0; 8]).contains("over 2^64"));
        assert!(problem("(0, 2)", &[]).starts_with("an array of shape (0, 2)"));
        assert!(problem("()", &[0; 8]).starts_with("an array of shape ()"));
        assert!(problem("(1, 1, 1, 1)", &[0; 8]).starts_with("an array of shape (1, 1, 1, 1)"));
    }

    #[test]
    fn what_is_not_numbers_is_named() {
        let problem = |bytes: &[u8]| parse(bytes).unwrap_err();
        let of_type = |descr: &str| problem(&file(&format!("{{'descr': {descr}, 'shape': (1,)}}"), &[0; 8]));
        assert_eq!(of_type("[('a', '<f8')]"), ArrayProblem::Type { found: "a record".into() });
        assert_eq!(problem(b"y1,y2\n"), ArrayProblem::NotNumpy);
        assert_eq!(problem(b"\x93NUMPY\x01"), ArrayProblem::Header("it ends early"));
        assert_eq!(problem(b"\x93NUMPY\x04\x00"), ArrayProblem::Version { major: 4, minor: 0 });
        assert_eq!(
            problem(b"\x93NUMPY\x02\x00\xff\xff\xff\xff"),
            ArrayProblem::Header("it is longer than 10000 bytes")
        );
        let objects = problem(&file("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", &[0; 8]));
        let help = miette::Diagnostic::help(&file_error("x.npy", objects)).unwrap().to_string();
        assert!(help.contains("numpy.savez"), "{help}");
    }
}
