//! The only place that writes to stdout and stderr.
//!
//! Results go to stdout. A reader that has seen enough (`| head`) ends the output without an error; any other failure ends the
//! command with a code of its own, after its files are written. Messages go to stderr, and one that cannot be written is
//! dropped: a log on a full disk or a closed pipe is no reason to end a training.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, Write};

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

/// Writes a text to stdout as it is.
pub fn offer(text: &str) -> Result<Reader> {
    write_to(&mut io::stdout().lock(), text)
}

fn write_to(out: &mut impl Write, text: &str) -> Result<Reader> {
    match out.write_all(escaped(text).as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(Reader::Listens),
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(Reader::Left),
        Err(source) => Err(Failure::Output { source }),
    }
}

/// Prints a text as it is.
pub fn print(text: &str) -> Result<()> {
    offer(text).map(drop)
}

/// Writes a value as one line of JSON.
pub fn offer_json_line(value: &impl Serialize) -> Result<Reader> {
    let text = serde_json::to_string(value).expect("strings, lists and numbers become JSON");
    offer(&(text + "\n"))
}

/// Prints a value as one line of JSON.
pub fn print_json_line(value: &impl Serialize) -> Result<()> {
    offer_json_line(value).map(drop)
}

/// Prints a value as indented JSON, for eyes as well.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).expect("strings, lists and numbers become JSON");
    print(&(text + "\n"))
}

/// Says something on stderr, in one write; where that is not possible, to nobody.
pub fn say(message: impl Display) {
    let line = format!("{message}\n");
    let _ = io::stderr().lock().write_all(escaped(&line).as_bytes());
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
    let line = format!("{:?}\n", miette::Report::new(failure));
    let _ = io::stderr().lock().write_all(line.as_bytes());
}

/// A text whose characters move nothing on a terminal but to the next line or column: names from files may hold others.
pub fn escaped(text: &str) -> Cow<'_, str> {
    let moves = |c: char| {
        c.is_control() && c != '\n' && c != '\t' || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(moves) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match moves(c) {
            true => shown.extend(c.escape_unicode()),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Broken(io::ErrorKind);

    impl Write for Broken {
        fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn names_move_nothing_on_a_terminal() {
        assert_eq!(
            escaped("a\u{1b}]0;pwn\u{7}\u{9b}31m\u{202e}b\n\tc"),
            "a\\u{1b}]0;pwn\\u{7}\\u{9b}31m\\u{202e}b\n\tc"
        );
        assert!(matches!(escaped("a name, \u{e4} \u{2192}\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_reader_that_left_is_no_failure_and_a_full_disk_is_one_with_its_own_code() {
        assert_eq!(write_to(&mut Vec::new(), "x").unwrap(), Reader::Listens);
        assert_eq!(write_to(&mut Broken(io::ErrorKind::BrokenPipe), "x").unwrap(), Reader::Left);
        assert_eq!(write_to(&mut Broken(io::ErrorKind::StorageFull), "x").unwrap_err().code(), 6);
    }
}
