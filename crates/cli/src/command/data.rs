//! `scrnn data`: the thesis' sequences as files.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use clap::Args;
use scrnn_run::source;
use scrnn_sim::reach::recording::{DemonstrationSample, ReachingRecording};
use scrnn_sim::reach::stage::PERIOD;
use scrnn_sim::reach::tutor::{self, Demonstration};
use scrnn_tasks::{Task, TaskName, interact, make};

use crate::args::{self, Shared};
use crate::output;
use crate::outputs::check_distinct;
use crate::progress::Busy;
use scrnn_data::{self as files, Field};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::memory::{self, product};

/// Write the sequences of the thesis' experiments
///
/// Samples go to FILE, which can be learned from: train with files = ["FILE"]. What the noise of chapter 3 hides, the true
/// mean and variance of each sample, goes beside them into FILE.truth. The task "reach" is taught to a simulated robot; as
/// .mcap its demonstrations can be watched in Foxglove and rerun.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn data sinusoid                                    the samples as CSV on stdout
  scrnn data lissajous --seed 7 --out lissajous.npz      also writes lissajous.truth.npz
  scrnn data limit-cycle --sequences 3 --steps 200 --out three.csv
  scrnn data reach --out reach.npz                       30 demonstrations, 10 at each position
  scrnn data reach --sequences 3 --out reach.mcap        one of each, to look at
  scrnn data interact --out interact.npz                 two robots, all 32 orders, from the physics
  scrnn data interact --sequences 1 --out world.mcap     a recording to watch")]
pub struct Arguments {
    /// Which sequences
    #[arg(value_parser = args::task_names())]
    task: TaskName,
    /// Seed of the noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = args::seed())]
    seed: u64,
    /// Number of sequences, 1 to 1000000 [default: as in the thesis]
    #[arg(long, value_name = "N", value_parser = args::count(1, 1_000_000))]
    sequences: Option<usize>,
    /// Samples in each sequence, 1 to 1000000000 [default: as in the thesis, 1000; 180 for reach, 470 for interact]
    #[arg(long, value_name = "N", value_parser = args::count(1, 1_000_000_000))]
    steps: Option<usize>,
    /// With reach: put the object exactly at its three positions, instead of up to 10 mm off
    #[arg(long)]
    exact_positions: bool,
    /// Where to write the samples: .csv, .txt, .npy or .npz; with robots also .mcap. Without it, CSV on stdout
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
    // Sample, mean and variance, and the samples as text.
    memory::check("what is to be made", product(&[size.0, size.1, 3 * size_of::<f64>() + 16]))?;
    let film = arguments.out.as_deref().filter(|path| is_recording(path));
    if arguments.exact_positions && arguments.task != TaskName::Reach {
        let message = format!("--exact-positions does not go with {}", arguments.task.word());
        return Err(Failure::input(message, "it is for the task reach"));
    }
    let truth = arguments.truth.clone().or_else(|| arguments.out.as_deref().map(beside));
    check_distinct(&[("--out", arguments.out.as_deref()), ("--truth", truth.as_deref())], &[])?;
    // What goes to a terminal stands there alone.
    let _busy =
        (arguments.out.is_some() || !output::is_for_a_person()).then(|| Busy::with("making the data", shared.quiet));
    match (arguments.task, film) {
        (TaskName::Reach, _) => return reach(arguments, size, shared),
        (TaskName::Interact, Some(path)) => {
            files::replace(path, &interact::film(size, arguments.seed)?)?;
            return Ok(Ending::Done);
        }
        (task, Some(path)) => {
            let message = format!("{} would be a recording of a world, and {} has none", path.display(), task.word());
            return Err(Failure::input(message, "write .csv, .txt, .npy or .npz"));
        }
        (_, None) => {}
    }
    let Task { data, means, variances } = make(arguments.task, size, arguments.seed, shared.engine()?.threads())?;
    let samples = [Field { name: "", data: &data }];
    match &arguments.out {
        Some(path) => files::write(path, &samples)?,
        None => output::print(&files::csv(&samples))?,
    }
    if let Some(path) = truth {
        files::write(&path, &[Field { name: "mean", data: &means }, Field { name: "variance", data: &variances }])?;
        shared.say(format_args!("true means and variances: {}", path.display()));
    }
    Ok(Ending::Done)
}

/// Lets the tutor teach, and writes what the robot sensed.
fn reach(arguments: &Arguments, size: (usize, usize), shared: &Shared) -> Result<Ending> {
    if arguments.truth.is_some() {
        return Err(Failure::input("--truth does not go with reach", "nobody knows the truth about a tutor's hand"));
    }
    let tutoring = source::tutoring(size, arguments.exact_positions);
    let threads = shared.engine()?.threads();
    if let Some(path) = arguments.out.as_deref().filter(|path| is_recording(path)) {
        let all = tutor::demonstrate_with(&tutoring, arguments.seed, threads, &DemonstrationSample::at)?;
        let seed = arguments.seed.to_string();
        files::replace(path, &recording(&all, &seed)?)?;
        return Ok(Ending::Done);
    }
    let data = tutor::dataset(&tutor::demonstrate(&tutoring, arguments.seed, threads)?)?;
    let samples = [Field { name: "", data: &data }];
    match &arguments.out {
        Some(path) => files::write(path, &samples)?,
        None => output::print(&files::csv(&samples))?,
    }
    Ok(Ending::Done)
}

/// All demonstrations one after the other, a second apart.
fn recording(all: &[(Demonstration, Vec<DemonstrationSample>)], seed: &str) -> Result<Vec<u8>> {
    let names = tutor::dataset(&all.iter().map(|(one, _)| one.clone()).collect::<Vec<_>>())?;
    let notes = [("task", "reach"), ("seed", seed)];
    let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), None, &notes)?;
    let mut begin = 0.0;
    for ((_, looks), sequence) in all.iter().zip(names.sequences()) {
        recording.begin_sequence(begin, &sequence.name)?;
        for look in looks {
            recording.demonstration(look)?;
        }
        begin += looks.len() as f64 * PERIOD + 1.0;
    }
    Ok(recording.finish()?.into_inner())
}

fn is_recording(path: &Path) -> bool {
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
