//! Generation (thesis 2.8): the network runs on recorded samples, on its own predictions, or on a mixture.
//!
//! ```text
//! x_t = y-hat_{t-xi}                                        open loop (2.25a)
//! x_t = y_{t-xi} + eps_{t-xi},  eps ~ N(0, v_{t-xi})        closed loop (2.25b), (2.26)
//! ```
//!
//! Each channel has its own rule, and a mixing ratio between the two. The first xi inputs of a closed loop are sensed
//! samples where there are any, else 0; once sensed samples run out, the predictions are fed back. A sensed value that is missing
//! (NaN) is stood in for by the mean that was predicted for it, and where nothing was, by the channel's last input, or 0.

use pulp::{Simd, WithSimd};
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::engine::{Engine, Run};
use crate::error::{Error, Result};
use crate::features::{Features, Past};
use crate::network::Network;
use crate::packed::Packed;
use crate::stepper::Stepper;
use crate::streams::{Purpose, stream};

mod running;

pub use running::Running;

/// What one channel's input is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelFeedback {
    /// Share of the sensed sample: 1 is the open loop, 0 the closed loop.
    pub sensed: f64,
    /// Whether noise of the predicted variance is added to what is fed back.
    pub noise: bool,
}

/// One rule for each channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback(pub Vec<ChannelFeedback>);

impl Feedback {
    /// All channels sensed (2.25a). Samples are drawn around the predictions, but not fed back.
    #[must_use]
    pub fn open(channels: usize) -> Self {
        Self::mixed(channels, 1.0, true)
    }

    /// All channels predicted (2.25b).
    #[must_use]
    pub fn closed(channels: usize, noise: bool) -> Self {
        Self::mixed(channels, 0.0, noise)
    }

    /// All channels made of `sensed` parts of the sample and 1 - `sensed` parts of the prediction.
    #[must_use]
    pub fn mixed(channels: usize, sensed: f64, noise: bool) -> Self {
        Self(vec![ChannelFeedback { sensed, noise }; channels])
    }
}

/// Where one generated sequence starts.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    /// u_0, N_C values.
    pub initial_state: &'a [f64],
    /// Sensed samples x channels, row-major, in the network's units; may be empty. Sample k is the input of step k; NaN is a missing
    /// value.
    pub sensed: &'a [f64],
}

/// How to generate.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GenerationOptions {
    /// Steps to predict.
    pub steps: usize,
    /// Where inputs come from.
    pub feedback: Feedback,
    /// Seed of the noise; each start draws from a stream of its own.
    pub seed: u64,
    /// Whether to record the contexts.
    pub contexts: bool,
}

impl GenerationOptions {
    /// So many steps with these inputs; the noise has seed 1, and contexts are not recorded.
    #[must_use]
    pub fn new(steps: usize, feedback: Feedback) -> Self {
        Self { steps, feedback, seed: 1, contexts: false }
    }

    /// The same with another seed of the noise.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// The same with the contexts recorded, or not.
    #[must_use]
    pub fn contexts(mut self, contexts: bool) -> Self {
        self.contexts = contexts;
        self
    }
}

/// One generated sequence, in the network's units; row k is the prediction of sample k + xi.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Generated {
    /// y, `[steps, N_O]`.
    pub mean: Vec<f64>,
    /// v, `[steps, N_O]`; empty without variance units.
    pub variance: Vec<f64>,
    /// y plus noise where the channel asks for it, `[steps, N_O]`.
    pub sample: Vec<f64>,
    /// c, `[steps, N_C]`; empty unless asked for.
    pub contexts: Vec<f64>,
}

/// Columns that one thread steps at a time.
const COLUMNS: usize = 6;

/// Generates one sequence for each start; all run in one batch.
///
/// # Errors
/// [`Error::Length`] for an initial state, samples or a feedback of another size than the network's, and
/// [`Error::Setting`] for a share outside of [0, 1].
pub fn generate(
    network: &Network,
    starts: &[Start<'_>],
    options: &GenerationOptions,
    engine: &Engine,
) -> Result<Vec<Generated>> {
    let topology = &network.topology;
    let (n_x, n_c) = (topology.channels(), topology.context_units());
    let length = |what: String, found: usize, needed: usize| match found == needed {
        true => Ok(()),
        false => Err(Error::Length { what, found, needed }),
    };
    check(&options.feedback, n_x)?;
    for (index, start) in starts.iter().enumerate() {
        length(format!("initial state {index}"), start.initial_state.len(), n_c)?;
        let whole = start.sensed.len().next_multiple_of(n_x);
        length(format!("the sensed samples of start {index}"), start.sensed.len(), whole)?;
    }

    let mut packed = Packed::new(topology, engine.instruction_set());
    packed.fill(&network.parameters);
    let mut jobs: Vec<Job<'_>> = starts
        .chunks(COLUMNS)
        .enumerate()
        .map(|(index, starts)| Job { starts, first: index * COLUMNS, out: Vec::new() })
        .collect();
    let (delay, features, variance) = (topology.delay(), Features::new(topology), topology.has_variance());
    engine.for_each(&mut jobs, |job| {
        let (packed, features, starts, first) = (&packed, &features, job.starts, job.first);
        job.out = engine.instruction_set().run(Generate { packed, features, delay, variance, options, starts, first });
    });
    Ok(jobs.into_iter().flat_map(|job| job.out).collect())
}

/// Whether a feedback is one that a network of N_I channels can run with.
fn check(feedback: &Feedback, n_x: usize) -> Result<()> {
    if feedback.0.len() != n_x {
        return Err(Error::Length { what: "the feedback".to_owned(), found: feedback.0.len(), needed: n_x });
    }
    match feedback.0.iter().find(|channel| !(0.0..=1.0).contains(&channel.sensed)) {
        Some(bad) => {
            let (what, found) = ("the share of sensed input", bad.sensed.to_string());
            Err(Error::Setting { what, found, needed: "a number from 0 to 1" })
        }
        None => Ok(()),
    }
}

struct Job<'a> {
    starts: &'a [Start<'a>],
    /// Number of the first start.
    first: usize,
    out: Vec<Generated>,
}

struct Generate<'a> {
    packed: &'a Packed,
    features: &'a Features,
    delay: usize,
    variance: bool,
    options: &'a GenerationOptions,
    starts: &'a [Start<'a>],
    first: usize,
}

impl WithSimd for Generate<'_> {
    type Output = Vec<Generated>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Generated> {
        let Self { packed, features, delay, variance, options, starts, first } = self;
        let (n_y, columns) = (packed.n_y, starts.len());
        let mut stepper = Stepper::new(packed, columns);
        let mut out = vec![Generated::default(); columns];
        let mut random = Vec::with_capacity(columns);
        for (column, start) in starts.iter().enumerate() {
            stepper.start(packed, column, start.initial_state);
            random.push(stream(options.seed, Purpose::Generation, (first + column) as u64));
            out[column].mean.reserve_exact(options.steps * n_y);
            out[column].sample.reserve_exact(options.steps * n_y);
        }
        let mut past = vec![Past::new(features); columns];
        let (mut x, mut guess) = (vec![0.0; n_y], vec![0.0; n_y]);
        stepper.enter(simd, packed);
        for k in 0..options.steps {
            for (column, start) in starts.iter().enumerate() {
                let sensed = start.sensed.get(k * n_y..(k + 1) * n_y);
                let from = k.checked_sub(delay).map(|from| from * n_y..(from + 1) * n_y);
                let predicted = from.map(|from| (&out[column].sample[from.clone()], &out[column].mean[from]));
                x.copy_from_slice(past[column].at(0));
                self::input(&mut x, &options.feedback, sensed, predicted);
                past[column].push(&x);
                features.inputs(|back| past[column].at(back), stepper.input(packed, column));
            }
            stepper.step(simd, packed);
            for (column, out) in out.iter_mut().enumerate() {
                let (rho, exp_u) = (stepper.mean(packed, column), stepper.variance(packed, column));
                features.guess(|back| past[column].at(back), &mut guess);
                for (i, (&rho, rule)) in rho.iter().zip(&options.feedback.0).enumerate() {
                    let y = features.mean(i, guess[i], rho);
                    out.mean.push(y);
                    let mut sample = y;
                    if variance {
                        let v = features.variance(i, exp_u[i]);
                        out.variance.push(v);
                        sample = draw(&mut random[column], y, v, rule.noise);
                    }
                    out.sample.push(sample);
                }
                if options.contexts {
                    out.contexts.extend_from_slice(stepper.context(packed, column));
                }
            }
        }
        out
    }
}

/// Fills the input from what is sensed and what was predicted for it, a sample and its mean (2.25a), (2.25b). Without either it stays
/// what it was.
#[inline(always)]
fn input(input: &mut [f64], feedback: &Feedback, sensed: Option<&[f64]>, predicted: Option<(&[f64], &[f64])>) {
    for (i, (x, rule)) in input.iter_mut().zip(&feedback.0).enumerate() {
        let sensed = sensed.map(|sensed| sensed[i]);
        *x = match (sensed, predicted) {
            (Some(sensed), None) if !sensed.is_nan() => sensed,
            (Some(sensed), Some((sample, mean))) if sensed.is_nan() => mix(rule.sensed, mean[i], sample[i]),
            (Some(sensed), Some((sample, _))) => mix(rule.sensed, sensed, sample[i]),
            (None, Some((sample, _))) => sample[i],
            (_, None) => *x,
        };
    }
}

/// y, with noise of variance v (2.26). A number is drawn even if it is not used: which channels have noise does not
/// change the noise of others.
#[inline(always)]
fn draw(random: &mut ChaCha8Rng, y: f64, v: f64, noise: bool) -> f64 {
    let z: f64 = StandardNormal.sample(random);
    if noise { y + v.sqrt() * z } else { y }
}

/// `share` parts sensed, the rest predicted; the pure cases are exact.
#[inline(always)]
fn mix(share: f64, sensed: f64, predicted: f64) -> f64 {
    if share == 1.0 {
        sensed
    } else if share == 0.0 {
        predicted
    } else {
        share * sensed + (1.0 - share) * predicted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::InstructionSet;
    use crate::forward::Plain;
    use crate::initialization::initialize;
    use crate::topology::{Group, Prediction, Topology};

    pub(super) fn network(delay: usize, floor: f64) -> Network {
        let groups = vec![Group::fast(9, 2.0), Group::slow(4, 30.0)];
        let topology = Topology::new(2, delay, groups, Prediction::MeanAndVariance { floor }).unwrap();
        let mut network = initialize(&topology, 1, 4).0;
        network.parameters.as_mut_slice().iter_mut().for_each(|w| *w *= 1.5);
        network
    }

    pub(super) fn samples(count: usize) -> Vec<f64> {
        (0..2 * count).map(|k| 0.7 * (0.4 * k as f64).sin()).collect()
    }

    fn options(steps: usize, feedback: Feedback) -> GenerationOptions {
        GenerationOptions { steps, feedback, seed: 9, contexts: true }
    }

    pub(super) const U0: [f64; 13] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.9, 0.1];

    fn close(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13)
    }

    #[test]
    fn the_open_loop_is_the_plain_forward_pass() {
        let (network, sensed) = (network(3, 0.01), samples(40));
        let start = Start { initial_state: &U0, sensed: &sensed };
        let open = generate(&network, &[start], &options(40, Feedback::open(2)), &Engine::serial()).unwrap();
        let mut plain = Plain::at(&network, &U0);
        for (k, x) in sensed.chunks_exact(2).enumerate() {
            plain.advance(x);
            assert!(close(&open[0].mean[2 * k..2 * k + 2], &plain.y), "mean of step {k}");
            assert!(close(&open[0].variance[2 * k..2 * k + 2], &plain.v), "variance of step {k}");
            assert!(close(&open[0].contexts[13 * k..13 * (k + 1)], &plain.c), "context of step {k}");
        }
    }

    #[test]
    fn the_closed_loop_feeds_predictions_back_after_the_delay() {
        let (network, sensed) = (network(3, 0.0), samples(3));
        let start = Start { initial_state: &U0, sensed: &sensed };
        let closed = generate(&network, &[start], &options(30, Feedback::closed(2, false)), &Engine::serial()).unwrap();
        let mut plain = Plain::at(&network, &U0);
        let mut inputs = sensed.clone();
        for k in 0..30 {
            plain.advance(&inputs[2 * k..2 * k + 2]);
            inputs.extend_from_slice(&plain.y);
            assert!(close(&closed[0].mean[2 * k..2 * k + 2], &plain.y), "step {k}");
        }
        assert_eq!(closed[0].sample, closed[0].mean);
    }

    #[test]
    fn channels_mix_sensed_and_predicted_input_each_in_its_own_way() {
        let (network, sensed) = (network(1, 0.0), samples(20));
        let rule = |sensed| ChannelFeedback { sensed, noise: false };
        let feedback = Feedback(vec![rule(0.25), rule(1.0)]);
        let start = Start { initial_state: &U0, sensed: &sensed };
        let mixed = generate(&network, &[start], &options(20, feedback), &Engine::serial()).unwrap();
        let mut plain = Plain::at(&network, &U0);
        let mut last = None;
        for (k, x) in sensed.chunks_exact(2).enumerate() {
            let first = last.map_or(x[0], |y: f64| 0.25 * x[0] + 0.75 * y);
            plain.advance(&[first, x[1]]);
            last = Some(plain.y[0]);
            assert!(close(&mixed[0].mean[2 * k..2 * k + 2], &plain.y), "step {k}");
        }
    }

    #[test]
    fn noise_has_the_predicted_variance_and_follows_the_seed() {
        let network = network(1, 0.0);
        let start = Start { initial_state: &U0, sensed: &[] };
        let generate = |seed, engine: &Engine| {
            let options = GenerationOptions { seed, ..options(4000, Feedback::closed(2, true)) };
            super::generate(&network, &[start; 9], &options, engine).unwrap()
        };
        let first = generate(1, &Engine::serial());
        let z: Vec<f64> = (first.iter())
            .flat_map(|one| one.sample.iter().zip(&one.mean).zip(&one.variance).map(|((s, y), v)| (s - y) / v.sqrt()))
            .collect();
        let n = z.len() as f64;
        let (mean, square) = (z.iter().sum::<f64>() / n, z.iter().map(|z| z * z).sum::<f64>() / n);
        assert!(mean.abs() < 5.0 / n.sqrt() && (square - 1.0).abs() < 8.0 / n.sqrt(), "{mean} {square}");
        let threads = Engine::new(3, InstructionSet::best()).unwrap();
        assert!(generate(1, &threads) == first && generate(2, &threads) != first);
        assert_ne!(first[0].sample, first[1].sample);
    }

    #[test]
    fn requests_of_the_wrong_size_are_refused() {
        let network = network(1, 0.0);
        let refuse = |state: &[f64], sensed: &[f64], feedback: Feedback| {
            let start = Start { initial_state: state, sensed };
            generate(&network, &[start], &options(3, feedback), &Engine::serial()).unwrap_err().to_string()
        };
        assert!(refuse(&U0[1..], &[], Feedback::open(2)).starts_with("initial state 0 holds 12 values; needed: 13"));
        assert!(refuse(&U0, &[1.0], Feedback::open(2)).contains("sensed samples of start 0 holds 1"));
        assert!(refuse(&U0, &[], Feedback::open(3)).contains("the feedback holds 3 values; needed: 2"));
        assert!(refuse(&U0, &[], Feedback::mixed(2, 1.5, true)).contains("is 1.5; needed: a number from 0 to 1"));
    }
}
