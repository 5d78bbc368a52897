//! What looks wrong in numbers that were read, as a pure function of them.
//!
//! Each threshold is set so that movements, noise and on-off signals stay below it, and what it is named after is well
//! above it. Missing values (NaN) are passed over. All take time in proportion to the data.

use std::f64::consts::{PI, TAU};

use scrnn::dataset::{Dataset, Sequence};
use serde::Serialize;

/// One thing that looks wrong. Counts of sequences and steps begin at 1.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "suspicion", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Suspicion {
    /// A channel grows by the same amount at every step: a clock or a counter.
    #[error("channel {channel} grows in even steps of {step}, as a clock or a counter does")]
    EvenSteps {
        /// The channel.
        channel: String,
        /// By how much it grows.
        step: f64,
    },
    /// A channel has one value.
    #[error("channel {channel} is {value} throughout")]
    Constant {
        /// The channel.
        channel: String,
        /// The value.
        value: f64,
    },
    /// A channel hardly moves beside its size.
    #[error("channel {channel} moves by {range} around {size}: it hardly moves beside its size")]
    HardlyMoves {
        /// The channel.
        channel: String,
        /// From its least to its greatest value.
        range: f64,
        /// Its mean.
        size: f64,
    },
    /// A few samples lie far outside of all others, and rule the scaling.
    #[error("channel {channel} has {count} spikes, the first {value} (sequence {sequence}, step {step}): scaled by its range, all else fills 1/{} of it", times.round())]
    Spikes {
        /// The channel.
        channel: String,
        /// How many samples.
        count: usize,
        /// Sequence of the first.
        sequence: String,
        /// Step of the first, from 1.
        step: usize,
        /// The first.
        value: f64,
        /// The range with them, over the range without.
        times: f64,
    },
    /// One value far from all others comes again and again: it may stand for a missing one.
    #[error("channel {channel} is {value} in {count} samples, far from all others: it may stand for missing ones")]
    Mark {
        /// The channel.
        channel: String,
        /// The value.
        value: f64,
        /// How many samples.
        count: usize,
    },
    /// An angle jumps by a whole turn.
    #[error("channel {channel} jumps by a whole turn (sequence {sequence}, step {step}; {count} jumps)")]
    Turns {
        /// The channel.
        channel: String,
        /// Sequence of the first jump.
        sequence: String,
        /// Step after the first jump, from 1.
        step: usize,
        /// How many.
        count: usize,
    },
    /// Sequences were filled up to one length.
    #[error("{count} sequences end in {with}, {sequence} for {samples} samples: they seem to be padded")]
    Padding {
        /// How many sequences.
        count: usize,
        /// `zeros` or `their last value`.
        with: &'static str,
        /// The sequence with most of it.
        sequence: String,
        /// Samples of it.
        samples: usize,
    },
    /// More channels than steps.
    #[error("there are {channels} channels, but at most {steps} steps: the axes may be the other way round")]
    MoreChannels {
        /// Channels.
        channels: usize,
        /// Samples of the longest sequence.
        steps: usize,
    },
    /// Some sequences are in degrees and others in radians.
    #[error("channel {channel} reaches {degrees} in {in_degrees}, but {radians} in {in_radians}: degrees and radians?")]
    DegreesAndRadians {
        /// The channel.
        channel: String,
        /// The largest size in one.
        degrees: f64,
        /// A sequence of it.
        in_degrees: String,
        /// The largest size in the other.
        radians: f64,
        /// A sequence of it.
        in_radians: String,
    },
    /// A value is held for several samples, and then jumps: it was recorded faster than it is measured.
    #[error("channel {channel} is held for {every} samples each time: a staircase")]
    Staircase {
        /// The channel.
        channel: String,
        /// Samples for each new value.
        every: usize,
    },
}

impl Suspicion {
    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::EvenSteps { .. } | Self::Constant { .. } => {
                "leave it out: `channels = [...]` names what to learn".to_owned()
            }
            Self::HardlyMoves { size, .. } => format!("take {size} off, or leave it out by `channels = [...]`"),
            Self::Spikes { .. } => "mend them, make them missing, or scale by `scaling = \"robust\"`".to_owned(),
            Self::Mark { .. } => "leave these cells empty, or write NaN: what is missing is learned around".to_owned(),
            Self::Turns { channel, .. } => {
                format!("`unwrap = [\"{channel}\"]` takes the jumps out; its sine and cosine never jump")
            }
            Self::Padding { .. } => "cut the sequences where their movements end".to_owned(),
            Self::MoreChannels { .. } => "save the array with steps first, or say `axes`".to_owned(),
            Self::DegreesAndRadians { .. } => "bring all files to one unit".to_owned(),
            Self::Staircase { channel, every } => format!(
                "take every {every}th sample (where times are known: a `period` {every} times as long), or record `{channel}` as often as it is measured"
            ),
        })
    }
}

/// All that looks wrong, in the order of the channels.
#[must_use]
pub fn look(data: &Dataset) -> Vec<Suspicion> {
    let channels = data.channels().len();
    let steps = data.sequences().iter().map(Sequence::len).max().unwrap_or(0);
    let mut found = Vec::new();
    if channels > steps {
        found.push(Suspicion::MoreChannels { channels, steps });
    }
    for (index, channel) in data.channels().iter().enumerate() {
        let series = Series::of(data, index);
        let turned = turns(&series, channel);
        let one = constant(&series, channel)
            .or_else(|| even_steps(&series, channel).filter(|_| turned.is_none()))
            .or_else(|| hardly_moves(&series, channel));
        found.extend(one);
        found.extend(spikes(&series, channel).or_else(|| mark(&series, channel)));
        found.extend(turned);
        found.extend(staircase(&series, channel));
    }
    found.extend(padding(data));
    found.extend(degrees_and_radians(data));
    found
}

/// One channel, sequence by sequence.
struct Series<'a> {
    parts: Vec<(&'a str, Vec<f64>)>,
}

impl<'a> Series<'a> {
    fn of(data: &'a Dataset, channel: usize) -> Self {
        let channels = data.channels().len();
        let part = |sequence: &'a Sequence| {
            let values = sequence.values().iter().skip(channel).step_by(channels).copied();
            (sequence.name.as_str(), values.collect())
        };
        Self { parts: data.sequences().iter().map(part).collect() }
    }

    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        self.parts.iter().flat_map(|(_, values)| values).copied().filter(|value| value.is_finite())
    }

    /// Differences between neighbours within sequences, where both are there.
    fn steps(&self) -> impl Iterator<Item = f64> + '_ {
        let of_part =
            |(_, values): &'_ (&str, Vec<f64>)| values.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
        self.parts.iter().flat_map(of_part).filter(|step| step.is_finite())
    }

    /// Least and greatest value.
    fn bounds(&self) -> Option<(f64, f64)> {
        let bounds =
            self.values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
        (bounds.0 <= bounds.1).then_some(bounds)
    }

    fn mean(&self) -> f64 {
        let (sum, count) = self.values().fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
        sum / count.max(1) as f64
    }
}

/// A value of the list that `share` of it lies below.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let place = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

fn constant(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let (least, greatest) = series.bounds()?;
    let several = series.values().nth(1).is_some();
    (least == greatest && several).then(|| Suspicion::Constant { channel: channel.to_owned(), value: least })
}

/// Fewest steps from which even ones are no chance.
const FEWEST_STEPS: usize = 10;
/// Share of a step by which steps may differ: a clock's jitter. Movements change their speed by more within ten samples.
const STEP_JITTER: f64 = 0.02;

fn even_steps(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let mut steps: Vec<f64> = series.steps().collect();
    if steps.len() < FEWEST_STEPS {
        return None;
    }
    let middle = quantile(&mut steps, 0.5);
    // Times in seconds since 1970 are rounded to 2e-7.
    let (_, greatest) = series.bounds()?;
    let rounding = 4.0 * f64::EPSILON * greatest.abs();
    let even = steps.iter().filter(|step| (*step - middle).abs() <= STEP_JITTER * middle + rounding).count();
    // A clock may have some gaps.
    (middle > 0.0 && even * 100 >= steps.len() * 97)
        .then(|| Suspicion::EvenSteps { channel: channel.to_owned(), step: middle })
}

/// Range over size. Of seven digits, as single precision and most tables have, at most four are left for the movement.
const HARDLY: f64 = 1e-3;

fn hardly_moves(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let ((least, greatest), size) = (series.bounds()?, series.mean());
    (greatest - least < HARDLY * size.abs()).then(|| Suspicion::HardlyMoves {
        channel: channel.to_owned(),
        range: greatest - least,
        size,
    })
}

/// Fewest samples among which an outlier is told from a movement.
const FEWEST_SAMPLES: usize = 30;
/// Share of the samples that may be spikes, on each side. More are part of what is recorded.
const SPIKE_SHARE: f64 = 0.01;
/// How many times the range of all others a spike lies outside of it. Of normal noise, 98 % fill 4.7 deviations: a spike is
/// further than eleven from the mean, which no noise reaches.
const SPIKE_DISTANCE: f64 = 2.0;
/// Samples that a spike lasts at most. A touch or a pulse lasts longer.
const SPIKE_LENGTH: usize = 3;

fn spikes(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let mut values: Vec<f64> = series.values().collect();
    if values.len() < FEWEST_SAMPLES {
        return None;
    }
    let one = SPIKE_SHARE.max(1.0 / (values.len() - 1) as f64);
    let (low, high) = (quantile(&mut values, one), quantile(&mut values, 1.0 - one));
    let inner = high - low;
    let outside = |value: f64| {
        value.is_finite() && (value < low - SPIKE_DISTANCE * inner || value > high + SPIKE_DISTANCE * inner)
    };
    let (mut count, mut first) = (0, None);
    if inner <= 0.0 {
        return None;
    }
    for (name, values) in &series.parts {
        let mut run = 0;
        for (step, &value) in values.iter().enumerate() {
            run = if outside(value) { run + 1 } else { 0 };
            if run > SPIKE_LENGTH {
                return None;
            }
            if run > 0 {
                count += 1;
                first.get_or_insert_with(|| ((*name).to_owned(), step + 1, value));
            }
        }
    }
    let (sequence, step, value) = first?;
    let (least, greatest) = series.bounds()?;
    Some(Suspicion::Spikes {
        channel: channel.to_owned(),
        count,
        sequence,
        step,
        value,
        times: (greatest - least) / inner,
    })
}

/// How many times the range of all others a mark lies outside of it, how large it is at least (-99, -999, 9999, 65535), and
/// how often it comes.
const MARK_DISTANCE: f64 = 3.0;
const LEAST_MARK: f64 = 99.0;
const FEWEST_MARKS: usize = 3;

/// The least or the greatest value, if it is a large whole number that comes again and again, and nothing else is near it.
fn mark(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let (least, greatest) = series.bounds()?;
    [least, greatest].into_iter().find_map(|value| {
        if value.abs() < LEAST_MARK || value.fract() != 0.0 {
            return None;
        }
        let (mut count, mut all, mut runs, mut before) = (0, 0, 0, f64::NAN);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for other in series.values() {
            all += 1;
            if other == value {
                count += 1;
                runs += usize::from(before != value);
            } else {
                (low, high) = (low.min(other), high.max(other));
            }
            before = other;
        }
        let away = (low - value).max(value - high);
        // An on-off signal has no range beside it.
        (all >= FEWEST_SAMPLES && runs >= FEWEST_MARKS && high > low && away > MARK_DISTANCE * (high - low))
            .then(|| Suspicion::Mark { channel: channel.to_owned(), value, count })
    })
}

/// Share of a turn that a jump has at least: the rest is the movement of one step.
const TURN: f64 = 0.75;

fn turns(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let (least, greatest) = series.bounds()?;
    let turn = [TAU, 360.0].into_iter().find(|turn| {
        // Both ends of what an angle reaches before it wraps are met, and nothing lies beyond.
        let near = |value: f64, end: f64| (value - end).abs() < 0.05 * turn;
        near(least, -turn / 2.0) && near(greatest, turn / 2.0) || near(least, 0.0) && near(greatest, *turn)
    })?;
    let mut sizes: Vec<f64> = series.steps().map(f64::abs).collect();
    if sizes.len() < FEWEST_STEPS {
        return None;
    }
    // An angle that moves by a quarter turn at a time jumps anyway.
    let usual = quantile(&mut sizes, 0.9);
    let mut jumps = (0, None);
    for (name, values) in &series.parts {
        for (step, pair) in values.windows(2).enumerate() {
            let size = (pair[1] - pair[0]).abs();
            if size > TURN * turn && (size - turn).abs() <= 3.0 * usual + 1e-9 {
                jumps.0 += 1;
                jumps.1.get_or_insert_with(|| ((*name).to_owned(), step + 2));
            }
        }
    }
    let (sequence, step) = jumps.1.filter(|_| usual < turn / 8.0)?;
    Some(Suspicion::Turns { channel: channel.to_owned(), sequence, step, count: jumps.0 })
}

/// Samples that are held at least, on average.
const HELD: usize = 3;

fn staircase(series: &Series<'_>, channel: &str) -> Option<Suspicion> {
    let mut runs = Vec::new();
    for (_, values) in &series.parts {
        let mut run = 1;
        for pair in values.windows(2) {
            if pair[0] == pair[1] {
                run += 1;
            } else {
                runs.push(run as f64);
                run = 1;
            }
        }
    }
    if runs.len() < FEWEST_STEPS {
        return None;
    }
    let middle = quantile(&mut runs, 0.5);
    let even = || runs.iter().filter(|run| (**run - middle).abs() <= 1.0).count();
    if middle < HELD as f64 || even() * 10 < runs.len() * 8 {
        return None;
    }
    // The ticks of an encoder and on-off signals come back to the same few values, at any time.
    let pairs = series.parts.iter().flat_map(|(_, values)| values.windows(2));
    let mut values: Vec<u64> = pairs.filter(|pair| pair[0] != pair[1]).map(|pair| pair[1].to_bits()).collect();
    values.sort_unstable();
    values.dedup();
    (2 * values.len() >= runs.len())
        .then(|| Suspicion::Staircase { channel: channel.to_owned(), every: middle as usize })
}

/// Fewest samples, and least share of a sequence, that count as padding.
const FEWEST_PADDED: usize = 5;
const PADDED: f64 = 0.02;

/// Zeros at the ends of sequences; or their last values, where all were brought to one length and held for different times.
/// A robot that rests at its end is not padded.
fn padding(data: &Dataset) -> Option<Suspicion> {
    let channels = data.channels().len();
    let tails: Vec<(usize, bool, &Sequence)> = data
        .sequences()
        .iter()
        .filter_map(|sequence| {
            let rows: Vec<&[f64]> = sequence.values().chunks_exact(channels).collect();
            let last = rows.last()?;
            let held = rows.iter().rev().take_while(|row| *row == last).count();
            let enough = held >= FEWEST_PADDED && held as f64 >= PADDED * rows.len() as f64 && held < rows.len();
            enough.then(|| (held, last.iter().all(|value| *value == 0.0), sequence))
        })
        .collect();
    let longest = |tails: &[&(usize, bool, &Sequence)], with| {
        let (samples, _, sequence) = tails.iter().max_by_key(|(held, ..)| *held)?;
        Some(Suspicion::Padding { count: tails.len(), with, sequence: sequence.name.clone(), samples: *samples })
    };
    // One channel may rest at zero; two do not at once.
    let zeros: Vec<_> = tails.iter().filter(|(_, zero, _)| *zero).collect();
    if !zeros.is_empty() && (channels > 1 || zeros.len() > 1) {
        return longest(&zeros, "zeros");
    }
    let held: Vec<_> = tails.iter().filter(|(_, zero, _)| !zero).collect();
    let one_length = data.sequences().iter().all(|sequence| sequence.len() == data.sequences()[0].len());
    let differ = held.iter().any(|(samples, ..)| *samples != held[0].0);
    // Most of them: the longest needs none.
    if held.len() > 1 && one_length && differ && 2 * held.len() >= data.sequences().len() {
        return longest(&held, "their last value");
    }
    None
}

/// How many degrees a radian has, and how far from that the ratio of two movements may be.
const DEGREES: (f64, f64) = (40.0, 82.0);

/// Sequences that reach beyond what angles in radians do, beside some that are smaller by the factor between the units.
fn degrees_and_radians(data: &Dataset) -> Option<Suspicion> {
    if data.sequences().len() < 2 {
        return None;
    }
    let mut found = None;
    let mut moving = 0;
    let mut suspicious = 0;
    for (index, channel) in data.channels().iter().enumerate() {
        let series = Series::of(data, index);
        // A spike in one sequence is not its unit.
        let spread = |values: &[f64]| {
            let mut finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            if finite.is_empty() {
                return (0.0, 0.0);
            }
            let (least, greatest) = (quantile(&mut finite, 0.02), quantile(&mut finite, 0.98));
            (greatest - least, greatest.abs().max(least.abs()))
        };
        let spreads: Vec<_> = series
            .parts
            .iter()
            .map(|(name, values)| (*name, spread(values)))
            .filter(|(_, (range, _))| *range > 0.0)
            .collect();
        let by_range = |a: &&(&str, (f64, f64)), b: &&(&str, (f64, f64))| a.1.0.total_cmp(&b.1.0);
        let (Some(small), Some(large)) = (spreads.iter().min_by(by_range), spreads.iter().max_by(by_range)) else {
            continue;
        };
        moving += 1;
        let ratio = large.1.0 / small.1.0;
        // More than a turn in radians is rare, and so is less than three degrees in degrees: two groups, nothing between.
        let between = spreads.iter().any(|(_, (range, _))| *range > 4.0 * small.1.0 && *range < large.1.0 / 4.0);
        if (DEGREES.0..DEGREES.1).contains(&ratio)
            && large.1.1 > TAU
            && small.1.1 <= 2.0 * PI
            && small.1.0 > 0.05
            && !between
        {
            suspicious += 1;
            found.get_or_insert_with(|| Suspicion::DegreesAndRadians {
                channel: channel.clone(),
                degrees: large.1.1,
                in_degrees: large.0.to_owned(),
                radians: small.1.1,
                in_radians: small.0.to_owned(),
            });
        }
    }
    found.filter(|_| 2 * suspicious >= moving)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sequences of one channel.
    fn set(sequences: &[Vec<f64>]) -> Dataset {
        wide(1, sequences)
    }

    fn wide(channels: usize, sequences: &[Vec<f64>]) -> Dataset {
        let sequence = |(index, values): (usize, &Vec<f64>)| {
            Sequence::new(format!("s{}", index + 1), channels, values.clone()).unwrap()
        };
        Dataset::new(Dataset::numbered_channels(channels), sequences.iter().enumerate().map(sequence).collect())
            .unwrap()
    }

    fn sine(samples: usize) -> Vec<f64> {
        (0..samples).map(|k| (k as f64 * 0.21).sin()).collect()
    }

    /// Numbers between -0.5 and 0.5.
    fn noise(samples: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..samples).map(|_| next()).collect()
    }

    #[test]
    fn plain_movements_raise_nothing() {
        assert_eq!(look(&set(&[sine(200)])), []);
        assert_eq!(look(&set(&[noise(1000)])), []);
        // A gripper that opens and closes, and a touch that lasts.
        let gripper: Vec<f64> = (0..300).map(|k| f64::from(u8::from(k % 100 > 70))).collect();
        assert_eq!(look(&set(&[gripper])), []);
        let touch: Vec<f64> =
            (0..2000).map(|k| if (900..910).contains(&k) { 5.0 } else { 0.01 * f64::from(k % 7) }).collect();
        assert_eq!(look(&set(&[touch])), []);
        // Encoder ticks.
        let ticks: Vec<f64> = sine(400).iter().map(|x| (x * 5.0).round() / 5.0).collect();
        assert_eq!(look(&set(&[ticks])), []);
        // A robot that rests at the end, once.
        let rest: Vec<f64> = sine(100).into_iter().chain([0.3; 30]).collect();
        assert_eq!(look(&set(&[rest])), []);
    }

    #[test]
    fn clocks_and_counters_grow_in_even_steps() {
        let stamp: Vec<f64> = (0..50).map(|k| 1_766_147_454.233 + f64::from(k) * 0.02).collect();
        assert!(matches!(&look(&set(&[stamp]))[..], [Suspicion::EvenSteps { step, .. }] if (step - 0.02).abs() < 1e-6));
        let frames: Vec<f64> = (0..50).map(f64::from).collect();
        let found = look(&set(&[frames.clone(), frames]));
        assert_eq!(found, [Suspicion::EvenSteps { channel: "y1".into(), step: 1.0 }]);
        let falls: Vec<f64> = (0..50).map(|k| -f64::from(k)).collect();
        let accelerates: Vec<f64> = (0..50).map(|k| f64::from(k * k)).collect();
        assert_eq!((look(&set(&[falls])), look(&set(&[accelerates]))), (vec![], vec![]));
    }

    #[test]
    fn channels_that_hardly_move_are_told_from_constant_ones() {
        let offset: Vec<f64> = sine(100).iter().map(|x| 1e6 + x).collect();
        assert!(
            matches!(&look(&set(&[offset]))[..], [Suspicion::HardlyMoves { range, .. }] if (range - 2.0).abs() < 0.01)
        );
        assert_eq!(look(&set(&[vec![1.0; 50]])), [Suspicion::Constant { channel: "y1".into(), value: 1.0 }]);
        let small: Vec<f64> = sine(100).iter().map(|x| 10.0 + 0.01 * x).collect();
        assert_eq!(look(&set(&[small])), []);
    }

    #[test]
    fn spikes_are_named_by_their_place() {
        let mut values = sine(1000);
        values[700] = 60.0;
        values[701] = -60.0;
        let found = look(&set(&[sine(500), values.clone()]));
        let [Suspicion::Spikes { count: 2, sequence, step: 701, value: 60.0, times, .. }] = &found[..] else {
            panic!("{found:?}")
        };
        assert_eq!(sequence, "s2");
        assert!((*times - 60.0).abs() < 1.0, "{times}");
        // As often as that it is part of what is recorded.
        (0..1000).step_by(20).for_each(|k| values[k] = 60.0);
        assert_eq!(look(&set(&[values])), []);
    }

    #[test]
    fn values_that_stand_for_missing_ones_are_seen() {
        let mut values = sine(200);
        for at in [3, 40, 41, 42, 43, 44, 120, 199] {
            values[at] = -9999.0;
        }
        let found = look(&set(&[values.clone()]));
        assert_eq!(found, [Suspicion::Mark { channel: "y1".into(), value: -9999.0, count: 8 }]);
        assert!(found[0].help().unwrap().contains("NaN"));
        // A gripper that is shut or open, and a movement that rests at its end.
        let gripper: Vec<f64> = (0..200).map(|k| if k % 50 < 25 { 0.0 } else { 1000.0 }).collect();
        let rests: Vec<f64> = sine(200).iter().map(|value| value.max(-0.5)).collect();
        for quiet in [gripper, rests] {
            let found = look(&set(&[quiet]));
            assert!(!found.iter().any(|one| matches!(one, Suspicion::Mark { .. })), "{found:?}");
        }
    }

    #[test]
    fn jumps_of_a_whole_turn_are_seen() {
        let angle: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k) + 0.02 * (f64::from(k) * 0.3).sin()).collect();
        let wrapped: Vec<f64> = angle.iter().map(|x| (x + PI).rem_euclid(TAU) - PI).collect();
        assert!(matches!(
            &look(&set(std::slice::from_ref(&wrapped)))[..],
            [Suspicion::Turns { step: 33, count: 3, .. }]
        ));
        let degrees: Vec<f64> = wrapped.iter().map(|x| x.to_degrees()).collect();
        assert!(matches!(&look(&set(&[degrees]))[..], [Suspicion::Turns { count: 3, .. }]));
        // A square wave of the same size stays where it is for a while, and so does one that never comes near the ends.
        let square: Vec<f64> = (0..200).map(|k| if k % 40 < 20 { 2.0 } else { -2.0 }).collect();
        assert_eq!(look(&set(&[square])), []);
    }

    #[test]
    fn padding_is_told_from_rest() {
        let padded = |samples: usize, with: Option<f64>| {
            let mut values: Vec<f64> = sine(samples).iter().flat_map(|x| [*x, x + 0.5]).collect();
            let (a, b) = with.map_or((values[2 * samples - 2], values[2 * samples - 1]), |value| (value, value));
            while values.len() < 200 {
                values.extend([a, b]);
            }
            values
        };
        let zeros = look(&wide(2, &[padded(100, None), padded(60, Some(0.0))]));
        assert_eq!(zeros, [Suspicion::Padding { count: 1, with: "zeros", sequence: "s2".into(), samples: 40 }]);
        let held = look(&wide(2, &[padded(100, None), padded(60, None), padded(80, None)]));
        assert_eq!(
            held,
            [Suspicion::Padding { count: 2, with: "their last value", sequence: "s2".into(), samples: 41 }]
        );
        assert_eq!(look(&wide(2, &[padded(100, None), padded(80, None), padded(80, None)])), []);
    }

    #[test]
    fn more_channels_than_steps_are_asked_about() {
        let found = look(&wide(20, &[noise(200)]));
        assert!(found.contains(&Suspicion::MoreChannels { channels: 20, steps: 10 }), "{found:?}");
    }

    #[test]
    fn degrees_beside_radians_are_seen() {
        let degrees: Vec<f64> = sine(200).iter().map(|x| 0.8 * x.to_degrees()).collect();
        let found = look(&set(&[sine(200), degrees.clone()]));
        assert!(
            matches!(&found[..], [Suspicion::DegreesAndRadians { in_degrees, .. }] if in_degrees == "s2"),
            "{found:?}"
        );
        // A movement of another size, one that is idle, and one between.
        assert_eq!(look(&set(&[sine(200), sine(200).iter().map(|x| 5.0 * x).collect()])), []);
        assert_eq!(look(&set(&[degrees.clone(), sine(200).iter().map(|x| 0.01 * x).collect()])), []);
        assert_eq!(look(&set(&[sine(200), degrees, sine(200).iter().map(|x| 6.5 * x).collect()])), []);
    }

    #[test]
    fn staircases_are_seen() {
        let held: Vec<f64> = (0..300).map(|k| (f64::from(k / 5) * 0.37).sin()).collect();
        assert_eq!(look(&set(&[held])), [Suspicion::Staircase { channel: "y1".into(), every: 5 }]);
    }
}
