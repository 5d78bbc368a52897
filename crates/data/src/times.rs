//! Times of samples: held to even steps, or brought to them.
//!
//! | intervals | what is done |
//! |---|---|
//! | all within a tenth of the middle one | taken as they are; the middle one is the period |
//! | some further off, none by more than half | taken as they are, and said |
//! | a gap, a time that falls, another rate | refused, with what would do; with a period resampled on straight lines |
//!
//! A gap of more than ten intervals is not bridged.

use crate::reading::Gap;
use crate::remark::Remark;
use crate::samples::{Samples, Track};
use crate::{FileError, Selection};

/// Share of the middle interval by which intervals may differ and still count as even.
const EVEN: f64 = 0.1;
/// Share from which on a sample was lost: an interval nearer to two steps than to one.
const LOST: f64 = 0.5;
/// Middle intervals, or periods, that a straight line may bridge.
const WIDEST_GAP: i128 = 10;
/// Most samples that one sample may be turned into, on average.
const MOST_PER_SAMPLE: i128 = 100;

const BILLION: i128 = 1_000_000_000;

/// Brings all tracks to even steps and returns the period in seconds, where it is known.
///
/// # Errors
/// [`FileError::Times`] with what was found.
pub fn to_even_steps(path: &str, samples: &mut Samples, selection: &Selection) -> Result<Option<f64>, FileError> {
    let refused = |sequence: &str, found: String, help: Option<String>| FileError::Times {
        path: path.to_owned(),
        sequence: sequence.to_owned(),
        found,
        help: help.unwrap_or_else(|| "choose another period, or cut the recording".to_owned()),
    };
    if samples.tracks.iter().all(|track| track.times.is_empty()) {
        return match (selection.period_in_nanoseconds(), samples.period) {
            (Some(wanted), Some(known)) if (wanted as f64 / 1e9 / known - 1.0).abs() > 1e-6 => {
                // The samples are even, so their numbers tell the time.
                let step = (known * 1e9).round().max(1.0) as i64;
                for track in &mut samples.tracks {
                    track.times = (0..track.values.len() / samples.channels.len().max(1))
                        .map(|k| step.saturating_mul(k as i64))
                        .collect();
                }
                to_even_steps(path, samples, selection)
            }
            (Some(_), None) => Err(FileError::NoClock { path: path.to_owned() }),
            _ => Ok(samples.period),
        };
    }
    let channels = samples.channels.len();
    let wanted = selection.period_in_nanoseconds().and_then(|period| i64::try_from(period).ok());
    let resolution = samples.resolution;
    let mut middles = Vec::new();
    for index in 0..samples.tracks.len() {
        let track = &mut samples.tracks[index];
        let Some(middle) = middle_interval(&track.times) else { continue };
        let irregularity = irregularity(track, middle, resolution);
        if irregularity.as_ref().is_some_and(|irregularity| !irregularity.wavers) {
            let gaps = gaps(track, middle);
            samples.facts.gaps.extend(gaps);
        }
        match (wanted, irregularity) {
            (Some(period), _) if !selection.ignores_time() => {
                track.values = resampled(track, channels, period).map_err(|found| refused(&track.name, found, None))?;
                track.times = Vec::new();
            }
            (_, Some(Irregularity { found, .. })) if selection.ignores_time() => {
                samples.remarks.push(Remark::Uneven { found: format!("sequence {}: {found}", track.name) });
            }
            (_, Some(Irregularity { found, wavers: true })) => {
                samples.remarks.push(Remark::Uneven { found: format!("sequence {}: {found}", track.name) });
            }
            (_, Some(Irregularity { found, wavers: false })) => {
                let sequence = track.name.clone();
                return Err(refused(&sequence, found, Some(help(middle, &samples.tracks))));
            }
            _ => {}
        }
        middles.push((track.name.clone(), middle));
    }
    if let Some(period) = wanted.filter(|_| !selection.ignores_time()) {
        let found = match middles.first() {
            Some((_, middle)) if *middle > 0 => format!("about {} s", seconds(*middle)),
            _ => "single samples".to_owned(),
        };
        if middles.iter().any(|(_, middle)| off(*middle, period) > 1e-6) {
            samples.remarks.push(Remark::Resampled { period: period as f64 / 1e9, found });
        }
        return Ok(Some(period as f64 / 1e9));
    }
    let Some((first, middle)) = middles.first().cloned() else { return Ok(samples.period) };
    if let Some((other, differs)) = middles
        .iter()
        .find(|(_, other)| off(*other, middle) > EVEN && other.abs_diff(middle) > resolution.unsigned_abs())
    {
        let found =
            format!("samples of {first} are {} s apart, those of {other} {} s", seconds(middle), seconds(*differs));
        if !selection.ignores_time() {
            return Err(refused(other, found, Some(help(middle.min(*differs), &samples.tracks))));
        }
        samples.remarks.push(Remark::Uneven { found });
    }
    Ok(mean_interval(&samples.tracks).or((middle > 0).then_some(middle as f64 / 1e9)))
}

/// What can be done about uneven times. A period is named only where it is not refused in turn.
fn help(middle: i64, tracks: &[Track]) -> String {
    // Three digits of a jittering clock are enough, as long as they say the same.
    let digits = (middle.max(1) as f64).log10().floor() as i32 - 2;
    let unit = 10_i128.pow(digits.clamp(0, 16) as u32);
    let rounded = i64::try_from((i128::from(middle) + unit / 2) / unit * unit).unwrap_or(middle);
    let period = if off(rounded, middle) < 0.01 { rounded.max(1) } else { middle.max(1) };
    if tracks.iter().all(|track| against(track, period).is_none()) {
        let period = seconds(period);
        return format!(
            "`period = {period}` brings them to even times; `time = \"rows\"` takes them as even steps all the same"
        );
    }
    "cut it there into several files, or in a table into sequences by a column `sequence` that changes there; `time = \"rows\"` takes \
     them as even steps all the same"
        .to_owned()
}

/// How far an interval is off, as a share of the middle one.
fn off(interval: i64, middle: i64) -> f64 {
    (interval as f64 - middle as f64).abs() / (middle as f64).abs().max(f64::MIN_POSITIVE)
}

/// What is uneven about times.
struct Irregularity {
    found: String,
    /// Whether no sample seems to be lost.
    wavers: bool,
}

fn irregularity(track: &Track, middle: i64, resolution: i64) -> Option<Irregularity> {
    let intervals = || track.times.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
    if let Some(at) = intervals().position(|interval| interval < 0) {
        let (before, after) = (since(track, at), since(track, at + 1));
        let found = format!("the time falls from {before} s to {after} s after step {}", at + 1);
        return Some(Irregularity { found, wavers: false });
    }
    if is_rounding(&track.times, middle, resolution) {
        return None;
    }
    if middle <= 0 {
        return Some(Irregularity { found: "most samples have the time of the one before".to_owned(), wavers: false });
    }
    let count = intervals().filter(|&interval| off(interval, middle) > EVEN).count();
    let (at, widest) = intervals().enumerate().max_by(|(_, a), (_, b)| off(*a, middle).total_cmp(&off(*b, middle)))?;
    let wavers = off(widest, middle) <= LOST;
    let found = format!(
        "samples are {} s apart in the middle, but {} s after step {} (at {} s; {count} of {} intervals are off by over a tenth)",
        seconds(middle),
        seconds(widest),
        at + 1,
        since(track, at),
        track.times.len() - 1,
    );
    (count > 0).then_some(Irregularity { found, wavers })
}

/// Whether intervals are off only because the times were written with few digits: none by more than the last of them, all
/// times within it of a straight line, and so many that it is the rule. A lost sample is off just once.
fn is_rounding(times: &[i64], middle: i64, resolution: i64) -> bool {
    let (Some(&first), Some(&last), true) = (times.first(), times.last(), resolution > 0) else { return false };
    let steps = (times.len() - 1) as f64;
    let mean = (last as f64 - first as f64) / steps;
    let near = |k: usize, time: i64| (time as f64 - first as f64 - k as f64 * mean).abs() <= 1.001 * resolution as f64;
    let intervals = || times.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
    let off_count = intervals().filter(|&interval| off(interval, middle) > EVEN).count();
    let by_digits = intervals().all(|interval| interval.abs_diff(middle) <= resolution.unsigned_abs());
    mean > 0.0
        && by_digits
        && off_count as f64 >= 0.05 * steps
        && times.iter().enumerate().all(|(k, &time)| near(k, time))
}

/// Seconds since the first sample.
fn since(track: &Track, index: usize) -> String {
    seconds(track.times[index].saturating_sub(track.times[0]))
}

/// Where time was lost.
fn gaps(track: &Track, middle: i64) -> Vec<Gap> {
    let pairs = track.times.windows(2).enumerate();
    let lost = pairs.filter(|(_, pair)| {
        let interval = pair[1].saturating_sub(pair[0]);
        interval > middle && off(interval, middle) > LOST
    });
    // A thousand tell as much as a million.
    lost.map(|(index, pair)| Gap {
        sequence: track.name.clone(),
        after: index + 1,
        seconds: pair[1].saturating_sub(pair[0]) as f64 / 1e9,
    })
    .take(1000)
    .collect()
}

/// The samples at every `period` nanoseconds from the first on: where a sample stands at that time its values, else on the
/// straight line between its neighbours. What is missing on one side of a line is missing on it.
///
/// # Errors
/// What stands against it, as a sentence.
pub fn resampled(track: &Track, channels: usize, period: i64) -> Result<Vec<f64>, String> {
    if let Some(found) = against(track, period) {
        return Err(found);
    }
    let times = &track.times;
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Ok(Vec::new()) };
    let wide = |time: i64| i128::from(time);
    let samples = (wide(last) - wide(first)) / wide(period) + 1;
    let mut at_even_times = Vec::with_capacity(usize::try_from(samples).unwrap_or(0).saturating_mul(channels));
    let mut after = 0;
    for k in 0..samples {
        let time = wide(first) + k * wide(period);
        while times.get(after + 1).is_some_and(|&next| wide(next) <= time) {
            after += 1;
        }
        let row = |index: usize| &track.values[index * channels..(index + 1) * channels];
        match times.get(after + 1) {
            Some(&next) if time > wide(times[after]) => {
                let share = (time - wide(times[after])) as f64 / (wide(next) - wide(times[after])) as f64;
                at_even_times.extend(row(after).iter().zip(row(after + 1)).map(|(a, b)| a + share * (b - a)));
            }
            _ => at_even_times.extend(row(after)),
        }
    }
    Ok(at_even_times)
}

/// What stands against bringing a track to a period, as a sentence.
fn against(track: &Track, period: i64) -> Option<String> {
    let times = &track.times;
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return None };
    if let Some(at) = times.windows(2).position(|pair| pair[1] < pair[0]) {
        return Some(format!(
            "the time falls from {} s to {} s after step {}",
            since(track, at),
            since(track, at + 1),
            at + 1
        ));
    }
    let wide = |time: i64| i128::from(time);
    let middle = middle_interval(times).unwrap_or(period);
    let widest = WIDEST_GAP * wide(middle.max(period));
    if let Some(at) = times.windows(2).position(|pair| wide(pair[1]) - wide(pair[0]) > widest) {
        return Some(format!(
            "no sample stands between {} s and {} s, which is too long to be bridged",
            since(track, at),
            since(track, at + 1)
        ));
    }
    let samples = (wide(last) - wide(first)) / wide(period) + 1;
    if samples > MOST_PER_SAMPLE * times.len() as i128 {
        return Some(format!(
            "{} samples would become {samples}; needed: at most {}",
            times.len(),
            MOST_PER_SAMPLE * times.len() as i128
        ));
    }
    None
}

/// The median of the intervals.
fn middle_interval(times: &[i64]) -> Option<i64> {
    let mut intervals: Vec<i64> = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable(middle).1)
}

/// The mean interval over all tracks, in seconds, to nine digits: it is nearer to the true period than any single one,
/// which is rounded.
fn mean_interval(tracks: &[Track]) -> Option<f64> {
    let spans = tracks.iter().filter_map(|track| Some((track.times.first()?, track.times.last()?, track.times.len())));
    let (time, count) = spans.fold((0_i128, 0_i128), |(time, count), (first, last, samples)| {
        (time + i128::from(*last) - i128::from(*first), count + samples as i128 - 1)
    });
    (count > 0 && time > 0).then(|| ((time as f64 / count as f64).round() / 1e9).max(1e-9))
}

/// Nanoseconds as seconds, without losing any.
#[must_use]
pub fn seconds(nanoseconds: i64) -> String {
    let sign = if nanoseconds < 0 { "-" } else { "" };
    let (whole, rest) = (nanoseconds.unsigned_abs() / 1_000_000_000, nanoseconds.unsigned_abs() % 1_000_000_000);
    let text = format!("{sign}{whole}.{rest:09}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Times in any unit as nanoseconds since the first, the unit found by their size and steps. None if they cannot be times.
#[must_use]
pub fn nanoseconds(values: &[f64]) -> Option<Vec<i64>> {
    if values.iter().any(|value| value.is_nan() || value.abs() > 1e19) {
        return None;
    }
    let billionths: Vec<i128> = values.iter().map(|value| (value * 1e9).round() as i128).collect();
    let first = values.first().copied()?;
    let (unit, _) = unit_of(&billionths, &vec![0; billionths.len()]);
    // The difference first: it is exact where the times are large.
    let nanoseconds = |value: &f64| Some(((value - first) * unit as f64).round()).filter(|time| time.abs() < 9.2e18);
    values.iter().map(|value| nanoseconds(value).map(|time| time as i64)).collect()
}

/// Nanoseconds in what is counted, by how large the times and their steps are, and whether it had to be guessed. Times are
/// in billionths of the unit; `track` tells the sequence of each.
pub(crate) fn unit_of(times: &[i128], track: &[u32]) -> (i128, bool) {
    let largest = times.iter().map(|time| (time / BILLION).unsigned_abs()).max().unwrap_or(0);
    // Since 1970, counted in s, a time has 10 digits; this century no other unit comes near.
    match largest {
        900_000_000_000_000_000.. => return (1, false),
        900_000_000_000_000..=5_000_000_000_000_000 => return (1000, false),
        900_000_000_000..=5_000_000_000_000 => return (1_000_000, false),
        _ => {}
    }
    if times.iter().any(|time| time % BILLION != 0) {
        return (BILLION, false);
    }
    let mut steps: Vec<i128> = times
        .windows(2)
        .zip(track.windows(2))
        .filter(|(times, track)| track[0] == track[1] && times[1] > times[0])
        .map(|(times, _)| (times[1] - times[0]) / BILLION)
        .collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return (BILLION, false);
    }
    // Whole numbers: movements are recorded at one to ten thousand samples a second.
    match *steps.select_nth_unstable(middle).1 {
        ..=1 => (BILLION, false),
        2..=1999 => (1_000_000, true),
        2000..=999_999 => (1000, true),
        _ => (1, true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One track of one channel with the number of each sample as its value.
    fn track(times: &[i64]) -> Track {
        let values = (0..times.len()).map(|k| k as f64).collect();
        Track { name: "a".into(), values, times: times.iter().map(|time| time * 1_000_000).collect() }
    }

    /// In milliseconds: the values and the period, or what is said.
    fn even(tracks: &[&[i64]], period: Option<f64>, resolution: i64) -> Result<(Vec<f64>, Option<f64>), String> {
        let tracks = tracks.iter().map(|times| track(times)).collect();
        let mut samples =
            Samples { channels: vec!["y".into()], tracks, resolution: resolution * 1_000_000, ..Samples::default() };
        let selection = Selection { period, ..Selection::default() };
        let period = to_even_steps("x", &mut samples, &selection).map_err(|error| error.to_string())?;
        assert!(samples.remarks.is_empty() || period.is_some());
        Ok((samples.tracks.remove(0).values, period))
    }

    #[test]
    fn a_little_jitter_is_even() {
        assert_eq!(even(&[&[0, 100, 205, 300]], None, 0), Ok((vec![0., 1., 2., 3.], Some(0.1))));
        assert_eq!(even(&[&[5]], None, 0), Ok((vec![0.0], None)));
        // Off by a third: taken, and said.
        assert_eq!(even(&[&[0, 100, 230, 300, 400]], None, 0), Ok((vec![0., 1., 2., 3., 4.], Some(0.1))));
    }

    #[test]
    fn gaps_falls_and_other_rates_are_refused() {
        let said = |tracks: &[&[i64]]| even(tracks, None, 0).unwrap_err();
        assert!(said(&[&[0, 100, 200, 500, 600]]).contains("0.3 s after step 3 (at 0.2 s; 1 of 4 intervals"));
        assert!(said(&[&[0, 100, 50, 150, 250]]).contains("falls from 0.1 s to 0.05 s after step 2"));
        assert!(said(&[&[0, 100, 200], &[0, 50, 100]]).contains("0.1 s apart, those of a 0.05 s"));
        assert!(said(&[&[0, 0, 0, 100]]).contains("the time of the one before"));
    }

    #[test]
    fn a_period_resamples_on_straight_lines() {
        assert_eq!(even(&[&[0, 100, 300]], Some(0.05), 0), Ok((vec![0., 0.5, 1., 1.25, 1.5, 1.75, 2.], Some(0.05))));
        assert_eq!(even(&[&[0, 100, 200], &[0, 50, 100]], Some(0.1), 0).unwrap().0, [0., 1., 2.]);
        let wide = even(&[&[0, 100, 200, 1400]], Some(0.1), 0).unwrap_err();
        assert!(wide.contains("between 0.2 s and 1.4 s, which is too long to be bridged"), "{wide}");
        assert!(even(&[&[0, 100]], Some(1e-9), 0).unwrap_err().contains("would become 100000001"));
        assert!(even(&[&[0, 100, 50]], Some(0.1), 0).unwrap_err().contains("falls"));
    }

    #[test]
    fn what_is_missing_stays_missing_on_the_lines_to_it() {
        let mut track = track(&[0, 100, 200, 300]);
        track.values[1] = f64::NAN;
        let values = resampled(&track, 1, 50_000_000).unwrap();
        let missing: Vec<bool> = values.iter().map(|value| value.is_nan()).collect();
        assert_eq!(missing, [false, true, true, true, false, false, false]);
    }

    #[test]
    fn times_of_few_digits_are_told_from_gaps() {
        // 125 samples a second, written in hundredths.
        let rounded: Vec<i64> = (0..200).map(|k| (k * 8 + 5) / 10 * 10).collect();
        assert_eq!(even(&[&rounded], None, 10).unwrap().1.map(|period| (period * 1000.0).round()), Some(8.0));
        // A hundred a second, one lost.
        let lost: Vec<i64> = (0..200).map(|k| 10 * (k + i64::from(k > 90))).collect();
        assert!(even(&[&lost], None, 10).unwrap_err().contains("0.02 s after step 91"));
    }

    #[test]
    fn even_samples_can_be_resampled_by_their_period() {
        let tracks = vec![Track { name: "a".into(), values: vec![0., 1., 2., 3.], times: Vec::new() }];
        let mut samples = Samples { channels: vec!["y".into()], tracks, period: Some(0.1), ..Samples::default() };
        let selection = Selection { period: Some(0.15), ..Selection::default() };
        assert_eq!(to_even_steps("x", &mut samples, &selection).unwrap(), Some(0.15));
        assert_eq!(samples.tracks[0].values, [0.0, 1.5, 3.0]);
        samples.period = None;
        assert!(matches!(to_even_steps("x", &mut samples, &selection), Err(FileError::NoClock { .. })));
    }

    #[test]
    fn numbers_are_times_in_the_unit_of_their_size() {
        assert_eq!(nanoseconds(&[1.5, 1.52]), Some(vec![0, 20_000_000]));
        assert_eq!(nanoseconds(&[1.766e18, 1.766e18 + 2e7]), Some(vec![0, 20_000_000]));
        assert_eq!(nanoseconds(&[f64::NAN]), None);
        assert_eq!(nanoseconds(&[0.0, 0.5, 1e11]), None);
    }
}
