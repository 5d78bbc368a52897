//! How well a network predicts one step ahead: its nll, beside the noise's own entropy and simple models, and whether
//! its variances are as large as its errors.

use std::ops::Range;

use scrnn::analysis::baselines;
use scrnn::analysis::calibration::Calibration;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::evaluation::gaussian_entropy;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::network::Network;
use serde::Serialize;

use crate::failure::Result;

/// Groups of similar predicted variance.
const BINS: usize = 20;

/// One-step predictions beside the samples.
#[derive(Debug, Clone)]
pub struct Predictions {
    /// Sample minus predicted mean, over all sequences, steps and channels.
    pub errors: Vec<f64>,
    /// Predicted variances; empty without variance units.
    pub variances: Vec<f64>,
}

/// The judgement, all in scaled units.
#[derive(Debug, Clone, Serialize)]
pub struct Assessment {
    /// Nats per step and channel on the learned sequences; none without variance units.
    pub nll: Option<f64>,
    /// The same on sequences that were not learned, where there are any.
    pub nll_held_out: Option<f64>,
    /// What the nll would come to with the true means and variances: the mean entropy of the noise. None where it is not
    /// known, or without a bound.
    pub entropy_of_noise: Option<f64>,
    /// Simple models on the learned sequences.
    pub baselines: Vec<Baseline>,
    /// Errors beside predicted variances, on sequences that were not learned where there are any.
    pub calibration: Option<Calibration>,
}

/// A simple model.
#[derive(Debug, Clone, Serialize)]
pub struct Baseline {
    /// What it predicts.
    pub model: &'static str,
    /// Nats per step and channel; none where it has no bound.
    pub nll: Option<f64>,
}

/// Runs the network on each sequence of `data` from the state beside it, as [`generate`] does.
pub fn run(
    network: &Network,
    states: &[&[f64]],
    data: &Dataset,
    options: &GenerationOptions,
    engine: &Engine,
) -> Result<Vec<Generated>> {
    let starts: Vec<Start<'_>> = states
        .iter()
        .zip(data.sequences())
        .map(|(state, sequence)| Start { initial_state: state, sensed: sequence.values() })
        .collect();
    Ok(generate(network, &starts, options, engine)?)
}

/// Steps that a network of this delay predicts of the longest sequence.
pub fn longest(data: &Dataset, delay: usize) -> usize {
    data.sequences().iter().map(|sequence| sequence.len() - delay).max().unwrap_or(0)
}

/// One step ahead of each sample (2.25a).
pub fn open_loop(network: &Network, states: &[&[f64]], data: &Dataset, engine: &Engine) -> Result<Vec<Generated>> {
    let steps = longest(data, network.topology().delay());
    let feedback = Feedback::open(data.channels().len());
    run(network, states, data, &GenerationOptions::new(steps, feedback), engine)
}

impl Predictions {
    /// Of what the open loop predicted on `data`. Missing samples are passed over.
    pub fn of(generated: &[Generated], data: &Dataset, delay: usize) -> Self {
        let whole: Vec<Range<usize>> = data.sequences().iter().map(|sequence| delay..sequence.len()).collect();
        Self::of_ranges(generated, data, (delay, &whole))
    }

    /// Of these samples of each sequence, none of them among the first `delay`. Samples that are missing (not a number) are left out.
    pub fn of_ranges(generated: &[Generated], data: &Dataset, (delay, ranges): (usize, &[Range<usize>])) -> Self {
        let n = data.channels().len();
        let (mut errors, mut variances) = (Vec::new(), Vec::new());
        for ((generated, sequence), range) in generated.iter().zip(data.sequences()).zip(ranges) {
            let targets = &sequence.values()[range.start * n..range.end * n];
            for (at, target) in targets.iter().enumerate().filter(|(_, target)| !target.is_nan()) {
                let at = (range.start - delay) * n + at;
                errors.push(target - generated.mean[at]);
                variances.extend(generated.variance.get(at));
            }
        }
        Self { errors, variances }
    }

    /// Nats per step and channel; none without variance units.
    pub fn nll(&self) -> Option<f64> {
        let terms = self.errors.iter().zip(&self.variances);
        let sum: f64 = terms.map(|(e, v)| 0.5 * ((std::f64::consts::TAU * v).ln() + e * e / v)).sum();
        (!self.variances.is_empty()).then(|| sum / self.variances.len() as f64)
    }
}

impl Assessment {
    /// Judges predictions on the learned sequences `data`, and on others.
    pub fn new(data: &Dataset, learned: &Predictions, held_out: Option<&Predictions>, delay: usize) -> Self {
        let judged = held_out.unwrap_or(learned);
        let has_variance = !judged.variances.is_empty();
        let baseline = |model, nll: Option<f64>| Baseline { model, nll: nll.filter(|nll| nll.is_finite()) };
        Self {
            nll: learned.nll(),
            nll_held_out: held_out.and_then(Predictions::nll),
            entropy_of_noise: None,
            baselines: vec![
                baseline("always the channel's mean", baselines::constant(data, delay)),
                baseline("always the sequence's mean", baselines::constant_of_sequence(data, delay)),
                baseline("the last known sample", baselines::last_value(data, delay)),
                baseline("linear in the last sample", baselines::autoregression(data, delay, 1)),
                baseline("linear in the last 4 samples", baselines::autoregression(data, delay, 4)),
            ],
            calibration: if has_variance { Calibration::of(&judged.errors, &judged.variances, BINS) } else { None },
        }
    }

    /// The same with the entropy of the noise, whose true variances are known.
    pub fn with_truth(mut self, variances: &Dataset, delay: usize) -> Self {
        self.entropy_of_noise = entropy_of_noise(variances, delay);
        self
    }
}

/// The mean entropy of noise with these variances, in nats per step and channel: no nll can be expected below it. None
/// where some variance is 0.
pub fn entropy_of_noise(variances: &Dataset, delay: usize) -> Option<f64> {
    let n = variances.channels().len();
    let values = variances.sequences().iter().flat_map(|sequence| &sequence.values()[delay * n..]);
    let entropies: Vec<f64> = values.map(|&v| gaussian_entropy(v)).collect();
    let mean = entropies.iter().sum::<f64>() / entropies.len() as f64;
    Some(mean).filter(|mean| mean.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn::dataset::Sequence;

    #[test]
    fn the_nll_is_that_of_a_gaussian_and_its_floor_the_entropy() {
        let data = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, vec![9.0, 1.0, -1.0]).unwrap()]).unwrap();
        let generated = {
            let mut it = Generated::default();
            it.mean = vec![0.0; 4];
            it.variance = vec![1.0; 4];
            it
        };
        let predictions = Predictions::of(&[generated], &data, 1);
        assert_eq!(predictions.errors, [1.0, -1.0]);
        assert!((predictions.nll().unwrap() - gaussian_entropy(1.0)).abs() < 1e-15);
        let ones = data.map(|_, _| 1.0);
        let assessment = Assessment::new(&data, &predictions, None, 1).with_truth(&ones, 1);
        assert!((assessment.entropy_of_noise.unwrap() - gaussian_entropy(1.0)).abs() < 1e-15);
        assert_eq!(assessment.calibration.unwrap().within_one, 1.0);
        let zeros = data.map(|_, _| 0.0);
        assert_eq!(Assessment::new(&data, &predictions, None, 1).with_truth(&zeros, 1).entropy_of_noise, None);
    }
}
