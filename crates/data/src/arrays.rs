//! Arrays of an archive as sequences: which are sequences, which are groups of channels of one recording, which tell the time
//! or names; and what their axes are.
//!
//! | arrays | taken as |
//! |---|---|
//! | a single one | sequences x steps x channels, steps x channels, or steps |
//! | one stem with numbers (`demo_0`, `demo_1`), or several lengths on the same channels | a sequence each |
//! | two numbers in each name and nothing else that differs (`s1_trial2`), several channels, one length | a sequence each |
//! | several stems with the same numbers (`qpos_0`, `action_0`, `qpos_1`, ...) | a sequence for each number, its arrays side by side |
//! | different names, one length | groups of channels of one recording: `qpos.0`, ... |
//!
//! More channels than steps are asked about, and so is a first axis along which values go on smoothly while they jump along
//! the second.

use std::collections::BTreeMap;

use crate::budget::{Budget, OverBudget};
use crate::natural::natural;
use crate::reading::Topic;
use crate::remark::Remark;
use crate::samples::{Samples, Track, split_off};
use crate::{ArrayProblem, Axes, FileError, Selection, times};

/// Numbers with a shape. NaN is missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Array {
    /// Its name.
    pub name: String,
    /// Lengths of its axes; empty for a single number.
    pub shape: Vec<usize>,
    /// The last axis varies fastest.
    pub values: Vec<f64>,
}

/// Texts that may be names of channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Texts {
    /// The array's name.
    pub name: String,
    /// What it holds.
    pub texts: Vec<String>,
}

/// Names of numbers that tell how many samples a second has.
const RATES: &[&str] = &[
    "fps",
    "framerate",
    "frame_rate",
    "freq",
    "frequency",
    "rate",
    "sample_rate",
    "sampling_rate",
    "samplerate",
    "hz",
    "fs",
    "sfreq",
];
/// Names of numbers that tell the seconds between samples.
const PERIODS: &[&str] = &["dt", "period", "timestep", "time_step", "frame_time", "delta_t", "deltat", "ts"];
/// Names of arrays that tell the time.
const CLOCKS: &[&str] = &[
    "t",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "stamp",
    "stamps",
    "time_s",
    "time_sec",
    "timestamp_s",
    "frame_times",
];

/// What the array is called that holds the names of the sequences, in what this project writes.
pub const SEQUENCES: &str = "names_of_sequences";
/// What the array is called that holds the names of the channels; of a field with channels of its own: and its name.
pub const CHANNELS: &str = "names_of_channels";
/// Names of texts that are the names of sequences, and of channels.
const SEQUENCE_NAMES: &[&str] = &[SEQUENCES, "sequence_names", "episode_names", "demo_names"];
const CHANNEL_NAMES: &[&str] = &[CHANNELS, "channel_names", "joint_names"];

/// Sequences of arrays.
///
/// # Errors
/// [`FileError::Array`] where it is not clear what is meant, with what to type.
pub fn to_samples(
    (path, budget): (&str, &Budget),
    mut arrays: Vec<Array>,
    texts: &[Texts],
    selection: &Selection,
) -> Result<Samples, FileError> {
    let mut remarks = Vec::new();
    let topics: Vec<(String, Vec<usize>)> =
        arrays.iter().map(|array| (array.name.clone(), array.shape.clone())).collect();
    if !selection.arrays.is_empty() {
        arrays = chosen(path, arrays, &selection.arrays)?;
    }
    let mut period = None;
    arrays.retain(|array| match single(array) {
        Some(value) => {
            let last = array.name.rsplit(['/', '.']).next().unwrap_or("").to_lowercase();
            let is = |names: &[&str]| names.iter().any(|name| last == *name || last.ends_with(&format!("_{name}")));
            let told = if is(RATES) { Some(1.0 / value) } else { is(PERIODS).then_some(value) };
            let what = match told.filter(|period| period.is_finite() && *period > 1e-9 && *period < 1e9) {
                Some(told) => {
                    period = Some(told);
                    format!("the period, {told} s")
                }
                None => "a single number".to_owned(),
            };
            remarks.push(Remark::LeftOut { column: array.name.clone(), what });
            false
        }
        None => true,
    });
    arrays.iter_mut().for_each(squeeze);
    // Images beside a robot's state.
    let (deep, flat): (Vec<_>, Vec<_>) = arrays.into_iter().partition(|array| array.shape.len() > 3);
    arrays = flat;
    if arrays.is_empty() || !selection.arrays.is_empty() {
        arrays.extend(deep);
    } else {
        remarks.extend(deep.into_iter().map(|array| {
            let what = format!("an array of {} axes, as images have", array.shape.len());
            Remark::LeftOut { column: array.name, what }
        }));
    }
    let (clock, mut arrays) = clock(arrays);
    let mut samples = match plan(path, &arrays, selection)? {
        Plan::Alone => alone(path, arrays.remove(0), selection, texts, &mut remarks)?,
        Plan::Sequences(order) => {
            let mut tracks = Vec::new();
            let mut channels = 0;
            for index in order {
                let Array { name, shape, values } = std::mem::take(&mut arrays[index]);
                channels = channels_of(&shape[1..]);
                tracks.push((name, values));
            }
            Samples::numbered(channels, tracks)
        }
        Plan::Groups(sequences) => groups(arrays, sequences, budget, &mut remarks)
            .map_err(|problem| FileError::OverBudget { path: path.to_owned(), problem })?,
    };
    if let Some((name, values)) = clock {
        let [track] = samples.tracks.as_mut_slice() else { return Ok(samples) };
        let count = track.values.len() / samples.channels.len().max(1);
        match times::nanoseconds(&values).filter(|times| times.len() == count) {
            Some(times) => {
                track.times = times;
                samples.facts.clock = Some(name.clone());
                remarks.push(Remark::Clock { column: name });
            }
            None => remarks.push(Remark::LeftOut {
                column: name,
                what: format!("times of another length than the {count} samples"),
            }),
        }
    }
    let named = names(&mut samples, texts);
    let unused = |texts: &&Texts| texts.texts != samples.channels && !named.contains(&texts.name.as_str());
    remarks.extend(
        texts
            .iter()
            .filter(unused)
            .map(|texts| Remark::LeftOut { column: texts.name.clone(), what: "text".to_owned() }),
    );
    samples.period = period;
    samples.facts.topics = topics
        .into_iter()
        .map(|(name, shape)| Topic {
            taken: selection.arrays.is_empty() || selection.arrays.contains(&name),
            name,
            of: shape_text(&shape),
            count: shape.first().copied().unwrap_or(1),
            ..Topic::default()
        })
        .collect();
    samples.remarks = remarks;
    Ok(samples)
}

fn error(path: &str, name: &str, problem: ArrayProblem, help: String) -> FileError {
    let path =
        if name.is_empty() { path.to_owned() } else { format!("{path}, array `{}`", crate::excerpt::shortened(name)) };
    FileError::Array { path, problem, help: Some(help) }
}

/// `(60, 2)`.
pub fn shape_text(shape: &[usize]) -> String {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    format!("({}{})", lengths.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// The arrays that are asked for, in that order.
fn chosen(path: &str, mut arrays: Vec<Array>, wanted: &[String]) -> Result<Vec<Array>, FileError> {
    let all = || {
        arrays.iter().map(|array| format!("{} {}", array.name, shape_text(&array.shape))).collect::<Vec<_>>().join(", ")
    };
    if let Some(found) = wanted.iter().find(|name| !arrays.iter().any(|array| array.name == **name)) {
        let help = format!("there are {}", all());
        return Err(error(path, "", ArrayProblem::NoArray { found: found.clone() }, help));
    }
    // What tells the time or the period helps although it is not asked for.
    let helps = |array: &Array| {
        array.shape.iter().product::<usize>() <= 1 || CLOCKS.contains(&array.name.to_lowercase().as_str())
    };
    let mut taken = Vec::new();
    for name in wanted {
        if let Some(at) = arrays.iter().position(|array| array.name == *name) {
            taken.push(arrays.remove(at));
        }
    }
    taken.extend(arrays.into_iter().filter(helps));
    Ok(taken)
}

fn single(array: &Array) -> Option<f64> {
    let one = array.values.len() == 1 && array.shape.len() <= 1;
    one.then(|| array.values[0])
}

/// Takes axes of length 1 out of an array of more than three.
fn squeeze(array: &mut Array) {
    if array.shape.len() > 3 {
        array.shape.retain(|&length| length != 1);
        if array.shape.is_empty() {
            array.shape.push(1);
        }
    }
}

/// Takes out the array that tells the time.
fn clock(mut arrays: Vec<Array>) -> (Option<(String, Vec<f64>)>, Vec<Array>) {
    let flat = |array: &Array| array.shape.iter().filter(|&&length| length != 1).count() == 1;
    let rises = |array: &Array| array.values.windows(2).all(|pair| pair[1] > pair[0]);
    let is_clock = |array: &Array| CLOCKS.contains(&array.name.to_lowercase().as_str()) && flat(array) && rises(array);
    let others = arrays.iter().any(|array| !is_clock(array));
    match arrays.iter().position(is_clock).filter(|_| others) {
        Some(at) => {
            let array = arrays.remove(at);
            (Some((array.name, array.values)), arrays)
        }
        None => (None, arrays),
    }
}

enum Plan {
    Alone,
    /// Each a sequence, in this order.
    Sequences(Vec<usize>),
    /// Name of each sequence, and for each the arrays that stand side by side.
    Groups(Vec<(String, Vec<usize>)>),
}

fn channels_of(axes: &[usize]) -> usize {
    axes.iter().product()
}

fn plan(path: &str, arrays: &[Array], selection: &Selection) -> Result<Plan, FileError> {
    match arrays {
        [] => return Err(FileError::Empty { path: path.to_owned() }),
        [_] => return Ok(Plan::Alone),
        _ => {}
    }
    // Steps x channels is what several arrays are taken for anyway; who says so need not be asked.
    let as_written = selection.axes == Some(Axes { sequences: None, steps: 0, channels: Some(1) });
    if let Some(axes) = selection.axes.filter(|_| !as_written) {
        let help = "with `axes`, take one array: `arrays = [\"...\"]`".to_owned();
        let found = arrays.iter().map(|array| array.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(error(path, "", ArrayProblem::Axes { axes: axes.to_string(), found }, help));
    }
    if let Some(deep) = arrays.iter().find(|array| array.shape.len() > 3 || array.values.is_empty()) {
        let help = "choose others with `arrays = [...]`".to_owned();
        let needed = "one to three axes with at least one sample";
        return Err(error(path, &deep.name, ArrayProblem::Shape { found: shape_text(&deep.shape), needed }, help));
    }
    let same_channels = arrays.iter().all(|array| channels_of(&array.shape[1..]) == channels_of(&arrays[0].shape[1..]));
    let same_length = arrays.iter().all(|array| array.shape[0] == arrays[0].shape[0]);
    let flat = arrays.iter().all(|array| array.shape.len() <= 2);
    let numbered: Option<Vec<(&str, &str)>> = arrays.iter().map(|array| stem_and_number(&array.name)).collect();
    if let Some(numbered) = numbered {
        let mut stems: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (index, (stem, _)) in numbered.iter().enumerate() {
            stems.entry(stem).or_default().push(index);
        }
        // Subjects and trials. Two arms of one recording are named so as well: that their recordings are of different lengths, but both arms
        // of each of the same, would tell.
        let differ_in_numbers = same_length && channels_of(&arrays[0].shape[1..]) > 1 && {
            let model = without_digits(&arrays[0].name);
            arrays.iter().all(|array| without_digits(&array.name) == model)
        };
        if (stems.len() == 1 || differ_in_numbers) && same_channels && flat {
            let mut order: Vec<usize> = (0..arrays.len()).collect();
            order.sort_by(|a, b| natural(&arrays[*a].name, &arrays[*b].name));
            if !as_written {
                steps_for_channels(path, arrays)?;
            }
            return Ok(Plan::Sequences(order));
        }
        if stems.len() > 1 && flat {
            let mut numbers: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
            for (index, (_, number)) in numbered.iter().enumerate() {
                numbers.entry(number).or_default().push(index);
            }
            let full = |group: &Vec<usize>| {
                group.len() == stems.len()
                    && group.iter().all(|&index| arrays[index].shape[0] == arrays[group[0]].shape[0])
            };
            let model: Vec<usize> = numbers.values().next().cloned().unwrap_or_default();
            let alike = |group: &Vec<usize>| {
                group.iter().zip(&model).all(|(a, b)| {
                    numbered[*a].0 == numbered[*b].0 && arrays[*a].shape.get(1) == arrays[*b].shape.get(1)
                })
            };
            if numbers.len() > 1 && numbers.values().all(full) && numbers.values().all(alike) {
                let mut sequences: Vec<(String, Vec<usize>)> =
                    numbers.into_iter().map(|(number, group)| (number.to_owned(), group)).collect();
                sequences.sort_by(|a, b| natural(&a.0, &b.0));
                return Ok(Plan::Groups(sequences));
            }
        }
    }
    if same_length {
        return Ok(Plan::Groups(vec![("1".to_owned(), (0..arrays.len()).collect())]));
    }
    if same_channels && flat {
        if !as_written {
            steps_for_channels(path, arrays)?;
        }
        return Ok(Plan::Sequences((0..arrays.len()).collect()));
    }
    let found =
        arrays.iter().map(|array| format!("{} {}", crate::excerpt::shortened(&array.name), shape_text(&array.shape)));
    let found = found.take(20).collect::<Vec<_>>().join(", ");
    let help = "name those that belong together: `arrays = [\"...\"]`, or --arrays".to_owned();
    Err(error(path, "", ArrayProblem::Lengths { found }, help))
}

/// A name's stem and the number at its end.
fn stem_and_number(name: &str) -> Option<(&str, &str)> {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (stem.len() < name.len()).then(|| (stem, &name[stem.len()..]))
}

fn without_digits(name: &str) -> String {
    name.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// Asks if sequences have more channels than any of them has steps.
fn steps_for_channels(path: &str, arrays: &[Array]) -> Result<(), FileError> {
    let steps = arrays.iter().map(|array| array.shape[0]).max().unwrap_or(0);
    let channels = arrays.first().map_or(1, |array| channels_of(&array.shape[1..]));
    if channels <= steps {
        return Ok(());
    }
    let first = &arrays[0];
    let help = "if its axes are channels x steps, save array.T instead; if it is meant so, save one array of three axes and say `axes = \"ntc\"`";
    Err(error(
        path,
        &first.name,
        ArrayProblem::MoreChannels { shape: shape_text(&first.shape), channels, steps },
        help.to_owned(),
    ))
}

/// One array.
fn alone(
    path: &str,
    array: Array,
    selection: &Selection,
    texts: &[Texts],
    remarks: &mut Vec<Remark>,
) -> Result<Samples, FileError> {
    let Array { name, shape, values } = array;
    let axes = match selection.axes {
        Some(axes) if axes.count() == shape.len() => axes,
        Some(axes) => {
            let found = format!("an array of shape {}", shape_text(&shape));
            let help =
                "give one letter for each of its axes, as `nct`: `n` sequences, `t` steps, `c` channels".to_owned();
            return Err(error(path, &name, ArrayProblem::Axes { axes: axes.to_string(), found }, help));
        }
        None => guessed(path, &name, &shape, &values)?,
    };
    let (steps, channels) = (shape[axes.steps], axes.channels.map_or(1, |axis| shape[axis]));
    let sequences = axes.sequences.map_or(1, |axis| shape[axis]);
    let as_they_are = axes.sequences.unwrap_or(0) <= axes.steps
        && axes.channels.is_none_or(|axis| axis > axes.steps)
        && axes.sequences.is_none_or(|axis| axis < axes.steps);
    let mut values = if as_they_are { values } else { reordered(&shape, axes, &values) };
    let own = sequences == 1 && shape.len() < 3 && !name.is_empty();
    // From the last to the first, so that the samples are held once.
    let mut tracks: Vec<(String, Vec<f64>)> =
        (1..sequences).rev().map(|s| ((s + 1).to_string(), split_off(&mut values, s * steps * channels))).collect();
    tracks.push((if own { name } else { "1".to_owned() }, values));
    tracks.reverse();
    let of_sequences = |texts: &Texts| SEQUENCE_NAMES.contains(&texts.name.to_lowercase().as_str());
    let mut fitting =
        texts.iter().filter(|texts| texts.texts.len() == channels && distinct(&texts.texts) && !of_sequences(texts));
    Ok(match (fitting.next(), fitting.next()) {
        (Some(names), None) if channels > 1 || names.name.to_lowercase().contains("name") => {
            remarks.push(Remark::Understood { what: format!("the channels' names are those in `{}`", names.name) });
            Samples::named(names.texts.clone(), tracks)
        }
        _ => Samples::numbered(channels, tracks),
    })
}

/// Names that an archive tells by what they are called. Returns those that were taken.
fn names<'a>(samples: &mut Samples, texts: &'a [Texts]) -> Vec<&'a str> {
    let mut taken = Vec::new();
    for Texts { name, texts } in texts.iter().filter(|texts| distinct(&texts.texts)) {
        let is = |names: &[&str]| names.contains(&name.to_lowercase().as_str());
        if texts.len() == samples.tracks.len() && is(SEQUENCE_NAMES) {
            samples.tracks.iter_mut().zip(texts).for_each(|(track, name)| track.name.clone_from(name));
            taken.push(name.as_str());
        } else if texts.len() == samples.channels.len() && !samples.facts.named && is(CHANNEL_NAMES) {
            samples.channels.clone_from(texts);
            samples.facts.named = true;
            taken.push(name.as_str());
        }
    }
    taken
}

fn distinct(texts: &[String]) -> bool {
    let mut seen = std::collections::BTreeSet::new();
    texts.iter().all(|text| !text.is_empty() && seen.insert(text))
}

/// The axes of an array that nobody told about.
fn guessed(path: &str, name: &str, shape: &[usize], values: &[f64]) -> Result<Axes, FileError> {
    let (axes, steps, channels) = match *shape {
        [_] => return Ok(Axes { sequences: None, steps: 0, channels: None }),
        [t, c] => (Axes { sequences: None, steps: 0, channels: Some(1) }, t, c),
        [_, t, c] => (Axes { sequences: Some(0), steps: 1, channels: Some(2) }, t, c),
        _ => {
            let help =
                "say which axis is which is possible for up to three: reshape it, e.g. array.reshape(len(array), -1)"
                    .to_owned();
            return Err(error(
                path,
                name,
                ArrayProblem::Shape { found: shape_text(shape), needed: "one, two or three axes" },
                help,
            ));
        }
    };
    let other = if shape.len() == 3 { ("nct", "ntc") } else { ("ct", "tc") };
    if channels > steps {
        let help = format!(
            "say which axis is which: `axes = \"{}\"` for {steps} channels of {channels} steps, `axes = \"{}\"` if it is meant as it is (`n` sequences, `t` steps, `c` channels)",
            other.0, other.1
        );
        return Err(error(path, name, ArrayProblem::MoreChannels { shape: shape_text(shape), channels, steps }, help));
    }
    if let [n, t, c] = *shape
        && first_is_time(n, t, c, values)
    {
        let help = format!(
            "if its {n} rows are steps, reshape it to ({n}, {}) by array.reshape(len(array), -1); if they are sequences, say `axes = \"ntc\"`",
            t * c
        );
        return Err(error(path, name, ArrayProblem::FirstAxisIsTime { shape: shape_text(shape) }, help));
    }
    Ok(axes)
}

/// Whether values go on smoothly along the first axis, and jump along the second. Steps of a movement are small beside
/// its extent; joints beside each other are as far apart as any two values.
pub(crate) fn first_is_time(n: usize, t: usize, c: usize, values: &[f64]) -> bool {
    if n <= t || values.len() != n * t * c {
        return false;
    }
    // The mean square of steps along an axis, by the variance around the mean along it.
    let roughness = |length: usize, others: &dyn Fn(usize, usize) -> usize, lines: usize| {
        let (mut steps, mut spread) = (0.0, 0.0);
        for line in 0..lines {
            let mean = (0..length).map(|k| values[others(line, k)]).sum::<f64>() / length as f64;
            spread += (0..length).map(|k| (values[others(line, k)] - mean).powi(2)).sum::<f64>() / length as f64;
            steps += (1..length).map(|k| (values[others(line, k)] - values[others(line, k - 1)]).powi(2)).sum::<f64>()
                / (length - 1).max(1) as f64;
        }
        steps / spread
    };
    let first = roughness(n, &|line, k| k * t * c + line, t * c);
    let second = roughness(t, &|line, k| (line / c) * t * c + k * c + line % c, n * c);
    // Noise has 2; a sine of 30 samples a turn 0.04.
    first < 0.3 && second > 0.7
}

/// Sequences x steps x channels, whatever the order was.
fn reordered(shape: &[usize], axes: Axes, values: &[f64]) -> Vec<f64> {
    let stride = |axis: usize| shape[axis + 1..].iter().product::<usize>();
    let of = |axis: Option<usize>| axis.map_or((1, 0), |axis| (shape[axis], stride(axis)));
    let ((n, by_n), (t, by_t), (c, by_c)) = (of(axes.sequences), of(Some(axes.steps)), of(axes.channels));
    let mut out = Vec::with_capacity(values.len());
    for s in 0..n {
        for k in 0..t {
            out.extend((0..c).map(|i| values[s * by_n + k * by_t + i * by_c]));
        }
    }
    out
}

/// Arrays side by side, for each sequence.
///
/// # Errors
/// [`OverBudget`]: a long name may stand for thousands of channels, and each of them has it in its own.
fn groups(
    mut arrays: Vec<Array>,
    sequences: Vec<(String, Vec<usize>)>,
    budget: &Budget,
    remarks: &mut Vec<Remark>,
) -> Result<Samples, OverBudget> {
    let mut channels = Vec::new();
    let mut tracks: Vec<Track> = Vec::new();
    let one = sequences.len() == 1;
    if let Some((_, model)) = sequences.first() {
        let mut groups = Vec::new();
        for &index in model {
            let array = &arrays[index];
            let stem = if one {
                array.name.as_str()
            } else {
                array.name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches(['_', '-', '.', '/'])
            };
            budget.take(channels_of(&array.shape[1..]).saturating_mul(stem.len() + 64))?;
            names_below(stem, &array.shape[1..], &mut channels);
            groups.push(stem.to_owned());
        }
        let what = format!(
            "{} were taken as groups of channels {}",
            groups.join(", "),
            if one {
                "of one recording; number the arrays' names (a_0, a_1) if they are sequences"
            } else {
                "side by side"
            }
        );
        remarks.push(Remark::Understood { what });
    }
    for (name, group) in sequences {
        let steps = group.first().map_or(0, |&index| arrays[index].shape[0]);
        let widths: Vec<usize> = group.iter().map(|&index| channels_of(&arrays[index].shape[1..])).collect();
        let mut values = Vec::with_capacity(steps.saturating_mul(channels.len()));
        for step in 0..steps {
            for (&index, &width) in group.iter().zip(&widths) {
                values.extend(&arrays[index].values[step * width..(step + 1) * width]);
            }
        }
        group.iter().for_each(|&index| arrays[index].values = Vec::new());
        tracks.push(Track { name, values, times: Vec::new() });
    }
    let sequences = tracks.into_iter().map(|track| (track.name, track.values)).collect();
    Ok(Samples::named(channels, sequences))
}

/// `qpos.0`, `qpos.1`, ... for each place below the first axis; `x` itself if there is none.
fn names_below(stem: &str, axes: &[usize], names: &mut Vec<String>) {
    match axes {
        [] => names.push(stem.to_owned()),
        [1] => names.push(stem.to_owned()),
        [length, rest @ ..] => (0..*length).for_each(|index| names_below(&format!("{stem}.{index}"), rest, names)),
    }
}
