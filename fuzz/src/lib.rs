//! What is fuzzed: every reader, on any bytes.
//!
//! Each function takes the bytes of a file. It must come back, whatever they are, must not panic, and must not hold much
//! more memory than the file has bytes: [`bounded`] counts.

mod readers;

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

/// Text in three guises. Of a column with a name of one letter much is known.
pub fn table(bytes: &[u8]) {
    for name in ["x.csv", "x.tsv", "x.txt"] {
        bounded(bytes, 1000, || readers::data(name, bytes, false));
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

/// A database of a bag.
pub fn sqlite(bytes: &[u8]) {
    bounded_beyond(FREE_UNPACKING, bytes, 20_000, || readers::data("x.db3", bytes, false));
}

/// ROS 2 messages: `.msg` or `.idl` text up to a byte of 0, then messages of 64 bytes.
pub fn cdr(bytes: &[u8]) {
    let (definition, messages) = halves(bytes);
    for language in ["ros2msg", "ros2idl"] {
        let recording = recording("pkg/msg/Thing", language, definition, "cdr", messages);
        bounded_beyond(FREE_UNPACKING, bytes, 20_000, || readers::data("x.mcap", &recording, false));
    }
}

/// protobuf messages: a descriptor set up to a byte of 0xff (which begins no field), then messages of 64 bytes.
pub fn protobuf(bytes: &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0xff).unwrap_or(bytes.len());
    let (descriptors, messages) = bytes.split_at(end);
    let recording = recording("a.Thing", "protobuf", descriptors, "protobuf", messages);
    bounded_beyond(FREE_UNPACKING, bytes, 20_000, || readers::data("x.mcap", &recording, false));
}

/// A bag's folder: `metadata.yaml` up to a byte of 0, then the file `a.mcap`.
pub fn bag(bytes: &[u8]) {
    let (metadata, file) = halves(bytes);
    let folder = std::env::temp_dir().join(format!("scrnn-fuzz-bag-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for bags");
    let metadata = [b"rosbag2_bagfile_information:\n", metadata].concat();
    std::fs::write(folder.join("metadata.yaml"), metadata).expect("room for a bag");
    std::fs::write(folder.join("a.mcap"), file).expect("room for a bag");
    bounded_beyond(FREE_UNPACKING, bytes, 20_000, || readers::folder(&folder));
}

/// What stands before and behind the first byte of 0.
fn halves(bytes: &[u8]) -> (&[u8], &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    (&bytes[..end], bytes.get(end + 1..).unwrap_or_default())
}

/// An MCAP recording with one channel and a message of each 64 bytes.
fn recording(schema: &str, language: &str, description: &[u8], encoding: &str, messages: &[u8]) -> Vec<u8> {
    let text = |text: &[u8]| [&(text.len() as u32).to_le_bytes(), text].concat();
    let record = |opcode: u8, body: Vec<u8>| [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat();
    let mut file = b"\x89MCAP0\r\n".to_vec();
    let id = [1, 0];
    let body = [&id[..], &text(schema.as_bytes()), &text(language.as_bytes()), &text(description)].concat();
    file.extend(record(3, body));
    let body = [&id[..], &id, &text(b"/t"), &text(encoding.as_bytes()), &text(b"")].concat();
    file.extend(record(4, body));
    for (number, message) in messages.chunks(64).enumerate() {
        let time = (number as u64 * 1_000_000).to_le_bytes();
        file.extend(record(5, [&id[..], &[0; 4], &time, &time, message].concat()));
    }
    file.extend(record(2, vec![0; 20]));
    file.extend(b"\x89MCAP0\r\n");
    file
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

/// Samples that come line by line.
pub fn stream(bytes: &[u8]) {
    for channels in [&["a", "b"][..], &["y1"]] {
        bounded(bytes, 400, || readers::stream(bytes, channels));
    }
}

/// The history of a run that goes on.
pub fn history(bytes: &[u8]) {
    for epoch in [0, 100, u64::MAX] {
        bounded(bytes, 50, || readers::history(bytes, epoch));
    }
}

/// The notes of a checkpoint whose run is to go on.
pub fn notes(bytes: &[u8]) {
    bounded(bytes, 1000, || readers::notes(bytes));
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
