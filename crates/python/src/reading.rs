//! Sequences from files and to files.

use std::path::PathBuf;

use pyo3::prelude::*;
use scrnn_data::{Field, Selection};
use scrnn_run::experiment::{Data, TaskName};
use scrnn_run::failure::Failure;
use scrnn_run::{memory, source};

use crate::arrays::{Arrays, Given, arrays};
use crate::failure::compute;
use crate::machine::{News, engine, watched};
use crate::texts::json_of;

/// Reads files, folders or patterns as the program does: the sequences, seconds between samples, what is worth saying, and facts as JSON.
#[pyfunction]
#[pyo3(signature = (paths, *, topics=vec![], time=None, period=None, channels=None, arrays_=vec![], axes=None, unwrap=vec![]))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn read<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    topics: Vec<String>,
    time: Option<&str>,
    period: Option<f64>,
    channels: Option<Vec<String>>,
    arrays_: Vec<String>,
    axes: Option<&str>,
    unwrap: Vec<String>,
) -> PyResult<(Arrays<'py>, Option<f64>, Vec<String>, String)> {
    let reading = watched(py, &News::default(), || {
        let refused = |message: String| Failure::input(message, "");
        if let Some(period) = period.filter(|period| !(1e-9..=1e9).contains(period)) {
            return Err(Failure::input(format!("period is {period}"), "give seconds, from 1e-9 to 1e9"));
        }
        let selection = Selection {
            topics,
            period,
            time: time.map(str::parse).transpose().map_err(refused)?,
            channels,
            arrays: arrays_,
            axes: axes.map(str::parse).transpose().map_err(refused)?,
            unwrap,
            ..Selection::default()
        };
        let mut reading = scrnn_data::read_all(&paths, &selection)?;
        let wrong = scrnn_data::suspicions::look(&reading.data).into_iter();
        reading.remarks.extend(wrong.map(|suspicion| scrnn_data::Remark::Suspicion { suspicion }));
        Ok(reading)
    })?;
    let facts = json_of(&reading.facts).map_err(crate::failure::raise)?;
    let told = |remark: &scrnn_data::Remark| {
        let kind = if remark.level() == scrnn_data::Level::Warning { "warning" } else { "note" };
        format!("{kind}: {remark}")
    };
    let remarks = reading.remarks.iter().map(told).collect();
    Ok((arrays(py, &reading.data)?, reading.period, remarks, facts))
}

/// Writes named data sets side by side, as the program does.
#[pyfunction]
pub fn write<'py>(py: Python<'py>, path: PathBuf, data: Vec<(String, Given<'py>)>) -> PyResult<()> {
    let mut sets = Vec::new();
    for (name, given) in &data {
        sets.push((name.as_str(), given.dataset()?));
    }
    compute(py, || {
        let fields: Vec<Field<'_>> = sets.iter().map(|(name, data)| Field { name, data }).collect();
        Ok(scrnn_data::write(&path, &fields)?)
    })
}

/// Sequences of a task of the thesis, with the variance of the noise in each sample where that is known.
#[pyfunction]
#[pyo3(signature = (name, *, sequences=None, steps=None, seed=1, threads=0))]
pub fn task<'py>(
    py: Python<'py>,
    name: &str,
    sequences: Option<usize>,
    steps: Option<usize>,
    seed: u64,
    threads: usize,
) -> PyResult<(Arrays<'py>, Option<Arrays<'py>>)> {
    let made = watched(py, &News::default(), || {
        let name: TaskName = name.parse().map_err(|message: String| Failure::input(message, ""))?;
        if sequences == Some(0) || steps == Some(0) {
            return Err(Failure::input("a task of nothing is asked for", "give at least 1 sequence and 2 steps"));
        }
        let (usual, long) = name.size();
        let (sequences, steps) = (sequences.unwrap_or(usual), steps.unwrap_or(long));
        memory::check("the task", memory::product(&[sequences, steps, 2 * size_of::<f64>()]))?;
        let data = Data {
            task: Some(name),
            sequences: Some(sequences),
            steps: Some(steps),
            seed: Some(seed),
            ..Data::default()
        };
        source::load(&data, engine(threads, None)?.threads())
    })?;
    let truth = made.truth.as_ref().map(|truth| arrays(py, &truth.variances)).transpose()?;
    Ok((arrays(py, &made.data)?, truth))
}
