//! Angles that jump by a whole turn where they leave their range.

use std::f64::consts::{PI, TAU};

/// Adds whole turns so that no value is further than half a turn from the one before it. Missing values (NaN) are passed
/// over. Values before the first jump keep their bits.
pub fn unwrap<'a>(values: impl Iterator<Item = &'a mut f64>) {
    let mut turns = 0.0;
    let mut before: Option<f64> = None;
    for value in values.filter(|value| value.is_finite()) {
        if let Some(before) = before {
            let step = *value - before;
            if step.abs() > PI {
                turns -= (step / TAU).round();
            }
        }
        before = Some(*value);
        if turns != 0.0 {
            *value += TAU * turns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_that_goes_round_and_back_is_unwrapped() {
        let truth: Vec<f64> = (0..200).map(|k| 9.0 * (f64::from(k) * 0.05).sin()).collect();
        let mut wrapped: Vec<f64> = truth.iter().map(|x| x.sin().atan2(x.cos())).collect();
        wrapped[50] = f64::NAN;
        unwrap(wrapped.iter_mut());
        for (k, (a, b)) in wrapped.iter().zip(&truth).enumerate() {
            assert!(k == 50 || (a - b).abs() < 1e-12, "{k}: {a} {b}");
        }
    }

    #[test]
    fn what_does_not_jump_keeps_its_bits() {
        let mut values = [0.1, 0.3, -0.2, 3.2, 3.0];
        let before = values;
        unwrap(values.iter_mut());
        // From -0.2 to 3.2 is more than half a turn.
        assert_eq!(values[..3], before[..3]);
        assert_eq!(values[3], 3.2 - TAU);
        let mut small = [0.1, 3.1, 0.05];
        unwrap(small.iter_mut());
        assert_eq!(small, [0.1, 3.1, 0.05]);
    }
}
