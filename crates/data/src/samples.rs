//! What a reader makes of a file, and the one way from there to a data set: channels are chosen, times are held to even
//! steps or resampled, turns are unwrapped, missing values are refused or passed on.
//!
//! NaN is a missing value here. Readers refuse infinite values themselves, or leave that to [`Samples::finish`].

use scrnn::dataset::{Dataset, Sequence};

use crate::angles;
use crate::reading::{Facts, Reading};
use crate::remark::Remark;
use crate::times;
use crate::{FileError, Selection};

/// What a reader makes of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// The channels' names. All of them, unless the reader took `Selection::channels` itself: then exactly those.
    pub channels: Vec<String>,
    /// The sequences.
    pub tracks: Vec<Track>,
    /// Seconds between samples, if the file says so itself. Times of the tracks go before it.
    pub period: Option<f64>,
    /// Nanoseconds between two times that the file can tell apart, e.g. the last digit that a table has. 0 if it is none.
    pub resolution: i64,
    /// What is worth saying.
    pub remarks: Vec<Remark>,
    /// What is known besides. [`Samples::finish`] cuts `units` to the chosen channels and fills `gaps` and `available`.
    pub facts: Facts,
}

/// One sequence as it stands in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Track {
    /// Its name.
    pub name: String,
    /// Samples x channels, the channels of a sample side by side. NaN is missing.
    pub values: Vec<f64>,
    /// Nanoseconds, one for each sample, in the order of the samples; empty if nothing tells the time.
    pub times: Vec<i64>,
}

/// Takes what stands from a place on out of a list, which gives its room back: where many sequences are cut from one list, the
/// samples are held once.
pub(crate) fn split_off(values: &mut Vec<f64>, from: usize) -> Vec<f64> {
    let rest = values.split_off(from.min(values.len()));
    // Not each time: where the system copies, that would be for each sequence all that is left.
    if values.capacity() - values.len() > values.capacity() / 16 {
        values.shrink_to_fit();
    }
    rest
}

impl Samples {
    /// Sequences without times, on channels `y1`, `y2`, ...
    #[must_use]
    pub fn numbered(channels: usize, sequences: Vec<(String, Vec<f64>)>) -> Self {
        Self::named(Dataset::numbered_channels(channels), sequences).unnamed()
    }

    /// Sequences without times, on channels of these names.
    #[must_use]
    pub fn named(channels: Vec<String>, sequences: Vec<(String, Vec<f64>)>) -> Self {
        let tracks = sequences.into_iter().map(|(name, values)| Track { name, values, times: Vec::new() }).collect();
        Self { channels, tracks, facts: Facts { named: true, ..Facts::default() }, ..Self::default() }
    }

    fn unnamed(mut self) -> Self {
        self.facts.named = false;
        self
    }

    /// The data set that is meant.
    ///
    /// # Errors
    /// [`FileError::Empty`], [`FileError::NoSuchChannel`], [`FileError::Times`], [`FileError::NotFinite`],
    /// [`FileError::Data`].
    pub fn finish(mut self, path: &str, selection: &Selection) -> Result<Reading, FileError> {
        self.tracks.retain(|track| !track.values.is_empty());
        if self.tracks.is_empty() || self.channels.is_empty() {
            return Err(FileError::Empty { path: path.to_owned() });
        }
        self.choose(path, selection)?;
        let channels = self.channels.len();
        let period = times::to_even_steps(path, &mut self, selection)?;
        self.unwrap(path, &selection.unwrap)?;
        self.judge_missing(path, selection)?;
        let Self { channels: names, tracks, remarks, facts, .. } = self;
        let rows = tracks.into_iter().map(|Track { name, values, .. }| Sequence::new(name, channels, values));
        let data = rows.collect::<Result<Vec<_>, _>>().and_then(|rows| Dataset::new(names, rows));
        let data = data.map_err(|source| FileError::Data { path: path.to_owned(), source })?;
        Ok(Reading { data, period, remarks, facts })
    }

    /// Takes the channels that are wanted, in their order.
    fn choose(&mut self, path: &str, selection: &Selection) -> Result<(), FileError> {
        let Some(wanted) = &selection.channels else { return Ok(()) };
        if *wanted == self.channels {
            return Ok(());
        }
        let columns = wanted.iter().map(|name| {
            self.channels.iter().position(|channel| channel == name).ok_or_else(|| FileError::NoSuchChannel {
                path: path.to_owned(),
                found: name.clone(),
                channels: self.channels.join(", "),
            })
        });
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        for track in &mut self.tracks {
            let rows = track.values.chunks_exact(self.channels.len());
            track.values = rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect();
        }
        if self.facts.units.len() == self.channels.len() {
            self.facts.units = columns.iter().map(|&column| self.facts.units[column].clone()).collect();
        }
        self.facts.available = std::mem::replace(&mut self.channels, wanted.clone());
        Ok(())
    }

    /// Takes the jumps of a whole turn out of these channels.
    fn unwrap(&mut self, path: &str, wanted: &[String]) -> Result<(), FileError> {
        let channels = self.channels.len();
        for name in wanted {
            let column = self.channels.iter().position(|channel| channel == name);
            let column = column.ok_or_else(|| FileError::NoSuchChannel {
                path: path.to_owned(),
                found: name.clone(),
                channels: self.channels.join(", "),
            })?;
            let values = self.tracks.iter().flat_map(|track| track.values.iter().skip(column).step_by(channels));
            let turn = angles::turn(values.copied());
            for track in &mut self.tracks {
                angles::unwrap(turn, track.values.iter_mut().skip(column).step_by(channels));
            }
        }
        Ok(())
    }

    /// Refuses infinite values, and missing ones unless they are to be passed on. The only place that decides that.
    fn judge_missing(&mut self, path: &str, selection: &Selection) -> Result<(), FileError> {
        let channels = self.channels.len();
        let mut missing = vec![0; channels];
        let mut samples = 0;
        for Track { name, values, .. } in &self.tracks {
            samples += values.len() / channels;
            for (index, &value) in values.iter().enumerate().filter(|(_, value)| !value.is_finite()) {
                if selection.refuses_missing() || !value.is_nan() {
                    return Err(FileError::NotFinite {
                        path: path.to_owned(),
                        sequence: name.clone(),
                        sample: index / channels + 1,
                        channel: self.channels[index % channels].clone(),
                        value,
                    });
                }
                missing[index % channels] += 1;
            }
        }
        self.remarks.extend(Remark::of_counts(&self.channels, &missing, samples));
        Ok(())
    }
}
