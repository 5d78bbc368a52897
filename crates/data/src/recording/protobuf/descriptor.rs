//! Descriptors: which fields the messages have.

use std::collections::HashMap;

use super::wire::{Fields, Value};

/// Most fields of all messages together.
const MOST_FIELDS: usize = 1 << 16;
/// Longest name of a message with all that it stands in, in bytes: each message has one.
const LONGEST_NAME: usize = 1000;
/// Messages may be declared this deep in others.
const DEEPEST: usize = 32;

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A float of 8 bytes.
    Double,
    /// A float of 4 bytes.
    Float,
    /// A varint: int32, int64, enums. Negative ones take ten bytes.
    Signed,
    /// A varint: uint32, uint64.
    Unsigned,
    /// A varint with the sign in its lowest bit.
    ZigZag,
    /// fixed32.
    Fixed32,
    /// fixed64.
    Fixed64,
    /// sfixed32.
    SignedFixed32,
    /// sfixed64.
    SignedFixed64,
    /// A truth value.
    Bool,
    /// Text.
    Text,
    /// Bytes, which are no numbers.
    Bytes,
    /// Another message.
    Message(usize),
    /// `google.protobuf.Timestamp` or `Duration`.
    Time,
}

/// A field.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its number on the wire.
    pub number: u32,
    /// What it holds.
    pub kind: Kind,
    /// Whether it is a list.
    pub repeated: bool,
    /// What it is where it is not on the wire, if that can be told.
    pub default: Option<f64>,
}

/// A message's fields.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Message {
    /// In the order of the declaration.
    pub fields: Vec<Field>,
    /// Where the field of a number is.
    pub places: HashMap<u32, usize>,
    /// Whether it is an entry of a map: `key` and `value`.
    pub is_entry: bool,
}

/// All messages of a set, and which one is meant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Descriptors {
    /// The messages.
    pub messages: Vec<Message>,
    /// The one that is meant.
    pub root: usize,
}

/// A field whose type is known by name yet.
struct Loose {
    field: Field,
    of: String,
}

#[derive(Default)]
struct Collecting {
    places: HashMap<String, usize>,
    messages: Vec<(Vec<Loose>, bool)>,
    fields: usize,
}

impl Descriptors {
    /// Reads a `FileDescriptorSet`, whose message `name` is meant.
    ///
    /// # Errors
    /// What is wrong with it, as the end of a sentence.
    pub fn parse(name: &str, set: &[u8]) -> Result<Self, String> {
        let mut all = Collecting::default();
        let broken = |why: &str| format!("have a descriptor that is damaged: it {why}");
        let mut files = Fields(set);
        while let Some((number, value)) = files.field().map_err(broken)? {
            if let (1, Value::Bytes(file)) = (number, value) {
                all.file(file).map_err(|why| broken(&why))?;
            }
        }
        let root = *all
            .places
            .get(name.trim_start_matches('.'))
            .ok_or_else(|| format!("are of type `{name}`, which the descriptors in the recording lack"))?;
        let messages = all.messages.into_iter().map(|(fields, is_entry)| {
            let mut message = Message { is_entry, ..Message::default() };
            for Loose { mut field, of } in fields {
                field.kind = match of.trim_start_matches('.') {
                    "" => field.kind,
                    "google.protobuf.Timestamp" | "google.protobuf.Duration" => Kind::Time,
                    name => match all.places.get(name) {
                        Some(&place) => Kind::Message(place),
                        None => {
                            return Err(format!("need the type `{name}`, which the descriptors in the recording lack"));
                        }
                    },
                };
                message.places.insert(field.number, message.fields.len());
                message.fields.push(field);
            }
            Ok(message)
        });
        let messages = messages.collect::<Result<_, _>>()?;
        Ok(Self { messages, root })
    }
}

impl Collecting {
    fn file(&mut self, file: &[u8]) -> Result<(), String> {
        let (mut package, mut proto3) = (String::new(), false);
        let mut fields = Fields(file);
        while let Some((number, value)) = fields.field()? {
            match (number, value) {
                (2, Value::Bytes(name)) => package = text(name),
                (12, Value::Bytes(syntax)) => proto3 = syntax != b"proto2",
                _ => {}
            }
        }
        let mut fields = Fields(file);
        while let Some((number, value)) = fields.field()? {
            if let (4, Value::Bytes(message)) = (number, value) {
                self.message(message, &package, proto3, 0)?;
            }
        }
        Ok(())
    }

    fn message(&mut self, message: &[u8], within: &str, proto3: bool, depth: usize) -> Result<(), String> {
        if depth == DEEPEST {
            return Err(format!("declares messages more than {DEEPEST} deep"));
        }
        let (mut name, mut loose, mut is_entry) = (String::new(), Vec::new(), false);
        let mut fields = Fields(message);
        while let Some((number, value)) = fields.field()? {
            match (number, value) {
                (1, Value::Bytes(bytes)) => name = text(bytes),
                (2, Value::Bytes(field)) => {
                    self.fields += 1;
                    if self.fields > MOST_FIELDS {
                        return Err(format!("declares more than {MOST_FIELDS} fields"));
                    }
                    loose.push(self::field(field, proto3)?);
                }
                (7, Value::Bytes(options)) => {
                    let mut options = Fields(options);
                    while let Some((number, value)) = options.field()? {
                        is_entry |= (number, value) == (7, Value::Varint(1));
                    }
                }
                _ => {}
            }
        }
        let full = if within.is_empty() { name } else { format!("{within}.{name}") };
        if full.len() > LONGEST_NAME {
            return Err(format!("declares a message whose name has more than {LONGEST_NAME} bytes"));
        }
        let mut fields = Fields(message);
        while let Some((number, value)) = fields.field()? {
            if let (3, Value::Bytes(nested)) = (number, value) {
                self.message(nested, &full, proto3, depth + 1)?;
            }
        }
        self.places.insert(full, self.messages.len());
        self.messages.push((loose, is_entry));
        Ok(())
    }
}

fn field(bytes: &[u8], proto3: bool) -> Result<Loose, String> {
    let (mut name, mut number, mut label, mut kind, mut of) = (String::new(), 0, 0, 0, String::new());
    let (mut default, mut has_presence) = (None, !proto3);
    let mut fields = Fields(bytes);
    while let Some((key, value)) = fields.field()? {
        match (key, value) {
            (1, Value::Bytes(bytes)) => name = text(bytes),
            (3, Value::Varint(value)) => number = u32::try_from(value).unwrap_or(0),
            (4, Value::Varint(value)) => label = value,
            (5, Value::Varint(value)) => kind = value,
            (6, Value::Bytes(bytes)) => of = text(bytes),
            (7, Value::Bytes(bytes)) => default = Some(text(bytes)),
            // In a choice, or optional in proto3: it may be missing.
            (9, Value::Varint(_)) => has_presence = true,
            _ => {}
        }
    }
    let repeated = label == 3;
    let (kind, is_number) = match kind {
        1 => (Kind::Double, true),
        2 => (Kind::Float, true),
        3 | 5 => (Kind::Signed, true),
        4 | 13 => (Kind::Unsigned, true),
        6 => (Kind::Fixed64, true),
        7 => (Kind::Fixed32, true),
        8 => (Kind::Bool, true),
        9 => (Kind::Text, false),
        14 => {
            of.clear();
            (Kind::Signed, true)
        }
        15 => (Kind::SignedFixed32, true),
        16 => (Kind::SignedFixed64, true),
        17 | 18 => (Kind::ZigZag, true),
        // Groups and bytes are passed over; messages get their place later.
        10 => {
            of.clear();
            (Kind::Bytes, false)
        }
        11 => (Kind::Message(0), false),
        _ => (Kind::Bytes, false),
    };
    if kind != Kind::Message(0) {
        of.clear();
    }
    let default = match default.as_deref() {
        _ if repeated || !is_number => None,
        Some("true") => Some(1.0),
        Some("false") => Some(0.0),
        Some(text) => text.parse().ok(),
        None if has_presence => None,
        None => Some(0.0),
    };
    Ok(Loose { field: Field { name, number, kind, repeated, default }, of })
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
