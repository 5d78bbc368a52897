//! Old files: a run and a recording of the first version that wrote them, which every later version reads.
//!
//! The files are never written again. A change that makes this test fail breaks what users have on their disks.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name)
}

fn scrnn(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_scrnn")).current_dir(folder).args(line.split_whitespace()).output().unwrap()
}

fn ok(folder: &Path, line: &str) -> String {
    let output = scrnn(folder, line);
    assert!(output.status.success(), "scrnn {line}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A copy of the golden run, to do things with.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("run")).unwrap();
    for entry in fs::read_dir(golden("run")).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), folder.path().join("run").join(entry.file_name())).unwrap();
    }
    fs::copy(golden("arm.mcap"), folder.path().join("arm.mcap")).unwrap();
    folder
}

/// All numbers but the samples, whose noise has another stream now than then.
fn numbers(csv: &str) -> Vec<f64> {
    let names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let rows = csv.lines().skip(1).flat_map(|line| line.split(',').zip(&names).skip(2));
    rows.filter(|(_, name)| !name.starts_with("sample")).map(|(field, _)| field.parse().unwrap()).collect()
}

/// That both tables hold the same, up to what another processor may round otherwise.
fn agrees(found: &str, golden: &str) {
    assert_eq!(found.lines().next(), golden.lines().next());
    let (found, golden) = (numbers(found), numbers(golden));
    assert_eq!(found.len(), golden.len());
    for (a, b) in found.iter().zip(&golden) {
        assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{a} instead of {b}");
    }
}

#[test]
fn the_golden_checkpoint_is_read_generates_and_goes_on() {
    let folder = copy();
    let folder = folder.path();
    let seen: Value = serde_json::from_str(&ok(folder, "inspect run --json")).unwrap();
    assert_eq!((&seen["epoch"], &seen["delay"]), (&60.into(), &2.into()));
    assert_eq!(seen["sequences"], serde_json::json!(["left", "right"]));
    agrees(&ok(folder, "generate run --mode open --data arm.mcap"), &fs::read_to_string(golden("open.csv")).unwrap());
    agrees(&ok(folder, "generate run --no-noise --steps 20"), &fs::read_to_string(golden("closed.csv")).unwrap());
    let found: Value =
        serde_json::from_str(&ok(folder, "recognize run arm.mcap --starts 3 --epochs 5 --json")).unwrap();
    assert_eq!(found["sequences"][1]["sequence"], "right");
    ok(folder, "generate run --best --mean --steps 3");
    // The experiment says where its data lie: beside the folder.
    ok(folder, "train run --resume --epochs 80");
    let seen: Value = serde_json::from_str(&ok(folder, "inspect run --json")).unwrap();
    assert_eq!(seen["epoch"], 80);
    let history = fs::read_to_string(folder.join("run/history.csv")).unwrap();
    assert!(history.lines().any(|line| line.starts_with("60,")) && history.lines().any(|line| line.starts_with("80,")));
}

#[test]
fn the_golden_recording_holds_the_samples_that_it_held() {
    let folder = copy();
    let seen: Value = serde_json::from_str(&ok(folder.path(), "inspect arm.mcap --json")).unwrap();
    let samples: Vec<_> =
        seen["sequences"].as_array().unwrap().iter().map(|one| (&one["name"], &one["samples"])).collect();
    assert_eq!(samples, [(&"left".into(), &30.into()), (&"right".into(), &30.into())]);
    let yaw = &seen["channels"][0];
    assert_eq!((&yaw["name"], &yaw["high"], &yaw["low"]), (&"yaw".into(), &29.5.into(), &(-14.0).into()));
    let joints = ok(folder.path(), "inspect arm.mcap --topic /joint_states --period 0.05");
    assert!(joints.contains("2 sequences of 59 samples, 2 channels") && joints.contains("elbow"), "{joints}");
}

#[test]
fn newer_versions_are_refused_with_their_number() {
    let folder = copy();
    let folder = folder.path();
    let path = folder.join("run/checkpoint.safetensors");
    let mut bytes = fs::read(&path).unwrap();
    let key = b"\\\"format_version\\\":";
    let at = bytes.windows(key.len()).position(|window| window == key).unwrap() + key.len();
    assert_eq!(bytes[at], b'1');
    bytes[at] = b'9';
    fs::write(&path, bytes).unwrap();
    for line in ["inspect run", "generate run", "train run --resume", "recognize run arm.mcap"] {
        let output = scrnn(folder, line);
        let told = String::from_utf8_lossy(&output.stderr).replace('\u{2502}', " ");
        let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{line}: {told}");
        assert!(told.contains("format version 9 is newer than 2, which this program reads"), "{line}: {told}");
    }
    let mut bytes = fs::read(folder.join("arm.mcap")).unwrap();
    bytes[5] = b'3';
    fs::write(folder.join("arm.mcap"), bytes).unwrap();
    let output = scrnn(folder, "inspect arm.mcap");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("version 3 of MCAP; known: 0"), "{told}");
}

/// What is written today reads as what was written since every random number has a stream of its own (the files before that began from
/// other weights). Where SCRNN_WRITE_GOLDEN names a folder, the files stay there: for the golden files of a later version, beside
/// these.
#[test]
fn files_of_today_read_as_the_golden_ones_do() {
    let temporary = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("SCRNN_WRITE_GOLDEN").map(PathBuf::from);
    let folder = kept.unwrap_or_else(|| temporary.path().to_owned());
    write_golden_files(&folder);
    let seen = |folder: &Path, path: &str| -> Value {
        let mut seen: Value = serde_json::from_str(&ok(folder, &format!("inspect {path} --json"))).unwrap();
        for key in ["path", "score", "best", "experiment"] {
            seen.as_object_mut().unwrap().remove(key);
        }
        seen
    };
    let then = golden("streams");
    for path in ["arm.mcap", "run"] {
        assert_eq!(seen(&folder, path), seen(&then, path), "{path}");
    }
    for name in ["open.csv", "closed.csv"] {
        agrees(&fs::read_to_string(folder.join(name)).unwrap(), &fs::read_to_string(then.join(name)).unwrap());
    }
}

/// Writes a recording, a run that learned it, and what the run generates.
fn write_golden_files(folder: &Path) {
    use scrnn_sim::recording::{Heading, Joint, Recorder};

    let channels = ["yaw".to_owned(), "pitch".to_owned()];
    let heading = Heading { channels: &channels, notes: &[("seed", "1")], ..Heading::default() };
    let mut recorder = Recorder::new(fs::File::create(folder.join("arm.mcap")).unwrap(), &heading).unwrap();
    for sequence in 0..2_u64 {
        recorder.begin_sequence(sequence * 60_000_000_000, ["left", "right"][sequence as usize]).unwrap();
        for step in 0..30_u64 {
            let time = sequence * 60_000_000_000 + step * 100_000_000;
            // Exact in binary.
            let yaw =
                [step as f64 - 0.5 * step as f64 * sequence as f64, -0.5 * step as f64][usize::from(step % 2 == 0)];
            recorder.joint_states(time, &[Joint::at("elbow", yaw), Joint::at("wrist", 0.25 * yaw)]).unwrap();
            recorder.sensed(time, &[yaw + 0.5 * (step % 2) as f64, 0.125 * (step % 5) as f64]).unwrap();
            recorder.predicted(time, &[yaw, 0.25], Some(&[0.5, 0.125])).unwrap();
        }
    }
    recorder.finish().unwrap();
    let experiment = "name = \"golden\"\n[data]\nfiles = [\"arm.mcap\"]\n[network]\ndelay = 2\n[[network.groups]]\n\
        name = \"fast\"\nunits = 4\ntime_constant = 2.0\nlearns_initial_state = false\n[[network.groups]]\nname = \"slow\"\n\
        units = 2\ntime_constant = 10.0\n[training]\nepochs = 60\noptimiser = \"momentum\"\n[training.momentum]\nrate = 1e-3\n\
        [output]\nhistory_every = 20\n";
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("golden.toml"), experiment).unwrap();
    fs::copy(folder.join("arm.mcap"), place.path().join("arm.mcap")).unwrap();
    ok(place.path(), "train golden.toml --out run");
    fs::create_dir_all(folder.join("run")).unwrap();
    for name in ["experiment.toml", "checkpoint.safetensors", "best.safetensors", "history.csv"] {
        fs::copy(place.path().join("run").join(name), folder.join("run").join(name)).unwrap();
    }
    // The experiment names the file where it lay; here it lies beside.
    let text = fs::read_to_string(folder.join("run/experiment.toml")).unwrap();
    let text: Vec<&str> = text
        .lines()
        .map(|line| if line.starts_with("files = ") { "files = [\"../arm.mcap\"]" } else { line })
        .collect();
    fs::write(folder.join("run/experiment.toml"), text.join("\n") + "\n").unwrap();
    fs::write(folder.join("open.csv"), ok(place.path(), "generate run --mode open --data arm.mcap")).unwrap();
    fs::write(folder.join("closed.csv"), ok(place.path(), "generate run --no-noise --steps 20")).unwrap();
}
