//! The sequences of a training, in the batches that its updates learn from.
//!
//! Sequences are dealt once, at random and always alike; every epoch takes the batches in a new order, which depends on
//! the epoch's number alone. So a training that goes on from a checkpoint needs to know no more than its epoch.
//!
//! With one batch an epoch is: evaluate everything, report, update. With several, each is evaluated at the parameters that
//! its predecessors left, and what an epoch reports is the sum of that: values of parameters on their way. Only before the
//! first update and after the last are all sequences evaluated at the same parameters.

use rand::seq::SliceRandom;

use super::adam::{self, AdamRule};
use super::state::Fields;
use crate::batch::Item;
use crate::checkpoint::{OptimiserState, StateTensor};
use crate::engine::Engine;
use crate::error::Result;
use crate::initial_states::InitialStates;
use crate::objective::{Objective, Want};
use crate::parameters::{Gradients, Parameters};
use crate::streams::{Purpose, stream};
use crate::topology::Topology;

/// Some of the sequences.
#[derive(Debug)]
struct Batch {
    sequences: Vec<usize>,
    objective: Objective,
    /// Steps times channels.
    terms: f64,
}

/// All sequences.
#[derive(Debug)]
pub(super) struct Batches {
    batches: Vec<Batch>,
    /// In which order this epoch takes them.
    order: Vec<usize>,
    /// u_0 of one batch, [sequence][unit].
    initial: Vec<f64>,
    units: usize,
    /// ln L_out of each sequence, as last evaluated.
    pub ln_likelihoods: Vec<f64>,
    squared_errors: Vec<f64>,
    /// Length of the last gradient in the shared parameters, per step and channel: of all, or of the last batch.
    pub gradient_norm: f64,
    /// The batch whose gradient was not finite.
    broken: Option<usize>,
}

const LN_LIKELIHOODS: &str = "batches.ln_likelihood";
const SQUARED_ERRORS: &str = "batches.squared_error";
const GRADIENT_NORM: &str = "batches.gradient_norm";

impl Batches {
    /// Deals the sequences into batches of `size` at most, none of which differs from another by more than one.
    pub fn new(topology: &Topology, items: &[Item<'_>], size: usize, recompute: bool, engine: &Engine) -> Self {
        let count = items.len().div_ceil(size.max(1)).max(1);
        let mut dealt: Vec<usize> = (0..items.len()).collect();
        if count > 1 {
            dealt.shuffle(&mut stream(0, Purpose::BatchMembers, 0));
        }
        let batch = |index: usize| {
            let mut sequences: Vec<usize> = dealt.iter().copied().skip(index).step_by(count).collect();
            sequences.sort_unstable();
            let own: Vec<Item<'_>> = sequences.iter().map(|&sequence| items[sequence]).collect();
            let steps: usize = own.iter().map(|item| item.steps).sum();
            let objective = Objective::new(topology, &own, recompute, engine);
            Batch { sequences, objective, terms: (steps * topology.channels()) as f64 }
        };
        let units = topology.context_units();
        Self {
            batches: (0..count).map(batch).collect(),
            order: (0..count).collect(),
            initial: vec![0.0; items.len().div_ceil(count) * units],
            units,
            ln_likelihoods: vec![0.0; items.len()],
            squared_errors: vec![0.0; items.len()],
            gradient_norm: 0.0,
            broken: None,
        }
    }

    /// ln L_out of all sequences, as last evaluated.
    pub fn ln_likelihood(&self) -> f64 {
        self.ln_likelihoods.iter().sum()
    }

    /// The squared error of all sequences, as last evaluated.
    pub fn squared_error(&self) -> f64 {
        self.squared_errors.iter().sum()
    }

    /// The first sequence whose values are not finite.
    pub fn sequence_without_numbers(&self) -> Option<usize> {
        let finite = |s: &usize| self.ln_likelihoods[*s].is_finite() && self.squared_errors[*s].is_finite();
        (0..self.ln_likelihoods.len()).find(|s| !finite(s))
    }

    /// The gradient that is not finite.
    pub fn gradient_without_numbers(&self) -> Option<&Gradients> {
        self.broken.map(|index| &self.batches[index].objective.gradients)
    }

    /// The gradients in shared parameters and in initial states, where all sequences are in one batch.
    pub fn gradient_of_all(&self) -> (&Gradients, &[f64]) {
        assert!(self.batches.len() == 1, "only one batch has the gradient of all sequences");
        (&self.batches[0].objective.gradients, &self.batches[0].objective.initial)
    }

    /// Evaluates all sequences at the same parameters.
    pub fn evaluate(&mut self, parameters: &Parameters, states: &InitialStates) {
        self.broken = None;
        for index in 0..self.batches.len() {
            self.evaluate_batch(index, parameters, states);
        }
        let terms: f64 = self.batches.iter().map(|batch| batch.terms).sum();
        let of_all = |i: usize| self.batches.iter().map(|batch| batch.objective.gradients.as_slice()[i]).sum::<f64>();
        let count = parameters.as_slice().len();
        self.gradient_norm = (0..count).map(|i| of_all(i).powi(2)).sum::<f64>().sqrt() / terms;
    }

    /// Makes an epoch's updates. Whether their values stand for the epoch that follows: where there is one batch, they are those
    /// of the epoch before.
    pub fn ascend(&mut self, rule: &mut AdamRule, epoch: u64, state: (&mut Parameters, &mut InitialStates)) -> bool {
        let (parameters, states) = state;
        let count = self.batches.len();
        if count > 1 {
            self.order.sort_unstable();
            self.order.shuffle(&mut stream(0, Purpose::BatchOrder, epoch));
        }
        for nth in 0..count {
            let index = self.order[nth];
            if count > 1 {
                self.evaluate_batch(index, parameters, states);
                if self.sequence_without_numbers().is_some() || self.broken.is_some() {
                    break;
                }
            }
            let Batch { sequences, objective, terms } = &self.batches[index];
            let update = epoch * count as u64 + nth as u64 + 1;
            let batch = adam::Batch { epoch, update, sequences, terms: *terms };
            rule.ascend(&batch, &objective.gradients, &objective.initial, parameters, states);
        }
        if count > 1 {
            let Batch { objective, terms, .. } = &self.batches[self.order[count - 1]];
            self.gradient_norm = objective.gradients.as_slice().iter().map(|g| g * g).sum::<f64>().sqrt() / terms;
        }
        count > 1
    }

    fn evaluate_batch(&mut self, index: usize, parameters: &Parameters, states: &InitialStates) {
        let Batch { sequences, objective, .. } = &mut self.batches[index];
        let initial = &mut self.initial[..sequences.len() * self.units];
        for (&sequence, initial) in sequences.iter().zip(initial.chunks_exact_mut(self.units)) {
            initial.copy_from_slice(states.sequence(sequence));
        }
        objective.set_parameters(parameters);
        objective.evaluate(initial, Want::Everything);
        for (own, &sequence) in sequences.iter().enumerate() {
            self.ln_likelihoods[sequence] = objective.ln_likelihood[own];
            self.squared_errors[sequence] = objective.squared_error[own];
        }
        let mut gradients = objective.gradients.as_slice().iter().chain(&objective.initial);
        if !gradients.all(|g| g.is_finite()) {
            self.broken = Some(index);
        }
    }

    /// Adds what a report needs to an optimiser's state; nothing where one evaluation finds it again.
    pub fn save(&self, state: &mut OptimiserState) {
        if self.batches.len() > 1 {
            for (name, values) in [(LN_LIKELIHOODS, &self.ln_likelihoods), (SQUARED_ERRORS, &self.squared_errors)] {
                let (shape, values) = (vec![values.len()], values.clone());
                state.tensors.push(StateTensor { name: name.to_owned(), shape, values });
            }
            state.numbers.push((GRADIENT_NORM.to_owned(), self.gradient_norm));
        }
    }

    /// Takes it out again, and tells whether it was there.
    ///
    /// # Errors
    /// [`crate::Error::Checkpoint`] if a part is missing, or of another size.
    pub fn load(&mut self, state: &OptimiserState) -> Result<bool> {
        self.broken = None;
        if self.batches.len() == 1 || !state.numbers.iter().any(|(name, _)| name == GRADIENT_NORM) {
            return Ok(false);
        }
        let shape = vec![self.ln_likelihoods.len()];
        let fields = Fields {
            tensors: vec![
                (LN_LIKELIHOODS, shape.clone(), &mut self.ln_likelihoods),
                (SQUARED_ERRORS, shape, &mut self.squared_errors),
            ],
            numbers: vec![(GRADIENT_NORM, &mut self.gradient_norm)],
        };
        fields.load(state)?;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::Adam;
    use super::*;
    use crate::initialization::initialize;

    /// Sequences of 9, 10, 11 ... samples of one channel.
    fn samples(count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|s| (0..9 + s).map(|t| 0.5 * (0.4 * t as f64 + s as f64).sin()).collect()).collect()
    }

    fn of(samples: &[Vec<f64>], size: usize, topology: &Topology) -> Batches {
        let items: Vec<Item<'_>> = samples.iter().map(|own| Item { samples: own, steps: own.len() - 1 }).collect();
        Batches::new(topology, &items, size, false, &Engine::serial())
    }

    #[test]
    fn each_sequence_is_dealt_once_into_batches_of_one_size() {
        let topology = Topology::s_ctrnn(1, 3, 2.0).unwrap();
        for (count, size, expected) in [(7, 3, 3), (7, 7, 1), (7, 100, 1), (7, 1, 7), (12, 5, 3), (144, 12, 12)] {
            let batches = of(&samples(count), size, &topology).batches;
            assert_eq!(batches.len(), expected);
            let sizes: Vec<usize> = batches.iter().map(|batch| batch.sequences.len()).collect();
            let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
            assert!(*most <= size && most - least <= 1, "{sizes:?}");
            let mut dealt: Vec<usize> = batches.iter().flat_map(|batch| batch.sequences.clone()).collect();
            dealt.sort_unstable();
            assert_eq!(dealt, (0..count).collect::<Vec<_>>());
            // 8 steps of the first sequence, 9 of the second, ...
            let terms: f64 = batches.iter().map(|batch| batch.terms).sum();
            assert_eq!(terms, (0..count).map(|s| 8.0 + s as f64).sum::<f64>());
        }
    }

    #[test]
    fn batches_together_have_the_gradient_of_all() {
        let topology = Topology::s_ctrnn(1, 5, 2.0).unwrap();
        let (network, states) = initialize(&topology, 7, 3);
        let samples = samples(7);
        let (mut all, mut some) = (of(&samples, 7, &topology), of(&samples, 2, &topology));
        all.evaluate(&network.parameters, &states);
        some.evaluate(&network.parameters, &states);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} and {b}");
        near(some.ln_likelihood(), all.ln_likelihood());
        near(some.squared_error(), all.squared_error());
        near(some.gradient_norm, all.gradient_norm);
        let (gradients, initial) = all.gradient_of_all();
        for (i, g) in gradients.as_slice().iter().enumerate() {
            near(some.batches.iter().map(|batch| batch.objective.gradients.as_slice()[i]).sum(), *g);
        }
        for batch in &some.batches {
            for (own, &sequence) in batch.objective.initial.chunks(5).zip(&batch.sequences) {
                own.iter().zip(&initial[sequence * 5..]).for_each(|(a, b)| near(*a, *b));
            }
        }
    }

    #[test]
    fn an_epoch_is_one_update_for_each_batch_in_a_new_order() {
        let topology = Topology::s_ctrnn(1, 5, 2.0).unwrap();
        let samples = samples(7);
        let mut orders = Vec::new();
        for epoch in [0, 1, 2] {
            let start = initialize(&topology, 7, 3);
            let (mut network, mut states) = start.clone();
            let total = samples.iter().map(|own| own.len() - 1).sum();
            let rule = || AdamRule::new(Adam::default(), &topology, &start.1, total, 1.0, 10);
            let mut batches = of(&samples, 2, &topology);
            assert!(batches.ascend(&mut rule(), epoch, (&mut network.parameters, &mut states)));
            let order = batches.order.clone();

            // The same by hand.
            let (mut by_hand, mut own_states) = start.clone();
            let (mut rule, mut met) = (rule(), vec![f64::NAN; 7]);
            let mut single = of(&samples, 2, &topology);
            for (nth, &index) in order.iter().enumerate() {
                single.evaluate(&by_hand.parameters, &own_states);
                let Batch { sequences, objective, terms } = &single.batches[index];
                for &sequence in sequences {
                    assert!(met[sequence].is_nan());
                    met[sequence] = single.ln_likelihoods[sequence];
                }
                let batch = adam::Batch { epoch, update: 4 * epoch + nth as u64 + 1, sequences, terms: *terms };
                let (gradients, initial) = (&objective.gradients, &objective.initial);
                rule.ascend(&batch, gradients, initial, &mut by_hand.parameters, &mut own_states);
            }
            assert_eq!((&network, &states), (&by_hand, &own_states));
            assert_eq!(batches.ln_likelihoods, met);
            assert_ne!(network, start.0);
            orders.push(order);
        }
        assert!(orders[0] != orders[1] || orders[1] != orders[2], "{orders:?}");
    }
}
