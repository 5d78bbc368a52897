//! HDF5 files of other software and of this one, whole and damaged.

use std::path::{Path, PathBuf};

use super::*;
use crate::budget::Budget;
use crate::tests_random::damage;
use crate::{Axes, Reading, inspect_bytes};

const BUDGET: u64 = 16 << 20;

/// What tests/python/write_formats.py wrote with h5py. `SCRNN_FIXTURES` can name a folder with all that it writes.
fn fixture(name: &str) -> Vec<u8> {
    let all = std::env::var_os("SCRNN_FIXTURES").map(PathBuf::from);
    let folder = all.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures"));
    std::fs::read(folder.join("hdf5").join(name)).unwrap()
}

/// Reads it as a file, and from memory: that must be one.
fn read_with(name: &str, selection: &Selection) -> Result<Reading, FileError> {
    let bytes = fixture(name);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(if name.ends_with("mat") { "x.mat" } else { "x.hdf5" });
    std::fs::write(&path, &bytes).unwrap();
    let (on_disk, in_memory) = (crate::inspect(&path, selection), inspect_bytes(&path, &bytes, selection));
    match (&on_disk, &in_memory) {
        (Ok(a), Ok(b)) => assert_eq!((&a.data, a.period, &a.remarks), (&b.data, b.period, &b.remarks), "{name}"),
        (a, b) => assert_eq!(a.as_ref().err().map(ToString::to_string), b.as_ref().err().map(ToString::to_string)),
    }
    on_disk
}

fn read(name: &str) -> Reading {
    read_with(name, &Selection::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn arrays(names: &[&str]) -> Selection {
    Selection { arrays: names.iter().map(|name| (*name).to_owned()).collect(), ..Selection::default() }
}

/// 16 e + t / 4 + c / 32, as the script has it.
fn state(e: usize, t: usize, c: usize) -> f64 {
    16.0 * e as f64 + t as f64 / 4.0 + c as f64 / 32.0
}

/// Checks demonstrations of 4, 5, 6, ... steps.
fn check_demos(name: &str, demos: usize) {
    let reading = read(name);
    assert_eq!(
        reading.data.channels(),
        [
            "obs/robot0_gripper_qpos.0",
            "obs/robot0_gripper_qpos.1",
            "obs/robot0_joint_pos.0",
            "obs/robot0_joint_pos.1",
            "obs/robot0_joint_pos.2",
            "actions.0",
            "actions.1",
            "actions.2"
        ]
    );
    assert_eq!(reading.data.sequences().len(), demos, "{name}");
    for (e, sequence) in reading.data.sequences().iter().enumerate() {
        assert_eq!((sequence.name.as_str(), sequence.len()), (format!("demo_{e}").as_str(), 4 + e), "{name}");
        for t in 0..sequence.len() {
            let row = sequence.sample(t);
            assert_eq!(row[2..5], [0, 1, 2].map(|c| state(e, t, c)), "{name}");
            assert_eq!(row[5..], [0, 1, 2].map(|c| -state(e, t, c)), "{name}");
        }
    }
    assert_eq!(reading.period, Some(0.05), "{name}");
}

#[test]
fn demonstrations_come_in_natural_order_however_they_were_written() {
    if std::env::var_os("SCRNN_FIXTURES").is_none() {
        for name in ["small.hdf5", "small_new.hdf5"] {
            check_demos(name, 3);
        }
        return;
    }
    for way in ["", "_new", "_gzip", "_gzip_new", "_grown", "_grown_both", "_one_chunk", "_lzf"] {
        check_demos(&format!("robomimic{way}.hdf5"), 12);
    }
}

#[test]
fn an_aloha_episode_is_its_joints_and_its_actions() {
    let reading = read("episode_1.hdf5");
    let names: Vec<&str> = reading.data.channels().iter().map(String::as_str).collect();
    assert_eq!(names[..3], ["observations/qpos.0", "observations/qpos.1", "observations/qpos.2"]);
    assert_eq!(names[3..], ["action.0", "action.1", "action.2"]);
    let sequence = &reading.data.sequences()[0];
    assert_eq!((sequence.len(), sequence.sample(8)[4]), (9, -state(1, 8, 1)));
    let said: Vec<String> = reading.remarks.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|remark| remark.contains("there is also observations/qvel")), "{said:?}");
    let reading = read_with("episode_1.hdf5", &arrays(&["/observations/qvel"])).unwrap();
    assert_eq!(reading.data.sequences()[0].sample(2)[1], 2.0 * state(1, 2, 1));
    let channels = Some(vec!["action.2".to_owned(), "observations/qvel.0".to_owned()]);
    let reading = read_with("episode_1.hdf5", &Selection { channels, ..Selection::default() }).unwrap();
    assert_eq!(reading.data.sequences()[0].sample(3), [-state(1, 3, 2), 2.0 * state(1, 3, 0)]);
}

#[test]
fn numbers_of_every_kind_are_read() {
    let budget = Budget::of(64 << 20);
    let windows = Windows::whole(fixture("types.h5"));
    let file = File::open(&windows, &budget).unwrap();
    let contents = Contents::read(&file).unwrap();
    let numbers = |path: &str| {
        let found = contents.data_sets.iter().find(|found| found.path == path).unwrap();
        contents.numbers(&file, found).unwrap()
    };
    let mut kinds = 0;
    for found in contents.data_sets.iter().filter(|found| found.path.starts_with("kinds/")) {
        let unsigned = found.path.contains("_u");
        let expected: Vec<f64> = match found.path.as_str() {
            "kinds/bool" => vec![1.0, 0.0, 1.0],
            _ => (if unsigned { 0 } else { -3 }..4).map(f64::from).collect(),
        };
        assert_eq!(numbers(&found.path), expected, "{}", found.path);
        kinds += 1;
    }
    assert_eq!(kinds, 19);
    assert_eq!(numbers("compact"), [0., 1., 2., 3., 4., 5.]);
    assert_eq!(numbers("scalar"), [3.0]);
    assert_eq!(numbers("filled"), [1.0, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5]);
    assert!(numbers("empty").is_empty());
    let error = read_with("types.h5", &arrays(&["compound"])).unwrap_err().to_string();
    assert!(error.contains("compound is 3 records"), "{error}");
    let error = read_with("types.h5", &arrays(&["nothing"])).unwrap_err();
    assert!(error.to_string().contains("it has no data set `nothing`"), "{error}");
    assert!(miette::Diagnostic::help(&error).unwrap().to_string().contains("compact (3 x 2)"));
    // Data sets of many lengths: nobody can tell which are meant.
    let error = read("episode_0.hdf5").data.channels().len();
    assert_eq!(error, 6);
    assert!(
        matches!(read_with("types.h5", &Selection::default()), Err(FileError::Format { problem, .. }) if matches!(*problem, FormatProblem::Choose { .. }))
    );
}

#[test]
fn many_groups_and_many_chunks_are_found() {
    if std::env::var_os("SCRNN_FIXTURES").is_none() {
        return;
    }
    for name in ["many.h5", "many_new.h5"] {
        let reading = read(name);
        assert_eq!(reading.data.sequences().len(), 200, "{name}");
        assert_eq!(reading.data.sequences()[123].sample(2)[1], state(123, 2, 1), "{name}");
        let long = ["long", "grown", "grown_gzip", "packed", "grown_both", "grown_both_gzip"];
        for array in if name == "many.h5" { &long[..1] } else { &long[..] } {
            let reading = read_with(name, &arrays(&[array])).unwrap_or_else(|error| panic!("{name} {array}: {error}"));
            let sequence = &reading.data.sequences()[0];
            assert_eq!(sequence.len(), if array.contains("both") { 300 } else { 3000 });
            for t in 0..sequence.len() {
                assert_eq!(*sequence.sample(t), [0, 1, 2].map(|c| state(0, t, c)), "{name} {array} {t}");
            }
        }
    }
}

#[test]
fn every_index_of_chunks_leads_to_them() {
    let budget = Budget::of(64 << 20);
    let windows = Windows::whole(fixture("indexes.h5"));
    let file = File::open(&windows, &budget).unwrap();
    let contents = Contents::read(&file).unwrap();
    assert_eq!(contents.data_sets.len(), 11);
    let expected: Vec<f64> = (0..40).flat_map(|t| (0..3).map(move |c| state(0, t, c))).collect();
    for found in &contents.data_sets {
        let numbers = contents.numbers(&file, found).unwrap_or_else(|error| panic!("{}: {error}", found.path));
        assert_eq!(numbers, expected, "{}", found.path);
    }
}

#[test]
fn axes_are_told_or_asked_for() {
    let error = read_with("axes.h5", &arrays(&["sideways"])).unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(help.contains("axes = \"ct\""), "{error}: {help}");
    let axes = |axes: &str| Selection { axes: Some(axes.parse::<Axes>().unwrap()), ..arrays(&["sideways"]) };
    let reading = read_with("axes.h5", &axes("ct")).unwrap();
    assert_eq!((reading.data.channels().len(), reading.data.sequences()[0].len()), (3, 20));
    assert_eq!(reading.data.sequences()[0].sample(7), [0, 1, 2].map(|c| state(0, 7, c)));
    let reading = read_with("axes.h5", &arrays(&["block"])).unwrap();
    assert_eq!((reading.data.sequences().len(), reading.data.channels().len()), (2, 3));
    assert_eq!(reading.data.sequences()[1].sample(4)[2], state(1, 4, 2));
}

#[test]
fn flags_of_the_last_step_tell_episodes_apart() {
    let reading = read("flags.h5");
    assert_eq!(reading.data.sequences().iter().map(|one| one.len()).collect::<Vec<_>>(), [4, 6, 2]);
    assert_eq!(reading.data.channels().len(), 6);
}

/// The remarks on a file, as one text.
fn said(reading: &Reading) -> String {
    reading.remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn groups_of_one_day_each_are_sequences_and_joints_stand_side_by_side() {
    let reading = read("dates.h5");
    let names: Vec<&str> = reading.data.sequences().iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["2024-01-30", "2024-01-31", "2024-02-01"]);
    assert_eq!(reading.data.channels(), ["arm/q.0", "arm/q.1", "arm/q.2"]);
    assert_eq!(reading.data.sequences()[2].sample(5), [0, 1, 2].map(|c| state(2, 5, c)));
    let reading = read("joints.h5");
    assert_eq!(reading.data.sequences().len(), 1);
    assert_eq!(reading.data.channels(), [0, 1, 2].map(|c| format!("arm/joint_{c}/position")));
    assert_eq!(reading.data.sequences()[0].sample(5), [0, 1, 2].map(|c| state(0, 5, c)));
}

#[test]
fn a_state_more_than_actions_is_left_out_and_said() {
    let reading = read("one_more.h5");
    assert_eq!(reading.data.sequences().iter().map(|one| one.len()).collect::<Vec<_>>(), [6, 7, 8]);
    let sample = reading.data.sequences()[2].sample(7);
    assert_eq!(sample[..3], [0, 1, 2].map(|c| state(2, 7, c)));
    assert_eq!(sample[3..], [0, 1, 2].map(|c| -state(2, 7, c)));
    let said = said(&reading);
    assert_eq!(said.matches("obs/agent/qpos has one step more").count(), 1, "{said}");
}

#[test]
fn points_in_space_are_asked_about_and_a_table_of_pandas_has_no_index() {
    let error = read_with("points.h5", &Selection::default()).unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(
        error.to_string().contains("40 steps of 12 channels") && help.contains("reshape(40, -1)"),
        "{error}: {help}"
    );
    let as_sequences = Selection { axes: "ntc".parse().ok(), ..Selection::default() };
    assert_eq!(read_with("points.h5", &as_sequences).unwrap().data.sequences().len(), 40);
    let reading = read("pandas.h5");
    assert_eq!(reading.data.channels(), [0, 1, 2].map(|c| format!("df/block0_values.{c}")));
    assert_eq!(reading.data.sequences()[0].sample(8), [0, 1, 2].map(|c| state(0, 8, c)));
}

#[test]
fn a_matlab_file_has_its_axes_in_reverse() {
    let reading = read("matlab.mat");
    assert_eq!(reading.data.channels(), ["q.0", "q.1", "q.2"]);
    assert_eq!(reading.data.sequences()[0].sample(9), [0, 1, 2].map(|c| state(0, 9, c)));
}

/// Reads all that is there.
fn read_all(bytes: &[u8]) -> Option<usize> {
    let budget = Budget::of(BUDGET);
    let windows = Windows::whole(bytes);
    let file = File::open(&windows, &budget).ok()?;
    let contents = Contents::read(&file).ok()?;
    let _ = layout::samples(&file, &contents, &Selection::default());
    Some(contents.data_sets.iter().filter(|found| contents.numbers(&file, found).is_ok()).count())
}

#[test]
fn damaged_bytes_never_panic() {
    for name in ["small.hdf5", "small_new.hdf5", "types.h5", "flags.h5", "indexes.h5"] {
        let bytes = fixture(name);
        assert!(read_all(&bytes).is_some_and(|count| count > 0), "{name}");
        damage(&bytes, 300, BUDGET, |bytes| {
            read_all(bytes);
        });
    }
}

#[test]
fn promises_of_terabytes_cost_nothing() {
    let mut bytes = fixture("axes.h5");
    // The lengths of `sideways`, and the most that they may grow to.
    let lengths = [3_u64, 20].map(u64::to_le_bytes).concat();
    let huge = [3_u64, 1 << 40].map(u64::to_le_bytes).concat();
    let places: Vec<usize> = (0..bytes.len() - 16).filter(|&place| bytes[place..place + 16] == lengths).collect();
    assert!(!places.is_empty());
    for place in places {
        bytes[place..place + 16].copy_from_slice(&huge);
    }
    let read = || {
        let refused = inspect_bytes(Path::new("x.h5"), &bytes, &arrays(&["sideways"]));
        assert!(refused.is_err());
        let axes = Selection { axes: Some("ct".parse().unwrap()), ..arrays(&["sideways"]) };
        assert!(inspect_bytes(Path::new("x.h5"), &bytes, &axes).is_err());
    };
    let held = allocation_counter::measure(read).bytes_max;
    assert!(held < 1 << 20, "{held}");
}

#[test]
fn demo_2_comes_before_demo_10() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/28-robomimic-hdf5/demo.hdf5");
    let reading = crate::inspect(&case, &Selection::default()).unwrap();
    let names: Vec<String> = reading.data.sequences().iter().map(|one| one.name.clone()).collect();
    assert_eq!(names, (0..12).map(|demo| format!("demo_{demo}")).collect::<Vec<_>>());
    assert!(reading.data.sequences().iter().all(|one| one.len() == 40));
    assert_eq!((reading.data.channels().len(), reading.data.channels()[7].as_str()), (9, "actions.0"));
    // Of demo_10, as h5py reads it.
    let sample = reading.data.sequences()[10].sample(3);
    assert_eq!(sample[..2], [-0.446_506_249_861_436_94, -0.085_805_176_156_179_69]);
    assert_eq!(sample[7..], [-0.426_946_282_847_032_23, -0.069_619_550_337_053_6]);
}
