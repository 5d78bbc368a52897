//! Frames sorted into episodes.

use std::collections::BTreeMap;

use super::plan::Plan;
use crate::budget::Budget;
use crate::parquet::{Cells, Parquet};
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
        let widths: Vec<usize> = plan.taken().map(|feature| feature.width).collect();
        for group in 0..file.groups() {
            let cells = |leaf: Option<usize>| leaf.map(|leaf| file.cells(group, leaf, budget)).transpose();
            let (episode, frame) = (cells(episode)?, cells(frame)?);
            let clock = cells(clock)?;
            let features =
                features.iter().map(|&leaf| file.cells(group, leaf, budget)).collect::<Result<Vec<_>, _>>()?;
            let rows = file.rows(group)?;
            budget.take_values::<f64>(rows.saturating_mul(plan.channels.len() + 2))?;
            self.take_rows(rows, episode.as_ref(), frame.as_ref(), clock.as_ref(), &features, &widths, plan)?;
            for cells in [episode, frame, clock].into_iter().flatten().chain(features) {
                budget.give_back(cells.taken());
            }
        }
        Ok(())
    }

    #[expect(clippy::too_many_arguments, reason = "the columns of one group of rows, each of its own kind")]
    fn take_rows(
        &mut self,
        rows: usize,
        episode: Option<&Cells>,
        frame: Option<&Cells>,
        clock: Option<&Cells>,
        features: &[Cells],
        widths: &[usize],
        plan: &Plan,
    ) -> Result<(), FormatProblem> {
        let whole = |cells: &Cells, row: usize, name: Option<&String>| match *cells.row(row) {
            [value] if value.is_finite() => Ok(value as i64),
            _ => Err(FormatProblem::Misfit {
                found: format!("row {} has no value of {}", row + 1, name.map_or("", String::as_str)),
                needed: "one in each row".to_owned(),
            }),
        };
        let mut row = 0;
        while row < rows {
            // Rows of one episode stand together.
            let number = episode.map_or(Ok(0), |cells| whole(cells, row, plan.episode.as_ref()))?;
            let mut end = rows;
            if let Some(cells) = episode {
                end = row + 1;
                while end < rows && whole(cells, end, plan.episode.as_ref())? == number {
                    end += 1;
                }
            }
            let into = self.all.entry(number).or_default();
            // What grows by doubling holds up to three times what it needs; what grows row by row is copied for each.
            let more = (end - row).saturating_mul(plan.channels.len());
            if more > into.values.len() / 8 {
                into.values.reserve_exact(more);
                into.frames.reserve_exact(if frame.is_some() { end - row } else { 0 });
                into.clock.reserve_exact(if clock.is_some() { end - row } else { 0 });
            }
            while row < end {
                for ((cells, &width), feature) in features.iter().zip(widths).zip(plan.taken()) {
                    match cells.row(row) {
                        [] => into.values.extend(std::iter::repeat_n(f64::NAN, width)),
                        values if values.len() == width => into.values.extend(values),
                        values => {
                            return Err(FormatProblem::Misfit {
                                found: format!("row {} has {} values of {}", row + 1, values.len(), feature.name),
                                needed: format!("{width}, as the first row has"),
                            });
                        }
                    }
                }
                if let Some(cells) = frame {
                    into.frames.push(whole(cells, row, plan.frame.as_ref())?);
                }
                if let Some(cells) = clock {
                    let missing = || FormatProblem::Misfit {
                        found: format!("row {} has no time", row + 1),
                        needed: "one in each row".to_owned(),
                    };
                    let value = cells.row(row).first().filter(|value| value.is_finite()).ok_or_else(missing)?;
                    into.clock.push(*value);
                }
                row += 1;
            }
        }
        Ok(())
    }

    /// How many episodes and frames there are.
    pub fn counts(&self) -> (usize, usize) {
        (self.all.len(), self.all.values().map(|episode| episode.frames.len()).sum())
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
