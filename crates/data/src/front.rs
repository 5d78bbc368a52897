//! Bytes that are read from the front, the lowest first. Whoever asks for more than there is gets `None`.

/// What is left to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Front<'a>(pub &'a [u8]);

impl<'a> Front<'a> {
    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (front, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(front)
    }

    /// The next `N` bytes.
    pub fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (front, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*front)
    }

    /// The next byte.
    pub fn u8(&mut self) -> Option<u8> {
        self.array().map(|[byte]| byte)
    }

    /// The next two bytes as a number.
    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    /// The next four bytes as a number.
    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    /// The next eight bytes as a number.
    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A number in `width` bytes, of which there are at most eight.
    pub fn number(&mut self, width: usize) -> Option<u64> {
        let bytes = self.take(width).filter(|_| width <= 8)?;
        Some(bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }

    /// A number in groups of seven bits, the lowest first; the highest bit of a byte says that another follows.
    pub fn varint(&mut self) -> Option<u64> {
        let mut number = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.u8()?;
            let part = u64::from(byte & 0x7f);
            if part << shift >> shift != part {
                return None;
            }
            number |= part << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// A signed number as a varint: 0, -1, 1, -2, ... stand as 0, 1, 2, 3, ...
    pub fn zigzag(&mut self) -> Option<i64> {
        self.varint().map(|number| (number >> 1) as i64 ^ -((number & 1) as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_lowest_byte_first() {
        let mut front = Front(&[1, 2, 0, 3, 0, 0, 0, 9, 8, 7]);
        assert_eq!((front.u8(), front.u16(), front.u32()), (Some(1), Some(2), Some(3)));
        assert_eq!(front.number(3), Some(0x07_0809));
        assert_eq!((front.u8(), front.number(0)), (None, Some(0)));
    }

    #[test]
    fn varints_have_an_end() {
        assert_eq!(Front(&[0xac, 0x02]).varint(), Some(300));
        assert_eq!(Front(&[0x80]).varint(), None);
        assert_eq!(Front(&[0xff; 11]).varint(), None);
        let mut largest = [0xff; 10];
        largest[9] = 1;
        assert_eq!(Front(&largest).varint(), Some(u64::MAX));
        largest[9] = 2;
        assert_eq!(Front(&largest).varint(), None);
        assert_eq!([0_u8, 1, 2, 3].map(|byte| Front(&[byte]).zigzag()), [0, -1, 1, -2].map(Some));
    }
}
