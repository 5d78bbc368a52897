//! A page that shows a robot or a stream while it goes on: its options, and the pace of what is shown.

use std::time::{Duration, Instant};

use clap::Args;
use scrnn_pages::live::{Frame, Heading, Look, Motion};
use scrnn_run::failure::Result;

use crate::args::number;
use crate::output;

/// Where to show what goes on.
#[derive(Debug, Clone, Args)]
pub struct Watch {
    /// Serve a page on this machine that shows it as it goes on, at this port or any that is free
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    watch: Option<u16>,
    /// With --watch: how many times as fast as in the world, 0 to 1000; 0 waits for nothing [default: 1]
    #[arg(long, value_name = "FACTOR", requires = "watch", value_parser = number(0.0, 1000.0))]
    speed: Option<f64>,
}

impl Watch {
    /// Whether a speed was asked for.
    pub fn has_speed(&self) -> bool {
        self.speed.is_some()
    }

    /// Begins to show, if that is wanted. `seconds` is how long one of the heading's units lasts in the world; none for what has a pace of
    /// its own.
    pub fn start(&self, heading: &Heading<'_>, seconds: Option<f64>) -> Result<Option<Watching>> {
        let Some(port) = self.watch else { return Ok(None) };
        let speed = Some(self.speed.unwrap_or(1.0)).filter(|speed| *speed > 0.0);
        let pace = seconds.zip(speed).map(|(seconds, speed)| speed / seconds);
        let motion = Motion::start(port, &Heading { pace, ..*heading })?;
        output::say(format_args!("watch it at {}", motion.url()));
        Ok(Some(Watching { motion, pace, begun: None }))
    }
}

/// A page, and the pace at which it is shown something.
#[derive(Debug)]
pub struct Watching {
    motion: Motion,
    /// Units of time in a second.
    pace: Option<f64>,
    begun: Option<(Instant, f64)>,
}

impl Watching {
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
