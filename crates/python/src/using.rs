//! Using a trained network: it generates, goes on from recordings, and recognises.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use scrnn::dataset::{Dataset, Sequence};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::generating::{From, Generating, Onward, State, generating, onward};
use scrnn_run::recognising::{Found, Recognising, recognising};

use crate::arrays::{self, Given, fields, rows};
use crate::machine::{News, engine, told, watched};
use crate::model::Model;

/// Where generation starts, as Python says it.
#[derive(FromPyObject)]
pub enum Begin {
    /// "learned" or "mean".
    Word(String),
    /// The states in the rows of an array, with their names.
    States(Vec<String>, Vec<Vec<f64>>),
}

/// Lets a network run. `sequence` names a learned one; `sensed` is the recorded sample's share of the input.
#[pyfunction]
#[pyo3(signature = (model, *, begin, sequence=None, sensed=0.0, open_channels=vec![], noise=true, steps=None, samples=1, seed=1,
    contexts=false, data=None, threads=0, instruction_set=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn generate<'py>(
    py: Python<'py>,
    model: &Model,
    begin: Begin,
    sequence: Option<String>,
    sensed: f64,
    open_channels: Vec<String>,
    noise: bool,
    steps: Option<usize>,
    samples: usize,
    seed: u64,
    contexts: bool,
    data: Option<Given<'py>>,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let given = data.map(|data| data.dataset()).transpose()?;
    let news = News::new(None, say);
    let generated = told(py, &news, || {
        let engine = engine(threads, instruction_set)?;
        let trained = model.first()?;
        let from = match (sequence, begin) {
            (Some(wanted), _) => From::Sequence(wanted),
            (None, Begin::Word(word)) if word == "mean" => From::Mean,
            (None, Begin::Word(_)) => From::Learned,
            (None, Begin::States(names, states)) => {
                let needed = trained.checkpoint.topology.context_units();
                if let Some(other) = states.iter().find(|state| state.len() != needed) {
                    let message =
                        format!("an initial state has {} values, the network {needed} context units", other.len());
                    return Err(Failure::input(message, "recognize gives such states"));
                }
                From::Given(names.into_iter().zip(states).map(|(name, values)| State::new(name, values)).collect())
            }
        };
        let data = match given {
            Some(data) => Some(model.fitted(data, "the data", &news)?),
            None if sensed > 0.0 || !open_channels.is_empty() => learned(model, &from, engine.threads())?,
            None => None,
        };
        let options = Generating::with(|it| {
            (it.from, it.sensed, it.open_channels, it.noise) = (from, sensed, open_channels, noise);
            (it.steps, it.samples, it.seed, it.contexts, it.data) = (steps, samples, seed, contexts, data);
        });
        generating(&model.all, &options, &engine)
    })?;
    fields(py, &generated)
}

/// What was learned, where it is at hand and no file has it: of the sequence that generation starts from, if it does from one.
fn learned(model: &Model, from: &From, threads: usize) -> Result<Option<Dataset>> {
    if model.data.is_none() {
        return Ok(None);
    }
    let data = model.source(threads)?.data;
    let From::Sequence(wanted) = from else { return Ok(Some(data)) };
    let one: Sequence = data.sequences()[model.first()?.sequence(wanted)?].clone();
    Ok(Some(Dataset::new(data.channels().to_vec(), vec![one])?))
}

/// How recordings go on after their first `observed` samples.
#[pyfunction]
#[pyo3(signature = (model, data, *, observed=None, steps=None, samples=1, seed=1, threads=0, instruction_set=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn go_on<'py>(
    py: Python<'py>,
    model: &Model,
    data: Given<'py>,
    observed: Option<usize>,
    steps: Option<usize>,
    samples: usize,
    seed: u64,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (data, news) = (data.dataset()?, News::new(None, say));
    let generated = watched(py, &news, || {
        let data = model.fitted(data, "the data", &news)?;
        let options = Onward { observed, steps, samples, seed };
        onward(&model.all, &data, options, &engine(threads, instruction_set)?)
    })?;
    fields(py, &generated)
}

/// The initial states that explain sequences best, and what follows them.
#[pyfunction]
#[pyo3(signature = (model, data, *, starts=20, epochs=300, seed=1, observed=None, samples=None, rate=None, threads=0,
    instruction_set=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn recognize<'py>(
    py: Python<'py>,
    model: &Model,
    data: Given<'py>,
    starts: usize,
    epochs: u64,
    seed: u64,
    observed: Option<usize>,
    samples: Option<usize>,
    rate: Option<f64>,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let (data, news) = (data.dataset()?, News::new(None, say));
    let (found, completed, by_likeness) = watched(py, &news, || {
        let data = model.fitted(data, "the data", &news)?;
        let options = Recognising::with(|it| {
            (it.starts, it.epochs, it.seed, it.observed, it.samples) = (starts, epochs, seed, observed, samples);
            it.rate = rate;
        });
        let found = recognising(&model.all, &data, &options, (&engine(threads, instruction_set)?, &news))?;
        let completed = match observed.is_some() && samples.is_none() {
            true => found.completed()?.into_iter().next().map(|(_, data)| data),
            false => None,
        };
        Ok((found.sequences, completed, found.by_likeness))
    })?;
    let n = model.first().map_err(crate::failure::raise)?.checkpoint.channels.len();
    let heard = observed.unwrap_or(usize::MAX);
    let list = PyList::empty(py);
    for (s, one) in found.iter().enumerate() {
        let rest = completed.as_ref().map(|data| {
            let values = data.sequences()[s].values();
            values[heard.min(data.sequences()[s].len()) * n..].to_vec()
        });
        list.append(recognised(py, one, rest, (n, by_likeness))?)?;
    }
    Ok(list)
}

/// What was found for a sequence as a dict.
fn recognised<'py>(
    py: Python<'py>,
    found: &Found,
    rest: Option<Vec<f64>>,
    (n, by_likeness): (usize, bool),
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("sequence", &found.sequence)?;
    dict.set_item("start", &found.start)?;
    dict.set_item("log_likelihood", found.ln_likelihood)?;
    dict.set_item("error", found.error)?;
    dict.set_item("completion_error", found.completion_error)?;
    dict.set_item("initial_state", PyArray1::from_slice(py, &found.initial_state))?;
    dict.set_item("by_likeness", by_likeness)?;
    let learned = found.learned.iter();
    let learned: Vec<_> = learned.map(|one| (one.number, &one.sequence, one.ln_likelihood, one.distance)).collect();
    dict.set_item("ranking", learned)?;
    let trials: Vec<_> = found.trials.iter().map(|one| (&one.start, one.ln_likelihood)).collect();
    dict.set_item("trials", trials)?;
    if let Some(completion) = &found.completion {
        dict.set_item("mean", rows(py, &completion.mean, n)?)?;
        let variance = (!completion.variance.is_empty()).then(|| rows(py, &completion.variance, n)).transpose()?;
        dict.set_item("variance", variance)?;
        dict.set_item("samples", arrays::blocks(py, &completion.samples, n)?)?;
        dict.set_item("effective_states", completion.effective_states)?;
        dict.set_item("nll", completion.nll)?;
        dict.set_item("within_one", completion.within_one)?;
        dict.set_item("within_two", completion.within_two)?;
    } else if let Some(rest) = rest {
        dict.set_item("mean", arrays::matrix(py, rest, n)?)?;
    }
    Ok(dict)
}
