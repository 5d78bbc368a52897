//! Recordings as data: trained on, recognised, generated along, looked at, refused.

use scrnn_sim::recording::{Heading, Joint, Recorder};

use crate::{Place, SINE, numbers};

/// A recording of two sequences at 10 Hz: an elbow, a wrist that follows it, and what a network might have been told.
fn recording(place: &Place, name: &str, phase: f64) {
    let channels = ["yaw".to_owned(), "a pitch".to_owned()];
    let heading = Heading { channels: &channels, ..Heading::default() };
    let file = std::fs::File::create(place.path(name)).unwrap();
    let mut recorder = Recorder::new(file, &heading).unwrap();
    for sequence in 0..2_u64 {
        recorder.begin_sequence(sequence * 60_000_000_000, ["left", "right"][sequence as usize]).unwrap();
        for step in 0..60_u64 {
            let time = sequence * 60_000_000_000 + step * 100_000_000;
            let angle = (0.3 * step as f64 + sequence as f64 + phase).sin();
            recorder.joint_states(time, &[Joint::at("elbow", angle), Joint::at("wrist", 0.5 * angle)]).unwrap();
            recorder.sensed(time, &[angle, 0.25 * angle]).unwrap();
        }
    }
    recorder.finish().unwrap();
}

fn experiment(data: &str) -> String {
    SINE.replace("task = \"sinusoid\"\nsteps = 80", data)
}

#[test]
fn a_network_learns_joints_by_their_names_and_finds_them_again() {
    let place = Place::with(&experiment(
        "files = [\"arm.mcap\", \"more.mcap\"]\ntopic = \"/joint_states\"\nperiod = 0.2\nchannels = [\"wrist\", \"elbow\"]",
    ));
    recording(&place, "arm.mcap", 0.0);
    recording(&place, "more.mcap", 1.0);
    place.ok("train sine.toml --out run");
    let seen = place.json("inspect run --json");
    let names: Vec<_> = seen["channels"].as_array().unwrap().iter().map(|channel| &channel["name"]).collect();
    assert_eq!(names, ["wrist", "elbow"]);
    assert_eq!(seen["sequences"], serde_json::json!(["arm/left", "arm/right", "more/left", "more/right"]));
    assert_eq!(seen["lengths"], serde_json::json!([30, 30, 30, 30]));

    // What the run learned is what it takes from other recordings, if nothing else is said.
    let found = place.json("recognize run more.mcap --starts 3 --epochs 10 --json");
    assert_eq!(found["sequences"][1]["sequence"], "right");
    let along = place.json("generate run --mode open --sequence 1 --data more.mcap --json");
    assert_eq!(along["sequences"][0]["mean"].as_array().unwrap().len(), 29);
    assert_eq!(place.json("generate run --mode open --json")["channels"], serde_json::json!(["wrist", "elbow"]));
    let finer = place.json("generate run --mode open --sequence 1 --data more.mcap --period 0.1 --json");
    assert_eq!(finer["sequences"][0]["mean"].as_array().unwrap().len(), 59);
    let (_, told) = place.fails(2, "recognize run more.mcap --channels elbow");
    assert!(told.contains("has no channel `wrist`") && told.contains("wrist, elbow"), "{told}");
}

#[test]
fn a_recording_and_a_table_of_the_same_samples_train_to_the_same_bits() {
    let place = Place::new();
    recording(&place, "arm.mcap", 0.0);
    let rows = (0..60).map(|step| {
        let angle = (0.3 * f64::from(step)).sin();
        format!("left,{angle:?},{:?}\n", 0.25 * angle)
    });
    let more = (0..60).map(|step| {
        let angle = (0.3 * f64::from(step) + 1.0).sin();
        format!("right,{angle:?},{:?}\n", 0.25 * angle)
    });
    place.write("arm.csv", format!("sequence,yaw,a pitch\n{}{}", rows.collect::<String>(), more.collect::<String>()));
    for file in ["arm.mcap", "arm.csv"] {
        place.write("one.toml", experiment(&format!("files = [\"{file}\"]")));
        place.ok(&format!("train one.toml --out run-{file}"));
    }
    let nll = |run: &str| place.json(&format!("inspect {run} --json"))["score"]["nll"].as_f64().unwrap();
    assert_eq!(nll("run-arm.mcap").to_bits(), nll("run-arm.csv").to_bits());
    // Channels can be chosen in a table as well.
    place.write("one.toml", experiment("files = [\"arm.csv\"]"));
    place.ok("train one.toml --out part --set data.channels=[\"yaw\"]");
    let seen = place.json("inspect part --json");
    assert_eq!(numbers(&serde_json::json!([seen["channels"].as_array().unwrap().len()])), [1.0]);
}

#[test]
fn what_a_recording_holds_is_shown_and_what_it_lacks_is_said() {
    let place = Place::new();
    recording(&place, "arm.mcap", 0.0);
    let said = place.ok("inspect arm.mcap");
    assert!(said.contains("arm.mcap: 2 sequences of 60 samples, 2 channels") && said.contains("a pitch"), "{said}");
    let said = place.ok("inspect arm.mcap --topic /joint_states --period 0.05 --channels wrist");
    assert!(said.contains("2 sequences of 119 samples, 1 channel") && said.contains("wrist"), "{said}");
    let (_, told) = place.fails(2, "inspect arm.mcap --topic /joints");
    assert!(told.contains("arm.mcap: there is no topic `/joints`"), "{told}");
    assert!(told.contains("joint_states (120 messages, json, foxglove.JointStates)"), "{told}");
    let (_, told) = place.fails(2, "inspect arm.mcap --channels nose");
    assert!(told.contains("arm.mcap, topic /sensed: there is no channel `nose`"), "{told}");
    let (_, told) = place.fails(2, "inspect arm.mcap --period 0");
    assert!(told.contains("give a number from 1e-9 to 1e9"), "{told}");
    let bytes = place.read("arm.mcap");
    place.write("cut.mcap", &bytes[..bytes.len() / 2]);
    let (_, told) = place.fails(2, "inspect cut.mcap");
    assert!(told.contains("cut.mcap: the recording is cut off") && told.contains("mcap recover"), "{told}");
    place.write("table.csv", "y\n1\n2\n");
    let (_, told) = place.fails(2, "inspect table.csv --topic /joint_states");
    assert!(told.contains("table.csv is a CSV table; `topics` goes with .mcap, .db3, .bag only"), "{told}");
    let (_, told) = place.fails(2, "data sinusoid --steps 5 --out wave.mcap");
    assert!(told.contains("wave.mcap would be a recording of a world") && !place.path("wave.mcap").exists(), "{told}");
    place.write("bad.toml", experiment("files = [\"arm.mcap\"]\nperiod = -1.0"));
    let (_, told) = place.fails(2, "train bad.toml");
    assert!(told.contains("`data.period` is -1") && told.contains("bad.toml:"), "{told}");
    place.write("bad.toml", experiment("task = \"sinusoid\"\ntopic = \"/sensed\""));
    let (_, told) = place.fails(2, "train bad.toml");
    assert!(told.contains("`data.topic` does not go with `task`"), "{told}");
}
