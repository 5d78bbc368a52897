//! What there is to compare: settings, runs and their measures, from the folder of a sweep or from run folders.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use scrnn_run::experiment::differences;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::history;
use scrnn_run::notes::{HeldOutScore, Notes};
use scrnn_run::run_folder::{BEST, CHECKPOINT, HISTORY};
use scrnn_run::trained::{Trained, read_checkpoint};
use serde_json::Value;

use crate::measures::{self, Better, MEASURES, Measure};
use crate::outcome::{self, FAILED, Failed, OUTCOME, Outcome};
use crate::plan::{Listed, PLAN, shown};

/// All of it.
#[derive(Debug, Clone)]
pub struct Collected {
    /// Its name.
    pub name: String,
    /// The keys that differ between settings, dotted.
    pub knobs: Vec<String>,
    /// Name and values of each setting.
    pub settings: Vec<(String, Vec<Value>)>,
    /// Whether settings have names that no knob tells.
    pub has_conditions: bool,
    /// The runs, setting after setting.
    pub runs: Vec<Row>,
    /// The measures that at least one run has, the deciding one first.
    pub measures: Vec<&'static Measure>,
}

/// A run.
#[derive(Debug, Clone)]
pub struct Row {
    /// As the page calls it.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
    /// Its page, as the way from the comparison's, where there is one.
    pub link: Option<String>,
    /// The place of its setting.
    pub setting: usize,
    /// Its seed.
    pub seed: u64,
    /// How it ended, or how far it is.
    pub state: &'static str,
    /// What there is to say of that.
    pub message: Option<String>,
    /// Whether it is finished, and has a network.
    pub is_whole: bool,
    /// Its numbers.
    pub measures: BTreeMap<String, f64>,
}

impl Row {
    /// The learning curve: epochs with nll, or with the logarithm of the squared error where there is no variance; and whether it is the
    /// nll. Empty where there is none.
    #[must_use]
    pub fn curve(&self) -> (Vec<(f64, f64)>, bool) {
        let rows = history::read(&self.path.join(HISTORY)).unwrap_or_default();
        let with_variance = rows.iter().all(|row| row.nll.is_some());
        let value = |row: &history::Row| if with_variance { row.nll.unwrap_or(f64::NAN) } else { row.mse.log10() };
        (rows.iter().map(|row| (row.epoch as f64, value(row))).collect(), with_variance)
    }
}

/// Gathers what is at `paths`; links start from `out`.
///
/// # Errors
/// [`Failure::Input`] for what is neither the folder of a sweep nor of a run.
pub fn collect(paths: &[&Path], out: &Path) -> Result<Collected> {
    let mut collected = match paths {
        [only] if only.join(PLAN).is_file() => of_sweep(only, out)?,
        [] => return Err(Failure::input("there is nothing to compare", "give a sweep's folder, or run folders")),
        several => {
            if let Some(sweep) = several.iter().find(|path| path.join(PLAN).is_file()) {
                let message =
                    format!("{} is the folder of a sweep, and {} paths are given", sweep.display(), several.len());
                return Err(Failure::input(message, "compare one sweep, or several runs"));
            }
            of_runs(several, out)?
        }
    };
    let there: BTreeSet<&str> = collected.runs.iter().flat_map(|run| run.measures.keys().map(String::as_str)).collect();
    let mut rest: Vec<&'static Measure> = MEASURES.iter().filter(|measure| there.contains(measure.key)).collect();
    // Those that are asked for come first, in their order.
    let asked: Vec<&'static Measure> =
        collected.measures.drain(..).filter(|measure| there.contains(measure.key)).collect();
    if asked.is_empty() {
        let decides = rest.iter().position(|measure| measure.better != Better::Neither).unwrap_or(0);
        if !rest.is_empty() {
            rest[..=decides].rotate_right(1);
        }
        collected.measures = rest;
    } else {
        collected.measures = asked;
    }
    Ok(collected)
}

fn of_sweep(folder: &Path, out: &Path) -> Result<Collected> {
    let listed = Listed::read(folder)?;
    let mut runs = Vec::with_capacity(listed.runs.len());
    for run in &listed.runs {
        let path = folder.join(&run.folder);
        let mut row = row(run.folder.clone(), path, out, (run.setting, run.seed));
        if let Some(outcome) = outcome::read::<Outcome>(&row.path, OUTCOME) {
            (row.state, row.is_whole) = (outcome.outcome.word(), outcome.outcome.is_whole());
            (row.message, row.measures) = (outcome.message, outcome.measures);
        } else if let Some(failed) = outcome::read::<Failed>(&row.path, FAILED) {
            (row.state, row.message) = ("failed", Some(failed.message));
        } else if row.path.join(CHECKPOINT).exists() {
            row.state = "not finished";
        }
        runs.push(row);
    }
    let measures = listed.measures.iter().filter_map(|key| measures::of(key).ok()).collect();
    Ok(Collected {
        name: listed.name,
        knobs: listed.knobs,
        has_conditions: listed.settings.iter().any(|setting| setting.condition.is_some()),
        settings: listed.settings.into_iter().map(|setting| (setting.name, setting.values)).collect(),
        runs,
        measures,
    })
}

fn row(name: String, path: PathBuf, out: &Path, (setting, seed): (usize, u64)) -> Row {
    let page = path.join(scrnn_report::PAGE);
    let link = page.is_file().then(|| way(out, &page)).flatten();
    Row {
        name,
        path,
        link,
        setting,
        seed,
        state: "not begun",
        message: None,
        is_whole: false,
        measures: BTreeMap::new(),
    }
}

/// The way from a folder to a file.
fn way(from: &Path, to: &Path) -> Option<String> {
    let (from, to) = (std::path::absolute(from).ok()?, std::path::absolute(to).ok()?);
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    Some(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// Runs of any origin: what differs between their experiments, but for seeds, makes their settings.
fn of_runs(paths: &[&Path], out: &Path) -> Result<Collected> {
    let mut found = Vec::new();
    for path in paths {
        let trained = Trained::open(path, false)?;
        let folder = if path.is_dir() { path.to_path_buf() } else { path.parent().unwrap_or(Path::new("")).to_owned() };
        let Some(notes) = trained.notes else {
            let message = format!("{} was not written by `scrnn train`", path.display());
            return Err(Failure::input(message, "give run folders, whose checkpoints say what was trained"));
        };
        found.push((folder, notes, trained.checkpoint.epoch));
    }
    let first = &found[0].1.experiment;
    let is_knob = |key: &str| {
        !matches!(key, "name" | "seed" | "data.seed" | "data.files" | "evaluation.every" | "training.epochs")
    };
    let knobs: BTreeSet<String> = (found.iter())
        .flat_map(|(_, notes, _)| differences(first, &notes.experiment))
        .map(|one| one.key)
        .filter(|key| is_knob(key))
        .collect();
    let knobs: Vec<String> = knobs.into_iter().collect();
    let value_of = |experiment: &Value, key: &str| {
        let none = Value::Null;
        let all = differences(&none, experiment);
        all.into_iter().find(|one| one.key == key).and_then(|one| one.new).unwrap_or(Value::Null)
    };
    let mut settings: Vec<(String, Vec<Value>)> = Vec::new();
    let mut runs = Vec::new();
    for (path, notes, epoch) in found {
        let values: Vec<Value> = knobs.iter().map(|key| value_of(&notes.experiment, key)).collect();
        let setting = settings.iter().position(|(_, other)| *other == values).unwrap_or_else(|| {
            let last = |key: &String| key.rsplit('.').next().unwrap_or(key).to_owned();
            let name = knobs.iter().zip(&values).map(|(key, value)| format!("{}={}", last(key), shown(value)));
            settings.push((name.collect::<Vec<_>>().join(","), values));
            settings.len() - 1
        });
        let seed = notes.experiment["seed"].as_u64().unwrap_or(0);
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let mut row = row(name, path, out, (setting, seed));
        row.measures = of_notes(&row.path, &notes, epoch);
        let epochs = notes.experiment["training"]["epochs"].as_u64();
        (row.is_whole, row.state) = (true, if epochs == Some(epoch) { "finished" } else { "not at its last epoch" });
        if let Some(outcome) = outcome::read::<Outcome>(&row.path, OUTCOME) {
            row.state = outcome.outcome.word();
            row.measures.extend(outcome.measures);
        }
        runs.push(row);
    }
    runs.sort_by_key(|run| (run.setting, run.seed));
    Ok(Collected { name: "runs".into(), knobs, settings, has_conditions: false, runs, measures: Vec::new() })
}

/// What a checkpoint and the best one note of themselves.
fn of_notes(folder: &Path, notes: &Notes, epoch: u64) -> BTreeMap<String, f64> {
    let mut numbers = BTreeMap::new();
    let mut number = |key: &str, value: Option<f64>| {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            numbers.insert(key.to_owned(), value);
        }
    };
    number("epoch", Some(epoch as f64));
    number("nll", notes.score.and_then(|score| score.nll));
    number("mse", notes.score.map(|score| score.mse));
    let of_best = || read_checkpoint(&folder.join(BEST)).ok().and_then(|best| Notes::of(&best)?.best);
    if let Some(best) = notes.best.or_else(of_best) {
        number("best.epoch", Some(best.epoch as f64));
        number("best.nll", best.nll);
        number("best.mse", Some(best.mse));
        if let Some(HeldOutScore { nll, mse }) = best.held_out {
            number("held_out.nll", nll);
            number("held_out.mse", Some(mse));
        }
    }
    numbers
}

impl Collected {
    /// The runs of a setting.
    pub fn of(&self, setting: usize) -> impl Iterator<Item = &Row> {
        self.runs.iter().filter(move |run| run.setting == setting)
    }

    /// A measure of the runs of a setting that are finished.
    #[must_use]
    pub fn values(&self, setting: usize, measure: &Measure) -> Vec<f64> {
        self.of(setting).filter(|run| run.is_whole).filter_map(|run| run.measures.get(measure.key).copied()).collect()
    }

    /// As the page calls a setting.
    #[must_use]
    pub fn called(&self, setting: usize) -> &str {
        match self.settings[setting].0.as_str() {
            "" => "as it is",
            name => name,
        }
    }

    /// A row for each run: where it lies, its setting, every knob, its seed, how it ended, every measure.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut keys: Vec<&str> = self.runs.iter().flat_map(|run| run.measures.keys().map(String::as_str)).collect();
        keys.sort_by_key(|key| (measures::place(key), *key));
        keys.dedup();
        let mut text = String::new();
        let mut line = |cells: &mut dyn Iterator<Item = String>| {
            text += &cells.map(|cell| field(&cell)).collect::<Vec<_>>().join(",");
            text.push('\n');
        };
        let head = ["run", "setting"].into_iter().chain(self.knobs.iter().map(String::as_str));
        line(&mut head.chain(["seed", "outcome"]).chain(keys.iter().copied()).map(str::to_owned));
        for run in &self.runs {
            let (name, values) = &self.settings[run.setting];
            let numbers =
                keys.iter().map(|key| run.measures.get(*key).map_or(String::new(), |value| format!("{value:?}")));
            let words = [run.name.clone(), name.clone()].into_iter().chain(values.iter().map(shown));
            line(&mut words.chain([run.seed.to_string(), run.state.to_owned()]).chain(numbers));
        }
        text
    }
}

/// A text as a field of a CSV file. What a spreadsheet would take for a formula, and run, gets a mark.
fn field(text: &str) -> String {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err();
    let text = format!("{}{text}", if formula { "'" } else { "" });
    match text.contains([',', '"', '\n', '\'', '\r', '\t']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_and_no_formulas() {
        for (text, expected) in [("a,b", "\"a,b\""), ("=1+1", "\"'=1+1\""), ("-1.5", "-1.5"), ("x\"y", "\"x\"\"y\"")] {
            assert_eq!(field(text), expected);
        }
    }

    #[test]
    fn links_lead_from_the_page_to_a_run() {
        let from = |from: &str, to: &str| way(Path::new(from), Path::new(to)).unwrap();
        assert_eq!(from("/a/s", "/a/s/x=1/seed-1/report.html"), "x=1/seed-1/report.html");
        assert_eq!(from("/a/out", "/a/runs/r/report.html"), "../runs/r/report.html");
    }
}
