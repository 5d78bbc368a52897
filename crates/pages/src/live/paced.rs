//! What is shown at a pace: a recording, or a simulation that is faster than the world.

use std::time::{Duration, Instant};

use scrnn_run::failure::Result;

use super::motion::{Frame, Heading, Look, Motion};

/// A page, and the pace at which it is shown something.
#[derive(Debug)]
pub struct Paced {
    motion: Motion,
    /// Units of time in a second.
    pace: Option<f64>,
    begun: Option<(Instant, f64)>,
}

impl Paced {
    /// Serves the page at a port; `heading.pace` is the pace of what it shows, too.
    ///
    /// # Errors
    /// A port that cannot be had.
    pub fn start(port: u16, heading: &Heading<'_>) -> Result<Self> {
        Ok(Self { motion: Motion::start(port, heading)?, pace: heading.pace, begun: None })
    }

    /// Where the page is.
    #[must_use]
    pub fn url(&self) -> String {
        self.motion.url()
    }

    /// Waits until it is time for what is shown next, and shows it.
    pub fn frame(&mut self, frame: &Frame<'_>) {
        if let Some(pace) = self.pace {
            let (at, first) = *self.begun.get_or_insert_with(|| (Instant::now(), frame.time));
            let due = Duration::try_from_secs_f64((frame.time - first) / pace).unwrap_or_default();
            if let Some(early) = due.checked_sub(at.elapsed()) {
                std::thread::sleep(early);
            }
        }
        self.motion.frame(frame);
    }

    /// As [`Motion::wants_look`].
    #[must_use]
    pub fn wants_look(&self) -> bool {
        self.motion.wants_look()
    }

    /// As [`Motion::look`].
    pub fn look(&mut self, look: Look, note: String) {
        self.motion.look(look, note);
    }

    /// Nothing more will come.
    pub fn finish(self) {
        self.motion.finish();
    }
}
