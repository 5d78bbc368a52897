//! `scrnn generate`: lets a trained network run (thesis 2.8).

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use scrnn::dataset::{Dataset, Sequence};
use serde_json::{Value, json};

use crate::args::{Part, Shared};
use crate::output;
use crate::outputs::check_distinct;
use scrnn_data::{self as files, Field};
use scrnn_run::completion::UNCERTAINTY;
use scrnn_run::failure::{Ending, Result};
use scrnn_run::generating::{From, Generating, Onward, generating, given_states, onward};
use scrnn_run::members;
use scrnn_run::trained::Trained;

/// Let a trained network generate sequences
///
/// In the closed loop the network is fed with what it predicted; noise of the predicted variance makes it fluctuate as
/// the data did. In the open loop it is fed with recorded samples and predicts each next one. The result is in the data's
/// own units: the predicted mean, the predicted variance, and a sample (mean plus noise). Row 1 predicts the sample after
/// the first xi ones, where xi is the network's delay.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  Each learned sequence, run by the network on its own:
    scrnn generate runs/lissajous --out curves.csv
  Ten runs of the third one, 500 steps each:
    scrnn generate runs/lissajous --sequence 3 --samples 10 --steps 500 --seed 7
  One step ahead of recorded samples, from the states that `scrnn recognize --out` found:
    scrnn generate runs/lissajous --mode open --data new.csv --initial-state states.npz
  How recorded sequences go on after their first 30 samples, as a distribution:
    scrnn generate runs/lissajous --from new.csv --observed 30 --samples 50 --out rest.npz")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// What the network is fed with
    #[arg(long, value_enum, default_value_t = Mode::Closed)]
    mode: Mode,
    /// With --mode mixed: the recorded sample's share of the input, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = crate::args::number(0.0, 1.0))]
    mixing: f64,
    /// Channels that are fed with recorded samples whatever the mode, by their names
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    open_channels: Vec<String>,
    /// Start from the state of the learned sequence of this name or, counted from 1, number [default: each of them]
    #[arg(long, value_name = "NAME|K", conflicts_with_all = ["mean", "initial_state"])]
    sequence: Option<String>,
    /// Start from the mean of the learned initial states
    #[arg(long, conflicts_with = "initial_state")]
    mean: bool,
    /// Start from the initial states in FILE: each row is one, with a column for each context unit
    #[arg(long, value_name = "FILE")]
    initial_state: Option<PathBuf>,
    /// Go on from the end of each sequence in FILE: its state is recognised first. Mean and variance are those of all --samples closed
    /// loops, which begin from several states that explain the sequence
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sequence", "mean", "initial_state", "data", "contexts", "mode", "open_channels", "no_noise", "mixing"])]
    from: Option<PathBuf>,
    /// With --from: recognise the first N samples, 1 to 1000000000, and go on from there
    #[arg(long, value_name = "N", requires = "from", value_parser = crate::args::count(1, 1_000_000_000))]
    observed: Option<usize>,
    /// Number of steps, 1 to 1000000000 [default: as many as the data have]
    #[arg(long, value_name = "N", value_parser = crate::args::count(1, 1_000_000_000))]
    steps: Option<usize>,
    /// No noise: what is fed back, and the sample, is the predicted mean
    #[arg(long)]
    no_noise: bool,
    /// Number of times that each sequence is generated, 1 to 1000000, with noise of its own
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    samples: u32,
    /// Seed of the noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
    /// Also give the context units' activations
    #[arg(long)]
    contexts: bool,
    /// Recorded sequences: the open loop runs along them, the closed loop starts from their first samples [default: those
    /// that were learned]
    #[arg(long, value_name = "FILE")]
    data: Option<PathBuf>,
    #[command(flatten)]
    part: Part,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Where to write: .csv, .txt or .npz. Without it, CSV on stdout
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long, conflicts_with = "out")]
    json: bool,
}

/// What the network is fed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Recorded samples
    Open,
    /// Its own predictions
    Closed,
    /// A mixture of both
    Mixed,
}

/// Generates.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let files = [&arguments.initial_state, &arguments.data, &arguments.from].map(Option::as_deref);
    let named = [
        ("RUN", Some(arguments.run.as_path())),
        ("--initial-state", files[0]),
        ("--data", files[1]),
        ("--from", files[2]),
    ];
    check_distinct(&[("--out", arguments.out.as_deref())], &named)?;
    let all = members::open(&arguments.run, arguments.best)?;
    all.iter().for_each(|trained| shared.say_of(trained));
    let Some(trained) = all.first() else { return Ok(Ending::Done) };
    let engine = shared.engine()?;
    let read = |path: &PathBuf| -> Result<Dataset> {
        let data = files::read_all(&[path], &arguments.part.of(path, trained.selection()))?.data;
        trained.fitted_aloud(data, path, shared)
    };
    let fields = match &arguments.from {
        Some(path) => {
            let Arguments { observed, steps, samples, seed, .. } = *arguments;
            shared.say(format_args!("the recognised state's uncertainty: {UNCERTAINTY}"));
            onward(&all, &read(path)?, Onward { observed, steps, samples: samples as usize, seed }, &engine)?
        }
        None => {
            let data = arguments.data.as_ref().map(read).transpose()?;
            generating(&all, &arguments.options(trained, data)?, &engine)?
        }
    };
    if arguments.json {
        output::print_json_line(&as_json(&fields))?;
        return Ok(Ending::Done);
    }
    let fields: Vec<Field<'_>> = fields.iter().map(|(name, data)| Field { name, data }).collect();
    match &arguments.out {
        Some(path) => files::write(path, &fields)?,
        None => output::print(&files::csv(&fields))?,
    }
    Ok(Ending::Done)
}

impl Arguments {
    fn options(&self, trained: &Trained, data: Option<Dataset>) -> Result<Generating> {
        let from = match (&self.initial_state, &self.sequence) {
            (Some(path), _) => From::Given(given_states(path, &trained.checkpoint)?),
            (None, Some(wanted)) => From::Sequence(wanted.clone()),
            (None, None) if self.mean => From::Mean,
            (None, None) => From::Learned,
        };
        let sensed = match self.mode {
            Mode::Open => 1.0,
            Mode::Closed => 0.0,
            Mode::Mixed => self.mixing,
        };
        Ok(Generating::with(|it| {
            (it.from, it.sensed, it.data) = (from, sensed, data);
            (it.open_channels, it.noise) = (self.open_channels.clone(), !self.no_noise);
            (it.steps, it.samples, it.seed) = (self.steps, self.samples as usize, self.seed);
            it.contexts = self.contexts;
        }))
    }
}

/// For each sequence, its name and its fields as lists of rows.
fn as_json(fields: &[(&str, Dataset)]) -> Value {
    let rows = |data: &Dataset, s: usize| -> Value {
        let sequence = &data.sequences()[s];
        (0..sequence.len()).map(|k| json!(sequence.sample(k))).collect()
    };
    let (_, first) = &fields[0];
    let sequence = |(s, sequence): (usize, &Sequence)| {
        let mut object = serde_json::Map::from_iter([("name".to_owned(), json!(sequence.name))]);
        object.extend(fields.iter().map(|(name, data)| ((*name).to_owned(), rows(data, s))));
        Value::Object(object)
    };
    json!({
        "channels": first.channels(),
        "sequences": first.sequences().iter().enumerate().map(sequence).collect::<Vec<_>>(),
    })
}
