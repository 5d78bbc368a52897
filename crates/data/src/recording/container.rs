//! MCAP: channels and messages, out of plain and compressed chunks, one after the other.
//!
//! ```text
//! magic, records, magic     a record: opcode (1 byte), length (8 bytes), that many bytes
//! ```
//!
//! A length is compared with the bytes that are there before anything is done on its word. What a chunk says that it
//! unpacks to has a bound, so that a small file cannot fill the memory. Of the file no more than a record is held.

use std::collections::HashMap;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::rc::Rc;

use super::message::{Channel, Each, Message, Schema, Trouble, nanoseconds};
use crate::RecordingProblem;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A file may unpack to `LARGEST_RATIO` times its own size and `FREE` bytes more.
const LARGEST_RATIO: u64 = 1000;
const FREE: u64 = 4 << 20;

/// What a zstd decoder may look back on: what every decoder grants (RFC 8878), or a whole chunk.
const WINDOW: u64 = 8 << 20;

mod opcode {
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const STATISTICS: u8 = 0x0b;
}

/// Calls `each` with every message, in the order of the file. `count` messages came before it.
///
/// # Errors
/// What is wrong with the file, or what `each` objects to.
pub fn messages<R: Read + Seek>(mut file: R, count: &mut usize, each: &mut Each<'_>) -> Result<(), Trouble> {
    let length = file.seek(SeekFrom::End(0))?;
    file.rewind()?;
    let mut file = BufReader::with_capacity(1 << 16, file);
    let mut left = length;
    let mut magic = [0; 8];
    if length >= 8 {
        file.read_exact(&mut magic)?;
        left -= 8;
    }
    match magic {
        [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'] => {}
        [0x89, b'M', b'C', b'A', b'P', version, b'\r', b'\n'] => {
            let found = (version as char).escape_default().to_string();
            return Err(RecordingProblem::Version { found }.into());
        }
        _ => return Err(RecordingProblem::NotMcap.into()),
    }
    let expected = expected(&mut file, length).unwrap_or_default();
    file.seek(SeekFrom::Start(8))?;
    let mut reader = Reader { schemas: HashMap::new(), channels: HashMap::new(), expected, count };
    let (mut body, mut content) = (Vec::new(), Vec::new());
    let mut unpacked = 0_u64;
    loop {
        let mut head = [0; 9];
        let size = left.checked_sub(9).ok_or(RecordingProblem::CutOff)?;
        file.read_exact(&mut head)?;
        let (opcode, wanted) = (head[0], Bytes(&head[1..]).u64().unwrap_or(u64::MAX));
        left = size.checked_sub(wanted).ok_or(RecordingProblem::CutOff)?;
        let is_wanted = matches!(opcode, opcode::SCHEMA | opcode::CHANNEL | opcode::MESSAGE | opcode::CHUNK);
        if opcode == opcode::FOOTER {
            // What follows is the end.
            skip(&mut file, wanted)?;
            break;
        } else if !is_wanted {
            skip(&mut file, wanted)?;
            continue;
        }
        body.clear();
        if (&mut file).take(wanted).read_to_end(&mut body)? as u64 != wanted {
            return Err(RecordingProblem::CutOff.into());
        }
        if opcode != opcode::CHUNK {
            reader.record(opcode, Bytes(&body), each)?;
            continue;
        }
        let chunk = Chunk::parse(&mut Bytes(&body)).ok_or(RecordingProblem::Damaged("a chunk's header ends early"))?;
        unpacked = unpacked.saturating_add(chunk.size);
        let allowed = FREE.saturating_add(LARGEST_RATIO.saturating_mul(length));
        if unpacked > allowed {
            return Err(RecordingProblem::TooLarge { unpacked, allowed }.into());
        }
        let mut records = Bytes(chunk.unpack(&mut content)?);
        while !records.0.is_empty() {
            let record = records.record();
            let (opcode, body) = record.ok_or(RecordingProblem::Damaged("a chunk ends within a record"))?;
            reader.record(opcode, body, each)?;
        }
    }
    let mut end = [0; 8];
    if left < 8 {
        return Err(RecordingProblem::CutOff.into());
    }
    file.seek(SeekFrom::End(-8))?;
    file.read_exact(&mut end)?;
    if end == MAGIC { Ok(()) } else { Err(RecordingProblem::CutOff.into()) }
}

/// How many messages each channel has, as the statistics at the end of the file tell. Nothing is believed of it but how
/// much room could be made.
fn expected<R: Read + Seek>(file: &mut R, length: u64) -> Option<HashMap<u16, u64>> {
    const FOOTER: u64 = 9 + 20 + 8;
    const LARGEST: u64 = 1 << 20;
    file.seek(SeekFrom::Start(length.checked_sub(FOOTER)?)).ok()?;
    let mut footer = [0; FOOTER as usize];
    file.read_exact(&mut footer).ok()?;
    let (opcode, mut body) = Bytes(&footer).record()?;
    let start = body.u64().filter(|&start| opcode == opcode::FOOTER && start >= 8)?;
    let summary = length.checked_sub(FOOTER)?.checked_sub(start)?;
    file.seek(SeekFrom::Start(start)).ok()?;
    let mut bytes = Vec::new();
    file.take(summary.min(LARGEST)).read_to_end(&mut bytes).ok()?;
    let mut records = Bytes(&bytes);
    while let Some((opcode, mut body)) = records.record() {
        if opcode == opcode::STATISTICS {
            // Counts of all kinds of records, the first and the last time, bytes of the map that follows.
            body.take(8 + 2 + 4 * 4 + 2 * 8)?;
            let bytes = usize::try_from(body.u32()?).ok()?;
            let mut map = Bytes(body.take(bytes)?);
            let pairs = std::iter::from_fn(|| Some((map.u16()?, map.u64()?)));
            return Some(pairs.collect());
        }
    }
    None
}

fn skip<R: Read + Seek>(file: &mut BufReader<R>, count: u64) -> Result<(), Trouble> {
    match i64::try_from(count) {
        Ok(count) => Ok(file.seek_relative(count)?),
        Err(_) => Err(RecordingProblem::CutOff.into()),
    }
}

/// What was read so far.
struct Reader<'c> {
    schemas: HashMap<u16, Rc<Schema>>,
    channels: HashMap<u16, Rc<Channel>>,
    expected: HashMap<u16, u64>,
    count: &'c mut usize,
}

impl Reader<'_> {
    fn record(&mut self, opcode: u8, mut body: Bytes<'_>, each: &mut Each<'_>) -> Result<(), Trouble> {
        let body = &mut body;
        let damaged = RecordingProblem::Damaged;
        match opcode {
            opcode::SCHEMA => {
                let schema = || Some((body.u16()?, body.text()?, body.text()?, body.u32()?));
                let (id, name, language, length) = { schema }().ok_or(damaged("a schema ends early"))?;
                let description = usize::try_from(length).ok().and_then(|length| body.take(length));
                let description = description.ok_or(damaged("a schema ends early"))?;
                self.schemas.insert(id, Rc::new(Schema { name, language, description: description.to_vec() }));
            }
            opcode::CHANNEL => {
                let channel = || Some((body.u16()?, body.u16()?, body.text()?, body.text()?));
                let (id, schema, topic, encoding) = { channel }().ok_or(damaged("a channel ends early"))?;
                let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
                let channel = Channel { topic, encoding, schema };
                // The same channel stands in every chunk: it stays the one that it was.
                if self.channels.get(&id).is_none_or(|known| **known != channel) {
                    self.channels.insert(id, Rc::new(channel));
                }
            }
            opcode::MESSAGE => {
                // A channel, a number within it, the time of logging, the time of publishing.
                let header = || Some((body.u16()?, body.u32()?, body.u64()?, body.u64()?));
                let (id, _, logged, published) = { header }().ok_or(damaged("a message ends early"))?;
                *self.count += 1;
                let channel =
                    self.channels.get(&id).ok_or(damaged("a message belongs to a channel that is not there"))?;
                let (logged, published) = (nanoseconds(logged), nanoseconds(published));
                let expected = self.expected.get(&id).copied().unwrap_or_default();
                each(&Message { channel, logged, published, number: *self.count, expected, data: body.0 })?;
            }
            // Indexes, statistics, attachments, and what later versions add.
            _ => {}
        }
        Ok(())
    }
}

/// Records that are packed together.
struct Chunk<'a> {
    size: u64,
    checksum: u32,
    compression: String,
    data: &'a [u8],
}

impl<'a> Chunk<'a> {
    fn parse(body: &mut Bytes<'a>) -> Option<Self> {
        let (_, _) = (body.u64()?, body.u64()?);
        let (size, checksum, compression) = (body.u64()?, body.u32()?, body.text()?);
        let length = body.u64()?;
        let data = body.take(usize::try_from(length).ok()?)?;
        Some(Self { size, checksum, compression, data })
    }

    /// Its records, where they are or in `content`.
    fn unpack<'c>(&self, content: &'c mut Vec<u8>) -> Result<&'c [u8], Trouble>
    where
        'a: 'c,
    {
        let broken = |error: &dyn std::fmt::Display| RecordingProblem::Compression {
            compression: self.compression.clone(),
            message: error.to_string(),
        };
        // The memory grows with what there is, not with what is promised.
        content.clear();
        let most = self.size.saturating_add(1);
        let records: &[u8] = match self.compression.as_str() {
            "" => self.data,
            "zstd" => {
                let stream =
                    ruzstd::decoding::StreamingDecoder::new_with_max_window_size(self.data, WINDOW.max(self.size));
                let stream = stream.map_err(|error| broken(&error))?;
                stream.take(most).read_to_end(content).map_err(|error| broken(&error))?;
                content
            }
            "lz4" => {
                let stream = lz4_flex::frame::FrameDecoder::new(self.data);
                stream.take(most).read_to_end(content).map_err(|error| broken(&error))?;
                content
            }
            other => return Err(RecordingProblem::UnknownCompression { found: other.to_owned() }.into()),
        };
        if records.len() as u64 != self.size {
            return Err(RecordingProblem::Damaged("a chunk does not unpack to the size that it says").into());
        }
        if self.checksum != 0 && crc32fast::hash(records) != self.checksum {
            return Err(RecordingProblem::Damaged("a chunk's checksum is wrong").into());
        }
        Ok(records)
    }
}

/// Bytes that are read from the front.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (front, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(front)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<String> {
        let length = self.u32()?;
        let text = self.take(usize::try_from(length).ok()?)?;
        Some(String::from_utf8_lossy(text).into_owned())
    }

    /// The next record's opcode and contents.
    fn record(&mut self) -> Option<(u8, Self)> {
        let [opcode] = self.array()?;
        let length = self.u64()?;
        let body = self.take(usize::try_from(length).ok()?)?;
        Some((opcode, Self(body)))
    }
}
