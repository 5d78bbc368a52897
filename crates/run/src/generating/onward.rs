//! How recorded sequences go on, as a distribution.

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::recognition::{RecognitionOptions, recognize};

use super::{Fields, check_finite};
use crate::completion;
use crate::failure::{Failure, Result};
use crate::members;
use crate::memory::{self, product};
use crate::trained::Trained;

/// How far to go on, and with what.
#[derive(Debug, Clone, Copy)]
pub struct Onward {
    /// How many samples of each sequence are heard; all of it where it is not said.
    pub observed: Option<usize>,
    /// The number of steps after them; to the end of the sequence where it is not said.
    pub steps: Option<usize>,
    /// How many closed loops there are.
    pub samples: usize,
    /// Of the search for states and of the noise.
    pub seed: u64,
}

/// Mean and variance of what follows the first samples of each sequence of `data`, and as many samples of it as were asked for. `data` are in
/// their own units, on the network's channels; `all` are the members of one mixture.
///
/// # Errors
/// [`Failure::Input`] where nothing is left to predict, and for what does not fit the network.
pub fn onward(all: &[Trained], data: &Dataset, options: Onward, engine: &Engine) -> Result<Fields> {
    let Some(trained) = all.first() else { return Ok(Vec::new()) };
    let checkpoint = &trained.checkpoint;
    data.check_for(&checkpoint.topology)?;
    let (n, delay, loops) = (data.channels().len(), checkpoint.topology.delay(), options.samples);
    completion::check_observed(options.observed, delay)?;
    let scaled = checkpoint.scaling.apply(data)?;
    let networks: Vec<_> = all.iter().map(Trained::network).collect();
    let mixture = members::mixed(all, &networks);
    let mut rests = Vec::new();
    for sequence in scaled.sequences() {
        let heard = options.observed.unwrap_or(usize::MAX).min(sequence.len());
        let ahead = options.steps.unwrap_or(sequence.len() - heard);
        if ahead == 0 {
            let message = format!("sequence {} is heard to its end", sequence.name);
            return Err(Failure::input(message, "say with --steps how many samples to generate after it"));
        }
        memory::check(
            "what is to be generated",
            product(&[loops + all.len(), heard + ahead, 3 * n, size_of::<f64>()]),
        )?;
        let beginning = Dataset::new(data.channels().to_vec(), vec![sequence.truncated(heard)])?;
        let mut recognised = Vec::new();
        for (one, network) in all.iter().zip(&networks) {
            let search = RecognitionOptions::with(|it| {
                it.seed = options.seed;
                it.initial_state_variance = one.initial_state_variance();
            });
            recognised.extend(recognize(network, &one.checkpoint.initial_states, &beginning, &search, engine)?);
        }
        let recognised: Vec<_> = recognised.iter().collect();
        let part = (sequence.values(), heard, ahead);
        rests.push(completion::forecast(&mixture, &recognised, part, (loops, options.seed), engine)?);
    }

    let scaling = &checkpoint.scaling;
    let raw = |values: &[f64]| values.iter().enumerate().map(|(k, &x)| scaling.to_raw(k % n, x)).collect::<Vec<_>>();
    let raw_variance =
        |values: &[f64]| values.iter().enumerate().map(|(k, &v)| scaling.variance_to_raw(k % n, v)).collect::<Vec<_>>();
    let field = |of: &dyn Fn(usize, usize) -> Vec<f64>| -> Result<Dataset> {
        let mut sequences = Vec::new();
        for (s, sequence) in data.sequences().iter().enumerate() {
            for k in 0..loops {
                let name = if loops > 1 { format!("{}/{}", sequence.name, k + 1) } else { sequence.name.clone() };
                let values = of(s, k);
                check_finite(&name, &values, n)?;
                sequences.push(Sequence::new(name, n, values)?);
            }
        }
        Ok(Dataset::new(data.channels().to_vec(), sequences)?)
    };
    let mut fields = vec![("mean", field(&|s, _| raw(&rests[s].mean))?)];
    if checkpoint.topology.has_variance() {
        fields.push(("variance", field(&|s, _| raw_variance(&rests[s].variance))?));
    }
    fields.push(("sample", field(&|s, k| raw(&rests[s].samples[k]))?));
    Ok(fields)
}
