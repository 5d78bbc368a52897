//! The experiments of Murata's thesis (2016), chapters 3 to 5, each from data to page.
//!
//! [`run`] makes the data, trains, generates, recognises and evaluates. Its folder receives `report.html`, one page that needs
//! nothing else; `metrics.json`, all numbers; `figures/`, each figure as SVG with its numbers as CSV; and a run folder for each
//! training. Trainings that are finished are not repeated, and one that was interrupted goes on.

mod context;
mod curves;
mod curves_page;
mod interact;
mod limit_cycle;
mod metrics;
mod overview;
mod preset;
mod processor_time;
mod reach;
mod seeds;
mod sinusoid;
mod study;

use std::path::{Path, PathBuf};
use std::time::Instant;

use scrnn::engine::Engine;
use scrnn::learning::Outcome;
use scrnn::network::Network;
use scrnn_report::{FIGURES, PAGE, Table, in_words};
use scrnn_run::experiment::{Experiment, Override};
use scrnn_run::failure::{Ending, Result};
use scrnn_run::history;
use scrnn_run::run_folder::{HISTORY, RunFolder};
use scrnn_run::training::{Found, Training, train};

use metrics::{Machine, Metrics};
use preset::Kind;
use study::{Learned, SeedResult, Study, Summary, TrainingFacts};

pub use context::{Context, ProgressOf};
pub use metrics::METRICS;
pub use preset::Preset;

/// Which experiment, and how.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which experiment.
    pub experiment: Name,
    /// Which settings.
    pub preset: Preset,
    /// Number of seeds, each with data and initial weights of its own; of [`Name::Interact`] the number of networks a
    /// condition, which all learn the same recordings.
    pub seeds: u64,
    /// The first seed.
    pub seed: u64,
    /// The folder; by default `runs/reproduce/EXPERIMENT-PRESET`.
    pub out: Option<PathBuf>,
    /// Number of epochs, instead of the preset's.
    pub epochs: Option<u64>,
    /// Keys of the first network's training or network that are changed.
    pub set: Vec<Override>,
    /// With [`Name::Interact`]: also initial-state variances between the thesis' two, and branchings with a bias (5.4.3).
    pub beyond: bool,
    /// Train anew what is in the folder already.
    pub overwrite: bool,
}

/// What a reproduction came to.
#[derive(Debug)]
pub struct Reproduced {
    /// How it ended.
    pub ending: Ending,
    /// `metrics.json` as text; empty if it was interrupted.
    pub json: String,
    /// Measures and goals as tables; empty if it was interrupted.
    pub text: String,
}

impl Reproduced {
    fn interrupted(context: &Context<'_>) -> Self {
        context.messages.say("interrupted: what was learned is saved, and the same command goes on with it");
        Self { ending: Ending::Interrupted, json: String::new(), text: String::new() }
    }
}

/// The thesis' experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Name {
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
    /// All of them, in the order of the thesis.
    pub const ALL: [Self; 6] =
        [Self::Lissajous, Self::Patterns, Self::Sinusoid, Self::LimitCycle, Self::Reach, Self::Interact];

    /// As it is written on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
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
    /// As it is written on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Fast => "fast",
        }
    }
}

/// Reproduces an experiment.
///
/// # Errors
/// What is wrong with the settings, and whatever the disk refuses.
pub fn run(options: &Options, context: &Context<'_>) -> Result<Reproduced> {
    match options.experiment {
        Name::Lissajous => reproduce(&curves::LISSAJOUS, options, context),
        Name::Patterns => reproduce(&curves::PATTERNS, options, context),
        Name::Sinusoid => reproduce(&sinusoid::Sinusoid, options, context),
        Name::LimitCycle => reproduce(&limit_cycle::LimitCycle, options, context),
        Name::Reach => reproduce(&reach::REACH, options, context),
        Name::Interact => interact::run(options, context),
    }
}

/// What one seed came to.
struct Seed<S: Study> {
    result: SeedResult<S::Findings>,
    networks: Vec<Learned>,
    material: S::Material,
}

fn reproduce<S: Study>(study: &S, options: &Options, context: &Context<'_>) -> Result<Reproduced> {
    let begun = Instant::now();
    let name = format!("{}-{}", options.experiment.word(), options.preset.word());
    let path = options.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").join(&name));
    let folder = RunFolder::open(&path)?;
    if options.overwrite {
        // A page that is there would speak of trainings that are not.
        folder.remove(PAGE)?;
        folder.remove(METRICS)?;
    }

    let cores = context.threads;
    let numbers: Vec<u64> = (0..options.seeds).map(|k| options.seed.saturating_add(k)).collect();
    let one = |seed: u64, threads: usize| -> Result<Option<Seed<S>>> {
        let engine = Engine::new(threads, context.instruction_set)?;
        let clock = Instant::now();
        let mut networks = Vec::new();
        for (index, kind) in study.networks().iter().enumerate() {
            let changed = if index == 0 { options.set.as_slice() } else { &[] };
            let experiment = kind.experiment(options.preset, seed, options.epochs, changed)?;
            let run = format!("seed-{seed}{}", kind.suffix);
            let label = format!("seed {seed}, {}: ", kind.called(&experiment));
            let progress = (context.progress)(&label, experiment.training.epochs);
            let found = if options.overwrite { Found::Overwrite } else { Found::GoOn };
            let place = path.join(&run);
            let training =
                train(&experiment, (&place, found), (&engine, context.interrupt), progress, context.messages)?;
            if training.outcome == Outcome::Stopped {
                return Ok(None);
            }
            networks.push(learned(kind, run, experiment, training, &place)?);
        }
        let trained = clock.elapsed().as_secs_f64();
        context.messages.say(&format!("seed {seed}: generating, recognising, evaluating"));
        let (findings, material) = study.evaluate(&networks, seed, &engine)?;
        let evaluated = clock.elapsed().as_secs_f64() - trained;
        if context.interrupt.asked() {
            return Ok(None);
        }
        let trainings: Vec<TrainingFacts> = networks.iter().map(|network| network.training.clone()).collect();
        let seconds = evaluated + trainings.iter().map(|training| training.seconds).sum::<f64>();
        Ok(Some(Seed { result: SeedResult { seed, seconds, threads, trainings, findings }, networks, material }))
    };
    let Some(seeds) = seeds::side_by_side(&numbers, cores, one)? else {
        return Ok(Reproduced::interrupted(context));
    };

    let (mut results, mut networks, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for Seed { result, networks: own, material } in seeds {
        results.push(result);
        networks.push(own);
        materials.push(material);
    }
    let metrics = Metrics {
        format: 1,
        experiment: options.experiment.word(),
        preset: options.preset.word(),
        command: command(options),
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::here(cores, context.instruction_set),
        seconds: begun.elapsed().as_secs_f64(),
        settings: networks[0].iter().map(|network| network.experiment.clone()).collect(),
        summary: study.measures().iter().map(|measure| Summary::of(measure, &results)).collect(),
        verdicts: study.verdicts(&results),
        seeds: results,
    };
    let page = overview::page(study, &metrics, &networks, &materials[0]);
    let text = serde_json::to_string_pretty(&metrics).expect("strings and numbers become JSON") + "\n";
    folder.write(METRICS, text.as_bytes())?;
    scrnn_pages::write(&page, &path)?;
    let diverged = metrics.seeds.iter().flat_map(|seed| &seed.trainings).filter_map(|facts| facts.diverged.as_ref());
    let ending = say_diverged(diverged, context);
    Ok(Reproduced { ending, json: text, text: told(&metrics, &path) })
}

/// Says which trainings diverged, and how a reproduction with them ended.
fn say_diverged<'a>(sentences: impl Iterator<Item = &'a String>, context: &Context<'_>) -> Ending {
    let mut ending = Ending::Done;
    for sentence in sentences {
        context.messages.say(&format!("{sentence}; the page speaks of the last good epoch"));
        ending = Ending::Diverged;
    }
    ending
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
fn command(options: &Options) -> String {
    let mut line = format!("scrnn reproduce {} --preset {}", options.experiment.word(), options.preset.word());
    line += &format!(" --seeds {} --seed {}", options.seeds, options.seed);
    if let Some(epochs) = options.epochs {
        line += &format!(" --epochs {epochs}");
    }
    if options.beyond {
        line += " --beyond";
    }
    for change in &options.set {
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
