//! Results on stdout. A reader that has seen enough (`| head`) ends the output without an error.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use scrnn_run::failure::{Failure, Result};

/// Prints a text as it is.
pub fn print(text: &str) -> Result<()> {
    match io::stdout().lock().write_all(text.as_bytes()).and_then(|()| io::stdout().flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::disk("write", Path::new("to stdout"), error))
        }
        _ => Ok(()),
    }
}

/// Prints a value as one line of JSON.
pub fn print_json_line(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string(value).expect("strings, lists and numbers become JSON");
    print(&(text + "\n"))
}

/// Prints a value as indented JSON, for eyes as well.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).expect("strings, lists and numbers become JSON");
    print(&(text + "\n"))
}
