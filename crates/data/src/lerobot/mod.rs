//! LeRobot data sets (v2.0, v2.1, v3.0), and other parquet tables.
//!
//! ```text
//! meta/info.json                          fps, and for each feature its type, shape and names
//! data/chunk-000/file-000.parquet         v3: many episodes in a file
//! data/chunk-000/episode_000000.parquet   v2: one
//! ```
//!
//! An episode is a sequence. `observation.state` and `action` are taken unless others are asked for; the channel
//! `shoulder` of `observation.state` is called `observation.state.shoulder`. What counts episodes, frames and tasks, and
//! the clock, are no channels. A single parquet file is read alike; its data set's info.json is used if it stands where
//! it belongs.

use std::path::{Path, PathBuf};

use crate::budget::Budget;
use crate::parquet::Parquet;
use crate::problem::FormatProblem;
use crate::reading::Facts;
use crate::samples::Samples;
use crate::source::{Source, read_bytes};
use crate::windows::Windows;
use crate::{FileError, Remark, Selection, natural};

mod episodes;
mod info;
mod plan;
pub mod write;

use episodes::Episodes;
use info::Info;
use plan::Plan;

/// Folders in the data folder that are looked through.
const DEEPEST: usize = 3;

/// Whether a folder is a data set.
pub fn is_folder(path: &Path) -> bool {
    path.join(info::PLACE).is_file() && path.join("data").is_dir()
}

/// Reads a data set, or a single file.
///
/// # Errors
/// [`FileError`].
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let path = source.path();
    if path.is_dir() {
        let info = info_of(path)?;
        let mut files = Vec::new();
        parquet_files(&path.join("data"), DEEPEST, &mut files)?;
        files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
        let mut reading = Reading::new(info, selection);
        for file in &files {
            let source = Source::at(file)?;
            reading.take(&source)?;
        }
        let mut samples = reading.finish(source.name())?;
        if let Some(names) = names(path, samples.tracks.len()) {
            samples.tracks.iter_mut().zip(names).for_each(|(track, name)| track.name = name);
        }
        return Ok(samples);
    }
    // data/chunk-000/file-000.parquet in the data set's folder.
    let root = path.ancestors().nth(3).filter(|root| path.is_file() && root.join(info::PLACE).is_file());
    let mut reading = Reading::new(root.map(info_of).transpose()?.flatten(), selection);
    reading.take(source)?;
    reading.whole = false;
    reading.finish(source.name())
}

/// Most bytes of a list of names.
const LONGEST_NAMES: u64 = 1 << 26;

/// Names of so many episodes, if [`write`] left some.
fn names(root: &Path, count: usize) -> Option<Vec<String>> {
    let path = root.join(write::NAMES);
    let length = std::fs::metadata(&path).ok()?.len();
    let text = (length <= LONGEST_NAMES).then(|| std::fs::read(&path).ok()).flatten()?;
    let names: Vec<String> = serde_json::from_slice(&text).ok()?;
    (names.len() == count).then_some(names)
}

fn info_of(root: &Path) -> Result<Option<Info>, FileError> {
    let path = root.join(info::PLACE);
    let name = path.display().to_string();
    let text = String::from_utf8(read_bytes(&path)?)
        .map_err(|_| FileError::NotText { path: name.clone(), found: "holds bytes that are not UTF-8" })?;
    Budget::of_file(text.len() as u64)
        .take(text.len().saturating_mul(50))
        .map_err(FormatProblem::from)
        .and_then(|()| Info::parse(&text))
        .map(Some)
        .map_err(|problem| problem.at(&name))
}

fn parquet_files(folder: &Path, deeper: usize, into: &mut Vec<PathBuf>) -> Result<(), FileError> {
    let disk = |source| FileError::disk("read", folder, source);
    for entry in std::fs::read_dir(folder).map_err(disk)? {
        let path = entry.map_err(disk)?.path();
        if path.is_dir() && deeper > 1 {
            parquet_files(&path, deeper - 1, into)?;
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("parquet")) {
            into.push(path);
        }
    }
    Ok(())
}

/// What was read so far of a data set.
struct Reading<'a> {
    info: Option<Info>,
    selection: &'a Selection,
    plan: Option<Plan>,
    episodes: Episodes,
    files: Vec<String>,
    /// Whether all files of the data set are meant.
    whole: bool,
}

impl<'a> Reading<'a> {
    fn new(info: Option<Info>, selection: &'a Selection) -> Self {
        Self { info, selection, plan: None, episodes: Episodes::default(), files: Vec::new(), whole: true }
    }

    /// Reads one file.
    fn take(&mut self, source: &Source<'_>) -> Result<(), FileError> {
        let windows = Windows::of(source)?;
        let at = |problem: FormatProblem| windows.failure(source, problem);
        let file = Parquet::open(&windows, source.budget()).map_err(at)?;
        let plan = match &mut self.plan {
            Some(plan) => plan,
            none => none.insert(Plan::new(&file, self.info.as_ref(), self.selection, source)?),
        };
        self.files.push(source.name().to_owned());
        self.episodes.take(&file, plan, source.budget()).map_err(at)
    }

    fn finish(self, path: &str) -> Result<Samples, FileError> {
        let Some(plan) = self.plan else { return Err(FileError::Empty { path: path.to_owned() }) };
        let mut samples = Samples { period: plan.period, remarks: plan.remarks(), ..Samples::default() };
        let (found, frames) = self.episodes.counts(plan.channels.len());
        if let Some((episodes, all)) = self.info.as_ref().filter(|_| self.whole).and_then(Info::totals)
            && (episodes, all) != (found, frames)
        {
            let what = format!(
                "{} says {episodes} episodes of {all} frames in all; here are {found} of {frames} frames",
                info::PLACE
            );
            samples.remarks.push(Remark::Understood { what });
        }
        samples.tracks = self.episodes.tracks(&plan).map_err(|problem| problem.at(path))?;
        let format = if self.info.is_some() || plan.is_lerobot { "LeRobot data set" } else { "parquet table" };
        samples.facts = Facts {
            format: format.to_owned(),
            files: self.files,
            named: true,
            clock: plan.clock_name(),
            topics: plan.topics(frames),
            ..Facts::default()
        };
        samples.channels = plan.channels;
        Ok(samples)
    }
}

#[cfg(test)]
mod tests;
