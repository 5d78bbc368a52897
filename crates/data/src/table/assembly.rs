//! From rows to sequences: which columns are clocks, counters, labels and channels, by how their values behave; where a
//! sequence ends.

use std::collections::HashMap;

use crate::budget::{Budget, OverBudget};
use crate::reading::Facts;
use crate::remark::Remark;
use crate::samples::{Samples, Track};

use super::clock::{Clock, clocks, course, restarts};
use super::header::{Holds, Layout};
use super::roles::Role;
use super::rows::{Plan, Rows};

/// What a column turned out to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Is {
    Channel,
    Clock,
    Counter,
    Label,
    Nothing,
}

/// Rows in sequences.
#[derive(Debug)]
pub struct Assembly {
    /// The samples, channels by their names.
    pub samples: Samples,
    /// Columns that are channels.
    pub channels: Vec<usize>,
    /// The sequence of each row, and the row's place in it, for messages.
    track: Vec<u32>,
}

impl Assembly {
    /// Name of the sequence of a row, and the row's number in it, from 1.
    pub fn place(&self, row: usize) -> (&str, usize) {
        let track = self.track[row];
        let before = self.track[..row].iter().filter(|other| **other == track).count();
        (self.samples.tracks.get(track as usize).map_or("", |track| &track.name), before + 1)
    }
}

/// Makes sequences of rows.
///
/// # Errors
/// [`OverBudget`].
pub fn assemble(
    layout: &Layout,
    plans: &[Plan],
    rows: Rows,
    budget: &Budget,
    asked: bool,
) -> Result<Assembly, OverBudget> {
    budget.take(rows.count.saturating_mul(24))?;
    let mut remarks = layout.remarks.clone();
    let mut is: Vec<Is> = vec![Is::Channel; plans.len()];
    let (mut track, mut names) = blocks(&rows, &mut remarks);
    let labelled = label(plans, &rows, &mut is, &mut track, &mut names, &mut remarks);
    let mut clocks = clocks(layout, plans, &rows, &track, &mut remarks);
    if clocks.is_empty() && !layout.named {
        clocks.extend(nameless_stamp(layout, plans, &rows));
    }
    for clock in &clocks {
        clock.columns.iter().for_each(|&column| is[column] = Is::Clock);
    }
    for (index, plan) in plans.iter().enumerate() {
        // The same time in every row, or a single row: no clock that tells anything, but no channel either.
        let stands = || {
            let course = course(values(&rows, index), &track);
            course.rises + course.falls + course.restarts == 0
        };
        let is_clock = matches!(plan.role, Some(Role::Clock { sure: true })) && is[index] == Is::Channel;
        if is_clock && !rows.columns[index].slots.is_empty() && stands() {
            is[index] = Is::Clock;
        }
    }
    count(plans, &rows, &track, &mut is, &mut remarks);
    if !labelled {
        let clock =
            clocks.first().map(|clock| (clock.name.clone(), clock.times.iter().map(|&time| time as f64).collect()));
        let clock = clock.or_else(|| counter(plans, &rows, &is));
        if let Some((name, values)) = clock {
            split_at_restarts(&name, &values, &mut track, &mut names, &mut remarks);
        }
    }
    // What is asked for is a channel, whatever it looks like.
    for (index, plan) in plans.iter().enumerate() {
        if plan.asked {
            is[index] = Is::Channel;
            continue;
        }
        let column = plan.name.clone();
        let kept = &rows.columns[index];
        match is[index] {
            Is::Clock => remarks.push(Remark::Clock { column }),
            Is::Counter if !column.is_empty() && column != "Unnamed: 0" => remarks.push(Remark::Counter { column }),
            Is::Channel if asked => is[index] = Is::Nothing,
            Is::Channel if !plan.numbers || !kept.any => {
                is[index] = Is::Nothing;
                let what = match (layout.columns[index].set_aside, layout.columns[index].holds) {
                    (Some(what), _) => what,
                    (None, Holds::Words) => "words",
                    (None, Holds::Moments) => "dates",
                    (None, _) if kept.bad[1].is_some() => {
                        // No number, but something: an error that shows it.
                        is[index] = Is::Channel;
                        continue;
                    }
                    (None, _) => "nothing",
                };
                let named = layout.columns[index].name.as_deref().is_some_and(|name| !name.is_empty());
                let runs = 1 + kept.labels.windows(2).filter(|pair| pair[0] != pair[1]).count();
                let stands_still = runs > 1 && runs * 4 <= kept.labels.len();
                if !labelled && names.len() == 1 && stands_still && kept.texts.iter().all(|text| !text.is_empty()) {
                    remarks.push(Remark::MayBeLabel { column, runs });
                } else if named || what != "nothing" {
                    remarks.push(Remark::LeftOut { column, what: what.to_owned() });
                } else if plans.len() == 1 {
                    is[index] = Is::Channel;
                }
            }
            Is::Channel if matches!(plan.role, Some(Role::Clock { sure: true })) => {
                remarks.push(Remark::NoClock { column });
            }
            _ => {}
        }
    }
    finish(layout, plans, rows, &is, track, names, clocks.into_iter().next(), remarks, budget)
}

/// Sequences by blank lines, comments and repeated headers.
fn blocks(rows: &Rows, remarks: &mut Vec<Remark>) -> (Vec<u32>, Vec<String>) {
    let lone = rows.blocks.len() == rows.count && rows.count > 2 && rows.blank + 1 == rows.blocks.len();
    if lone && rows.blocks.iter().all(|(_, name)| name.is_none()) {
        remarks.push(Remark::Understood {
            what: "a blank line stands between any two rows: they were taken as one sequence".to_owned(),
        });
        return (vec![0; rows.count], vec!["1".to_owned()]);
    }
    if !rows.repeated.is_empty() {
        let what = format!("the header stands there {} times: each begins a sequence", rows.repeated.len() + 1);
        remarks.push(Remark::Understood { what });
    }
    let mut track = Vec::with_capacity(rows.count);
    let mut names = Vec::with_capacity(rows.blocks.len());
    for (index, (start, name)) in rows.blocks.iter().enumerate() {
        let end = rows.blocks.get(index + 1).map_or(rows.count, |(start, _)| *start);
        track.extend(std::iter::repeat_n(index as u32, end - start));
        names.push(name.clone().unwrap_or_else(|| (index + 1).to_string()));
    }
    (track, names)
}

/// Splits by labels; whether there were any.
fn label(
    plans: &[Plan],
    rows: &Rows,
    is: &mut [Is],
    track: &mut [u32],
    names: &mut Vec<String>,
    remarks: &mut Vec<Remark>,
) -> bool {
    let mut found = false;
    for (index, plan) in plans.iter().enumerate() {
        let Some(Role::Label { sure }) = plan.role else { continue };
        let kept = &rows.columns[index];
        if plan.asked || kept.labels.is_empty() {
            continue;
        }
        let runs = 1 + kept.labels.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let whole = kept.texts.iter().all(|text| {
            !text.contains('.') || text.trim_end_matches('0').ends_with('.') || text.parse::<f64>().is_err()
        });
        // A label stands still for several rows; one that changes at every row is something else.
        if !sure && (!whole || runs * 2 > rows.count) {
            continue;
        }
        is[index] = Is::Label;
        let before = if found { std::mem::take(names) } else { vec![String::new()] };
        if !found {
            track.iter_mut().for_each(|track| *track = 0);
        }
        let mut parts: HashMap<(u32, u32, u32), u32> = HashMap::new();
        let mut latest: HashMap<u32, (u32, u32)> = HashMap::new();
        let mut split = Vec::new();
        for (track, &label) in track.iter_mut().zip(&kept.labels) {
            // By value where the name is sure, else by runs: trials 1, 2, 1, 2 are four.
            let run = if sure {
                0
            } else {
                let (last, run) = latest.entry(*track).or_insert((label, 0));
                *run += u32::from(*last != label);
                *last = label;
                *run
            };
            let next = parts.len() as u32;
            let now = *parts.entry((*track, label, run)).or_insert(next);
            if now == next {
                split.push((*track, label));
            }
            *track = now;
        }
        // A label that tells nothing apart that is not told apart already adds nothing to the names.
        *names = if found && split.len() == before.len() {
            split.iter().map(|(track, _)| before[*track as usize].clone()).collect()
        } else {
            let text = |label: u32| kept.texts[label as usize].as_str();
            let join = |(track, label): &(u32, u32)| match before[*track as usize].as_str() {
                "" => text(*label).to_owned(),
                front => format!("{front}/{}", text(*label)),
            };
            split.iter().map(join).collect()
        };
        found = true;
        let sequences = names.len();
        if kept.texts.len() == 1 && plan.name != "sequence" {
            let what = "the same throughout".to_owned();
            remarks.push(Remark::LeftOut { column: plan.name.clone(), what });
        } else if plan.name != "sequence" {
            remarks.push(Remark::Label { column: plan.name.clone(), sequences });
        }
    }
    if found {
        let mut seen: HashMap<String, usize> = HashMap::new();
        for name in names.iter_mut() {
            let times = seen.entry(name.clone()).or_insert(0);
            *times += 1;
            if *times > 1 {
                *name = format!("{name} ({times})");
            }
        }
    }
    found
}

/// Values of a column of numbers.
fn values<'a>(rows: &'a Rows, column: usize) -> impl Iterator<Item = f64> + 'a {
    let slot = rows.columns[column].slots.start;
    rows.numbers.chunks_exact(rows.width.max(1)).map(move |row| row[slot])
}

/// Finds counters.
fn count(plans: &[Plan], rows: &Rows, track: &[u32], is: &mut [Is], remarks: &mut Vec<Remark>) {
    for (index, plan) in plans.iter().enumerate().filter(|(_, plan)| !plan.asked) {
        let sure = match plan.role {
            Some(Role::Counter { sure }) => sure,
            // A label that changes at every row.
            Some(Role::Label { sure: false }) if is[index] == Is::Channel => false,
            _ => continue,
        };
        if sure {
            is[index] = Is::Counter;
            continue;
        }
        let kept = &rows.columns[index];
        if kept.slots.is_empty() || kept.bad[1].is_some() || !values(rows, index).all(|value| value.fract() == 0.0) {
            continue;
        }
        let course = course(values(rows, index), track);
        let steps = course.rises + course.stays + course.restarts + course.falls;
        // Counts of encoders rise and fall; numbers of rows rise, and begin again at times.
        if course.falls == 0 && course.restarts * 2 <= steps && course.rises > 0 && course.stays * 2 <= steps {
            is[index] = Is::Counter;
            let lost = lost(values(rows, index), track);
            if lost > 0 {
                remarks.push(Remark::NumbersLeftOut { column: plan.name.clone(), lost });
            }
        } else if course.rises + course.restarts + course.falls == 0 && steps > 0 {
            // The same in each sequence: it tells nothing.
            is[index] = Is::Label;
            remarks.push(Remark::LeftOut { column: plan.name.clone(), what: "the same throughout".to_owned() });
        }
    }
}

/// Numbers that a counter passes over, if it counts by ones.
fn lost(values: impl Iterator<Item = f64>, track: &[u32]) -> usize {
    let (mut before, mut ones, mut lost, mut steps) = ((f64::NAN, u32::MAX), 0, 0.0, 0);
    for (value, &track) in values.zip(track) {
        let step = value - before.0;
        if track == before.1 && step > 0.0 {
            steps += 1;
            ones += usize::from(step == 1.0);
            lost += step - 1.0;
        }
        before = (value, track);
    }
    if 2 * ones > steps { lost as usize } else { 0 }
}

/// The values of a counter that begins again.
fn counter(plans: &[Plan], rows: &Rows, is: &[Is]) -> Option<(String, Vec<f64>)> {
    let named = |index: &usize| {
        is[*index] == Is::Counter
            && !rows.columns[*index].slots.is_empty()
            && rows.columns[*index].bad.iter().all(Option::is_none)
    };
    let index = (0..plans.len()).find(named)?;
    Some((plans[index].name.clone(), values(rows, index).collect()))
}

/// Begins a sequence wherever the values begin again.
fn split_at_restarts(
    name: &str,
    values: &[f64],
    track: &mut [u32],
    names: &mut Vec<String>,
    remarks: &mut Vec<Remark>,
) {
    let (mut extra, mut first) = (0, None);
    let mut now = (u32::MAX, f64::NAN, f64::NAN);
    let mut old_of_new = Vec::new();
    for (row, (value, track)) in values.iter().zip(track.iter_mut()).enumerate() {
        let (before, start, latest) = now;
        if before != *track {
            now = (*track, *value, *value);
            old_of_new.push(*track);
        } else if *value < latest && restarts(start, latest, *value) {
            extra += 1;
            first.get_or_insert(row + 1);
            now = (*track, *value, *value);
            old_of_new.push(*track);
        } else {
            now.2 = *value;
        }
        *track += extra;
    }
    if let Some(row) = first {
        let given = |old: u32| names.get(old as usize).filter(|name| name.parse::<usize>().is_err()).cloned();
        let parts: Vec<usize> = {
            let mut counts = HashMap::new();
            old_of_new
                .iter()
                .map(|old| {
                    let count = counts.entry(*old).or_insert(0);
                    *count += 1;
                    *count
                })
                .collect()
        };
        let renamed = old_of_new.iter().zip(parts).enumerate();
        *names = renamed
            .map(|(index, (&old, part))| match given(old) {
                Some(name) => format!("{name}.{part}"),
                None => (index + 1).to_string(),
            })
            .collect();
        remarks.push(Remark::Restart { clock: name.to_owned(), row, sequences: names.len() });
    }
}

/// Seconds and nanoseconds in two columns of a table without names, as `ros2 topic echo --csv` writes them: whole seconds
/// of this century that rise by single seconds, and whole numbers below a billion behind them.
fn nameless_stamp(layout: &Layout, plans: &[Plan], rows: &Rows) -> Option<Clock> {
    let numbers = |index: usize| {
        layout.columns.get(index)?.holds.eq(&Holds::Numbers).then(|| values(rows, index).collect::<Vec<_>>())
    };
    if plans.iter().take(2).any(|plan| plan.asked || !plan.numbers) || rows.count < 3 {
        return None;
    }
    let (seconds, parts) = (numbers(0)?, numbers(1)?);
    let in_century = |value: &f64| value.fract() == 0.0 && (9e8..5e9).contains(value);
    let in_second = |value: &f64| value.fract() == 0.0 && (0.0..1e9).contains(value);
    if !seconds.iter().all(in_century) || !parts.iter().all(in_second) {
        return None;
    }
    let first = seconds[0];
    let times: Vec<i64> = seconds.iter().zip(&parts).map(|(s, part)| ((s - first) * 1e9 + part) as i64).collect();
    let fine = parts.iter().any(|part| *part >= 1e6);
    let rises = times.windows(2).all(|pair| pair[1] > pair[0]);
    (fine && rises).then(|| Clock {
        columns: vec![0, 1],
        name: "the first two columns".to_owned(),
        times,
        resolution: 1,
    })
}

#[expect(clippy::too_many_arguments, reason = "the parts of a table, which come from everywhere")]
fn finish(
    layout: &Layout,
    plans: &[Plan],
    rows: Rows,
    is: &[Is],
    track: Vec<u32>,
    names: Vec<String>,
    clock: Option<Clock>,
    remarks: Vec<Remark>,
    budget: &Budget,
) -> Result<Assembly, OverBudget> {
    let channels: Vec<usize> =
        (0..plans.len()).filter(|&index| is[index] == Is::Channel && plans[index].numbers).collect();
    let slots: Vec<usize> = channels.iter().flat_map(|&index| rows.columns[index].slots.clone()).collect();
    let mut tracks: Vec<Track> = names.into_iter().map(|name| Track { name, ..Track::default() }).collect();
    if tracks.len() == 1 && slots.len() == rows.width {
        tracks[0].values = rows.numbers;
        tracks[0].times = clock.as_ref().map(|clock| clock.times.clone()).unwrap_or_default();
    } else {
        budget.take(2 * 8 * rows.count.saturating_mul(slots.len() + 1))?;
        for (row, &track) in track.iter().enumerate() {
            let numbers = &rows.numbers[row * rows.width..(row + 1) * rows.width];
            let track = &mut tracks[track as usize];
            track.values.extend(slots.iter().map(|&slot| numbers[slot]));
            track.times.extend(clock.as_ref().map(|clock| clock.times[row]));
        }
    }
    let mut named = Vec::new();
    let mut units = Vec::new();
    for &index in &channels {
        let plan = &plans[index];
        let unit = layout.columns[index].unit.clone();
        if plan.parts > 1 || matches!(layout.columns[index].holds, Holds::Lists(_)) {
            named.extend((0..plan.parts).map(|part| format!("{}.{part}", plan.name)));
        } else {
            named.push(plan.name.clone());
        }
        units.resize(named.len(), unit);
    }
    let facts = Facts {
        named: layout.named,
        units: if units.iter().any(Option::is_some) { units } else { Vec::new() },
        clock: clock.as_ref().map(|clock| clock.name.clone()),
        ..Facts::default()
    };
    let resolution = clock.map_or(0, |clock| clock.resolution);
    let samples = Samples { channels: named, tracks, period: None, resolution, remarks, facts };
    Ok(Assembly { samples, channels, track })
}
