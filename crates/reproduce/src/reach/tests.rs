//! The reaching experiment in short.

use super::*;
use crate::framework::job_result::TrainingFacts;
use crate::framework::preset::Preset;
use crate::framework::{JobResult, Learned};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::initialization::initialize;
use scrnn_report::Page;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::{Messages, Silent};
use scrnn_run::source;

/// Networks that have learned nothing, beside three short demonstrations.
fn networks() -> Vec<Learned> {
    let learned = |kind: &Kind| {
        let mut experiment = kind.experiment(Preset::Fast, 2, Some(1), &[]).unwrap();
        (experiment.data.sequences, experiment.data.steps) = (Some(3), Some(36));
        let source = source::load(&experiment.data, 2).unwrap();
        let (network, initial_states) = initialize(&experiment.bare_topology(6).unwrap(), 3, 2);
        let (training, history) = (TrainingFacts::none(kind.name), Vec::new());
        let scaling = experiment.data.scaling_for(&source.data).unwrap();
        Learned { name: kind.name, experiment, network, initial_states, scaling, source, history, training }
    };
    [TAUGHT, TAUGHT_EXACTLY].iter().map(learned).collect()
}

#[test]
fn the_robot_learns_scaled_angles_by_the_settings_of_chapter_4() {
    for (kind, exact) in [(TAUGHT, false), (TAUGHT_EXACTLY, true)] {
        for preset in [Preset::Thesis, Preset::Fast] {
            let experiment = kind.experiment(preset, 3, None, &[]).unwrap();
            let (network, data) = (&experiment.network, &experiment.data);
            assert_eq!((network.groups[0].units, network.groups[0].time_constant, network.delay), (30, 2.0, 1));
            assert_eq!((network.initial_state_variance, network.variance_floor), (0.001, 0.0));
            assert_eq!((data.sequences, data.steps, data.exact_positions), (Some(30), Some(180), Some(exact)));
            assert_eq!(serde_json::to_value(&data.scaling).unwrap(), "fit");
        }
        let thesis = kind.experiment(Preset::Thesis, 3, None, &[]).unwrap().training;
        let momentum = thesis.momentum.unwrap();
        assert_eq!((thesis.epochs, momentum.rate, momentum.momentum), (500_000, 1e-4, 0.9));
    }
}

/// Asks to stop when it hears these words.
struct Stopping<'a>(&'a Interrupt, &'static str, std::sync::Mutex<Vec<String>>);

impl Messages for Stopping<'_> {
    fn say(&self, message: &str) {
        self.2.lock().unwrap().push(message.to_owned());
        if message.contains(self.1) {
            self.0.ask();
        }
    }
}

#[test]
fn the_fit_of_the_mixture_is_told_of_and_ends_when_somebody_asks() {
    let networks = networks();
    let engine = Engine::new(1, InstructionSet::best()).unwrap();
    let interrupt = Interrupt::new();
    let messages = Stopping(&interrupt, "a Gaussian mixture of 41 components", std::sync::Mutex::default());
    let desk = Desk::new(&engine, (&interrupt, &messages), "seed 2", None);
    let condition = REACH.conditions(false)[0];
    let job = Job { condition: &condition, seed: 2, first: true, networks: &networks };
    assert!(matches!(REACH.evaluate(&job, &desk), Err(crate::framework::stop::Stop::Interrupted)));
    // It was the fit that ended: no performance was begun.
    let said = messages.2.lock().unwrap();
    assert_eq!(*said, ["seed 2: a Gaussian mixture of 41 components to compare with"]);
}

#[test]
fn a_short_reproduction_judges_every_driver_and_the_same_seed_comes_to_the_same() {
    let study = Reach { cycles: 6, fewer: 1, after_shift: 1 };
    let networks = networks();
    let evaluate = |threads| {
        let engine = Engine::new(threads, InstructionSet::best()).unwrap();
        let interrupt = Interrupt::new();
        let desk = Desk::new(&engine, (&interrupt, &Silent), "", None);
        let condition = study.conditions(false)[0];
        let job = Job { condition: &condition, seed: 2, first: true, networks: &networks };
        let (mut findings, material) = study.evaluate(&job, &desk).unwrap();
        findings.speed = 0.0;
        (serde_json::to_value(&findings).unwrap(), findings, material)
    };
    let (first, findings, material) = evaluate(2);
    assert_eq!(first, evaluate(1).0);
    let keys: Vec<&str> = findings.conditions.iter().map(|condition| condition.key).collect();
    let expected = ["noise", "no_noise", "constant_noise", "frozen", "exact", "replay", "mixture", "mixture_noise"];
    assert_eq!(keys, expected);
    assert_eq!((findings.conditions[0].places.len(), findings.conditions[4].places.len()), (9, 5));
    // A tutor touches, an untrained network does not, and a replayed demonstration does where it was given.
    assert!(findings.demonstrations.iter().all(|one| one.rate() == 1.0));
    assert!(findings.rate("noise").unwrap() < 0.5);
    assert!(findings.condition("replay").unwrap().learned().iter().any(|found| found.touched > 0));
    assert_eq!((findings.shifts.len(), findings.variance.phase.len()), (6, 12));

    let (seconds, seconds_of_evaluation, threads, trainings) = (1.0, 1.0, 1, Vec::new());
    let job = JobResult { condition: None, seed: 2, seconds, seconds_of_evaluation, threads, trainings, findings };
    let (settings, summary, times, comparisons, tables) = Default::default();
    let results =
        Results { conditions: study.conditions(false), settings, jobs: vec![job], summary, times, comparisons, tables };
    let page = Page { title: "t".into(), lede: String::new(), sections: study.sections(&results, &[material]) };
    let files: Vec<&str> = page.figures().map(|figure| figure.file.as_str()).collect();
    assert_eq!(files, ["over-time", "snapshots", "phase-plots", "variance-by-phase"]);
    assert!(!page.html().contains("NaN"));
    let verdicts = study.verdicts(&results);
    assert_eq!(verdicts.len(), 15);
    let met = |goal: &str| verdicts.iter().find(|verdict| verdict.goal.starts_with(goal)).unwrap().met;
    assert!(!met("touches per cycle, no noise") && !met("touches per cycle, pooled"));
}
