//! The container of a recording: its channels and messages, out of plain and compressed chunks.
//!
//! ```text
//! magic, records, magic     a record: opcode (1 byte), length (8 bytes), that many bytes
//! ```
//!
//! A length is compared with the bytes that are there before anything is done on its word. What a chunk says that it
//! unpacks to has a bound, so that a small file cannot fill the memory.

use std::collections::BTreeMap;
use std::io::Read;

use super::super::RecordingProblem;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A file may unpack to this many times its own size,
const LARGEST_RATIO: u64 = 1000;
/// and to these bytes more.
const FREE: u64 = 4 << 20;

/// What a zstd decoder may look back on: what every decoder grants (RFC 8878), or a whole chunk.
const WINDOW: u64 = 8 << 20;

mod opcode {
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
}

/// Where messages of one kind go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// How its messages are encoded, e.g. `json`.
    pub encoding: String,
    /// Name of their schema; empty if they have none.
    pub schema: String,
}

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its channel.
    pub channel: &'a Channel,
    /// When it was logged, in nanoseconds.
    pub time: u64,
    /// Its number among all of the file, from 1.
    pub number: usize,
    /// What it says.
    pub data: &'a [u8],
}

/// Calls `each` with every message, in the order of the file.
///
/// # Errors
/// What is wrong with the file, or what `each` objects to.
pub fn messages(
    bytes: &[u8],
    mut each: impl FnMut(Message<'_>) -> Result<(), RecordingProblem>,
) -> Result<(), RecordingProblem> {
    let mut rest = match bytes {
        [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n', rest @ ..] => Bytes(rest),
        [0x89, b'M', b'C', b'A', b'P', version, b'\r', b'\n', ..] => {
            return Err(RecordingProblem::Version { found: (*version as char).escape_default().to_string() });
        }
        _ => return Err(RecordingProblem::NotMcap),
    };
    let mut reader = Reader { schemas: BTreeMap::new(), channels: BTreeMap::new(), count: 0 };
    let mut unpacked = 0_u64;
    loop {
        let Some((opcode, mut body)) = rest.record() else { return Err(RecordingProblem::CutOff) };
        match opcode {
            opcode::FOOTER => break,
            opcode::CHUNK => {
                let chunk = Chunk::parse(&mut body).ok_or(RecordingProblem::Damaged("a chunk's header ends early"))?;
                unpacked = unpacked.saturating_add(chunk.size);
                let allowed = FREE + LARGEST_RATIO * bytes.len() as u64;
                if unpacked > allowed {
                    return Err(RecordingProblem::TooLarge { unpacked, allowed });
                }
                let content = chunk.unpack()?;
                let mut records = Bytes(&content);
                while !records.0.is_empty() {
                    let record = records.record();
                    let (opcode, body) = record.ok_or(RecordingProblem::Damaged("a chunk ends within a record"))?;
                    reader.record(opcode, body, &mut each)?;
                }
            }
            _ => reader.record(opcode, body, &mut each)?,
        }
    }
    if rest.0.ends_with(MAGIC) { Ok(()) } else { Err(RecordingProblem::CutOff) }
}

/// What was read so far.
struct Reader {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    count: usize,
}

impl Reader {
    fn record(
        &mut self,
        opcode: u8,
        mut body: Bytes<'_>,
        each: &mut impl FnMut(Message<'_>) -> Result<(), RecordingProblem>,
    ) -> Result<(), RecordingProblem> {
        let body = &mut body;
        let damaged = RecordingProblem::Damaged;
        match opcode {
            opcode::SCHEMA => {
                let schema = || Some((body.u16()?, body.text()?));
                let (id, name) = { schema }().ok_or(damaged("a schema ends early"))?;
                self.schemas.insert(id, name);
            }
            opcode::CHANNEL => {
                let channel = || Some((body.u16()?, body.u16()?, body.text()?, body.text()?));
                let (id, schema, topic, encoding) = { channel }().ok_or(damaged("a channel ends early"))?;
                let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
                self.channels.insert(id, Channel { topic, encoding, schema });
            }
            opcode::MESSAGE => {
                // A channel, a number within it, the time of logging, the time of publishing.
                let header = || Some((body.u16()?, body.u32()?, body.u64()?, body.u64()?));
                let (id, _, time, _) = { header }().ok_or(damaged("a message ends early"))?;
                self.count += 1;
                let channel =
                    self.channels.get(&id).ok_or(damaged("a message belongs to a channel that is not there"))?;
                each(Message { channel, time, number: self.count, data: body.0 })?;
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

    fn unpack(&self) -> Result<Vec<u8>, RecordingProblem> {
        let broken = |error: &dyn std::fmt::Display| RecordingProblem::Compression {
            compression: self.compression.clone(),
            message: error.to_string(),
        };
        // The memory grows with what there is, not with what is promised.
        let mut content = Vec::new();
        let most = self.size + 1;
        match self.compression.as_str() {
            "" => content.extend(self.data),
            "zstd" => {
                let stream =
                    ruzstd::decoding::StreamingDecoder::new_with_max_window_size(self.data, WINDOW.max(self.size));
                let stream = stream.map_err(|error| broken(&error))?;
                stream.take(most).read_to_end(&mut content).map_err(|error| broken(&error))?;
            }
            "lz4" => {
                let stream = lz4_flex::frame::FrameDecoder::new(self.data);
                stream.take(most).read_to_end(&mut content).map_err(|error| broken(&error))?;
            }
            other => return Err(RecordingProblem::UnknownCompression { found: other.to_owned() }),
        }
        if content.len() as u64 != self.size {
            return Err(RecordingProblem::Damaged("a chunk does not unpack to the size that it says"));
        }
        if self.checksum != 0 && crc32fast::hash(&content) != self.checksum {
            return Err(RecordingProblem::Damaged("a chunk's checksum is wrong"));
        }
        Ok(content)
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
