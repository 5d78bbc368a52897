//! A sine wave whose noise grows and falls within each period (thesis 3.3.1).
//!
//! Letters: `t` time step from 1, `P` period.

use super::{Task, noisy};
use scrnn::error::Result;
use std::f64::consts::TAU;

/// P, in steps.
pub const PERIOD: usize = 25;

/// How much to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How many sequences: the same curve, each with noise of its own. The thesis has one.
    pub sequences: usize,
    /// T, samples of each sequence.
    pub steps: usize,
}

impl Default for Options {
    /// One sequence of 1000 steps.
    fn default() -> Self {
        Self { sequences: 1, steps: 40 * PERIOD }
    }
}

/// The curve with noise, on channel `y`.
///
/// # Errors
/// [`scrnn::error::Error::Setting`] for no sequences or no steps.
pub fn generate(options: &Options, seed: u64) -> Result<Task> {
    noisy(["y"], (options.sequences, options.steps), seed, |_, t| ([ideal(t)], standard_deviation(t)))
}

/// The clean curve at time step `t`.
///
/// ```text
/// y = 0.8 sin(2 pi t / P)                                                  (3.6)
/// ```
#[must_use]
pub fn ideal(t: usize) -> f64 {
    0.8 * (TAU * (t % PERIOD) as f64 / PERIOD as f64).sin()
}

/// The standard deviation of the noise at time step `t`.
///
/// ```text
/// sigma =  0.12 / P (t - n P) + 0.01          n P <= t < (2 n + 1) P / 2   (3.7)
///         -0.12 / P (t - (n + 1) P) + 0.01    up to (n + 1) P
/// ```
#[must_use]
pub fn standard_deviation(t: usize) -> f64 {
    let since = t % PERIOD;
    let distance = if 2 * since < PERIOD { since } else { PERIOD - since };
    0.12 / PERIOD as f64 * distance as f64 + 0.01
}

#[cfg(test)]
mod tests {
    use super::super::tests::standardised_deviation;
    use super::*;

    #[test]
    fn the_curve_passes_through_hand_worked_points() {
        assert_eq!(ideal(25), 0.0);
        let fifth = 0.8 * (10.0 + 2.0 * 5.0_f64.sqrt()).sqrt() / 4.0;
        assert!((ideal(5) - fifth).abs() < 1e-12);
        assert!((ideal(995) + fifth).abs() < 1e-12);
    }

    #[test]
    fn noise_peaks_in_the_middle_of_each_period() {
        for (t, sigma) in [(0, 0.01), (1, 0.0148), (12, 0.0676), (13, 0.0676), (24, 0.0148), (25, 0.01), (987, 0.0676)]
        {
            assert!((standard_deviation(t) - sigma).abs() < 1e-15, "t = {t}: {}", standard_deviation(t));
        }
    }

    #[test]
    fn samples_scatter_by_the_true_variance() {
        let task = generate(&Options { sequences: 2, steps: 4000 }, 5).unwrap();
        for s in 0..2 {
            let ratio = standardised_deviation(&task, s);
            assert!((ratio - 1.0).abs() < 0.05, "sequence {s}: {ratio}");
        }
        let deviation = standard_deviation(1);
        assert_eq!(task.variances.sequences()[0].sample(0), [deviation * deviation]);
        assert_eq!(task.means.sequences()[0].sample(0), [ideal(1)]);
    }

    #[test]
    fn sequences_share_the_curve_but_not_the_noise() {
        let task = generate(&Options { sequences: 2, steps: 100 }, 5).unwrap();
        let [first, second] = [0, 1].map(|s| task.data.sequences()[s].values());
        assert!(first.iter().zip(second).all(|(a, b)| a != b));
        assert_eq!(task.means.sequences()[0].values(), task.means.sequences()[1].values());
    }

    #[test]
    fn the_default_is_one_sequence_of_forty_periods() {
        let task = generate(&Options::default(), 0).unwrap();
        assert_eq!((task.data.sequences().len(), task.data.total_samples()), (1, 1000));
        assert_eq!(task.data.channels(), ["y"]);
        assert!(generate(&Options { sequences: 1, steps: 0 }, 0).is_err());
    }

    #[test]
    fn seed_42_gives_these_values() {
        let task = generate(&Options::default(), 42).unwrap();
        for (step, expected) in [(0, 0.1557217324502468), (999, 0.03450774551953396)] {
            let found = task.data.sequences()[0].sample(step)[0];
            assert!((found - expected).abs() < 1e-12, "step {step}: {found}");
        }
    }
}
