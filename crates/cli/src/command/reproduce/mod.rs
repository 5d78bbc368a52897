//! `scrnn reproduce`: an experiment of the thesis from data to page.

mod curves;
mod curves_page;
mod interact;
mod limit_cycle;
mod metrics;
mod overview;
mod preset;
mod reach;
mod seeds;
mod sinusoid;
mod study;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use indicatif::MultiProgress;
use scrnn::engine::Engine;
use scrnn::learning::Outcome;
use scrnn::network::Network;

use crate::args::Shared;
use crate::command::train::{Found, Interrupt, Training, train};
use crate::experiment::{Experiment, Override};
use crate::failure::{Ending, Result};
use crate::history;
use crate::output;
use crate::progress::{Progress, in_words};
use crate::report::{self, FIGURES, PAGE};
use crate::run_folder::{HISTORY, RunFolder};
use crate::table::Table;
use metrics::{METRICS, Machine, Metrics};
use preset::{Kind, Preset};
use study::{Learned, SeedResult, Study, Summary, TrainingFacts};

/// Reproduce an experiment of the thesis, and write a page about it
///
/// Makes the data, trains, generates, recognises and evaluates. The folder receives report.html, one page that needs
/// nothing else; metrics.json, all numbers; figures/, each figure as SVG with its numbers as CSV; and a run folder for
/// each training, as `scrnn train` writes it. Trainings that are finished are not repeated, and one that was interrupted
/// goes on.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn reproduce sinusoid                               a page in a few seconds
  scrnn reproduce lissajous --seeds 5 --out runs/five    five networks side by side on the cores
  scrnn reproduce limit-cycle --preset thesis            the thesis' optimiser and number of epochs
  scrnn reproduce interact --networks 10                 20 networks, in two robots' world and out of it")]
pub struct Arguments {
    /// Which experiment
    experiment: Name,
    /// Which settings
    #[arg(long, value_enum, default_value_t = Preset::Fast)]
    preset: Preset,
    /// Number of seeds, each with data and initial weights of its own; of `interact` the number of networks a condition,
    /// which all learn the same recordings
    #[arg(long, visible_alias = "networks", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// The first seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The folder [default: runs/reproduce/EXPERIMENT-PRESET]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of epochs, instead of the preset's
    #[arg(long, value_name = "N")]
    epochs: Option<u64>,
    /// A key of the S-CTRNN's training or network, e.g. --set training.adam.rate=1e-3
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// With `interact`: also initial-state variances between the thesis' two, and branchings with a bias (5.4.3)
    #[arg(long)]
    beyond: bool,
    /// Train anew what is in the folder already
    #[arg(long)]
    overwrite: bool,
    /// Print metrics.json
    #[arg(long)]
    json: bool,
}

/// The thesis' experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Name {
    /// Twelve Lissajous curves, each with noise of its own (3.2)
    Lissajous,
    /// 144 patterns in one network (6.2.3)
    Patterns,
    /// A sine wave whose noise changes over time (3.3)
    Sinusoid,
    /// An oscillator that is driven by noise which depends on its state (3.4)
    LimitCycle,
    /// NAO learns to touch a sphere from demonstrations, in simulation (4)
    Reach,
    /// Two robots interact: reactive and proactive behaviour, and error regression (5)
    Interact,
}

impl Name {
    fn word(self) -> &'static str {
        match self {
            Self::Lissajous => "lissajous",
            Self::Patterns => "patterns",
            Self::Sinusoid => "sinusoid",
            Self::LimitCycle => "limit-cycle",
            Self::Reach => "reach",
            Self::Interact => "interact",
        }
    }
}

impl Preset {
    fn word(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Fast => "fast",
        }
    }
}

/// Reproduces.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    match arguments.experiment {
        Name::Lissajous => reproduce(&curves::LISSAJOUS, arguments, shared),
        Name::Patterns => reproduce(&curves::PATTERNS, arguments, shared),
        Name::Sinusoid => reproduce(&sinusoid::Sinusoid, arguments, shared),
        Name::LimitCycle => reproduce(&limit_cycle::LimitCycle, arguments, shared),
        Name::Reach => reproduce(&reach::REACH, arguments, shared),
        Name::Interact => interact::run(arguments, shared),
    }
}

/// What one seed came to.
struct Seed<S: Study> {
    result: SeedResult<S::Findings>,
    networks: Vec<Learned>,
    material: S::Material,
}

fn reproduce<S: Study>(study: &S, arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let begun = Instant::now();
    let name = format!("{}-{}", arguments.experiment.word(), arguments.preset.word());
    let path = arguments.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").join(&name));
    let folder = RunFolder::open(&path)?;
    if arguments.overwrite {
        // A page that is there would speak of trainings that are not.
        folder.remove(PAGE)?;
        folder.remove(METRICS)?;
    }

    let cores = shared.engine()?.threads();
    let numbers: Vec<u64> = (0..arguments.seeds).map(|k| arguments.seed.saturating_add(k)).collect();
    let interrupt = Interrupt::listen();
    let bars = MultiProgress::new();
    let one = |seed: u64, threads: usize| -> Result<Option<Seed<S>>> {
        let engine = Engine::new(threads, shared.instruction_set())?;
        let clock = Instant::now();
        let mut networks = Vec::new();
        for (index, kind) in study.networks().iter().enumerate() {
            let changed = if index == 0 { arguments.set.as_slice() } else { &[] };
            let experiment = kind.experiment(arguments.preset, seed, arguments.epochs, changed)?;
            let run = format!("seed-{seed}{}", kind.suffix);
            let label = format!("seed {seed}, {}: ", kind.called(&experiment));
            let progress = Progress::labelled(&label, experiment.training.epochs, shared.quiet, &bars);
            let found = if arguments.overwrite { Found::Overwrite } else { Found::GoOn };
            let place = path.join(&run);
            let training = train(&experiment, (&place, found), (&engine, &interrupt), progress, shared)?;
            if training.outcome == Outcome::Stopped {
                return Ok(None);
            }
            networks.push(learned(kind, run, experiment, training, &place)?);
        }
        let trained = clock.elapsed().as_secs_f64();
        shared.say(format_args!("seed {seed}: generating, recognising, evaluating"));
        let (findings, material) = study.evaluate(&networks, seed, &engine)?;
        let evaluated = clock.elapsed().as_secs_f64() - trained;
        if interrupt.asked() {
            return Ok(None);
        }
        let trainings: Vec<TrainingFacts> = networks.iter().map(|network| network.training.clone()).collect();
        let seconds = evaluated + trainings.iter().map(|training| training.seconds).sum::<f64>();
        Ok(Some(Seed { result: SeedResult { seed, seconds, threads, trainings, findings }, networks, material }))
    };
    let Some(seeds) = seeds::side_by_side(&numbers, cores, one)? else {
        shared.say("interrupted: what was learned is saved, and the same command goes on with it");
        return Ok(Ending::Interrupted);
    };

    let (mut results, mut networks, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for Seed { result, networks: own, material } in seeds {
        results.push(result);
        networks.push(own);
        materials.push(material);
    }
    let metrics = Metrics {
        format: 1,
        experiment: arguments.experiment.word(),
        preset: arguments.preset.word(),
        command: command(arguments),
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::here(cores, shared.instruction_set()),
        seconds: begun.elapsed().as_secs_f64(),
        settings: networks[0].iter().map(|network| network.experiment.clone()).collect(),
        summary: study.measures().iter().map(|measure| Summary::of(measure, &results)).collect(),
        verdicts: study.verdicts(&results),
        seeds: results,
    };
    let page = overview::page(study, &metrics, &networks, &materials[0]);
    let text = serde_json::to_string_pretty(&metrics).expect("strings and numbers become JSON") + "\n";
    folder.write(METRICS, text.as_bytes())?;
    report::write(&page, &path)?;

    if arguments.json {
        output::print(&text)?;
    } else {
        output::print(&told(&metrics, &path))?;
    }
    let diverged = metrics.seeds.iter().flat_map(|seed| &seed.trainings).filter_map(|facts| facts.diverged.as_ref());
    let diverged: Vec<&String> = diverged.collect();
    for sentence in &diverged {
        eprintln!("{sentence}; the page speaks of the last good epoch");
    }
    Ok(if diverged.is_empty() { Ending::Done } else { Ending::Diverged })
}

/// The network that a training ended with.
fn learned(kind: &Kind, folder: String, experiment: Experiment, training: Training, place: &Path) -> Result<Learned> {
    let Network { topology, parameters } = training.learner.network();
    let network = Network { topology: topology.clone(), parameters: parameters.clone() };
    let name = kind.called(&experiment);
    let facts = TrainingFacts::of(name, &folder, &training);
    Ok(Learned {
        name,
        experiment,
        network,
        initial_states: training.learner.initial_states().clone(),
        source: training.source,
        history: history::read(&place.join(HISTORY))?,
        training: facts,
    })
}

/// The command that does the same again.
fn command(arguments: &Arguments) -> String {
    let mut line = format!("scrnn reproduce {} --preset {}", arguments.experiment.word(), arguments.preset.word());
    line += &format!(" --seeds {} --seed {}", arguments.seeds, arguments.seed);
    if let Some(epochs) = arguments.epochs {
        line += &format!(" --epochs {epochs}");
    }
    if arguments.beyond {
        line += " --beyond";
    }
    for change in &arguments.set {
        let key_and_value = change.typed.trim_start_matches("--set ");
        line += &format!(" --set '{}'", key_and_value.replace('\'', "'\\''"));
    }
    line
}

/// The result in words and tables.
fn told<F>(metrics: &Metrics<F>, path: &Path) -> String {
    let numbers: Vec<String> = metrics.seeds.iter().map(|seed| format!("seed {}", seed.seed)).collect();
    let with_seeds = |head: &[&str], tail: &[&str]| -> Table {
        let mut cells = head.to_vec();
        cells.extend(numbers.iter().map(String::as_str));
        cells.extend(tail);
        Table::new(&cells)
    };
    let mut measures = with_seeds(&["measure", "thesis"], &["mean"]);
    for summary in &metrics.summary {
        let mut row = vec![summary.label.to_owned(), summary.thesis.to_owned()];
        row.extend(summary.values.iter().map(|&value| summary.shown(value)));
        row.push(summary.shown_mean());
        measures.row(row);
    }
    let mut verdicts = with_seeds(&["goal", "needed"], &["verdict"]);
    for verdict in &metrics.verdicts {
        let mut row = vec![verdict.goal.clone(), verdict.needed.clone()];
        row.extend(verdict.seeds.iter().map(|seed| seed.found.clone()));
        row.push(verdict.word().to_owned());
        verdicts.row(row);
    }
    let took = in_words(std::time::Duration::from_secs_f64(metrics.seconds));
    let folder = path.display();
    format!("{measures}\n{verdicts}\nafter {took}: {folder}/{PAGE}, {folder}/{METRICS}, {folder}/{FIGURES}/\n")
}
