//! Which columns of a parquet table are channels, which tell episodes and times, and which are left out.

use std::ops::ControlFlow;

use crate::budget::Budget;
use crate::parquet::Parquet;
use crate::problem::FormatProblem;
use crate::reading::Topic;
use crate::source::Source;
use crate::{FileError, Remark, Selection};

use super::info::Info;

/// What is taken if nothing is asked for, where it is there.
const MAIN: [&str; 2] = ["observation.state", "action"];
/// Columns that tell the episode.
const EPISODE: [&str; 8] =
    ["episode_index", "episode", "episode_id", "traj_id", "trajectory", "demo", "trial", "sequence"];
/// Columns that count frames within an episode.
const FRAME: [&str; 3] = ["frame_index", "frame", "step"];
/// Columns that tell the time.
const CLOCK: [&str; 4] = ["timestamp", "time", "t", "stamp"];
/// Other columns that only count, or tell how an episode went.
const NOTHING: [&str; 9] = [
    "index",
    "task_index",
    "subtask_index",
    "__index_level_0__",
    "next.done",
    "next.reward",
    "next.success",
    "next.truncated",
    "seq",
];

/// A column, or a column of lists, that holds numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Feature {
    /// Its name.
    pub name: String,
    /// Values in each frame.
    pub width: usize,
    /// The channels' names.
    pub channels: Vec<String>,
    kind: String,
    taken: bool,
}

/// What is taken from a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    features: Vec<Feature>,
    /// The column that tells the episode.
    pub episode: Option<String>,
    /// The column that counts frames.
    pub frame: Option<String>,
    /// The column that tells the time, if nothing else does, and its values in a second where its type tells them.
    pub clock: Option<(String, Option<f64>)>,
    /// Seconds between frames, if the data set says so.
    pub period: Option<f64>,
    /// Names of the channels that are taken.
    pub channels: Vec<String>,
    /// Whether it looks like one of LeRobot's tables.
    pub is_lerobot: bool,
    left_out: Vec<String>,
}

impl Plan {
    /// Looks at the first file of a data set.
    pub fn new(
        file: &Parquet<'_>,
        info: Option<&Info>,
        selection: &Selection,
        source: &Source<'_>,
    ) -> Result<Self, FileError> {
        let at = |problem: FormatProblem| problem.at(source.name());
        let asked =
            |name: &str| selection.channels.iter().flatten().chain(&selection.arrays).any(|asked| asked == name);
        let numeric = |name: &&&str| file.leaf(name).is_some_and(|leaf| file.leaves[leaf].is_numeric());
        let first = |names: &[&str]| names.iter().find(numeric).map(|name| (*name).to_owned());
        let (episode, frame) = (first(&EPISODE), first(&FRAME));
        let is_lerobot = file.leaf("episode_index").is_some() && file.leaf("frame_index").is_some();
        let period = info.and_then(Info::period);
        let clock = first(&CLOCK).map(|name| {
            let per_second = file.leaf(&name).and_then(|leaf| file.leaves[leaf].per_second);
            (name, per_second)
        });
        let is_special = |name: &str| {
            !asked(name)
                && ([&episode, &frame].into_iter().flatten().any(|special| special == name)
                    || clock.as_ref().is_some_and(|(clock, _)| clock == name)
                    || NOTHING.contains(&name))
        };
        let mut features = Vec::new();
        let mut left_out = Vec::new();
        for (index, leaf) in file.leaves.iter().enumerate() {
            if is_special(&leaf.name) {
                continue;
            }
            if !leaf.is_numeric() {
                left_out.push(leaf.name.clone());
                continue;
            }
            let about = info.and_then(|info| info.feature(&leaf.name));
            let width = if leaf.lists == 0 { 1 } else { width(file, index, source.budget()).map_err(at)? };
            source.budget().take(width.saturating_mul(leaf.name.len() + 48)).map_err(|problem| at(problem.into()))?;
            let channels = match about.and_then(|about| about.names(width)) {
                Some(names) if width > 1 || names[0] != leaf.name => {
                    names.iter().map(|name| format!("{}.{name}", leaf.name)).collect()
                }
                _ if leaf.lists == 0 => vec![leaf.name.clone()],
                _ => (0..width).map(|index| format!("{}.{index}", leaf.name)).collect(),
            };
            let kind = about.map_or_else(|| format!("{:?}", leaf.physical).to_lowercase(), |about| about.dtype.clone());
            features.push(Feature { name: leaf.name.clone(), width, channels, kind, taken: false });
        }
        let mut plan = Self { features, episode, frame, clock, period, channels: Vec::new(), is_lerobot, left_out };
        plan.choose(selection, source.name())?;
        if plan.period.is_some() {
            plan.clock = None;
        }
        Ok(plan)
    }

    /// Decides which features are taken.
    fn choose(&mut self, selection: &Selection, path: &str) -> Result<(), FileError> {
        let all = || self.features.iter().map(|feature| feature.name.as_str()).collect::<Vec<_>>().join(", ");
        if let Some(found) =
            selection.arrays.iter().find(|name| !self.features.iter().any(|feature| feature.name == **name))
        {
            return Err(FormatProblem::NoSuch { what: "feature", found: found.clone(), there: all() }.at(path));
        }
        let has = |feature: &Feature, name: &String| feature.channels.contains(name);
        let wanted = selection.channels.as_deref().unwrap_or_default();
        if let Some(found) = wanted.iter().find(|name| !self.features.iter().any(|feature| has(feature, name))) {
            let channels = self.features.iter().flat_map(|feature| &feature.channels);
            let channels = channels.map(String::as_str).collect::<Vec<_>>().join(", ");
            return Err(FileError::NoSuchChannel { path: path.to_owned(), found: found.clone(), channels });
        }
        let some_main = self.features.iter().any(|feature| MAIN.contains(&feature.name.as_str()));
        for feature in &mut self.features {
            feature.taken = if !wanted.is_empty() {
                wanted.iter().any(|name| has(feature, name))
            } else if !selection.arrays.is_empty() {
                selection.arrays.contains(&feature.name)
            } else {
                !some_main || MAIN.contains(&feature.name.as_str())
            };
        }
        let order = |name: &str| {
            let list = selection.arrays.iter().position(|array| array == name);
            list.or_else(|| MAIN.iter().position(|main| *main == name)).unwrap_or(usize::MAX)
        };
        self.features.sort_by_key(|feature| order(&feature.name));
        self.channels = self.taken().flat_map(|feature| feature.channels.iter().cloned()).collect();
        Ok(())
    }

    /// The features that are taken, in the order of their channels.
    pub fn taken(&self) -> impl Iterator<Item = &Feature> {
        self.features.iter().filter(|feature| feature.taken)
    }

    /// What told the time.
    pub fn clock_name(&self) -> Option<String> {
        let clock = self.clock.as_ref().map(|(name, _)| name.clone());
        clock.or_else(|| self.period.map(|_| "fps".to_owned()))
    }

    /// What is worth saying.
    pub fn remarks(&self) -> Vec<Remark> {
        let names = |taken: bool| {
            let features = self.features.iter().filter(|feature| feature.taken == taken);
            features.map(|feature| feature.name.as_str()).collect::<Vec<_>>().join(", ")
        };
        let mut remarks = Vec::new();
        if self.features.iter().any(|feature| !feature.taken) {
            remarks.push(Remark::Chosen { taken: names(true), others: names(false) });
        }
        let left_out = self
            .left_out
            .iter()
            .map(|column| Remark::LeftOut { column: column.clone(), what: "no numbers".to_owned() });
        remarks.extend(left_out);
        remarks
    }

    /// All features, for those who look.
    pub fn topics(&self, count: usize) -> Vec<Topic> {
        let topic = |feature: &Feature| {
            let of =
                if feature.width == 1 { feature.kind.clone() } else { format!("{} x {}", feature.width, feature.kind) };
            Topic { name: feature.name.clone(), of, count, taken: feature.taken, ..Topic::default() }
        };
        self.features.iter().map(topic).collect()
    }
}

/// Values in the first list of a column that has any.
fn width(file: &Parquet<'_>, leaf: usize, budget: &Budget) -> Result<usize, FormatProblem> {
    let mut found = None;
    for group in 0..file.groups() {
        file.each(group, leaf, budget, &mut |_, cells| {
            found = (0..cells.ends.len()).map(|row| cells.row(row).len()).find(|&width| width > 0);
            Ok(if found.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })?;
        if let Some(width) = found {
            return Ok(width);
        }
    }
    Ok(0)
}
