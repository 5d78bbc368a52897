//! Frames sorted into episodes.

use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};

use super::plan::Plan;
use crate::budget::Budget;
use crate::parquet::Parquet;
use crate::problem::FormatProblem;
use crate::samples::Track;
use crate::times;

/// The frames that were read so far, by episode.
#[derive(Debug, Default)]
pub struct Episodes {
    all: BTreeMap<i64, Episode>,
}

#[derive(Debug, Default)]
struct Episode {
    values: Vec<f64>,
    /// Numbers of the frames; empty if nothing counts them.
    frames: Vec<i64>,
    /// What the clock shows; empty if it is not needed.
    clock: Vec<f64>,
}

/// Rows of a group that stand together and are of one episode.
#[derive(Debug)]
struct Stretch {
    episode: i64,
    rows: Range<usize>,
    /// How many frames of the episode come before.
    at: usize,
}

/// What is done with a row of a column: the episode, the number within it, the number within the group, and the values.
type EachRow<'e> = &'e mut dyn FnMut(&mut Episode, usize, usize, &[f64]) -> Result<(), FormatProblem>;

/// The value in a row of a column of whole numbers.
fn whole(values: &[f64], row: usize, name: Option<&String>) -> Result<i64, FormatProblem> {
    match *values {
        [value] if value.is_finite() => Ok(value as i64),
        _ => Err(FormatProblem::Misfit {
            found: format!("row {} has no value of {}", row + 1, name.map_or("", String::as_str)),
            needed: "one in each row".to_owned(),
        }),
    }
}

/// Finds the stretches of a group of rows.
fn stretches(
    file: &Parquet<'_>,
    group: usize,
    rows: usize,
    leaf: Option<usize>,
    plan: &Plan,
    budget: &Budget,
) -> Result<Vec<Stretch>, FormatProblem> {
    let mut stretches: Vec<Stretch> = Vec::new();
    match leaf {
        None if rows > 0 => stretches.push(Stretch { episode: 0, rows: 0..rows, at: 0 }),
        None => {}
        Some(leaf) => file.each(group, leaf, budget, &mut |first, cells| {
            for row in 0..cells.ends.len() {
                let (episode, at) = (whole(cells.row(row), first + row, plan.episode.as_ref())?, first + row);
                match stretches.last_mut().filter(|last| last.episode == episode) {
                    Some(last) => last.rows.end = at + 1,
                    None => stretches.push(Stretch { episode, rows: at..at + 1, at: 0 }),
                }
            }
            Ok(ControlFlow::Continue(()))
        })?,
    }
    Ok(stretches)
}

impl Episodes {
    /// Takes all frames of a file.
    pub fn take(&mut self, file: &Parquet<'_>, plan: &Plan, budget: &Budget) -> Result<(), FormatProblem> {
        let leaf = |name: &str| {
            let leaf = file.leaf(name).filter(|&leaf| file.leaves[leaf].is_numeric());
            leaf.ok_or_else(|| FormatProblem::NoSuch {
                what: "column of numbers",
                found: name.to_owned(),
                there: file.leaves.iter().map(|leaf| leaf.name.as_str()).collect::<Vec<_>>().join(", "),
            })
        };
        let one = |name: Option<&String>| name.map(|name| leaf(name)).transpose();
        let (episode, frame) = (one(plan.episode.as_ref())?, one(plan.frame.as_ref())?);
        let clock = one(plan.clock.as_ref().map(|(name, _)| name))?;
        let features = plan.taken().map(|feature| leaf(&feature.name)).collect::<Result<Vec<_>, _>>()?;
        for group in 0..file.groups() {
            let rows = file.rows(group)?;
            budget.take_values::<f64>(rows.saturating_mul(plan.channels.len() + 2))?;
            let stretches = stretches(file, group, rows, episode, plan, budget)?;
            budget.take_values::<Stretch>(stretches.len())?;
            let stretches = self.room(stretches, plan.channels.len(), frame.is_some(), clock.is_some());
            self.columns(file, group, &stretches, (&features, frame, clock), plan, budget)?;
            budget.give_back(stretches.len() * size_of::<Stretch>());
        }
        Ok(())
    }

    /// Makes room for the frames of each stretch.
    fn room(&mut self, mut stretches: Vec<Stretch>, channels: usize, frame: bool, clock: bool) -> Vec<Stretch> {
        for stretch in &mut stretches {
            let into = self.all.entry(stretch.episode).or_default();
            let count = stretch.rows.len();
            // What grows by doubling holds up to three times what it needs; what grows row by row is copied for each.
            let more = count * channels;
            if more > into.values.len() / 8 {
                into.values.reserve_exact(more);
                into.frames.reserve_exact(if frame { count } else { 0 });
                into.clock.reserve_exact(if clock { count } else { 0 });
            }
            stretch.at = into.values.len() / channels.max(1);
            into.values.resize(into.values.len() + more, f64::NAN);
        }
        stretches
    }

    /// Puts the columns of a group of rows in their places.
    fn columns(
        &mut self,
        file: &Parquet<'_>,
        group: usize,
        stretches: &[Stretch],
        (features, frame, clock): (&[usize], Option<usize>, Option<usize>),
        plan: &Plan,
        budget: &Budget,
    ) -> Result<(), FormatProblem> {
        let channels = plan.channels.len();
        let mut column = 0;
        for (&leaf, feature) in features.iter().zip(plan.taken()) {
            let width = feature.width;
            self.each_row(file, group, stretches, leaf, budget, &mut |into, frame, row, values| {
                let place = frame * channels + column;
                match values {
                    [] => {}
                    values if values.len() == width => into.values[place..place + width].copy_from_slice(values),
                    values => {
                        return Err(FormatProblem::Misfit {
                            found: format!("row {} has {} values of {}", row + 1, values.len(), feature.name),
                            needed: format!("{width}, as the first row has"),
                        });
                    }
                }
                Ok(())
            })?;
            column += width;
        }
        if let Some(leaf) = frame {
            self.each_row(file, group, stretches, leaf, budget, &mut |into, _, row, values| {
                into.frames.push(whole(values, row, plan.frame.as_ref())?);
                Ok(())
            })?;
        }
        if let Some(leaf) = clock {
            self.each_row(file, group, stretches, leaf, budget, &mut |into, _, row, values| {
                let missing = || FormatProblem::Misfit {
                    found: format!("row {} has no time", row + 1),
                    needed: "one in each row".to_owned(),
                };
                into.clock.push(*values.first().filter(|value| value.is_finite()).ok_or_else(missing)?);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Calls `each` with each row of a column.
    fn each_row(
        &mut self,
        file: &Parquet<'_>,
        group: usize,
        stretches: &[Stretch],
        leaf: usize,
        budget: &Budget,
        each: EachRow<'_>,
    ) -> Result<(), FormatProblem> {
        let mut coming = stretches.iter();
        let mut now: Option<&Stretch> = None;
        file.each(group, leaf, budget, &mut |first, cells| {
            let mut row = 0;
            while row < cells.ends.len() {
                if now.is_none_or(|now| now.rows.end <= first + row) {
                    now = coming.next();
                }
                let Some(stretch) = now else { break };
                let into = self.all.entry(stretch.episode).or_default();
                let end = cells.ends.len().min(stretch.rows.end - first);
                for row in row..end {
                    each(into, stretch.at + first + row - stretch.rows.start, first + row, cells.row(row))?;
                }
                row = end;
            }
            Ok(ControlFlow::Continue(()))
        })
    }

    /// How many episodes and frames there are.
    pub fn counts(&self, channels: usize) -> (usize, usize) {
        (self.all.len(), self.all.values().map(|episode| episode.values.len() / channels.max(1)).sum())
    }

    /// The episodes in their order, each with its frames in theirs.
    pub fn tracks(self, plan: &Plan) -> Result<Vec<Track>, FormatProblem> {
        let (labelled, channels) = (plan.episode.is_some(), plan.channels.len());
        let track = |(number, mut episode): (i64, Episode)| {
            let name = if labelled { number.to_string() } else { "1".to_owned() };
            episode.sort(channels);
            if let Some(pair) = episode.frames.windows(2).find(|pair| pair[0] == pair[1]) {
                return Err(FormatProblem::Misfit {
                    found: format!("frame {} of episode {name} comes twice", pair[0]),
                    needed: "each frame once".to_owned(),
                });
            }
            if let Some(pair) = episode.frames.windows(2).find(|pair| pair[1].saturating_sub(pair[0]) > 1)
                && episode.clock.is_empty()
            {
                return Err(FormatProblem::Misfit {
                    found: format!("episode {name} lacks the frames between {} and {}", pair[0], pair[1]),
                    needed: "all frames, as steps are equally spaced".to_owned(),
                });
            }
            let times = episode.times(plan).ok_or_else(|| FormatProblem::Misfit {
                found: format!("the times of episode {name} are beyond all bounds"),
                needed: "seconds, or whole numbers of their parts".to_owned(),
            })?;
            Ok(Track { name, values: episode.values, times })
        };
        self.all.into_iter().map(track).collect()
    }
}

impl Episode {
    /// Nanoseconds, if the clock is needed.
    fn times(&self, plan: &Plan) -> Option<Vec<i64>> {
        let (Some(&first), Some((_, unit))) = (self.clock.first(), &plan.clock) else { return Some(Vec::new()) };
        match unit {
            // The difference first: it is exact where the times are large.
            Some(per_second) => self
                .clock
                .iter()
                .map(|time| Some(((time - first) / per_second * 1e9).round()).filter(|time| time.abs() < 9.2e18))
                .map(|time| time.map(|time| time as i64))
                .collect(),
            None => times::nanoseconds(&self.clock),
        }
    }

    /// Brings frames that stand in another order into the order of their numbers.
    fn sort(&mut self, channels: usize) {
        if self.frames.is_sorted() || channels == 0 {
            return;
        }
        let mut order: Vec<usize> = (0..self.frames.len()).collect();
        order.sort_by_key(|&row| self.frames[row]);
        let values = order.iter().flat_map(|&row| &self.values[row * channels..(row + 1) * channels]);
        self.values = values.copied().collect();
        if !self.clock.is_empty() {
            self.clock = order.iter().map(|&row| self.clock[row]).collect();
        }
        self.frames = order.iter().map(|&row| self.frames[row]).collect();
    }
}
