//! An oscillator with a stable cycle that noise drives while y is positive (thesis 3.4.1).
//!
//! Letters: `y` the sample, `z` its hidden partner, `t` time step from 1.
//!
//! The thesis does not say where its sequences start. Here each starts from a point drawn uniformly from the box
//! |y| < 0.8, |z| < 0.7 around the cycle, and its first [`BURN_IN`] steps are dropped: they are noisy steps as all
//! others, more than six periods, after which the start shows in the phase alone.
//!
//! Without noise y swings between -0.79 and 0.79 in 75.5 steps. With noise the largest of ten sequences of 1000 steps
//! is 0.98 in the median, but the noise has no bound: in one set out of four some peak passes 1, by a few hundredths.
//! Samples are not clipped: that would make the true variance wrong.

use super::{Task, check, dataset, generator, normal};
use rand::RngExt;
use scrnn::dataset::Dataset;
use scrnn::error::Result;

/// Delta t.
pub const TIME_STEP: f64 = 0.1;
/// Steps that are dropped before the first sample.
pub const BURN_IN: usize = 500;
const K_1: f64 = 1.0;
const K_2: f64 = 2.0;
const Z_A: f64 = 0.25;

/// How much to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How many sequences, each from a start of its own.
    pub sequences: usize,
    /// T, samples of each sequence.
    pub steps: usize,
}

impl Default for Options {
    /// Ten sequences of 1000 steps.
    fn default() -> Self {
        Self { sequences: 10, steps: 1000 }
    }
}

/// The samples with the hidden partner of each.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitCycle {
    /// Samples y_t on channel `y`; their means y_{t-1} + z_{t-1} dt; their variances (3.12).
    pub task: Task,
    /// z_t on channel `z`, for phase plots. It is never learned from.
    pub z: Dataset,
}

/// A point of the phase plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// The value that is seen.
    pub y: f64,
    /// The value that is hidden.
    pub z: f64,
}

impl State {
    /// The next point, before noise is added to y.
    ///
    /// ```text
    /// y_t = y_{t-1} + z_{t-1} dt + epsilon_t
    /// z_t = z_{t-1} + (f(z_{t-1}) - k_1 y_{t-1}) dt         (3.10)
    /// ```
    #[must_use]
    pub fn next(self) -> Self {
        let Self { y, z } = self;
        Self { y: y + z * TIME_STEP, z: z + (drive(z) - K_1 * y) * TIME_STEP }
    }

    /// The standard deviation of the noise that the next y receives.
    ///
    /// ```text
    /// sigma_t = 0.03 y_{t-1}  for 0 < y_{t-1},  else 0      (3.12)
    /// ```
    #[must_use]
    pub fn standard_deviation(self) -> f64 {
        if self.y > 0.0 { 0.03 * self.y } else { 0.0 }
    }
}

/// ```text
/// f(z) =  k_2 z               |z| <= z_a
///        -k_2 (z - 2 z_a)     z_a < z
///        -k_2 (z + 2 z_a)     z < -z_a                      (3.11)
/// ```
fn drive(z: f64) -> f64 {
    if z > Z_A {
        -K_2 * (z - 2.0 * Z_A)
    } else if z < -Z_A {
        -K_2 * (z + 2.0 * Z_A)
    } else {
        K_2 * z
    }
}

/// Sequences of the noisy oscillator.
///
/// # Errors
/// [`scrnn::error::Error::Setting`] for no sequences or no steps.
pub fn generate(options: &Options, seed: u64) -> Result<LimitCycle> {
    check(options.sequences, options.steps)?;
    let [mut data, mut means, mut variances, mut partners] = [const { Vec::new() }; 4];
    for s in 0..options.sequences {
        let mut rng = generator(seed, s);
        let mut state = State { y: rng.random_range(-0.8..0.8), z: rng.random_range(-0.7..0.7) };
        let mut advance = || {
            let (clean, sigma) = (state.next(), state.standard_deviation());
            // A number is drawn even where it counts for nothing: noise is then the same function of the step.
            state = State { y: clean.y + sigma * normal(&mut rng), ..clean };
            (state, clean.y, sigma * sigma)
        };
        for _ in 0..BURN_IN {
            advance();
        }
        let [mut ys, mut clean, mut spread, mut zs] = [0; 4].map(|_| Vec::with_capacity(options.steps));
        for _ in 0..options.steps {
            let (state, mean, variance) = advance();
            ys.push(state.y);
            clean.push(mean);
            spread.push(variance);
            zs.push(state.z);
        }
        data.push(ys);
        means.push(clean);
        variances.push(spread);
        partners.push(zs);
    }
    let task =
        Task { data: dataset(&["y"], data)?, means: dataset(&["y"], means)?, variances: dataset(&["y"], variances)? };
    Ok(LimitCycle { task, z: dataset(&["z"], partners)? })
}

#[cfg(test)]
mod tests {
    use super::super::tests::standardised_deviation;
    use super::*;

    #[test]
    fn one_step_agrees_with_a_hand_worked_case_on_each_branch() {
        let cases = [
            (State { y: 0.5, z: 0.2 }, State { y: 0.52, z: 0.19 }),
            (State { y: 0.5, z: 0.6 }, State { y: 0.56, z: 0.53 }),
            (State { y: 0.5, z: -0.6 }, State { y: 0.44, z: -0.63 }),
        ];
        for (from, to) in cases {
            let next = from.next();
            assert!((next.y - to.y).abs() < 1e-15 && (next.z - to.z).abs() < 1e-15, "{from:?}: {next:?}");
        }
    }

    #[test]
    fn f_is_continuous_at_its_corners() {
        for corner in [-Z_A, Z_A] {
            assert!((drive(corner - 1e-9) - drive(corner + 1e-9)).abs() < 1e-8);
        }
        assert_eq!(drive(0.0), 0.0);
    }

    #[test]
    fn the_clean_cycle_has_a_period_of_75_and_a_half_steps() {
        let mut state = State { y: 0.1, z: 0.1 };
        let mut crossings = Vec::new();
        let mut extremes = (0.0_f64, 0.0_f64);
        for t in 0..20_000 {
            let next = state.next();
            if t >= 2000 {
                extremes = (extremes.0.min(next.y), extremes.1.max(next.y));
                if state.y < 0.0 && next.y >= 0.0 {
                    crossings.push(f64::from(t) - state.y / (next.y - state.y));
                }
            }
            state = next;
        }
        let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
        assert!((period - 75.47).abs() < 0.01, "{period}");
        assert!((extremes.0 + 0.788).abs() < 1e-3 && (extremes.1 - 0.788).abs() < 1e-3, "{extremes:?}");
    }

    #[test]
    fn noise_follows_the_last_sample_and_vanishes_below_zero() {
        let LimitCycle { task, z } = generate(&Options::default(), 1).unwrap();
        for (s, sequence) in task.data.sequences().iter().enumerate() {
            let values = |set: &Dataset, k: usize| set.sequences()[s].sample(k)[0];
            for k in 1..sequence.len() {
                let last = State { y: values(&task.data, k - 1), z: values(&z, k - 1) };
                assert_eq!(values(&task.means, k), last.next().y);
                assert_eq!(values(&z, k), last.next().z);
                let deviation = 0.03 * last.y.max(0.0);
                assert_eq!(values(&task.variances, k), deviation * deviation);
                if last.y < 0.0 {
                    assert_eq!(values(&task.data, k), values(&task.means, k));
                }
            }
        }
    }

    #[test]
    fn samples_scatter_by_the_true_variance() {
        let task = generate(&Options { sequences: 2, steps: 4000 }, 2).unwrap().task;
        for s in 0..2 {
            let ratio = standardised_deviation(&task, s);
            assert!((ratio - 1.0).abs() < 0.05, "sequence {s}: {ratio}");
        }
    }

    #[test]
    fn sequences_lie_on_the_cycle_from_their_first_sample_at_different_phases() {
        let LimitCycle { task, z } = generate(&Options::default(), 3).unwrap();
        assert_eq!((task.data.sequences().len(), task.data.total_samples()), (10, 10_000));
        // Two of five phases have y below -0.3, and two above 0.3: among forty there are some of both, whatever the seed.
        let many = generate(&Options { sequences: 40, steps: 1 }, 3).unwrap().task.data;
        let mut starts: Vec<f64> = many.sequences().iter().map(|sequence| sequence.sample(0)[0]).collect();
        starts.sort_by(f64::total_cmp);
        assert!(starts.windows(2).all(|pair| pair[1] > pair[0]), "{starts:?}");
        assert!(starts[4] < -0.3 && starts[35] > 0.3, "{starts:?}");
        for (y, z) in task.data.sequences().iter().zip(z.sequences()) {
            for (y, z) in y.values().iter().zip(z.values()) {
                let radius = y.hypot(*z);
                assert!((0.5..1.3).contains(&radius), "y = {y}, z = {z}");
            }
        }
    }

    #[test]
    fn seed_42_gives_these_values() {
        let LimitCycle { task, z } = generate(&Options { sequences: 2, steps: 1000 }, 42).unwrap();
        // Sums and products alone: the bits are the same on every platform.
        assert_eq!(task.data.sequences()[1].sample(0), [0.10949589893967172]);
        assert_eq!(task.data.sequences()[1].sample(999), [-0.5120029033575435]);
        assert_eq!(z.sequences()[1].sample(999), [-0.3575550432582247]);
    }
}
