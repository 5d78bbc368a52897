//! Swings of a signal: how large, how long, and how regular (for thesis 3.4).
//!
//! A cycle lasts from one upward crossing of a level to the next. A crossing counts only after the signal was well below
//! the level, so that noise around it does not count twice.

use serde::{Deserialize, Serialize};

use crate::evaluation::mean_and_deviation;

/// Amplitude and period over all cycles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Oscillation {
    /// Number of whole cycles.
    pub cycles: usize,
    /// Mean of half the distance between a cycle's highest and lowest value.
    pub amplitude: f64,
    /// Its standard deviation from cycle to cycle.
    pub amplitude_deviation: f64,
    /// Mean length in steps.
    pub period: f64,
    /// Its standard deviation.
    pub period_deviation: f64,
}

impl Oscillation {
    /// Of several signals, around `level`; a crossing counts once the signal was `below` under it. None without two cycles.
    #[must_use]
    pub fn of<'a>(signals: impl IntoIterator<Item = &'a [f64]>, level: f64, below: f64) -> Option<Self> {
        let (mut amplitudes, mut periods) = (Vec::new(), Vec::new());
        for signal in signals {
            let crossings = crossings(signal, level, below);
            for pair in crossings.windows(2) {
                let ((from, start), (to, end)) = (pair[0], pair[1]);
                let (low, high) = signal[from..to]
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &y| (low.min(y), high.max(y)));
                amplitudes.push((high - low) / 2.0);
                periods.push(end - start);
            }
        }
        let (amplitude, amplitude_deviation) = mean_and_deviation(&amplitudes);
        let (period, period_deviation) = mean_and_deviation(&periods);
        let cycles = periods.len();
        (cycles > 1).then_some(Self { cycles, amplitude, amplitude_deviation, period, period_deviation })
    }
}

/// Upward crossings: the first index at or above the level, and the time between two samples.
fn crossings(signal: &[f64], level: f64, below: f64) -> Vec<(usize, f64)> {
    let mut found = Vec::new();
    let mut armed = false;
    for (k, pair) in signal.windows(2).enumerate() {
        armed |= pair[0] < level - below;
        if armed && pair[0] < level && pair[1] >= level {
            found.push((k + 1, k as f64 + (level - pair[0]) / (pair[1] - pair[0])));
            armed = false;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_wave_has_its_amplitude_and_period() {
        let wave: Vec<f64> =
            (0..1000).map(|k| 0.8 * (std::f64::consts::TAU * f64::from(k) / 24.0 - 1.0).sin()).collect();
        let found = Oscillation::of([wave.as_slice()], 0.0, 0.2).unwrap();
        assert_eq!(found.cycles, 41);
        assert!((found.period - 24.0).abs() < 1e-9 && found.period_deviation < 1e-9, "{found:?}");
        assert!((found.amplitude - 0.8).abs() < 0.01 && found.amplitude_deviation < 1e-9, "{found:?}");
    }

    #[test]
    fn noise_around_the_level_is_not_a_cycle() {
        let signal = [-1.0, 0.1, -0.1, 0.1, 1.0, -1.0, 1.0, -1.0, 3.0];
        let found = Oscillation::of([signal.as_slice()], 0.0, 0.2).unwrap();
        assert_eq!(found.cycles, 2);
        assert_eq!(found.amplitude, 1.0);
        assert_eq!(Oscillation::of([[1.0, 2.0].as_slice()], 0.0, 0.2), None);
    }
}
