//! What a reader may hold in memory: a fixed part, and a part in proportion to the file.
//!
//! A small file can promise, unpack to, or name again and again, far more than it has bytes. Every reader draws all that
//! it allocates on behalf of a file on one [`Budget`], names included, and stops when that is spent. Time follows: what
//! is not held is not worked on. What is unpacked and given back again counts as work, which has a bound of its own: parts of a
//! file that many others point to would be unpacked for each of them.

use std::cell::Cell;

/// Bytes that any file may be turned into.
const FREE: u64 = 16 << 20;
/// Bytes that each byte of a file may be turned into. Deflate packs to a thousandth at most; the unpacked bytes and the
/// numbers made of them are held together.
const RATIO: u64 = 2100;

/// What a reader may still hold.
#[derive(Debug)]
pub struct Budget {
    allowed: u64,
    held: Cell<u64>,
    worked: Cell<u64>,
}

/// Times that all that a file may be turned into may be unpacked: once to look, once to read, and once more.
const LOOKS: u64 = 3;

/// A file that would be turned into more than it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it would fill over {} MB of memory; a file of its size may fill {} MB", needed >> 20, allowed >> 20)]
pub struct OverBudget {
    /// Bytes that were held already, and that were to be held then.
    pub needed: u64,
    /// Bytes that may be held.
    pub allowed: u64,
}

impl Budget {
    /// What a file of so many bytes may be turned into.
    #[must_use]
    pub fn of_file(bytes: u64) -> Self {
        Self::of(FREE.saturating_add(bytes.saturating_mul(RATIO)))
    }

    /// This many bytes.
    #[must_use]
    pub fn of(allowed: u64) -> Self {
        Self { allowed, held: Cell::new(0), worked: Cell::new(0) }
    }

    /// Takes bytes before they are allocated. They stay taken until [`Self::give_back`].
    ///
    /// # Errors
    /// [`OverBudget`], and nothing is taken.
    pub fn take(&self, bytes: usize) -> Result<(), OverBudget> {
        let needed = self.held.get().saturating_add(bytes as u64);
        if needed > self.allowed {
            return Err(OverBudget { needed, allowed: self.allowed });
        }
        self.held.set(needed);
        Ok(())
    }

    /// Takes the bytes of `count` values of type `T`.
    ///
    /// # Errors
    /// [`OverBudget`].
    pub fn take_values<T>(&self, count: usize) -> Result<(), OverBudget> {
        self.take(count.saturating_mul(size_of::<T>()))
    }

    /// An empty vector with room for `count` values, which are taken.
    ///
    /// # Errors
    /// [`OverBudget`].
    pub fn vec<T>(&self, count: usize) -> Result<Vec<T>, OverBudget> {
        self.take_values::<T>(count)?;
        Ok(Vec::with_capacity(count))
    }

    /// The text, whose bytes are taken.
    ///
    /// # Errors
    /// [`OverBudget`].
    pub fn text(&self, text: &str) -> Result<String, OverBudget> {
        // The string itself, and what the allocator needs for it, count too: a name of one letter costs more than a byte.
        self.take(text.len() + 2 * size_of::<String>())?;
        Ok(text.to_owned())
    }

    /// Takes bytes that are to be unpacked. They may be given back, the work may not.
    ///
    /// # Errors
    /// [`OverBudget`], and nothing is taken.
    pub fn unpack(&self, bytes: usize) -> Result<(), OverBudget> {
        let (worked, most) = (self.worked.get().saturating_add(bytes as u64), self.allowed.saturating_mul(LOOKS));
        if worked > most {
            return Err(OverBudget { needed: worked, allowed: most });
        }
        self.take(bytes)?;
        self.worked.set(worked);
        Ok(())
    }

    /// Gives back bytes that are held no longer.
    pub fn give_back(&self, bytes: usize) {
        self.held.set(self.held.get().saturating_sub(bytes as u64));
    }

    /// Bytes that may still be taken.
    #[must_use]
    pub fn left(&self) -> u64 {
        self.allowed - self.held.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spent_is_refused_until_it_is_given_back() {
        let budget = Budget::of(100);
        assert_eq!(budget.vec::<u64>(10).map(|v| v.capacity() >= 10), Ok(true));
        assert_eq!(budget.take(21), Err(OverBudget { needed: 101, allowed: 100 }));
        assert_eq!((budget.left(), budget.take(20)), (20, Ok(())));
        budget.give_back(80);
        assert_eq!(budget.text("a much too long name for what is left of it").map_err(|e| e.allowed), Err(100));
        assert_eq!(budget.take(usize::MAX).map_err(|error| error.needed), Err(u64::MAX));
        assert_eq!(budget.left(), 80);
    }

    #[test]
    fn what_is_given_back_may_not_be_unpacked_for_ever() {
        let budget = Budget::of(100);
        for _ in 0..6 {
            budget.unpack(50).unwrap();
            budget.give_back(50);
        }
        assert_eq!((budget.unpack(1), budget.left()), (Err(OverBudget { needed: 301, allowed: 300 }), 100));
        assert_eq!(Budget::of(100).unpack(101), Err(OverBudget { needed: 101, allowed: 100 }));
        Budget::of(u64::MAX).unpack(usize::MAX).unwrap();
    }

    #[test]
    fn a_small_file_may_not_fill_the_memory() {
        assert!(Budget::of_file(64 << 10).left() < 160 << 20);
        assert_eq!(Budget::of_file(u64::MAX).left(), u64::MAX);
    }
}
