//! Predicted variances beside the true ones of a task.

use std::fmt;

use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::evaluation::correlation;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn_tasks::limit_cycle;
use serde::Serialize;

use crate::failure::Result;
use crate::source::Truth;
use scrnn_tasks::TaskName;

/// The noise of the closed loop that is judged.
const SEED: u64 = 1;

/// How near the predicted variances come to the true ones, in the open loop and in the closed loop with noise.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Comparison {
    /// Correlation of predicted and true standard deviations over all steps.
    SdCorrelation {
        /// Fed with the samples.
        open: Option<f64>,
        /// Fed with its own predictions and their noise.
        closed: Option<f64>,
    },
    /// Where the variance is constant in each sequence: |mean predicted - true| / true, averaged over sequences and
    /// channels (3.4).
    MeanVarianceError {
        /// Fed with the samples.
        open: f64,
        /// Fed with its own predictions and their noise.
        closed: f64,
    },
}

/// Lets the network generate each sequence and compares.
pub fn compare(
    (network, initial_states): (&Network, &InitialStates),
    (data, truth, scaling): (&Dataset, &Truth, &Scaling),
    engine: &Engine,
) -> Result<Option<Comparison>> {
    let scaled = scaling.apply(data)?;
    let n = scaled.channels().len();
    let delay = network.topology().delay();
    let steps = scaled.sequences().iter().map(|sequence| sequence.len() - delay).max().unwrap_or(0);
    let starts: Vec<Start<'_>> = scaled
        .sequences()
        .iter()
        .enumerate()
        .map(|(s, sequence)| Start { initial_state: initial_states.sequence(s), sensed: sequence.values() })
        .collect();
    let run = |feedback| {
        let options = GenerationOptions::new(steps, feedback).seed(SEED);
        generate(network, &starts, &options, engine)
    };
    let (open, closed) = (run(Feedback::open(n))?, run(Feedback::closed(n, true))?);

    let constant = truth.variances.sequences().iter().all(|sequence| {
        let first = sequence.sample(0);
        first.iter().all(|&v| v > 0.0) && sequence.values().chunks_exact(n).all(|sample| sample == first)
    });
    if constant {
        let error = |generated: &[Generated]| mean_variance_error(generated, truth, scaling, delay);
        return Ok(Some(Comparison::MeanVarianceError { open: error(&open), closed: error(&closed) }));
    }
    let of_data = |s: usize, k: usize, i: usize| truth.variances.sequences()[s].sample(k + delay)[i].sqrt();
    // Where the noise depends on the state, the truth of a closed loop depends on the state that the loop is in.
    let of_loop = |s: usize, k: usize, i: usize| match truth.task {
        TaskName::LimitCycle => {
            let last = match k {
                0 => data.sequences()[s].sample(delay - 1)[i],
                _ => scaling.to_raw(i, closed[s].sample[(k - 1) * n + i]),
            };
            limit_cycle::State { y: last, z: 0.0 }.standard_deviation()
        }
        TaskName::Lissajous | TaskName::Patterns | TaskName::Sinusoid | TaskName::Reach | TaskName::Interact => {
            of_data(s, k, i)
        }
    };
    let correlate = |generated: &[Generated], true_sd: &dyn Fn(usize, usize, usize) -> f64| {
        let (mut predicted, mut expected) = (Vec::new(), Vec::new());
        for (s, sequence) in data.sequences().iter().enumerate() {
            for k in 0..sequence.len() - delay {
                for i in 0..n {
                    predicted.push(scaling.variance_to_raw(i, generated[s].variance[k * n + i]).sqrt());
                    expected.push(true_sd(s, k, i));
                }
            }
        }
        correlation(&predicted, &expected)
    };
    Ok(Some(Comparison::SdCorrelation { open: correlate(&open, &of_data), closed: correlate(&closed, &of_loop) }))
}

fn mean_variance_error(generated: &[Generated], truth: &Truth, scaling: &Scaling, delay: usize) -> f64 {
    let mut errors = Vec::new();
    for (sequence, generated) in truth.variances.sequences().iter().zip(generated) {
        let n = sequence.sample(0).len();
        let steps = sequence.len() - delay;
        for (i, &expected) in sequence.sample(0).iter().enumerate() {
            let predicted = generated.variance.chunks_exact(n).take(steps).map(|v| v[i]).sum::<f64>() / steps as f64;
            errors.push((scaling.variance_to_raw(i, predicted) - expected).abs() / expected);
        }
    }
    errors.iter().sum::<f64>() / errors.len() as f64
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SdCorrelation { open, closed } => {
                let show = |value: &Option<f64>| {
                    value.map_or("nothing (one of them is constant)".into(), |r| format!("{r:.4}"))
                };
                let (open, closed) = (show(open), show(closed));
                write!(
                    f,
                    "Predicted and true standard deviations correlate with {open} in the open loop and {closed} in the closed loop with noise."
                )
            }
            Self::MeanVarianceError { open, closed } => write!(
                f,
                "The mean predicted variance is off from the true one by {:.1} % on average in the open loop and by {:.1} % in the closed loop with noise.",
                100.0 * open,
                100.0 * closed
            ),
        }
    }
}
