//! What an evaluation is given: where to compute, whether to go on, where news goes, and what was finished before.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use scrnn::engine::Engine;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::Messages;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::kept::Kept;
use super::stop::{Result, Stop};

/// Silence lasts no longer than this, where an evaluation says what it is at.
const BETWEEN_NEWS: Duration = Duration::from_secs(2);

/// What an evaluation is given. It can be shared by threads.
pub struct Desk<'a> {
    engine: &'a Engine,
    interrupt: &'a Interrupt,
    messages: &'a dyn Messages,
    /// Goes before what is said.
    label: String,
    kept: Option<Kept>,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    said: Instant,
    /// Seconds of parts that were finished before.
    saved: f64,
}

impl<'a> Desk<'a> {
    /// With parts to be kept, if there is a place for them.
    pub fn new(
        engine: &'a Engine,
        (interrupt, messages): (&'a Interrupt, &'a dyn Messages),
        label: &str,
        kept: Option<Kept>,
    ) -> Self {
        let state = Mutex::new(State { said: Instant::now(), saved: 0.0 });
        Self { engine, interrupt, messages, label: label.to_owned(), kept, state }
    }

    /// Where to compute.
    pub fn engine(&self) -> &'a Engine {
        self.engine
    }

    /// Whether somebody asked to stop.
    pub fn interrupted(&self) -> bool {
        self.interrupt.asked()
    }

    /// Ends the evaluation if somebody asked for it.
    pub fn go_on(&self) -> Result<()> {
        if self.interrupted() { Err(Stop::Interrupted) } else { Ok(()) }
    }

    /// Says at once what begins.
    pub fn say(&self, what: &str) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).said = Instant::now();
        self.messages.say(&format!("{}: {what}", self.label));
    }

    /// As [`Desk::go_on`], and says what the evaluation is at, if nothing was said for a while.
    pub fn at(&self, what: impl FnOnce() -> String) -> Result<()> {
        self.go_on()?;
        let silent = self.state.lock().unwrap_or_else(PoisonError::into_inner).said.elapsed();
        if silent >= BETWEEN_NEWS {
            self.say(&what());
        }
        Ok(())
    }

    /// Does a part of the evaluation, unless it was done before; the name is shown, and must be the part's own.
    pub fn part<T: Serialize + DeserializeOwned>(&self, name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        self.at(|| name.to_owned())?;
        if let Some((value, seconds)) = self.kept.as_ref().and_then(|kept| kept.get(name)) {
            self.state.lock().unwrap_or_else(PoisonError::into_inner).saved += seconds;
            return Ok(value);
        }
        let begun = Instant::now();
        let value = work()?;
        if let Some(kept) = &self.kept {
            kept.put(name, &value, begun.elapsed().as_secs_f64())?;
        }
        Ok(value)
    }

    /// Seconds of parts that were finished before.
    pub fn saved(&self) -> f64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).saved
    }

    /// As if nothing had been said for so long.
    #[cfg(test)]
    pub fn be_silent_for(&self, time: Duration) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.said = state.said.checked_sub(time).unwrap_or(state.said);
    }
}
