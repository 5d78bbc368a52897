//! Many networks: a sweep is planned here, and its runs are trained one at a time by whatever hands out the work.

use std::path::{Path, PathBuf};
use std::time::Duration;

use pyo3::prelude::*;
use scrnn::engine::InstructionSet;
use scrnn_data::replace;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_sweep::compare::{METRICS, NETWORKS};
use scrnn_sweep::plan::Plan;
use scrnn_sweep::status::Status;
use scrnn_sweep::working::{Context, Options, prepare, work_on};

use crate::failure::raise;
use crate::machine::{News, attended, engine, watched};
use crate::texts::json_of;

/// Plans the sweep at `path` and writes the plan into its folder: the folder, and the places of all runs in the order in which they are
/// best worked on.
#[pyfunction]
#[pyo3(signature = (path, *, out=None, say=None))]
pub fn sweep_plan(
    py: Python<'_>,
    path: PathBuf,
    out: Option<PathBuf>,
    say: Option<Py<PyAny>>,
) -> PyResult<(String, Vec<usize>)> {
    let news = News::new(None, say);
    watched(py, &news, || {
        let plan = Plan::read(&path)?;
        let folder = out.unwrap_or_else(|| Path::new("runs").join(&plan.file.name));
        prepare(&plan, &folder, &news)?;
        let folder = std::path::absolute(&folder).map_err(|error| Failure::disk("find", &folder, error))?;
        let order = plan.order();
        match folder.to_str() {
            Some(folder) => Ok((folder.to_owned(), order)),
            None => Err(Failure::input(format!("the path {} is not UTF-8", folder.display()), "choose another folder")),
        }
    })
}

/// Trains one run of the sweep at `path`, whose folder is `out`, if it is not finished: what came of it as JSON.
#[pyfunction]
#[pyo3(signature = (path, out, place, *, threads=1, stale=120.0))]
pub fn sweep_run(
    py: Python<'_>,
    path: PathBuf,
    out: PathBuf,
    place: usize,
    threads: usize,
    stale: f64,
) -> PyResult<String> {
    let patience = Duration::try_from_secs_f64(stale).ok().filter(|patience| *patience >= Duration::from_secs(1));
    let Some(patience) = patience else {
        return Err(raise(Failure::input(format!("stale is {stale}"), "give a number of seconds, at least 1")));
    };
    let (interrupt, news) = (Interrupt::new(), News::default());
    let (told, signal) = attended(py, (&interrupt, &news), || {
        let plan = Plan::read(&path)?;
        let progress = |label: &str, total: u64| news.training(label, total);
        let context = Context {
            threads: engine(threads, None)?.threads(),
            instruction_set: InstructionSet::best(),
            interrupt: &interrupt,
            messages: &news,
            progress: &progress,
        };
        let options = Options { patience, ..Options::default() };
        json_of(&work_on(&plan, (&out, place), &options, &context)?)
    })?;
    match signal {
        Some(signal) => Err(signal),
        None => Ok(told),
    }
}

/// How far the sweep in `folder` is, in words and as JSON.
#[pyfunction]
pub fn sweep_status(py: Python<'_>, folder: PathBuf) -> PyResult<(String, String)> {
    watched(py, &News::default(), || {
        let status = Status::read(&folder)?;
        Ok((status.to_string(), json_of(&status)?))
    })
}

/// Compares a sweep or several runs, and writes page and metrics.csv into `out`: the best setting as JSON, and the text of metrics.csv.
#[pyfunction]
pub fn compare(py: Python<'_>, paths: Vec<PathBuf>, out: PathBuf) -> PyResult<(String, String)> {
    watched(py, &News::default(), || -> Result<(String, String)> {
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        let compared = scrnn_sweep::compare::compare(&paths, &out, NETWORKS)?;
        std::fs::create_dir_all(&out).map_err(|error| Failure::disk("make the folder", &out, error))?;
        replace(&out.join(METRICS), compared.csv.as_bytes())?;
        scrnn_pages::write(&compared.page, &out)?;
        Ok((json_of(&compared.best)?, compared.csv))
    })
}
