//! The wire format: fields by number.
//!
//! ```text
//! field      key (varint: number << 3 | kind), value
//! kinds      0 varint, 1 eight bytes, 2 length (varint) and bytes, 3 and 4 a group's ends, 5 four bytes
//! ```

/// A field's value as it stands there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Value<'m> {
    /// A number of up to ten bytes.
    Varint(u64),
    /// Eight bytes.
    Eight(&'m [u8]),
    /// Some bytes.
    Bytes(&'m [u8]),
    /// Four bytes.
    Four(&'m [u8]),
}

/// Fields that are read from the front.
#[derive(Debug, Clone, Copy)]
pub struct Fields<'m>(pub &'m [u8]);

impl<'m> Fields<'m> {
    /// A varint at the front.
    pub fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..70).step_by(7) {
            let (&byte, rest) = self.0.split_first()?;
            self.0 = rest;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, count: usize) -> Option<&'m [u8]> {
        let (front, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(front)
    }

    /// The next field: its number and value. None at the end, or an error.
    pub fn field(&mut self) -> Result<Option<(u32, Value<'m>)>, &'static str> {
        const SHORT: &str = "ends within a field";
        loop {
            if self.0.is_empty() {
                return Ok(None);
            }
            let key = self.varint().ok_or(SHORT)?;
            let number = u32::try_from(key >> 3).map_err(|_| "has a field with a number that is too large")?;
            let value = match key & 7 {
                0 => Value::Varint(self.varint().ok_or(SHORT)?),
                1 => Value::Eight(self.take(8).ok_or(SHORT)?),
                2 => {
                    let length = self.varint().and_then(|length| usize::try_from(length).ok()).ok_or(SHORT)?;
                    Value::Bytes(self.take(length).ok_or(SHORT)?)
                }
                // What is in a group follows as fields; nobody wants groups.
                3 | 4 => continue,
                5 => Value::Four(self.take(4).ok_or(SHORT)?),
                _ => return Err("has a field of a kind that does not exist"),
            };
            return Ok(Some((number, value)));
        }
    }
}
