//! Recognition as a whole: it ranks, ascends, weighs the prior, polishes, and copies no sample for a start.

use super::*;
use crate::dataset::Sequence;
use crate::engine::Engine;
use crate::generation::{Feedback, GenerationOptions, Start, generate};
use crate::initialization::initialize;
use crate::topology::{Group, Prediction, Topology};

/// A network whose initial state shows in its output for a while, and sequences that it made itself.
fn setting() -> (Network, InitialStates, Dataset) {
    let groups = vec![Group::full("context", 12, 8.0)];
    let topology = Topology::new(2, 1, groups, Prediction::Mean).unwrap();
    let (mut network, mut states) = initialize(&topology, 3, 2);
    network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 2.0);
    for (k, u) in states.values_mut().iter_mut().enumerate() {
        *u = (1.7 * k as f64).sin();
    }
    let feedback = Feedback::closed(2, false);
    let options = GenerationOptions { steps: 40, feedback, seed: 1, contexts: false };
    let start = |s: usize| Start { initial_state: states.sequence(s), sensed: &[0.2, -0.1] };
    let made = generate(&network, &[start(0), start(1), start(2)], &options, &Engine::serial()).unwrap();
    let sequence = |one: &crate::generation::Generated| {
        Sequence::new("", 2, [&[0.2, -0.1], one.mean.as_slice()].concat()).unwrap()
    };
    let data = Dataset::new(Dataset::numbered_channels(2), made.iter().map(sequence).collect()).unwrap();
    (network, states, data)
}

/// A network with variance units that a part of its units forget, and sequences of several lengths that no initial state explains
/// exactly.
fn noisy_setting() -> (Network, InitialStates, Dataset) {
    let groups = vec![Group::fast(4, 2.0), Group::full("slow", 8, 6.0)];
    let topology = Topology::new(2, 1, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
    let (mut network, mut states) = initialize(&topology, 3, 2);
    network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 2.0);
    let learns: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
    for (k, u) in states.values_mut().iter_mut().enumerate().filter(|(k, _)| learns[k % 12]) {
        *u = 0.7 * (1.7 * k as f64).sin();
    }
    let wave = |s: usize| (0..2 * (30 + 7 * s)).map(move |k| 0.6 * (0.23 * k as f64 + s as f64).sin());
    let sequences = (0..4).map(|s| Sequence::new("", 2, wave(s).collect()).unwrap()).collect();
    (network, states, Dataset::new(Dataset::numbered_channels(2), sequences).unwrap())
}

fn options() -> RecognitionOptions {
    RecognitionOptions { starts: 4, epochs: 150, initial_state_variance: 1e8, ..RecognitionOptions::default() }
}

#[test]
fn the_ranking_knows_which_sequence_it_is() {
    let (network, states, data) = setting();
    let results = recognize(&network, &states, &data, &options(), &Engine::serial()).unwrap();
    for (s, result) in results.iter().enumerate() {
        assert_eq!(result.ranking[0].sequence, s);
        assert!(result.ranking[0].error < 1e-20 && result.ranking[1].error > 1e-6);
        assert!(result.trials.is_sorted_by(|a, b| a.ln_joint() >= b.ln_joint()));
    }
}

#[test]
fn ascent_from_anywhere_explains_a_sequence_better() {
    let (network, states, data) = setting();
    let warm_starts = vec![WarmStart::Zero, WarmStart::Random];
    let ascended = RecognitionOptions { warm_starts: warm_starts.clone(), epochs: 400, polish: 0, ..options() };
    let untouched = RecognitionOptions { warm_starts, epochs: 0, polish: 0, ..options() };
    let run = |options| recognize(&network, &states, &data, options, &Engine::serial()).unwrap();
    for (after, before) in run(&ascended).iter().zip(run(&untouched)) {
        assert_eq!(after.trials.len(), 4);
        assert!(after.trials[0].ln_likelihood > before.trials[0].ln_likelihood);
        let (after, before) = (after.trials[0].error, before.trials[0].error);
        assert!(after < 0.1 * before, "{before} to {after}");
    }
}

#[test]
fn starts_are_taken_in_turn_and_only_as_often_as_they_differ() {
    let ranked = |sequence| Ranked { sequence, ln_likelihood: 0.0, error: 0.0 };
    let of = |warm_starts: &[WarmStart]| {
        let options = RecognitionOptions { starts: 6, warm_starts: warm_starts.to_vec(), ..options() };
        starts(&options, &[ranked(2), ranked(0)]).iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = of(&[WarmStart::Zero, WarmStart::Learned, WarmStart::Random]);
    assert_eq!(all, ["zero", "learned 3", "random", "learned 1", "random", "random"]);
    assert_eq!(of(&[WarmStart::Mean, WarmStart::Learned]), ["mean", "learned 3", "learned 1"]);
}

#[test]
fn only_observed_samples_count() {
    let (network, states, data) = setting();
    let cut = data.map(|_, x| x);
    let changed = {
        let mut values = data.sequences()[0].values().to_vec();
        values[2 * 20..].fill(0.9);
        Dataset::new(data.channels().to_vec(), vec![Sequence::new("", 2, values).unwrap()]).unwrap()
    };
    let observed = RecognitionOptions { observed: Some(20), ..options() };
    let run = |data: &Dataset, options| recognize(&network, &states, data, options, &Engine::serial()).unwrap();
    assert_eq!(run(&cut, &observed)[0], run(&changed, &observed)[0]);
    assert_ne!(run(&cut, &options())[0], run(&changed, &options())[0]);
}

#[test]
fn random_starts_lie_as_far_apart_as_asked() {
    let (network, states, data) = setting();
    let distance = |random_spread: f64| -> f64 {
        let warm_starts = vec![WarmStart::Random];
        let drawn = RecognitionOptions { starts: 40, epochs: 0, polish: 0, random_spread, warm_starts, ..options() };
        let results = recognize(&network, &states, &data, &drawn, &Engine::serial()).unwrap();
        let average = |i: usize| (0..3).map(|s| states.sequence(s)[i]).sum::<f64>() / 3.0;
        let off = |(i, u): (usize, &f64)| (u - average(i)).powi(2);
        let trials = results.iter().flat_map(|result| &result.trials);
        trials.map(|trial| trial.initial_state.iter().enumerate().map(off).sum::<f64>()).sum::<f64>().sqrt()
    };
    // The same draws, each at a quarter of its distance.
    assert!((distance(0.25) / distance(1.0) - 0.25).abs() < 1e-12);
}

#[test]
fn senseless_requests_are_refused() {
    let (network, states, data) = setting();
    let refuse = |options: RecognitionOptions| {
        recognize(&network, &states, &data, &options, &Engine::serial()).unwrap_err().to_string()
    };
    assert!(refuse(RecognitionOptions { observed: Some(1), ..options() }).contains("more samples than the delay"));
    assert!(refuse(RecognitionOptions { starts: 0, ..options() }).contains("starts is 0"));
    assert!(refuse(RecognitionOptions { random_spread: 0.0, ..options() }).contains("random_spread is 0"));
    assert!(refuse(RecognitionOptions { beta2: 1.0, ..options() }).contains("beta2 is 1"));
    assert!(refuse(RecognitionOptions { tolerance: -1.0, ..options() }).contains("tolerance is -1"));
    let other = initialize(&Topology::s_ctrnn(2, 5, 2.0).unwrap(), 1, 1).1;
    let told = recognize(&network, &other, &data, &options(), &Engine::serial()).unwrap_err().to_string();
    assert!(told.contains("the mean of the learned initial states holds 5 values; needed: 12"), "{told}");
    let none = InitialStates::zeros(&network.topology, 0);
    let learned = RecognitionOptions { warm_starts: vec![WarmStart::Learned], ..options() };
    let told = recognize(&network, &none, &data, &learned, &Engine::serial()).unwrap_err().to_string();
    assert!(told.contains("learned states, of which there are none"), "{told}");
}

/// ln L_all of `state` on sequence `s`, found by the ranking's way.
fn ln_joint(network: &Network, (data, s): (&Dataset, usize), state: &[f64], mean: &[f64], variance: f64) -> f64 {
    let mut states = InitialStates::zeros(&network.topology, 1);
    states.values_mut().copy_from_slice(state);
    states.mean_mut().copy_from_slice(mean);
    let one = Dataset::new(data.channels().to_vec(), vec![data.sequences()[s].clone()]).unwrap();
    let ranked =
        recognize(network, &states, &one, &RecognitionOptions { epochs: 0, polish: 0, ..options() }, &Engine::serial());
    ranked.unwrap()[0].ranking[0].ln_likelihood + states.ln_prior(&network.topology, variance)
}

#[test]
fn under_a_narrow_prior_a_far_start_does_not_win_though_it_is_likelier() {
    let (network, states, data) = setting();
    let options = RecognitionOptions { initial_state_variance: 1e-5, ..options() };
    for (s, result) in recognize(&network, &states, &data, &options, &Engine::serial()).unwrap().iter().enumerate() {
        assert!(result.trials.is_sorted_by(|a, b| a.ln_joint() >= b.ln_joint()));
        let best = &result.trials[0];
        let far = result.trials.iter().find(|trial| trial.start == TrialStart::Learned(s)).unwrap();
        // The state that made the sequence predicts it best, hundreds of the prior's deviations away from its mean.
        assert!(far.ln_likelihood > best.ln_likelihood && far.ln_prior < best.ln_prior - 1e4, "{far:?}");
        assert_eq!(best.start, TrialStart::Mean);
        // Both parts are those of the state that is reported.
        let own = ln_joint(&network, (&data, s), &best.initial_state, states.mean(), 1e-5);
        assert!((best.ln_joint() - own).abs() < 1e-9, "{} and {own}", best.ln_joint());
        assert!(own > ln_joint(&network, (&data, s), states.mean(), states.mean(), 1e-5));
    }
}

#[test]
fn the_best_start_is_polished_to_the_top_of_its_hill() {
    let (network, states, data) = noisy_setting();
    let mut gained = 0.0_f64;
    for variance in [1e-3, 1.0, 100.0] {
        let run = |polish, tolerance| {
            let options = RecognitionOptions { initial_state_variance: variance, polish, tolerance, ..options() };
            recognize(&network, &states, &data, &options, &Engine::serial()).unwrap()
        };
        let tolerance = RecognitionOptions::default().tolerance;
        let (rough, polished, exact) = (run(0, tolerance), run(500, tolerance), run(5000, 0.0));
        for (s, result) in polished.iter().enumerate() {
            let terms = ((data.sequences()[s].len() - 1) * 2) as f64;
            let (best, before) = (&result.trials[0], &rough[s].trials[0]);
            assert!(result.polish.converged && result.polish.updates > 0, "{:?}", result.polish);
            assert_eq!(rough[s].polish, Polish::default());
            let gain = (best.ln_joint() - before.ln_joint()) / terms;
            assert!((gain - result.polish.gain).abs() < 1e-12 && gain >= 0.0, "{gain} {:?}", result.polish);
            gained = gained.max(gain);
            // Nothing to speak of is left, neither for more updates nor nearby.
            let left = (exact[s].trials[0].ln_joint() - best.ln_joint()) / terms;
            assert!(left.abs() <= 10.0 * tolerance, "{variance:e}, {s}: {left:e} left, {:?}", result.polish);
            for k in 0..40 {
                let mut near = best.initial_state.clone();
                for (i, u) in near.iter_mut().enumerate().skip(4) {
                    *u += 1e-4 * variance.sqrt().min(1.0) * (1.7 * (i + 13 * k) as f64).sin();
                }
                let there = ln_joint(&network, (&data, s), &near, states.mean(), variance);
                assert!(there < best.ln_joint() + tolerance * terms, "{variance:e}: {}", there - best.ln_joint());
            }
            // The others are as they were.
            assert_eq!(result.trials[1..], rough[s].trials[1..]);
        }
    }
    // Adam alone left more than that.
    assert!(gained > 1e-8, "{gained:e}");
}

#[test]
fn a_sequence_is_recognised_alike_alone_and_in_company_on_any_number_of_threads() {
    let (network, states, data) = noisy_setting();
    let options = RecognitionOptions { starts: 5, warm_starts: vec![WarmStart::Mean, WarmStart::Learned], ..options() };
    let run = |data: &Dataset, threads| {
        let engine = Engine::new(threads, crate::engine::InstructionSet::best()).unwrap();
        recognize(&network, &states, data, &options, &engine).unwrap()
    };
    let together = run(&data, 1);
    assert!(run(&data, 2) == together && run(&data, 5) == together);
    for (s, result) in together.iter().enumerate() {
        let alone = Dataset::new(data.channels().to_vec(), vec![data.sequences()[s].clone()]).unwrap();
        assert!(run(&alone, 1)[0] == *result, "sequence {s}");
    }
}

#[test]
fn memory_grows_with_the_new_sequences_and_with_the_learned_ones_but_not_with_both() {
    const STEPS: usize = 100;
    let topology = Topology::s_ctrnn(2, 3, 2.0).unwrap();
    let wave = |s: usize| Sequence::new("", 2, (0..2 * STEPS).map(|k| (0.1 * (k + s) as f64).sin()).collect()).unwrap();
    let peak = |new: usize, learned: usize, starts: usize| {
        let (network, states) = initialize(&topology, learned, 1);
        let data = Dataset::new(Dataset::numbered_channels(2), (0..new).map(wave).collect()).unwrap();
        let options = RecognitionOptions { starts, epochs: 0, polish: 1, ..options() };
        let mut found = Vec::new();
        let counted = allocation_counter::measure(|| {
            found = recognize(&network, &states, &data, &options, &Engine::serial()).unwrap();
        });
        assert_eq!((found.len(), found[0].ranking.len()), (new, learned.min(100)));
        counted.bytes_max as usize
    };
    // What a result takes, for every sequence: its trials and its ranking. The samples of a start alone are 1600 bytes.
    let result = |learned: usize, starts: usize| 1024 + 200 * starts + 24 * learned.min(100) * 2;
    for (new, learned, starts) in [(10_000, 20, 1), (20, 10_000, 1), (2000, 20, 60)] {
        let (found, needed) = (peak(new, learned, starts), 48 << 20);
        let needed = needed + new * result(learned, starts) + 24 * learned;
        assert!(found < needed, "{new} new, {learned} learned, {starts} starts: {found} bytes; expected {needed}");
    }
}

#[test]
fn a_ranking_holds_as_many_as_asked_for_and_no_state_beyond_the_numbers_leads_it() {
    let (network, mut states, data) = setting();
    states.sequence_mut(1).fill(f64::INFINITY);
    let run = |ranked| {
        let options = RecognitionOptions { ranked, starts: 3, epochs: 2, ..options() };
        recognize(&network, &states, &data, &options, &Engine::serial()).unwrap()
    };
    let (all, two) = (run(100), run(2));
    for s in [0, 2] {
        assert_eq!((all[s].ranking.len(), all[s].ranking[0].sequence), (3, s));
        assert_eq!((all[s].ranking[2].sequence, all[s].ranking[2].ln_likelihood), (1, f64::NEG_INFINITY));
        assert_eq!(two[s].ranking, all[s].ranking[..2]);
        assert_eq!(two[s].trials, all[s].trials);
    }
}
