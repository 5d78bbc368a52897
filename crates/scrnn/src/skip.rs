//! The constants of a skip connection, see [`crate::features`].

use crate::error::{Error, Result};

/// A connection from the samples to the mean, past the context: constants, fitted once to the training data.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Skip {
    /// A_l, `[lag][to][from]`: what the guess takes of the last differences; empty for the last sample alone.
    taps: Vec<f64>,
    /// s, one for each channel.
    scale: Vec<f64>,
}

impl Skip {
    /// A connection from its constants: A_l as `[lag][to][from]`, and s of each channel.
    ///
    /// # Errors
    /// [`Error::Length`] for taps that fill no whole lags, [`Error::Setting`] for a scale that is not above 0 and finite, or for taps
    /// that are not finite.
    pub fn new(taps: Vec<f64>, scale: Vec<f64>) -> Result<Self> {
        let square = scale.len().pow(2).max(1);
        if !taps.len().is_multiple_of(square) {
            let needed = taps.len().next_multiple_of(square);
            return Err(Error::Length { what: "the list of taps".to_owned(), found: taps.len(), needed });
        }
        if let Some(bad) = taps.iter().find(|tap| !tap.is_finite()) {
            let (what, needed) = ("a tap of the skip connection", "a finite number");
            return Err(Error::Setting { what, found: bad.to_string(), needed });
        }
        positive("a scale of the skip connection", &scale)?;
        Ok(Self { taps, scale })
    }

    /// A_l, `[lag][to][from]`.
    #[must_use]
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// s of each channel.
    #[must_use]
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }
}

pub(crate) fn positive(what: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
        Some(bad) => Err(Error::Setting { what, found: bad.to_string(), needed: "a number above 0" }),
        None => Ok(()),
    }
}
