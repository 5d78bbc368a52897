//! Python beside the program: numpy and pandas write what it reads and read what it writes, numpy computes from a
//! checkpoint what it generates, and mcap reads recordings.
//!
//! The interpreter is that of tests/python/interpreter.rs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use scrnn_sim::recording::{Contact, Heading, Joint, Recorder, Robot};
use scrnn_sim::world::scene::{Body, Frame, Part, Scene, Shape};

#[path = "python/interpreter.rs"]
mod interpreter;

use interpreter::root;

/// An interpreter that has all packages.
fn python() -> Option<PathBuf> {
    interpreter::python("numpy, pandas, safetensors, mcap, mcap_protobuf, foxglove_schemas_protobuf")
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
    // Arrays of one length and other names (named.npz) are channels of one recording, not sequences.
    let files = [
        "plain.npz",
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
    assert_ne!(train("named.npz").to_bits(), first.to_bits());
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

/// An arm of two links beside a ball on a bench, at an angle of its joint.
fn scene(angle: f64) -> Scene {
    let body = |name: &str, part, shape, x: f64| {
        let mut body = Body { name: name.into(), part, shape, world_from_shape: Default::default() };
        body.world_from_shape.translation.vector.x = x;
        body
    };
    let frame = |name: &str, x: f64, angle: f64| {
        let mut frame = Frame { name: name.into(), world_from_frame: Default::default() };
        frame.world_from_frame.translation.vector.x = x;
        // A quaternion's numbers are i, j, k, w.
        let turned = frame.world_from_frame.rotation.as_mut_unchecked();
        (turned.k, turned.w) = (angle / 2.0).sin_cos();
        frame
    };
    let capsule = Shape::Capsule { a: [0.0, 0.0, 0.1].into(), b: [0.0, 0.0, -0.1].into(), radius: 0.03 };
    Scene {
        bodies: vec![
            body("self/hand", Part::Hand, capsule, 0.1),
            body("ball", Part::Object, Shape::Sphere { radius: 0.02 }, 0.3),
            body("bench", Part::Furniture, Shape::Cuboid { half_extents: [0.2, 0.3, 0.01] }, 0.0),
        ],
        frames: vec![frame("self/base", 0.5, 0.0), frame("self/hand", 0.6, angle)],
    }
}

#[test]
fn python_reads_recordings_with_schemas_that_are_foxgloves_own() {
    let Some(place) = Place::new() else { return };
    let urdf = r#"<robot name="arm"><link name="base"/><link name="hand"/><joint name="elbow" type="revolute">
        <parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
    let channels = ["elbow", "vision x"].map(str::to_owned);
    let heading = Heading {
        robots: &[Robot { prefix: "self/", urdf }],
        experiment: Some("name = \"arm\"\n"),
        channels: &channels,
        notes: &[("seed", "1")],
    };
    let file = std::fs::File::create(place.folder.path().join("arm.mcap")).unwrap();
    let mut recorder = Recorder::new(file, &heading).unwrap();
    for step in 0..20_u64 {
        let (time, angle) = (step * 1_500_000_000, step as f64 / 20.0);
        recorder.begin_sequence(time, &format!("one {step}")).unwrap();
        recorder.scene(time, &scene(angle)).unwrap();
        let elbow = Joint { name: "elbow", position: angle, velocity: Some(0.5), effort: Some(-0.25) };
        recorder.joint_states(time, &[elbow]).unwrap();
        recorder.joint_targets(time, &[Joint::at("elbow", angle + 0.125)]).unwrap();
        recorder.sensed(time, &[angle, 1e-300]).unwrap();
        recorder.predicted(time, &[angle, 0.0], Some(&[1e-4, 0.5])).unwrap();
        let contact = Contact { a: "self/hand", b: "ball", distance: Some(0.0), force: Some(2.5) };
        recorder.contacts(time, &[contact]).unwrap();
        recorder.event(time, "touch", &[("gap", 0.001)]).unwrap();
    }
    recorder.finish().unwrap();

    let found: serde_json::Value = serde_json::from_str(&place.agrees("read_recording.py", "arm.mcap")).unwrap();
    assert_eq!(found["attachments"]["self/robot.urdf"], urdf);
    assert_eq!(found["attachments"]["experiment.toml"], "name = \"arm\"\n");
    let counts = found["counts"].as_object().unwrap();
    assert_eq!(counts.len(), 10, "{counts:?}");
    assert!(counts.values().all(|count| count == 20), "{counts:?}");
    let last = &found["last"];
    assert_eq!(last["/joint_states"]["joints"][0]["effort"], -0.25);
    assert_eq!(last["/sensed"]["elbow"], 0.95);
    assert_eq!(last["/sensed"]["vision x"].as_f64().unwrap().to_bits(), 1e-300_f64.to_bits());
    assert_eq!(last["/contacts"]["contacts"][0]["b"], "ball");
    // The hand hangs on the base: a tenth of a metre away, turned by the joint's angle.
    let hand = &last["/transforms"]["transforms"][1];
    assert_eq!((&hand["parent_frame_id"], &hand["child_frame_id"]), (&"self/base".into(), &"self/hand".into()));
    assert!((hand["translation"]["x"].as_f64().unwrap() - 0.1).abs() < 1e-12, "{hand}");
    assert!((hand["rotation"]["z"].as_f64().unwrap() - (0.95_f64 / 2.0).sin()).abs() < 1e-12, "{hand}");
    let entities = last["/scene"]["entities"].as_array().unwrap();
    assert_eq!(entities.len(), 3);
    assert_eq!(entities[0]["spheres"].as_array().unwrap().len(), 2);
    assert_eq!(entities[0]["cylinders"][0]["size"]["z"], 0.2);
    assert_eq!(entities[2]["cubes"][0]["size"]["y"], 0.6);
    // A recording that lost its end, as after a crash, is not whole.
    let bytes = std::fs::read(place.folder.path().join("arm.mcap")).unwrap();
    std::fs::write(place.folder.path().join("cut.mcap"), &bytes[..bytes.len() - 100]).unwrap();
    assert_ne!(place.script("read_recording.py", "cut.mcap").status.code(), Some(0));
}

#[test]
fn python_reads_what_a_robot_did_that_reaches() {
    let Some(place) = Place::new() else { return };
    let experiment = "name = \"reach\"\n[data]\ntask = \"reach\"\nsequences = 3\nsteps = 24\n[[network.groups]]\n\
                      name = \"c\"\nunits = 6\ntime_constant = 2.0\n[training]\nepochs = 20\noptimiser = \"adam\"\n";
    place.write("reach.toml", experiment);
    place.scrnn("train reach.toml --out run");
    place.scrnn("simulate reach run --position 2 --cycles 1 --mcap reach.mcap");
    let found: serde_json::Value = serde_json::from_str(&place.agrees("read_recording.py", "reach.mcap")).unwrap();
    let attached = found["attachments"].as_object().unwrap();
    assert!(attached["self/robot.urdf"].as_str().unwrap().contains("<robot name=\"nao\">"));
    assert!(attached["experiment.toml"].as_str().unwrap().contains("task = \"reach\""));
    let count = |topic: &str| found["counts"][topic].as_u64().unwrap_or(0);
    assert_eq!((count("/sensed"), count("/predicted_mean"), count("/predicted_variance")), (12, 12, 12));
    // Ten pictures in each of six seconds, and the one at the beginning.
    let pictures = ["/scene", "/transforms", "/joint_states", "/joint_targets", "/contacts"];
    assert!(pictures.iter().all(|topic| count(topic) == 61), "{}", found["counts"]);
    let sphere = found["last"]["/scene"]["entities"].as_array().unwrap().iter().find(|one| one["id"] == "sphere");
    assert!(sphere.is_some(), "{}", found["last"]["/scene"]);
}
