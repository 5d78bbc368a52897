//! The thesis' chapter 5, from two robots in a world to a page.

mod conditions;
mod figures;
mod findings;
mod page;
mod scan;
mod trials;
mod world;

use std::time::Instant;

use scrnn::engine::Engine;
use scrnn::learning::Outcome;
use serde::Serialize;

use crate::metrics::{METRICS, Machine};
use crate::study::TrainingFacts;
use crate::{Context, Options, Reproduced, command, say_diverged, seeds};
use conditions::{BEYOND, Condition, NARROW, WIDE};
use figures::Material;
use findings::{Findings, Overall};
use scrnn_report::{FIGURES, PAGE, Table, in_words};
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::run_folder::RunFolder;
use scrnn_run::training::{Found, train};
use std::path::Path;
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
pub fn run(options: &Options, context: &Context<'_>) -> Result<Reproduced> {
    let begun = Instant::now();
    let name = format!("interact-{}", options.preset.word());
    let path = options.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").join(&name));
    let folder = RunFolder::open(&path)?;
    if options.overwrite {
        folder.remove(PAGE)?;
        folder.remove(METRICS)?;
    }
    let path = std::path::absolute(&path).map_err(|error| Failure::disk("find", &path, error))?;
    let conditions: Vec<Condition> = match options.beyond {
        false => vec![NARROW, WIDE],
        true => [NARROW, WIDE].into_iter().chain(BEYOND).collect(),
    };
    let mut recordings = Vec::new();
    for condition in &conditions {
        context.messages.say(&format!("{}: recordings of two robots", condition.label));
        recordings.push(condition.record(&path, RECORDINGS, context.threads)?);
    }
    // Conditions take turns, so that whatever is interrupted has networks of each.
    let jobs: Vec<(usize, u64)> = (0..options.seeds)
        .flat_map(|k| (0..conditions.len()).map(move |condition| (condition, k)))
        .filter(|&(condition, k)| conditions[condition].of_thesis || k < BEYOND_NETWORKS)
        .map(|(condition, k)| (condition, options.seed.saturating_add(k)))
        .collect();
    let cores = context.threads;
    let one = |job: usize| -> Result<Option<Done>> {
        let (index, seed) = jobs[job];
        let (condition, data) = (&conditions[index], &recordings[index]);
        let engine = Engine::new(if jobs.len() == 1 { cores } else { 1 }, context.instruction_set)?;
        let how = (options.epochs, options.set.as_slice());
        let experiment = condition.experiment(&path, options.preset, seed, how)?;
        let run = format!("{}-{seed}", condition.key);
        let progress = (context.progress)(&format!("{run}: "), experiment.training.epochs);
        let found = if options.overwrite { Found::Overwrite } else { Found::GoOn };
        let training =
            train(&experiment, (&path.join(&run), found), (&engine, context.interrupt), progress, context.messages)?;
        if training.outcome == Outcome::Stopped {
            return Ok(None);
        }
        context.messages.say(&format!("{run}: generating, following, regressing, in the world"));
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
        let material = if seed == options.seed && condition.of_thesis {
            Some(Material::of(condition.key, &subject)?)
        } else {
            None
        };
        Ok((!context.interrupt.asked()).then_some(Done { findings, experiment, material }))
    };
    let Some(done) = seeds::one_by_one(jobs.len(), cores, one)? else {
        return Ok(Reproduced::interrupted(context));
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
        preset: options.preset.word(),
        command: command(options),
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::here(cores, context.instruction_set),
        seconds,
        settings,
        overall: Overall::of(&networks, channels, seconds),
        networks,
    };
    let page = page::page(&metrics, &conditions, &materials);
    let text = serde_json::to_string_pretty(&metrics).expect("strings and numbers become JSON") + "\n";
    folder.write(METRICS, text.as_bytes())?;
    scrnn_pages::write(&page, &path)?;
    let ending = say_diverged(metrics.networks.iter().filter_map(|one| one.training.diverged.as_ref()), context);
    Ok(Reproduced { ending, json: text, text: told(&metrics, &path) })
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
