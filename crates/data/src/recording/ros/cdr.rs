//! CDR, as ROS 2 sends messages (XCDR1; plain XCDR2 too), read by a message's definition.
//!
//! ```text
//! header      2 bytes: how it is encoded; 2 bytes: options
//! number      at a multiple of its size, counted from behind the header (in XCDR2 of 4 at most)
//! string      its length with a closing 0 (4 bytes), its bytes
//! list        how many (4 bytes), its entries
//! array       its entries
//! struct      its fields
//! ```

use std::borrow::Cow;

use super::definition::{Count, Definition, Part};
use crate::recording::tree::{Array, MOST_NODES, Number, Tree};

/// A message may be longer than its definition by what padding there can be.
const MOST_LEFT: usize = 7;

/// Most entries of a list for which room is made before they come.
const MOST_RESERVED: usize = 64;

/// Reads a message.
///
/// # Errors
/// What is wrong with it, as the end of a sentence.
pub fn read<'m>(definition: &'m Definition, message: &'m [u8]) -> Result<Tree<'m>, String> {
    let Some(([kind_high, kind, _, _], body)) = message.split_first_chunk::<4>() else {
        return Err("is shorter than a CDR header".to_owned());
    };
    let (big, widest) = match (kind_high, kind) {
        (0, 0) => (true, 8),
        (0, 1) => (false, 8),
        // XCDR2 of types that are final; both numbers are in use.
        (0, 0x06 | 0x10) => (true, 4),
        (0, 0x07 | 0x11) => (false, 4),
        _ => {
            let found = u16::from_be_bytes([*kind_high, *kind]);
            return Err(format!("is encoded as CDR of kind {found:#06x}; known: 0x0000, 0x0001, 0x0006, 0x0007"));
        }
    };
    let mut cursor = Cursor { body, at: 0, big, widest, left: MOST_NODES };
    let tree = cursor.object(definition, 0)?;
    if body.len() - cursor.at > MOST_LEFT {
        return Err(format!("has {} bytes more than its definition tells of", body.len() - cursor.at));
    }
    Ok(tree)
}

struct Cursor<'m> {
    body: &'m [u8],
    at: usize,
    big: bool,
    /// Numbers stand at multiples of this at most.
    widest: usize,
    /// Nodes that may still be made.
    left: usize,
}

impl<'m> Cursor<'m> {
    fn object(&mut self, definition: &'m Definition, of: usize) -> Result<Tree<'m>, String> {
        let fields = &definition.types[of].fields;
        let mut entries = Vec::with_capacity(fields.len());
        for (name, part, count) in fields {
            entries.push((Cow::Borrowed(name.as_str()), self.field(definition, *part, *count)?));
        }
        Ok(Tree::Object(entries))
    }

    fn field(&mut self, definition: &'m Definition, part: Part, count: Count) -> Result<Tree<'m>, String> {
        let count = match count {
            Count::One => return self.one(definition, part),
            Count::Fixed(count) => count,
            Count::Counted(bound) => {
                let count = self.length()?;
                match bound {
                    Some(bound) if count > bound => {
                        return Err(format!("has a list of {count} entries, which may have {bound}"));
                    }
                    _ => count,
                }
            }
        };
        if let Part::Number(number) = part {
            if count > 0 {
                self.align(number.size());
            }
            let length = count.checked_mul(number.size()).ok_or_else(short)?;
            return Ok(Tree::Array(Array { number, big: self.big, bytes: self.take(length)? }));
        }
        // Lists may be in lists: what they promise to hold is not reserved.
        let mut list = Vec::with_capacity(count.min(MOST_RESERVED));
        for _ in 0..count {
            list.push(self.one(definition, part)?);
        }
        Ok(Tree::List(list))
    }

    fn one(&mut self, definition: &'m Definition, part: Part) -> Result<Tree<'m>, String> {
        self.left = self.left.checked_sub(1).ok_or_else(|| format!("holds more than {MOST_NODES} values"))?;
        match part {
            Part::Number(number) => {
                self.align(number.size());
                let bytes = self.take(number.size())?;
                Ok(match (number, number.whole(bytes, self.big)) {
                    (Number::Bool, whole) => Tree::Truth(whole != Some(0)),
                    (_, Some(whole)) => Tree::Whole(whole),
                    (_, None) => Tree::Number(number.value(bytes, self.big)),
                })
            }
            Part::Text => {
                let length = self.length()?;
                let text = self.take(length)?;
                let text = text.strip_suffix(&[0]).unwrap_or(text);
                Ok(Tree::Text(String::from_utf8_lossy(text)))
            }
            Part::WideText => {
                // Its length counts units of two bytes; whether a closing 0 is among them differs.
                let length = self.length()?.checked_mul(2).ok_or_else(short)?;
                self.take(length)?;
                Ok(Tree::Text(Cow::Borrowed("")))
            }
            Part::Type(place) => self.object(definition, place),
        }
    }

    fn length(&mut self) -> Result<usize, String> {
        self.align(4);
        let bytes = self.take(4)?;
        let length = Number::Unsigned(4).whole(bytes, self.big);
        length.and_then(|length| usize::try_from(length).ok()).ok_or_else(short)
    }

    fn align(&mut self, size: usize) {
        // The end is noticed when something is taken from behind it.
        self.at = self.at.next_multiple_of(size.min(self.widest));
    }

    fn take(&mut self, count: usize) -> Result<&'m [u8], String> {
        let end = self.at.checked_add(count).ok_or_else(short)?;
        let bytes = self.body.get(self.at..end);
        // An empty list may end the message before the padding that would follow.
        let bytes = bytes.or((count == 0).then_some(&[][..])).ok_or_else(short)?;
        self.at = end.min(self.body.len());
        Ok(bytes)
    }
}

fn short() -> String {
    "ends before all that its definition tells of".to_owned()
}
