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

/// Bytes held at a time while a file of these bytes is read from the disk, and the samples that it holds.
fn held_on_disk(name: &str, bytes: &[u8], selection: &Selection) -> (u64, u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let mut samples = 0;
    let read = || {
        let reading = inspect(&path, selection).unwrap_or_else(|error| panic!("{name}: {error}"));
        samples = reading.data.sequences().iter().map(|one| size_of_val(one.values())).sum::<usize>() as u64;
    };
    (allocation_counter::measure(read).bytes_max, samples)
}

/// An HDF5 file with one data set of steps x channels, in one stretch or in chunks of 1024 steps, one behind the other.
fn hdf5_of(steps: usize, channels: usize, chunked: bool) -> Vec<u8> {
    let message = |kind: u8, data: &[u8]| [&[kind, data.len() as u8, 0, 0][..], data].concat();
    let header = |messages: &[Vec<u8>]| {
        let all = messages.concat();
        [&b"OHDR\x02\x02"[..], &(all.len() as u32).to_le_bytes(), &all, &[0; 4]].concat()
    };
    let place = |address: usize| (address as u64).to_le_bytes();
    let undefined = u64::MAX.to_le_bytes();
    let (root, data) = (48, 1024);
    let link = |to: usize| message(6, &[&[1, 0, 1, b'q'][..], &place(to)].concat());
    let root_header = header(&[link(200)]);
    let layout = match chunked {
        true => [&[4, 2, 0, 3, 8][..], &place(1024), &place(channels), &place(8), &[2], &place(data)].concat(),
        false => [&[3, 1][..], &place(data), &place(steps * channels * 8)].concat(),
    };
    let number = [&[0x11, 0x20, 0x3f, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52][..], &1023_u32.to_le_bytes()].concat();
    let space = [&[2, 2, 0, 1][..], &place(steps), &place(channels)].concat();
    let set_header = header(&[message(1, &space), message(3, &number), message(8, &layout)]);
    let mut bytes = [&b"\x89HDF\r\n\x1a\n\x02\x08\x08\0"[..], &place(0), &undefined, &undefined, &place(root)].concat();
    for (from, header) in [(root, root_header), (200, set_header)] {
        bytes.resize(from, 0);
        bytes.extend(header);
    }
    bytes.resize(data, 0);
    bytes.extend((0..steps * channels).flat_map(|k| ((k as f64) * 0.37).sin().to_le_bytes()));
    // The last chunk is written in full.
    let full = if chunked { steps.next_multiple_of(1024) } else { steps };
    bytes.resize(data + full * channels * 8, 0);
    bytes
}

#[test]
fn a_file_on_the_disk_is_held_once_as_samples_and_not_as_a_file_too() {
    let (steps, channels) = (65_536, 8);
    let values: Vec<f64> = (0..steps * channels).map(|k| (k as f64 * 0.37).sin()).collect();
    let data = |split: usize| {
        let rows = values.chunks(values.len() / split).enumerate();
        let rows = rows.map(|(s, part)| Sequence::new(s.to_string(), channels, part.to_vec()).unwrap()).collect();
        Dataset::new(Dataset::numbered_channels(channels), rows).unwrap()
    };
    let (one, many) = (data(1), data(16));
    let field = |data| [Field { name: "", data }];
    let frames = |data: &Dataset| {
        let files = lerobot::write::files("x", data, Some(0.02), "move").unwrap();
        files.into_iter().find(|(place, _)| place.starts_with("data/")).unwrap().1
    };
    let columns = npy::array_bytes(&[steps, channels], values.iter().copied());
    let turned = String::from_utf8_lossy(&columns[..128]).into_owned();
    let at = turned.find("False").unwrap();
    let mut fortran = columns;
    // At its place in bytes: the magic begins with one that is no UTF-8, which became three.
    fortran[at - 2..at + 3].copy_from_slice(b"True ");
    let half = |from: usize| values.chunks_exact(channels).flat_map(move |row| row[from..from + 4].to_vec());
    let groups = super::tests::archive(&[
        ("qpos.npy", npy::array_bytes(&[steps, 4], half(0))),
        ("action.npy", npy::array_bytes(&[steps, 4], half(4))),
    ]);
    // What is held at most, as a share of the samples. Where one array is cut into sequences, what is left of it is made
    // shorter: a system does that in its place, the allocator of this test copies.
    for (name, bytes, share) in [
        ("x.npy", npy::write("x.npy", &field(&one)).unwrap(), 1.1),
        ("x.npy", npy::write("x.npy", &field(&many)).unwrap(), 2.1),
        ("x.npy", fortran, 1.1),
        ("x.npz", npz::write("x.npz", &field(&many)).unwrap(), 1.1),
        ("x.npz", groups, 2.1),
        ("x.h5", hdf5_of(steps, channels, false), 1.5),
        ("x.h5", hdf5_of(steps, channels, true), 1.1),
        ("x.parquet", frames(&one), 1.6),
        ("x.parquet", frames(&many), 1.5),
    ] {
        let (held, samples) = held_on_disk(name, &bytes, &Selection::default());
        assert_eq!(samples, (values.len() * 8) as u64, "{name}");
        assert!(held as f64 <= share * samples as f64 + FREE as f64, "{name}: {held} for {samples}, allowed {share}");
    }
}

#[test]
fn what_is_read_in_windows_is_what_stands_there() {
    for chunked in [false, true] {
        let bytes = hdf5_of(5000, 3, chunked);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.h5");
        std::fs::write(&path, &bytes).unwrap();
        let selection = Selection::default();
        let (on_disk, in_memory) =
            (inspect(&path, &selection).unwrap(), inspect_bytes(&path, &bytes, &selection).unwrap());
        assert_eq!(on_disk.data, in_memory.data);
        let values = on_disk.data.sequences()[0].values();
        assert_eq!((values.len(), values[14_999]), (15_000, (14_999.0_f64 * 0.37).sin()));
        // Cut anywhere, it is refused.
        for length in (0..1100).step_by(13).chain([bytes.len() - 1]) {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(inspect(&path, &selection).is_err(), "{length}");
        }
    }
}
