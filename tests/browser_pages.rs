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
#[path = "sweeping/thousand.rs"]
mod thousand;
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
    let sine = root().join("assets/experiments/sinusoid_fast.toml").display().to_string();
    scrnn(folder.path(), &format!("train {sine} --epochs 20 --set data.sequences=1 --out one --quiet"));
    scrnn(folder.path(), &format!("train {sine} --epochs 20 --set data.sequences=2 --out two --quiet"));
    scrnn(folder.path(), &format!("train {sine} --epochs 20 --set network.variance=false --out mean --quiet"));
    for (run, least) in [("cycle/seed-1", 3), ("one", 1), ("two", 2)] {
        scrnn(folder.path(), &format!("report {run}"));
        let Some(found) = used(folder.path(), &["drag", &format!("{run}/report.html")]) else { return };
        assert_eq!((&found["networks"], &found["can_choose"]), (&json!([""]), &json!(false)), "{run}");
        dragged_as_generated(folder.path(), run, &found, least);
    }
    scrnn(folder.path(), &format!("train {sine} --epochs 20 --set training.members=2 --out mixture --quiet"));
    scrnn(folder.path(), "report mixture");
    let Some(found) = used(folder.path(), &["drag", "mixture/report.html"]) else { return };
    assert_eq!(found["changed"], json!([true, true, true]), "a mixture: {found}");
    assert!(numbers(&found["runs"][0]["mean"][49]).iter().all(|mean| mean.is_finite()), "{found}");

    // All of them on the page of a comparison, where another network is chosen: with other channels, states and without variance.
    let curves = root().join("assets/experiments/lissajous_fast.toml").display().to_string();
    scrnn(folder.path(), &format!("train {curves} --epochs 20 --out curves --quiet"));
    scrnn(folder.path(), "compare cycle/seed-1 one two mean curves --out page");
    for (run, least) in [("one", 1), ("mean", 1), ("curves", 12), ("cycle/seed-1", 3), ("two", 2)] {
        let name = run.rsplit('/').next().unwrap();
        let Some(found) = used(folder.path(), &["drag", "page/report.html", name]) else { return };
        assert!(found["can_choose"] == true && found["networks"].as_array().unwrap().len() == 5, "{run}: {found}");
        let shown = json!({ ".orbit": name == "curves", ".noise": name != "mean" });
        assert_eq!(found["shown"], shown, "{run}: no plane of one channel, no noise without variance");
        dragged_as_generated(folder.path(), run, &found, least);
    }
}

/// What a page said of a network that was dragged in it: everything moves, and its numbers are the library's.
fn dragged_as_generated(folder: &Path, run: &str, found: &Value, least: usize) {
    assert_ne!(found["start"], found["dragged"], "{run}");
    assert_ne!(found["dragged"], found["keyed"], "{run}");
    let noise = &found["shown"][".noise"];
    assert_eq!(found["changed"], json!([true, noise, true]), "{run}: a drag, noise and a push change what is drawn");
    let generated = scrnn(folder, &format!("generate {run} --no-noise --json"));
    let generated: Value = serde_json::from_str(&generated).unwrap();
    let (sequences, runs) = (generated["sequences"].as_array().unwrap(), found["runs"].as_array().unwrap());
    assert!(runs.len() == sequences.len() && runs.len() >= least);
    for (own, sequence) in runs.iter().zip(sequences) {
        for part in if noise == true { &["mean", "variance"][..] } else { &["mean"] } {
            let (own, library) = (own[part].as_array().unwrap(), sequence[part].as_array().unwrap());
            assert!(own.len() >= 50);
            for (step, (a, b)) in own.iter().zip(library).enumerate() {
                for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
                    assert!((a - b).abs() <= 1e-6, "{run}, {part} at step {step}: {a} in the page, {b} in the library");
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

/// A network that has hardly learned to follow: its hand meets the object at every second branching.
const CLUMSY: &str = "name = \"clumsy\"\n[data]\ntask = \"interact\"\nsequences = 2\nsteps = 40\n[[network.groups]]\nname = \"c\"\nunits = 8\n\
                      time_constant = 2.0\n[training]\nepochs = 5\noptimiser = \"adam\"\n";

#[test]
fn contacts_and_branchings_of_an_interaction_are_marked_when_its_recording_has_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("clumsy.toml"), CLUMSY).unwrap();
    scrnn(folder.path(), "train clumsy.toml --out run --quiet");
    scrnn(folder.path(), "simulate interact run --order LRLR --mcap world.mcap");
    // The recording alone: in a folder of its own, without the run.
    let alone = tempfile::tempdir().unwrap();
    std::fs::rename(folder.path().join("world.mcap"), alone.path().join("world.mcap")).unwrap();
    scrnn(alone.path(), "view world.mcap");
    let Some(found) = used(alone.path(), &["marks", "world.html", "world.mcap"]) else { return };
    let mut drawn: Vec<(String, f64, String)> = Vec::new();
    for mark in found["drawn"].as_array().unwrap() {
        assert!(mark["seen"] == true && mark["upright"] == true, "{mark}");
        let words = mark["words"].as_str().unwrap();
        let words = words.rsplit_once(" at ").unwrap().0;
        drawn.push((mark["kind"].as_str().unwrap().to_owned(), mark["time"].as_f64().unwrap(), words.to_owned()));
    }
    drawn.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let recorded = found["recorded"].as_array().unwrap();
    let of = |kind: &str| recorded.iter().filter(|one| one[0] == kind).count();
    assert!(of("contact") > 10 && of("sequence") == 1, "{recorded:?}");
    let branchings = |one: &&Value| one[2].as_str().unwrap().starts_with("branching");
    assert_eq!(recorded.iter().filter(branchings).count(), 4, "{recorded:?}");
    assert_eq!(drawn.len(), recorded.len());
    for ((kind, time, words), one) in drawn.iter().zip(recorded) {
        // An event has its values behind its name.
        let (own, at) = (one[2].as_str().unwrap(), one[1].as_f64().unwrap());
        let same = if kind == "contact" { *words == format!("{own} touch") } else { words.starts_with(own) };
        assert!(one[0] == *kind && same, "{kind} {words} at {time}, recorded {one}");
        assert!((time - at).abs() < 1e-9, "{kind} {words} at {time}, recorded at {at}");
    }
    let told = &found["told"][0];
    assert_eq!(told, "branching 1 to the left, at 2.0 s");
    assert!(!found["text"].as_str().unwrap().contains("contacts are not marked"), "{found}");
}

#[test]
fn a_recording_of_ros_with_joint_states_alone_shows_the_hand_where_forward_kinematics_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = interpreter::python("playwright.sync_api, mcap_ros2.writer, numpy") else { return };
    let script = root().join("tests/python/write_arm.py");
    let output = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    scrnn(folder.path(), "view arm.mcap --urdf arm.urdf --out arm.html");
    let truth: Value = serde_json::from_slice(&std::fs::read(folder.path().join("hand.json")).unwrap()).unwrap();
    let truth: Vec<&Value> = truth.as_array().unwrap().iter().step_by(7).collect();
    let times: Vec<String> = truth.iter().map(|one| one["t"].to_string()).collect();
    let mut arguments = vec!["poses", "arm.html", "hand"];
    arguments.extend(times.iter().map(String::as_str));
    let Some(found) = used(folder.path(), &arguments) else { return };
    for (one, truth) in found["poses"].as_array().unwrap().iter().zip(&truth) {
        let rows: Vec<Vec<f64>> = truth["pose"].as_array().unwrap().iter().map(numbers).collect();
        let place = numbers(&one["place"]);
        let [x, y, z, w] = [place[3], place[4], place[5], place[6]];
        // The rotation of a unit quaternion.
        let turned = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        for (i, row) in rows.iter().enumerate() {
            assert!((place[i] - row[3]).abs() < 1e-6, "at {}: {one}, needed {truth}", truth["t"]);
            for k in 0..3 {
                assert!((turned[i][k] - row[k]).abs() < 1e-6, "at {}: {turned:?}, needed {truth}", truth["t"]);
            }
        }
        let (drawn, projected) = (numbers(&one["drawn"]["at"]), numbers(&one["projected"]));
        let off = (drawn[0] - projected[0]).hypot(drawn[1] - projected[1]);
        assert!(off <= 1.5, "{off} pixels at {}: {one}", truth["t"]);
    }
    assert!(found["poses"][0]["form"] == "box" && numbers(&found["poses"][0]["size"]) == [0.1, 0.06, 0.04], "{found}");
    assert_eq!(found["curves"], 3, "the joints themselves");
    let said = found["text"].as_str().unwrap();
    assert!(said.contains("Nothing is recorded on /sensed") && said.contains("its root is at the origin"), "{said}");
}

/// A command that is ended when the test is over, however it ends.
struct Served(std::process::Child);

impl Served {
    /// Waits for its own end.
    fn ends(mut self) {
        assert!(self.0.wait().unwrap().success());
    }
}

/// A command that serves a page, and where.
fn served(folder: &Path, line: &str) -> (Served, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
    command.current_dir(folder).stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null());
    let mut served = Served(command.args(line.split_whitespace()).spawn().unwrap());
    let mut said = BufReader::new(served.0.stderr.take().unwrap());
    let mut all = String::new();
    let url = loop {
        let before = all.len();
        assert!(said.read_line(&mut all).unwrap() > 0, "{all}");
        if let Some(url) = all[before..].trim().strip_prefix("watch it at ") {
            break url.to_owned();
        }
    };
    // Somebody has to read what it says.
    std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
    (served, url)
}

/// What is told to a page that names another host.
fn refuses_other_hosts(url: &str, path: &str, secret: &str) {
    let address = url.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    stream.write_all(format!("GET /{path} HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n").as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403 ") && !answer.contains(secret), "{answer}");
}

impl Drop for Served {
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

    let line = format!("train {experiment} --epochs 1000000 --out live --watch --set output.checkpoint_seconds=1");
    let (_training, url) = served(folder.path(), &line);
    refuses_other_hosts(&url, "data.json", "lissajous");
    let Some(found) = used(folder.path(), &["live", &url]) else { return };
    assert!(found["points"].as_f64().unwrap() > 2.0 && found["loops"].as_f64().unwrap() >= 2.0, "{found}");
    assert!(
        found["stand"].as_str().unwrap().contains("of 1000000") && found["back"].as_str().unwrap().contains("left")
    );
    assert!(found["lost"].as_str().unwrap().contains("does not answer"), "{found}");
    assert_eq!(found["foreign"], json!([]), "no request goes elsewhere");
}

/// A network that has seen a little of three short demonstrations of reaching.
const REACH: &str = "name = \"reach\"\n[data]\ntask = \"reach\"\nsequences = 3\nsteps = 30\n[network]\n\
                     initial_state_variance = 0.001\n[[network.groups]]\nname = \"c\"\nunits = 8\ntime_constant = 2.0\n\
                     [training]\nepochs = 300\noptimiser = \"adam\"\n[training.adam]\nrate = 0.01\n";

#[test]
fn a_robot_is_watched_while_it_reaches_and_does_what_it_does_unwatched() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("reach.toml"), REACH).unwrap();
    scrnn(folder.path(), "train reach.toml --out run --quiet");
    let line = "simulate reach run --cycles 1 --seed 3 --json";
    let plain = scrnn(folder.path(), line);
    assert!(plain == scrnn(folder.path(), &format!("{line} --watch --speed 0")), "the page changed what was done");

    let (served, url) = served(folder.path(), "simulate reach run --cycles 10000 --watch");
    refuses_other_hosts(&url, "data/0.json", "HeadYaw");
    let Some(found) = used(folder.path(), &["motion", &url]) else { return };
    assert!(found["bodies"].as_f64().unwrap() > 10.0 && found["channels"] == 6, "{found}");
    assert!(numbers(&found["curves"]).iter().all(|count| *count >= 2.0) && found["bands"] == 6, "{found}");
    assert!(numbers(&found["errors"]).iter().all(|error| *error >= 0.0) && found["in_order"] == true, "{found}");
    // The hand moves, and is drawn where the page was told that it is.
    assert_ne!(found["hand"], found["later"], "{found}");
    let (drawn, projected) = (numbers(&found["drawn"]["drawn"]["at"]), numbers(&found["drawn"]["projected"]));
    let off = (projected[0] - drawn[0]).hypot(projected[1] - drawn[1]);
    assert!(off <= 1.0, "{off} pixels: {found}");
    assert!(found["lost"].as_f64().unwrap() > 0.0 && found["back"].as_str().unwrap().contains(" s, error "), "{found}");
    assert_eq!(found["foreign"], json!([]), "no request goes elsewhere");
    drop(served);
}

#[test]
fn a_stream_is_watched_and_answered_as_it_is_unwatched() {
    let folder = tempfile::tempdir().unwrap();
    scrnn(folder.path(), "reproduce sinusoid --epochs 50 --out wave --quiet");
    scrnn(folder.path(), "data sinusoid --sequences 1 --steps 300 --out new.csv");
    let line = "recognize wave/seed-1 new.csv --online --window 20 --steps 2 --ahead 15";
    let followed = |more: &str, out: &str| {
        scrnn(folder.path(), &format!("{line}{more} --out {out}"));
        std::fs::read(folder.path().join(out)).unwrap()
    };
    assert!(followed("", "a.csv") == followed(" --watch --speed 0", "b.csv"), "the page changed what was found");

    let (served, url) = served(folder.path(), &format!("{line} --watch --speed 0.5"));
    refuses_other_hosts(&url, "data/0.json", "frames");
    let Some(found) = used(folder.path(), &["motion", &url]) else { return };
    assert!(found["bodies"] == 0 && found["channels"] == 1 && found["look"] == 16, "{found}");
    // Sensed, expected, to come, and what is now made of the past; a band for what was expected and one for what is to come.
    assert!(numbers(&found["curves"])[0] >= 4.0 && found["bands"] == 2, "{found}");
    assert!(found["back"].as_str().unwrap().starts_with("sample ") && found["in_order"] == true, "{found}");
    assert_eq!(found["foreign"], json!([]), "no request goes elsewhere");
    drop(served);
}

#[test]
fn a_sweep_and_a_mixture_are_watched_until_all_are_done() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = root().join("assets/experiments/sinusoid_fast.toml");
    let sweep = format!(
        "name = \"two\"\nexperiment = {experiment:?}\nseeds = 2\n[set]\ntraining.epochs = 1500\noutput.checkpoint_every = 50\n[grid]\n\
         \"training.adam.rate\" = [1e-3, 1e-2]\n"
    );
    std::fs::write(folder.path().join("two.toml"), sweep).unwrap();
    // Its own server would go with it: another one reads the same folder.
    let (sweeping, own) = served(folder.path(), "sweep two.toml --out two --watch");
    refuses_other_hosts(&own, "data/0.json", "seed-1");
    let (_status, url) = served(folder.path(), "sweep two.toml --out two --status --watch");
    let Some(found) = used(folder.path(), &["many", &url]) else { return };
    sweeping.ends();
    assert!(found["first"].as_str().unwrap().starts_with("Of 4 runs:"), "{found}");
    assert_eq!(found["last"], "Of 4 runs: 4 finished.");
    assert_eq!((&found["rows"], &found["curves"], &found["marked"]), (&json!(4), &json!(4), &json!(1)), "{found}");
    assert!(found["key"].as_str().unwrap().contains("epoch 1500 of 1500"), "{found}");
    assert_eq!(found["foreign"], json!([]), "no request goes elsewhere");

    let line = format!("train {} --set training.members=2 --epochs 40000 --out mix --watch", experiment.display());
    let (_training, url) = served(folder.path(), &line);
    let address = url.trim_start_matches("http://").trim_end_matches('/');
    let told = || -> Value {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        stream.write_all(format!("GET /data/0.json HTTP/1.1\r\nHost: {address}\r\n\r\n").as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap()).unwrap()
    };
    let begun = std::time::Instant::now();
    let both = loop {
        let told = told();
        if told["counts"][1] == json!(["being trained", 2]) {
            break told;
        }
        assert!(begun.elapsed().as_secs() < 60, "{told}");
        std::thread::sleep(std::time::Duration::from_millis(200));
    };
    let names: Vec<&Value> = both["changed"].as_array().unwrap().iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["member 1", "member 2"], "{both}");
    assert_eq!(both["changed"][0]["epochs"], 40000, "{both}");
}

#[test]
fn the_page_of_a_comparison_reads_well_on_a_phone_in_print_in_dark_and_light_also_with_a_thousand_networks() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = root().join("assets/experiments/sinusoid_fast.toml");
    let sweep = format!(
        "name = \"two\"\nexperiment = {experiment:?}\nseeds = 3\n[set]\ntraining.epochs = 20\n[grid]\n\"training.adam.rate\" = [1e-3, 1e-2]\n\
         \"network.groups.context.units\" = [3, 4, 5]\n"
    );
    std::fs::write(folder.path().join("two.toml"), sweep).unwrap();
    scrnn(folder.path(), "sweep two.toml --out two --quiet");
    scrnn(folder.path(), "compare two");
    let text = std::fs::read_to_string(&experiment).unwrap();
    std::fs::write(folder.path().join("sine.toml"), format!("{text}\n").replace("epochs = 25_000", "epochs = 200"))
        .unwrap();
    thousand::make(folder.path(), &|line| scrnn(folder.path(), line));
    scrnn(folder.path(), "compare runs/s");
    for (place, least) in [("two", 200), ("runs/s", 1000)] {
        let page = format!("{place}/report.html");
        let size = std::fs::metadata(folder.path().join(&page)).unwrap().len();
        assert!(size < 5_000_000, "{page}: {size} bytes");
        // No request leaves the page: else the script fails.
        let Some(found) = used(folder.path(), &["read", &page]) else { return };
        for way in ["light", "dark", "print"] {
            let found = &found[way];
            assert_eq!(found["wide"], 0, "{page}, {way}: wider than 390 pixels: {found}");
            assert!(found["texts"].as_u64().unwrap() > least, "{page}, {way}: {found}");
            assert!(found["faintest"]["contrast"].as_f64().unwrap() >= 4.5, "{page}, {way}: {found}");
            let verdict = &found["verdict"];
            assert!(verdict["text"].as_str().unwrap().starts_with("Over all seeds the best setting is"), "{verdict}");
            let [left, right, top] = ["left", "right", "top"].map(|side| verdict[side].as_f64().unwrap());
            assert!(
                verdict["seen"] == true && left >= 0.0 && right <= 390.0 && top < 800.0,
                "{page}, {way}: {verdict}"
            );
            let milliseconds = found["milliseconds"].as_f64().unwrap();
            assert!(milliseconds < 2_000.0, "{page}, {way}: {milliseconds} ms to open");
            eprintln!(
                "{page}, {way}: {size} bytes, {milliseconds:.0} ms, least contrast {}",
                found["faintest"]["contrast"]
            );
        }
    }
}
