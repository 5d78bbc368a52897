//! What happened in a simulation, as an MCAP file that Foxglove and rerun open.
//!
//! | topic | what it holds | encoding |
//! |---|---|---|
//! | `/scene` | `foxglove.SceneUpdate`: each body as an entity | protobuf |
//! | `/transforms` | `foxglove.FrameTransforms`: each frame in the link that it hangs on | protobuf |
//! | `/joint_states`, `/joint_targets` | `foxglove.JointStates` | JSON |
//! | `/sensed` | by channel, in the data's units: what the network senses | JSON |
//! | `/predicted_mean`, `/predicted_variance` | by channel: what it expects next, and how far off it expects to be | JSON |
//! | `/contacts` | pairs of bodies, with distance and force | JSON |
//! | `/events` | whatever else happened, by name | JSON |
//! | `/sequence` | the name of the sequence that begins, where a recording holds several | JSON |
//!
//! What a viewer draws is protobuf, because rerun shows the JSON form as bytes; numbers are JSON, because every script reads
//! it. Robots and experiment are attached. A topic is there if it was written to. The same calls give the same bytes: time
//! is simulated time, in nanoseconds, and never runs backwards.
//!
//! ```
//! use std::io::Cursor;
//! use scrnn_sim::recording::{Heading, Joint, Recorder};
//!
//! let channels = ["head_yaw".to_owned(), "head_pitch".to_owned()];
//! let heading = Heading { channels: &channels, experiment: Some("name = \"reach\""), ..Heading::default() };
//! let mut recorder = Recorder::new(Cursor::new(Vec::new()), &heading)?;
//! for step in 0..3_u64 {
//!     let time = step * 500_000_000;
//!     recorder.sensed(time, &[0.1, -0.2])?;
//!     recorder.predicted(time, &[0.11, -0.19], Some(&[1e-4, 2e-4]))?;
//!     recorder.joint_states(time, &[Joint::at("head_yaw", 0.1)])?;
//! }
//! recorder.event(3 * 500_000_000, "touch", &[("gap", 0.001)])?;
//! let bytes = recorder.finish()?.into_inner();
//! # assert!(bytes.starts_with(b"\x89MCAP0\r\n"));
//! # Ok::<(), scrnn_sim::recording::RecordingError>(())
//! ```

use std::borrow::Cow;
use std::collections::{BTreeMap, HashSet};
use std::io::{Seek, Write};

use mcap::records::MessageHeader;
use mcap::{Attachment, McapError};
use serde::Serialize;

use crate::world::JointState;
use crate::world::scene::Scene;
use json::{Named, Time};

mod error;
mod foxglove;
mod json;
#[cfg(test)]
pub(crate) mod reading;
mod types;
mod wire;

pub use error::RecordingError;
pub use wire::Message as ProtobufMessage;

/// What a recording says of itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct Heading<'a> {
    /// The robots that take part.
    pub robots: &'a [Robot<'a>],
    /// The experiment file.
    pub experiment: Option<&'a str>,
    /// Names of the network's channels.
    pub channels: &'a [String],
    /// More to know, e.g. the seed.
    pub notes: &'a [(&'a str, &'a str)],
}

/// A robot's description.
#[derive(Debug, Clone, Copy)]
pub struct Robot<'a> {
    /// What goes before the names of its links in a scene, e.g. `self/`; may be empty.
    pub prefix: &'a str,
    /// Its URDF.
    pub urdf: &'a str,
}

/// A joint: where it is, or where it should go. What is not known is left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Joint<'a> {
    /// Its name, unique in a message.
    pub name: &'a str,
    /// In radians, or metres.
    pub position: f64,
    /// In radians or metres a second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<f64>,
    /// In newton metres, or newtons.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort: Option<f64>,
}

impl<'a> Joint<'a> {
    /// A joint of which only the position is known.
    #[must_use]
    pub fn at(name: &'a str, position: f64) -> Self {
        Self { name, position, velocity: None, effort: None }
    }
}

impl<'a> From<JointState<'a>> for Joint<'a> {
    fn from(JointState { name, angle, velocity }: JointState<'a>) -> Self {
        Self { name, position: angle, velocity: Some(velocity), effort: None }
    }
}

/// Two bodies that touch, or nearly do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contact<'a> {
    /// Name of one body.
    pub a: &'a str,
    /// Name of the other body.
    pub b: &'a str,
    /// Between their surfaces in metres; negative if they overlap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
    /// In newtons.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<f64>,
}

/// Which link of a robot hangs on which, by the names of their frames.
#[derive(Debug, Default)]
struct Links {
    parents: BTreeMap<String, String>,
}

impl Links {
    fn of(robots: &[Robot<'_>]) -> Result<Self, RecordingError> {
        let mut parents = BTreeMap::new();
        for Robot { prefix, urdf } in robots {
            let robot = urdf_rs::read_from_string(urdf)
                .map_err(|error| RecordingError::Robot { robot: (*prefix).to_owned(), message: error.to_string() })?;
            let named = |link: &str| format!("{prefix}{link}");
            parents.extend(robot.joints.iter().map(|joint| (named(&joint.child.link), named(&joint.parent.link))));
        }
        Ok(Self { parents })
    }

    fn parent(&self, frame: &str) -> Option<&str> {
        self.parents.get(frame).map(String::as_str)
    }
}

/// A topic that was written to.
#[derive(Debug, Clone, Copy)]
struct Open {
    channel: u16,
    messages: u32,
}

/// Writes a recording while a simulation runs.
///
/// A recorder that is dropped completes its file as well as it can; [`Recorder::finish`] tells whether that worked.
pub struct Recorder<W: Write + Seek> {
    writer: mcap::Writer<W>,
    channels: Vec<String>,
    links: Links,
    open: BTreeMap<&'static str, Open>,
    time: u64,
}

impl<W: Write + Seek> Recorder<W> {
    /// Begins a recording.
    ///
    /// # Errors
    /// [`RecordingError::Robot`], [`RecordingError::Twice`] for channels of one name, [`RecordingError::Write`].
    pub fn new(out: W, heading: &Heading<'_>) -> Result<Self, RecordingError> {
        let links = Links::of(heading.robots)?;
        // A channel stands beside the timestamp of its message.
        distinct("/sensed", ["timestamp"].into_iter().chain(heading.channels.iter().map(String::as_str)))?;
        let options = mcap::WriteOptions::new().compression(None).library(concat!("scrnn ", env!("CARGO_PKG_VERSION")));
        let failed = |topic| move |source| RecordingError::Write { topic, source };
        let mut writer = options.create(out).map_err(failed("header"))?;
        let attach = |writer: &mut mcap::Writer<W>, name: String, media_type: &str, text: &str| {
            let media_type = media_type.to_owned();
            let data = Cow::Borrowed(text.as_bytes());
            writer.attach(&Attachment { log_time: 0, create_time: 0, name, media_type, data })
        };
        for robot in heading.robots {
            let name = format!("{}robot.urdf", robot.prefix);
            attach(&mut writer, name, "application/xml", robot.urdf).map_err(failed("attachment robot.urdf"))?;
        }
        if let Some(text) = heading.experiment {
            let name = "experiment.toml".to_owned();
            attach(&mut writer, name, "application/toml", text).map_err(failed("attachment experiment.toml"))?;
        }
        let mut notes: BTreeMap<String, String> =
            heading.notes.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        if !heading.channels.is_empty() {
            notes.insert("channels".to_owned(), json::text(&heading.channels));
        }
        let metadata = mcap::records::Metadata { name: "scrnn".to_owned(), metadata: notes };
        writer.write_metadata(&metadata).map_err(failed("metadata"))?;
        Ok(Self { writer, channels: heading.channels.to_vec(), links, open: BTreeMap::new(), time: 0 })
    }

    /// Says that a sequence begins, for recordings that hold several.
    ///
    /// # Errors
    /// [`RecordingError::Backwards`], [`RecordingError::Write`]; as all of the following.
    pub fn begin_sequence(&mut self, time: u64, name: &str) -> Result<(), RecordingError> {
        self.json("/sequence", time, &json::Sequence { timestamp: Time::of(time), name })
    }

    /// All bodies and frames.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`], [`RecordingError::Twice`].
    pub fn scene(&mut self, time: u64, scene: &Scene) -> Result<(), RecordingError> {
        distinct("/scene", scene.bodies.iter().map(|body| body.name.as_str()))?;
        distinct("/transforms", scene.frames.iter().map(|frame| frame.name.as_str()))?;
        for body in &scene.bodies {
            finite_place("/scene", time, &body.name, &body.world_from_shape)?;
        }
        for frame in &scene.frames {
            finite_place("/transforms", time, &frame.name, &frame.world_from_frame)?;
        }
        if !scene.frames.is_empty() {
            let message = foxglove::frame_transforms(time, scene, &self.links);
            self.write("/transforms", time, &message)?;
        }
        self.write("/scene", time, &foxglove::scene_update(time, scene))
    }

    /// Where the joints are. Readers place a robot's links by them and its description, so none should be left out, even
    /// those that the experiment does not move.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`], [`RecordingError::Twice`].
    pub fn joint_states(&mut self, time: u64, joints: &[Joint<'_>]) -> Result<(), RecordingError> {
        self.joints("/joint_states", time, joints)
    }

    /// Where the joints should go.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`], [`RecordingError::Twice`].
    pub fn joint_targets(&mut self, time: u64, joints: &[Joint<'_>]) -> Result<(), RecordingError> {
        self.joints("/joint_targets", time, joints)
    }

    /// What the network senses, a value for each channel in the data's units.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`], [`RecordingError::Length`].
    pub fn sensed(&mut self, time: u64, values: &[f64]) -> Result<(), RecordingError> {
        self.by_channel("/sensed", time, values)
    }

    /// What the network predicts, a mean and a variance for each channel in the data's units.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`], [`RecordingError::Length`].
    pub fn predicted(&mut self, time: u64, mean: &[f64], variance: Option<&[f64]>) -> Result<(), RecordingError> {
        self.by_channel("/predicted_mean", time, mean)?;
        variance.map_or(Ok(()), |variance| self.by_channel("/predicted_variance", time, variance))
    }

    /// Bodies that touch; an empty list where none do.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`].
    pub fn contacts(&mut self, time: u64, contacts: &[Contact<'_>]) -> Result<(), RecordingError> {
        for contact in contacts {
            let name = || format!("{} with {}", contact.a, contact.b);
            finite("/contacts", time, name, contact.distance.into_iter().chain(contact.force))?;
        }
        self.json("/contacts", time, &json::Contacts { timestamp: Time::of(time), contacts })
    }

    /// Something that happened, e.g. a touch or a branching, with numbers by name.
    ///
    /// # Errors
    /// [`RecordingError::NotFinite`].
    pub fn event(&mut self, time: u64, name: &str, values: &[(&str, f64)]) -> Result<(), RecordingError> {
        for (key, value) in values {
            finite("/events", time, || format!("{key} of {name}"), [*value])?;
        }
        self.json("/events", time, &json::Event { timestamp: Time::of(time), name, values: Named(values) })
    }

    /// Completes the file and gives it back.
    ///
    /// # Errors
    /// [`RecordingError::Write`].
    pub fn finish(mut self) -> Result<W, RecordingError> {
        self.writer.finish().map_err(|source| RecordingError::Write { topic: "summary", source })?;
        Ok(self.writer.into_inner())
    }

    fn joints(&mut self, topic: &'static str, time: u64, joints: &[Joint<'_>]) -> Result<(), RecordingError> {
        distinct(topic, joints.iter().map(|joint| joint.name))?;
        for joint in joints {
            let values = [joint.position].into_iter().chain(joint.velocity).chain(joint.effort);
            finite(topic, time, || joint.name.to_owned(), values)?;
        }
        self.json(topic, time, &json::JointStates { timestamp: Time::of(time), joints })
    }

    fn by_channel(&mut self, topic: &'static str, time: u64, values: &[f64]) -> Result<(), RecordingError> {
        let needed = self.channels.len();
        if values.len() != needed {
            return Err(RecordingError::Length { topic, time, found: values.len(), needed });
        }
        for (name, value) in self.channels.iter().zip(values) {
            finite(topic, time, || name.clone(), [*value])?;
        }
        let named: Vec<(&str, f64)> = self.channels.iter().map(String::as_str).zip(values.iter().copied()).collect();
        let bytes = json::bytes(&json::Channels { timestamp: Time::of(time), values: Named(&named) });
        self.write(topic, time, &bytes)
    }

    fn json(&mut self, topic: &'static str, time: u64, message: &impl Serialize) -> Result<(), RecordingError> {
        self.write(topic, time, &json::bytes(message))
    }

    fn write(&mut self, topic: &'static str, time: u64, bytes: &[u8]) -> Result<(), RecordingError> {
        if time < self.time {
            return Err(RecordingError::Backwards { topic, time, last: self.time });
        }
        self.time = time;
        let failed = |source| RecordingError::Write { topic, source };
        let Open { channel, messages } = self.open(topic).map_err(failed)?;
        let header = MessageHeader { channel_id: channel, sequence: messages, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, bytes).map_err(failed)?;
        self.open.insert(topic, Open { channel, messages: messages.wrapping_add(1) });
        Ok(())
    }

    fn open(&mut self, topic: &'static str) -> Result<Open, McapError> {
        if let Some(open) = self.open.get(topic) {
            return Ok(*open);
        }
        let schema = json::Schema::of(topic, &self.channels);
        let id = self.writer.add_schema(schema.name, schema.encoding, &schema.data)?;
        let channel = self.writer.add_channel(id, topic, schema.message_encoding, &BTreeMap::new())?;
        Ok(Open { channel, messages: 0 })
    }
}

fn finite(
    topic: &'static str,
    time: u64,
    name: impl Fn() -> String,
    values: impl IntoIterator<Item = f64>,
) -> Result<(), RecordingError> {
    match values.into_iter().find(|value| !value.is_finite()) {
        Some(value) => Err(RecordingError::NotFinite { topic, time, what: name(), value }),
        None => Ok(()),
    }
}

fn finite_place(
    topic: &'static str,
    time: u64,
    name: &str,
    place: &nalgebra::Isometry3<f64>,
) -> Result<(), RecordingError> {
    let values = place.translation.vector.iter().chain(place.rotation.coords.iter()).copied();
    finite(topic, time, || name.to_owned(), values)
}

fn distinct<'a>(topic: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), RecordingError> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(RecordingError::Twice { topic, name: name.to_owned() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
