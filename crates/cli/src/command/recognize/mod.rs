//! `scrnn recognize`: which initial state makes the network predict a sequence best (thesis 2.9)? With `--online`: which
//! internal state explains what just happened (thesis 2.10.2)?

mod alike;
mod completing;
mod deadline;
mod locking;
mod online;
mod regression;

pub use deadline::Latency;
pub use regression::RegressionArguments;

use std::path::PathBuf;

use clap::Args;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::recognition::{Recognition, RecognitionOptions, recognize};
use serde::Serialize;

use crate::args::{Part, Shared};
use crate::command::generate::unit_names;
use crate::output;
use crate::outputs::check_distinct;
use completing::{Completion, complete};
use online::{How, Online};
use scrnn_data::{self as files, Field};
use scrnn_report::Table;
use scrnn_run::channel_scores::observed_error;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::members;
use scrnn_run::trained::Trained;

/// How many of the learned sequences the table names.
const NAMED: usize = 3;

/// Find the initial states from which a trained network predicts given sequences best
///
/// The weights stay as they are; each sequence's initial state climbs the likelihood from many starts: zero, the mean, the
/// learned states, and random ones around the mean. The table shows, for each sequence, the start that ended best, its
/// log-likelihood (nats per step and channel, in scaled units), its error (3.5) in the data's units, and the learned
/// sequences from whose own initial states the data are most likely.
///
/// With --online the network follows the samples one by one instead. Whenever one arrives, the internal state at the tail
/// of a sliding window climbs the likelihood of the window, and the next samples are predicted anew. DATA `-` reads
/// lines from the standard input and answers each at once. A line holds a number for each channel, between commas, semicolons,
/// tabs or spaces, in the network's order or in that of a first line with all the names; or it is a JSON object with the
/// channels as keys, or with the lists `name` and `position`; no key twice. A blank line ends a sequence, a last line without
/// its end is no sample. An empty field, null, a number that is not finite, and one that lies 1e12 times as far out as
/// anything that was learned are missing: a warning goes to stderr, and the network's own prediction stands in for that value.
///
/// With --json each answer is an object: `sample` (its number, from 1), `mean` and `variance` of the next sample in the data's
/// units (empty before the network's delay is over), `forecast` (the means of the --ahead samples after it), `ln_likelihood`
/// (nats per step and regarded channel of the window, before and after the regression; null where there was none), `locked` (whether the
/// window is as likely as what was learned, but for one nat per step and channel: else the forecast is not to be relied on),
/// `milliseconds`, and `missing` (names, if any). With --full it holds `iterations`, `error` and `view` (`from`, `smoothed`,
/// `contexts`, `predicted`, `variance`) instead.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn recognize runs/lissajous new.csv
  scrnn recognize runs/lissajous new.csv --starts 40 --out states.npz
  scrnn recognize runs/lissajous new.csv --observed 100 --completed whole.csv
  scrnn recognize runs/lissajous new.csv --observed 100 --samples 50 --completed rest.npz
  scrnn generate runs/lissajous --initial-state states.npz
  scrnn recognize runs/interact new.csv --online --deadline 5
  robot | scrnn recognize runs/interact - --online --json | controller")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// The sequences to recognise: a data file, a folder of them or a pattern; with --online also `-`, the standard input
    data: PathBuf,
    #[command(flatten)]
    part: Part,
    /// Number of starts for each sequence, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    starts: u32,
    /// Number of updates from each start, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u64).range(0..=1_000_000))]
    epochs: u64,
    /// Recognise from the first N samples, 1 to 1000000000, and complete the rest
    #[arg(long, value_name = "N", value_parser = crate::args::count(1, 1_000_000_000))]
    observed: Option<usize>,
    /// With --observed: complete by N closed loops with noise, 1 to 10000, from several states that explain what was observed. Mean and variance of the
    /// rest are those of all of them
    #[arg(long, value_name = "N", requires = "observed", value_parser = crate::args::count(1, 10_000))]
    samples: Option<usize>,
    /// Rate of the ascent, more than 0, at most 1e6 [default: one that suits most networks]
    #[arg(long, value_name = "RATE", value_parser = crate::args::positive(1e6))]
    rate: Option<f64>,
    /// Seed of the random starts, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Write the best initial states, for `scrnn generate --initial-state`; with --online, each sample as predicted and as
    /// smoothed
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// With --observed: write the sequences with their rest as predicted
    #[arg(long, value_name = "FILE", requires = "observed")]
    completed: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    online: Online,
    #[command(flatten)]
    regression: RegressionArguments,
}

/// What was found for one sequence.
#[derive(Debug, Serialize)]
struct Found {
    /// Its name.
    sequence: String,
    /// The kind of start that ended best.
    start: String,
    /// Nats per step and channel, in scaled units; none without variance units.
    ln_likelihood: Option<f64>,
    /// (3.5), in the data's units.
    error: f64,
    /// With --observed: (3.5) over the samples that were not observed.
    completion_error: Option<f64>,
    /// With --samples: the rest as a distribution.
    #[serde(skip_serializing_if = "Option::is_none")]
    completion: Option<Completion>,
    /// What each member of a mixture found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    members: Vec<Found>,
    /// The best initial state; empty for a mixture, whose members have their own.
    initial_state: Vec<f64>,
    /// The learned sequences, most likely first.
    learned: Vec<Learned>,
    /// All starts, best first.
    trials: Vec<Tried>,
}

/// How likely a learned sequence's initial state makes the data; where all share one, how far its contexts are off.
#[derive(Debug, Serialize)]
struct Learned {
    /// Its number, from 1.
    number: usize,
    sequence: String,
    ln_likelihood: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    distance: Option<f64>,
}

/// Where one start ended.
#[derive(Debug, Serialize)]
struct Tried {
    start: String,
    ln_likelihood: Option<f64>,
}

/// Recognises.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    check_distinct(
        &[("--out", arguments.out.as_deref()), ("--completed", arguments.completed.as_deref())],
        &[("DATA", Some(&arguments.data)), ("RUN", Some(&arguments.run))],
    )?;
    if arguments.online.wanted() {
        let Arguments { run, data, part, best, rate, out, json, regression, .. } = arguments;
        let how = How { regression, rate: *rate };
        return online::run(&arguments.online, (run, *best), (data, part), (&how, out.as_deref(), *json), shared);
    }
    if arguments.regression.given() {
        return Err(Failure::input("options of error regression go with --online", "add --online, or leave them out"));
    }
    let all = members::open(&arguments.run, arguments.best)?;
    all.iter().for_each(|trained| shared.say_of(trained));
    let Some(trained) = all.first() else { return Ok(Ending::Done) };
    if all.len() > 1 && arguments.out.is_some() {
        let message = "--out writes the states of one network, and this is a mixture";
        return Err(Failure::input(
            message,
            format!("give one of its members: {}", members::folder(&arguments.run, 1).display()),
        ));
    }
    let checkpoint = &trained.checkpoint;
    let part = arguments.part.of(&arguments.data, trained.selection());
    let data = files::read_all(&[&arguments.data], &part)?.data;
    let data = trained.fitted_aloud(data, &arguments.data, shared)?;
    data.check_for(&checkpoint.topology)?;
    let delay = checkpoint.topology.delay();
    if let Some(observed) = arguments.observed.filter(|observed| *observed <= delay) {
        let message = format!("--observed {observed} leaves nothing to predict: the network's delay is {delay}");
        return Err(Failure::input(message, format!("observe at least {} samples", delay + 1)));
    }
    let scaled = checkpoint.scaling.apply(&data)?;
    let engine = shared.engine()?;
    let heard = arguments.observed.unwrap_or(usize::MAX);
    let (mut recognitions, mut generated) = (Vec::new(), Vec::new());
    for one in &all {
        let states = &one.checkpoint.initial_states;
        let found = recognize(&one.network(), states, &scaled, &options(arguments, one), &engine)?;
        generated.push(replay(one, &scaled, &found, heard, &engine)?);
        recognitions.push(found);
    }
    let mut found = (0..scaled.sequences().len())
        .map(|s| summary_of_all(&all, &data.sequences()[s], (&recognitions, &generated), s, heard))
        .collect::<Vec<_>>();
    let by_likeness = alike::share_one_state(trained);
    if by_likeness {
        alike::rank(trained, &data, heard, &mut found, shared)?;
    }

    if let Some(path) = &arguments.out {
        let states = states(trained, &data, &recognitions[0])?;
        files::write(path, &[Field { name: "", data: &states }])?;
    }
    if let Some(loops) = arguments.samples {
        let networks: Vec<_> = all.iter().map(Trained::network).collect();
        let mixture = members::mixed(&all, &networks);
        let noise = (loops, arguments.seed);
        let completions = complete(trained, (&mixture, &recognitions), (&data, heard), noise, &engine)?;
        if let Some(path) = &arguments.completed {
            let fields = completing::fields(&data, heard, &completions)?;
            let fields: Vec<Field<'_>> = fields.iter().map(|(name, data)| Field { name, data }).collect();
            files::write(path, &fields)?;
        }
        for (found, completion) in found.iter_mut().zip(completions) {
            found.completion_error = completion.as_ref().map(|completion| completion.error);
            found.completion = completion;
        }
    } else if let Some(path) = &arguments.completed {
        let means: Vec<Vec<f64>> = (0..found.len()).map(|s| mean_of_all(&all, &generated, s)).collect();
        let whole = completed(trained, &data, &means, heard)?;
        files::write(path, &[Field { name: "", data: &whole }])?;
    }
    if arguments.json {
        output::print_json_line(&serde_json::json!({ "sequences": found }))?;
    } else {
        output::print(&table(&found, arguments.observed.is_some(), by_likeness))?;
    }
    Ok(Ending::Done)
}

/// What was found for sequence `s` by one network, or by all members of a mixture: the likelihoods are those of the mean of the members'
/// densities, and the means those of their means.
fn summary_of_all(
    all: &[Trained],
    sequence: &Sequence,
    (recognitions, generated): (&[Vec<Recognition>], &[Vec<Generated>]),
    s: usize,
    heard: usize,
) -> Found {
    let mut each: Vec<Found> = (all.iter().zip(recognitions).zip(generated))
        .map(|((one, recognitions), generated)| {
            summary(one, sequence, &recognitions[s], &raw_means(one, &generated[s]), heard)
        })
        .collect();
    if let [_] = each.as_slice() {
        return each.swap_remove(0);
    }
    let mean = mean_of_all(all, generated, s);
    let mut found = summary(&all[0], sequence, &recognitions[0][s], &mean, heard);
    let delay = all[0].checkpoint.topology.delay();
    let terms = sequence.targets(delay, heard.min(sequence.len()) - delay).max(1) as f64;
    let mixed = |values: &[f64]| {
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = values.iter().map(|value| (terms * (value - largest)).exp()).sum::<f64>() / all.len() as f64;
        largest + mean.ln() / terms
    };
    let likelihoods: Option<Vec<f64>> = each.iter().map(|one| one.ln_likelihood).collect();
    found.ln_likelihood = likelihoods.map(|values| mixed(&values));
    for learned in &mut found.learned {
        let of = |one: &Found| one.learned.iter().find(|other| other.number == learned.number)?.ln_likelihood;
        // What a member does not rank is too unlikely to count.
        let values: Vec<f64> = each.iter().filter_map(of).collect();
        learned.ln_likelihood = (!values.is_empty()).then(|| mixed(&values));
    }
    let order = |a: &Learned, b: &Learned| {
        let value = |one: &Learned| one.ln_likelihood.unwrap_or(f64::NEG_INFINITY);
        value(b).total_cmp(&value(a))
    };
    found.learned.sort_by(order);
    found.start = format!("mixture of {}", all.len());
    (found.initial_state, found.trials) = (Vec::new(), Vec::new());
    found.members = each;
    found
}

/// The predicted means of sequence `s` in the data's units, averaged over the members.
fn mean_of_all(all: &[Trained], generated: &[Vec<Generated>], s: usize) -> Vec<f64> {
    let each: Vec<Vec<f64>> = all.iter().zip(generated).map(|(one, generated)| raw_means(one, &generated[s])).collect();
    match each.as_slice() {
        [one] => one.clone(),
        _ => (0..each[0].len()).map(|at| each.iter().map(|one| one[at]).sum::<f64>() / each.len() as f64).collect(),
    }
}

fn options(arguments: &Arguments, trained: &Trained) -> RecognitionOptions {
    let mut options = RecognitionOptions::with(|it| {
        it.starts = arguments.starts as usize;
        it.epochs = arguments.epochs;
        it.seed = arguments.seed;
        it.observed = arguments.observed;
    });
    if let Some(rate) = arguments.rate {
        options.rate = rate;
    }
    let variance = |notes: &scrnn_run::notes::Notes| notes.experiment["network"]["initial_state_variance"].as_f64();
    if let Some(variance) = trained.notes.as_ref().and_then(variance) {
        options.initial_state_variance = variance;
    }
    options
}

/// Runs each sequence from its best initial state: fed with what was heard, then with its own predictions.
fn replay(
    trained: &Trained,
    scaled: &Dataset,
    recognitions: &[Recognition],
    heard: usize,
    engine: &Engine,
) -> Result<Vec<Generated>> {
    let n = scaled.channels().len();
    let starts: Vec<Start<'_>> = recognitions
        .iter()
        .zip(scaled.sequences())
        .map(|(recognition, sequence)| Start {
            initial_state: &recognition.trials[0].initial_state,
            sensed: &sequence.values()[..heard.min(sequence.len()) * n],
        })
        .collect();
    let longest = scaled.sequences().iter().map(Sequence::len).max().unwrap_or(0);
    let steps = longest - trained.checkpoint.topology.delay();
    let options = GenerationOptions::new(steps, Feedback::mixed(n, 1.0, false)).seed(0);
    Ok(generate(&trained.network(), &starts, &options, engine)?)
}

fn summary(trained: &Trained, sequence: &Sequence, recognition: &Recognition, means: &[f64], heard: usize) -> Found {
    let checkpoint = &trained.checkpoint;
    let (n, delay) = (checkpoint.channels.len(), checkpoint.topology.delay());
    let heard = heard.min(sequence.len());
    // What is missing does not count.
    let terms = sequence.targets(delay, heard - delay).max(1) as f64;
    let per_value = |ln_likelihood: f64| checkpoint.topology.has_variance().then(|| ln_likelihood / terms);
    let error = |samples: std::ops::Range<usize>| {
        let predicted = &means[(samples.start - delay) * n..(samples.end - delay) * n];
        observed_error(&sequence.values()[samples.start * n..samples.end * n], predicted)
    };
    let best = &recognition.trials[0];
    Found {
        sequence: sequence.name.clone(),
        start: best.start.to_string(),
        ln_likelihood: per_value(best.ln_likelihood),
        error: error(delay..heard),
        completion_error: (heard < sequence.len()).then(|| error(heard..sequence.len())),
        completion: None,
        members: Vec::new(),
        initial_state: best.initial_state.clone(),
        learned: recognition
            .ranking
            .iter()
            .map(|ranked| Learned {
                number: ranked.sequence + 1,
                sequence: checkpoint.sequences[ranked.sequence].clone(),
                ln_likelihood: per_value(ranked.ln_likelihood),
                distance: None,
            })
            .collect(),
        trials: recognition
            .trials
            .iter()
            .map(|trial| Tried { start: trial.start.to_string(), ln_likelihood: per_value(trial.ln_likelihood) })
            .collect(),
    }
}

/// One row for each sequence, one column for each context unit.
fn states(trained: &Trained, data: &Dataset, recognitions: &[Recognition]) -> Result<Dataset> {
    let topology = &trained.checkpoint.topology;
    let units: Vec<String> = topology.groups().iter().flat_map(unit_names).collect();
    let rows = data.sequences().iter().zip(recognitions).map(|(sequence, recognition)| {
        Sequence::new(sequence.name.clone(), units.len(), recognition.trials[0].initial_state.clone())
    });
    Ok(Dataset::new(units.clone(), rows.collect::<scrnn::error::Result<_>>()?)?)
}

/// What was heard, followed by what the network makes of it.
fn completed(trained: &Trained, data: &Dataset, means: &[Vec<f64>], heard: usize) -> Result<Dataset> {
    let checkpoint = &trained.checkpoint;
    let (n, delay) = (checkpoint.channels.len(), checkpoint.topology.delay());
    let rows = data.sequences().iter().zip(means).map(|(sequence, means)| {
        let known = heard.min(sequence.len());
        let mut values = sequence.values()[..known * n].to_vec();
        values.extend(&means[(known - delay) * n..(sequence.len() - delay) * n]);
        Sequence::new(sequence.name.clone(), n, values)
    });
    Ok(Dataset::new(data.channels().to_vec(), rows.collect::<scrnn::error::Result<_>>()?)?)
}

/// The predicted means in the data's units.
fn raw_means(trained: &Trained, generated: &Generated) -> Vec<f64> {
    let scaling = &trained.checkpoint.scaling;
    generated.mean.iter().enumerate().map(|(k, &mean)| scaling.to_raw(k % scaling.channels(), mean)).collect()
}

fn table(found: &[Found], completed: bool, by_likeness: bool) -> String {
    let likelihood = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    let mut head = vec!["sequence", "start", "ln L", "error"];
    let distribution = found.iter().any(|one| one.completion.is_some());
    if completed {
        head.push("error beyond");
    }
    if distribution {
        head.push("nll beyond");
        head.push("within 1, 2 sd");
    }
    head.push(match by_likeness {
        true => "learned sequences most alike (distance of contexts)",
        false => "most likely learned sequences (ln L)",
    });
    let mut table = Table::new(&head);
    for Found { sequence, start, ln_likelihood, error, completion_error, completion, learned, .. } in found {
        let mut row = vec![sequence.clone(), start.clone(), likelihood(*ln_likelihood), format!("{error:.3e}")];
        if completed {
            row.push(completion_error.map_or("-".to_owned(), |error| format!("{error:.3e}")));
        }
        if distribution {
            row.extend(completion.as_ref().map_or(["-", "-"].map(String::from), Completion::told));
        }
        let named = learned.iter().take(NAMED).map(|one| {
            let name =
                if one.sequence == one.number.to_string() { String::new() } else { format!(" {}", one.sequence) };
            let value = match (one.ln_likelihood, one.distance) {
                (Some(value), _) => format!(" ({value:.4})"),
                (None, Some(distance)) => format!(" ({distance:.1e})"),
                (None, None) => String::new(),
            };
            format!("{}{name}{value}", one.number)
        });
        row.push(named.collect::<Vec<_>>().join(", "));
        table.row(row);
    }
    table.to_string()
}
