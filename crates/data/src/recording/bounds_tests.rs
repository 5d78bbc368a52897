//! Recordings made by an attacker, and damaged ones: they end, soon, and hold little.

use std::path::Path;

use super::ros::Dice;
use crate::memory_tests::{SECONDS, quickest};
use crate::{Selection, inspect_bytes};

/// What may be held for a file of 64 KB: the budget of readers, a chunk and its decoder.
const HELD: u64 = 256 << 20;
fn text(text: &[u8]) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text].concat()
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// What a recording consists of before it is packed: a schema, a channel, messages a millisecond apart.
fn records(schema: [&str; 2], description: &[u8], encoding: &str, messages: impl Iterator<Item = Vec<u8>>) -> Vec<u8> {
    let id = [1, 0];
    let [name, language] = schema.map(|part| text(part.as_bytes()));
    let mut all = record(3, &[&id[..], &name, &language, &text(description)].concat());
    all.extend(record(4, &[&id[..], &id, &text(b"/t"), &text(encoding.as_bytes()), &text(b"")].concat()));
    for (number, message) in messages.enumerate() {
        let time = (number as u64 * 1_000_000).to_le_bytes();
        all.extend(record(5, &[&id[..], &[0; 4], &time, &time, &message].concat()));
    }
    all
}

fn plain(records: &[u8]) -> Vec<u8> {
    [&b"\x89MCAP0\r\n"[..], records, &record(2, &[0; 20]), b"\x89MCAP0\r\n"].concat()
}

/// All in one chunk of zstd.
fn packed(records: &[u8]) -> Vec<u8> {
    let content = ruzstd::encoding::compress_to_vec(records, ruzstd::encoding::CompressionLevel::Fastest);
    let size = (records.len() as u64).to_le_bytes();
    let body = [&[0; 16][..], &size, &[0; 4], &text(b"zstd"), &(content.len() as u64).to_le_bytes(), &content].concat();
    plain(&record(6, &body))
}

fn json(messages: impl Iterator<Item = String>) -> Vec<u8> {
    records(["S", "jsonschema"], b"{}", "json", messages.map(String::into_bytes))
}

/// A field of a protobuf message, or a message in it.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let mut length = content.len();
    let mut bytes = vec![number << 3 | 2];
    while length >= 128 {
        bytes.push(length as u8 | 128);
        length >>= 7;
    }
    bytes.push(length as u8);
    bytes.extend(content);
    bytes
}

/// Recordings whose definitions have long names that many others contain, and long lines: small once they are packed.
fn long_names() -> Vec<(&'static str, Vec<u8>)> {
    let long = "a".repeat(300_000);
    let file = |definition: &[u8], language: &str, name: &str| {
        let encoding = if language == "protobuf" { "protobuf" } else { "cdr" };
        packed(&records([name, language], definition, encoding, std::iter::repeat_n(vec![0, 1, 0, 0, 0, 0, 0, 0], 3)))
    };
    let messages: Vec<u8> = (0..3000_u32).flat_map(|k| field(4, &field(1, format!("m{k}").as_bytes()))).collect();
    let package = field(1, &[field(2, long.as_bytes()), messages].concat());
    let fields = "T x\n".repeat(20_000);
    let nested = (0..31).map(|k| format!("T{k}[65535] x\n===\nMSG: p/T{k}\n"));
    let nested = nested.collect::<String>() + "uint8[] z\n";
    let typedefs: String = (0..3000).map(|k| format!("typedef float t{k}; ")).collect();
    vec![
        ("a package of 300 kB", file(&package, "protobuf", "m1")),
        ("a package of 300 kB in .msg", file(fields.as_bytes(), "ros2msg", &format!("{long}/T"))),
        ("a type of 300 kB in .msg", file(format!("===\nMSG: {long}/T\n{fields}").as_bytes(), "ros2msg", "p/T")),
        ("a module of 300 kB", file(format!("module {long} {{ {typedefs} }};").as_bytes(), "ros2idl", "p/T")),
        ("an endless line of words", file("a ".repeat(1_000_000).as_bytes(), "ros2idl", "p/T")),
        ("an endless line of enumerations", file("enum a {}; ".repeat(190_000).as_bytes(), "ros2idl", "p/T")),
        ("lists in lists of 65535", {
            let body = [vec![0, 1, 0, 0], vec![0; 2_000_000]].concat();
            packed(&records(["p/T", "ros2msg"], nested.as_bytes(), "cdr", std::iter::repeat_n(body, 2)))
        }),
    ]
}

#[test]
fn a_file_of_64_kilobytes_ends_soon_and_holds_little() {
    let names = |k: usize, count: usize| {
        (0..count).map(|n| format!("\"{}\":1", (n * 7919 + k * 31) % 65_000)).collect::<Vec<_>>()
    };
    let wide = format!("{{\"a\":[{}0]}}", "0,".repeat(60_000));
    let truths = format!("{{\"a\":[{}0]}}", "true,".repeat(200_000));
    let deep = format!("{}[{}0]{}", "{\"aaaaaaaaaaaaaaaa\":".repeat(100), "0,".repeat(2000), "}".repeat(100));
    let definition = b"float64[] x\nOther[] y\n===\nMSG: p/Other\nuint8[] z\n";
    let mut cdr = vec![0, 1, 0, 0, 0, 0, 0, 0];
    cdr.extend(60_000_u32.to_le_bytes());
    cdr.extend(vec![0; 240_000]);
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("wide", packed(&json(std::iter::repeat_n(wide, 480)))),
        ("truths", packed(&json(std::iter::repeat_n(truths, 45)))),
        ("deep and wide", packed(&json(std::iter::repeat_n(deep, 2000)))),
        ("tiny messages", packed(&json((0..7000).map(|_| "{\"a\":1}".to_owned())))),
        ("names in other orders", packed(&json((0..8).map(|k| format!("{{{}}}", names(k, 600).join(",")))))),
        ("new names in each message", plain(&json((0..1000).map(|k| format!("{{\"n{k}\":1}}"))))),
        ("thousands of names", plain(&json((0..4).map(|k| format!("{{{}}}", names(k, 2000).join(",")))))),
        ("lists of nothing", packed(&records(["p/T", "ros2msg"], definition, "cdr", std::iter::repeat_n(cdr, 60)))),
        ("lists in lists", plain(&json((0..2).map(|_| format!("{{\"a\":{}{}}}", "[".repeat(120), "]".repeat(120)))))),
    ];
    for (name, bytes) in cases.into_iter().chain(long_names()) {
        assert!(bytes.len() < 2 << 16, "{name}: {} bytes", bytes.len());
        for period in [None, Some(1e-5)] {
            let selection = Selection { period, ..Selection::default() };
            let (mut said, mut most) = (String::new(), 0);
            let seconds = quickest(|| {
                let held = allocation_counter::measure(|| {
                    let outcome = inspect_bytes(Path::new("x.mcap"), &bytes, &selection);
                    said = outcome.map_or_else(
                        |error| error.to_string(),
                        |reading| format!("{} samples", reading.data.total_samples()),
                    );
                });
                most = held.bytes_max;
            });
            println!("{name}, {} bytes: {:.2} s, {} MB held: {said}", bytes.len(), seconds, most >> 20);
            assert!(most < HELD, "{name}: {most} bytes held: {said}");
            assert!(seconds < SECONDS, "{name}: {seconds} s: {said}");
        }
    }
}

#[test]
fn times_at_the_ends_of_their_range_are_refused_or_give_samples() {
    const TOP: u64 = i64::MAX as u64;
    let mut refused = 0;
    for times in [[0, u64::MAX], [u64::MAX, 0], [u64::MAX - 1, u64::MAX], [TOP, TOP + 1], [0, TOP], [0, 1], [7, 7]] {
        for period in [None, Some(1e-9), Some(0.05), Some(1e9)] {
            let id = [1, 0];
            let mut all = record(3, &[&id[..], &text(b"S"), &text(b"jsonschema"), &text(b"{}")].concat());
            all.extend(record(4, &[&id[..], &id, &text(b"/t"), &text(b"json"), &text(b"")].concat()));
            for time in times.map(u64::to_le_bytes) {
                all.extend(record(5, &[&id[..], &[0; 4], &time, &time, b"{\"a\":1.5}"].concat()));
            }
            let selection = Selection { period, ..Selection::default() };
            let Ok(reading) = inspect_bytes(Path::new("x.mcap"), &plain(&all), &selection) else {
                refused += 1;
                continue;
            };
            let values = reading.data.sequences().iter().flat_map(|sequence| sequence.values());
            assert!(
                reading.data.total_samples() > 0 && values.clone().all(|&value| value == 1.5),
                "{times:?} {period:?}"
            );
            assert!(reading.period.is_none_or(|period| period > 0.0 && period.is_finite()), "{times:?} {period:?}");
        }
    }
    // Two samples that 584 years lie between are no sequence of nanoseconds.
    assert!(refused >= 4, "{refused}");
}

/// Each damaged in thousands of ways. Whatever comes of it, it comes back.
#[test]
fn damaged_recordings_of_all_kinds_end() {
    let msg = b"std_msgs/Header header\nstring[] name\nfloat64[] position\n===\nMSG: std_msgs/Header\nTime stamp\nstring frame_id\n===\nMSG: std_msgs/Time\nint32 sec\nuint32 nanosec\n";
    let idl = b"module p { module msg { struct T { double x; sequence<long, 3> y; string<4> z[2]; }; }; };";
    let mut joint =
        vec![0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0];
    joint.extend([1, 0, 0, 0, 0, 0, 0, 0]);
    joint.extend(1.5_f64.to_le_bytes());
    let thing = [&[0, 1, 0, 0][..], &[0; 8], &[1, 0, 0, 0, 5, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0]].concat();
    let descriptors = b"\x0a\x1f\x12\x01a\x22\x12\x0a\x05Thing\x12\x09\x0a\x01x\x18\x01\x20\x01\x28\x01\x62\x06proto3";
    let proto = [&[9][..], &2.5_f64.to_le_bytes()].concat();
    let five = |message: &[u8]| std::iter::repeat_n(message.to_vec(), 5);
    let bases: Vec<(&str, Vec<u8>)> = vec![
        ("x.mcap", plain(&records(["sensor_msgs/msg/JointState", "ros2msg"], msg, "cdr", five(&joint)))),
        ("x.mcap", plain(&records(["p/msg/T", "ros2idl"], idl, "cdr", five(&thing)))),
        ("x.mcap", plain(&records(["a.Thing", "protobuf"], descriptors, "protobuf", five(&proto)))),
        ("x.mcap", plain(&json((0..5).map(|k| format!("{{\"timestamp\":{k},\"x\":[{k}.5,1],\"b\":true}}"))))),
        ("x.db3", include_bytes!("../../tests/cases/14-cdr-jointstate/bag3/bag3.db3").to_vec()),
    ];
    let mut dice = Dice(17);
    for (kind, (name, base)) in bases.iter().enumerate() {
        let read = |bytes: &[u8]| {
            inspect_bytes(Path::new(name), bytes, &Selection::default()).map(|reading| reading.data.total_samples())
        };
        let whole = read(base);
        assert!(whole.is_ok(), "{kind}: {whole:?}");
        let mut well = 0;
        for _ in 0..3000 {
            let mut damaged = base.clone();
            for _ in 0..=dice.roll(3) {
                let at = dice.roll(damaged.len());
                damaged[at] = match dice.roll(4) {
                    0 => 0xff,
                    1 => 0,
                    2 => damaged[at] ^ 1 << dice.roll(8),
                    _ => dice.roll(256) as u8,
                };
            }
            if dice.roll(8) == 0 {
                damaged.truncate(dice.roll(base.len()));
            }
            well += usize::from(read(&damaged).is_ok());
        }
        assert!(well > 0 && well < 3000, "{kind}: {well}");
    }
    for _ in 0..3000 {
        let mut metadata =
            b"rosbag2_bagfile_information:\n  relative_file_paths:\n    - 'a b.mcap'\n  compression_mode: message\n"
                .to_vec();
        let at = dice.roll(metadata.len());
        metadata[at] = dice.roll(128) as u8;
        let _ = super::files::parse(&String::from_utf8_lossy(&metadata));
    }
}
