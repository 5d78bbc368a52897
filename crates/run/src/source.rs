//! Where an experiment's sequences come from: a task, which knows the truth, or files.

use std::path::Path;

use scrnn::dataset::Dataset;
use scrnn_sim::tutor::{self, Demonstration, Tutoring};
use sha2::{Digest, Sha256};

use crate::channels;
use crate::experiment::Data;
use crate::failure::{Failure, Result};
use scrnn_data as files;
use scrnn_tasks::{Task, TaskName, make};

/// Sequences in their own units.
#[derive(Debug)]
pub struct Source {
    /// What is learned.
    pub data: Dataset,
    /// The variance of each sample's noise, where it is known.
    pub truth: Option<Truth>,
    /// What came of the movements that a robot was taught; empty where none was.
    pub demonstrations: Vec<Demonstration>,
}

impl Source {
    fn of(data: Dataset) -> Self {
        Self { data, truth: None, demonstrations: Vec::new() }
    }
}

/// The true variances of a task.
#[derive(Debug)]
pub struct Truth {
    /// The task.
    pub task: TaskName,
    /// The variance of the noise in each sample.
    pub variances: Dataset,
}

/// Makes or reads the sequences of a resolved experiment. Simulated robots use so many threads, which change no bit.
///
/// # Errors
/// What is wrong with task or files.
pub fn load(data: &Data, threads: usize) -> Result<Source> {
    if let Some(task) = data.task {
        let (sequences, steps) = task.size();
        let size = (data.sequences.unwrap_or(sequences), data.steps.unwrap_or(steps));
        let seed = data.seed.unwrap_or(1);
        if task == TaskName::Reach {
            let tutoring = tutoring(size, data.exact_positions.unwrap_or(false));
            let demonstrations = tutor::demonstrate(&tutoring, seed, threads)?;
            return Ok(Source {
                demonstrations: demonstrations.clone(),
                ..Source::of(tutor::dataset(&demonstrations)?)
            });
        }
        let Task { data, variances, .. } = make(task, size, seed, threads)?;
        // The noise of a robot's sensors is not all that cannot be predicted, so the true variances are unknown.
        let truth = (!task.has_robot()).then_some(Truth { task, variances });
        return Ok(Source { truth, ..Source::of(data) });
    }
    let paths = data.files.as_deref().unwrap_or_default();
    let mut sets = Vec::with_capacity(paths.len());
    for path in paths {
        sets.push((path, files::read_part(path, &data.selection())?));
    }
    let data = match sets.as_slice() {
        [(_, only)] => only.clone(),
        several => {
            let (first, channels) = match several.first() {
                Some((path, set)) => (path.display().to_string(), set.channels().to_vec()),
                None => return Err(Failure::input("the experiment names no file", "add one to `data.files`")),
            };
            let mut sequences = Vec::new();
            for (path, set) in sets {
                let set = alike(set, &channels, (path, &first))?;
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                for sequence in set.sequences() {
                    let mut sequence = sequence.clone();
                    sequence.name = format!("{stem}/{}", sequence.name);
                    sequences.push(sequence);
                }
            }
            Dataset::new(channels, sequences)?
        }
    };
    Ok(Source::of(data))
}

/// `set`, from the file at `path`, on the channels of the first file: by their names, whatever their order.
fn alike(set: Dataset, channels: &[String], (path, first): (&Path, &str)) -> Result<Dataset> {
    if set.channels() == channels {
        return Ok(set);
    }
    if channels::nameless(set.channels()) || channels::by_name(set.channels(), channels).is_err() {
        let message = format!(
            "the channels of {} are {}, those of {first} are {}",
            path.display(),
            set.channels().join(", "),
            channels.join(", ")
        );
        return Err(Failure::input(message, "files that are learned together need the same channels, by name"));
    }
    channels::matched(set, channels, &path.display().to_string())
}

/// How the robot is taught: so many demonstrations of so many samples.
pub fn tutoring((sequences, samples): (usize, usize), exact_positions: bool) -> Tutoring {
    let usual = Tutoring::default();
    let placement = if exact_positions { 0.0 } else { usual.placement };
    Tutoring { sequences, samples, placement, ..usual }
}

/// A fingerprint of names, lengths and the bits of all samples.
pub fn digest(data: &Dataset) -> String {
    let mut hash = Sha256::new();
    let text = |hash: &mut Sha256, text: &str| {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    };
    hash.update((data.channels().len() as u64).to_le_bytes());
    data.channels().iter().for_each(|name| text(&mut hash, name));
    for sequence in data.sequences() {
        text(&mut hash, &sequence.name);
        hash.update((sequence.len() as u64).to_le_bytes());
        for value in sequence.values() {
            hash.update(value.to_bits().to_le_bytes());
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn::dataset::Sequence;

    #[test]
    fn the_digest_sees_each_bit_the_split_and_the_names() {
        let set = |name: &str, parts: &[&[f64]]| {
            let sequences = parts.iter().map(|part| Sequence::new(name, 1, part.to_vec()).unwrap()).collect();
            digest(&Dataset::new(vec!["y".into()], sequences).unwrap())
        };
        let one = set("a", &[&[1.0, 2.0, 3.0]]);
        assert_eq!(one, set("a", &[&[1.0, 2.0, 3.0]]));
        for other in [
            set("b", &[&[1.0, 2.0, 3.0]]),
            set("a", &[&[1.0, 2.0], &[3.0]]),
            set("a", &[&[1.0, 2.0, 3.0_f64.next_up()]]),
        ] {
            assert_ne!(one, other);
        }
    }
}
