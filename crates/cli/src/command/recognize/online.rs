//! `scrnn recognize --online`: error regression while samples arrive (thesis 2.10.2).

use std::fmt::Write as _;
use std::io::{self, BufReader};
use std::path::Path;

use clap::Args;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions, Regression};
use serde::Serialize;
use serde_json::json;

use super::deadline::{Deadline, Latency};
use super::locking::{self, Choice};
use super::regression::RegressionArguments;
use crate::args::{Part, Shared};
use crate::command::generate::unit_names;
use crate::output::{self, Reader};
use scrnn_data::{self as files, Field};
use scrnn_report::Table;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::familiar::{self, Range, Unfamiliar, is_far};
use scrnn_run::memory::{self, product};
use scrnn_run::stream::{Arrival, Stream};
use scrnn_run::trained::{TOO_FAR, Trained};

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
}

impl Online {
    /// Whether it is asked for.
    pub fn wanted(&self) -> bool {
        self.online
    }

    fn options(&self, how: &How<'_>, trained: &Trained) -> Result<ErrorRegressionOptions> {
        let channels = &trained.checkpoint.channels;
        let mut options = how.regression.options(how.rate, channels.len())?;
        options.ahead = self.ahead;
        let units = trained.checkpoint.topology.context_units();
        let bytes = product(&[options.window + options.ahead, 2 * units + 4 * channels.len(), size_of::<f64>()]);
        memory::check("a window of that length", bytes)?;
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

    fn start<'a>(&self, trained: &'a Trained) -> Result<&'a [f64]> {
        let learned = &trained.checkpoint.initial_states;
        match &self.sequence {
            None => Ok(learned.mean()),
            Some(wanted) => Ok(learned.sequence(trained.sequence(wanted)?)),
        }
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

/// What became of one sample.
#[derive(Debug, Serialize)]
struct Observed {
    /// Its number, from 1.
    sample: usize,
    /// Updates of the internal state.
    iterations: usize,
    /// Nats per step and channel of the window before and after; none without variance units.
    ln_likelihood: Option<[f64; 2]>,
    /// (3.5) over the window before and after, in scaled units.
    error: Option<[f64; 2]>,
    /// Whether the window is as likely as what was learned, but for one nat per step and channel.
    locked: Option<bool>,
    milliseconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    view: Option<View>,
}

/// What a stream is answered with, in the data's units; the keys are explained in the help.
#[derive(Debug, Serialize)]
struct Answer<'a> {
    sample: usize,
    mean: Vec<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    variance: Vec<f64>,
    forecast: Vec<Vec<f64>>,
    ln_likelihood: Option<[f64; 2]>,
    locked: Option<bool>,
    milliseconds: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    missing: Vec<&'a str>,
}

/// The network's view at one moment, in the data's units: rows of channels, or of context units.
#[derive(Debug, Serialize)]
struct View {
    /// Number of the window's first sample, from 1.
    from: usize,
    /// What the window now says about its samples.
    smoothed: Vec<Vec<f64>>,
    /// The contexts that go with them.
    contexts: Vec<Vec<f64>>,
    /// What is predicted of the samples to come.
    predicted: Vec<Vec<f64>>,
    variance: Vec<Vec<f64>>,
}

/// One sequence, whole.
#[derive(Debug, Serialize)]
struct Followed {
    sequence: String,
    samples: usize,
    /// Averages over all samples.
    ln_likelihood: Option<[f64; 2]>,
    error: [f64; 2],
    /// (3.5) of each sample against what it was predicted as just before, in the data's units.
    prediction_error: f64,
    /// Share of the samples at which the window was as likely as what was learned, but for one nat per step and channel.
    locked: Option<f64>,
    latency: Option<Latency>,
    steps: Vec<Observed>,
    #[serde(skip)]
    rows: Rows,
}

/// What goes into a file: a row for each sample from the first predicted one on.
#[derive(Debug, Default)]
struct Rows {
    mean: Vec<f64>,
    variance: Vec<f64>,
    smoothed: Vec<f64>,
    context: Vec<f64>,
}

/// A network that follows one sequence.
struct Session<'a> {
    trained: &'a Trained,
    regression: ErrorRegression,
    deadline: Deadline,
    taken: usize,
    scaled: Vec<f64>,
    /// Channels whose values are not there in the sample that came last.
    missing: Vec<usize>,
    /// Channels whose errors are regressed on.
    heeded: usize,
    /// Waits for the first samples, unless it is said where to start.
    choice: Option<Choice>,
    options: ErrorRegressionOptions,
    engine: &'a Engine,
}

impl<'a> Session<'a> {
    fn new(online: &Online, how: &How<'_>, trained: &'a Trained, engine: &'a Engine) -> Result<Self> {
        let options = online.options(how, trained)?;
        let start = online.start(trained)?;
        let heeded = options.mask.iter().filter(|share| **share > 0.0).count();
        let regression = ErrorRegression::new(&trained.network(), start, options.clone(), engine)?;
        let choice = (!online.mean && online.sequence.is_none()).then(|| Choice::new(trained));
        let (deadline, scaled) = (how.regression.clock()?, vec![0.0; trained.checkpoint.channels.len()]);
        let missing = Vec::new();
        Ok(Self { trained, regression, deadline, taken: 0, scaled, missing, heeded, choice, options, engine })
    }

    fn observe(&mut self, sample: &[f64]) -> Result<Regression> {
        let scaling = &self.trained.checkpoint.scaling;
        self.missing.clear();
        for (channel, (scaled, raw)) in self.scaled.iter_mut().zip(sample).enumerate() {
            let value = scaling.to_scaled(channel, *raw);
            if value.is_finite() && value.abs() < TOO_FAR {
                *scaled = value;
                continue;
            }
            self.missing.push(channel);
            // It does not count; the network's own prediction stands in as an input.
            *scaled = f64::NAN;
        }
        self.taken += 1;
        if let Some(choice) = &mut self.choice
            && choice.take(&self.scaled)
        {
            if let Some(better) = choice.begin(self.trained, self.options.clone(), self.engine)? {
                self.regression = better;
            }
            self.choice = None;
        }
        let (regression, scaled) = (&mut self.regression, &self.scaled);
        Ok(self.deadline.sample(|go_on| regression.observe(scaled, go_on))?)
    }

    fn told(&self, done: &Regression, view: bool, ahead: usize) -> Observed {
        let values = (done.steps * self.heeded) as f64;
        let has_variance = self.trained.checkpoint.topology.has_variance();
        let regressed = done.iterations > 0 && self.heeded > 0;
        let ln_likelihood = (regressed && has_variance).then(|| done.ln_likelihood.map(|sum| sum / values));
        let bound = locking::bound(self.trained);
        Observed {
            sample: self.taken,
            iterations: done.iterations,
            ln_likelihood,
            locked: ln_likelihood.zip(bound).map(|([_, after], bound)| after >= bound),
            error: regressed.then(|| done.squared_error.map(|sum| sum / (2.0 * values))),
            milliseconds: 1e3 * self.deadline.last().as_secs_f64(),
            view: view.then(|| self.view(ahead)),
        }
    }

    /// The next sample as predicted, as a row of a table.
    fn row(&self, done: &Regression) -> String {
        let milliseconds = 1e3 * self.deadline.last().as_secs_f64();
        let mut line = format!("{},{},{milliseconds:.3}", self.taken, done.iterations);
        for (channel, &y) in self.regression.mean().iter().enumerate() {
            match self.predicts() {
                true => write!(line, ",{:?}", self.trained.checkpoint.scaling.to_raw(channel, y)),
                false => line.write_char(','),
            }
            .expect("a string takes all");
        }
        line.push('\n');
        line
    }

    /// Takes nothing from the window but the sum of its likelihood.
    fn answer(&self, done: &Regression, ahead: usize) -> Answer<'a> {
        let Observed { sample, ln_likelihood, locked, milliseconds, .. } = self.told(done, false, ahead);
        let (scaling, channels) = (&self.trained.checkpoint.scaling, &self.trained.checkpoint.channels);
        let raw = |mean: &[f64]| mean.iter().enumerate().map(|(i, &y)| scaling.to_raw(i, y)).collect::<Vec<_>>();
        let (mut mean, mut variance, mut forecast) = (Vec::new(), Vec::new(), Vec::new());
        if self.predicts() {
            mean = raw(self.regression.mean());
            let v = self.regression.variance().iter().enumerate();
            variance = v.map(|(i, &v)| scaling.variance_to_raw(i, v)).collect();
            forecast = (1..=ahead).filter_map(|k| self.regression.forecast_mean(k)).map(raw).collect();
        }
        let missing = self.missing.iter().map(|&channel| channels[channel].as_str()).collect();
        Answer { sample, mean, variance, forecast, ln_likelihood, locked, milliseconds, missing }
    }

    /// Whether enough samples came for a prediction of the next one.
    fn predicts(&self) -> bool {
        self.taken >= self.trained.checkpoint.topology.delay()
    }

    fn view(&self, ahead: usize) -> View {
        let scaling = &self.trained.checkpoint.scaling;
        let raw = |mean: &[f64]| mean.iter().enumerate().map(|(i, &y)| scaling.to_raw(i, y)).collect::<Vec<_>>();
        let raw_variance =
            |v: &[f64]| v.iter().enumerate().map(|(i, &v)| scaling.variance_to_raw(i, v)).collect::<Vec<_>>();
        let window = self.regression.window();
        let forecast = if self.predicts() { 0..ahead + 1 } else { 0..0 };
        let has_variance = self.trained.checkpoint.topology.has_variance();
        View {
            from: self.taken + 1 - window,
            smoothed: (0..window).filter_map(|k| self.regression.smoothed_mean(k)).map(raw).collect(),
            contexts: (0..window).filter_map(|k| self.regression.context(k)).map(<[f64]>::to_vec).collect(),
            predicted: forecast.clone().filter_map(|k| self.regression.forecast_mean(k)).map(raw).collect(),
            variance: match has_variance {
                true => forecast.filter_map(|k| self.regression.forecast_variance(k)).map(raw_variance).collect(),
                false => Vec::new(),
            },
        }
    }
}

/// Follows recorded sequences, or a stream on the standard input.
pub fn run(
    online: &Online,
    (run, best): (&Path, bool),
    (data, part): (&Path, &Part),
    (how, out, as_json): (&How<'_>, Option<&Path>, bool),
    shared: &Shared,
) -> Result<Ending> {
    let trained = Trained::open(run, best)?;
    shared.say_of(&trained);
    if data == Path::new("-") {
        if out.is_some() || !online.at.is_empty() {
            return Err(Failure::input("--out and --at do not go with a stream", "it is printed as it comes"));
        }
        return stream(online, how, &trained, as_json, shared);
    }
    let set = files::read_all(&[data], &part.of(data, trained.selection()))?.data;
    let data = trained.fitted_aloud(set, data, shared)?;
    let engine = shared.engine()?;
    let mut followed = Vec::new();
    for sequence in data.sequences() {
        followed.push(follow(online, how, &trained, sequence, &engine)?);
    }
    for one in followed.iter().filter(|one| one.steps.last().is_some_and(|step| step.locked == Some(false))) {
        shared.say(format_args!(
            "{} was not found: the window at its end is less likely than what was learned, by more than a nat per step and channel",
            one.sequence
        ));
    }
    if let Some(path) = out {
        write(path, &trained, &followed)?;
    }
    if as_json {
        output::print_json_line(&json!({ "sequences": followed }))?;
    } else {
        output::print(&table(&followed))?;
    }
    Ok(Ending::Done)
}

fn follow(online: &Online, how: &How<'_>, trained: &Trained, sequence: &Sequence, engine: &Engine) -> Result<Followed> {
    let mut session = Session::new(online, how, trained, engine)?;
    let (scaling, delay) = (&trained.checkpoint.scaling, trained.checkpoint.topology.delay());
    let (mut steps, mut rows) = (Vec::with_capacity(sequence.len()), Rows::default());
    let (mut squares, mut values) = (0.0, 0_usize);
    for k in 0..sequence.len() {
        let sample = sequence.sample(k);
        if k >= delay {
            for (i, &y) in session.regression.mean().iter().enumerate() {
                rows.mean.push(scaling.to_raw(i, y));
                if !sample[i].is_nan() {
                    squares += (scaling.to_raw(i, y) - sample[i]).powi(2);
                    values += 1;
                }
            }
            let v = session.regression.variance().iter().enumerate();
            rows.variance.extend(v.map(|(i, &v)| scaling.variance_to_raw(i, v)));
        }
        let done = session.observe(sample)?;
        if k >= delay {
            let last = session.regression.window() - 1;
            let smoothed = session.regression.smoothed_mean(last).into_iter().flatten().enumerate();
            rows.smoothed.extend(smoothed.map(|(i, &y)| scaling.to_raw(i, y)));
            rows.context.extend(session.regression.context(last).into_iter().flatten());
        }
        steps.push(session.told(&done, online.at.contains(&(k + 1)), online.ahead));
    }
    let mean = |of: &dyn Fn(&Observed) -> Option<[f64; 2]>| {
        let pairs: Vec<[f64; 2]> = steps.iter().filter_map(of).collect();
        let n = pairs.len() as f64;
        (!pairs.is_empty()).then(|| [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / n))
    };
    let locked: Vec<bool> = steps.iter().filter_map(|step| step.locked).collect();
    let share = locked.iter().filter(|locked| **locked).count() as f64 / locked.len() as f64;
    Ok(Followed {
        sequence: sequence.name.clone(),
        samples: sequence.len(),
        ln_likelihood: mean(&|step| step.ln_likelihood),
        error: mean(&|step| step.error).unwrap_or_default(),
        prediction_error: squares / (2.0 * values.max(1) as f64),
        locked: (!locked.is_empty()).then_some(share),
        latency: session.deadline.latency(),
        steps,
        rows,
    })
}

/// One line of output for each line of input. Ends when whoever reads it has left.
fn stream(online: &Online, how: &How<'_>, trained: &Trained, as_json: bool, shared: &Shared) -> Result<Ending> {
    let channels = &trained.checkpoint.channels;
    let engine = shared.engine()?;
    let mut lines = Stream::new(BufReader::new(io::stdin()), channels);
    let mut session = Session::new(online, how, trained, &engine)?;
    let mut warned = Warned { far: vec![false; channels.len()], ..Warned::default() };
    let known = familiar::learned(trained);
    let mut locked = None;
    let mut reader = Reader::Listens;
    if !as_json {
        reader = output::offer(&format!("sample,iterations,milliseconds,{}\n", channels.join(",")))?;
    }
    while reader == Reader::Listens {
        let sample = match lines.next()? {
            None => break,
            Some(Arrival::Sample(sample)) => sample,
            Some(Arrival::Gap) => {
                if session.taken > 0 {
                    let deadline = session.deadline;
                    session = Session { deadline, ..Session::new(online, how, trained, &engine)? };
                }
                continue;
            }
        };
        let done = session.observe(&sample)?;
        for &channel in &session.missing {
            warned.missing(lines.line_number(), &channels[channel], sample[channel], shared);
        }
        for (channel, &value) in sample.iter().enumerate().filter(|(channel, _)| !session.missing.contains(channel)) {
            warned.far(lines.line_number(), (&channels[channel], channel), (known[channel], value), shared);
        }
        let now = session.told(&done, false, 0).locked;
        if now.is_some() && now != locked && !as_json {
            let found = if now == Some(true) { "found" } else { "not found" };
            shared.say(format_args!("sample {}: what is followed is {found} among what was learned", session.taken));
        }
        locked = now.or(locked);
        reader = match (as_json, online.full) {
            (true, true) => output::offer_json_line(&session.told(&done, true, online.ahead))?,
            (true, false) => output::offer_json_line(&session.answer(&done, online.ahead))?,
            (false, _) => output::offer(&session.row(&done))?,
        };
    }
    if lines.is_unfinished() {
        shared.say("the last line of the stream has no end: it is no sample");
    }
    if let Some(latency) = session.deadline.latency() {
        shared.say(told_latency(&latency));
    }
    Ok(Ending::Done)
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

/// Each sample as predicted just before it came and as the window has it afterwards, in the data's units.
fn write(path: &Path, trained: &Trained, followed: &[Followed]) -> Result<()> {
    let channels = &trained.checkpoint.channels;
    let units: Vec<String> = trained.checkpoint.topology.groups().iter().flat_map(unit_names).collect();
    let field = |names: &[String], of: &dyn Fn(&Rows) -> &Vec<f64>| -> Result<Dataset> {
        let rows = followed.iter().map(|one| Sequence::new(one.sequence.clone(), names.len(), of(&one.rows).clone()));
        Ok(Dataset::new(names.to_vec(), rows.collect::<scrnn::error::Result<_>>()?)?)
    };
    let mut fields = vec![("mean", field(channels, &|rows| &rows.mean)?)];
    if trained.checkpoint.topology.has_variance() {
        fields.push(("variance", field(channels, &|rows| &rows.variance)?));
    }
    fields.push(("smoothed", field(channels, &|rows| &rows.smoothed)?));
    fields.push(("context", field(&units, &|rows| &rows.context)?));
    let fields: Vec<Field<'_>> = fields.iter().map(|(name, data)| Field { name, data }).collect();
    Ok(files::write(path, &fields)?)
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
