//! The command line: its commands.

use std::sync::LazyLock;

use clap::{Parser, Subcommand};
use scrnn::engine::InstructionSet;

use crate::args::Shared;
use crate::command::{
    compare, completions, convert, data, evaluate, export, generate, inspect, recognize, report, reproduce, schema,
    simulate, sweep, train, view,
};

static VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{} (instruction set {})", env!("CARGO_PKG_VERSION"), InstructionSet::best()));

const AFTER_HELP: &str = "\
A first session, on the thesis' noisy sine wave:
  scrnn train assets/experiments/sinusoid_fast.toml     learns it, into runs/sinusoid_fast
  scrnn generate runs/sinusoid_fast --out wave.csv      lets the network run on its own
  scrnn inspect runs/sinusoid_fast                      what is in the run folder

The thesis' chapter 3, with a page to look at:
  scrnn reproduce sinusoid                              trains, evaluates, compares with the thesis

And on data of your own:
  scrnn inspect mine.csv                                what scrnn makes of the file
  scrnn inspect mine.csv --plot mine.html               and what they look like
  scrnn train mine.csv                                  with settings that suit the data, into runs/mine
  scrnn recognize runs/mine new.csv                     which learned sequence is this?
  scrnn evaluate runs/mine new.csv                      how well does it do on what it did not learn?
  scrnn report runs/mine                                the run as a page
  scrnn view between.mcap                               a recording as a page that plays it

Results go to stdout, progress and messages to stderr. Sequences count from 1, as in the thesis.

Exit codes:
  0    success
  2    bad usage or bad input: arguments, experiment, data
  3    the training diverged; it was rolled back, and the last good state is saved
  4    a file could not be read or written
  5    refused: the run folder is busy or holds a run, or experiment or data changed
       of `scrnn sweep`: 3 if a network diverged; 2, 4 or 5 if one could not be finished, as the first of these would have ended
  6    the results could not be written to stdout; files are written
  130  interrupted by Ctrl-C; the state is saved
       so for SIGHUP 129, SIGUSR1 138, SIGTERM 143, SIGXCPU 152";

/// Recurrent networks that learn to predict sequences together with their own uncertainty
///
/// scrnn trains S-CTRNNs and S-MTRNNs: continuous-time recurrent networks that predict the mean and the variance of the
/// next sample. A trained network generates sequences with the fluctuations it has seen, and recognises new ones.
#[derive(Debug, Parser)]
#[command(name = "scrnn", version = VERSION.as_str(), after_help = AFTER_HELP, max_term_width = 100)]
pub struct Cli {
    #[command(flatten)]
    pub shared: Shared,
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    Data(data::Arguments),
    Train(train::Arguments),
    Sweep(sweep::Arguments),
    Compare(compare::Arguments),
    Generate(generate::Arguments),
    Recognize(recognize::Arguments),
    Evaluate(evaluate::Arguments),
    Simulate(simulate::Arguments),
    Reproduce(reproduce::Arguments),
    Report(report::Arguments),
    View(view::Arguments),
    Inspect(inspect::Arguments),
    Convert(convert::Arguments),
    Export(export::Arguments),
    Schema(schema::Arguments),
    Completions(completions::Arguments),
}

#[cfg(test)]
#[path = "../../../tests/cli/numbers_table.rs"]
mod numbers_table;

#[cfg(test)]
#[path = "../../../tests/cli/numeric_options.rs"]
mod tests;
