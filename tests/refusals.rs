//! What the library refuses, in words that say what was found and what was needed; and what it does at the edge of the finite
//! numbers. The program refuses most of this sooner, with a file and a line.

use scrnn::analysis::mixture::{GaussianMixture, MixtureOptions};
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::error::Result;
use scrnn::error_regression::{Ascent, ErrorRegression, ErrorRegressionOptions};
use scrnn::generation::{Feedback, Running};
use scrnn::initial_states::InitialStates;
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Learner, Optimiser, Outcome, Plan};
use scrnn::network::Network;
use scrnn::parameters::Block;
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn::scaling::Scaling;
use scrnn::topology::{Group, Prediction, Topology};
use std::ops::ControlFlow;

const UNITS: usize = 5;

fn topology(prediction: Prediction) -> Topology {
    Topology::new(2, 1, vec![Group::full("context", UNITS, 2.0)], prediction).unwrap()
}

fn network() -> (Network, InitialStates) {
    initialize(&topology(Prediction::MeanAndVariance { floor: 0.0 }), 2, 1)
}

/// Two waves on two channels.
fn waves() -> Dataset {
    let wave = |shift: f64| (0..60).map(|k| 0.5 * (0.3 * f64::from(k) + shift).sin()).collect();
    let sequence = |name: &str, shift| Sequence::new(name, 2, wave(shift)).unwrap();
    Dataset::new(vec!["a".into(), "b".into()], vec![sequence("one", 0.0), sequence("two", 1.0)]).unwrap()
}

fn refused<T>(result: Result<T>, words: &[&str]) {
    let message = result.err().expect("is refused").to_string();
    for word in words {
        assert!(message.contains(word), "{message}\nneeded: {word}");
    }
}

#[test]
fn data_that_do_not_fit_together_are_refused() {
    refused(Sequence::new("walk", 2, vec![0.0; 5]), &["walk", "5", "6"]);
    refused(Sequence::new("walk", 0, vec![0.0; 5]), &["walk"]);
    refused(Dataset::new(vec!["a".into()], vec![]), &["sequence"]);
    let flat = Sequence::new("flat", 1, vec![0.0; 4]).unwrap();
    assert!(!flat.is_empty() && Sequence::new("none", 1, vec![]).unwrap().is_empty());
    refused(Dataset::new(vec!["a".into(), "b".into()], vec![flat.clone()]), &["sequence 0", "1", "2"]);
    let narrow = Dataset::new(vec!["a".into()], vec![flat]).unwrap();
    refused(narrow.check_for(network().0.topology()), &["data set", "1", "2"]);
}

#[test]
fn networks_and_scalings_without_sense_are_refused() {
    refused(Topology::new(2, 1, vec![], Prediction::Mean), &["empty", "at least one group"]);
    let twice = vec![Group::full("fast", 3, 2.0), Group::full("fast", 4, 5.0)];
    refused(Topology::new(2, 1, twice, Prediction::Mean), &["`fast` twice", "distinct names"]);
    refused(Scaling::new(vec![0.0, 0.0], vec![1.0]), &["scales", "1", "2"]);
    refused(Scaling::new(vec![0.0], vec![f64::NAN]), &["NaN", "finite"]);
    refused(Scaling::new(vec![f64::INFINITY], vec![1.0]), &["inf", "finite"]);
    let options = MixtureOptions { regularisation: 0.0, ..MixtureOptions::default() };
    refused(GaussianMixture::fit(&[0.0, 1.0, 2.0], 1, &options), &["regularisation", "0", "positive"]);
}

#[test]
fn instructions_that_the_processor_does_not_have_are_refused_with_those_that_it_has() {
    let strange = if cfg!(target_arch = "aarch64") { InstructionSet::Avx2 } else { InstructionSet::Neon };
    refused(Engine::new(1, strange), &[&strange.to_string(), "portable"]);
}

#[test]
fn learning_and_recognising_ask_for_what_belongs_to_them() {
    let engine = Engine::new(1, InstructionSet::Portable).unwrap();
    let (network, states) = network();
    let one = InitialStates::zeros(network.topology(), 1);
    let plan = Plan::with(|it| {
        it.epochs = 10;
    });
    refused(Learner::new(network.clone(), one, &waves(), plan, &engine), &["initial states", "1", "2"]);
    let options = RecognitionOptions::with(|it| {
        it.warm_starts = vec![];
    });
    refused(recognize(&network, &states, &waves(), &options, &engine), &["empty", "at least one kind"]);
}

#[test]
fn a_recognition_whose_steps_become_non_finite_keeps_the_best_start() {
    let engine = Engine::new(1, InstructionSet::Portable).unwrap();
    let (mut network, states) = network();
    // A variance that follows the context without bounds: far out it overflows.
    network.block_mut(Block::VarianceFromContext).fill(300.0);
    let options = RecognitionOptions::with(|it| {
        it.starts = 4;
        it.epochs = 20;
        it.rate = 1e3;
    });
    for found in recognize(&network, &states, &waves(), &options, &engine).unwrap() {
        for trial in &found.trials {
            assert!(trial.ln_likelihood.is_finite() || trial.ln_likelihood == f64::NEG_INFINITY, "{trial:?}");
            assert!(trial.initial_state.iter().all(|u| u.is_finite()), "{trial:?}");
        }
    }
}

#[test]
fn a_gradient_beyond_all_numbers_is_a_divergence_that_names_its_block() {
    let engine = Engine::new(1, InstructionSet::Portable).unwrap();
    let (mut network, states) = network();
    // v = 1e-308 and errors near 0.05: the sum of e^2 / 2v is a number, that of e / v is none.
    network.parameters_mut().fill(0.0);
    network.block_mut(Block::VarianceBias).fill(-709.0);
    let near = |name: &str| Sequence::new(name, 2, (0..120).map(|k| 0.05 + 1e-4 * f64::from(k % 7)).collect()).unwrap();
    let data = Dataset::new(vec!["a".into(), "b".into()], vec![near("one"), near("two")]).unwrap();
    let plan = Plan::with(|it| {
        it.epochs = 3;
        it.optimiser = Optimiser::Adam(Adam::default());
    });
    let mut learner = Learner::new(network, states, &data, plan, &engine).unwrap();
    let ended = learner.run(&mut |_: &EpochReport, _: &Learner| ControlFlow::Continue(()));
    let Outcome::Diverged(divergence) = ended else { panic!("did not diverge") };
    let told = divergence.to_string();
    assert!(told.contains("diverged at epoch 0") && told.contains("gradient of "), "{told}");
}

#[test]
fn error_regression_refuses_what_it_cannot_use() {
    let (network, _) = network();
    let new = |state: &[f64], change: &dyn Fn(&mut ErrorRegressionOptions)| {
        let mut options = ErrorRegressionOptions::new(2);
        change(&mut options);
        ErrorRegression::new(&network, state, options, &Engine::new(1, InstructionSet::Portable).unwrap())
    };
    refused(new(&[0.0; 4], &|_| ()), &["initial state", "4", "5"]);
    refused(
        new(&[0.0; UNITS], &|o| o.ascent = Ascent::Momentum { rate: 0.1, momentum: 1.0 }),
        &["momentum", "1", "below 1"],
    );
    refused(new(&[0.0; UNITS], &|o| o.max_norm = Some(0.0)), &["longest gradient", "0", "positive"]);
}

#[test]
fn a_shortened_gradient_moves_the_state_less() {
    let (network, _) = network();
    let moved = |max_norm| {
        let ascent = Ascent::Momentum { rate: 1e-2, momentum: 0.0 };
        let options = ErrorRegressionOptions::with(2, |it| {
            it.window = 10;
            it.iterations = 1;
            it.ascent = ascent;
            it.max_norm = max_norm;
        });
        let mut regression =
            ErrorRegression::new(&network, &[0.1; UNITS], options, &Engine::new(1, InstructionSet::Portable).unwrap())
                .unwrap();
        let mut gain = 0.0;
        for k in 0..30 {
            let sample = [0.9 * (0.7 * f64::from(k)).sin(), -0.8];
            let [before, after] = regression.observe(&sample, &mut || true).unwrap().ln_likelihood;
            gain += (after - before).abs();
        }
        gain
    };
    let (free, long, short) = (moved(None), moved(Some(1e9)), moved(Some(1e-3)));
    assert_eq!(free, long);
    assert!(short > 0.0 && short < 0.1 * free, "{short} of {free}");
}

#[test]
fn a_network_without_variance_runs_beside_a_world_and_can_change_its_feedback() {
    let (network, _) = initialize(&topology(Prediction::Mean), 1, 3);
    let run = |change: bool| {
        let set = InstructionSet::Portable;
        let mut running =
            Running::new(&network, &[0.2; UNITS], Feedback::open(2), 1, &Engine::new(1, set).unwrap()).unwrap();
        for k in 0..20 {
            if change && k == 10 {
                running.set_feedback(Feedback::closed(2, false)).unwrap();
            }
            running.step(&[0.1 * f64::from(k), 0.3]).unwrap();
        }
        assert!(running.variance().is_empty());
        running.mean().to_vec()
    };
    let (open, closed) = (run(false), run(true));
    assert_ne!(open, closed);
    assert!(closed.iter().all(|y| y.abs() <= 1.0));
}
