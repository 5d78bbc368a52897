//! The only place that writes to stdout and stderr.
//!
//! Results go to stdout. A reader that has seen enough (`| head`) ends the output without an error; any other failure ends the
//! command with a code of its own, after its files are written. Messages go to stderr, and one that cannot be written is
//! dropped: a log on a full disk or a closed pipe is no reason to end a training, nor is a pipe that nobody reads one to wait.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use miette::{GraphicalReportHandler, GraphicalTheme};
use serde::Serialize;

use scrnn_run::failure::{Failure, Result};

/// Whether somebody still reads what goes to stdout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reader {
    /// As far as can be known.
    Listens,
    /// The pipe is closed at its other end.
    Left,
}

/// Between two tries to write to a pipe that takes nothing, and does not want to be waited for.
const PAUSE: Duration = Duration::from_millis(1);

/// Whether a person reads what goes to stdout, and no file or program.
pub fn is_for_a_person() -> bool {
    io::stdout().is_terminal()
}

/// Writes a text to stdout as it is.
pub fn offer(text: &str) -> Result<Reader> {
    write_to(&mut io::stdout().lock(), &escaped(text))
}

fn write_to(out: &mut impl Write, text: &str) -> Result<Reader> {
    match write_all(out, text.as_bytes()) {
        Ok(()) => Ok(Reader::Listens),
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(Reader::Left),
        Err(source) => Err(Failure::Output { source }),
    }
}

/// Writes and flushes. Who shares a pipe may have told the system not to wait at it (`O_NONBLOCK`): then this waits.
fn write_all(out: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
    loop {
        let outcome = match bytes {
            [] => out.flush().map(|()| None),
            _ => out.write(bytes).map(Some),
        };
        match outcome {
            Ok(None) => return Ok(()),
            Ok(Some(0)) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(Some(written)) => bytes = &bytes[written..],
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => std::thread::sleep(PAUSE),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Prints a text as it is.
pub fn print(text: &str) -> Result<()> {
    offer(text).map(drop)
}

/// Writes a value as one line of JSON.
pub fn offer_json_line(value: &impl Serialize) -> Result<Reader> {
    let text = serde_json::to_string(value).expect("strings, lists and numbers become JSON");
    write_to(&mut io::stdout().lock(), &(escaped_in_json(&text) + "\n"))
}

/// Prints a value as one line of JSON.
pub fn print_json_line(value: &impl Serialize) -> Result<()> {
    offer_json_line(value).map(drop)
}

/// Prints a value as indented JSON, for eyes as well.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).expect("strings, lists and numbers become JSON");
    write_to(&mut io::stdout().lock(), &(escaped_in_json(&text) + "\n")).map(drop)
}

/// Says something on stderr, in one write; where that is not possible, to nobody.
pub fn say(message: impl Display) {
    let line = format!("{message}\n");
    tell(escaped(&line).into_owned());
}

/// When something was said last, or this was asked for first.
static LAST_SAID: LazyLock<Mutex<Instant>> = LazyLock::new(|| Mutex::new(Instant::now()));

/// For how long nothing has been said.
pub fn silence() -> Duration {
    LAST_SAID.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
}

/// Messages that may wait; more are dropped.
const MOST_WAITING: usize = 1000;
/// For so long a message is waited for, so that it stands before what comes after it. Who reads so slowly once is no longer
/// waited for.
const PATIENCE: Duration = Duration::from_millis(200);
/// For so long the end of the program waits for its last messages.
const LAST_PATIENCE: Duration = Duration::from_secs(1);

/// The thread that writes to stderr: a pipe that is full holds it up, and nobody else.
struct Teller {
    messages: SyncSender<String>,
    /// How many were not written yet.
    waiting: Arc<(Mutex<usize>, Condvar)>,
    is_slow: AtomicBool,
}

static TELLER: LazyLock<Option<Teller>> = LazyLock::new(|| {
    let (messages, coming) = sync_channel::<String>(MOST_WAITING);
    let waiting = Arc::new((Mutex::new(0), Condvar::new()));
    let written = Arc::clone(&waiting);
    let write = move || {
        for message in coming {
            let _ = write_all(&mut io::stderr().lock(), message.as_bytes());
            *count(&written.0) -= 1;
            written.1.notify_all();
        }
    };
    std::thread::Builder::new().name("stderr".to_owned()).spawn(write).ok()?;
    Some(Teller { messages, waiting, is_slow: AtomicBool::new(false) })
});

fn count(waiting: &Mutex<usize>) -> MutexGuard<'_, usize> {
    waiting.lock().unwrap_or_else(PoisonError::into_inner)
}

fn tell(message: String) {
    *LAST_SAID.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    let Some(teller) = &*TELLER else {
        let _ = io::stderr().lock().write_all(message.as_bytes());
        return;
    };
    let mut waiting = count(&teller.waiting.0);
    if teller.messages.try_send(message).is_ok() {
        *waiting += 1;
        let is_first = *waiting == 1;
        drop(waiting);
        if is_first || !teller.is_slow.load(Ordering::Relaxed) {
            teller.is_slow.store(!teller.is_done(PATIENCE), Ordering::Relaxed);
        }
    }
}

impl Teller {
    /// Waits until all is written, but no longer than that.
    fn is_done(&self, patience: Duration) -> bool {
        let (waiting, written) = &*self.waiting;
        let outcome = written.wait_timeout_while(count(waiting), patience, |waiting| *waiting > 0);
        outcome.is_ok_and(|(_, time)| !time.timed_out())
    }
}

/// Waits a little for messages that are not yet written, before the program ends.
pub fn finish() {
    if let Some(teller) = &*TELLER {
        teller.is_done(LAST_PATIENCE);
    }
}

/// Shows a failure on stderr with what to do about it; in colours where a terminal has them.
pub fn show(failure: Failure) {
    let mut plain = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    if handler.render_report(&mut plain, &failure).is_ok() && matches!(escaped(&plain), Cow::Owned(_)) {
        // Colours are control characters as well: without them, all others are known to come from names and files.
        say(plain.trim_end_matches('\n'));
        return;
    }
    tell(format!("{:?}\n", miette::Report::new(failure)));
}

/// Whether a character moves more on a terminal than to the next line or column.
fn moves(c: char) -> bool {
    c.is_control() && c != '\n' && c != '\t' || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A text whose characters move nothing on a terminal but to the next line or column: names from files may hold others.
pub fn escaped(text: &str) -> Cow<'_, str> {
    replaced(text, |c| c.escape_unicode().to_string())
}

/// As [`escaped`], for JSON, which stays JSON of the same strings.
fn escaped_in_json(text: &str) -> Cow<'_, str> {
    replaced(text, |c| format!("\\u{:04x}", u32::from(c)))
}

fn replaced(text: &str, by: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(moves) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match moves(c) {
            true => shown.push_str(&by(c)),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
#[path = "../../../tests/cli/output_tests.rs"]
mod tests;
