//! What goes wrong, as exceptions: subclasses of ValueError with the message of the program.

use std::any::Any;
use std::error::Error as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

use miette::{Diagnostic, SourceCode, SourceSpan};
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scrnn_run::failure::{Failure, Result};

create_exception!(
    scrnn,
    Error,
    PyValueError,
    "What is wrong with data, settings or a request. Every error of scrnn is one."
);
create_exception!(scrnn, FileError, Error, "A file could not be read or written.");
create_exception!(
    scrnn,
    RefusedError,
    Error,
    "The request is clear but would do harm, e.g. write over a run that is there already."
);
create_exception!(
    scrnn,
    DivergedError,
    Error,
    "A training left the finite numbers. The estimator keeps the last good state."
);
create_exception!(scrnn, InternalError, Error, "A mistake in scrnn itself: please report it with what led to it.");

/// What settings from Python are called.
pub const SETTINGS: &str = "the settings";

/// Options of the program that say yes; the others have a value.
const FLAGS: [&str; 8] = ["resume", "overwrite", "best", "mean", "calibrate", "no-noise", "json", "ers"];

/// The message of the program, with the place that it points at and what to do.
pub fn message(failure: &Failure) -> String {
    let mut text = failure.to_string();
    let mut cause = failure.source();
    while let Some(source) = cause {
        text += &format!(": {source}");
        cause = source.source();
    }
    if let Some(line) = place(failure) {
        text += &format!(" ({line})");
    }
    if let Some(help) = failure.help() {
        text += &format!("\n{help}");
    }
    in_python(&text)
}

/// The file and line that a failure points at; settings that come from Python are in none.
fn place(failure: &Failure) -> Option<String> {
    let span: SourceSpan = *failure.labels()?.next()?.inner();
    let source: &dyn SourceCode = failure.source_code()?;
    let contents = source.read_span(&span, 0, 0).ok()?;
    let name = contents.name().filter(|name| *name != SETTINGS && *name != "the command line")?;
    Some(format!("{name}, line {}", contents.line() + 1))
}

/// Options as they are written in Python: `--steps 5` is `steps=5`, and `--resume` is `resume=True`.
pub fn in_python(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("--") {
        out += before;
        let end = after.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(after.len());
        let (name, behind) = after.split_at(end);
        let begins = before.chars().next_back().is_none_or(|c| c.is_whitespace() || "(`'\"".contains(c));
        if name.is_empty() || !begins {
            out += "--";
            out += name;
            rest = behind;
            continue;
        }
        out += &match name {
            "no-noise" => "noise=False".to_owned(),
            "out" | "set" => format!("{}=...", if name == "set" { "settings" } else { name }),
            flag if FLAGS.contains(&flag) => format!("{flag}=True"),
            option => format!("{}=", option.replace('-', "_")),
        };
        let has_value = out.ends_with('=') && behind.starts_with(' ');
        let value = behind.trim_start_matches(' ');
        // A number behind it is its value; anything else goes on with the sentence.
        rest = match has_value && value.starts_with(|c: char| c.is_ascii_digit()) {
            true => value,
            false if out.ends_with("=...") => {
                ["RUN", "FILE", "KEY=VALUE"].iter().find_map(|word| value.strip_prefix(word)).unwrap_or(behind)
            }
            false => behind,
        };
    }
    out + rest
}

/// As an exception.
pub fn raise(failure: Failure) -> PyErr {
    let text = message(&failure);
    match failure.code() {
        4 | 6 => FileError::new_err(text),
        5 => RefusedError::new_err(text),
        _ => Error::new_err(text),
    }
}

/// A panic as an exception.
pub fn raise_panic(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    InternalError::new_err(format!("scrnn made a mistake: {}", text.unwrap_or("a panic without words")))
}

/// Computes without the interpreter's lock. Whatever goes wrong becomes an exception.
pub fn compute<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(result) => result.map_err(raise),
        Err(panic) => Err(raise_panic(panic.as_ref())),
    }
}

/// Breaks down, for the tests: a panic must come out as an exception.
#[pyfunction]
pub fn break_down(py: Python<'_>, attended: bool) -> PyResult<()> {
    let work = || -> Result<()> { panic!("broken down on purpose") };
    match attended {
        true => crate::machine::watched(py, &crate::machine::News::default(), work),
        false => compute(py, work),
    }
}
