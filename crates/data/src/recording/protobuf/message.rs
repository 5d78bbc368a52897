//! A message on the wire as a tree. What is not on the wire has its default value, if that can be told.

use std::borrow::Cow;

use super::descriptor::{Descriptors, Field, Kind};
use super::wire::{Fields, Value};
use crate::recording::tree::{Array, MOST_NODES, Number, Tree};

/// Messages may be in each other this deep.
const DEEPEST: usize = 64;

/// Reads a message.
///
/// # Errors
/// What is wrong with it, as the end of a sentence.
pub fn read<'m>(descriptors: &'m Descriptors, message: &'m [u8]) -> Result<Tree<'m>, String> {
    let mut reader = Reader { descriptors, left: MOST_NODES };
    reader.message(descriptors.root, message, 0)
}

struct Reader<'m> {
    descriptors: &'m Descriptors,
    /// Nodes that may still be made.
    left: usize,
}

impl<'m> Reader<'m> {
    fn count(&mut self, nodes: usize) -> Result<(), String> {
        let left = self.left.checked_sub(nodes);
        self.left = left.ok_or_else(|| format!("holds more than {MOST_NODES} values"))?;
        Ok(())
    }

    fn message(&mut self, of: usize, bytes: &'m [u8], depth: usize) -> Result<Tree<'m>, String> {
        if depth == DEEPEST {
            return Err(format!("is nested more than {DEEPEST} messages deep"));
        }
        let message = &self.descriptors.messages[of];
        self.count(message.fields.len() + 1)?;
        let mut found: Vec<Option<Tree<'m>>> = vec![None; message.fields.len()];
        let mut fields = Fields(bytes);
        while let Some((number, value)) = fields.field()? {
            // What later versions of the message added.
            let Some(&place) = message.places.get(&number) else { continue };
            let field = &message.fields[place];
            match field.repeated {
                false => found[place] = self.value(field, value, depth)?.or(found[place].take()),
                true => self.append(&mut found[place], field, value, depth)?,
            }
        }
        let mut entries = Vec::with_capacity(message.fields.len());
        for (field, found) in message.fields.iter().zip(found) {
            let name = || Cow::Borrowed(field.name.as_str());
            match found {
                Some(Tree::List(list)) if self.is_map(field) => entries.push((name(), as_object(list))),
                Some(tree) => entries.push((name(), tree)),
                None if field.repeated => entries.push((name(), Tree::List(Vec::new()))),
                None => entries.extend(field.default.map(|value| (name(), absent(field.kind, value)))),
            }
        }
        Ok(Tree::Object(entries))
    }

    fn is_map(&self, field: &Field) -> bool {
        matches!(field.kind, Kind::Message(place) if self.descriptors.messages[place].is_entry)
    }

    /// Appends what stands on the wire to a list: one value, or several that are packed.
    fn append(
        &mut self,
        list: &mut Option<Tree<'m>>,
        field: &'m Field,
        value: Value<'m>,
        depth: usize,
    ) -> Result<(), String> {
        let number = fixed(field.kind);
        if let (Some(number), Value::Bytes(bytes)) = (number, value) {
            if bytes.len() % number.size() != 0 {
                return Err(format!("ends within the list `{}`", field.name));
            }
            let array = Array { number, big: false, bytes };
            if list.is_none() {
                *list = Some(Tree::Array(array));
                return Ok(());
            }
        }
        // Lists in several pieces are rare.
        if let Some(Tree::Array(array)) = list.as_ref() {
            self.count(array.len())?;
            *list = Some(Tree::List(array.values().map(Tree::Number).collect()));
        }
        let Tree::List(entries) = list.get_or_insert_with(|| Tree::List(Vec::new())) else { return Ok(()) };
        match (number, value) {
            (Some(number), Value::Bytes(bytes)) => {
                let array = Array { number, big: false, bytes };
                self.count(array.len())?;
                entries.extend(array.values().map(Tree::Number));
            }
            (None, Value::Bytes(bytes)) if is_varint(field.kind) => {
                let mut packed = Fields(bytes);
                while !packed.0.is_empty() {
                    self.count(1)?;
                    let bits = packed.varint().ok_or_else(|| format!("ends within the list `{}`", field.name))?;
                    entries.push(varint(field.kind, bits));
                }
            }
            _ => {
                self.count(1)?;
                entries.extend(self.value(field, value, depth)?);
            }
        }
        Ok(())
    }

    /// One value; None if it does not go with the field's type, as after a change of the declaration.
    fn value(&mut self, field: &'m Field, value: Value<'m>, depth: usize) -> Result<Option<Tree<'m>>, String> {
        Ok(match (field.kind, value) {
            (Kind::Message(place), Value::Bytes(bytes)) => Some(self.message(place, bytes, depth + 1)?),
            (Kind::Time, Value::Bytes(bytes)) => Some(time(bytes)?),
            (Kind::Text, Value::Bytes(bytes)) => Some(Tree::Text(String::from_utf8_lossy(bytes))),
            (kind, Value::Varint(bits)) if is_varint(kind) => Some(varint(kind, bits)),
            (kind, Value::Four(bytes) | Value::Eight(bytes)) => fixed(kind)
                .filter(|number| number.size() == bytes.len())
                .map(|number| number.whole(bytes, false).map_or(Tree::Number(number.value(bytes, false)), Tree::Whole)),
            _ => None,
        })
    }
}

/// A value that is not on the wire.
fn absent(kind: Kind, value: f64) -> Tree<'static> {
    match kind {
        Kind::Double | Kind::Float => Tree::Number(value),
        Kind::Bool => Tree::Truth(value != 0.0),
        _ => Tree::Whole(value as i64),
    }
}

/// The entries of a map by their keys.
fn as_object(list: Vec<Tree<'_>>) -> Tree<'_> {
    let pairs = list.into_iter().filter_map(|entry| {
        let Tree::Object(entries) = entry else { return None };
        let (mut key, mut value) = (Cow::Borrowed(""), None);
        for (name, tree) in entries {
            match (name.as_ref(), tree) {
                ("key", Tree::Text(text)) => key = text,
                ("key", Tree::Whole(whole)) => key = Cow::Owned(whole.to_string()),
                ("key", Tree::Truth(truth)) => key = Cow::Borrowed(if truth { "true" } else { "false" }),
                ("value", tree) => value = Some(tree),
                _ => {}
            }
        }
        value.map(|value| (key, value))
    });
    Tree::Object(pairs.collect())
}

/// Seconds and nanoseconds.
fn time(bytes: &[u8]) -> Result<Tree<'static>, String> {
    let (mut seconds, mut rest) = (0, 0);
    let mut fields = Fields(bytes);
    while let Some((number, value)) = fields.field()? {
        match (number, value) {
            (1, Value::Varint(value)) => seconds = value as i64,
            (2, Value::Varint(value)) => rest = value as i64,
            _ => {}
        }
    }
    Ok(Tree::Object(vec![("sec".into(), Tree::Whole(seconds)), ("nsec".into(), Tree::Whole(rest))]))
}

fn fixed(kind: Kind) -> Option<Number> {
    match kind {
        Kind::Double => Some(Number::Double),
        Kind::Float => Some(Number::Single),
        Kind::Fixed32 => Some(Number::Unsigned(4)),
        Kind::Fixed64 => Some(Number::Unsigned(8)),
        Kind::SignedFixed32 => Some(Number::Signed(4)),
        Kind::SignedFixed64 => Some(Number::Signed(8)),
        _ => None,
    }
}

fn is_varint(kind: Kind) -> bool {
    matches!(kind, Kind::Signed | Kind::Unsigned | Kind::ZigZag | Kind::Bool)
}

fn varint<'m>(kind: Kind, bits: u64) -> Tree<'m> {
    match kind {
        Kind::Bool => Tree::Truth(bits != 0),
        Kind::ZigZag => Tree::Whole((bits >> 1) as i64 ^ -((bits & 1) as i64)),
        Kind::Unsigned => i64::try_from(bits).map_or(Tree::Number(bits as f64), Tree::Whole),
        _ => Tree::Whole(bits as i64),
    }
}
