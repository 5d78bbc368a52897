//! What is done with each trained network: the sweep file's `[then]`, and the work itself.
//!
//! What comes of it lies in the run folder, and its numbers among the measures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::error_regression::ErrorRegressionOptions;
use scrnn_data::Field;
use scrnn_run::evaluation::{Bench, Member, Report, Search, SimpleModels};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::following::{Begin, Deadline, Following, fields, follow};
use scrnn_run::generating::{Generating, generating};
use scrnn_run::history;
use scrnn_run::messages::Silent;
use scrnn_run::recognising::{Recognising, recognising};
use scrnn_run::run_folder::HISTORY;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;
use serde::{Deserialize, Serialize};

use crate::measures;

mod simulating;

pub use simulating::Simulated;

/// What is done with each trained network. An empty table turns a step on; without any, networks are only trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Then {
    /// Whether the best network is taken instead of the newest. Default false.
    pub best: bool,
    /// Whether each run gets its page, report.html with figures, some 0.5 MB. Default true.
    pub report: bool,
    /// The measures that are compared, the first of which says which setting is best. Default: all there are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measures: Vec<String>,
    /// Judges it by sequences that it did not learn, as `scrnn evaluate`; into evaluated.json.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluate: Option<Evaluate>,
    /// Lets it run on its own from the states that it learned, as `scrnn generate`; into generated.csv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generate: Option<Generate>,
    /// Searches for the initial states of sequences, as `scrnn recognize`; into recognised.json.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recognise: Option<Recognise>,
    /// Follows sequences while they arrive, as `scrnn recognize --online`; into followed.csv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub follow: Option<Follow>,
    /// Lets it move a simulated robot, as `scrnn simulate`; into simulated.json.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulate: Option<Simulate>,
}

impl Default for Then {
    fn default() -> Self {
        Self {
            best: false,
            report: true,
            measures: Vec::new(),
            evaluate: None,
            generate: None,
            recognise: None,
            follow: None,
            simulate: None,
        }
    }
}

/// How it is judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Evaluate {
    /// Sequences, relative to the sweep file. Default: those that the experiment holds out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// Closed loops of each sequence.
    pub samples: usize,
    /// Starts of the search for each sequence's state.
    pub starts: usize,
    /// Updates from each start.
    pub epochs: u64,
    /// Seed of the closed loops' noise.
    pub seed: u64,
}

impl Default for Evaluate {
    fn default() -> Self {
        Self { data: None, samples: 50, starts: 20, epochs: 300, seed: 1 }
    }
}

/// How it runs on its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Generate {
    /// Steps. Default: as many as the learned sequences have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Whether noise of the predicted variance is fed back.
    pub noise: bool,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Generate {
    fn default() -> Self {
        Self { steps: None, noise: false, seed: 1 }
    }
}

/// How states are searched for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Recognise {
    /// Sequences, relative to the sweep file. Default: those that were learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// Samples of each that are heard. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observed: Option<usize>,
    /// Starts for each sequence.
    pub starts: usize,
    /// Updates from each start.
    pub epochs: u64,
    /// Seed of the random starts.
    pub seed: u64,
}

impl Default for Recognise {
    fn default() -> Self {
        Self { data: None, observed: None, starts: 20, epochs: 300, seed: 1 }
    }
}

/// How it follows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Follow {
    /// Sequences, relative to the sweep file. Default: those that are held out, or else those that were learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// Samples of the window.
    pub window: usize,
    /// Updates for each sample.
    pub iterations: usize,
}

impl Default for Follow {
    fn default() -> Self {
        Self { data: None, window: 30, iterations: 15 }
    }
}

/// How it moves a simulated robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulate {
    /// Which experiment.
    pub experiment: Simulated,
    /// Interactions, or cycles at each of the three positions. Default 6.
    #[serde(default = "six")]
    pub trials: u64,
    /// For "interact": from which state, "mean", "corresponding" or a learned order. Default "mean".
    #[serde(default = "mean")]
    pub begin: String,
    /// For "interact": updates of error regression for each sample. Default 0: without it.
    #[serde(default)]
    pub iterations: usize,
    /// For "interact": samples of error regression's window. Default 50.
    #[serde(default = "fifty")]
    pub window: usize,
    /// Seed of orders and of all noise. Default 1.
    #[serde(default = "one")]
    pub seed: u64,
}

fn six() -> u64 {
    6
}

fn mean() -> String {
    "mean".to_owned()
}

fn fifty() -> usize {
    50
}

fn one() -> u64 {
    1
}

/// What a step found.
pub type Numbers = BTreeMap<String, f64>;

impl Then {
    /// Whether all numbers are in their ranges.
    ///
    /// # Errors
    /// [`Failure::Input`].
    pub fn check(&self) -> Result<()> {
        for key in &self.measures {
            measures::of(key)?;
        }
        let within = |place: &str, value: u64, least: u64, most: u64| match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(Failure::input(
                format!("`then.{place}` is {value}"),
                format!("give a number from {least} to {most}"),
            )),
        };
        let whole = |value: usize| value as u64;
        if let Some(one) = &self.evaluate {
            within("evaluate.samples", whole(one.samples), 1, 10_000)?;
            within("evaluate.starts", whole(one.starts), 1, 10_000)?;
            within("evaluate.epochs", one.epochs, 0, 1_000_000)?;
        }
        if let Some(steps) = self.generate.as_ref().and_then(|one| one.steps) {
            within("generate.steps", whole(steps), 1, 1_000_000_000)?;
        }
        if let Some(one) = &self.recognise {
            within("recognise.starts", whole(one.starts), 1, 10_000)?;
            within("recognise.epochs", one.epochs, 0, 1_000_000)?;
        }
        if let Some(one) = &self.follow {
            within("follow.window", whole(one.window), 1, 1_000_000)?;
            within("follow.iterations", whole(one.iterations), 0, 1_000_000)?;
        }
        if let Some(one) = &self.simulate {
            within("simulate.trials", one.trials, 1, 10_000)?;
            within("simulate.window", whole(one.window), 1, 1_000_000)?;
            within("simulate.iterations", whole(one.iterations), 0, 1_000_000)?;
        }
        Ok(())
    }

    /// Does all of it with the network in `folder`, which learned `source`; paths start from `place`. The files come first, so that what
    /// has measures has files.
    ///
    /// # Errors
    /// What is wrong with data or options, and what the disk refuses.
    pub fn run(&self, folder: &Path, (source, place): (&Source, &Path), engine: &Engine) -> Result<Numbers> {
        let mut numbers = Numbers::new();
        let steps = [self.evaluate.is_some(), self.generate.is_some(), self.recognise.is_some(), self.follow.is_some()];
        if !self.report && self.simulate.is_none() && steps.iter().all(|step| !step) {
            return Ok(numbers);
        }
        let trained = Arc::new(Trained::open(folder, self.best)?);
        if let Some(options) = &self.evaluate {
            numbers.extend(evaluate(&trained, options, (folder, source, place), engine)?);
        }
        if let Some(options) = &self.generate {
            numbers.extend(generate(&trained, options, (folder, source), engine)?);
        }
        if let Some(options) = &self.recognise {
            numbers.extend(recognise(&trained, options, (folder, source, place), engine)?);
        }
        if let Some(options) = &self.follow {
            numbers.extend(follow_all(&trained, options, (folder, source, place), engine)?);
        }
        if let Some(options) = &self.simulate {
            numbers.extend(simulating::simulate(&trained, options, folder, engine)?);
        }
        if self.report {
            let rows = history::read(&folder.join(HISTORY))?;
            scrnn_pages::write(&scrnn_pages::run_page::page(&trained, source, &rows, 1, engine)?, folder)?;
        }
        Ok(numbers)
    }
}

/// Sequences from a file, on the network's channels.
fn given(trained: &Trained, path: &Path, place: &Path) -> Result<Dataset> {
    let path = place.join(path);
    let selection = trained.selection().unwrap_or_default();
    trained.fitted(scrnn_data::read_all(&[&path], &selection)?.data, &path)
}

fn number(numbers: &mut Numbers, key: &str, value: Option<f64>) {
    if let Some(value) = value.filter(|value| value.is_finite()) {
        numbers.insert(key.to_owned(), value);
    }
}

fn evaluate(
    trained: &Trained,
    options: &Evaluate,
    (folder, source, place): (&Path, &Source, &Path),
    engine: &Engine,
) -> Result<Numbers> {
    let checkpoint = &trained.checkpoint;
    let data = match (&options.data, &source.held_out) {
        (Some(path), _) => given(trained, path, place)?,
        (None, Some(held_out)) => held_out.clone(),
        (None, None) => {
            let help =
                "add `held_out = 0.2` under [data] of the experiment, or say which: [then.evaluate] data = \"new.csv\"";
            return Err(Failure::input("the experiment holds no sequences out to evaluate by", help));
        }
    };
    data.check_for(&checkpoint.topology)?;
    let delay = checkpoint.topology.delay();
    let models = SimpleModels::fit(&checkpoint.scaling.apply(&source.data)?, delay);
    let shares = trained.evaluation();
    let shares = (shares.burn_in, shares.observed);
    let bench = Bench::new(checkpoint.scaling.apply(&data)?, models, shares, (delay, options.seed), engine)?;
    let search = Search {
        starts: options.starts,
        epochs: options.epochs,
        initial_state_variance: trained.initial_state_variance(),
    };
    let network = trained.network();
    let members = [Member { network: &network, states: &checkpoint.initial_states }];
    let learned = (&checkpoint.scaling, checkpoint.sequences.as_slice());
    let report = Report::new(&bench, &members, learned, (search, options.samples))?;
    crate::outcome::write(folder, "evaluated.json", &report)?;
    let mut numbers = Numbers::new();
    let steps = &report.one_step;
    number(&mut numbers, "evaluate.nll", steps.after_burn_in.nll);
    number(&mut numbers, "evaluate.mse", Some(steps.after_burn_in.mse));
    number(&mut numbers, "evaluate.nll_recognised", steps.from_recognised.nll);
    number(&mut numbers, "evaluate.closed_loop", Some(report.closed_loop_from_recognised.distance));
    number(&mut numbers, "evaluate.within_one", report.calibration.as_ref().map(|one| one.within_one));
    number(&mut numbers, "evaluate.within_two", report.calibration.as_ref().map(|one| one.within_two));
    Ok(numbers)
}

fn generate(
    trained: &Trained,
    options: &Generate,
    (folder, source): (&Path, &Source),
    engine: &Engine,
) -> Result<Numbers> {
    let checkpoint = &trained.checkpoint;
    let longest = source.data.sequences().iter().map(|sequence| sequence.len()).max().unwrap_or(0);
    let steps = options.steps.unwrap_or_else(|| longest.saturating_sub(checkpoint.topology.delay()));
    let how = Generating::with(|it| {
        (it.noise, it.seed, it.steps) = (options.noise, options.seed, Some(steps));
    });
    let again = Trained::of(trained.path.clone(), checkpoint.clone())?;
    let generated = generating(&[again], &how, engine)?;
    let written: Vec<Field<'_>> = generated.iter().map(|(name, data)| Field { name, data }).collect();
    scrnn_data::write(&folder.join("generated.csv"), &written)?;
    let mut numbers = Numbers::new();
    let means = generated.iter().find(|(name, _)| *name == "mean").map(|(_, data)| data);
    number(&mut numbers, "generate.distance", means.and_then(|means| distance(means, source, trained)));
    Ok(numbers)
}

/// Root mean square, per channel and in scaled units, of what was generated for each learned sequence less that sequence, over the steps
/// that both have.
fn distance(means: &Dataset, source: &Source, trained: &Trained) -> Option<f64> {
    let (scaling, delay) = (&trained.checkpoint.scaling, trained.checkpoint.topology.delay());
    let (means, learned) = (scaling.apply(means).ok()?, scaling.apply(&source.data).ok()?);
    let n = learned.channels().len();
    let (mut squares, mut count) = (0.0, 0_usize);
    for (mean, sequence) in means.sequences().iter().zip(learned.sequences()) {
        let targets = sequence.values().get(delay * n..)?;
        for (mean, target) in mean.values().iter().zip(targets).filter(|(_, target)| target.is_finite()) {
            squares += (mean - target).powi(2);
            count += 1;
        }
    }
    (count > 0).then(|| (squares / count as f64).sqrt())
}

fn recognise(
    trained: &Trained,
    options: &Recognise,
    (folder, source, place): (&Path, &Source, &Path),
    engine: &Engine,
) -> Result<Numbers> {
    let data = match &options.data {
        Some(path) => given(trained, path, place)?,
        None => source.data.clone(),
    };
    let how = Recognising::with(|it| {
        (it.starts, it.epochs, it.seed, it.observed) = (options.starts, options.epochs, options.seed, options.observed);
    });
    let all = [Trained::of(trained.path.clone(), trained.checkpoint.clone())?];
    let found = recognising(&all, &data, &how, (engine, &Silent))?;
    crate::outcome::write(folder, "recognised.json", &found.sequences)?;
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let learned = &trained.checkpoint.sequences;
    let known: Vec<bool> = (found.sequences.iter())
        .filter(|one| learned.contains(&one.sequence))
        .map(|one| one.learned.first().is_some_and(|first| first.sequence == one.sequence))
        .collect();
    let mut numbers = Numbers::new();
    number(&mut numbers, "recognise.error", mean(found.sequences.iter().map(|one| one.error).collect()));
    number(
        &mut numbers,
        "recognise.nll",
        mean(found.sequences.iter().filter_map(|one| one.ln_likelihood).map(|ln| -ln).collect()),
    );
    number(&mut numbers, "recognise.correct", mean(known.iter().map(|&known| f64::from(u8::from(known))).collect()));
    Ok(numbers)
}

fn follow_all(
    trained: &Arc<Trained>,
    options: &Follow,
    (folder, source, place): (&Path, &Source, &Path),
    engine: &Engine,
) -> Result<Numbers> {
    let data = match (&options.data, &source.held_out) {
        (Some(path), _) => given(trained, path, place)?,
        (None, Some(held_out)) => held_out.clone(),
        (None, None) => source.data.clone(),
    };
    let mut how = ErrorRegressionOptions::new(trained.checkpoint.channels.len());
    (how.window, how.iterations) = (options.window, options.iterations);
    let begin =
        || Following::new(Arc::clone(trained), how.clone(), Begin::default(), Deadline::new(None), engine.clone());
    let mut followed = Vec::new();
    for sequence in data.sequences() {
        followed.push(follow(begin()?, sequence, &[])?);
    }
    let rows = fields(trained, &followed)?;
    let written: Vec<Field<'_>> = rows.iter().map(|(name, data)| Field { name, data }).collect();
    scrnn_data::write(&folder.join("followed.csv"), &written)?;
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let mut numbers = Numbers::new();
    number(&mut numbers, "follow.error", mean(followed.iter().map(|one| one.prediction_error).collect()));
    number(&mut numbers, "follow.locked", mean(followed.iter().filter_map(|one| one.locked).collect()));
    Ok(numbers)
}
