//! `scrnn generate`: lets a trained network run (thesis 2.8).

mod onward;
mod starts;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::generation::{ChannelFeedback, Feedback, Generated, GenerationOptions, Start, generate};
use serde_json::{Value, json};

use crate::args::{Part, Shared};
use crate::output;
use crate::outputs::check_distinct;
use scrnn_data::{self as files, Field};
use scrnn_run::evaluation::Rest;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::members;
use scrnn_run::trained::Trained;
use starts::Row;

pub use starts::unit_names;

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

/// What is written: names and values.
type Fields = Vec<(&'static str, Dataset)>;

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
    let fields = match &arguments.from {
        Some(path) => onward::fields(arguments, path, &all, shared)?,
        None => mixed(arguments, &all, shared)?,
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

/// What one network generates; or a mixture, each member in loops of its own: the moments are those of the mixture, the samples those of
/// its members in turn.
fn mixed(arguments: &Arguments, all: &[Trained], shared: &Shared) -> Result<Fields> {
    if all.len() > 1 && (arguments.initial_state.is_some() || arguments.contexts) {
        let message = "initial states and contexts are those of one network, and this is a mixture";
        return Err(Failure::input(
            message,
            format!("give one of its members: {}", members::folder(&arguments.run, 1).display()),
        ));
    }
    let mut each = Vec::new();
    let mut of_first = Vec::new();
    for (m, trained) in all.iter().enumerate() {
        let feedback = feedback(arguments, &trained.checkpoint)?;
        let rows = starts::rows(
            (arguments, trained),
            (shared, shared.engine()?.threads()),
            feedback.0.iter().any(|channel| channel.sensed > 0.0),
        )?;
        let starts: Vec<Start<'_>> =
            rows.iter().map(|row| Start { initial_state: &row.state, sensed: &row.sensed }).collect();
        let options = GenerationOptions::new(rows.iter().map(|row| row.steps).max().unwrap_or(0), feedback)
            .seed(arguments.seed.wrapping_add(m as u64))
            .contexts(arguments.contexts);
        each.push(generate(&trained.network(), &starts, &options, &shared.engine()?)?);
        if m == 0 {
            of_first = rows;
        }
    }
    let Some(trained) = all.first() else { return Ok(Vec::new()) };
    let generated: Vec<Generated> = match each.as_slice() {
        [_] => each.swap_remove(0),
        _ => (0..of_first.len()).map(|row| mixture(&each, row)).collect(),
    };
    fields(&trained.checkpoint, &of_first, &generated)
}

/// The moments of what the members generated in a row, and the sample of one of them.
fn mixture(each: &[Vec<Generated>], row: usize) -> Generated {
    let loops: Vec<Generated> = each.iter().map(|one| one[row].clone()).collect();
    let mut rest = Rest::of(&loops, 0);
    let mut generated = Generated::default();
    generated.sample = rest.samples.swap_remove(row % each.len());
    (generated.mean, generated.variance) = (rest.mean, rest.variance);
    generated
}

/// How each channel is fed.
fn feedback(arguments: &Arguments, checkpoint: &Checkpoint) -> Result<Feedback> {
    let (n, noise) = (checkpoint.channels.len(), !arguments.no_noise);
    let sensed = match arguments.mode {
        Mode::Open => 1.0,
        Mode::Closed => 0.0,
        Mode::Mixed => arguments.mixing,
    };
    let mut feedback = Feedback::mixed(n, sensed, noise);
    for name in &arguments.open_channels {
        let channel = checkpoint.channels.iter().position(|channel| channel == name).ok_or_else(|| {
            let help = format!("the channels are {}", checkpoint.channels.join(", "));
            Failure::input(format!("the network has no channel `{name}`"), help)
        })?;
        feedback.0[channel] = ChannelFeedback { sensed: 1.0, noise };
    }
    Ok(feedback)
}

/// Mean, variance, sample and contexts of all rows, in the data's units, each row as long as it should be.
fn fields(checkpoint: &Checkpoint, rows: &[Row], generated: &[Generated]) -> Result<Fields> {
    let scaling = &checkpoint.scaling;
    let n = checkpoint.channels.len();
    let field = |channels: &[String], of: &dyn Fn(&Generated) -> Vec<f64>| -> Result<Dataset> {
        let mut sequences = Vec::with_capacity(rows.len());
        for (row, generated) in rows.iter().zip(generated) {
            let mut values = of(generated);
            values.truncate(row.steps * channels.len());
            check_finite(&row.name, &values, channels.len())?;
            sequences.push(Sequence::new(row.name.clone(), channels.len(), values)?);
        }
        Ok(Dataset::new(channels.to_vec(), sequences)?)
    };
    let raw = |values: &[f64]| values.iter().enumerate().map(|(k, &x)| scaling.to_raw(k % n, x)).collect::<Vec<_>>();
    let raw_variance = |generated: &Generated| {
        generated.variance.iter().enumerate().map(|(k, &v)| scaling.variance_to_raw(k % n, v)).collect::<Vec<_>>()
    };
    let mut fields = vec![("mean", field(&checkpoint.channels, &|generated| raw(&generated.mean))?)];
    if checkpoint.topology.has_variance() {
        fields.push(("variance", field(&checkpoint.channels, &raw_variance)?));
    }
    fields.push(("sample", field(&checkpoint.channels, &|generated| raw(&generated.sample))?));
    if generated.iter().any(|generated| !generated.contexts.is_empty()) {
        let names: Vec<String> = checkpoint.topology.groups().iter().flat_map(starts::unit_names).collect();
        fields.push(("context", field(&names, &|generated| generated.contexts.clone())?));
    }
    Ok(fields)
}

/// Refuses values of the sequence `name` that are not finite.
fn check_finite(name: &str, values: &[f64], channels: usize) -> Result<()> {
    let Some(index) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let step = index / channels + 1;
    Err(Failure::input(
        format!("sequence {name} left the finite numbers at step {step}"),
        "the network predicts variances without bound here: try --no-noise, or train it further",
    ))
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
