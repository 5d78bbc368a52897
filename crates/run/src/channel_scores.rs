//! How well each channel is predicted one step ahead, in words that need no nats.

use scrnn::dataset::Dataset;
use scrnn::evaluation::half_mean_squared_error;
use scrnn::generation::Generated;
use scrnn::scaling::Scaling;
use serde::Serialize;

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelScore {
    /// Its name.
    pub channel: String,
    /// The share of its variance that the predictions explain: 1 if they are right, 0 if the channel's mean does as well, below
    /// 0 if it does better. None where the channel never changes.
    pub explained: Option<f64>,
    /// The root of the mean squared error, in the data's units. None where no sample was observed.
    pub rmse: Option<f64>,
    /// Spikes that do not count: samples outside of -1 to 1 in scaled units, where they are few.
    pub left_out: usize,
}

/// Share of the samples that spikes are at most. More are part of what is recorded.
const SPIKES: f64 = 0.01;

/// Scores what the open loop predicted of `scaled`. Missing samples are passed over, and so are spikes that a robust scaling left
/// outside: nothing predicts them, and one of them outweighs all else.
#[must_use]
pub fn channel_scores(scaled: &Dataset, generated: &[Generated], delay: usize, scaling: &Scaling) -> Vec<ChannelScore> {
    let n = scaled.channels().len();
    let all = |i: usize| {
        scaled.sequences().iter().zip(generated).flat_map(move |(sequence, generated)| {
            let samples = sequence.values().iter().skip(delay * n + i).step_by(n).copied();
            samples.zip(generated.mean.iter().skip(i).step_by(n).copied()).filter(|(sample, _)| sample.is_finite())
        })
    };
    let is_spike = |sample: f64| sample.abs() >= 1.0;
    let score = |(i, channel): (usize, &String)| {
        let (spikes, samples) = all(i)
            .fold((0, 0), |(spikes, count), (sample, _)| (spikes + usize::from(is_spike(sample)), count + 1_usize));
        let left_out = if spikes as f64 <= SPIKES * samples as f64 { spikes } else { 0 };
        let pairs = |i: usize| all(i).filter(move |(sample, _)| left_out == 0 || !is_spike(*sample));
        let (sum, count) = pairs(i).fold((0.0, 0_usize), |(sum, count), (sample, _)| (sum + sample, count + 1));
        let mean = sum / count.max(1) as f64;
        let squares = pairs(i).map(|(sample, y)| (sample - y).powi(2)).sum::<f64>();
        let spread = pairs(i).map(|(sample, _)| (sample - mean).powi(2)).sum::<f64>();
        ChannelScore {
            channel: channel.clone(),
            explained: Some(1.0 - squares / spread).filter(|share| spread > 0.0 && share.is_finite()),
            left_out,
            rmse: (count > 0).then(|| (squares / count.max(1) as f64).sqrt() / scaling.scale()[i].abs()),
        }
    };
    scaled.channels().iter().enumerate().map(score).collect()
}

/// (3.5) over the samples that were observed: half their mean squared error. NaN where none was.
#[must_use]
pub fn observed_error(samples: &[f64], means: &[f64]) -> f64 {
    let pairs = samples.iter().zip(means).filter(|(sample, _)| !sample.is_nan());
    let (samples, means): (Vec<f64>, Vec<f64>) = pairs.map(|(sample, mean)| (*sample, *mean)).unzip();
    half_mean_squared_error(&samples, &means)
}

impl ChannelScore {
    /// The share in percent.
    #[must_use]
    pub fn share(&self) -> String {
        self.explained.map_or("-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
    }

    /// The error in four digits.
    #[must_use]
    pub fn error(&self) -> String {
        self.rmse.map_or("-".to_owned(), |rmse| match rmse {
            0.0 => "0".to_owned(),
            rmse if (1e-3..1e5).contains(&rmse) => {
                let digits = (3 - rmse.log10().floor() as i32).max(0) as usize;
                format!("{rmse:.digits$}")
            }
            rmse => format!("{rmse:.3e}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn::dataset::Sequence;

    #[test]
    fn a_few_spikes_do_not_count_and_are_counted() {
        let mut values: Vec<f64> = (0..301).map(|k| 0.5 * (f64::from(k) * 0.3).sin()).collect();
        let mut generated = Generated::default();
        generated.mean = values[1..].to_vec();
        (values[7], values[8]) = (60.0, -60.0);
        let scores = |values: Vec<f64>| {
            let data = Dataset::new(vec!["a".into()], vec![Sequence::new("", 1, values).unwrap()]).unwrap();
            channel_scores(&data, std::slice::from_ref(&generated), 1, &Scaling::identity(1)).swap_remove(0)
        };
        let few = scores(values.clone());
        assert_eq!((few.left_out, few.explained, few.rmse), (2, Some(1.0), Some(0.0)));
        (10..60).for_each(|k| values[k] = 60.0);
        let many = scores(values);
        assert!(many.left_out == 0 && many.explained.unwrap() < 0.5, "{many:?}");
    }

    #[test]
    fn what_is_missing_counts_neither_as_right_nor_as_wrong() {
        assert_eq!(observed_error(&[1.0, f64::NAN, 3.0], &[0.0, 5.0, 3.0]), 0.25);
        let data = Dataset::new(vec!["a".into()], vec![Sequence::new("", 1, vec![0.0, 1.0, f64::NAN, -1.0]).unwrap()])
            .unwrap();
        let mut generated = Generated::default();
        generated.mean = vec![1.0, 7.0, -1.0];
        let scores = channel_scores(&data, &[generated], 1, &Scaling::identity(1));
        assert_eq!((scores[0].explained, scores[0].rmse), (Some(1.0), Some(0.0)));
    }

    #[test]
    fn shares_and_errors_are_those_of_the_predicted_samples_in_their_own_units() {
        // The first sample is what the network starts from.
        let values = vec![9.0, 9.0, 1.0, 0.5, -1.0, 0.5, 1.0, 0.5, -1.0, 0.5];
        let data = Dataset::new(vec!["a".into(), "b".into()], vec![Sequence::new("", 2, values).unwrap()]).unwrap();
        let mut generated = Generated::default();
        generated.mean = vec![0.9, 0.5, -1.1, 0.5, 0.9, 0.5, -1.1, 0.5];
        let scaling = Scaling::new(vec![0.0, 0.0], vec![0.1, 1.0]).unwrap();
        let scores = channel_scores(&data, &[generated], 1, &scaling);
        assert!((scores[0].explained.unwrap() - 0.99).abs() < 1e-12 && (scores[0].rmse.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!((scores[0].share().as_str(), scores[0].error().as_str()), ("99.0 %", "1.000"));
        // It never changes.
        assert_eq!((scores[1].explained, scores[1].rmse), (None, Some(0.0)));
        assert_eq!((scores[1].share().as_str(), scores[1].error().as_str()), ("-", "0"));
    }
}
