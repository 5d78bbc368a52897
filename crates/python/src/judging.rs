//! How a network does on sequences that it did not learn.

use std::path::PathBuf;

use pyo3::prelude::*;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn_run::digest::digest;
use scrnn_run::evaluation::{Bench, Report, Search, SimpleModels};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::members;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;
use scrnn_run::variance_factor::VarianceFactor;

use crate::arrays::Given;
use crate::machine::{News, engine, told, watched};
use crate::model::Model;
use crate::texts::json_of;

/// What to judge by, and what was learned where that is known.
fn sequences(model: &Model, data: Option<Dataset>, news: &News, engine: &Engine) -> Result<(Dataset, Option<Source>)> {
    let source = model.source(engine.threads());
    match (data, source) {
        (Some(data), source) => Ok((model.fitted(data, "the data", news)?, source.ok())),
        (None, Ok(source)) => match &source.held_out {
            Some(held_out) => Ok((held_out.clone(), Some(source))),
            None => {
                let message = "the experiment holds no sequences out";
                Err(Failure::input(message, "give the sequences to judge by, or hold some out: fit(..., held_out=0.2)"))
            }
        },
        (None, Err(failure)) => Err(failure),
    }
}

/// The bench of these sequences, by the simple models of what was learned.
fn bench(
    model: &Model,
    (data, source): (&Dataset, Option<&Source>),
    (burn_in, observed, seed): (Option<f64>, Option<f64>, u64),
    engine: &Engine,
) -> Result<Bench> {
    let first = model.first()?;
    let (checkpoint, delay) = (&first.checkpoint, first.checkpoint.topology.delay());
    data.check_for(&checkpoint.topology)?;
    let scaled = checkpoint.scaling.apply(data)?;
    let learned = source.map(|source| checkpoint.scaling.apply(&source.data)).transpose()?;
    let models = SimpleModels::fit(learned.as_ref().unwrap_or(&scaled), delay);
    let evaluation = first.evaluation();
    let shares = (burn_in.unwrap_or(evaluation.burn_in), observed.unwrap_or(evaluation.observed));
    for (what, share) in [("burn_in", shares.0), ("observed", shares.1)] {
        if !(0.0..=0.99).contains(&share) {
            return Err(Failure::input(format!("{what} is {share}"), "give a share from 0 to 0.99"));
        }
    }
    Bench::new(scaled, models, shares, (delay, seed), engine)
}

/// nll and mean squared error one step ahead from the mean initial state, per step and channel, in scaled units.
#[pyfunction]
#[pyo3(signature = (model, data=None, *, burn_in=None, threads=0, instruction_set=None, say=None))]
pub fn score<'py>(
    py: Python<'py>,
    model: &Model,
    data: Option<Given<'py>>,
    burn_in: Option<f64>,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<(Option<f64>, f64)> {
    let (data, news) = (data.map(|data| data.dataset()).transpose()?, News::new(None, say));
    told(py, &news, || {
        let engine = engine(threads, instruction_set)?;
        let (data, source) = sequences(model, data, &news, &engine)?;
        let bench = bench(model, (&data, source.as_ref()), (burn_in, None, 1), &engine)?;
        let networks: Vec<_> = model.all.iter().map(Trained::network).collect();
        let found = bench.from_mean(&members::mixed(&model.all, &networks), &bench.scored)?.one_step();
        Ok((found.nll, found.mse))
    })
}

/// The report of `scrnn evaluate`, in words and as JSON.
#[pyfunction]
#[pyo3(signature = (model, data=None, *, burn_in=None, observed=None, samples=50, starts=20, epochs=300, seed=1, threads=0,
    instruction_set=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn evaluate<'py>(
    py: Python<'py>,
    model: &Model,
    data: Option<Given<'py>>,
    burn_in: Option<f64>,
    observed: Option<f64>,
    samples: usize,
    starts: usize,
    epochs: u64,
    seed: u64,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<(String, String)> {
    let (data, news) = (data.map(|data| data.dataset()).transpose()?, News::new(None, say));
    watched(py, &news, || {
        let engine = engine(threads, instruction_set)?;
        let (data, source) = sequences(model, data, &news, &engine)?;
        let bench = bench(model, (&data, source.as_ref()), (burn_in, observed, seed), &engine)?;
        let first = model.first()?;
        let search = Search { starts, epochs, initial_state_variance: first.initial_state_variance() };
        let networks: Vec<_> = model.all.iter().map(Trained::network).collect();
        let learned = (&first.checkpoint.scaling, first.checkpoint.sequences.as_slice());
        let mut report = Report::new(&bench, &members::mixed(&model.all, &networks), learned, (search, samples))?;
        report.simple_models_fitted_to_learned = source.is_some();
        Ok((report.to_string(), json_of(&report)?))
    })
}

/// Finds a factor on the variances, and gives the network that has it, the effect as JSON, and where the old one was read.
#[pyfunction]
#[pyo3(signature = (model, data=None, *, burn_in=None, seed=1, threads=0, instruction_set=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn calibrate<'py>(
    py: Python<'py>,
    model: &Model,
    data: Option<Given<'py>>,
    burn_in: Option<f64>,
    seed: u64,
    threads: usize,
    instruction_set: Option<&str>,
    say: Option<Py<PyAny>>,
) -> PyResult<(Model, String, Vec<PathBuf>)> {
    let (data, news) = (data.map(|data| data.dataset()).transpose()?, News::new(None, say));
    told(py, &news, || {
        let engine = engine(threads, instruction_set)?;
        let (data, source) = sequences(model, data, &news, &engine)?;
        refuse_learned(model, &data, source.as_ref())?;
        let bench = bench(model, (&data, source.as_ref()), (burn_in, None, seed), &engine)?;
        let (mut all, mut effects) = (Vec::new(), Vec::new());
        for one in &model.all {
            let (factor, nll) = VarianceFactor::find(&bench, &one.checkpoint, &data)?;
            let Some(notes) = &one.notes else {
                let message = format!("{} was not written by scrnn", one.path.display());
                return Err(Failure::input(message, "the factor is kept in the notes of such a checkpoint"));
            };
            let mut notes = notes.clone();
            effects.push(serde_json::json!({ "factor": factor, "nll": nll }));
            notes.variance_factor = Some(factor);
            let mut checkpoint = one.checkpoint.clone();
            checkpoint.notes = notes.to_value();
            all.push(Trained::of(one.path.clone(), checkpoint)?);
        }
        let paths = all.iter().map(|one| one.path.clone()).collect();
        Ok((model.with(all), json_of(&effects)?, paths))
    })
}

/// A factor from sequences that were learned would promise too much.
fn refuse_learned(model: &Model, data: &Dataset, source: Option<&Source>) -> Result<()> {
    let help = "a factor from learned sequences would promise too much: give others";
    if let Some(notes) = &model.first()?.notes
        && notes.data.digest == digest(data)
    {
        return Err(Failure::input("these are the sequences that were learned", help));
    }
    let learned =
        |values: &[f64]| source.is_some_and(|source| source.data.sequences().iter().any(|one| one.values() == values));
    match data.sequences().iter().find(|sequence| learned(sequence.values())) {
        Some(one) => Err(Failure::input(format!("sequence {} was learned", one.name), help)),
        None => Ok(()),
    }
}
