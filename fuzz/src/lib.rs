//! What is fuzzed: every reader of the program, with its own sources, on any bytes.
//!
//! The readers live in a binary, which no crate can depend on. Their modules are taken in by path: they are the same
//! files, and the program stays as it is.
//!
//! Each function takes the bytes of a file. It must come back, whatever they are, must not panic, and must not hold much
//! more memory than the file has bytes: [`bounded`] counts.

use std::path::Path;

#[allow(dead_code, reason = "a fuzzer does not write files")]
#[path = "../../crates/cli/src/files/mod.rs"]
mod files;

#[allow(dead_code, reason = "a fuzzer does not end commands")]
#[path = "../../crates/cli/src/failure.rs"]
mod failure;

#[allow(dead_code, reason = "a fuzzer does not train")]
#[path = "../../crates/cli/src/experiment/mod.rs"]
mod experiment;

#[allow(dead_code, reason = "a fuzzer does not simulate")]
#[path = "../../crates/sim/src/error.rs"]
mod error;

#[allow(dead_code, reason = "a fuzzer does not simulate")]
#[path = "../../crates/sim/src/scene.rs"]
mod scene;

#[allow(dead_code, reason = "a fuzzer does not simulate")]
#[path = "../../crates/sim/src/robot.rs"]
mod robot;

use files::{Selection, parse_as};

/// What a reader may hold whatever the file, e.g. a decoder's window.
const FREE: u64 = 1 << 20;

/// Runs a reader, which may hold at most `factor` bytes at a time for each byte of the file, and a little more.
fn bounded(bytes: &[u8], factor: u64, read: impl FnOnce()) {
    let used = allocation_counter::measure(read);
    let allowed = FREE + factor * bytes.len() as u64;
    assert!(used.bytes_max <= allowed, "{} bytes held for a file of {}", used.bytes_max, bytes.len());
}

/// Makes a message, and renders one of sixteen as the program would: that takes longer than all reading.
fn show(bytes: &[u8], error: impl Into<miette::Report>) {
    let report = error.into();
    assert!(!report.to_string().is_empty());
    if crc32fast::hash(bytes).is_multiple_of(16) {
        assert!(!format!("{report:?}").is_empty());
    }
}

fn data(name: &str, bytes: &[u8], selection: &Selection) {
    match parse_as(Path::new(name), bytes, selection) {
        Ok(data) => {
            assert!(data.total_samples() > 0 && !data.channels().is_empty());
            assert!(data.sequences().iter().all(|s| s.values().iter().all(|value| value.is_finite())));
        }
        Err(error) => show(bytes, error),
    }
}

/// Text in three guises.
pub fn table(bytes: &[u8]) {
    for name in ["x.csv", "x.tsv", "x.txt"] {
        bounded(bytes, 100, || data(name, bytes, &Selection::default()));
    }
}

/// One numpy array.
pub fn npy(bytes: &[u8]) {
    bounded(bytes, 50, || data("x.npy", bytes, &Selection::default()));
}

/// Numpy arrays in an archive. What is packed may unpack to 1000 times its size.
pub fn npz(bytes: &[u8]) {
    bounded(bytes, 20_000, || data("x.npz", bytes, &Selection::default()));
}

/// A recording, as it is and resampled. What is packed may unpack to 1000 times its size.
pub fn mcap(bytes: &[u8]) {
    bounded(bytes, 20_000, || data("x.mcap", bytes, &Selection::default()));
    let resampled = Selection { topic: Some("/joint_states".into()), period: Some(0.05), channels: None };
    bounded(bytes, 20_000, || data("x.mcap", bytes, &resampled));
}

/// An experiment file, with a change on the command line.
pub fn experiment(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    bounded(bytes, 2000, || match experiment::read_text("x.toml", text, &[]) {
        Ok(read) => {
            let resolved = read.resolved(Path::new("/")).expect("a folder that is absolute");
            let again = toml::to_string(&resolved).expect("what was read can be written");
            assert!(experiment::read_text("again.toml", &again, &[]).is_ok(), "{again}");
            let _ = resolved.plan();
            let _ = resolved.topology(2);
        }
        Err(error) => show(bytes, error),
    });
    if let Ok(change) = "network.groups.context.units=3".parse::<experiment::Override>()
        && let Err(error) = experiment::read_text("x.toml", text, &[change])
    {
        show(bytes, error);
    }
}

/// A checkpoint.
pub fn checkpoint(bytes: &[u8]) {
    bounded(bytes, 200, || match scrnn::checkpoint::Checkpoint::from_bytes(bytes) {
        Ok(checkpoint) => assert!(checkpoint.check().is_ok()),
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}

/// A robot's description.
pub fn urdf(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    bounded(bytes, 2000, || match robot::Robot::from_urdf(text) {
        Ok(robot) => assert!(robot.joint_names().len() >= robot.dof()),
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}
