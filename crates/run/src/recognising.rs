//! Finds the initial states from which trained networks predict given sequences best (thesis 2.9), in the data's units, and what follows.

mod alike;
mod completing;

pub use completing::Completion;

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::recognition::{Recognition, RecognitionOptions, recognize};
use serde::Serialize;

use crate::channel_scores::observed_error;
use crate::completion;
use crate::failure::{Failure, Result};
use crate::generating::{Fields, unit_names};
use crate::members;
use crate::messages::Messages;
use crate::trained::Trained;

/// How to search.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Recognising {
    /// Number of starts for each sequence.
    pub starts: usize,
    /// Number of updates from each start.
    pub epochs: u64,
    /// Of the random starts and of the completions' noise.
    pub seed: u64,
    /// How many samples are heard; all where it is not said.
    pub observed: Option<usize>,
    /// How many closed loops with noise complete the rest; none where it is not said.
    pub samples: Option<usize>,
    /// Rate of the ascent; the library's where it is not said.
    pub rate: Option<f64>,
}

impl Default for Recognising {
    fn default() -> Self {
        Self { starts: 20, epochs: 300, seed: 1, observed: None, samples: None, rate: None }
    }
}

impl Recognising {
    /// The defaults, changed.
    pub fn with(change: impl FnOnce(&mut Self)) -> Self {
        let mut options = Self::default();
        change(&mut options);
        options
    }

    /// For one network.
    fn of(&self, trained: &Trained) -> RecognitionOptions {
        RecognitionOptions::with(|it| {
            (it.starts, it.epochs, it.seed, it.observed) = (self.starts, self.epochs, self.seed, self.observed);
            it.rate = self.rate.unwrap_or(it.rate);
            it.initial_state_variance = trained.initial_state_variance();
        })
    }
}

/// What was found for a set of sequences.
#[derive(Debug)]
pub struct Recognised<'a> {
    /// For each sequence.
    pub sequences: Vec<Found>,
    /// Whether learned sequences are ranked by likeness, since all share one initial state.
    pub by_likeness: bool,
    all: &'a [Trained],
    data: &'a Dataset,
    heard: usize,
    distribution: bool,
    /// The mean over the members of what each predicts of each sequence, in the data's units.
    means: Vec<Vec<f64>>,
}

/// What was found for one sequence.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Found {
    /// Its name.
    pub sequence: String,
    /// The kind of start that ended best.
    pub start: String,
    /// Nats per step and channel, in scaled units; none without variance units.
    pub ln_likelihood: Option<f64>,
    /// (3.5), in the data's units.
    pub error: f64,
    /// Where a part was observed: (3.5) over the samples that were not observed.
    pub completion_error: Option<f64>,
    /// Where samples were asked for: the rest as a distribution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub completion: Option<Completion>,
    /// What each member of a mixture found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<Found>,
    /// The best initial state; empty for a mixture, whose members have their own.
    pub initial_state: Vec<f64>,
    /// The learned sequences, most likely first.
    pub learned: Vec<Learned>,
    /// All starts, best first.
    pub trials: Vec<Tried>,
}

/// How likely a learned sequence's initial state makes the data; where all share one, how far its contexts are off.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Learned {
    /// Its number, from 1.
    pub number: usize,
    /// Its name.
    pub sequence: String,
    /// Nats per step and channel, in scaled units; none without variance units or where all share one state.
    pub ln_likelihood: Option<f64>,
    /// The root mean square distance of contexts, where all share one state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
}

/// Where one start ended.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Tried {
    /// Its kind.
    pub start: String,
    /// Nats per step and channel, in scaled units; none without variance units.
    pub ln_likelihood: Option<f64>,
}

/// Recognises `data`, which are in their own units and on the network's channels, by one network or by all members of a mixture.
///
/// # Errors
/// [`Failure::Input`] where nothing is left to predict, and for what does not fit the network.
pub fn recognising<'a>(
    all: &'a [Trained],
    data: &'a Dataset,
    options: &Recognising,
    (engine, messages): (&Engine, &dyn Messages),
) -> Result<Recognised<'a>> {
    let heard = options.observed.unwrap_or(usize::MAX);
    let Some(trained) = all.first() else {
        return Ok(Recognised {
            sequences: Vec::new(),
            by_likeness: false,
            all,
            data,
            heard,
            distribution: false,
            means: Vec::new(),
        });
    };
    let checkpoint = &trained.checkpoint;
    data.check_for(&checkpoint.topology)?;
    completion::check_observed(options.observed, checkpoint.topology.delay())?;
    let scaled = checkpoint.scaling.apply(data)?;
    let (mut recognitions, mut generated) = (Vec::new(), Vec::new());
    for one in all {
        let states = &one.checkpoint.initial_states;
        let found = recognize(&one.network(), states, &scaled, &options.of(one), engine)?;
        generated.push(replay(one, &scaled, &found, heard, engine)?);
        recognitions.push(found);
    }
    let count = scaled.sequences().len();
    let mut sequences: Vec<Found> =
        (0..count).map(|s| summary_of_all(all, &data.sequences()[s], (&recognitions, &generated), s, heard)).collect();
    let by_likeness = alike::share_one_state(trained);
    if by_likeness {
        alike::rank(trained, data, heard, &mut sequences, (engine, messages))?;
    }
    if let Some(loops) = options.samples {
        let networks: Vec<_> = all.iter().map(Trained::network).collect();
        let mixture = members::mixed(all, &networks);
        let noise = (loops, options.seed);
        let completions = completing::complete(trained, (&mixture, &recognitions), (data, heard), noise, engine)?;
        for (found, completion) in sequences.iter_mut().zip(completions) {
            found.completion_error = completion.as_ref().map(|completion| completion.error);
            found.completion = completion;
        }
    }
    let means = (0..count).map(|s| mean_of_all(all, &generated, s)).collect();
    Ok(Recognised { sequences, by_likeness, all, data, heard, distribution: options.samples.is_some(), means })
}

impl Recognised<'_> {
    /// The best initial states: one row for each sequence, one column for each context unit.
    ///
    /// # Errors
    /// [`Failure::Input`] for a mixture, whose members have their own.
    pub fn states(&self) -> Result<Dataset> {
        let [trained] = self.all else {
            return Err(Failure::input("a mixture has no initial state of its own", "ask one of its members"));
        };
        let units: Vec<String> = trained.checkpoint.topology.groups().iter().flat_map(unit_names).collect();
        let of = |one: &Found| Sequence::new(one.sequence.clone(), units.len(), one.initial_state.clone());
        let rows = self.sequences.iter().map(of).collect::<scrnn::error::Result<_>>()?;
        Ok(Dataset::new(units.clone(), rows)?)
    }

    /// What was heard, followed by what the networks make of it: as one field without a name or, where samples were asked for, as a
    /// distribution.
    ///
    /// # Errors
    /// None that data of [`recognising`] can cause.
    pub fn completed(&self) -> Result<Fields> {
        if self.distribution {
            let completions: Vec<_> = self.sequences.iter().map(|one| one.completion.as_ref()).collect();
            return completing::fields(self.data, self.heard, &completions);
        }
        let (n, data) = (self.data.channels().len(), self.data);
        let delay = self.all.first().map_or(0, |trained| trained.checkpoint.topology.delay());
        let rows = data.sequences().iter().zip(&self.means).map(|(sequence, means)| {
            let known = self.heard.min(sequence.len());
            let mut values = sequence.values()[..known * n].to_vec();
            values.extend(&means[(known - delay) * n..(sequence.len() - delay) * n]);
            Sequence::new(sequence.name.clone(), n, values)
        });
        let rows = rows.collect::<scrnn::error::Result<_>>()?;
        Ok(vec![("", Dataset::new(data.channels().to_vec(), rows)?)])
    }
}

/// What was found for sequence `s` by one network, or by all members of a mixture: the likelihoods are those of the mean of the members'
/// densities, and the means those of their means.
fn summary_of_all(
    all: &[Trained],
    sequence: &Sequence,
    (recognitions, generated): (&[Vec<Recognition>], &[Vec<Generated>]),
    s: usize,
    heard: usize,
) -> Found {
    let mut each: Vec<Found> = (all.iter().zip(recognitions).zip(generated))
        .map(|((one, recognitions), generated)| {
            summary(one, sequence, &recognitions[s], &raw_means(one, &generated[s]), heard)
        })
        .collect();
    if let [_] = each.as_slice() {
        return each.swap_remove(0);
    }
    let mean = mean_of_all(all, generated, s);
    let mut found = summary(&all[0], sequence, &recognitions[0][s], &mean, heard);
    let delay = all[0].checkpoint.topology.delay();
    let terms = sequence.targets(delay, heard.min(sequence.len()) - delay).max(1) as f64;
    let mixed = |values: &[f64]| {
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = values.iter().map(|value| (terms * (value - largest)).exp()).sum::<f64>() / all.len() as f64;
        largest + mean.ln() / terms
    };
    let likelihoods: Option<Vec<f64>> = each.iter().map(|one| one.ln_likelihood).collect();
    found.ln_likelihood = likelihoods.map(|values| mixed(&values));
    for learned in &mut found.learned {
        let of = |one: &Found| one.learned.iter().find(|other| other.number == learned.number)?.ln_likelihood;
        // What a member does not rank is too unlikely to count.
        let values: Vec<f64> = each.iter().filter_map(of).collect();
        learned.ln_likelihood = (!values.is_empty()).then(|| mixed(&values));
    }
    let order = |a: &Learned, b: &Learned| {
        let value = |one: &Learned| one.ln_likelihood.unwrap_or(f64::NEG_INFINITY);
        value(b).total_cmp(&value(a))
    };
    found.learned.sort_by(order);
    found.start = format!("mixture of {}", all.len());
    (found.initial_state, found.trials) = (Vec::new(), Vec::new());
    found.members = each;
    found
}

/// The predicted means of sequence `s` in the data's units, averaged over the members.
fn mean_of_all(all: &[Trained], generated: &[Vec<Generated>], s: usize) -> Vec<f64> {
    let each: Vec<Vec<f64>> = all.iter().zip(generated).map(|(one, generated)| raw_means(one, &generated[s])).collect();
    match each.as_slice() {
        [one] => one.clone(),
        _ => (0..each[0].len()).map(|at| each.iter().map(|one| one[at]).sum::<f64>() / each.len() as f64).collect(),
    }
}

/// Runs each sequence from its best initial state: fed with what was heard, then with its own predictions.
fn replay(
    trained: &Trained,
    scaled: &Dataset,
    recognitions: &[Recognition],
    heard: usize,
    engine: &Engine,
) -> Result<Vec<Generated>> {
    let n = scaled.channels().len();
    let starts: Vec<Start<'_>> = recognitions
        .iter()
        .zip(scaled.sequences())
        .map(|(recognition, sequence)| Start {
            initial_state: &recognition.trials[0].initial_state,
            sensed: &sequence.values()[..heard.min(sequence.len()) * n],
        })
        .collect();
    let longest = scaled.sequences().iter().map(Sequence::len).max().unwrap_or(0);
    let steps = longest - trained.checkpoint.topology.delay();
    let options = GenerationOptions::new(steps, Feedback::mixed(n, 1.0, false)).seed(0);
    Ok(generate(&trained.network(), &starts, &options, engine)?)
}

fn summary(trained: &Trained, sequence: &Sequence, recognition: &Recognition, means: &[f64], heard: usize) -> Found {
    let checkpoint = &trained.checkpoint;
    let (n, delay) = (checkpoint.channels.len(), checkpoint.topology.delay());
    let heard = heard.min(sequence.len());
    // What is missing does not count.
    let terms = sequence.targets(delay, heard - delay).max(1) as f64;
    let per_value = |ln_likelihood: f64| checkpoint.topology.has_variance().then(|| ln_likelihood / terms);
    let error = |samples: std::ops::Range<usize>| {
        let predicted = &means[(samples.start - delay) * n..(samples.end - delay) * n];
        observed_error(&sequence.values()[samples.start * n..samples.end * n], predicted)
    };
    let best = &recognition.trials[0];
    Found {
        sequence: sequence.name.clone(),
        start: best.start.to_string(),
        ln_likelihood: per_value(best.ln_likelihood),
        error: error(delay..heard),
        completion_error: (heard < sequence.len()).then(|| error(heard..sequence.len())),
        completion: None,
        members: Vec::new(),
        initial_state: best.initial_state.clone(),
        learned: recognition
            .ranking
            .iter()
            .map(|ranked| Learned {
                number: ranked.sequence + 1,
                sequence: checkpoint.sequences[ranked.sequence].clone(),
                ln_likelihood: per_value(ranked.ln_likelihood),
                distance: None,
            })
            .collect(),
        trials: recognition
            .trials
            .iter()
            .map(|trial| Tried { start: trial.start.to_string(), ln_likelihood: per_value(trial.ln_likelihood) })
            .collect(),
    }
}

/// The predicted means in the data's units.
fn raw_means(trained: &Trained, generated: &Generated) -> Vec<f64> {
    let scaling = &trained.checkpoint.scaling;
    generated.mean.iter().enumerate().map(|(k, &mean)| scaling.to_raw(k % scaling.channels(), mean)).collect()
}
