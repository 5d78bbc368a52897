//! Protocol buffers, as much of them as a recording needs: messages as bytes, and descriptions of their types.

/// A protobuf message under construction. Fields that hold their default are left out, as in proto3.
#[derive(Debug, Default)]
pub struct Message {
    bytes: Vec<u8>,
}

/// How a value is laid out.
#[derive(Clone, Copy)]
enum Layout {
    Varint = 0,
    Fixed64 = 1,
    Delimited = 2,
}

impl Message {
    /// The finished message.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// A double.
    pub fn double(&mut self, field: u32, value: f64) {
        // The default is +0.0; -0.0 has other bits and is kept.
        if value.to_bits() != 0 {
            self.key(field, Layout::Fixed64);
            self.bytes.extend(value.to_le_bytes());
        }
    }

    /// An integer, an enumeration or a truth value.
    pub fn integer(&mut self, field: u32, value: u64) {
        if value != 0 {
            self.integer_or_zero(field, value);
        }
    }

    /// An integer of a type that tells 0 from nothing, or one more of a list.
    pub fn integer_or_zero(&mut self, field: u32, value: u64) {
        self.key(field, Layout::Varint);
        self.varint(value);
    }

    /// Text.
    pub fn text(&mut self, field: u32, value: &str) {
        if !value.is_empty() {
            self.delimited(field, value.as_bytes());
        }
    }

    /// Bytes as they are.
    pub fn bytes(&mut self, field: u32, bytes: &[u8]) {
        self.delimited(field, bytes);
    }

    /// A message inside of this one, or one more of a list.
    pub fn message(&mut self, field: u32, fill: impl FnOnce(&mut Self)) {
        let mut inner = Self::default();
        fill(&mut inner);
        self.delimited(field, &inner.bytes);
    }

    fn delimited(&mut self, field: u32, bytes: &[u8]) {
        self.key(field, Layout::Delimited);
        self.varint(bytes.len() as u64);
        self.bytes.extend(bytes);
    }

    fn key(&mut self, field: u32, layout: Layout) {
        self.varint(u64::from(field) << 3 | layout as u64);
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }
}

/// Type of a field, with the number that a description gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// 64-bit float.
    Double,
    /// Integers.
    Int64,
    /// Integers of 32 bits.
    Int32,
    /// Integers of 32 bits that always take four bytes.
    Fixed32,
    /// A truth value.
    Bool,
    /// Text.
    Text,
    /// Bytes.
    Bytes,
    /// A message of this full name, e.g. `foxglove.Pose`.
    Of(&'static str),
    /// An enumeration of this full name.
    OneOf(&'static str),
}

impl Kind {
    fn number(self) -> u64 {
        match self {
            Self::Double => 1,
            Self::Int64 => 3,
            Self::Int32 => 5,
            Self::Fixed32 => 7,
            Self::Bool => 8,
            Self::Text => 9,
            Self::Of(_) => 11,
            Self::Bytes => 12,
            Self::OneOf(_) => 14,
        }
    }
}

/// One field of a message.
pub struct FieldType {
    /// Its name.
    pub name: &'static str,
    /// Its number.
    pub number: u32,
    /// Its type.
    pub kind: Kind,
    /// Whether it is a list.
    pub repeated: bool,
}

/// A type of messages.
pub struct MessageType {
    /// Its name without the package.
    pub name: &'static str,
    /// Its fields.
    pub fields: &'static [FieldType],
    /// An enumeration called `Type` within it, its names numbered from 0.
    pub variants: &'static [&'static str],
}

/// A file of types.
pub struct TypeFile {
    /// Path, as files that import it say it.
    pub path: &'static str,
    /// Goes before the names of its types.
    pub package: &'static str,
    /// Paths of files that it uses.
    pub imports: &'static [&'static str],
    /// Its types.
    pub types: &'static [MessageType],
}

/// A `google.protobuf.FileDescriptorSet` of the files, each after those that it imports.
pub fn descriptor_set(files: &[&TypeFile]) -> Vec<u8> {
    let mut set = Message::default();
    for file in files {
        set.message(1, |out| {
            out.text(1, file.path);
            out.text(2, file.package);
            for import in file.imports {
                out.text(3, import);
            }
            for one in file.types {
                out.message(4, |out| describe(one, out));
            }
            out.text(12, "proto3");
        });
    }
    set.into_bytes()
}

fn describe(one: &MessageType, out: &mut Message) {
    out.text(1, one.name);
    for field in one.fields {
        out.message(2, |out| {
            out.text(1, field.name);
            out.integer(3, u64::from(field.number));
            out.integer(4, if field.repeated { 3 } else { 1 });
            out.integer(5, field.kind.number());
            if let Kind::Of(name) | Kind::OneOf(name) = field.kind {
                out.text(6, &format!(".{name}"));
            }
        });
    }
    if !one.variants.is_empty() {
        out.message(4, |out| {
            out.text(1, "Type");
            for (number, name) in one.variants.iter().enumerate() {
                out.message(2, |out| {
                    out.text(1, name);
                    out.integer_or_zero(2, number as u64);
                });
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the encoding's own documentation.
    #[test]
    fn bytes_are_those_of_the_documentation() {
        let bytes = |fill: fn(&mut Message)| {
            let mut message = Message::default();
            fill(&mut message);
            message.into_bytes()
        };
        assert_eq!(bytes(|m| m.integer(1, 150)), [0x08, 0x96, 0x01]);
        assert_eq!(bytes(|m| m.text(2, "testing")), [0x12, 7, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67]);
        assert_eq!(bytes(|m| m.message(3, |m| m.integer(1, 150))), [0x1a, 3, 0x08, 0x96, 0x01]);
        assert_eq!(bytes(|m| m.double(1, 1.0)), [0x09, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        assert_eq!(bytes(|m| m.message(16, |_| ())), [0x82, 0x01, 0]);
        assert!(bytes(|m| (m.double(1, 0.0), m.text(2, ""), m.integer(3, 0)).2).is_empty());
        assert_eq!(bytes(|m| m.double(1, -0.0)).len(), 9);
    }
}
