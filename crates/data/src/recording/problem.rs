//! What can be wrong with a recording, and what to do about it.

use crate::excerpt::shortened;

/// What is wrong with a recording.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RecordingProblem {
    /// Other contents.
    #[error("this is not an MCAP file")]
    NotMcap,

    /// A format that did not exist when this was written.
    #[error("version {found} of MCAP; known: 0")]
    Version {
        /// The version, a character.
        found: String,
    },

    /// No end.
    #[error("the recording is cut off")]
    CutOff,

    /// Contents that contradict themselves.
    #[error("the recording is damaged: {0}")]
    Damaged(&'static str),

    /// A chunk or message that cannot be unpacked.
    #[error("a chunk cannot be unpacked ({compression}): {message}")]
    Compression {
        /// How it is packed.
        compression: String,
        /// What is wrong with it.
        message: String,
    },

    /// A way to pack chunks that is not known.
    #[error("its chunks are packed as `{}`; known: zstd, lz4, and unpacked ones", shortened(found))]
    UnknownCompression {
        /// How they are packed.
        found: String,
    },

    /// A file that fills the memory.
    #[error("it promises to unpack to {unpacked} bytes; a file of its size may unpack to {allowed}")]
    TooLarge {
        /// What it says.
        unpacked: u64,
        /// What is granted.
        allowed: u64,
    },

    /// A file that takes very long.
    #[error("it is packed so well that its messages hold more than {allowed} numbers for each of its bytes")]
    TooMany {
        /// What is granted.
        allowed: u64,
    },

    /// A database that cannot be read.
    #[error("{0}")]
    Database(String),

    /// A database of something else.
    #[error("this database is no bag: it has no tables `topics` and `messages`")]
    NoBag,

    /// A database whose newest rows are not in it yet.
    #[error("its newest messages are still in `{path}-wal`, beside it")]
    Journal {
        /// The database.
        path: String,
    },

    /// A bag's folder that is not as it should be.
    #[error("this is no whole bag: {0}")]
    Bag(String),

    /// A bag of ROS 1.
    #[error("this is a bag of ROS 1, which is not read")]
    Ros1 {
        /// Its path without the extension.
        stem: String,
    },

    /// No messages at all.
    #[error("the recording holds no messages")]
    Empty,

    /// A topic that is not there.
    #[error("there is no topic `{}`", shortened(found))]
    NoTopic {
        /// What is asked for.
        found: String,
        /// What there is.
        topics: String,
        /// One that could be meant.
        example: String,
    },

    /// Several topics, and none asked for.
    #[error("it is not clear which topic is meant")]
    WhichTopic {
        /// What there is.
        topics: String,
        /// One that could be meant.
        example: String,
    },

    /// Messages that cannot be read.
    #[error("its messages {why}")]
    Encoding {
        /// Why, as the end of a sentence.
        why: String,
    },

    /// A message that cannot be read.
    #[error("message {number}, of {time} s, {message}")]
    Message {
        /// Its number among all of the file.
        number: usize,
        /// When it was logged, in seconds.
        time: String,
        /// What is wrong with it.
        message: String,
    },

    /// Messages without numbers.
    #[error("the messages hold no numbers")]
    NoNumbers,

    /// A channel that is asked for, but not there.
    #[error("there is no channel `{}`", shortened(found))]
    NoChannel {
        /// What is asked for.
        found: String,
        /// What there is.
        channels: String,
    },

    /// A channel that is asked for, and there in several topics.
    #[error("`{}` is in several topics", shortened(found))]
    Ambiguous {
        /// What is asked for.
        found: String,
        /// What could be meant.
        channels: String,
    },

    /// Times that are asked for, but not there.
    #[error("its messages {why}")]
    NoStamps {
        /// Why, as the end of a sentence.
        why: String,
    },

    /// Messages at uneven times, and no period.
    #[error(
        "sequence {sequence}: messages were logged in bursts of about {burst}, and nothing else tells when they were made"
    )]
    Bursts {
        /// The sequence.
        sequence: String,
        /// How many come at once.
        burst: usize,
    },

    /// A period that does not suit the messages, or messages that do not go together.
    #[error("sequence {sequence}: {message}")]
    Resampling {
        /// The sequence.
        sequence: String,
        /// What was found.
        message: String,
    },

    /// Several topics, whose times are not to be looked at.
    #[error("several kinds of messages are joined by their times, which `time = \"rows\"` forbids")]
    RowsOfSeveral,
}

impl RecordingProblem {
    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::CutOff => {
                "the program that recorded it may have been killed; `mcap recover` saves what is there".to_owned()
            }
            Self::UnknownCompression { .. } => "`mcap compress --compression zstd` changes it".to_owned(),
            Self::TooMany { .. } => "if it is not damaged, `mcap decompress` unpacks it".to_owned(),
            Self::Journal { path } => {
                format!("`sqlite3 {path} \"PRAGMA wal_checkpoint(TRUNCATE)\"` moves them into it")
            }
            Self::Ros1 { stem } => format!(
                "`pip install rosbags`, then `rosbags-convert --src {stem}.bag --dst {stem}` makes a bag of ROS 2 of it, which is read"
            ),
            Self::NoBag => "bags of ROS 2 end in .mcap or .db3".to_owned(),
            Self::Encoding { .. } => {
                "read are JSON, ROS 2 (cdr with a definition in ros2msg or ros2idl), and protobuf with its descriptors"
                    .to_owned()
            }
            Self::NoTopic { topics, example, .. } | Self::WhichTopic { topics, example } => format!(
                "say with `--topic {example}`, or `topics = [\"{example}\"]` in the experiment's [data], which to take; several are joined: {topics}"
            ),
            Self::NoStamps { .. } => "`time = \"log\"` goes by the times of logging".to_owned(),
            Self::Bursts { .. } => {
                "`time = \"rows\"` takes the messages as even steps; a period would make stairs of them".to_owned()
            }
            Self::Resampling { .. } => "choose another period or other channels, or cut the recording".to_owned(),
            Self::NoChannel { channels, .. } => format!("there are {channels}"),
            Self::Ambiguous { channels, .. } => format!("write {channels}"),
            Self::RowsOfSeveral => "leave it out, or take a single topic".to_owned(),
            _ => return None,
        })
    }
}
