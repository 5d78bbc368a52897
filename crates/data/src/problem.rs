//! What can be wrong with files of formats that others made: parquet, HDF5, MATLAB, motion capture, labelled series.

use crate::FileError;
use crate::budget::OverBudget;

/// What is wrong with a file of a format that others made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FormatProblem {
    /// It is something else.
    #[error("it is no {kind} file: {why}")]
    NotThis {
        /// What it was to be.
        kind: &'static str,
        /// What gave it away.
        why: &'static str,
    },

    /// It contradicts itself, or is cut off.
    #[error("the {kind} file is damaged or cut off: {what}")]
    Damaged {
        /// What it is.
        kind: &'static str,
        /// What was found.
        what: &'static str,
    },

    /// It would fill the memory.
    #[error("{0}")]
    OverBudget(#[from] OverBudget),

    /// It is whole, but uses something that is not read.
    #[error("{found}, which is not read here")]
    NotRead {
        /// What it uses.
        found: String,
        /// What to type.
        help: String,
    },

    /// What is asked for is not there, or is none of numbers.
    #[error("it has no {what} `{found}`")]
    NoSuch {
        /// `data set`, `feature`, ...
        what: &'static str,
        /// What is asked for.
        found: String,
        /// What there is.
        there: String,
    },

    /// There is nothing in it that could be samples.
    #[error("it holds no samples: {why}")]
    NoSamples {
        /// What it holds instead.
        why: String,
    },

    /// Several things could be meant.
    #[error("it is not clear which {what} are meant: there are {there}")]
    Choose {
        /// `data sets`, `matrices`, ...
        what: &'static str,
        /// What there is.
        there: String,
        /// What to type.
        help: String,
    },

    /// Parts that should fit together do not.
    #[error("{found}; needed: {needed}")]
    Misfit {
        /// What was found, and where.
        found: String,
        /// What would fit.
        needed: String,
    },

    /// A line of text.
    #[error("line {line}: {found}; needed: {needed}")]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What was found.
        found: String,
        /// What would fit.
        needed: String,
    },
}

impl FormatProblem {
    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::NotRead { help, .. } | Self::Choose { help, .. } => Some(help.clone()),
            Self::NoSuch { there, .. } if !there.is_empty() => Some(format!("there are {there}")),
            Self::Damaged { .. } => Some("copy or write the file again".to_owned()),
            _ => None,
        }
    }

    /// The problem of the file at `path`.
    #[must_use]
    pub fn at(self, path: &str) -> FileError {
        match self {
            Self::OverBudget(problem) => FileError::OverBudget { path: path.to_owned(), problem },
            problem => FileError::Format { path: path.to_owned(), help: problem.help(), problem: Box::new(problem) },
        }
    }
}
