//! What a quantity does over a cycle that repeats, e.g. a predicted variance from one branching point to the next.

use serde::Serialize;

/// The mean over many cycles, phase by phase, and where it is largest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CycleProfile {
    /// Mean at each phase.
    pub mean: Vec<f64>,
    /// The phase of the largest mean.
    pub peak_at: usize,
    /// The largest mean over the median one.
    pub peak_over_median: f64,
}

impl CycleProfile {
    /// Of signals whose cycles of `length` steps begin at `starts`. Cycles that a signal does not reach the end of are left
    /// out; none if nothing is left.
    #[must_use]
    pub fn of<'a>(signals: impl IntoIterator<Item = &'a [f64]>, starts: &[usize], length: usize) -> Option<Self> {
        let (mut sums, mut count) = (vec![0.0; length], 0_usize);
        for signal in signals {
            for cycle in starts.iter().filter_map(|&start| signal.get(start..start + length)) {
                sums.iter_mut().zip(cycle).for_each(|(sum, value)| *sum += value);
                count += 1;
            }
        }
        if count == 0 || length == 0 {
            return None;
        }
        let mean: Vec<f64> = sums.iter().map(|sum| sum / count as f64).collect();
        let mut sorted = mean.clone();
        sorted.sort_by(f64::total_cmp);
        let median = f64::midpoint(sorted[(length - 1) / 2], sorted[length / 2]);
        let peak_at = (0..length).max_by(|&a, &b| mean[a].total_cmp(&mean[b])).unwrap_or(0);
        Some(Self { peak_over_median: mean[peak_at] / median, peak_at, mean })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_stands_out_of_the_mean_cycle() {
        let signal = [9.0, 1.0, 4.0, 2.0, 1.0, 3.0, 6.0, 2.0, 1.0, 100.0];
        let found = CycleProfile::of([signal.as_slice()], &[1, 5, 9], 4).unwrap();
        assert_eq!(found.mean, [2.0, 5.0, 2.0, 1.0]);
        assert_eq!((found.peak_at, found.peak_over_median), (1, 2.5));
        assert_eq!(CycleProfile::of([signal.as_slice()], &[8], 4), None);
    }
}
