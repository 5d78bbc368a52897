//! What simple models come to on the same samples: nll in nats per step and channel, each with the variance that suits it
//! best on these very samples.
//!
//! All predict the samples that a network of delay xi predicts, those from index xi on, with a Gaussian of constant
//! variance for each channel. The nll of such a model is the entropy of a Gaussian with its mean squared error.

use nalgebra::DMatrix;

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
        if (0..data.channels().len()).any(|i| from(sequence, delay, i).next().is_none()) {
            continue;
        }
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
        mean(&differences.filter(|square| !square.is_nan()).collect::<Vec<_>>())
    })
}

/// Singular values of the standardised regressors below this share of the largest are rounding, and count as 0.
const RELATIVE_CUT: f64 = 1e-12;
/// Rows that are factored at a time: bounds the memory, whatever the number of samples.
const ROWS: usize = 1024;

/// Linear regression on the newest `order` samples of all channels that are known, and a constant; one for all sequences.
/// None if there are fewer samples than coefficients.
#[must_use]
pub fn autoregression(data: &Dataset, delay: usize, order: usize) -> Option<f64> {
    let model = Linear::fit(data, delay, order)?;
    of_errors(data.channels().len(), |i| Some(model.variances[i]))
}

/// A Gaussian of constant variance for each channel around a linear function of the newest samples, fitted to some sequences and used
/// on others.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    delay: usize,
    order: usize,
    /// Where each channel begins, and how long its unit is.
    units: Vec<(f64, f64)>,
    /// Of standardised regressors, to standardised channels.
    weights: DMatrix<f64>,
    variances: Vec<f64>,
}

impl Linear {
    /// Fits the `order` newest samples that a prediction over `delay` steps knows, and a constant, by least squares. None if there are
    /// fewer samples than coefficients.
    ///
    /// ```text
    /// [X Y] = Q [R_x R_y; 0 S],   R_x w = R_y in the least squares        X: standardised regressors, Y: standardised targets
    /// ```
    ///
    /// By orthogonal factors of the regressors themselves, in each channel's own unit: neither their units nor regressors that are
    /// nearly the same spoil it, as they would in normal equations. Samples that are missing (not a number) are left out, with all
    /// that would be predicted from them.
    #[must_use]
    pub fn fit(data: &Dataset, delay: usize, order: usize) -> Option<Self> {
        let n = data.channels().len();
        let width = order * n + 1;
        let units: Vec<(f64, f64)> = (0..n).map(|i| unit(data, i)).collect::<Option<_>>()?;
        let mut model = Self { delay, order, units, weights: DMatrix::zeros(width, n), variances: vec![0.0; n] };
        let first = model.first();
        let places: Vec<(&Sequence, usize)> = data
            .sequences()
            .iter()
            .flat_map(|sequence| (first..sequence.len()).map(move |k| (sequence, k)))
            .filter(|&(sequence, k)| model.row(sequence, k).iter().all(|value| value.is_finite()))
            .collect();
        if places.len() <= width {
            return None;
        }
        // The triangle of all rows so far, above the next ones, makes the triangle of both.
        let mut triangle = DMatrix::zeros(0, width + n);
        for places in places.chunks(ROWS) {
            let above = triangle.nrows();
            let mut stacked = triangle.resize_vertically(above + places.len(), 0.0);
            for (k, &(sequence, at)) in places.iter().enumerate() {
                stacked.row_mut(above + k).iter_mut().zip(model.row(sequence, at)).for_each(|(to, value)| *to = value);
            }
            triangle = stacked.qr().r();
        }
        let (x, y) = (triangle.view((0, 0), (width, width)).into_owned(), triangle.view((0, width), (width, n)));
        let factors = x.svd(true, true);
        model.weights = factors.solve(&y, RELATIVE_CUT * factors.singular_values.max()).ok()?;
        for &(sequence, k) in &places {
            for (i, (predicted, target)) in model.predict(sequence, k).iter().zip(sequence.sample(k)).enumerate() {
                model.variances[i] += (target - predicted).powi(2) / places.len() as f64;
            }
        }
        Some(model)
    }

    /// The first sample of a sequence that it can predict.
    #[must_use]
    pub fn first(&self) -> usize {
        self.delay + self.order.saturating_sub(1)
    }

    /// What it predicts for sample `k`, at least [`Linear::first`], from the samples up to `k - delay`.
    ///
    /// # Panics
    /// If there is no such sample, or it is one of another number of channels.
    #[must_use]
    pub fn predict(&self, sequence: &Sequence, k: usize) -> Vec<f64> {
        let row = self.row(sequence, k);
        let standard =
            self.weights.column_iter().map(|weights| row.iter().zip(weights.iter()).map(|(x, w)| x * w).sum::<f64>());
        standard.zip(&self.units).map(|(value, (start, length))| start + length * value).collect()
    }

    /// The variance of each channel's error on the sequences that it was fitted to.
    #[must_use]
    pub fn variances(&self) -> &[f64] {
        &self.variances
    }

    /// A row of [X Y].
    fn row(&self, sequence: &Sequence, k: usize) -> Vec<f64> {
        let standard = |k: usize| {
            sequence.sample(k).iter().zip(&self.units).map(|(value, (start, length))| (value - start) / length)
        };
        (0..self.order).flat_map(|lag| standard(k - self.delay - lag)).chain([1.0]).chain(standard(k)).collect()
    }
}

/// Mean and standard deviation of channel `i`, or 1 where it never changes: where it begins, and how long its unit is.
fn unit(data: &Dataset, i: usize) -> Option<(f64, f64)> {
    let values: Vec<f64> = data.sequences().iter().flat_map(|sequence| from(sequence, 0, i)).collect();
    let deviation = mean_square_about_mean(&values)?.sqrt();
    Some((mean(&values)?, if deviation > 0.0 { deviation } else { 1.0 }))
}

/// Samples of channel `i` that are predicted, without those that are missing (not a number).
fn from(sequence: &Sequence, delay: usize, i: usize) -> impl Iterator<Item = f64> {
    (delay..sequence.len()).map(move |k| sequence.sample(k)[i]).filter(|value| !value.is_nan())
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
    fn missing_samples_are_passed_over() {
        let gap = f64::NAN;
        let data = set(&[&[100.0, 1.0, gap, -1.0, 1.0, -1.0], &[gap; 4]]);
        assert!((constant(&data, 1).unwrap() - gaussian_entropy(1.0)).abs() < 1e-15);
        assert!((constant_of_sequence(&data, 1).unwrap() - gaussian_entropy(1.0)).abs() < 1e-15);
        assert!((last_value(&data, 1).unwrap() - gaussian_entropy((99.0_f64.powi(2) + 8.0) / 3.0)).abs() < 1e-12);
        let noise = |k: i32| 1e-3 * f64::from(k * k * k).sin();
        let mut wave: Vec<f64> = (0..300).map(|k| f64::from(k).sin() + noise(k)).collect();
        (wave[50], wave[200]) = (gap, gap);
        assert!(autoregression(&set(&[&wave]), 1, 2).unwrap() < gaussian_entropy(1e-5));
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

    #[test]
    fn a_linear_model_predicts_sequences_that_it_was_not_fitted_to() {
        let noise = |k: i32| 1e-3 * f64::from(k * k * k).sin();
        let wave = |phase: f64| (0..300).map(|k| 5.0 + (f64::from(k) + phase).sin() + noise(k)).collect::<Vec<_>>();
        let model = Linear::fit(&set(&[&wave(0.0), &wave(1.0)]), 1, 4).unwrap();
        let other = set(&[&wave(2.0)]);
        let sequence = &other.sequences()[0];
        assert_eq!(model.first(), 4);
        let errors =
            (4..300).map(|k| (model.predict(sequence, k)[0] - sequence.sample(k)[0]).powi(2)).sum::<f64>() / 296.0;
        assert!(errors < 1e-5 && (errors / model.variances()[0] - 1.0).abs() < 0.2, "{errors} {:?}", model.variances());
    }

    /// Two channels of which one is a smooth wave, and the other follows it with noise, each in a unit of its own.
    fn two_channels(units: [f64; 2], offsets: [f64; 2]) -> Dataset {
        let noise = |k: usize| (0.7 * (k * k) as f64).sin() + (1.3 * (k * k * k % 1009) as f64).sin();
        let wave = |k: usize| (0.05 * k as f64).sin() + 1e-4 * noise(k);
        let rows = |k: usize| [wave(k), 0.5 * wave(k.saturating_sub(2)) + 0.1 * noise(k + 7)];
        let values = (0..3000).flat_map(|k| {
            let row = rows(k);
            [0, 1].map(|i| offsets[i] + units[i] * row[i])
        });
        let sequences = vec![Sequence::new("", 2, values.collect()).unwrap()];
        Dataset::new(Dataset::numbered_channels(2), sequences).unwrap()
    }

    #[test]
    fn an_autoregression_does_not_depend_on_units() {
        let plain = autoregression(&two_channels([1.0, 1.0], [0.0, 0.0]), 1, 4).unwrap();
        for (units, offsets, accuracy) in [
            ([1e6, 1e6], [0.0, 0.0], 1e-9),
            ([1e-6, 1e-6], [0.0, 0.0], 1e-9),
            ([1e6, 1e-6], [0.0, 0.0], 1e-9),
            ([1e-6, 1e6], [0.0, 0.0], 1e-9),
            // What is left of the samples' digits beside an offset.
            ([1.0, 1e-6], [1e3, 1e-3], 1e-6),
        ] {
            let shift = units.iter().map(|unit: &f64| unit.ln()).sum::<f64>() / 2.0;
            let found = autoregression(&two_channels(units, offsets), 1, 4).unwrap() - shift;
            assert!((found - plain).abs() < accuracy, "{units:?}, {offsets:?}: {found} and {plain}");
        }
    }

    #[test]
    fn a_channel_that_is_there_twice_in_two_units_is_predicted_as_well_as_once() {
        let both = two_channels([1.0, 1.0], [0.0, 0.0]);
        let of = |units: &[f64]| {
            let values = both.sequences()[0].values().chunks(2).flat_map(|row| units.iter().map(|unit| unit * row[0]));
            let sequence = Sequence::new("", units.len(), values.collect()).unwrap();
            autoregression(&Dataset::new(Dataset::numbered_channels(units.len()), vec![sequence]).unwrap(), 1, 3)
                .unwrap()
        };
        let (once, twice) = (of(&[1.0]), of(&[1.0, 1e6]));
        assert!((twice - 0.5 * 1e6_f64.ln() - once).abs() < 1e-9, "{twice} and {once}");
    }
}
