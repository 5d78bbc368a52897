//! Recordings as data: written by the mcap crate, packed in every way, and damaged.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::Path;

use ::mcap::records::MessageHeader;
use ::mcap::{WriteOptions, Writer};

use super::*;
use crate::error::FileError;

/// Messages as topic, nanoseconds and text.
fn recording(options: WriteOptions, messages: &[(&str, u64, String)]) -> Vec<u8> {
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).unwrap();
    let mut channels = BTreeMap::new();
    for (topic, time, text) in messages {
        let id = *channels.entry(*topic).or_insert_with(|| {
            let schema = writer.add_schema(&format!("schema of {topic}"), "jsonschema", b"{}").unwrap();
            let encoding = if topic.starts_with("/binary") { "protobuf" } else { "json" };
            writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap()
        });
        let header = MessageHeader { channel_id: id, sequence: 0, log_time: *time, publish_time: 0 };
        writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn plain() -> WriteOptions {
    WriteOptions::new().compression(None)
}

fn joints(a: f64, b: f64) -> String {
    format!(r#"{{"joints":[{{"name":"elbow","position":{a}}},{{"name":"wrist","position":{b}}}]}}"#)
}

fn ten() -> Vec<(&'static str, u64, String)> {
    (0..10).map(|k| ("/joint_states", 100 * k, joints(k as f64, -(k as f64) / 2.0))).collect()
}

/// A small recording.
pub fn some_joints() -> Vec<u8> {
    recording(plain(), &ten())
}

fn read_bytes(path: &str, bytes: &[u8], selection: &Selection) -> Result<scrnn::dataset::Dataset, FileError> {
    crate::parse_as(std::path::Path::new(path), bytes, selection)
}

fn select(topic: Option<&str>, period: Option<f64>, channels: Option<&[&str]>) -> Selection {
    let channels = channels.map(|names| names.iter().map(|&name| name.to_owned()).collect());
    Selection { topics: topic.map(str::to_owned).into_iter().collect(), period, channels, ..Selection::default() }
}

fn values(bytes: &[u8], selection: &Selection) -> Vec<f64> {
    read_bytes("r.mcap", bytes, selection).unwrap().sequences()[0].values().to_vec()
}

fn said(bytes: &[u8], selection: &Selection) -> (String, String) {
    let error = read_bytes("r.mcap", bytes, selection).unwrap_err();
    let help = miette::Diagnostic::help(&error).map(|help| help.to_string()).unwrap_or_default();
    (error.to_string(), help)
}

/// The same records, each chunk packed by `pack` under the name `compression`.
fn repacked(bytes: &[u8], compression: &str, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let magic = &bytes[..8];
    let mut out = magic.to_vec();
    let mut rest = &bytes[8..bytes.len() - 8];
    while let [opcode, after @ ..] = rest {
        let length = u64::from_le_bytes(after[..8].try_into().unwrap()) as usize;
        let body = &after[8..8 + length];
        let body = if *opcode == 0x06 {
            let (head, tail) = body.split_at(28);
            assert_eq!(tail[..4], [0; 4], "a chunk that is not packed");
            let packed = pack(&tail[12..]);
            let name = [&(compression.len() as u32).to_le_bytes(), compression.as_bytes()].concat();
            [head, &name, &(packed.len() as u64).to_le_bytes(), &packed].concat()
        } else {
            body.to_vec()
        };
        out.push(*opcode);
        out.extend((body.len() as u64).to_le_bytes());
        out.extend(body);
        rest = &after[8 + length..];
    }
    out.extend(magic);
    out
}

#[test]
fn joints_become_channels_and_messages_samples() {
    let data = read_bytes("r.mcap", &recording(plain(), &ten()), &Selection::default()).unwrap();
    assert_eq!(data.channels(), ["elbow", "wrist"]);
    assert_eq!(data.sequences().len(), 1);
    assert_eq!((data.sequences()[0].len(), data.sequences()[0].sample(4)), (10, &[4.0, -2.0][..]));
}

#[test]
fn packed_chunks_hold_the_same_samples() {
    let bytes = recording(plain(), &ten());
    let expected = values(&bytes, &Selection::default());
    let zstd = |content: &[u8]| ruzstd::encoding::compress_to_vec(content, ruzstd::encoding::CompressionLevel::Fastest);
    let lz4 = |content: &[u8]| {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        encoder.write_all(content).unwrap();
        encoder.finish().unwrap()
    };
    assert_eq!(values(&repacked(&bytes, "zstd", zstd), &Selection::default()), expected);
    assert_eq!(values(&repacked(&bytes, "lz4", lz4), &Selection::default()), expected);
    assert_eq!(values(&recording(plain().use_chunks(false), &ten()), &Selection::default()), expected);

    let (message, help) = said(&repacked(&bytes, "brotli", zstd), &Selection::default());
    assert_eq!(message, "r.mcap: its chunks are packed as `brotli`; known: zstd, lz4, and unpacked ones");
    assert!(help.contains("mcap compress"), "{help}");
    let (message, _) = said(&repacked(&bytes, "lz4", zstd), &Selection::default());
    assert!(message.starts_with("r.mcap: a chunk cannot be unpacked (lz4): "), "{message}");
}

#[test]
fn the_topic_is_the_one_that_is_asked_for_or_the_only_one() {
    let mut messages = ten();
    messages.push(("/battery", 900, r#"{"volt":24}"#.into()));
    messages.push(("/binary", 900, "x".into()));
    let bytes = recording(plain(), &messages);
    assert_eq!(values(&bytes, &select(Some("/battery"), None, None)), [24.0]);
    let (message, help) = said(&bytes, &Selection::default());
    assert_eq!(message, "r.mcap: it is not clear which topic is meant");
    assert!(help.contains("/battery (1 messages, json, schema of /battery); /binary (1 messages, protobuf"), "{help}");
    let (message, help) = said(&bytes, &select(Some("/joints"), None, None));
    assert_eq!(message, "r.mcap: there is no topic `/joints`");
    assert!(help.contains("/joint_states (10 messages, json"), "{help}");
    let (message, _) = said(&bytes, &select(Some("/binary"), None, None));
    assert_eq!(message, "r.mcap, topic /binary: its messages are protobuf, but described in `jsonschema`");
    // What the network was told is what to learn from.
    messages.push(("/sensed", 900, r#"{"timestamp":{"sec":0,"nsec":900},"z":1,"a":2}"#.into()));
    let data = read_bytes("r.mcap", &recording(plain(), &messages), &Selection::default()).unwrap();
    assert_eq!(
        (data.channels(), data.sequences()[0].values()),
        (&["z".to_owned(), "a".to_owned()][..], &[1.0, 2.0][..])
    );
    assert_eq!(said(&recording(plain(), &[]), &Selection::default()).0, "r.mcap: the recording holds no messages");
}

#[test]
fn channels_are_taken_by_name_in_the_order_that_is_asked_for() {
    let bytes = recording(plain(), &ten()[..2]);
    assert_eq!(values(&bytes, &select(None, None, Some(&["wrist", "elbow"]))), [0.0, 0.0, -0.5, 1.0]);
    assert_eq!(values(&bytes, &select(None, None, Some(&["wrist"]))), [0.0, -0.5]);
    let (message, help) = said(&bytes, &select(None, None, Some(&["knee"])));
    assert_eq!(
        (message.as_str(), help.as_str()),
        ("r.mcap, topic /joint_states: there is no channel `knee`", "there are elbow, wrist")
    );
}

/// What the reader makes of a recording, before it becomes a data set.
fn samples(bytes: &[u8], selection: &Selection) -> crate::samples::Samples {
    read(&Source::of_bytes(Path::new("r.mcap"), bytes), selection).unwrap()
}

#[test]
fn what_a_message_does_not_hold_is_missing_and_what_it_holds_wrongly_is_named() {
    let mut messages = ten();
    messages[7].2 = r#"{"joints":[{"name":"elbow","position":1}]}"#.into();
    let bytes = recording(plain(), &messages);
    let track = samples(&bytes, &Selection::default()).tracks.remove(0);
    assert_eq!(track.values.iter().position(|value| value.is_nan()), Some(15));
    assert_eq!((track.values[14], track.values.len()), (1.0, 20));
    assert_eq!(values(&bytes, &select(None, None, Some(&["elbow"]))).len(), 10);
    messages[7].2 =
        r#"{"joints":[{"name":"elbow","position":1},{"name":"x","position":1},{"name":"wrist","position":1}]}"#.into();
    let read = samples(&recording(plain(), &messages), &Selection::default());
    assert_eq!(read.channels, ["elbow", "wrist", "x"]);
    assert_eq!(read.tracks[0].values.iter().filter(|value| value.is_nan()).count(), 9);
    messages[7].2 = "{}".into();
    let read = samples(&recording(plain(), &messages), &Selection::default());
    assert!(read.remarks.iter().any(|remark| remark.to_string().contains("1 messages hold none of the channels")));
    messages[7].2 = r#"{"joints":[{"name":"elbow","position":1},{"name":"wrist","position":null}]}"#.into();
    assert!(samples(&recording(plain(), &messages), &Selection::default()).tracks[0].values[15].is_nan());
    messages[7].2 = r#"{"joints":[{"name":"elbow","position":1},{"name":"wrist","position":"up"}]}"#.into();
    let (message, _) = said(&recording(plain(), &messages), &Selection::default());
    assert_eq!(message, "r.mcap, topic /joint_states: message 8, of 0.0000007 s, holds no position of joint `wrist`");
    let (message, _) = said(&recording(plain(), &[("/a", 0, "{}".into())]), &Selection::default());
    assert_eq!(message, "r.mcap, topic /a: the messages hold no numbers");
}

#[test]
fn messages_are_ordered_by_time_and_resampled() {
    let mut messages = ten();
    messages.swap(2, 7);
    let bytes = recording(plain(), &messages);
    assert_eq!(values(&bytes, &select(None, None, Some(&["elbow"]))), (0..10).map(f64::from).collect::<Vec<_>>());
    assert_eq!(values(&bytes, &select(None, Some(200e-9), Some(&["elbow"]))), [0., 2., 4., 6., 8.]);
    assert_eq!(values(&bytes, &select(None, Some(150e-9), Some(&["elbow"]))), [0., 1.5, 3., 4.5, 6., 7.5, 9.]);
    messages[5].1 += 60;
    let bytes = recording(plain(), &messages);
    let (message, help) = said(&bytes, &Selection::default());
    assert!(message.contains("sequence 1: samples are 0.0000001 s apart in the middle, but"), "{message}");
    assert!(help.contains("period = 0.0000001"), "{help}");
    assert_eq!(values(&bytes, &select(None, Some(100e-9), None)).len(), 20);
}

#[test]
fn a_recording_may_hold_several_sequences() {
    let mut messages = Vec::new();
    for (k, name) in ["left", "none", "right"].into_iter().enumerate() {
        let start = 10_000 * k as u64;
        messages.push(("/sequence", start, format!(r#"{{"timestamp":{{"sec":0,"nsec":0}},"name":"{name}"}}"#)));
        if name != "none" {
            messages.extend(
                (0..3).map(|step| ("/sensed", start + 100 * step, format!(r#"{{"y":{}}}"#, 10 * k as u64 + step))),
            );
        }
    }
    let data = read_bytes("r.mcap", &recording(plain(), &messages), &Selection::default()).unwrap();
    let found: Vec<_> = data.sequences().iter().map(|sequence| (sequence.name.as_str(), sequence.values())).collect();
    assert_eq!(found, [("left", &[0., 1., 2.][..]), ("right", &[20., 21., 22.][..])]);
    messages[0].2 = "{}".into();
    assert!(said(&recording(plain(), &messages), &Selection::default()).0.contains("names no sequence"));
}

#[test]
fn a_recording_that_is_cut_or_damaged_anywhere_is_refused_or_read_but_never_panics() {
    let bytes = recording(plain(), &ten());
    for length in 0..bytes.len() {
        let error = read_bytes("r.mcap", &bytes[..length], &Selection::default()).unwrap_err();
        assert!(matches!(error, FileError::Recording { .. }), "{error}");
    }
    assert_eq!(said(&bytes[..300], &Selection::default()).0, "r.mcap: the recording is cut off");
    assert_eq!(said(b"y1,y2\n", &Selection::default()).0, "r.mcap: this is not an MCAP file");
    assert_eq!(said(b"\x89MCAP1\r\n", &Selection::default()).0, "r.mcap: version 1 of MCAP; known: 0");
    let expected = values(&bytes, &Selection::default());
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            if let Ok(data) = read_bytes("r.mcap", &damaged, &Selection::default()) {
                // What is not checked by the chunk's checksum: times of indexes, attachments, the library's name.
                assert_eq!(data.sequences()[0].values(), expected, "byte {at}, bit {bit}");
            }
        }
    }
}

#[test]
fn a_header_that_promises_terabytes_is_refused() {
    let bytes = recording(plain(), &ten());
    let chunk = bytes.windows(9).position(|window| window[0] == 0x06 && window[7..9] == [0, 0]).unwrap();
    // Behind opcode, length and two times stands the size.
    let mut huge = bytes.clone();
    huge[chunk + 25..chunk + 33].copy_from_slice(&(1_u64 << 42).to_le_bytes());
    let (message, _) = said(&huge, &Selection::default());
    assert!(
        message.starts_with("r.mcap: it promises to unpack to 4398046511104 bytes; a file of its size"),
        "{message}"
    );
    let mut huge = bytes.clone();
    huge[chunk + 1..chunk + 9].copy_from_slice(&u64::MAX.to_le_bytes());
    assert_eq!(said(&huge, &Selection::default()).0, "r.mcap: the recording is cut off");

    // Found by fuzzing: the sizes of two chunks, one of them as large as numbers go, were added.
    let several = recording(plain().chunk_size(Some(200)), &ten());
    let mut chunks = Vec::new();
    let mut at = 8;
    while at + 9 < several.len() {
        chunks.extend((several[at] == 0x06).then_some(at));
        at += 9 + u64::from_le_bytes(several[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    assert!(chunks.len() > 1);
    let mut huge = several;
    let last = chunks[chunks.len() - 1];
    huge[last + 25..last + 33].copy_from_slice(&u64::MAX.to_le_bytes());
    let (message, _) = said(&huge, &Selection::default());
    assert!(message.starts_with("r.mcap: it promises to unpack to 18446744073709551615 bytes"), "{message}");

    // A frame of some bytes that asks for a window of 64 MiB.
    let window = repacked(&bytes, "zstd", |_| vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x80, 0x01, 0x00, 0x00]);
    let (message, _) = said(&window, &Selection::default());
    assert!(message.starts_with("r.mcap: a chunk cannot be unpacked (zstd): "), "{message}");

    // A chunk that unpacks to more than it says stops there.
    let bomb = repacked(&bytes, "zstd", |content| {
        ruzstd::encoding::compress_to_vec(
            &*[content, &vec![0; 50_000_000]].concat(),
            ruzstd::encoding::CompressionLevel::Fastest,
        )
    });
    assert_eq!(
        said(&bomb, &Selection::default()).0,
        "r.mcap: the recording is damaged: a chunk does not unpack to the size that it says"
    );
}
