//! L-BFGS (Nocedal and Wright 2006, algorithms 7.4 and 3.5) on ln L_all per step and channel, over all sequences at once.
//!
//! ```text
//! theta <- theta + t H g,   H from the last pairs s = theta' - theta, d = g - g'
//! ```
//!
//! The step t is 1 where that will do; otherwise it is doubled or bisected until it gains enough and the slope along it is
//! nearly gone (the weak Wolfe conditions), which makes every pair's curvature positive. So ln L_all never falls.
//! Initial states move in [`Coordinates`], as Adam's do. The pairs are all that is remembered from one update to the next.

use super::batches::Batches;
use super::coordinates::Coordinates;
use super::plan::Lbfgs;
use super::state::Fields;
use crate::checkpoint::OptimiserState;
use crate::error::{Error, Result};
use crate::initial_states::InitialStates;
use crate::parameters::Parameters;
use crate::topology::Topology;

/// A step must gain this share of what its slope promises,
const GAIN: f64 = 1e-4;
/// and leave at most this share of the slope.
const SLOPE: f64 = 0.9;
/// Tries for a step.
const TRIES: usize = 25;
/// Length of the first try where there is no pair yet that would tell the scale.
const FIRST: f64 = 1e-3;

/// What the rule remembers, and room for what it computes.
#[derive(Debug, Clone)]
pub(super) struct LbfgsRule {
    /// theta: shared parameters, z of each sequence, mean.
    at: Vec<f64>,
    gradient: Vec<f64>,
    direction: Vec<f64>,
    tried: Vec<f64>,
    gradient_there: Vec<f64>,
    memory: usize,
    /// s and d, `[memory, theta]`, in a ring: `next` is the place of the next pair, `held` the number of pairs.
    moves: Vec<f64>,
    changes: Vec<f64>,
    held: f64,
    next: f64,
    along: Vec<f64>,
    /// t of the last update.
    pub step: f64,
    /// 1 when no step was found that gains anything; then nothing moves any more.
    converged: f64,
    coordinates: Coordinates,
    /// Units with an initial state each.
    units: usize,
    shared: usize,
    terms: f64,
}

impl LbfgsRule {
    pub fn new(options: &Lbfgs, topology: &Topology, sequences: usize, terms: f64, variance: f64) -> Self {
        let shared = Parameters::zeros(topology).as_slice().len();
        let len = shared + (sequences + 1) * topology.context_units();
        let zeros = || vec![0.0; len];
        Self {
            at: zeros(),
            gradient: zeros(),
            direction: zeros(),
            tried: zeros(),
            gradient_there: zeros(),
            memory: options.memory,
            moves: vec![0.0; options.memory * len],
            changes: vec![0.0; options.memory * len],
            held: 0.0,
            next: 0.0,
            along: vec![0.0; options.memory],
            step: 1.0,
            converged: 0.0,
            coordinates: Coordinates::new(topology, variance),
            units: topology.context_units(),
            shared,
            terms,
        }
    }

    /// One update from where `batches`, which are one, were evaluated. Whether they are evaluated at what it came to.
    pub fn ascend(&mut self, batches: &mut Batches, parameters: &mut Parameters, states: &mut InitialStates) -> bool {
        if self.converged > 0.0 {
            return true;
        }
        self.read(parameters, states);
        let here = self.value(&self.at, batches);
        self.take_gradient(Point::Here, batches);
        self.choose_direction();
        let slope = dot(&self.gradient, &self.direction);
        // Bounds on t, and how much the best step so far gains.
        let (mut low, mut high) = (0.0, f64::INFINITY);
        self.step = if self.held > 0.0 { 1.0 } else { FIRST / dot(&self.direction, &self.direction).sqrt() };
        let mut found = false;
        for _ in 0..TRIES {
            if !(slope > 0.0 && self.step.is_finite()) {
                break;
            }
            for ((tried, at), d) in self.tried.iter_mut().zip(&self.at).zip(&self.direction) {
                *tried = at + self.step * d;
            }
            self.write(&self.tried, parameters, states);
            batches.evaluate(parameters, states);
            let gain = self.value(&self.tried, batches) - here;
            let sound = gain.is_finite() && batches.gradient_without_numbers().is_none();
            found = sound && gain >= GAIN * self.step * slope;
            if found {
                self.take_gradient(Point::There, batches);
                if dot(&self.gradient_there, &self.direction) <= SLOPE * slope {
                    break;
                }
                low = self.step;
            } else {
                high = self.step;
            }
            self.step = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * self.step };
        }
        if found {
            self.remember();
            return true;
        }
        // Rounding, or pairs that lead astray: once more without them, and if there were none it is the end.
        self.write(&self.at, parameters, states);
        self.converged = if self.held > 0.0 || low > 0.0 { 0.0 } else { 1.0 };
        (self.held, self.next) = (0.0, 0.0);
        false
    }

    /// theta of a network.
    fn read(&mut self, parameters: &Parameters, states: &InitialStates) {
        let (shared, rest) = self.at.split_at_mut(self.shared);
        shared.copy_from_slice(parameters.as_slice());
        let (z, mean) = rest.split_at_mut(states.values().len());
        mean.copy_from_slice(states.mean());
        self.coordinates.read(states, z);
    }

    /// The network of theta.
    fn write(&self, theta: &[f64], parameters: &mut Parameters, states: &mut InitialStates) {
        let (shared, rest) = theta.split_at(self.shared);
        parameters.as_mut_slice().copy_from_slice(shared);
        let (z, mean) = rest.split_at(states.values().len());
        states.mean_mut().copy_from_slice(mean);
        self.coordinates.write(z, states);
    }

    /// ln L_all per step and channel, but for a constant.
    fn value(&self, theta: &[f64], batches: &Batches) -> f64 {
        let z = &theta[self.shared..theta.len() - self.units];
        (batches.ln_likelihood() - 0.5 * self.coordinates.pull() * dot(z, z)) / self.terms
    }

    /// The gradient of [`Self::value`] in theta, from d ln L_out / d (theta_share, u_0).
    fn take_gradient(&mut self, point: Point, batches: &Batches) {
        let (theta, gradient) = match point {
            Point::Here => (&self.at, &mut self.gradient),
            Point::There => (&self.tried, &mut self.gradient_there),
        };
        let end = theta.len() - self.units;
        let (shared, initial) = batches.gradient_of_all();
        let (of_sequences, of_mean) = gradient.split_at_mut(end);
        of_sequences[..self.shared].copy_from_slice(shared.as_slice());
        of_sequences[self.shared..].copy_from_slice(initial);
        of_mean.fill(0.0);
        for (index, (g, z)) in of_sequences[self.shared..].iter_mut().zip(&theta[self.shared..end]).enumerate() {
            let i = index % self.units;
            of_mean[i] += *g;
            *g = self.coordinates.slope(i, *g, *z);
        }
        gradient.iter_mut().for_each(|g| *g /= self.terms);
    }

    /// H g (algorithm 7.4).
    fn choose_direction(&mut self) {
        let len = self.at.len();
        let pair = |age: usize| {
            let place = (self.next as usize + self.memory - 1 - age) % self.memory;
            place * len..(place + 1) * len
        };
        let held = self.held as usize;
        let direction = &mut self.direction;
        direction.copy_from_slice(&self.gradient);
        for age in 0..held {
            let (s, d) = (&self.moves[pair(age)], &self.changes[pair(age)]);
            self.along[age] = dot(s, direction) / dot(s, d);
            direction.iter_mut().zip(d).for_each(|(q, d)| *q -= self.along[age] * d);
        }
        if held > 0 {
            let (s, d) = (&self.moves[pair(0)], &self.changes[pair(0)]);
            let scale = dot(s, d) / dot(d, d);
            direction.iter_mut().for_each(|q| *q *= scale);
        }
        for age in (0..held).rev() {
            let (s, d) = (&self.moves[pair(age)], &self.changes[pair(age)]);
            let back = self.along[age] - dot(d, direction) / dot(s, d);
            direction.iter_mut().zip(s).for_each(|(q, s)| *q += back * s);
        }
    }

    /// Takes the pair of an update up, in place of the oldest, unless rounding left it no curvature.
    fn remember(&mut self) {
        let len = self.at.len();
        let place = self.next as usize;
        let own = place * len..(place + 1) * len;
        let (moves, changes) = (&mut self.moves[own.clone()], &mut self.changes[own]);
        for (i, (s, d)) in moves.iter_mut().zip(changes.iter_mut()).enumerate() {
            *s = self.tried[i] - self.at[i];
            *d = self.gradient[i] - self.gradient_there[i];
        }
        let curvature = dot(moves, changes);
        if curvature > f64::EPSILON * (dot(moves, moves) * dot(changes, changes)).sqrt() {
            self.next = ((place + 1) % self.memory) as f64;
            self.held = (self.held + 1.0).min(self.memory as f64);
        }
    }

    /// Takes what was kept out of a checkpoint.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if a part is missing, of another size, or counts pairs that cannot be there.
    pub fn load(&mut self, state: &OptimiserState) -> Result<()> {
        self.fields().load(state)?;
        let memory = self.memory as f64;
        for (name, count, most) in [("held", self.held, memory), ("next", self.next, memory - 1.0)] {
            if !(count.fract() == 0.0 && (0.0..=most).contains(&count)) {
                let what = format!("the optimiser's lbfgs.{name} is {count}; needed: a whole number up to {most}");
                return Err(Error::Checkpoint(what));
            }
        }
        Ok(())
    }

    /// What has to be kept to go on.
    pub fn fields(&mut self) -> Fields<'_> {
        let shape = vec![self.memory, self.at.len()];
        Fields {
            tensors: vec![("lbfgs.moves", shape.clone(), &mut self.moves), ("lbfgs.changes", shape, &mut self.changes)],
            numbers: vec![
                ("lbfgs.held", &mut self.held),
                ("lbfgs.next", &mut self.next),
                ("lbfgs.step", &mut self.step),
                ("lbfgs.converged", &mut self.converged),
            ],
        }
    }
}

/// Of which point a gradient is.
#[derive(Debug, Clone, Copy)]
enum Point {
    Here,
    There,
}

/// Eight sums side by side, as wide as vectors get: the same bits on all of them.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (eights, rest) = a.as_chunks::<8>();
    let (others, other_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in eights.iter().zip(others) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f64>() + rest.iter().zip(other_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Dataset, Sequence};
    use crate::engine::Engine;
    use crate::initialization::initialize;
    use crate::objective::{Backend, Request, Run};
    use crate::topology::{Group, Prediction};

    /// All sequences in one batch.
    fn batches(topology: &Topology, samples: &[Vec<f64>]) -> Batches {
        let sequences: Vec<_> = samples.iter().map(|own| Sequence::new("", 1, own.clone()).unwrap()).collect();
        let data = Dataset::new(vec!["y".into()], sequences).unwrap();
        let objective = Engine::serial().objective(&Request::new(topology, &data)).unwrap();
        Batches::new(objective, topology, Run::through_all(&data, 1), samples.len())
    }

    /// A network with learned and unlearned initial states on two sequences, its batches and a rule.
    fn problem(variance: f64) -> (LbfgsRule, Batches, Parameters, InitialStates) {
        let groups = vec![Group::fast(3, 2.0), Group::slow(2, 5.0)];
        let topology = Topology::new(1, 1, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
        let samples: Vec<Vec<f64>> =
            (0..2).map(|s| (0..12 + s).map(|t| 0.6 * (0.5 * t as f64 + s as f64).sin()).collect()).collect();
        let (network, mut states) = initialize(&topology, 2, 3);
        let far = variance.sqrt().min(1.0);
        for (index, u0) in states.values_mut().iter_mut().enumerate().filter(|(index, _)| index % 5 > 2) {
            *u0 += far * (0.3 + 0.2 * index as f64);
        }
        let batches = batches(&topology, &samples);
        let rule = LbfgsRule::new(&Lbfgs { share: 1.0, memory: 4 }, &topology, 2, 23.0, variance);
        (rule, batches, network.parameters, states)
    }

    #[test]
    fn its_gradient_is_that_of_the_value_in_every_coordinate() {
        for variance in [1e-5, 0.3, 100.0] {
            let (mut rule, mut batches, mut parameters, mut states) = problem(variance);
            rule.read(&parameters, &states);
            batches.evaluate(&parameters, &states);
            rule.take_gradient(Point::Here, &batches);
            let theta = rule.at.clone();
            for i in 0..theta.len() {
                let mut at = |step: f64| {
                    let mut moved = theta.clone();
                    moved[i] += step;
                    rule.write(&moved, &mut parameters, &mut states);
                    batches.evaluate(&parameters, &states);
                    rule.value(&moved, &batches)
                };
                let step = 1e-3;
                let slope = (8.0 * (at(step) - at(-step)) - at(2.0 * step) + at(-2.0 * step)) / (12.0 * step);
                let g = rule.gradient[i];
                // A missing weight, and z of a unit that always starts from 0, are no coordinates.
                let z = i.checked_sub(rule.shared).filter(|z| *z < 10);
                if z.is_some_and(|z| z % 5 < 3) || theta[i] == 0.0 && g == 0.0 {
                    assert_eq!(g, 0.0);
                    continue;
                }
                assert!((g - slope).abs() < 1e-8 * (1.0 + g.abs()), "{variance:e}, {i}: {g} and {slope}");
            }
        }
    }

    #[test]
    fn its_direction_is_that_of_the_whole_matrix() {
        let (mut rule, ..) = problem(1.0);
        let len = rule.at.len();
        let number = |k: usize| (1.7 * k as f64 + 0.3).sin();
        // Five pairs for a memory of four: d = A s with a diagonal A has positive curvature.
        let mut pairs = Vec::new();
        for k in 0..5 {
            let s: Vec<f64> = (0..len).map(|i| number(31 * k + i)).collect();
            let d: Vec<f64> = s.iter().enumerate().map(|(i, s)| (0.5 + (i % 7) as f64) * s).collect();
            for i in 0..len {
                (rule.at[i], rule.tried[i]) = (0.0, s[i]);
                (rule.gradient[i], rule.gradient_there[i]) = (d[i], 0.0);
            }
            rule.remember();
            pairs.push((s, d));
        }
        assert_eq!((rule.held, rule.next), (4.0, 1.0));
        rule.gradient = (0..len).map(|i| number(1000 + i)).collect();
        rule.choose_direction();

        // BFGS with the matrix written out: H <- (1 - r s d^T) H (1 - r d s^T) + r s s^T, r = 1 / s^T d.
        let (s, d) = &pairs[4];
        let mut matrix = nalgebra::DMatrix::<f64>::identity(len, len) * (dot(s, d) / dot(d, d));
        for (s, d) in &pairs[1..] {
            let (s, d) = (nalgebra::DVector::from_column_slice(s), nalgebra::DVector::from_column_slice(d));
            let r = 1.0 / s.dot(&d);
            let left = nalgebra::DMatrix::identity(len, len) - &s * d.transpose() * r;
            matrix = &left * matrix * left.transpose() + &s * s.transpose() * r;
        }
        let expected = matrix * nalgebra::DVector::from_column_slice(&rule.gradient);
        for (found, expected) in rule.direction.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{found} and {expected}");
        }
    }

    #[test]
    fn an_update_gains_and_leaves_the_batches_at_what_it_came_to() {
        let (mut rule, mut batches, mut parameters, mut states) = problem(0.3);
        batches.evaluate(&parameters, &states);
        let prior = |states: &InitialStates| {
            let far = |(k, u0): (usize, &f64)| (k % 5 > 2) as u8 as f64 * (u0 - states.mean()[k % 5]).powi(2);
            -0.5 / 0.3 * states.values().iter().enumerate().map(far).sum::<f64>()
        };
        let mut all = batches.ln_likelihood() + prior(&states);
        for update in 0..60 {
            assert!(rule.ascend(&mut batches, &mut parameters, &mut states));
            let (found, now) = (batches.ln_likelihood(), batches.ln_likelihood() + prior(&states));
            batches.evaluate(&parameters, &states);
            assert_eq!(batches.ln_likelihood().to_bits(), found.to_bits());
            assert!(now > all, "update {update}: {all} to {now}");
            all = now;
        }
        // The units that start from 0 still do.
        assert!(states.values().iter().enumerate().all(|(k, u0)| k % 5 > 2 || *u0 == 0.0));
    }

    #[test]
    fn where_nothing_can_be_gained_nothing_moves() {
        let groups = vec![Group::full("context", 3, 2.0)];
        let topology = Topology::new(1, 1, groups, Prediction::Mean).unwrap();
        let (mut network, mut states) = initialize(&topology, 1, 3);
        // All weights and biases 0 predict the zeros exactly.
        network.parameters.as_mut_slice().fill(0.0);
        let mean = states.mean().to_vec();
        states.values_mut().copy_from_slice(&mean);
        let (before, mut batches) = ((network.clone(), states.clone()), batches(&topology, &[vec![0.0; 9]]));
        let mut rule = LbfgsRule::new(&Lbfgs::default(), &topology, 1, 8.0, 1.0);
        batches.evaluate(&network.parameters, &states);
        assert!(!rule.ascend(&mut batches, &mut network.parameters, &mut states));
        batches.evaluate(&network.parameters, &states);
        assert!(rule.ascend(&mut batches, &mut network.parameters, &mut states));
        assert_eq!((network, states), before);
    }
}
