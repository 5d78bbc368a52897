//! A message as a tree, whatever it was encoded as: JSON, CDR, protobuf.
//!
//! Text and arrays of numbers are borrowed from the message where they stand there as they are: reading a long array
//! costs nothing before somebody asks for its values.

use std::borrow::Cow;
use std::cell::Cell;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// Most values, lists and objects that a message may have. What is beyond costs much memory for few bytes.
pub const MOST_NODES: usize = 1 << 18;

/// A value of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Tree<'a> {
    /// Nothing: JSON's `null`.
    Null,
    /// `true` or `false`.
    Truth(bool),
    /// A whole number.
    Whole(i64),
    /// A number.
    Number(f64),
    /// Text.
    Text(Cow<'a, str>),
    /// Numbers of one kind, side by side in the message.
    Array(Array<'a>),
    /// A list.
    List(Vec<Tree<'a>>),
    /// Entries by name, in the message's order; a name may stand there twice.
    Object(Vec<(Cow<'a, str>, Tree<'a>)>),
}

/// How a number is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// One byte, zero or not.
    Bool,
    /// Signed, of this many bytes: 1, 2, 4 or 8.
    Signed(u8),
    /// Unsigned, of this many bytes: 1, 2, 4 or 8.
    Unsigned(u8),
    /// A float of 4 bytes.
    Single,
    /// A float of 8 bytes.
    Double,
    /// A float of 16 bytes. Nobody reads it: it is passed over.
    Quadruple,
}

impl Number {
    /// Bytes of one.
    pub fn size(self) -> usize {
        match self {
            Self::Bool => 1,
            Self::Signed(size) | Self::Unsigned(size) => usize::from(size),
            Self::Single => 4,
            Self::Double => 8,
            Self::Quadruple => 16,
        }
    }

    /// Whether values between two of them make no sense.
    pub fn is_discrete(self) -> bool {
        matches!(self, Self::Bool | Self::Signed(_) | Self::Unsigned(_))
    }

    /// The number that `bytes` hold; they are as many as [`Self::size`] says.
    pub fn value(self, bytes: &[u8], big: bool) -> f64 {
        match (self, self.whole(bytes, big)) {
            (Self::Single, _) => f64::from(f32::from_bits(unsigned(bytes, big) as u32)),
            (Self::Double, _) => f64::from_bits(unsigned(bytes, big)),
            (Self::Unsigned(8), _) => unsigned(bytes, big) as f64,
            (_, Some(whole)) => whole as f64,
            (_, None) => f64::NAN,
        }
    }

    /// The whole number that `bytes` hold, if they do and it is not larger than such numbers go here.
    pub fn whole(self, bytes: &[u8], big: bool) -> Option<i64> {
        let bits = unsigned(bytes, big);
        match self {
            Self::Bool => Some(i64::from(bits != 0)),
            Self::Unsigned(_) => i64::try_from(bits).ok(),
            Self::Signed(size) => {
                let unused = 64 - 8 * u32::from(size);
                Some(((bits << unused) as i64) >> unused)
            }
            Self::Single | Self::Double | Self::Quadruple => None,
        }
    }
}

/// Up to eight bytes as a number.
fn unsigned(bytes: &[u8], big: bool) -> u64 {
    let mut all = [0; 8];
    let count = bytes.len().min(8);
    if big {
        all[8 - count..].copy_from_slice(&bytes[..count]);
        u64::from_be_bytes(all)
    } else {
        all[..count].copy_from_slice(&bytes[..count]);
        u64::from_le_bytes(all)
    }
}

/// Numbers side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Array<'a> {
    /// What they are.
    pub number: Number,
    /// Whether their first byte is the greatest.
    pub big: bool,
    /// Their bytes, as many as whole numbers need.
    pub bytes: &'a [u8],
}

impl<'a> Array<'a> {
    /// How many.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.number.size()
    }

    /// Their values.
    pub fn values(self) -> impl Iterator<Item = f64> + use<'a> {
        self.bytes.chunks_exact(self.number.size()).map(move |bytes| self.number.value(bytes, self.big))
    }

    /// Appends their values.
    pub fn append_to(self, values: &mut Vec<f64>) {
        if self.number == Number::Double && !self.big {
            let (doubles, _) = self.bytes.as_chunks::<8>();
            values.extend(doubles.iter().map(|&bytes| f64::from_le_bytes(bytes)));
        } else {
            values.extend(self.values());
        }
    }
}

impl Tree<'_> {
    /// The entry `name` of an object.
    pub fn get(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Object(entries) => entries.iter().find(|(key, _)| key == name).map(|(_, value)| value),
            _ => None,
        }
    }

    /// A list's entries; none of a list of numbers of one kind.
    pub fn list(&self) -> Option<&[Self]> {
        match self {
            Self::List(list) => Some(list),
            Self::Array(array) if array.bytes.is_empty() => Some(&[]),
            _ => None,
        }
    }

    /// A text's characters.
    pub fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// A number's value. Null is a number that is missing.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Whole(whole) => Some(*whole as f64),
            Self::Null => Some(f64::NAN),
            _ => None,
        }
    }

    /// A whole number's value.
    pub fn whole(&self) -> Option<i64> {
        if let Self::Whole(whole) = self { Some(*whole) } else { None }
    }
}

/// Reads JSON.
///
/// # Errors
/// What is wrong with it, as the end of a sentence.
pub fn from_json(data: &[u8]) -> Result<Tree<'_>, String> {
    let left = Cell::new(MOST_NODES);
    let mut deserializer = serde_json::Deserializer::from_slice(data);
    let tree = Node(&left).deserialize(&mut deserializer).and_then(|tree| deserializer.end().map(|()| tree));
    tree.map_err(|error| {
        if left.get() == 0 { format!("holds more than {MOST_NODES} values") } else { format!("is not JSON: {error}") }
    })
}

/// Reads one node, and counts it.
struct Node<'c>(&'c Cell<usize>);

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Tree<'de>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Tree<'de>, D::Error> {
        let left = self.0.get().checked_sub(1).ok_or_else(|| D::Error::custom("too many values"))?;
        self.0.set(left);
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Tree<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_unit<E>(self) -> Result<Tree<'de>, E> {
        Ok(Tree::Null)
    }

    fn visit_bool<E>(self, truth: bool) -> Result<Tree<'de>, E> {
        Ok(Tree::Truth(truth))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Tree<'de>, E> {
        Ok(Tree::Whole(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Tree<'de>, E> {
        Ok(i64::try_from(value).map_or(Tree::Number(value as f64), Tree::Whole))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Tree<'de>, E> {
        Ok(Tree::Number(value))
    }

    fn visit_borrowed_str<E>(self, value: &'de str) -> Result<Tree<'de>, E> {
        Ok(Tree::Text(Cow::Borrowed(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Tree<'de>, E> {
        Ok(Tree::Text(Cow::Owned(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Tree<'de>, A::Error> {
        let mut list = Vec::new();
        while let Some(entry) = entries.next_element_seed(Node(self.0))? {
            list.push(entry);
        }
        Ok(Tree::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Tree<'de>, A::Error> {
        let mut object = Vec::new();
        while let Some(key) = entries.next_key_seed(Key)? {
            object.push((key, entries.next_value_seed(Node(self.0))?));
        }
        Ok(Tree::Object(object))
    }
}

/// An entry's name, borrowed if nothing in it is escaped.
struct Key;

impl<'de> DeserializeSeed<'de> for Key {
    type Value = Cow<'de, str>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de> Visitor<'de> for Key {
    type Value = Cow<'de, str>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name")
    }

    fn visit_borrowed_str<E>(self, value: &'de str) -> Result<Self::Value, E> {
        Ok(Cow::Borrowed(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Self::Value, E> {
        Ok(Cow::Owned(value.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_sizes_signs_and_orders() {
        let value = |number: Number, bytes: &[u8], big| number.value(bytes, big);
        assert_eq!(value(Number::Signed(1), &[0xfe], false), -2.0);
        assert_eq!(value(Number::Unsigned(1), &[0xfe], true), 254.0);
        assert_eq!(value(Number::Signed(2), &[0xfe, 0xff], false), -2.0);
        assert_eq!(value(Number::Signed(2), &[0xff, 0xfe], true), -2.0);
        assert_eq!(value(Number::Signed(4), &(-5_i32).to_be_bytes(), true), -5.0);
        assert_eq!(value(Number::Unsigned(8), &u64::MAX.to_le_bytes(), false), u64::MAX as f64);
        assert_eq!(value(Number::Single, &1.5_f32.to_be_bytes(), true), 1.5);
        assert_eq!(value(Number::Double, &(-0.1_f64).to_be_bytes(), true), -0.1);
        assert_eq!((value(Number::Bool, &[7], false), value(Number::Bool, &[0], false)), (1.0, 0.0));
        assert_eq!(Number::Unsigned(8).whole(&u64::MAX.to_le_bytes(), false), None);
        let array = Array {
            number: Number::Double,
            big: false,
            bytes: &[1.0_f64.to_le_bytes(), 2.0_f64.to_le_bytes()].concat(),
        };
        let mut values = Vec::new();
        array.append_to(&mut values);
        assert_eq!((array.len(), values), (2, vec![1.0, 2.0]));
    }

    #[test]
    fn json_that_grows_in_memory_is_refused() {
        let wide = format!("[{}0]", "0,".repeat(MOST_NODES));
        assert_eq!(from_json(wide.as_bytes()).unwrap_err(), format!("holds more than {MOST_NODES} values"));
        let text = format!("[\"{}\"]", "0,".repeat(MOST_NODES));
        assert!(from_json(text.as_bytes()).is_ok());
        let deep = format!("{}1{}", "{\"a\":".repeat(200), "}".repeat(200));
        assert!(from_json(deep.as_bytes()).unwrap_err().contains("recursion"));
        assert!(from_json(b"{} x").unwrap_err().contains("trailing"));
        assert!(from_json(b"{").unwrap_err().starts_with("is not JSON: EOF"));
    }

    #[test]
    fn whole_numbers_keep_their_digits() {
        let tree = from_json(br#"{"a": 1766147454233218075, "b\n": -1, "c": 1e3, "d": 18446744073709551615}"#).unwrap();
        assert_eq!(tree.get("a").and_then(Tree::whole), Some(1_766_147_454_233_218_075));
        assert_eq!(tree.get("b\n").and_then(Tree::whole), Some(-1));
        assert_eq!(tree.get("c"), Some(&Tree::Number(1000.0)));
        assert_eq!(tree.get("d"), Some(&Tree::Number(u64::MAX as f64)));
    }
}
