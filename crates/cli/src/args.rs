//! The command line: its commands, and the options that all of them share.

use std::path::Path;
use std::sync::LazyLock;

use clap::{Args, Parser, Subcommand};
use scrnn::engine::{Engine, InstructionSet};

use crate::command::{completions, data, generate, inspect, recognize, report, reproduce, simulate, train};
use crate::failure::Result;
use scrnn_data::Selection;

static VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{} (instruction set {})", env!("CARGO_PKG_VERSION"), InstructionSet::best()));

/// Where the options of every command stand in the help.
const SHARED: &str = "Options of every command";

const AFTER_HELP: &str = "\
A first session, on the thesis' noisy sine wave:
  scrnn train assets/experiments/sinusoid_fast.toml     learns it, into runs/sinusoid_fast
  scrnn generate runs/sinusoid_fast --out wave.csv      lets the network run on its own
  scrnn inspect runs/sinusoid_fast                      what is in the run folder

The thesis' chapter 3, with a page to look at:
  scrnn reproduce sinusoid                              trains, evaluates, compares with the thesis

And on data of your own:
  scrnn inspect mine.csv                                what scrnn makes of the file
  scrnn train mine.toml                                 an experiment with files = [\"mine.csv\"]
  scrnn recognize runs/mine new.csv                     which learned sequence is this?
  scrnn report runs/mine                                the run as a page

Results go to stdout, progress and messages to stderr. Sequences count from 1, as in the thesis.

Exit codes:
  0    success
  2    bad usage or bad input: arguments, experiment, data
  3    the training diverged; it was rolled back, and the last good state is saved
  4    a file could not be read or written
  5    refused: the run folder is busy or holds a run, or experiment or data changed
  130  interrupted by Ctrl-C; the state is saved";

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

/// Options of every command.
#[derive(Debug, Args)]
pub struct Shared {
    /// Threads to work with; 0 takes one for each core. The result is the same to the bit
    #[arg(long, global = true, value_name = "N", default_value_t = 0, hide_default_value = true, help_heading = SHARED)]
    pub threads: usize,
    /// The vector instructions to use; by default the fastest that the processor has
    #[arg(long, global = true, value_name = "NAME", hide_short_help = true, help_heading = SHARED)]
    pub instruction_set: Option<InstructionSet>,
    /// No progress and no messages, only results and errors
    #[arg(long, short, global = true, help_heading = SHARED)]
    pub quiet: bool,
}

impl Shared {
    /// The machine to compute on.
    pub fn engine(&self) -> Result<Engine> {
        Ok(Engine::new(self.threads, self.instruction_set())?)
    }

    /// The vector instructions in use.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set.unwrap_or_else(InstructionSet::best)
    }

    /// Says something on stderr, unless told to be quiet.
    pub fn say(&self, message: impl std::fmt::Display) {
        if !self.quiet {
            eprintln!("{message}");
        }
    }
}

/// Which part of data files is meant.
#[derive(Debug, Clone, Default, Args)]
pub struct Part {
    /// In .mcap files, the topic whose messages are samples [default: /sensed, or the only one that is JSON]
    #[arg(long, value_name = "TOPIC")]
    pub topic: Option<String>,
    /// In .mcap files, bring the messages to samples this many seconds apart, on straight lines between them
    #[arg(long, value_name = "SECONDS", value_parser = period)]
    pub period: Option<f64>,
    /// The channels to take, by their names [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub channels: Option<Vec<String>>,
}

fn period(text: &str) -> std::result::Result<f64, String> {
    let period: f64 = text.parse().map_err(|_| "give a number of seconds".to_owned())?;
    if period > 0.0 && period.is_finite() { Ok(period) } else { Err("give a number of seconds above 0".to_owned()) }
}

impl Part {
    /// What it selects in the file at `path`; where it is silent, what `learned` of its training's data says.
    pub fn of(&self, path: &Path, learned: Option<Selection>) -> Selection {
        let Selection { topics, period, channels, .. } = learned.unwrap_or_default();
        let recording = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        Selection {
            topics: match &self.topic {
                Some(topic) => vec![topic.clone()],
                None if recording => topics,
                None => Vec::new(),
            },
            period: self.period.or(period.filter(|_| recording)),
            channels: self.channels.clone().or(channels),
            ..Selection::default()
        }
    }
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    Data(data::Arguments),
    Train(train::Arguments),
    Generate(generate::Arguments),
    Recognize(recognize::Arguments),
    Simulate(simulate::Arguments),
    Reproduce(reproduce::Arguments),
    Report(report::Arguments),
    Inspect(inspect::Arguments),
    /// Print the JSON schema of the experiment file
    ///
    /// Editors with a TOML language server complete and check an experiment file that begins with
    ///   #:schema ./scrnn.schema.json
    #[command(verbatim_doc_comment, after_help = "Example:\n  scrnn schema > scrnn.schema.json")]
    Schema,
    Completions(completions::Arguments),
}
