//! Messages of several kinds as rows at even times.
//!
//! A series is what came together: the messages of one topic that hold the same names. Series are joined over the time
//! in which all of them are there, at the times of the densest one if no period is given. Values lie on straight lines
//! between messages; those that are discrete (truth values, whole numbers, a gripper's 0 and 1) are the nearest ones.

use std::fmt::Write;

use crate::budget::{Budget, OverBudget};

/// Most samples that one message may be turned into, on average.
const MOST_PER_MESSAGE: i128 = 100;
/// Times by which neighbouring messages may be further apart than they are in the middle, or than the period.
const WIDEST_GAP: i64 = 10;
/// Share of the middle interval by which intervals may differ and still count as even.
const EVEN: f64 = 0.1;
/// Share of all times at which the largest series must be there so that others are fitted into its rows.
const LARGEST: f64 = 0.8;
/// Share of the longest series that must remain of it.
const LEAST_OVERLAP: f64 = 0.5;

/// Messages that hold the same names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Which channels these are.
    pub columns: Vec<usize>,
    /// Nanoseconds.
    pub times: Vec<i64>,
    /// Messages x columns.
    pub values: Vec<f64>,
}

/// Channels as they should be joined.
#[derive(Debug, Clone, Copy)]
pub struct Channels<'c> {
    /// Their names.
    pub names: &'c [String],
    /// Whether values between two of theirs make no sense.
    pub discrete: &'c [bool],
}

/// Rows on all channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joined {
    /// Samples x channels. NaN is missing.
    pub values: Vec<f64>,
    /// When they were taken; empty if at every period.
    pub times: Vec<i64>,
    /// Nanoseconds between samples, if they were brought to a period.
    pub period: Option<i64>,
    /// Nanoseconds that were cut off at the ends because not all series are there.
    pub cut: i64,
}

/// What stands against joining.
#[derive(Debug, PartialEq)]
pub enum Refusal {
    /// A sentence.
    Said(String),
    /// It would fill the memory.
    Memory(OverBudget),
}

impl From<OverBudget> for Refusal {
    fn from(problem: OverBudget) -> Self {
        Self::Memory(problem)
    }
}

impl Series {
    /// Puts the messages into the order of their times; those of the same time stay in theirs.
    pub fn sort(&mut self) {
        if self.times.is_sorted() {
            return;
        }
        let mut order: Vec<usize> = (0..self.times.len()).collect();
        order.sort_by_key(|&index| self.times[index]);
        let columns = self.columns.len();
        self.times = order.iter().map(|&index| self.times[index]).collect();
        self.values =
            order.iter().flat_map(|&index| &self.values[index * columns..(index + 1) * columns]).copied().collect();
    }

    fn ends(&self) -> Option<(i64, i64)> {
        Some((*self.times.first()?, *self.times.last()?))
    }

    /// One series for each column.
    fn split(self) -> impl Iterator<Item = Self> {
        let Self { columns, times, values } = self;
        let count = columns.len();
        columns.into_iter().enumerate().map(move |(place, column)| Self {
            columns: vec![column],
            times: times.clone(),
            values: values.iter().skip(place).step_by(count).copied().collect(),
        })
    }
}

/// Joins series, whose times never fall.
///
/// # Errors
/// [`Refusal`].
pub fn join(
    mut series: Vec<Series>,
    channels: Channels<'_>,
    period: Option<i64>,
    budget: &Budget,
) -> Result<Joined, Refusal> {
    series.retain(|series| !series.times.is_empty());
    let count = channels.names.len();
    if period.is_none() && series.len() < 2 {
        let Some(only) = series.pop() else { return Ok(Joined::default()) };
        let is_whole =
            only.columns.len() == count && only.columns.iter().enumerate().all(|(place, &column)| place == column);
        let values =
            if is_whole { only.values } else { rows(std::slice::from_ref(&only), &only.times, count, budget)? };
        return Ok(Joined { values, times: only.times, ..Joined::default() });
    }
    let mut met = vec![false; count];
    let overlap =
        series.iter().flat_map(|series| &series.columns).any(|&column| std::mem::replace(&mut met[column], true));
    if period.is_none()
        && overlap
        && let Some(times) = common_times(&series)
    {
        return Ok(Joined { values: rows(&series, &times, count, budget)?, times, ..Joined::default() });
    }
    if overlap {
        series = merged(series, count, budget)?;
    }
    resample(&series, channels, period, budget)
}

/// The times of all series, if they are even and the largest series is there at most of them.
fn common_times(series: &[Series]) -> Option<Vec<i64>> {
    let mut times: Vec<i64> = series.iter().flat_map(|series| &series.times).copied().collect();
    times.sort_unstable();
    times.dedup();
    let largest = series.iter().map(|series| series.times.len()).max()?;
    let middle = middle_interval(&times)?;
    let off = |interval: i64| (interval as f64 - middle as f64).abs() > EVEN * middle as f64;
    let even = !times.windows(2).any(|pair| off(pair[1].saturating_sub(pair[0])));
    (even && largest as f64 >= LARGEST * times.len() as f64).then_some(times)
}

/// The values at these times, each of which is one of a series. What is not there is missing.
fn rows(series: &[Series], times: &[i64], count: usize, budget: &Budget) -> Result<Vec<f64>, Refusal> {
    let size = times.len().saturating_mul(count);
    budget.take_values::<f64>(size)?;
    let mut values = vec![f64::NAN; size];
    for series in series {
        let mut row = 0;
        for (time, found) in series.times.iter().zip(series.values.chunks_exact(series.columns.len())) {
            while times[row] < *time {
                row += 1;
            }
            for (&column, &value) in series.columns.iter().zip(found) {
                values[row * count + column] = value;
            }
            // Of one series, rows of the same time stay apart.
            if times.get(row + 1) == Some(time) {
                row += 1;
            }
        }
    }
    Ok(values)
}

/// One series for each column, where columns are in several.
fn merged(series: Vec<Series>, count: usize, budget: &Budget) -> Result<Vec<Series>, Refusal> {
    let mut columns: Vec<Series> =
        (0..count).map(|column| Series { columns: vec![column], ..Series::default() }).collect();
    for series in series {
        budget.take_values::<[f64; 2]>(series.values.len())?;
        for part in series.split() {
            let all = &mut columns[part.columns[0]];
            all.times.extend(part.times);
            all.values.extend(part.values);
        }
    }
    columns.retain(|series| !series.times.is_empty());
    columns.iter_mut().for_each(Series::sort);
    Ok(columns)
}

/// Brings all series to a period: the one that is given, else that of the densest series.
fn resample(
    series: &[Series],
    channels: Channels<'_>,
    period: Option<i64>,
    budget: &Budget,
) -> Result<Joined, Refusal> {
    let said = |text: String| Err(Refusal::Said(text));
    let middles: Vec<Option<i64>> =
        series.iter().map(|series| middle_interval(&series.times).filter(|&middle| middle > 0)).collect();
    let densest = (0..series.len()).filter(|&index| middles[index].is_some()).min_by_key(|&index| middles[index]);
    let base = densest.unwrap_or(0);
    let Some(period) = period.or(middles.get(base).copied().flatten()) else {
        return said("no two messages of a kind come after each other".to_owned());
    };
    let ends: Vec<(i64, i64)> = series.iter().filter_map(Series::ends).collect();
    let (Some(start), Some(end)) = (ends.iter().map(|ends| ends.0).max(), ends.iter().map(|ends| ends.1).min()) else {
        return Ok(Joined::default());
    };
    let span = |(first, last): (i64, i64)| last.saturating_sub(first);
    let longest = ends.iter().copied().map(span).max().unwrap_or(0);
    // At the times of the densest series, which then keeps its values.
    let first = series[base].times.iter().copied().find(|&time| time >= start).unwrap_or(start);
    if series.len() > 1 && (first > end || span((start, end)) as f64 <= LEAST_OVERLAP * longest as f64) {
        return said(where_they_are(series, &ends, channels));
    }
    for (series, middle) in series.iter().zip(&middles) {
        if series.columns.iter().all(|&column| channels.discrete[column]) {
            continue;
        }
        let widest = WIDEST_GAP.saturating_mul(middle.unwrap_or(period).max(period));
        let inside = |pair: &&[i64]| pair[1] > first && pair[0] < end;
        let gap = series.times.windows(2).filter(inside).find(|pair| pair[1].saturating_sub(pair[0]) > widest);
        if let Some(gap) = gap {
            return said(format!(
                "no message came between {} s and {} s, which is too long to be bridged",
                crate::times::seconds(gap[0]),
                crate::times::seconds(gap[1])
            ));
        }
    }
    let samples = (i128::from(end) - i128::from(first)) / i128::from(period) + 1;
    let messages = series.iter().map(|series| series.times.len()).max().unwrap_or(0);
    let most = MOST_PER_MESSAGE * messages as i128;
    if samples > most {
        return said(format!("{messages} messages would become {samples} samples; needed: at most {most}"));
    }
    let (samples, count) = (samples as usize, channels.names.len());
    budget.take_values::<f64>(samples.saturating_mul(count))?;
    let mut values = vec![f64::NAN; samples * count];
    for series in series {
        let mut after = 0;
        let width = series.columns.len();
        for (sample, row) in values.chunks_exact_mut(count).enumerate() {
            let time = first + sample as i64 * period;
            while series.times.get(after + 1).is_some_and(|&next| next <= time) {
                after += 1;
            }
            let before = &series.values[after * width..(after + 1) * width];
            let at = series.times[after];
            match series.times.get(after + 1) {
                Some(&next) if time > at => {
                    let share = (time - at) as f64 / (i128::from(next) - i128::from(at)) as f64;
                    let behind = &series.values[(after + 1) * width..(after + 2) * width];
                    for ((&column, &a), &b) in series.columns.iter().zip(before).zip(behind) {
                        row[column] = match channels.discrete[column] {
                            true if share <= 0.5 => a,
                            true => b,
                            false => a + share * (b - a),
                        };
                    }
                }
                _ => series.columns.iter().zip(before).for_each(|(&column, &value)| row[column] = value),
            }
        }
    }
    let cut = longest.saturating_sub(span((first, end)));
    Ok(Joined { values, times: Vec::new(), period: Some(period), cut })
}

/// Tells that series do not go together in time.
fn where_they_are(series: &[Series], ends: &[(i64, i64)], channels: Channels<'_>) -> String {
    let mut said = "the channels are not there at the same time:".to_owned();
    for (index, (series, (first, last))) in series.iter().zip(ends).enumerate().take(5) {
        let names: Vec<_> = series.columns.iter().take(3).map(|&column| channels.names[column].as_str()).collect();
        let more = if series.columns.len() > 3 { ", ..." } else { "" };
        let comma = if index > 0 { ";" } else { "" };
        let (first, last) = (crate::times::seconds(*first), crate::times::seconds(*last));
        // Writing to a string cannot fail.
        let _ = write!(said, "{comma} {}{more} from {first} s to {last} s", names.join(", "));
    }
    said
}

/// The median of the intervals.
pub fn middle_interval(times: &[i64]) -> Option<i64> {
    let mut intervals: Vec<i64> = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable(middle).1)
}

#[cfg(test)]
mod tests;
