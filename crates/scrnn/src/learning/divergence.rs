//! Where a value of a training became non-finite.

use std::fmt;

use crate::dataset::Dataset;
use crate::forward::Plain;
use crate::initial_states::InitialStates;
use crate::likelihood::ln_gaussian;
use crate::network::Network;
use crate::parameters::Gradients;

/// The first value that was not finite. The learner is back at the last good state.
#[derive(Debug, Clone, PartialEq)]
pub struct Divergence {
    /// The epoch whose evaluation failed.
    pub epoch: u64,
    /// The last epoch whose evaluation was finite: where the learner is now.
    pub rolled_back_to: u64,
    /// The sequence, from 0, unless it was a gradient.
    pub sequence: Option<usize>,
    /// The step in it, from 0.
    pub step: Option<usize>,
    /// What was not finite: `context`, `mean`, `variance`, `log-likelihood`, or `gradient of` a block of parameters.
    pub quantity: String,
    /// Where all values were finite: by how much the nll rose above its best, in nats per step and channel. The sequence is then the
    /// least likely one.
    pub rise: Option<f64>,
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rise {
            Some(rise) => {
                write!(
                    f,
                    "the training diverged at epoch {}: the nll rose by {rise:.1} nats above its best",
                    self.epoch
                )?;
                if let Some(sequence) = self.sequence {
                    write!(f, ", most in sequence {}", sequence + 1)?;
                }
                return write!(f, "; rolled back to epoch {}", self.rolled_back_to);
            }
            None => {
                write!(f, "the training diverged at epoch {}: the {} is not finite", self.epoch, self.quantity)?;
            }
        }
        if let Some(sequence) = self.sequence {
            write!(f, " in sequence {}", sequence + 1)?;
        }
        if let Some(step) = self.step {
            write!(f, ", step {}", step + 1)?;
        }
        write!(f, "; rolled back to epoch {}", self.rolled_back_to)
    }
}

impl Divergence {
    /// Finds the place in a sequence whose likelihood is not finite.
    pub(super) fn in_sequence(epoch: u64, network: &Network, states: &InitialStates, data: &Dataset, s: usize) -> Self {
        let (step, quantity) = place(network, states.sequence(s), data, s);
        Self { quantity: quantity.to_owned(), step, ..Self::at(epoch, Some(s)) }
    }

    /// A likelihood that collapsed, most so in sequence `s`.
    pub(super) fn of_likelihood(epoch: u64, s: usize, rise: f64) -> Self {
        Self { quantity: "log-likelihood".to_owned(), rise: Some(rise), ..Self::at(epoch, Some(s)) }
    }

    fn at(epoch: u64, sequence: Option<usize>) -> Self {
        let rolled_back_to = epoch.saturating_sub(1);
        Self { epoch, rolled_back_to, sequence, step: None, quantity: String::new(), rise: None }
    }

    /// Finds the block of a gradient that is not finite.
    pub(super) fn in_gradient(epoch: u64, gradients: &Gradients) -> Self {
        let block =
            gradients.as_slice().iter().position(|g| !g.is_finite()).and_then(|index| gradients.block_at(index));
        let quantity = format!("gradient of {}", block.map_or("initial_state", |block| block.name()));
        Self { quantity, ..Self::at(epoch, None) }
    }
}

fn place(network: &Network, u0: &[f64], data: &Dataset, s: usize) -> (Option<usize>, &'static str) {
    let sequence = &data.sequences()[s];
    let delay = network.topology.delay();
    let mut state = Plain::at(network, u0);
    for step in 0..sequence.len() - delay {
        state.advance(sequence.sample(step));
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if !finite(&state.u) {
            return (Some(step), "context");
        }
        if !finite(&state.y) {
            return (Some(step), "mean");
        }
        if !finite(&state.v) || state.v.contains(&0.0) {
            return (Some(step), "variance");
        }
        let target = sequence.sample(step + delay);
        if state
            .v
            .iter()
            .enumerate()
            .any(|(i, &v)| !target[i].is_nan() && !ln_gaussian(target[i], state.y[i], v).is_finite())
        {
            return (Some(step), "log-likelihood");
        }
    }
    (None, "log-likelihood")
}
