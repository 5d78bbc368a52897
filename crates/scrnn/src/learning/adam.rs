//! Adam (Kingma and Ba 2015) with warm-up, cosine decay and clipping, on g = d(ln L per step and channel).
//!
//! ```text
//! m <- beta1 m + (1 - beta1) g,   q <- beta2 q + (1 - beta2) g^2
//! theta <- theta + rate(n) (m / (1 - beta1^n)) / (sqrt(q / (1 - beta2^n)) + epsilon)
//! ```
//!
//! before which weights w <- (1 - rate(n) decay) w if decay is above 0 (decoupled weight decay, Loshchilov and Hutter 2019).
//! Initial states move in [`NonCentred`] form that are not stiff, however narrow the prior. Between the first update of an epoch and
//! the last, z is what is kept, and u_0 follows it and the mean where a batch asks for it: so an update costs what its batch costs.

use std::ops::Range;

use super::non_centred::NonCentred;
use super::plan::Adam;
use super::state::Fields;
use crate::initial_states::InitialStates;
use crate::objective::{Evaluation, Run};
use crate::parameters::{Block, Parameters};
use crate::topology::Topology;

/// First and second moments of one list of parameters.
#[derive(Debug, Clone)]
struct Moments {
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Moments {
    fn new(len: usize) -> Self {
        Self { first: vec![0.0; len], second: vec![0.0; len] }
    }

    /// Moves `values` along `gradient`; `update` is the number of this update, from 1.
    fn ascend(&mut self, adam: &Adam, update: u64, rate: f64, gradient: &[f64], values: &mut [f64]) {
        self.ascend_range(0..values.len(), adam, update, rate, gradient, values);
    }

    /// The same for values that are only a part of the list.
    fn ascend_range(
        &mut self,
        part: Range<usize>,
        adam: &Adam,
        update: u64,
        rate: f64,
        gradient: &[f64],
        values: &mut [f64],
    ) {
        let power = |beta: f64| 1.0 - beta.powf(update as f64);
        let (correct_first, correct_second) = (1.0 / power(adam.beta1), 1.0 / power(adam.beta2));
        let moments = self.first[part.clone()].iter_mut().zip(&mut self.second[part]);
        for ((value, g), (m, q)) in values.iter_mut().zip(gradient).zip(moments) {
            *m = adam.beta1 * *m + (1.0 - adam.beta1) * g;
            *q = adam.beta2 * *q + (1.0 - adam.beta2) * (g * g);
            *value += rate * (*m * correct_first) / ((*q * correct_second).sqrt() + adam.epsilon);
        }
    }
}

/// The sequences that an update learns from.
#[derive(Debug)]
pub(super) struct Batch<'a> {
    /// The epoch, from 0.
    pub epoch: u64,
    /// The number of this update, from 1.
    pub update: u64,
    pub runs: &'a [Run],
    /// Their steps times the channels, less what is missing.
    pub terms: f64,
}

/// What the rule remembers.
#[derive(Debug, Clone)]
pub(super) struct AdamRule {
    options: Adam,
    /// The guard's factor; 1 unless the training became unstable.
    pub guarded: f64,
    shared: Moments,
    initial: Moments,
    mean: Moments,
    epochs: u64,
    /// The average of T N_O over sequences.
    terms: f64,
    non_centred: NonCentred,
    scratch: Vec<f64>,
    z: Vec<f64>,
}

impl AdamRule {
    pub fn new(
        options: Adam,
        topology: &Topology,
        states: &InitialStates,
        terms: f64,
        variance: f64,
        epochs: u64,
    ) -> Self {
        let parameters = Parameters::zeros(topology).as_slice().len();
        Self {
            options,
            guarded: 1.0,
            shared: Moments::new(parameters),
            initial: Moments::new(states.values().len()),
            mean: Moments::new(states.mean().len()),
            epochs,
            terms: terms / states.sequences() as f64,
            non_centred: NonCentred::new(topology, variance),
            scratch: vec![0.0; parameters.max(states.values().len())],
            z: vec![0.0; states.values().len()],
        }
    }

    /// The rate of the update that follows epoch `epoch`.
    pub fn rate(&self, epoch: u64) -> f64 {
        self.guarded * self.scheduled_rate(epoch)
    }

    fn scheduled_rate(&self, epoch: u64) -> f64 {
        let Adam { rate, warm_up, final_rate, .. } = self.options;
        let warm = (warm_up * self.epochs as f64).round();
        let at = epoch as f64;
        if at < warm {
            return rate * (at + 1.0) / warm;
        }
        let left = (self.epochs as f64 - warm).max(1.0);
        let phase = ((at - warm) / left).min(1.0) * std::f64::consts::PI;
        final_rate + (rate - final_rate) * 0.5 * (1.0 + phase.cos())
    }

    /// The rates for shared parameters and initial states.
    pub fn rates(&self, epoch: u64) -> (f64, f64) {
        let rate = self.rate(epoch);
        (rate, rate * self.options.initial_state_factor)
    }

    /// Takes z up, before the first update of an epoch.
    pub fn begin_epoch(&mut self, states: &InitialStates) {
        self.non_centred.read(states, &mut self.z);
    }

    /// Brings u_0 of a batch to where z and the mean are.
    pub fn place(&self, runs: &[Run], states: &mut InitialStates) {
        let units = states.mean().len();
        for run in runs {
            let z = &self.z[run.sequence * units..(run.sequence + 1) * units];
            self.non_centred.write_one(z, run.sequence, states);
        }
    }

    /// Brings u_0 of all sequences there, after the last update of an epoch.
    pub fn end_epoch(&self, states: &mut InitialStates) {
        self.non_centred.write(&self.z, states);
    }

    /// One update of weights, mean, and z of a batch, from the gradients of ln L_out over its sequences.
    pub fn ascend(
        &mut self,
        batch: &Batch<'_>,
        evaluation: &Evaluation,
        parameters: &mut Parameters,
        states: &mut InitialStates,
    ) {
        let Evaluation { gradients, initial, .. } = evaluation;
        let adam = self.options.clone();
        let rate = self.rate(batch.epoch);

        let norm = gradients.as_slice().iter().map(|g| g * g).sum::<f64>().sqrt() / batch.terms;
        let clip = if adam.clip_norm > 0.0 && norm > adam.clip_norm { adam.clip_norm / norm } else { 1.0 };
        let scratch = &mut self.scratch[..gradients.as_slice().len()];
        for (out, g) in scratch.iter_mut().zip(gradients.as_slice()) {
            *out = g * (clip / batch.terms);
        }
        if adam.weight_decay > 0.0 {
            let keep = 1.0 - (rate * adam.weight_decay).min(1.0);
            for block in Block::ALL.into_iter().filter(|block| !block.is_bias()) {
                parameters.block_mut(block).iter_mut().for_each(|w| *w *= keep);
            }
        }
        self.shared.ascend(&adam, batch.update, rate, scratch, parameters.as_mut_slice());

        let units = states.mean().len();
        // Each sequence is met once an epoch.
        let (met, own_rate) = (batch.epoch + 1, rate * adam.initial_state_factor);
        for (run, initial) in batch.runs.iter().zip(initial.chunks_exact(units)) {
            let own = run.sequence * units..(run.sequence + 1) * units;
            let z = &mut self.z[own.clone()];
            let scratch = &mut self.scratch[..units];
            for (i, (out, g)) in scratch.iter_mut().zip(initial).enumerate() {
                *out = self.non_centred.slope(i, *g, z[i]) / self.terms;
            }
            self.initial.ascend_range(own, &adam, met, own_rate, scratch, z);
        }

        let scratch = &mut self.scratch[..units];
        for (i, out) in scratch.iter_mut().enumerate() {
            *out = initial.iter().skip(i).step_by(units).sum::<f64>() / batch.terms;
        }
        self.mean.ascend(&adam, batch.update, rate * adam.mean_factor, scratch, states.mean_mut());
    }

    /// Takes over what another rule of the same training remembers; allocates nothing.
    pub fn copy_from(&mut self, other: &Self) {
        let own = [&mut self.shared, &mut self.initial, &mut self.mean];
        for (own, other) in own.into_iter().zip([&other.shared, &other.initial, &other.mean]) {
            own.first.copy_from_slice(&other.first);
            own.second.copy_from_slice(&other.second);
        }
        self.guarded = other.guarded;
    }

    /// What has to be kept to go on.
    pub fn fields(&mut self) -> Fields<'_> {
        let (parameters, units) = (self.shared.first.len(), self.mean.first.len());
        let states = vec![self.initial.first.len() / units, units];
        Fields {
            tensors: vec![
                ("first_moment.shared", vec![parameters], &mut self.shared.first),
                ("second_moment.shared", vec![parameters], &mut self.shared.second),
                ("first_moment.initial_state", states.clone(), &mut self.initial.first),
                ("second_moment.initial_state", states, &mut self.initial.second),
                ("first_moment.initial_state_mean", vec![units], &mut self.mean.first),
                ("second_moment.initial_state_mean", vec![units], &mut self.mean.second),
            ],
            numbers: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weight_decay_shrinks_weights_and_leaves_biases() {
        let topology = Topology::s_ctrnn(2, 3, 2.0).unwrap();
        let (mut network, mut states) = crate::initialization::initialize(&topology, 1, 5);
        network.parameters.as_mut_slice().fill(0.5);
        let options = Adam { rate: 0.1, warm_up: 0.0, weight_decay: 0.2, ..Adam::default() };
        let mut rule = AdamRule::new(options, &topology, &states, 10.0, 1.0, 10);
        // Without a gradient nothing else moves.
        let mut evaluation = Evaluation::new(&topology);
        evaluation.resize(1);
        let batch = Batch { epoch: 0, update: 1, runs: &[Run::new(0, 10)], terms: 20.0 };
        rule.ascend(&batch, &evaluation, &mut network.parameters, &mut states);
        for block in Block::ALL {
            let expected = if block.is_bias() { 0.5 } else { 0.5 * 0.98 };
            assert!(network.parameters.block(block).iter().all(|w| (w - expected).abs() < 1e-15), "{block:?}");
        }
    }

    #[test]
    fn an_update_moves_only_the_initial_states_of_its_batch() {
        let topology = Topology::s_ctrnn(1, 2, 2.0).unwrap();
        let (mut network, mut states) = crate::initialization::initialize(&topology, 3, 5);
        let options = Adam { rate: 0.1, warm_up: 0.0, mean_factor: 0.0, ..Adam::default() };
        let mut rule = AdamRule::new(options, &topology, &states, 10.0, 1.0, 10);
        let (mut evaluation, before) = (Evaluation::new(&topology), states.clone());
        evaluation.initial = vec![1.0, 2.0, -1.0, 5.0];
        let batch = Batch { epoch: 0, update: 1, runs: &[Run::new(2, 10), Run::new(0, 10)], terms: 20.0 };
        rule.begin_epoch(&states);
        rule.ascend(&batch, &evaluation, &mut network.parameters, &mut states);
        rule.end_epoch(&mut states);
        let moved = |s: usize| [0, 1].map(|i| states.sequence(s)[i] - before.sequence(s)[i]);
        // The first step of Adam is as long as the rate, three times that of the weights, whatever the gradient.
        for (sequence, expected) in [(0, [-0.3, 0.3]), (1, [0.0, 0.0]), (2, [0.3, 0.3])] {
            for (moved, expected) in moved(sequence).into_iter().zip(expected) {
                assert!((moved - expected).abs() < 1e-6, "{sequence}: {moved} instead of {expected}");
            }
        }
    }

    #[test]
    fn the_rate_rises_and_falls_on_its_schedule() {
        let topology = Topology::s_ctrnn(1, 2, 2.0).unwrap();
        let states = InitialStates::zeros(&topology, 1);
        let adam = Adam { rate: 2.0, warm_up: 0.1, final_rate: 0.5, ..Adam::default() };
        let rule = AdamRule::new(adam, &topology, &states, 10.0, 1.0, 100);
        assert_eq!((rule.rate(0), rule.rate(9), rule.rate(10)), (0.2, 2.0, 2.0));
        assert!((rule.rate(55) - 1.25).abs() < 1e-12);
        assert!((rule.rate(100) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_first_update_is_one_rate_long() {
        let mut moments = Moments::new(3);
        let mut values = [0.0; 3];
        moments.ascend(&Adam::default(), 1, 0.1, &[5.0, -1e-3, 0.0], &mut values);
        assert!((values[0] - 0.1).abs() < 1e-6 && (values[1] + 0.1).abs() < 1e-5 && values[2] == 0.0);
    }
}
