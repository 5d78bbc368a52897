//! `scrnn evaluate`: how does a network do on sequences that it did not learn?

use std::path::PathBuf;

use clap::Args;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn_data as files;
use scrnn_run::digest::digest;
use scrnn_run::evaluation::{Bench, Report, Search, SimpleModels};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::members;
use scrnn_run::run_folder::RunFolder;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;
use scrnn_run::variance_factor::{Effect, VarianceFactor};
use serde::Serialize;

use crate::args::{Part, Shared, count};
use crate::output;
use crate::progress::Busy;

/// Judge a trained network by sequences that it did not learn
///
/// One step ahead, from the mean initial state and from the state that is recognised in the first part of each sequence, beside two simple
/// models that are fitted to what was learned; calibration and coverage; the closed loop after the first part of each sequence; and whether
/// sequences are recognised as of their own kind, where their names tell kinds (`walk_3`, `wave_1`). Without DATA the sequences are those
/// that the experiment held out.
///
/// With --calibrate, one factor for each channel makes the predicted variances as large as the errors on these sequences. It is kept in the
/// checkpoint beside the weights, which stay as they are, and every command uses it and says so. Going on with the training drops it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn evaluate runs/mine                     on what the experiment held out
  scrnn evaluate runs/mine new.csv --best --json
  scrnn evaluate runs/mine new.csv --calibrate")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// Sequences that were not learned [default: those that the experiment held out]
    data: Option<PathBuf>,
    #[command(flatten)]
    part: Part,
    /// Share of each sequence that is listened to before predictions count, 0 to 0.99 [default: the experiment's, or 0.1]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    burn_in: Option<f64>,
    /// Share of each sequence that is heard before the closed loop, 0 to 0.99 [default: the experiment's, or 0.3]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    observed: Option<f64>,
    /// Closed loops of each sequence, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = count(1, 10_000))]
    samples: usize,
    /// Starts of the search for each sequence's state, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = count(1, 10_000))]
    starts: usize,
    /// Updates from each start, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u64).range(0..=1_000_000))]
    epochs: u64,
    /// Seed of the closed loops' noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Find a factor for each channel's variance, and keep it in the checkpoint
    #[arg(long)]
    calibrate: bool,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// Something must be left to judge by.
const LARGEST_SHARE: f64 = 0.99;

fn share(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=LARGEST_SHARE).contains(&value) => Ok(value),
        _ => Err(format!("give a share from 0 to {LARGEST_SHARE}")),
    }
}

/// What is printed.
#[derive(Serialize)]
struct Printed {
    #[serde(flatten)]
    report: Report,
    /// With --calibrate: the factor of each network, and what it does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    calibrated: Vec<Calibrated>,
}

#[derive(Serialize)]
struct Calibrated {
    factor: VarianceFactor,
    nll: Effect,
}

/// Judges.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let all = members::open(&arguments.run, arguments.best)?;
    let Some(trained) = all.first() else { return Ok(Ending::Done) };
    all.iter().for_each(|one| shared.say_of(one));
    let engine = shared.engine()?;
    let busy = Busy::with("evaluating", shared.quiet);
    let source = trained.source(engine.threads());
    let data = sequences((arguments, shared), trained, source.as_ref().ok())?;
    let bench = bench(arguments, trained, (&data, source.as_ref().ok()), &engine)?;
    let mut calibrated = Vec::new();
    if arguments.calibrate {
        // No training may write at the same time.
        let _run = arguments.run.is_dir().then(|| RunFolder::open(&arguments.run)).transpose()?;
        for one in &all {
            calibrated.push(calibrate(one, (&bench, &data, source.as_ref().ok()))?);
        }
    }
    // With the factor that was just found.
    let all = if arguments.calibrate { members::open(&arguments.run, arguments.best)? } else { all };
    let networks: Vec<_> = all.iter().map(Trained::network).collect();
    let mixture = members::mixed(&all, &networks);
    let Some(Trained { checkpoint, .. }) = all.first() else { return Ok(Ending::Done) };
    let search = Search {
        starts: arguments.starts,
        epochs: arguments.epochs,
        initial_state_variance: all.first().map_or(1.0, Trained::initial_state_variance),
    };
    let learned = (&checkpoint.scaling, checkpoint.sequences.as_slice());
    let mut report = Report::new(&bench, &mixture, learned, (search, arguments.samples))?;
    report.simple_models_fitted_to_learned = source.is_ok();
    drop(busy);
    if arguments.json {
        output::print_json(&Printed { report, calibrated })?;
        return Ok(Ending::Done);
    }
    output::print(&report.to_string())?;
    for (Calibrated { factor, nll }, one) in calibrated.iter().zip(&all) {
        let left_out =
            nll.left_out.map_or(String::new(), |nll| format!("; {nll:.4} on each with the factor of the others"));
        output::print(&format!(
            "\n{}\nnll before {:.4}, now {:.4}{left_out}. Kept in {}\n",
            factor.in_words(&checkpoint.channels),
            nll.before,
            nll.after,
            one.path.display()
        ))?;
    }
    Ok(Ending::Done)
}

/// The sequences to judge by, on the channels that were learned.
fn sequences(
    (arguments, shared): (&Arguments, &Shared),
    trained: &Trained,
    source: Option<&Source>,
) -> Result<Dataset> {
    if let Some(path) = &arguments.data {
        let part = arguments.part.of(path, trained.selection());
        return trained.fitted_aloud(files::read_all(&[path], &part)?.data, path, shared);
    }
    match source {
        Some(Source { held_out: Some(held_out), .. }) => Ok(held_out.clone()),
        Some(_) => Err(Failure::input(
            "the experiment holds no sequences out",
            "say which to judge by: scrnn evaluate RUN DATA",
        )),
        None => {
            // Why they cannot be had.
            trained.source(1)?;
            Err(Failure::input("there are no sequences to judge by", "say which: scrnn evaluate RUN DATA"))
        }
    }
}

fn bench(
    arguments: &Arguments,
    trained: &Trained,
    (data, source): (&Dataset, Option<&Source>),
    engine: &Engine,
) -> Result<Bench> {
    let checkpoint = &trained.checkpoint;
    let delay = checkpoint.topology.delay();
    data.check_for(&checkpoint.topology)?;
    let scaled = checkpoint.scaling.apply(data)?;
    let learned = source.map(|source| checkpoint.scaling.apply(&source.data)).transpose()?;
    let models = SimpleModels::fit(learned.as_ref().unwrap_or(&scaled), delay);
    let evaluation = trained.evaluation();
    let shares = (arguments.burn_in.unwrap_or(evaluation.burn_in), arguments.observed.unwrap_or(evaluation.observed));
    Bench::new(scaled, models, shares, (delay, arguments.seed), engine)
}

/// Finds the factor and keeps it in the checkpoint that was read.
fn calibrate(trained: &Trained, (bench, data, source): (&Bench, &Dataset, Option<&Source>)) -> Result<Calibrated> {
    let help = "a factor from learned sequences would promise too much: give others";
    if let Some(notes) = &trained.notes
        && notes.data.digest == digest(data)
    {
        return Err(Failure::input("these are the sequences that were learned", help));
    }
    let learned =
        |values: &[f64]| source.is_some_and(|source| source.data.sequences().iter().any(|one| one.values() == values));
    if let Some(one) = data.sequences().iter().find(|sequence| learned(sequence.values())) {
        return Err(Failure::input(format!("sequence {} was learned", one.name), help));
    }
    let (factor, nll) = VarianceFactor::find(bench, &trained.checkpoint, data)?;
    let Some(notes) = &trained.notes else {
        let message = format!("{} was not written by `scrnn train`", trained.path.display());
        return Err(Failure::input(message, "the factor is kept in the notes of such a checkpoint"));
    };
    let mut notes = notes.clone();
    notes.variance_factor = Some(factor.clone());
    let mut checkpoint = trained.checkpoint.clone();
    checkpoint.notes = notes.to_value();
    files::replace(&trained.path, &checkpoint.to_bytes()?)?;
    Ok(Calibrated { factor, nll })
}
