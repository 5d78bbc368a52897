//! `scrnn export`: one step of a trained network for other programs.

use std::path::PathBuf;

use clap::Args;
use scrnn_data::replace;
use scrnn_run::export::{OneStep, Precision};
use scrnn_run::failure::{Ending, Result};
use scrnn_run::members;

use crate::args::Shared;
use crate::output;
use crate::outputs::check_distinct;

/// Write one step of a trained network as C or ONNX, for a robot's own program
///
/// A sample goes in, mean and variance of the forecast come out, all in the data's units; the state goes in and comes out. What
/// is missing in a sample (NaN) is stood in for by the network's own prediction. docs/robots.md shows how to use the files.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  scrnn export runs/mine --c network.h --onnx network.onnx --sequence wave --best")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// Write a C file to include
    #[arg(long, value_name = "FILE", required_unless_present = "onnx")]
    c: Option<PathBuf>,
    /// Write an ONNX model
    #[arg(long, value_name = "FILE")]
    onnx: Option<PathBuf>,
    /// The ONNX model computes in float32 instead of float64
    #[arg(long, requires = "onnx")]
    float32: bool,
    /// Begin from the state of the learned sequence of this name or, counted from 1, number [default: the mean of all]
    #[arg(long, value_name = "NAME|K|mean")]
    sequence: Option<String>,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
}

/// Writes.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let Arguments { run, c, onnx, sequence, .. } = arguments;
    let all = members::open(run, arguments.best)?;
    let read = all.iter().map(|one| ("RUN", one.path.parent())).chain([("RUN", Some(run.as_path()))]);
    check_distinct(&[("--c", c.as_deref()), ("--onnx", onnx.as_deref())], &read.collect::<Vec<_>>())?;
    all.iter().for_each(|trained| shared.say_of(trained));
    let step = OneStep::of(&all, sequence.as_deref())?;
    let precision = if arguments.float32 { Precision::Float32 } else { Precision::Float64 };
    let c = c.iter().map(|path| (path, step.c().into_bytes()));
    let onnx = onnx.iter().map(|path| Ok((path, step.onnx(precision)?))).collect::<Result<Vec<_>>>()?;
    for (path, bytes) in c.chain(onnx) {
        replace(path, &bytes)?;
        output::print(&format!("{}\n", path.display()))?;
    }
    Ok(Ending::Done)
}
