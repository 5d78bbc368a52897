//! The loop of learning: evaluate, report, ascend.

use super::adam::AdamRule;
use super::batches::Batches;
use super::divergence::Divergence;
use super::guard::{self, Guard, Recovery};
use super::lbfgs::LbfgsRule;
use super::momentum::MomentumRule;
use super::plan::{OnDivergence, Optimiser, Plan};
use super::state::Fields;
use super::state::OptimiserState;
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::initial_states::InitialStates;
use crate::network::Network;
use crate::objective::{Backend, ClosedLoopTerm, Request};
use std::ops::ControlFlow;

/// What the evaluation of an epoch found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct EpochReport {
    /// Epochs done so far; 0 is the initial network.
    pub epoch: u64,
    /// ln L_out in nats over all sequences (2.11); without variance units -E (A.22). In batches, each was evaluated at the parameters
    /// that it met, but for the first report and the last. Where a part is learned in the closed loop, its terms are in it with their
    /// weight, but for the last report; so they are in `nll`.
    pub ln_likelihood: f64,
    /// -ln L_out in nats per step and channel that is not missing, in the network's units; none without variance units.
    pub nll: Option<f64>,
    /// Squared error per step and channel, in the network's units.
    pub mse: f64,
    /// ln L_init in nats (2.16).
    pub ln_prior: f64,
    /// The rate for shared parameters; in L-BFGS, the length of the last step, 1 before the first.
    pub rate_shared: f64,
    /// The rate for initial states; in L-BFGS the same.
    pub rate_initial: f64,
    /// Length of the gradient of ln L_out per step and channel in the shared parameters; in batches, of the last one.
    pub gradient_norm: f64,
    /// How often the training was reset to its best network so far.
    pub recoveries: u64,
    /// Whether all tries of the adaptive rate (D.1) failed: the update was withdrawn, and the network is that of the epoch before. The
    /// next one tries at the rate that is left. (`false` in the first report after a training was taken up again.)
    pub withdrawn: bool,
}

/// Watches a training, and can stop it.
pub trait Observer {
    /// Called before each epoch, and after the last: a run of N epochs makes N + 1 calls. `learner` holds what was evaluated (in
    /// batches, the parameters after it): saved here and restored later, a training goes on bit for bit.
    fn epoch(&mut self, report: &EpochReport, learner: &Learner) -> ControlFlow<()>;

    /// Called when a training became unstable and was reset to its best network, before it goes on.
    fn recovered(&mut self, _recovery: &Recovery) {}
}

impl<F: FnMut(&EpochReport, &Learner) -> ControlFlow<()>> Observer for F {
    fn epoch(&mut self, report: &EpochReport, learner: &Learner) -> ControlFlow<()> {
        self(report, learner)
    }
}

/// How a training ended. Divergence is an outcome and no error. A caller that ignores it may use a network that never learned.
#[must_use = "a training may have diverged or been stopped"]
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// All epochs are done.
    Finished,
    /// The observer stopped it.
    Stopped,
    /// A value was not finite, or the training became unstable too often. The learner is back at the last good state.
    Diverged(Divergence),
}

#[derive(Debug, Clone)]
pub(super) enum Rule {
    Momentum(MomentumRule),
    Adam(AdamRule),
}

impl Rule {
    pub fn fields(&mut self) -> Fields<'_> {
        match self {
            Self::Momentum(rule) => rule.fields(),
            Self::Adam(rule) => rule.fields(),
        }
    }

    /// Multiplies all rates, in place of what the guard said before.
    fn slow_down(&mut self, factor: f64) {
        match self {
            Self::Momentum(rule) => rule.guarded = factor,
            Self::Adam(rule) => rule.guarded = factor,
        }
    }
}

/// The part of a learner that an update changes.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub network: Network,
    pub initial_states: InitialStates,
    pub rule: Rule,
    pub epoch: u64,
}

impl State {
    /// Takes over another state of the same training; allocates nothing.
    pub fn copy_from(&mut self, other: &Self) {
        self.network.parameters.as_mut_slice().copy_from_slice(other.network.parameters.as_slice());
        self.initial_states.values_mut().copy_from_slice(other.initial_states.values());
        self.initial_states.mean_mut().copy_from_slice(other.initial_states.mean());
        match (&mut self.rule, &other.rule) {
            (Rule::Momentum(rule), Rule::Momentum(other)) => rule.copy_from(other),
            (Rule::Adam(rule), Rule::Adam(other)) => rule.copy_from(other),
            _ => unreachable!("a training keeps its optimiser"),
        }
        self.epoch = other.epoch;
    }
}

/// A network in training on a data set.
#[derive(Debug)]
pub struct Learner {
    state: State,
    last_good: State,
    guard: Option<Guard>,
    plan: Plan,
    data: Dataset,
    terms: f64,
    batches: Batches,
    /// The rule of the last epochs. It never needs a reset, so it is no part of the state.
    lbfgs: Option<LbfgsRule>,
    /// Whether `batches` already holds what the next report says.
    evaluated: bool,
    /// Whether the last update was withdrawn for good.
    withdrawn: bool,
}

impl Learner {
    /// A learner at epoch 0. `data` must be in the network's units; its samples are shared, not copied. `backend`, an
    /// [`Engine`](crate::engine::Engine) unless there is another, computes.
    ///
    /// # Errors
    /// A plan out of range, data that do not fit the network, initial states for another number of sequences or of units, or what the
    /// backend cannot compute.
    pub fn new(
        network: Network,
        mut initial_states: InitialStates,
        data: &Dataset,
        plan: Plan,
        backend: &dyn Backend,
    ) -> Result<Self> {
        plan.check()?;
        let topology = &network.topology;
        data.check_for(topology)?;
        let sequences = data.sequences().len();
        if initial_states.sequences() != sequences {
            let what = "the list of initial states".to_owned();
            return Err(Error::Length { what, found: initial_states.sequences(), needed: sequences });
        }
        let (units, needed) = (initial_states.mean().len(), topology.context_units());
        if units != needed {
            return Err(Error::Length { what: "each initial state".to_owned(), found: units, needed });
        }
        let delay = topology.delay();
        let terms = data.total_targets(delay) as f64;
        if terms == 0.0 {
            return Err(Error::Setting {
                what: "number of values that can be learned",
                found: "0: all are missing".to_owned(),
                needed: "at least 1",
            });
        }
        let variance = plan.initial_state_variance;
        let first = plan.epochs_of_optimiser();
        let rule = match &plan.optimiser {
            Optimiser::Momentum(options) => {
                Rule::Momentum(MomentumRule::new(options.clone(), topology, &initial_states, terms, variance))
            }
            Optimiser::Adam(options) => {
                let options = options.clone();
                Rule::Adam(AdamRule::new(options, topology, &initial_states, terms, variance, first))
            }
        };
        let batch_size = match &plan.optimiser {
            Optimiser::Adam(adam) if adam.batch_size > 0 => adam.batch_size,
            _ => sequences,
        };
        let mut request = Request::new(topology, data);
        request.recompute = plan.recompute;
        request.precision = plan.precision;
        request.closed_loop = plan.closed_loop.as_ref().map(|it| ClosedLoopTerm::new(it.copies, it.weight));
        let objective = backend.objective(&request)?;
        let mut batches = Batches::new(objective, topology, data, batch_size);
        batches.close_loop(plan.closed_loop.clone());
        if plan.lbfgs.is_some() && batches.count() > 1 {
            // A first pass of all at once takes the memory, so that no epoch does.
            batches.deal(sequences);
            batches.evaluate(&network.parameters, &initial_states);
            batches.deal(batch_size);
        }
        let lbfgs = plan.lbfgs.as_ref().map(|options| LbfgsRule::new(options, topology, sequences, terms, variance));
        if variance == 0.0 {
            initial_states.share(topology);
        }
        let state = State { network, initial_states, rule, epoch: 0 };
        let guard = (plan.on_divergence == OnDivergence::Recover).then(|| Guard::new(&state));
        let last_good = state.clone();
        Ok(Self {
            last_good,
            state,
            guard,
            plan,
            data: data.clone(),
            terms,
            batches,
            lbfgs,
            evaluated: false,
            withdrawn: false,
        })
    }

    /// Goes on where a checkpoint stands, as if the training had never stopped: to the same bits, for the same data, plan and
    /// backend.
    ///
    /// # Errors
    /// As [`Learner::new`]; [`Error::Checkpoint`] if the checkpoint is of another optimiser.
    #[cfg(feature = "checkpoint")]
    pub fn resume(
        checkpoint: &crate::checkpoint::Checkpoint,
        data: &Dataset,
        plan: Plan,
        backend: &dyn Backend,
    ) -> Result<Self> {
        let network = Network::new(checkpoint.topology.clone(), checkpoint.parameters.clone())?;
        let mut learner = Self::new(network, checkpoint.initial_states.clone(), data, plan, backend)?;
        learner.restore(checkpoint.epoch, &checkpoint.optimiser)?;
        Ok(learner)
    }

    /// Goes on from a checkpoint, of which `new` got the network and the initial states.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if the state is of another optimiser or of other sizes.
    pub fn restore(&mut self, epoch: u64, state: &OptimiserState) -> Result<()> {
        self.state.rule.fields().load(state)?;
        self.state.epoch = epoch;
        if let Some(guard) = &mut self.guard {
            guard.safe.copy_from(&self.state);
            guard.load(state)?;
            self.state.rule.slow_down(guard.rate_factor());
        }
        self.take_whole();
        self.evaluated = self.batches.load(state)?;
        if self.has_refined()
            && let Some(lbfgs) = &mut self.lbfgs
        {
            lbfgs.load(state)?;
        }
        Ok(())
    }

    /// The network as it is.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.state.network
    }

    /// The initial states as they are.
    #[must_use]
    pub fn initial_states(&self) -> &InitialStates {
        &self.state.initial_states
    }

    /// Epochs done so far.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.state.epoch
    }

    /// How often the training was reset to its best network.
    #[must_use]
    pub fn recoveries(&self) -> u64 {
        self.guard.as_ref().map_or(0, |guard| guard.recoveries)
    }

    /// Names the arithmetic that computes: a training goes on bit for bit only where it is the same.
    #[must_use]
    pub fn numerics(&self) -> &str {
        self.batches.numerics()
    }

    /// The optimiser's memory.
    #[must_use]
    pub fn optimiser_state(&self) -> OptimiserState {
        let mut state = self.state.rule.clone().fields().save();
        if let Some(guard) = &self.guard {
            guard.save(&mut state);
        }
        if self.evaluated {
            self.batches.save(&mut state);
        }
        if let Some(lbfgs) = self.lbfgs.as_ref().filter(|_| self.has_refined()) {
            lbfgs.save(&mut state);
        }
        state
    }

    /// Whether the next update is one of L-BFGS.
    fn refines(&self) -> bool {
        self.lbfgs.is_some() && self.state.epoch >= self.plan.epochs_of_optimiser()
    }

    /// Whether the last update was.
    fn has_refined(&self) -> bool {
        self.lbfgs.is_some() && self.state.epoch > self.plan.epochs_of_optimiser()
    }

    /// Learns to the end of the plan, or until the observer stops it.
    pub fn run(&mut self, observer: &mut dyn Observer) -> Outcome {
        self.last_good.copy_from(&self.state);
        loop {
            self.take_whole();
            self.evaluate();
            if let Some(divergence) = self.divergence() {
                if let Some(recovery) = self.recover(&divergence) {
                    observer.recovered(&recovery);
                    continue;
                }
                self.state.copy_from(self.guard.as_ref().map_or(&self.last_good, |guard| &guard.safe));
                self.evaluated = false;
                return Outcome::Diverged(divergence);
            }
            self.last_good.copy_from(&self.state);
            if let Some(guard) = &mut self.guard {
                guard.compare(&self.state, self.batches.ln_likelihood());
            }
            let control = observer.epoch(&self.report(), self);
            if self.state.epoch >= self.plan.epochs {
                return Outcome::Finished;
            }
            if control.is_break() {
                return Outcome::Stopped;
            }
            self.update();
            self.state.epoch += 1;
        }
    }

    /// Puts all sequences into one batch where L-BFGS begins.
    fn take_whole(&mut self) {
        if self.refines() && self.batches.count() > 1 {
            self.batches.deal(self.data.sequences().len());
            self.evaluated = false;
        }
    }

    fn evaluate(&mut self) {
        if !self.evaluated {
            // What an update climbs is evaluated with its closed loops, what is only reported without.
            let climbs = self.batches.count() == 1 && !self.refines() && self.state.epoch < self.plan.epochs;
            self.batches.release(climbs.then_some(self.state.epoch));
            self.batches.evaluate(&self.state.network.parameters, &self.state.initial_states);
            self.evaluated = true;
        }
    }

    /// Goes back to the best state at a lower rate, unless that was done too often.
    fn recover(&mut self, divergence: &Divergence) -> Option<Recovery> {
        let guard =
            self.guard.as_mut().filter(|guard| guard.recoveries < guard::MOST && guard.ln_likelihood.is_finite())?;
        guard.recoveries += 1;
        let epoch = self.state.epoch;
        self.state.copy_from(&guard.safe);
        self.state.epoch = epoch;
        self.state.rule.slow_down(guard.rate_factor());
        self.evaluated = false;
        Some(Recovery { divergence: divergence.clone(), number: guard.recoveries, rate_factor: guard.rate_factor() })
    }

    fn divergence(&self) -> Option<Divergence> {
        let State { network, initial_states, epoch, .. } = &self.state;
        let mut divergence = if let Some(s) = self.batches.non_finite_sequence() {
            Divergence::in_sequence(*epoch, network, initial_states, &self.data, s)
        } else if let Some(gradients) = self.batches.non_finite_gradient() {
            Divergence::in_gradient(*epoch, gradients)
        } else {
            Divergence::of_likelihood(*epoch, self.least_likely(), self.rise()?)
        };
        divergence.rolled_back_to = self.guard.as_ref().map_or(self.last_good.epoch, |guard| guard.safe.epoch);
        Some(divergence)
    }

    /// How far the nll rose above its best, where the guard objects to it. Closed loops, of which each epoch has others, may be off by
    /// any amount in one of them: there it does not.
    fn rise(&self) -> Option<f64> {
        if self.plan.closed_loop.is_some() {
            return None;
        }
        self.guard.as_ref()?.rise(self.batches.ln_likelihood(), self.terms)
    }

    /// The sequence of the lowest likelihood a step.
    fn least_likely(&self) -> usize {
        let delay = self.state.network.topology.delay();
        let steps = self.data.sequences().iter().map(|own| own.targets(delay, own.len() - delay).max(1) as f64);
        let each = self.batches.ln_likelihoods.iter().zip(steps).map(|(ln_likelihood, steps)| ln_likelihood / steps);
        each.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(s, _)| s)
    }

    fn report(&self) -> EpochReport {
        let topology = &self.state.network.topology;
        let ln_likelihood = self.batches.ln_likelihood();
        let (rate_shared, rate_initial) = match (&self.lbfgs, &self.state.rule) {
            (Some(lbfgs), _) if self.refines() => (lbfgs.step, lbfgs.step),
            (_, Rule::Momentum(rule)) => rule.rates(),
            (_, Rule::Adam(rule)) => rule.rates(self.state.epoch),
        };
        EpochReport {
            epoch: self.state.epoch,
            ln_likelihood,
            nll: topology.has_variance().then_some(-ln_likelihood / self.terms),
            mse: self.batches.squared_error() / self.terms,
            ln_prior: self.state.initial_states.ln_prior(topology, self.plan.initial_state_variance),
            rate_shared,
            rate_initial,
            gradient_norm: self.batches.gradient_norm,
            recoveries: self.recoveries(),
            withdrawn: self.withdrawn,
        }
    }

    fn update(&mut self) {
        let refines = self.refines();
        let State { network, initial_states, rule, epoch } = &mut self.state;
        (self.evaluated, self.withdrawn) = (false, false);
        if let Some(lbfgs) = self.lbfgs.as_mut().filter(|_| refines) {
            self.evaluated = lbfgs.ascend(&mut self.batches, &mut network.parameters, initial_states);
            return;
        }
        match rule {
            Rule::Adam(rule) => {
                let last = *epoch + 1 == self.plan.epochs_of_optimiser();
                let state = (&mut network.parameters, initial_states);
                // After several updates the values that they began from stand for the epoch, but for the last.
                self.evaluated = self.batches.ascend(rule, *epoch, state) && !last;
            }
            Rule::Momentum(rule) => {
                let (gradients, initial) = self.batches.gradient_of_all();
                rule.accumulate(&network.topology, gradients, initial, initial_states);
                rule.apply(&mut network.parameters, initial_states);
                if rule.options.adaptive_rate.is_some() {
                    self.adapt();
                }
            }
        }
    }

    /// Accepts the tentative update, or withdraws it and tries a lower rate (D.1). Every try is judged; where the last one fails too,
    /// nothing moves in this epoch. The last good state holds the parameters before the update.
    fn adapt(&mut self) {
        let before = self.batches.squared_error();
        let Rule::Momentum(rule) = &self.state.rule else { return };
        let Some(options) = rule.options.adaptive_rate.clone() else { return };
        for tries_left in (0..options.max_tries).rev() {
            self.evaluated = false;
            self.evaluate();
            let ratio = self.batches.squared_error() / before;
            let State { network, initial_states, rule: Rule::Momentum(rule), .. } = &mut self.state else { return };
            if ratio <= options.max_error_ratio {
                if ratio < 1.0 {
                    rule.factor *= options.increase;
                }
                return;
            }
            rule.factor *= options.decrease;
            let good = &self.last_good;
            network.parameters.as_mut_slice().copy_from_slice(good.network.parameters.as_slice());
            initial_states.values_mut().copy_from_slice(good.initial_states.values());
            initial_states.mean_mut().copy_from_slice(good.initial_states.mean());
            if tries_left > 0 {
                rule.apply(&mut network.parameters, initial_states);
            }
        }
        (self.evaluated, self.withdrawn) = (false, true);
    }
}
