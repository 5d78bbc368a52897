//! What kind of movement data are: smooth or noisy, and whether it comes to rest.
//!
//! ```text
//! step = rms(x_t - x_{t-1}) / sd(x)                          how far a sample is from the one before
//! turn = rms(d_t - d_{t-1}) / rms(d_t),  d_t = x_t - x_{t-1}  how much of a change is not as the one before
//! ```
//!
//! Of white noise the step is 1.4 and the turn 1.7; of a wave of n samples a period both are about 6.3 / n. Noise shows in the turn
//! first: where it is above 1, a straight line predicts the next sample worse than the last sample does.

use scrnn::dataset::{Dataset, Sequence};

/// The character of a data set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Character {
    /// The median of the channels that move.
    pub step: f64,
    /// The same.
    pub turn: f64,
    /// Whether movements come to rest where their sequences end: they slow down there, or all end in one place that they did not begin
    /// in.
    pub rests: bool,
}

/// The share of a sequence's end that is looked at, and how slow it must be beside the whole.
const END: f64 = 0.03;
const SLOW: f64 = 0.1;
/// The share of the sequences that must come to rest.
const MOST: f64 = 0.8;
/// How near ends must be to each other, beside the whole movement, and beside the beginnings.
const NEAR: (f64, f64) = (0.05, 0.25);

impl Character {
    /// Looks at data. Where no channel moves, step and turn are 0.
    #[must_use]
    pub fn of(data: &Dataset) -> Self {
        let deviations: Vec<f64> = data.channel_moments().iter().map(|(_, variance)| variance.sqrt()).collect();
        let moving = (0..deviations.len()).filter(|i| deviations[*i] > 0.0);
        let (mut steps, mut turns): (Vec<f64>, Vec<f64>) = moving.map(|i| of_channel(data, i, deviations[i])).unzip();
        let resting = data.sequences().iter().filter(|sequence| comes_to_rest(sequence, &deviations)).count();
        let rests = resting as f64 >= MOST * data.sequences().len() as f64 || have_one_end(data, &deviations);
        Self { step: median(&mut steps), turn: median(&mut turns), rests }
    }

    /// Whether samples follow from the ones before by more than chance: whether a straight line predicts better than the last sample.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        self.turn > 0.0 && self.turn < 0.5
    }
}

/// Step and turn of one channel.
fn of_channel(data: &Dataset, i: usize, deviation: f64) -> (f64, f64) {
    let (mut step, mut turn) = ((0.0, 0_usize), (0.0, 0_usize));
    for sequence in data.sequences() {
        let x = |k: usize| sequence.sample(k)[i];
        for k in 1..sequence.len() {
            let d = x(k) - x(k - 1);
            let turned = if k > 1 { d - (x(k - 1) - x(k - 2)) } else { f64::NAN };
            for (sum, value) in [(&mut step, d), (&mut turn, turned)] {
                if value.is_finite() {
                    *sum = (sum.0 + value * value, sum.1 + 1);
                }
            }
        }
    }
    let rms = |(sum, count): (f64, usize)| (sum / count.max(1) as f64).sqrt();
    let (step, turn) = (rms(step), rms(turn));
    (step / deviation, if step > 0.0 { turn / step } else { 0.0 })
}

/// Whether the last steps are far slower than all.
fn comes_to_rest(sequence: &Sequence, deviations: &[f64]) -> bool {
    let speed = |from: usize| {
        let length = |k: usize| {
            let parts = sequence.sample(k).iter().zip(sequence.sample(k - 1)).zip(deviations);
            let squares =
                parts.filter(|(_, deviation)| **deviation > 0.0).map(|((x, before), sd)| ((x - before) / sd).powi(2));
            squares.filter(|square| square.is_finite()).sum::<f64>().sqrt()
        };
        let count = sequence.len() - from;
        (from..sequence.len()).map(length).sum::<f64>() / count as f64
    };
    let last = ((END * sequence.len() as f64).round() as usize).max(2);
    if sequence.len() < 5 * last {
        return false;
    }
    let whole = speed(1);
    whole > 0.0 && speed(sequence.len() - last) < SLOW * whole
}

/// Whether all sequences end in one place, and do not begin in one.
fn have_one_end(data: &Dataset, deviations: &[f64]) -> bool {
    let sequences = data.sequences();
    let spread = |at: &dyn Fn(&Sequence) -> usize| {
        let of_channel = |(i, deviation): (usize, &f64)| {
            let values = || sequences.iter().map(|own| own.sample(at(own))[i]).filter(|value| value.is_finite());
            let count = values().count().max(1) as f64;
            let mean = values().sum::<f64>() / count;
            values().map(|value| ((value - mean) / deviation).powi(2)).sum::<f64>() / count
        };
        let moving = deviations.iter().enumerate().filter(|(_, deviation)| **deviation > 0.0);
        let (sum, count) = moving.map(of_channel).fold((0.0, 0_usize), |(sum, count), one| (sum + one, count + 1));
        (sum / count.max(1) as f64).sqrt()
    };
    let long = sequences.len() > 2 && sequences.iter().all(|own| own.len() > 10);
    if !long {
        return false;
    }
    let (first, last) = (spread(&|_| 0), spread(&|own| own.len() - 1));
    last < NEAR.0 && last < NEAR.1 * first
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Channels whose predicted samples are all the same.
pub fn still_channels(data: &Dataset, delay: usize) -> Vec<String> {
    let n = data.channels().len();
    let predicted = || data.sequences().iter().filter_map(|sequence| sequence.values().get(delay * n..));
    let still = |i: usize| {
        let samples = predicted().flat_map(|values| values.chunks_exact(n)).map(|sample| sample[i]);
        let mut samples = samples.filter(|value| !value.is_nan());
        let first = samples.next();
        samples.all(|sample| Some(sample) == first)
    };
    // One sample says nothing about change.
    let several = predicted().map(|values| values.len() / n).sum::<usize>() > 1;
    (0..n).filter(|&i| several && still(i)).map(|i| data.channels()[i].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(samples: usize, of: impl Fn(usize, usize) -> f64) -> Dataset {
        let sequence = |s: usize| Sequence::new(s.to_string(), 1, (0..samples).map(|k| of(s, k)).collect()).unwrap();
        Dataset::new(vec!["y".into()], (0..4).map(sequence).collect()).unwrap()
    }

    /// White noise, between -1/2 and 1/2.
    fn noise(s: usize, k: usize) -> f64 {
        let mut bits = (k as u64 + 1000 * s as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (bits >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
    }

    #[test]
    fn waves_are_smooth_noise_is_not_and_a_little_noise_shows_in_the_turn() {
        let wave = |s: usize, k: usize| (std::f64::consts::TAU * k as f64 / 50.0 + s as f64).sin();
        let smooth = Character::of(&data(200, wave));
        // 2 sin(pi / 50) root 1/2 over root 1/2, and 2 sin(pi / 50).
        let expected = 2.0 * (std::f64::consts::PI / 50.0).sin();
        assert!((smooth.step - expected).abs() < 2e-3 && (smooth.turn - expected).abs() < 2e-3, "{smooth:?}");
        assert!(smooth.is_smooth() && !smooth.rests);
        let noisy = Character::of(&data(200, noise));
        assert!((noisy.step - 2_f64.sqrt()).abs() < 0.15 && (noisy.turn - 3_f64.sqrt()).abs() < 0.15, "{noisy:?}");
        let some = Character::of(&data(200, |s, k| wave(s, k) + 0.5 * noise(s, k)));
        assert!(!some.is_smooth() && some.step < 0.5, "{some:?}");
    }

    #[test]
    fn what_slows_down_rests_and_missing_values_are_passed_over() {
        let reach = |_: usize, k: usize| (-(k as f64) / 15.0).exp();
        assert!(Character::of(&data(100, reach)).rests);
        assert!(!Character::of(&data(9, reach)).rests);
        let line_to_the_origin = |s: usize, k: usize| (99 - k) as f64 * (1.0 + s as f64);
        assert!(Character::of(&data(100, line_to_the_origin)).rests);
        // The same wave again and again ends where it ends, and goes on.
        let again = |_: usize, k: usize| (0.1 * k as f64).sin();
        assert!(!Character::of(&data(200, again)).rests);
        let wave = |s: usize, k: usize| (0.1 * k as f64 + s as f64).sin();
        let gapped = Character::of(&data(200, |s, k| if k % 11 == 3 { f64::NAN } else { wave(s, k) }));
        let whole = Character::of(&data(200, wave));
        assert!((gapped.step / whole.step - 1.0).abs() < 0.05 && (gapped.turn / whole.turn - 1.0).abs() < 0.05);
        let still = Character::of(&data(20, |_, _| 3.0));
        assert_eq!(still, Character { step: 0.0, turn: 0.0, rests: false });
    }
}
