//! Pages with a script in them, used in a real browser: the network in a page computes what the library computes, and a recording is
//! played to its end.
//!
//! It needs what tests/browser.rs needs, and the packages of tests/python/requirements.txt. Without them the tests say that they were
//! skipped.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Command, Output};

use scrnn_run::export::OneStep;
use serde_json::{Value, json};

#[path = "python/interpreter.rs"]
mod interpreter;
#[path = "../crates/run/tests/variants/mod.rs"]
mod variants;

use interpreter::root;
use variants::{BLIND, STEPS, greatest_difference};

/// The script's exit code where there is no browser.
const NO_BROWSER: i32 = 3;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn scrnn(folder: &Path, line: &str) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_scrnn")).current_dir(folder).args(line.split_whitespace()).output().unwrap();
    assert!(output.status.success(), "scrnn {line}\n{}", text(&output.stderr));
    text(&output.stdout)
}

/// What the script says; none if there is no interpreter or no browser.
fn used(folder: &Path, arguments: &[&str]) -> Option<Value> {
    let python = interpreter::python("playwright.sync_api, mcap, mcap_protobuf")?;
    let script = root().join("tests/python/use_page.py");
    let output: Output = Command::new(python).current_dir(folder).arg(script).args(arguments).output().unwrap();
    if output.status.code() == Some(NO_BROWSER) {
        return None;
    }
    assert!(output.status.success(), "{arguments:?}\n{}{}", text(&output.stdout), text(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
}

#[test]
fn the_step_in_script_computes_what_the_library_computes_for_every_kind_of_network() {
    let place = tempfile::tempdir().unwrap();
    let variants = variants::all(place.path());
    std::fs::write(place.path().join("step.js"), scrnn_pages::STEP).unwrap();
    let mut arguments = vec!["step".to_owned(), "step.js".to_owned()];
    for variant in &variants {
        let step = OneStep::of(&variant.all, variant.sequence).unwrap();
        std::fs::write(variant.run.join("network.json"), step.json().to_string()).unwrap();
        let value = |x: &f64| if x.is_finite() { json!(x) } else { json!(x.to_string()) };
        let rows = variant.samples.chunks_exact(variant.ranges.len());
        let rows: Vec<Vec<Value>> = rows.map(|row| row.iter().map(value).collect()).collect();
        std::fs::write(variant.run.join("samples.json"), json!(rows).to_string()).unwrap();
        arguments.push(variant.run.display().to_string());
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    if used(place.path(), &arguments).is_none() {
        return;
    }
    for variant in &variants {
        let found: Value = serde_json::from_slice(&std::fs::read(variant.run.join("browser.json")).unwrap()).unwrap();
        let (mean, variance) = (numbers(&found["mean"]), numbers(&found["variance"]));
        // While samples come; and with 15 steps where none come, in which some of these networks double any error at each step.
        for (steps, most) in [(BLIND.start, 1e-9), (STEPS, 1e-6)] {
            let (of_means, of_variances) = greatest_difference(variant, &mean, &variance, steps);
            assert!(
                of_means <= most && of_variances <= most,
                "{}, {steps} steps: {of_means:e}, {of_variances:e}",
                variant.name
            );
        }
    }
}

#[test]
fn the_network_in_a_page_is_dragged_and_runs_as_the_program_lets_it_run() {
    let folder = tempfile::tempdir().unwrap();
    scrnn(folder.path(), "reproduce limit-cycle --epochs 20 --out cycle");
    scrnn(folder.path(), "report cycle/seed-1");
    let Some(found) = used(folder.path(), &["drag", "cycle/seed-1/report.html"]) else { return };
    assert_ne!(found["start"], found["dragged"]);
    assert_ne!(found["dragged"], found["keyed"]);
    assert_eq!(found["changed"], json!([true, true, true]), "a drag, noise and a push change what is drawn");
    let generated = scrnn(folder.path(), "generate cycle/seed-1 --no-noise --json");
    let generated: Value = serde_json::from_str(&generated).unwrap();
    let sequences = generated["sequences"].as_array().unwrap();
    let runs = found["runs"].as_array().unwrap();
    assert!(runs.len() == sequences.len() && runs.len() >= 3);
    for (run, sequence) in runs.iter().zip(sequences) {
        for part in ["mean", "variance"] {
            let (own, library) = (run[part].as_array().unwrap(), sequence[part].as_array().unwrap());
            assert!(own.len() >= 50);
            for (step, (a, b)) in own.iter().zip(library).enumerate() {
                for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
                    assert!((a - b).abs() <= 1e-6, "{part} at step {step}: {a} in the page, {b} in the library");
                }
            }
        }
    }
}

#[test]
fn a_recording_is_played_to_its_end_and_its_hand_is_where_the_recording_has_it() {
    let folder = tempfile::tempdir().unwrap();
    scrnn(folder.path(), "data reach --sequences 1 --out demo.mcap");
    scrnn(folder.path(), "view demo.mcap");
    let page = folder.path().join("demo.html");
    assert!(std::fs::metadata(&page).unwrap().len() < 5_000_000);
    let Some(found) = used(folder.path(), &["view", "demo.html", "demo.mcap", "self/r_hand"]) else { return };
    assert_eq!(found["time"], found["length"]);
    assert!(found["length"].as_f64().unwrap() > 5.0 && found["pictures"].as_f64().unwrap() > 10.0, "{found}");
    let (projected, drawn) = (numbers(&found["projected"]), numbers(&found["drawn"]["at"]));
    assert!(found["drawn"]["pixels"].as_f64().unwrap() > 20.0, "{found}");
    let off = (projected[0] - drawn[0]).hypot(projected[1] - drawn[1]);
    assert!(off <= 1.0, "{off} pixels: {found}");
    let size = numbers(&found["canvas"]);
    assert!((0.0..size[0]).contains(&drawn[0]) && (0.0..size[1]).contains(&drawn[1]), "{found}");
    assert_eq!((&found["turned"], &found["curves"]), (&json!(true), &json!(6)), "{found}");
}

/// A training that is ended when the test is over, however it ends.
struct Training(std::process::Child);

impl Drop for Training {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_training_is_watched_live_and_learns_what_it_would_learn_unwatched() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = root().join("assets/experiments/lissajous_fast.toml").display().to_string();
    let line = format!("train {experiment} --epochs 200 --out");
    scrnn(folder.path(), &format!("{line} plain"));
    scrnn(folder.path(), &format!("{line} watched --watch"));
    let [plain, watched] =
        ["plain", "watched"].map(|run| scrnn(folder.path(), &format!("generate {run} --seed 3 --json")));
    assert!(plain == watched, "the page changed what was learned");

    let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
    command.current_dir(folder.path()).stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null());
    let line = format!("train {experiment} --epochs 1000000 --out live --watch --set output.checkpoint_seconds=1");
    let mut training = Training(command.args(line.split_whitespace()).spawn().unwrap());
    let mut said = BufReader::new(training.0.stderr.take().unwrap());
    let mut first = String::new();
    said.read_line(&mut first).unwrap();
    let url = first.trim().strip_prefix("watch it at ").unwrap_or_else(|| panic!("{first}")).to_owned();
    // Somebody has to read what it says.
    std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));

    let address = url.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    stream.write_all(b"GET /data.json HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403 ") && !answer.contains("lissajous"), "{answer}");

    let Some(found) = used(folder.path(), &["live", &url]) else { return };
    assert!(found["points"].as_f64().unwrap() > 2.0 && found["loops"].as_f64().unwrap() >= 2.0, "{found}");
    assert!(
        found["stand"].as_str().unwrap().contains("of 1000000") && found["back"].as_str().unwrap().contains("left")
    );
    assert!(found["lost"].as_str().unwrap().contains("does not answer"), "{found}");
    assert_eq!(found["foreign"], json!([]), "no request goes elsewhere");
}
