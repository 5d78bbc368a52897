//! Types of elements (IV.A.2.d), as far as they are numbers or text.

use super::file::{File, damaged};
use crate::front::Front;
use crate::parquet::half;
use crate::problem::FormatProblem;

/// The type of a data set's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// What they are.
    pub class: Class,
    /// Bytes of one.
    pub size: usize,
    big_endian: bool,
}

/// What elements are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Whole numbers.
    Whole {
        /// Whether they have a sign.
        signed: bool,
    },
    /// Floats of IEEE 754: 2, 4 or 8 bytes.
    Float,
    /// Text of a fixed length.
    Text,
    /// Text of any length.
    LongText,
    /// Something else, by its name.
    Other(&'static str),
}

impl Kind {
    /// Reads a type from the front of its description.
    pub fn read(description: &[u8]) -> Result<Self, FormatProblem> {
        let broken = || damaged("the type of a data set");
        let mut front = Front(description);
        let mut head = || Some((front.u8()?, front.array::<3>()?, front.u32()? as usize));
        let (class, [bits, sign, _], size) = head().ok_or_else(broken)?;
        let other = |name| Class::Other(name);
        let big_endian = bits & 1 != 0;
        let class = match class & 0x0f {
            0 if matches!(size, 1 | 2 | 4 | 8) => {
                let (offset, precision) = front.u16().zip(front.u16()).ok_or_else(broken)?;
                let all = offset == 0 && usize::from(precision) == 8 * size;
                if all { Class::Whole { signed: bits & 8 != 0 } } else { other("whole numbers of odd sizes") }
            }
            1 => {
                let properties = front.array::<8>().ok_or_else(broken)?;
                let [0, 0, precision, 0, exponent_at, exponent, 0, mantissa] = properties else {
                    return Ok(Self { class: other("floats of odd sizes"), size, big_endian });
                };
                let standard = match size {
                    2 => [16, 10, 5, 10],
                    4 => [32, 23, 8, 23],
                    8 => [64, 52, 11, 52],
                    _ => [0; 4],
                };
                let as_standard =
                    [precision, exponent_at, exponent, mantissa] == standard && sign.checked_add(1) == Some(precision);
                // The second bit of the order is that of a VAX.
                if as_standard && bits & 0x40 == 0 { Class::Float } else { other("floats of odd sizes") }
            }
            3 => Class::Text,
            // Enumerations are numbers with names; a truth value is one of h5py's.
            8 => {
                let base = Self::read_base(front.0)?;
                return if base.size == size { Ok(base) } else { Err(broken()) };
            }
            9 if bits & 0x0f == 1 => Class::LongText,
            2 => other("times"),
            4 => other("bit fields"),
            5 => other("opaque bytes"),
            6 => other("records"),
            7 => other("references"),
            9 => other("lists of different lengths"),
            10 => other("arrays"),
            _ => other("elements of an unknown type"),
        };
        Ok(Self { class, size, big_endian })
    }

    fn read_base(description: &[u8]) -> Result<Self, FormatProblem> {
        // An enumeration of enumerations does not exist.
        if description.first().is_some_and(|class| class & 0x0f == 8) {
            return Err(damaged("the type of a data set"));
        }
        Self::read(description)
    }

    /// Whether elements are numbers.
    pub fn is_numeric(self) -> bool {
        matches!(self.class, Class::Whole { .. } | Class::Float)
    }

    /// Its name as numpy has it, for those who look.
    pub fn name(self) -> String {
        match self.class {
            Class::Whole { signed: true } => format!("int{}", 8 * self.size),
            Class::Whole { signed: false } => format!("uint{}", 8 * self.size),
            Class::Float => format!("float{}", 8 * self.size),
            Class::Text | Class::LongText => "text".to_owned(),
            Class::Other(name) => name.to_owned(),
        }
    }

    /// Appends the numbers that stand behind each other.
    pub fn numbers(self, bytes: &[u8], mut each: impl FnMut(f64)) {
        match (self.class, self.size, self.big_endian) {
            (Class::Float, 4, false) => bytes.as_chunks().0.iter().for_each(|&b| each(f32::from_le_bytes(b).into())),
            (Class::Float, 8, false) => bytes.as_chunks().0.iter().for_each(|&b| each(f64::from_le_bytes(b))),
            (_, size, _) => bytes.chunks_exact(size.max(1)).for_each(|bytes| each(self.number(bytes))),
        }
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let low = if self.big_endian {
            bytes.iter().fold(0_u64, |number, &byte| number << 8 | u64::from(byte))
        } else {
            bytes.iter().rev().fold(0_u64, |number, &byte| number << 8 | u64::from(byte))
        };
        let unused = 64 - 8 * self.size.clamp(1, 8);
        match (self.class, self.size) {
            (Class::Float, 2) => half(low as u16),
            (Class::Float, 4) => f32::from_bits(low as u32).into(),
            (Class::Float, 8) => f64::from_bits(low),
            (Class::Whole { signed: true }, _) => ((low << unused) as i64 >> unused) as f64,
            (Class::Whole { signed: false }, _) => low as f64,
            _ => f64::NAN,
        }
    }
}

/// The text of one element.
pub fn text(file: &File<'_>, kind: Kind, data: &[u8]) -> Option<String> {
    let bytes = match kind.class {
        Class::Text => data.get(..kind.size)?,
        Class::LongText => {
            let mut front = Front(data);
            let length = front.u32()? as usize;
            let address = file.address(&mut front)??;
            super::heap::global(file, address, front.u32()?).ok()?.get(..length)?
        }
        _ => return None,
    };
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    file.budget.take(end).ok()?;
    std::str::from_utf8(&bytes[..end]).ok().map(str::to_owned)
}
