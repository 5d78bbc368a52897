//! The Python that tests run beside the program.
//!
//! It is SCRNN_PYTHON, else the one in .venv, which .ci/run makes. Without one that has the packages of
//! tests/python/requirements.txt the tests say that they were skipped; where CI is set, they fail.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// An interpreter that can import these modules, named with commas between.
pub fn python(modules: &str) -> Option<PathBuf> {
    let venv = if cfg!(windows) { ".venv/Scripts/python.exe" } else { ".venv/bin/python" };
    let python = std::env::var_os("SCRNN_PYTHON").map_or_else(|| root().join(venv), PathBuf::from);
    let found = Command::new(&python).args(["-c", &format!("import {modules}")]).output();
    if found.as_ref().is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    let why =
        found.map_or_else(|error| error.to_string(), |output| String::from_utf8_lossy(&output.stderr).into_owned());
    let why = why.lines().last().unwrap_or_default().to_owned();
    let message = format!("no Python with what tests/python/requirements.txt lists: {}: {why}", python.display());
    assert!(std::env::var_os("CI").is_none(), "{message}");
    // Past the test harness, which shows nothing of a test that passes.
    writeln!(std::io::stderr().lock(), "skipped: {message}; .ci/run makes one").unwrap();
    None
}
