//! What a message consists of.

use std::collections::BTreeMap;

use super::super::tree::Number;

/// Most fields that a message may have, those of nested types counted each time.
const MOST_FIELDS: usize = 1 << 16;
/// Types may be nested this deep.
const DEEPEST: usize = 32;

/// A field as a definition writes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// How often.
    pub count: Count,
}

/// What a field holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Number(Number),
    /// Text of bytes.
    Text,
    /// Text of units of two bytes.
    WideText,
    /// Fields of another type, `package/Name`.
    Type(String),
}

/// How often something stands there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// Once.
    One,
    /// As often as the definition says, and at least once.
    Fixed(usize),
    /// As often as the message says, up to a bound.
    Counted(Option<usize>),
}

/// Types by name.
pub type Types = BTreeMap<String, Vec<Field>>;

/// A type whose parts were all found.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// The types, the message's own first.
    pub types: Vec<Type>,
}

/// The fields of a type, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Type {
    /// Each with its name.
    pub fields: Vec<(String, Part, Count)>,
}

/// As [`Kind`], by place in [`Definition::types`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A number.
    Number(Number),
    /// Text of bytes.
    Text,
    /// Text of units of two bytes.
    WideText,
    /// Another type.
    Type(usize),
}

impl Definition {
    /// Finds all parts of the type `name`.
    ///
    /// # Errors
    /// What is missing or too much, as the end of a sentence.
    pub fn of(name: &str, types: Types) -> Result<Self, String> {
        let mut linker = Linker { types: &types, done: Vec::new(), places: BTreeMap::new(), open: Vec::new() };
        linker.place(name)?;
        Ok(Self { types: linker.done.into_iter().map(|(ready, _)| ready).collect() })
    }
}

struct Linker<'t> {
    types: &'t Types,
    /// Each type, and its fields with those of nested types.
    done: Vec<(Type, usize)>,
    places: BTreeMap<&'t str, usize>,
    open: Vec<&'t str>,
}

impl<'t> Linker<'t> {
    /// Where the type is, and how many fields it has in all.
    fn place(&mut self, name: &str) -> Result<(usize, usize), String> {
        if self.open.contains(&name) {
            return Err(format!("are of a type that contains itself: `{name}`"));
        }
        if let Some(&place) = self.places.get(name) {
            return Ok((place, self.done[place].1));
        }
        let Some((name, fields)) = self.types.get_key_value(name) else {
            return Err(format!("need the type `{name}`, which the definition in the recording lacks"));
        };
        if self.open.len() == DEEPEST {
            return Err(format!("are nested more than {DEEPEST} types deep"));
        }
        let place = self.done.len();
        self.done.push((Type { fields: Vec::new() }, 0));
        self.places.insert(name, place);
        self.open.push(name);
        let mut total = 0;
        let mut parts = Vec::with_capacity(fields.len());
        for field in fields {
            let (part, below) = match &field.kind {
                Kind::Number(number) => (Part::Number(*number), 1),
                Kind::Text => (Part::Text, 1),
                Kind::WideText => (Part::WideText, 1),
                Kind::Type(name) => {
                    let (place, below) = self.place(name)?;
                    (Part::Type(place), below)
                }
            };
            total += below;
            if total > MOST_FIELDS {
                return Err(format!("have more than {MOST_FIELDS} fields"));
            }
            parts.push((field.name.clone(), part, field.count));
        }
        if parts.is_empty() {
            // What has no fields is sent as a byte, so that it is something.
            parts.push((String::new(), Part::Number(Number::Unsigned(1)), Count::One));
            total = 1;
        }
        self.open.pop();
        self.done[place] = (Type { fields: parts }, total);
        Ok((place, total))
    }
}

/// `package/Name` for `package/msg/Name`, `package::msg::Name` and the like.
pub fn plain(name: &str) -> String {
    let name = name.replace("::", "/");
    let name = name.strip_suffix('_').unwrap_or(&name).replace("/dds_/", "/");
    match (name.split_once('/'), name.rsplit_once('/')) {
        (Some((package, _)), Some((_, last))) => format!("{package}/{last}"),
        _ => name,
    }
}
