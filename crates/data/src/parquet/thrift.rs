//! Thrift's compact protocol, in which parquet writes what it says about itself: a tree of structs, lists and numbers.
//!
//! ```text
//! struct   fields until a zero byte; a field: its number as a step from the last and its type in one byte, the value
//! list     count and type in one byte (counts from 15 on follow as a varint), the values
//! number   a zigzag varint; text: its length as a varint, its bytes
//! ```

use crate::front::Front;

/// Structs in structs that are followed.
const DEEPEST: usize = 16;

/// A value of the tree.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// Bytes or text.
    Bytes(&'a [u8]),
    /// A list, or a set.
    List(Vec<Value<'a>>),
    /// A struct: its fields' numbers and values.
    Struct(Vec<(i64, Value<'a>)>),
    /// Of a kind that is not needed here.
    Other,
}

impl<'a> Value<'a> {
    /// Reads a struct from the front.
    pub fn read(front: &mut Front<'a>) -> Option<Self> {
        read_struct(front, DEEPEST)
    }

    /// The field of a struct, by its number.
    pub fn field(&self, number: i64) -> Option<&Self> {
        let Self::Struct(fields) = self else { return None };
        fields.iter().find(|(found, _)| *found == number).map(|(_, value)| value)
    }

    /// The whole number in a field.
    pub fn int(&self, number: i64) -> Option<i64> {
        match self.field(number)? {
            Self::Int(int) => Some(*int),
            _ => None,
        }
    }

    /// A length or a place in a field.
    pub fn size(&self, number: i64) -> Option<usize> {
        self.int(number).and_then(|size| usize::try_from(size).ok())
    }

    /// The text in a field.
    pub fn text(&self, number: i64) -> Option<&'a str> {
        match self.field(number)? {
            Self::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    /// The list in a field.
    pub fn list(&self, number: i64) -> Option<&[Self]> {
        match self.field(number)? {
            Self::List(list) => Some(list),
            _ => None,
        }
    }
}

fn read_struct<'a>(front: &mut Front<'a>, deeper: usize) -> Option<Value<'a>> {
    let mut fields = Vec::new();
    let mut number = 0_i64;
    loop {
        let head = front.u8()?;
        if head == 0 {
            return Some(Value::Struct(fields));
        }
        number = match head >> 4 {
            0 => front.zigzag()?,
            step => number.checked_add(i64::from(step))?,
        };
        let value = match head & 0x0f {
            1 => Value::Bool(true),
            2 => Value::Bool(false),
            kind => read_value(front, kind, deeper.checked_sub(1)?)?,
        };
        fields.push((number, value));
    }
}

fn read_value<'a>(front: &mut Front<'a>, kind: u8, deeper: usize) -> Option<Value<'a>> {
    Some(match kind {
        1 | 2 => Value::Bool(front.u8()? == 1),
        3 => Value::Int(i64::from(front.u8()? as i8)),
        4..=6 => Value::Int(front.zigzag()?),
        7 => front.take(8).map(|_| Value::Other)?,
        8 => {
            let length = usize::try_from(front.varint()?).ok()?;
            Value::Bytes(front.take(length)?)
        }
        9 | 10 => {
            let head = front.u8()?;
            let count = if head >> 4 == 15 { usize::try_from(front.varint()?).ok()? } else { usize::from(head >> 4) };
            // Each element takes a byte at least.
            if count > front.0.len() {
                return None;
            }
            let deeper = deeper.checked_sub(1)?;
            Value::List((0..count).map(|_| read_value(front, head & 0x0f, deeper)).collect::<Option<_>>()?)
        }
        12 => read_struct(front, deeper)?,
        // Maps (11) do not occur in parquet.
        _ => return None,
    })
}

/// Writes structs in the compact protocol.
#[derive(Debug, Default)]
pub struct Writer {
    bytes: Vec<u8>,
    /// The last field's number in each struct that is open.
    last: Vec<i64>,
}

impl Writer {
    /// The bytes of one struct, whose fields `write` gives in rising order.
    pub fn of(write: impl FnOnce(&mut Self)) -> Vec<u8> {
        let mut writer = Self::default();
        writer.body(write);
        writer.bytes
    }

    fn body(&mut self, write: impl FnOnce(&mut Self)) {
        self.last.push(0);
        write(self);
        self.last.pop();
        self.bytes.push(0);
    }

    fn head(&mut self, number: i64, kind: u8) {
        let step = number - self.last.last().copied().unwrap_or(0);
        if (1..16).contains(&step) {
            self.bytes.push((step as u8) << 4 | kind);
        } else {
            self.bytes.push(kind);
            self.zigzag(number);
        }
        if let Some(last) = self.last.last_mut() {
            *last = number;
        }
    }

    fn varint(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }

    fn zigzag(&mut self, number: i64) {
        self.varint((number << 1 ^ number >> 63) as u64);
    }

    /// A number of 32 bits.
    pub fn i32(&mut self, number: i64, value: i32) {
        self.head(number, 5);
        self.zigzag(value.into());
    }

    /// A number of 64 bits.
    pub fn i64(&mut self, number: i64, value: i64) {
        self.head(number, 6);
        self.zigzag(value);
    }

    /// Text.
    pub fn text(&mut self, number: i64, value: &str) {
        self.head(number, 8);
        self.varint(value.len() as u64);
        self.bytes.extend(value.as_bytes());
    }

    /// A struct.
    pub fn inner(&mut self, number: i64, write: impl FnOnce(&mut Self)) {
        self.head(number, 12);
        self.body(write);
    }

    /// A list of structs.
    pub fn structs<T>(&mut self, number: i64, items: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.list(number, 12, items, |writer, item| writer.body(|writer| write(writer, item)));
    }

    /// A list of numbers of 32 bits.
    pub fn numbers(&mut self, number: i64, items: &[i32]) {
        self.list(number, 5, items, |writer, item| writer.zigzag(i64::from(*item)));
    }

    /// A list of texts.
    pub fn texts(&mut self, number: i64, items: &[&str]) {
        self.list(number, 8, items, |writer, item| {
            writer.varint(item.len() as u64);
            writer.bytes.extend(item.as_bytes());
        });
    }

    fn list<T>(&mut self, number: i64, kind: u8, items: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.head(number, 9);
        if items.len() < 15 {
            self.bytes.push((items.len() as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            self.varint(items.len() as u64);
        }
        for item in items {
            write(self, item);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let many: Vec<i32> = (-10..10).collect();
        let bytes = Writer::of(|writer| {
            writer.i32(1, -5);
            writer.text(3, "state");
            writer.structs(40, &[7, 8], |writer, item| writer.i64(2, item << 40));
            writer.numbers(41, &many);
            writer.texts(42, &["a", "b"]);
            writer.inner(43, |writer| writer.i32(1, 1));
        });
        let mut front = Front(&bytes);
        let value = Value::read(&mut front).unwrap();
        assert!(front.0.is_empty());
        assert_eq!((value.int(1), value.text(3), value.size(1)), (Some(-5), Some("state"), None));
        assert_eq!(value.list(40).unwrap()[1].int(2), Some(8 << 40));
        assert_eq!(value.list(41).unwrap().len(), 20);
        assert_eq!(value.list(42).unwrap()[1], Value::Bytes(b"b"));
        assert_eq!(value.field(43).unwrap().int(1), Some(1));
    }

    #[test]
    fn a_tree_without_end_is_refused() {
        assert_eq!(Value::read(&mut Front(&[0x1c; 10_000])), None);
        // A list that promises 2^40 elements.
        assert_eq!(Value::read(&mut Front(&[0x19, 0xf5, 0x80, 0x80, 0x80, 0x80, 0x80, 0x20, 0])), None);
        assert_eq!(Value::read(&mut Front(&[0x15])), None);
    }
}
