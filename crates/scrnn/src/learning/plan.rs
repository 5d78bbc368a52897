//! What to do: epochs, the prior's variance, and an optimiser with its options.

use crate::error::{Error, Result};
use crate::objective::Precision;

/// A training.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Plan {
    /// Passes through the data; each is one update, but for Adam in batches. An epoch of L-BFGS is one update, which
    /// may take several passes.
    pub epochs: u64,
    /// sigma^2_IS, the variance of the initial states around their mean (2.13). 0 makes all sequences share one initial state, the
    /// mean: only what a network hears then tells it which sequence it is in. Momentum needs one above 0.
    pub initial_state_variance: f64,
    /// How to ascend.
    pub optimiser: Optimiser,
    /// Whether a part of the sequences is learned in the closed loop, by Adam only.
    pub closed_loop: Option<ClosedLoop>,
    /// Whether the last epochs ascend by L-BFGS instead.
    pub lbfgs: Option<Lbfgs>,
    /// Keep only a part of the states and compute the rest again on the way back: memory grows with the square root of
    /// the sequences' length, time by a third, and the bits stay the same.
    pub recompute: bool,
    /// What states and products are computed in; the bits of a training are those of its precision.
    pub precision: Precision,
    /// What to do when the training becomes unstable.
    pub on_divergence: OnDivergence,
}

/// What to do when a training becomes unstable: a value is not finite, or the likelihood collapses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum OnDivergence {
    /// Go back to the last finite epoch and stop. A likelihood that collapses while all values stay finite is accepted.
    Stop,
    /// Go back to the best network, halve the rate, and go on; also when the likelihood collapses. After twenty times stop.
    Recover,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            epochs: 100_000,
            initial_state_variance: 1.0,
            optimiser: Optimiser::Momentum(Momentum::default()),
            closed_loop: None,
            lbfgs: None,
            recompute: false,
            precision: Precision::F64,
            on_divergence: OnDivergence::Stop,
        }
    }
}

/// How to ascend.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Optimiser {
    /// Gradient ascent with momentum, the thesis' rule (2.17)-(2.19).
    Momentum(Momentum),
    /// Adam with warm-up, cosine decay and clipping.
    Adam(Adam),
}

/// Gradient ascent with momentum. With T_total steps in all and N_O channels, shared parameters ascend at
/// alpha / (T_total N_O) and initial states at alpha / N_O (thesis 2.7).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
#[non_exhaustive]
pub struct Momentum {
    /// alpha-tilde.
    pub rate: f64,
    /// eta, at least 0 and below 1.
    pub momentum: f64,
    /// How the prior acts on initial states and their mean.
    pub prior: PriorStep,
    /// Whether the rate adapts (D.1).
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub adaptive_rate: Option<AdaptiveRate>,
}

impl Default for Momentum {
    fn default() -> Self {
        Self { rate: 1e-4, momentum: 0.9, prior: PriorStep::Implicit, adaptive_rate: None }
    }
}

/// How the prior (2.23), (2.24) enters a step of gradient ascent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum PriorStep {
    /// Solved for where the step ends: stable for any variance, and the literal rule where that is stable.
    Implicit,
    /// As printed; unstable for narrow priors.
    Thesis,
}

/// The adaptive rate (D.1): one factor on both rates. An update that lets the squared error grow by more than
/// `max_error_ratio` is withdrawn and tried again at a lower rate. Every try is judged: where none holds, nothing moves in this
/// epoch, the report says so ([`EpochReport::withdrawn`](super::EpochReport::withdrawn)), and the next epoch begins at the rate that
/// is left.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
#[non_exhaustive]
pub struct AdaptiveRate {
    /// r_th.
    pub max_error_ratio: f64,
    /// alpha_dec.
    pub decrease: f64,
    /// alpha_inc.
    pub increase: f64,
    /// Tries for each epoch, at least 1.
    pub max_tries: u32,
}

impl Default for AdaptiveRate {
    fn default() -> Self {
        Self { max_error_ratio: 1.1, decrease: 0.7, increase: 1.05, max_tries: 1000 }
    }
}

/// Adam on the gradient of ln L per step and channel. Initial states are written u_0 = mean + s z with
/// s = min(sigma_IS, 1), and Adam moves z and the mean: no prior is too narrow for it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
#[non_exhaustive]
pub struct Adam {
    /// The largest rate.
    pub rate: f64,
    /// Share of the epochs in which the rate rises from 0.
    pub warm_up: f64,
    /// The rate at the end of the cosine.
    pub final_rate: f64,
    /// Longest gradient of the shared parameters; 0 leaves it as it is.
    pub clip_norm: f64,
    /// Share of every weight that a rate of 1 would take away at each update, biases aside (decoupled, Loshchilov and
    /// Hutter, 2019): smooth networks for short data.
    pub weight_decay: f64,
    /// Sequences of an update; 0 takes all. With fewer than all, the sequences are dealt into batches of this size at most, and an
    /// epoch makes an update for each batch.
    pub batch_size: usize,
    /// Factor on the rate for initial states.
    pub initial_state_factor: f64,
    /// Factor on the rate for their mean.
    pub mean_factor: f64,
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
}

impl Default for Adam {
    fn default() -> Self {
        Self {
            rate: 3e-3,
            warm_up: 0.02,
            final_rate: 0.0,
            clip_norm: 1.0,
            weight_decay: 0.0,
            batch_size: 0,
            initial_state_factor: 3.0,
            mean_factor: 3.0,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
        }
    }
}

/// Learning in the closed loop. In each update a share of the sequences is taught up to some step and goes on from there on the
/// network's own predictions and their noise, in several copies. What the copies predict together is a Gaussian of their mean and
/// their variance, and its likelihood is climbed together with that of the taught steps
/// ([`crate::objective::ClosedLoopTerm`]). An epoch takes as much longer as there are copies.
///
/// A network that was only ever taught does not know what to do where its own errors have led it, and its variance says nothing of
/// that.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
#[non_exhaustive]
pub struct ClosedLoop {
    /// K, how many loops are averaged.
    pub copies: usize,
    /// What a step in the closed loop counts; a taught one counts 1.
    pub weight: f64,
    /// Share of the sequences of an epoch that are taught throughout.
    pub taught: f64,
    /// Where the loop is closed, at the earliest, as a share of the sequence.
    pub earliest: f64,
    /// And at the latest. In between every step is as likely.
    pub latest: f64,
}

impl Default for ClosedLoop {
    fn default() -> Self {
        Self { copies: 4, weight: 0.3, taught: 0.5, earliest: 0.05, latest: 0.9 }
    }
}

impl ClosedLoop {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one that is out of its range, e.g. `closed_loop.copies`.
    pub fn check(&self) -> Result<()> {
        let sound = (1..=1000).contains(&self.copies);
        require("closed_loop.copies", self.copies as f64, sound, "a number from 1 to 1000")?;
        not_negative("closed_loop.weight", self.weight)?;
        let share = |what, value: f64| require(what, value, (0.0..=1.0).contains(&value), "a number from 0 to 1");
        share("closed_loop.taught", self.taught)?;
        share("closed_loop.earliest", self.earliest)?;
        share("closed_loop.latest", self.latest)?;
        require("closed_loop.latest", self.latest, self.latest >= self.earliest, "at least closed_loop.earliest")
    }
}

/// L-BFGS on ln L_all per step and channel, over all sequences at once, for the last epochs of a training. Each of its epochs is
/// an update, which evaluates the sequences as often as its line search asks for: 1.1 times on average, where the likelihood is
/// smooth. ln L_all never falls. Initial states are written as for [`Adam`].
///
/// Where a small network has to be exact it gets far further than a rule of first order. It finds the nearest maximum: let the
/// optimiser choose which one that is.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
#[non_exhaustive]
pub struct Lbfgs {
    /// Share of the epochs, the last ones; 1 leaves none to the optimiser.
    pub share: f64,
    /// How many updates are remembered.
    pub memory: usize,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self { share: 0.3, memory: 50 }
    }
}

impl Plan {
    /// Epochs of the optimiser, after which L-BFGS begins.
    #[must_use]
    pub fn epochs_of_optimiser(&self) -> u64 {
        let share = self.lbfgs.as_ref().map_or(0.0, |lbfgs| lbfgs.share);
        self.epochs - ((share * self.epochs as f64).round() as u64).min(self.epochs)
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one that is out of its range, e.g. `adam.rate`.
    pub fn check(&self) -> Result<()> {
        not_negative("initial_state_variance", self.initial_state_variance)?;
        if let Some(closed_loop) = &self.closed_loop {
            closed_loop.check()?;
        }
        if let Optimiser::Momentum(_) = &self.optimiser {
            positive("initial_state_variance (with momentum)", self.initial_state_variance)?;
            let closed = self.closed_loop.is_some();
            require("closed_loop (with momentum)", 1.0, !closed, "adam, which alone learns in the closed loop")?;
        }
        if let Some(lbfgs) = &self.lbfgs {
            lbfgs.check()?;
        }
        match &self.optimiser {
            Optimiser::Momentum(momentum) => momentum.check(),
            Optimiser::Adam(adam) => adam.check(),
        }
    }
}

impl Momentum {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one that is out of its range, e.g. `momentum.rate`.
    pub fn check(&self) -> Result<()> {
        positive("momentum.rate", self.rate)?;
        below_one("momentum.momentum", self.momentum)?;
        let Some(AdaptiveRate { max_error_ratio, decrease, increase, max_tries }) = self.adaptive_rate else {
            return Ok(());
        };
        let at_least_1 = |what, value: f64| require(what, value, value >= 1.0, "a number, at least 1");
        at_least_1("momentum.adaptive_rate.max_error_ratio", max_error_ratio)?;
        let inside = decrease > 0.0 && decrease < 1.0;
        require("momentum.adaptive_rate.decrease", decrease, inside, "a number between 0 and 1")?;
        at_least_1("momentum.adaptive_rate.increase", increase)?;
        at_least_1("momentum.adaptive_rate.max_tries", f64::from(max_tries))
    }
}

impl Adam {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one that is out of its range, e.g. `adam.rate`.
    pub fn check(&self) -> Result<()> {
        positive("adam.rate", self.rate)?;
        below_one("adam.warm_up", self.warm_up)?;
        not_negative("adam.final_rate", self.final_rate)?;
        not_negative("adam.clip_norm", self.clip_norm)?;
        not_negative("adam.weight_decay", self.weight_decay)?;
        not_negative("adam.initial_state_factor", self.initial_state_factor)?;
        not_negative("adam.mean_factor", self.mean_factor)?;
        below_one("adam.beta1", self.beta1)?;
        below_one("adam.beta2", self.beta2)?;
        positive("adam.epsilon", self.epsilon)
    }
}

impl Lbfgs {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one that is out of its range, e.g. `lbfgs.share`.
    pub fn check(&self) -> Result<()> {
        require("lbfgs.share", self.share, (0.0..=1.0).contains(&self.share), "a number from 0 to 1")?;
        // Twice as many numbers as parameters for each.
        let sound = (1..=1000).contains(&self.memory);
        require("lbfgs.memory", self.memory as f64, sound, "a number from 1 to 1000")
    }
}

/// `with` for options: the defaults with some of them changed.
macro_rules! with {
    ($($options:ident),*) => {$(
        impl $options {
            /// The defaults with some of them changed.
            #[must_use]
            pub fn with(change: impl FnOnce(&mut Self)) -> Self {
                let mut options = Self::default();
                change(&mut options);
                options
            }
        }
    )*};
}

with!(Plan, Momentum, AdaptiveRate, Adam, ClosedLoop, Lbfgs);

fn positive(what: &'static str, value: f64) -> Result<()> {
    require(what, value, value > 0.0, "a number above 0")
}

fn not_negative(what: &'static str, value: f64) -> Result<()> {
    require(what, value, value >= 0.0, "0 or a number above it")
}

fn below_one(what: &'static str, value: f64) -> Result<()> {
    require(what, value, (0.0..1.0).contains(&value), "a number from 0 to just below 1")
}

fn require(what: &'static str, value: f64, holds: bool, needed: &'static str) -> Result<()> {
    if holds && value.is_finite() { Ok(()) } else { Err(Error::Setting { what, found: value.to_string(), needed }) }
}
