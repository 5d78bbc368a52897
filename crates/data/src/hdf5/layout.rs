//! What the data sets of a file are: demonstrations, one recording, or sequences in one array.

use std::collections::BTreeMap;

use super::dataset::{Attribute, attribute};
use super::file::File;
use super::object::Object;
use super::{Contents, Found};
use crate::problem::FormatProblem;
use crate::reading::{Facts, Topic};
use crate::samples::{Samples, Track, split_off};
use crate::{Remark, Selection, natural, times};

/// Beginnings of the names of groups of which each is a demonstration, also if there is only one.
const DEMO: [&str; 15] = [
    "demo_",
    "demo",
    "episode_",
    "episode",
    "ep_",
    "traj_",
    "trajectory_",
    "trial_",
    "trial",
    "rollout_",
    "run_",
    "recording_",
    "session_",
    "sequence_",
    "take_",
];
/// What parts of one robot or one set of sensors are called: groups that differ by a number, but stand side by side.
const PARTS: [&str; 14] = [
    "joint", "arm", "leg", "finger", "hand", "robot", "link", "motor", "sensor", "imu", "marker", "camera", "cam",
    "channel",
];
/// Groups in groups that demonstrations are looked for in.
const DEEPEST: usize = 6;
/// Ends of the names of what a robot's state is; taken with the actions, where they are there, if nothing is asked for.
const STATE: [&str; 6] = ["joint_pos", "qpos", "joint_positions", "joint_position", "proprio", "observation.state"];
const ACTION: [&str; 2] = ["action", "actions"];
/// Data sets that only count, or tell how a demonstration went, and copies of others.
const NOTHING: [&str; 12] = [
    "rewards",
    "reward",
    "dones",
    "done",
    "terminals",
    "timeouts",
    "states",
    "is_first",
    "is_last",
    "is_terminal",
    "episode_index",
    "frame_index",
];
/// Data sets that are not zero at the last step of an episode.
const LAST: [&str; 4] = ["terminals", "timeouts", "dones", "is_last"];
const CLOCK: [&str; 5] = ["timestamp", "timestamps", "time", "times", "t"];

/// A sequence: its name, and its data sets by the names that they share with those of the others.
struct Demo<'c> {
    name: String,
    members: BTreeMap<&'c str, &'c Found>,
}

fn last(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// Whether a data set can be channels: numbers along one axis of steps, and perhaps one of channels.
fn is_series(found: &Found) -> bool {
    let lengths = found.about.shape.as_deref().unwrap_or_default();
    found.about.kind.is_numeric() && matches!(lengths.len(), 1 | 2) && !lengths.contains(&0)
}

fn shape(found: &Found) -> String {
    match &found.about.shape {
        Some(lengths) if !lengths.is_empty() => lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(" x "),
        _ => "1".to_owned(),
    }
}

/// `path (shape)` of all data sets that could be meant, but not of too many.
fn listed<'c>(data_sets: impl Iterator<Item = &'c Found>) -> String {
    let all: Vec<String> = data_sets.map(|found| format!("{} ({})", found.path, shape(found))).collect();
    if all.len() <= 12 { all.join(", ") } else { format!("{}, ... ({} in all)", all[..12].join(", "), all.len()) }
}

/// Makes sequences of what was found.
pub fn samples(file: &File<'_>, contents: &Contents, selection: &Selection) -> Result<Samples, FormatProblem> {
    let wanted: Vec<&str> = selection.arrays.iter().map(|path| path.trim_matches('/')).collect();
    let demos = demos(contents);
    let by_path = |path: &str| contents.data_sets.iter().find(|found| found.path == path);
    let within = |path: &str| demos.iter().any(|demo| demo.members.contains_key(path));
    let mut samples = if wanted.is_empty() && demos.is_empty() {
        recording(file, contents, selection)?
    } else if !demos.is_empty() && wanted.iter().all(|path| within(path)) {
        demonstrations(file, contents, &demos, &wanted, selection)?
    } else {
        let found = wanted.iter().map(|path| {
            by_path(path).ok_or_else(|| FormatProblem::NoSuch {
                what: "data set",
                found: (*path).to_owned(),
                there: listed(contents.data_sets.iter().filter(|found| is_series(found))),
            })
        });
        of_data_sets(file, contents, &found.collect::<Result<Vec<_>, _>>()?, selection)?
    };
    samples.period = period(file);
    samples.facts = Facts { named: true, clock: samples.facts.clock.take(), ..Facts::default() };
    samples.facts.topics = topics(contents, &demos, &samples.channels);
    Ok(samples)
}

/// Groups by their names, and what is in each by the path within it.
type Children<'c> = BTreeMap<&'c str, BTreeMap<&'c str, &'c Found>>;

/// The groups of which each is a demonstration, in natural order: siblings whose names differ by a number, or are dates.
fn demos(contents: &Contents) -> Vec<Demo<'_>> {
    let mut prefixes = vec!["data/", ""];
    // Further down, siblings may as well be parts of one robot: only what is called so, or differs in length, is told apart.
    let mut deeper: Vec<&str> =
        contents.data_sets.iter().filter(|found| is_series(found)).flat_map(prefixes_of).collect();
    deeper.sort_by_key(|prefix| (prefix.matches('/').count(), *prefix));
    deeper.dedup();
    prefixes.extend(deeper.into_iter().filter(|prefix| *prefix != "data/"));
    for (index, prefix) in prefixes.into_iter().enumerate() {
        let Some((stem, children)) = family(contents, prefix) else { continue };
        let (called_so, is_part) = (is_demo(stem), is_part(stem));
        let several = children.len() > 1;
        let are_demos = match (prefix, index) {
            ("data/", _) => true,
            ("", _) => several && (!is_part || differ_in_length(&children)) || called_so,
            _ => several && (called_so || stem.is_empty() || differ_in_length(&children)),
        };
        if are_demos {
            let demo = |(name, members): (&str, _)| Demo { name: name.to_owned(), members };
            let mut demos: Vec<Demo<'_>> = children.into_iter().map(demo).collect();
            demos.sort_by(|a, b| natural(&a.name, &b.name));
            return demos;
        }
    }
    Vec::new()
}

/// The groups around a data set, from the outermost, but for the root and its own.
fn prefixes_of(found: &Found) -> impl Iterator<Item = &str> {
    let slashes: Vec<usize> = found.path.match_indices('/').map(|(at, _)| at).take(DEEPEST).collect();
    let count = slashes.len().saturating_sub(1);
    slashes.into_iter().take(count).map(|at| &found.path[..=at])
}

/// The family of groups in a group that is called so, or else the largest, and what their names have in common.
fn family<'c>(contents: &'c Contents, prefix: &str) -> Option<(&'c str, Children<'c>)> {
    let mut families: BTreeMap<&str, Children<'_>> = BTreeMap::new();
    for found in contents.data_sets.iter().filter(|found| is_series(found)) {
        let Some((child, member)) = found.path.strip_prefix(prefix).and_then(|rest| rest.split_once('/')) else {
            continue;
        };
        // A date, or a number alone.
        let is_date = child.bytes().all(|b| b.is_ascii_digit() || b"-_:. TZ".contains(&b));
        let stem = if is_date { "" } else { child.trim_end_matches(|c: char| c.is_ascii_digit()) };
        if stem.len() < child.len() {
            families.entry(stem).or_default().entry(child).or_default().insert(member, found);
        }
    }
    families.into_iter().max_by_key(|(stem, children)| (is_demo(stem), !is_part(stem), children.len()))
}

fn is_demo(stem: &str) -> bool {
    DEMO.contains(&stem.to_lowercase().as_str())
}

fn is_part(stem: &str) -> bool {
    PARTS.contains(&stem.trim_end_matches(['_', '-']).to_lowercase().as_str())
}

/// Whether something that all of them have has other lengths in some: parts of one recording have one.
fn differ_in_length(children: &Children<'_>) -> bool {
    let steps = |found: &Found| found.about.shape.as_deref().and_then(|shape| shape.first()).copied();
    let Some(first) = children.values().next() else { return false };
    children.values().any(|members| {
        first.iter().any(|(path, found)| members.get(path).is_some_and(|other| steps(other) != steps(found)))
    })
}

/// What is taken of several data sets of one recording if nothing is asked for.
fn chosen<'p>(paths: &[&'p str]) -> Vec<&'p str> {
    // The rows' and columns' names of a table of pandas, beside its blocks.
    let is_index = |path: &str| {
        let group = path.strip_suffix("axis0").or_else(|| path.strip_suffix("axis1"));
        group.is_some_and(|group| paths.iter().any(|other| other.strip_prefix(group) == Some("block0_values")))
    };
    let ends = |path: &str, ends: &[&str]| {
        let name = last(path);
        ends.iter().any(|end| name == *end || name.ends_with(&format!("_{end}")))
    };
    let useful = |path: &&&str| {
        let name = last(path);
        !NOTHING.contains(&name) && !CLOCK.contains(&name) && !path.starts_with("next_obs") && !is_index(path)
    };
    let useful: Vec<&str> = paths.iter().filter(useful).copied().collect();
    let state = useful.iter().filter(|path| ends(path, &STATE));
    let action = useful.iter().filter(|path| ACTION.contains(path));
    let main: Vec<&str> = state.chain(action).copied().collect();
    if main.iter().any(|path| ends(path, &STATE)) { main } else { useful }
}

fn demonstrations(
    file: &File<'_>,
    contents: &Contents,
    demos: &[Demo<'_>],
    wanted: &[&str],
    selection: &Selection,
) -> Result<Samples, FormatProblem> {
    let first = &demos[0];
    let all: Vec<&str> = first.members.keys().copied().collect();
    let everywhere: Vec<&str> =
        all.iter().copied().filter(|path| demos.iter().all(|demo| demo.members.contains_key(path))).collect();
    let asked = asked_for(&everywhere, selection);
    let taken = if !wanted.is_empty() { wanted.to_vec() } else { chosen(&everywhere) };
    let taken = asked.unwrap_or(taken);
    if taken.is_empty() {
        return Err(FormatProblem::NoSamples {
            why: format!("{} and {} have no numbers in common", first.name, demos[demos.len() - 1].name),
        });
    }
    let mut samples = Samples::default();
    for demo in demos {
        let parts = taken.iter().map(|path| {
            let found = demo.members.get(path).copied();
            found.map(|found| (*path, found)).ok_or_else(|| FormatProblem::Misfit {
                found: format!("{} has no {path}", demo.name),
                needed: format!("the same data sets as {} has", first.name),
            })
        });
        let parts = parts.collect::<Result<Vec<_>, _>>()?;
        let clock = demo.members.iter().find(|(path, _)| CLOCK.contains(&last(path)) && !taken.contains(path));
        let track = track(file, contents, &demo.name, &parts, clock.map(|(_, found)| *found), &mut samples)?;
        samples.tracks.push(track);
    }
    note_others(&mut samples, &taken, &everywhere);
    Ok(samples)
}

/// Paths of the data sets that hold the channels that are asked for by name.
fn asked_for<'p>(paths: &[&'p str], selection: &Selection) -> Option<Vec<&'p str>> {
    let channels = selection.channels.as_ref()?;
    let of = |channel: &String| {
        let number = channel.rsplit_once('.').filter(|(_, number)| number.bytes().all(|b| b.is_ascii_digit()));
        paths.iter().copied().find(|path| *path == channel || number.is_some_and(|(of, _)| of == *path))
    };
    let mut taken = channels.iter().map(of).collect::<Option<Vec<_>>>()?;
    taken.sort_unstable();
    taken.dedup();
    Some(taken)
}

/// A file without demonstrations.
fn recording(file: &File<'_>, contents: &Contents, selection: &Selection) -> Result<Samples, FormatProblem> {
    let series: Vec<&Found> = contents.data_sets.iter().filter(|found| is_series(found)).collect();
    let paths: Vec<&str> = series.iter().map(|found| found.path.as_str()).collect();
    let taken = asked_for(&paths, selection).unwrap_or_else(|| chosen(&paths));
    let data_sets: Vec<&Found> =
        taken.iter().filter_map(|path| series.iter().find(|found| found.path == *path)).copied().collect();
    if data_sets.is_empty() {
        let three =
            |found: &&Found| found.about.kind.is_numeric() && found.about.shape.as_ref().is_some_and(|s| s.len() == 3);
        let blocks: Vec<&Found> = contents.data_sets.iter().filter(three).collect();
        return match blocks.as_slice() {
            [only] => of_data_sets(file, contents, &[*only], selection),
            [] => Err(FormatProblem::NoSamples {
                why: match listed(contents.data_sets.iter()) {
                    there if there.is_empty() => "there is no data set in it".to_owned(),
                    there => format!("its data sets are {there}"),
                },
            }),
            several => Err(choose(several.iter().copied())),
        };
    }
    let steps = |found: &Found| found.about.shape.as_deref().and_then(|shape| shape.first()).copied();
    if let Some(other) = data_sets.iter().find(|other| steps(other) != steps(data_sets[0])) {
        // One of them alone may have been meant; nobody can tell.
        return Err(choose(data_sets.iter().copied().chain(std::iter::once(*other)).take(data_sets.len())));
    }
    let mut samples = of_data_sets(file, contents, &data_sets, selection)?;
    note_others(&mut samples, &taken, &paths);
    Ok(samples)
}

fn choose<'c>(data_sets: impl Iterator<Item = &'c Found> + Clone) -> FormatProblem {
    let one = data_sets.clone().next().map_or("", |found| found.path.as_str());
    FormatProblem::Choose {
        what: "data sets",
        there: listed(data_sets.clone()),
        help: format!("`arrays = [\"{one}\"]` takes it; several of one length stand side by side"),
    }
}

fn note_others(samples: &mut Samples, taken: &[&str], there: &[&str]) {
    let others: Vec<&str> = there.iter().copied().filter(|path| !taken.contains(path)).collect();
    if !others.is_empty() {
        samples.remarks.push(Remark::Chosen { taken: taken.join(", "), others: others.join(", ") });
    }
}

/// Data sets side by side as one recording, or the sequences in one of three axes.
fn of_data_sets(
    file: &File<'_>,
    contents: &Contents,
    data_sets: &[&Found],
    selection: &Selection,
) -> Result<Samples, FormatProblem> {
    if let [only] = data_sets
        && (selection.axes.is_some() || !is_series(only) || wide(only))
    {
        return array(file, contents, only, selection);
    }
    let mut samples = Samples::default();
    let parts: Vec<(&str, &Found)> = data_sets.iter().map(|found| (found.path.as_str(), *found)).collect();
    if let Some(found) = data_sets.iter().find(|found| !is_series(found)) {
        return Err(FormatProblem::Misfit {
            found: format!("{} is {} {}", found.path, shape(found), found.about.kind.name()),
            needed: "numbers, steps x channels, to stand beside other data sets".to_owned(),
        });
    }
    let steps = data_sets[0].about.shape.as_deref().unwrap_or_default().first().copied();
    let beside = |names: &'static [&str]| {
        contents.data_sets.iter().filter(move |found| {
            let alike = found
                .about
                .shape
                .as_ref()
                .is_some_and(|shape| Some(shape.as_slice()) == steps.as_ref().map(std::slice::from_ref));
            names.contains(&last(&found.path)) && is_series(found) && alike
        })
    };
    let is_taken = |found: &&Found| !data_sets.iter().any(|taken| taken.path == found.path);
    let clock = beside(&CLOCK).find(is_taken);
    let track = track(file, contents, "1", &parts, clock, &mut samples)?;
    // Where an episode ends, another begins.
    let mut ends = Vec::new();
    for found in beside(&LAST).filter(is_taken) {
        let flags = contents.numbers(file, found)?;
        ends.extend(flags.iter().enumerate().filter(|(_, flag)| **flag != 0.0).map(|(step, _)| step + 1));
        if !ends.is_empty() {
            samples.facts.clock = samples.facts.clock.take();
        }
    }
    ends.extend(steps);
    ends.sort_unstable();
    ends.dedup();
    if ends.len() > 1 {
        samples.remarks.push(Remark::Label {
            column: beside(&LAST).map(|found| found.path.as_str()).collect::<Vec<_>>().join(", "),
            sequences: ends.len(),
        });
    }
    let channels = samples.channels.len();
    // From the last to the first, so that what is left goes on as it is.
    let Track { mut values, mut times, .. } = track;
    ends.pop();
    for (number, from) in ends.iter().enumerate().rev() {
        let values = split_off(&mut values, from * channels);
        let times = times.split_off((*from).min(times.len()));
        samples.tracks.push(Track { name: (number + 2).to_string(), values, times });
    }
    samples.tracks.push(Track { name: "1".to_owned(), values, times });
    samples.tracks.reverse();
    Ok(samples)
}

/// Whether an array has more columns than rows: its axes may be the other way round.
fn wide(found: &Found) -> bool {
    matches!(found.about.shape.as_deref(), Some([steps, channels]) if channels > steps && *steps > 1)
}

/// One array by itself, whose axes may be told.
fn array(file: &File<'_>, contents: &Contents, found: &Found, selection: &Selection) -> Result<Samples, FormatProblem> {
    let lengths = found.about.shape.as_deref().unwrap_or_default();
    let unfit = |needed: String| FormatProblem::Misfit {
        found: format!("{} is {} {}", found.path, shape(found), found.about.kind.name()),
        needed,
    };
    if !found.about.kind.is_numeric() || !(1..=3).contains(&lengths.len()) || lengths.contains(&0) {
        return Err(unfit("numbers along one, two or three axes".to_owned()));
    }
    if file.is_matlab && lengths.len() > 2 {
        return Err(unfit("in a MATLAB file, matrices of steps x channels".to_owned()));
    }
    let numbers = contents.numbers(file, found)?;
    if let ([n, t, c], None) = (lengths, selection.axes)
        && t >= c
        && crate::arrays::first_is_time(*n, *t, *c, &numbers)
    {
        return Err(FormatProblem::Choose {
            what: "axes",
            there: format!(
                "{} of {}, whose values go on along the first axis, as steps do: it may be {n} steps of {} channels",
                shape(found),
                found.path,
                t * c
            ),
            help: format!(
                "if so, save it as {n} x {}, in h5py by `f[\"flat\"] = f[\"{}\"][:].reshape({n}, -1)`; if it is {n} sequences, \
                 say `axes = \"ntc\"`",
                t * c,
                found.path
            ),
        });
    }
    let axes = match selection.axes {
        Some(axes) if axes.count() != lengths.len() => {
            return Err(unfit(format!("{} axes, as in `{axes}`", axes.count())));
        }
        Some(axes) => axes,
        None => {
            let (steps, channels) = (lengths[lengths.len().saturating_sub(2)], lengths[lengths.len() - 1]);
            if lengths.len() > 1 && channels > steps {
                let turned = if lengths.len() == 2 { "ct" } else { "nct" };
                let straight = if lengths.len() == 2 { "tc" } else { "ntc" };
                return Err(FormatProblem::Choose {
                    what: "axes",
                    there: format!(
                        "{} of {}, which would be {channels} channels of {steps} steps",
                        shape(found),
                        found.path
                    ),
                    help: format!(
                        "`axes = \"{turned}\"` if steps come last, `axes = \"{straight}\"` if it is as it stands"
                    ),
                });
            }
            let sequences = (lengths.len() == 3).then_some(0);
            let steps = usize::from(lengths.len() == 3);
            crate::Axes { sequences, steps, channels: (lengths.len() > 1).then_some(lengths.len() - 1) }
        }
    };
    let mut strides = vec![1; lengths.len()];
    for axis in (1..lengths.len()).rev() {
        strides[axis - 1] = strides[axis] * lengths[axis];
    }
    let along = |axis: Option<usize>| axis.map_or((1, 0), |axis| (lengths[axis], strides[axis]));
    let ((sequences, next_sequence), (steps, next_step), (channels, next_channel)) =
        (along(axes.sequences), along(Some(axes.steps)), along(axes.channels));
    file.budget.take_values::<f64>(numbers.len())?;
    let tracks = (0..sequences).map(|n| {
        let values =
            (0..steps).flat_map(|t| (0..channels).map(move |c| n * next_sequence + t * next_step + c * next_channel));
        Track { name: (n + 1).to_string(), values: values.map(|index| numbers[index]).collect(), times: Vec::new() }
    });
    let tracks = tracks.collect();
    let channels = names(file, &found.path, axes.channels.map(|_| channels))?;
    Ok(Samples { channels, tracks, ..Samples::default() })
}

/// The channels of a data set: its path, and their numbers if it has an axis of several.
fn names(file: &File<'_>, path: &str, channels: Option<usize>) -> Result<Vec<String>, FormatProblem> {
    file.budget.take(channels.unwrap_or(1).saturating_mul(path.len() + 48))?;
    Ok(match channels {
        None | Some(1) => vec![path.to_owned()],
        Some(channels) => (0..channels).map(|channel| format!("{path}.{channel}")).collect(),
    })
}

/// Data sets side by side. Names the channels in `samples`, or holds them to those that are named.
fn track(
    file: &File<'_>,
    contents: &Contents,
    name: &str,
    parts: &[(&str, &Found)],
    clock: Option<&Found>,
    samples: &mut Samples,
) -> Result<Track, FormatProblem> {
    let lengths = |found: &Found| {
        let shape = found.about.shape.as_deref().unwrap_or_default();
        (shape.first().copied().unwrap_or(0), shape.get(1).copied())
    };
    let (first_path, first) = parts[0];
    // Of a state there is often one more than of actions: what came of the last.
    let (least, most) = parts
        .iter()
        .fold((usize::MAX, 0), |(least, most), (_, found)| (least.min(lengths(found).0), most.max(lengths(found).0)));
    let one_more = most == least.saturating_add(1) && least > 1;
    let steps = if one_more { least } else { lengths(first).0 };
    if one_more && samples.tracks.is_empty() {
        let longer = parts.iter().filter(|(_, found)| lengths(found).0 == most).map(|(path, _)| *path);
        let what = format!(
            "{} has one step more than the other data sets: its last step was left out",
            longer.collect::<Vec<_>>().join(", ")
        );
        samples.remarks.push(Remark::Understood { what });
    }
    let mut channels = Vec::new();
    for (path, found) in parts {
        if lengths(found).0 != steps && !one_more {
            return Err(FormatProblem::Misfit {
                found: format!("in {name}, {first_path} has {steps} steps, {path} {}", lengths(found).0),
                needed: "data sets of one length, to stand side by side; `arrays = [...]` chooses".to_owned(),
            });
        }
        let width = lengths(found).1;
        channels.extend(names(file, path, width)?);
    }
    if samples.channels.is_empty() {
        samples.channels = channels;
    } else if samples.channels != channels {
        return Err(FormatProblem::Misfit {
            found: format!("{name} has {} channels", channels.len()),
            needed: format!("the same {} channels as the first demonstration", samples.channels.len()),
        });
    }
    let width = samples.channels.len();
    let values = match parts {
        // Nothing to copy.
        [(_, only)] => contents.numbers(file, only)?,
        parts => {
            let mut values = file.budget.vec(steps.saturating_mul(width))?;
            values.resize(steps * width, 0.0);
            let mut column = 0;
            for (_, found) in parts {
                let wide = lengths(found).1.unwrap_or(1);
                let numbers = contents.numbers(file, found)?;
                for (row, part) in values.chunks_exact_mut(width).zip(numbers.chunks_exact(wide)) {
                    row[column..column + wide].copy_from_slice(part);
                }
                file.budget.give_back(numbers.len() * size_of::<f64>());
                column += wide;
            }
            values
        }
    };
    let mut times = Vec::new();
    let fits = |clock: &&Found| lengths(clock) == (steps, None) || one_more && lengths(clock) == (most, None);
    if let Some(clock) = clock.filter(fits) {
        let mut numbers = contents.numbers(file, clock)?;
        numbers.truncate(steps);
        if let Some(read) = times::nanoseconds(&numbers) {
            times = read;
            samples.facts.clock = Some(clock.path.clone());
        }
    }
    Ok(Track { name: name.to_owned(), values, times })
}

/// Seconds between samples, where an attribute of the root or of `data` tells.
fn period(file: &File<'_>) -> Option<f64> {
    let root = Object::read(file, file.root).ok()?;
    let data = super::links(file, &root).ok()?.into_iter().find(|link| link.name == "data");
    let data = data.and_then(|link| Object::read(file, link.address).ok());
    let rate = [Some(&root), data.as_ref()].into_iter().flatten().find_map(|object| {
        let number = |name: &str| match attribute(file, object, name) {
            Some(Attribute::Number(rate)) => Some(rate),
            _ => None,
        };
        // robomimic keeps what made the environment as JSON.
        let from_json = || match attribute(file, object, "env_args") {
            Some(Attribute::Text(text)) if text.len() < 1 << 20 => {
                let json: serde_json::Value = serde_json::from_str(&text).ok()?;
                json.get("env_kwargs")?.get("control_freq")?.as_f64()
            }
            _ => None,
        };
        ["fps", "control_freq", "sampling_rate", "rate_hz", "hz"].into_iter().find_map(number).or_else(from_json)
    });
    rate.filter(|rate| rate.is_finite() && *rate > 0.0).map(|rate| 1.0 / rate)
}

/// The data sets, for those who look: of demonstrations those of the first.
fn topics(contents: &Contents, demos: &[Demo<'_>], channels: &[String]) -> Vec<Topic> {
    let topic = |name: &str, found: &Found| {
        let lengths = found.about.shape.as_deref().unwrap_or_default();
        let taken = channels.iter().any(|channel| {
            channel == name
                || channel
                    .strip_prefix(name)
                    .is_some_and(|rest| rest.starts_with('.') && rest[1..].bytes().all(|b| b.is_ascii_digit()))
        });
        let of = format!("{} {}", shape(found), found.about.kind.name());
        Topic { name: name.to_owned(), of, count: lengths.first().copied().unwrap_or(1), taken, ..Topic::default() }
    };
    match demos.first() {
        Some(demo) => demo.members.iter().map(|(name, found)| topic(name, found)).collect(),
        None => contents.data_sets.iter().map(|found| topic(&found.path, found)).collect(),
    }
}
