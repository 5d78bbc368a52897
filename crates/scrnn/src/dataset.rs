//! Sequences of samples, possibly of different lengths, on named channels (thesis 2.6.1).
//!
//! A sequence of L samples gives T = L - xi steps: at step t (from 0) the input is sample t and the target is
//! sample t + xi.
//!
//! NaN is a missing value. As a target it does not count; as an input, the network's own prediction stands in for it, and where there
//! was none yet, the channel's last input, or 0.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::topology::Topology;

/// One recorded sequence: samples x channels, row-major; NaN is a missing value. Clones share the samples.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// A name to show; may be empty.
    pub name: String,
    channels: usize,
    /// Shared by clones, and never copied: recordings fill much of the memory.
    values: Arc<Vec<f64>>,
    /// How many values are missing.
    missing: usize,
}

/// Equal names and values; missing values are equal to each other.
impl PartialEq for Sequence {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        self.name == other.name
            && self.channels == other.channels
            && self.values.len() == other.values.len()
            && self.values.iter().zip(&*other.values).all(same)
    }
}

impl Sequence {
    /// Takes `values` as samples of `channels` numbers each.
    ///
    /// # Errors
    /// [`Error::Length`] if the values do not fill whole samples.
    pub fn new(name: impl Into<String>, channels: usize, values: Vec<f64>) -> Result<Self> {
        let name = name.into();
        if channels == 0 || !values.len().is_multiple_of(channels) {
            let needed = values.len().next_multiple_of(channels.max(1));
            return Err(Error::Length { what: format!("sequence `{name}`"), found: values.len(), needed });
        }
        Ok(Self::of(name, channels, values))
    }

    fn of(name: String, channels: usize, mut values: Vec<f64>) -> Self {
        // Readers push what comes: up to half of the room would stay empty for as long as the sequence lives.
        values.shrink_to_fit();
        let missing = values.iter().filter(|value| value.is_nan()).count();
        Self { name, channels, values: Arc::new(values), missing }
    }

    /// How many values are missing.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.missing
    }

    /// How many values are there to be predicted in the first `steps` steps at this delay: steps times channels, less what is missing.
    #[must_use]
    pub fn targets(&self, delay: usize, steps: usize) -> usize {
        let n = self.channels;
        let all = (steps * n).min(self.values.len().saturating_sub(delay * n));
        match self.missing {
            0 => all,
            _ => self.values[delay * n..][..all].iter().filter(|value| !value.is_nan()).count(),
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len() / self.channels
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The sample at index `step`. One that is not there panics, as in a slice.
    #[must_use]
    pub fn sample(&self, step: usize) -> &[f64] {
        &self.values[step * self.channels..(step + 1) * self.channels]
    }

    /// All samples, row-major.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The first `samples` samples, or all there are.
    #[must_use]
    pub fn truncated(&self, samples: usize) -> Self {
        let end = samples.min(self.len()) * self.channels;
        Self::of(self.name.clone(), self.channels, self.values[..end].to_vec())
    }
}

/// Sequences on the same channels. Clones share the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    channels: Vec<String>,
    sequences: Vec<Sequence>,
}

impl Dataset {
    /// Checks and collects sequences.
    ///
    /// # Errors
    /// [`Error::NoSequences`], [`Error::Length`] when a sequence has another number of channels, and
    /// [`Error::NotFinite`] with the place of the first infinite sample. NaN is taken, as a missing value.
    pub fn new(channels: Vec<String>, sequences: Vec<Sequence>) -> Result<Self> {
        if sequences.is_empty() {
            return Err(Error::NoSequences);
        }
        for (s, sequence) in sequences.iter().enumerate() {
            if sequence.channels != channels.len() {
                let what = format!("each sample of sequence {s}");
                return Err(Error::Length { what, found: sequence.channels, needed: channels.len() });
            }
            if let Some(index) = sequence.values.iter().position(|value| value.is_infinite()) {
                return Err(Error::NotFinite {
                    sequence: s,
                    step: index / channels.len(),
                    channel: channels[index % channels.len()].clone(),
                    value: sequence.values[index],
                });
            }
        }
        Ok(Self { channels, sequences })
    }

    /// Names for channels that have none: `y1`, `y2`, ...
    #[must_use]
    pub fn numbered_channels(count: usize) -> Vec<String> {
        (1..=count).map(|i| format!("y{i}")).collect()
    }

    /// The channels' names.
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// The sequences.
    #[must_use]
    pub fn sequences(&self) -> &[Sequence] {
        &self.sequences
    }

    /// Samples over all sequences.
    #[must_use]
    pub fn total_samples(&self) -> usize {
        self.sequences.iter().map(Sequence::len).sum()
    }

    /// How many values are missing in all sequences.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.sequences.iter().map(Sequence::missing).sum()
    }

    /// Values over all sequences that a network of delay `delay` predicts and that are there: what a likelihood per step and channel
    /// is divided by. Without missing values T_total N_O.
    #[must_use]
    pub fn total_targets(&self, delay: usize) -> usize {
        self.sequences.iter().map(|sequence| sequence.targets(delay, sequence.len().saturating_sub(delay))).sum()
    }

    /// T_total: steps over all sequences that a network of delay `delay` predicts.
    #[must_use]
    pub fn total_steps(&self, delay: usize) -> usize {
        self.sequences.iter().map(|sequence| sequence.len().saturating_sub(delay)).sum()
    }

    /// Checks that a network of this topology can be trained on the set or recognise it.
    ///
    /// # Errors
    /// [`Error::Length`] for another number of channels, [`Error::SequenceTooShort`].
    pub fn check_for(&self, topology: &Topology) -> Result<()> {
        if self.channels.len() != topology.channels() {
            let what = "each sample of the data set".to_owned();
            return Err(Error::Length { what, found: self.channels.len(), needed: topology.channels() });
        }
        let delay = topology.delay();
        for (s, sequence) in self.sequences.iter().enumerate() {
            if sequence.len() <= delay {
                return Err(Error::SequenceTooShort { sequence: s, length: sequence.len(), delay });
            }
        }
        Ok(())
    }

    /// Mean and variance (divided by n) of every channel over all samples that are there; NaN for a channel without any.
    #[must_use]
    pub fn channel_moments(&self) -> Vec<(f64, f64)> {
        (0..self.channels.len())
            .map(|i| {
                let all = || self.sequences.iter().flat_map(|s| s.values.chunks_exact(s.channels)).map(move |x| x[i]);
                let values = || all().filter(|value| !value.is_nan());
                let n = values().count() as f64;
                let mean = values().sum::<f64>() / n;
                (mean, values().map(|x| (x - mean).powi(2)).sum::<f64>() / n)
            })
            .collect()
    }

    /// The same sequences with every sample passed through `map(channel, value)`.
    #[must_use]
    pub fn map(&self, map: impl Fn(usize, f64) -> f64) -> Self {
        let n = self.channels.len();
        let through = |sequence: &Sequence| {
            let values = sequence.values.iter().enumerate().map(|(k, &x)| map(k % n, x)).collect();
            Sequence::of(sequence.name.clone(), n, values)
        };
        Self { channels: self.channels.clone(), sequences: self.sequences.iter().map(through).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clone_of_a_data_set_shares_its_samples() {
        let set =
            Dataset::new(Dataset::numbered_channels(1), vec![Sequence::new("a", 1, vec![1.0; 9]).unwrap()]).unwrap();
        assert!(std::ptr::eq(set.clone().sequences()[0].values(), set.sequences()[0].values()));
    }

    #[test]
    fn a_bad_sample_is_named_by_its_place() {
        let good = Sequence::new("a", 2, vec![0.0; 6]).unwrap();
        let bad = Sequence::new("b", 2, vec![0.0, 1.0, 2.0, f64::INFINITY]).unwrap();
        let error = Dataset::new(Dataset::numbered_channels(2), vec![good, bad]).unwrap_err();
        assert!(error.to_string().starts_with("sequence 1, step 1, channel y2 is inf"), "{error}");
    }

    #[test]
    fn moments_run_over_all_sequences() {
        let a = Sequence::new("a", 1, vec![1.0, 2.0]).unwrap();
        let b = Sequence::new("b", 1, vec![6.0]).unwrap();
        let set = Dataset::new(Dataset::numbered_channels(1), vec![a, b]).unwrap();
        assert_eq!(set.channel_moments(), [(3.0, 14.0 / 3.0)]);
    }
}
