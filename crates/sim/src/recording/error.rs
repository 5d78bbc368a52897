//! What can be wrong with a recording: on which topic, what was found, what is needed.

/// A recording that cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The world that was to be recorded.
    #[error(transparent)]
    World(#[from] crate::error::Error),

    /// A number that no message can hold.
    #[error("{topic} at {time} ns: {what} is {value}; needed: a finite number")]
    NotFinite {
        /// The topic.
        topic: &'static str,
        /// When, in nanoseconds.
        time: u64,
        /// Name of the channel, joint, body or frame.
        what: String,
        /// The value.
        value: f64,
    },

    /// Values that do not fit the channels of the heading.
    #[error("{topic} at {time} ns: {found} values; needed: {needed}, one for each channel of the heading")]
    Length {
        /// The topic.
        topic: &'static str,
        /// When, in nanoseconds.
        time: u64,
        /// How many values there are.
        found: usize,
        /// How many channels there are.
        needed: usize,
    },

    /// A message from before the last one.
    #[error("{topic} at {time} ns: the last message is of {last} ns; time does not run backwards")]
    Backwards {
        /// The topic.
        topic: &'static str,
        /// When, in nanoseconds.
        time: u64,
        /// When the last message was.
        last: u64,
    },

    /// Two of one message that go by the same name.
    #[error("{topic}: there are two called `{name}`; a viewer would show one of them")]
    Twice {
        /// The topic.
        topic: &'static str,
        /// The name.
        name: String,
    },

    /// A robot whose description cannot be read.
    #[error("the description of robot `{robot}` cannot be read: {message}")]
    Robot {
        /// What goes before the robot's names.
        robot: String,
        /// What is wrong with it.
        message: String,
    },

    /// Bytes that could not be written.
    #[error("{topic}: the recording cannot be written")]
    Write {
        /// The topic, or the part of the file.
        topic: &'static str,
        /// Why.
        #[source]
        source: mcap::McapError,
    },
}
