//! An interaction of two robots as an MCAP recording (thesis 5.2.2).

use std::io::Cursor;

use super::interaction::{CHANNELS, Interaction, PERIOD};
use crate::robot::joints::{HEAD, RIGHT_ARM};
use crate::robot::nao;
use crate::recording::{Heading, Joint, Recorder, RecordingError, Robot};

/// An MCAP recording in the making.
pub struct Film {
    recorder: Recorder<Cursor<Vec<u8>>>,
    /// Nanoseconds before the present sequence, and at its last frame.
    begun: u64,
    now: u64,
}

impl Film {
    /// An empty one, with these notes in it.
    ///
    /// # Errors
    /// What the recorder refuses.
    pub fn new(notes: &[(&str, &str)]) -> Result<Self, RecordingError> {
        let channels = CHANNELS.map(String::from);
        let robots = ["self/", "other/"].map(|prefix| Robot { prefix, urdf: nao::URDF });
        let heading = Heading { robots: &robots, channels: &channels, notes, ..Heading::default() };
        Ok(Self { recorder: Recorder::new(Cursor::new(Vec::new()), &heading)?, begun: 0, now: 0 })
    }

    /// A sequence begins after the last one.
    ///
    /// # Errors
    /// What the recorder refuses.
    pub fn begin(&mut self, name: &str) -> Result<(), RecordingError> {
        self.begun = match self.now {
            0 => 0,
            now => now + nanoseconds(PERIOD),
        };
        self.recorder.begin_sequence(self.begun, name)
    }

    /// The world at a sample; `predicted` are mean and variance of it.
    ///
    /// # Errors
    /// What the recorder refuses.
    pub fn frame(
        &mut self,
        interaction: &Interaction,
        sample: &[f64; 8],
        predicted: Option<(&[f64], Option<&[f64]>)>,
    ) -> Result<(), RecordingError> {
        let time = self.begun + nanoseconds(interaction.time());
        self.now = time;
        let recorder = &mut self.recorder;
        recorder.scene(time, &interaction.scene())?;
        let [angles, goals] = interaction.joints();
        let names = || HEAD.into_iter().chain(RIGHT_ARM);
        let of = |values: &[f64]| names().zip(values).map(|(name, &q)| Joint::at(name, q)).collect::<Vec<_>>();
        recorder.joint_states(time, &of(&angles))?;
        recorder.joint_targets(time, &of(&goals))?;
        recorder.sensed(time, sample)?;
        if let Some((mean, variance)) = predicted {
            recorder.predicted(time, mean, variance)?;
        }
        if let Some(collision) = interaction.collision() {
            let depth = interaction.depth();
            recorder.event(time, &format!("collision with {collision:?}").to_lowercase(), &[("depth", depth)])?;
        }
        Ok(())
    }

    /// Completes the recording; the bytes of its file.
    ///
    /// # Errors
    /// What the recorder refuses.
    pub fn finish(self) -> Result<Vec<u8>, RecordingError> {
        Ok(self.recorder.finish()?.into_inner())
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
