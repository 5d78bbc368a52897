//! Lets trained networks run (thesis 2.8), in the data's units: from learned or given initial states, or on from the end of recordings.

mod onward;
mod starts;

pub use onward::{Onward, onward};
pub use starts::{From, State, given_states, unit_names};

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::generation::{ChannelFeedback, Feedback, Generated, GenerationOptions, Start, generate};

use crate::evaluation::Rest;
use crate::failure::{Failure, Result};
use crate::trained::Trained;
use starts::Row;

/// What is generated: names and values, in the data's units (contexts as they are). `mean`, `variance` where the network has variance
/// units, `sample`, and `context` if it was asked for.
pub type Fields = Vec<(&'static str, Dataset)>;

/// How to generate.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Generating {
    /// Where it starts.
    pub from: From,
    /// The recorded sample's share of the input: 1 is the open loop, 0 the closed loop.
    pub sensed: f64,
    /// Channels that are fed with recorded samples whatever that share.
    pub open_channels: Vec<String>,
    /// Whether noise of the predicted variance is fed back, and in the samples.
    pub noise: bool,
    /// The number of steps; as many as the data have where it is not said.
    pub steps: Option<usize>,
    /// How many times each sequence is generated, with noise of its own.
    pub samples: usize,
    /// Of the noise.
    pub seed: u64,
    /// Whether contexts are given as well.
    pub contexts: bool,
    /// Recorded sequences in the data's units, on the network's channels; those that were learned where there are none.
    pub data: Option<Dataset>,
}

impl Default for Generating {
    fn default() -> Self {
        Self {
            from: From::Learned,
            sensed: 0.0,
            open_channels: Vec::new(),
            noise: true,
            steps: None,
            samples: 1,
            seed: 1,
            contexts: false,
            data: None,
        }
    }
}

impl Generating {
    /// The defaults, changed.
    pub fn with(change: impl FnOnce(&mut Self)) -> Self {
        let mut options = Self::default();
        change(&mut options);
        options
    }
}

/// What one network generates; or a mixture, each member in loops of its own: the moments are those of the mixture, the samples those of
/// its members in turn.
///
/// # Errors
/// [`Failure::Input`] for what does not fit the networks, for a number of steps that is not known, and for values that leave the finite
/// numbers.
pub fn generating(all: &[Trained], options: &Generating, engine: &Engine) -> Result<Fields> {
    if all.len() > 1 && (matches!(options.from, From::Given(_)) || options.contexts) {
        let message = "initial states and contexts are those of one network, and this is a mixture";
        let first = all[0].path.parent().unwrap_or(&all[0].path).display();
        return Err(Failure::input(message, format!("give one of its members: {first}")));
    }
    let mut each = Vec::new();
    let mut of_first = Vec::new();
    for (m, trained) in all.iter().enumerate() {
        let feedback = feedback(options, &trained.checkpoint)?;
        let sensing = feedback.0.iter().any(|channel| channel.sensed > 0.0);
        let rows = starts::rows(options, trained, engine.threads(), sensing)?;
        let starts: Vec<Start<'_>> =
            rows.iter().map(|row| Start { initial_state: &row.state, sensed: &row.sensed }).collect();
        let steps = rows.iter().map(|row| row.steps).max().unwrap_or(0);
        let how = GenerationOptions::new(steps, feedback)
            .seed(options.seed.wrapping_add(m as u64))
            .contexts(options.contexts);
        each.push(generate(&trained.network(), &starts, &how, engine)?);
        if m == 0 {
            of_first = rows;
        }
    }
    let Some(trained) = all.first() else { return Ok(Vec::new()) };
    let generated: Vec<Generated> = match each.as_slice() {
        [_] => each.swap_remove(0),
        _ => (0..of_first.len()).map(|row| mixture(&each, row)).collect(),
    };
    fields(&trained.checkpoint, &of_first, &generated)
}

/// The moments of what the members generated in a row, and the sample of one of them.
fn mixture(each: &[Vec<Generated>], row: usize) -> Generated {
    let loops: Vec<Generated> = each.iter().map(|one| one[row].clone()).collect();
    let mut rest = Rest::of(&loops, 0);
    let mut generated = Generated::default();
    generated.sample = rest.samples.swap_remove(row % each.len());
    (generated.mean, generated.variance) = (rest.mean, rest.variance);
    generated
}

/// How each channel is fed.
fn feedback(options: &Generating, checkpoint: &Checkpoint) -> Result<Feedback> {
    let (n, noise) = (checkpoint.channels.len(), options.noise);
    let mut feedback = Feedback::mixed(n, options.sensed, noise);
    for name in &options.open_channels {
        let channel = checkpoint.channels.iter().position(|channel| channel == name).ok_or_else(|| {
            let help = format!("the channels are {}", checkpoint.channels.join(", "));
            Failure::input(format!("the network has no channel `{name}`"), help)
        })?;
        feedback.0[channel] = ChannelFeedback { sensed: 1.0, noise };
    }
    Ok(feedback)
}

/// Mean, variance, sample and contexts of all rows, in the data's units, each row as long as it should be.
fn fields(checkpoint: &Checkpoint, rows: &[Row], generated: &[Generated]) -> Result<Fields> {
    let scaling = &checkpoint.scaling;
    let n = checkpoint.channels.len();
    let field = |channels: &[String], of: &dyn Fn(&Generated) -> Vec<f64>| -> Result<Dataset> {
        let mut sequences = Vec::with_capacity(rows.len());
        for (row, generated) in rows.iter().zip(generated) {
            let mut values = of(generated);
            values.truncate(row.steps * channels.len());
            check_finite(&row.name, &values, channels.len())?;
            sequences.push(Sequence::new(row.name.clone(), channels.len(), values)?);
        }
        Ok(Dataset::new(channels.to_vec(), sequences)?)
    };
    let raw = |values: &[f64]| values.iter().enumerate().map(|(k, &x)| scaling.to_raw(k % n, x)).collect::<Vec<_>>();
    let raw_variance = |generated: &Generated| {
        generated.variance.iter().enumerate().map(|(k, &v)| scaling.variance_to_raw(k % n, v)).collect::<Vec<_>>()
    };
    let mut fields = vec![("mean", field(&checkpoint.channels, &|generated| raw(&generated.mean))?)];
    if checkpoint.topology.has_variance() {
        fields.push(("variance", field(&checkpoint.channels, &raw_variance)?));
    }
    fields.push(("sample", field(&checkpoint.channels, &|generated| raw(&generated.sample))?));
    if generated.iter().any(|generated| !generated.contexts.is_empty()) {
        let names: Vec<String> = checkpoint.topology.groups().iter().flat_map(starts::unit_names).collect();
        fields.push(("context", field(&names, &|generated| generated.contexts.clone())?));
    }
    Ok(fields)
}

/// Refuses values of the sequence `name` that are not finite.
fn check_finite(name: &str, values: &[f64], channels: usize) -> Result<()> {
    let Some(index) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let step = index / channels + 1;
    Err(Failure::input(
        format!("sequence {name} left the finite numbers at step {step}"),
        "the network predicts variances without bound here: try --no-noise, or train it further",
    ))
}
