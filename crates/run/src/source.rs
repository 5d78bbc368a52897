//! Where an experiment's sequences come from: a task, which knows the truth, or files.

use scrnn::dataset::{Dataset, Sequence};
use scrnn_sim::reach::tutor::{self, Demonstration, Tutoring};

use crate::experiment::{Data, Experiment};
use crate::failure::{Failure, Result};
use crate::held_out;
use crate::interrupt::Interrupt;
use scrnn_data::{Reading, Remark, read_all, suspicions};
use scrnn_tasks::{Task, TaskName, interact, make};

/// Sequences in their own units.
#[derive(Debug, Clone)]
pub struct Source {
    /// What is learned.
    pub data: Dataset,
    /// What is held out of the training, on the same channels.
    pub held_out: Option<Dataset>,
    /// The variance of each sample's noise, where it is known.
    pub truth: Option<Truth>,
    /// Seconds between two samples, where that is known.
    pub period: Option<f64>,
    /// What is worth saying about files that were read, what looks wrong among it.
    pub remarks: Vec<Remark>,
    /// What came of the movements that a robot was taught; empty where none was.
    pub demonstrations: Vec<Demonstration>,
}

impl Source {
    fn of(data: Dataset) -> Self {
        Self { data, held_out: None, truth: None, period: None, remarks: Vec::new(), demonstrations: Vec::new() }
    }
}

/// The true variances of a task.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The task.
    pub task: TaskName,
    /// The variance of the noise in each sample.
    pub variances: Dataset,
}

/// Makes or reads the sequences of a resolved experiment, and takes those out that are not to be learned.
///
/// # Errors
/// As [`load`]; [`Failure::Input`] where the data have no such sequences, or nothing would be left to learn.
pub fn of(experiment: &Experiment, threads: usize) -> Result<Source> {
    held_out::split(load(&experiment.data, threads)?, experiment)
}

/// Makes or reads all sequences of a resolved experiment. Simulated robots use so many threads, which change no bit.
///
/// # Errors
/// What is wrong with task or files.
pub fn load(data: &Data, threads: usize) -> Result<Source> {
    load_while(data, threads, &Interrupt::new())
}

/// As [`load`], until somebody asks to stop.
///
/// # Errors
/// As [`load`]; [`Failure::Stopped`] if somebody asked to stop while a robot was simulated.
pub fn load_while(data: &Data, threads: usize, interrupt: &Interrupt) -> Result<Source> {
    let go_on = || if interrupt.asked() { Err(Failure::Stopped) } else { Ok(()) };
    if let Some(task) = data.task {
        let (sequences, steps) = task.size();
        let size = (data.sequences.unwrap_or(sequences), data.steps.unwrap_or(steps));
        let seed = data.seed.unwrap_or(1);
        if task == TaskName::Reach {
            let tutoring = tutoring(size, data.exact_positions.unwrap_or(false));
            let demonstrations = tutor::demonstrate_while(&tutoring, seed, threads, &go_on)?;
            return Ok(Source {
                demonstrations: demonstrations.clone(),
                ..Source::of(tutor::dataset(&demonstrations)?)
            });
        }
        if let (TaskName::Interact, Some(left)) = (task, data.left) {
            return Ok(Source::of(interact::drawn_while(left, size, seed, threads, |_| go_on())?));
        }
        let Task { data, variances, .. } = match task {
            TaskName::Interact => interact::make_while(size, seed, threads, |_| go_on())?,
            _ => make(task, size, seed, threads)?,
        };
        // The noise of a robot's sensors is not all that cannot be predicted, so the true variances are unknown.
        let truth = (!task.has_robot()).then_some(Truth { task, variances });
        return Ok(Source { truth, ..Source::of(data) });
    }
    let files = data.files.as_deref().unwrap_or_default();
    if files.is_empty() {
        return Err(Failure::input("the experiment names no file", "add one to `data.files`"));
    }
    let Reading { data: read, period, mut remarks, .. } = read_all(files, &data.selection())?;
    let source = at_hand(read, data.rest)?;
    remarks.extend(source.remarks);
    Ok(Source { period, remarks, ..Source::of(source.data) })
}

/// Sequences that are at hand, as if they had been read from files: with what looks wrong among them, and held at rest for this share of
/// their lengths.
///
/// # Errors
/// None where the sequences are sound.
pub fn at_hand(data: Dataset, rest: Option<f64>) -> Result<Source> {
    let suspicions = suspicions::look(&data).into_iter();
    let remarks = suspicions.map(|suspicion| Remark::Suspicion { suspicion }).collect();
    let data = match rest {
        Some(rest) if rest > 0.0 => at_rest(&data, rest)?,
        _ => data,
    };
    Ok(Source { remarks, ..Source::of(data) })
}

/// As [`of`], from what the files of the experiment hold, which is at hand.
///
/// # Errors
/// As [`of`].
pub fn of_hand(experiment: &Experiment, data: Dataset) -> Result<Source> {
    held_out::split(at_hand(data, experiment.data.rest)?, experiment)
}

/// Holds the last sample of each sequence for a share of its length.
///
/// # Errors
/// None where the sequences are sound: they only grow.
pub fn at_rest(data: &Dataset, share: f64) -> Result<Dataset> {
    let n = data.channels().len();
    let longer = |sequence: &Sequence| {
        let count = (share * sequence.len() as f64).round() as usize;
        let mut values = sequence.values().to_vec();
        let last = values[values.len().saturating_sub(n)..].to_vec();
        values.extend(last.iter().copied().cycle().take(count * n));
        Sequence::new(sequence.name.clone(), n, values)
    };
    let sequences = data.sequences().iter().map(longer).collect::<scrnn::error::Result<_>>()?;
    Ok(Dataset::new(data.channels().to_vec(), sequences)?)
}

/// How the robot is taught: so many demonstrations of so many samples.
pub fn tutoring((sequences, samples): (usize, usize), exact_positions: bool) -> Tutoring {
    let usual = Tutoring::default();
    let placement = if exact_positions { 0.0 } else { usual.placement };
    Tutoring { sequences, samples, placement, ..usual }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_sample_is_held() {
        let sequence = Sequence::new("a", 2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]).unwrap();
        let data = Dataset::new(Dataset::numbered_channels(2), vec![sequence]).unwrap();
        assert_eq!(at_rest(&data, 0.5).unwrap().sequences()[0].values()[8..], [7.0, 8.0, 7.0, 8.0]);
        assert_eq!(at_rest(&data, 0.1).unwrap(), data);
    }
}
