//! What a reader holds is a small multiple of the file's size, whatever the file promises.

use std::path::Path;

use super::*;

/// What a reader may hold whatever the file, e.g. a decoder's window.
const FREE: u64 = 1 << 20;

/// Seconds of a processor that a file of 64 KB may take, as tests are built (CONTRIBUTING.md): the program takes fewer.
pub const SECONDS: f64 = 1.0;

/// Seconds of this thread's processor that some work takes, the best of up to three times: what else the machine does is no
/// matter of the work. Where the system does not tell, by the clock.
pub fn quickest(mut work: impl FnMut()) -> f64 {
    let told = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds / 1e9)
    };
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let (begun, before) = (std::time::Instant::now(), told());
        work();
        let spent = told().zip(before).map_or(begun.elapsed().as_secs_f64(), |(after, before)| after - before);
        best = best.min(spent);
        if best < SECONDS {
            break;
        }
    }
    best
}

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
    for (head, row) in [
        ("time,x\n", "2024-01-01T00:00:00.000000001,1\n"),
        ("time,x\n", "1e308,1\n"),
        ("time,x\n", "99999999999999999999999999999999,1e308\n"),
        ("sequence,x\n", "a,1\nb,1\n"),
        ("x;y\n", "1,5;\n"),
        ("x,y\n", "1.000.000,1\n"),
        ("x,y\n", ",\n"),
        ("x,y\n", "\"\"\"\",1\n"),
        ("x\n", "0000000000000000000000000000000000000001e-300\n"),
    ] {
        tables.push([head.as_bytes(), &repeated(row)].concat());
    }
    let names = numbered(&|index| format!("a{index}.sec,"));
    tables.push([&names[..], b"\n", &b"1,".repeat(names.iter().filter(|byte| **byte == b',').count())].concat());
    let fields = numbered(&|index| format!("('f{index}','<f8'),"));
    let header =
        format!("{{'descr': [{}], 'fortran_order': False, 'shape': (1,)}}", String::from_utf8(fields).unwrap());
    let npy = [b"\x93NUMPY\x01\x00", &(header.len().min(60_000) as u16).to_le_bytes()[..], header.as_bytes()].concat();
    let series = |head: &str, part: &str| [head.as_bytes(), b"@data\n", &repeated(part)].concat();
    let plain = "@timeStamps false\n@classLabel false\n";
    let labelled = numbered(&|index| format!("1:l{index}\n"));
    let labelled = [b"@timeStamps false\n@classLabel true\n@data\n", &labelled[..]].concat();
    let skeleton = |part: &str| [&repeated(part)[..], b"MOTION\nFrames: 9999999999\nFrame Time: 1e-300\n1\n"].concat();
    let others = [
        ("x.npy", npy),
        ("x.ts", series(plain, "1:")),
        ("x.ts", series(plain, "1,")),
        ("x.ts", series(plain, "1:2\n")),
        ("x.ts", series(plain, "?\n")),
        ("x.ts", series("@timeStamps true\n@classLabel false\n", "(0,1),")),
        ("x.ts", series("@timeStamps true\n@classLabel false\n", "(1e300,1):(0,1)\n")),
        ("x.ts", repeated("@classLabel true a ")),
        ("x.ts", labelled),
        ("x.bvh", skeleton("ROOT a\n")),
        ("x.bvh", skeleton("JOINT a{CHANNELS 1 x}\n")),
        ("x.bvh", skeleton("CHANNELS 0 ")),
        ("x.bvh", skeleton("CHANNELS 18446744073709551615 ")),
        ("x.bvh", skeleton("ROOT a {\nCHANNELS 1 x\n")),
        ("x.txt", repeated("1 ")),
        ("x.txt", repeated("1\n\n")),
        ("x.tsv", repeated("\t")),
        ("x.tsv", repeated("a\ta\n")),
    ];
    let files = tables.into_iter().map(|table| ("x.csv", table)).chain(others);
    for (name, bytes) in files {
        let mut most = 0;
        let seconds = quickest(|| most = held(name, &bytes));
        let (held, shown) = (most, String::from_utf8_lossy(&bytes[..20]).into_owned());
        assert!(seconds < SECONDS, "{shown:?}: {seconds} s");
        assert!(held < FREE + 1000 * bytes.len() as u64, "{shown:?}: {held} for {}", bytes.len());
    }
}

/// Names that many channels contain, each of them as long as the file allows.
#[test]
fn long_names_of_thousands_of_channels_are_refused() {
    use std::io::{Cursor, Write};
    use zip::write::SimpleFileOptions;

    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for letter in ["a", "b"] {
        archive.start_file(format!("{}.npy", letter.repeat(20_000)), options).unwrap();
        archive.write_all(&npy::array_bytes(&[2, 500_000], std::iter::repeat_n(0.0, 1_000_000))).unwrap();
    }
    let channels = "Xposition ".repeat(3000);
    let bvh = format!(
        "HIERARCHY\nROOT {}\n{{\nCHANNELS 3000 {channels}\n}}\nMOTION\nFrames: 1\nFrame Time: 1\n{}\n",
        "a".repeat(30_000),
        "1 ".repeat(3000)
    );
    for (name, bytes) in [("x.npz", archive.finish().unwrap().into_inner()), ("x.bvh", bvh.into_bytes())] {
        assert!(bytes.len() < 200 << 10, "{name}: {}", bytes.len());
        let mut most = 0;
        let seconds = quickest(|| most = held(name, &bytes));
        assert!(seconds < SECONDS && most < (64 << 20) + 4400 * bytes.len() as u64, "{name}: {seconds} s, {most}");
    }
    let arrays = |axes: &str| Selection { axes: axes.parse().ok(), ..Selection::default() };
    let field = format!("('{}','<f8',({}))", "a".repeat(4000), "1,".repeat(33));
    let header = format!("{{'descr': [{field}], 'fortran_order': False, 'shape': (1,)}}");
    let npy = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &[0; 8]].concat();
    let told = parse_as(Path::new("x.npy"), &npy, &arrays("tc")).unwrap_err().to_string();
    assert!(told.contains("up to 32 lengths"), "{told}");
}
