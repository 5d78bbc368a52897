//! Measures of what was learned: errors, likelihoods of simple models, agreement with the truth.

/// Pearson's correlation; none for fewer than two values, where one list is constant, or where the lists differ in length.
#[must_use]
pub fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let n = a.len() as f64;
    let mean = |list: &[f64]| list.iter().sum::<f64>() / n;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product =
        |x: &[f64], mx: f64, y: &[f64], my: f64| -> f64 { x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum() };
    let scale = (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt();
    (a.len() == b.len() && a.len() >= 2 && scale > 0.0).then(|| product(a, mean_a, b, mean_b) / scale)
}

/// E of (3.5): half the squared error per value.
#[must_use]
pub fn half_mean_squared_error(target: &[f64], mean: &[f64]) -> f64 {
    let sum: f64 = target.iter().zip(mean).map(|(target, y)| (target - y).powi(2)).sum();
    sum / (2.0 * target.len() as f64)
}

/// The most a pattern's error (3.5) may be to count as reproduced, given the standard deviation of its noise (3.2.5).
#[must_use]
pub fn success_bound(standard_deviation: f64) -> f64 {
    (3.0 * standard_deviation).powi(2) / 2.0
}

/// Differential entropy in nats of a Gaussian: what the nll per value can at best come down to.
#[must_use]
pub fn gaussian_entropy(variance: f64) -> f64 {
    0.5 * (2.0 * std::f64::consts::PI * std::f64::consts::E * variance).ln()
}

/// Mean and standard deviation (divided by n - 1; 0 for a single value). NaN for an empty list.
#[must_use]
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, if values.len() > 1 { (squares / (n - 1.0)).sqrt() } else { squares })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_lines_and_of_nothing() {
        let a = [1.0, 2.0, 4.0];
        assert!((correlation(&a, &[3.0, 5.0, 9.0]).unwrap() - 1.0).abs() < 1e-15);
        assert!((correlation(&a, &[-3.0, -5.0, -9.0]).unwrap() + 1.0).abs() < 1e-15);
        assert_eq!((correlation(&a, &[2.0; 3]), correlation(&[], &[])), (None, None));
    }

    #[test]
    fn the_deviation_of_a_sample_is_unbiased_in_its_square() {
        assert_eq!(mean_and_deviation(&[1.0, 3.0]), (2.0, 2.0_f64.sqrt()));
        assert_eq!(mean_and_deviation(&[5.0]), (5.0, 0.0));
        assert!(mean_and_deviation(&[]).0.is_nan());
    }

    #[test]
    fn errors_and_entropy_by_hand() {
        assert_eq!(half_mean_squared_error(&[1.0, 2.0], &[0.0, 0.0]), 1.25);
        assert!((success_bound(0.01) - 0.00045).abs() < 1e-18);
        assert!((gaussian_entropy(1.0) - 1.418_938_533_204_672_7).abs() < 1e-15);
    }
}
