//! A recording as a page that plays it: the robots in 3-D, and below them what was sensed and predicted, with contacts and events.
//!
//! What is drawn comes from the recording alone: from `foxglove.SceneUpdate` messages, or, where there are none, from joint states and
//! a robot's description. What a recording does not hold, the page says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use scrnn_data::{FileError, play};
use scrnn_report::{Applet, Block, Page, Section};
use scrnn_run::failure::Failure;
use scrnn_sim::robot::looks::Looks;
use serde_json::{Value, json};

mod bodies;
mod signals;

use bodies::Bodies;
pub(crate) use bodies::base64;
use signals::Signals;

/// Bytes of places of bodies in a page, before they become text; more pictures than fit are thinned out.
const BYTES: usize = 2_400_000;
/// Numbers of all curves in a page.
const NUMBERS: usize = 120_000;
/// Marks of one kind that are kept.
const MARKS: usize = 2_000;

const BODY: &str = r#"<canvas class="world" tabindex="0" role="img" aria-label="The robots in 3-D. Drag to turn, wheel to come nearer; or arrow keys, plus and minus"></canvas>
<p class="missing" role="status" hidden></p>
<div class="controls">
<button class="play" type="button" aria-label="play">&#9654;</button>
<input class="bar" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output class="clock">0.0 s</output>
<label>speed <select class="speed"><option value="0.25">1/4</option><option value="1" selected>1</option><option value="2">2</option><option value="5">5</option><option value="20">20</option></select></label>
<button class="home" type="button">view from the front</button>
</div>
<p class="now" aria-live="off"></p>
<svg class="marks" viewBox="0 0 1000 10" preserveAspectRatio="none" role="img" aria-label="When something happened"></svg>
<div class="signals"></div>"#;

/// What the recording tells of one moment after the other.
#[derive(Debug, Default)]
struct Story {
    bodies: Bodies,
    signals: Signals,
    /// Time, kind and words of what happened.
    events: Vec<(i64, String)>,
    sequences: Vec<(i64, String)>,
    /// Times at which pairs of bodies touched.
    contacts: BTreeMap<String, Vec<i64>>,
    contact_messages: usize,
    joints: Vec<(i64, BTreeMap<String, f64>)>,
    description: Option<String>,
    topics: BTreeSet<String>,
}

/// The page about a recording, from its file, or from these bytes that would stand there; with the description of a robot where somebody
/// gives one.
///
/// # Errors
/// What is wrong with the recording; [`ViewError::Robot`] for a description that cannot be read, [`ViewError::Nothing`] where there is
/// nothing to show.
pub fn page(recording: &Path, bytes: Option<&[u8]>, urdf: Option<&str>) -> Result<Page, ViewError> {
    let mut story = Story::default();
    let wanted = |topic: &str, of: &str| {
        matches!(topic, "/sensed" | "/predicted_mean" | "/predicted_variance" | "/contacts" | "/events" | "/sequence")
            || of == "foxglove.SceneUpdate"
            || is_joint_state(of)
            || topic.ends_with("/robot_description")
    };
    let unread = play(recording, bytes, &wanted, &mut |told| {
        story.topics.insert(told.topic.to_owned());
        story.take(told.topic, told.of, told.time, &told.value);
    })?;
    let mut missing: Vec<String> = unread.into_iter().map(|why| format!("Not read: {why}.")).collect();
    // Somebody who names a description wants to see that robot.
    let description = urdf.map(str::to_owned).or_else(|| story.description.take());
    if story.bodies.is_empty() || urdf.is_some() {
        match &description {
            Some(text) => {
                let looks = Looks::from_urdf(text).map_err(|error| ViewError::Robot(error.to_string()))?;
                story.pose(&looks, &mut missing);
            }
            None if story.joints.is_empty() => {
                missing.push("The recording holds neither scenes (foxglove.SceneUpdate) nor joint states: no robot is shown.".into());
            }
            None => missing.push(
                "The recording holds joint states but no description of the robot: give its URDF with --urdf to see it.".into(),
            ),
        }
    }
    if story.bodies.is_empty() && story.signals.is_empty() && story.joints.is_empty() {
        return Err(ViewError::Nothing { path: recording.display().to_string() });
    }
    if story.signals.is_empty() {
        // The joints themselves are better than nothing below the robot.
        for (time, joints) in &story.joints {
            story.signals.sensed(*time, joints.iter().map(|(name, value)| (name.as_str(), *value)));
        }
        missing.push(
            "Nothing is recorded on /sensed: the curves are the joints' positions, and there is no prediction.".into(),
        );
    } else if !story.signals.has_predictions() {
        missing.push("Nothing is recorded on /predicted_mean: there is no prediction beside what was sensed.".into());
    }
    if story.contact_messages == 0 {
        missing.push("Nothing is recorded on /contacts: contacts are not marked.".into());
    }
    Ok(story.page(recording, missing))
}

/// Why there is no page.
#[derive(Debug)]
pub enum ViewError {
    /// The recording cannot be read.
    File(FileError),
    /// The robot's description cannot be read: why.
    Robot(String),
    /// There is nothing in it that can be shown.
    Nothing {
        /// The recording.
        path: String,
    },
}

impl From<ViewError> for Failure {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::File(error) => error.into(),
            ViewError::Robot(why) => Self::input(why, "give a URDF file to --urdf"),
            ViewError::Nothing { path } => Self::input(
                format!("{path} holds nothing to show"),
                "needed: foxglove.SceneUpdate, joint states, or the topic /sensed; `scrnn inspect` lists what it holds",
            ),
        }
    }
}

impl From<FileError> for ViewError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

fn is_joint_state(of: &str) -> bool {
    matches!(of, "foxglove.JointStates" | "sensor_msgs/msg/JointState" | "sensor_msgs/JointState")
}

impl Story {
    fn take(&mut self, topic: &str, of: &str, time: i64, value: &Value) {
        let named = |value: &Value| value["name"].as_str().unwrap_or_default().to_owned();
        match topic {
            _ if of == "foxglove.SceneUpdate" => self.bodies.scene(time, value),
            "/joint_targets" => {}
            _ if is_joint_state(of) => {
                let joints = joint_state(value);
                // Robots may have topics of their own; messages of one moment are one posture.
                match self.joints.last_mut() {
                    Some((last, all)) if *last == time => all.extend(joints),
                    last => {
                        let mut all = last.map(|(_, all)| all.clone()).unwrap_or_default();
                        all.extend(joints);
                        self.joints.push((time, all));
                    }
                }
            }
            "/sensed" => self.signals.sensed(time, by_channel(value)),
            "/predicted_mean" => self.signals.mean(time, by_channel(value)),
            "/predicted_variance" => self.signals.variance(time, by_channel(value)),
            "/sequence" => self.sequences.push((time, named(value))),
            "/contacts" => {
                self.contact_messages += 1;
                for contact in value["contacts"].as_array().into_iter().flatten() {
                    let [a, b] = ["a", "b"].map(|key| contact[key].as_str().unwrap_or_default());
                    self.contacts.entry(format!("{a} and {b}")).or_default().push(time);
                }
            }
            "/events" => {
                let values = value["values"].as_object().into_iter().flatten();
                let values: Vec<String> = values.map(|(key, value)| format!("{key} {}", digits(value))).collect();
                self.events.push((time, format!("{} {}", named(value), values.join(", ")).trim().to_owned()));
            }
            _ => {
                let text = value["data"].as_str().or(value.as_str());
                if let Some(text) = text.filter(|text| text.contains("<robot")) {
                    self.description = Some(text.to_owned());
                }
            }
        }
    }

    /// A robot by its description and the joint states.
    fn pose(&mut self, looks: &Looks, missing: &mut Vec<String>) {
        let known: BTreeSet<&String> = self.joints.iter().flat_map(|(_, joints)| joints.keys()).collect();
        let unmoved: Vec<&str> = looks.joints().filter(|name| !known.contains(&(*name).to_owned())).collect();
        if self.joints.is_empty() {
            missing.push("No joint states are recorded: the robot stands still.".into());
            self.joints.push((0, BTreeMap::new()));
        } else if !unmoved.is_empty() {
            missing.push(format!("No joint state moves {} of {}: shown at 0.", unmoved.join(", "), looks.name));
        }
        if looks.meshes > 0 {
            missing.push(format!(
                "{} parts of {} are meshes, which are left out; simple shapes for contacts stand in where the description has them.",
                looks.meshes, looks.name
            ));
        }
        if !looks.still.is_empty() {
            missing.push(format!("Joints of a kind that is not shown stand still: {}.", looks.still.join(", ")));
        }
        missing.push("Where the robot stands in the world is not known: its root is at the origin.".into());
        for (time, joints) in &self.joints {
            self.bodies.posture(*time, looks, &looks.places(joints));
        }
    }

    fn page(mut self, recording: &Path, missing: Vec<String>) -> Page {
        let name = recording.file_name().unwrap_or(recording.as_os_str()).to_string_lossy().into_owned();
        let times = self.bodies.times().iter().copied().chain(self.signals.times());
        let times = times.chain(self.events.iter().map(|(time, _)| *time));
        let (first, last) = times.fold((i64::MAX, i64::MIN), |(first, last), time| (first.min(time), last.max(time)));
        let (first, last) = if first > last { (0, 0) } else { (first, last) };
        let seconds = |time: i64| time.saturating_sub(first) as f64 / 1e9;
        let mut notes = missing;
        notes.extend(self.bodies.thin_out(BYTES));
        notes.extend(self.signals.thin_out(NUMBERS));
        // What touches all the time, as a robot and its bench, is no event.
        let always = |times: &Vec<i64>| times.len() * 10 > self.contact_messages * 9;
        let kept = self.contacts.iter().filter(|(_, times)| !always(times));
        let contacts: Vec<Value> = kept
            .map(|(pair, times)| {
                let every = times.len().div_ceil(MARKS).max(1);
                let times: Vec<f64> = times.iter().step_by(every).map(|&time| seconds(time)).collect();
                json!({ "pair": pair, "times": times })
            })
            .collect();
        let marks = |list: &[(i64, String)]| -> Vec<Value> {
            let every = list.len().div_ceil(MARKS).max(1);
            list.iter().step_by(every).map(|(time, words)| json!([seconds(*time), words])).collect()
        };
        let length = seconds(last);
        let lede = format!(
            "{length:.1} seconds, {} bodies in {} pictures, {} channels, {} events.",
            self.bodies.count(),
            self.bodies.times().len(),
            self.signals.channels(),
            self.events.len()
        );
        let data = json!({
            "length": length,
            "times": self.bodies.times().iter().map(|&time| seconds(time)).collect::<Vec<_>>(),
            "bodies": self.bodies.json(),
            "signals": self.signals.json(&seconds),
            "events": marks(&self.events),
            "sequences": marks(&self.sequences),
            "contacts": contacts,
        });
        let applet = Applet {
            name: "view".into(),
            title: "The recording".into(),
            caption: "Drag to turn, wheel or two fingers to come nearer, right button or shift to move; space plays. Below: what was sensed \
                      (dashed), what the network expected (line) and two of its standard deviations (band), at the time at which it is written: in recordings \
                      of reaching an expectation is of the next sample. Marks under the time bar are \
                      events, contacts and the begins of sequences; a click into a curve goes there."
                .into(),
            body: BODY.into(),
            style: include_str!("view.css"),
            script: concat!(include_str!("../common.js"), include_str!("scene.js"), include_str!("view.js")),
            data: data.to_string(),
        };
        let mut sections = vec![Section { title: "Recording".into(), blocks: vec![Block::Applet(Box::new(applet))] }];
        if !notes.is_empty() {
            let blocks = notes.into_iter().map(Block::Text).collect();
            sections.push(Section { title: "What is not shown".into(), blocks });
        }
        let topics = self.topics.iter().map(String::as_str).collect::<Vec<_>>().join("\n");
        sections.push(Section { title: "Topics that were read".into(), blocks: vec![Block::Verbatim(topics)] });
        Page { title: format!("Recording: {name}"), lede, sections }
    }
}

/// A number with as many digits as one can take in.
fn digits(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if number != 0.0 => {
            let places = (3 - number.abs().log10().floor() as i32).clamp(0, 9) as usize;
            let text = format!("{number:.places$}");
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        _ => value.to_string(),
    }
}

/// Name and position of each joint, whether they are a list of objects or lists side by side.
fn joint_state(value: &Value) -> Vec<(String, f64)> {
    if let Some(joints) = value["joints"].as_array() {
        let one = |joint: &Value| Some((joint["name"].as_str()?.to_owned(), joint["position"].as_f64()?));
        return joints.iter().filter_map(one).collect();
    }
    let (names, positions) = (value["name"].as_array(), value["position"].as_array());
    let pairs = names.into_iter().flatten().zip(positions.into_iter().flatten());
    pairs.filter_map(|(name, position)| Some((name.as_str()?.to_owned(), position.as_f64()?))).collect()
}

/// The numbers of a message by name; its timestamp is none.
fn by_channel(value: &Value) -> impl Iterator<Item = (&str, f64)> {
    let entries = value.as_object().into_iter().flatten();
    entries.filter_map(|(name, value)| Some((name.as_str(), value.as_f64()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_events_are_short_and_joint_states_are_read_in_both_forms() {
        let all = [json!(0.004_971_584), json!(2.0), json!(0), json!(12_345.678)].map(|value| digits(&value));
        assert_eq!(all, ["0.004972", "2", "0", "12346"]);
        let foxglove = json!({ "joints": [{ "name": "a", "position": 0.5 }, { "name": "b" }] });
        let ros = json!({ "name": ["a", "b"], "position": [0.5, 1.5], "velocity": [] });
        assert_eq!(joint_state(&foxglove), [("a".to_owned(), 0.5)]);
        assert_eq!(joint_state(&ros), [("a".to_owned(), 0.5), ("b".to_owned(), 1.5)]);
        assert_eq!(by_channel(&json!({ "timestamp": { "sec": 1 }, "x": 2.0 })).collect::<Vec<_>>(), [("x", 2.0)]);
    }
}
