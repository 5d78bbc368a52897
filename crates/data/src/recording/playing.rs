//! All messages of a recording one after the other, for who shows them: whatever they were encoded as, they come as JSON.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use serde_json::{Map, Value};

use super::decoding::Decoder;
use super::files::Files;
use super::message::{Channel, Trouble};
use super::refusal_of;
use super::tree::Tree;
use crate::source::Source;
use crate::{FileError, RecordingProblem};

/// A message that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Told<'a> {
    /// Its topic.
    pub topic: &'a str,
    /// Its type, e.g. `foxglove.SceneUpdate` or `sensor_msgs/msg/JointState`; empty if nothing tells it.
    pub of: &'a str,
    /// When it was logged, in nanoseconds.
    pub time: i64,
    /// What it says. Numbers that are not finite are null.
    pub value: Value,
}

/// Goes through the messages of a recording, in its order, and hands over those of topics and types that are `wanted`. Topics that are
/// not, and types that nobody can read, cost nothing; the latter are returned with the reason. With `bytes`, these are what stands in
/// the file.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn play(
    path: &Path,
    bytes: Option<&[u8]>,
    wanted: &dyn Fn(&str, &str) -> bool,
    each: &mut dyn FnMut(Told<'_>),
) -> Result<Vec<String>, FileError> {
    let source = match bytes {
        Some(bytes) => Source::of_bytes(path, bytes),
        None => Source::at(path)?,
    };
    let files = Files::of(&source)?;
    let mut decoders: HashMap<Rc<Channel>, Option<Decoder>> = HashMap::new();
    let mut unread = Vec::new();
    let result = files.messages(&mut |message| {
        let channel = message.channel;
        if !wanted(&channel.topic, &channel.schema.name) {
            return Ok(());
        }
        let decoder = match decoders.get(channel) {
            Some(decoder) => decoder.clone(),
            None => {
                let decoder = Decoder::of(channel).map_err(|why| unread.push(format!("{}: {why}", channel.topic))).ok();
                decoders.insert(Rc::clone(channel), decoder.clone());
                decoder
            }
        };
        let Some(decoder) = decoder else { return Ok(()) };
        // A message may be compressed well: what is held of it is counted as for any reader.
        files.effort.spend(message.data.len(), message.data.len() / 2)?;
        let tree = decoder.read(message.data).map_err(|why| {
            let problem = RecordingProblem::Encoding { why: format!("message {} {why}", message.number) };
            Trouble::Topic(channel.topic.clone(), Box::new(problem))
        })?;
        each(Told { topic: &channel.topic, of: &channel.schema.name, time: message.logged, value: json(&tree) });
        Ok(())
    });
    let name = source.name();
    result.map_err(|(file, trouble)| refusal_of(if file.is_empty() { name } else { &file }, trouble))?;
    Ok(unread)
}

fn json(tree: &Tree<'_>) -> Value {
    match tree {
        Tree::Null => Value::Null,
        Tree::Truth(truth) => (*truth).into(),
        Tree::Whole(whole) => (*whole).into(),
        Tree::Number(number) => (*number).into(),
        Tree::Text(text) => text.as_ref().into(),
        Tree::Array(array) => Value::Array(array.values().map(Value::from).collect()),
        Tree::List(list) => Value::Array(list.iter().map(json).collect()),
        Tree::Object(entries) => {
            let entries = entries.iter().map(|(key, value)| (key.to_string(), json(value)));
            Value::Object(entries.collect::<Map<_, _>>())
        }
    }
}
