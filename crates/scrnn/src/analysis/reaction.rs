//! How long a robot takes to follow another one (thesis D.2).
//!
//! ```text
//! E_t = 1/2 sum_{i in I_A} (y_t,i - y-hat_t,i)^2                                              (D.3)
//! ```
//!
//! The thesis counts the steps from a branching point until E_t "became less than" E_th = 0.01. Read to the letter that is 0
//! for every network whose arm is at rest in the centre when the other robot begins to move. So here a reaction begins
//! with an error: the first E_t at or above E_th soon after the branching. It ends with the first of several steps in a row
//! below it, and its time is counted from the branching. Without such an error it is 0.

use serde::Serialize;

/// How reaction times are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReactionRule {
    /// E_th.
    pub threshold: f64,
    /// Steps from the branching in which the error must begin to belong to it.
    pub onset: usize,
    /// Steps in a row below the threshold that count as recovered.
    pub settled: usize,
    /// The time of a reaction that does not come, in steps; also how long it is waited for.
    pub longest: usize,
}

impl Default for ReactionRule {
    fn default() -> Self {
        Self { threshold: 0.01, onset: 50, settled: 5, longest: 90 }
    }
}

/// E_t (D.3) of predicted against recorded arm angles.
#[must_use]
pub fn arm_error(predicted: &[f64], recorded: &[f64]) -> f64 {
    0.5 * predicted.iter().zip(recorded).map(|(y, target)| (y - target).powi(2)).sum::<f64>()
}

impl ReactionRule {
    /// The reaction time to the branching at `branch`, given E_t of all steps.
    #[must_use]
    pub fn time(&self, errors: &[f64], branch: usize) -> usize {
        let from = branch.min(errors.len());
        let errors = &errors[from..(from + self.longest).min(errors.len())];
        let Some(onset) = errors.iter().take(self.onset).position(|e| *e >= self.threshold || e.is_nan()) else {
            return 0;
        };
        let settled = self.settled.max(1);
        let calm = errors[onset..].windows(settled).position(|steps| steps.iter().all(|e| *e < self.threshold));
        calm.map_or(self.longest, |wait| onset + wait)
    }

    /// The printed reading: steps from the branching to the first E_t below the threshold.
    #[must_use]
    pub fn literal_time(&self, errors: &[f64], branch: usize) -> usize {
        let steps = errors.iter().skip(branch).take(self.longest);
        steps.clone().position(|e| *e < self.threshold).unwrap_or(self.longest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: ReactionRule = ReactionRule { threshold: 1.0, onset: 4, settled: 2, longest: 10 };

    #[test]
    fn a_reaction_begins_with_an_error_and_ends_when_it_stays_small() {
        let mut errors = vec![0.0; 20];
        assert_eq!(RULE.time(&errors, 5), 0);
        errors[7..10].fill(2.0);
        assert_eq!((RULE.time(&errors, 5), RULE.literal_time(&errors, 5)), (5, 0));
        // A single step below the threshold is no recovery.
        errors[11] = 2.0;
        assert_eq!(RULE.time(&errors, 5), 7);
        // An error that is there at the branching already counts from it.
        assert_eq!((RULE.time(&errors, 8), RULE.literal_time(&errors, 8)), (4, 2));
    }

    #[test]
    fn errors_too_late_do_not_belong_to_the_branching_and_too_long_ones_are_cut() {
        let mut errors = vec![0.0; 20];
        errors[9..].fill(2.0);
        assert_eq!(RULE.time(&errors, 5), 0);
        assert_eq!(RULE.time(&errors, 6), 10);
        assert_eq!(RULE.literal_time(&errors, 10), 10);
        errors[18..].fill(f64::NAN);
        assert_eq!(RULE.time(&errors, 18), 10);
        assert_eq!(RULE.time(&errors, 30), 0);
    }

    #[test]
    fn the_arm_error_is_half_the_sum_of_squares() {
        assert_eq!(arm_error(&[1.0, 2.0], &[0.0, 4.0]), 2.5);
    }
}
