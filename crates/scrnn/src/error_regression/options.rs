//! How to regress, and what a regression did.

use crate::error::{Error, Result};

/// L-BFGS' own, in nats a step.
const TOLERANCE: f64 = 2e-5;

/// How the internal state is moved; every sample starts from rest.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Ascent {
    /// Gradient ascent with momentum, as in the thesis.
    Momentum {
        /// alpha_reg.
        rate: f64,
        /// eta.
        momentum: f64,
    },
    /// Adam (Kingma and Ba, 2015), with its usual constants.
    Adam {
        /// The step's size in units of the internal state.
        rate: f64,
    },
    /// L-BFGS (Nocedal and Wright 2006, algorithm 7.4) with a search for each step: ln L_reg never ends lower than it was. It knows the curvature
    /// from the samples before, so it alone does not start from rest, and a unit normal around the state that an ascent begins from holds
    /// it back where the window says nothing.
    Lbfgs {
        /// Pairs of steps and changes of the gradient that tell the curvature, 1 to 1000.
        memory: usize,
    },
}

impl Ascent {
    /// The same rule at another rate; L-BFGS, which has none, as it is.
    #[must_use]
    pub fn with_rate(self, rate: f64) -> Self {
        match self {
            Self::Momentum { momentum, .. } => Self::Momentum { rate, momentum },
            Self::Adam { .. } => Self::Adam { rate },
            Self::Lbfgs { memory } => Self::Lbfgs { memory },
        }
    }
}

/// How to regress.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ErrorRegressionOptions {
    /// W, in steps.
    pub window: usize,
    /// Most steps that are tried for each sample, each with a pass forward and one back.
    pub iterations: usize,
    /// How the state is moved.
    pub ascent: Ascent,
    /// Longest gradient; a longer one is shortened to this length. L-BFGS does not look at it.
    pub max_norm: Option<f64>,
    /// Whether the best state that was met is kept, be it the one before the first step. L-BFGS does so anyway; the others else end where their
    /// last step leads.
    pub keep_best: bool,
    /// Nats a step of the window: a step that changes ln L_reg by less is the last. None is 2e-5 for L-BFGS, and no such end for the others.
    pub tolerance: Option<f64>,
    /// Whether the network goes on from the state that it has without regression where the predictions made from there, each before its sample
    /// came, made the window more likely than regression does after. None does so for L-BFGS alone.
    pub guard: Option<bool>,
    /// Share of the sensed sample in the input of each channel when time goes on: 1 senses, 0 runs on the own prediction.
    pub sensed: Vec<f64>,
    /// The same inside of the window; all 0 in the thesis.
    pub sensed_in_window: Vec<f64>,
    /// Share of each channel's errors in ln L_reg: 0 does not heed a channel, e.g. that of a joint which the network moves
    /// itself, and which therefore always is where it was predicted.
    pub mask: Vec<f64>,
    /// Samples to predict beyond the next one.
    pub ahead: usize,
}

impl ErrorRegressionOptions {
    /// The defaults on so many channels with some of them changed.
    #[must_use]
    pub fn with(channels: usize, change: impl FnOnce(&mut Self)) -> Self {
        let mut options = Self::new(channels);
        change(&mut options);
        options
    }

    /// A window of 50 steps and 15 iterations of L-BFGS, guarded: safe for all networks that were tried. Every channel senses,
    /// and the window runs in the closed loop.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            window: 50,
            iterations: 15,
            ascent: Ascent::Lbfgs { memory: 24 },
            max_norm: None,
            keep_best: false,
            tolerance: None,
            guard: None,
            sensed: vec![1.0; channels],
            sensed_in_window: vec![0.0; channels],
            mask: vec![1.0; channels],
            ahead: 0,
        }
    }

    /// The same with 10 iterations of Adam at 0.05, which moves each unit by as much whatever the slope, and neither keeps the best nor guards. It suits networks
    /// whose slow units alone are moved, such as those of the thesis' chapter 5, whose study runs with it.
    #[must_use]
    pub fn adam(channels: usize) -> Self {
        Self { ascent: Ascent::Adam { rate: 0.05 }, iterations: 10, ..Self::new(channels) }
    }

    /// Whether the network without regression runs beside.
    #[must_use]
    pub fn is_guarded(&self) -> bool {
        self.guard.unwrap_or(matches!(self.ascent, Ascent::Lbfgs { .. }))
    }

    /// In nats a step.
    pub(super) fn tolerance_of_a_step(&self) -> f64 {
        self.tolerance.unwrap_or(if matches!(self.ascent, Ascent::Lbfgs { .. }) { TOLERANCE } else { 0.0 })
    }

    pub(super) fn check(&self, channels: usize) -> Result<()> {
        if self.window == 0 {
            return Err(Error::Setting { what: "the window", found: "0".to_owned(), needed: "at least 1 step" });
        }
        let positive = |what, value: f64| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(Error::Setting { what, found: value.to_string(), needed: "a positive number" }),
        };
        match self.ascent {
            Ascent::Adam { rate } => positive("the regression rate", rate)?,
            Ascent::Lbfgs { memory } if !(1..=1000).contains(&memory) => {
                let what = "the memory of L-BFGS";
                return Err(Error::Setting { what, found: memory.to_string(), needed: "1 to 1000 pairs" });
            }
            Ascent::Lbfgs { .. } => {}
            Ascent::Momentum { rate, momentum } => {
                positive("the regression rate", rate)?;
                if !(0.0..1.0).contains(&momentum) {
                    let (found, needed) = (momentum.to_string(), "a number from 0 to below 1");
                    return Err(Error::Setting { what: "the regression's momentum", found, needed });
                }
            }
        }
        if let Some(norm) = self.max_norm {
            positive("the longest gradient", norm)?;
        }
        if let Some(tolerance) = self.tolerance.filter(|tolerance| !(*tolerance >= 0.0 && tolerance.is_finite())) {
            let (what, found) = ("the regression's tolerance", tolerance.to_string());
            return Err(Error::Setting { what, found, needed: "0 or a positive number" });
        }
        for (what, shares) in [
            ("the sensed shares", &self.sensed),
            ("the window's shares", &self.sensed_in_window),
            ("the mask", &self.mask),
        ] {
            if shares.len() != channels {
                return Err(Error::Length { what: what.to_owned(), found: shares.len(), needed: channels });
            }
            if let Some(share) = shares.iter().find(|share| !(0.0..=1.0).contains(*share)) {
                return Err(Error::Setting { what, found: share.to_string(), needed: "numbers from 0 to 1" });
            }
        }
        Ok(())
    }
}

/// What one sample's regression did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Regression {
    /// Steps in the window.
    pub steps: usize,
    /// Values in the window that are there, on channels of a share above 0 in the mask: what the likelihood is a sum over.
    pub values: usize,
    /// Steps that were tried.
    pub iterations: usize,
    /// The one after which the state was as it is now; 0 is the state before the first.
    pub kept: usize,
    /// Passes through the window forward and back; 0 where there was no time for a single one.
    pub passes: usize,
    /// ln L_reg of the closed-loop window before the first iteration and after the last, or as the guard left it; -E without variance units.
    pub ln_likelihood: [f64; 2],
    /// Sums of squared errors in the window, before and after.
    pub squared_error: [f64; 2],
    /// Whether a step led to non-finite values: it was taken back. Only L-BFGS makes others after it.
    pub diverged: bool,
    /// Whether it ended because there was less than the tolerance to gain.
    pub converged: bool,
    /// Whether the network without regression predicted the window better, and its state was taken over.
    pub given_up: bool,
}
