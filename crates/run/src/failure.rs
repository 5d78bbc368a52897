//! What ends a command early, and with which exit code.
//!
//! | code | meaning |
//! |---|---|
//! | 0 | success |
//! | 2 | bad usage or bad input: arguments, experiment, data |
//! | 3 | the training diverged; the last good state is saved |
//! | 4 | a file could not be read or written |
//! | 5 | refused: the run folder is busy or holds a run, or experiment or data changed |
//! | 6 | the results could not be written to stdout; files are written |
//! | 129, 130, 138, 143, 152 | ended by SIGHUP, Ctrl-C, SIGUSR1, SIGTERM, SIGXCPU; the state is saved |

use std::io;
use std::ops::Range;
use std::path::Path;

use miette::{Diagnostic, NamedSource, SourceSpan};

use scrnn_data::{FileError, disk_help};

/// How a command ended that did what it could.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// All was done.
    Done,
    /// A value of the training became non-finite, and the training was rolled back.
    Diverged,
    /// Ctrl-C or another signal. Which one it was, only the program knows.
    Interrupted,
    /// Of many networks one could not be finished: the code that it would have ended with alone.
    Unfinished(u8),
}

impl Ending {
    /// The process' exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Diverged => 3,
            Self::Interrupted => 130,
            Self::Unfinished(code) => code,
        }
    }
}

/// Why a command could not do its work.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Failure {
    /// Arguments, experiment or data are not what is needed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Input(Box<BadInput>),

    /// A data file is not what is needed, or the operating system refused it.
    #[error(transparent)]
    #[diagnostic(transparent)]
    File(#[from] FileError),

    /// The operating system refused to read or write.
    #[error("cannot {action}")]
    Disk {
        /// What was tried, with the file's name.
        action: String,
        /// What the system said.
        #[source]
        source: io::Error,
        /// What to do.
        #[help]
        help: Option<&'static str>,
    },

    /// Results cannot be written to stdout: a full disk behind it, a terminal that is gone.
    #[error("cannot write the results to stdout")]
    #[diagnostic(help("files that the command writes are complete; call it again with stdout on another disk"))]
    Output {
        /// What the system said.
        #[source]
        source: io::Error,
    },

    /// The request is clear, but would do harm.
    #[error("{message}")]
    Refused {
        /// What stands against it.
        message: String,
        /// What to do.
        #[help]
        help: String,
    },

    /// Somebody asked to stop before there was anything to save.
    #[error("interrupted before anything was learned")]
    Stopped,
}

/// Bad input, with the place in the file where it is known.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{message}")]
pub struct BadInput {
    message: String,
    #[help]
    help: Option<String>,
    #[source_code]
    text: Option<NamedSource<String>>,
    #[label("{label}")]
    span: Option<SourceSpan>,
    label: String,
}

/// Shorthand for results of commands.
pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// The process' exit code.
    pub fn code(&self) -> u8 {
        match self {
            Self::File(FileError::Disk { .. }) | Self::Disk { .. } => 4,
            Self::Input(_) | Self::File(_) => 2,
            Self::Refused { .. } => 5,
            Self::Output { .. } => 6,
            Self::Stopped => Ending::Interrupted.code(),
        }
    }

    /// Bad input without a place in a file.
    pub fn input(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Input(Box::new(BadInput {
            message: message.into(),
            help: Some(help.into()).filter(|help| !help.is_empty()),
            text: None,
            span: None,
            label: String::new(),
        }))
    }

    /// Bad input at `span` of `text`, which is the file (or argument) called `name`.
    pub fn input_at(
        message: impl Into<String>,
        help: Option<String>,
        (name, text): (&str, &str),
        span: Option<Range<usize>>,
        label: impl Into<String>,
    ) -> Self {
        Self::Input(Box::new(BadInput {
            message: message.into(),
            help,
            text: Some(NamedSource::new(name, text.to_owned())),
            span: span.map(SourceSpan::from),
            label: label.into(),
        }))
    }

    /// The system's refusal to `verb` ("read", "write", ...) `path`.
    pub fn disk(verb: &str, path: &Path, source: io::Error) -> Self {
        Self::Disk { action: format!("{verb} {}", path.display()), help: disk_help(source.kind()), source }
    }

    /// A request that would do harm.
    pub fn refused(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Refused { message: message.into(), help: help.into() }
    }
}

impl From<scrnn_sim::error::Error> for Failure {
    fn from(error: scrnn_sim::error::Error) -> Self {
        match error {
            scrnn_sim::error::Error::Network(error) => error.into(),
            other => Self::input(other.to_string(), ""),
        }
    }
}

impl From<scrnn_sim::recording::RecordingError> for Failure {
    fn from(error: scrnn_sim::recording::RecordingError) -> Self {
        Self::input(format!("the recording cannot be made: {error}"), "")
    }
}

/// The library counts from 0, the program from 1 as the thesis does.
impl From<scrnn::error::Error> for Failure {
    fn from(error: scrnn::error::Error) -> Self {
        use scrnn::error::Error;
        match error {
            Error::NotFinite { sequence, step, channel, value } => Self::input(
                format!("sequence {}, sample {}, channel {channel} is {value}", sequence + 1, step + 1),
                "every sample must be a finite number; one that is missing is NaN",
            ),
            Error::SequenceTooShort { sequence, length, delay } => Self::input(
                format!(
                    "sequence {} has {length} samples; a delay of {delay} needs at least {}",
                    sequence + 1,
                    delay + 1
                ),
                "leave the sequence out, or lower `delay` in the experiment's [network]",
            ),
            Error::NoSuch { what, found, count } => Self::input(
                format!("{what} {} does not exist; there are {count}, counted from 1", found + 1),
                "`scrnn inspect` shows what there is",
            ),
            other => Self::input(other.to_string(), ""),
        }
    }
}
