//! Interactions as an MCAP recording: what there is to see, what was sensed and predicted, collisions.

use std::io::Cursor;

use super::interaction::{CHANNELS, Interaction};
use super::order::PERIOD;
use crate::recording::{Contact, Heading, Joint, Recorder, RecordingError, Robot};
use crate::robot::joints::{HEAD, RIGHT_ARM};
use crate::robot::nao;

/// A recording of interactions, in memory until it is [finished](Film::finish).
///
/// Links of the self-robot are named `self/...`, those of the other one `other/...`. So are the other robot's joints; the
/// self-robot's are named as in its description, like the channels.
pub struct Film {
    recorder: Recorder<Cursor<Vec<u8>>>,
    /// When the present sequence began, and when its last frame was, in nanoseconds.
    begun: u64,
    now: Option<u64>,
    /// Whether the object was in view at the last frame.
    in_view: bool,
}

impl std::fmt::Debug for Film {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Film").field("begun", &self.begun).field("now", &self.now).finish_non_exhaustive()
    }
}

/// Mean and variance of a sample as they were predicted, in the sensors' units; the variance where there is one.
pub type Prediction<'a> = (&'a [f64], Option<&'a [f64]>);

impl Film {
    /// Begins a recording, with notes of its own.
    ///
    /// # Errors
    /// As [`Recorder::new`].
    pub fn new(notes: &[(&str, &str)]) -> Result<Self, RecordingError> {
        let channels = CHANNELS.map(String::from);
        let robots = ["self/", "other/"].map(|prefix| Robot { prefix, urdf: nao::URDF });
        let heading = Heading { robots: &robots, channels: &channels, notes, ..Heading::default() };
        let recorder = Recorder::new(Cursor::new(Vec::new()), &heading)?;
        Ok(Self { recorder, begun: 0, now: None, in_view: true })
    }

    /// An interaction begins, one period after the last frame of the one before.
    ///
    /// # Errors
    /// As [`Recorder::begin_sequence`].
    pub fn begin(&mut self, name: &str) -> Result<(), RecordingError> {
        self.begun = self.now.map_or(0, |now| now + nanoseconds(PERIOD));
        self.in_view = true;
        self.recorder.begin_sequence(self.begun, name)
    }

    /// The world at a sample, what was sensed of it, and what it was predicted as.
    ///
    /// # Errors
    /// As the [`Recorder`]'s.
    pub fn frame(
        &mut self,
        interaction: &Interaction,
        sample: &[f64; 8],
        predicted: Option<Prediction<'_>>,
    ) -> Result<(), RecordingError> {
        let time = self.begun + nanoseconds(interaction.time());
        self.now = Some(time);
        let recorder = &mut self.recorder;
        recorder.scene(time, &interaction.scene())?;
        let [own, other] = interaction.joint_states();
        let names: Vec<String> = other.iter().map(|joint| format!("other/{}", joint.name)).collect();
        let other = other.into_iter().zip(&names).map(|(joint, name)| Joint { name, ..Joint::from(joint) });
        recorder.joint_states(time, &own.into_iter().map(Joint::from).chain(other).collect::<Vec<_>>())?;
        let [_, goals] = interaction.joints();
        let targets = HEAD.into_iter().chain(RIGHT_ARM).zip(&goals).map(|(name, &goal)| Joint::at(name, goal));
        recorder.joint_targets(time, &targets.collect::<Vec<_>>())?;
        recorder.sensed(time, sample)?;
        if let Some((mean, variance)) = predicted {
            recorder.predicted(time, mean, variance)?;
        }
        let contacts = interaction.contacts().into_iter();
        let contacts =
            contacts.map(|([a, b], depth, force)| Contact { a, b, distance: Some(-depth), force: Some(force) });
        recorder.contacts(time, &contacts.collect::<Vec<_>>())?;
        if let Some(collision) = interaction.collision() {
            let depth = interaction.depth();
            recorder.event(time, &format!("collision with {collision:?}").to_lowercase(), &[("depth", depth)])?;
        }
        if let Some(branching) = interaction.branching() {
            recorder.event(time, &branching, &[])?;
        }
        let in_view = interaction.object_in_view();
        if in_view != self.in_view {
            self.in_view = in_view;
            recorder.event(time, if in_view { "object in view again" } else { "object out of view" }, &[])?;
        }
        Ok(())
    }

    /// Completes the recording and gives its bytes.
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn finish(self) -> Result<Vec<u8>, RecordingError> {
        Ok(self.recorder.finish()?.into_inner())
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::interact::{InteractionOptions, all_orders, letters, parse_order, record};
    use crate::recording::reading::Last;

    fn film() -> Vec<u8> {
        let mut film = Film::new(&[("seed", "1")]).unwrap();
        for order in &all_orders(1) {
            film.begin(&letters(order)).unwrap();
            record(order, &InteractionOptions::default(), (1, 0), 40, |interaction, sample| {
                film.frame(interaction, sample, Some((&[0.0; 8], None))).unwrap();
            })
            .unwrap();
        }
        film.finish().unwrap()
    }

    #[test]
    fn a_film_shows_both_robots_and_the_same_calls_give_the_same_bytes() {
        let bytes = film();
        assert!(bytes == film());
        let (mut topics, mut times) = (BTreeMap::new(), Vec::new());
        for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
            *topics.entry(message.channel.topic.clone()).or_insert(0) += 1;
            if message.channel.topic == "/sequence" {
                times.push(message.log_time);
            }
        }
        for topic in ["/scene", "/transforms", "/joint_states", "/joint_targets", "/sensed", "/predicted_mean"] {
            assert_eq!(topics[topic], 80, "{topic}");
        }
        assert_eq!(times, [0, 4_000_000_000]);
        // The only branching of each.
        assert!(topics["/events"] == 2 && !topics.contains_key("/predicted_variance"), "{topics:?}");
    }

    #[test]
    fn joint_states_place_every_link_of_both_robots_where_its_frame_is() {
        let last = Last::of(&film());
        assert_eq!(last.joints.len(), 20, "{:?}", last.joints);
        let robot = nao::load().unwrap();
        for (links, joints) in [("self/", ""), ("other/", "other/")] {
            let off = last.farthest(&robot, links, joints);
            assert!(off < 1e-9, "{links}: {off} m");
        }
    }

    #[test]
    fn a_film_tells_when_the_object_is_lost() {
        let mut interaction =
            Interaction::new(&parse_order("L").unwrap(), &InteractionOptions::default(), 1, 0).unwrap();
        let mut film = Film::new(&[]).unwrap();
        film.begin("L").unwrap();
        interaction.turn_away();
        for _ in 0..10 {
            let sample = interaction.sense();
            film.frame(&interaction, &sample, None).unwrap();
            interaction.step_tutored();
        }
        let bytes = film.finish().unwrap();
        let events = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let events: Vec<String> = events
            .filter(|message| message.channel.topic == "/events")
            .map(|message| String::from_utf8(message.data.to_vec()).unwrap())
            .collect();
        assert!(events.len() == 1 && events[0].contains("object out of view"), "{events:?}");
    }
}
