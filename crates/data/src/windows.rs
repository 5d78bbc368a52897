//! A file that is read where somebody looks, and not as a whole: descriptions are kept for as long as the file is open, samples
//! pass by.

use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};
use std::fs::File;
use std::io::{Error, Read, Seek, SeekFrom};

use crate::budget::{Budget, OverBudget};
use crate::source::Source;
use crate::{FileError, FormatProblem};

/// Bytes between the beginnings of the smallest windows. A window has twice as many, so that each stretch of so many bytes
/// lies within one.
const SMALLEST: u64 = 4096;
/// Sizes of windows, each twice as large as the one before.
const SIZES: usize = 40;
/// Windows of a row of them.
const ROW: u64 = 1024;

/// Windows of one size: rows that are made when somebody looks there.
type Kept = Vec<OnceCell<Vec<OnceCell<Box<[u8]>>>>>;

/// A file that is read where somebody looks.
#[derive(Debug)]
pub struct Windows<'a> {
    bytes: Bytes<'a>,
    length: u64,
    kept: [OnceCell<Kept>; SIZES],
    failed: RefCell<Option<Error>>,
}

#[derive(Debug)]
enum Bytes<'a> {
    Whole(Cow<'a, [u8]>),
    Disk(RefCell<File>),
}

impl<'a> Windows<'a> {
    /// What a reader was given. What is no file, a pipe or a device, is read as a whole.
    ///
    /// # Errors
    /// [`FileError::Disk`], [`FileError::TooLarge`].
    pub fn of(source: &Source<'a>) -> Result<Self, FileError> {
        let Some((file, length)) = source.file()? else { return Ok(Self::whole(source.bytes()?)) };
        Ok(Self::new(Bytes::Disk(RefCell::new(file)), length))
    }

    /// Bytes that are in memory.
    #[must_use]
    pub fn whole(bytes: impl Into<Cow<'a, [u8]>>) -> Self {
        let bytes = bytes.into();
        let length = bytes.len() as u64;
        Self::new(Bytes::Whole(bytes), length)
    }

    /// The same file, of which nothing is kept. What was drawn for that on the budget is given back.
    #[must_use]
    pub fn forget(self, budget: &Budget) -> Self {
        let windows = self.kept.iter().filter_map(OnceCell::get).flatten().filter_map(OnceCell::get).flatten();
        budget.give_back(windows.filter_map(OnceCell::get).map(|window| window.len()).sum());
        Self { kept: [const { OnceCell::new() }; SIZES], ..self }
    }

    fn new(bytes: Bytes<'a>, length: u64) -> Self {
        Self { bytes, length, kept: [const { OnceCell::new() }; SIZES], failed: RefCell::new(None) }
    }

    /// Bytes of the file.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// What stands at a place: `least` bytes and what happens to be there behind them, or all up to the end of the file if
    /// that comes first. It is kept, and drawn on the budget.
    ///
    /// # Errors
    /// [`OverBudget`]. Where the disk fails, nothing stands there: ask [`Self::failure`].
    pub fn kept(&self, place: u64, least: usize, budget: &Budget) -> Result<&[u8], OverBudget> {
        if let Bytes::Whole(bytes) = &self.bytes {
            return Ok(usize::try_from(place).ok().and_then(|place| bytes.get(place..)).unwrap_or_default());
        }
        if place >= self.length {
            return Ok(&[]);
        }
        let least = (least as u64).min(self.length - place).max(1);
        let size = least.div_ceil(SMALLEST).next_power_of_two().ilog2() as usize;
        let step = SMALLEST << size.min(SIZES - 1);
        let (number, rows) = (place / step, self.length / step / ROW + 1);
        let row = (number / ROW) as usize;
        let rows = self.kept[size.min(SIZES - 1)].get_or_init(|| vec![OnceCell::new(); rows as usize]);
        let row = rows[row].get_or_init(|| vec![OnceCell::new(); ROW as usize]);
        let window = &row[(number % ROW) as usize];
        if window.get().is_none() {
            let from = number * step;
            let bytes = (2 * step).min(self.length - from) as usize;
            budget.take(bytes)?;
            let _ = window.set(self.read(from, bytes).into_boxed_slice());
        }
        let window = window.get().map(|window| &**window).unwrap_or_default();
        Ok(window.get((place - number * step) as usize..).unwrap_or_default())
    }

    /// So many bytes at a place, which are not kept; fewer if the file ends before.
    #[must_use]
    pub fn passing(&self, place: u64, size: usize) -> Cow<'_, [u8]> {
        let there = self.length.saturating_sub(place).min(size as u64) as usize;
        match &self.bytes {
            Bytes::Whole(bytes) => {
                let found = usize::try_from(place).ok().and_then(|place| bytes.get(place..place + there));
                Cow::Borrowed(found.unwrap_or_default())
            }
            Bytes::Disk(_) => Cow::Owned(self.read(place, there)),
        }
    }

    /// Reads from the disk; what cannot be read is not there.
    fn read(&self, from: u64, size: usize) -> Vec<u8> {
        let Bytes::Disk(file) = &self.bytes else { return Vec::new() };
        let mut file = file.borrow_mut();
        let mut bytes = Vec::with_capacity(size);
        let done =
            file.seek(SeekFrom::Start(from)).and_then(|_| file.by_ref().take(size as u64).read_to_end(&mut bytes));
        if let Err(error) = done {
            bytes.clear();
            self.failed.borrow_mut().get_or_insert(error);
        }
        bytes
    }

    /// What is wrong with a file in which a reader came upon a problem: that, or what the disk said before.
    #[must_use]
    pub fn failure(&self, source: &Source<'_>, problem: FormatProblem) -> FileError {
        match self.failed.borrow_mut().take() {
            Some(error) => FileError::disk("read", source.path(), error),
            None => problem.at(source.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn what_stands_in_a_file_is_the_same_by_windows_and_as_a_whole() {
        let bytes: Vec<u8> = (0..100_003_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        std::fs::write(&path, &bytes).unwrap();
        let source = Source::at(&path).unwrap();
        let given = Source::of_bytes(Path::new("x"), &bytes);
        for windows in [Windows::of(&source).unwrap(), Windows::of(&given).unwrap()] {
            assert_eq!(windows.length(), 100_003);
            for (place, least) in
                [(0, 1), (4095, 4096), (4097, 5000), (8191, 20_000), (3, 100_000), (100_000, 9), (99_999, 4)]
            {
                let there = windows.kept(place as u64, least, source.budget()).unwrap();
                assert!(there.len() >= least.min(bytes.len() - place), "{place} {least}: {}", there.len());
                assert_eq!(there, &bytes[place..place + there.len()], "{place} {least}");
                let end = (place + least).min(bytes.len());
                assert_eq!(*windows.passing(place as u64, least), bytes[place..end]);
            }
            for beyond in [100_003, u64::MAX] {
                assert!(windows.kept(beyond, 1, source.budget()).unwrap().is_empty());
                assert!(windows.passing(beyond, usize::MAX).is_empty());
            }
            assert_eq!(windows.kept(9, usize::MAX, source.budget()).unwrap(), &bytes[9..]);
        }
    }

    #[test]
    fn what_is_kept_is_drawn_on_the_budget_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        std::fs::write(&path, vec![1; 1 << 20]).unwrap();
        let windows = Windows::of(&Source::at(&path).unwrap()).unwrap();
        let budget = Budget::of(20_000);
        for place in 0..4096 {
            assert!(windows.kept(place, 16, &budget).unwrap().len() >= 16);
        }
        assert_eq!(budget.left(), 20_000 - 8192);
        assert!(windows.kept(0, 100_000, &budget).is_err() && windows.passing(0, 100_000).len() == 100_000);
        assert_eq!(budget.left(), 20_000 - 8192);
        let windows = windows.forget(&budget);
        assert_eq!((budget.left(), windows.passing(1, 3).len()), (20_000, 3));
    }
}
