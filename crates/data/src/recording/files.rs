//! The files of a recording: one, or those of a bag's folder in their order.
//!
//! | what | read |
//! |---|---|
//! | `.mcap`, `.db3` | by itself |
//! | a folder with `metadata.yaml` | the files that it names, in that order |
//! | a folder of such files | in the order of the numbers in their names |

use std::cell::Cell;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::message::{Channel, Each, Message, Schema, Trouble};
use super::sqlite::{Database, Problem, Value};
use super::{container, ros};
use crate::budget::Budget;
use crate::source::Source;
use crate::{FileError, RecordingProblem};

/// Bytes of the largest `metadata.yaml` that is read.
const LARGEST_METADATA: u64 = 16 << 20;
/// What a compressed message may unpack to, as a multiple of itself.
const LARGEST_RATIO: u64 = 1000;
/// What a zstd decoder may look back on: what every decoder grants (RFC 8878).
const WINDOW: u64 = 8 << 20;

/// What may be done on behalf of files, in numbers that are taken out of messages: each is held, named and compared, and
/// what is packed well could ask for a thousand for each byte.
#[derive(Debug)]
pub struct Effort {
    left: Cell<u64>,
}

impl Effort {
    /// Numbers that any file may hold,
    const FREE: u64 = 1 << 20;
    /// and those that it may hold for each of its bytes.
    const RATIO: u64 = 64;

    fn of_file(bytes: u64) -> Self {
        Self { left: Cell::new(Self::FREE.saturating_add(bytes.saturating_mul(Self::RATIO))) }
    }

    /// Counts a message of so many bytes and numbers.
    ///
    /// # Errors
    /// [`RecordingProblem::TooMany`].
    pub fn spend(&self, bytes: usize, numbers: usize) -> Result<(), RecordingProblem> {
        let left = self.left.get().checked_sub(16 + bytes as u64 / 16 + numbers as u64);
        self.left.set(left.ok_or(RecordingProblem::TooMany { allowed: Self::RATIO })?);
        Ok(())
    }
}

/// How a file holds messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Storage {
    Mcap,
    Sqlite,
}

impl Storage {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_ascii_lowercase();
        match extension.to_str()? {
            "mcap" => Some(Self::Mcap),
            "db3" => Some(Self::Sqlite),
            _ => None,
        }
    }
}

/// The files of one recording.
pub struct Files<'s> {
    files: Vec<(Storage, Holder<'s>)>,
    /// What may be held on their behalf.
    pub budget: Budget,
    /// What may be done on their behalf.
    pub effort: Effort,
    /// Whether each message is packed with zstd.
    packed: bool,
}

/// A file that is opened when it is its turn.
enum Holder<'s> {
    Given(&'s Source<'s>),
    Found(PathBuf),
}

impl<'s> Files<'s> {
    /// What is to be read.
    ///
    /// # Errors
    /// [`FileError`] if a folder is not as it should be.
    pub fn of(source: &'s Source<'s>) -> Result<Self, FileError> {
        if source.path().is_dir() {
            return Self::of_folder(source.path());
        }
        // The name decided already that it is a recording.
        let storage = Storage::of(source.path()).unwrap_or(Storage::Mcap);
        if storage == Storage::Sqlite {
            check_journal(source.path())?;
        }
        let bytes = source.open()?.seek(std::io::SeekFrom::End(0));
        let bytes = bytes.map_err(|error| FileError::disk("read", source.path(), error))?;
        Ok(Self {
            files: vec![(storage, Holder::Given(source))],
            budget: Budget::of_file(bytes),
            effort: Effort::of_file(bytes),
            packed: false,
        })
    }

    fn of_folder(folder: &Path) -> Result<Self, FileError> {
        let metadata = Metadata::of(folder)?;
        let (mut files, mut bytes) = (Vec::new(), 0_u64);
        for path in &metadata.files {
            let length = std::fs::metadata(path).map_err(|error| FileError::disk("read", path, error))?.len();
            bytes = bytes.saturating_add(length);
            let Some(storage) = Storage::of(path) else {
                return Err(wrong(
                    folder,
                    RecordingProblem::Bag(format!("its file `{}` is neither .mcap nor .db3", path.display())),
                ));
            };
            if storage == Storage::Sqlite {
                check_journal(path)?;
            }
            files.push((storage, Holder::Found(path.clone())));
        }
        Ok(Self { files, budget: Budget::of_file(bytes), effort: Effort::of_file(bytes), packed: metadata.packed })
    }

    /// The files, as people would name them.
    pub fn names(&self) -> Vec<String> {
        let name = |(_, holder): &(Storage, Holder<'_>)| match holder {
            Holder::Given(source) => source.name().to_owned(),
            Holder::Found(path) => path.display().to_string(),
        };
        self.files.iter().map(name).collect()
    }

    /// Calls `each` with all messages, file after file.
    ///
    /// # Errors
    /// [`Trouble`], and which file it was.
    pub fn messages(&self, each: &mut Each<'_>) -> Result<(), (String, Trouble)> {
        let mut count = 0;
        for ((storage, holder), name) in self.files.iter().zip(self.names()) {
            let in_file = |trouble| (name.clone(), trouble);
            let opened: Result<Box<dyn crate::source::ReadSeek + '_>, Trouble> = match holder {
                Holder::Given(source) => source.open().map_err(|error| Trouble::File(Box::new(error))),
                Holder::Found(path) => match std::fs::File::open(path) {
                    Ok(file) => Ok(Box::new(file)),
                    Err(error) => Err(Trouble::File(Box::new(FileError::disk("read", path, error)))),
                },
            };
            let opened = opened.map_err(in_file)?;
            let mut unpacked = Vec::new();
            let mut left = (1_u64 << 22).saturating_add(self.budget.left());
            let mut unpacking = |message: &Message<'_>| {
                let broken = |error: &dyn std::fmt::Display| RecordingProblem::Compression {
                    compression: "zstd".to_owned(),
                    message: error.to_string(),
                };
                unpacked.clear();
                let most = LARGEST_RATIO.saturating_mul(message.data.len() as u64).min(left);
                let stream = ruzstd::decoding::StreamingDecoder::new_with_max_window_size(message.data, WINDOW);
                let stream = stream.map_err(|error| broken(&error))?;
                stream.take(most).read_to_end(&mut unpacked).map_err(|error| broken(&error))?;
                left -= unpacked.len() as u64;
                each(&Message { data: &unpacked, ..*message })
            };
            let each: &mut Each<'_> = if self.packed { &mut unpacking } else { &mut *each };
            match storage {
                Storage::Mcap => container::messages(opened, &mut count, each),
                Storage::Sqlite => sqlite_messages(opened, &mut count, each),
            }
            .map_err(in_file)?;
        }
        Ok(())
    }
}

fn wrong(path: &Path, problem: RecordingProblem) -> FileError {
    super::refusal(&path.display().to_string(), problem)
}

/// Refuses a database whose newest rows are still in a journal beside it.
fn check_journal(path: &Path) -> Result<(), FileError> {
    let mut journal = path.as_os_str().to_owned();
    journal.push("-wal");
    match std::fs::metadata(&journal) {
        Ok(found) if found.len() > 0 => {
            Err(wrong(path, RecordingProblem::Journal { path: path.display().to_string() }))
        }
        _ => Ok(()),
    }
}

/// The messages of a bag of rosbag2's older kind.
fn sqlite_messages<R: Read + Seek>(reader: R, count: &mut usize, each: &mut Each<'_>) -> Result<(), Trouble> {
    let mut database = Database::open(reader)?;
    let mut definitions = std::collections::HashMap::new();
    database.rows("message_definitions", &["topic_type", "encoding", "encoded_message_definition"], &mut |row| {
        if let [Value::Text(name), Value::Text(language), Value::Text(text)] = row {
            let description = (String::from_utf8_lossy(language).into_owned(), text.to_vec());
            definitions.insert(ros::definition::plain(&String::from_utf8_lossy(name)), description);
        }
        Ok::<(), Trouble>(())
    })?;
    let mut channels = std::collections::HashMap::new();
    let mut schemas = std::collections::HashMap::new();
    let found = database.rows("topics", &["id", "name", "type", "serialization_format"], &mut |row| {
        if let [Value::Whole(id), Value::Text(topic), Value::Text(name), Value::Text(encoding)] = row {
            let name = String::from_utf8_lossy(name).into_owned();
            let schema = schemas.entry(name).or_insert_with_key(|name| {
                let (language, description) =
                    definitions.get(&ros::definition::plain(name)).cloned().unwrap_or_default();
                Rc::new(Schema { name: name.clone(), language, description })
            });
            let (topic, encoding) =
                (String::from_utf8_lossy(topic).into_owned(), String::from_utf8_lossy(encoding).into_owned());
            channels.insert(*id, Rc::new(Channel { topic, encoding, schema: Rc::clone(schema) }));
        }
        Ok::<(), Trouble>(())
    })?;
    let in_topics = found;
    let found = database.rows("messages", &["topic_id", "timestamp", "data"], &mut |row| {
        let [Value::Whole(topic), Value::Whole(time), Value::Bytes(data)] = row else {
            return Err(RecordingProblem::Damaged("a row of `messages` holds no message").into());
        };
        *count += 1;
        let damaged = RecordingProblem::Damaged("a message belongs to a topic that is not there");
        let channel = channels.get(topic).ok_or(damaged)?;
        each(&Message { channel, logged: *time, published: *time, number: *count, expected: 0, data })
    })?;
    if in_topics && found { Ok(()) } else { Err(RecordingProblem::NoBag.into()) }
}

impl From<Problem> for Trouble {
    fn from(problem: Problem) -> Self {
        match problem {
            Problem::Wrong(what) => RecordingProblem::Database(what).into(),
            Problem::Disk(error) => Self::Disk(error),
        }
    }
}

/// Whether a folder is one recording.
pub fn is_bag(folder: &Path) -> bool {
    let mut start = Vec::new();
    let file = std::fs::File::open(folder.join(METADATA));
    let read = file.and_then(|file| file.take(1 << 12).read_to_end(&mut start));
    read.is_ok() && String::from_utf8_lossy(&start).contains(MARK)
}

const METADATA: &str = "metadata.yaml";
/// The key under which rosbag2 writes all it knows.
const MARK: &str = "rosbag2_bagfile_information";

/// What a bag's folder says of itself.
struct Metadata {
    files: Vec<PathBuf>,
    packed: bool,
}

impl Metadata {
    fn of(folder: &Path) -> Result<Self, FileError> {
        let path = folder.join(METADATA);
        let file = std::fs::File::open(&path).map_err(|error| FileError::disk("read", &path, error))?;
        let mut bytes = Vec::new();
        let read = file.take(LARGEST_METADATA).read_to_end(&mut bytes);
        read.map_err(|error| FileError::disk("read", &path, error))?;
        let text =
            String::from_utf8(bytes).map_err(|_| wrong(&path, RecordingProblem::Bag("it is not UTF-8".into())))?;
        let (names, packed) = parse(&text).map_err(|why| wrong(&path, RecordingProblem::Bag(why)))?;
        let mut files = Vec::with_capacity(names.len());
        for name in names {
            // Old bags name files from the folder's parent, and nobody leaves the folder.
            let file = Path::new(&name).file_name().map(|name| folder.join(name));
            let file = file.filter(|file| file.is_file()).ok_or_else(|| {
                wrong(
                    &path,
                    RecordingProblem::Bag(format!(
                        "it names `{}`, which is not in the folder",
                        crate::excerpt::shortened(&name)
                    )),
                )
            })?;
            files.push(file);
        }
        Ok(Self { files, packed })
    }
}

/// The files that a `metadata.yaml` names, and whether messages are packed.
///
/// # Errors
/// What cannot be read, as a sentence.
pub fn parse(text: &str) -> Result<(Vec<String>, bool), String> {
    let unquoted = |text: &str| text.trim().trim_matches(['\'', '"']).to_owned();
    let (mut files, mut listing) = (Vec::new(), None);
    let (mut mode, mut format) = (String::new(), String::new());
    for line in text.lines() {
        let (inside, indent) = (line.trim(), line.len() - line.trim_start().len());
        if inside.is_empty() || inside.starts_with('#') {
            continue;
        }
        if let Some(key_indent) = listing {
            match inside.strip_prefix("- ") {
                Some(name) if indent >= key_indent => {
                    files.push(unquoted(name));
                    continue;
                }
                _ => listing = None,
            }
        }
        if let Some(rest) = inside.strip_prefix("relative_file_paths:") {
            files.clear();
            match rest.trim().strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                Some(list) => files.extend(list.split(',').map(unquoted).filter(|name| !name.is_empty())),
                None => listing = Some(indent),
            }
        } else if let Some(rest) = inside.strip_prefix("compression_mode:") {
            mode = unquoted(rest).to_ascii_lowercase();
        } else if let Some(rest) = inside.strip_prefix("compression_format:") {
            format = unquoted(rest).to_ascii_lowercase();
        }
    }
    let mut met = std::collections::HashSet::new();
    if let Some(twice) = files.iter().find(|file| !met.insert(file.as_str())) {
        return Err(format!("it names `{}` twice", crate::excerpt::shortened(twice)));
    }
    if files.is_empty() {
        return Err("it names no files; `ros2 bag reindex` makes it anew".to_owned());
    }
    match (mode.as_str(), format.as_str()) {
        ("" | "none", _) | (_, "") => Ok((files, false)),
        // Files of bags that were packed as a whole end in `.zstd`, and are refused for that.
        ("message", "zstd") => Ok((files, true)),
        ("file", _) => Err(format!("its files are packed ({format}); `zstd -d` unpacks them, or `ros2 bag convert`")),
        _ => Err(format!("its messages are packed ({format}); known: zstd; `ros2 bag convert` writes others")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_those_that_are_named_in_their_order() {
        let indented = "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n    - b_0.mcap\n    - 'b 1.mcap'\n  files:\n  - path: x\n";
        assert_eq!(parse(indented), Ok((vec!["b_0.mcap".into(), "b 1.mcap".into()], false)));
        let flat = "a:\n  relative_file_paths:\n  - \"bag.db3\"\n  ros_distro: x\n  compression_mode: MESSAGE\n  compression_format: zstd\n";
        assert_eq!(parse(flat), Ok((vec!["bag.db3".into()], true)));
        assert_eq!(parse("relative_file_paths: [a.mcap, b.mcap]\n").unwrap().0, ["a.mcap", "b.mcap"]);
        assert!(parse("relative_file_paths: []\n").unwrap_err().contains("names no files"));
        assert!(parse("").is_err());
        assert!(parse("relative_file_paths: [a.mcap, a.mcap]\n").unwrap_err().contains("`a.mcap` twice"));
        let whole = "relative_file_paths:\n- a.db3.zstd\ncompression_mode: FILE\ncompression_format: zstd\n";
        assert!(parse(whole).unwrap_err().contains("zstd -d"));
    }
}
