//! Where following begins, and whether the network has found what it follows.

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions};

use crate::assessment::{Predictions, open_loop};
use crate::failure::Result;
use crate::trained::Trained;

/// Samples that are predicted before the learned states are compared.
const WAIT: usize = 5;
/// Learned states that are compared, the first of them: this must not take longer than a few samples.
const COMPARED: usize = 200;

/// Waits for the first samples, to begin from the learned state from which they are most likely.
#[derive(Debug)]
pub struct Choice {
    /// Scaled samples so far.
    samples: Vec<f64>,
    wanted: usize,
}

impl Choice {
    /// Before the first sample.
    pub fn new(trained: &Trained) -> Self {
        let topology = &trained.checkpoint.topology;
        Self { samples: Vec::new(), wanted: (topology.delay() + WAIT) * topology.channels() }
    }

    /// Takes a sample; whether there are enough.
    pub fn take(&mut self, sample: &[f64]) -> bool {
        self.samples.extend_from_slice(sample);
        self.samples.len() >= self.wanted
    }

    /// A regression from the learned state from which the samples are most likely, up to before the last of them. None if they are as likely
    /// from the mean.
    pub fn begin(
        &self,
        trained: &Trained,
        options: ErrorRegressionOptions,
        engine: &Engine,
    ) -> Result<Option<ErrorRegression>> {
        let checkpoint = &trained.checkpoint;
        let (states, n) = (&checkpoint.initial_states, checkpoint.channels.len());
        let count = states.sequences().min(COMPARED);
        let candidates: Vec<&[f64]> =
            std::iter::once(states.mean()).chain((0..count).map(|s| states.sequence(s))).collect();
        let sequence = Sequence::new("", n, self.samples.clone())?;
        let data = Dataset::new(checkpoint.channels.clone(), vec![sequence; candidates.len()])?;
        let (network, delay) = (trained.network(), checkpoint.topology.delay());
        let predicted = open_loop(&network, &candidates, &data, engine)?;
        let cost = |k: usize| {
            let one = Dataset::new(checkpoint.channels.clone(), vec![data.sequences()[k].clone()])?;
            let predictions = Predictions::of(&predicted[k..=k], &one, delay);
            let squares = || predictions.errors.iter().map(|error| error * error).sum::<f64>();
            Ok(predictions.nll().unwrap_or_else(squares))
        };
        let costs = (0..candidates.len()).map(cost).collect::<Result<Vec<f64>>>()?;
        let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
        if costs[best] >= costs[0] {
            return Ok(None);
        }
        let mut regression = ErrorRegression::new(&network, candidates[best], options, engine)?;
        for sample in self.samples[..self.samples.len() - n].chunks_exact(n) {
            regression.observe(sample, &mut || false)?;
        }
        Ok(Some(regression))
    }
}

/// Nats per step and channel that a window may be less likely than what was learned, on average.
const TOLERANCE: f64 = 1.0;

/// What a window's likelihood must reach, in nats per step and channel, for the network to have found what it follows. None where it is not
/// known how likely the learned sequences are.
pub fn bound(trained: &Trained) -> Option<f64> {
    let score = trained.notes.as_ref()?.score?;
    Some(-score.held_out.and_then(|held_out| held_out.nll).or(score.nll)? - TOLERANCE)
}
