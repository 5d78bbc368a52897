//! `scrnn data`: the thesis' sequences as files.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn::tasks::Task;

use crate::args::Shared;
use crate::experiment::TaskName;
use crate::failure::{Ending, Failure, Result};
use crate::files::{self, Field};
use crate::{interactions, output, source};

/// Write the sequences of the thesis' experiments
///
/// Samples go to FILE. What the noise hides, the true mean and variance of each sample, goes beside them into
/// FILE.truth, so that FILE itself can be learned from: train with files = ["FILE"].
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn data sinusoid                                    the samples as CSV on stdout
  scrnn data lissajous --seed 7 --out lissajous.npz      also writes lissajous.truth.npz
  scrnn data limit-cycle --sequences 3 --steps 200 --out three.csv
  scrnn data interact --out interact.npz                 two robots, all 32 orders, from the physics
  scrnn data interact --sequences 1 --out world.mcap     a recording to watch")]
pub struct Arguments {
    /// Which sequences
    task: TaskName,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of sequences [default: as in the thesis]
    #[arg(long, value_name = "N")]
    sequences: Option<usize>,
    /// Samples in each sequence [default: as in the thesis, 1000 or 470]
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Where to write the samples: .csv, .txt, .npy or .npz, and .mcap for robots. Without it, CSV on stdout
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where to write the true means and variances [default: FILE with `.truth` before its extension]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
}

/// Makes the sequences and writes them.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let (sequences, steps) = arguments.task.size();
    let size = (arguments.sequences.unwrap_or(sequences), arguments.steps.unwrap_or(steps));
    if let Some(path) = arguments.out.as_deref().filter(|path| is_mcap(path)) {
        if arguments.task != TaskName::Interact {
            let message = format!("{} would be a recording of a world, and this task has none", path.display());
            return Err(Failure::input(message, "write .csv, .txt, .npy or .npz"));
        }
        interactions::film(path, size, arguments.seed)?;
        return Ok(Ending::Done);
    }
    let Task { data, means, variances } = source::make(arguments.task, size, arguments.seed)?;
    let samples = [Field { name: "", data: &data }];
    match &arguments.out {
        Some(path) => files::write(path, &samples)?,
        None => output::print(&files::csv(&samples))?,
    }
    if let Some(path) = arguments.truth.clone().or_else(|| arguments.out.as_deref().map(beside)) {
        files::write(&path, &[Field { name: "mean", data: &means }, Field { name: "variance", data: &variances }])?;
        shared.say(format_args!("true means and variances: {}", path.display()));
    }
    Ok(Ending::Done)
}

fn is_mcap(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"))
}

/// Where the truth goes. A `.npy` has room for one array only, a `.npz` has for both.
fn beside(path: &Path) -> PathBuf {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = if extension.eq_ignore_ascii_case("npy") { "npz" } else { &extension };
    path.with_extension(format!("truth.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_lies_beside_the_samples() {
        assert_eq!(beside(Path::new("a/b.csv")), Path::new("a/b.truth.csv"));
        assert_eq!(beside(Path::new("b.npy")), Path::new("b.truth.npz"));
    }
}
