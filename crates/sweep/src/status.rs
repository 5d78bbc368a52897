//! How far a sweep is, read from its folder alone.

use std::fmt;
use std::path::Path;

use scrnn_report::Table;
use scrnn_run::failure::Result;
use scrnn_run::run_folder::CHECKPOINT;
use serde::Serialize;

use crate::claim::{self, PATIENCE};
use crate::outcome::{self, FAILED, Failed, OUTCOME, Outcome};
use crate::plan::Listed;

/// Runs that words name one by one.
const SHOWN: usize = 20;

/// Where one run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// Finished, with a network.
    Finished,
    /// A value left the finite numbers.
    Diverged,
    /// Whoever worked on it was killed, again and again.
    Killed,
    /// It could not be finished; the next call tries again.
    Failed,
    /// Somebody works on it.
    Working,
    /// Begun, and nobody works on it.
    Interrupted,
    /// Not begun.
    Waiting,
}

/// A run that is worth naming.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Named {
    /// Its folder in that of the sweep.
    pub run: String,
    /// Where it stands.
    pub state: State,
    /// Why, or by whom.
    pub message: String,
}

/// Where all of it stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Status {
    /// The sweep's name.
    pub name: String,
    /// All settings.
    pub settings: usize,
    /// All runs.
    pub runs: usize,
    /// Runs that are finished.
    pub finished: usize,
    /// Runs that diverged.
    pub diverged: usize,
    /// Runs that are left alone.
    pub killed: usize,
    /// Runs that could not be finished.
    pub failed: usize,
    /// Runs that somebody works on.
    pub working: usize,
    /// Runs that were begun, and that nobody works on.
    pub interrupted: usize,
    /// Runs that are not begun.
    pub waiting: usize,
    /// Those that are worked on, or came to nothing.
    pub named: Vec<Named>,
}

impl Status {
    /// Reads the folder of a sweep.
    ///
    /// # Errors
    /// [`Failure::Input`](scrnn_run::failure::Failure::Input) for a folder without a plan.
    pub fn read(folder: &Path) -> Result<Self> {
        let listed = Listed::read(folder)?;
        let mut status = Self {
            name: listed.name,
            settings: listed.settings.len(),
            runs: listed.runs.len(),
            finished: 0,
            diverged: 0,
            killed: 0,
            failed: 0,
            working: 0,
            interrupted: 0,
            waiting: 0,
            named: Vec::new(),
        };
        for run in &listed.runs {
            let (state, message) = look(&folder.join(&run.folder));
            match state {
                State::Finished => status.finished += 1,
                State::Diverged => status.diverged += 1,
                State::Killed => status.killed += 1,
                State::Failed => status.failed += 1,
                State::Working => status.working += 1,
                State::Interrupted => status.interrupted += 1,
                State::Waiting => status.waiting += 1,
            }
            if let Some(message) = message {
                status.named.push(Named { run: run.folder.clone(), state, message });
            }
        }
        Ok(status)
    }
}

/// Where each run of the sweep in `folder` stands: its folder in that of the sweep, and what there is to say of it.
///
/// # Errors
/// As [`Status::read`].
pub fn each(folder: &Path) -> Result<Vec<Named>> {
    let one = |run: crate::plan::Run| {
        let (state, message) = look(&folder.join(&run.folder));
        Named { run: run.folder, state, message: message.unwrap_or_default() }
    };
    Ok(Listed::read(folder)?.runs.into_iter().map(one).collect())
}

/// Where the run in `folder` stands, and what there is to say of it.
fn look(folder: &Path) -> (State, Option<String>) {
    if let Some(Outcome { outcome: ended, message, .. }) = outcome::read(folder, OUTCOME) {
        return match ended {
            outcome::Ended::Finished | outcome::Ended::OutOfPatience => (State::Finished, None),
            outcome::Ended::Diverged => (State::Diverged, Some(message.unwrap_or_default())),
            outcome::Ended::Killed => (State::Killed, Some(message.unwrap_or_default())),
        };
    }
    if let Some(newest) = claim::newest(folder) {
        let lost = match newest.number {
            1 => String::new(),
            number => format!("; {} before were lost", number - 1),
        };
        if !newest.is_dead() && newest.age <= PATIENCE {
            let by = newest
                .holder
                .map_or_else(|| "somebody".to_owned(), |one| format!("process {} of {}", one.process, one.host));
            return (State::Working, Some(format!("{by}{lost}")));
        }
        return (State::Interrupted, Some(format!("whoever worked on it is gone{lost}")));
    }
    if let Some(Failed { message, .. }) = outcome::read(folder, FAILED) {
        return (State::Failed, Some(message));
    }
    match folder.join(CHECKPOINT).exists() {
        true => (State::Interrupted, None),
        false => (State::Waiting, None),
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {} networks of {} settings", self.name, self.runs, self.settings)?;
        let mut table = Table::new(&[]);
        for (word, count) in [
            ("finished", self.finished),
            ("diverged", self.diverged),
            ("killed", self.killed),
            ("failed", self.failed),
            ("being trained", self.working),
            ("interrupted", self.interrupted),
            ("not begun", self.waiting),
        ] {
            if count > 0 {
                table.row(vec![format!("  {word}"), count.to_string()]);
            }
        }
        write!(f, "{}", table.to_string().trim_start_matches('\n'))?;
        for Named { run, message, .. } in self.named.iter().take(SHOWN) {
            writeln!(f, "  {run}: {message}")?;
        }
        match self.named.len().checked_sub(SHOWN) {
            None | Some(0) => Ok(()),
            Some(more) => writeln!(f, "  and {more} more: --json has all"),
        }
    }
}
