//! Files of formats that others made: pyarrow, h5py and scipy write them, and read what is written here.
//!
//! The interpreter is that of tests/python/interpreter.rs.

use std::path::{Path, PathBuf};
use std::process::Command;

use scrnn::dataset::{Dataset, Sequence};
use scrnn_data::{Conversion, Reading, Selection, inspect, write_converted};

#[path = "python/interpreter.rs"]
mod interpreter;

use interpreter::root;

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    interpreter::python("numpy, pandas, pyarrow, h5py, scipy.io, mcap")
}

/// Runs one of the scripts in tests/python, which must succeed.
fn script(python: &Path, name: &str, folder: &Path) {
    let script = root().join("tests/python").join(name);
    let output = Command::new(python).arg("-Wignore").arg(script).arg(folder).output().unwrap();
    let said = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
    assert!(output.status.success(), "{name}: {}{}", said[0], said[1]);
}

/// 16 e + t / 4 + c / 32: the rule of write_formats.py.
fn state(e: usize, t: usize, c: usize) -> f64 {
    16.0 * e as f64 + t as f64 / 4.0 + c as f64 / 32.0
}

/// Checks that three channels from `column` on follow the rule, times `factor`, in sequences from `first` on.
fn check(of: &str, reading: &Reading, lengths: &[usize], first: usize, column: usize, factor: f64) {
    let found: Vec<usize> = reading.data.sequences().iter().map(Sequence::len).collect();
    assert_eq!(found, lengths, "{of}");
    for (e, sequence) in (first..).zip(reading.data.sequences()) {
        for t in 0..sequence.len() {
            let expected = [0, 1, 2].map(|c| factor * state(e, t, c));
            assert_eq!(sequence.sample(t)[column..column + 3], expected, "{of}, sequence {e}, step {t}");
        }
    }
}

#[test]
fn files_of_other_programs_hold_what_they_wrote() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    script(&python, "write_formats.py", folder.path());
    let read = |name: &str, arrays: &[&str]| {
        let arrays = arrays.iter().map(|name| (*name).to_owned()).collect();
        let selection = Selection { arrays, ..Selection::default() };
        inspect(&folder.path().join(name), &selection).unwrap_or_else(|error| panic!("{name}: {error}"))
    };

    for (name, lengths) in [("lerobot_v3", vec![5, 4, 6, 3, 7]), ("lerobot_v2", (3..15).collect())] {
        let reading = read(name, &[]);
        check(name, &reading, &lengths, 0, 0, 1.0);
        check(name, &reading, &lengths, 0, 3, -1.0);
        assert_eq!(reading.data.channels()[0], "observation.state.shoulder");
        assert_eq!(reading.period, Some(0.02));
    }
    let ways = [
        "snappy", "plain", "gzip", "zstd", "lz4", "v2", "v2_plain", "pages", "old", "split", "delta", "double", "half",
        "fixed",
    ];
    for way in ways {
        check(way, &read(&format!("parquet/{way}.parquet"), &[]), &[10, 12, 8], 0, 0, 1.0);
    }
    let error = inspect(&folder.path().join("parquet/brotli.parquet"), &Selection::default()).unwrap_err();
    assert!(error.to_string().contains("packed by brotli"), "{error}");

    let lengths: Vec<usize> = (4..16).collect();
    for way in ["", "_new", "_gzip", "_gzip_new", "_grown", "_grown_both", "_one_chunk", "_lzf"] {
        let reading = read(&format!("hdf5/robomimic{way}.hdf5"), &["obs/robot0_joint_pos", "actions"]);
        check(way, &reading, &lengths, 0, 0, 1.0);
        check(way, &reading, &lengths, 0, 3, -1.0);
        assert_eq!(reading.period, Some(0.05), "{way}");
    }
    check("aloha", &read("hdf5/episode_1.hdf5", &[]), &[9], 1, 3, -1.0);
    for name in ["hdf5/many.h5", "hdf5/many_new.h5"] {
        check(name, &read(name, &[]), &[3; 200], 0, 0, 1.0);
        check(name, &read(name, &["long"]), &[3000], 0, 0, 1.0);
    }
    for array in ["grown", "grown_gzip", "packed"] {
        check(array, &read("hdf5/many_new.h5", &[array]), &[3000], 0, 0, 1.0);
    }
    for array in ["grown_both", "grown_both_gzip"] {
        check(array, &read("hdf5/many_new.h5", &[array]), &[300], 0, 0, 1.0);
    }
    for name in ["mat/plain.mat", "mat/packed.mat"] {
        check(name, &read(name, &["q"]), &[20], 0, 0, 1.0);
    }
    check("cells", &read("mat/cells.mat", &[]), &[5, 6], 0, 0, 1.0);
    check("matlab 7.3", &read("hdf5/matlab.mat", &[]), &[20], 0, 0, 1.0);
}

#[test]
fn pyarrow_pandas_and_mcap_read_what_is_converted() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let channels = ["observation.state.shoulder", "observation.state.elbow", "observation.state.gripper", "action.0"];
    let sequence = |(e, steps): (usize, usize)| {
        let row = |t: usize| [state(e, t, 0), state(e, t, 1), state(e, t, 2), -state(e, t, 0)];
        Sequence::new(format!("episode {e}"), 4, (0..steps).flat_map(row).collect()).unwrap()
    };
    let sequences = [30, 20, 25].into_iter().enumerate().map(sequence).collect();
    let data = Dataset::new(channels.map(str::to_owned).to_vec(), sequences).unwrap();
    let about = Conversion { period: Some(0.02), task: Some("wave the arm") };
    for name in ["lerobot", "arm.mcap", "arm.csv", "arm.npz", "frames.parquet"] {
        write_converted(&folder.path().join(name), &data, &about).unwrap();
    }
    script(&python, "read_formats.py", folder.path());
}
