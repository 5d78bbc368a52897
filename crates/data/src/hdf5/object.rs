//! Headers of objects (IV.A): what a group or a data set is, in messages.

use super::file::{File, damaged};
use crate::front::Front;
use crate::problem::FormatProblem;

/// Blocks that a header may be spread over.
const MOST_BLOCKS: usize = 256;

/// Kinds of messages.
pub mod kind {
    pub const DATASPACE: u16 = 0x01;
    pub const LINK_INFO: u16 = 0x02;
    pub const DATATYPE: u16 = 0x03;
    pub const OLD_FILL: u16 = 0x04;
    pub const FILL: u16 = 0x05;
    pub const LINK: u16 = 0x06;
    pub const EXTERNAL: u16 = 0x07;
    pub const LAYOUT: u16 = 0x08;
    pub const FILTERS: u16 = 0x0b;
    pub const ATTRIBUTE: u16 = 0x0c;
    pub const CONTINUATION: u16 = 0x10;
    pub const SYMBOLS: u16 = 0x11;
}

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its kind.
    pub kind: u16,
    /// Whether its contents stand elsewhere.
    shared: bool,
    /// Its contents.
    pub data: &'a [u8],
}

/// The messages of an object's header.
#[derive(Debug)]
pub struct Object<'a> {
    messages: Vec<Message<'a>>,
}

impl<'a> Object<'a> {
    /// Reads the header at an address.
    pub fn read(file: &File<'a>, address: u64) -> Result<Self, FormatProblem> {
        let cut = || damaged("an object's header ends early");
        let mut front = file.at(address)?;
        let mut object = Self { messages: Vec::new() };
        let mut blocks: Vec<(Front<'a>, Shape)> = Vec::new();
        if front.0.starts_with(b"OHDR") {
            front.take(5).ok_or_else(cut)?;
            let flags = front.u8().ok_or_else(cut)?;
            let times = if flags & 0x20 == 0 { 0 } else { 16 };
            let changes = if flags & 0x10 == 0 { 0 } else { 4 };
            front.take(times + changes).ok_or_else(cut)?;
            let size = front.number(1 << (flags & 3)).ok_or_else(cut)?;
            let head = 6 + times + changes + (1 << (flags & 3));
            let size = usize::try_from(size).ok().ok_or_else(cut)?;
            let mut front = file.front(address, size.saturating_add(head))?;
            front.take(head).ok_or_else(cut)?;
            let block = front.take(size).ok_or_else(cut)?;
            blocks.push((Front(block), Shape::New { ordered: flags & 4 != 0 }));
        } else {
            if front.u8() != Some(1) {
                return Err(damaged("an object's header is of a version that is not known"));
            }
            front.take(7).ok_or_else(cut)?;
            let size = front.u32().ok_or_else(cut)? as usize;
            let mut front = file.front(address, size.saturating_add(16))?;
            front.take(16).ok_or_else(cut)?;
            blocks.push((Front(front.take(size).ok_or_else(cut)?), Shape::Old));
        }
        let mut at = 0;
        while let Some(&(block, shape)) = blocks.get(at) {
            at += 1;
            let mut block = block;
            while block.0.len() >= shape.head() {
                file.budget.take(size_of::<Message<'_>>())?;
                let message = shape.message(&mut block).ok_or_else(cut)?;
                if message.kind != kind::CONTINUATION {
                    object.messages.push(message);
                    continue;
                }
                if blocks.len() >= MOST_BLOCKS {
                    return Err(damaged("an object's header is spread over too many blocks"));
                }
                let mut place = Front(message.data);
                let address = file.address(&mut place).flatten().ok_or_else(cut)?;
                let size = file.length(&mut place).ok_or_else(cut)?;
                blocks.push((continuation(file, address, size, shape)?, shape));
            }
        }
        Ok(object)
    }

    /// The contents of the first message of a kind, wherever they stand.
    pub fn message(&self, file: &File<'a>, kind: u16) -> Result<Option<&'a [u8]>, FormatProblem> {
        match self.messages.iter().find(|message| message.kind == kind) {
            None => Ok(None),
            Some(message) if message.shared => shared(file, message.data, kind).map(Some),
            Some(message) => Ok(Some(message.data)),
        }
    }

    /// All messages of a kind that stand here.
    pub fn messages(&self, kind: u16) -> impl Iterator<Item = &'a [u8]> {
        self.messages.iter().filter(move |message| message.kind == kind && !message.shared).map(|message| message.data)
    }

    /// Whether there is a message of a kind.
    pub fn has(&self, kind: u16) -> bool {
        self.messages.iter().any(|message| message.kind == kind)
    }
}

/// The block that goes on with a header.
fn continuation<'a>(file: &File<'a>, address: u64, size: usize, shape: Shape) -> Result<Front<'a>, FormatProblem> {
    match shape {
        Shape::Old => file.bytes(address, size).map(Front),
        Shape::New { .. } => {
            let block = file.bytes(address, size)?.strip_prefix(b"OCHK");
            let block = block.and_then(|block| block.split_last_chunk::<4>());
            block.map(|(block, _)| Front(block)).ok_or_else(|| damaged("an object's header goes on in the wrong place"))
        }
    }
}

/// A message that is kept at another object (IV.A.2.a, shared messages).
pub fn shared<'a>(file: &File<'a>, data: &[u8], kind: u16) -> Result<&'a [u8], FormatProblem> {
    let cut = || damaged("a shared message ends early");
    let mut front = Front(data);
    let (version, place) = front.u8().zip(front.u8()).ok_or_else(cut)?;
    if version == 1 {
        front.take(6).ok_or_else(cut)?;
    } else if version == 3 && place == 1 {
        return Err(FormatProblem::NotRead {
            found: "a message in a heap of shared messages".to_owned(),
            help: "write the file again by h5py or `h5repack`".to_owned(),
        });
    }
    let address = file.address(&mut front).flatten().ok_or_else(cut)?;
    // An object that is shared shares no further: the message itself must stand there.
    let object = Object::read(file, address)?;
    let message = object.messages.iter().find(|message| message.kind == kind && !message.shared);
    message.map(|message| message.data).ok_or_else(|| damaged("a shared message is not where it should be"))
}

/// How messages stand in a header.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Old,
    New { ordered: bool },
}

impl Shape {
    /// Bytes before a message's contents.
    fn head(self) -> usize {
        match self {
            Self::Old => 8,
            Self::New { ordered } => 4 + if ordered { 2 } else { 0 },
        }
    }

    fn message<'a>(self, front: &mut Front<'a>) -> Option<Message<'a>> {
        let (kind, size, flags);
        match self {
            Self::Old => {
                (kind, size, flags) = (front.u16()?, front.u16()?, front.u8()?);
                front.take(3)?;
            }
            Self::New { ordered } => {
                (kind, size, flags) = (u16::from(front.u8()?), front.u16()?, front.u8()?);
                front.take(if ordered { 2 } else { 0 })?;
            }
        }
        Some(Message { kind, shared: flags & 2 != 0, data: front.take(size.into())? })
    }
}
