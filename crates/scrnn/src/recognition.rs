//! Recognition (thesis 2.9): from a sequence back to the initial state that reproduces it.
//!
//! ```text
//! u_0 = arg max ln L_all,   ln L_all = ln L_out(sequence | u_0) + ln L_init(u_0)       (2.11), (2.16), (2.15)
//! ```
//!
//! The ascent of learning, in u_0 only. All starts of all sequences are columns, each moved by its own Adam on ln L_all per step and
//! channel, and its best state is kept. The best start of each sequence is the one of the highest ln L_all, which is what was climbed;
//! it is then polished by L-BFGS until nothing to speak of is gained. Columns do not know of each other: neither threads nor
//! which other sequences are recognised change a bit.

use std::fmt;

use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::initial_states::{InitialStates, add_ln_prior};
use crate::network::Network;
use crate::objective::{Backend, Evaluation, Objective, Request, Run, Want};
use crate::streams::{Purpose, stream};

mod ascent;
mod polish;

pub use polish::Polish;

/// A kind of starting point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
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
#[non_exhaustive]
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
    /// Decay of Adam's second moment. From a wrong attractor to the right one the likelihood's slope falls by orders of
    /// magnitude. With a long memory of the first squared slopes, all later steps would be too small.
    pub beta2: f64,
    /// sigma^2_IS of the prior around the learned mean.
    pub initial_state_variance: f64,
    /// The most updates of L-BFGS for the best start; 0 leaves it as it is.
    pub polish: u64,
    /// Where the polish ends: ten updates together gained at most this, in nats per step and channel.
    pub tolerance: f64,
    /// The most learned sequences that a ranking keeps, the most likely ones.
    pub ranked: usize,
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
            polish: 500,
            tolerance: 1e-10,
            ranked: 100,
            warm_starts: vec![WarmStart::Zero, WarmStart::Mean, WarmStart::Learned, WarmStart::Random],
        }
    }
}

/// Where a trial began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
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
#[non_exhaustive]
pub struct Trial {
    /// Where it began.
    pub start: TrialStart,
    /// u_0, N_C values.
    pub initial_state: Vec<f64>,
    /// ln L_out of the observed samples in nats (2.11); -E without variance units. Minus infinity if it never was a finite number.
    pub ln_likelihood: f64,
    /// ln L_init of the initial state in nats (2.16), constant included.
    pub ln_prior: f64,
    /// (3.5) in the network's units: half the squared error per step and channel.
    pub error: f64,
}

impl RecognitionOptions {
    /// The defaults with some of them changed.
    #[must_use]
    pub fn with(change: impl FnOnce(&mut Self)) -> Self {
        let mut options = Self::default();
        change(&mut options);
        options
    }
}

impl Trial {
    /// ln L_all = ln L_out + ln L_init in nats (2.15): what the ascent climbs, and what trials are ordered by.
    #[must_use]
    pub fn ln_joint(&self) -> f64 {
        self.ln_likelihood + self.ln_prior
    }
}

/// How well a learned initial state explains a sequence.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Ranked {
    /// The learned sequence, from 0.
    pub sequence: usize,
    /// ln L_out of the observed samples in nats; minus infinity if it is not finite.
    pub ln_likelihood: f64,
    /// (3.5) in the network's units.
    pub error: f64,
}

/// The result for one sequence.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Recognition {
    /// All starts, that of the highest ln L_all first; it is the one that was polished.
    pub trials: Vec<Trial>,
    /// The learned sequences, the most likely first. The prior has no say here: all of them are equally likely before a sample is
    /// seen.
    pub ranking: Vec<Ranked>,
    /// How the polish of the best start ended.
    pub polish: Polish,
}

/// Finds the initial states that explain the sequences of `data` (in the network's units).
///
/// # Errors
/// Data or initial states that do not fit the network, too few observed samples, or a setting out of range.
pub fn recognize(
    network: &Network,
    learned: &InitialStates,
    data: &Dataset,
    options: &RecognitionOptions,
    backend: &dyn Backend,
) -> Result<Vec<Recognition>> {
    check(network, learned, data, options)?;
    if options.initial_state_variance == 0.0 && options.warm_starts != [WarmStart::Mean] {
        // All sequences share one initial state: there is nothing to look for.
        let options = RecognitionOptions {
            starts: 1,
            epochs: 0,
            polish: 0,
            warm_starts: vec![WarmStart::Mean],
            ..options.clone()
        };
        return recognize(network, learned, data, &options, backend);
    }
    let learns = network.topology.per_unit(|group| group.learns_initial_state).collect();
    let problem = Problem { network, data, options, mean: learned.mean(), learns };
    let mut objective = backend.objective(&Request::new(&network.topology, data))?;
    objective.set_parameters(&network.parameters);
    let objective = objective.as_mut();
    let mut results: Vec<Recognition> = Vec::with_capacity(data.sequences().len());
    let places = Places::new(learned, &problem.learns, options.random_spread);
    let (mut waiting, width) = (Vec::new(), problem.columns_at_a_time());
    for (s, mut ranking) in problem.rank(learned, objective).into_iter().enumerate() {
        let starts = starts(options, &ranking);
        ranking.truncate(options.ranked);
        ranking.shrink_to_fit();
        results.push(Recognition { trials: Vec::with_capacity(starts.len()), ranking, polish: Polish::default() });
        let mut random = stream(options.seed, Purpose::RecognitionStarts, s as u64);
        for start in starts {
            waiting.push(Origin { sequence: s, start, state: places.state(start, &mut random) });
            if waiting.len() == width {
                ascent::ascend(&problem, objective, &mut waiting, &mut results);
            }
        }
    }
    ascent::ascend(&problem, objective, &mut waiting, &mut results);
    for result in &mut results {
        result.trials.sort_by(|a, b| b.ln_joint().total_cmp(&a.ln_joint()));
    }
    polish::polish(&problem, objective, &mut results);
    Ok(results)
}

fn check(network: &Network, learned: &InitialStates, data: &Dataset, options: &RecognitionOptions) -> Result<()> {
    data.check_for(&network.topology)?;
    let (found, needed) = (learned.mean().len(), network.topology.context_units());
    if found != needed {
        return Err(Error::Length { what: "the mean of the learned initial states".to_owned(), found, needed });
    }
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
    if learned.sequences() == 0 && options.warm_starts.iter().all(|kind| *kind == WarmStart::Learned) {
        return setting("the list of starts", "learned states, of which there are none".to_owned(), "another kind");
    }
    if !(0.0..1.0).contains(&options.beta2) {
        return setting("beta2", options.beta2.to_string(), "a number from 0 to below 1");
    }
    let spread = ("random_spread", options.random_spread);
    let variance = options.initial_state_variance;
    if !(variance >= 0.0 && variance.is_finite()) {
        return setting("initial_state_variance", variance.to_string(), "0 or a positive number");
    }
    for (what, value) in [("rate", options.rate), spread] {
        if !(value > 0.0 && value.is_finite()) {
            return setting(what, value.to_string(), "a positive number");
        }
    }
    if !(options.tolerance >= 0.0 && options.tolerance.is_finite()) {
        return setting("tolerance", options.tolerance.to_string(), "0 or a positive number");
    }
    Ok(())
}

/// Where a column begins.
struct Origin {
    sequence: usize,
    start: TrialStart,
    /// u_0.
    state: Vec<f64>,
}

/// What is known to all columns.
struct Problem<'a> {
    network: &'a Network,
    data: &'a Dataset,
    options: &'a RecognitionOptions,
    /// u of the prior.
    mean: &'a [f64],
    /// Whether a unit's initial state is looked for.
    learns: Vec<bool>,
}

/// Bytes that columns may take at a time: each has states, gradients and moments of its own, and a backend may put the samples of all
/// runs side by side. Memory would grow with the number of starts if all ran at once.
const AT_A_TIME: usize = 32 << 20;
/// Columns that run at once even so: a block of them shares its weights.
const BLOCK: usize = 6;

impl Problem<'_> {
    /// Predicted steps of a sequence.
    fn steps(&self, s: usize) -> usize {
        let length = self.data.sequences()[s].len();
        self.options.observed.map_or(length, |observed| observed.min(length)) - self.network.topology.delay()
    }

    /// Steps times channels, less what is missing: what a value per step and channel is divided by.
    fn terms(&self, s: usize) -> f64 {
        self.data.sequences()[s].targets(self.network.topology.delay(), self.steps(s)).max(1) as f64
    }

    /// How many columns may run at once. The same for any number of threads, though no bit depends on it.
    fn columns_at_a_time(&self) -> usize {
        let longest = (0..self.data.sequences().len()).map(|s| self.steps(s)).max().unwrap_or(0);
        let topology = &self.network.topology;
        let samples = (longest + topology.delay()) * topology.channels();
        // States, gradients and moments, the pairs of the polish, and what a block holds for each column.
        let own = (8 + 2 * polish::MEMORY) * (topology.context_units() + topology.channels());
        (AT_A_TIME / ((samples + own) * size_of::<f64>())).max(BLOCK)
    }

    /// A run through each of these sequences.
    fn runs(&self, sequences: impl Iterator<Item = usize>) -> Vec<Run> {
        sequences.map(|s| Run::new(s, self.steps(s))).collect()
    }

    /// ln L_init of one initial state.
    fn ln_prior(&self, u0: &[f64]) -> f64 {
        add_ln_prior(0.0, &self.network.topology, self.options.initial_state_variance, u0, self.mean)
    }

    /// s of u_0 = mean + s z, which no prior makes stiff: s = min(sigma_IS, 1), as in learning.
    fn scale(&self) -> f64 {
        self.options.initial_state_variance.sqrt().min(1.0)
    }

    /// d ln L_all / dz of unit `i`, where `gradient` is d ln L_out / d u_0.
    fn slope(&self, i: usize, gradient: f64, u0: f64) -> f64 {
        if self.options.initial_state_variance == 0.0 {
            return 0.0;
        }
        let pull = (u0 - self.mean[i]) / self.options.initial_state_variance;
        self.scale() * (gradient - pull)
    }

    /// The units whose initial state is looked for.
    fn units(&self) -> impl Iterator<Item = usize> {
        (0..self.learns.len()).filter(|i| self.learns[*i])
    }

    /// Every learned initial state on every sequence; of each sequence the best, as many as are reported or started from.
    fn rank(&self, learned: &InitialStates, objective: &mut dyn Objective) -> Vec<Vec<Ranked>> {
        let (sequences, count) = (self.data.sequences().len(), learned.sequences());
        let kept = self.options.ranked.max(self.options.starts).min(count);
        let mut rankings = Vec::with_capacity(sequences);
        let mut ranking = Vec::with_capacity(count);
        if count == 0 {
            return vec![Vec::new(); sequences];
        }
        let pairs = sequences * count;
        let width = self.columns_at_a_time();
        let mut found = Evaluation::new(&self.network.topology);
        for first in (0..pairs).step_by(width) {
            let pairs = first..(first + width).min(pairs);
            let runs = self.runs(pairs.clone().map(|pair| pair / count));
            let initial: Vec<f64> = pairs.clone().flat_map(|pair| learned.sequence(pair % count)).copied().collect();
            objective.evaluate(&runs, &initial, Want::Score, &mut found);
            for (index, pair) in pairs.enumerate() {
                let ln_likelihood = found.ln_likelihood[index];
                ranking.push(Ranked {
                    sequence: pair % count,
                    ln_likelihood: if ln_likelihood.is_finite() { ln_likelihood } else { f64::NEG_INFINITY },
                    error: found.squared_error[index] / (2.0 * self.terms(pair / count)),
                });
                if ranking.len() == count {
                    ranking.sort_by(|a: &Ranked, b| b.ln_likelihood.total_cmp(&a.ln_likelihood));
                    rankings.push(ranking[..kept].to_vec());
                    ranking.clear();
                }
            }
        }
        rankings
    }
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

/// Where starts lie.
struct Places<'a> {
    learned: &'a InitialStates,
    learns: &'a [bool],
    /// Mean and standard deviation of the random starts in each unit.
    normal: Vec<(f64, f64)>,
}

impl<'a> Places<'a> {
    fn new(learned: &'a InitialStates, learns: &'a [bool], spread: f64) -> Self {
        let n = learned.sequences().max(1) as f64;
        let normal = |i: usize| {
            let of = || (0..learned.sequences()).map(|s| learned.sequence(s)[i]);
            let mean = of().sum::<f64>() / n;
            let variance = of().map(|u| (u - mean).powi(2)).sum::<f64>() / n;
            // Even where nothing was learned, starts must differ.
            (mean, (spread * variance.sqrt()).max(1e-3))
        };
        Self { learned, learns, normal: (0..learns.len()).map(normal).collect() }
    }

    /// u_0 of a start.
    fn state(&self, start: TrialStart, random: &mut ChaCha8Rng) -> Vec<f64> {
        let draw = |i: usize, random: &mut ChaCha8Rng| {
            let z: f64 = StandardNormal.sample(random);
            self.normal[i].0 + self.normal[i].1 * z
        };
        let unit = |i: usize| match start {
            _ if !self.learns[i] => 0.0,
            TrialStart::Zero => 0.0,
            TrialStart::Mean => self.learned.mean()[i],
            TrialStart::Learned(s) => self.learned.sequence(s)[i],
            TrialStart::Random => draw(i, random),
        };
        (0..self.learns.len()).map(unit).collect()
    }
}

#[cfg(test)]
mod tests;
