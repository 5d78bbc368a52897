//! Writes recordings (MCAP): `foxglove.JointStates` as JSON, which Foxglove shows and [`crate::read`] reads.
//!
//! ```text
//! magic, header, chunks with an index each, end of data, summary, footer, magic
//! ```
//!
//! Nothing is packed. The summary repeats schemas and channels and tells where chunks are, so that viewers need not read
//! all. (MCAP format specification, version 0.)

use scrnn::dataset::Dataset;
use serde_json::json;

use crate::FileError;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Bytes of messages from which on another chunk is begun.
const CHUNK: usize = 1 << 20;
/// Seconds between two sequences.
const PAUSE: f64 = 1.0;

/// Numbers of the two topics.
const JOINTS: u16 = 1;
const SEQUENCES: u16 = 2;

mod opcode {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const STATISTICS: u8 = 0x0b;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

/// The bytes of a recording, one sequence after the other, `period` seconds between samples. Channels are joints whose
/// positions are the values; a message on `/sequence` begins each sequence.
///
/// # Errors
/// [`FileError::NoPeriod`].
pub fn recording(path: &str, data: &Dataset, period: Option<f64>) -> Result<Vec<u8>, FileError> {
    let period = period.filter(|period| period.is_finite() && *period > 0.0);
    let period = period.ok_or_else(|| FileError::NoPeriod { path: path.to_owned() })?;
    let mut file = Recording::new();
    let names: Vec<String> = data.channels().iter().map(|name| json!(name).to_string()).collect();
    let mut begin = 0_u64;
    for sequence in data.sequences() {
        let time = |step: usize| begin + (step as f64 * period * 1e9).round() as u64;
        file.message(
            SEQUENCES,
            begin,
            json!({ "timestamp": stamp(begin), "name": sequence.name }).to_string().as_bytes(),
        );
        for step in 0..sequence.len() {
            let joints = names.iter().zip(sequence.sample(step)).filter(|(_, value)| value.is_finite());
            let joints: Vec<String> =
                joints.map(|(name, value)| format!("{{\"name\":{name},\"position\":{value:?}}}")).collect();
            let text = format!("{{\"timestamp\":{},\"joints\":[{}]}}", stamp(time(step)), joints.join(","));
            file.message(JOINTS, time(step), text.as_bytes());
        }
        begin = time(sequence.len()) + (PAUSE * 1e9) as u64;
    }
    Ok(file.finish())
}

fn stamp(time: u64) -> serde_json::Value {
    json!({ "sec": time / 1_000_000_000, "nsec": time % 1_000_000_000 })
}

/// A file that is being written.
struct Recording {
    bytes: Vec<u8>,
    chunk: Vec<u8>,
    /// Times and places in the chunk, of each topic.
    index: [Vec<(u64, u64)>; 2],
    chunks: Vec<Vec<u8>>,
    counts: [u64; 2],
    first: u64,
    last: u64,
}

fn text(out: &mut Vec<u8>, text: &str) {
    bytes(out, text.as_bytes());
}

fn bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(bytes);
}

fn record(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
}

impl Recording {
    fn new() -> Self {
        let mut file = Self {
            bytes: MAGIC.to_vec(),
            chunk: Vec::new(),
            index: [Vec::new(), Vec::new()],
            chunks: Vec::new(),
            counts: [0; 2],
            first: u64::MAX,
            last: 0,
        };
        let mut body = Vec::new();
        text(&mut body, "");
        text(&mut body, concat!("scrnn-data ", env!("CARGO_PKG_VERSION")));
        record(&mut file.bytes, opcode::HEADER, &body);
        file.bytes.extend(topics());
        file
    }

    fn message(&mut self, topic: u16, time: u64, data: &[u8]) {
        let which = usize::from(topic - 1);
        let place = self.chunk.len() as u64;
        let mut body = topic.to_le_bytes().to_vec();
        body.extend((self.counts[which] as u32).to_le_bytes());
        body.extend(time.to_le_bytes());
        body.extend(time.to_le_bytes());
        body.extend(data);
        record(&mut self.chunk, opcode::MESSAGE, &body);
        self.counts[which] += 1;
        self.index[which].push((time, place));
        if self.chunk.len() >= CHUNK {
            self.end_chunk();
        }
    }

    fn end_chunk(&mut self) {
        let records = std::mem::take(&mut self.chunk);
        let index = std::mem::take(&mut self.index);
        let times = || index.iter().flatten().map(|(time, _)| *time);
        let (Some(first), Some(last)) = (times().min(), times().max()) else { return };
        (self.first, self.last) = (self.first.min(first), self.last.max(last));
        let start = self.bytes.len() as u64;
        let mut body = first.to_le_bytes().to_vec();
        body.extend(last.to_le_bytes());
        body.extend((records.len() as u64).to_le_bytes());
        body.extend(crc32fast::hash(&records).to_le_bytes());
        text(&mut body, "");
        body.extend((records.len() as u64).to_le_bytes());
        body.extend(&records);
        record(&mut self.bytes, opcode::CHUNK, &body);
        let length = self.bytes.len() as u64 - start;
        let indexes = self.bytes.len() as u64;
        let mut offsets = Vec::new();
        for (topic, entries) in (JOINTS..).zip(&index).filter(|(_, entries)| !entries.is_empty()) {
            offsets.extend(topic.to_le_bytes());
            offsets.extend((self.bytes.len() as u64).to_le_bytes());
            let mut body = topic.to_le_bytes().to_vec();
            let pairs: Vec<u8> =
                entries.iter().flat_map(|(time, place)| [time.to_le_bytes(), place.to_le_bytes()].concat()).collect();
            bytes(&mut body, &pairs);
            record(&mut self.bytes, opcode::MESSAGE_INDEX, &body);
        }
        let mut about = Vec::new();
        for number in [first, last, start, length] {
            about.extend(number.to_le_bytes());
        }
        bytes(&mut about, &offsets);
        about.extend((self.bytes.len() as u64 - indexes).to_le_bytes());
        text(&mut about, "");
        about.extend((records.len() as u64).to_le_bytes());
        about.extend((records.len() as u64).to_le_bytes());
        self.chunks.push(about);
    }

    fn finish(mut self) -> Vec<u8> {
        self.end_chunk();
        record(&mut self.bytes, opcode::DATA_END, &[0; 4]);
        let summary = self.bytes.len() as u64;
        let mut groups = Vec::new();
        let begin = self.bytes.len() as u64;
        let (schemas, channels) = (schemas(), channels());
        for (opcode, part) in [(opcode::SCHEMA, schemas), (opcode::CHANNEL, channels)] {
            let start = self.bytes.len() as u64;
            self.bytes.extend(part);
            groups.push((opcode, start, self.bytes.len() as u64 - start));
        }
        let start = self.bytes.len() as u64;
        let statistics = self.statistics();
        record(&mut self.bytes, opcode::STATISTICS, &statistics);
        groups.push((opcode::STATISTICS, start, self.bytes.len() as u64 - start));
        let start = self.bytes.len() as u64;
        for chunk in &self.chunks {
            record(&mut self.bytes, opcode::CHUNK_INDEX, chunk);
        }
        groups.push((opcode::CHUNK_INDEX, start, self.bytes.len() as u64 - start));
        let offsets = self.bytes.len() as u64;
        for (opcode, start, length) in groups {
            let mut body = vec![opcode];
            body.extend(start.to_le_bytes());
            body.extend(length.to_le_bytes());
            record(&mut self.bytes, opcode::SUMMARY_OFFSET, &body);
        }
        debug_assert_eq!(begin, summary);
        let mut body = summary.to_le_bytes().to_vec();
        body.extend(offsets.to_le_bytes());
        // No checksum of the summary.
        body.extend([0; 4]);
        record(&mut self.bytes, opcode::FOOTER, &body);
        self.bytes.extend(MAGIC);
        self.bytes
    }

    fn statistics(&self) -> Vec<u8> {
        let mut body = self.counts.iter().sum::<u64>().to_le_bytes().to_vec();
        body.extend(2_u16.to_le_bytes());
        body.extend(2_u32.to_le_bytes());
        // Attachments and metadata.
        body.extend([0; 8]);
        body.extend((self.chunks.len() as u32).to_le_bytes());
        body.extend(self.first.min(self.last).to_le_bytes());
        body.extend(self.last.to_le_bytes());
        let counts: Vec<u8> = (JOINTS..)
            .zip(self.counts)
            .flat_map(|(topic, count)| [topic.to_le_bytes().as_slice(), count.to_le_bytes().as_slice()].concat())
            .collect();
        bytes(&mut body, &counts);
        body
    }
}

/// Schemas and channels.
fn topics() -> Vec<u8> {
    [schemas(), channels()].concat()
}

fn schemas() -> Vec<u8> {
    let number = || json!({ "type": "number" });
    let object = |title: &str, properties: serde_json::Value, required: &[&str]| json!({ "title": title, "type": "object", "properties": properties, "required": required });
    let whole = json!({ "type": "integer", "minimum": 0 });
    let below = json!({ "type": "integer", "minimum": 0, "maximum": 999_999_999 });
    let time = json!({ "type": "object", "title": "time", "properties": { "sec": whole, "nsec": below } });
    let joint = object(
        "foxglove.JointState",
        json!({ "name": { "type": "string" }, "position": number(), "velocity": number(), "acceleration": number(), "effort": number() }),
        &["name"],
    );
    let joints = object(
        "foxglove.JointStates",
        json!({ "timestamp": time, "joints": { "type": "array", "items": joint } }),
        &["timestamp", "joints"],
    );
    let sequence =
        object("scrnn.Sequence", json!({ "timestamp": time, "name": { "type": "string" } }), &["timestamp", "name"]);
    let mut out = Vec::new();
    for (id, name, schema) in [(JOINTS, "foxglove.JointStates", joints), (SEQUENCES, "scrnn.Sequence", sequence)] {
        let mut body = id.to_le_bytes().to_vec();
        text(&mut body, name);
        text(&mut body, "jsonschema");
        text(&mut body, &schema.to_string());
        record(&mut out, opcode::SCHEMA, &body);
    }
    out
}

fn channels() -> Vec<u8> {
    let mut out = Vec::new();
    for (id, topic) in [(JOINTS, "/joint_states"), (SEQUENCES, "/sequence")] {
        let mut body = id.to_le_bytes().to_vec();
        body.extend(id.to_le_bytes());
        text(&mut body, topic);
        text(&mut body, "json");
        // No notes.
        bytes(&mut body, &[]);
        record(&mut out, opcode::CHANNEL, &body);
    }
    out
}
