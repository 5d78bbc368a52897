//! What a reader is given: a file or a folder on the disk, or bytes that would stand in a file, and a budget.

use std::borrow::Cow;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

use crate::FileError;
use crate::budget::Budget;

/// What is to be read: a file or a folder on the disk, or bytes that would stand in a file.
pub struct Source<'a> {
    path: &'a Path,
    name: String,
    bytes: Option<&'a [u8]>,
    budget: Budget,
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
            None => match std::fs::read(self.path) {
                Ok(bytes) => Ok(Cow::Owned(bytes)),
                Err(source) => Err(FileError::disk("read", self.path, source)),
            },
        }
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
