//! Groups: names, and the objects that they name.

use super::file::{File, damaged};
use super::heap::{Fractal, Local};
use super::object::{Object, kind};
use super::tree;
use crate::front::Front;
use crate::problem::FormatProblem;

/// A name in a group and the address of the object that it names. Soft links and links to other files are passed over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// The name.
    pub name: String,
    /// The object's header.
    pub address: u64,
}

/// Whether an object is a group.
pub fn is_group(object: &Object<'_>) -> bool {
    [kind::SYMBOLS, kind::LINK_INFO, kind::LINK].iter().any(|&kind| object.has(kind))
}

/// The links of a group.
pub fn links(file: &File<'_>, group: &Object<'_>) -> Result<Vec<Link>, FormatProblem> {
    let mut links = Vec::new();
    let mut push = |name: &str, address: u64| -> Result<(), FormatProblem> {
        let name = file.budget.text(name)?;
        links.push(Link { name, address });
        Ok(())
    };
    for message in group.messages(kind::LINK) {
        if let Some((name, address)) = link(file, message)? {
            push(name, address)?;
        }
    }
    if let Some(message) = group.message(file, kind::LINK_INFO)? {
        let mut front = Front(message);
        let mut places = || {
            let flags = front.array::<2>()?[1];
            front.take(if flags & 1 == 0 { 0 } else { 8 })?;
            Some((file.address(&mut front)?, file.address(&mut front)?))
        };
        let places = places().ok_or_else(|| damaged("a group's links"))?;
        if let (Some(heap), Some(index)) = places {
            let heap = Fractal::read(file, heap)?;
            // By name (III.A.2): a hash of four bytes, then the place in the heap.
            tree::new(file, index, &mut |record| {
                let id = record.get(4..).ok_or_else(|| damaged("a group's links"))?;
                match link(file, heap.object(id)?)? {
                    Some((name, address)) => push(name, address),
                    None => Ok(()),
                }
            })?;
        }
    }
    if let Some(message) = group.message(file, kind::SYMBOLS)? {
        let mut front = Front(message);
        let mut places = || Some((file.address(&mut front)??, file.address(&mut front)??));
        let (index, heap) = places().ok_or_else(|| damaged("a group's links"))?;
        let heap = Local::read(file, heap)?;
        tree::old(file, index, 0, file.lengths, &mut |_, node| {
            let broken = || damaged("a group's table of links");
            let mut front = file.signed(node, b"SNOD")?;
            front.take(2).ok_or_else(broken)?;
            let count = front.u16().ok_or_else(broken)?;
            let mut front = file.signed_front(node, b"SNOD", 4 + usize::from(count) * (2 * file.offsets + 24))?;
            front.take(4).ok_or_else(broken)?;
            for _ in 0..count {
                let mut entry = || {
                    let (name, address, cache) = (front.number(file.offsets)?, file.address(&mut front)?, front.u32()?);
                    front.take(20)?;
                    Some((name, address, cache))
                };
                let (name, address, cache) = entry().ok_or_else(broken)?;
                // 2: a soft link.
                if let (Some(address), true) = (address, cache != 2) {
                    push(heap.name(name).ok_or_else(broken)?, address)?;
                }
            }
            Ok(())
        })?;
    }
    Ok(links)
}

/// What a link message says, if it is a hard link (IV.A.2.g).
fn link<'a>(file: &File<'_>, message: &'a [u8]) -> Result<Option<(&'a str, u64)>, FormatProblem> {
    let mut front = Front(message);
    let mut read = || {
        let [_, flags] = front.array()?;
        let hard = if flags & 8 == 0 { true } else { front.u8()? == 0 };
        front.take(if flags & 4 == 0 { 0 } else { 8 })?;
        front.take(if flags & 16 == 0 { 0 } else { 1 })?;
        let length = usize::try_from(front.number(1 << (flags & 3))?).ok()?;
        let name = std::str::from_utf8(front.take(length)?).ok()?;
        if hard { Some(Some((name, file.address(&mut front)??))) } else { Some(None) }
    };
    read().ok_or_else(|| damaged("a link"))
}
