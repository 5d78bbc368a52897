//! Samples that come line by line while they are made.

use std::collections::HashSet;
use std::io::{BufRead, ErrorKind, Read};
use std::path::Path;
use std::time::Duration;

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value;

use crate::channels::{by_name, nameless, shown};
use crate::failure::{Failure, Result};

/// Columns and keys that are no channels.
const NOT_CHANNELS: [&str; 5] = ["sequence", "step", "time", "header", "stamp"];
/// Words for a value that is not there, as programs write it.
const ABSENT: [&str; 4] = ["", "null", "NA", "None"];
/// The longest line, in bytes.
const LONGEST: usize = 1 << 20;
/// Between two looks at a pipe that has nothing and does not want to be waited for.
const PAUSE: Duration = Duration::from_millis(1);

/// Lines of numbers between semicolons, commas, tabs or spaces, or of JSON objects.
///
/// Fields are taken by position, one for each channel, or by the names of a first line; objects by their keys, or by the lists
/// `name` and `position` of a ROS JointState. An empty field is a missing value and moves no other. A blank line, or another
/// name in a column `sequence`, ends a sequence. A last line without its end is no sample.
#[derive(Debug)]
pub struct Stream<R> {
    input: R,
    channels: Vec<String>,
    layout: Option<Layout>,
    number: usize,
    line: Vec<u8>,
    unfinished: bool,
    sequence: Option<String>,
    /// A sample that came with the end of the sequence before it.
    waiting: Option<Vec<f64>>,
}

/// Where the channels stand.
#[derive(Debug, Clone, PartialEq)]
enum Layout {
    /// In fields, one for each channel.
    Positions,
    /// In the fields of these names.
    Names { names: Vec<String>, fields: Vec<usize>, sequence: Option<usize> },
    /// In objects.
    Objects,
}

/// What came.
#[derive(Debug, PartialEq)]
pub enum Arrival {
    /// One value for each channel; NaN where it is missing.
    Sample(Vec<f64>),
    /// A sequence ended.
    Gap,
}

impl<R: BufRead> Stream<R> {
    /// Of samples on these channels.
    pub fn new(input: R, channels: &[String]) -> Self {
        Self {
            input,
            channels: channels.to_vec(),
            layout: None,
            number: 0,
            line: Vec::new(),
            unfinished: false,
            sequence: None,
            waiting: None,
        }
    }

    /// The number of the line that came last, from 1.
    pub fn line_number(&self) -> usize {
        self.number
    }

    /// Whether the stream ended in the middle of a line.
    pub fn is_unfinished(&self) -> bool {
        self.unfinished
    }

    /// Waits for the next sample; none at the end of the stream.
    ///
    /// # Errors
    /// [`Failure::Input`] with the number of the line that is no sample; [`Failure::Disk`].
    #[expect(clippy::should_implement_trait, reason = "an iterator that may fail would hide where it ends")]
    pub fn next(&mut self) -> Result<Option<Arrival>> {
        if let Some(sample) = self.waiting.take() {
            return Ok(Some(Arrival::Sample(sample)));
        }
        while self.read_line()? {
            let line = std::mem::take(&mut self.line);
            let arrival = self.arrival(&line);
            self.line = line;
            if let Some(arrival) = arrival? {
                return Ok(Some(arrival));
            }
        }
        Ok(None)
    }

    /// Reads a whole line; whether there was one.
    fn read_line(&mut self) -> Result<bool> {
        self.line.clear();
        loop {
            let mut input = (&mut self.input).take((LONGEST + 1 - self.line.len()) as u64);
            match input.read_until(b'\n', &mut self.line) {
                Ok(_) => break,
                // Who shares a pipe may have told the system not to wait at it: then this waits.
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(PAUSE),
                Err(error) => return Err(Failure::disk("read", Path::new("the stream"), error)),
            }
        }
        self.number += 1;
        if self.line.len() > LONGEST {
            let message = format!("line {} of the stream is longer than {LONGEST} bytes", self.number);
            return Err(Failure::input(message, "end each sample with a line break"));
        }
        let whole = self.line.ends_with(b"\n");
        self.unfinished = !whole && !self.line.is_empty();
        Ok(whole)
    }

    /// What a line says; nothing if it is a comment or names the columns.
    fn arrival(&mut self, line: &[u8]) -> Result<Option<Arrival>> {
        let line = std::str::from_utf8(line).map_err(|_| {
            let message = format!("line {} of the stream is not text: it is not UTF-8", self.number);
            Failure::input(message, format!("lines of numbers: {}", self.channels.join(", ")))
        })?;
        // Spreadsheets mark their text by it.
        let line = if self.number == 1 { line.strip_prefix('\u{feff}').unwrap_or(line) } else { line };
        if line.trim().is_empty() {
            self.sequence = None;
            return Ok(Some(Arrival::Gap));
        }
        if line.starts_with('#') {
            return Ok(None);
        }
        if line.trim_start().starts_with('{') {
            return self.object(line).map(|sample| Some(Arrival::Sample(sample)));
        }
        let cells = split(line);
        let layout = match &self.layout {
            Some(layout) => layout,
            None => {
                let layout = self.header(&cells)?;
                let named = layout != Layout::Positions;
                self.layout = Some(layout);
                if named {
                    return Ok(None);
                }
                &Layout::Positions
            }
        };
        let (needed, fields, sequence) = match layout {
            Layout::Positions => (self.channels.len(), None, None),
            Layout::Objects => {
                let message = format!("line {} is no JSON object, as the lines before it were", self.number);
                return Err(Failure::input(message, "one kind of line for the whole stream"));
            }
            Layout::Names { names, fields, sequence } => {
                if cells == *names {
                    // Another table follows.
                    return Ok(Some(Arrival::Gap));
                }
                (names.len(), Some(fields), *sequence)
            }
        };
        if cells.len() != needed {
            let message = format!("line {} has {} fields, needed are {needed}", self.number, cells.len());
            let help = format!("the channels are {}; a missing value is an empty field", self.channels.join(", "));
            return Err(Failure::input(message, help));
        }
        let cell = |i: usize| cells[fields.map_or(i, |fields| fields[i])];
        let values = (0..self.channels.len()).map(|i| self.value(i, cell(i)));
        let sample = values.collect::<Result<Vec<_>>>()?;
        let name = sequence.map(|field| cells[field].to_owned());
        let before = std::mem::replace(&mut self.sequence, name);
        if before.is_some() && before != self.sequence {
            self.waiting = Some(sample);
            return Ok(Some(Arrival::Gap));
        }
        Ok(Some(Arrival::Sample(sample)))
    }

    /// Whether the first line holds numbers, and which names otherwise.
    fn header(&self, cells: &[&str]) -> Result<Layout> {
        let needed = || format!("needed: {} numbers, or the names {}", self.channels.len(), self.channels.join(", "));
        let refused = |what: &str| {
            let found: Vec<String> =
                cells.iter().take(20).map(|cell| format!("`{}`", shown(cell).escape_debug())).collect();
            let message = format!("line {} of the stream, {}, {what}", self.number, found.join(" "));
            Failure::input(message, needed())
        };
        let places: Vec<usize> = (0..cells.len()).filter(|&k| !NOT_CHANNELS.contains(&cells[k])).collect();
        let names: Vec<&str> = places.iter().map(|&k| cells[k]).collect();
        let found = by_name(&names, &self.channels);
        if found.is_err() && cells.iter().all(|cell| is_value(cell)) {
            return match cells.len() == self.channels.len() {
                true => Ok(Layout::Positions),
                false => Err(refused(&format!("has {} fields", cells.len()))),
            };
        }
        let owned: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let like_names = names.iter().all(|name| name.starts_with(|c: char| c.is_alphabetic() || c == '_'));
        let some_are_numbers = names.iter().any(|name| is_value(name));
        let order = match found {
            Ok(order) => order,
            // Without names of their own on one side, channels are taken by position, as those of files.
            Err(_)
                if names.len() == self.channels.len()
                    && like_names
                    && !some_are_numbers
                    && (nameless(&owned) || nameless(&self.channels)) =>
            {
                (0..names.len()).collect()
            }
            Err(_) if some_are_numbers => return Err(refused("is neither all numbers nor all names")),
            Err(what) => return Err(refused(&what)),
        };
        let fields = order.into_iter().map(|k| places[k]).collect();
        let sequence = cells.iter().position(|&cell| cell == "sequence");
        Ok(Layout::Names { names: cells.iter().map(|&cell| cell.to_owned()).collect(), fields, sequence })
    }

    /// A number; NaN if it is missing.
    fn value(&self, channel: usize, cell: &str) -> Result<f64> {
        if ABSENT.contains(&cell) {
            return Ok(f64::NAN);
        }
        cell.parse().map_err(|_| {
            let (channel, cell) = (&self.channels[channel], shown(cell).escape_debug().to_string());
            Failure::input(
                format!("line {}, {channel} is `{cell}`", self.number),
                "a number, or nothing if it is missing",
            )
        })
    }

    /// The sample of a line that is a JSON object.
    fn object(&mut self, line: &str) -> Result<Vec<f64>> {
        let refused = |what: String| {
            let help = format!("an object with a number or null for each of {}", self.channels.join(", "));
            Failure::input(format!("line {} {what}", self.number), help)
        };
        if self.layout.as_ref().is_some_and(|layout| *layout != Layout::Objects) {
            return Err(refused("is a JSON object, the lines before it were none".to_owned()));
        }
        let Object(object) = serde_json::from_str(line)
            .or_else(|error| serde_json::from_str(&without_non_finite(line)).map_err(|_| error))
            .map_err(|error| refused(format!("is no JSON object: {error}")))?;
        let mut keys = HashSet::new();
        if let Some((twice, _)) = object.iter().find(|&(key, _)| !keys.insert(key)) {
            return Err(refused(format!("has `{}` more than once", shown(twice))));
        }
        let value = |wanted: &str| object.iter().find(|(key, _)| key == wanted).map(|(_, value)| value);
        let pairs: Vec<(&str, &Value)> = match (value("name"), value("position")) {
            (Some(Value::Array(names)), Some(Value::Array(positions))) => {
                if names.len() != positions.len() {
                    let what = format!("has {} names and {} positions", names.len(), positions.len());
                    return Err(refused(what));
                }
                let names = names.iter().map(|name| name.as_str().unwrap_or_default());
                names.zip(positions).collect()
            }
            _ => object.iter().map(|(key, value)| (key.as_str(), value)).collect(),
        };
        let pairs: Vec<(&str, &Value)> = pairs.into_iter().filter(|(name, _)| !NOT_CHANNELS.contains(name)).collect();
        let mut names: Vec<&str> = pairs.iter().map(|(name, _)| *name).collect();
        if self.layout.is_some() {
            // All were there once: what is not there now is missing.
            let there: HashSet<&str> = names.iter().copied().collect();
            names.extend(self.channels.iter().map(String::as_str).filter(|name| !there.contains(name)));
        }
        let order = by_name(&names, &self.channels).map_err(refused)?;
        let values = order.iter().zip(&self.channels).map(|(&k, channel)| match pairs.get(k).map(|pair| pair.1) {
            None | Some(Value::Null) => Ok(f64::NAN),
            Some(Value::Number(number)) => Ok(number.as_f64().unwrap_or(f64::NAN)),
            Some(other) => Err(refused(format!("has {channel} as {}", shown(&other.to_string())))),
        });
        let sample = values.collect::<Result<Vec<_>>>()?;
        self.layout = Some(Layout::Objects);
        Ok(sample)
    }
}

/// Whether a field stands for a number, be it missing.
fn is_value(cell: &str) -> bool {
    ABSENT.contains(&cell) || cell.parse::<f64>().is_ok()
}

/// The fields of a line. Between semicolons, commas and tabs a field may be empty; spaces only separate.
fn split(line: &str) -> Vec<&str> {
    fn part(cell: &str) -> &str {
        let cell = cell.trim();
        cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).map_or(cell, scrnn_data::unguarded)
    }
    let line = line.trim_end_matches(['\r', '\n']);
    match [';', ',', '\t'].into_iter().find(|separator| line.contains(*separator)) {
        Some(separator) => line.split(separator).map(part).collect(),
        None => line.split_whitespace().map(part).collect(),
    }
}

/// The line with null in place of what is no number of JSON, but is written by many programs: NaN, Infinity and -Infinity, and
/// numbers beyond all that float64 holds.
fn without_non_finite(line: &str) -> String {
    let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.');
    let (mut out, mut rest) = (String::with_capacity(line.len()), line);
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' => quoted(rest),
            _ if is_word(first) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let (part, after) = rest.split_at(length);
        let is_number = part.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
        let beyond = is_number && part.parse::<f64>().is_ok_and(f64::is_infinite);
        out.push_str(if beyond || matches!(part, "NaN" | "Infinity" | "-Infinity") { "null" } else { part });
        rest = after;
    }
    out
}

/// Length of the string that begins here, with its quotes.
fn quoted(text: &str) -> usize {
    let mut escaped = false;
    let end = text.bytes().skip(1).position(|byte| match (escaped, byte) {
        (true, _) => {
            escaped = false;
            false
        }
        (false, b'\\') => {
            escaped = true;
            false
        }
        (false, byte) => byte == b'"',
    });
    end.map_or(text.len(), |end| end + 2)
}

/// The keys of a JSON object with their values, in their order. What stands there twice is there twice.
struct Object(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Object;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> std::result::Result<Object, M::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Object(pairs))
            }
        }
        deserializer.deserialize_map(Pairs)
    }
}

#[cfg(test)]
#[path = "stream_tests.rs"]
mod tests;
