//! Many networks from outside: workers that are killed, interrupted or share the work; plans and comparisons of many settings; SLURM.
//!
//! What must hold: whoever works on a sweep, and however often they are killed, it comes to the bytes of one undisturbed process.

#![cfg(unix)]

#[path = "sweeping/cluster.rs"]
mod cluster;
#[path = "sweeping/comparing.rs"]
mod comparing;
#[path = "sweeping/thousand.rs"]
mod thousand;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const SCRNN: &str = env!("CARGO_BIN_EXE_scrnn");

/// A small sine wave, saved often.
const SINE: &str = r#"
name = "sine"
[data]
task = "sinusoid"
steps = 60
sequences = 3
[[network.groups]]
name = "context"
units = 5
time_constant = 2.0
[training]
epochs = 1500
optimiser = "adam"
[output]
checkpoint_every = 25
"#;

/// Files of a run that are the same to the byte however it came about.
const SAME: [&str; 8] = [
    "experiment.toml",
    "checkpoint.safetensors",
    "best.safetensors",
    "outcome.json",
    "generated.csv",
    "report.html",
    "figures/learning.svg",
    "figures/learning.csv",
];

/// Numbers that look random (splitmix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }
}

/// A folder with an experiment and a sweep.
struct Place(tempfile::TempDir);

impl Place {
    fn new(experiment: &str, sweep: &str) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        fs::write(place.path("sine.toml"), experiment).unwrap();
        fs::write(place.path("s.toml"), format!("name = \"s\"\nexperiment = \"sine.toml\"\n{sweep}")).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(SCRNN);
        command.current_dir(&self.0).args(line.split_whitespace());
        command
    }

    fn start(&self, line: &str) -> Child {
        self.command(line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    fn run(&self, line: &str) -> Output {
        self.command(line).output().unwrap()
    }

    /// Runs a command that should end with `code`: stdout and stderr.
    fn ends(&self, code: i32, line: &str) -> (String, String) {
        let output = self.run(line);
        let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(code), "scrnn {line}\n{out}\n{err}");
        (out, err)
    }

    fn json(&self, line: &str) -> Value {
        serde_json::from_str(&self.ends(0, line).0).unwrap()
    }

    /// The folders of all runs of a sweep.
    fn runs(&self, out: &str) -> Vec<String> {
        let plan: Value = serde_json::from_slice(&fs::read(self.path(out).join("plan.json")).unwrap()).unwrap();
        plan["runs"].as_array().unwrap().iter().map(|run| run["folder"].as_str().unwrap().to_owned()).collect()
    }
}

/// All files below a folder, but for those that say when and where.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    fn below(folder: &Path, name: &str, found: &mut Vec<(String, Vec<u8>)>) {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let own = format!("{name}/{}", entry.file_name().to_string_lossy());
            if entry.file_type().unwrap().is_dir() {
                below(&entry.path(), &own, found);
            } else if !own.ends_with("/times.json") && !own.ends_with("/history.csv") {
                found.push((own, fs::read(entry.path()).unwrap()));
            }
        }
    }
    let mut found = Vec::new();
    below(folder, "", &mut found);
    found.sort();
    found
}

/// Both folders hold the same files with the same bytes.
fn same_files(place: &Place, a: &str, b: &str) {
    let [a, b] = [a, b].map(|out| files(&place.path(out)));
    let names = |all: &[(String, Vec<u8>)]| all.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

/// The epochs of a history, without its seconds.
fn epochs(place: &Place, run: &str) -> Vec<String> {
    let text = fs::read_to_string(place.path(run).join("history.csv")).unwrap();
    text.lines()
        .map(|line| {
            line.split(',').enumerate().filter(|(k, _)| *k != 6).map(|(_, field)| field).collect::<Vec<_>>().join(",")
        })
        .collect()
}

#[test]
fn four_workers_that_are_killed_twenty_times_come_to_the_same_bytes_as_one_undisturbed() {
    let sweep = "seeds = 2\n[grid]\n\"training.adam.rate\" = [1e-3, 3e-3, 1e-2]\n[then.generate]\nsteps = 50\n";
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 6000"), sweep);
    place.ends(0, "sweep s.toml --out whole --quiet");
    place.ends(0, "compare whole");
    let mut dice = Dice(7);
    let mut workers: Vec<Child> = (0..4).map(|_| place.start("sweep s.toml --out cut --threads 1")).collect();
    let mut killed = 0;
    for _ in 0..400 {
        std::thread::sleep(Duration::from_millis(5 + dice.below(120)));
        let victim = dice.below(4) as usize;
        if workers[victim].try_wait().unwrap().is_none() {
            workers[victim].kill().unwrap();
            workers[victim].wait().unwrap();
            killed += 1;
        }
        if killed == 20 {
            break;
        }
        workers[victim] = place.start("sweep s.toml --out cut --threads 1");
    }
    assert_eq!(killed, 20, "the sweep was finished before twenty were killed");
    workers.iter_mut().for_each(|worker| _ = worker.wait().unwrap());
    let worked = place.json("sweep s.toml --out cut --json");
    assert_eq!((worked["finished"].as_u64(), worked["runs"].as_u64()), (Some(6), Some(6)), "{worked}");
    place.ends(0, "compare cut");
    for run in place.runs("whole") {
        for name in SAME {
            assert!(place.path("whole").join(&run).join(name).exists(), "{run}/{name}");
        }
        assert_eq!(epochs(&place, &format!("whole/{run}")), epochs(&place, &format!("cut/{run}")), "{run}");
    }
    same_files(&place, "whole", "cut");
    let names: Vec<String> = files(&place.path("cut")).into_iter().map(|(name, _)| name).collect();
    assert!(!names.iter().any(|name| name.contains("claim-") || name.contains("half-written")), "{names:?}");
}

fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn ctrl_c_and_sigterm_save_all_networks_and_the_same_command_goes_on() {
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 40000"), "seeds = 2\n[then]\nreport = false\n");
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let mut worker = place
            .command("sweep s.toml --out cut --threads 2")
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let is_begun = |seed: u32| {
            let folder = place.path(&format!("cut/seed-{seed}"));
            folder.join("claim-1").exists() && folder.join("checkpoint.safetensors").exists()
        };
        wait_for("the work", || is_begun(1) && is_begun(2));
        Command::new("kill").args([signal, &worker.id().to_string()]).status().unwrap();
        let err = std::io::read_to_string(worker.stderr.take().unwrap()).unwrap();
        assert_eq!(worker.wait().unwrap().code(), Some(code), "{err}");
        assert!(err.contains("scrnn sweep s.toml --out cut"), "{err}");
        let names: Vec<String> = files(&place.path("cut")).into_iter().map(|(name, _)| name).collect();
        assert!(!names.iter().any(|name| name.contains("claim-")), "{names:?}");
    }
    let status = place.json("sweep s.toml --out cut --status --json");
    assert_eq!((status["interrupted"].as_u64(), status["finished"].as_u64()), (Some(2), Some(0)), "{status}");
    let text = place.ends(0, "sweep cut --status").0;
    assert!(text.starts_with("s: 2 networks of 1 settings\n") && text.contains("interrupted"), "{text}");
    let reached = place.json("inspect cut/seed-1 --json")["epoch"].as_u64().unwrap();
    assert!(reached > 0 && reached < 40000, "{reached}");
}

#[test]
fn what_fails_is_told_and_does_not_end_the_others() {
    let sweep = "[set]\ntraining.on_divergence = \"stop\"\n[grid]\n\"training.adam.rate\" = [1e-3, 1e7, 1e-2]\n[then]\nreport = false\n";
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 60"), sweep);
    let out = place.ends(3, "sweep s.toml --out out").0;
    assert!(out.contains("2 of 3 networks are finished") && out.contains("1 diverged"), "{out}");
    let status = place.json("sweep out --status --json");
    assert_eq!((status["finished"].as_u64(), status["diverged"].as_u64()), (Some(2), Some(1)), "{status}");
    place.ends(0, "compare out");
    let csv = fs::read_to_string(place.path("out/metrics.csv")).unwrap();
    assert!(csv.contains("rate=1e7/seed-1,rate=1e7,1e7,1,diverged,"), "{csv}");
    // A run whose folder is no folder: told with the code that `scrnn train` would end with.
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 60"), "seeds = 3\n[then]\nreport = false\n");
    fs::create_dir(place.path("out")).unwrap();
    fs::write(place.path("out/seed-2"), "in the way").unwrap();
    let (out, err) = place.ends(4, "sweep s.toml --out out");
    assert!(out.contains("2 of 3 networks are finished") && err.contains("seed-2: "), "{out}{err}");
    fs::remove_file(place.path("out/seed-2")).unwrap();
    place.ends(0, "sweep s.toml --out out");
}

#[test]
fn a_full_disk_ends_one_network_and_not_the_sweep() {
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 60"), "seeds = 3\n[then]\nreport = false\n");
    // The second run lies on a disk of its own, which is full.
    let script = format!(
        "mkdir -p out/seed-2 && mount -t tmpfs -o size=16k tmpfs out/seed-2 && head -c 12288 /dev/zero > out/seed-2/full; \
         {SCRNN} sweep s.toml --out out --threads 1; code=$?; ls out/seed-2 >&2; rm out/seed-2/full; \
         {SCRNN} sweep s.toml --out out --threads 1 >/dev/null 2>&1; exit $code"
    );
    let output = Command::new("unshare").args(["-rm", "sh", "-c", &script]).current_dir(&place.0).output();
    let output = output.expect("unshare can be called");
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    if !err.contains("full") && std::env::var_os("SCRNN_SKIP_MOUNTS").is_some() {
        return;
    }
    assert_eq!(output.status.code(), Some(4), "{out}{err}");
    assert!(out.contains("2 of 3 networks are finished"), "{out}{err}");
}

#[test]
fn ten_thousand_settings_are_planned_shown_and_looked_at_in_no_time() {
    let sweep = "[grid]\n\"training.adam.rate\" = { from = 1e-4, to = 1e-1, count = 100, scale = \"log\" }\n\
                 \"network.groups.context.units\" = { from = 1, to = 100, count = 100 }\n";
    let place = Place::new(SINE, sweep);
    let begun = Instant::now();
    let (out, _) = place.ends(0, "sweep s.toml --dry-run");
    let planned = begun.elapsed();
    assert_eq!(out.lines().count(), 10_001);
    assert!(
        out.contains("units=100,rate=0.1  x 1\n10000 networks of 10000 settings, into runs/s\n"),
        "{}",
        &out[out.len() - 200..]
    );
    assert!(!place.path("runs").exists(), "a dry run leaves nothing behind");
    // A sweep that is finished, without the time that it takes.
    fs::create_dir_all(place.path("runs/s")).unwrap();
    let plan = place.ends(0, "sweep s.toml --dry-run --json").0;
    fs::write(place.path("runs/s/plan.json"), plan).unwrap();
    for run in place.runs("runs/s") {
        let folder = place.path("runs/s").join(run);
        fs::create_dir_all(&folder).unwrap();
        fs::write(
            folder.join("outcome.json"),
            "{\"format\":1,\"outcome\":\"finished\",\"decided_by\":\"\",\"measures\":{\"nll\":1.0}}",
        )
        .unwrap();
    }
    let begun = Instant::now();
    let status = place.json("sweep runs/s --status --json");
    let looked = begun.elapsed();
    assert_eq!(status["finished"].as_u64(), Some(10_000));
    // Goals of an optimised program on a machine of its own: 2 s and 1 s. Here others compute as well.
    let slow = if cfg!(debug_assertions) { 10 } else { 1 };
    assert!(
        planned < slow * Duration::from_secs(2) && looked < slow * Duration::from_secs(1),
        "{planned:?} {looked:?}"
    );
}

#[test]
fn a_sweep_that_is_wrong_is_refused_before_anything_is_trained() {
    let place = Place::new(SINE, "[grid]\n\"training.adam.rat\" = [1e-3]\n");
    let err = place.ends(2, "sweep s.toml").1;
    assert!(err.contains("did you mean `rate`") && !place.path("runs").exists(), "{err}");
    let err = place.ends(2, "sweep sine.toml").1;
    assert!(err.contains("is an experiment file"), "{err}");
    fs::create_dir(place.path("empty")).unwrap();
    let err = place.ends(2, "sweep empty --status").1;
    assert!(err.contains("is a folder, not a sweep file"), "{err}");
    let err = place.ends(2, "sweep s.toml --shard 3/2").1;
    assert!(err.contains("give it as 2/4"), "{err}");
}
