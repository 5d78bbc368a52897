//! `scrnn recognize --online`: error regression while samples arrive (thesis 2.10.2).

use std::fmt::Write as _;
use std::io::{self, BufReader};
use std::path::Path;
use std::sync::Arc;

use clap::Args;
use scrnn::engine::Engine;
use scrnn::error_regression::{ErrorRegressionOptions, Regression};
use serde_json::json;

use super::regression::RegressionArguments;
use crate::args::{Part, Shared};
use crate::output::{self, Reader};
use crate::watching::Watch;
use scrnn_data::{self as files, Field};
use scrnn_pages::live::{Heading, SampleBySample};
use scrnn_report::Table;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::familiar::{self, Range, Unfamiliar, is_far};
use scrnn_run::following::{self, Begin, Followed, Following, Latency, follow_watched};
use scrnn_run::stream::{Arrival, Stream};
use scrnn_run::trained::Trained;

/// Seconds between two samples of a file that does not say, where they are watched.
const PERIOD: f64 = 0.1;

/// How to follow.
#[derive(Debug, Args)]
#[command(next_help_heading = "Options of --online")]
pub struct Online {
    /// Follow the samples one by one: regress over a sliding window whenever one arrives, and predict the next
    #[arg(long, conflicts_with_all = ["observed", "completed", "starts", "epochs", "seed"])]
    online: bool,
    /// Samples to predict beyond the next one, 0 to 100000
    #[arg(long, value_name = "N", default_value_t = 10, requires = "online", value_parser = crate::args::count(0, 100_000))]
    ahead: usize,
    /// Channels whose input is the network's own prediction, as those of an arm that it moves
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "online")]
    closed_channels: Vec<String>,
    /// Channels whose errors are not regressed on
    #[arg(long, alias = "unheeded-channels", value_name = "NAME,...", value_delimiter = ',', requires = "online")]
    masked_channels: Vec<String>,
    /// Start from the state of the learned sequence of this name or, counted from 1, number [default: their mean for the first samples,
    /// then the state from which these are most likely]
    #[arg(long, value_name = "NAME|K", requires = "online")]
    sequence: Option<String>,
    /// Start from the mean of the learned states, and stay with that
    #[arg(long, requires = "online", conflicts_with = "sequence")]
    mean: bool,
    /// In the JSON object, show the window and the forecast at these samples, each 1 to 1000000000
    #[arg(long, value_name = "K,...", value_delimiter = ',', requires_all = ["online", "json"],
        value_parser = crate::args::count(1, 1_000_000_000))]
    at: Vec<usize>,
    /// In the lines of a stream, show the whole window, its contexts and the number of updates as well
    #[arg(long, requires_all = ["online", "json"])]
    full: bool,
    #[command(flatten)]
    watch: Watch,
}

impl Online {
    /// Whether it is asked for.
    pub fn wanted(&self) -> bool {
        self.online
    }

    fn options(&self, how: &How<'_>, trained: &Trained) -> Result<ErrorRegressionOptions> {
        let channels = &trained.checkpoint.channels;
        let mut options = how.regression.options(ErrorRegressionOptions::new(channels.len()), how.rate)?;
        options.ahead = self.ahead;
        for (names, shares) in
            [(&self.closed_channels, &mut options.sensed), (&self.masked_channels, &mut options.mask)]
        {
            for name in names {
                let channel = channels.iter().position(|channel| channel == name).ok_or_else(|| {
                    let help = format!("the channels are {}", channels.join(", "));
                    Failure::input(format!("the network has no channel `{name}`"), help)
                })?;
                shares[channel] = 0.0;
            }
        }
        Ok(options)
    }

    fn begin(&self) -> Begin {
        match &self.sequence {
            Some(wanted) => Begin::Sequence(wanted.clone()),
            None if self.mean => Begin::Mean,
            None => Begin::Likely,
        }
    }

    /// Begins to show what happens, if that is wanted. `period` is that of the samples; a stream comes at its own pace.
    fn showing(&self, trained: &Trained, what: &str, period: Option<f64>) -> Result<SampleBySample> {
        let (title, channels) = (format!("Following {what}"), &trained.checkpoint.channels);
        let scaling = &trained.checkpoint.scaling;
        let heading = Heading { title: &title, channels, scaling, unit: "samples", pace: None };
        Ok(SampleBySample::on(self.watch.start(&heading, period)?))
    }

    /// Begins to follow.
    fn following(&self, how: &How<'_>, trained: &Arc<Trained>, engine: &Engine) -> Result<Following> {
        let options = self.options(how, trained)?;
        Following::new(trained.clone(), options, self.begin(), how.regression.clock()?, engine.clone())
    }
}

/// How to regress.
#[derive(Debug, Clone, Copy)]
pub struct How<'a> {
    /// The options.
    pub regression: &'a RegressionArguments,
    /// The rate, if it was given.
    pub rate: Option<f64>,
}

/// Follows recorded sequences, or a stream on the standard input.
pub fn run(
    online: &Online,
    (run, best): (&Path, bool),
    (data, part): (&Path, &Part),
    (how, out, as_json): (&How<'_>, Option<&Path>, bool),
    shared: &Shared,
) -> Result<Ending> {
    let trained = Arc::new(Trained::open(run, best)?);
    shared.say_of(&trained);
    if data == Path::new("-") {
        if out.is_some() || !online.at.is_empty() {
            return Err(Failure::input("--out and --at do not go with a stream", "it is printed as it comes"));
        }
        if online.watch.has_speed() {
            return Err(Failure::input("--speed does not go with a stream", "it comes at its own pace"));
        }
        return stream(online, how, &trained, as_json, shared);
    }
    let read = files::read_all(&[data], &part.of(data, trained.selection()))?;
    let name = data.display().to_string();
    let data = trained.fitted_aloud(read.data, data, shared)?;
    let engine = shared.engine()?;
    let mut followed = Vec::new();
    let mut shown = online.showing(&trained, &name, Some(read.period.unwrap_or(PERIOD)))?;
    for sequence in data.sequences() {
        shown.begin(&sequence.name);
        let watch = &mut |session: &Following, sample: &[f64], done: &Regression| shown.sample(session, sample, done);
        followed.push(follow_watched(online.following(how, &trained, &engine)?, sequence, &online.at, watch)?);
    }
    shown.finish();
    for one in followed.iter().filter(|one| one.steps.last().is_some_and(|step| step.locked == Some(false))) {
        shared.say(format_args!(
            "{} was not found: the window at its end is less likely than what was learned, by more than a nat per step and channel",
            one.sequence
        ));
    }
    if let Some(path) = out {
        let fields = following::fields(&trained, &followed)?;
        files::write(path, &fields.iter().map(|(name, data)| Field { name, data }).collect::<Vec<_>>())?;
    }
    if as_json {
        output::print_json_line(&json!({ "sequences": followed }))?;
    } else {
        output::print(&table(&followed))?;
    }
    Ok(Ending::Done)
}

/// One line of output for each line of input. Ends when whoever reads it has left.
fn stream(online: &Online, how: &How<'_>, trained: &Arc<Trained>, as_json: bool, shared: &Shared) -> Result<Ending> {
    let channels = &trained.checkpoint.channels;
    let engine = shared.engine()?;
    let mut lines = Stream::new(BufReader::new(io::stdin()), channels);
    let mut session = online.following(how, trained, &engine)?;
    let mut warned = Warned { far: vec![false; channels.len()], ..Warned::default() };
    let known = familiar::learned(trained);
    let mut locked = None;
    let mut reader = Reader::Listens;
    let mut shown = online.showing(trained, "the standard input", None)?;
    if !as_json {
        reader = output::offer(&format!("sample,iterations,milliseconds,{}\n", channels.join(",")))?;
    }
    while reader == Reader::Listens {
        let sample = match lines.next()? {
            None => break,
            Some(Arrival::Sample(sample)) => sample,
            Some(Arrival::Gap) => {
                if session.taken() > 0 {
                    session = session.begin_anew()?;
                    shown.begin("another sequence");
                }
                continue;
            }
        };
        let done = session.observe(&sample)?;
        for &channel in session.missing() {
            warned.missing(lines.line_number(), &channels[channel], sample[channel], shared);
        }
        for (channel, &value) in sample.iter().enumerate().filter(|(channel, _)| !session.missing().contains(channel)) {
            warned.far(lines.line_number(), (&channels[channel], channel), (known[channel], value), shared);
        }
        let now = session.told(&done, false).locked;
        if now.is_some() && now != locked && !as_json {
            let found = if now == Some(true) { "found" } else { "not found" };
            shared.say(format_args!("sample {}: what is followed is {found} among what was learned", session.taken()));
        }
        locked = now.or(locked);
        reader = match (as_json, online.full) {
            (true, true) => output::offer_json_line(&session.told(&done, true))?,
            (true, false) => output::offer_json_line(&session.answer(&done))?,
            (false, _) => output::offer(&row(&session, &done))?,
        };
        shown.sample(&session, &sample, &done);
    }
    shown.finish();
    if lines.is_unfinished() {
        shared.say("the last line of the stream has no end: it is no sample");
    }
    if let Some(latency) = session.latency() {
        shared.say(told_latency(&latency));
    }
    Ok(Ending::Done)
}

/// The next sample as predicted, as a row of a table.
fn row(session: &Following, done: &Regression) -> String {
    let milliseconds = 1e3 * session.last_took().as_secs_f64();
    let mut line = format!("{},{},{milliseconds:.3}", session.taken(), done.iterations);
    let mean = session.next_mean();
    for channel in 0..session.trained().checkpoint.channels.len() {
        match &mean {
            Some(mean) => write!(line, ",{:?}", mean[channel]),
            None => line.write_char(','),
        }
        .expect("a string takes all");
    }
    line.push('\n');
    line
}

/// Warnings about values that are taken as missing: the 1st, 2nd, 4th, 8th, ...; and about the first of each channel that is
/// far from what was learned.
#[derive(Debug, Default)]
struct Warned {
    missing: u64,
    far: Vec<bool>,
}

impl Warned {
    fn missing(&mut self, line: usize, channel: &str, value: f64, shared: &Shared) {
        self.missing += 1;
        if self.missing.is_power_of_two() {
            let what =
                if value.is_finite() { format!("{value:e}, far beyond what was learned") } else { "missing".into() };
            let so_far = if self.missing > 1 { format!(" ({} values so far)", self.missing) } else { String::new() };
            shared.say(format_args!("line {line}, {channel} is {what}: the network's prediction stands in{so_far}",));
        }
    }

    fn far(&mut self, line: usize, (name, channel): (&str, usize), (known, value): (Range, f64), shared: &Shared) {
        if !self.far[channel] && is_far(known, value) {
            self.far[channel] = true;
            let what = Unfamiliar { channel: name.to_owned(), learned: known, found: (value, value), units: false };
            shared.say(format_args!("warning: line {line}: {what}"));
        }
    }
}

fn table(followed: &[Followed]) -> String {
    let pair = |pair: [f64; 2], digits: usize| format!("{:.digits$} -> {:.digits$}", pair[0], pair[1]);
    let deadline = followed.iter().any(|one| one.latency.is_some_and(|latency| latency.missed.is_some()));
    let mut head = vec![
        "sequence",
        "samples",
        "ln L in the window",
        "error of prediction",
        "locked on",
        "median ms",
        "99 % ms",
        "longest ms",
    ];
    if deadline {
        head.push("missed");
    }
    let mut table = Table::new(&head);
    for one in followed {
        let mut row = vec![
            one.sequence.clone(),
            one.samples.to_string(),
            one.ln_likelihood.map_or("-".to_owned(), |found| pair(found, 3)),
            format!("{:.3e}", one.prediction_error),
            one.locked.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share)),
        ];
        if let Some(Latency { median, p99, longest, missed, .. }) = one.latency {
            row.extend([median, p99, longest].map(|ms| format!("{ms:.3}")));
            row.extend(missed.map(|missed| missed.to_string()));
        }
        table.row(row);
    }
    table.to_string()
}

fn told_latency(latency: &Latency) -> String {
    let Latency { median, p99, longest, missed, .. } = latency;
    let missed = missed.map_or(String::new(), |missed| format!(", {missed} missed the deadline"));
    format!("{median:.3} ms a sample, 99 % within {p99:.3} ms, longest {longest:.3} ms{missed}")
}
