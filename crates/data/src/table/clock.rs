//! Which columns tell the time, by their names and by how their values behave, and in which unit.

use std::collections::HashMap;

use crate::remark::Remark;

use crate::times::unit_of;

use super::header::Layout;
use super::roles::{Role, nanoseconds_in, without_unit};
use super::rows::{NO_TIME, Plan, Rows, Shape};

const BILLION: i128 = 1_000_000_000;

/// What tells the time of every row.
#[derive(Debug)]
pub struct Clock {
    /// Its columns: one, or two that belong together.
    pub columns: Vec<usize>,
    /// Its name.
    pub name: String,
    /// Nanoseconds since some moment, one for each row.
    pub times: Vec<i64>,
    /// Nanoseconds between two times that the file can tell apart.
    pub resolution: i64,
}

/// How values go on from row to row within a sequence.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Course {
    /// Rises.
    pub rises: usize,
    /// Values that are those of the row before.
    pub stays: usize,
    /// Falls to about where the sequence began.
    pub restarts: usize,
    /// Other falls.
    pub falls: usize,
}

/// Whether a fall from `from` to `to` is a restart, where the values began at `start`: it falls to the first tenth.
pub fn restarts(start: f64, from: f64, to: f64) -> bool {
    to <= start + 0.1 * (from - start)
}

/// Follows values through the rows; `track` tells the sequence of each.
pub fn course(values: impl Iterator<Item = f64>, track: &[u32]) -> Course {
    let mut course = Course::default();
    // Start and latest value of the sequence that the latest row was of; sequences seldom interleave.
    let mut open: HashMap<u32, (f64, f64)> = HashMap::new();
    for (value, &track) in values.zip(track) {
        let (start, before) = open.entry(track).or_insert((value, f64::NAN));
        if value > *before {
            course.rises += 1;
        } else if value == *before {
            course.stays += 1;
        } else if value < *before {
            if restarts(*start, *before, value) {
                course.restarts += 1;
                *start = value;
            } else {
                course.falls += 1;
            }
        }
        *before = value;
    }
    course
}

/// A column, or two, that could tell the time.
struct Candidate {
    columns: Vec<usize>,
    times: Vec<i128>,
    decimals: usize,
    /// Nanoseconds in a billionth of what is counted, times a billion; None if the values must tell.
    unit: Option<i128>,
    sure: bool,
    stamp: bool,
}

/// All clocks of the rows, the best first.
pub fn clocks(layout: &Layout, plans: &[Plan], rows: &Rows, track: &[u32], remarks: &mut Vec<Remark>) -> Vec<Clock> {
    let mut clocks = Vec::new();
    for candidate in candidates(layout, plans, rows) {
        let Candidate { columns, times, decimals, unit, sure, stamp } = candidate;
        let name = columns.iter().map(|&column| plans[column].name.as_str()).collect::<Vec<_>>().join(" and ");
        if times.contains(&NO_TIME) {
            continue;
        }
        let first = times.iter().copied().min().unwrap_or(0);
        let course = course(times.iter().map(|time| (time - first) as f64), track);
        let steady = if sure {
            course.falls * 50 <= times.len()
        } else {
            course.falls == 0 && course.stays == 0 && course.rises > 1
        };
        if !steady || course.rises == 0 {
            continue;
        }
        let unit = match unit {
            Some(unit) => unit,
            None => {
                let (unit, guessed) = unit_of(&times, track);
                if guessed {
                    let in_unit = match unit {
                        1 => "nanoseconds",
                        1000 => "microseconds",
                        _ => "milliseconds",
                    };
                    remarks.push(Remark::Understood {
                        what: format!("`{name}` was taken to be in {in_unit}, by its steps"),
                    });
                }
                unit
            }
        };
        let in_nanoseconds = |time: i128| i64::try_from((time - first).checked_mul(unit)? / BILLION).ok();
        let Some(times) = times.iter().map(|&time| in_nanoseconds(time)).collect::<Option<Vec<i64>>>() else {
            continue;
        };
        let resolution = i64::try_from(unit / 10_i128.pow(decimals as u32)).unwrap_or(i64::MAX);
        clocks.push((stamp, Clock { columns, name, times, resolution }));
    }
    // The stamp in a message's header tells when it was measured; other clocks when it arrived somewhere.
    clocks.sort_by_key(|(stamp, _)| !stamp);
    clocks.into_iter().map(|(_, clock)| clock).collect()
}

fn candidates(layout: &Layout, plans: &[Plan], rows: &Rows) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    let mut used = vec![false; plans.len()];
    let added = |a: &[i128], b: &[i128], unit: i128| -> Vec<i128> {
        let sum = |(a, b): (&i128, &i128)| {
            if *a == NO_TIME || *b == NO_TIME { NO_TIME } else { a.saturating_mul(unit).saturating_add(*b) }
        };
        a.iter().zip(b).map(sum).collect()
    };
    let nanoseconds: HashMap<&str, usize> = plans
        .iter()
        .enumerate()
        .filter_map(|(index, plan)| match &plan.role {
            Some(Role::Nanoseconds(stem)) => Some((stem.as_str(), index)),
            _ => None,
        })
        .collect();
    for (index, plan) in plans.iter().enumerate() {
        let kept = &rows.columns[index];
        if kept.times.is_empty() {
            continue;
        }
        // Seconds and nanoseconds in two columns.
        if let Some(Role::Seconds(stem)) = &plan.role
            && let Some(&other) = nanoseconds.get(stem.as_str())
            && rows.columns[other].times.len() == kept.times.len()
        {
            let times = added(&kept.times, &rows.columns[other].times, BILLION);
            let (columns, stamp) = (vec![index, other], stem.contains("stamp"));
            candidates.push(Candidate { columns, times, decimals: 0, unit: Some(1), sure: true, stamp });
            (used[index], used[other]) = (true, true);
        }
        // A day and a time of day.
        if let (Some(Shape::Day), Some(Shape::Clock)) =
            (kept.moment, rows.columns.get(index + 1).and_then(|next| next.moment))
        {
            let next = &rows.columns[index + 1];
            let times = added(&kept.times, &next.times, 1);
            candidates.push(Candidate {
                columns: vec![index, index + 1],
                times,
                decimals: next.decimals,
                unit: Some(BILLION),
                sure: true,
                stamp: false,
            });
            (used[index], used[index + 1]) = (true, true);
        }
    }
    for (index, plan) in plans.iter().enumerate() {
        let kept = &rows.columns[index];
        if kept.times.is_empty() || used[index] {
            continue;
        }
        let (mut times, mut unit) = (kept.times.clone(), None);
        match kept.moment {
            Some(Shape::Day) => continue,
            Some(Shape::Clock) => {
                past_midnight(&mut times);
                unit = Some(BILLION);
            }
            Some(Shape::Stamp) => unit = Some(BILLION),
            None => {}
        }
        let sure = kept.moment.is_some() || matches!(plan.role, Some(Role::Clock { sure: true }));
        let stamp = matches!(plan.role, Some(Role::Clock { .. })) && plan.name.to_lowercase().contains("header");
        let unit = unit.or_else(|| unit_in_name(&plan.name, layout.columns[index].unit.as_deref(), &plan.role));
        candidates.push(Candidate { columns: vec![index], times, decimals: kept.decimals, unit, sure, stamp });
    }
    candidates
}

/// A time of day that falls by most of a day is of the next.
fn past_midnight(times: &mut [i128]) {
    const DAY: i128 = 86_400 * BILLION;
    let (mut days, mut before) = (0, NO_TIME);
    for time in times.iter_mut().filter(|time| **time != NO_TIME) {
        if before != NO_TIME && before - *time > DAY * 3 / 4 {
            days += 1;
        }
        before = *time;
        *time += days * DAY;
    }
}

/// Nanoseconds in what a column counts, where its name or unit tells. Times are kept in billionths.
fn unit_in_name(name: &str, unit: Option<&str>, role: &Option<Role>) -> Option<i128> {
    if let Some(unit) = unit.and_then(nanoseconds_in) {
        return Some(unit);
    }
    match role {
        Some(Role::Seconds(_)) => return Some(BILLION),
        Some(Role::Nanoseconds(_)) => return Some(1),
        _ => {}
    }
    // `rostopic echo -p` writes nanoseconds.
    if name.starts_with('%') || name.starts_with("field.") && name.ends_with("stamp") {
        return Some(1);
    }
    let (bare, _) = without_unit(name);
    let ending = bare.rsplit(['_', ' ']).next().filter(|ending| ending.len() < bare.len());
    nanoseconds_in(ending.unwrap_or("")).or_else(|| nanoseconds_in(bare))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_course_of_values_is_followed() {
        let of = |values: &[f64]| course(values.iter().copied(), &vec![0; values.len()]);
        assert_eq!(of(&[0.0, 1.0, 1.0, 2.0]), Course { rises: 2, stays: 1, ..Course::default() });
        assert_eq!(of(&[5.0, 6.0, 7.0, 5.0, 6.0]), Course { rises: 3, restarts: 1, ..Course::default() });
        assert_eq!(of(&[0.0, 5.0, 4.0]), Course { rises: 1, falls: 1, ..Course::default() });
        let two = course([1.0, 7.0, 2.0, 8.0].into_iter(), &[0, 1, 0, 1]);
        assert_eq!(two, Course { rises: 2, ..Course::default() });
    }

    #[test]
    fn units_go_by_sizes_where_nothing_tells_them() {
        let of = |times: &[i128]| {
            unit_of(&times.iter().map(|time| time * BILLION).collect::<Vec<_>>(), &vec![0; times.len()])
        };
        assert_eq!(of(&[1_766_147_454_233_218_075, 1_766_147_454_253_218_075]), (1, false));
        assert_eq!(of(&[1_766_147_454_233, 1_766_147_454_253]), (1_000_000, false));
        assert_eq!(of(&[1_766_147_454, 1_766_147_455]), (BILLION, false));
        assert_eq!(of(&[0, 20, 40]), (1_000_000, true));
        assert_eq!(of(&[0, 1, 2]), (BILLION, false));
        assert_eq!(of(&[31_950_000_000, 31_970_000_000]), (1, true));
        assert_eq!(unit_in_name("time_ms", None, &None), Some(1_000_000));
        assert_eq!(unit_in_name("Time", Some("s"), &None), Some(BILLION));
        assert_eq!(unit_in_name("timestamp", None, &None), None);
    }
}
