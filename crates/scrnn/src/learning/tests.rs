//! Learning as a whole: it ascends, resumes, rolls back, and does not depend on threads.

use super::*;
use crate::dataset::{Dataset, Sequence};
use crate::engine::{Engine, InstructionSet};
use crate::initialization::initialize;
use crate::topology::{Group, Prediction, Topology};

fn waves(sequences: usize, steps: usize) -> Dataset {
    let of = |s: usize| {
        let values = (0..steps).map(|t| 0.6 * (0.3 * t as f64 + s as f64).sin() + 0.05 * (7.1 * t as f64).cos());
        Sequence::new(s.to_string(), 1, values.collect()).unwrap()
    };
    Dataset::new(vec!["y".into()], (0..sequences).map(of).collect()).unwrap()
}

fn learner(plan: Plan, threads: usize) -> Learner {
    let topology = Topology::s_ctrnn(1, 8, 2.0).unwrap();
    let (network, states) = initialize(&topology, 3, 5);
    let engine = Engine::new(threads, InstructionSet::best()).unwrap();
    Learner::new(network, states, &waves(3, 60), plan, &engine).unwrap()
}

fn momentum(epochs: u64, options: Momentum) -> Plan {
    Plan { epochs, optimiser: Optimiser::Momentum(options), ..Plan::default() }
}

fn adam(epochs: u64) -> Plan {
    Plan { epochs, optimiser: Optimiser::Adam(Adam { rate: 0.01, ..Adam::default() }), ..Plan::default() }
}

/// Runs, and returns the objective of every epoch.
fn run(learner: &mut Learner) -> (Outcome, Vec<f64>) {
    let mut history = Vec::new();
    let outcome = learner.run(&mut |report: &EpochReport, _: &Learner| {
        history.push(report.ln_likelihood);
        Control::Continue
    });
    (outcome, history)
}

fn bits(learner: &Learner) -> Vec<u64> {
    let states = learner.initial_states();
    let lists = [learner.network().parameters.as_slice(), states.values(), states.mean()];
    lists.concat().iter().map(|x| x.to_bits()).collect()
}

#[test]
fn every_optimiser_ascends() {
    let adaptive = Momentum { adaptive: Some(AdaptiveRate::default()), ..Momentum::default() };
    for plan in [momentum(4000, Momentum::default()), momentum(800, adaptive), adam(800)] {
        let mut learner = learner(plan.clone(), 1);
        let (outcome, history) = run(&mut learner);
        assert_eq!((outcome, history.len() as u64), (Outcome::Finished, plan.epochs + 1));
        let (first, last) = (history[0], history[history.len() - 1]);
        assert!(last > first + 100.0, "{plan:?}: {first} to {last}");
    }
}

#[test]
fn a_learner_without_variance_lowers_the_squared_error() {
    let groups = vec![Group::full("context", 8, 2.0)];
    let topology = Topology::new(1, 1, groups, Prediction::Mean).unwrap();
    let (network, states) = initialize(&topology, 3, 5);
    let plan = momentum(1500, Momentum { rate: 0.05, ..Momentum::default() });
    let mut learner = Learner::new(network, states, &waves(3, 60), plan, &Engine::serial()).unwrap();
    let mut reports = Vec::new();
    learner.run(&mut |report: &EpochReport, _: &Learner| {
        reports.push(report.clone());
        Control::Continue
    });
    let (first, last) = (&reports[0], &reports[1500]);
    assert!(last.mse < 0.05 * first.mse, "{} to {}", first.mse, last.mse);
    assert_eq!(first.nll, None);
    assert!((first.ln_likelihood + 0.5 * first.mse * 3.0 * 59.0).abs() < 1e-9);
}

#[test]
fn stopping_and_restoring_goes_on_bit_for_bit() {
    let adaptive = Momentum { adaptive: Some(AdaptiveRate::default()), ..Momentum::default() };
    let narrow = Plan { initial_state_variance: 1e-5, ..momentum(60, Momentum::default()) };
    for plan in [momentum(60, Momentum::default()), momentum(60, adaptive), adam(60), narrow] {
        let mut whole = learner(plan.clone(), 1);
        run(&mut whole);

        let mut part = learner(plan.clone(), 1);
        let stop_at_23 = |report: &EpochReport, _: &Learner| match report.epoch {
            23 => Control::Stop,
            _ => Control::Continue,
        };
        let mut stop_at_23 = stop_at_23;
        assert_eq!(part.run(&mut stop_at_23), Outcome::Stopped);
        let engine = Engine::serial();
        let (network, states) = (part.network().clone(), part.initial_states().clone());
        let mut rest = Learner::new(network, states, &waves(3, 60), plan, &engine).unwrap();
        rest.restore(part.epoch(), &part.optimiser_state()).unwrap();
        run(&mut rest);
        assert!(bits(&whole) == bits(&rest));
        assert_eq!(whole.optimiser_state(), rest.optimiser_state());
    }
}

#[test]
fn any_number_of_threads_learns_the_same_bits() {
    let data = waves(14, 80);
    let topology = Topology::s_ctrnn(1, 8, 2.0).unwrap();
    let learn = |threads: usize| {
        let (network, states) = initialize(&topology, 14, 5);
        let engine = Engine::new(threads, InstructionSet::best()).unwrap();
        let mut learner = Learner::new(network, states, &data, adam(40), &engine).unwrap();
        run(&mut learner);
        bits(&learner)
    };
    let one = learn(1);
    assert!(learn(2) == one && learn(4) == one);
}

#[test]
fn recomputation_learns_the_same_bits() {
    let learn = |recompute| {
        let mut learner = learner(Plan { recompute, ..adam(20) }, 1);
        run(&mut learner);
        bits(&learner)
    };
    assert!(learn(true) == learn(false));
}

#[test]
fn divergence_is_located_and_rolled_back() {
    let mut learner = learner(momentum(5000, Momentum { rate: 1e12, ..Momentum::default() }), 1);
    let mut last = None;
    let outcome = learner.run(&mut |report: &EpochReport, learner: &Learner| {
        last = Some((report.epoch, bits(learner)));
        Control::Continue
    });
    let Outcome::Diverged(divergence) = outcome else { panic!("{outcome:?}") };
    let (epoch, good) = last.unwrap();
    assert_eq!((divergence.rolled_back_to, divergence.epoch, learner.epoch()), (epoch, epoch + 1, epoch));
    assert!(bits(&learner) == good);
    assert!(good.iter().all(|bits| f64::from_bits(*bits).is_finite()));
    let sentence = divergence.to_string();
    assert!(sentence.contains(&divergence.quantity) && sentence.contains("rolled back to epoch"), "{sentence}");
    assert!(divergence.sequence.is_some() || divergence.quantity.starts_with("gradient"), "{divergence:?}");
}

#[test]
fn a_narrow_prior_is_stable_for_the_implicit_step_and_for_adam_only() {
    let narrow = |plan: Plan| Plan { initial_state_variance: 1e-5, ..plan };
    let spread = |learner: &Learner| {
        let states = learner.initial_states();
        let n = states.mean().len();
        let far = |s: usize| (0..n).map(|i| (states.sequence(s)[i] - states.mean()[i]).abs()).fold(0.0, f64::max);
        (0..3).map(far).fold(0.0, f64::max)
    };
    let rate = 1e-3;
    for plan in [narrow(momentum(1500, Momentum { rate, ..Momentum::default() })), narrow(adam(500))] {
        let mut learner = learner(plan, 1);
        let (outcome, history) = run(&mut learner);
        assert_eq!(outcome, Outcome::Finished);
        assert!(history[history.len() - 1] > history[0]);
        assert!(spread(&learner) < 0.1, "{}", spread(&learner));
    }
    let literal = Momentum { rate, prior: PriorStep::Thesis, ..Momentum::default() };
    let mut learner = learner(narrow(momentum(1500, literal)), 1);
    let (outcome, _) = run(&mut learner);
    assert!(matches!(outcome, Outcome::Diverged(_)) || spread(&learner) > 10.0, "the literal rule was stable");
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refuse = |plan: Plan| plan.check().unwrap_err().to_string();
    assert!(refuse(Plan { initial_state_variance: 0.0, ..Plan::default() }).contains("initial_state_variance is 0"));
    assert!(refuse(momentum(1, Momentum { momentum: 1.0, ..Momentum::default() })).contains("momentum.momentum is 1"));
    assert!(refuse(momentum(1, Momentum { rate: f64::NAN, ..Momentum::default() })).contains("momentum.rate is NaN"));
}
