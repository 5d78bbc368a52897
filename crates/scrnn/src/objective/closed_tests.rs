//! Missing values, features and closed loops: values against plain loops, gradients against differences.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::engine::InstructionSet;
use crate::features::{Skip, SkipKind, velocity_deviations};
use crate::forward::Plain;
use crate::initialization::initialize;
use crate::likelihood;
use crate::network::Network;
use crate::objective::Release;
use crate::streams::{Purpose, stream};
use crate::topology::{Group, Prediction};

/// Two channels, three sequences of unequal lengths; a share of the values is missing.
fn data(missing: bool) -> Dataset {
    let sequence = |s: usize, len: usize| {
        let value = |k: usize| {
            let (t, i) = ((k / 2) as f64, (k % 2) as f64);
            if missing && (k * 7 + s * 3).is_multiple_of(5) {
                return f64::NAN;
            }
            0.5 * (0.4 * t + i + s as f64).sin() + 0.2 * (1.3 * t + 2.0 * i).cos()
        };
        Sequence::new(format!("s{s}"), 2, (0..2 * len).map(value).collect()).unwrap()
    };
    Dataset::new(Dataset::numbered_channels(2), vec![sequence(0, 14), sequence(1, 11), sequence(2, 17)]).unwrap()
}

/// Each variant of the model, at a delay.
fn topologies(delay: usize) -> Vec<(&'static str, Topology)> {
    let groups = || vec![Group::fast(4, 2.0), Group { drives_output: true, ..Group::slow(3, 5.0) }];
    let of = |prediction| Topology::new(2, delay, groups(), prediction).unwrap();
    let whole = data(false);
    let skip = |kind| Skip::fit(kind, &whole, delay).unwrap();
    let deviations = || velocity_deviations(&whole);
    let plain = || of(Prediction::MeanAndVariance { floor: 0.01 });
    vec![
        ("plain", plain()),
        ("mean alone", of(Prediction::Mean)),
        ("linear", plain().with_linear_mean(true)),
        ("velocity", plain().with_velocity_inputs(deviations()).unwrap()),
        ("residual", plain().with_skip(skip(SkipKind::Residual)).unwrap()),
        (
            "extrapolation",
            of(Prediction::MeanAndVariance { floor: 0.0 })
                .with_linear_mean(true)
                .with_velocity_inputs(deviations())
                .unwrap()
                .with_skip(skip(SkipKind::Extrapolation { damping: 0.7 }))
                .unwrap(),
        ),
        (
            "autoregressive",
            plain()
                .with_linear_mean(true)
                .with_velocity_inputs(deviations())
                .unwrap()
                .with_skip(skip(SkipKind::Autoregressive { lags: 3 }))
                .unwrap(),
        ),
        ("skip of the mean alone", of(Prediction::Mean).with_skip(skip(SkipKind::Residual)).unwrap()),
    ]
}

fn network(topology: &Topology) -> (Network, Vec<f64>) {
    let (mut network, _) = initialize(topology, 3, 5);
    network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 0.9);
    let states = (0..3 * 7).map(|k| if k % 7 < 4 { 0.0 } else { 0.3 * (k as f64).sin() }).collect();
    (network, states)
}

fn evaluate(request: &Request<'_>, network: &Network, runs: &[Run], states: &[f64], engine: &Engine) -> Evaluation {
    let mut objective = engine.objective(request).unwrap();
    objective.set_parameters(&network.parameters);
    let mut evaluation = Evaluation::new(request.topology);
    objective.evaluate(runs, states, Want::Everything, &mut evaluation);
    evaluation
}

fn near(name: &str, found: f64, expected: f64, tolerance: f64) {
    let bound = tolerance * (1.0 + expected.abs());
    assert!((found - expected).abs() < bound, "{name}: {found} instead of {expected}");
}

/// ln L and squared error of a released run, in plain loops.
fn plain_closed(network: &Network, u0: &[f64], samples: &[f64], run: &Run, term: ClosedLoopTerm) -> (f64, f64) {
    let (n, delay) = (2, network.topology.delay());
    let release = run.release.unwrap();
    let spread = |copy: &Plain<'_>, i: usize| copy.v.get(i).map_or(0.0, |v| v.sqrt());
    let mut copies: Vec<Plain<'_>> = (0..term.copies).map(|_| Plain::at(network, u0)).collect();
    let mut random: Vec<_> =
        (0..term.copies).map(|copy| stream(release.seed, Purpose::ClosedLoopNoise, copy as u64)).collect();
    // [copy][step]: mean and spread.
    let mut made: Vec<Vec<Vec<(f64, f64)>>> = vec![Vec::new(); term.copies];
    let (mut ln_likelihood, mut squared_error) = (0.0, 0.0);
    for k in 0..run.steps {
        for (c, copy) in copies.iter_mut().enumerate() {
            let x: Vec<f64> = match k < release.step {
                true => samples[k * n..(k + 1) * n].to_vec(),
                false => (made[c][k - delay].iter())
                    .map(|(mean, spread)| {
                        let e: f64 = StandardNormal.sample(&mut random[c]);
                        mean + spread * e
                    })
                    .collect(),
            };
            copy.advance(&x);
            made[c].push((0..n).map(|i| (copy.y[i], spread(copy, i))).collect());
        }
        let (ks, weight) = if k < release.step { (1, 1.0) } else { (term.copies, term.weight) };
        for (i, target) in samples[(k + delay) * n..][..n].iter().enumerate().filter(|(_, target)| !target.is_nan()) {
            let mean = copies[..ks].iter().map(|copy| copy.y[i]).sum::<f64>() / ks as f64;
            squared_error += (target - mean).powi(2);
            ln_likelihood += weight
                * match network.topology.has_variance() {
                    false => -0.5 * (target - mean).powi(2),
                    true => {
                        let within = copies[..ks].iter().map(|copy| copy.v[i]).sum::<f64>() / ks as f64;
                        let apart = copies[..ks].iter().map(|copy| (copy.y[i] - mean).powi(2)).sum::<f64>();
                        let between = if ks > 1 { apart / (ks - 1) as f64 } else { 0.0 };
                        likelihood::ln_gaussian(*target, mean, within + between)
                    }
                };
        }
    }
    (ln_likelihood, squared_error)
}

/// One run through each sequence; the last two are released where `term` is there.
fn runs(data: &Dataset, delay: usize, term: Option<ClosedLoopTerm>) -> Vec<Run> {
    let mut runs = Run::through_all(data, delay);
    if term.is_some() {
        runs[1] = runs[1].released(Release::new(delay + 1, 7));
        runs[2] = runs[2].released(Release::new(delay, 8));
    }
    runs
}

fn request<'a>(topology: &'a Topology, data: &'a Dataset, closed_loop: Option<ClosedLoopTerm>) -> Request<'a> {
    Request { closed_loop, ..Request::new(topology, data) }
}

#[test]
fn values_are_those_of_plain_loops() {
    let terms = [None, Some(ClosedLoopTerm::new(1, 0.5)), Some(ClosedLoopTerm::new(3, 0.3))];
    for delay in [1, 3] {
        for (name, topology) in topologies(delay) {
            for (missing, term) in [false, true].into_iter().flat_map(|missing| terms.map(|term| (missing, term))) {
                let (data, (network, states)) = (data(missing), network(&topology));
                let runs = runs(&data, delay, term);
                let found = evaluate(&request(&topology, &data, term), &network, &runs, &states, &Engine::serial());
                for (index, run) in runs.iter().enumerate() {
                    let (samples, u0) = (data.sequences()[index].values(), &states[index * 7..(index + 1) * 7]);
                    let expected = match (run.release, term) {
                        (Some(_), Some(term)) => plain_closed(&network, u0, samples, run, term),
                        _ => likelihood::plain(&network, u0, samples, run.steps).unwrap(),
                    };
                    let name = format!("{name}, delay {delay}, missing {missing}, {term:?}, run {index}");
                    near(&name, found.ln_likelihood[index], expected.0, 1e-11);
                    near(&name, found.squared_error[index], expected.1, 1e-11);
                }
            }
        }
    }
}

#[test]
fn gradients_are_those_of_differences() {
    let h = 1e-5;
    for delay in [1, 2] {
        for (name, topology) in topologies(delay) {
            for (missing, term) in [(true, None), (false, None), (true, Some(ClosedLoopTerm::new(3, 0.4)))] {
                let (data, (mut network, mut states)) = (data(missing), network(&topology));
                let (runs, request) = (runs(&data, delay, term), request(&topology, &data, term));
                let mut objective = Engine::serial().objective(&request).unwrap();
                let mut found = Evaluation::new(&topology);
                objective.set_parameters(&network.parameters);
                objective.evaluate(&runs, &states, Want::Everything, &mut found);
                let (gradients, initial) = (found.gradients.clone(), found.initial.clone());
                let mut value = |network: &Network, states: &[f64]| {
                    objective.set_parameters(&network.parameters);
                    objective.evaluate(&runs, states, Want::Score, &mut found);
                    found.ln_likelihood.iter().sum::<f64>()
                };
                for block in Parameter::ALL {
                    for index in block.range(&topology) {
                        let before = network.parameters.as_slice()[index];
                        let mut at = |offset: f64| {
                            network.parameters.as_mut_slice()[index] = before + offset;
                            let value = value(&network, &states);
                            network.parameters.as_mut_slice()[index] = before;
                            value
                        };
                        let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                        let exists = gradients.as_slice()[index] != 0.0;
                        let place = format!("{name}, delay {delay}, missing {missing}, {term:?}, {block:?} {index}");
                        if exists {
                            near(&place, gradients.as_slice()[index], slope, 1e-6);
                        } else {
                            // Only what the topology does not have may have no gradient: slow units see no input.
                            assert_eq!(block, Parameter::ContextFromInput, "{place}: {slope}");
                        }
                    }
                }
                for k in (0..states.len()).filter(|k| k % 7 >= 4) {
                    let before = states[k];
                    let mut at = |offset: f64| {
                        states[k] = before + offset;
                        let value = value(&network, &states);
                        states[k] = before;
                        value
                    };
                    let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                    near(&format!("{name}, delay {delay}, {term:?}, u0 {k}"), initial[k], slope, 1e-6);
                }
            }
        }
    }
}

#[test]
fn a_whole_sequence_gives_the_same_step_by_step() {
    // One value of the third sequence is missing, in its last sample: only there the ways part.
    for (name, topology) in topologies(1).into_iter().filter(|(_, topology)| topology.has_variance()) {
        let (whole, (network, states)) = (data(false), network(&topology));
        let mut values = whole.sequences()[2].values().to_vec();
        let last = values.len() - 1;
        values[last] = f64::NAN;
        let mut sequences = whole.sequences().to_vec();
        sequences[2] = Sequence::new("s2", 2, values).unwrap();
        let gapped = Dataset::new(whole.channels().to_vec(), sequences).unwrap();
        let shorter = |data: &Dataset| Run::new(2, data.sequences()[2].len() - 2);
        let fast =
            evaluate(&Request::new(&topology, &whole), &network, &[shorter(&whole)], &states[14..], &Engine::serial());
        let slow = evaluate(
            &Request::new(&topology, &gapped),
            &network,
            &[shorter(&gapped)],
            &states[14..],
            &Engine::serial(),
        );
        near(name, slow.ln_likelihood[0], fast.ln_likelihood[0], 1e-12);
        for (slow, fast) in slow.gradients.as_slice().iter().zip(fast.gradients.as_slice()) {
            near(name, *slow, *fast, 1e-11);
        }
        for (slow, fast) in slow.initial.iter().zip(&fast.initial) {
            near(name, *slow, *fast, 1e-11);
        }
    }
}

#[test]
fn neither_threads_nor_instruction_sets_change_a_bit() {
    let topology = topologies(2).swap_remove(6).1;
    let (network, _) = network(&topology);
    let many: Vec<Sequence> = (0..40).map(|k| data(k % 3 == 0).sequences()[k % 3].clone()).collect();
    let many = Dataset::new(Dataset::numbered_channels(2), many).unwrap();
    let runs: Vec<Run> = (Run::through_all(&many, 2).into_iter().enumerate())
        .map(|(k, run)| if k % 2 == 0 { run.released(Release::new(2 + k % 5, k as u64)) } else { run })
        .collect();
    let states: Vec<f64> = (0..40 * 7).map(|k| 0.2 * (k as f64).cos()).collect();
    let request = request(&topology, &many, Some(ClosedLoopTerm::new(4, 0.3)));
    let first = evaluate(&request, &network, &runs, &states, &Engine::serial());
    assert!(first.ln_likelihood.iter().all(|value| value.is_finite()));
    for set in InstructionSet::available() {
        for threads in [1, 2, 3] {
            let engine = Engine::new(threads, set).unwrap();
            assert_eq!(evaluate(&request, &network, &runs, &states, &engine), first, "{set}, {threads} threads");
        }
    }
}

/// Records are not cleared between evaluations: what is read was written before in the same one.
#[test]
fn what_earlier_evaluations_left_behind_changes_nothing() {
    for delay in [1, 2] {
        for (name, topology) in topologies(delay) {
            let (data, (network, states)) = (data(true), network(&topology));
            let request = request(&topology, &data, Some(ClosedLoopTerm::new(3, 0.4)));
            let own = runs(&data, delay, request.closed_loop);
            let fresh = evaluate(&request, &network, &own, &states, &Engine::serial());
            let mut objective = Engine::serial().objective(&request).unwrap();
            let mut found = Evaluation::new(&topology);
            // All states and predictions non-finite, and columns that begin and end elsewhere.
            let mut broken = network.clone();
            broken.parameters.as_mut_slice().fill(f64::NAN);
            objective.set_parameters(&broken.parameters);
            let elsewhere: Vec<Run> = own.iter().map(|run| run.released(Release::new(delay + 2, 3))).collect();
            objective.evaluate(&elsewhere, &states, Want::Everything, &mut found);
            assert!(found.ln_likelihood.iter().all(|value| value.is_nan()), "{name}");
            objective.set_parameters(&network.parameters);
            objective.evaluate(&own, &states, Want::Everything, &mut found);
            assert_eq!(found, fresh, "{name}, delay {delay}");
        }
    }
}

#[test]
fn senseless_closed_loops_are_refused() {
    let (topology, data) = (topologies(1).swap_remove(0).1, data(false));
    for term in [ClosedLoopTerm::new(0, 1.0), ClosedLoopTerm::new(3, -1.0), ClosedLoopTerm::new(3, f64::NAN)] {
        let refused = Engine::serial().objective(&request(&topology, &data, Some(term))).unwrap_err();
        assert!(refused.to_string().contains("of the closed loop is"), "{refused}");
    }
}
