//! A made-up study through the whole framework.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use scrnn::engine::InstructionSet;
use scrnn_report::Section;
use scrnn_run::failure::Ending;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::{Messages, Silent};
use serde_json::Value;

use super::comparison::Test;
use super::context::Context;
use super::options::{Options, Reproduced};
use super::preset::{Preset, asset};
use super::*;

const WAVE: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("sinusoid.toml"), asset!("sinusoid_fast.toml")] };

/// Two conditions, and evaluations of four parts.
#[derive(Debug, Default)]
struct Toy {
    /// What was really done.
    done: Mutex<Vec<String>>,
    /// In the middle of which part somebody asks to stop.
    stop_in: Option<&'static str>,
    interrupt: Interrupt,
    edition: u32,
}

impl Study for Toy {
    type Findings = Vec<f64>;
    type Material = u64;

    fn title(&self) -> &'static str {
        "Toy"
    }

    fn edition(&self) -> u32 {
        self.edition
    }

    fn conditions(&self, beyond: bool) -> Vec<Condition> {
        let one = |key, most| Condition { key, label: key, networks: &[WAVE], most };
        [vec![one("a", None), one("b", None)], if beyond { vec![one("c", Some(1))] } else { Vec::new() }].concat()
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Vec<f64>, u64)> {
        let mut found = Vec::new();
        for part in 0..4 {
            let name = format!("{}-{} part {part}", job.condition.key, job.seed);
            found.push(desk.part(&name, || {
                self.done.lock().unwrap().push(name.clone());
                if self.stop_in == Some(&name) {
                    self.interrupt.ask();
                }
                desk.go_on()?;
                Ok(job.networks[0].initial_states.values()[part])
            })?);
        }
        Ok((found, job.seed))
    }

    fn measures(&self) -> Vec<Measure<Vec<f64>>> {
        let first = |f: &Vec<f64>| f.first().copied();
        let of = |condition, key| Measure { condition: Some(condition), ..Measure::new(key, key, "", "", 3, first) };
        vec![of("a", "first_a"), of("b", "first_b"), Measure::new("all", "all", "", "", 3, first)]
    }

    fn comparisons(&self) -> Vec<Comparison> {
        let measures = ["first_a", "first_b"];
        vec![Comparison { what: "a against b", thesis: "", measures, test: Test::Paired, within: None }]
    }

    fn tables(&self, results: &Results<Vec<f64>>) -> Vec<Table> {
        let rows = results.jobs.iter().map(|job| vec![Cell::Count(job.seed), Cell::Numbers(job.findings.clone())]);
        let column = |key| Column { key, label: key, digits: 2 };
        let (caption, note) = ("All", "");
        vec![Table { key: "all", caption, columns: vec![column("seed"), column("parts")], rows: rows.collect(), note }]
    }

    fn verdicts(&self, results: &Results<Vec<f64>>) -> Vec<Verdict> {
        results.comparisons.iter().map(|one| one.verdict()).collect()
    }

    fn sections(&self, _results: &Results<Vec<f64>>, materials: &[u64]) -> Vec<Section> {
        vec![Section { title: format!("materials {materials:?}"), blocks: Vec::new() }]
    }
}

fn options(out: &Path, overwrite: bool) -> Options {
    let out = Some(PathBuf::from(out));
    let (preset, set) = (Preset::Fast, Vec::new());
    Options { preset, seeds: 2, seed: 4, out, epochs: Some(2), set, beyond: false, overwrite }
}

fn run(toy: &Toy, options: &Options, threads: usize, messages: &dyn Messages) -> (Reproduced, Vec<String>) {
    let context = Context {
        threads,
        instruction_set: InstructionSet::best(),
        interrupt: &toy.interrupt,
        messages,
        progress: &|_, _| Box::new(Silent),
    };
    let reproduced = reproduce("toy", toy, options, &context).unwrap();
    (reproduced, std::mem::take(&mut *toy.done.lock().unwrap()))
}

/// Without what a clock says, and without the folder.
fn numbers(reproduced: &Reproduced) -> Value {
    let mut value: Value = serde_json::from_str(&reproduced.json).unwrap();
    for key in ["seconds", "times", "machine", "command"] {
        value.as_object_mut().unwrap().remove(key).unwrap();
    }
    for seed in value["seeds"].as_array_mut().unwrap() {
        for key in ["seconds", "seconds_of_evaluation", "threads"] {
            seed.as_object_mut().unwrap().remove(key).unwrap();
        }
        seed["trainings"][0].as_object_mut().unwrap().remove("seconds").unwrap();
    }
    value
}

#[test]
fn an_interrupted_reproduction_repeats_no_part_and_comes_to_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, cut) = (folder.path().join("whole"), folder.path().join("cut"));
    let (uninterrupted, done) = run(&Toy::default(), &options(&whole, false), 2, &Silent);
    assert_eq!((uninterrupted.ending, done.len()), (Ending::Done, 16));

    let stopped = Toy { stop_in: Some("b-4 part 2"), ..Toy::default() };
    let (nothing, done) = run(&stopped, &options(&cut, false), 1, &Silent);
    let all: Vec<String> = (0..4).map(|part| format!("a-4 part {part}")).collect();
    assert_eq!(done, [&all[..], &["b-4 part 0", "b-4 part 1", "b-4 part 2"].map(String::from)].concat());
    assert_eq!((nothing.ending, nothing.json.as_str()), (Ending::Interrupted, ""));
    assert!(!cut.join("metrics.json").exists() && !cut.join("report.html").exists());

    let (resumed, done) = run(&Toy::default(), &options(&cut, false), 1, &Silent);
    assert_eq!(done[..2], ["b-4 part 2", "b-4 part 3"]);
    assert_eq!(done.len(), 2 + 8);
    assert_eq!(numbers(&resumed), numbers(&uninterrupted));

    // Once more: nothing is left to do. Another edition does all of it again, and so does --overwrite.
    assert_eq!(run(&Toy::default(), &options(&cut, false), 2, &Silent).1.len(), 0);
    assert_eq!(run(&Toy { edition: 2, ..Toy::default() }, &options(&cut, false), 2, &Silent).1.len(), 16);
    let (anew, done) = run(&Toy { edition: 2, ..Toy::default() }, &options(&cut, true), 2, &Silent);
    assert_eq!(done.len(), 16);
    assert_eq!(numbers(&anew), numbers(&uninterrupted));
}

#[test]
fn jobs_come_condition_by_condition_with_all_that_is_made_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let with = Options { beyond: true, ..options(folder.path(), false) };
    let (reproduced, _) = run(&Toy::default(), &with, 2, &Silent);
    let found: Value = serde_json::from_str(&reproduced.json).unwrap();
    let jobs: Vec<(&str, u64)> = found["seeds"]
        .as_array()
        .unwrap()
        .iter()
        .map(|job| (job["condition"].as_str().unwrap(), job["seed"].as_u64().unwrap()))
        .collect();
    assert_eq!(jobs, [("a", 4), ("a", 5), ("b", 4), ("b", 5), ("c", 4)]);
    assert_eq!(found["seeds"][4]["trainings"][0]["folder"], "c-4");
    let values = |at: usize| found["summary"][at]["values"].as_array().unwrap().len();
    assert_eq!((values(0), values(1), values(2)), (2, 2, 5));
    assert_eq!((found["format"].as_u64(), found["settings"].as_array().unwrap().len()), (Some(2), 3));
    assert_eq!(found["tables"]["all"][1]["parts"], found["seeds"][1]["findings"]);
    // The same weights under both conditions: no difference.
    assert_eq!(found["comparisons"][0]["difference"], 0.0);
    assert_eq!(found["verdicts"][0]["met"], false);
    let keys: Vec<&str> = found["times"].as_array().unwrap().iter().map(|one| one["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["training", "evaluation"]);
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("materials [4, 5, 4, 5, 4]") && page.contains("learning-s-ctrnn-b"));
    assert!(page.contains("no goal asks for them"));
}

/// Collects what is said.
#[derive(Debug, Default)]
struct Said(Mutex<Vec<String>>);

impl Messages for Said {
    fn say(&self, message: &str) {
        self.0.lock().unwrap().push(message.to_owned());
    }
}

#[test]
fn an_evaluation_says_what_it_is_at_after_a_silence() {
    let (said, interrupt) = (Said::default(), Interrupt::new());
    let engine = scrnn::engine::Engine::serial();
    let desk = Desk::new(&engine, (&interrupt, &said), "seed 4", None);
    desk.at(|| "too soon".to_owned()).unwrap();
    desk.be_silent_for(std::time::Duration::from_secs(6));
    desk.at(|| "recording 3 of 8".to_owned()).unwrap();
    desk.at(|| "too soon again".to_owned()).unwrap();
    assert_eq!(*said.0.lock().unwrap(), ["seed 4: recording 3 of 8"]);
    interrupt.ask();
    assert!(matches!(desk.at(String::new), Err(super::stop::Stop::Interrupted)));
}
