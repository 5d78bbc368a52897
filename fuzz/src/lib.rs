//! What is fuzzed: every reader, on any bytes.
//!
//! Each function takes the bytes of a file. It must come back, whatever they are, must not panic, and must not hold much
//! more memory than the file has bytes: [`bounded`] counts.

use scrnn_program::readers;

/// What a reader may hold whatever the file.
const FREE: u64 = 1 << 20;

/// What it may hold if it unpacks zstd (a window of 8 MiB) or lz4 (blocks of up to 8 MiB, in and out).
const FREE_UNPACKING: u64 = 32 << 20;

/// Runs a reader, which may hold at most `factor` bytes at a time for each byte of the file, and a little more.
fn bounded(bytes: &[u8], factor: u64, read: impl FnOnce()) {
    bounded_beyond(FREE, bytes, factor, read);
}

/// As [`bounded`], with `free` bytes on top.
fn bounded_beyond(free: u64, bytes: &[u8], factor: u64, read: impl FnOnce()) {
    let used = allocation_counter::measure(read);
    let allowed = free + factor * bytes.len() as u64;
    assert!(used.bytes_max <= allowed, "{} bytes held for a file of {}", used.bytes_max, bytes.len());
}

/// Text in three guises.
pub fn table(bytes: &[u8]) {
    for name in ["x.csv", "x.tsv", "x.txt"] {
        bounded(bytes, 100, || readers::data(name, bytes, false));
    }
}

/// One numpy array.
pub fn npy(bytes: &[u8]) {
    bounded(bytes, 50, || readers::data("x.npy", bytes, false));
}

/// Numpy arrays in an archive. What is packed may unpack to 1000 times its size.
pub fn npz(bytes: &[u8]) {
    bounded(bytes, 20_000, || readers::data("x.npz", bytes, false));
}

/// A recording, as it is and resampled. What is packed may unpack to 1000 times its size.
pub fn mcap(bytes: &[u8]) {
    for resampled in [false, true] {
        bounded_beyond(FREE_UNPACKING, bytes, 20_000, || readers::data("x.mcap", bytes, resampled));
    }
}

/// An experiment file, as it is and with a change on the command line.
pub fn experiment(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    bounded(bytes, 2000, || readers::experiment(text));
    bounded(bytes, 2000, || readers::changed_experiment(text, "network.groups.context.units=3"));
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
    bounded(bytes, 2000, || match scrnn_sim::robot::Robot::from_urdf(text) {
        Ok(robot) => assert!(robot.joint_names().len() >= robot.dof()),
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}

/// A reader that draws all it holds on a budget: 16 MiB and 2100 bytes for each byte of the file. What is counted twice for
/// a moment, as a vector grows, is allowed for.
fn budgeted(name: &str, bytes: &[u8]) {
    bounded_beyond(FREE_UNPACKING + (16 << 20), bytes, 4400, || readers::data(name, bytes, false));
}

/// A table in columns.
pub fn parquet(bytes: &[u8]) {
    budgeted("x.parquet", bytes);
}

/// Data sets in groups.
pub fn hdf5(bytes: &[u8]) {
    budgeted("x.hdf5", bytes);
}

/// MATLAB's matrices.
pub fn mat(bytes: &[u8]) {
    budgeted("x.mat", bytes);
}

/// Motion capture.
pub fn bvh(bytes: &[u8]) {
    budgeted("x.bvh", bytes);
}

/// Labelled series.
pub fn series(bytes: &[u8]) {
    budgeted("x.ts", bytes);
}
