//! The sequences of a training, in the batches that its updates learn from.
//!
//! Sequences are dealt once, at random and always alike; every epoch takes the batches in a new order, which depends on
//! the epoch's number alone. So a training that goes on from a checkpoint needs to know no more than its epoch.
//!
//! With one batch an epoch is: evaluate everything, report, update. With several, each batch is evaluated with the
//! parameters after the batch before it, and an epoch reports the sum: each term belongs to other parameters. Only before
//! the first update and after the last are all sequences evaluated with the same parameters.

use std::ops::Range;

use rand::RngExt;
use rand::seq::SliceRandom;

use super::adam::{self, AdamRule};
use super::plan::ClosedLoop;
use super::state::Fields;
use super::state::{OptimiserState, StateTensor};
use crate::dataset::Dataset;
use crate::error::Result;
use crate::initial_states::InitialStates;
use crate::objective::{Evaluation, Objective, Release, Run, Want};
use crate::parameters::{Gradients, Parameters};
use crate::streams::{Purpose, stream};
use crate::topology::Topology;

/// All sequences. Batches are parts of one list: there is one objective, and room for the largest of them.
#[derive(Debug)]
pub(super) struct Batches {
    objective: Box<dyn Objective>,
    /// The evaluation of the last batch.
    evaluation: Evaluation,
    /// One run through each sequence, in their order.
    runs: Vec<Run>,
    /// The same in the order in which they are dealt; each batch is a part of this list.
    dealt: Vec<Run>,
    /// Where each batch ends in `dealt`.
    ends: Vec<usize>,
    /// In which order this epoch takes the batches.
    order: Vec<usize>,
    /// u_0 of one batch, [run][unit].
    initial: Vec<f64>,
    /// T N_O of each sequence, less what is missing.
    targets: Vec<usize>,
    delay: usize,
    closed_loop: Option<ClosedLoop>,
    /// Which sequences an epoch releases: scratch.
    shuffled: Vec<usize>,
    /// The gradient of all batches together.
    total: Vec<f64>,
    /// ln L_out of each sequence, as last evaluated.
    pub ln_likelihoods: Vec<f64>,
    squared_errors: Vec<f64>,
    /// Length of the last gradient in the shared parameters, per step and channel: of all, or of the last batch.
    pub gradient_norm: f64,
    /// A gradient that is not finite.
    broken: Option<Gradients>,
}

const LN_LIKELIHOODS: &str = "batches.ln_likelihood";
const SQUARED_ERRORS: &str = "batches.squared_error";
const GRADIENT_NORM: &str = "batches.gradient_norm";

/// Steps times channels, less what is missing.
fn terms(runs: &[Run], targets: &[usize]) -> f64 {
    runs.iter().map(|run| targets[run.sequence]).sum::<usize>() as f64
}

impl Batches {
    /// Deals the sequences, through each of which there is a run, into batches of `size` at most, none of which differs from another
    /// by more than one.
    pub fn new(objective: Box<dyn Objective>, topology: &Topology, data: &Dataset, size: usize) -> Self {
        let runs = Run::through_all(data, topology.delay());
        let count = runs.len();
        let targets = |run: &Run| data.sequences()[run.sequence].targets(topology.delay(), run.steps);
        let mut batches = Self {
            objective,
            evaluation: Evaluation::new(topology),
            targets: runs.iter().map(targets).collect(),
            dealt: runs.clone(),
            runs,
            ends: Vec::new(),
            order: Vec::new(),
            initial: Vec::new(),

            delay: topology.delay(),
            closed_loop: None,
            shuffled: Vec::new(),
            total: Parameters::zeros(topology).as_slice().to_vec(),
            ln_likelihoods: vec![0.0; count],
            squared_errors: vec![0.0; count],
            gradient_norm: 0.0,
            broken: None,
        };
        batches.deal(size);
        batches
    }

    /// Deals them anew.
    pub fn deal(&mut self, size: usize) {
        let sequences = self.runs.len();
        let count = sequences.div_ceil(size.max(1)).max(1);
        self.dealt.clone_from(&self.runs);
        self.ends.clear();
        self.ends.push(sequences);
        if count > 1 {
            let mut shuffled: Vec<usize> = (0..sequences).collect();
            shuffled.shuffle(&mut stream(0, Purpose::BatchMembers, 0));
            (self.dealt, self.ends) = (Vec::with_capacity(sequences), Vec::with_capacity(count));
            for index in 0..count {
                let start = self.dealt.len();
                self.dealt.extend(shuffled.iter().skip(index).step_by(count).map(|&sequence| self.runs[sequence]));
                self.dealt[start..].sort_unstable_by_key(|run| run.sequence);
                self.ends.push(self.dealt.len());
            }
        }
        self.order.clear();
        self.order.extend(0..count);
    }

    /// Learns in the closed loop as well; with `None`, no more.
    pub fn close_loop(&mut self, closed_loop: Option<ClosedLoop>) {
        self.closed_loop = closed_loop;
    }

    /// Chooses which sequences an epoch releases and where, the same for the same epoch; without one all are taught.
    pub fn release(&mut self, epoch: Option<u64>) {
        self.dealt.iter_mut().for_each(|run| run.release = None);
        let (Some(options), Some(epoch)) = (&self.closed_loop, epoch) else { return };
        let mut random = stream(0, Purpose::ClosedLoopStarts, epoch);
        let count = self.dealt.len();
        self.shuffled.clear();
        self.shuffled.extend(0..count);
        self.shuffled.shuffle(&mut random);
        // Half of an odd number is rounded now up, now down.
        let taught = (options.taught * count as f64 + random.random::<f64>()).floor() as usize;
        for &index in self.shuffled.iter().skip(taught.min(count)) {
            let run = &mut self.dealt[index];
            let share = options.earliest + (options.latest - options.earliest) * random.random::<f64>();
            let step = ((share * run.steps as f64).round() as usize).max(self.delay);
            *run = run.released(Release::new(step, random.random()));
        }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// Where batch `index` lies in the list of runs.
    fn part(&self, index: usize) -> Range<usize> {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[index]
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
    pub fn non_finite_sequence(&self) -> Option<usize> {
        (0..self.ln_likelihoods.len()).find(|&sequence| !self.has_numbers(sequence))
    }

    fn has_numbers(&self, sequence: usize) -> bool {
        self.ln_likelihoods[sequence].is_finite() && self.squared_errors[sequence].is_finite()
    }

    /// The gradient that is not finite.
    pub fn non_finite_gradient(&self) -> Option<&Gradients> {
        self.broken.as_ref()
    }

    /// The gradients in shared parameters and in initial states, where all sequences are in one batch.
    pub fn gradient_of_all(&self) -> (&Gradients, &[f64]) {
        assert!(self.count() == 1, "only one batch has the gradient of all sequences");
        (&self.evaluation.gradients, &self.evaluation.initial)
    }

    /// Names the arithmetic.
    pub fn numerics(&self) -> &str {
        self.objective.numerics()
    }

    /// Evaluates all sequences at the same parameters.
    pub fn evaluate(&mut self, parameters: &Parameters, states: &InitialStates) {
        self.broken = None;
        self.total.fill(0.0);
        for index in 0..self.count() {
            self.evaluate_batch(index, parameters, states);
            self.total.iter_mut().zip(self.evaluation.gradients.as_slice()).for_each(|(sum, g)| *sum += g);
        }
        self.gradient_norm = norm(&self.total) / terms(&self.runs, &self.targets);
    }

    /// Makes an epoch's updates. Whether their values stand for the epoch that follows: where there is one batch, they are those
    /// of the epoch before.
    pub fn ascend(&mut self, rule: &mut AdamRule, epoch: u64, state: (&mut Parameters, &mut InitialStates)) -> bool {
        let (parameters, states) = state;
        let count = self.count();
        if count > 1 {
            self.order.sort_unstable();
            self.order.shuffle(&mut stream(0, Purpose::BatchOrder, epoch));
            self.release(Some(epoch));
        }
        rule.begin_epoch(states);
        for nth in 0..count {
            let index = self.order[nth];
            if count > 1 {
                rule.place(&self.dealt[self.part(index)], states);
                if !self.evaluate_batch(index, parameters, states) {
                    break;
                }
            }
            let runs = &self.dealt[self.part(index)];
            let update = epoch * count as u64 + nth as u64 + 1;
            let batch = adam::Batch { epoch, update, runs, terms: terms(runs, &self.targets) };
            rule.ascend(&batch, &self.evaluation, parameters, states);
        }
        rule.end_epoch(states);
        if count > 1 {
            let runs = &self.dealt[self.part(self.order[count - 1])];
            self.gradient_norm = norm(self.evaluation.gradients.as_slice()) / terms(runs, &self.targets);
        }
        count > 1
    }

    /// Whether all values are finite.
    fn evaluate_batch(&mut self, index: usize, parameters: &Parameters, states: &InitialStates) -> bool {
        let part = self.part(index);
        let runs = &self.dealt[part.clone()];
        self.initial.clear();
        for run in runs {
            self.initial.extend_from_slice(states.sequence(run.sequence));
        }
        self.objective.set_parameters(parameters);
        self.objective.evaluate(runs, &self.initial, Want::Everything, &mut self.evaluation);
        for (own, run) in runs.iter().enumerate() {
            self.ln_likelihoods[run.sequence] = self.evaluation.ln_likelihood[own];
            self.squared_errors[run.sequence] = self.evaluation.squared_error[own];
        }
        let Evaluation { gradients, initial, .. } = &self.evaluation;
        let is_broken = !gradients.as_slice().iter().chain(initial).all(|g| g.is_finite());
        if is_broken {
            self.broken = Some(gradients.clone());
        }
        !is_broken && self.dealt[part].iter().all(|run| self.has_numbers(run.sequence))
    }

    /// Adds what a report needs to an optimiser's state; nothing where one evaluation finds it again.
    pub fn save(&self, state: &mut OptimiserState) {
        if self.count() > 1 {
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
        if self.count() == 1 || !state.numbers.iter().any(|(name, _)| name == GRADIENT_NORM) {
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

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|g| g * g).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::plan::Adam;
    use super::*;
    use crate::dataset::{Dataset, Sequence};
    use crate::engine::Engine;
    use crate::initialization::initialize;
    use crate::objective::{Backend, Request};

    /// Sequences of 9, 10, 11 ... samples of one channel.
    fn samples(count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|s| (0..9 + s).map(|t| 0.5 * (0.4 * t as f64 + s as f64).sin()).collect()).collect()
    }

    fn of(samples: &[Vec<f64>], size: usize, topology: &Topology) -> Batches {
        let sequences = samples.iter().map(|own| Sequence::new("", 1, own.clone()).unwrap()).collect();
        let data = Dataset::new(vec!["y".into()], sequences).unwrap();
        let objective = Engine::serial().objective(&Request::new(topology, &data)).unwrap();
        Batches::new(objective, topology, &data, size)
    }

    #[test]
    fn each_sequence_is_dealt_once_into_batches_of_one_size() {
        let topology = Topology::s_ctrnn(1, 3, 2.0).unwrap();
        for (count, size, expected) in [(7, 3, 3), (7, 7, 1), (7, 100, 1), (7, 1, 7), (12, 5, 3), (144, 12, 12)] {
            let batches = of(&samples(count), size, &topology);
            assert_eq!(batches.count(), expected);
            let parts: Vec<&[Run]> = (0..expected).map(|index| &batches.dealt[batches.part(index)]).collect();
            let sizes: Vec<usize> = parts.iter().map(|part| part.len()).collect();
            let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
            assert!(*most <= size && most - least <= 1, "{sizes:?}");
            let mut dealt: Vec<usize> = parts.iter().flat_map(|part| part.iter().map(|run| run.sequence)).collect();
            dealt.sort_unstable();
            assert_eq!(dealt, (0..count).collect::<Vec<_>>());
            // 8 steps of the first sequence, 9 of the second, ...
            let terms: f64 = parts.iter().map(|part| terms(part, &batches.targets)).sum();
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
        some.total.iter().zip(gradients.as_slice()).for_each(|(some, all)| near(*some, *all));
        for index in 0..some.count() {
            assert!(some.evaluate_batch(index, &network.parameters, &states));
            for (own, run) in some.evaluation.initial.chunks(5).zip(&some.dealt[some.part(index)]) {
                own.iter().zip(&initial[run.sequence * 5..]).for_each(|(a, b)| near(*a, *b));
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
            let total = samples.iter().map(|own| (own.len() - 1) as f64).sum();
            let rule = || AdamRule::new(Adam::default(), &topology, &start.1, total, 1.0, 10);
            let mut batches = of(&samples, 2, &topology);
            assert!(batches.ascend(&mut rule(), epoch, (&mut network.parameters, &mut states)));
            let order = batches.order.clone();

            // The same by hand.
            let (mut by_hand, mut own_states) = start.clone();
            let (mut rule, mut met) = (rule(), vec![f64::NAN; 7]);
            let mut single = of(&samples, 2, &topology);
            rule.begin_epoch(&own_states);
            for (nth, &index) in order.iter().enumerate() {
                rule.end_epoch(&mut own_states);
                single.evaluate_batch(index, &by_hand.parameters, &own_states);
                let runs = &single.dealt[single.part(index)];
                for run in runs {
                    assert!(met[run.sequence].is_nan());
                    met[run.sequence] = single.ln_likelihoods[run.sequence];
                }
                let batch = adam::Batch {
                    epoch,
                    update: 4 * epoch + nth as u64 + 1,
                    runs,
                    terms: terms(runs, &single.targets),
                };
                rule.ascend(&batch, &single.evaluation, &mut by_hand.parameters, &mut own_states);
            }
            rule.end_epoch(&mut own_states);
            assert_eq!((&network, &states), (&by_hand, &own_states));
            assert_eq!(batches.ln_likelihoods, met);
            assert_ne!(network, start.0);
            orders.push(order);
        }
        assert!(orders[0] != orders[1] || orders[1] != orders[2], "{orders:?}");
    }
}
