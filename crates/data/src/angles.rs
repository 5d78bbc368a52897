//! Angles that jump by a whole turn where they leave their range.

use std::f64::consts::TAU;

/// A whole turn in the unit of these angles: 360 if any is beyond what radians reach before they wrap.
pub fn turn(values: impl Iterator<Item = f64>) -> f64 {
    let beyond = |value: f64| value.is_finite() && value.abs() > TAU + 0.1;
    if { values }.any(beyond) { 360.0 } else { TAU }
}

/// Adds whole turns so that no value is further than half a turn from the one before it. Missing values (NaN) are passed
/// over. Values before the first jump keep their bits.
pub fn unwrap<'a>(turn: f64, values: impl Iterator<Item = &'a mut f64>) {
    let mut turns = 0.0;
    let mut before: Option<f64> = None;
    for value in values.filter(|value| value.is_finite()) {
        if let Some(before) = before {
            let step = *value - before;
            if step.abs() > turn / 2.0 {
                turns -= (step / turn).round();
            }
        }
        before = Some(*value);
        if turns != 0.0 {
            *value += turn * turns;
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
        unwrap(TAU, wrapped.iter_mut());
        for (k, (a, b)) in wrapped.iter().zip(&truth).enumerate() {
            assert!(k == 50 || (a - b).abs() < 1e-12, "{k}: {a} {b}");
        }
    }

    #[test]
    fn what_does_not_jump_keeps_its_bits() {
        let mut values = [0.1, 0.3, -0.2, 3.2, 3.0];
        let before = values;
        unwrap(TAU, values.iter_mut());
        // From -0.2 to 3.2 is more than half a turn.
        assert_eq!(values[..3], before[..3]);
        assert_eq!(values[3], 3.2 - TAU);
        let mut small = [0.1, 3.1, 0.05];
        unwrap(TAU, small.iter_mut());
        assert_eq!(small, [0.1, 3.1, 0.05]);
        let mut degrees = [170.0, -175.0, -165.0];
        unwrap(turn(degrees.iter().copied()), degrees.iter_mut());
        assert_eq!(degrees, [170.0, 185.0, 195.0]);
        assert_eq!(turn([f64::NAN, 3.0].into_iter()), TAU);
    }
}
