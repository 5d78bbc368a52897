//! The result of a training, in words and as JSON.

use std::fmt;

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::evaluation::gaussian_entropy;
use scrnn::learning::{Divergence, Outcome};
use serde::Serialize;

use crate::assessment;
use crate::channel_scores::{ChannelScore, channel_scores};
use crate::character::still_channels;
use crate::evaluation::Member;
use crate::failure::Result;
use crate::held_out::Judgement;
use crate::notes::Score;
use crate::training::Training;
use crate::truth::{self, Comparison};

/// The result of a training.
#[derive(Debug, Serialize)]
pub struct Verdict {
    run: String,
    outcome: &'static str,
    epoch: u64,
    nll: Option<f64>,
    mse: Option<f64>,
    /// The model that predicts each channel's mean and variance, whatever came before.
    constant_model: ConstantModel,
    best: Option<Score>,
    /// How each channel is predicted one step ahead.
    channels: Vec<ChannelScore>,
    /// How the best network does on the sequences that were held out.
    held_out: Option<Judgement>,
    truth: Option<Comparison>,
    divergence: Option<Place>,
    /// Channels that never change in the samples that are predicted, where the variance is predicted.
    still_channels: Vec<String>,
    /// How often the training was reset to its best network, at half the rate.
    recoveries: u64,
    seconds: f64,
    threads: usize,
    instruction_set: String,
}

/// How well a channel's mean and variance alone predict it, in scaled units.
#[derive(Debug, Serialize)]
struct ConstantModel {
    /// None where a channel never changes: its likelihood has no bound.
    nll: Option<f64>,
    mse: f64,
}

/// Where a value of a training became non-finite.
#[derive(Debug, Serialize)]
struct Place {
    epoch: u64,
    /// From 1.
    sequence: Option<usize>,
    /// From 1.
    step: Option<usize>,
    quantity: String,
}

impl Verdict {
    /// Judges the network that the training ended with.
    pub fn new(training: &Training, engine: &Engine) -> Result<Self> {
        let Training { run, outcome, learner, source, scaling, score, best, seconds, .. } = training;
        let topology = &learner.network().topology();
        let truth = match (outcome, &source.truth) {
            (Outcome::Finished, Some(truth)) if topology.has_variance() => {
                truth::compare((learner.network(), learner.initial_states()), (&source.data, truth, scaling), engine)?
            }
            _ => None,
        };
        let scaled = scaling.apply(&source.data)?;
        let states: Vec<&[f64]> = (0..scaled.sequences().len()).map(|s| learner.initial_states().sequence(s)).collect();
        let open = assessment::open_loop(learner.network(), &states, &scaled, engine)?;
        Ok(Self {
            run: run.clone(),
            outcome: match outcome {
                Outcome::Stopped if training.out_of_patience => "out of patience",
                Outcome::Finished => "finished",
                Outcome::Stopped => "interrupted",
                Outcome::Diverged(_) => "diverged",
            },
            epoch: learner.epoch(),
            nll: score.and_then(|score| score.nll),
            mse: score.map(|score| score.mse),
            constant_model: ConstantModel::of(&scaled, topology.delay())?,
            best: *best,
            channels: channel_scores(&scaled, &open, topology.delay(), scaling),
            held_out: judgement(training)?,
            truth,
            divergence: match outcome {
                Outcome::Diverged(divergence) => Some(Place::of(divergence)),
                _ => None,
            },
            still_channels: match topology.has_variance() {
                true => still_channels(&source.data, topology.delay()),
                false => Vec::new(),
            },
            recoveries: learner.recoveries(),
            seconds: *seconds,
            threads: engine.threads(),
            instruction_set: engine.instruction_set().to_string(),
        })
    }
}

/// Channels that are shown in words; the JSON object has all.
const SHOWN: usize = 24;

impl Verdict {
    /// A line for each channel.
    fn write_channels(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.channels.iter().take(SHOWN).map(|score| score.channel.chars().count());
        let width = names.max().unwrap_or(0);
        writeln!(
            f,
            "One step ahead, the share of each channel's variance that is explained, and the rms error in its own units:"
        )?;
        for score in self.channels.iter().take(SHOWN) {
            let spikes = match score.left_out {
                0 => String::new(),
                count => format!("  (without {count} spikes)"),
            };
            writeln!(f, "  {:width$}  {:>8}  {}{spikes}", score.channel, score.share(), score.error())?;
        }
        match self.channels.len().checked_sub(SHOWN) {
            None | Some(0) => Ok(()),
            Some(more) => writeln!(f, "  and {more} more: --json has all"),
        }
    }
}

/// How the best network does on what was held out; none while a person waits for an interrupted training to end.
fn judgement(training: &Training) -> Result<Option<Judgement>> {
    let ended = !matches!(training.outcome, Outcome::Stopped) || training.out_of_patience;
    match (&training.watch, &training.best_network, training.best) {
        (Some(watch), Some((network, states)), Some(best)) if ended => {
            Ok(Some(watch.judge(&[Member { network, states }], best.epoch, training.initial_state_variance)?))
        }
        _ => Ok(None),
    }
}

impl ConstantModel {
    /// Over the samples that a network of this delay predicts.
    fn of(scaled: &Dataset, delay: usize) -> Result<Self> {
        let n = scaled.channels().len();
        let predicted = scaled.sequences().iter().map(|s| Sequence::new("", n, s.values()[delay * n..].to_vec()));
        let predicted = Dataset::new(scaled.channels().to_vec(), predicted.collect::<scrnn::error::Result<_>>()?)?;
        let moments = predicted.channel_moments().into_iter().map(|(_, variance)| variance);
        // A channel that was never observed counts nowhere.
        let variances: Vec<f64> = moments.filter(|variance| !variance.is_nan()).collect();
        let count = variances.len().max(1) as f64;
        let nll = variances.iter().map(|&variance| gaussian_entropy(variance)).sum::<f64>() / count;
        Ok(Self { nll: Some(nll).filter(|nll| nll.is_finite()), mse: variances.iter().sum::<f64>() / count })
    }
}

impl Place {
    fn of(divergence: &Divergence) -> Self {
        let from_one = |index: Option<usize>| index.map(|index| index + 1);
        Self {
            epoch: divergence.epoch,
            sequence: from_one(divergence.sequence),
            step: from_one(divergence.step),
            quantity: divergence.quantity.clone(),
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let epochs = self.epoch;
        match (self.nll, self.constant_model.nll) {
            (Some(nll), Some(constant)) => {
                writeln!(
                    f,
                    "After {epochs} epochs the nll is {nll:.4} nats per step and channel (how unexpected each next sample is, in \
                     scaled units: lower is better, also below 0), against {constant:.4} of a model that always predicts \
                     each channel's mean and variance: {}.",
                    gain(constant - nll)
                )?;
            }
            (Some(nll), None) => writeln!(
                f,
                "After {epochs} epochs the nll is {nll:.4} nats per step and channel (how unexpected each next sample is, in \
                 scaled units: lower is better, also below 0); there is nothing to compare it with, as a channel never \
                 changes."
            )?,
            (None, _) => {
                if let Some(mse) = self.mse {
                    let constant = self.constant_model.mse;
                    writeln!(
                        f,
                        "After {epochs} epochs the mean squared error is {mse:.4e} per step and channel (in scaled units), \
                         against {constant:.4e} of a model that always predicts each channel's mean."
                    )?;
                }
            }
        }
        self.write_channels(f)?;
        if self.recoveries > 0 {
            writeln!(
                f,
                "Training became unstable {} times. Each time it went back to its best network and on at half the rate: \
                 the rate is too large for these data (history.csv has the epochs).",
                self.recoveries
            )?;
        }
        if let Some(held_out) = &self.held_out {
            write!(f, "{held_out}")?;
            if held_out.epoch != self.epoch {
                writeln!(f, "The best network is in best.safetensors: give --best to the commands that use the run.")?;
            }
        }
        for channel in &self.still_channels {
            writeln!(f, "Channel {channel} never changes: its predicted variance falls to the variance_floor.")?;
        }
        match &self.truth {
            Some(truth) => writeln!(f, "{truth}"),
            None => Ok(()),
        }
    }
}

/// What a difference in nats means: a ratio of probability densities, averaged as logarithms.
fn gain(nats: f64) -> String {
    if nats > 0.0 {
        format!("the probability density of a sample is e^{nats:.2} = {:.1} times as high", nats.exp())
    } else {
        "the network is not better than that yet".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_constant_model_has_the_entropy_of_the_predicted_samples() {
        let sequence = Sequence::new("", 1, vec![100.0, 1.0, -1.0, 1.0, -1.0]).unwrap();
        let data = Dataset::new(vec!["y".into()], vec![sequence]).unwrap();
        let model = ConstantModel::of(&data, 1).unwrap();
        assert_eq!(model.mse, 1.0);
        assert!((model.nll.unwrap() - 1.418_938_533_204_672_7).abs() < 1e-15);
        let still = Sequence::new("", 1, vec![2.0; 5]).unwrap();
        let data = Dataset::new(vec!["y".into()], vec![still]).unwrap();
        assert_eq!(ConstantModel::of(&data, 1).unwrap().nll, None);
    }
}
