//! Several files read as one data set. Channels are matched by their names; by their places only where a file has none.

use std::collections::BTreeSet;
use std::path::Path;

use scrnn::dataset::{Dataset, Sequence};

use crate::remark::Remark;
use crate::{ChannelsError, FileError, Reading, Selection, expand, inspect};

/// Reads all files that the patterns name ([`expand`]) as one data set. The first file's channels are needed in all
/// others, in any order. Sequences of several files are called `file/sequence`.
///
/// # Errors
/// [`FileError`], of the first file that cannot be read or does not go with the first: [`FileError::ChannelsDiffer`],
/// [`FileError::Times`] for another period.
pub fn read_all<P: AsRef<Path>>(patterns: &[P], selection: &Selection) -> Result<Reading, FileError> {
    let mut paths = Vec::new();
    for pattern in patterns {
        paths.extend(expand(pattern.as_ref())?);
    }
    let mut readings = Vec::with_capacity(paths.len());
    for path in &paths {
        readings.push((path.as_path(), inspect(path, selection)?));
    }
    join(readings, selection.ignores_time())
}

/// The readings of several files as one.
fn join(mut readings: Vec<(&Path, Reading)>, any_period: bool) -> Result<Reading, FileError> {
    if readings.len() == 1
        && let Some((_, only)) = readings.pop()
    {
        return Ok(only);
    }
    let named_first = readings.iter().position(|(_, reading)| reading.facts.named).unwrap_or(0);
    let Some((first, model)) = readings.get(named_first) else {
        return Err(FileError::Empty { path: "the list of files".to_owned() });
    };
    let channels = model.data.channels().to_vec();
    let (mut remarks, mut sequences, mut facts) = (Vec::new(), Vec::new(), model.facts.clone());
    facts.files.clear();
    facts.gaps.clear();
    let period = model.period;
    let stems = stems(readings.iter().map(|(path, _)| *path));
    for ((path, reading), stem) in readings.iter().zip(&stems) {
        let columns = columns(path, reading, first, &channels, model.facts.named, &mut remarks)?;
        if let (Some(a), Some(b)) = (period, reading.period)
            && !any_period
            && (a / b - 1.0).abs() > 0.1
        {
            return Err(FileError::Times {
                path: path.display().to_string(),
                sequence: reading.data.sequences()[0].name.clone(),
                found: format!("samples are {b} s apart, those of {} {a} s", first.display()),
                help: format!("`period = {}` brings all to even times", a.max(b)),
            });
        }
        for sequence in reading.data.sequences() {
            let name = format!("{stem}/{}", sequence.name);
            sequences.push(match &columns {
                None => {
                    // A clone shares the samples.
                    let mut sequence = sequence.clone();
                    sequence.name = name;
                    sequence
                }
                Some(columns) => {
                    let rows = sequence.values().chunks_exact(channels.len());
                    let values = rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect();
                    let sequence = Sequence::new(name, channels.len(), values);
                    sequence.map_err(|source| FileError::Data { path: path.display().to_string(), source })?
                }
            });
        }
        for remark in &reading.remarks {
            if !remarks.contains(remark) {
                remarks.push(remark.clone());
            }
        }
        facts.files.extend(reading.facts.files.iter().cloned());
        let gaps = reading.facts.gaps.iter().cloned();
        facts.gaps.extend(gaps.map(|gap| crate::Gap { sequence: format!("{stem}/{}", gap.sequence), ..gap }));
    }
    let data = Dataset::new(channels, sequences);
    let data = data.map_err(|source| FileError::Data { path: first.display().to_string(), source })?;
    Ok(Reading { data, period, remarks, facts })
}

/// Where the wanted channels are in a reading; None if they are in their places.
fn columns(
    path: &Path,
    reading: &Reading,
    first: &Path,
    channels: &[String],
    named: bool,
    remarks: &mut Vec<Remark>,
) -> Result<Option<Vec<usize>>, FileError> {
    let found = reading.data.channels();
    if found == channels {
        return Ok(None);
    }
    let differ = |help: String| {
        FileError::ChannelsDiffer(Box::new(ChannelsError {
            path: path.display().to_string(),
            found: found.join(", "),
            first: first.display().to_string(),
            needed: channels.join(", "),
            help,
        }))
    };
    if found.len() != channels.len() {
        return Err(differ(
            "files that are learned together need the same channels: `channels = [...]` names those to take".into(),
        ));
    }
    if !reading.facts.named && named {
        remarks.push(Remark::ByPlace { path: path.display().to_string(), channels: channels.join(", ") });
        return Ok(None);
    }
    let place = |name: &String| found.iter().position(|other| other == name);
    if let Some(columns) = channels.iter().map(place).collect::<Option<Vec<_>>>() {
        return Ok(Some(columns));
    }
    let plain = |name: &str| {
        let bare = name.split(['[', '(']).next().unwrap_or(name).trim();
        bare.to_lowercase()
    };
    let near: BTreeSet<_> = found.iter().map(|name| plain(name)).collect();
    Err(differ(if near == channels.iter().map(|name| plain(name)).collect() {
        "the names differ in capitals, spaces or units only: write them alike in all files".into()
    } else {
        "files that are learned together need the same channels, by the same names".into()
    }))
}

/// A name for each file: its stem, with as much of its folders as tells it from the others.
fn stems<'a>(paths: impl Iterator<Item = &'a Path>) -> Vec<String> {
    let paths: Vec<&Path> = paths.collect();
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let short: Vec<String> = paths.iter().map(|path| stem(path)).collect();
    let mut seen = BTreeSet::new();
    if short.iter().all(|stem| seen.insert(stem)) {
        return short;
    }
    let long = |path: &&Path| match path.parent().and_then(Path::file_name) {
        Some(folder) => format!("{}/{}", folder.to_string_lossy(), stem(path)),
        None => stem(path),
    };
    paths.iter().map(long).collect()
}
