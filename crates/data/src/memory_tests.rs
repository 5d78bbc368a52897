//! What a reader holds is a small multiple of the file's size, whatever the file promises.

use std::path::Path;

use super::*;

/// What a reader may hold whatever the file, e.g. a decoder's window.
const FREE: u64 = 1 << 20;

/// Bytes held at a time while a file of this name is read.
fn held(name: &str, bytes: &[u8]) -> u64 {
    let selection = Selection::default();
    let read = || {
        if let Err(error) = parse_as(Path::new(name), bytes, &selection) {
            assert!(!format!("{:?}", miette::Report::new(error)).is_empty());
        }
    };
    allocation_counter::measure(read).bytes_max
}

#[test]
fn good_files_are_read_in_a_small_multiple_of_their_size() {
    let values: Vec<f64> = (0..200_000).map(|k| (f64::from(k) * 0.37).sin()).collect();
    let sequence = Sequence::new("a", 2, values).unwrap();
    let data = Dataset::new(vec!["x".into(), "y".into()], vec![sequence]).unwrap();
    let fields = [Field { name: "", data: &data }];
    let files = [
        ("x.csv", table::writing::csv(&fields, ',').into_bytes(), 10),
        ("x.txt", table::writing::blocks(&fields).into_bytes(), 10),
        ("x.npy", npy::write("x.npy", &fields).unwrap(), 5),
        ("x.npz", npz::write("x.npz", &fields).unwrap(), 5),
        ("x.mcap", recording::tests::some_joints(), 50),
    ];
    for (name, bytes, factor) in files {
        let held = held(name, &bytes);
        assert!(held < FREE + factor * bytes.len() as u64, "{name}: {held} for {} bytes", bytes.len());
    }
}

#[test]
fn a_set_of_many_episodes_is_held_once_and_a_part_of_it_twice() {
    let episode = |e: usize| {
        let values = (0..20_000).map(|k| ((e * k) as f64 * 0.37).sin()).collect();
        Sequence::new(e.to_string(), 10, values).unwrap()
    };
    let data = Dataset::new(Dataset::numbered_channels(10), (0..40).map(episode).collect()).unwrap();
    let files = lerobot::write::files("x", &data, Some(0.02), "move").unwrap();
    let (_, frames) = files.into_iter().find(|(place, _)| place.starts_with("data/")).unwrap();
    let decoded = (data.total_samples() * 10 * size_of::<f64>()) as u64;
    // Beside the samples: numbers of the frames, the clock, and one episode as it is read.
    let held = held("x.parquet", &frames);
    assert!(held < FREE + decoded * 3 / 2, "{held} for {decoded}");
}

#[test]
fn promises_of_terabytes_cost_nothing() {
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 100000, 1), }\n";
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    npy.extend((header.len() as u16).to_le_bytes());
    npy.extend(header.as_bytes());
    npy.extend([0; 64]);
    // An archive whose member says that it holds 2^40 bytes, in its own header and in the directory.
    let member = npy::array_bytes(&[2, 2], [1.0, 2.0, 3.0, 4.0].into_iter());
    let mut npz = super::tests::archive(&[("a.npy", member.clone())]);
    let size = (member.len() as u32).to_le_bytes();
    for at in (0..npz.len() - 4).collect::<Vec<_>>() {
        if npz[at..at + 4] == size {
            npz[at..at + 4].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
        }
    }
    let mut mcap = recording::tests::some_joints();
    let chunk = mcap.windows(9).position(|window| window[0] == 0x06 && window[7..9] == [0, 0]).unwrap();
    mcap[chunk + 25..chunk + 33].copy_from_slice(&(1_u64 << 42).to_le_bytes());
    for (name, bytes) in [("x.npy", npy), ("x.npz", npz), ("x.mcap", mcap)] {
        // What an archive says of its members' sizes is not asked at all: they are read until they end.
        assert!(name == "x.npz" || parse_as(Path::new(name), &bytes, &Selection::default()).is_err(), "{name}");
        assert!(held(name, &bytes) < FREE, "{name}: {}", held(name, &bytes));
    }
}

/// Deflate packs zeros into a thousandth, and nothing into less.
#[test]
fn an_archive_unpacks_to_some_thousand_times_its_size_at_most() {
    use std::io::{Cursor, Write};
    use zip::write::SimpleFileOptions;

    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for index in 0..3 {
        archive.start_file(format!("{index}.npy"), options).unwrap();
        archive.write_all(&npy::array_bytes(&[3_000_000, 1], std::iter::repeat_n(0.0, 3_000_000))).unwrap();
    }
    let bytes = archive.finish().unwrap().into_inner();
    let held = held("x.npz", &bytes);
    assert!(held < 5000 * bytes.len() as u64, "{held} for {} bytes", bytes.len());
}

/// An archive whose directory names one member again and again, each by its own name.
fn overlapping(times: usize) -> Vec<u8> {
    let zeros = npy::array_bytes(&[100_000, 1], std::iter::repeat_n(0.0, 100_000));
    let one = super::tests::archive(&[("a000000.npy", zeros)]);
    let start = one.windows(4).rposition(|window| window == b"PK\x01\x02").unwrap();
    let end = one.windows(4).rposition(|window| window == b"PK\x05\x06").unwrap();
    let mut bytes = one[..start].to_vec();
    for index in 0..times {
        let mut entry = one[start..end].to_vec();
        let name = entry.windows(7).position(|window| window == b"a000000").unwrap();
        entry[name..name + 7].copy_from_slice(format!("a{index:06}").as_bytes());
        bytes.extend(entry);
    }
    let (directory, mut last) = ((bytes.len() - start) as u32, one[end..].to_vec());
    last[8..10].copy_from_slice(&(times as u16).to_le_bytes());
    last[10..12].copy_from_slice(&(times as u16).to_le_bytes());
    last[12..16].copy_from_slice(&directory.to_le_bytes());
    bytes.extend(last);
    bytes
}

#[test]
fn members_that_share_bytes_are_refused() {
    let bytes = overlapping(1000);
    let error = parse_as(Path::new("x.npz"), &bytes, &Selection::default()).unwrap_err();
    assert!(matches!(error, FileError::Overlap { .. }), "{error}");
    assert!(held("x.npz", &bytes) < 8 << 20, "{}", held("x.npz", &bytes));
    assert!(parse_as(Path::new("x.npz"), &overlapping(1), &Selection::default()).is_ok());
}

#[test]
fn no_small_file_takes_long_or_much() {
    let size = 64 << 10;
    let repeated = |text: &str| text.repeat(size / text.len()).into_bytes();
    let numbered = |format: &dyn Fn(usize) -> String| {
        let mut text = String::new();
        (0..)
            .take_while(|index| {
                text.push_str(&format(*index));
                text.len() < size
            })
            .count();
        text.into_bytes()
    };
    let mut tables = vec![
        repeated("a,"),
        repeated("1,"),
        repeated("\n1\n"),
        repeated("x\n"),
        repeated("time,"),
        repeated("[1 "),
        repeated("\""),
        repeated("# a b\n"),
        repeated("1 # x\n"),
        repeated("a\n1\n"),
        repeated("# sequence: a\n1\n"),
        repeated("sec,nsec,"),
        repeated("[["),
        numbered(&|index| format!("a{index}.sec,a{index}.nsec,")),
        numbered(&|index| format!("X,X.{index},")),
        numbered(&|index| format!("# sequence: {index}\n1\n")),
    ];
    let labels = numbered(&|index| format!("{index},1\n"));
    tables.push([&b"sequence,x\n"[..], &labels].concat());
    let twice = numbered(&|index| format!("{},1\n", index / 2));
    tables.push([&b"trial,x\n"[..], &twice].concat());
    let restarts = numbered(&|index| format!("{},1\n", index % 2));
    tables.push([&b"time,x\n"[..], &restarts].concat());
    let names = numbered(&|index| format!("a{index}.sec,"));
    tables.push([&names[..], b"\n", &b"1,".repeat(names.iter().filter(|byte| **byte == b',').count())].concat());
    let fields = numbered(&|index| format!("('f{index}','<f8'),"));
    let header =
        format!("{{'descr': [{}], 'fortran_order': False, 'shape': (1,)}}", String::from_utf8(fields).unwrap());
    let npy = [b"\x93NUMPY\x01\x00", &(header.len().min(60_000) as u16).to_le_bytes()[..], header.as_bytes()].concat();
    let files = tables.into_iter().map(|table| ("x.csv", table)).chain([("x.npy", npy)]);
    for (name, bytes) in files {
        let start = std::time::Instant::now();
        let held = held(name, &bytes);
        let shown = String::from_utf8_lossy(&bytes[..20]).into_owned();
        // Unoptimised, and beside other tests: a second of the program is less.
        assert!(start.elapsed().as_secs() < 10, "{shown:?}: {:?}", start.elapsed());
        assert!(held < FREE + 1000 * bytes.len() as u64, "{shown:?}: {held} for {}", bytes.len());
    }
}
