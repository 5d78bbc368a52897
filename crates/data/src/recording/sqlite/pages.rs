//! The file as pages.

use std::io::{Read, Seek, SeekFrom};

use super::{Problem, damaged};

const MAGIC: &[u8] = b"SQLite format 3\0";

/// The pages of a file.
pub struct Pages<R> {
    reader: R,
    size: u32,
    usable: u32,
    count: u32,
    bytes: u64,
}

impl<R: Read + Seek> Pages<R> {
    /// Reads the header.
    pub fn open(mut reader: R) -> Result<Self, Problem> {
        let bytes = reader.seek(SeekFrom::End(0))?;
        reader.rewind()?;
        let mut header = [0; 100];
        if bytes < 100 {
            return Err(Problem::Wrong("this is not an SQLite database".to_owned()));
        }
        reader.read_exact(&mut header)?;
        if !header.starts_with(MAGIC) {
            return Err(Problem::Wrong("this is not an SQLite database".to_owned()));
        }
        let size = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            size => u32::from(size),
        };
        if !size.is_power_of_two() || size < 512 {
            return Err(damaged("its pages have an impossible size"));
        }
        let usable = size - u32::from(header[20]);
        if usable < 480 {
            return Err(damaged("its pages have no room"));
        }
        let encoding = u32::from_be_bytes([header[56], header[57], header[58], header[59]]);
        if encoding > 1 {
            return Err(Problem::Wrong("its text is UTF-16; needed: UTF-8".to_owned()));
        }
        let count = u32::try_from(bytes / u64::from(size)).unwrap_or(u32::MAX);
        Ok(Self { reader, size, usable, count, bytes })
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Bytes of a page that are for the database.
    pub fn usable(&self) -> u32 {
        self.usable
    }

    fn go_to(&mut self, number: u32) -> Result<(), Problem> {
        if number == 0 || number > self.count {
            return Err(damaged("it leads to a page that is not there"));
        }
        self.reader.seek(SeekFrom::Start(u64::from(number - 1) * u64::from(self.size)))?;
        Ok(())
    }

    /// Reads a page.
    pub fn read(&mut self, number: u32, page: &mut Vec<u8>) -> Result<(), Problem> {
        self.go_to(number)?;
        page.resize(self.size as usize, 0);
        self.reader.read_exact(page)?;
        page.truncate(self.usable as usize);
        Ok(())
    }

    /// Appends what stands on an overflow page, up to `rest` bytes. Returns the next page, and what then remains.
    pub fn append(&mut self, number: u32, rest: u64, row: &mut Vec<u8>) -> Result<(u32, u64), Problem> {
        self.go_to(number)?;
        let mut next = [0; 4];
        self.reader.read_exact(&mut next)?;
        let count = rest.min(u64::from(self.usable - 4));
        let start = row.len();
        row.resize(start + count as usize, 0);
        self.reader.read_exact(&mut row[start..])?;
        Ok((u32::from_be_bytes(next), rest - count))
    }
}
