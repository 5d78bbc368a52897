//! Which learned sequence a new one is like, where all share one initial state.
//!
//! ```text
//! distance(a, b) = mean over units i of (m_i(a) - m_i(b))^2 + (s_i(a) - s_i(b))^2
//! ```
//!
//! m_i and s_i are mean and standard deviation of context unit i over what was heard of a sequence; this is the squared Wasserstein
//! distance of two normal distributions. It does not ask that two sequences are in step, as a comparison step by step does.
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
    /// The squared distance of means and standard deviations of the contexts, 0 to 4.
    pub distance: f64,
}

/// The learned sequences, the one most alike first, for each sequence of `new`. Of all of them the first `heard` samples count. Both data
/// sets are in their own units.
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
    let heard = |data| -> Result<Vec<Moments>> {
        Ok(contexts(trained, data, heard, engine)?.iter().map(|one| Moments::of(one, units)).collect())
    };
    let (known, found) = (heard(learned)?, heard(new)?);
    let ranking = |own: &Moments| {
        let mut ranking: Vec<Likeness> = (known.iter().enumerate())
            .map(|(sequence, other)| Likeness { sequence, distance: own.distance(other) })
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

/// Mean and standard deviation of each context unit over a sequence; empty where nothing was heard.
struct Moments(Vec<(f64, f64)>);

impl Moments {
    /// Of contexts, `[step][unit]`.
    fn of(contexts: &[f64], units: usize) -> Self {
        let steps = (contexts.len() / units) as f64;
        let mean = |value: &dyn Fn(f64) -> f64, unit: usize| {
            contexts.iter().skip(unit).step_by(units).map(|&c| value(c)).sum::<f64>() / steps
        };
        let one = |unit| {
            let average = mean(&|c| c, unit);
            (average, mean(&|c| (c - average).powi(2), unit).sqrt())
        };
        Self(if steps > 0.0 { (0..units).map(one).collect() } else { Vec::new() })
    }

    /// Infinite where nothing was heard of one of the two.
    fn distance(&self, other: &Self) -> f64 {
        if self.0.is_empty() || other.0.is_empty() {
            return f64::INFINITY;
        }
        let square = |((m, s), (n, t)): (&(f64, f64), &(f64, f64))| (m - n).powi(2) + (s - t).powi(2);
        self.0.iter().zip(&other.0).map(square).sum::<f64>() / self.0.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contexts_are_alike_where_their_means_and_spreads_are() {
        let of = |contexts: &[f64]| Moments::of(contexts, 2);
        // Unit 1: 0 and 1, mean 0.5, deviation 0.5. Unit 2 stands at 0.5.
        let swing = of(&[0.0, 0.5, 1.0, 0.5]);
        assert_eq!(swing.0, [(0.5, 0.5), (0.5, 0.0)]);
        assert_eq!(
            swing.distance(&of(&[1.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0, 0.5])),
            0.0,
            "out of step, and twice as long"
        );
        assert_eq!(swing.distance(&of(&[0.5, 0.5])), 0.125);
        assert_eq!(of(&[1.0, -1.0]).distance(&of(&[-1.0, 1.0])), 4.0);
        assert_eq!(swing.distance(&of(&[])), f64::INFINITY);
    }
}
