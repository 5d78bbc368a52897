//! `scrnn recognize`: which initial state makes the network predict a sequence best (thesis 2.9)? With `--online`: which
//! internal state explains what just happened (thesis 2.10.2)?

mod online;
mod regression;

pub use regression::RegressionArguments;

use std::path::PathBuf;

use clap::Args;

use crate::args::{Part, Shared};
use crate::output;
use crate::outputs::check_distinct;
use online::{How, Online};
use scrnn_data::{self as files, Field};
use scrnn_report::Table;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::members;
use scrnn_run::recognising::{Completion, Found, Recognising, recognising};

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
/// `milliseconds`, and `missing` (names, if any). With --full it holds `iterations`, `given_up` (whether the network predicted the window
/// better without regression, and goes on so), `error` and `view` (`from`, `smoothed`,
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
    let part = arguments.part.of(&arguments.data, trained.selection());
    let data = files::read_all(&[&arguments.data], &part)?.data;
    let data = trained.fitted_aloud(data, &arguments.data, shared)?;
    let options = Recognising::with(|it| {
        (it.starts, it.epochs, it.seed) = (arguments.starts as usize, arguments.epochs, arguments.seed);
        (it.observed, it.samples) = (arguments.observed, arguments.samples);
        it.rate = arguments.rate.or(it.rate);
    });
    let recognised = recognising(&all, &data, &options, (&shared.engine()?, shared))?;
    if let Some(path) = &arguments.out {
        files::write(path, &[Field { name: "", data: &recognised.states()? }])?;
    }
    if let Some(path) = &arguments.completed {
        let fields = recognised.completed()?;
        files::write(path, &fields.iter().map(|(name, data)| Field { name, data }).collect::<Vec<_>>())?;
    }
    let found = &recognised.sequences;
    if arguments.json {
        output::print_json_line(&serde_json::json!({ "sequences": found }))?;
    } else {
        output::print(&table(found, arguments.observed.is_some(), recognised.by_likeness))?;
    }
    Ok(Ending::Done)
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
