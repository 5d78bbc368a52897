//! The rest of a sequence as a distribution: several closed loops, from several states that explain its beginning.
//!
//! What is not known of the state is told by the ensemble of the search's starts. The states in which they ended are weighted by their joint
//! likelihood, and each loop begins from one of them:
//!
//! ```text
//! w_j = exp(ln L_all,j - max ln L_all) / sum        loop k of K: the state j at which the sum of weights passes (k + 1/2) / K
//! ```
//!
//! Starts that ended in one place count as one place more often, so that a broad basin weighs more than a narrow one of the same height.

use scrnn::engine::Engine;
use scrnn::recognition::{Recognition, Trial};

use crate::evaluation::{self, Member, Rest};
use crate::failure::{Failure, Result};

/// Refuses a beginning in which a network of this delay predicts nothing.
///
/// # Errors
/// [`Failure::Input`] with the least number of samples.
pub fn check_observed(observed: Option<usize>, delay: usize) -> Result<()> {
    let Some(observed) = observed.filter(|observed| *observed <= delay) else { return Ok(()) };
    let message = format!("--observed {observed} leaves nothing to predict: the network's delay is {delay}");
    Err(Failure::input(message, format!("observe at least {} samples", delay + 1)))
}

/// For each of `count` loops, the state that it begins from.
pub fn states(recognition: &Recognition, count: usize) -> Vec<&[f64]> {
    let chosen = chosen(&weights(&recognition.trials), count);
    chosen.into_iter().map(|at| recognition.trials[at].initial_state.as_slice()).collect()
}

/// For each of `count` loops, the number of its state.
fn chosen(weights: &[f64], count: usize) -> Vec<usize> {
    let (mut at, mut passed) = (0, weights.first().copied().unwrap_or(1.0));
    let mut chosen = Vec::with_capacity(count);
    for k in 0..count {
        let wanted = (k as f64 + 0.5) / count as f64;
        while passed < wanted && at + 1 < weights.len() {
            at += 1;
            passed += weights[at];
        }
        chosen.push(at);
    }
    chosen
}

/// How many states of the ensemble count: 1 where one is far more likely than all others.
pub fn effective_states(recognition: &Recognition) -> f64 {
    1.0 / weights(&recognition.trials).iter().map(|weight| weight * weight).sum::<f64>()
}

/// Of trials that are ordered by ln L_all, the best first.
fn weights(trials: &[Trial]) -> Vec<f64> {
    of_logarithms(&trials.iter().map(Trial::ln_joint).collect::<Vec<_>>())
}

/// Weights in proportion to what these are the logarithms of, the largest first.
fn of_logarithms(logarithms: &[f64]) -> Vec<f64> {
    let largest = logarithms.first().copied().unwrap_or(0.0);
    if !largest.is_finite() {
        // Not even the best is a number: it is all there is.
        return (0..logarithms.len()).map(|k| f64::from(u8::from(k == 0))).collect();
    }
    let weights: Vec<f64> = logarithms.iter().map(|ln| (ln - largest).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// What comes after the first `heard` samples of a sequence, `ahead` of them: `loops` closed loops in all, shared out evenly among the members,
/// each from a state that explains what was heard. `recognitions` holds one for each member.
///
/// # Errors
/// What the network cannot run on.
pub fn forecast(
    members: &[Member<'_>],
    recognitions: &[&Recognition],
    (samples, heard, ahead): (&[f64], usize, usize),
    (loops, seed): (usize, u64),
    engine: &Engine,
) -> Result<Rest> {
    let mut all = Vec::new();
    let mut first = 0;
    for (m, (member, recognition)) in members.iter().zip(recognitions).enumerate() {
        let topology = member.network.topology();
        let own = ((loops + members.len() - 1 - m) / members.len()).max(1);
        let part = (samples, heard, heard - topology.delay() + ahead);
        let seed = seed.wrapping_add(m as u64);
        all.extend(evaluation::alone(member.network, &states(recognition, own), part, seed, engine)?);
        first = (heard - topology.delay()) * topology.channels();
    }
    Ok(Rest::of(&all, first))
}

/// In words, for whoever gets the distribution.
pub const UNCERTAINTY: &str = "the ends of the search's starts, weighted by their joint likelihood";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_weigh_as_much_as_they_are_likely() {
        let half = -(2.0_f64.ln());
        assert_eq!(of_logarithms(&[0.0, half, half, f64::NEG_INFINITY]), [0.5, 0.25, 0.25, 0.0]);
        assert_eq!(of_logarithms(&[f64::NEG_INFINITY; 2]), [1.0, 0.0]);
        assert_eq!(of_logarithms(&[-5.0]), [1.0]);
    }

    #[test]
    fn loops_are_shared_out_by_weight() {
        assert_eq!(chosen(&[0.5, 0.25, 0.25], 4), [0, 0, 1, 2]);
        assert_eq!(chosen(&[0.9, 0.1], 3), [0, 0, 0]);
        assert_eq!(chosen(&[1.0, 0.0], 2), [0, 0]);
    }
}
