//! Parquet files of other software, whole and damaged.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::*;
use crate::tests_random::damage;

const BUDGET: u64 = 16 << 20;

/// What tests/python/write_formats.py wrote with pyarrow. `SCRNN_FIXTURES` can name a folder with all that it writes.
pub fn fixture(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("SCRNN_FIXTURES").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures"));
    std::fs::read(folder.join(name)).unwrap()
}

fn budget(bytes: &[u8]) -> Budget {
    Budget::of_file(bytes.len() as u64)
}

/// All cells of a column in a group of rows.
pub fn cells(file: &Parquet<'_>, group: usize, leaf: usize, budget: &Budget) -> Result<Cells, FormatProblem> {
    let mut all = Cells::default();
    let before = budget.left();
    file.each(group, leaf, budget, &mut |first, cells| {
        assert_eq!((first, cells.ends.last()), (all.ends.len(), Some(&cells.values.len())));
        all.ends.extend(cells.ends.iter().map(|end| all.values.len() + end));
        all.values.extend(&cells.values);
        Ok(ControlFlow::Continue(()))
    })?;
    assert_eq!(budget.left(), before, "what was held is given back");
    Ok(all)
}

/// All rows of a column of a fixture.
fn column(name: &str, leaf: &str) -> Vec<Vec<f64>> {
    let bytes = fixture(&format!("parquet/{name}.parquet"));
    let (budget, windows) = (budget(&bytes), Windows::whole(bytes));
    let file = Parquet::open(&windows, &budget).unwrap();
    let leaf = file.leaf(leaf).unwrap_or_else(|| panic!("{name}: {leaf} in {:?}", file.leaves));
    let mut rows = Vec::new();
    for group in 0..file.groups() {
        let cells = cells(&file, group, leaf, &budget).unwrap_or_else(|error| panic!("{name}: {error}"));
        rows.extend((0..cells.ends.len()).map(|row| cells.row(row).to_vec()));
    }
    rows
}

/// The rows that the script's rule makes: three episodes of 10, 12 and 8 frames.
fn expected() -> Vec<Vec<f64>> {
    let rows =
        [10, 12, 8].into_iter().enumerate().flat_map(|(e, steps)| (0..steps).map(move |t| (e as f64, f64::from(t))));
    rows.map(|(e, t)| (0..3).map(|c| 16.0 * e + t / 4.0 + f64::from(c) / 32.0).collect()).collect()
}

#[test]
fn every_way_in_which_pyarrow_writes_is_read() {
    let mut names = vec!["snappy", "plain", "zstd", "v2", "v2_plain", "pages", "old", "split", "delta", "half"];
    if std::env::var_os("SCRNN_FIXTURES").is_some() {
        names.extend(["gzip", "lz4", "fixed", "double"]);
    }
    for name in names {
        let expected = expected();
        assert_eq!(column(name, "observation.state"), expected, "{name}");
        let action: Vec<Vec<f64>> = column(name, "action").iter().map(|row| row.iter().map(|x| -x).collect()).collect();
        assert_eq!(action, expected, "{name}");
        let episodes: Vec<Vec<f64>> =
            [10, 12, 8].iter().enumerate().flat_map(|(e, &n)| vec![vec![e as f64]; n]).collect();
        assert_eq!(column(name, "episode_index"), episodes, "{name}");
        let times: Vec<f64> = column(name, "timestamp").concat();
        assert_eq!(times[..3], [0.0, f64::from(0.02_f32), f64::from(0.04_f32)], "{name}");
    }
    let done = column("plain", "next.done").concat();
    assert_eq!(done.iter().sum::<f64>(), 3.0);
    assert_eq!((done[10], done[11]), (1.0, 0.0));
}

#[test]
fn missing_values_lists_and_elements_keep_their_places() {
    let rows = column("missing", "observation.state");
    assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3, 0, 0, 3, 3]);
    assert!(rows[1][2].is_nan());
    assert_eq!((rows[1][1], rows[5][2]), (0.25 + 1.0 / 32.0, 1.25 + 2.0 / 32.0));
    let reward = column("missing", "reward").concat();
    assert_eq!((reward[0], reward[2], reward[5]), (1.0, 3.0, 6.0));
    assert!([1, 3, 4].iter().all(|&row: &usize| reward[row].is_nan()));
    assert_eq!(column("missing", "episode_index").concat(), [0., 0., 0., 0., 1., 1.]);
    let bytes = fixture("parquet/missing.parquet");
    let windows = Windows::whole(&bytes);
    let file = Parquet::open(&windows, &budget(&bytes)).unwrap();
    let leaf = |name| &file.leaves[file.leaf(name).unwrap()];
    assert!(!leaf("task").is_numeric());
    assert_eq!((leaf("stamp").per_second, leaf("episode_index").unsigned), (Some(1e6), true));
    assert!(cells(&file, 0, file.leaf("task").unwrap(), &budget(&bytes)).is_err());
}

#[test]
fn what_is_no_parquet_file_is_told_apart() {
    let open = |bytes: &[u8]| Parquet::open(&Windows::whole(bytes), &budget(bytes)).map(|_| ()).unwrap_err();
    assert!(matches!(open(b"a,b\n1,2\n"), FormatProblem::NotThis { .. }));
    let pointer = open(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12\n");
    assert!(pointer.help().unwrap().contains("git lfs pull"), "{pointer}");
    let whole = fixture("parquet/snappy.parquet");
    assert!(open(&whole[..whole.len() - 9]).to_string().contains("cut off"));
}

/// Reads all numeric columns; whether all could be read.
fn read_all(bytes: &[u8]) -> bool {
    let budget = Budget::of(BUDGET);
    let windows = Windows::whole(bytes);
    let Ok(file) = Parquet::open(&windows, &budget) else { return false };
    let mut whole = true;
    for group in 0..file.groups() {
        for leaf in (0..file.leaves.len()).filter(|&leaf| file.leaves[leaf].is_numeric()) {
            whole &=
                cells(&file, group, leaf, &budget).is_ok_and(|cells| cells.ends.last() == Some(&cells.values.len()));
        }
    }
    whole
}

#[test]
fn damaged_bytes_never_panic() {
    for name in ["snappy", "zstd", "v2", "pages", "split", "delta", "missing", "old"] {
        let bytes = fixture(&format!("parquet/{name}.parquet"));
        assert!(read_all(&bytes), "{name}");
        damage(&bytes, 300, BUDGET, |bytes| {
            read_all(bytes);
        });
        assert!((0..bytes.len()).all(|length| !read_all(&bytes[..length])), "{name}");
    }
}
