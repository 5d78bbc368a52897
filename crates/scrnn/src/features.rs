//! What the network is shown of samples, and what its outputs are added to.
//!
//! ```text
//! d_t   = x_t - x_{t-1},  d_0 = 0
//! input = x_t, or [x_t, d_t / sd] with velocity inputs
//! b_t   = x_t + sum_l A_l d_{t-l}                  the skip connection's guess of the sample xi steps ahead
//! y     = b_t + s rho,    v = s^2 (exp(...) + floor)
//! ```
//!
//! rho is what the mean units say, tanh or linear, and s the size of the guess's error on the training data, one value for each
//! channel. Smooth movements are nearly predicted by b_t already: the network then learns what is left, in units of what is left.
//! Without a skip connection b = 0 and s = 1, which is the thesis.
//!
//! A sample before the first is taken to be the first one.

use crate::dataset::Dataset;
use crate::error::{Error, Result};
pub use crate::skip::Skip;
use crate::topology::Topology;

/// What a skip connection guesses.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SkipKind {
    /// The next sample is the last one.
    Residual,
    /// The last sample and `damping` times as much change for each step ahead as in the last step; 0 is [`SkipKind::Residual`], 1 a
    /// straight line.
    Extrapolation {
        /// gamma, from 0 to 1.
        damping: f64,
    },
    /// A linear map of the last `lags` differences, by ridge least squares on the training data.
    #[cfg(feature = "analysis")]
    Autoregressive {
        /// How many differences, at least 1: one less than samples.
        lags: usize,
    },
}

/// Below this share of a channel's deviation an error counts as none: a channel that does not move has no scale of its own.
const NO_ERROR: f64 = 1e-9;
#[cfg(feature = "analysis")]
/// Ridge of the autoregressive fit, as a share of the differences' mean square.
const RIDGE: f64 = 1e-6;

impl Skip {
    /// Fits a connection to data in the network's units: the taps where the kind has some to fit, and s as the root mean square of
    /// what is left over. `delay` is xi.
    ///
    /// # Errors
    /// [`Error::Setting`] for a damping out of range or no lag, or where no two samples that far apart are there.
    pub fn fit(kind: SkipKind, data: &Dataset, delay: usize) -> Result<Self> {
        let n = data.channels().len();
        let taps = match kind {
            SkipKind::Residual => Vec::new(),
            SkipKind::Extrapolation { damping } => {
                if !(0.0..=1.0).contains(&damping) {
                    let (what, needed) = ("damping of the extrapolation", "a number from 0 to 1");
                    return Err(Error::Setting { what, found: damping.to_string(), needed });
                }
                let ahead = damping * delay as f64;
                (0..n * n).map(|k| if k / n == k % n { ahead } else { 0.0 }).collect()
            }
            #[cfg(feature = "analysis")]
            SkipKind::Autoregressive { lags: 0 } => {
                let (what, needed) = ("lags of the skip connection", "at least 1");
                return Err(Error::Setting { what, found: "0".to_owned(), needed });
            }
            #[cfg(feature = "analysis")]
            SkipKind::Autoregressive { lags } => fit_taps(data, delay, lags),
        };
        let guess = Guess { n, lags: taps.len() / (n * n).max(1), taps: &taps };
        let (mut squares, mut counts, mut b) = (vec![0.0; n], vec![0_usize; n], vec![0.0; n]);
        for sequence in data.sequences() {
            for k in 0..sequence.len().saturating_sub(delay) {
                guess.write(|back| sequence.sample(k.saturating_sub(back)), &mut b);
                for (i, (target, b)) in sequence.sample(k + delay).iter().zip(&b).enumerate() {
                    let e = target - b;
                    if e.is_finite() {
                        squares[i] += e * e;
                        counts[i] += 1;
                    }
                }
            }
        }
        if counts.iter().all(|count| *count == 0) {
            let (what, needed) = ("pairs of samples that are one delay apart", "at least one");
            return Err(Error::Setting { what, found: "0".to_owned(), needed });
        }
        let moments = data.channel_moments();
        let scale = (0..n).map(|i| {
            let s = (squares[i] / counts[i].max(1) as f64).sqrt();
            if s > NO_ERROR * moments[i].1.sqrt() && s > 0.0 { s } else { 1.0 }
        });
        Self::new(taps, scale.collect())
    }
}

/// Root mean squares of the differences between neighbouring samples, one for each channel: what velocity inputs are divided by. 1 for
/// a channel that does not move.
#[must_use]
pub fn velocity_deviations(data: &Dataset) -> Vec<f64> {
    let n = data.channels().len();
    let moments = data.channel_moments();
    let square = |i: usize| {
        let pairs = data.sequences().iter().flat_map(|own| (1..own.len()).map(move |k| (own, k)));
        let differences = pairs.map(|(own, k)| own.sample(k)[i] - own.sample(k - 1)[i]).filter(|d| d.is_finite());
        let (sum, count) = differences.fold((0.0, 0_usize), |(sum, count), d| (sum + d * d, count + 1));
        (sum / count.max(1) as f64).sqrt()
    };
    (0..n).map(|i| Some(square(i)).filter(|s| *s > NO_ERROR * moments[i].1.sqrt() && *s > 0.0).unwrap_or(1.0)).collect()
}

#[cfg(feature = "analysis")]
/// The taps that predict what the last sample leaves over, from differences, by ridge least squares.
///
/// Not by the factors of `analysis::baselines`, which find the least squares however alike the regressors are: neighbouring differences
/// of a smooth movement are nearly the same, and taps that make the most of that can be large, which a closed loop does not bear. The ridge
/// keeps them small, and bounds the condition of the normal equations.
fn fit_taps(data: &Dataset, delay: usize, lags: usize) -> Vec<f64> {
    let n = data.channels().len();
    let width = lags * n;
    let mut normal = nalgebra::DMatrix::<f64>::zeros(width, width);
    let mut right = nalgebra::DMatrix::<f64>::zeros(width, n);
    let (mut d, mut e) = (nalgebra::DVector::zeros(width), nalgebra::RowDVector::zeros(n));
    for sequence in data.sequences() {
        let at = |k: usize, back: usize| sequence.sample(k.saturating_sub(back));
        for k in 0..sequence.len().saturating_sub(delay) {
            for lag in 0..lags {
                for i in 0..n {
                    d[lag * n + i] = at(k, lag)[i] - at(k, lag + 1)[i];
                }
            }
            for i in 0..n {
                e[i] = sequence.sample(k + delay)[i] - at(k, 0)[i];
            }
            if d.iter().chain(e.iter()).all(|value: &f64| value.is_finite()) {
                normal.ger(1.0, &d, &d, 1.0);
                right.ger(1.0, &d, &e.transpose(), 1.0);
            }
        }
    }
    let ridge = RIDGE * normal.trace() / width.max(1) as f64;
    for i in 0..width {
        normal[(i, i)] += ridge.max(f64::MIN_POSITIVE);
    }
    let Some(solved) = normal.cholesky().map(|factor| factor.solve(&right)) else {
        return vec![0.0; width * n];
    };
    // [lag][to][from]
    let tap = |k: usize| solved[(k / (n * n) * n + k % n, k / n % n)];
    (0..width * n).map(tap).map(|tap| if tap.is_finite() { tap } else { 0.0 }).collect()
}

/// b_t.
struct Guess<'a> {
    n: usize,
    lags: usize,
    taps: &'a [f64],
}

impl Guess<'_> {
    /// `at(l)` is the sample l steps back.
    #[inline(always)]
    fn write<'b>(&self, at: impl Fn(usize) -> &'b [f64], b: &mut [f64]) {
        let n = self.n;
        b.copy_from_slice(at(0));
        for lag in 0..self.lags {
            let (x, before) = (at(lag), at(lag + 1));
            for (b, row) in b.iter_mut().zip(self.taps[lag * n * n..].chunks_exact(n)) {
                for ((tap, x), before) in row.iter().zip(x).zip(before) {
                    *b += tap * (x - before);
                }
            }
        }
    }
}

/// A topology's features, ready for use.
#[derive(Debug, Clone)]
pub(crate) struct Features {
    /// Channels.
    n: usize,
    /// 1 / sd of the differences; empty without velocity inputs.
    velocity: Vec<f64>,
    skip: Option<Skip>,
    lags: usize,
    floor: f64,
}

impl Features {
    pub fn new(topology: &Topology) -> Self {
        let n = topology.channels();
        let velocity = topology.velocity_inputs().map(|sd| sd.iter().map(|sd| 1.0 / sd).collect());
        let skip = topology.skip().cloned();
        let lags = skip.as_ref().map_or(0, |skip| skip.taps().len() / (n * n));
        Self { n, velocity: velocity.unwrap_or_default(), skip, lags, floor: topology.variance_floor() }
    }

    /// Whether inputs are the samples themselves and outputs the predictions.
    pub fn are_plain(&self) -> bool {
        self.velocity.is_empty() && self.skip.is_none()
    }

    pub fn has_skip(&self) -> bool {
        self.skip.is_some()
    }

    /// How many samples before the last one are needed.
    pub fn past(&self) -> usize {
        self.lags.max(usize::from(!self.velocity.is_empty()))
    }

    /// Differences that the guess uses.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// 1 / sd of the differences; empty without velocity inputs.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// s of a channel.
    #[inline(always)]
    pub fn scale(&self, channel: usize) -> f64 {
        self.skip.as_ref().map_or(1.0, |skip| skip.scale()[channel])
    }

    /// Writes the inputs of a step; `at(l)` is the sample l steps back.
    #[inline(always)]
    pub fn inputs<'b>(&self, at: impl Fn(usize) -> &'b [f64], out: &mut [f64]) {
        let (own, rates) = out.split_at_mut(self.n);
        own.copy_from_slice(at(0));
        if !self.velocity.is_empty() {
            for (((out, x), before), rate) in rates.iter_mut().zip(at(0)).zip(at(1)).zip(&self.velocity) {
                *out = (x - before) * rate;
            }
        }
    }

    /// Writes b; 0 without a skip connection.
    #[inline(always)]
    pub fn guess<'b>(&self, at: impl Fn(usize) -> &'b [f64], b: &mut [f64]) {
        match &self.skip {
            Some(skip) => Guess { n: self.n, lags: self.lags, taps: skip.taps() }.write(at, b),
            None => b.fill(0.0),
        }
    }

    /// The mean, from what the mean unit says.
    #[inline(always)]
    pub fn mean(&self, channel: usize, guess: f64, rho: f64) -> f64 {
        match &self.skip {
            Some(skip) => guess + skip.scale()[channel] * rho,
            None => rho,
        }
    }

    /// v, from exp u of the variance unit.
    #[inline(always)]
    pub fn variance(&self, channel: usize, exp_u: f64) -> f64 {
        match &self.skip {
            Some(skip) => skip.scale()[channel].powi(2) * (exp_u + self.floor),
            None => exp_u + self.floor,
        }
    }

    /// Adds what the gradient `g` of the mean says of the difference `lag` steps back: A_l' g.
    #[inline(always)]
    pub fn back(&self, lag: usize, g: &[f64], out: &mut [f64]) {
        let n = self.n;
        if let Some(skip) = &self.skip {
            for (g, row) in g.iter().zip(skip.taps()[lag * n * n..].chunks_exact(n)) {
                for (out, tap) in out.iter_mut().zip(row) {
                    *out += tap * g;
                }
            }
        }
    }

    /// The inputs and targets of every sequence, where the network is taught throughout: inputs as [`Features::inputs`] has them,
    /// targets as (y-hat - b) / s, of sample k + xi at k.
    pub fn taught(&self, data: &Dataset, delay: usize) -> Result<(Dataset, Dataset)> {
        let n = self.n;
        let (width, names) = (n + self.velocity.len(), |count| Dataset::numbered_channels(count));
        let mut sets = (Vec::new(), Vec::new());
        let mut b = vec![0.0; n];
        for sequence in data.sequences() {
            let mut inputs = vec![0.0; sequence.len() * width];
            // The first xi rows are never a target.
            let mut targets = sequence.values()[..delay.min(sequence.len()) * n].to_vec();
            for (k, out) in inputs.chunks_exact_mut(width).enumerate() {
                let at = |back| sequence.sample(k.saturating_sub(back));
                self.inputs(at, out);
                if k + delay < sequence.len() {
                    self.guess(at, &mut b);
                    let scaled = sequence.sample(k + delay).iter().zip(&b).enumerate();
                    targets.extend(scaled.map(|(i, (target, b))| (target - b) / self.scale(i)));
                }
            }
            sets.0.push(crate::dataset::Sequence::new(sequence.name.clone(), width, inputs)?);
            sets.1.push(crate::dataset::Sequence::new(sequence.name.clone(), n, targets)?);
        }
        Ok((Dataset::new(names(width), sets.0)?, Dataset::new(names(n), sets.1)?))
    }
}

/// The last samples of one loop, newest first.
#[derive(Debug, Clone)]
pub(crate) struct Past {
    n: usize,
    /// [back][channel].
    samples: Vec<f64>,
    started: bool,
}

impl Past {
    pub fn new(features: &Features) -> Self {
        Self { n: features.n, samples: vec![0.0; (features.past() + 1) * features.n], started: false }
    }

    /// Takes in the sample of this step.
    pub fn push(&mut self, x: &[f64]) {
        let n = self.n;
        if !self.started {
            self.samples.chunks_exact_mut(n).for_each(|own| own.copy_from_slice(x));
            self.started = true;
            return;
        }
        let kept = self.samples.len() - n;
        self.samples.copy_within(..kept, n);
        self.samples[..n].copy_from_slice(x);
    }

    /// The sample so many steps back.
    #[inline(always)]
    pub fn at(&self, back: usize) -> &[f64] {
        &self.samples[back * self.n..(back + 1) * self.n]
    }
}

#[cfg(test)]
#[path = "features_tests.rs"]
mod tests;
