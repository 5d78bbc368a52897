//! Sensor ranges to and from the range of the mean units (thesis 4.2, 5.2).
//!
//! ```text
//! scaled = (raw - offset) * scale
//! ```
//!
//! The output is a tanh, so data are brought to [-0.8, 0.8]; a variance scales with the square.

use crate::dataset::Dataset;
use crate::error::{Error, Result};

/// One affine map per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaling {
    offset: Vec<f64>,
    scale: Vec<f64>,
}

impl Scaling {
    /// The range that the thesis maps sensors to.
    pub const RANGE: (f64, f64) = (-0.8, 0.8);

    /// A map from its two constants.
    ///
    /// # Errors
    /// [`Error::Length`] for lists of different lengths, [`Error::Setting`] for a scale that is zero or not finite.
    pub fn new(offset: Vec<f64>, scale: Vec<f64>) -> Result<Self> {
        if offset.len() != scale.len() {
            let what = "the list of scales".to_owned();
            return Err(Error::Length { what, found: scale.len(), needed: offset.len() });
        }
        if let Some(bad) = scale.iter().chain(&offset).find(|value| !value.is_finite()) {
            return Err(Error::Setting {
                what: "a scaling constant",
                found: bad.to_string(),
                needed: "a finite number",
            });
        }
        if scale.contains(&0.0) {
            return Err(Error::Setting { what: "a scale", found: "0".into(), needed: "a number other than 0" });
        }
        Ok(Self { offset, scale })
    }

    /// Leaves values as they are.
    #[must_use]
    pub fn identity(channels: usize) -> Self {
        Self { offset: vec![0.0; channels], scale: vec![1.0; channels] }
    }

    /// Maps each channel's `[low, high]` onto `onto`. A channel of no extent is centred and not stretched.
    #[must_use]
    pub fn from_ranges(ranges: &[(f64, f64)], onto: (f64, f64)) -> Self {
        let (offset, scale) = ranges
            .iter()
            .map(|&(low, high)| {
                if high > low {
                    let scale = (onto.1 - onto.0) / (high - low);
                    (low - onto.0 / scale, scale)
                } else {
                    (low - f64::midpoint(onto.0, onto.1), 1.0)
                }
            })
            .unzip();
        Self { offset, scale }
    }

    /// Maps each channel's smallest and largest sample onto `onto`. A channel without any is left as it is.
    #[must_use]
    pub fn fit(data: &Dataset, onto: (f64, f64)) -> Self {
        let n = data.channels().len();
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); n];
        for sample in data.sequences().iter().flat_map(|s| s.values().chunks_exact(n)) {
            for (range, &x) in ranges.iter_mut().zip(sample) {
                *range = (range.0.min(x), range.1.max(x));
            }
        }
        for range in ranges.iter_mut().filter(|(low, high)| low > high) {
            *range = (f64::midpoint(onto.0, onto.1), f64::midpoint(onto.0, onto.1));
        }
        Self::from_ranges(&ranges, onto)
    }

    /// The raw value that maps to 0, per channel.
    #[must_use]
    pub fn offset(&self) -> &[f64] {
        &self.offset
    }

    /// The factor per channel.
    #[must_use]
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// Number of channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.scale.len()
    }

    /// A value of `channel` in the network's units. A channel is an index: one that is not there panics, as in a slice.
    #[must_use]
    pub fn to_scaled(&self, channel: usize, raw: f64) -> f64 {
        (raw - self.offset[channel]) * self.scale[channel]
    }

    /// A value of `channel` in the data's units. Panics as [`Scaling::to_scaled`].
    #[must_use]
    pub fn to_raw(&self, channel: usize, scaled: f64) -> f64 {
        scaled / self.scale[channel] + self.offset[channel]
    }

    /// A variance of `channel` in the data's units. Panics as [`Scaling::to_scaled`].
    #[must_use]
    pub fn variance_to_raw(&self, channel: usize, scaled: f64) -> f64 {
        scaled / self.scale[channel].powi(2)
    }

    /// The whole set in the network's units.
    ///
    /// # Errors
    /// [`Error::Length`] for a set of another number of channels.
    pub fn apply(&self, data: &Dataset) -> Result<Dataset> {
        let (found, needed) = (data.channels().len(), self.channels());
        if found != needed {
            return Err(Error::Length { what: "the list of channels".into(), found, needed });
        }
        Ok(data.map(|channel, raw| self.to_scaled(channel, raw)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Sequence;

    #[test]
    fn fit_reaches_the_ends_of_the_range_and_comes_back() {
        let sequence = Sequence::new("", 2, vec![1.0, 5.0, 3.0, 5.0, 2.0, 5.0]).unwrap();
        let data = Dataset::new(Dataset::numbered_channels(2), vec![sequence]).unwrap();
        let scaling = Scaling::fit(&data, Scaling::RANGE);
        assert!((scaling.to_scaled(0, 1.0) + 0.8).abs() < 1e-15);
        assert!((scaling.to_scaled(0, 3.0) - 0.8).abs() < 1e-15);
        assert_eq!(scaling.to_scaled(1, 5.0), 0.0);
        assert!((scaling.to_raw(0, scaling.to_scaled(0, 2.3)) - 2.3).abs() < 1e-15);
        assert!((scaling.variance_to_raw(0, 0.64) - 1.0).abs() < 1e-15);
        let message = Scaling::identity(3).apply(&data).unwrap_err().to_string();
        assert_eq!(message, "the list of channels holds 2 values; needed: 3");
    }
}
