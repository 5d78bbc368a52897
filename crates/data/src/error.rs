//! What can be wrong with a data file: where, what was found, what is needed.

use std::io;
use std::path::Path;

use miette::{Diagnostic, NamedSource, SourceSpan};

use crate::budget::OverBudget;
use crate::problem::FormatProblem;
use crate::recording::RecordingProblem;

/// A data file that cannot be read or written.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum FileError {
    /// The operating system refused.
    #[error("cannot {verb} {path}")]
    Disk {
        /// What was tried.
        verb: &'static str,
        /// The file.
        path: String,
        /// What the system said.
        #[source]
        source: io::Error,
        /// What to do.
        #[help]
        help: Option<&'static str>,
    },

    /// More bytes than can be held.
    #[error("{path} has more than the {most} MB that {what}")]
    #[diagnostic(help("give a smaller file, or a part of it"))]
    TooLarge {
        /// The file.
        path: String,
        /// What would fit.
        most: u64,
        /// What of.
        what: &'static str,
    },

    /// The extension does not tell a format.
    #[error("the name of {path} does not tell what the file holds")]
    #[diagnostic(help("data files end in {known}"))]
    Extension {
        /// The file.
        path: String,
        /// The extensions that are known.
        known: String,
    },

    /// A pattern or a folder without data files.
    #[error("{what}: {pattern}")]
    #[diagnostic(help("check the spelling; paths start from the folder of the experiment file, or the current one"))]
    NoMatch {
        /// The pattern.
        pattern: String,
        /// What is missing.
        what: &'static str,
    },

    /// A file that was to hold text.
    #[error("{path} is not plain text: it {found}")]
    #[diagnostic(help("save the table as CSV in UTF-8"))]
    NotText {
        /// The file.
        path: String,
        /// What gave it away.
        found: &'static str,
    },

    /// No samples.
    #[error("{path} holds no samples; needed: at least one")]
    Empty {
        /// The file.
        path: String,
    },

    /// A header that names no channel.
    #[error("{path} has no column of samples; its header names only {columns}")]
    #[diagnostic(help("`sequence`, `step`, `time` and an unnamed first column are not samples"))]
    NoChannel {
        /// The file.
        path: String,
        /// The columns there are.
        columns: String,
    },

    /// A line that cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Line(Box<LineError>),

    /// An array that cannot be read.
    #[error("{path}: {problem}")]
    Array {
        /// The file, and the member of an archive.
        path: String,
        /// What is wrong.
        problem: ArrayProblem,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// An array with a value that is NaN or infinite.
    #[error("{path}: sequence {sequence}, step {sample}, channel {channel} is {value}")]
    #[diagnostic(help(
        "every sample must be a finite number; a missing one is NaN, empty or null, unless `missing = \"refuse\"` is set"
    ))]
    NotFinite {
        /// The file.
        path: String,
        /// Name of the sequence.
        sequence: String,
        /// Number of the sample in it, from 1.
        sample: usize,
        /// Name of the channel.
        channel: String,
        /// The value.
        value: f64,
    },

    /// A `.npz` that is no archive, or a damaged one.
    #[error("{path} cannot be read as a .npz archive")]
    Archive {
        /// The file.
        path: String,
        /// What is wrong with it.
        #[source]
        source: zip::result::ZipError,
    },

    /// An archive whose members share bytes, so that it would unpack to far more than it has.
    #[error("{path} is a damaged archive: its members overlap")]
    Overlap {
        /// The file.
        path: String,
    },

    /// A recording that cannot be read.
    #[error("{path}: {problem}")]
    Recording {
        /// The file, and the topic.
        path: String,
        /// What is wrong.
        problem: Box<RecordingProblem>,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// An option that makes sense for other formats only.
    #[error("{path} is a {format}; `{option}` goes with {known} only")]
    #[diagnostic(help("leave it out"))]
    UnknownOption {
        /// The file.
        path: String,
        /// What kind of file it is.
        format: &'static str,
        /// The option.
        option: &'static str,
        /// Extensions of the formats that know it.
        known: String,
    },

    /// A file that would fill the memory.
    #[error("{path}: {problem}")]
    #[diagnostic(help("it may be damaged; if it is not, unpack it or cut it into several files"))]
    OverBudget {
        /// The file.
        path: String,
        /// How much it would take.
        problem: OverBudget,
    },

    /// Times that are not even, or cannot be made so.
    #[error("{path}, sequence {sequence}: {found}; steps are equally spaced")]
    #[diagnostic(help("{help}"))]
    Times {
        /// The file.
        path: String,
        /// The sequence.
        sequence: String,
        /// What was found.
        found: String,
        /// What to do.
        help: String,
    },

    /// A period for data of which nobody knows when they were taken.
    #[error("{path} does not tell when its samples were taken, so they cannot be brought to a period")]
    #[diagnostic(help("leave `period` out, or add a column `time` in seconds"))]
    NoClock {
        /// The file.
        path: String,
    },

    /// A file that tells times is to be written, and nobody knows them.
    #[error("{path} cannot be written: nothing tells how many seconds there are between two samples")]
    #[diagnostic(help("say it: `--period 0.02` for 50 samples a second"))]
    NoPeriod {
        /// The file.
        path: String,
    },

    /// Files whose channels do not go together.
    #[error(transparent)]
    #[diagnostic(transparent)]
    ChannelsDiffer(Box<ChannelsError>),

    /// A channel that is asked for, but not there.
    #[error("{path} has no channel `{found}`")]
    #[diagnostic(help("its channels are {channels}"))]
    NoSuchChannel {
        /// The file.
        path: String,
        /// What is asked for.
        found: String,
        /// What there is.
        channels: String,
    },

    /// A format that can be read only.
    #[error("{path} cannot be written: files of this kind are only read")]
    #[diagnostic(help(
        "write .csv, .txt, .npz, .npy, .parquet or .mcap, or a name without an extension: the folder of a LeRobot data set"
    ))]
    OnlyRead {
        /// The file.
        path: String,
    },

    /// Fields that do not stand side by side.
    #[error("{path}: the fields `{first}` and `{other}` differ in the lengths of their sequences")]
    FieldsDiffer {
        /// The file.
        path: String,
        /// The first field.
        first: String,
        /// The one that differs.
        other: String,
    },

    /// More than one array for a `.npy`.
    #[error("{path}: a .npy file holds one array, but there are {found} to write")]
    #[diagnostic(help("write a .npz file, or a .csv"))]
    SeveralFields {
        /// The file.
        path: String,
        /// How many.
        found: usize,
    },

    /// Sequences of different lengths for a `.npy`.
    #[error("{path}: the sequences have from {shortest} to {longest} samples; a .npy file needs equal lengths")]
    #[diagnostic(help("write a .npz file, which holds an array for each sequence"))]
    Ragged {
        /// The file.
        path: String,
        /// Least samples.
        shortest: usize,
        /// Most samples.
        longest: usize,
    },

    /// A file of a format that is known, but not read.
    #[error("{path} is {what}, which is not read here")]
    #[diagnostic(help("{help}"))]
    Elsewhere {
        /// The file.
        path: String,
        /// What it is.
        what: &'static str,
        /// What turns it into one that is read.
        help: String,
    },

    /// A file of a format that others made.
    #[error("{path}: {problem}")]
    Format {
        /// The file.
        path: String,
        /// What is wrong.
        problem: Box<FormatProblem>,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// Values that make no data set.
    #[error("{path}")]
    Data {
        /// The file.
        path: String,
        /// Why.
        #[source]
        source: scrnn::error::Error,
    },
}

impl FileError {
    /// The system's refusal to `verb` the file at `path`.
    pub fn disk(verb: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Disk { verb, path: path.display().to_string(), help: disk_help(source.kind()), source }
    }
}

/// What to do about a refusal of the operating system.
pub fn disk_help(kind: io::ErrorKind) -> Option<&'static str> {
    match kind {
        io::ErrorKind::NotFound => {
            Some("check the spelling, and that the folder is still there; paths start from the current folder")
        }
        io::ErrorKind::PermissionDenied => Some("check who owns the file and its folder"),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Some("make room on the disk and try again"),
        io::ErrorKind::FileTooLarge => Some("a limit forbids files of this size: `ulimit -f` shows it"),
        io::ErrorKind::ReadOnlyFilesystem => Some("the disk is mounted for reading only: choose another folder"),
        io::ErrorKind::NotADirectory => Some("part of the path is a file, not a folder"),
        _ => None,
    }
}

/// Files whose channels do not go together.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("the channels of {path} are {found}; those of {first} are {needed}")]
pub struct ChannelsError {
    /// The file that differs.
    pub path: String,
    /// Its channels.
    pub found: String,
    /// The first file.
    pub first: String,
    /// The channels of that.
    pub needed: String,
    /// What to do.
    #[help]
    pub help: String,
}

/// A line of a text file that cannot be read, with the text around it.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{path}, line {line}: {problem}")]
pub struct LineError {
    /// The file.
    pub path: String,
    /// Number of the line, from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: LineProblem,
    /// What to do.
    #[help]
    pub help: Option<String>,
    /// The file, or of a large one the lines around the place.
    #[source_code]
    pub text: NamedSource<String>,
    /// The place in it.
    #[label("{}", problem.label())]
    pub span: SourceSpan,
}

/// What is wrong with a line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LineProblem {
    /// Another number of fields than the lines before.
    #[error("{found} fields; needed: {needed}, as in line {first}")]
    FieldCount {
        /// Fields of this line.
        found: usize,
        /// Fields of the first line.
        needed: usize,
        /// Number of the first line.
        first: usize,
    },

    /// What could mean several things.
    #[error("{what}")]
    Ambiguous {
        /// What it could be, and what to do.
        what: &'static str,
    },

    /// Something else than a number.
    #[error("`{found}` in column {column} is not a number")]
    NotANumber {
        /// What stands there.
        found: String,
        /// Name of the channel.
        column: String,
    },

    /// NaN, infinity, or nothing at all.
    #[error("sequence {sequence}, step {sample}, channel {channel} is {found}")]
    NotFinite {
        /// Name of the sequence.
        sequence: String,
        /// Number of the sample in it, from 1.
        sample: usize,
        /// Name of the channel.
        channel: String,
        /// What stands there.
        found: String,
    },
}

impl LineProblem {
    /// The words under the caret.
    fn label(&self) -> String {
        match self {
            Self::FieldCount { found, needed, .. } => format!("{found} instead of {needed} fields"),
            Self::Ambiguous { .. } => "this line".to_owned(),
            Self::NotANumber { .. } => "not a number".to_owned(),
            Self::NotFinite { .. } => "not a finite number".to_owned(),
        }
    }
}

/// What is wrong with a numpy array.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArrayProblem {
    /// Other contents.
    #[error("this is not a numpy array")]
    NotNumpy,

    /// A format that did not exist when this was written.
    #[error("version {major}.{minor} of the numpy format; known: 1.0, 2.0, 3.0")]
    Version {
        /// The first number.
        major: u8,
        /// The second number.
        minor: u8,
    },

    /// A header that ends early, or is not numpy's.
    #[error("the array's header is damaged: {0}")]
    Header(&'static str),

    /// Elements that are not numbers.
    #[error("an array of type `{}`; needed: floats, integers or booleans", super::excerpt::shortened(found))]
    Type {
        /// The type as numpy writes it.
        found: String,
    },

    /// Too many axes, or none.
    #[error("an array of shape {found}; needed: {needed}")]
    Shape {
        /// The shape as numpy writes it.
        found: String,
        /// What would do.
        needed: &'static str,
    },

    /// More channels than steps: the axes may be another way round.
    #[error("an array of shape {shape} would be {channels} channels of {steps} steps; it may be the other way round")]
    MoreChannels {
        /// The shape as numpy writes it.
        shape: String,
        /// Channels.
        channels: usize,
        /// Steps.
        steps: usize,
    },

    /// The first axis looks like the steps of one recording.
    #[error("an array of shape {shape} may be one recording: its values go on smoothly along the first axis")]
    FirstAxisIsTime {
        /// The shape as numpy writes it.
        shape: String,
    },

    /// Axes that do not fit.
    #[error("`axes = \"{axes}\"` does not fit {found}")]
    Axes {
        /// What was asked for.
        axes: String,
        /// What there is.
        found: String,
    },

    /// An array that is asked for, but not there.
    #[error("there is no array `{found}`")]
    NoArray {
        /// What is asked for.
        found: String,
    },

    /// Arrays that do not go together.
    #[error("its arrays differ in lengths and channels: {found}")]
    Lengths {
        /// The arrays with their shapes.
        found: String,
    },

    /// More or fewer bytes than the shape says.
    #[error("the array's header promises {promised} bytes, but {held} follow")]
    Size {
        /// Bytes that type and shape ask for.
        promised: String,
        /// Bytes that are there.
        held: usize,
    },
}
