//! Trees: where the links of a group and the chunks of a data set are (III.A).

use super::file::{File, bytes_for, damaged};
use crate::front::Front;
use crate::problem::FormatProblem;

/// Levels of a tree that are followed.
const DEEPEST: usize = 32;

/// Calls `each` with the key and the child of every entry in the leaves of an old tree (version 1).
pub fn old<'a>(
    file: &File<'a>,
    address: u64,
    kind: u8,
    key: usize,
    each: &mut dyn FnMut(&'a [u8], u64) -> Result<(), FormatProblem>,
) -> Result<(), FormatProblem> {
    old_node(file, address, kind, key, None, each)
}

fn old_node<'a>(
    file: &File<'a>,
    address: u64,
    kind: u8,
    key: usize,
    level: Option<u8>,
    each: &mut dyn FnMut(&'a [u8], u64) -> Result<(), FormatProblem>,
) -> Result<(), FormatProblem> {
    let broken = || damaged("a tree of links or chunks");
    let mut front = file.signed(address, b"TREE")?;
    let mut head = || Some((front.u8()?, front.u8()?, front.u16()?, front.take(2 * file.offsets)?));
    let (found, here, entries, _) = head().ok_or_else(broken)?;
    if found != kind || level.is_some_and(|level| here != level) || usize::from(here) > DEEPEST {
        return Err(broken());
    }
    let head = 4 + 2 * file.offsets;
    let mut front = file.signed_front(address, b"TREE", head + usize::from(entries) * (key + file.offsets))?;
    front.take(head).ok_or_else(broken)?;
    for _ in 0..entries {
        file.budget.take(16)?;
        let key_bytes = front.take(key).ok_or_else(broken)?;
        let child = file.address(&mut front).flatten().ok_or_else(broken)?;
        match here.checked_sub(1) {
            Some(below) => old_node(file, child, kind, key, Some(below), each)?,
            None => each(key_bytes, child)?,
        }
    }
    Ok(())
}

/// Calls `each` with every record of a new tree (version 2).
pub fn new<'a>(
    file: &File<'a>,
    address: u64,
    each: &mut dyn FnMut(&'a [u8]) -> Result<(), FormatProblem>,
) -> Result<(), FormatProblem> {
    let broken = || damaged("a tree of links or chunks");
    let mut front = file.signed(address, b"BTHD")?;
    let mut head = || {
        front.take(2)?;
        let (node, record, depth) = (front.u32()? as usize, usize::from(front.u16()?), usize::from(front.u16()?));
        front.take(2)?;
        Some((node, record, depth, file.address(&mut front)?, usize::from(front.u16()?)))
    };
    let (node, record, depth, root, records) = head().ok_or_else(broken)?;
    let Some(root) = root.filter(|_| records > 0) else { return Ok(()) };
    if record == 0 || depth > DEEPEST || node < 16 {
        return Err(broken());
    }
    // Per level, the bytes of a pointer to a node below it. Nodes begin and end with 10 bytes that are no records.
    let most = (node - 10) / record;
    let count = bytes_for(most as u64);
    let (mut pointers, mut all, mut all_size) = (vec![0], most as u64, 0);
    for _ in 0..depth {
        let pointer = file.offsets + count + all_size;
        let here = node.checked_sub(10 + pointer).ok_or_else(broken)? / (record + pointer);
        all = (here as u64 + 1).checked_mul(all).and_then(|below| below.checked_add(here as u64)).ok_or_else(broken)?;
        all_size = bytes_for(all);
        pointers.push(pointer);
    }
    New { file, record, count, pointers }.node(root, depth, records, each)
}

struct New<'f, 'a> {
    file: &'f File<'a>,
    record: usize,
    count: usize,
    pointers: Vec<usize>,
}

impl<'a> New<'_, 'a> {
    fn node(
        &self,
        address: u64,
        level: usize,
        records: usize,
        each: &mut dyn FnMut(&'a [u8]) -> Result<(), FormatProblem>,
    ) -> Result<(), FormatProblem> {
        let broken = || damaged("a tree of links or chunks");
        let pointers = records.saturating_add(1).saturating_mul(self.pointers[level]);
        let least = records.saturating_mul(self.record).saturating_add(pointers).saturating_add(2);
        let mut front = self.file.signed_front(address, if level == 0 { b"BTLF" } else { b"BTIN" }, least)?;
        front.take(2).ok_or_else(broken)?;
        let all = front.take(records.checked_mul(self.record).ok_or_else(broken)?).ok_or_else(broken)?;
        let mut here = all.chunks_exact(self.record);
        if level > 0 {
            for _ in 0..=records {
                let mut pointer = Front(front.take(self.pointers[level]).ok_or_else(broken)?);
                let child = self.file.address(&mut pointer).flatten().ok_or_else(broken)?;
                let below =
                    pointer.number(self.count).and_then(|count| usize::try_from(count).ok()).ok_or_else(broken)?;
                self.node(child, level - 1, below, each)?;
                // The records of a node stand between its children.
                if let Some(record) = here.next() {
                    each(record)?;
                }
            }
        }
        here.try_for_each(|record| {
            self.file.budget.take(16)?;
            each(record)
        })
    }
}
