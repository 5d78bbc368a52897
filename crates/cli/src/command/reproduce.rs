//! `scrnn reproduce`: an experiment of the thesis from data to page.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use scrnn_reproduce::{self as reproduce, Context, Options};
use scrnn_run::experiment::Override;
use scrnn_run::failure::{Ending, Result};

use crate::args::Shared;
use crate::output;
use crate::progress::Bars;
use crate::signals;

/// Reproduce an experiment of the thesis, and write a page about it
///
/// Makes the data, trains, generates, recognises and evaluates. The folder receives report.html, one page that needs
/// nothing else; metrics.json, all numbers; figures/, each figure as SVG with its numbers as CSV; and a run folder for
/// each training, as `scrnn train` writes it. Trainings that are finished are not repeated, and one that was interrupted
/// goes on.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn reproduce sinusoid                               a page in a few seconds
  scrnn reproduce lissajous --seeds 5 --out runs/five    five networks side by side on the cores
  scrnn reproduce limit-cycle --preset thesis            the thesis' optimiser and number of epochs
  scrnn reproduce interact --networks 10                 20 networks, in two robots' world and out of it")]
pub struct Arguments {
    /// Which experiment
    experiment: Name,
    /// Which settings
    #[arg(long, value_enum, default_value_t = Preset::Fast)]
    preset: Preset,
    /// Number of seeds, each with data and initial weights of its own; of `interact` the number of networks a condition,
    /// which all learn the same recordings
    #[arg(long, visible_alias = "networks", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// The first seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The folder [default: runs/reproduce/EXPERIMENT-PRESET]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of epochs, instead of the preset's
    #[arg(long, value_name = "N")]
    epochs: Option<u64>,
    /// A key of the S-CTRNN's training or network, e.g. --set training.adam.rate=1e-3
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// With `interact`: also initial-state variances between the thesis' two, and branchings with a bias (5.4.3)
    #[arg(long)]
    beyond: bool,
    /// Train anew what is in the folder already
    #[arg(long)]
    overwrite: bool,
    /// Print metrics.json
    #[arg(long)]
    json: bool,
}

/// The thesis' experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Name {
    /// Twelve Lissajous curves, each with noise of its own (3.2)
    Lissajous,
    /// 144 patterns in one network (6.2.3)
    Patterns,
    /// A sine wave whose noise changes over time (3.3)
    Sinusoid,
    /// An oscillator that is driven by noise which depends on its state (3.4)
    LimitCycle,
    /// NAO learns to touch a sphere from demonstrations, in simulation (4)
    Reach,
    /// Two robots interact: reactive and proactive behaviour, and error regression (5)
    Interact,
}

impl From<Name> for reproduce::Name {
    fn from(name: Name) -> Self {
        match name {
            Name::Lissajous => Self::Lissajous,
            Name::Patterns => Self::Patterns,
            Name::Sinusoid => Self::Sinusoid,
            Name::LimitCycle => Self::LimitCycle,
            Name::Reach => Self::Reach,
            Name::Interact => Self::Interact,
        }
    }
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

/// Reproduces.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let interrupt = signals::listen();
    let bars = Bars::new(shared.quiet);
    let context = Context {
        threads: shared.engine()?.threads(),
        instruction_set: shared.instruction_set(),
        interrupt: &interrupt,
        messages: shared,
        progress: &|label, epochs| bars.bar(label, epochs),
    };
    let options = Options {
        experiment: arguments.experiment.into(),
        preset: arguments.preset.into(),
        seeds: arguments.seeds,
        seed: arguments.seed,
        out: arguments.out.clone(),
        epochs: arguments.epochs,
        set: arguments.set.clone(),
        beyond: arguments.beyond,
        overwrite: arguments.overwrite,
    };
    let reproduced = reproduce::run(&options, &context)?;
    output::print(if arguments.json { &reproduced.json } else { &reproduced.text })?;
    Ok(reproduced.ending)
}
