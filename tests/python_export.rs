//! Exported networks in onnxruntime: every kind of network step by step beside the library, in float64 and float32, and what the
//! program exports of runs that it trained.
//!
//! The interpreter is that of tests/python/interpreter.rs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use scrnn_run::export::{OneStep, Precision};
use serde_json::{Value, json};

#[path = "python/interpreter.rs"]
mod interpreter;
#[path = "../crates/run/tests/variants/mod.rs"]
mod variants;

use interpreter::root;
use variants::{BLIND, STEPS, greatest_difference};

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    interpreter::python("numpy, onnx, onnxruntime")
}

/// Writes samples where the script looks for them.
fn write_samples(folder: &Path, samples: &[f64], n: usize) {
    let value = |x: &f64| if x.is_finite() || x.is_nan() { json!(x) } else { json!(x.to_string()) };
    let rows: Vec<Vec<Value>> = samples.chunks_exact(n).map(|row| row.iter().map(value).collect()).collect();
    std::fs::write(folder.join("samples.json"), json!(rows).to_string()).unwrap();
}

/// Runs all models in these folders.
fn run_models(python: &Path, folders: &[PathBuf]) {
    let output = Command::new(python).arg(root().join("tests/python/read_export.py")).args(folders).output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    // The runtime warns on stderr.
    assert!(output.status.success() && err.is_empty(), "{out}{err}");
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|list| list.iter().map(|x| x.as_f64().unwrap()).collect()).unwrap_or_default()
}

/// The greatest differences while samples come, and with 15 steps where none come. There a network runs on its own predictions, and some
/// of these, which extrapolate several steps ahead and were never trained, double any error at each step.
const FLOAT64: [f64; 2] = [1e-12, 1e-9];
const FLOAT32: [f64; 2] = [1e-4, 1e-1];

#[test]
fn onnxruntime_computes_what_the_library_computes_for_every_kind_of_network() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let variants = variants::all(place.path());
    for variant in &variants {
        let step = OneStep::of(&variant.all, variant.sequence).unwrap();
        for (name, precision) in [("float64.onnx", Precision::Float64), ("float32.onnx", Precision::Float32)] {
            std::fs::write(variant.run.join(name), step.onnx(precision).unwrap()).unwrap();
        }
        write_samples(&variant.run, &variant.samples, variant.ranges.len());
    }
    run_models(&python, &variants.iter().map(|variant| variant.run.clone()).collect::<Vec<_>>());
    let mut wrong = Vec::new();
    for variant in &variants {
        for (name, [seeing, blind]) in [("float64", FLOAT64), ("float32", FLOAT32)] {
            let found = read(&variant.run.join(format!("{name}.json")));
            let (mean, variance) = (numbers(&found["mean"]), numbers(&found["variance"]));
            for (steps, most) in [(BLIND.start, seeing), (STEPS, blind)] {
                let (of_means, of_variances) = greatest_difference(variant, &mean, &variance, steps);
                println!("{} {name}, {steps} steps: means {of_means:.1e}, variances {of_variances:.1e}", variant.name);
                if !(of_means <= most && of_variances <= most) {
                    wrong.push(format!("{} {name}, {steps} steps: {of_means:e}, {of_variances:e}", variant.name));
                }
            }
            let (note, checkpoint) = (&found["note"], &variant.all[0].checkpoint);
            assert_eq!(note["channels"], json!(checkpoint.channels));
            assert_eq!(note["delay"], checkpoint.topology.delay());
            assert_eq!((&note["members"], &note["precision"]), (&json!(variant.all.len()), &json!(name)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A folder to work in.
struct Place(tempfile::TempDir);

impl Place {
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, line: &str) -> Output {
        let mut program = Command::new(env!("CARGO_BIN_EXE_scrnn"));
        program.current_dir(&self.0).args(line.split_whitespace()).output().unwrap()
    }

    fn ok(&self, line: &str) -> String {
        let output = self.run(line);
        assert!(output.status.success(), "scrnn {line}\n{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

/// Two channels around 1200 and 0.003, some values missing.
fn table(samples: usize, phase: f64) -> (String, Vec<f64>) {
    let (mut text, mut values) = (String::from("near,far\n"), Vec::new());
    for k in 0..samples {
        let angle = k as f64 / 4.0 + phase;
        let near = 1200.0 + 100.0 * angle.sin() + (1.7 * k as f64).sin();
        let far = if k % 11 == 5 { f64::NAN } else { 0.003 + 0.001 * angle.cos() + 1e-5 * (2.9 * k as f64).sin() };
        let cell = if far.is_nan() { String::new() } else { far.to_string() };
        text += &format!("{near},{cell}\n");
        values.extend([near, far]);
    }
    (text, values)
}

const EXPERIMENT: &str = r#"
name = "arm"
[data]
files = ["one.csv", "two.csv"]
scaling = "robust"
[network]
delay = 2
skip = "residual"
velocity_inputs = true
[[network.groups]]
name = "fast"
units = 9
time_constant = 2.0
learns_initial_state = false
[[network.groups]]
name = "slow"
units = 4
time_constant = 20.0
receives_input = false
drives_output = false
[training]
epochs = 300
optimiser = "adam"
"#;

#[test]
fn what_the_program_exports_predicts_what_the_program_generates() {
    let Some(python) = python() else { return };
    let place = Place(tempfile::tempdir().unwrap());
    for (name, phase) in [("one.csv", 0.0), ("two.csv", 2.0), ("three.csv", 4.0)] {
        std::fs::write(place.path(name), table(250, phase).0).unwrap();
    }
    let (new, samples) = table(400, 1.0);
    std::fs::write(place.path("new.csv"), new).unwrap();
    std::fs::write(place.path("arm.toml"), EXPERIMENT).unwrap();
    place.ok("train arm.toml --out single");
    place.ok("evaluate single three.csv --calibrate");
    place.ok("train arm.toml --out mixture --set training.members=2");

    for (run, start, options) in
        [("single", "--sequence 2", "--sequence 2"), ("mixture", "--mean", "--best"), ("single", "--mean", "")]
    {
        let folder = place.path(&format!("{run}-out"));
        std::fs::create_dir_all(&folder).unwrap();
        let printed = place.ok(&format!("export {run} --onnx {run}-out/model.onnx --c {run}-out/network.h {options}"));
        assert_eq!(printed, format!("{run}-out/network.h\n{run}-out/model.onnx\n"));
        write_samples(&folder, &samples, 2);
        run_models(&python, std::slice::from_ref(&folder));
        let best = if options == "--best" { "--best" } else { "" };
        let generated: Value = serde_json::from_str(
            &place.ok(&format!("generate {run} --mode open --data new.csv {start} {best} --json")),
        )
        .unwrap();
        let found = read(&folder.join("model.json"));
        assert_eq!((&found["note"]["channels"], &found["note"]["delay"]), (&json!(["near", "far"]), &json!(2)));
        // Of a mixture, `generate` tells the spread of its loops as it is estimated from them: divided by K - 1.
        let fields: &[&str] = if run == "mixture" { &["mean"] } else { &["mean", "variance"] };
        for field in fields {
            let rows = generated["sequences"][0][field].as_array().unwrap();
            let theirs: Vec<f64> = rows.iter().flat_map(numbers).collect();
            let ours = &numbers(&found[field])[..theirs.len()];
            assert_eq!(theirs.len(), 2 * 398);
            for (k, (a, b)) in ours.iter().zip(&theirs).enumerate() {
                assert!((a - b).abs() <= 1e-11 * b.abs(), "{run} {field} {k}: {a} instead of {b}");
            }
        }
    }
}

#[test]
fn the_loop_in_the_document_runs() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let variant = variants::all(place.path()).into_iter().find(|one| one.name == "s_ctrnn").unwrap();
    let step = OneStep::of(&variant.all, variant.sequence).unwrap();
    std::fs::write(variant.run.join("network.onnx"), step.onnx(Precision::Float64).unwrap()).unwrap();
    let document = std::fs::read_to_string(root().join("docs/robots.md")).unwrap();
    let shown = document.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let robot = "count, sent = 0, []\n\ndef read_sensors():\n    global count\n    count += 1\n    \
                 return [1200.0 + count - 1, float('nan')] if count <= 5 else None\n\n\
                 def send_command(mean, deviation):\n    sent.append([mean.tolist(), deviation.tolist()])\n\n";
    std::fs::write(variant.run.join("loop.py"), format!("{robot}{shown}\nprint(json.dumps(sent))\n")).unwrap();
    let output = Command::new(python).current_dir(&variant.run).arg("loop.py").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let sent: Vec<[Vec<f64>; 2]> = serde_json::from_slice(&output.stdout).unwrap();
    let samples: Vec<f64> = (0..5).flat_map(|k| [1200.0 + f64::from(k), f64::NAN]).collect();
    let (mean, variance) = variants::predicted(&variant.all, variant.sequence, &samples);
    assert_eq!(sent.len(), 5);
    for (k, [y, deviation]) in sent.iter().enumerate() {
        for i in 0..2 {
            assert!((y[i] - mean[2 * k + i]).abs() < 1e-9 * mean[2 * k + i].abs(), "step {k}, channel {i}");
            assert!((deviation[i].powi(2) / variance[2 * k + i] - 1.0).abs() < 1e-9, "step {k}, channel {i}");
        }
    }
}
