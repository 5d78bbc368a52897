//! What simple models come to on the same samples: nll in nats per step and channel, each with the variance that suits it
//! best on these very samples.
//!
//! All predict the samples that a network of delay xi predicts, those from index xi on, with a Gaussian of constant
//! variance for each channel. The nll of such a model is the entropy of a Gaussian with its mean squared error.

use nalgebra::{DMatrix, DVector};

use crate::dataset::{Dataset, Sequence};
use crate::evaluation::gaussian_entropy;

/// Always the channel's mean. None where a channel never changes: the likelihood has no bound.
#[must_use]
pub fn constant(data: &Dataset, delay: usize) -> Option<f64> {
    let channels = data.channels().len();
    of_errors(channels, |i| {
        let values: Vec<f64> = data.sequences().iter().flat_map(|s| from(s, delay, i)).collect();
        mean_square_about_mean(&values)
    })
}

/// Always the mean of the sequence, with a variance for each sequence.
#[must_use]
pub fn constant_of_sequence(data: &Dataset, delay: usize) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for sequence in data.sequences() {
        let steps = sequence.len().saturating_sub(delay);
        let nll = of_errors(data.channels().len(), |i| {
            mean_square_about_mean(&from(sequence, delay, i).collect::<Vec<_>>())
        })?;
        sum += nll * steps as f64;
        count += steps;
    }
    (count > 0).then(|| sum / count as f64)
}

/// The newest sample that is known: that of xi steps before.
#[must_use]
pub fn last_value(data: &Dataset, delay: usize) -> Option<f64> {
    of_errors(data.channels().len(), |i| {
        let differences = data.sequences().iter().flat_map(|sequence| {
            (delay..sequence.len()).map(move |k| (sequence.sample(k)[i] - sequence.sample(k - delay)[i]).powi(2))
        });
        mean(&differences.collect::<Vec<_>>())
    })
}

/// Linear regression on the newest `order` samples of all channels that are known, and a constant; one for all sequences.
/// None if there are fewer samples than coefficients.
#[must_use]
pub fn autoregression(data: &Dataset, delay: usize, order: usize) -> Option<f64> {
    let n = data.channels().len();
    let width = order * n + 1;
    let first = delay + order.saturating_sub(1);
    let places: Vec<(&Sequence, usize)> =
        data.sequences().iter().flat_map(|sequence| (first..sequence.len()).map(move |k| (sequence, k))).collect();
    if places.len() <= width {
        return None;
    }
    let regressors = |(sequence, k): (&Sequence, usize)| {
        let lags = (0..order).flat_map(move |lag| sequence.sample(k - delay - lag).iter().copied());
        DVector::from_iterator(width, lags.chain([1.0]))
    };
    // Normal equations: A w = b with A = sum x x', b = sum x y.
    let (mut a, mut b) = (DMatrix::zeros(width, width), DMatrix::zeros(width, n));
    for &place in &places {
        let x = regressors(place);
        a.ger(1.0, &x, &x, 1.0);
        b.ger(1.0, &x, &DVector::from_column_slice(place.0.sample(place.1)), 1.0);
    }
    let weights = a.svd(true, true).solve(&b, 1e-12).ok()?;
    let mut squares = vec![0.0; n];
    for &place in &places {
        let predicted = weights.tr_mul(&regressors(place));
        for (i, square) in squares.iter_mut().enumerate() {
            *square += (place.0.sample(place.1)[i] - predicted[i]).powi(2) / places.len() as f64;
        }
    }
    of_errors(n, |i| Some(squares[i]))
}

/// Samples of channel `i` that are predicted.
fn from(sequence: &Sequence, delay: usize, i: usize) -> impl Iterator<Item = f64> {
    (delay..sequence.len()).map(move |k| sequence.sample(k)[i])
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn mean_square_about_mean(values: &[f64]) -> Option<f64> {
    let centre = mean(values)?;
    mean(&values.iter().map(|value| (value - centre).powi(2)).collect::<Vec<_>>())
}

/// The average over channels of the entropy that belongs to each channel's mean squared error.
fn of_errors(channels: usize, mean_square: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    let mut sum = 0.0;
    for i in 0..channels {
        sum += gaussian_entropy(mean_square(i)?);
    }
    Some(sum / channels as f64).filter(|nll| nll.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(sequences: &[&[f64]]) -> Dataset {
        let sequences = sequences.iter().map(|values| Sequence::new("", 1, values.to_vec()).unwrap()).collect();
        Dataset::new(vec!["y".into()], sequences).unwrap()
    }

    #[test]
    fn constants_have_the_entropy_of_the_predicted_samples() {
        let data = set(&[&[100.0, 1.0, -1.0, 1.0, -1.0], &[100.0, 3.0, 1.0, 3.0, 1.0]]);
        assert!((constant(&data, 1).unwrap() - gaussian_entropy(2.0)).abs() < 1e-15);
        assert!((constant_of_sequence(&data, 1).unwrap() - gaussian_entropy(1.0)).abs() < 1e-15);
        assert_eq!(constant(&set(&[&[2.0; 5]]), 1), None);
    }

    #[test]
    fn the_last_value_errs_by_the_difference_over_the_delay() {
        let data = set(&[&[0.0, 1.0, 4.0, 9.0]]);
        assert!((last_value(&data, 1).unwrap() - gaussian_entropy((1.0 + 9.0 + 25.0) / 3.0)).abs() < 1e-15);
        assert!((last_value(&data, 2).unwrap() - gaussian_entropy((16.0 + 64.0) / 2.0)).abs() < 1e-15);
    }

    #[test]
    fn two_lags_predict_a_sine_wave_but_one_does_not() {
        // sin(t) = 2 cos(1) sin(t - 1) - sin(t - 2); a little noise keeps the likelihood bounded.
        let noise = |k: i32| 1e-3 * f64::from(k * k * k).sin();
        let wave: Vec<f64> = (0..500).map(|k| f64::from(k).sin() + noise(k)).collect();
        let data = set(&[&wave]);
        assert!(autoregression(&data, 1, 2).unwrap() < gaussian_entropy(1e-5));
        let one = autoregression(&data, 1, 1).unwrap();
        // A lag of one step leaves 1 - cos(1)^2 of the variance 1/2.
        assert!((one - gaussian_entropy(0.5 * (1.0 - 1.0_f64.cos().powi(2)))).abs() < 0.01, "{one}");
        assert!(one < constant(&data, 1).unwrap());
        assert_eq!(autoregression(&set(&[&[1.0, 2.0, 3.0]]), 1, 4), None);
    }
}
