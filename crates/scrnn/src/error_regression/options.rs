//! How to regress, and what a regression did.

use crate::error::{Error, Result};

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
}

impl Ascent {
    /// The same rule at another rate.
    #[must_use]
    pub fn with_rate(self, rate: f64) -> Self {
        match self {
            Self::Momentum { momentum, .. } => Self::Momentum { rate, momentum },
            Self::Adam { .. } => Self::Adam { rate },
        }
    }
}

/// How to regress.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ErrorRegressionOptions {
    /// W, in steps.
    pub window: usize,
    /// Forward and backward passes for each sample.
    pub iterations: usize,
    /// How the state is moved.
    pub ascent: Ascent,
    /// Longest gradient; a longer one is shortened to this length.
    pub max_norm: Option<f64>,
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

    /// A window of 50 steps and 10 iterations of Adam, which suits most networks; every channel senses, and the window
    /// runs in the closed loop.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            window: 50,
            iterations: 10,
            ascent: Ascent::Adam { rate: 0.05 },
            max_norm: None,
            sensed: vec![1.0; channels],
            sensed_in_window: vec![0.0; channels],
            mask: vec![1.0; channels],
            ahead: 0,
        }
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
    /// Iterations that were made.
    pub iterations: usize,
    /// ln L_reg of the closed-loop window before the first iteration and after the last; -E without variance units.
    pub ln_likelihood: [f64; 2],
    /// Sums of squared errors in the window, before and after.
    pub squared_error: [f64; 2],
    /// Whether a step led to non-finite values: it was taken back, and no more were made.
    pub diverged: bool,
}
