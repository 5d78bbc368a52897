//! The only place that writes to stdout and stderr.
//!
//! Results go to stdout. A reader that has seen enough (`| head`) ends the output without an error; any other failure ends the
//! command with a code of its own, after its files are written. Messages go to stderr, and one that cannot be written is
//! dropped: a log on a full disk or a closed pipe is no reason to end a training.

use std::fmt::Display;
use std::io::{self, Write};

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
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
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
    let _ = io::stderr().lock().write_all(line.as_bytes());
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
    fn a_reader_that_left_is_no_failure_and_a_full_disk_is_one_with_its_own_code() {
        assert_eq!(write_to(&mut Vec::new(), "x").unwrap(), Reader::Listens);
        assert_eq!(write_to(&mut Broken(io::ErrorKind::BrokenPipe), "x").unwrap(), Reader::Left);
        assert_eq!(write_to(&mut Broken(io::ErrorKind::StorageFull), "x").unwrap_err().code(), 6);
    }
}
