//! The default: L-BFGS under a guard, beside the other rules, on networks that have learned.

use super::*;

#[test]
fn lbfgs_never_leads_downhill_whatever_is_missing_masked_or_skipped() {
    for delay in [1, 3] {
        for (kind, network) in with_features(delay, true).iter().enumerate() {
            let options = ErrorRegressionOptions {
                window: 12,
                sensed_in_window: vec![0.0, 0.3, 0.0],
                mask: vec![1.0, 0.5, 0.0],
                guard: Some(false),
                ..ErrorRegressionOptions::new(3)
            };
            let mut regression = ErrorRegression::new(network, &u0(network), options, &Engine::serial()).unwrap();
            let mut gained = 0;
            for t in 0..50 {
                let done = regression.observe(&gapped(t), &mut || true).unwrap();
                let [before, after] = done.ln_likelihood;
                assert!(after >= before && !done.diverged, "delay {delay}, kind {kind}, sample {t}: {done:?}");
                gained += usize::from(after > before);
                assert!(done.passes == 0 || now(&mut regression) == after, "delay {delay}, kind {kind}, sample {t}");
            }
            assert!(gained > 20, "delay {delay}, kind {kind}: {gained}");
        }
    }
}

/// Ellipses, run through slowly and quickly by turns, from anywhere, with a little noise.
fn waves(count: usize, steps: usize, seed: u64) -> crate::dataset::Dataset {
    use crate::dataset::{Dataset, Sequence};
    use rand::RngExt as _;
    let mut random = crate::streams::stream(seed, crate::streams::Purpose::TaskData, 0);
    let mut sequences = Vec::new();
    for s in 0..count {
        let (frequency, phase) = ([0.2, 0.35][s % 2], random.random_range(0.0..6.0));
        let mut samples = Vec::new();
        for t in 0..steps {
            let angle: f64 = phase + frequency * t as f64;
            samples.push(0.6 * angle.sin() + random.random_range(-0.03..0.03));
            samples.push(0.5 * angle.cos() + random.random_range(-0.03..0.03));
        }
        sequences.push(Sequence::new(format!("{s}"), 2, samples).unwrap());
    }
    Dataset::new(Dataset::numbered_channels(2), sequences).unwrap()
}

/// A network that has learned such waves, and the mean of its initial states.
fn trained(groups: Vec<Group>, epochs: u64) -> (Network, Vec<f64>) {
    use crate::learning::{Adam, Learner, Optimiser, Plan};
    let topology = Topology::new(2, 1, groups, Prediction::MeanAndVariance { floor: 1e-4 }).unwrap();
    let (network, states) = initialize(&topology, 8, 3);
    let plan = Plan::with(|it| {
        it.epochs = epochs;
        it.optimiser = Optimiser::Adam(Adam::with(|it| it.rate = 1e-2));
    });
    let data = waves(8, 120, 1);
    let mut learner = Learner::new(network, states, &data, plan, &Engine::serial()).unwrap();
    let _ = learner.run(&mut |_: &crate::learning::EpochReport, _: &Learner| std::ops::ControlFlow::Continue(()));
    (learner.network().clone(), learner.initial_states().mean().to_vec())
}

fn one_group() -> Vec<Group> {
    vec![Group::full("context", 20, 2.0)]
}

/// A slow group alone has an initial state that is learned, and so is moved.
fn slow_alone_moves() -> Vec<Group> {
    vec![Group::fast(16, 2.0), Group::slow(6, 20.0)]
}

/// What following waves that were not learned came to.
#[derive(Debug, Default)]
struct Came {
    /// Nats a step of the full windows.
    ln_likelihood: f64,
    /// Squared errors of the next sample, and of the one ten later.
    errors: [f64; 2],
    passes: f64,
    given_up: usize,
}

fn came((network, state): &(Network, Vec<f64>), options: &ErrorRegressionOptions) -> Came {
    let options = ErrorRegressionOptions { ahead: 9, ..options.clone() };
    let (mut came, mut counts) = (Came::default(), [0.0; 3]);
    for sequence in waves(6, 150, 77).sequences() {
        let mut regression = ErrorRegression::new(network, state, options.clone(), &Engine::serial()).unwrap();
        for t in 0..sequence.len() {
            let done = regression.observe(sequence.sample(t), &mut || true).unwrap();
            if done.steps < options.window {
                continue;
            }
            came.ln_likelihood += done.ln_likelihood[1] / done.steps as f64;
            came.passes += done.passes as f64;
            came.given_up += usize::from(done.given_up);
            counts[2] += 1.0;
            for (k, steps) in [0, 9].into_iter().enumerate().filter(|(_, steps)| t + 1 + steps < sequence.len()) {
                let forecast = regression.forecast_mean(steps).unwrap();
                let pairs = forecast.iter().zip(sequence.sample(t + 1 + steps));
                came.errors[k] += pairs.map(|(y, x)| (y - x).powi(2)).sum::<f64>();
                counts[k] += 1.0;
            }
        }
    }
    came.ln_likelihood /= counts[2];
    came.passes /= counts[2];
    came.errors = [0, 1].map(|k| came.errors[k] / counts[k]);
    came
}

#[test]
fn a_dozen_steps_of_lbfgs_come_to_what_a_hundred_of_adam_do() {
    // What holds L-BFGS back costs a little where slow units alone say what comes.
    for (groups, epochs, least) in
        [(one_group(), 1000, 0.0), (one_group(), 3000, -1e-3), (slow_alone_moves(), 3000, -3e-3)]
    {
        let trained = trained(groups, epochs);
        let with = |ascent, iterations| {
            let (window, guard) = (30, Some(false));
            came(
                &trained,
                &ErrorRegressionOptions { ascent, iterations, window, guard, ..ErrorRegressionOptions::new(2) },
            )
        };
        let adam = with(Ascent::Adam { rate: 0.01 }, 100);
        let own = with(ErrorRegressionOptions::new(2).ascent, 12);
        assert!(own.ln_likelihood > adam.ln_likelihood + least, "{epochs} epochs: {own:?}, {adam:?}");
        assert!(own.passes < 13.0 && adam.passes == 100.0, "{own:?}");
    }
}

#[test]
fn pairs_that_live_on_are_worth_having() {
    let (network, state) = trained(one_group(), 3000);
    let run = |forgets: bool| {
        let options = ErrorRegressionOptions { window: 30, guard: Some(false), ..ErrorRegressionOptions::new(2) };
        let mut regression = ErrorRegression::new(&network, &state, options, &Engine::serial()).unwrap();
        let mut sum = 0.0;
        for sample in waves(1, 150, 77).sequences()[0].values().chunks(2) {
            if forgets {
                regression.memory.as_mut().unwrap().forget();
            }
            let done = regression.observe(sample, &mut || true).unwrap();
            sum += if done.steps == 30 { done.ln_likelihood[1] } else { 0.0 };
        }
        sum
    };
    let (lives, forgets) = (run(false), run(true));
    assert!(lives > forgets + 10.0, "{lives} and {forgets}");
}

#[test]
fn the_default_does_no_harm_and_helps_where_the_closed_loop_follows() {
    let quiet = ErrorRegressionOptions { iterations: 0, ..ErrorRegressionOptions::new(2) };
    for (groups, epochs) in
        [(one_group(), 1000), (slow_alone_moves(), 1000), (one_group(), 3000), (slow_alone_moves(), 3000)]
    {
        let (alone, trained) = (groups.len() == 1, trained(groups, epochs));
        let (on, off) = (came(&trained, &ErrorRegressionOptions::new(2)), came(&trained, &quiet));
        let all = format!("one group: {alone}, {epochs} epochs: on {on:?}, off {off:?}");
        for k in 0..2 {
            assert!(on.errors[k] < 1.02 * off.errors[k], "{all}");
        }
        if epochs == 3000 {
            assert!(on.errors[1] < 0.5 * off.errors[1], "{all}");
        } else if alone {
            // What this is about: the default before, and that it is the guard that helps.
            assert!(on.given_up > 100, "{all}");
            let adam = came(&trained, &ErrorRegressionOptions::adam(2));
            assert!(adam.errors[0] > 1.2 * off.errors[0], "{all}, Adam {adam:?}");
        }
    }
}

#[test]
fn where_regression_is_given_up_the_network_is_as_it_would_be_without() {
    let network = network(2, true, fast_and_slow());
    // Steps so large that many windows get worse.
    let options = ErrorRegressionOptions {
        ascent: Ascent::Adam { rate: 30.0 },
        guard: Some(true),
        window: 8,
        ahead: 4,
        ..ErrorRegressionOptions::new(3)
    };
    let new = |iterations| {
        let options = ErrorRegressionOptions { iterations, ..options.clone() };
        ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap()
    };
    let (mut guarded, mut without) = (new(10), new(0));
    let mut counts = [0; 2];
    for t in 0..60 {
        let done = guarded.observe(&gapped(t), &mut || true).unwrap();
        without.observe(&gapped(t), &mut || true).unwrap();
        let told = |it: &ErrorRegression| {
            let ahead = (0..=4).flat_map(|k| it.forecast_mean(k).unwrap().to_vec());
            let window =
                (0..=it.window()).flat_map(|k| [it.smoothed_mean(k).unwrap(), it.context(k).unwrap()].concat());
            ahead.chain(window).chain(it.variance().to_vec()).chain(it.tail().to_vec()).collect::<Vec<f64>>()
        };
        if done.passes > 0 {
            assert_eq!(told(&guarded) == told(&without), done.given_up, "sample {t}");
            counts[usize::from(done.given_up)] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 2), "{counts:?}");
}

#[test]
fn the_default_gives_the_same_bits_on_every_instruction_set() {
    let network = network(2, true, fast_and_slow());
    let run = |set| {
        let engine = Engine::new(1, set).unwrap();
        let options = ErrorRegressionOptions { window: 12, ..ErrorRegressionOptions::new(3) };
        let mut regression = ErrorRegression::new(&network, &u0(&network), options, &engine).unwrap();
        let mut all = Vec::new();
        for t in 0..60 {
            let done = regression.observe(&gapped(t), &mut || true).unwrap();
            all.extend(regression.mean().iter().chain(regression.tail()).map(|x| x.to_bits()));
            all.extend([done.iterations as u64, done.kept as u64, done.ln_likelihood[1].to_bits()]);
        }
        all
    };
    let sets = InstructionSet::available();
    let first = run(InstructionSet::Portable);
    for set in sets {
        assert_eq!(run(set), first, "{set}");
    }
}
