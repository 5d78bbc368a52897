//! Which learned sequence a new one is like, where all share one initial state.
//!
//! ```text
//! distance(a, b) = mean over steps and units of (c_t(a) - c_t(b))^2,   t up to the shorter one's end
//! ```
//!
//! Where each learned sequence has an initial state of its own, recognition asks which of them makes the new samples most likely
//! (thesis 2.9). Where they share one there is nothing to ask: but the network has heard both, and what it heard is in its contexts c.

use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, GenerationOptions, Start, generate};

use crate::failure::Result;
use crate::trained::Trained;

/// A learned sequence and how far it is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likeness {
    /// The learned sequence, from 0.
    pub sequence: usize,
    /// The mean squared difference of the contexts, 0 to 4.
    pub distance: f64,
}

/// The learned sequences, the one most alike first, for each sequence of `new`, of which the first `heard` samples count. Both data sets
/// are in their own units.
///
/// # Errors
/// Data that do not fit the network.
pub fn rank(
    trained: &Trained,
    learned: &Dataset,
    new: &Dataset,
    heard: usize,
    engine: &Engine,
) -> Result<Vec<Vec<Likeness>>> {
    let units = trained.checkpoint.topology.context_units();
    let known = contexts(trained, learned, usize::MAX, engine)?;
    let found = contexts(trained, new, heard, engine)?;
    let ranking = |own: &Vec<f64>| {
        let mut ranking: Vec<Likeness> = (known.iter().enumerate())
            .map(|(sequence, other)| Likeness { sequence, distance: distance(own, other, units) })
            .collect();
        ranking.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        ranking
    };
    Ok(found.iter().map(ranking).collect())
}

/// c of every step while the network listens, from the state that all sequences share; `[sequence][step][unit]`.
fn contexts(trained: &Trained, data: &Dataset, heard: usize, engine: &Engine) -> Result<Vec<Vec<f64>>> {
    let checkpoint = &trained.checkpoint;
    let scaled = checkpoint.scaling.apply(data)?;
    let n = scaled.channels().len();
    let mean = checkpoint.initial_states.mean();
    let samples = |own: &scrnn::dataset::Sequence| own.len().min(heard);
    let starts: Vec<Start<'_>> = (scaled.sequences().iter())
        .map(|own| Start { initial_state: mean, sensed: &own.values()[..samples(own) * n] })
        .collect();
    let longest = scaled.sequences().iter().map(samples).max().unwrap_or(0);
    let options = GenerationOptions::new(longest, Feedback::mixed(n, 1.0, false)).contexts(true);
    let generated = generate(&trained.network(), &starts, &options, engine)?;
    let units = mean.len();
    let cut = |(mut one, own): (scrnn::generation::Generated, &scrnn::dataset::Sequence)| {
        one.contexts.truncate(samples(own) * units);
        one.contexts
    };
    Ok(generated.into_iter().zip(scaled.sequences()).map(cut).collect())
}

fn distance(a: &[f64], b: &[f64], units: usize) -> f64 {
    let len = a.len().min(b.len()) / units * units;
    let squares: f64 = a[..len].iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    if len == 0 { f64::INFINITY } else { squares / len as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contexts_are_compared_up_to_the_shorter_one() {
        assert_eq!(distance(&[1.0, 0.0, 0.5, 0.5], &[0.0, 0.0], 2), 0.5);
        assert_eq!(distance(&[0.1, 0.2], &[0.1, 0.2, 9.0, 9.0], 2), 0.0);
        assert_eq!(distance(&[], &[1.0, 2.0], 2), f64::INFINITY);
    }
}
