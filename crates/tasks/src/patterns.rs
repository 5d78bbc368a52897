//! 144 fluctuating patterns (thesis 6.2.3).
//!
//! The thesis says that 144 patterns with different noise were learned, and nothing else. Here they are the twelve
//! Lissajous curves, each in twelve variants: turned by 0, 30 or 60 degrees, and shrunk to one of four sizes. No two
//! run along the same points, and all stay within reach of the mean units. Turning by 90 degrees would lead from one
//! curve to another, which is why it is left out. The four levels of noise are those of (3.3); each level is met
//! equally often among curves, angles and sizes.

use super::{Task, lissajous, noisy};
use scrnn::error::{Error, Result};

/// How many there are.
pub const PATTERNS: usize = CURVES * ANGLES.len() * SIZES.len();
const CURVES: usize = 12;
/// In degrees.
const ANGLES: [f64; 3] = [0.0, 30.0, 60.0];
const SIZES: [f64; 4] = [0.8, 0.65, 0.5, 0.35];

/// How much to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How many of the patterns, from the first.
    pub sequences: usize,
    /// T, samples of each sequence.
    pub steps: usize,
}

impl Default for Options {
    /// All of them, of 1000 steps.
    fn default() -> Self {
        Self { sequences: PATTERNS, steps: 1000 }
    }
}

/// The patterns with noise, on channels `y1` and `y2`.
///
/// # Errors
/// [`Error::Setting`] for more than 144 sequences, no sequences or no steps.
pub fn generate(options: &Options, seed: u64) -> Result<Task> {
    if options.sequences > PATTERNS {
        let found = options.sequences.to_string();
        return Err(Error::Setting { what: "sequences", found, needed: "at most 144, as there are 144 patterns" });
    }
    noisy(["y1", "y2"], (options.sequences, options.steps), seed, |s, t| (pattern(s, t), deviation(s)))
}

/// Pattern `s` at time step `t`: curve s mod 12, turned, then shrunk.
fn pattern(s: usize, t: usize) -> [f64; 2] {
    let variant = s / CURVES;
    let (sin, cos) = ANGLES[variant % ANGLES.len()].to_radians().sin_cos();
    let size = SIZES[variant / ANGLES.len()];
    let [a, b] = lissajous::curve(s % CURVES, t);
    [size * (cos * a - sin * b), size * (sin * a + cos * b)]
}

/// The levels of (3.3), moved on by one from variant to variant.
fn deviation(s: usize) -> f64 {
    lissajous::deviation(s + s / CURVES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_twelve_are_the_lissajous_curves_at_four_fifths_of_their_size() {
        for (s, t) in [(0, 7), (5, 12), (11, 20)] {
            let expected = lissajous::curve(s, t).map(|value| 0.8 * value);
            assert_eq!(pattern(s, t), expected);
        }
        // Curve 1 half way round is at (0.8, 0); turned by 30 degrees and at 0.8 of its size:
        let [a, b] = pattern(12, 25 / 2);
        let [x, y] = lissajous::curve(0, 12);
        assert!((a - 0.8 * (0.75_f64.sqrt() * x - 0.5 * y)).abs() < 1e-12);
        assert!((b - 0.8 * (0.5 * x + 0.75_f64.sqrt() * y)).abs() < 1e-12);
    }

    #[test]
    fn no_two_patterns_run_along_the_same_points_in_the_same_direction() {
        let whole = |s: usize| (1..=25).map(|t| pattern(s, t)).collect::<Vec<_>>();
        let all: Vec<_> = (0..PATTERNS).map(whole).collect();
        let apart = |a: &[[f64; 2]], b: &[[f64; 2]], shift: usize| {
            (0..25).map(|t| (a[t][0] - b[(t + shift) % 25][0]).hypot(a[t][1] - b[(t + shift) % 25][1])).sum::<f64>()
        };
        for first in 0..PATTERNS {
            for second in first + 1..PATTERNS {
                let least = (0..25).map(|shift| apart(&all[first], &all[second], shift)).fold(f64::INFINITY, f64::min);
                assert!(least / 25.0 > 0.03, "{first} and {second}: {least}");
            }
        }
    }

    #[test]
    fn patterns_stay_within_reach_and_meet_each_level_equally_often() {
        let reach = (0..PATTERNS).flat_map(|s| (1..=25).flat_map(move |t| pattern(s, t))).map(f64::abs);
        assert!(reach.fold(0.0, f64::max) < 0.93);
        for level in [0.01, 0.03, 0.05, 0.07] {
            assert_eq!((0..PATTERNS).filter(|&s| deviation(s) == level).count(), 36);
        }
        assert!(generate(&Options { sequences: 145, steps: 1 }, 1).is_err());
    }
}
