//! Every block of the gradient against central differences of the plain reference.

use super::*;
use crate::batch::Block;
use crate::initial_states::InitialStates;
use crate::initialization::initialize;
use crate::likelihood;
use crate::network::Network;
use crate::packed::Packed;
use crate::topology::{Group, Prediction, Topology};
use crate::trajectory::Cut;

const FLOORLESS: Prediction = Prediction::MeanAndVariance { floor: 0.0 };

/// One network and one set of sequences.
#[derive(Clone)]
struct Case {
    channels: usize,
    delay: usize,
    /// Units and time constant of each group; a second group is slow.
    groups: &'static [(usize, f64)],
    prediction: Prediction,
    /// Steps of each sequence.
    lengths: &'static [usize],
    /// Variance of the initial states' prior.
    prior: f64,
    recompute: bool,
    precision: Precision,
}

const SMALL: Case = Case {
    channels: 2,
    delay: 1,
    groups: &[(5, 2.0)],
    prediction: FLOORLESS,
    lengths: &[9, 9, 9],
    prior: 1.0,
    recompute: false,
    precision: Precision::F64,
};

/// Everything that a gradient is taken of.
#[derive(Clone)]
struct Point {
    network: Network,
    states: InitialStates,
}

impl Case {
    fn point(&self) -> Point {
        let groups = match *self.groups {
            [(units, tau)] => vec![Group::full("context", units, tau)],
            [(fast, tau_fast), (slow, tau_slow)] => vec![Group::fast(fast, tau_fast), Group::slow(slow, tau_slow)],
            _ => panic!("one or two groups"),
        };
        let topology = Topology::new(self.channels, self.delay, groups, self.prediction).unwrap();
        let (mut network, mut states) = initialize(&topology, self.lengths.len(), 11);
        // Larger weights than at the start of learning, so that every path matters.
        network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 1.7);
        let spread = self.prior.sqrt().min(0.5);
        for s in 0..self.lengths.len() {
            let mean = states.mean().to_vec();
            let learns: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
            for (i, u0) in states.sequence_mut(s).iter_mut().enumerate() {
                *u0 = if learns[i] { mean[i] + spread * ((s * 7 + i * 3) as f64).sin() } else { 0.0 };
            }
        }
        Point { network, states }
    }

    /// The objective's data, which are the samples, and a run through each sequence.
    fn data(&self) -> (Dataset, Vec<Run>) {
        let sequences = self.samples().into_iter().map(|x| Sequence::new("", self.channels, x).unwrap());
        let data = Dataset::new(Dataset::numbered_channels(self.channels), sequences.collect()).unwrap();
        let runs = Run::through_all(&data, self.delay);
        (data, runs)
    }

    fn samples(&self) -> Vec<Vec<f64>> {
        let wave = |s: usize, k: usize| 0.7 * ((k as f64) * (0.3 + 0.1 * s as f64) + s as f64 + 0.5).sin();
        let of = |(s, &steps): (usize, &usize)| (0..(steps + self.delay) * self.channels).map(|k| wave(s, k)).collect();
        self.lengths.iter().enumerate().map(of).collect()
    }

    /// ln L_out and ln L_all by the plain reference.
    fn ln_likelihood(&self, point: &Point, samples: &[Vec<f64>]) -> (f64, f64) {
        let runs = self.lengths.iter().zip(samples).enumerate();
        let out: f64 = runs
            .map(|(s, (&steps, x))| likelihood::plain(&point.network, point.states.sequence(s), x, steps).unwrap().0)
            .sum();
        (out, out + point.states.ln_prior(&point.network.topology, self.prior))
    }
}

fn close(analytic: f64, numeric: f64, scale: f64, what: &str) {
    let tolerance = 1e-6 * analytic.abs().max(numeric.abs()).max(1e-2 * scale);
    assert!((analytic - numeric).abs() <= tolerance, "{what}: analytic {analytic:e}, by differences {numeric:e}");
}

/// Fourth-order central difference.
fn difference(mut f: impl FnMut(f64) -> f64, h: f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

/// What an objective finds that was in use before.
fn evaluation(case: &Case, engine: &Engine) -> Evaluation {
    let (point, (data, runs)) = (case.point(), case.data());
    let (recompute, precision) = (case.recompute, case.precision);
    let request = Request { recompute, precision, ..Request::new(&point.network.topology, &data) };
    let mut objective = engine.objective(&request).unwrap();
    let mut evaluation = Evaluation::new(&point.network.topology);
    objective.set_parameters(&point.network.parameters);
    for _ in 0..2 {
        objective.evaluate(&runs, point.states.values(), Want::Everything, &mut evaluation);
    }
    evaluation
}

/// float32 comes to the same, but for rounding: to 1e-4 of the largest gradient of a block.
fn check_single(case: &Case, double: &Evaluation) {
    let single = evaluation(&Case { precision: Precision::F32, ..case.clone() }, &Engine::serial());
    assert!(single.gradients != double.gradients, "float32 has bits of its own");
    let near = |single: &[f64], double: &[f64], what: &str| {
        let scale = double.iter().fold(1e-3, |most: f64, value| most.max(value.abs()));
        for (i, (single, double)) in single.iter().zip(double).enumerate() {
            assert!((single - double).abs() <= 1e-4 * scale, "{what}[{i}]: {single} in float32, {double} in float64");
        }
    };
    for block in Parameter::ALL {
        near(single.gradients.block(block), double.gradients.block(block), block.name());
    }
    near(&single.initial, &double.initial, "initial state");
    near(&single.ln_likelihood, &double.ln_likelihood, "ln L");
    near(&single.squared_error, &double.squared_error, "squared error");
}

fn check(case: &Case) {
    let (point, samples) = (case.point(), case.samples());
    let topology = &point.network.topology;
    let objective = evaluation(case, &Engine::serial());
    check_single(case, &objective);

    for (s, (x, &steps)) in samples.iter().zip(case.lengths).enumerate() {
        let (plain, squared) = likelihood::plain(&point.network, point.states.sequence(s), x, steps).unwrap();
        assert!((plain - objective.ln_likelihood[s]).abs() <= 1e-12 * (1.0 + plain.abs()), "ln L of sequence {s}");
        assert!((squared - objective.squared_error[s]).abs() <= 1e-12 * (1.0 + squared), "error of sequence {s}");
    }

    for block in Parameter::ALL {
        let analytic = objective.gradients.block(block);
        let scale = analytic.iter().fold(0.0, |a: f64, g| a.max(g.abs()));
        assert!(scale > 0.0 || analytic.is_empty(), "{}: no gradient at all", block.name());
        for (i, &analytic) in analytic.iter().enumerate() {
            if point.network.parameters.block(block)[i] == 0.0 {
                assert_eq!(analytic, 0.0, "{}[{i}] does not exist", block.name());
                continue;
            }
            let mut moved = point.clone();
            let numeric = difference(
                |h| {
                    moved.network.parameters.block_mut(block)[i] = point.network.parameters.block(block)[i] + h;
                    case.ln_likelihood(&moved, &samples).0
                },
                2e-4,
            );
            close(analytic, numeric, scale, &format!("{}[{i}]", block.name()));
        }
    }

    let mut gradient = InitialStates::zeros(topology, case.lengths.len());
    gradient.values_mut().copy_from_slice(&objective.initial);
    point.states.add_prior_gradient(topology, case.prior, &mut gradient);
    let n_c = topology.context_units();
    let learns: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
    let h = 2e-4 * case.prior.sqrt().min(1.0);
    let scale = gradient.values().iter().fold(0.0, |a: f64, g| a.max(g.abs()));
    for (index, &analytic) in gradient.values().iter().enumerate() {
        let mut moved = point.clone();
        let numeric = difference(
            |h| {
                moved.states.values_mut()[index] = point.states.values()[index] + h;
                case.ln_likelihood(&moved, &samples).1
            },
            h,
        );
        let numeric = if learns[index % n_c] { numeric } else { 0.0 };
        close(analytic, numeric, scale, &format!("initial_state[{index}]"));
    }
    let scale = gradient.mean().iter().fold(0.0, |a: f64, g| a.max(g.abs()));
    for (i, &analytic) in gradient.mean().iter().enumerate() {
        let mut moved = point.clone();
        let numeric = difference(
            |h| {
                moved.states.mean_mut()[i] = point.states.mean()[i] + h;
                case.ln_likelihood(&moved, &samples).1
            },
            h,
        );
        close(analytic, numeric, scale, &format!("initial_state_mean[{i}]"));
    }
}

#[test]
fn s_ctrnn() {
    check(&SMALL);
}

#[test]
fn ctrnn_with_squared_error() {
    check(&Case { prediction: Prediction::Mean, ..SMALL });
}

#[test]
fn s_mtrnn_with_fast_and_slow_groups() {
    check(&Case { groups: &[(6, 2.0), (3, 70.0)], ..SMALL });
}

#[test]
fn mtrnn_with_squared_error() {
    check(&Case { groups: &[(6, 2.0), (3, 70.0)], prediction: Prediction::Mean, delay: 5, ..SMALL });
}

#[test]
fn delay_of_five() {
    check(&Case { delay: 5, ..SMALL });
}

#[test]
fn s_mtrnn_with_delay_of_five_and_ragged_sequences() {
    check(&Case { groups: &[(6, 5.0), (3, 100.0)], delay: 5, lengths: &[4, 13, 1, 7, 13], ..SMALL });
}

#[test]
fn ragged_sequences() {
    check(&Case { lengths: &[3, 12, 7, 1, 12, 5, 2], ..SMALL });
}

#[test]
fn narrow_prior() {
    check(&Case { prior: 1e-5, ..SMALL });
}

#[test]
fn wide_prior() {
    check(&Case { prior: 100.0, ..SMALL });
}

#[test]
fn variance_floor() {
    check(&Case { prediction: Prediction::MeanAndVariance { floor: 0.001 }, ..SMALL });
}

#[test]
fn large_variance_floor_with_two_groups() {
    let prediction = Prediction::MeanAndVariance { floor: 0.5 };
    check(&Case { prediction, groups: &[(6, 2.0), (3, 70.0)], ..SMALL });
}

#[test]
fn time_constant_of_one_forgets_the_internal_state() {
    check(&Case { groups: &[(5, 1.0)], ..SMALL });
}

#[test]
fn time_constant_of_a_hundred() {
    check(&Case { groups: &[(5, 100.0)], lengths: &[40, 40], ..SMALL });
}

#[test]
fn recurrence_over_many_steps() {
    check(&Case { lengths: &[120], ..SMALL });
}

#[test]
fn one_channel_one_unit_one_step() {
    check(&Case { channels: 1, groups: &[(1, 2.0)], lengths: &[1], ..SMALL });
}

#[test]
fn sizes_that_leave_odd_ends_everywhere() {
    check(&Case { channels: 3, groups: &[(35, 3.0)], lengths: &[6, 6, 6, 6, 5, 6, 6], ..SMALL });
    check(&Case { channels: 1, groups: &[(65, 3.0)], lengths: &[3, 2], ..SMALL });
}

#[test]
fn more_channels_than_units() {
    check(&Case { channels: 11, groups: &[(3, 2.0)], ..SMALL });
}

fn evaluate(case: &Case, engine: &Engine) -> (Vec<u64>, Vec<u64>) {
    let Evaluation { gradients, initial, ln_likelihood, squared_error, .. } = evaluation(case, engine);
    let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    (bits(gradients.as_slice()), bits(&[initial, ln_likelihood, squared_error].concat()))
}

const LONG: Case = Case {
    groups: &[(30, 2.0), (10, 50.0)],
    lengths: &[700, 1500, 700, 3000, 64, 700, 1, 700, 700, 2999, 700, 700, 700],
    ..SMALL
};

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let set = crate::engine::InstructionSet::best();
    // The second would be one block, were there not so much to do.
    // The others are one, which a second thread follows with the gradient of the weights, segment by segment.
    let one = Case { lengths: &[4500, 2500, 4000], ..LONG };
    for case in
        [LONG, Case { lengths: &[700, 1500, 700, 64, 700], ..LONG }, one.clone(), Case { recompute: true, ..one }]
    {
        let one = evaluate(&case, &Engine::new(1, set).unwrap());
        for threads in [2, 3, 4, 7] {
            assert!(evaluate(&case, &Engine::new(threads, set).unwrap()) == one, "{threads} threads");
        }
    }
}

#[test]
fn recomputation_of_spans_gives_the_same_bits() {
    let engine = Engine::serial();
    for precision in [Precision::F64, Precision::F32] {
        let kept = Case { precision, ..LONG };
        assert!(evaluate(&kept, &engine) == evaluate(&Case { recompute: true, ..kept }, &engine));
    }
}

#[test]
fn float32_gives_the_same_bits_on_any_threads_and_instruction_set() {
    let case = Case { precision: Precision::F32, lengths: &[70, 150, 70, 30, 64, 70, 1], ..LONG };
    let portable = evaluate(&case, &Engine::new(1, crate::engine::InstructionSet::Portable).unwrap());
    assert!(portable.0.iter().all(|g| f64::from_bits(*g).is_finite()));
    for set in crate::engine::InstructionSet::available() {
        for threads in [1, 3] {
            assert!(evaluate(&case, &Engine::new(threads, set).unwrap()) == portable, "{set}, {threads} threads");
        }
    }
}

#[test]
fn an_objective_says_what_it_computes_in() {
    let (point, (data, _)) = (SMALL.point(), SMALL.data());
    for (precision, name) in [(Precision::F64, "f64"), (Precision::F32, "f32")] {
        let request = Request { precision, ..Request::new(&point.network.topology, &data) };
        assert_eq!(Engine::serial().objective(&request).unwrap().numerics(), name);
    }
}

#[test]
fn recomputation_keeps_a_small_part_of_the_states() {
    let topology = LONG.point().network.topology;
    let packed = Packed::<f64>::new(&topology, crate::engine::InstructionSet::best());
    let mut block = Block::default();
    block.fill(&[Run::new(0, 20_000)], &[0]);
    let cut = Cut::new(&packed, &block, true);
    assert!(cut.spans() > 10 && cut.span * 10 < cut.products, "{cut:?}");
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let case = Case { lengths: &[70, 150, 70, 30, 64, 70, 1], ..LONG };
    let portable = evaluate(&case, &Engine::new(1, crate::engine::InstructionSet::Portable).unwrap());
    for set in crate::engine::InstructionSet::available() {
        assert!(evaluate(&case, &Engine::new(1, set).unwrap()) == portable, "{set}");
    }
}

#[test]
fn evaluations_of_other_runs_in_between_change_no_bit() {
    // Of seven threads, three follow the four blocks of all runs.
    [1, 7].into_iter().for_each(other_runs_in_between);
}

fn other_runs_in_between(threads: usize) {
    let engine = Engine::new(threads, crate::engine::InstructionSet::best()).unwrap();
    let (point, (data, runs)) = (LONG.point(), LONG.data());
    let topology = &point.network.topology;
    let (n_c, values) = (topology.context_units(), point.states.values());
    let mut objective = engine.objective(&Request::new(topology, &data)).unwrap();
    objective.set_parameters(&point.network.parameters);
    let mut evaluate = |part: std::ops::Range<usize>, want| {
        let mut evaluation = Evaluation::new(topology);
        objective.evaluate(&runs[part.clone()], &values[part.start * n_c..part.end * n_c], want, &mut evaluation);
        evaluation
    };
    let all = evaluate(0..13, Want::Everything);
    let part = evaluate(3..8, Want::Everything);
    assert_eq!(evaluate(0..0, Want::Everything).gradients, Parameters::zeros(topology));
    assert_eq!(evaluate(3..8, Want::Score).ln_likelihood, part.ln_likelihood);
    assert_eq!(evaluate(0..13, Want::Everything), all);
    assert_eq!(evaluate(3..8, Want::Everything), part);
    assert_eq!(
        (&part.ln_likelihood[..], &part.initial[..]),
        (&all.ln_likelihood[3..8], &all.initial[3 * n_c..8 * n_c])
    );
}

#[test]
fn what_cannot_be_evaluated_is_nan() {
    let (point, (data, runs)) = (SMALL.point(), SMALL.data());
    let topology = &point.network.topology;
    let mut objective = Engine::serial().objective(&Request::new(topology, &data)).unwrap();
    let other = Parameters::zeros(&Topology::s_ctrnn(2, 4, 2.0).unwrap());
    let mut found = |parameters: &Parameters, runs: &[Run], initial: &[f64]| {
        let mut evaluation = Evaluation::new(topology);
        objective.set_parameters(parameters);
        objective.evaluate(runs, initial, Want::Everything, &mut evaluation);
        let Evaluation { gradients, initial, ln_likelihood, squared_error, .. } = evaluation;
        [gradients.as_slice(), &initial, &ln_likelihood, &squared_error].concat()
    };
    let (parameters, initial) = (&point.network.parameters, point.states.values());
    for nan in [
        found(&other, &runs, initial),
        found(parameters, &runs, &initial[1..]),
        found(parameters, &[Run::new(3, 1)], &initial[..5]),
        found(parameters, &[Run::new(0, 10)], &initial[..5]),
        found(parameters, &[Run::new(0, 0)], &initial[..5]),
    ] {
        assert!(nan.len() > 40 && nan.iter().all(|value| value.is_nan()));
    }
    assert!(found(parameters, &runs, initial).iter().all(|value| value.is_finite()));
    let mut of_another = Evaluation::new(&Topology::s_ctrnn(2, 4, 2.0).unwrap());
    objective.evaluate(&runs, initial, Want::Everything, &mut of_another);
    assert!(of_another.ln_likelihood.iter().all(|value| value.is_nan()));
    let narrow = Topology::s_ctrnn(1, 5, 2.0).unwrap();
    assert!(Engine::serial().objective(&Request::new(&narrow, &data)).is_err());
}
