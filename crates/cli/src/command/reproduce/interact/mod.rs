//! `scrnn reproduce interact`: the thesis' chapter 5, from two robots in a world to a page.

mod conditions;
mod figures;
mod findings;
mod page;
mod scan;
mod trials;
mod world;

use std::path::Path;
use std::time::Instant;

use indicatif::MultiProgress;
use scrnn::engine::Engine;
use scrnn::learning::Outcome;
use serde::Serialize;

use super::metrics::{METRICS, Machine};
use super::study::TrainingFacts;
use super::{Arguments, command, seeds};
use crate::args::Shared;
use crate::command::train::{Found, Interrupt, train};
use crate::experiment::Experiment;
use crate::failure::{Ending, Failure, Result};
use crate::output;
use crate::progress::{Progress, in_words};
use crate::report::{self, FIGURES, PAGE};
use crate::run_folder::RunFolder;
use crate::table::Table;
use conditions::{BEYOND, Condition, NARROW, WIDE};
use figures::Material;
use findings::{Findings, Overall};
use trials::Subject;

/// Seed of the recordings: the thesis' networks differ in their first weights alone.
const RECORDINGS: u64 = 1;

/// All numbers.
#[derive(Debug, Serialize)]
pub struct Metrics {
    format: u32,
    experiment: &'static str,
    preset: &'static str,
    command: String,
    version: &'static str,
    machine: Machine,
    seconds: f64,
    settings: Vec<Experiment>,
    networks: Vec<Findings>,
    #[serde(flatten)]
    overall: Overall,
}

/// One network that went through everything.
struct Done {
    findings: Findings,
    experiment: Experiment,
    material: Option<Material>,
}

/// Reproduces.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let begun = Instant::now();
    let name = format!("interact-{}", arguments.preset.word());
    let path = arguments.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").join(&name));
    let folder = RunFolder::open(&path)?;
    if arguments.overwrite {
        folder.remove(PAGE)?;
        folder.remove(METRICS)?;
    }
    let path = std::path::absolute(&path).map_err(|error| Failure::disk("find", &path, error))?;
    let conditions: Vec<Condition> = match arguments.beyond {
        false => vec![NARROW, WIDE],
        true => [NARROW, WIDE].into_iter().chain(BEYOND).collect(),
    };
    let mut recordings = Vec::new();
    for condition in &conditions {
        shared.say(format_args!("{}: recordings of two robots", condition.label));
        recordings.push(condition.record(&path, RECORDINGS)?);
    }
    // Conditions take turns, so that whatever is interrupted has networks of each.
    let jobs: Vec<(usize, u64)> = (0..arguments.seeds)
        .flat_map(|k| (0..conditions.len()).map(move |condition| (condition, k)))
        .filter(|&(condition, k)| conditions[condition].of_thesis || k < BEYOND_NETWORKS)
        .map(|(condition, k)| (condition, arguments.seed.saturating_add(k)))
        .collect();
    let cores = shared.engine()?.threads();
    let interrupt = Interrupt::listen();
    let bars = MultiProgress::new();
    let one = |job: usize| -> Result<Option<Done>> {
        let (index, seed) = jobs[job];
        let (condition, data) = (&conditions[index], &recordings[index]);
        let engine = Engine::new(if jobs.len() == 1 { cores } else { 1 }, shared.instruction_set())?;
        let how = (arguments.epochs, arguments.set.as_slice());
        let experiment = condition.experiment(&path, arguments.preset, seed, how)?;
        let run = format!("{}-{seed}", condition.key);
        let progress = Progress::labelled(&format!("{run}: "), experiment.training.epochs, shared.quiet, &bars);
        let found = if arguments.overwrite { Found::Overwrite } else { Found::GoOn };
        let training = train(&experiment, (&path.join(&run), found), (&engine, &interrupt), progress, shared)?;
        if training.outcome == Outcome::Stopped {
            return Ok(None);
        }
        shared.say(format_args!("{run}: generating, following, regressing, in the world"));
        let scaled = training.scaling.apply(data);
        let subject = Subject {
            network: training.learner.network(),
            states: training.learner.initial_states(),
            scaling: &training.scaling,
            data: &scaled,
            seed,
            engine: &engine,
        };
        let findings = Findings::of(condition, seed, TrainingFacts::of("S-MTRNN", &run, &training), &subject)?;
        let material = if seed == arguments.seed && condition.of_thesis {
            Some(Material::of(condition.key, &subject)?)
        } else {
            None
        };
        Ok((!interrupt.asked()).then_some(Done { findings, experiment, material }))
    };
    let Some(done) = seeds::one_by_one(jobs.len(), cores, one)? else {
        shared.say("interrupted: what was learned is saved, and the same command goes on with it");
        return Ok(Ending::Interrupted);
    };

    let mut networks = Vec::new();
    let (mut settings, mut materials) = (Vec::new(), Vec::new());
    for Done { findings, experiment, material } in done {
        if settings.len() < conditions.len() {
            settings.push(experiment);
        }
        networks.push(findings);
        materials.extend(material);
    }
    let order = |key: &str| conditions.iter().position(|condition| condition.key == key);
    networks.sort_by_key(|one| (order(one.condition), one.seed));
    let seconds = begun.elapsed().as_secs_f64();
    let channels = recordings[0].channels().len();
    let metrics = Metrics {
        format: 1,
        experiment: "interact",
        preset: arguments.preset.word(),
        command: command(arguments),
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::here(cores, shared.instruction_set()),
        seconds,
        settings,
        overall: Overall::of(&networks, channels, seconds),
        networks,
    };
    let page = page::page(&metrics, &conditions, &materials);
    let text = serde_json::to_string_pretty(&metrics).expect("strings and numbers become JSON") + "\n";
    folder.write(METRICS, text.as_bytes())?;
    report::write(&page, &path)?;
    if arguments.json {
        output::print(&text)?;
    } else {
        output::print(&told(&metrics, &path))?;
    }
    let diverged: Vec<&String> = metrics.networks.iter().filter_map(|one| one.training.diverged.as_ref()).collect();
    for sentence in &diverged {
        eprintln!("{sentence}; the page speaks of the last good epoch");
    }
    Ok(if diverged.is_empty() { Ending::Done } else { Ending::Diverged })
}

/// Networks for each condition beyond the thesis.
const BEYOND_NETWORKS: u64 = 3;

/// The result in tables.
fn told(metrics: &Metrics, path: &Path) -> String {
    let mut measures = Table::new(&["measure", "thesis", "mean and sd"]);
    for summary in metrics.overall.summary.iter().filter(|summary| !summary.values.is_empty()) {
        measures.row(vec![
            summary.label.to_owned(),
            summary.thesis.to_owned(),
            format!("{:.2} \u{b1} {:.2}", summary.mean, summary.deviation),
        ]);
    }
    let mut goals = Table::new(&["goal", "needed", "found", "verdict"]);
    for goal in &metrics.overall.goals {
        let verdict = if goal.met { "met" } else { "missed" };
        goals.row(vec![goal.goal.to_owned(), goal.needed.to_owned(), goal.found.clone(), verdict.to_owned()]);
    }
    let took = in_words(std::time::Duration::from_secs_f64(metrics.seconds));
    let folder = path.display();
    format!("{measures}\n{goals}\nafter {took}: {folder}/{PAGE}, {folder}/{METRICS}, {folder}/{FIGURES}/\n")
}
