//! Tests across formats: what is written is read again, bit for bit, and no garbage makes the readers panic.

use super::*;
use miette::Diagnostic;

fn set(channels: &[&str], sequences: &[(&str, &[f64])]) -> Dataset {
    let sequence = |(name, values): &(&str, &[f64])| Sequence::new(*name, channels.len(), values.to_vec()).unwrap();
    let channels = channels.iter().map(|name| name.to_string()).collect();
    Dataset::new(channels, sequences.iter().map(sequence).collect()).unwrap()
}

fn bits(data: &Dataset) -> Vec<Vec<u64>> {
    data.sequences().iter().map(|sequence| sequence.values().iter().map(|value| value.to_bits()).collect()).collect()
}

/// Writes and reads again.
fn through(extension: &str, fields: &[Field<'_>]) -> Result<Dataset, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("data.{extension}"));
    write(&path, fields)?;
    read(&path)
}

/// Numbers whose shortest text is long, tiny, huge or easily spoilt.
const AWKWARD: &[f64] =
    &[0.1, -0.0, 1.0 / 3.0, 5e-324, f64::MAX, f64::MIN_POSITIVE, 1e-20, -123_456_789.123_456_79, 1e16, 2.0, 1e5, 7.0];

#[test]
fn every_format_gives_back_the_bits() {
    let ragged = set(&["a b", "c"], &[("x, \"1\"", AWKWARD), ("#2", &AWKWARD[..2])]);
    let even = set(&["a b", "c"], &[("x", AWKWARD), ("y", AWKWARD)]);
    let upper = set(&["time of day", "\u{e9}"], &[("0.5", AWKWARD)]);
    for data in [&ragged, &even, &upper] {
        for extension in ["csv", "txt", "dat", "tsv", "CSV", "npz", "npy"] {
            if extension == "npy" && data == &ragged {
                continue;
            }
            let back = through(extension, &[Field { name: "", data }]).unwrap();
            assert_eq!(bits(&back), bits(data), "{extension}");
            if !extension.starts_with("np") {
                assert_eq!(&back, data, "{extension}");
            }
        }
    }
}

#[test]
fn names_that_would_not_tell_sequences_apart_become_numbers() {
    let data = set(&["y"], &[("a", &[1.0]), ("a", &[2.0])]);
    for extension in ["csv", "txt"] {
        let back = through(extension, &[Field { name: "", data: &data }]).unwrap();
        assert_eq!(back, set(&["y"], &[("1", &[1.0]), ("2", &[2.0])]));
    }
}

#[test]
fn fields_stand_side_by_side() {
    let mean = set(&["y1", "y2"], &[("a", &[1.0, 2.0]), ("b", &[3.0, 4.0])]);
    let context = set(&["c1"], &[("a", &[0.5]), ("b", &[0.25])]);
    let fields = [Field { name: "mean", data: &mean }, Field { name: "context", data: &context }];
    assert_eq!(csv(&fields), "sequence,step,mean_y1,mean_y2,context_c1\na,1,1.0,2.0,0.5\nb,1,3.0,4.0,0.25\n");
    let joined = set(&["mean_y1", "mean_y2", "context_c1"], &[("a", &[1.0, 2.0, 0.5]), ("b", &[3.0, 4.0, 0.25])]);
    assert_eq!(through("txt", &fields).unwrap(), joined);

    let bytes = npz::write("x.npz", &fields).unwrap();
    let names: Vec<String> = {
        let archive = zip::ZipArchive::new(std::io::Cursor::new(&bytes)).unwrap();
        archive.file_names().map(|name| name.unwrap().into_owned()).collect()
    };
    let arrays = ["mean_000.npy", "mean_001.npy", "context_000.npy", "context_001.npy"];
    assert_eq!(names[..4], arrays);
    assert_eq!(names[4..], ["names_of_sequences.npy", "names_of_channels_context.npy"]);
    let again = inspect_bytes(Path::new("x.npz"), &bytes, &Selection::default()).unwrap().data;
    assert_eq!(again.sequences().iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(bytes, npz::write("x.npz", &fields).unwrap());
}

#[test]
fn what_a_format_cannot_hold_is_refused_and_nothing_is_written() {
    let ragged = set(&["y"], &[("a", &[1.0, 2.0]), ("b", &[3.0])]);
    let even = set(&["y"], &[("a", &[1.0]), ("b", &[3.0])]);
    let field = |data| Field { name: "", data };
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, fields: &[Field<'_>]| write(&folder.path().join(name), fields).unwrap_err();
    let error = refused("x.npy", &[field(&ragged)]);
    assert!(error.help().unwrap().to_string().contains(".npz"));
    assert!(matches!(error, FileError::Ragged { shortest: 1, longest: 2, .. }), "{error}");
    assert!(matches!(refused("x.npy", &[field(&even), field(&even)]), FileError::SeveralFields { found: 2, .. }));
    assert!(matches!(refused("x.npz", &[field(&even), field(&even)]), FileError::Archive { .. }));
    assert!(matches!(refused("x.csv", &[field(&even), field(&ragged)]), FileError::FieldsDiffer { .. }));
    assert!(matches!(refused("x.csv", &[]), FileError::Empty { .. }));
    assert!(matches!(refused("x.xyz", &[field(&even)]), FileError::Extension { .. }));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = read(Path::new("no/such/file.csv")).unwrap_err();
    assert_eq!(error.to_string(), "cannot read no/such/file.csv");
    assert!(matches!(read(Path::new("data")).unwrap_err(), FileError::Extension { .. }));
}

#[test]
fn arrays_become_sequences_by_their_axes() {
    let values = |count: u32| (0..count).map(f64::from);
    let shapes = |bytes: Vec<u8>| {
        let data = parse_as(Path::new("x.npy"), &bytes, &Selection::default()).unwrap();
        let named = |s: &Sequence| (s.name.clone(), s.len());
        (data.channels().len(), data.sequences().iter().map(named).collect::<Vec<_>>())
    };
    assert_eq!(shapes(npy::array_bytes(&[2, 4, 3], values(24))), (3, vec![("1".into(), 4), ("2".into(), 4)]));
    assert_eq!(shapes(npy::array_bytes(&[4, 3], values(12))), (3, vec![("1".into(), 4)]));
    assert_eq!(shapes(npy::array_bytes(&[3], values(3))), (1, vec![("1".into(), 3)]));
}

/// An archive of these members, deflated as numpy.savez_compressed does.
pub fn archive(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    use std::io::Write;
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in members {
        let method = zip::CompressionMethod::Deflated;
        archive.start_file(*name, zip::write::SimpleFileOptions::default().compression_method(method)).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn images_in_an_archive_are_left_out_beside_numbers() {
    let array = |lengths: &[usize]| npy::array_bytes(lengths, (0..lengths.iter().product()).map(|k: usize| k as f64));
    let bytes = archive(&[("qpos.npy", array(&[5, 2])), ("images.npy", array(&[5, 2, 2, 3]))]);
    let reading = inspect_bytes(Path::new("x.npz"), &bytes, &Selection::default()).unwrap();
    assert_eq!(reading.data.sequences()[0].values(), (0..10).map(f64::from).collect::<Vec<_>>());
    let said: Vec<String> = reading.remarks.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|one| one.contains("`images`") && one.contains("4 axes")), "{said:?}");
    // Asked for, they are refused with what to do; alone, too.
    let asked = Selection { arrays: vec!["images".into()], ..Selection::default() };
    assert!(matches!(inspect_bytes(Path::new("x.npz"), &bytes, &asked), Err(FileError::Array { .. })));
    let alone = archive(&[("images.npy", array(&[5, 2, 2, 3]))]);
    assert!(inspect_bytes(Path::new("x.npz"), &alone, &Selection::default()).is_err());
}

#[test]
fn the_arrays_of_an_archive_are_its_sequences() {
    let rows = |lengths: &[usize]| npy::array_bytes(lengths, (0..lengths.iter().product()).map(|k: usize| k as f64));
    let read = |members: &[(&str, Vec<u8>)]| parse_as(Path::new("x.npz"), &archive(members), &Selection::default());
    let two = read(&[("b.npy", rows(&[3, 2])), ("a.npy", rows(&[1, 2]))]).unwrap();
    assert_eq!(two, set(&["y1", "y2"], &[("b", &[0., 1., 2., 3., 4., 5.]), ("a", &[0., 1.])]));
    let one = read(&[("all.npy", rows(&[2, 3, 1]))]).unwrap();
    assert_eq!(one, set(&["y1"], &[("1", &[0., 1., 2.]), ("2", &[3., 4., 5.])]));

    let message = |members: &[(&str, Vec<u8>)]| read(members).unwrap_err().to_string();
    assert_eq!(
        message(&[("a.npy", rows(&[2, 2])), ("b.npy", rows(&[3, 3]))]),
        "x.npz: its arrays differ in lengths and channels: a (2, 2), b (3, 3)"
    );
    assert_eq!(message(&[("notes.txt", b"hello".to_vec())]), "x.npz, array `notes.txt`: this is not a numpy array");
    assert_eq!(message(&[("a.npy", b"hello".to_vec())]), "x.npz, array `a.npy`: this is not a numpy array");
    assert_eq!(message(&[]), "x.npz holds no samples; needed: at least one");
    let missing = archive(&[("a.npy", npy::array_bytes(&[2, 2], [1.0, 2.0, 3.0, f64::NAN].into_iter()))]);
    let refuse = Selection { missing: Missing::Refuse, ..Selection::default() };
    let error = parse_as(Path::new("x.npz"), &missing, &refuse).unwrap_err();
    assert_eq!(error.to_string(), "x.npz: sequence a, step 2, channel y2 is NaN");
    assert_eq!(parse_as(Path::new("x.npz"), &missing, &Selection::default()).unwrap().missing(), 1);
}

#[test]
fn arrays_that_are_numbered_twice_are_sequences_unless_something_else_tells_them_apart() {
    let rows = |lengths: &[usize]| npy::array_bytes(lengths, (0..lengths.iter().product()).map(|k: usize| k as f64));
    let names = |members: &[&str], shape: &[usize]| {
        let members: Vec<(&str, Vec<u8>)> = members.iter().map(|name| (*name, rows(shape))).collect();
        let data = parse_as(Path::new("x.npz"), &archive(&members), &Selection::default()).unwrap();
        let named = data.sequences().iter().map(|one| one.name.clone()).collect::<Vec<_>>();
        (data.channels().len(), named)
    };
    let trials =
        ["s2_trial1.npy", "s1_trial10.npy", "s1_trial2.npy", "s2_trial10.npy", "s1_trial1.npy", "s2_trial2.npy"];
    let (channels, sequences) = names(&trials, &[4, 3]);
    assert_eq!(channels, 3);
    assert_eq!(sequences, ["s1_trial1", "s1_trial2", "s1_trial10", "s2_trial1", "s2_trial2", "s2_trial10"]);
    // Of one channel each they are joints.
    assert_eq!(
        names(&["joint1_0.npy", "joint2_0.npy", "joint1_1.npy", "joint2_1.npy"], &[4]),
        (2, vec!["0".into(), "1".into()])
    );
    // Words tell arrays apart that belong together.
    assert_eq!(names(&["qpos_0.npy", "action_0.npy", "qpos_1.npy", "action_1.npy"], &[4, 3]).0, 6);
}

/// A generator of garbage that needs no crate (splitmix64).
struct Garbage(u64);

impl Garbage {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    /// Pure noise, pieces of the format, or a good file with a few spots changed and its end cut off.
    fn bytes(&mut self, pieces: &[&[u8]], good: &[Vec<u8>]) -> Vec<u8> {
        let length = self.below(200);
        match self.below(3) {
            0 => (0..length).map(|_| self.next() as u8).collect(),
            1 => (0..length / 4).flat_map(|_| pieces[self.below(pieces.len())].to_vec()).collect(),
            _ => {
                let mut bytes = good[self.below(good.len())].clone();
                for _ in 0..=self.below(4) {
                    let spot = self.below(bytes.len());
                    bytes[spot] = if self.below(2) == 0 { self.next() as u8 } else { 0xff };
                }
                if self.below(3) == 0 {
                    bytes.truncate(self.below(bytes.len()));
                }
                bytes
            }
        }
    }
}

#[test]
fn garbage_never_makes_a_reader_panic() {
    let data = set(&["a", "b"], &[("x y", &[0.5, 1.5, 2.5, 3.5]), ("z", &[4.5, 5.5, 6.5, 7.5])]);
    let fields = [Field { name: "", data: &data }];
    let text = [table::writing::csv(&fields, ',').into_bytes(), table::writing::blocks(&fields).into_bytes()];
    let npy = [npy::write("x.npy", &fields).unwrap()];
    let member = npy::array_bytes(&[2, 2], [1.0, 2.0, 3.0, 4.0].into_iter());
    let npz = [npz::write("x.npz", &fields).unwrap(), archive(&[("a.npy", member)])];
    let words = "1 2.5 , ; \t \n \r \" # \"\" - . e9 nan inf NA a sequence time frame episode sec nsec True [1 2] 10:00 2024-05-01T10:00:00Z 1,5 % sep=; deg \u{e9} columns: # sequence: \u{feff}";
    let mut pieces: Vec<&[u8]> = words.split(' ').map(str::as_bytes).collect();
    pieces.extend([&b" "[..], b"\n", b"\xff", b"\n1,2\n"]);
    let header = "{ } ( ) , : 'descr' 'fortran_order' 'shape' '<f8' '|u1' True False 99999999999999999999 3 L";
    let mut array_pieces: Vec<&[u8]> = header.split(' ').map(str::as_bytes).collect();
    array_pieces.extend([
        &b"\x93NUMPY\x01\0"[..],
        b"\x93NUMPY\x02\0\x10\0\0\0",
        b"\0",
        b"PK\x01\x02",
        b"PK\x05\x06",
        b"PK\x03\x04",
    ]);

    let mcap = [recording::tests::some_joints()];
    let records =
        "\x01 \x02 \x03 \x04 \x05 \x06 \0 \0\0\0 {\"joints\":[ {\"name\":\"a\", \"position\":1} ]} zstd lz4 json /a";
    let mut record_pieces: Vec<&[u8]> = records.split(' ').map(str::as_bytes).collect();
    record_pieces.extend([&b"\x89MCAP0\r\n"[..], b"\x08\0\0\0\0\0\0\0", b"\x28\xb5\x2f\xfd", b"\xff"]);

    let mut garbage = Garbage(1);
    let mut read_well = [0; 4];
    for _ in 0..4000 {
        let bytes = garbage.bytes(&pieces, &text);
        read_well[0] += ["g.csv", "g.txt", "g.tsv"].iter().filter(|name| checked(name, &bytes)).count();
        read_well[1] += usize::from(checked("g.npy", &garbage.bytes(&array_pieces, &npy)));
        read_well[2] += usize::from(checked("g.npz", &garbage.bytes(&array_pieces, &npz)));
        read_well[3] += usize::from(checked("g.mcap", &garbage.bytes(&record_pieces, &mcap)));
    }
    // The test would say little if all of it failed at the first byte.
    assert!(read_well.iter().all(|&count| count > 50), "{read_well:?}");
}

/// Whether the bytes are data; a message is rendered if not.
fn checked(name: &str, bytes: &[u8]) -> bool {
    match parse_as(Path::new(name), bytes, &Selection::default()) {
        Ok(data) => {
            assert!(data.total_samples() > 0 && !data.channels().is_empty());
            true
        }
        Err(error) => {
            let message = format!("{:?}", miette::Report::new(error));
            assert!(!message.is_empty());
            false
        }
    }
}
