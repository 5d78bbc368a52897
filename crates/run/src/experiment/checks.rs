//! What the types of the experiment file cannot rule out. A complaint names its key, so that the reader can point at it.

use crate::members::MOST as MOST_MEMBERS;
use crate::memory::{complaint as complaint_about, product};

use super::{
    Adam, ClosedLoop, Data, Experiment, HeldOut, HeldOutDrawn, HeldOutFiles, Lbfgs, Momentum, Network, OptimiserName,
    Output, ScalingChoice, SkipName, TaskName, Training,
};

/// Most sequences and steps that a task is asked for, most units of a group, and the longest delay.
const MOST_SEQUENCES: usize = 1_000_000;
const MOST_STEPS: usize = 1_000_000_000;
const MOST_UNITS: usize = 1_000_000;
const MOST_DELAY: usize = 1_000_000;
const MOST_LAGS: usize = 100;

/// A value that will not do.
#[derive(Debug, PartialEq)]
pub struct Complaint {
    /// The parts of the key. A group is addressed by its name.
    pub path: Vec<String>,
    /// What is wrong.
    pub message: String,
    /// What would do.
    pub needed: String,
}

type Check = Result<(), Complaint>;

fn complaint(path: &[&str], message: impl Into<String>, needed: impl Into<String>) -> Check {
    let path = path.iter().map(|&part| part.to_owned()).collect();
    Err(Complaint { path, message: message.into(), needed: needed.into() })
}

/// Complains unless `ok`.
fn must(ok: bool, path: &[&str], found: impl std::fmt::Display, needed: &str) -> Check {
    if ok { Ok(()) } else { complaint(path, format!("`{}` is {found}", path.join(".")), needed) }
}

fn positive(path: &[&str], value: f64) -> Check {
    must(value > 0.0 && value.is_finite(), path, value, "a number above 0")
}

fn not_negative(path: &[&str], value: f64) -> Check {
    must(value >= 0.0 && value.is_finite(), path, value, "0 or a number above it")
}

/// Checks all values.
pub fn check(experiment: &Experiment) -> Check {
    let name = &experiment.name;
    let folder = !name.is_empty() && !name.contains(['/', '\\']) && name != "." && name != "..";
    must(folder, &["name"], format!("{name:?}"), "a name that a folder can have")?;
    check_data(&experiment.data)?;
    check_network(&experiment.network)?;
    let Training { momentum, adam, closed_loop, lbfgs, optimiser, .. } = &experiment.training;
    of_library(momentum.as_ref().map_or(Ok(()), Momentum::check))?;
    of_library(adam.as_ref().map_or(Ok(()), Adam::check))?;
    of_library(closed_loop.as_ref().map_or(Ok(()), ClosedLoop::check))?;
    if *optimiser == OptimiserName::Momentum {
        let path = ["network", "initial_state_variance"];
        must(
            experiment.network.initial_state_variance > 0.0,
            &path,
            0,
            "a number above 0 with momentum; 0 needs adam",
        )?;
        let path = ["training", "closed_loop"];
        must(closed_loop.is_none(), &path, "given with momentum", "optimiser = \"adam\"")?;
    }
    of_library(lbfgs.as_ref().map_or(Ok(()), Lbfgs::check))?;
    check_held_out(experiment)?;
    if let Some(members) = experiment.training.members {
        must((1..=MOST_MEMBERS).contains(&members), &["training", "members"], members, "1 to 100 networks")?;
    }
    check_output(&experiment.output)
}

fn check_data(data: &Data) -> Check {
    match (&data.task, &data.files) {
        (None, None) => {
            return complaint(
                &["data"],
                "there are no data to learn",
                "task = \"sinusoid\" (or \"lissajous\", \"limit-cycle\", \"reach\"), or files = [\"mine.csv\"]",
            );
        }
        (Some(_), Some(_)) => {
            return complaint(&["data", "files"], "both `task` and `files` are given", "one of the two");
        }
        (None, Some(files)) => {
            must(!files.is_empty(), &["data", "files"], "empty", "at least one file")?;
            let of_task = [
                ("sequences", data.sequences.is_some()),
                ("steps", data.steps.is_some()),
                ("seed", data.seed.is_some()),
            ];
            for (key, given) in of_task {
                if given {
                    return complaint(&["data", key], format!("`data.{key}` does not go with `files`"), "leave it out");
                }
            }
        }
        (Some(_), None) => {
            let of_files = [
                ("topic", data.topic.is_some()),
                ("topics", data.topics.is_some()),
                ("time", data.time.is_some()),
                ("arrays", data.arrays.is_some()),
                ("axes", data.axes.is_some()),
                ("unwrap", data.unwrap.is_some()),
                ("missing", data.missing.is_some()),
                ("period", data.period.is_some()),
                ("rest", data.rest.is_some()),
                ("channels", data.channels.is_some()),
            ];
            for (key, given) in of_files {
                if given {
                    return complaint(&["data", key], format!("`data.{key}` does not go with `task`"), "leave it out");
                }
            }
        }
    }
    if let Some(axes) = &data.axes
        && let Err(message) = axes.parse::<scrnn_data::Axes>()
    {
        return complaint(&["data", "axes"], message, "one letter for each axis, as \"nct\" or \"tc\"");
    }
    if let Some(rest) = data.rest {
        must((0.0..=10.0).contains(&rest), &["data", "rest"], rest, "a share of a sequence's length, from 0 to 10")?;
    }
    if let Some(period) = data.period {
        positive(&["data", "period"], period)?;
    }
    if let Some(channels) = &data.channels {
        let path = ["data", "channels"];
        must(!channels.is_empty(), &path, "empty", "at least one name")?;
        let twice = channels.iter().enumerate().find(|(index, name)| channels[..*index].contains(name));
        must(twice.is_none(), &path, "a list that names a channel twice", "each channel once")?;
    }
    if data.exact_positions.is_some() && data.task != Some(TaskName::Reach) {
        let message = "`data.exact_positions` is given without the task \"reach\"";
        return complaint(&["data", "exact_positions"], message, "leave it out");
    }
    if let Some(left) = data.left {
        if data.task != Some(TaskName::Interact) {
            return complaint(&["data", "left"], "`data.left` is given without the task \"interact\"", "leave it out");
        }
        must((0.0..=1.0).contains(&left), &["data", "left"], left, "a probability from 0 to 1")?;
    }
    must(data.sequences != Some(0), &["data", "sequences"], 0, "at least 1")?;
    must(data.steps != Some(0), &["data", "steps"], 0, "at least 1 more than the delay")?;
    let (sequences, steps) = (data.sequences.unwrap_or(1), data.steps.unwrap_or(1));
    must(sequences <= MOST_SEQUENCES, &["data", "sequences"], sequences, "at most 1e6")?;
    must(steps <= MOST_STEPS, &["data", "steps"], steps, "at most 1e9")?;
    if let Some(amounts) = complaint_about(product(&[sequences, steps, 2 * size_of::<f64>()])) {
        return complaint(&["data", "steps"], format!("{sequences} sequences of {steps} steps {amounts}"), "fewer");
    }
    let path = ["data", "scaling"];
    match &data.scaling {
        Some(ScalingChoice::Ranges(scaling)) => {
            for &(low, high) in &scaling.ranges {
                let found = format!("[{low}, {high}]");
                must(
                    low < high && low.is_finite() && high.is_finite(),
                    &path,
                    found,
                    "ranges [low, high] with low < high",
                )?;
            }
        }
        Some(ScalingChoice::Constants(scaling)) => {
            let equal = scaling.offset.len() == scaling.scale.len();
            must(equal, &path, "two lists of different lengths", "one offset and one scale for each channel")?;
            let fine = |value: &f64| value.is_finite() && *value != 0.0;
            must(scaling.scale.iter().all(fine), &path, "not usable", "scales that are finite and not 0")?;
            must(scaling.offset.iter().all(|value| value.is_finite()), &path, "not usable", "offsets that are finite")?;
        }
        Some(ScalingChoice::Named(_)) | None => {}
    }
    Ok(())
}

fn check_held_out(experiment: &Experiment) -> Check {
    let path = ["data", "held_out"];
    match &experiment.data.held_out {
        Some(HeldOut::Share(share) | HeldOut::Drawn(HeldOutDrawn { share, .. })) => {
            must(*share > 0.0 && *share < 1.0, &path, share, "a share above 0 and below 1, as 0.2")?;
        }
        Some(HeldOut::Names(names)) => must(!names.is_empty(), &path, "empty", "at least one name")?,
        Some(HeldOut::Files(HeldOutFiles { files })) => {
            must(!files.is_empty(), &path, "without a file", "at least one file")?;
            if experiment.data.task.is_some() {
                return complaint(&path, "files are held out of a `task`", "a share, as held_out = 0.2");
            }
        }
        None => {
            let without = "needs sequences that are held out";
            if experiment.training.patience.is_some() {
                let message = format!("`training.patience` {without}");
                return complaint(&["training", "patience"], message, "held_out = 0.2 in [data], or leave it out");
            }
            if experiment.evaluation.is_some() {
                let message = format!("`evaluation` {without}");
                return complaint(&["evaluation"], message, "held_out = 0.2 in [data], or leave it out");
            }
        }
    }
    must(experiment.training.patience != Some(0), &["training", "patience"], 0, "at least 1 evaluation")?;
    if let Some(evaluation) = &experiment.evaluation {
        must(evaluation.every != Some(0), &["evaluation", "every"], 0, "at least 1 epoch")?;
        let share = |key, value: f64| {
            must((0.0..1.0).contains(&value), &["evaluation", key], value, "a share from 0 to below 1")
        };
        share("burn_in", evaluation.burn_in)?;
        share("observed", evaluation.observed)?;
    }
    Ok(())
}

fn check_network(network: &Network) -> Check {
    must((1..=MOST_DELAY).contains(&network.delay), &["network", "delay"], network.delay, "1 to 1e6 steps")?;
    not_negative(&["network", "variance_floor"], network.variance_floor)?;
    not_negative(&["network", "initial_state_variance"], network.initial_state_variance)?;
    let path = ["network", "skip_damping"];
    if let Some(damping) = network.skip_damping {
        must(network.skip == SkipName::Extrapolation, &path, damping, "no such key without skip = \"extrapolation\"")?;
        must((0.0..=1.0).contains(&damping), &path, damping, "a number from 0 to 1")?;
    }
    let path = ["network", "skip_lags"];
    if let Some(lags) = network.skip_lags {
        must(network.skip == SkipName::Autoregressive, &path, lags, "no such key without skip = \"autoregressive\"")?;
        must((1..=MOST_LAGS).contains(&lags), &path, lags, "1 to 100 differences")?;
    }
    let groups = ["network", "groups"];
    must(!network.groups.is_empty(), &groups, "empty", "at least one group of context units")?;
    for (index, group) in network.groups.iter().enumerate() {
        let key = |key| ["network", "groups", group.name.as_str(), key];
        must(!group.name.is_empty(), &["network", "groups", "", "name"], "empty", "a name")?;
        let twice = network.groups[..index].iter().any(|other| other.name == group.name);
        must(!twice, &key("name"), format!("`{}` twice", group.name), "a name of its own for each group")?;
        must((1..=MOST_UNITS).contains(&group.units), &key("units"), group.units, "1 to 1e6 units")?;
        let tau = group.time_constant;
        must(tau >= 1.0 && tau.is_finite(), &key("time_constant"), tau, "a number of steps, at least 1")?;
    }
    // Weights, their gradient, the optimiser's two memories and the best network.
    let units: Vec<usize> = network.groups.iter().map(|group| group.units).collect();
    let all = units.iter().try_fold(0_usize, |sum, units| sum.checked_add(*units)).unwrap_or(usize::MAX);
    if let Some(amounts) = complaint_about(product(&[all, all, 5 * size_of::<f64>()])) {
        return complaint(&groups, format!("a network of {all} context units {amounts}"), "fewer units");
    }
    let driven = network.groups.iter().any(|group| group.drives_output);
    must(driven, &groups, "without a group that drives the outputs", "drives_output = true in one group")
}

/// What the library refuses, with its key in the experiment file.
fn of_library(checked: scrnn::error::Result<()>) -> Check {
    use scrnn::error::Error;
    match checked {
        Ok(()) => Ok(()),
        Err(Error::Setting { what, found, needed }) => {
            let path: Vec<&str> = std::iter::once("training").chain(what.split('.')).collect();
            must(false, &path, found, needed)
        }
        Err(other) => complaint(&["training"], other.to_string(), "settings that the library takes"),
    }
}

fn check_output(output: &Output) -> Check {
    must(output.checkpoint_every != Some(0), &["output", "checkpoint_every"], 0, "at least 1 epoch")?;
    must(output.history_every != Some(0), &["output", "history_every"], 0, "at least 1 epoch")?;
    not_negative(&["output", "checkpoint_seconds"], output.checkpoint_seconds)
}
