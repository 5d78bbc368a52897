//! Where things are in an HDF5 file: the superblock, addresses, and the way to any of them with bounds.
//!
//! Format specification version 3.0 (the HDF Group); roman numerals name its sections.

use std::borrow::Cow;

use crate::budget::Budget;
use crate::front::Front;
use crate::problem::FormatProblem;
use crate::windows::Windows;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// What messages call such a file.
pub const KIND: &str = "HDF5";

/// Bytes that the beginning of any description is read with.
const LEAST: usize = 1024;
const BEYOND: &str = "a part reaches beyond the end of the file";

/// A contradiction, or an end that comes too early.
pub fn damaged(what: &'static str) -> FormatProblem {
    FormatProblem::Damaged { kind: KIND, what }
}

/// A file whose superblock was read.
#[derive(Debug)]
pub struct File<'a> {
    windows: &'a Windows<'a>,
    /// Where the superblock stands: addresses count from there.
    start: u64,
    /// Bytes of an address.
    pub offsets: usize,
    /// Bytes of a length.
    pub lengths: usize,
    /// The root group's header.
    pub root: u64,
    /// Whether it is a MATLAB 7.3 file, whose axes stand in reverse.
    pub is_matlab: bool,
    /// What may be held and done on behalf of the file.
    pub budget: &'a Budget,
}

impl<'a> File<'a> {
    /// Reads the superblock (II.A), which may stand behind a block of somebody else's.
    ///
    /// # Errors
    /// [`FormatProblem`].
    pub fn open(windows: &'a Windows<'a>, budget: &'a Budget) -> Result<Self, FormatProblem> {
        let places = std::iter::once(0).chain((9..31).map(|power| 1_u64 << power));
        let start = places
            .take_while(|&place| place < windows.length())
            .find(|&place| *windows.passing(place, SIGNATURE.len()) == *SIGNATURE);
        let start = start.ok_or(FormatProblem::NotThis { kind: KIND, why: "its signature is nowhere" })?;
        let is_matlab = start > 0 && *windows.passing(0, 10) == *b"MATLAB 7.3";
        let bytes = windows.kept(start, LEAST, budget)?;
        let mut front = Front(bytes.get(SIGNATURE.len()..).unwrap_or_default());
        let cut = || damaged("the superblock ends early");
        let version = front.u8().ok_or_else(cut)?;
        let (offsets, lengths, root) = match version {
            0 | 1 => {
                front.take(4).ok_or_else(cut)?;
                let (offsets, lengths) = front.u8().zip(front.u8()).ok_or_else(cut)?;
                front.take(if version == 0 { 9 } else { 13 }).ok_or_else(cut)?;
                // Base, free space, end of file, driver; of the root's entry the name.
                front.take(5 * usize::from(offsets)).ok_or_else(cut)?;
                (offsets, lengths, front.number(offsets.into()).ok_or_else(cut)?)
            }
            2 | 3 => {
                let (offsets, lengths) = front.u8().zip(front.u8()).ok_or_else(cut)?;
                // Flags; base, extension, end of file.
                front.take(1 + 3 * usize::from(offsets)).ok_or_else(cut)?;
                (offsets, lengths, front.number(offsets.into()).ok_or_else(cut)?)
            }
            _ => return Err(damaged("its superblock is of a version that is not known")),
        };
        if !matches!(offsets, 2 | 4 | 8) || !matches!(lengths, 2 | 4 | 8) {
            return Err(damaged("its addresses have a strange size"));
        }
        Ok(Self { windows, start, offsets: offsets.into(), lengths: lengths.into(), root, is_matlab, budget })
    }

    /// What stands from an address on: the beginning of a description.
    pub fn at(&self, address: u64) -> Result<Front<'a>, FormatProblem> {
        self.front(address, LEAST)
    }

    /// What stands from an address on: at least `least` bytes, if the file has them.
    pub fn front(&self, address: u64, least: usize) -> Result<Front<'a>, FormatProblem> {
        // Each visit costs, so that a small file cannot send its reader round and round.
        self.budget.take(32)?;
        let place = self.place(address).ok_or_else(|| damaged("an address lies outside of the file"))?;
        Ok(Front(self.windows.kept(place, least, self.budget)?))
    }

    /// `size` bytes of a description from an address on.
    pub fn bytes(&self, address: u64, size: usize) -> Result<&'a [u8], FormatProblem> {
        self.front(address, size)?.take(size).ok_or_else(|| damaged(BEYOND))
    }

    /// `size` bytes from an address on that are not kept, and nothing is taken for.
    pub fn passing(&self, address: u64, size: usize) -> Result<Cow<'a, [u8]>, FormatProblem> {
        self.check(address, size)?;
        self.budget.take(32)?;
        let place = self.place(address).ok_or_else(|| damaged(BEYOND))?;
        let bytes = self.windows.passing(place, size);
        if bytes.len() == size { Ok(bytes) } else { Err(damaged(BEYOND)) }
    }

    /// Whether so many bytes stand at an address.
    pub fn check(&self, address: u64, size: usize) -> Result<(), FormatProblem> {
        let end = self.place(address).and_then(|place| place.checked_add(size as u64));
        if end.is_some_and(|end| end <= self.windows.length()) { Ok(()) } else { Err(damaged(BEYOND)) }
    }

    fn place(&self, address: u64) -> Option<u64> {
        self.start.checked_add(address).filter(|place| *place <= self.windows.length())
    }

    /// What stands behind a signature at an address: the beginning of a description.
    pub fn signed(&self, address: u64, signature: &[u8; 4]) -> Result<Front<'a>, FormatProblem> {
        self.signed_front(address, signature, LEAST)
    }

    /// As [`Self::signed`], with at least `least` bytes, if the file has them.
    pub fn signed_front(&self, address: u64, signature: &[u8; 4], least: usize) -> Result<Front<'a>, FormatProblem> {
        let mut front = self.front(address, least.saturating_add(4))?;
        if front.array() == Some(*signature) {
            Ok(front)
        } else {
            Err(damaged("something else stands where an address points to"))
        }
    }

    /// An address; None if it is undefined.
    pub fn address(&self, front: &mut Front<'_>) -> Option<Option<u64>> {
        let address = front.number(self.offsets)?;
        let undefined = u64::MAX >> (64 - 8 * self.offsets);
        Some((address != undefined).then_some(address))
    }

    /// A length.
    pub fn length(&self, front: &mut Front<'_>) -> Option<usize> {
        usize::try_from(front.number(self.lengths)?).ok()
    }
}

/// Bytes that numbers up to `limit` take.
pub fn bytes_for(limit: u64) -> usize {
    limit.max(1).ilog2() as usize / 8 + 1
}
