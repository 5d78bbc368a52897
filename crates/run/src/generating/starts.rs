//! Where generation starts: initial states, and the recorded samples that go with each.

use std::path::Path;

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::Dataset;
use scrnn::topology::Group;

use scrnn_data as files;

use super::Generating;
use crate::failure::{Failure, Result};
use crate::memory::{self, product};
use crate::trained::Trained;

/// Where generation starts.
#[derive(Debug, Clone, Default)]
pub enum From {
    /// From the initial state of each learned sequence.
    #[default]
    Learned,
    /// From that of the learned sequence of this name or, counted from 1, number.
    Sequence(String),
    /// From the mean of the learned initial states.
    Mean,
    /// From each of these.
    Given(Vec<State>),
}

/// One sequence to generate.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// u_0.
    pub state: Vec<f64>,
    /// Recorded samples, scaled; at least the first xi.
    pub sensed: Vec<f64>,
    /// Its number of steps.
    pub steps: usize,
}

/// An initial state without its samples.
#[derive(Debug, Clone)]
pub struct State {
    name: String,
    values: Vec<f64>,
    /// The learned sequence that it belongs to, from 0.
    learned: Option<usize>,
}

impl State {
    /// A value of u_0 for each context unit, under a name.
    pub fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { name: name.into(), values, learned: None }
    }
}

/// The sequences to generate. `sensing` says whether recorded samples are needed beyond the first; where simulated robots
/// make them, so many threads are used.
pub(super) fn rows(options: &Generating, trained: &Trained, threads: usize, sensing: bool) -> Result<Vec<Row>> {
    let checkpoint = &trained.checkpoint;
    let states = states(&options.from, trained)?;
    let mut rows = match (&options.data, sensing) {
        (Some(data), _) => pair(states, data, checkpoint)?,
        (None, true) => {
            let data = trained.learned_data(threads)?;
            if states.iter().all(|state| state.learned.is_some()) {
                let of = |state: State| {
                    let s = state.learned.unwrap_or_default();
                    row(state, &data, s, checkpoint)
                };
                states.into_iter().map(of).collect::<Result<_>>()?
            } else {
                pair(states, &data, checkpoint)?
            }
        }
        (None, false) => on_their_own(states, trained),
    };
    if let Some(steps) = options.steps {
        rows.iter_mut().for_each(|row| row.steps = steps);
    }
    if let Some(row) = rows.iter().find(|row| row.steps == 0) {
        let help = "say with --steps how many to generate";
        return Err(Failure::input(format!("the number of steps of sequence {} is not known", row.name), help));
    }
    let wide = 3 * checkpoint.channels.len() + checkpoint.topology.context_units();
    let longest = rows.iter().map(|row| row.steps).max().unwrap_or(0);
    let bytes = product(&[rows.len(), options.samples, longest, wide, size_of::<f64>()]);
    memory::check("what is to be generated", bytes)?;
    if options.samples > 1 {
        let repeat = |row: &Row| {
            let row = row.clone();
            (1..=options.samples).map(move |k| Row { name: format!("{}/{k}", row.name), ..row.clone() })
        };
        rows = rows.iter().flat_map(repeat).collect();
    }
    Ok(rows)
}

/// The initial states that the options ask for.
fn states(from: &From, trained: &Trained) -> Result<Vec<State>> {
    let checkpoint = &trained.checkpoint;
    let learned = &checkpoint.initial_states;
    let of_sequence = |s: usize| State {
        name: checkpoint.sequences[s].clone(),
        values: learned.sequence(s).to_vec(),
        learned: Some(s),
    };
    match from {
        From::Learned => Ok((0..checkpoint.sequences.len()).map(of_sequence).collect()),
        From::Sequence(wanted) => Ok(vec![of_sequence(trained.sequence(wanted)?)]),
        From::Mean => Ok(vec![State::new("mean", learned.mean().to_vec())]),
        From::Given(states) => {
            let needed = checkpoint.topology.context_units();
            match states.iter().find(|state| state.values.len() != needed) {
                Some(State { name, values, .. }) => {
                    let message = format!(
                        "initial state {name} has {} values, but the network has {needed} context units",
                        values.len()
                    );
                    Err(Failure::input(message, "give one for each context unit"))
                }
                None => Ok(states.clone()),
            }
        }
    }
}

/// The initial states in a file: every row of every sequence in it is one.
///
/// # Errors
/// [`Failure`] for a file that cannot be read, and for another number of columns than the network has context units.
pub fn given_states(path: &Path, checkpoint: &Checkpoint) -> Result<Vec<State>> {
    // A single state is an array of one row: its axes are no matter of doubt.
    let is_array = path.extension().is_some_and(|extension| extension == "npy" || extension == "npz");
    let axes = is_array.then_some(files::Axes { sequences: None, steps: 0, channels: Some(1) });
    let file = files::read_part(path, &files::Selection { axes, ..files::Selection::default() })?;
    let (found, needed) = (file.channels().len(), checkpoint.topology.context_units());
    if found != needed {
        let message = format!("{} has {found} columns, but the network has {needed} context units", path.display());
        return Err(Failure::input(message, "`scrnn recognize --out FILE` writes such a file"));
    }
    let mut states = Vec::new();
    for sequence in file.sequences() {
        for k in 0..sequence.len() {
            let name = if sequence.len() == 1 { sequence.name.clone() } else { format!("{}/{}", sequence.name, k + 1) };
            states.push(State::new(name, sequence.sample(k).to_vec()));
        }
    }
    Ok(states)
}

/// Gives each state its sequence of `data`: one to one, or the only one of either side to all of the other.
fn pair(states: Vec<State>, data: &Dataset, checkpoint: &Checkpoint) -> Result<Vec<Row>> {
    let (n, m) = (states.len(), data.sequences().len());
    match (n, m) {
        _ if n == m => states.into_iter().enumerate().map(|(s, state)| row(state, data, s, checkpoint)).collect(),
        (_, 1) => states.into_iter().map(|state| row(state, data, 0, checkpoint)).collect(),
        (1, _) => {
            let only = &states[0];
            let copy = |s: usize| {
                let name = data.sequences()[s].name.clone();
                row(State::new(name, only.values.clone()), data, s, checkpoint)
            };
            (0..m).map(copy).collect()
        }
        _ => Err(Failure::input(
            format!("there are {n} initial states, but {m} recorded sequences"),
            "choose one state with --sequence K or --mean, or find one for each sequence with `scrnn recognize`",
        )),
    }
}

/// A state with sequence `s` of `data`.
fn row(state: State, data: &Dataset, s: usize, checkpoint: &Checkpoint) -> Result<Row> {
    let (sequence, delay) = (&data.sequences()[s], checkpoint.topology.delay());
    if sequence.len() <= delay {
        return Err(scrnn::error::Error::SequenceTooShort { sequence: s, length: sequence.len(), delay }.into());
    }
    let n = checkpoint.channels.len();
    let scaled = |(k, &x): (usize, &f64)| checkpoint.scaling.to_scaled(k % n, x);
    let sensed = sequence.values().iter().enumerate().map(scaled).collect();
    Ok(Row { name: state.name, state: state.values, sensed, steps: sequence.len() - delay })
}

/// States with the first samples that the checkpoint keeps: the learned sequence's own, or the average of all.
fn on_their_own(states: Vec<State>, trained: &Trained) -> Vec<Row> {
    let checkpoint = &trained.checkpoint;
    let delay = checkpoint.topology.delay();
    let size = delay * checkpoint.channels.len();
    let lengths = trained.notes.as_ref().map(|notes| notes.data.lengths.as_slice()).unwrap_or_default();
    let longest = lengths.iter().max().copied().unwrap_or(0);
    let average = || -> Vec<f64> {
        let count = checkpoint.sequences.len() as f64;
        (0..size).map(|k| checkpoint.first_inputs.iter().skip(k).step_by(size).sum::<f64>() / count).collect()
    };
    let of = |State { name, values, learned }| {
        let length = learned.map_or(longest, |s| lengths.get(s).copied().unwrap_or(0));
        let sensed = match learned {
            Some(s) => checkpoint.first_inputs[s * size..(s + 1) * size].to_vec(),
            None => average(),
        };
        Row { name, state: values, sensed, steps: length.saturating_sub(delay) }
    };
    states.into_iter().map(of).collect()
}

/// The names of a group's units, for the columns of contexts and initial states.
pub fn unit_names(group: &Group) -> Vec<String> {
    (1..=group.units).map(|i| format!("{}{i}", group.name)).collect()
}
