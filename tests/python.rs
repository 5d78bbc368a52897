//! Python beside the program: numpy and pandas write what it reads and read what it writes, and numpy computes from a
//! checkpoint what it generates.
//!
//! The interpreter is SCRNN_PYTHON, else the one in .venv, which .ci/run makes. It needs what
//! tests/python/requirements.txt lists. Without one these tests say that they were skipped; where CI is set, they fail.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    let venv = if cfg!(windows) { ".venv/Scripts/python.exe" } else { ".venv/bin/python" };
    let python = std::env::var_os("SCRNN_PYTHON").map_or_else(|| root().join(venv), PathBuf::from);
    let import = Command::new(&python).args(["-c", "import numpy, pandas, safetensors"]).output();
    match import {
        Ok(output) if output.status.success() => Some(python),
        found => {
            let why = found.map_or_else(|error| error.to_string(), |output| text(&output.stderr));
            let why = why.lines().last().unwrap_or_default().to_owned();
            let message = format!("no Python with numpy, pandas and safetensors: {}: {why}", python.display());
            assert!(std::env::var_os("CI").is_none(), "{message}");
            // Past the test harness, which shows nothing of a test that passes.
            let mut terminal = std::io::stderr().lock();
            writeln!(terminal, "skipped: {message}; .ci/run makes one").unwrap();
            None
        }
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A folder to work in, and the interpreter.
struct Place {
    folder: tempfile::TempDir,
    python: PathBuf,
}

impl Place {
    fn new() -> Option<Self> {
        Some(Self { folder: tempfile::tempdir().unwrap(), python: python()? })
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).unwrap();
    }

    fn run(&self, program: &Path, line: &str) -> Output {
        Command::new(program).current_dir(&self.folder).args(line.split_whitespace()).output().unwrap()
    }

    /// Runs the program, which must succeed; its stdout.
    fn scrnn(&self, line: &str) -> String {
        let output = self.run(Path::new(env!("CARGO_BIN_EXE_scrnn")), line);
        assert!(output.status.success(), "scrnn {line}\n{}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Runs one of the scripts in tests/python.
    fn script(&self, name: &str, line: &str) -> Output {
        let script = root().join("tests/python").join(name);
        let arguments = line.split_whitespace();
        Command::new(&self.python).current_dir(&self.folder).arg(script).args(arguments).output().unwrap()
    }

    /// Runs a script that should find all as it should be; what it says.
    fn agrees(&self, name: &str, line: &str) -> String {
        let output = self.script(name, line);
        assert!(output.status.success(), "{name} {line}\n{}{}", text(&output.stdout), text(&output.stderr));
        text(&output.stdout)
    }

    /// The nll of a run, with all its digits.
    fn nll(&self, run: &str) -> f64 {
        let seen: serde_json::Value = serde_json::from_str(&self.scrnn(&format!("inspect {run} --json"))).unwrap();
        seen["score"]["nll"].as_f64().unwrap()
    }
}

/// An experiment with a fast and a slow group, on files of its own.
fn experiment(file: &str) -> String {
    format!(
        r#"
name = "groups"
[data]
files = ["{file}"]
scaling = "fit"
[network]
delay = 2
initial_state_variance = 10.0
[[network.groups]]
name = "fast"
units = 7
time_constant = 2.0
learns_initial_state = false
[[network.groups]]
name = "slow"
units = 3
time_constant = 20.0
receives_input = false
drives_output = false
[training]
epochs = 60
optimiser = "adam"
[training.adam]
rate = 0.02
"#
    )
}

#[test]
fn numpy_computes_from_a_checkpoint_what_the_open_loop_generates() {
    let Some(place) = Place::new() else { return };
    place.scrnn("data lissajous --sequences 3 --steps 80 --out curves.npz");
    place.agrees("write_data.py", ".");
    for (data, sequences) in [("curves.npz", 3), ("ragged.npz", 2)] {
        place.write("groups.toml", &experiment(data));
        for (run, change) in [
            ("floorless", ""),
            ("floor", "--set network.variance_floor=0.01"),
            ("mean", "--set network.variance=false"),
            ("plain", "--set network.delay=1 --set data.scaling=none --epochs 0"),
        ] {
            place.scrnn(&format!("train groups.toml --overwrite --out {run} {change}"));
            place.scrnn(&format!("generate {run} --mode open --out {run}.npz"));
            let line = format!("{run}/checkpoint.safetensors {data} {run}.npz");
            let said = place.agrees("read_checkpoint.py", &line);
            assert!(said.starts_with(&format!("{sequences} sequences agree")), "{said}");
        }
        // The comparison is worth something: it tells two networks apart, and names the place.
        let output = place.script("read_checkpoint.py", &format!("floor/checkpoint.safetensors {data} floorless.npz"));
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("allowed: 1e-12") && said.contains("row "), "{said}");
    }
}

#[test]
fn files_of_numpy_and_pandas_train_alike_in_every_form() {
    let Some(place) = Place::new() else { return };
    place.agrees("write_data.py", ".");
    let files = [
        "plain.npz",
        "named.npz",
        "one.npz",
        "compressed.npz",
        "float32.npz",
        "array.npy",
        "float32.npy",
        "fortran.npy",
        "big_endian.npy",
        "lines.txt",
        "index.csv",
        "no_index.csv",
        "tabs.tsv",
        "semicolons.csv",
        "time.csv",
    ];
    let train = |file: &str| {
        place.write("one.toml", &experiment(file));
        place.scrnn(&format!("train one.toml --epochs 2 --overwrite --out run-{file}"));
        place.nll(&format!("run-{file}"))
    };
    let first = train(files[0]);
    for file in &files[1..] {
        assert_eq!(train(file).to_bits(), first.to_bits(), "{file}");
    }
    assert_ne!(train("ragged.npz").to_bits(), first.to_bits());
}

#[test]
fn numpy_and_pandas_read_the_same_bits_from_every_file() {
    let Some(place) = Place::new() else { return };
    for kind in ["npz", "npy", "csv", "txt"] {
        place.scrnn(&format!("data lissajous --sequences 3 --steps 50 --out data.{kind}"));
    }
    place.agrees("compare_files.py", "same .");

    place.agrees("write_data.py", ".");
    place.write("one.toml", &experiment("ragged.npz"));
    place.scrnn("train one.toml --epochs 20 --out run");
    for kind in ["npz", "csv", "txt"] {
        place.scrnn(&format!("generate run --out generated.{kind}"));
    }
    place.agrees("compare_files.py", "generated .");

    for kind in ["npz", "csv"] {
        place.scrnn(&format!("recognize run array.npy --epochs 3 --starts 2 --observed 25 --completed whole.{kind}"));
    }
    place.agrees("compare_files.py", "observed . 25");
    let output = place.script("compare_files.py", "observed . 26");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
}
