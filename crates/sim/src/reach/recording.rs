//! The reaching experiment as a recording: what there is to see, what was sensed and predicted, touches.

use std::io::{Seek, Write};

use crate::reach::agent::Snapshot;
use crate::reach::channels::REACHING;
use crate::reach::stage::Stage;
use crate::recording::{Contact, Heading, Joint, Recorder, RecordingError, Robot};
use crate::robot::nao;
use crate::world::scene::Scene;

/// Seconds between two pictures of a performance.
const PICTURES: f64 = 0.1;

/// A recording under way.
pub struct ReachingRecording<W: Write + Seek> {
    recorder: Recorder<W>,
    /// When the sequence began, in seconds of the recording.
    begun: f64,
    /// Pictures taken in the sequence.
    pictures: u64,
}

impl<W: Write + Seek> std::fmt::Debug for ReachingRecording<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReachingRecording").field("begun", &self.begun).finish_non_exhaustive()
    }
}

/// What is kept of one sample of a demonstration.
#[derive(Debug, Clone, PartialEq)]
pub struct DemonstrationSample {
    /// Seconds since the demonstration began.
    pub time: f64,
    /// What the robot sensed, by channel.
    pub sensed: Vec<f64>,
    /// Name and true angle of every joint that the robot's description calls movable.
    pub joints: Vec<(String, f64)>,
    /// All that can be seen.
    pub scene: Scene,
}

impl DemonstrationSample {
    /// At the stage as it is.
    #[must_use]
    pub fn at(stage: &Stage, sensed: &[f64]) -> Self {
        let states = stage.world.own(stage.robot()).joint_states();
        let joints = states.into_iter().map(|state| (state.name.to_owned(), state.angle)).collect();
        Self { time: stage.world.time(), sensed: sensed.to_vec(), joints, scene: stage.world.scene() }
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

fn targets(angles: &[f64]) -> Vec<Joint<'static>> {
    REACHING.iter().zip(angles).map(|(name, &angle)| Joint::at(name, angle)).collect()
}

impl<W: Write + Seek> ReachingRecording<W> {
    /// Begins, with the experiment file and other notes where there are any.
    ///
    /// # Errors
    /// As [`Recorder::new`].
    pub fn new(out: W, experiment: Option<&str>, notes: &[(&str, &str)]) -> Result<Self, RecordingError> {
        let channels = REACHING.map(str::to_owned);
        let robots = [Robot { prefix: "self/", urdf: nao::URDF }];
        let heading = Heading { robots: &robots, experiment, channels: &channels, notes };
        Ok(Self { recorder: Recorder::new(out, &heading)?, begun: 0.0, pictures: 0 })
    }

    /// A sequence begins at a time, in seconds.
    ///
    /// # Errors
    /// As [`Recorder::begin_sequence`].
    pub fn begin_sequence(&mut self, seconds: f64, name: &str) -> Result<(), RecordingError> {
        self.begun = seconds;
        self.pictures = 0;
        self.recorder.begin_sequence(nanoseconds(seconds), name)
    }

    /// One sample of a demonstration.
    ///
    /// # Errors
    /// As the [`Recorder`]'s.
    pub fn demonstration(&mut self, sample: &DemonstrationSample) -> Result<(), RecordingError> {
        let time = nanoseconds(self.begun + sample.time);
        let joints: Vec<Joint<'_>> = sample.joints.iter().map(|(name, angle)| Joint::at(name, *angle)).collect();
        self.recorder.joint_states(time, &joints)?;
        self.recorder.sensed(time, &sample.sensed)?;
        self.recorder.scene(time, &sample.scene)
    }

    /// One snapshot of a performance.
    ///
    /// # Errors
    /// As the [`Recorder`]'s.
    pub fn snapshot(&mut self, snapshot: &Snapshot<'_>) -> Result<(), RecordingError> {
        let stage = snapshot.stage;
        let time = nanoseconds(self.begun + stage.world.time());
        if let Some((sensed, decision)) = snapshot.decision {
            self.recorder.sensed(time, sensed)?;
            let variance = Some(decision.variance.as_slice()).filter(|variance| !variance.is_empty());
            self.recorder.predicted(time, &decision.mean, variance)?;
        }
        if let Some(cycle) = snapshot.contact {
            let hand = stage.hand_state();
            let values = [("cycle", cycle as f64 + 1.0), ("gap", hand.gap), ("aim", hand.aim)];
            self.recorder.event(time, "touch", &values)?;
        }
        if stage.world.time() + 1e-9 < self.pictures as f64 * PICTURES {
            return Ok(());
        }
        self.pictures += 1;
        let states = stage.world.own(stage.robot()).joint_states();
        self.recorder.joint_states(time, &states.into_iter().map(Joint::from).collect::<Vec<_>>())?;
        self.recorder.joint_targets(time, &targets(&snapshot.goals))?;
        let contacts = stage.world.contacts();
        let contacts = contacts.iter().map(|contact| Contact {
            a: stage.world.name_of(contact.bodies[0]),
            b: stage.world.name_of(contact.bodies[1]),
            distance: Some(-contact.depth),
            force: Some(contact.force),
        });
        self.recorder.contacts(time, &contacts.collect::<Vec<_>>())?;
        self.recorder.scene(time, &stage.world.scene())
    }

    /// Completes the recording.
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn finish(self) -> Result<W, RecordingError> {
        self.recorder.finish()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::error::Error;
    use crate::reach::agent::{Performance, Replay, perform};
    use crate::reach::stage::{POSITIONS, retracted_arm, touching_arm};
    use crate::reach::tutor::{Tutoring, demonstrate_with};
    use crate::recording::reading::Last;
    use crate::robot::nao::load_one_armed;
    use crate::world::WorldOptions;

    #[derive(Debug)]
    struct Failed;

    impl From<Error> for Failed {
        fn from(_: Error) -> Self {
            Self
        }
    }

    impl From<RecordingError> for Failed {
        fn from(_: RecordingError) -> Self {
            Self
        }
    }

    fn performance() -> Vec<u8> {
        let robot = load_one_armed().unwrap();
        let y = POSITIONS[2];
        let arms = [touching_arm(&robot, y, [0.0; 3], &[0.0; 4]).unwrap(), retracted_arm(&robot, y).unwrap()];
        let mut driver = Replay::new(arms.iter().flat_map(|arm| [*arm; 4]).collect()).unwrap();
        let performance = Performance { y, samples: 12, shift: None, frozen: None, world: WorldOptions::default() };
        let mut recording =
            ReachingRecording::new(Cursor::new(Vec::new()), Some("name = \"x\""), &[("seed", "1")]).unwrap();
        recording.begin_sequence(0.0, "here").unwrap();
        let mut observe = |snapshot: &Snapshot<'_>| Ok::<(), Failed>(recording.snapshot(snapshot)?);
        let performed = perform(&performance, &mut driver, &mut observe).unwrap();
        assert!(performed.cycles.iter().any(|cycle| cycle.touched), "{:?}", performed.cycles);
        recording.finish().unwrap().into_inner()
    }

    #[test]
    fn the_same_performance_gives_the_same_bytes() {
        let bytes = performance();
        assert!(bytes == performance() && bytes.len() > 50_000, "{} bytes", bytes.len());
        let mut topics = std::collections::BTreeMap::new();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            *topics.entry(message.unwrap().channel.topic.clone()).or_insert(0) += 1;
        }
        assert_eq!((topics["/sensed"], topics["/predicted_mean"], topics["/sequence"]), (12, 12, 1));
        assert_eq!((topics["/scene"], topics["/joint_states"], topics["/joint_targets"]), (61, 61, 61));
        assert!(topics["/events"] >= 1 && !topics.contains_key("/predicted_variance"));
    }

    #[test]
    fn joint_states_and_description_place_every_link_where_its_frame_is() {
        let off = |bytes: &[u8]| Last::of(bytes).farthest(&nao::load().unwrap(), "self/", "");
        assert!(off(&performance()) < 1e-9, "{}", off(&performance()));
        let tutoring = Tutoring { sequences: 1, samples: 2, ..Tutoring::default() };
        let all = demonstrate_with(&tutoring, 1, 1, &DemonstrationSample::at).unwrap();
        let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), None, &[]).unwrap();
        all[0].1.iter().for_each(|sample| recording.demonstration(sample).unwrap());
        let bytes = recording.finish().unwrap().into_inner();
        assert!(off(&bytes) < 1e-9, "{}", off(&bytes));
    }

    #[test]
    fn demonstrations_follow_each_other_in_time() {
        let tutoring = Tutoring { sequences: 2, samples: 3, ..Tutoring::default() };
        let all = demonstrate_with(&tutoring, 1, 2, &DemonstrationSample::at).unwrap();
        let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), None, &[]).unwrap();
        for (index, (demonstration, samples)) in all.iter().enumerate() {
            recording.begin_sequence(10.0 * index as f64, "some").unwrap();
            assert_eq!(
                samples.iter().flat_map(|sample| sample.sensed.clone()).collect::<Vec<_>>(),
                demonstration.samples
            );
            samples.iter().for_each(|sample| recording.demonstration(sample).unwrap());
        }
        assert!(!recording.finish().unwrap().into_inner().is_empty());
    }
}
