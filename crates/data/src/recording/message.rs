//! Messages as they come out of a file of a recording, whatever kind of file it is.

use std::io;
use std::rc::Rc;

use crate::budget::OverBudget;
use crate::{FileError, RecordingProblem};

/// Where messages of one kind go.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// How its messages are encoded, e.g. `json`, `cdr`, `protobuf`.
    pub encoding: String,
    /// Their type.
    pub schema: Rc<Schema>,
}

/// A type of messages.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Schema {
    /// Its name; empty if nothing tells it.
    pub name: String,
    /// In which language it is described, e.g. `ros2msg`.
    pub language: String,
    /// The description.
    pub description: Vec<u8>,
}

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its channel.
    pub channel: &'a Rc<Channel>,
    /// When it was logged, in nanoseconds.
    pub logged: i64,
    /// When it was published, in nanoseconds.
    pub published: i64,
    /// Its number among all of the recording, from 1.
    pub number: usize,
    /// How many of its channel the file tells of; 0 if it does not. It may tell anything.
    pub expected: u64,
    /// What it says.
    pub data: &'a [u8],
}

/// What is done with each message.
pub type Each<'e> = dyn FnMut(&Message<'_>) -> Result<(), Trouble> + 'e;

/// What ends the reading of a recording.
#[derive(Debug)]
pub enum Trouble {
    /// Something is wrong with it.
    Problem(Box<RecordingProblem>),
    /// Something is wrong with the messages of a topic.
    Topic(String, Box<RecordingProblem>),
    /// One of its files cannot be opened.
    File(Box<FileError>),
    /// It would fill the memory.
    Memory(OverBudget),
    /// The operating system refused.
    Disk(io::Error),
}

impl From<RecordingProblem> for Trouble {
    fn from(problem: RecordingProblem) -> Self {
        Self::Problem(Box::new(problem))
    }
}

impl From<OverBudget> for Trouble {
    fn from(problem: OverBudget) -> Self {
        Self::Memory(problem)
    }
}

impl From<io::Error> for Trouble {
    fn from(error: io::Error) -> Self {
        Self::Disk(error)
    }
}

/// A time as programs write it, which is never below zero, as it goes here. What is beyond the year 2262 is no time.
pub fn nanoseconds(time: u64) -> i64 {
    i64::try_from(time).unwrap_or(i64::MAX)
}
