//! What all studies have in common. A study implements [`Study`]; [`reproduce`] does the rest.
//!
//! ```text
//! study --conditions x seeds--> jobs --side by side on the cores-->
//!     train the job's networks -> evaluate, part by part, each kept -> findings, material
//! all findings -> measures -> comparisons, tables -> verdicts -> metrics.json, tables, page with all material
//! ```
//!
//! | module | what it holds |
//! |---|---|
//! | [`study`], [`condition`] | the trait, a job, a trained network; under which circumstances networks learn |
//! | [`preset`] | the experiment files of a study's networks |
//! | [`driver`], [`film`] | from options to a page; recordings beside it |
//! | [`desk`], [`kept`] | what an evaluation is given; parts of evaluations in files |
//! | [`job_result`], [`results`] | the results of one job, and of all of them |
//! | [`measure`], [`comparison`], [`verdict`], [`table`] | what is made of it |
//! | [`shapes`] | what figures of several studies are made from |
//! | [`metrics`], [`printout`], [`overview`] | how it is shown: as JSON, as text, as a page |
//! | [`options`], [`context`], [`stop`] | what a reproduction is asked and given, and how it ends early |

pub mod comparison;
pub mod condition;
pub mod context;
pub mod desk;
pub mod driver;
pub mod film;
pub mod job_result;
pub mod kept;
pub mod measure;
pub mod metrics;
pub mod options;
pub mod overview;
pub mod preset;
pub mod printout;
pub mod results;
pub mod shapes;
pub mod stop;
pub mod study;
pub mod table;
#[cfg(test)]
mod tests;

pub mod verdict;

use scrnn::streams::{Purpose, derived_seed};

pub use comparison::Comparison;
pub use condition::Condition;
pub use desk::Desk;
pub use driver::reproduce;
pub use film::Film;
pub use job_result::JobResult;
pub use measure::{Measure, Summary};
pub use preset::Kind;
pub use results::Results;
pub use stop::Result;
pub use study::{Job, Learned, Study};
pub use table::{Cell, Column, Table};
pub use verdict::Verdict;

/// The seed of data that were not learned; a study numbers its sets.
pub fn held_out(seed: u64, set: u64) -> u64 {
    derived_seed(seed, Purpose::HeldOut, set)
}

/// The seed of the noise that closed loops are run with; a study numbers its kinds of them.
pub fn closed_loop(seed: u64, kind: u64) -> u64 {
    derived_seed(seed, Purpose::StudyLoops, kind)
}

/// The seed of a trial in a world; a study numbers its trials.
pub fn in_trial(seed: u64, trial: u64) -> u64 {
    derived_seed(seed, Purpose::StudyTrials, trial)
}
