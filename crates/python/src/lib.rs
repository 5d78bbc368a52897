//! The compiled part of the Python package `scrnn`: numpy's arrays to the libraries and back.
//!
//! What a person sees is written in Python, in `python/scrnn`; here are the few calls that it stands on. They compute without the
//! interpreter's lock, long work looks for signals meanwhile, and what goes wrong is an exception with the program's message.
//!
//! | module | what it holds |
//! |---|---|
//! | `failure`, `machine` | errors and panics as exceptions; threads, signals, progress |
//! | `arrays`, `texts` | numpy's arrays, JSON and TOML, to the types of the libraries and back |
//! | `reading` | sequences from files and to files, and those of the thesis' tasks |
//! | `model`, `training` | a trained network in memory, and how it comes about |
//! | `using`, `following`, `judging` | generation and recognition, error regression, evaluation |
//! | `sweeps` | many networks: one of them at a time, for whatever hands out the work |
//! | `studies` | the thesis' experiments and its robots |

use pyo3::prelude::*;

mod arrays;
mod failure;
mod following;
mod judging;
mod machine;
mod model;
mod reading;
mod studies;
mod sweeps;
mod texts;
mod training;
mod using;

/// The module `scrnn._scrnn`.
#[pymodule]
fn _scrnn(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", py.get_type::<failure::Error>())?;
    module.add("FileError", py.get_type::<failure::FileError>())?;
    module.add("RefusedError", py.get_type::<failure::RefusedError>())?;
    module.add("DivergedError", py.get_type::<failure::DivergedError>())?;
    module.add("InternalError", py.get_type::<failure::InternalError>())?;
    module.add_function(wrap_pyfunction!(failure::break_down, module)?)?;
    module.add_class::<model::Model>()?;
    module.add_class::<following::Follower>()?;
    module.add_class::<following::Step>()?;
    module.add_function(wrap_pyfunction!(training::fit, module)?)?;
    module.add_function(wrap_pyfunction!(training::train_paths, module)?)?;
    module.add_function(wrap_pyfunction!(using::generate, module)?)?;
    module.add_function(wrap_pyfunction!(using::go_on, module)?)?;
    module.add_function(wrap_pyfunction!(using::recognize, module)?)?;
    module.add_function(wrap_pyfunction!(judging::score, module)?)?;
    module.add_function(wrap_pyfunction!(judging::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(judging::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(reading::read, module)?)?;
    module.add_function(wrap_pyfunction!(reading::write, module)?)?;
    module.add_function(wrap_pyfunction!(reading::task, module)?)?;
    module.add_function(wrap_pyfunction!(sweeps::sweep_plan, module)?)?;
    module.add_function(wrap_pyfunction!(sweeps::sweep_run, module)?)?;
    module.add_function(wrap_pyfunction!(sweeps::sweep_status, module)?)?;
    module.add_function(wrap_pyfunction!(sweeps::compare, module)?)?;
    module.add_function(wrap_pyfunction!(studies::studies, module)?)?;
    module.add_function(wrap_pyfunction!(studies::reproduce, module)?)?;
    module.add_function(wrap_pyfunction!(studies::simulate_reach, module)?)?;
    module.add_function(wrap_pyfunction!(studies::simulate_interact, module)?)?;
    Ok(())
}
