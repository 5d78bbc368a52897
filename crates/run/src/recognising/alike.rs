//! What is said of learned sequences where they share one initial state: by what the network heard, not by where it began.

use super::{Found, Learned};
use crate::failure::Result;
use crate::likeness;
use crate::messages::Messages;
use crate::trained::Trained;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;

/// Whether all learned sequences of a run share one initial state.
pub(super) fn share_one_state(trained: &Trained) -> bool {
    trained.initial_state_variance() == 0.0
}

/// Ranks the learned sequences by likeness, in place of the likelihoods of their initial states, which are all the same.
///
/// # Errors
/// What the network cannot run on.
pub(super) fn rank(
    trained: &Trained,
    new: &Dataset,
    heard: usize,
    found: &mut [Found],
    (engine, messages): (&Engine, &dyn Messages),
) -> Result<()> {
    let learned = match trained.learned_data(engine.threads()) {
        Ok(learned) => learned,
        Err(failure) => {
            messages.say(&format!(
                "note: which learned sequences these are like is not told: all share one initial state, and what was learned cannot be \
                 read again ({failure})"
            ));
            found.iter_mut().for_each(|one| one.learned.clear());
            return Ok(());
        }
    };
    for (found, ranking) in found.iter_mut().zip(likeness::rank(trained, &learned, new, heard, engine)?) {
        let one = |like: &likeness::Likeness| Learned {
            number: like.sequence + 1,
            sequence: trained.checkpoint.sequences[like.sequence].clone(),
            ln_likelihood: None,
            distance: Some(like.distance),
        };
        found.learned = ranking.iter().take(KEPT).map(one).collect();
    }
    Ok(())
}

/// As many as recognition keeps of its ranking.
const KEPT: usize = 100;
