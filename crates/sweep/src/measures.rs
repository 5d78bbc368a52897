//! The numbers that are collected of each network, with what they mean.

use scrnn_run::failure::{Failure, Result};

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Less of it.
    Lower,
    /// More of it.
    Higher,
    /// Neither: it is told, and decides nothing.
    Neither,
}

/// A number of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measure {
    /// Its name in files and columns.
    pub key: &'static str,
    /// As figures and tables have it.
    pub label: &'static str,
    /// Which way is better.
    pub better: Better,
}

const fn lower(key: &'static str, label: &'static str) -> Measure {
    Measure { key, label, better: Better::Lower }
}

const fn higher(key: &'static str, label: &'static str) -> Measure {
    Measure { key, label, better: Better::Higher }
}

const fn neither(key: &'static str, label: &'static str) -> Measure {
    Measure { key, label, better: Better::Neither }
}

/// All of them. Of those that a sweep has, the first one says which setting is best, unless the sweep file names another.
pub const MEASURES: &[Measure] = &[
    lower("held_out.nll", "nll on held-out sequences, best epoch"),
    lower("held_out.mse", "squared error on held-out sequences, best epoch"),
    lower("evaluate.nll", "nll on new sequences, one step ahead"),
    lower("evaluate.mse", "squared error on new sequences, one step ahead"),
    lower("evaluate.nll_recognised", "the same nll from the recognised state"),
    lower("evaluate.closed_loop", "distance of the closed loop on new sequences"),
    neither("evaluate.within_one", "share of errors within one predicted sd (Gaussian 0.68)"),
    neither("evaluate.within_two", "share of errors within two predicted sd (Gaussian 0.95)"),
    lower("nll", "nll, last epoch"),
    lower("mse", "squared error, last epoch"),
    lower("best.nll", "nll, best epoch"),
    lower("best.mse", "squared error, best epoch"),
    neither("best.epoch", "best epoch"),
    neither("epoch", "last epoch"),
    neither("recoveries", "resets to the best network"),
    lower("generate.distance", "distance of the closed loop to the learned sequences"),
    lower("recognise.error", "error of recognised sequences, data units"),
    lower("recognise.nll", "nll of recognised sequences"),
    higher("recognise.correct", "share of sequences recognised as themselves"),
    lower("follow.error", "error of the next sample while following, data units"),
    higher("follow.locked", "share of samples at which the network has found the movement"),
    higher("simulate.success", "share of branchings that succeed"),
    lower("simulate.collisions", "collisions"),
    lower("simulate.reaction", "reaction time, samples"),
    higher("simulate.touched", "share of cycles that touch the sphere"),
];

/// The measure of this name.
///
/// # Errors
/// [`Failure::Input`] with all names.
pub fn of(key: &str) -> Result<&'static Measure> {
    MEASURES.iter().find(|measure| measure.key == key).ok_or_else(|| {
        let names = MEASURES.iter().map(|measure| measure.key).collect::<Vec<_>>().join(", ");
        Failure::input(format!("there is no measure `{key}`"), format!("there are {names}"))
    })
}

/// The place of a name in the order of tables and columns.
#[must_use]
pub fn place(key: &str) -> usize {
    MEASURES.iter().position(|measure| measure.key == key).unwrap_or(MEASURES.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_measure_has_a_name_of_its_own() {
        for (k, measure) in MEASURES.iter().enumerate() {
            assert!(
                MEASURES[..k].iter().all(|other| other.key != measure.key && other.label != measure.label),
                "{measure:?}"
            );
            assert_eq!((of(measure.key).unwrap(), place(measure.key)), (measure, k));
        }
        assert!(of("nl").unwrap_err().to_string().contains("no measure `nl`"));
    }
}
