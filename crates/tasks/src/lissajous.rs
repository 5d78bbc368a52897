//! Twelve fluctuating Lissajous curves (thesis 3.2.1, C.1.1).
//!
//! Letters: `s` sequence, `t` time step from 1, `P` period, `Y_i` the four sine waves. Sequences count from 0 here, so
//! that curve s is (C.{s + 1}).

use super::{Task, noisy};
use scrnn::error::{Error, Result};
use std::f64::consts::TAU;

/// P, in steps.
pub const PERIOD: usize = 25;

/// The channels of each curve: plus or minus one of the waves Y_1 ... Y_4.
const CURVES: [[i8; 2]; 12] = [
    [1, 2],  // (C.1)
    [-1, 2], // (C.2)
    [2, 1],  // (C.3)
    [2, -1], // (C.4)
    [1, 4],  // (C.5)
    [-1, 4], // (C.6)
    [4, 1],  // (C.7)
    [4, -1], // (C.8)
    [3, 2],  // (C.9)
    [-3, 2], // (C.10)
    [2, 3],  // (C.11)
    [2, -3], // (C.12)
];

/// How much to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How many of the twelve curves, from the first.
    pub sequences: usize,
    /// T, samples of each sequence.
    pub steps: usize,
}

impl Default for Options {
    /// All twelve, of 1000 steps.
    fn default() -> Self {
        Self { sequences: CURVES.len(), steps: 40 * PERIOD }
    }
}

/// The curves with noise, on channels `y1` and `y2`.
///
/// # Errors
/// [`Error::Setting`] for more than twelve sequences, no sequences or no steps.
pub fn generate(options: &Options, seed: u64) -> Result<Task> {
    if options.sequences > CURVES.len() {
        let found = options.sequences.to_string();
        return Err(Error::Setting {
            what: "sequences",
            found,
            needed: "at most 12, as there are 12 Lissajous curves",
        });
    }
    noisy(["y1", "y2"], (options.sequences, options.steps), seed, |s, t| (curve(s, t), deviation(s)))
}

/// The clean curve `s` at time step `t`.
///
/// # Errors
/// [`Error::NoSuch`] if `s` is not below 12.
pub fn ideal(s: usize, t: usize) -> Result<[f64; 2]> {
    exists(s).map(|()| curve(s, t))
}

/// The standard deviation of the noise on curve `s` (3.3).
///
/// # Errors
/// [`Error::NoSuch`] if `s` is not below 12.
pub fn standard_deviation(s: usize) -> Result<f64> {
    exists(s).map(|()| deviation(s))
}

fn exists(s: usize) -> Result<()> {
    if s < CURVES.len() {
        return Ok(());
    }
    Err(Error::NoSuch { what: "Lissajous curve", found: s, count: CURVES.len() })
}

/// ```text
/// (y_1, y_2) = (+-Y_i, +-Y_j)                                  (C.1) - (C.12)
/// ```
pub(super) fn curve(s: usize, t: usize) -> [f64; 2] {
    let waves = waves(t);
    CURVES[s].map(|wave| f64::from(wave.signum()) * waves[usize::from(wave.unsigned_abs()) - 1])
}

/// ```text
/// sigma = 0.01, 0.03, 0.05, 0.07, 0.01, ...                    (3.3)
/// ```
pub(super) fn deviation(s: usize) -> f64 {
    [0.01, 0.03, 0.05, 0.07][s % 4]
}

/// ```text
/// Y_1 = -0.4 (cos(2 pi t / P) - 1)     Y_2 = 0.8 sin(2 pi t / P)
/// Y_3 = -0.4 (cos(4 pi t / P) - 1)     Y_4 = 0.8 sin(4 pi t / P)     (3.1)
/// ```
///
/// Whole periods are taken off first: the curve repeats to the bit.
fn waves(t: usize) -> [f64; 4] {
    let angle = TAU * (t % PERIOD) as f64 / PERIOD as f64;
    let [(sin, cos), (sin_twice, cos_twice)] = [angle.sin_cos(), (2.0 * angle).sin_cos()];
    [-0.4 * (cos - 1.0), 0.8 * sin, -0.4 * (cos_twice - 1.0), 0.8 * sin_twice]
}

#[cfg(test)]
mod tests {
    use super::super::tests::standardised_deviation;
    use super::*;

    fn assert_near(found: [f64; 2], expected: [f64; 2]) {
        for (a, b) in found.into_iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{found:?} instead of {expected:?}");
        }
    }

    #[test]
    fn curves_pass_through_hand_worked_points() {
        // A fifth of a period: cos(72 deg) = (sqrt 5 - 1) / 4, and twice that angle has cos(144 deg) = -(sqrt 5 + 1) / 4.
        let root = 5.0_f64.sqrt();
        let y1 = -0.4 * ((root - 1.0) / 4.0 - 1.0);
        let y2 = 0.8 * (10.0 + 2.0 * root).sqrt() / 4.0;
        let y3 = -0.4 * (-(root + 1.0) / 4.0 - 1.0);
        let y4 = 0.8 * (10.0 - 2.0 * root).sqrt() / 4.0;
        let expected = [
            [y1, y2],
            [-y1, y2],
            [y2, y1],
            [y2, -y1],
            [y1, y4],
            [-y1, y4],
            [y4, y1],
            [y4, -y1],
            [y3, y2],
            [-y3, y2],
            [y2, y3],
            [y2, -y3],
        ];
        for (s, point) in expected.into_iter().enumerate() {
            assert_near(ideal(s, 5).unwrap(), point);
            assert_near(ideal(s, 0).unwrap(), [0.0, 0.0]);
            assert_eq!(ideal(s, 7).unwrap(), ideal(s, 7 + 39 * PERIOD).unwrap());
        }
    }

    #[test]
    fn the_first_sample_is_time_step_one() {
        let task = generate(&Options { sequences: 3, steps: 30 }, 1).unwrap();
        for s in 0..3 {
            for k in 0..30 {
                assert_eq!(task.means.sequences()[s].sample(k), ideal(s, k + 1).unwrap());
            }
        }
    }

    #[test]
    fn noise_has_the_level_of_its_curve() {
        let task = generate(&Options::default(), 7).unwrap();
        assert_eq!((task.data.sequences().len(), task.data.total_samples()), (12, 12_000));
        let levels = [0.01, 0.03, 0.05, 0.07, 0.01, 0.03, 0.05, 0.07, 0.01, 0.03, 0.05, 0.07];
        for (s, sigma) in levels.into_iter().enumerate() {
            assert_eq!(standard_deviation(s).unwrap(), sigma);
            assert!(task.variances.sequences()[s].values().iter().all(|&v| v == sigma * sigma));
            let ratio = standardised_deviation(&task, s);
            assert!((ratio - 1.0).abs() < 0.05, "curve {s}: {ratio}");
        }
    }

    #[test]
    fn the_first_curves_do_not_depend_on_how_many_are_made() {
        let few = generate(&Options { sequences: 2, steps: 50 }, 3).unwrap();
        let all = generate(&Options { sequences: 12, steps: 100 }, 3).unwrap();
        assert_eq!(few.data.sequences()[1], all.data.sequences()[1].truncated(50));
        assert_ne!(few.data, generate(&Options { sequences: 2, steps: 50 }, 4).unwrap().data);
    }

    #[test]
    fn there_are_no_more_than_twelve() {
        let error = generate(&Options { sequences: 13, ..Options::default() }, 0).unwrap_err();
        assert!(error.to_string().contains("there are 12 Lissajous curves"), "{error}");
        assert!(ideal(12, 1).is_err() && standard_deviation(12).is_err());
        assert!(generate(&Options { steps: 0, ..Options::default() }, 0).is_err());
    }

    #[test]
    fn seed_42_gives_these_values() {
        let task = generate(&Options { sequences: 4, steps: 3 }, 42).unwrap();
        let sample = |s: usize| task.data.sequences()[s].sample(2).try_into().unwrap();
        assert_near(sample(0), [0.12009758382952394, 0.5458176302540316]);
        assert_near(sample(3), [0.4779715848685582, -0.05589816873388424]);
    }
}
