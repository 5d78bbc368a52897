//! The program from outside: each command on small data, its errors, its exit codes, and runs that are killed.

#[path = "cli/channels.rs"]
mod channels;
#[path = "cli/crafted.rs"]
mod crafted;
#[path = "cli/evaluating.rs"]
mod evaluating;
#[path = "cli/experiments.rs"]
mod experiments;
#[path = "cli/exporting.rs"]
mod exporting;
#[path = "cli/extremes.rs"]
mod extremes;
#[path = "cli/following.rs"]
mod following;
#[path = "cli/held_out.rs"]
mod held_out;
#[path = "cli/numbers.rs"]
mod numbers;
#[path = "cli/numbers_table.rs"]
mod numbers_table;
#[path = "cli/own_data.rs"]
mod own_data;
#[path = "cli/progress.rs"]
mod progress;
#[path = "cli/reaching.rs"]
mod reaching;
#[path = "cli/recordings.rs"]
mod recordings;
#[path = "cli/refusals.rs"]
mod refusals;
#[path = "cli/reproducing.rs"]
mod reproducing;
#[path = "cli/resuming.rs"]
mod resuming;
#[path = "cli/strangers.rs"]
mod strangers;
#[path = "cli/using.rs"]
mod using;

use std::path::PathBuf;
use std::process::{Output, Stdio};
use std::time::Duration;

use assert_cmd::Command;
use serde_json::Value;

/// A small sine wave, learned by momentum ascent.
const SINE: &str = r#"
name = "sine"
[data]
task = "sinusoid"
steps = 80
[[network.groups]]
name = "context"
units = 6
time_constant = 2.0
[training]
epochs = 120
optimiser = "momentum"
[training.momentum]
rate = 1e-3
[output]
checkpoint_every = 10
"#;

/// The same with Adam, which has a schedule.
fn sine_with_adam() -> String {
    SINE.replace("optimiser = \"momentum\"", "optimiser = \"adam\"").replace("[training.momentum]", "[training.adam]")
}

/// The same with three sequences, one in each update.
fn sine_in_batches() -> String {
    sine_with_adam()
        .replace("steps = 80", "steps = 60\nsequences = 3")
        .replace("[training.adam]", "[training.adam]\nbatch_size = 1")
}

/// The same, two thirds of it by L-BFGS.
fn sine_with_lbfgs() -> String {
    sine_in_batches() + "[training.lbfgs]\nshare = 0.667\nmemory = 4\n"
}

/// A folder to work in; all paths of a command line are relative to it.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A folder with one experiment file, `sine.toml`.
    fn with(experiment: &str) -> Self {
        let place = Self::new();
        place.write("sine.toml", experiment);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> Vec<u8> {
        let path = self.path(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    fn run(&self, line: &str) -> Output {
        let mut command = Command::cargo_bin("scrnn").unwrap();
        command.current_dir(&self.0).args(line.split_whitespace()).output().unwrap()
    }

    /// Runs a command that should succeed; its stdout.
    fn ok(&self, line: &str) -> String {
        let output = self.run(line);
        let err = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "scrnn {line}\n{err}");
        String::from_utf8(output.stdout).unwrap()
    }

    fn json(&self, line: &str) -> Value {
        serde_json::from_str(&self.ok(line)).unwrap()
    }

    /// Runs a command that should succeed; its stdout and stderr.
    fn says(&self, line: &str) -> (String, String) {
        let output = self.run(line);
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "scrnn {line}\n{err}");
        (String::from_utf8(output.stdout).unwrap(), err)
    }

    /// Runs a command and kills it after so many milliseconds; whether it had ended before.
    fn stopped_after(&self, milliseconds: u64, line: &str) -> bool {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_scrnn"));
        command.current_dir(&self.0).args(line.split_whitespace());
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        let ended = child.try_wait().unwrap().is_some();
        let _ = child.kill();
        child.wait().unwrap();
        ended
    }

    /// Runs a command that should end with `code`; its stderr as printed, and with line breaks taken out.
    fn fails(&self, code: i32, line: &str) -> (String, String) {
        let output = self.run(line);
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "scrnn {line}\n{err}");
        let flat = err.replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        (err, flat)
    }
}

/// The epochs of a history file.
fn epochs(history: &str) -> Vec<u64> {
    history.lines().skip(1).map(|row| row.split(',').next().unwrap().parse().unwrap()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(entries) => entries.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}
