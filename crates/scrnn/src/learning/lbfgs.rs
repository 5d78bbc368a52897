//! L-BFGS ([`quasi_newton`](crate::quasi_newton)) on ln L_all per step and channel, over all sequences at once.
//!
//! A step must gain enough, so that ln L_all never falls. Initial states move in [`NonCentred`] form, as Adam's do. The pairs are all
//! that is remembered from one update to the next; a checkpoint holds those that there are, in rows.

use super::batches::Batches;
use super::non_centred::NonCentred;
use super::plan::Lbfgs;
use super::state::{Fields, OptimiserState, StateTensor};
use crate::error::{Error, Result};
use crate::initial_states::InitialStates;
use crate::parameters::Parameters;
use crate::quasi_newton::{Next, Pairs, Search, dot};
use crate::topology::Topology;

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
    pairs: Pairs,
    /// How many pairs there are, and the row of the next, as a checkpoint holds them.
    held: f64,
    next: f64,
    /// t of the last update.
    pub step: f64,
    /// 1 when no step was found that gains anything; then nothing moves any more.
    converged: f64,
    non_centred: NonCentred,
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
            pairs: Pairs::new(len, options.memory),
            held: 0.0,
            next: 0.0,
            step: 1.0,
            converged: 0.0,
            non_centred: NonCentred::new(topology, variance),
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
        self.pairs.direction(&self.gradient, &mut self.direction);
        let slope = dot(&self.gradient, &self.direction);
        self.step = self.pairs.first_step(&self.direction);
        let search = Search::new(slope, self.step);
        if search.is_some_and(|search| self.search(search, here, batches, parameters, states)) {
            self.remember();
            return true;
        }
        // Rounding, or pairs that lead astray: once more without them, and if there were none it is the end.
        self.write(&self.at, parameters, states);
        self.converged = if self.pairs.held() > 0 { 0.0 } else { 1.0 };
        self.pairs.forget();
        false
    }

    /// Looks for a step that gains enough over the value `here`. Whether there is one; then the network and its gradient are there.
    fn search(
        &mut self,
        mut search: Search,
        here: f64,
        batches: &mut Batches,
        parameters: &mut Parameters,
        states: &mut InitialStates,
    ) -> bool {
        loop {
            self.step = search.step;
            self.attempt(batches, parameters, states);
            let gain = self.value(&self.tried, batches) - here;
            let sound = batches.non_finite_gradient().is_none();
            let next = search.judge(if sound { gain } else { f64::NAN }, || {
                self.take_gradient(Point::There, batches);
                dot(&self.gradient_there, &self.direction)
            });
            match next {
                Next::Try => {}
                Next::Take => return true,
                Next::GoBack => {
                    self.step = search.step;
                    self.attempt(batches, parameters, states);
                    self.take_gradient(Point::There, batches);
                    return true;
                }
                Next::Nothing => return false,
            }
        }
    }

    /// Evaluates `step` along the direction.
    fn attempt(&mut self, batches: &mut Batches, parameters: &mut Parameters, states: &mut InitialStates) {
        for ((tried, at), d) in self.tried.iter_mut().zip(&self.at).zip(&self.direction) {
            *tried = at + self.step * d;
        }
        self.write(&self.tried, parameters, states);
        batches.evaluate(parameters, states);
    }

    /// theta of a network.
    fn read(&mut self, parameters: &Parameters, states: &InitialStates) {
        let (shared, rest) = self.at.split_at_mut(self.shared);
        shared.copy_from_slice(parameters.as_slice());
        let (z, mean) = rest.split_at_mut(states.values().len());
        mean.copy_from_slice(states.mean());
        self.non_centred.read(states, z);
    }

    /// The network of theta.
    fn write(&self, theta: &[f64], parameters: &mut Parameters, states: &mut InitialStates) {
        let (shared, rest) = theta.split_at(self.shared);
        parameters.as_mut_slice().copy_from_slice(shared);
        let (z, mean) = rest.split_at(states.values().len());
        states.mean_mut().copy_from_slice(mean);
        self.non_centred.write(z, states);
    }

    /// ln L_all per step and channel, but for a constant.
    fn value(&self, theta: &[f64], batches: &Batches) -> f64 {
        let z = &theta[self.shared..theta.len() - self.units];
        (batches.ln_likelihood() - 0.5 * self.non_centred.pull() * dot(z, z)) / self.terms
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
            *g = self.non_centred.slope(i, *g, *z);
        }
        gradient.iter_mut().for_each(|g| *g /= self.terms);
    }

    /// Takes the pair of an update up.
    fn remember(&mut self) {
        for (s, at) in self.tried.iter_mut().zip(&self.at) {
            *s -= at;
        }
        for (d, here) in self.gradient_there.iter_mut().zip(&self.gradient) {
            *d = here - *d;
        }
        self.pairs.remember(&self.tried, &self.gradient_there);
    }

    /// Takes what was kept out of a checkpoint: rows that hold a pair each, or, of earlier versions, rows for as many as there can
    /// be, of which the first ones hold one.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if a part is missing, of another size, or counts pairs that cannot be there.
    pub fn load(&mut self, state: &OptimiserState) -> Result<()> {
        let numbers = vec![
            (HELD, &mut self.held),
            (NEXT, &mut self.next),
            (STEP, &mut self.step),
            (CONVERGED, &mut self.converged),
        ];
        Fields { tensors: vec![], numbers }.load(state)?;
        let memory = self.memory as f64;
        // Until all rows are there, the next is the one after the last.
        let nexts = if self.held < memory { self.held..=self.held } else { 0.0..=memory - 1.0 };
        for (name, count, needed) in [("held", self.held, 0.0..=memory), ("next", self.next, nexts)] {
            if !(count.fract() == 0.0 && needed.contains(&count)) {
                let (least, most) = (needed.start(), needed.end());
                let what = format!(
                    "the optimiser's lbfgs.{name} is {count}; needed: a whole number of at least {least} and at most {most}"
                );
                return Err(Error::Checkpoint(what));
            }
        }
        let (held, len) = (self.held as usize, self.at.len());
        let rows = |name: &str| {
            let missing = || Error::Checkpoint(format!("optimiser.{name} is missing"));
            let tensor = state.tensors.iter().find(|tensor| tensor.name == name).ok_or_else(missing)?;
            let (shape, values) = (&tensor.shape, &tensor.values);
            match shape[..] {
                [rows, of] if of == len && (rows == held || rows == self.memory) && values.len() == rows * len => {
                    Ok(values)
                }
                _ => {
                    let needed = format!("optimiser.{name} has the shape {shape:?}; needed: [{held}, {len}]");
                    Err(Error::Checkpoint(needed))
                }
            }
        };
        let (moves, changes) = (rows(MOVES)?, rows(CHANGES)?);
        self.pairs.restore(moves, changes, held, self.next as usize);
        Ok(())
    }

    /// Adds what has to be kept to go on. The memory is large: it is copied once, into the state.
    pub fn save(&self, state: &mut OptimiserState) {
        let held = self.pairs.held();
        let (moves, changes, next) = self.pairs.rows();
        for (name, values) in [(MOVES, moves), (CHANGES, changes)] {
            let shape = vec![held, self.at.len()];
            state.tensors.push(StateTensor { name: name.to_owned(), shape, values: values.to_vec() });
        }
        let numbers = [(HELD, held as f64), (NEXT, next as f64), (STEP, self.step), (CONVERGED, self.converged)];
        state.numbers.extend(numbers.map(|(name, value)| (name.to_owned(), value)));
    }
}

const HELD: &str = "lbfgs.held";
const NEXT: &str = "lbfgs.next";
const STEP: &str = "lbfgs.step";
const CONVERGED: &str = "lbfgs.converged";
const MOVES: &str = "lbfgs.moves";
const CHANGES: &str = "lbfgs.changes";

/// Of which point a gradient is.
#[derive(Debug, Clone, Copy)]
enum Point {
    Here,
    There,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn saved(rule: &LbfgsRule) -> OptimiserState {
        let mut state = OptimiserState::default();
        rule.save(&mut state);
        state
    }
    use crate::dataset::{Dataset, Sequence};
    use crate::engine::Engine;
    use crate::initialization::initialize;
    use crate::objective::{Backend, Request};
    use crate::parameters::Block;
    use crate::topology::{Group, Prediction};

    /// All sequences in one batch.
    fn batches(topology: &Topology, samples: &[Vec<f64>]) -> Batches {
        let sequences: Vec<_> = samples.iter().map(|own| Sequence::new("", 1, own.clone()).unwrap()).collect();
        let data = Dataset::new(vec!["y".into()], sequences).unwrap();
        let objective = Engine::serial().objective(&Request::new(topology, &data)).unwrap();
        Batches::new(objective, topology, &data, samples.len())
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

    #[test]
    fn a_step_that_gained_enough_is_kept_though_the_last_try_did_not() {
        let groups = vec![Group::full("context", 3, 2.0)];
        let topology = Topology::new(1, 1, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
        let samples = vec![0.0; 9];
        for place in 0..8 {
            // All weights and biases 0 predict the zeros exactly: ln L grows with a falling variance at a slope that never falls, up
            // to the edge where the variance is 0.
            let (mut network, mut states) = initialize(&topology, 1, 3);
            network.parameters.as_mut_slice().fill(0.0);
            let start = -40.7 * f64::from(place);
            network.parameters.block_mut(Block::VarianceBias).fill(start);
            states.mean_mut().fill(0.0);
            let mut batches = batches(&topology, std::slice::from_ref(&samples));
            let mut rule = LbfgsRule::new(&Lbfgs::default(), &topology, 1, 8.0, 1.0);
            batches.evaluate(&network.parameters, &states);
            let before = batches.ln_likelihood();
            assert!(rule.ascend(&mut batches, &mut network.parameters, &mut states), "{place}: nothing gained");
            let after = batches.ln_likelihood();
            assert!(after > before + 100.0, "{place}: {before} to {after}");
            assert_eq!(rule.converged, 0.0);
            batches.evaluate(&network.parameters, &states);
            assert_eq!(batches.ln_likelihood(), after);
            // More than half of the way to the edge.
            let bias = network.parameters.block(Block::VarianceBias)[0];
            assert!(bias > -745.2 && bias < 0.5 * (start - 709.7), "{start} to {bias}");
        }
    }

    #[test]
    fn a_checkpoint_holds_the_pairs_that_there_are_and_one_with_empty_rows_is_read() {
        let (mut rule, mut batches, mut parameters, mut states) = problem(0.3);
        batches.evaluate(&parameters, &states);
        let len = rule.at.len();
        for update in 0..7 {
            let kept = saved(&rule);
            let held = rule.pairs.held();
            assert_eq!(held, update.min(4));
            for tensor in &kept.tensors {
                assert_eq!((&tensor.shape[..], tensor.values.len()), (&[held, len][..], held * len));
            }
            // As earlier versions wrote it: rows for all pairs that there can be.
            let mut earlier = kept.clone();
            for tensor in &mut earlier.tensors {
                tensor.shape[0] = 4;
                tensor.values.resize(4 * len, 0.0);
            }
            let mut after = Vec::new();
            for state in [&kept, &earlier] {
                let (mut other, mut own_batches, mut own_parameters, mut own_states) = problem(0.3);
                own_parameters.clone_from(&parameters);
                own_states.clone_from(&states);
                other.load(state).unwrap();
                assert_eq!(saved(&other), kept);
                own_batches.evaluate(&own_parameters, &own_states);
                other.ascend(&mut own_batches, &mut own_parameters, &mut own_states);
                after.push((own_parameters, own_states));
            }
            rule.ascend(&mut batches, &mut parameters, &mut states);
            for (own_parameters, own_states) in after {
                assert_eq!((&own_parameters, &own_states), (&parameters, &states), "update {update}");
            }
        }
        let mut strange = saved(&rule);
        strange.tensors[1].shape[0] = 3;
        strange.tensors[1].values.truncate(3 * len);
        let told = problem(0.3).0.load(&strange).unwrap_err().to_string();
        assert!(told.contains(&format!("lbfgs.changes has the shape [3, {len}]; needed: [4, {len}]")), "{told}");
    }
}
