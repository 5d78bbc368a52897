//! `scrnn simulate interact`: the self-robot follows the other one (thesis 5.3.2, 5.3.4).

use std::path::PathBuf;

use clap::Args;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions};
use scrnn::streams::Purpose;
use scrnn_sim::interact::{Branch, ControlStep, Controller, Followed, Outcome, follow, with_own_arm};
use scrnn_sim::interact::{CHANNELS, Interaction, InteractionOptions, PERIOD, letters, parse_order, random_order};
use serde::Serialize;
use serde_json::json;

use crate::args::Shared;
use crate::command::recognize::RegressionArguments;
use crate::command::view;
use crate::output;
use crate::outputs::check_distinct;
use crate::watching::Watch;
use scrnn_data::{self as files, Field};
use scrnn_pages::live::{Frame, Heading, Sample};
use scrnn_report::Table;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::following::Latency;
use scrnn_run::trained::Trained;
use scrnn_sim::interact::Film;
use scrnn_tasks::interact::BRANCHES;

/// Two robots: the network follows the other robot's object with its arm
///
/// The head follows the object by itself; object and head are sensed, with the sensors' noise, and the arm goes to where
/// the network predicts it. For each branching the table says how it went and after how many samples of 100 ms the
/// arm was where it should be. With --ers the network revises its slow state by error regression while it acts.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn simulate interact runs/interaction_wide --order RLLLR --initial-state LLRRL
  scrnn simulate interact runs/interaction_wide --order RLLLR --initial-state LLRRL --ers --mcap world.mcap
  scrnn simulate interact runs/interaction_wide --ers --watch        in a browser, as it goes on")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// Where the object goes, in letters L and R [default: drawn at random]
    #[arg(long, value_name = "ORDER")]
    order: Option<String>,
    /// The state to start from: `corresponding` to the order, that of another learned order, or `mean`
    #[arg(long, value_name = "STATE", default_value = "mean")]
    initial_state: String,
    /// Number of interactions, 1 to 10000, each with another order unless one is given, and other noise
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    trials: u32,
    /// Seed of random orders and of the sensors' noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
    /// Regress on prediction errors
    #[arg(long)]
    ers: bool,
    /// Rate of the ascent, more than 0, at most 1e6 [default: one that suits most networks]
    #[arg(long, value_name = "RATE", value_parser = crate::args::positive(1e6))]
    rate: Option<f64>,
    #[command(flatten)]
    regression: RegressionArguments,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Write what was sensed, predicted and done at each sample: .csv, .txt or .npz
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a recording of the world
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Write a page that plays what happened, in any browser
    #[arg(long, value_name = "PAGE.html")]
    view: Option<PathBuf>,
    #[command(flatten)]
    watch: Watch,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// One interaction.
#[derive(Debug, Serialize)]
struct Trial {
    order: String,
    initial_state: String,
    branches: Vec<Branch>,
    latency: Option<Latency>,
    #[serde(skip)]
    followed: Followed,
}

/// Simulates.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let outputs = [
        ("--out", arguments.out.as_deref()),
        ("--mcap", arguments.mcap.as_deref()),
        ("--view", arguments.view.as_deref()),
    ];
    check_distinct(&outputs, &[("RUN", Some(&arguments.run))])?;
    let trained = Trained::open(&arguments.run, arguments.best)?;
    shared.say_of(&trained);
    let checkpoint = &trained.checkpoint;
    if checkpoint.channels.len() != CHANNELS.len() {
        let message = format!("the network's channels are {}", checkpoint.channels.join(", "));
        return Err(Failure::input(message, format!("an interaction has {}", CHANNELS.join(", "))));
    }
    let options = arguments.options(&trained)?;
    let network = trained.network();
    let mut film = match arguments.mcap.as_ref().or(arguments.view.as_ref()) {
        Some(_) => Some(Film::new(&[("run", &arguments.run.display().to_string())])?),
        None => None,
    };
    let (channels, scaling) = (&checkpoint.channels, &checkpoint.scaling);
    let heading = Heading { title: "Two robots interact", channels, scaling, unit: "s", pace: None };
    let mut shown = arguments.watch.start(&heading, Some(1.0))?;
    let mut begun = 0.0;
    let engine = shared.engine()?;
    let mut trials = Vec::new();
    for trial in 0..u64::from(arguments.trials) {
        let order = match &arguments.order {
            Some(text) => parse_order(text)?,
            None => random_order(BRANCHES, 0.5, arguments.seed, Purpose::TrialOrders, trial),
        };
        let (initial_state, state) = trained.state_for_order(&arguments.initial_state, &letters(&order))?;
        let controller =
            Controller { network: &network, scaling: &checkpoint.scaling, initial_state: state, engine: &engine };
        let mut interaction = Interaction::new(&order, &InteractionOptions::default(), arguments.seed, trial)?;
        let mut deadline = arguments.regression.clock()?;
        if let Some(film) = &mut film {
            film.begin(&letters(&order))?;
        }
        let observe = |regression: &mut ErrorRegression, sample: &[f64]| {
            deadline.sample(|go_on| regression.observe(sample, go_on))
        };
        let watch = |interaction: &Interaction, step: &ControlStep, _: &ErrorRegression| -> Result<()> {
            if film.is_none() && shown.is_none() {
                return Ok(());
            }
            let raw = |y: [f64; 8]| (0..8).map(|i| scaling.to_raw(i, y[i])).collect::<Vec<_>>();
            let mean = step.predicted.map(raw);
            let variance: Vec<f64> =
                step.variance.iter().enumerate().map(|(i, &v)| scaling.variance_to_raw(i, v)).collect();
            if let Some(shown) = &mut shown {
                let sample =
                    Sample { sensed: &step.sensed, mean: mean.as_deref().unwrap_or_default(), variance: &variance };
                let (scene, event) = (interaction.scene(), happening(interaction));
                let time = begun + interaction.time();
                shown.frame(&Frame { time, scene: Some(&scene), sample: Some(sample), event: event.as_deref() });
            }
            let Some(film) = film.as_mut() else { return Ok(()) };
            let variance = Some(variance.as_slice()).filter(|variance| !variance.is_empty());
            Ok(film.frame(interaction, &step.sensed, mean.as_deref().map(|mean| (mean, variance)))?)
        };
        let followed = follow(&controller, &options, &mut interaction, observe, watch)?;
        begun += interaction.time() + PERIOD;
        let (order, branches) = (letters(&order), followed.branches.clone());
        trials.push(Trial { order, initial_state, branches, latency: deadline.latency(), followed });
    }
    if let Some(shown) = shown {
        shown.finish();
    }
    if let Some(film) = film {
        let bytes = film.finish()?;
        if let Some(path) = &arguments.mcap {
            files::replace(path, &bytes)?;
        }
        if let Some(page) = &arguments.view {
            view::write(page, &bytes)?;
        }
    }
    if let Some(path) = &arguments.out {
        write(path, &trained, &trials)?;
    }
    if arguments.json {
        let successes = share(&trials, |branch| branch.outcome == Outcome::Success);
        let collisions = share(&trials, |branch| branch.collision.is_some());
        output::print_json_line(&json!({ "trials": trials, "success": successes, "collision": collisions }))?;
    } else {
        output::print(&told(&trials))?;
    }
    Ok(Ending::Done)
}

/// What happens at this sample, in words.
fn happening(interaction: &Interaction) -> Option<String> {
    if let Some(collision) = interaction.collision() {
        return Some(format!("collision with {collision:?}").to_lowercase());
    }
    interaction.branching()
}

impl Arguments {
    fn options(&self, trained: &Trained) -> Result<ErrorRegressionOptions> {
        let default = ErrorRegressionOptions::adam(trained.checkpoint.channels.len());
        let mut options = with_own_arm(self.regression.options(default, self.rate)?);
        options.ahead = 0;
        if !self.ers {
            options.iterations = 0;
        }
        Ok(options)
    }
}

/// The share of branchings.
fn share(trials: &[Trial], of: impl Fn(&Branch) -> bool) -> f64 {
    let branches = || trials.iter().flat_map(|trial| &trial.branches);
    branches().filter(|branch| of(branch)).count() as f64 / branches().count().max(1) as f64
}

fn told(trials: &[Trial]) -> String {
    let mut table = Table::new(&["order", "started from", "branchings", "reaction, samples", "collisions"]);
    for trial in trials {
        let word = |branch: &Branch| match branch.outcome {
            Outcome::Success => "success",
            Outcome::Opposite => "opposite",
            Outcome::Collision => "collision",
            Outcome::Stayed => "stayed",
        };
        let list = |of: &dyn Fn(&Branch) -> String| trial.branches.iter().map(of).collect::<Vec<_>>().join(" ");
        table.row(vec![
            trial.order.clone(),
            trial.initial_state.clone(),
            list(&|branch| word(branch).to_owned()),
            list(&|branch| branch.reaction_time.to_string()),
            trial.branches.iter().filter(|branch| branch.collision.is_some()).count().to_string(),
        ]);
    }
    let branches: usize = trials.iter().map(|trial| trial.branches.len()).sum();
    let success = 100.0 * share(trials, |branch| branch.outcome == Outcome::Success);
    let mut text = format!("{table}\n{success:.1} % of {branches} branchings succeeded\n");
    let longest = trials.iter().filter_map(|trial| trial.latency).map(|latency| latency.p99).fold(0.0, f64::max);
    let missed: usize = trials.iter().filter_map(|trial| trial.latency?.missed).sum();
    let deadline = trials.iter().any(|trial| trial.latency.is_some_and(|latency| latency.missed.is_some()));
    text += &format!("99 % of the control steps took {longest:.3} ms at most");
    text += &if deadline { format!("; {missed} missed the deadline\n") } else { "\n".to_owned() };
    text
}

/// Sensed, predicted, variance, contexts, arm error, hand.
fn write(path: &std::path::Path, trained: &Trained, trials: &[Trial]) -> Result<()> {
    let (checkpoint, n) = (&trained.checkpoint, CHANNELS.len());
    let (scaling, delay) = (&checkpoint.scaling, checkpoint.topology.delay());
    let moments = |trial: &Trial| trial.followed.steps.get(delay..).unwrap_or_default().to_vec();
    let field = |names: Vec<String>, of: &dyn Fn(&scrnn_sim::interact::ControlStep) -> Vec<f64>| -> Result<Dataset> {
        let rows = trials
            .iter()
            .map(|trial| Sequence::new(trial.order.clone(), names.len(), moments(trial).iter().flat_map(of).collect()));
        let rows = rows.collect::<scrnn::error::Result<Vec<_>>>()?;
        Ok(Dataset::new(names, rows)?)
    };
    let channels = || checkpoint.channels.clone();
    let units = checkpoint.topology.groups().iter().flat_map(scrnn_run::generating::unit_names).collect();
    let sensed = field(channels(), &|moment| moment.sensed.to_vec())?;
    let mean = field(channels(), &|moment| {
        let predicted = moment.predicted.unwrap_or_default();
        (0..n).map(|i| scaling.to_raw(i, predicted[i])).collect()
    })?;
    let context = field(units, &|moment| moment.context.clone())?;
    let state = field(vec!["arm_error".into(), "hand".into()], &|moment| vec![moment.error, moment.hand])?;
    let mut fields = vec![("sensed", sensed), ("mean", mean)];
    if checkpoint.topology.has_variance() {
        let variance = field(channels(), &|moment| {
            moment.variance.iter().enumerate().map(|(i, &v)| scaling.variance_to_raw(i, v)).collect()
        })?;
        fields.push(("variance", variance));
    }
    fields.extend([("context", context), ("", state)]);
    let fields: Vec<Field<'_>> = fields.iter().map(|(name, data)| Field { name, data }).collect();
    Ok(files::write(path, &fields)?)
}
