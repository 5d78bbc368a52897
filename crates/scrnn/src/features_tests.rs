//! Fits by hand, and what is refused.

use super::*;
use crate::dataset::Sequence;
use crate::topology::Prediction;

fn data(values: &[&[f64]]) -> Dataset {
    let sequences = values.iter().map(|values| Sequence::new("s", 1, values.to_vec()).unwrap()).collect();
    Dataset::new(Dataset::numbered_channels(1), sequences).unwrap()
}

#[test]
fn scales_are_root_mean_squares_of_what_is_left() {
    // Differences 1, 3, -2; of a straight line 1 (from rest), 2, -5.
    let data = data(&[&[0.0, 1.0, 4.0, 2.0]]);
    let scale = |kind| Skip::fit(kind, &data, 1).unwrap().scale()[0];
    assert!((scale(SkipKind::Residual) - (14.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    assert!((scale(SkipKind::Extrapolation { damping: 1.0 }) - (30.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    assert_eq!(scale(SkipKind::Extrapolation { damping: 0.0 }), scale(SkipKind::Residual));
    assert!((velocity_deviations(&data)[0] - (14.0_f64 / 3.0).sqrt()).abs() < 1e-15);
}

#[test]
fn two_steps_ahead_a_line_goes_twice_as_far() {
    let ramp: Vec<f64> = (0..20).map(f64::from).collect();
    let fitted = Skip::fit(SkipKind::Extrapolation { damping: 1.0 }, &data(&[&ramp]), 2).unwrap();
    assert_eq!(fitted.taps(), [2.0]);
    // Only the first step, which knows no change yet, is wrong: by 2, of 18 steps.
    assert!((fitted.scale()[0] - (4.0_f64 / 18.0).sqrt()).abs() < 1e-15);
}

#[cfg(feature = "analysis")]
#[test]
fn what_the_fitted_taps_leave_over_has_nothing_of_the_differences_left() {
    let wave: Vec<f64> =
        (0..60).map(|t| (0.3 * f64::from(t)).sin() + 0.3 * (1.1 * f64::from(t * t % 17)).cos()).collect();
    let skip = Skip::fit(SkipKind::Autoregressive { lags: 2 }, &data(&[&wave]), 1).unwrap();
    let d = |k: usize, lag: usize| if k > lag { wave[k - lag] - wave[k - lag - 1] } else { 0.0 };
    let left = |k: usize| wave[k + 1] - wave[k] - skip.taps()[0] * d(k, 0) - skip.taps()[1] * d(k, 1);
    for lag in 0..2 {
        let (product, square) = (0..59).fold((0.0, 0.0), |(p, s), k| (p + left(k) * d(k, lag), s + d(k, lag).powi(2)));
        assert!(product.abs() < 1e-5 * square, "{lag}: {product} of {square}");
    }
    let mean_square = (0..59).map(|k| left(k).powi(2)).sum::<f64>() / 59.0;
    assert!((skip.scale()[0] - mean_square.sqrt()).abs() < 1e-12);
    let still = Skip::fit(SkipKind::Autoregressive { lags: 3 }, &data(&[&[1.0; 9]]), 1).unwrap();
    assert_eq!((still.taps(), still.scale()), (&[0.0; 3][..], &[1.0][..]));
}

#[test]
fn missing_values_are_passed_over() {
    let whole = data(&[&[0.0, 1.0, 4.0], &[1.0, 2.0]]);
    let gapped = data(&[&[0.0, 1.0, 4.0, f64::NAN], &[f64::NAN, 1.0, 2.0]]);
    let scale = |data| Skip::fit(SkipKind::Residual, data, 1).unwrap().scale()[0];
    assert_eq!(scale(&whole), scale(&gapped));
    assert_eq!(velocity_deviations(&whole), velocity_deviations(&gapped));
}

#[test]
fn what_makes_no_connection_is_refused() {
    let data = data(&[&[0.0, 1.0, 4.0]]);
    let message = |result: Result<Skip>| result.unwrap_err().to_string();
    assert!(message(Skip::fit(SkipKind::Extrapolation { damping: 1.5 }, &data, 1)).contains("is 1.5; needed"));
    assert!(message(Skip::fit(SkipKind::Residual, &data, 3)).contains("one delay apart is 0"));
    assert!(message(Skip::new(vec![], vec![0.0])).contains("is 0; needed: a number above 0"));
    assert!(message(Skip::new(vec![f64::NAN], vec![1.0])).contains("tap of the skip connection is NaN"));
    assert!(message(Skip::new(vec![1.0; 3], vec![1.0; 2])).contains("holds 3 values; needed: 4"));
    let topology = Topology::new(2, 1, vec![crate::topology::Group::full("c", 2, 2.0)], Prediction::Mean).unwrap();
    let skip = Skip::new(vec![], vec![1.0]).unwrap();
    assert!(topology.clone().with_skip(skip).unwrap_err().to_string().contains("holds 1 values; needed: 2"));
    assert!(topology.with_velocity_inputs(vec![1.0, -1.0]).unwrap_err().to_string().contains("deviation is -1"));
}
