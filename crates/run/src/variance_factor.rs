//! Predicted variances, made as large as the errors on sequences that were not learned: one factor for each channel.
//!
//! ```text
//! v = r (f exp(u) + floor),   f such that   mean over samples of (target - y)^2 / v = 1
//! ```
//!
//! where r is 1, or the square of a skip connection's scale. The factor is kept beside the network in the notes of its checkpoint, whose weights stay as learning left them. Whoever opens the
//! checkpoint gets a network whose variance biases hold ln f more, so that every use of the network has it.

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::Dataset;
use scrnn::network::Network;
use scrnn::parameters::Block;
use scrnn::topology::Topology;
use serde::{Deserialize, Serialize};

use crate::assessment::Predictions;
use crate::digest::digest;
use crate::evaluation::{Bench, Member};
use crate::failure::{Failure, Result};

/// Factors up to this and down to its inverse are told.
const MOST: f64 = 1e6;

/// A factor on each channel's predicted variance, with what it was found from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VarianceFactor {
    /// For each channel.
    pub factors: Vec<f64>,
    /// Sequences that it was found from.
    pub sequences: usize,
    /// Samples of each channel.
    pub samples: usize,
    /// Fingerprint of these sequences.
    pub digest: String,
}

/// What a factor does to the nll, in nats per step and channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Without it.
    pub before: f64,
    /// With it, on the sequences that it was found from.
    pub after: f64,
    /// On each sequence with the factor of the others; none for a single sequence.
    pub left_out: Option<f64>,
}

impl VarianceFactor {
    /// The network as the checkpoint holds it, with the factor on its variances.
    ///
    /// # Errors
    /// [`Failure::Input`] for factors that are not those of such a network.
    pub fn apply(&self, network: &mut Network) -> Result<()> {
        let biases = network.block_mut(Block::VarianceBias);
        let fits = |factor: &f64| (1.0 / MOST..=MOST).contains(factor);
        if biases.len() != self.factors.len() || !self.factors.iter().all(fits) {
            let message = "the variance factor in the checkpoint is not one of its network";
            return Err(Failure::input(message, "find it anew: scrnn evaluate RUN DATA --calibrate"));
        }
        for (bias, factor) in biases.iter_mut().zip(&self.factors) {
            *bias += factor.ln();
        }
        Ok(())
    }

    /// What to tell whoever looks at variances.
    pub fn in_words(&self, channels: &[String]) -> String {
        let each = channels.iter().zip(&self.factors).map(|(name, factor)| format!("{name} {factor:.3}"));
        format!(
            "variances are multiplied by a factor that was found on {} sequences that were not learned: {}",
            self.sequences,
            each.collect::<Vec<_>>().join(", ")
        )
    }

    /// Finds it from sequences that were not learned, one step ahead after the burn-in. `network` is that of the checkpoint, whatever
    /// factor it may have.
    ///
    /// # Errors
    /// [`Failure::Input`] for a network without variance units.
    pub fn find(bench: &Bench, checkpoint: &Checkpoint, raw: &Dataset) -> Result<(Self, Effect)> {
        let topology = &checkpoint.topology;
        if !topology.has_variance() {
            return Err(Failure::input("the network predicts no variance", "leave --calibrate out"));
        }
        let network = Network::new(topology.clone(), checkpoint.parameters.clone())?;
        let members = [Member { network: &network, states: &checkpoint.initial_states }];
        let each = bench.sequence_by_sequence(&members)?;
        let n = topology.channels();
        let floor = floors(topology);
        let floor = floor.as_slice();
        let factors = of(&each.iter().collect::<Vec<_>>(), n, floor);
        let left_out = |s: usize| {
            let others: Vec<&Vec<Predictions>> = (0..each.len()).filter(|k| *k != s).map(|k| &each[k]).collect();
            nats(&each[s..=s], &of(&others, n, floor), floor)
        };
        let terms = |s: usize| each[s].iter().map(|channel| channel.errors.len()).sum::<usize>() as f64;
        let total: f64 = (0..each.len()).map(terms).sum();
        let effect = Effect {
            before: nats(&each, &vec![1.0; n], floor),
            after: nats(&each, &factors, floor),
            left_out: (each.len() > 1).then(|| (0..each.len()).map(|s| left_out(s) * terms(s)).sum::<f64>() / total),
        };
        let samples = each.iter().map(|channels| channels[0].errors.len()).sum();
        Ok((Self { factors, sequences: each.len(), samples, digest: digest(raw) }, effect))
    }
}

/// What is added to each channel's variance, in scaled units.
fn floors(topology: &Topology) -> Vec<f64> {
    let unit = |i: usize| topology.skip().map_or(1.0, |skip| skip.scale()[i].powi(2));
    (0..topology.channels()).map(|i| topology.variance_floor() * unit(i)).collect()
}

/// The factor of each channel, from the predictions of some sequences.
fn of(each: &[&Vec<Predictions>], channels: usize, floors: &[f64]) -> Vec<f64> {
    let channel = |i: usize| {
        let floor = floors[i];
        let pairs = || each.iter().flat_map(move |one| one[i].errors.iter().zip(&one[i].variances));
        let count = pairs().count() as f64;
        // Falls as the factor rises.
        let ratio = |f: f64| pairs().map(|(e, v)| e * e / (f * (v - floor) + floor)).sum::<f64>() / count;
        let (mut low, mut high) = (-MOST.ln(), MOST.ln());
        for _ in 0..100 {
            let middle = f64::midpoint(low, high);
            if ratio(middle.exp()) > 1.0 { low = middle } else { high = middle }
        }
        f64::midpoint(low, high).exp().clamp(1.0 / MOST, MOST)
    };
    (0..channels).map(channel).collect()
}

/// Nats per step and channel with these factors.
fn nats(each: &[Vec<Predictions>], factors: &[f64], floors: &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for ((channel, factor), floor) in each.iter().flat_map(|one| one.iter().zip(factors).zip(floors)) {
        for (e, v) in channel.errors.iter().zip(&channel.variances) {
            let v = factor * (v - floor) + floor;
            sum += 0.5 * ((std::f64::consts::TAU * v).ln() + e * e / v);
            count += 1;
        }
    }
    sum / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_makes_errors_as_large_as_predicted_also_above_a_floor() {
        let one = |errors: &[f64], variances: &[f64]| {
            vec![Predictions { errors: errors.to_vec(), variances: variances.to_vec() }]
        };
        let predictions = one(&[2.0, -2.0, 4.0, 0.0], &[1.0, 1.0, 4.0, 4.0]);
        let factor = of(&[&predictions], 1, &[0.0])[0];
        assert!((factor - 3.0).abs() < 1e-9, "{factor}");
        let factor = of(&[&predictions], 1, &[0.5])[0];
        let ratio = [(4.0, 1.0), (4.0, 1.0), (16.0, 4.0), (0.0, 4.0)];
        let mean = ratio.iter().map(|(e, v)| e / (factor * (v - 0.5) + 0.5)).sum::<f64>() / 4.0;
        assert!((mean - 1.0).abs() < 1e-9, "{factor} {mean}");
        let all = std::slice::from_ref(&predictions);
        assert!(nats(all, &[factor], &[0.5]) < nats(all, &[1.0], &[0.5]));
    }
}
