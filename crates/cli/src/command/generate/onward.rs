//! `scrnn generate --from`: how recorded sequences go on, as a distribution.

use std::path::Path;

use scrnn::dataset::{Dataset, Sequence};
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn_data as files;
use scrnn_run::completion;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::members;
use scrnn_run::memory::{self, product};
use scrnn_run::trained::Trained;

use super::{Arguments, Fields};
use crate::args::Shared;

/// Mean and variance of what follows the first samples of each sequence of `path`, and as many samples of it as were asked for.
pub fn fields(arguments: &Arguments, path: &Path, all: &[Trained], shared: &Shared) -> Result<Fields> {
    let Some(trained) = all.first() else { return Ok(Vec::new()) };
    let (checkpoint, engine) = (&trained.checkpoint, shared.engine()?);
    let data = files::read_all(&[path], &arguments.part.of(path, trained.selection()))?.data;
    let data = trained.fitted_aloud(data, path, shared)?;
    data.check_for(&checkpoint.topology)?;
    let (n, delay, loops) = (data.channels().len(), checkpoint.topology.delay(), arguments.samples as usize);
    if let Some(observed) = arguments.observed.filter(|observed| *observed <= delay) {
        let message = format!("--observed {observed} leaves nothing to predict: the network's delay is {delay}");
        return Err(Failure::input(message, format!("observe at least {} samples", delay + 1)));
    }
    let scaled = checkpoint.scaling.apply(&data)?;
    let networks: Vec<_> = all.iter().map(Trained::network).collect();
    let mixture = members::mixed(all, &networks);
    shared.say(format_args!("the recognised state's uncertainty: {}", completion::UNCERTAINTY));
    let mut rests = Vec::new();
    for sequence in scaled.sequences() {
        let heard = arguments.observed.unwrap_or(usize::MAX).min(sequence.len());
        let ahead = arguments.steps.unwrap_or(sequence.len() - heard);
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
            let options = RecognitionOptions::with(|it| {
                it.seed = arguments.seed;
                it.initial_state_variance = one.initial_state_variance();
            });
            recognised.extend(recognize(network, &one.checkpoint.initial_states, &beginning, &options, &engine)?);
        }
        let recognised: Vec<_> = recognised.iter().collect();
        let part = (sequence.values(), heard, ahead);
        rests.push(completion::forecast(&mixture, &recognised, part, (loops, arguments.seed), &engine)?);
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
                super::check_finite(&name, &values, n)?;
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
