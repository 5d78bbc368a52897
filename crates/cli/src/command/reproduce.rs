//! `scrnn reproduce`: an experiment of the thesis from data to page.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use scrnn_reproduce::{self as reproduce, Context, Experiment, Options, STUDIES};
use scrnn_run::experiment::Override;
use scrnn_run::failure::{Ending, Result};

use crate::args::{MOST_IN_TOML, Shared, whole};
use crate::output;
use crate::progress::Work;
use crate::signals::Signals;

/// Reproduce an experiment of the thesis, and write a page about it
///
/// Makes the data, trains, generates, recognises and evaluates. The folder receives report.html, one page that needs
/// nothing else; metrics.json, all numbers; figures/, each figure as SVG with its numbers as CSV; and a run folder for
/// each training, as `scrnn train` writes it. Trainings that are finished are not repeated, nor are parts of evaluations,
/// and what was interrupted goes on.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn reproduce sinusoid                               a page in a few seconds
  scrnn reproduce lissajous --seeds 5 --out runs/five    five networks side by side on the cores
  scrnn reproduce limit-cycle --preset thesis            the thesis' optimiser and number of epochs
  scrnn reproduce interact --networks 10                 20 networks, in two robots' world and out of it")]
pub struct Arguments {
    /// Which experiment
    #[arg(value_parser = experiments())]
    experiment: &'static Experiment,
    /// Which settings
    #[arg(long, value_enum, default_value_t = Preset::Fast)]
    preset: Preset,
    /// Number of seeds, 1 to 1000, each with data and initial weights of its own; of `interact` the number of networks a condition,
    /// which all learn the same recordings
    #[arg(long, visible_alias = "networks", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// The first seed, 0 to 9000000000000000000
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(0, 9_000_000_000_000_000_000))]
    seed: u64,
    /// The folder [default: runs/reproduce/EXPERIMENT-PRESET]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of epochs, 0 to 9223372036854775807, instead of the preset's
    #[arg(long, value_name = "N", value_parser = whole(0, MOST_IN_TOML))]
    epochs: Option<u64>,
    /// A key of the S-CTRNN's training or network, e.g. --set training.adam.rate=1e-3
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// With `interact`: also initial-state variances between the thesis' two, and branchings with a bias (5.4.3)
    #[arg(long)]
    beyond: bool,
    /// Train and evaluate anew what is in the folder already
    #[arg(long)]
    overwrite: bool,
    /// Print metrics.json
    #[arg(long)]
    json: bool,
}

/// Which settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// The thesis' optimiser and number of epochs
    Thesis,
    /// What gets there soonest
    Fast,
}

impl From<Preset> for reproduce::Preset {
    fn from(preset: Preset) -> Self {
        match preset {
            Preset::Thesis => Self::Thesis,
            Preset::Fast => Self::Fast,
        }
    }
}

/// One of the thesis' experiments by its word.
fn experiments() -> impl TypedValueParser<Value = &'static Experiment> {
    let words = STUDIES.iter().map(|study| PossibleValue::new(study.word).help(study.about));
    PossibleValuesParser::new(words).map(|word| STUDIES.iter().find(|study| study.word == word).unwrap_or(&STUDIES[0]))
}

/// Reproduces.
pub fn run(arguments: &Arguments, (shared, signals): (&Shared, &Signals)) -> Result<Ending> {
    let interrupt = signals.listen();
    // Data come first, whatever was trained already.
    let work = Work::begin(&format!("{}: making the data", arguments.experiment.word), shared.quiet);
    let context = Context {
        threads: shared.engine()?.threads(),
        instruction_set: shared.instruction_set(),
        interrupt: &interrupt,
        messages: &work,
        progress: &|label, epochs| work.bar(label, epochs),
    };
    let options = Options {
        preset: arguments.preset.into(),
        seeds: arguments.seeds,
        seed: arguments.seed,
        out: arguments.out.clone(),
        epochs: arguments.epochs,
        set: arguments.set.clone(),
        beyond: arguments.beyond,
        overwrite: arguments.overwrite,
    };
    let reproduced = arguments.experiment.run(&options, &context);
    drop(work);
    let reproduced = reproduced?;
    output::print(if arguments.json { &reproduced.json } else { &reproduced.text })?;
    Ok(reproduced.ending)
}
