//! What a reader is given: a file or a folder on the disk, or bytes that would stand in a file, and a budget.

use std::borrow::Cow;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

use crate::FileError;
use crate::budget::Budget;
use crate::memory;

/// What is to be read: a file or a folder on the disk, or bytes that would stand in a file.
pub struct Source<'a> {
    path: &'a Path,
    name: String,
    bytes: Option<&'a [u8]>,
    budget: Budget,
}

/// Bytes that are taken from what is no file: a pipe, a device. Nobody knows whether there is an end.
const MOST_OF_NO_FILE: u64 = 256 << 20;

/// All bytes of a file that is known to end and to fit.
///
/// # Errors
/// [`FileError::TooLarge`] for more bytes than the machine's memory has, and for a pipe or a device without an end;
/// [`FileError::Disk`].
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let disk = |source| FileError::disk("read", path, source);
    let found = std::fs::metadata(path).map_err(disk)?;
    let too_large = |most: u64, what: &'static str| FileError::TooLarge {
        path: path.display().to_string(),
        most: most >> 20,
        what,
    };
    if found.is_file() || found.is_dir() {
        let most = memory::of_machine().unwrap_or(u64::MAX >> 1);
        return match found.len() <= most || found.is_dir() {
            true => std::fs::read(path).map_err(disk),
            false => Err(too_large(most, "this machine has")),
        };
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(disk)?;
    file.take(MOST_OF_NO_FILE + 1).read_to_end(&mut bytes).map_err(disk)?;
    match bytes.len() as u64 > MOST_OF_NO_FILE {
        true => Err(too_large(MOST_OF_NO_FILE, "read from a pipe or a device are")),
        false => Ok(bytes),
    }
}

/// A file that can be read at any place.
pub trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

impl<'a> Source<'a> {
    /// A file or folder.
    ///
    /// # Errors
    /// [`FileError::Disk`] if it is not there.
    pub fn at(path: &'a Path) -> Result<Self, FileError> {
        let length = std::fs::metadata(path).map_err(|source| FileError::disk("read", path, source))?.len();
        Ok(Self { path, name: path.display().to_string(), bytes: None, budget: Budget::of_file(length) })
    }

    /// Bytes that would stand in a file of this path.
    #[must_use]
    pub fn of_bytes(path: &'a Path, bytes: &'a [u8]) -> Self {
        let budget = Budget::of_file(bytes.len() as u64);
        Self { path, name: path.display().to_string(), bytes: Some(bytes), budget }
    }

    /// Where it stands.
    #[must_use]
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// The path, for messages.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What may be held on its behalf. A folder's budget is that of an empty file: take [`Source::at`] for its files.
    #[must_use]
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// All bytes of the file.
    ///
    /// # Errors
    /// [`FileError::Disk`].
    pub fn bytes(&self) -> Result<Cow<'a, [u8]>, FileError> {
        match self.bytes {
            Some(bytes) => Ok(Cow::Borrowed(bytes)),
            None => read_bytes(self.path).map(Cow::Owned),
        }
    }

    /// The file on the disk and its bytes' number, if that is what it is: not bytes that were given, a pipe or a device.
    ///
    /// # Errors
    /// [`FileError::Disk`].
    pub(crate) fn file(&self) -> Result<Option<(std::fs::File, u64)>, FileError> {
        let disk = |source| FileError::disk("read", self.path, source);
        if self.bytes.is_some() || !std::fs::metadata(self.path).map_err(disk)?.is_file() {
            return Ok(None);
        }
        let file = std::fs::File::open(self.path).map_err(disk)?;
        let length = file.metadata().map_err(disk)?.len();
        Ok(Some((file, length)))
    }

    /// The file, to be read piece by piece.
    ///
    /// # Errors
    /// [`FileError::Disk`].
    pub fn open(&self) -> Result<Box<dyn ReadSeek + 'a>, FileError> {
        match self.bytes {
            Some(bytes) => Ok(Box::new(Cursor::new(bytes))),
            None => match std::fs::File::open(self.path) {
                Ok(file) => Ok(Box::new(file)),
                Err(source) => Err(FileError::disk("read", self.path, source)),
            },
        }
    }
}
