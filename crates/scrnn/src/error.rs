//! What can be wrong with a request: found, where, and needed.
//!
//! A training that diverges is not an error but an outcome, see [`crate::learning::Outcome`].

/// A request that cannot be served.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A network without context units, channels, or with a senseless constant.
    #[error("topology: {what} is {found}; needed: {needed}")]
    Topology {
        /// The setting.
        what: String,
        /// Its value.
        found: String,
        /// What would do.
        needed: &'static str,
    },

    /// A setting of an algorithm lies outside of its range.
    #[error("{what} is {found}; needed: {needed}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        found: String,
        /// What would do.
        needed: &'static str,
    },

    /// A list has another length than the network or the data asks for.
    #[error("{what} holds {found} values; needed: {needed}")]
    Length {
        /// The list.
        what: String,
        /// Its length.
        found: usize,
        /// The length asked for.
        needed: usize,
    },

    /// A data set without sequences.
    #[error("the data set holds no sequence; needed: at least one")]
    NoSequences,

    /// A sample that is infinite.
    #[error(
        "sequence {sequence}, step {step}, channel {channel} is {value}; needed: a finite number, or NaN for a missing value"
    )]
    NotFinite {
        /// Index of the sequence, from 0.
        sequence: usize,
        /// Index of the sample in it, from 0.
        step: usize,
        /// Name of the channel.
        channel: String,
        /// The value found.
        value: f64,
    },

    /// Nothing is left to predict once the delay is taken off.
    #[error("sequence {sequence} has {length} samples; a delay of {delay} needs at least {}", delay + 1)]
    SequenceTooShort {
        /// Index of the sequence, from 0.
        sequence: usize,
        /// Its number of samples.
        length: usize,
        /// The delay xi.
        delay: usize,
    },

    /// An index beyond the end.
    #[error("{what} {found} does not exist; there are {count}, counted from 0")]
    NoSuch {
        /// The kind of thing.
        what: &'static str,
        /// The index asked for.
        found: usize,
        /// How many there are.
        count: usize,
    },

    /// A file that is not what this version reads.
    #[error("checkpoint: {0}")]
    Checkpoint(String),

    /// An instruction set that this processor or this build lacks.
    #[error("the instruction set {0} is not available here; available: {1}")]
    InstructionSet(String, String),
}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;
