//! Training: from settings and samples to a model, by the same way as the program.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::learning::Outcome;
use scrnn_data::Field;
use scrnn_run::experiment::{Experiment, Override};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_run::members::{self, train_members};
use scrnn_run::request::{self, Asked, Request};
use scrnn_run::run_folder::CHECKPOINT;
use scrnn_run::source::{self, Source};
use scrnn_run::training::{Found, train_on};
use scrnn_run::verdict::Verdict;

use crate::arrays::Given;
use crate::failure::{compute, raise};
use crate::machine::{News, attended, engine, watched};
use crate::model::{DATA, Model};
use crate::texts::{json_of, toml_of};

/// Where a training writes, and what it does about a run that is there.
struct Place {
    folder: PathBuf,
    found: Found,
}

/// How a training ended.
struct Ended {
    outcome: &'static str,
    /// What went wrong, where it diverged.
    message: String,
    epoch: u64,
    /// The verdict in words and as JSON; empty where a person stopped it.
    words: String,
    json: String,
}

/// What to do about a run that is there, by its word.
fn found(word: &str) -> PyResult<Found> {
    match word {
        "refuse" => Ok(Found::Refuse),
        "resume" => Ok(Found::GoOn),
        "overwrite" => Ok(Found::Overwrite),
        other => Err(raise(Failure::input(format!("there is no way called {other}"), ""))),
    }
}

/// Trains one network or the members of a mixture.
fn train(
    (experiment, source): (&Experiment, Option<Source>),
    place: &Place,
    (engine, interrupt): (&Engine, &Interrupt),
    news: &News,
) -> Result<Ended> {
    let (folder, found) = (place.folder.as_path(), place.found);
    if experiment.training.members.is_some_and(|members| members > 1) {
        let progress = |label: &str, total: u64| news.training(label, total);
        let machine = (engine.threads(), engine.instruction_set(), interrupt);
        let verdict = train_members(experiment, (folder, found), machine, &progress, news)?;
        let outcome = match (verdict.interrupted(), verdict.diverged()) {
            (true, _) => "interrupted",
            (_, true) => "diverged",
            _ => "finished",
        };
        let epoch = verdict.members.iter().map(|member| member.epoch).max().unwrap_or(0);
        let message = "a member of the mixture left the finite numbers; its last good state is saved".to_owned();
        return Ok(Ended { outcome, message, epoch, words: verdict.to_string(), json: json_of(&verdict)? });
    }
    if !members::folders(folder).is_empty() {
        let message = format!("{} holds a mixture of networks", folder.display());
        return Err(Failure::refused(message, "--out RUN writes elsewhere; or set training.members"));
    }
    let source = match source {
        Some(source) => source,
        None => source::load(&experiment.data, engine.threads())?,
    };
    let progress = news.training("", experiment.training.epochs);
    let training = train_on(experiment, source, (folder, found), (engine, interrupt), progress, news)?;
    let epoch = training.learner.epoch();
    let (outcome, message) = match &training.outcome {
        Outcome::Finished => ("finished", String::new()),
        Outcome::Stopped if training.out_of_patience => ("out of patience", String::new()),
        Outcome::Stopped => ("interrupted", String::new()),
        Outcome::Diverged(divergence) => (
            "diverged",
            format!(
                "{divergence}; the last good state is kept\nTrain anew with a smaller rate, a variance_floor above 0 or, with adam, a \
                 smaller clip_norm."
            ),
        ),
    };
    let (mut words, mut text) = (String::new(), "null".to_owned());
    // Nobody waits for a verdict who wants to stop.
    if outcome != "interrupted" {
        let verdict = Verdict::new(&training, engine)?;
        (words, text) = (verdict.to_string(), json_of(&verdict)?);
    }
    Ok(Ended { outcome, message, epoch, words, json: text })
}

/// How a training ended, and what it made.
type Trained<'py> = (Model, Bound<'py, PyDict>, Option<Py<PyAny>>);

/// What Python gets of a training: the model, how it ended, and the exception of a signal that came.
fn answer<'py>(
    py: Python<'py>,
    folder: &Path,
    data: Option<Dataset>,
    (ended, signal): (Ended, Option<PyErr>),
) -> PyResult<Trained<'py>> {
    let model = compute(py, || Model::read(folder, false, data))?;
    let told = PyDict::new(py);
    told.set_item("outcome", ended.outcome)?;
    told.set_item("message", crate::failure::in_python(&ended.message))?;
    told.set_item("epoch", ended.epoch)?;
    told.set_item("words", crate::failure::in_python(&ended.words))?;
    told.set_item("json", ended.json)?;
    let signal = signal.map(|error| error.into_value(py).into_any());
    Ok((model, told, signal))
}

/// Trains by settings in the form of an experiment, as JSON, on samples at hand or on files that the settings name.
#[pyfunction]
#[pyo3(signature = (settings, folder, way, *, samples=None, kept=None, keep=false, threads=0, instruction_set=None, show=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn fit<'py>(
    py: Python<'py>,
    settings: &str,
    folder: PathBuf,
    way: &str,
    samples: Option<Given<'py>>,
    kept: Option<Py<Model>>,
    keep: bool,
    threads: usize,
    instruction_set: Option<&str>,
    show: Option<Py<PyAny>>,
    say: Option<Py<PyAny>>,
) -> PyResult<Trained<'py>> {
    let data = match (samples, &kept) {
        (Some(samples), _) => Some(samples.dataset()?),
        (None, Some(model)) => model.get().data.clone(),
        (None, None) => None,
    };
    let place = Place { folder, found: found(way)? };
    let (interrupt, news) = (Interrupt::new(), News::new(show, say));
    let ended = attended(py, (&interrupt, &news), || {
        let engine = engine(threads, instruction_set)?;
        let text = toml_of(settings)?;
        let (experiment, source) = request::of_text(crate::failure::SETTINGS, &text, Path::new(""), data.clone())?;
        if let (true, Some(data)) = (keep, &data) {
            std::fs::create_dir_all(&place.folder)
                .map_err(|error| Failure::disk("make the folder", &place.folder, error))?;
            let there = place.folder.join(CHECKPOINT).exists() || !members::folders(&place.folder).is_empty();
            // What refuses to write over a run must not write over its samples before.
            if !there || place.found == Found::Overwrite {
                scrnn_data::write(&place.folder.join(DATA), &[Field { name: "", data }])?;
            }
        }
        train((&experiment, Some(source)), &place, (&engine, &interrupt), &news)
    })?;
    answer(py, &place.folder, data, ended)
}

/// As `scrnn train`: paths are an experiment file, data files, or with `resume` a run folder.
#[pyfunction]
#[pyo3(signature = (paths, *, out=None, way="refuse", settings=vec![], threads=0, instruction_set=None, show=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn train_paths<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    out: Option<PathBuf>,
    way: &str,
    settings: Vec<String>,
    threads: usize,
    instruction_set: Option<&str>,
    show: Option<Py<PyAny>>,
    say: Option<Py<PyAny>>,
) -> PyResult<Trained<'py>> {
    let found = found(way)?;
    let (interrupt, news) = (Interrupt::new(), News::new(show, say));
    let overrides = settings.iter().map(|text| text.parse::<Override>());
    let overrides = overrides.collect::<std::result::Result<Vec<_>, String>>();
    let overrides = overrides.map_err(|message| raise(Failure::input(message, "")))?;
    let resume = found == Found::GoOn;
    let asked = watched(py, &news, || Request::of(&paths, resume)?.experiment(&overrides, out.as_deref(), resume))?;
    let Asked { experiment, source, folder } = asked;
    let place = Place { folder, found };
    let ended = attended(py, (&interrupt, &news), || {
        let engine = engine(threads, instruction_set)?;
        train((&experiment, source), &place, (&engine, &interrupt), &news)
    })?;
    answer(py, &place.folder, None, ended)
}
