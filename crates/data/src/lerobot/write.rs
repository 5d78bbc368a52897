//! Writes LeRobot data sets of version 3.0.
//!
//! ```text
//! meta/info.json, meta/stats.json, meta/tasks.parquet
//! meta/episodes/chunk-000/file-000.parquet     where the frames of each episode are
//! data/chunk-000/file-000.parquet              the frames, a group of rows for each episode
//! meta/sequences.json                          names of the episodes, which LeRobot does not read
//! ```
//!
//! Channels called `observation.state.X` and `action.X` become these features; all are `observation.state` where no
//! channel is called so. Floats have 32 bits where all values fit in them, as LeRobot's own, else 64.

use scrnn::dataset::{Dataset, Sequence};
use serde_json::{Value, json};

use super::info;
use crate::FileError;
use crate::parquet::write::{Column, File, Type, Values};

/// Bytes of a data file from which on another is begun.
const LARGEST_FILE: usize = 100 << 20;
/// Files in a folder.
const FILES_IN_CHUNK: usize = 1000;
/// Values in a page at most: its bytes are counted in 32 bits.
const MOST_VALUES: usize = 1 << 25;
/// Where the names of sequences are.
pub const NAMES: &str = "meta/sequences.json";
const MAIN: [&str; 2] = ["observation.state", "action"];

/// A feature: its name, the columns of the data that it takes, and what these are called.
struct Feature {
    name: String,
    columns: Vec<usize>,
    names: Vec<String>,
}

impl Feature {
    /// The features that channels of these names make.
    fn of(channels: &[String]) -> Vec<Self> {
        let parts: Option<Vec<(&str, &str)>> = channels.iter().map(|name| main_part(name)).collect();
        let parts = parts.unwrap_or_else(|| channels.iter().map(|name| (MAIN[0], name.as_str())).collect());
        let feature = |main: &str| {
            let here = || parts.iter().enumerate().filter(|(_, (feature, _))| *feature == main);
            let columns = here().map(|(column, _)| column).collect();
            let names = here().map(|(_, (_, name))| (*name).to_owned()).collect();
            Self { name: main.to_owned(), columns, names }
        };
        MAIN.iter().map(|main| feature(main)).filter(|feature| !feature.columns.is_empty()).collect()
    }

    /// The feature's values in rows of a sequence.
    fn values(&self, sequence: &Sequence, rows: std::ops::Range<usize>) -> Vec<f64> {
        rows.flat_map(|row| self.columns.iter().map(move |&column| sequence.sample(row)[column])).collect()
    }
}

/// The main feature that a channel's name begins with, and the rest of the name.
fn main_part(name: &str) -> Option<(&'static str, &str)> {
    MAIN.into_iter().find_map(|main| {
        let rest = name.strip_prefix(main)?;
        if rest.is_empty() { Some((main, name)) } else { Some((main, rest.strip_prefix('.')?)) }
    })
}

/// Files of a data set: their paths within its folder, with slashes, and their bytes.
pub type Files = Vec<(String, Vec<u8>)>;

/// The files of a data set of these sequences, `period` seconds between samples.
///
/// # Errors
/// [`FileError::NoPeriod`] if nobody knows the period.
pub fn files(path: &str, data: &Dataset, period: Option<f64>, task: &str) -> Result<Files, FileError> {
    let period = period.filter(|period| period.is_finite() && *period > 0.0);
    let period = period.ok_or_else(|| FileError::NoPeriod { path: path.to_owned() })?;
    let features = Feature::of(data.channels());
    let exact =
        |sequence: &Sequence| sequence.values().iter().all(|&value| value.is_nan() || f64::from(value as f32) == value);
    let short = data.sequences().iter().all(exact);
    let mut files = Vec::new();
    let mut episodes = Episodes::default();
    let mut writer = None;
    let mut number = 0;
    for (episode, sequence) in data.sequences().iter().enumerate() {
        let file = writer.get_or_insert_with(|| File::new(columns(&features, short)));
        episodes.push(sequence.len(), number);
        write_episode(file, &features, sequence, episode, episodes.from[episode], period);
        let last = episode + 1 == data.sequences().len();
        if (last || file.size() >= LARGEST_FILE)
            && let Some(file) = writer.take()
        {
            files.push((place("data", number), file.finish(&[])));
            number += 1;
        }
    }
    files.push((place("meta/episodes", 0), episodes.file(task)));
    files.push(("meta/tasks.parquet".to_owned(), tasks(task)));
    files.push((info::PLACE.to_owned(), pretty(&about(data, &features, period, short, &episodes))));
    files.push(("meta/stats.json".to_owned(), pretty(&statistics(data, &features, period))));
    // Their own files have no place for names.
    let names: Vec<&str> = data.sequences().iter().map(|sequence| sequence.name.as_str()).collect();
    files.push((NAMES.to_owned(), pretty(&json!(names))));
    Ok(files)
}

fn place(folder: &str, number: usize) -> String {
    format!("{folder}/chunk-{:03}/file-{:03}.parquet", number / FILES_IN_CHUNK, number % FILES_IN_CHUNK)
}

fn pretty(value: &Value) -> Vec<u8> {
    format!("{value:#}\n").into_bytes()
}

fn columns(features: &[Feature], short: bool) -> Vec<Column> {
    let float = |width| if short { Type::Float(width) } else { Type::Double(width) };
    let named = features.iter().map(|feature| (feature.name.as_str(), float(feature.columns.len())));
    let counted = ["frame_index", "episode_index", "index", "task_index"].map(|name| (name, Type::Int64));
    let all = named.chain([("timestamp", Type::Float(1))]).chain(counted);
    all.map(|(name, of)| Column { name: name.to_owned(), of }).collect()
}

fn write_episode(file: &mut File, features: &[Feature], sequence: &Sequence, episode: usize, from: usize, period: f64) {
    let mut begin = 0;
    let most = (MOST_VALUES / features.iter().map(|feature| feature.columns.len()).max().unwrap_or(1)).max(1);
    while begin < sequence.len() {
        let rows = begin..sequence.len().min(begin + most);
        begin = rows.end;
        let values: Vec<Vec<f64>> = features.iter().map(|feature| feature.values(sequence, rows.clone())).collect();
        let times: Vec<f64> = rows.clone().map(|row| row as f64 * period).collect();
        let whole = |value: &dyn Fn(usize) -> usize| rows.clone().map(|row| value(row) as i64).collect::<Vec<i64>>();
        let counted = [whole(&|row| row), whole(&|_| episode), whole(&|row| from + row), whole(&|_| 0)];
        let columns: Vec<Values<'_>> = values
            .iter()
            .chain([&times])
            .map(|values| Values::Floats(values))
            .chain(counted.iter().map(|values| Values::Whole(values)))
            .collect();
        file.group(rows.len(), &columns);
    }
}

/// Where episodes are.
#[derive(Default)]
struct Episodes {
    lengths: Vec<usize>,
    from: Vec<usize>,
    files: Vec<usize>,
}

impl Episodes {
    fn push(&mut self, length: usize, file: usize) {
        self.from.push(self.frames());
        self.lengths.push(length);
        self.files.push(file);
    }

    fn frames(&self) -> usize {
        self.lengths.iter().sum()
    }

    fn file(&self, task: &str) -> Vec<u8> {
        let names = [
            "episode_index",
            "length",
            "data/chunk_index",
            "data/file_index",
            "dataset_from_index",
            "dataset_to_index",
            "meta/episodes/chunk_index",
            "meta/episodes/file_index",
        ];
        let mut columns: Vec<Column> =
            names.iter().map(|name| Column { name: (*name).to_owned(), of: Type::Int64 }).collect();
        columns.insert(1, Column { name: "tasks".to_owned(), of: Type::Texts });
        let each =
            |value: &dyn Fn(usize) -> usize| (0..self.lengths.len()).map(|e| value(e) as i64).collect::<Vec<i64>>();
        let numbers = [
            each(&|e| e),
            each(&|e| self.lengths[e]),
            each(&|e| self.files[e] / FILES_IN_CHUNK),
            each(&|e| self.files[e] % FILES_IN_CHUNK),
            each(&|e| self.from[e]),
            each(&|e| self.from[e] + self.lengths[e]),
            each(&|_| 0),
            each(&|_| 0),
        ];
        let tasks = vec![task; self.lengths.len()];
        let mut values: Vec<Values<'_>> = numbers.iter().map(|numbers| Values::Whole(numbers)).collect();
        values.insert(1, Values::Text(&tasks));
        let mut file = File::new(columns);
        file.group(self.lengths.len(), &values);
        file.finish(&[])
    }
}

/// The table of tasks: one, in the index that pandas makes of it.
fn tasks(task: &str) -> Vec<u8> {
    let column = |name: &str, kind: &str, numpy: &str| json!({ "name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": null });
    let pandas = json!({
        "index_columns": ["task"],
        "column_indexes": [{ "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object", "metadata": { "encoding": "UTF-8" } }],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "creator": { "library": "pyarrow", "version": "20.0.0" },
        "pandas_version": "2.2.0",
    });
    let mut file = File::new(vec![
        Column { name: "task_index".to_owned(), of: Type::Int64 },
        Column { name: "task".to_owned(), of: Type::Text },
    ]);
    file.group(1, &[Values::Whole(&[0]), Values::Text(&[task])]);
    file.finish(&[("pandas", &pandas.to_string())])
}

/// meta/info.json.
fn about(data: &Dataset, features: &[Feature], period: f64, short: bool, episodes: &Episodes) -> Value {
    let rate = 1.0 / period;
    let whole = rate.round();
    let fps = if (rate - whole).abs() < 1e-6 * rate && whole >= 1.0 { json!(whole as u64) } else { json!(rate) };
    let kind = if short { "float32" } else { "float64" };
    let mut described = serde_json::Map::new();
    for feature in features {
        let value = json!({ "dtype": kind, "shape": [feature.columns.len()], "names": feature.names });
        described.insert(feature.name.clone(), value);
    }
    for (name, kind) in [
        ("timestamp", "float32"),
        ("frame_index", "int64"),
        ("episode_index", "int64"),
        ("index", "int64"),
        ("task_index", "int64"),
    ] {
        described.insert(name.to_owned(), json!({ "dtype": kind, "shape": [1], "names": null }));
    }
    let count = data.sequences().len();
    json!({
        "codebase_version": "v3.0",
        "robot_type": null,
        "total_episodes": count,
        "total_frames": episodes.frames(),
        "total_tasks": 1,
        "chunks_size": FILES_IN_CHUNK,
        "data_files_size_in_mb": LARGEST_FILE >> 20,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": { "train": format!("0:{count}") },
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": null,
        "features": described,
    })
}

/// meta/stats.json: least, greatest, mean, standard deviation and count of each feature.
fn statistics(data: &Dataset, features: &[Feature], period: f64) -> Value {
    let mut all = serde_json::Map::new();
    for feature in features {
        let columns = feature.columns.iter().map(|&column| {
            let values =
                data.sequences().iter().flat_map(move |one| (0..one.len()).map(move |row| one.sample(row)[column]));
            Statistics::of(values)
        });
        all.insert(feature.name.clone(), Statistics::json(&columns.collect::<Vec<_>>()));
    }
    let rows = || data.sequences().iter().enumerate().flat_map(|(e, one)| (0..one.len()).map(move |row| (e, row)));
    let one = |values: &mut dyn Iterator<Item = f64>| Statistics::json(&[Statistics::of(values)]);
    all.insert("timestamp".to_owned(), one(&mut rows().map(|(_, row)| row as f64 * period)));
    all.insert("frame_index".to_owned(), one(&mut rows().map(|(_, row)| row as f64)));
    all.insert("episode_index".to_owned(), one(&mut rows().map(|(e, _)| e as f64)));
    all.insert("index".to_owned(), one(&mut rows().enumerate().map(|(index, _)| index as f64)));
    all.insert("task_index".to_owned(), one(&mut rows().map(|_| 0.0)));
    Value::Object(all)
}

struct Statistics {
    least: f64,
    greatest: f64,
    mean: f64,
    deviation: f64,
    count: usize,
}

impl Statistics {
    /// By Welford's recurrence; missing values are passed over.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut all = Self { least: f64::INFINITY, greatest: f64::NEG_INFINITY, mean: 0.0, deviation: 0.0, count: 0 };
        let mut squares = 0.0;
        for value in values.filter(|value| !value.is_nan()) {
            all.count += 1;
            (all.least, all.greatest) = (all.least.min(value), all.greatest.max(value));
            let before = value - all.mean;
            all.mean += before / all.count as f64;
            squares += before * (value - all.mean);
        }
        all.deviation = (squares / all.count.max(1) as f64).sqrt();
        all
    }

    fn json(all: &[Self]) -> Value {
        let each = |value: fn(&Self) -> f64| all.iter().map(value).collect::<Vec<f64>>();
        json!({
            "min": each(|one| one.least),
            "max": each(|one| one.greatest),
            "mean": each(|one| one.mean),
            "std": each(|one| one.deviation),
            "count": [all.iter().map(|one| one.count).max().unwrap_or(0)],
        })
    }
}
