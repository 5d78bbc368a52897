//! Ranges of channels that a few spikes do not rule.

use scrnn::dataset::Dataset;

/// Share of the samples, on each side, that may lie anywhere.
const SHARE: f64 = 0.01;
/// How far beyond all others, in their range, a sample still counts. Of normal noise 98 % fill 4.7 deviations, so that noise
/// counts as a whole.
const BEYOND: f64 = 0.5;

/// The range of each channel: from its least to its greatest sample, without those that lie further outside of what 98 % of
/// them fill than half of its width. Without such samples it is the whole range. Missing values are passed over.
pub fn ranges(data: &Dataset) -> Vec<(f64, f64)> {
    let n = data.channels().len();
    let channel = |i: usize| {
        let all = data.sequences().iter().flat_map(move |sequence| sequence.values().iter().skip(i).step_by(n));
        range(all.copied().filter(|value| value.is_finite()).collect())
    };
    (0..n).map(channel).collect()
}

fn range(mut values: Vec<f64>) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    let place = (last as f64 * SHARE).ceil() as usize;
    let (low, high) = (values[place.min(last)], values[last - place.min(last)]);
    // What hardly ever moves has no other range than its whole.
    if low >= high {
        return (values[0], values[last]);
    }
    let reach = BEYOND * (high - low);
    let inside = || values.iter().copied().filter(|value| (low - reach..=high + reach).contains(value));
    (inside().fold(f64::INFINITY, f64::min), inside().fold(f64::NEG_INFINITY, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spikes_do_not_count_and_all_else_does() {
        let mut wave: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.1).sin()).collect();
        let whole = range(wave.clone());
        assert!(whole.0 < -0.9999 && whole.1 > 0.9999);
        (wave[10], wave[500], wave[700]) = (60.0, -60.0, 61.0);
        assert_eq!(range(wave), whole);
        // A touch that is rare, but all there is.
        let mut touch = vec![0.0; 1000];
        touch[5] = 1.0;
        assert_eq!(range(touch), (0.0, 1.0));
        assert_eq!(range(vec![3.0, 1.0, 2.0]), (1.0, 3.0));
        assert_eq!(range(Vec::new()), (0.0, 0.0));
    }
}
