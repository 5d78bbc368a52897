//! Resets a training that became unstable to its best network, and halves its rate.
//!
//! A rate that is too large shows in two ways: values become non-finite, or the likelihood collapses while all values stay
//! finite, and the network needs thousands of epochs, or all the rest, to recover. Both count.
//!
//! The epochs go on counting, so that a training ends when its plan says; the optimiser's memory goes back with the network. All
//! that the guard knows is part of the optimiser's state in a checkpoint.

use super::divergence::Divergence;
use super::learner::State;
use super::state::{OptimiserState, StateTensor};
use crate::error::{Error, Result};
use crate::parameters::Parameters;

/// After so many recoveries, at a millionth of the rate, it is not the rate that is wrong.
pub(super) const MOST: u64 = 20;

/// Nats per step and channel by which the nll may rise above its best: e^10 = 22 000 times less likely a sample.
pub(super) const LARGEST_RISE: f64 = 10.0;

/// Each recovery goes on at this share of the rate.
const SLOWER: f64 = 0.5;

/// How a training was reset to its best network.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovery {
    /// What went wrong; `rolled_back_to` is the epoch of the best network, where the training goes on from.
    pub divergence: Divergence,
    /// Recoveries so far, this one included.
    pub number: u64,
    /// The rate's factor from now on.
    pub rate_factor: f64,
}

/// What the guard remembers.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    /// The best state so far.
    pub safe: State,
    /// Its ln L_out.
    pub ln_likelihood: f64,
    /// How often it was needed.
    pub recoveries: u64,
}

/// Names of the guard's tensors and numbers begin with it.
const PREFIX: &str = "guard.";
const PARAMETERS: &str = "guard.parameters";
const INITIAL: &str = "guard.initial_states";
const MEAN: &str = "guard.initial_state_mean";
const RECOVERIES: &str = "guard.recoveries";
const EPOCH: &str = "guard.epoch";
const LN_LIKELIHOOD: &str = "guard.ln_likelihood";

impl Guard {
    /// A guard of a training that is about to begin.
    pub fn new(state: &State) -> Self {
        Self { safe: state.clone(), ln_likelihood: f64::NEG_INFINITY, recoveries: 0 }
    }

    /// The rate's factor.
    pub fn rate_factor(&self) -> f64 {
        SLOWER.powi(self.recoveries.min(MOST) as i32)
    }

    /// By how much the nll rose above its best, where that is too much. `terms` are the steps times the channels.
    pub fn rise(&self, ln_likelihood: f64, terms: f64) -> Option<f64> {
        let rise = (self.ln_likelihood - ln_likelihood) / terms;
        (rise > LARGEST_RISE && rise.is_finite()).then_some(rise)
    }

    /// Keeps a state that is better than all before; allocates nothing.
    pub fn compare(&mut self, state: &State, ln_likelihood: f64) {
        if ln_likelihood > self.ln_likelihood {
            self.safe.copy_from(state);
            self.ln_likelihood = ln_likelihood;
        }
    }

    /// Adds what the guard remembers to an optimiser's state.
    pub fn save(&self, state: &mut OptimiserState) {
        let State { network, initial_states, rule, epoch } = &self.safe;
        let own = rule.clone().fields().save();
        let guarded = |name: &str| format!("{PREFIX}{name}");
        state
            .tensors
            .extend(own.tensors.into_iter().map(|tensor| StateTensor { name: guarded(&tensor.name), ..tensor }));
        state.numbers.extend(own.numbers.into_iter().map(|(name, value)| (guarded(&name), value)));
        let units = initial_states.mean().len();
        let parameters = network.parameters.as_slice();
        for (name, shape, values) in [
            (PARAMETERS, vec![parameters.len()], parameters),
            (INITIAL, vec![initial_states.sequences(), units], initial_states.values()),
            (MEAN, vec![units], initial_states.mean()),
        ] {
            state.tensors.push(StateTensor { name: name.to_owned(), shape, values: values.to_vec() });
        }
        // Counts stay far below 2^53.
        for (name, value) in
            [(RECOVERIES, self.recoveries as f64), (EPOCH, *epoch as f64), (LN_LIKELIHOOD, self.ln_likelihood)]
        {
            state.numbers.push((name.to_owned(), value));
        }
    }

    /// Takes it out again. A state without a guard, from a training that had none, leaves the guard as new.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if a part is missing, or of another size.
    pub fn load(&mut self, state: &OptimiserState) -> Result<()> {
        let number = |name: &str| state.numbers.iter().find(|(other, _)| other == name).map(|(_, value)| *value);
        let Some(recoveries) = number(RECOVERIES) else { return Ok(()) };
        let missing = |name: &str| Error::Checkpoint(format!("the optimiser's {name} is missing"));
        let bare = |name: &str| name.strip_prefix(PREFIX).map(str::to_owned);
        let tensors =
            state.tensors.iter().filter_map(|tensor| Some(StateTensor { name: bare(&tensor.name)?, ..tensor.clone() }));
        let numbers = state.numbers.iter().filter_map(|(name, value)| Some((bare(name)?, *value)));
        self.safe.rule.fields().load(&OptimiserState { tensors: tensors.collect(), numbers: numbers.collect() })?;
        let take = |name: &str, values: &mut [f64]| {
            let tensor = state.tensors.iter().find(|tensor| tensor.name == name).ok_or_else(|| missing(name))?;
            if tensor.values.len() != values.len() {
                let (found, needed) = (tensor.values.len(), values.len());
                return Err(Error::Checkpoint(format!("optimiser.{name} holds {found} values; needed: {needed}")));
            }
            values.copy_from_slice(&tensor.values);
            Ok(())
        };
        take(PARAMETERS, Parameters::as_mut_slice(&mut self.safe.network.parameters))?;
        take(INITIAL, self.safe.initial_states.values_mut())?;
        take(MEAN, self.safe.initial_states.mean_mut())?;
        self.recoveries = recoveries as u64;
        self.safe.epoch = number(EPOCH).ok_or_else(|| missing(EPOCH))? as u64;
        self.ln_likelihood = number(LN_LIKELIHOOD).ok_or_else(|| missing(LN_LIKELIHOOD))?;
        Ok(())
    }
}
