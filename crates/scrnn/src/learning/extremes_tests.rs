//! Learning at the edges of numbers and of data. What must come out is what a user would want: a network, or a word; never NaN.

use super::*;
use crate::dataset::{Dataset, Sequence};
use crate::engine::Engine;
use crate::generation::{Feedback, GenerationOptions, Start, generate};
use crate::initial_states::InitialStates;
use crate::initialization::initialize;
use crate::network::Network;
use crate::parameters::Block;
use crate::recognition::{RecognitionOptions, recognize};
use crate::topology::{Group, Prediction, Topology};
use std::ops::ControlFlow;

fn data(channels: usize, sequences: &[Vec<f64>]) -> Dataset {
    let rows = sequences.iter().map(|values| Sequence::new("", channels, values.clone()).unwrap()).collect();
    Dataset::new(Dataset::numbered_channels(channels), rows).unwrap()
}

fn wave(steps: usize) -> Vec<f64> {
    (0..steps).map(|t| 0.6 * (0.3 * t as f64).sin() + 0.05 * (7.1 * t as f64).cos()).collect()
}

fn topology(channels: usize, floor: f64) -> Topology {
    Topology::new(channels, 1, vec![Group::full("context", 6, 2.0)], Prediction::MeanAndVariance { floor }).unwrap()
}

fn plan(epochs: u64, on_divergence: OnDivergence) -> Plan {
    let optimiser = Optimiser::Adam(Adam { rate: 0.01, ..Adam::default() });
    Plan { epochs, optimiser, on_divergence, ..Plan::default() }
}

/// A learner of initial parameters that were changed.
fn learner(topology: &Topology, data: &Dataset, plan: Plan, change: impl Fn(&mut Network)) -> Learner {
    let (mut network, states) = initialize(topology, data.sequences().len(), 5);
    change(&mut network);
    Learner::new(network, states, data, plan, &Engine::serial()).unwrap()
}

/// Runs; the nll of every epoch, each of them a number.
fn run(learner: &mut Learner) -> (Outcome, Vec<f64>) {
    let mut nll = Vec::new();
    let outcome = learner.run(&mut |report: &EpochReport, _: &Learner| {
        assert!(
            [report.mse, report.gradient_norm, report.ln_prior].iter().all(|value| value.is_finite()),
            "{report:?}"
        );
        nll.push(report.nll.unwrap_or(report.mse));
        ControlFlow::Continue(())
    });
    assert!(nll.iter().all(|value| value.is_finite()));
    finite(learner.network(), learner.initial_states());
    (outcome, nll)
}

fn finite(network: &Network, states: &InitialStates) {
    let all = [network.parameters.as_slice(), states.values(), states.mean()].concat();
    assert!(all.iter().all(|value| value.is_finite()));
}

/// exp of the variance units overflows above 709.8 and is 0 below -745.2.
#[test]
fn a_variance_beyond_all_numbers_is_a_divergence_with_its_place() {
    for (bias, on_divergence) in [
        (800.0, OnDivergence::Stop),
        (-800.0, OnDivergence::Stop),
        (800.0, OnDivergence::Recover),
        (-800.0, OnDivergence::Recover),
    ] {
        let data = data(1, &[wave(30)]);
        let mut learner = learner(&topology(1, 0.0), &data, plan(20, on_divergence), |network| {
            network.parameters.block_mut(Block::VarianceBias).fill(bias);
        });
        let (outcome, nll) = run(&mut learner);
        // An overflowing variance makes every sample equally likely and the likelihood small, but finite; a vanishing one
        // makes it minus infinity.
        if bias > 0.0 {
            assert_eq!((outcome, nll.len()), (Outcome::Finished, 21));
            assert!(nll.iter().all(|nll| *nll > 300.0), "{nll:?}");
            continue;
        }
        let Outcome::Diverged(divergence) = outcome else { panic!("{bias}, {on_divergence:?}: {outcome:?}") };
        assert_eq!((divergence.epoch, divergence.sequence, divergence.step), (0, Some(0), Some(0)));
        assert_eq!((divergence.quantity.as_str(), nll.len()), ("variance", 0));
    }
}

#[test]
fn a_variance_that_ran_away_comes_back_where_numbers_allow_it() {
    for bias in [20.0, -20.0] {
        let data = data(1, &[wave(30)]);
        let mut learner = learner(&topology(1, 0.0), &data, plan(3000, OnDivergence::Recover), |network| {
            network.parameters.block_mut(Block::VarianceBias).fill(bias);
        });
        let (outcome, nll) = run(&mut learner);
        assert_eq!(outcome, Outcome::Finished);
        assert!(nll[nll.len() - 1] < 0.5 * nll[0].abs(), "{bias}: {} to {}", nll[0], nll[nll.len() - 1]);
    }
}

#[test]
fn saturated_units_have_no_gradient_but_numbers() {
    let data = data(1, &[wave(30)]);
    for scale in [1e4, 1e100, 1e300] {
        let mut learner = learner(&topology(1, 1e-4), &data, plan(20, OnDivergence::Stop), |network| {
            for block in [Block::ContextFromInput, Block::ContextFromContext, Block::MeanFromContext] {
                network.parameters.block_mut(block).iter_mut().for_each(|w| *w *= scale);
            }
        });
        let (outcome, nll) = run(&mut learner);
        assert_eq!((outcome, nll.len()), (Outcome::Finished, 21), "{scale:e}");
    }
}

#[test]
fn a_channel_that_never_changes_comes_down_to_the_floor() {
    let floor = 1e-4;
    let rows: Vec<f64> = wave(60).into_iter().flat_map(|y| [y, 0.25]).collect();
    let data = data(2, &[rows]);
    let mut learner = learner(&topology(2, floor), &data, plan(3000, OnDivergence::Recover), |_| ());
    let (outcome, nll) = run(&mut learner);
    assert_eq!(outcome, Outcome::Finished);
    // The density of N(y, floor) at its top is the best that this channel can come to.
    let top = 0.5 * (2.0 * std::f64::consts::PI * floor).ln();
    assert!(nll[3000] > top && nll[3000] < 0.0, "{}", nll[3000]);
    let options = GenerationOptions { steps: 40, feedback: Feedback::closed(2, false), seed: 1, contexts: false };
    let start =
        Start { initial_state: learner.initial_states().sequence(0), sensed: &data.sequences()[0].values()[..2] };
    let generated = generate(learner.network(), &[start], &options, &Engine::serial()).unwrap();
    let variances: Vec<f64> = generated[0].variance.iter().skip(1).step_by(2).copied().collect();
    assert!(variances.iter().all(|&v| v >= floor && v < 2.0 * floor), "{variances:?}");
}

/// Without a floor the likelihood grows for ever. Whatever comes, the network that is left holds numbers.
#[test]
fn a_channel_that_never_changes_never_makes_a_network_non_finite() {
    for optimiser in [
        Optimiser::Adam(Adam { rate: 0.1, final_rate: 0.1, ..Adam::default() }),
        Optimiser::Momentum(Momentum { rate: 0.1, ..Momentum::default() }),
    ] {
        for on_divergence in [OnDivergence::Stop, OnDivergence::Recover] {
            let plan = Plan { epochs: 12_000, optimiser: optimiser.clone(), on_divergence, ..Plan::default() };
            let data = data(1, &[vec![0.25; 12]]);
            let mut learner = learner(&topology(1, 0.0), &data, plan, |_| ());
            let (outcome, nll) = run(&mut learner);
            assert!(outcome != Outcome::Stopped);
            let best = nll.iter().copied().fold(f64::INFINITY, f64::min);
            // Adam goes on for ever; momentum at this rate is thrown out of its valley after a few steps.
            let gain = if matches!(optimiser, Optimiser::Adam(_)) { 3.0 } else { 1.0 };
            assert!(best < nll[0] - gain, "{optimiser:?}, {on_divergence:?}: {} to {best}", nll[0]);
            assert!(nll.iter().all(|nll| nll.is_finite()), "{optimiser:?}, {on_divergence:?}");
            assert!(learner.network().parameters.as_slice().iter().all(|value| value.is_finite()));
            if on_divergence == OnDivergence::Recover {
                assert!(nll[nll.len() - 1] < best + 10.0 + 1e-9, "{optimiser:?}: {best}, then {}", nll[nll.len() - 1]);
            }
        }
    }
}

#[test]
fn samples_that_are_all_equal_and_all_zero_train_without_a_variance_too() {
    for value in [0.0, 0.5, -0.8] {
        let topology = Topology::new(2, 1, vec![Group::full("context", 6, 2.0)], Prediction::Mean).unwrap();
        let mut learner =
            learner(&topology, &data(2, &[vec![value; 20], vec![value; 8]]), plan(400, OnDivergence::Recover), |_| ());
        let (outcome, mse) = run(&mut learner);
        assert_eq!(outcome, Outcome::Finished);
        assert!(mse[400] < 1e-3, "{value}: {}", mse[400]);
    }
}

#[test]
fn sequences_that_stand_there_twice_learn_alike_and_are_recognised_alike() {
    let (a, b) = (wave(40), wave(40).iter().map(|y| -y).collect::<Vec<_>>());
    let data = data(1, &[a.clone(), b, a]);
    let topology = topology(1, 0.0);
    let (network, _) = initialize(&topology, 3, 5);
    // From the same place.
    let states = InitialStates::zeros(&topology, 3);
    let mut learner =
        Learner::new(network, states, &data, plan(400, OnDivergence::Recover), &Engine::serial()).unwrap();
    let (outcome, _) = run(&mut learner);
    assert_eq!(outcome, Outcome::Finished);
    let states = learner.initial_states();
    assert_eq!(states.sequence(0), states.sequence(2));
    assert_ne!(states.sequence(0), states.sequence(1));
    let options = RecognitionOptions { starts: 4, epochs: 10, ..RecognitionOptions::default() };
    let found = recognize(learner.network(), states, &data, &options, &Engine::serial()).unwrap();
    assert!(found.iter().all(|one| one.trials.iter().all(|trial| trial.ln_likelihood.is_finite())));
}

#[test]
fn sequences_of_one_step_train_and_shorter_ones_are_refused() {
    let one_step = data(1, &[vec![0.1, 0.2], vec![-0.3, 0.4]]);
    let mut learner = learner(&topology(1, 1e-3), &one_step, plan(200, OnDivergence::Recover), |_| ());
    let (outcome, nll) = run(&mut learner);
    assert!(outcome == Outcome::Finished && nll[200] < nll[0]);
    for values in [vec![], vec![0.5]] {
        let (network, states) = initialize(&topology(1, 0.0), 2, 5);
        let short = data(1, &[vec![0.1, 0.2], values.clone()]);
        let refused =
            Learner::new(network, states, &short, plan(1, OnDivergence::Stop), &Engine::serial()).unwrap_err();
        let expected = format!("sequence 1 has {} samples; a delay of 1 needs at least 2", values.len());
        assert_eq!(refused.to_string(), expected);
    }
}

#[test]
fn thousands_of_channels_train() {
    let channels = 3000;
    let values: Vec<f64> = (0..channels * 6).map(|k| 0.7 * (k as f64 * 0.37).sin()).collect();
    let mut learner =
        learner(&topology(channels, 0.0), &data(channels, &[values]), plan(30, OnDivergence::Recover), |_| ());
    let (outcome, nll) = run(&mut learner);
    assert_eq!(outcome, Outcome::Finished);
    assert!(nll[30] < nll[0] - 0.02, "{} to {}", nll[0], nll[30]);
}

#[test]
fn any_rate_ends_in_a_network_of_finite_values() {
    for rate in [1e-300, 1e-12, 1.0, 1e3, 1e12, 1e150, 1e300] {
        for optimiser in [
            Optimiser::Momentum(Momentum { rate, ..Momentum::default() }),
            Optimiser::Momentum(Momentum { rate, adaptive_rate: Some(AdaptiveRate::default()), ..Momentum::default() }),
            Optimiser::Adam(Adam { rate, ..Adam::default() }),
        ] {
            let with_and_without = [None, Some(Lbfgs { share: 0.5, memory: 5 })];
            for (on_divergence, lbfgs) in [OnDivergence::Stop, OnDivergence::Recover]
                .into_iter()
                .flat_map(|on| with_and_without.clone().map(|l| (on, l)))
            {
                let plan = Plan { epochs: 40, optimiser: optimiser.clone(), on_divergence, lbfgs, ..Plan::default() };
                let mut learner = learner(&topology(1, 0.0), &data(1, &[wave(25)]), plan, |_| ());
                let (outcome, nll) = run(&mut learner);
                let best = nll.iter().copied().fold(f64::INFINITY, f64::min);
                // What is left is worth what was reported of it.
                let kept = worth(&learner);
                let case = format!("{rate:e}, {optimiser:?}, {on_divergence:?}");
                match (&outcome, on_divergence) {
                    (Outcome::Finished, _) => assert_eq!((nll.len(), kept), (41, nll[40]), "{case}"),
                    (Outcome::Diverged(_), OnDivergence::Stop) => assert_eq!(kept, nll[nll.len() - 1], "{case}"),
                    (Outcome::Diverged(_), OnDivergence::Recover) => assert_eq!(kept, best, "{case}"),
                    (Outcome::Stopped, _) => panic!("{case}: nobody stopped it"),
                }
                if on_divergence == OnDivergence::Recover {
                    // As far from the best as the guard allows, and not above where it began.
                    let mut least = f64::INFINITY;
                    for &value in &nll {
                        least = least.min(value);
                        assert!(value <= least + 10.0 + 1e-9, "{case}: {nll:?}");
                    }
                }
            }
        }
    }
}

/// The nll of the network that a learner of one wave of 25 samples was left with.
fn worth(learner: &Learner) -> f64 {
    let (network, states) = (learner.network().clone(), learner.initial_states().clone());
    let plan = Plan { epochs: 0, ..Plan::default() };
    let mut again = Learner::new(network, states, &data(1, &[wave(25)]), plan, &Engine::serial()).unwrap();
    let (outcome, nll) = run(&mut again);
    assert_eq!((&outcome, nll.len()), (&Outcome::Finished, 1));
    nll[0]
}
