//! Reading a ROS 2 bag: JointState of 12 joints at 500 Hz, CDR in MCAP.
//!
//! ```text
//! cargo bench -p scrnn-data --bench recording [-- [--seconds 3600] [--rounds 5]]
//! ```
//!
//! Tells megabytes of the file for each second that the thread had a core (where Linux tells; else by the clock), for
//! messages whose joints keep their order, come in ten orders, and come in another order each time; and what is held in
//! memory at the most, as a multiple of the samples.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::time::Instant;

use mcap::records::MessageHeader;
use scrnn_data::{Reading, Selection, inspect};

const JOINTS: usize = 12;
const RATE: u64 = 500;
const DEFINITION: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n================================================================================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n================================================================================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// In how many orders the joints come.
#[derive(Clone, Copy)]
struct Orders(usize);

fn main() {
    let (mut seconds, mut rounds) = (60, 5);
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    for pair in arguments.windows(2) {
        match (pair[0].as_str(), pair[1].parse()) {
            ("--seconds", Ok(value)) => seconds = value,
            ("--rounds", Ok(value)) => rounds = value,
            _ => {}
        }
    }
    let folder = tempfile::tempdir().expect("a folder for bags");
    let cases = [
        ("one order", Orders(1), false),
        ("ten orders", Orders(10), false),
        ("another order each time", Orders(usize::MAX), false),
        ("one order, packed with zstd", Orders(1), true),
    ];
    for (name, orders, packed) in cases {
        let path = folder.path().join("bag.mcap");
        if packed {
            write_packed(&path, seconds, orders);
        } else {
            write(&path, seconds, orders);
        }
        report(name, &path, rounds);
    }
}

fn report(name: &str, path: &Path, rounds: u64) {
    let size = std::fs::metadata(path).expect("the bag").len() as f64;
    let mut times: Vec<f64> = (0..rounds).map(|_| timed(path).0).collect();
    times.sort_by(f64::total_cmp);
    let middle = times[times.len() / 2];
    let mut reading = None;
    let held = allocation_counter::measure(|| reading = Some(timed(path).1)).bytes_max;
    let reading = reading.expect("it was read");
    let samples = reading.data.sequences()[0].len();
    let decoded = (8 * JOINTS * samples) as f64;
    println!(
        "{name}: {:.0} MB, {samples} samples: {middle:.2} s, {:.0} MB/s, {:.2} times the samples held",
        size / 1e6,
        size / 1e6 / middle,
        held as f64 / decoded
    );
}

fn timed(path: &Path) -> (f64, Reading) {
    let (start, before) = (Instant::now(), on_a_core());
    let reading = inspect(path, &Selection::default()).expect("a bag that can be read");
    let clock = start.elapsed().as_secs_f64();
    (on_a_core().zip(before).map_or(clock, |(after, before)| after - before), reading)
}

/// Seconds that this thread has had a core.
fn on_a_core() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e9)
}

/// A message of a number.
fn message(number: u64, orders: Orders) -> Vec<u8> {
    let time = number * 1_000_000_000 / RATE;
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(((time / 1_000_000_000) as u32).to_le_bytes());
    bytes.extend(((time % 1_000_000_000) as u32).to_le_bytes());
    text(&mut bytes, "");
    let mut order: Vec<usize> = (0..JOINTS).collect();
    let mut dice = (number % orders.0 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    if orders.0 > 1 {
        for last in (1..JOINTS).rev() {
            dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            order.swap(last, (dice >> 33) as usize % (last + 1));
        }
    }
    count(&mut bytes, JOINTS);
    order.iter().for_each(|joint| text(&mut bytes, &format!("left_arm_joint_{joint}")));
    for quantity in 0..3 {
        count(&mut bytes, JOINTS);
        pad(&mut bytes, 8);
        for joint in &order {
            let value = (number as f64 * 0.01 + *joint as f64 + f64::from(quantity)).sin();
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

fn pad(bytes: &mut Vec<u8>, size: usize) {
    while !(bytes.len() - 4).is_multiple_of(size) {
        bytes.push(0);
    }
}

fn count(bytes: &mut Vec<u8>, count: usize) {
    pad(bytes, 4);
    bytes.extend((count as u32).to_le_bytes());
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    count(bytes, text.len() + 1);
    bytes.extend(text.as_bytes());
    bytes.push(0);
}

fn write(path: &Path, seconds: u64, orders: Orders) {
    let file = BufWriter::new(File::create(path).expect("room for the bag"));
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = mcap::Writer::with_options(file, options).expect("a writer");
    let schema = writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", DEFINITION.as_bytes()).expect("a schema");
    let channel = writer.add_channel(schema, "/joint_states", "cdr", &BTreeMap::new()).expect("a channel");
    for number in 0..seconds * RATE {
        let time = number * 1_000_000_000 / RATE;
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &message(number, orders)).expect("room for a message");
    }
    writer.finish().expect("room for the end");
}

/// As [`write`], with chunks that are packed.
fn write_packed(path: &Path, seconds: u64, orders: Orders) {
    write(path, seconds.min(60), orders);
    let plain = std::fs::read(path).expect("the bag");
    let mut packed = plain[..8].to_vec();
    let mut rest = &plain[8..plain.len() - 8];
    while let [opcode, after @ ..] = rest {
        let length = u64::from_le_bytes(after[..8].try_into().expect("eight bytes")) as usize;
        let mut body = after[8..8 + length].to_vec();
        if *opcode == 6 {
            let content = ruzstd::encoding::compress_to_vec(&body[40..], ruzstd::encoding::CompressionLevel::Fastest);
            body.truncate(28);
            body.extend(4_u32.to_le_bytes());
            body.extend(b"zstd");
            body.extend((content.len() as u64).to_le_bytes());
            body.extend(content);
        }
        packed.push(*opcode);
        packed.extend((body.len() as u64).to_le_bytes());
        packed.extend(body);
        rest = &after[8 + length..];
    }
    packed.extend(&plain[..8]);
    std::fs::write(path, packed).expect("room for the bag");
}
