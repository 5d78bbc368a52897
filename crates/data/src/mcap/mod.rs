//! Recordings: `.mcap`. The messages of one topic, JSON encoded, become samples.
//!
//! A recording is a sequence; one that `scrnn` wrote may hold several, told apart by its topic `/sequence`. Messages are
//! put in the order of their log times. With a period they are resampled ([`resampling`]), without one they must come at
//! even times.

use std::collections::BTreeMap;

use crate::format::Source;
use crate::samples::Samples;
use crate::{FileError, RecordingProblem, Selection};
use container::{Channel, Message, messages};
use resampling::Series;

mod container;
mod json;
mod numbers;
mod resampling;

/// Where recordings of `scrnn` say which sequence begins.
const SEQUENCE_TOPIC: &str = "/sequence";
/// What the network was told, in recordings of `scrnn`: the topic to learn from.
const SENSED_TOPIC: &str = "/sensed";

/// Reads the file called `path`.
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let (path, bytes) = (source.name(), &source.bytes()?);
    let wrong = |topic: Option<&str>, problem| FileError::Recording {
        path: match topic {
            Some(topic) => format!("{path}, topic {topic}"),
            None => path.to_owned(),
        },
        help: help(&problem),
        problem: Box::new(problem),
    };
    let topics = topics(bytes).map_err(|problem| wrong(None, problem))?;
    let topic =
        choose(&topics, selection.topics.first().map(String::as_str)).map_err(|problem| wrong(None, problem))?;
    let (channels, sequences) = sequences(bytes, topic, selection).map_err(|problem| wrong(Some(topic), problem))?;
    Ok(Samples { period: selection.period, ..Samples::named(channels, sequences) })
}

/// What to do about a problem.
fn help(problem: &RecordingProblem) -> Option<String> {
    match problem {
        RecordingProblem::CutOff => {
            Some("the program that recorded it may have been killed; `mcap recover` saves what is there".into())
        }
        RecordingProblem::UnknownCompression { .. } => Some("`mcap compress --compression zstd` changes it".into()),
        RecordingProblem::Encoding { .. } => Some("record it as JSON, or write the samples as .npz or .csv".into()),
        RecordingProblem::NoTopic { topics, .. } | RecordingProblem::WhichTopic { topics } => {
            Some(format!("say with --topic, or `topic` in the experiment's [data], which to take: {topics}"))
        }
        RecordingProblem::Uneven { .. } => Some(
            "give a period in seconds with --period, or `period` in the experiment's [data], to resample them".into(),
        ),
        RecordingProblem::Resampling { .. } => Some("choose another period, or cut the recording".into()),
        RecordingProblem::NoChannel { channels, .. } => Some(format!("there are {channels}")),
        _ => None,
    }
}

/// A topic and what is known of it.
struct Topic {
    channel: Channel,
    messages: usize,
}

/// All topics that have messages.
fn topics(bytes: &[u8]) -> Result<Vec<Topic>, RecordingProblem> {
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    messages(bytes, |message| {
        match topics.get_mut(&message.channel.topic) {
            Some(topic) => topic.messages += 1,
            None => {
                let topic = Topic { channel: message.channel.clone(), messages: 1 };
                topics.insert(topic.channel.topic.clone(), topic);
            }
        }
        Ok(())
    })?;
    Ok(topics.into_values().collect())
}

/// The topic that is asked for, or the only one that can be meant.
fn choose<'a>(topics: &'a [Topic], wanted: Option<&str>) -> Result<&'a str, RecordingProblem> {
    let named = |name: &str| topics.iter().find(|topic| topic.channel.topic == name);
    let list = || {
        let one = |Topic { channel, messages }: &Topic| {
            let Channel { topic, encoding, schema } = channel;
            format!(
                "{topic} ({messages} messages, {encoding}{})",
                if schema.is_empty() { String::new() } else { format!(", {schema}") }
            )
        };
        topics.iter().map(one).collect::<Vec<_>>().join("; ")
    };
    let chosen = match wanted {
        Some(wanted) => {
            named(wanted).ok_or_else(|| RecordingProblem::NoTopic { found: wanted.to_owned(), topics: list() })?
        }
        None => {
            let readable = |topic: &&Topic| topic.channel.encoding == "json" && topic.channel.topic != SEQUENCE_TOPIC;
            let mut candidates = topics.iter().filter(readable);
            match (named(SENSED_TOPIC), candidates.next(), candidates.next()) {
                (Some(sensed), ..) => sensed,
                (None, Some(only), None) => only,
                (None, None, _) if topics.is_empty() => return Err(RecordingProblem::Empty),
                _ => return Err(RecordingProblem::WhichTopic { topics: list() }),
            }
        }
    };
    match chosen.channel.encoding.as_str() {
        "json" => Ok(&chosen.channel.topic),
        other => Err(RecordingProblem::Encoding { topic: chosen.channel.topic.clone(), found: other.to_owned() }),
    }
}

/// One message of the topic, or the begin of a sequence.
enum Entry {
    Begin(String),
    Sample(Vec<f64>),
}

/// The topic's channels, and its samples sequence by sequence.
type Sequences = (Vec<String>, Vec<(String, Vec<f64>)>);

fn sequences(bytes: &[u8], topic: &str, selection: &Selection) -> Result<Sequences, RecordingProblem> {
    let mut columns = Columns::new(selection);
    let mut entries: Vec<(u64, Entry)> = Vec::new();
    messages(bytes, |message| {
        if message.channel.topic == topic {
            entries.push((message.time, Entry::Sample(columns.take(&message)?)));
        } else if message.channel.topic == SEQUENCE_TOPIC {
            entries.push((message.time, Entry::Begin(sequence_name(&message)?)));
        }
        Ok(())
    })?;
    // A stable sort: what comes at the same time stays in the order of the file.
    entries.sort_by_key(|(time, _)| *time);
    let channels = columns.names();
    if channels.is_empty() {
        return Err(RecordingProblem::NoNumbers);
    }
    let mut series: Vec<(String, Series)> = Vec::new();
    for (time, entry) in entries {
        match entry {
            Entry::Begin(name) => series.push((name, Series::default())),
            Entry::Sample(values) => {
                if series.is_empty() {
                    series.push(("1".to_owned(), Series::default()));
                }
                if let Some((_, series)) = series.last_mut() {
                    series.times.push(time);
                    series.values.extend(values);
                }
            }
        }
    }
    series.retain(|(_, series)| !series.times.is_empty());
    let sample = |(sequence, series): (String, Series)| match selection.period_in_nanoseconds() {
        Some(period) => {
            let values = series.resampled(period, channels.len());
            let values =
                values.map_err(|message| RecordingProblem::Resampling { sequence: sequence.clone(), message })?;
            Ok((sequence, values))
        }
        None => {
            let even = series.check_even();
            even.map_err(|message| RecordingProblem::Uneven { sequence: sequence.clone(), message })?;
            Ok((sequence, series.values))
        }
    };
    let sequences = series.into_iter().map(sample).collect::<Result<Vec<_>, _>>()?;
    Ok((channels, sequences))
}

fn sequence_name(message: &Message<'_>) -> Result<String, RecordingProblem> {
    let name = serde_json::from_slice::<json::Json>(message.data).ok();
    let name = name.as_ref().and_then(|json| json.get("name")).and_then(json::Json::text).map(str::to_owned);
    name.ok_or_else(|| RecordingProblem::Message {
        number: message.number,
        time: resampling::seconds(message.time),
        message: "of topic /sequence names no sequence".to_owned(),
    })
}

/// The channels that are wanted, by the names in the first message.
struct Columns<'a> {
    wanted: Option<&'a [String]>,
    names: Option<Vec<String>>,
}

impl<'a> Columns<'a> {
    fn new(selection: &'a Selection) -> Self {
        Self { wanted: selection.channels.as_deref(), names: None }
    }

    fn names(self) -> Vec<String> {
        self.names.unwrap_or_default()
    }

    /// The message's values of the wanted channels.
    fn take(&mut self, message: &Message<'_>) -> Result<Vec<f64>, RecordingProblem> {
        let about = |text: String| RecordingProblem::Message {
            number: message.number,
            time: resampling::seconds(message.time),
            message: text,
        };
        let numbers = numbers::parse(message.data).map_err(about)?;
        let all = || numbers.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        let names = match (&mut self.names, self.wanted) {
            (Some(names), _) => &*names,
            (none, Some(wanted)) => {
                if let Some(missing) = wanted.iter().find(|name| !numbers.iter().any(|(found, _)| found == *name)) {
                    return Err(RecordingProblem::NoChannel { found: missing.clone(), channels: all().join(", ") });
                }
                &*none.insert(wanted.to_vec())
            }
            (none, None) => &*none.insert(all()),
        };
        let value_of = |(index, name): (usize, &String)| {
            // Messages of one topic are nearly always alike.
            let here = numbers.get(index).filter(|(found, _)| found == name);
            let found = here.or_else(|| numbers.iter().find(|(found, _)| found == name));
            let value =
                found.map(|(_, value)| *value).ok_or_else(|| about(format!("holds no `{name}`, as the first does")))?;
            if value.is_finite() { Ok(value) } else { Err(about(format!("holds `{name}` as {value}"))) }
        };
        let values = names.iter().enumerate().map(value_of).collect::<Result<Vec<_>, _>>()?;
        if self.wanted.is_none()
            && numbers.len() != values.len()
            && let Some((new, _)) = numbers.iter().find(|(name, _)| !names.contains(name))
        {
            return Err(about(format!("holds `{new}`, which the first does not")));
        }
        Ok(values)
    }
}

#[cfg(test)]
pub mod tests;
