//! Recognition (thesis 2.9): from a sequence back to the initial state that reproduces it.
//!
//! The ascent of learning, in u_0 only. All starts of all sequences are columns of one batch; each is moved by its own
//! Adam on ln L_all per step and channel, and its best state is kept.

use std::fmt;

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::initial_states::InitialStates;
use crate::network::Network;
use crate::objective::{Backend, Evaluation, Objective, Request, Run, Want};

/// A kind of starting point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WarmStart {
    /// All zeros.
    Zero,
    /// The mean of the learned initial states.
    Mean,
    /// The learned initial states, the one that explains the sequence best first.
    Learned,
    /// Drawn from the normal distribution with the learned states' mean and, unless
    /// [`RecognitionOptions::random_spread`] says otherwise, their variance in each unit.
    Random,
}

/// How to recognise.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognitionOptions {
    /// Starts for each sequence.
    pub starts: usize,
    /// Updates of each start.
    pub epochs: u64,
    /// Seed of the random starts.
    pub seed: u64,
    /// Standard deviation of the random starts in each unit, as a share of that of the learned states.
    pub random_spread: f64,
    /// Use the first so many samples only.
    pub observed: Option<usize>,
    /// The largest rate; it falls on a cosine.
    pub rate: f64,
    /// Decay of Adam's second moment. On the way from a wrong attractor to the right one the likelihood's slope falls by
    /// orders of magnitude: who remembers the first squares for long takes steps that are too small for all the rest.
    pub beta2: f64,
    /// sigma^2_IS of the prior around the learned mean.
    pub initial_state_variance: f64,
    /// Kinds of starts, taken in turn; zero and mean once, learned as often as there are sequences.
    pub warm_starts: Vec<WarmStart>,
}

impl Default for RecognitionOptions {
    fn default() -> Self {
        Self {
            starts: 20,
            epochs: 300,
            seed: 1,
            random_spread: 1.0,
            observed: None,
            rate: 0.1,
            beta2: 0.999,
            initial_state_variance: 1.0,
            warm_starts: vec![WarmStart::Zero, WarmStart::Mean, WarmStart::Learned, WarmStart::Random],
        }
    }
}

/// Where a trial began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialStart {
    /// All zeros.
    Zero,
    /// The mean of the learned initial states.
    Mean,
    /// The learned initial state of this sequence, from 0.
    Learned(usize),
    /// Drawn at random.
    Random,
}

impl fmt::Display for TrialStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Zero => f.write_str("zero"),
            Self::Mean => f.write_str("mean"),
            Self::Learned(s) => write!(f, "learned {}", s + 1),
            Self::Random => f.write_str("random"),
        }
    }
}

/// What one start ended in.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Where it began.
    pub start: TrialStart,
    /// u_0, N_C values.
    pub initial_state: Vec<f64>,
    /// ln L_out of the observed samples in nats; -E without variance units.
    pub ln_likelihood: f64,
    /// (3.5) in the network's units: half the squared error per step and channel.
    pub error: f64,
}

/// How well a learned initial state explains a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// The learned sequence, from 0.
    pub sequence: usize,
    /// ln L_out of the observed samples in nats.
    pub ln_likelihood: f64,
    /// (3.5) in the network's units.
    pub error: f64,
}

/// The result for one sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Recognition {
    /// All starts, the most likely first.
    pub trials: Vec<Trial>,
    /// The learned sequences, the most likely first.
    pub ranking: Vec<Ranked>,
}

/// Finds the initial states that explain the sequences of `data` (in the network's units).
///
/// # Errors
/// Data that do not fit the network, too few observed samples, or a setting out of range.
pub fn recognize(
    network: &Network,
    learned: &InitialStates,
    data: &Dataset,
    options: &RecognitionOptions,
    backend: &dyn Backend,
) -> Result<Vec<Recognition>> {
    check(network, data, options)?;
    let (topology, n_c) = (&network.topology, network.topology.context_units());
    let steps = |s: usize| {
        let length = data.sequences()[s].len();
        options.observed.map_or(length, |observed| observed.min(length)) - topology.delay()
    };
    let per_step = |s: usize| (steps(s) * topology.channels()) as f64;
    let sequences = data.sequences().len();

    let mut objective = backend.objective(&Request::new(topology, data))?;
    objective.set_parameters(&network.parameters);
    let mut found = Evaluation::new(topology);

    // Every learned initial state on every sequence.
    let mut rankings = vec![Vec::new(); sequences];
    for (s, ranking) in rankings.iter_mut().enumerate().filter(|_| learned.sequences() > 0) {
        let runs = vec![Run::new(s, steps(s)); learned.sequences()];
        objective.evaluate(&runs, learned.values(), Want::Score, &mut found);
        for sequence in 0..learned.sequences() {
            let error = found.squared_error[sequence] / (2.0 * per_step(s));
            ranking.push(Ranked { sequence, ln_likelihood: found.ln_likelihood[sequence], error });
        }
        ranking.sort_by(|a, b| b.ln_likelihood.total_cmp(&a.ln_likelihood));
    }

    let mut origins = Vec::new();
    let mut states = Vec::new();
    for (s, ranking) in rankings.iter().enumerate() {
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        random.set_stream(s as u64);
        for start in starts(options, ranking) {
            states.extend(initial_state(network, learned, start, options.random_spread, &mut random));
            origins.push((s, start));
        }
    }
    let runs: Vec<_> = origins.iter().map(|&(s, _)| Run::new(s, steps(s))).collect();
    let scales: Vec<f64> = origins.iter().map(|&(s, _)| per_step(s)).collect();
    let best = ascend(objective.as_mut(), &runs, learned.mean(), states, &scales, options, network);

    let mut results: Vec<Recognition> =
        rankings.into_iter().map(|ranking| Recognition { trials: Vec::new(), ranking }).collect();
    for (index, &(s, start)) in origins.iter().enumerate() {
        results[s].trials.push(Trial {
            start,
            initial_state: best.states[index * n_c..(index + 1) * n_c].to_vec(),
            ln_likelihood: best.ln_likelihood[index],
            error: best.squared_error[index] / (2.0 * scales[index]),
        });
    }
    for result in &mut results {
        result.trials.sort_by(|a, b| b.ln_likelihood.total_cmp(&a.ln_likelihood));
    }
    Ok(results)
}

fn check(network: &Network, data: &Dataset, options: &RecognitionOptions) -> Result<()> {
    data.check_for(&network.topology)?;
    let setting = |what, found: String, needed| Err(Error::Setting { what, found, needed });
    let delay = network.topology.delay();
    if options.observed.is_some_and(|observed| observed <= delay) {
        return setting("observed", format!("{:?}", options.observed), "more samples than the delay");
    }
    if options.starts == 0 {
        return setting("starts", "0".to_owned(), "at least 1");
    }
    if options.warm_starts.is_empty() {
        return setting("the list of starts", "empty".to_owned(), "at least one kind");
    }
    if !(0.0..1.0).contains(&options.beta2) {
        return setting("beta2", options.beta2.to_string(), "a number from 0 to below 1");
    }
    let spread = ("random_spread", options.random_spread);
    for (what, value) in [("rate", options.rate), ("initial_state_variance", options.initial_state_variance), spread] {
        if !(value > 0.0 && value.is_finite()) {
            return setting(what, value.to_string(), "a positive number");
        }
    }
    Ok(())
}

/// The starts of one sequence: the kinds in turn, each as often as it makes sense.
fn starts(options: &RecognitionOptions, ranking: &[Ranked]) -> Vec<TrialStart> {
    let mut starts = Vec::new();
    let mut round = 0;
    while starts.len() < options.starts {
        let before = starts.len();
        for kind in &options.warm_starts {
            let start = match kind {
                WarmStart::Zero if round == 0 => Some(TrialStart::Zero),
                WarmStart::Mean if round == 0 => Some(TrialStart::Mean),
                WarmStart::Learned => ranking.get(round).map(|ranked| TrialStart::Learned(ranked.sequence)),
                WarmStart::Random => Some(TrialStart::Random),
                _ => None,
            };
            starts.extend(start);
        }
        if starts.len() == before {
            break;
        }
        round += 1;
    }
    starts.truncate(options.starts);
    starts
}

fn initial_state(
    network: &Network,
    learned: &InitialStates,
    start: TrialStart,
    spread: f64,
    random: &mut ChaCha8Rng,
) -> Vec<f64> {
    let learns: Vec<bool> = network.topology.per_unit(|group| group.learns_initial_state).collect();
    let n = learned.sequences().max(1) as f64;
    let of = |i: usize| (0..learned.sequences()).map(move |s| learned.sequence(s)[i]);
    let draw = |i: usize, random: &mut ChaCha8Rng| {
        let mean = of(i).sum::<f64>() / n;
        let variance = of(i).map(|u| (u - mean).powi(2)).sum::<f64>() / n;
        // Even where nothing was learned, starts must differ.
        let z: f64 = StandardNormal.sample(random);
        mean + (spread * variance.sqrt()).max(1e-3) * z
    };
    (0..learns.len())
        .map(|i| match start {
            _ if !learns[i] => 0.0,
            TrialStart::Zero => 0.0,
            TrialStart::Mean => learned.mean()[i],
            TrialStart::Learned(s) => learned.sequence(s)[i],
            TrialStart::Random => draw(i, random),
        })
        .collect()
}

/// The best states met, and what they are worth.
struct Best {
    states: Vec<f64>,
    ln_likelihood: Vec<f64>,
    squared_error: Vec<f64>,
}

/// Adam on z, u_0 = mean + s z, s = min(sigma_IS, 1), as in learning.
fn ascend(
    objective: &mut dyn Objective,
    runs: &[Run],
    mean: &[f64],
    mut states: Vec<f64>,
    scales: &[f64],
    options: &RecognitionOptions,
    network: &Network,
) -> Best {
    let beta = (0.9, options.beta2);
    let n_c = mean.len();
    let learns: Vec<bool> = network.topology.per_unit(|group| group.learns_initial_state).collect();
    let variance = options.initial_state_variance;
    let s = variance.sqrt().min(1.0);
    let (mut first, mut second) = (vec![0.0; states.len()], vec![0.0; states.len()]);
    let count = scales.len();
    let mut best = Best {
        states: states.clone(),
        ln_likelihood: vec![f64::NEG_INFINITY; count],
        squared_error: vec![f64::INFINITY; count],
    };
    let mut found = Evaluation::new(&network.topology);
    for epoch in 0..=options.epochs {
        let want = if epoch < options.epochs { Want::InitialStates } else { Want::Score };
        objective.evaluate(runs, &states, want, &mut found);
        let phase = std::f64::consts::PI * epoch as f64 / options.epochs.max(1) as f64;
        let rate = options.rate * 0.5 * (1.0 + phase.cos());
        let correct = |beta: f64| 1.0 / (1.0 - beta.powf(epoch as f64 + 1.0));
        let (correct_first, correct_second) = (correct(beta.0), correct(beta.1));
        for (index, scale) in scales.iter().enumerate() {
            let own = index * n_c..(index + 1) * n_c;
            let ln_likelihood = found.ln_likelihood[index];
            if !ln_likelihood.is_finite() {
                // Out of bounds: back to the best, at rest.
                states[own.clone()].copy_from_slice(&best.states[own.clone()]);
                first[own.clone()].fill(0.0);
                second[own].fill(0.0);
                continue;
            }
            if ln_likelihood > best.ln_likelihood[index] {
                best.ln_likelihood[index] = ln_likelihood;
                best.squared_error[index] = found.squared_error[index];
                best.states[own.clone()].copy_from_slice(&states[own.clone()]);
            }
            for at in own {
                let i = at % n_c;
                if !learns[i] {
                    continue;
                }
                let pull = (states[at] - mean[i]) / variance;
                let g = s * (found.initial[at] - pull) / scale;
                first[at] = beta.0 * first[at] + (1.0 - beta.0) * g;
                second[at] = beta.1 * second[at] + (1.0 - beta.1) * g * g;
                let step = first[at] * correct_first / ((second[at] * correct_second).sqrt() + 1e-8);
                states[at] += s * rate * step;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Sequence;
    use crate::engine::Engine;
    use crate::generation::{Feedback, GenerationOptions, Start, generate};
    use crate::initialization::initialize;
    use crate::topology::{Group, Prediction, Topology};

    /// A network whose initial state shows in its output for a while, and sequences that it made itself.
    fn setting() -> (Network, InitialStates, Dataset) {
        let groups = vec![Group::full("context", 12, 8.0)];
        let topology = Topology::new(2, 1, groups, Prediction::Mean).unwrap();
        let (mut network, mut states) = initialize(&topology, 3, 2);
        network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 2.0);
        for (k, u) in states.values_mut().iter_mut().enumerate() {
            *u = (1.7 * k as f64).sin();
        }
        let feedback = Feedback::closed(2, false);
        let options = GenerationOptions { steps: 40, feedback, seed: 1, contexts: false };
        let start = |s: usize| Start { initial_state: states.sequence(s), sensed: &[0.2, -0.1] };
        let made = generate(&network, &[start(0), start(1), start(2)], &options, &Engine::serial()).unwrap();
        let sequence = |one: &crate::generation::Generated| {
            Sequence::new("", 2, [&[0.2, -0.1], one.mean.as_slice()].concat()).unwrap()
        };
        let data = Dataset::new(Dataset::numbered_channels(2), made.iter().map(sequence).collect()).unwrap();
        (network, states, data)
    }

    fn options() -> RecognitionOptions {
        RecognitionOptions { starts: 4, epochs: 150, initial_state_variance: 1e8, ..RecognitionOptions::default() }
    }

    #[test]
    fn the_ranking_knows_which_sequence_it_is() {
        let (network, states, data) = setting();
        let results = recognize(&network, &states, &data, &options(), &Engine::serial()).unwrap();
        for (s, result) in results.iter().enumerate() {
            assert_eq!(result.ranking[0].sequence, s);
            assert!(result.ranking[0].error < 1e-20 && result.ranking[1].error > 1e-6);
            assert!(result.trials.is_sorted_by(|a, b| a.ln_likelihood >= b.ln_likelihood));
        }
    }

    #[test]
    fn ascent_from_anywhere_explains_a_sequence_better() {
        let (network, states, data) = setting();
        let warm_starts = vec![WarmStart::Zero, WarmStart::Random];
        let ascended = RecognitionOptions { warm_starts: warm_starts.clone(), epochs: 400, ..options() };
        let untouched = RecognitionOptions { warm_starts, epochs: 0, ..options() };
        let run = |options| recognize(&network, &states, &data, options, &Engine::serial()).unwrap();
        for (after, before) in run(&ascended).iter().zip(run(&untouched)) {
            assert_eq!(after.trials.len(), 4);
            assert!(after.trials[0].ln_likelihood > before.trials[0].ln_likelihood);
            let (after, before) = (after.trials[0].error, before.trials[0].error);
            assert!(after < 0.1 * before, "{before} to {after}");
        }
    }

    #[test]
    fn starts_are_taken_in_turn_and_only_as_often_as_they_differ() {
        let ranked = |sequence| Ranked { sequence, ln_likelihood: 0.0, error: 0.0 };
        let of = |warm_starts: &[WarmStart]| {
            let options = RecognitionOptions { starts: 6, warm_starts: warm_starts.to_vec(), ..options() };
            starts(&options, &[ranked(2), ranked(0)]).iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let all = of(&[WarmStart::Zero, WarmStart::Learned, WarmStart::Random]);
        assert_eq!(all, ["zero", "learned 3", "random", "learned 1", "random", "random"]);
        assert_eq!(of(&[WarmStart::Mean, WarmStart::Learned]), ["mean", "learned 3", "learned 1"]);
    }

    #[test]
    fn only_observed_samples_count() {
        let (network, states, data) = setting();
        let cut = data.map(|_, x| x);
        let changed = {
            let mut values = data.sequences()[0].values().to_vec();
            values[2 * 20..].fill(0.9);
            Dataset::new(data.channels().to_vec(), vec![Sequence::new("", 2, values).unwrap()]).unwrap()
        };
        let observed = RecognitionOptions { observed: Some(20), ..options() };
        let run = |data: &Dataset, options| recognize(&network, &states, data, options, &Engine::serial()).unwrap();
        assert_eq!(run(&cut, &observed)[0], run(&changed, &observed)[0]);
        assert_ne!(run(&cut, &options())[0], run(&changed, &options())[0]);
    }

    #[test]
    fn random_starts_lie_as_far_apart_as_asked() {
        let (network, states, data) = setting();
        let distance = |random_spread: f64| -> f64 {
            let warm_starts = vec![WarmStart::Random];
            let drawn = RecognitionOptions { starts: 40, epochs: 0, random_spread, warm_starts, ..options() };
            let results = recognize(&network, &states, &data, &drawn, &Engine::serial()).unwrap();
            let average = |i: usize| (0..3).map(|s| states.sequence(s)[i]).sum::<f64>() / 3.0;
            let off = |(i, u): (usize, &f64)| (u - average(i)).powi(2);
            let trials = results.iter().flat_map(|result| &result.trials);
            trials.map(|trial| trial.initial_state.iter().enumerate().map(off).sum::<f64>()).sum::<f64>().sqrt()
        };
        // The same draws, each at a quarter of its distance.
        assert!((distance(0.25) / distance(1.0) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn senseless_requests_are_refused() {
        let (network, states, data) = setting();
        let refuse = |options: RecognitionOptions| {
            recognize(&network, &states, &data, &options, &Engine::serial()).unwrap_err().to_string()
        };
        assert!(refuse(RecognitionOptions { observed: Some(1), ..options() }).contains("more samples than the delay"));
        assert!(refuse(RecognitionOptions { starts: 0, ..options() }).contains("starts is 0"));
        assert!(refuse(RecognitionOptions { random_spread: 0.0, ..options() }).contains("random_spread is 0"));
        assert!(refuse(RecognitionOptions { beta2: 1.0, ..options() }).contains("beta2 is 1"));
    }
}
