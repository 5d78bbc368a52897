//! How a network does on sequences that it did not learn, beside simple models that were fitted to what it learned.
//!
//! One step ahead it starts from the mean of the learned initial states, listens to a first part of each sequence (the burn-in), and is
//! scored on the rest. In the closed loop it hears a part of each sequence and goes on alone: several copies, each with its own predicted
//! noise, whose moments are the prediction. The mean of a mixture of Gaussians is the mean of their means; its variance is the mean of
//! their variances and the spread of their means.
//!
//! Everything is in scaled units. Samples that are missing (not a number) are not scored.

use std::ops::Range;

use scrnn::analysis::baselines::Linear;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::recognition::{RecognitionOptions, recognize};
use serde::Serialize;

use crate::assessment::{self, Predictions};
use crate::failure::{Failure, Result};

pub mod labels;
mod report;

pub use report::{Channel, ChannelCalibration, Horizon, Report, Steps};

/// Samples that the linear predictor looks at.
pub const LAGS: usize = 4;
/// Steps after which the closed loop's distance is told.
pub const HORIZONS: [usize; 3] = [1, 5, 20];

/// How well samples were predicted one step ahead, per step and channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OneStep {
    /// Nats; none without a variance, or without a bound.
    pub nll: Option<f64>,
    /// Mean squared error.
    pub mse: f64,
}

impl OneStep {
    /// Of errors and variances.
    pub fn of(predictions: &Predictions) -> Self {
        let squares: f64 = predictions.errors.iter().map(|error| error * error).sum();
        Self { nll: predictions.nll().filter(|nll| nll.is_finite()), mse: squares / predictions.errors.len() as f64 }
    }

    /// Whether this is better than `other`: by the nll where both have one, else by the squared error.
    pub fn beats(&self, other: &Self) -> bool {
        match (self.nll, other.nll) {
            (Some(nll), Some(other)) => nll < other,
            _ => self.mse < other.mse,
        }
    }
}

/// The first scored sample of each sequence: after this share of it, and late enough for the linear predictor.
pub fn starts(data: &Dataset, delay: usize, share: f64) -> Vec<usize> {
    let start = |sequence: &Sequence| {
        let after = (share * sequence.len() as f64).ceil() as usize;
        after.max(delay + LAGS - 1).min(sequence.len() - 1).max(delay)
    };
    data.sequences().iter().map(start).collect()
}

/// From these samples of each sequence to its end.
pub fn to_the_end(data: &Dataset, starts: &[usize]) -> Vec<Range<usize>> {
    data.sequences().iter().zip(starts).map(|(sequence, &start)| start..sequence.len()).collect()
}

/// A network with the initial states that it learned.
#[derive(Debug, Clone, Copy)]
pub struct Member<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its initial states.
    pub states: &'a InitialStates,
}

/// One step ahead of some samples, by one network or by a mixture.
#[derive(Debug, Clone)]
pub struct Ahead {
    /// Errors of the mean of the members' means, and the variance of their mixture.
    pub moments: Predictions,
    /// -ln of the mean of the members' densities, in nats per step and channel; none without variance units.
    pub nll: Option<f64>,
}

impl Ahead {
    /// Mixes what each member predicted of the same samples, each with the same weight. All channels of a sample are of one member.
    fn mixed(each: &[Predictions], channels: usize) -> Self {
        let [first, rest @ ..] = each else {
            return Self { moments: Predictions { errors: Vec::new(), variances: Vec::new() }, nll: None };
        };
        if rest.is_empty() {
            return Self { moments: first.clone(), nll: first.nll() };
        }
        let m = each.len() as f64;
        let mean = |at: usize| each.iter().map(|one| one.errors[at]).sum::<f64>() / m;
        let errors: Vec<f64> = (0..first.errors.len()).map(mean).collect();
        let variance = |at: usize| {
            each.iter().map(|one| one.variances[at] + (one.errors[at] - errors[at]).powi(2)).sum::<f64>() / m
        };
        let variances: Vec<f64> = (0..first.variances.len()).map(variance).collect();
        let moments = Predictions { errors, variances };
        let nll = mixture_nll(each, channels);
        Self { moments, nll }
    }

    /// Nats and squared error.
    pub fn one_step(&self) -> OneStep {
        OneStep { nll: self.nll.filter(|nll| nll.is_finite()), ..OneStep::of(&self.moments) }
    }
}

/// -ln of the mean of the members' densities of each sample, in nats per step and channel. Where values are missing, what is scored
/// does not come in whole samples, and each value counts by itself.
fn mixture_nll(each: &[Predictions], channels: usize) -> Option<f64> {
    let values = each.iter().map(|one| one.variances.len()).min().filter(|values| *values > 0)?;
    let together = if values.is_multiple_of(channels) { channels } else { 1 };
    let ln_density = |one: &Predictions, at: usize| {
        let (e, v) = (one.errors[at], one.variances[at]);
        -0.5 * ((std::f64::consts::TAU * v).ln() + e * e / v)
    };
    let mut sum = 0.0;
    for first in (0..values).step_by(together) {
        let members: Vec<f64> =
            each.iter().map(|one| (first..first + together).map(|at| ln_density(one, at)).sum()).collect();
        let largest = members.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = members.iter().map(|ln| (ln - largest).exp()).sum::<f64>() / members.len() as f64;
        sum -= largest + mean.ln();
    }
    Some(sum / values as f64)
}

/// Sequences to judge networks by.
#[derive(Debug)]
pub struct Bench {
    /// Scaled as what was learned.
    pub data: Dataset,
    /// Fitted to what was learned.
    pub models: SimpleModels,
    /// Share of each sequence that is listened to before predictions count.
    pub burn_in: f64,
    /// Share of each sequence that is heard before the closed loop, and from which states are recognised.
    pub observed: f64,
    /// The samples of each sequence that count one step ahead, from the mean initial state.
    pub scored: Vec<Range<usize>>,
    /// How many samples of each sequence are heard.
    pub heard: Vec<usize>,
    delay: usize,
    seed: u64,
    engine: Engine,
}

/// How hard states are searched for.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Starts for each sequence.
    pub starts: usize,
    /// Updates of each.
    pub epochs: u64,
    /// sigma^2_IS of the prior.
    pub initial_state_variance: f64,
}

impl Bench {
    /// For `data` in scaled units, and a network of this delay.
    ///
    /// # Errors
    /// [`Failure::Input`] for a sequence that is too short to judge anything by.
    pub fn new(
        data: Dataset,
        models: SimpleModels,
        (burn_in, observed): (f64, f64),
        (delay, seed): (usize, u64),
        engine: &Engine,
    ) -> Result<Self> {
        let needed = delay + LAGS;
        if let Some(short) = data.sequences().iter().find(|sequence| sequence.len() <= needed) {
            let message = format!("sequence {} has only {} samples to judge by", short.name, short.len());
            return Err(Failure::input(message, format!("needed: at least {}", needed + 1)));
        }
        let scored = to_the_end(&data, &starts(&data, delay, burn_in));
        let heard = starts(&data, delay, observed);
        Ok(Self { data, models, burn_in, observed, scored, heard, delay, seed, engine: engine.clone() })
    }

    /// One step ahead of these samples, from the mean initial state.
    pub fn from_mean(&self, members: &[Member<'_>], scored: &[Range<usize>]) -> Result<Ahead> {
        let of = |member: &Member<'_>| {
            let states = vec![member.states.mean(); self.data.sequences().len()];
            self.ahead(member.network, &states, scored)
        };
        let each = members.iter().map(of).collect::<Result<Vec<_>>>()?;
        Ok(Ahead::mixed(&each, self.data.channels().len()))
    }

    /// One step ahead of what comes after the part that is heard, from each member's own states.
    pub fn from_states(&self, members: &[Member<'_>], states: &[Vec<Vec<f64>>]) -> Result<Ahead> {
        let scored = to_the_end(&self.data, &self.heard);
        let of = |(member, states): (&Member<'_>, &Vec<Vec<f64>>)| {
            let states: Vec<&[f64]> = states.iter().map(Vec::as_slice).collect();
            self.ahead(member.network, &states, &scored)
        };
        let each = members.iter().zip(states).map(of).collect::<Result<Vec<_>>>()?;
        Ok(Ahead::mixed(&each, self.data.channels().len()))
    }

    /// One step ahead of what is scored, from the mean initial state: for each sequence, the errors and variances of each channel.
    pub fn sequence_by_sequence(&self, members: &[Member<'_>]) -> Result<Vec<Vec<Predictions>>> {
        let ahead = self.from_mean(members, &self.scored)?.moments;
        let n = self.data.channels().len();
        let mut pairs = ahead.errors.iter().zip(&ahead.variances);
        let mut all = Vec::with_capacity(self.data.sequences().len());
        for (sequence, range) in self.data.sequences().iter().zip(&self.scored) {
            let mut channels = vec![Predictions { errors: Vec::new(), variances: Vec::new() }; n];
            for k in range.clone() {
                let there = sequence.sample(k).iter().enumerate().filter(|(_, target)| !target.is_nan());
                for ((i, _), (error, variance)) in there.zip(&mut pairs) {
                    channels[i].errors.push(*error);
                    channels[i].variances.push(*variance);
                }
            }
            all.push(channels);
        }
        Ok(all)
    }

    fn ahead(&self, network: &Network, states: &[&[f64]], scored: &[Range<usize>]) -> Result<Predictions> {
        let open = assessment::open_loop(network, states, &self.data, &self.engine)?;
        Ok(Predictions::of_ranges(&open, &self.data, (self.delay, scored)))
    }

    /// What `copies` closed loops of each member make of the rest of the first `sequences` sequences, from each member's states or,
    /// without them, from the means.
    pub fn rests(
        &self,
        members: &[Member<'_>],
        states: Option<&[Vec<Vec<f64>>]>,
        (sequences, copies): (usize, usize),
    ) -> Result<Vec<Rest>> {
        let rest = |(s, sequence): (usize, &Sequence)| {
            let mut loops = Vec::new();
            for (m, member) in members.iter().enumerate() {
                let state = states.map_or(member.states.mean(), |states| &states[m][s]);
                let copies = if member.network.topology().has_variance() { copies } else { 1 };
                let part = (sequence.values(), self.heard[s], sequence.len() - self.delay);
                loops.extend(alone(
                    member.network,
                    &vec![state; copies],
                    part,
                    self.seed.wrapping_add(m as u64),
                    &self.engine,
                )?);
            }
            Ok(Rest::of(&loops, (self.heard[s] - self.delay) * self.data.channels().len()))
        };
        self.data.sequences().iter().take(sequences).enumerate().map(rest).collect()
    }

    /// The closed loops of the first `sequences` sequences beside what really followed.
    pub fn closed_loop(
        &self,
        members: &[Member<'_>],
        states: Option<&[Vec<Vec<f64>>]>,
        (sequences, copies): (usize, usize),
    ) -> Result<ClosedLoop> {
        let rests = self.rests(members, states, (sequences, copies))?;
        Ok(closed_loop(&self.data, &self.heard, &rests, &self.models))
    }

    /// For each member, the initial states that explain the part of each sequence that is heard best.
    pub fn recognised(&self, members: &[Member<'_>], search: Search) -> Result<Vec<Vec<Vec<f64>>>> {
        let of = |member: &Member<'_>| {
            let states = self.data.sequences().iter().zip(&self.heard).map(|(sequence, &heard)| {
                let data = Dataset::new(self.data.channels().to_vec(), vec![sequence.truncated(heard)])?;
                let options = RecognitionOptions::with(|it| {
                    it.starts = search.starts;
                    it.epochs = search.epochs;
                    it.polish = 100;
                    it.initial_state_variance = search.initial_state_variance;
                });
                let mut found = recognize(member.network, member.states, &data, &options, &self.engine)?;
                Ok(found.swap_remove(0).trials.swap_remove(0).initial_state)
            });
            states.collect::<Result<Vec<_>>>()
        };
        members.iter().map(of).collect()
    }
}

/// Models without a memory to speak of, fitted to the learned sequences.
#[derive(Debug, Clone)]
pub struct SimpleModels {
    /// Mean and variance of each channel.
    pub moments: Vec<(f64, f64)>,
    /// Linear in the last [`LAGS`] samples that are known; none if there were too few samples.
    pub linear: Option<Linear>,
}

impl SimpleModels {
    /// Fits them to the samples that a network of this delay predicts.
    pub fn fit(learned: &Dataset, delay: usize) -> Self {
        let n = learned.channels().len();
        let moments = |i: usize| {
            let samples = || {
                let of = |sequence| (delay..Sequence::len(sequence)).map(move |k| sequence.sample(k)[i]);
                learned.sequences().iter().flat_map(of).filter(|value| value.is_finite())
            };
            let count = samples().count() as f64;
            let mean = samples().sum::<f64>() / count;
            (mean, samples().map(|value| (value - mean).powi(2)).sum::<f64>() / count)
        };
        Self { moments: (0..n).map(moments).collect(), linear: Linear::fit(learned, delay, LAGS) }
    }

    /// Always the channel's mean and variance.
    pub fn constant(&self, data: &Dataset, scored: &[Range<usize>]) -> OneStep {
        let variances: Vec<f64> = self.moments.iter().map(|moments| moments.1).collect();
        let means: Vec<f64> = self.moments.iter().map(|moments| moments.0).collect();
        OneStep::of(&gathered(data, scored, &variances, |_, _| means.clone()))
    }

    /// Linear in the last samples; none where it could not be fitted.
    pub fn linear(&self, data: &Dataset, scored: &[Range<usize>]) -> Option<OneStep> {
        let linear = self.linear.as_ref()?;
        let scored: Vec<Range<usize>> =
            scored.iter().map(|range| range.start.max(linear.first())..range.end.max(linear.first())).collect();
        let predictions = gathered(data, &scored, linear.variances(), |sequence, k| linear.predict(sequence, k));
        (!predictions.errors.is_empty()).then(|| OneStep::of(&predictions))
    }
}

/// Errors of a model of constant variances on the scored samples that are there.
fn gathered(
    data: &Dataset,
    scored: &[Range<usize>],
    variances: &[f64],
    predict: impl Fn(&Sequence, usize) -> Vec<f64>,
) -> Predictions {
    let mut all = Predictions { errors: Vec::new(), variances: Vec::new() };
    for (sequence, range) in data.sequences().iter().zip(scored) {
        for k in range.clone() {
            let predicted = predict(sequence, k);
            for ((target, mean), variance) in sequence.sample(k).iter().zip(predicted).zip(variances) {
                let error = target - mean;
                if !error.is_nan() {
                    all.errors.push(error);
                    all.variances.push(*variance);
                }
            }
        }
    }
    all
}

/// What several closed loops make of the rest of one sequence, from the first sample that was not heard; samples x channels.
#[derive(Debug, Clone, Default)]
pub struct Rest {
    /// The mean of the loops' means.
    pub mean: Vec<f64>,
    /// The mean of the loops' variances and the spread of their means; empty without variance units.
    pub variance: Vec<f64>,
    /// What each loop drew.
    pub samples: Vec<Vec<f64>>,
}

/// Lets a network hear the first `heard` samples and go on alone to the end of `steps` predictions, once from each of `states`, each
/// with noise of its own.
pub fn alone(
    network: &Network,
    states: &[&[f64]],
    (samples, heard, steps): (&[f64], usize, usize),
    seed: u64,
    engine: &Engine,
) -> Result<Vec<Generated>> {
    let n = network.topology().channels();
    let sensed = &samples[..heard * n];
    let starts: Vec<Start<'_>> = states.iter().map(|state| Start { initial_state: state, sensed }).collect();
    let options = GenerationOptions::new(steps, Feedback::mixed(n, 1.0, network.topology().has_variance())).seed(seed);
    Ok(generate(network, &starts, &options, engine)?)
}

impl Rest {
    /// The moments of loops from their value `first` on.
    pub fn of(loops: &[Generated], first: usize) -> Self {
        let k = loops.len() as f64;
        let values = loops.first().map_or(0, |one| one.mean.len());
        let mean: Vec<f64> = (first..values).map(|at| loops.iter().map(|one| one.mean[at]).sum::<f64>() / k).collect();
        let variance = |at: usize| {
            let own = loops.iter().map(|one| one.variance[at]).sum::<f64>() / k;
            let spread: f64 = loops.iter().map(|one| (one.mean[at] - mean[at - first]).powi(2)).sum();
            own + if loops.len() > 1 { spread / (k - 1.0) } else { 0.0 }
        };
        let has_variance = loops.iter().all(|one| one.variance.len() == values);
        Self {
            variance: if has_variance { (first..values).map(variance).collect() } else { Vec::new() },
            samples: loops.iter().map(|one| one.sample[first..].to_vec()).collect(),
            mean,
        }
    }
}

/// How far the closed loop is from what really followed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClosedLoop {
    /// Root mean squared distance per channel so many steps after the last sample that was heard.
    pub after: Vec<Distance>,
    /// The same at the last sample of each sequence.
    pub end: f64,
    /// The same over all samples that were not heard.
    pub distance: f64,
    /// The same of the channels' means.
    pub distance_of_constant: f64,
    /// Nats per step and channel of the loops' moments.
    pub nll: Option<f64>,
    /// Share of samples within one predicted standard deviation.
    pub within_one: Option<f64>,
    /// Share of samples within two.
    pub within_two: Option<f64>,
}

/// A distance, some steps after the last sample that was heard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// So many steps; fewer than asked for where no sequence is that long.
    pub steps: usize,
    /// Root mean squared distance per channel; none where no sequence is that long.
    pub distance: Option<f64>,
}

impl ClosedLoop {
    /// Whether it ends up further from the data than the channels' means are.
    pub fn leaves_the_data(&self) -> bool {
        // What is not a number is further than anything.
        self.distance.partial_cmp(&self.distance_of_constant) != Some(std::cmp::Ordering::Less)
    }
}

/// Judges `rests`, which follow the first `heard` samples of each sequence.
pub fn closed_loop(data: &Dataset, heard: &[usize], rests: &[Rest], models: &SimpleModels) -> ClosedLoop {
    let n = data.channels().len();
    let mut at_horizon = vec![Vec::new(); HORIZONS.len()];
    let (mut end, mut all, mut constant) = (Vec::new(), Vec::new(), Vec::new());
    let mut scored = Predictions { errors: Vec::new(), variances: Vec::new() };
    for ((sequence, &heard), rest) in data.sequences().iter().zip(heard).zip(rests) {
        for k in heard..sequence.len() {
            for (i, target) in sequence.sample(k).iter().enumerate().filter(|(_, target)| !target.is_nan()) {
                let at = (k - heard) * n + i;
                let error = target - rest.mean[at];
                all.push(error);
                constant.push(target - models.moments[i].0);
                if let Some(variance) = rest.variance.get(at) {
                    scored.errors.push(error);
                    scored.variances.push(*variance);
                }
                for (errors, steps) in at_horizon.iter_mut().zip(HORIZONS) {
                    if k + 1 == heard + steps {
                        errors.push(error);
                    }
                }
                if k + 1 == sequence.len() {
                    end.push(error);
                }
            }
        }
    }
    let count = scored.errors.len() as f64;
    let within = |k: f64| {
        let inside = scored.errors.iter().zip(&scored.variances).filter(|(e, v)| *e * *e <= k * k * *v).count();
        (count > 0.0).then_some(inside as f64 / count)
    };
    let after = at_horizon.iter().zip(HORIZONS);
    ClosedLoop {
        after: after
            .map(|(errors, steps)| Distance { steps, distance: (!errors.is_empty()).then(|| root(errors)) })
            .collect(),
        end: root(&end),
        distance: root(&all),
        distance_of_constant: root(&constant),
        nll: scored.nll().filter(|nll| nll.is_finite()),
        within_one: within(1.0),
        within_two: within(2.0),
    }
}

/// Root of the mean square.
fn root(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(sequences: &[&[f64]]) -> Dataset {
        let sequences = sequences.iter().map(|values| Sequence::new("", 1, values.to_vec()).unwrap()).collect();
        Dataset::new(vec!["y".into()], sequences).unwrap()
    }

    fn one(mean: &[f64], variance: &[f64]) -> Generated {
        let mut it = Generated::default();
        (it.mean, it.variance, it.sample) = (mean.to_vec(), variance.to_vec(), mean.to_vec());
        it
    }

    #[test]
    fn moments_of_loops_are_those_of_their_mixture() {
        let rest = Rest::of(&[one(&[9.0, 1.0], &[9.0, 0.5]), one(&[9.0, 3.0], &[9.0, 1.5])], 1);
        assert_eq!((rest.mean, rest.variance), (vec![2.0], vec![1.0 + 2.0]));
        assert_eq!(rest.samples, [vec![1.0], vec![3.0]]);
    }

    #[test]
    fn a_mixture_has_the_mean_of_the_densities_and_the_moments_of_the_mixture() {
        let predictions = |errors: &[f64]| Predictions { errors: errors.to_vec(), variances: vec![1.0; errors.len()] };
        let density = |e: f64| (-0.5 * e * e).exp() / std::f64::consts::TAU.sqrt();
        let mixed = Ahead::mixed(&[predictions(&[1.0, 0.0]), predictions(&[-1.0, 2.0])], 1);
        assert_eq!((mixed.moments.errors, mixed.moments.variances), (vec![0.0, 1.0], vec![2.0, 2.0]));
        let by_hand = -0.5 * (density(1.0).ln() + (f64::midpoint(density(0.0), density(2.0))).ln());
        assert!((mixed.nll.unwrap() - by_hand).abs() < 1e-12);
        // Two channels of a sample come from one member.
        let mixed = Ahead::mixed(&[predictions(&[0.0, 0.0]), predictions(&[3.0, 3.0])], 2);
        let by_hand = -0.5 * f64::midpoint(density(0.0).powi(2), density(3.0).powi(2)).ln();
        assert!((mixed.nll.unwrap() - by_hand).abs() < 1e-12);
        // Two of the same are one.
        let twice = Ahead::mixed(&[predictions(&[1.0, 0.5]), predictions(&[1.0, 0.5])], 1);
        assert!((twice.nll.unwrap() - predictions(&[1.0, 0.5]).nll().unwrap()).abs() < 1e-12);
    }

    #[test]
    fn distances_are_told_at_their_steps_and_at_the_end() {
        let data = set(&[&[0.0; 8], &[0.0; 4]]);
        let rest = |mean: &[f64]| Rest { mean: mean.to_vec(), variance: vec![1.0; mean.len()], samples: Vec::new() };
        let rests = [rest(&[1.0, 1.0, 1.0, 1.0, 3.0, 0.0]), rest(&[1.0, 2.0])];
        let models = SimpleModels { moments: vec![(10.0, 1.0)], linear: None };
        let found = closed_loop(&data, &[2, 2], &rests, &models);
        let distances: Vec<Option<f64>> = found.after.iter().map(|after| after.distance).collect();
        assert_eq!(distances, [Some(1.0), Some(3.0), None]);
        assert_eq!(found.end, 2.0_f64.sqrt());
        assert_eq!((found.within_one, found.within_two), (Some(6.0 / 8.0), Some(7.0 / 8.0)));
        assert!(!found.leaves_the_data() && found.distance_of_constant == 10.0);
        assert!(closed_loop(&data, &[2, 2], &[rest(&[f64::NAN; 6]), rest(&[1.0, 2.0])], &models).leaves_the_data());
    }

    #[test]
    fn simple_models_are_scored_on_other_sequences_than_those_they_were_fitted_to() {
        let ramp: Vec<f64> = (0..40).map(|k| f64::from(k) + 0.1 * f64::from(k * k).sin()).collect();
        let models = SimpleModels::fit(&set(&[&ramp]), 1);
        let other: Vec<f64> = (100..120).map(|k| f64::from(k) + 0.1 * f64::from(k * k).sin()).collect();
        let data = set(&[&other]);
        let starts = starts(&data, 1, 0.5);
        assert_eq!(starts, [10]);
        let scored = to_the_end(&data, &starts);
        let (constant, linear) = (models.constant(&data, &scored), models.linear(&data, &scored).unwrap());
        assert!(linear.mse < 0.1 && constant.mse > 5000.0 && linear.beats(&constant), "{linear:?} {constant:?}");
    }
}
