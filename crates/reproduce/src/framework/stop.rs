//! How a reproduction ends early: a person asked for it, or something failed. Both travel with `?`.

use scrnn_run::failure::Failure;

/// Why there is no result.
#[derive(Debug)]
pub enum Stop {
    /// Somebody asked to stop.
    Interrupted,
    /// Something is wrong.
    Failed(Failure),
}

/// Shorthand for what can be interrupted.
pub type Result<T> = std::result::Result<T, Stop>;

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Stopped => Self::Interrupted,
            failure => Self::Failed(failure),
        }
    }
}

impl From<scrnn::error::Error> for Stop {
    fn from(error: scrnn::error::Error) -> Self {
        Self::Failed(error.into())
    }
}

impl From<scrnn_sim::error::Error> for Stop {
    fn from(error: scrnn_sim::error::Error) -> Self {
        Self::Failed(error.into())
    }
}

impl From<scrnn_data::FileError> for Stop {
    fn from(error: scrnn_data::FileError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<scrnn_sim::recording::RecordingError> for Stop {
    fn from(error: scrnn_sim::recording::RecordingError) -> Self {
        Self::Failed(error.into())
    }
}
