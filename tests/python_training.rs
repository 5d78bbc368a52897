//! Data that people have, written by software that is not ours: each is learned, generated and recognised by one command
//! each, without an experiment file.
//!
//! The interpreter is that of tests/python/interpreter.rs.

use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;

#[path = "python/interpreter.rs"]
mod interpreter;

use interpreter::root;

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    interpreter::python("numpy, h5py, pyarrow, scipy.io, rosbags, mcap_ros2, mcap_protobuf, foxglove_schemas_protobuf")
}

/// A folder with all movements.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let script = root().join("tests/python/write_movements.py");
        let output = Command::new(python()?).arg("-Wignore").arg(script).arg(folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Some(Self(folder))
    }

    fn run(&self, line: &str) -> Output {
        let mut program = Command::new(env!("CARGO_BIN_EXE_scrnn"));
        let output = program.current_dir(&self.0).args(line.split_whitespace()).output().unwrap();
        assert!(output.status.success(), "scrnn {line}\n{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    fn json(&self, line: &str) -> Value {
        serde_json::from_slice(&self.run(&format!("{line} --json")).stdout).unwrap()
    }
}

/// Learns `data` into `run`, generates from it and recognises each of its sequences.
fn works(place: &Place, data: &str, options: &str, run: &str, (channels, names): (&[&str], &[&str])) {
    let output = place.run(&format!("train {data} {options} --json"));
    let verdict: Value = serde_json::from_slice(&output.stdout).unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("without an experiment file") && said.contains(&format!("{run}/experiment.toml")), "{said}");
    let explained = |score: &Value| score["explained"].as_f64().unwrap();
    let scores = verdict["channels"].as_array().unwrap();
    assert_eq!(scores.iter().map(|score| score["channel"].as_str().unwrap()).collect::<Vec<_>>(), channels);
    assert!(scores.iter().all(|score| explained(score) > 0.9), "{verdict}");
    let experiment = std::fs::read_to_string(place.0.path().join(run).join("experiment.toml")).unwrap();
    assert!(experiment.contains("# In steps.") && experiment.contains("time_constant"), "{experiment}");

    let generated = place.json(&format!("generate {run}"));
    let named: Vec<&str> =
        generated["sequences"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(named, names);
    let rows = generated["sequences"][0]["mean"].as_array().unwrap();
    assert!(rows.len() > 80 && rows[0].as_array().unwrap().len() == channels.len());
    let one = place.json(&format!("generate {run} --sequence {} --steps 5", names[1]));
    assert_eq!(one["sequences"][0]["name"], names[1]);

    let found = place.json(&format!("recognize {run} {data} --starts 4 --epochs 40"));
    for (one, name) in found["sequences"].as_array().unwrap().iter().zip(names) {
        assert_eq!((&one["sequence"], &one["learned"][0]["sequence"]), (&Value::from(*name), &Value::from(*name)));
    }
}

#[test]
fn bags_of_two_topics_with_joints_in_any_order() {
    let Some(place) = Place::new() else { return };
    let seen = place.json("inspect bags --topic /joint_states,/touch --period 0.02");
    // Joints stand in the order of the first message.
    let channels: Vec<&str> =
        seen["channels"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    let mut sorted = channels.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, ["elbow", "shoulder", "touch[0]", "touch[1]"]);
    let options = "--topic /joint_states,/touch --period 0.02 --epochs 1500 --seed 3";
    works(&place, "bags", options, "runs/bags", (&channels, &["circle/1", "wave/1"]));
}

#[test]
fn a_lerobot_data_set() {
    let Some(place) = Place::new() else { return };
    let channels = ["observation.state.shoulder", "observation.state.elbow", "action.shoulder", "action.elbow"];
    works(&place, "set", "--epochs 1500", "runs/set", (&channels, &["0", "1", "2"]));
}

#[test]
fn demonstrations_in_hdf5() {
    let Some(place) = Place::new() else { return };
    let seen = place.json("inspect demos.hdf5");
    let channels: Vec<String> =
        seen["channels"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect();
    let channels: Vec<&str> = channels.iter().map(String::as_str).collect();
    assert!(channels.iter().any(|name| name.contains("joint_pos")), "{channels:?}");
    works(&place, "demos.hdf5", "--epochs 1500", "runs/demos", (&channels, &["demo_0", "demo_1", "demo_2"]));
}
