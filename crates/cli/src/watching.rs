//! The options of a page that shows a robot or a stream while it goes on.

use clap::Args;
use scrnn_pages::live::{Heading, Paced};
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
    pub fn start(&self, heading: &Heading<'_>, seconds: Option<f64>) -> Result<Option<Paced>> {
        let Some(port) = self.watch else { return Ok(None) };
        let speed = Some(self.speed.unwrap_or(1.0)).filter(|speed| *speed > 0.0);
        let pace = seconds.zip(speed).map(|(seconds, speed)| speed / seconds);
        let page = Paced::start(port, &Heading { pace, ..*heading })?;
        output::say(format_args!("watch it at {}", page.url()));
        Ok(Some(page))
    }
}
