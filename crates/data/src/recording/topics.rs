//! One way through a recording: which topics there are, and the numbers of those that are meant.

use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

use super::collecting::Collecting;
use super::decoding::{Decoder, is_movement};
use super::files::{Effort, Files};
use super::message::{Channel, Message, Schema, Trouble};
use super::tree::{self, Tree};
use crate::RecordingProblem;
use crate::budget::Budget;

/// Where recordings of `scrnn` say which sequence begins.
const SEQUENCE_TOPIC: &str = "/sequence";
/// What the network was told, in recordings of `scrnn`: the topic to learn from.
const SENSED_TOPIC: &str = "/sensed";
/// Topics that a message lists.
const LISTED: usize = 30;

/// A topic and what is known of it.
#[derive(Debug)]
pub struct Topic {
    /// Its channel; the first, if it has several.
    pub channel: Rc<Channel>,
    /// How many messages it has.
    pub messages: usize,
    /// When the first was logged.
    pub first: i64,
    /// When the last was logged.
    pub last: i64,
    /// Whether it was taken.
    pub taken: bool,
    /// Whether somebody who names no topic can mean it.
    usable: bool,
}

/// What is taken of a topic.
#[derive(Debug)]
pub struct Lane {
    /// Topic, and the field if one is named, as it was asked for, without the slash at the front.
    pub label: String,
    /// The topic.
    pub topic: String,
    /// Its numbers.
    pub collecting: Collecting,
}

/// What came of one way through.
#[derive(Debug, Default)]
pub struct Findings {
    /// All topics with messages, by name.
    pub topics: BTreeMap<String, Topic>,
    /// What was taken, in the order that was asked for.
    pub lanes: Vec<Lane>,
    /// When sequences begin, and their names.
    pub begins: Vec<(i64, String)>,
}

/// Goes through the files, and takes the numbers of `asked` topics, or of the only one that can be meant.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn find(files: &Files<'_>, asked: &[String], wanted: Option<&[String]>) -> Result<Findings, (String, Trouble)> {
    let whole = |problem: RecordingProblem| (String::new(), Trouble::from(problem));
    let mut pass = Pass::new(asked, wanted, files);
    files.messages(&mut |message| pass.take(message))?;
    if asked.is_empty() && pass.findings.topics.contains_key(SENSED_TOPIC) && pass.chosen() != Some(SENSED_TOPIC) {
        // What the network was told is what to learn from.
        return find(files, &[SENSED_TOPIC.to_owned()], wanted);
    }
    let Pass { findings, asked, several, failure, .. } = pass;
    if findings.topics.is_empty() {
        return Err(whole(RecordingProblem::Empty));
    }
    let (topics, example) = (findings.list(), findings.example());
    if several || asked.is_empty() && findings.lanes.is_empty() {
        // A single topic that cannot be read tells why itself.
        return match findings.topics.values().next() {
            Some(only)
                if findings.topics.len() == 1
                    && let Err(why) = Decoder::of(&only.channel) =>
            {
                let path = only.channel.topic.clone();
                Err((String::new(), Trouble::Topic(path, Box::new(RecordingProblem::Encoding { why }))))
            }
            _ => Err(whole(RecordingProblem::WhichTopic { topics, example })),
        };
    }
    if let Some((topic, problem)) = failure {
        return Err((String::new(), Trouble::Topic(topic, Box::new(problem))));
    }
    if let Some(missing) = asked.iter().find(|entry| !findings.lanes.iter().any(|lane| entry.is(lane))) {
        return Err(whole(RecordingProblem::NoTopic { found: missing.text.clone(), topics, example }));
    }
    Ok(findings)
}

impl Findings {
    /// All topics with their types, for people.
    fn list(&self) -> String {
        let one = |topic: &Topic| {
            let Channel { topic: name, encoding, schema } = &*topic.channel;
            let of = if schema.name.is_empty() { String::new() } else { format!(", {}", schema.name) };
            crate::excerpt::printable(&format!("{name} ({} messages, {encoding}{of})", topic.messages))
        };
        let mut list: Vec<String> = self.topics.values().take(LISTED).map(one).collect();
        if self.topics.len() > LISTED {
            list.push(format!("and {} more", self.topics.len() - LISTED));
        }
        list.join("; ")
    }

    /// A topic that somebody could mean: the usable one with the most messages.
    fn example(&self) -> String {
        let candidates = self.topics.values().filter(|topic| topic.usable);
        let all = candidates.max_by_key(|topic| topic.messages).or(self.topics.values().next());
        all.map(|topic| topic.channel.topic.clone()).unwrap_or_default()
    }
}

/// A topic that is asked for, perhaps with a field: `/odom`, `/odom.pose.pose`.
#[derive(Debug)]
struct Entry {
    text: String,
}

impl Entry {
    /// What of a topic of this name is asked for: nothing, all, or a field.
    fn field_of<'e>(&'e self, topic: &str) -> Option<Option<&'e str>> {
        let bare = |name: &'e str| name.strip_prefix('/').unwrap_or(name);
        let rest = bare(&self.text).strip_prefix(topic.strip_prefix('/').unwrap_or(topic))?;
        match rest.strip_prefix('.') {
            Some(field) if !field.is_empty() => Some(Some(field)),
            _ => rest.is_empty().then_some(None),
        }
    }

    fn label(&self) -> &str {
        self.text.strip_prefix('/').unwrap_or(&self.text)
    }

    fn is(&self, lane: &Lane) -> bool {
        self.label() == lane.label
    }
}

/// What a channel's messages mean for this way through.
struct Route {
    /// Kept so that its address stays its own.
    _channel: Rc<Channel>,
    decoder: Option<Decoder>,
    /// Lanes that it fills.
    lanes: Vec<usize>,
}

struct Pass<'p> {
    asked: Vec<Entry>,
    wanted: Option<&'p [String]>,
    budget: &'p Budget,
    effort: &'p Effort,
    findings: Findings,
    routes: HashMap<*const Channel, Route>,
    decoders: HashMap<(*const Schema, String), Result<Decoder, String>>,
    /// Whether several topics could be meant.
    several: bool,
    /// What is wrong with a topic that was chosen before it was clear that it is meant.
    failure: Option<(String, RecordingProblem)>,
}

impl<'p> Pass<'p> {
    fn new(asked: &[String], wanted: Option<&'p [String]>, files: &'p Files<'_>) -> Self {
        let mut entries: Vec<Entry> = Vec::with_capacity(asked.len());
        for text in asked {
            let entry = Entry { text: text.clone() };
            if !entries.iter().any(|known| known.label() == entry.label()) {
                entries.push(entry);
            }
        }
        Self {
            asked: entries,
            wanted,
            budget: &files.budget,
            effort: &files.effort,
            findings: Findings::default(),
            routes: HashMap::new(),
            decoders: HashMap::new(),
            several: false,
            failure: None,
        }
    }

    fn chosen(&self) -> Option<&str> {
        self.findings.lanes.first().map(|lane| lane.topic.as_str())
    }

    fn take(&mut self, message: &Message<'_>) -> Result<(), Trouble> {
        if let Some(topic) = self.findings.topics.get_mut(&message.channel.topic) {
            topic.messages += 1;
            topic.first = topic.first.min(message.logged);
            topic.last = topic.last.max(message.logged);
        }
        let key = Rc::as_ptr(message.channel);
        if !self.routes.contains_key(&key) {
            let route = self.route(message)?;
            self.routes.insert(key, route);
        }
        let Some(Route { decoder, lanes, .. }) = self.routes.get(&key) else { return Ok(()) };
        let failed = |text: String| RecordingProblem::Message {
            number: message.number,
            time: crate::times::seconds(message.logged),
            message: text,
        };
        if message.channel.topic == SEQUENCE_TOPIC && message.channel.encoding == "json" && lanes.is_empty() {
            let name = tree::from_json(message.data).ok();
            let name = name.as_ref().and_then(|tree| tree.get("name")).and_then(Tree::text).map(str::to_owned);
            let name = name.ok_or_else(|| failed("of topic /sequence names no sequence".to_owned()))?;
            self.budget.take(name.len() + 64)?;
            self.findings.begins.push((message.logged, name));
            return Ok(());
        }
        if self.several || self.failure.is_some() || lanes.is_empty() {
            return Ok(());
        }
        let Some(decoder) = decoder else { return Ok(()) };
        let outcome = match decoder.read(message.data) {
            Ok(tree) => {
                let mut outcome = Ok(());
                for &lane in lanes {
                    let collecting = &mut self.findings.lanes[lane].collecting;
                    let manner = decoder.manner(collecting.takes_all());
                    outcome = outcome.and(collecting.take(message, &tree, manner, self.budget)?);
                    self.effort.spend(message.data.len(), collecting.taken())?;
                }
                outcome
            }
            Err(why) => Err(why),
        };
        match outcome {
            Ok(()) => Ok(()),
            // Another topic may yet turn out to be the one that is meant.
            Err(why) if self.asked.is_empty() => {
                self.failure = Some((message.channel.topic.clone(), failed(why)));
                Ok(())
            }
            Err(why) => Err(Trouble::Topic(message.channel.topic.clone(), Box::new(failed(why)))),
        }
    }

    /// What is to be done with messages of a channel that was not met before.
    fn route(&mut self, message: &Message<'_>) -> Result<Route, Trouble> {
        let channel = message.channel;
        self.budget.take(2 * (channel.topic.len() + channel.encoding.len()) + 500)?;
        let mut route = Route { _channel: Rc::clone(channel), decoder: None, lanes: Vec::new() };
        let is_new = !self.findings.topics.contains_key(&channel.topic);
        let movement = is_movement(channel) && channel.topic != SEQUENCE_TOPIC;
        let mut usable = false;
        if self.asked.is_empty() {
            usable = movement && self.decoder(channel).is_ok();
            if usable && !self.several {
                match self.chosen() {
                    None => {
                        let label = channel.topic.strip_prefix('/').unwrap_or(&channel.topic).to_owned();
                        route.lanes.push(self.new_lane(label, None, channel));
                    }
                    Some(chosen) if chosen == channel.topic => route.lanes.push(0),
                    Some(_) => {
                        self.several = true;
                        // What was taken is not needed any more.
                        self.findings.lanes.truncate(0);
                        self.routes.values_mut().for_each(|route| route.lanes.clear());
                    }
                }
                route.decoder = self.decoder(channel).ok();
            }
        } else {
            for index in 0..self.asked.len() {
                let entry = &self.asked[index];
                let Some(field) = entry.field_of(&channel.topic).map(|field| field.map(str::to_owned)) else {
                    continue;
                };
                let known = self.findings.lanes.iter().position(|lane| entry.is(lane));
                let label = entry.label().to_owned();
                match self.decoder(channel) {
                    Ok(decoder) => route.decoder = Some(decoder),
                    Err(why) => {
                        return Err(Trouble::Topic(
                            channel.topic.clone(),
                            Box::new(RecordingProblem::Encoding { why }),
                        ));
                    }
                }
                let lane = known.unwrap_or_else(|| self.new_lane(label, field, channel));
                route.lanes.push(lane);
            }
        }
        let taken = !route.lanes.is_empty();
        if is_new {
            let (channel, at) = (Rc::clone(channel), message.logged);
            let topic = Topic { channel, messages: 1, first: at, last: at, taken, usable };
            self.findings.topics.insert(message.channel.topic.clone(), topic);
        }
        Ok(route)
    }

    fn new_lane(&mut self, label: String, field: Option<String>, channel: &Rc<Channel>) -> usize {
        let wanted = self.wanted.map(|names| {
            names.iter().flat_map(|name| {
                let mut ways = vec![(name.clone(), name.clone())];
                if let Some(inside) = name.strip_prefix(&label).and_then(|rest| rest.strip_prefix('.')) {
                    ways.push((inside.to_owned(), name.clone()));
                }
                let short = label.rsplit('/').next().unwrap_or_default();
                if let Some(rest) =
                    name.strip_prefix(short).filter(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
                {
                    ways.push((format!("data{rest}"), name.clone()));
                }
                ways
            })
        });
        let collecting = Collecting::new(field.as_deref(), wanted.map(Iterator::collect));
        self.findings.lanes.push(Lane { label, topic: channel.topic.clone(), collecting });
        self.findings.lanes.len() - 1
    }

    /// The decoder of a channel. Each type is understood once.
    fn decoder(&mut self, channel: &Rc<Channel>) -> Result<Decoder, String> {
        let key = (Rc::as_ptr(&channel.schema), channel.encoding.clone());
        self.decoders.entry(key).or_insert_with(|| Decoder::of(channel)).clone()
    }
}
