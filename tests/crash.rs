//! Faults: the program killed at any moment, a full or read-only disk, a folder that vanishes, two processes on one run.
//!
//! What must hold after each: the last good checkpoint is there, the run goes on to the bits of one that nothing happened to,
//! the message says what to do, and the exit code which kind of fault it was.
//!
//! SCRNN_CRASH_RUNS says how many trainings are killed; docs/reliability.md has a record of 200.

#![cfg(unix)]

#[path = "crash/endings.rs"]
mod endings;
#[path = "crash/outputs.rs"]
mod outputs;
#[path = "crash/terminals.rs"]
mod terminals;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const SCRNN: &str = env!("CARGO_BIN_EXE_scrnn");

/// A small sine wave, saved often.
const SINE: &str = r#"
name = "sine"
[data]
task = "sinusoid"
steps = 60
[[network.groups]]
name = "context"
units = 6
time_constant = 2.0
[training]
epochs = 1500
optimiser = "momentum"
[training.momentum]
rate = 1e-3
[output]
checkpoint_every = 25
"#;

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

/// A folder with the experiment in it.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Self::with(SINE)
    }

    fn with(experiment: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("sine.toml"), experiment).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(SCRNN);
        command.current_dir(&self.0).args(line.split_whitespace());
        command
    }

    fn run(&self, line: &str) -> Output {
        self.command(line).output().unwrap()
    }

    fn ok(&self, line: &str) {
        let output = self.run(line);
        assert!(output.status.success(), "scrnn {line}\n{}", text(&output.stderr));
    }

    fn start(&self, line: &str) -> Child {
        self.command(line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Runs a shell script in a world of its own, where it may mount and set limits. Nothing where the system forbids that.
    fn in_own_world(&self, script: &str) -> Option<Output> {
        let possible = Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]).output();
        if !possible.is_ok_and(|output| output.status.success()) {
            let reason = std::env::var("SCRNN_SKIP_MOUNTS").unwrap_or_default();
            assert!(
                std::env::var_os("CI").is_none() || !reason.trim().is_empty(),
                "mount namespaces are not allowed here: full and read-only disks are not tested. \
                 Allow them (unshare -rm), or give the reason in SCRNN_SKIP_MOUNTS"
            );
            eprintln!("SKIPPED: mount namespaces are not allowed here. {reason}");
            return None;
        }
        let mut command = Command::new("unshare");
        command.args(["-rm", "sh", "-c", script]).current_dir(&self.0).env("SCRNN", SCRNN);
        Some(command.output().unwrap())
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A message without the line breaks of its rendering.
fn flat(bytes: &[u8]) -> String {
    text(bytes).replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// That both runs ended with the same networks, and their histories have the same rows but for the seconds.
fn same(place: &Place, a: &str, b: &str) {
    for name in ["checkpoint.safetensors", "best.safetensors"] {
        let [a, b] = [a, b].map(|run| fs::read(place.path(run).join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    let rows = |run: &str| -> Vec<String> {
        let history = fs::read_to_string(place.path(run).join("history.csv")).unwrap();
        let without_seconds = |line: &str| {
            let mut fields: Vec<&str> = line.split(',').collect();
            fields.remove(6);
            fields.join(",")
        };
        history.lines().map(without_seconds).collect()
    };
    assert_eq!(rows(a), rows(b));
}

/// Nothing but what belongs there.
fn tidy(run: &Path) {
    let mut names: Vec<_> = fs::read_dir(run).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["best.safetensors", "checkpoint.safetensors", "experiment.toml", "history.csv", "lock"]);
}

#[test]
fn trainings_that_are_killed_at_random_moments_come_to_the_undisturbed_bits() {
    let runs: u64 = std::env::var("SCRNN_CRASH_RUNS").map_or(6, |runs| runs.parse().unwrap());
    let place = Place::new();
    let (mut kills, mut early) = (0, 0);
    for seed in 1..=runs {
        let mut dice = Dice(seed);
        // Both rules, one of them with a rate that needs the guard.
        let change = ["", "--set training.momentum.rate=0.3", "--set training.optimiser=adam"][seed as usize % 3];
        let options = format!("--seed {seed} --threads 1 {change}");
        let begun = Instant::now();
        place.ok(&format!("train sine.toml --out whole --overwrite {options}"));
        let whole = begun.elapsed().as_micros() as u64;
        // On a busy machine the next training may be over before the first kill: then again, with a quicker hand.
        let mut longest = whole / 2 + 2000;
        loop {
            let _ = fs::remove_dir_all(place.path("cut"));
            let killed = cut(&place, &options, &mut dice, longest);
            kills += killed.0;
            early += killed.1;
            if killed.0 > 0 {
                break;
            }
            assert!(longest > 100, "seed {seed}: no kill came before the end");
            longest /= 2;
        }
        same(&place, "whole", "cut");
        tidy(&place.path("cut"));
    }
    println!("{runs} trainings, {kills} kills, {early} of them before the first checkpoint");
}

/// A training that is killed and resumed until it comes to its end. Kills, and those before the first checkpoint.
fn cut(place: &Place, options: &str, dice: &mut Dice, longest: u64) -> (u64, u64) {
    let (mut kills, mut early) = (0, 0);
    for attempt in 0..40 {
        let mut child = place.start(&format!("train sine.toml --out cut --resume {options}"));
        // From before the first file is there to about the end; at last it gets the time it needs.
        let pause = if attempt < 39 { dice.below(longest) } else { 60_000_000 };
        let until = Instant::now() + Duration::from_micros(pause);
        while Instant::now() < until && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_micros(200));
        }
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{options}: {}", flat(&child.wait_with_output().unwrap().stderr));
            return (kills, early);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        early += u64::from(!place.path("cut/checkpoint.safetensors").exists());
    }
    panic!("{options}: never came to its end");
}

#[test]
fn a_full_disk_keeps_the_last_checkpoint_and_says_so() {
    let place = Place::new();
    place.ok("train sine.toml --out whole --set output.history_every=1");
    fs::create_dir(place.path("small")).unwrap();
    // Room for a few checkpoints and some of the history, which has 1500 rows here.
    let script = "mount -t tmpfs -o size=80k tmpfs small && cd small && \
        $SCRNN train ../sine.toml --out run --set output.history_every=1 2>../err; echo $? >../code; \
        $SCRNN inspect run --json >../seen; rm -rf ../rescued; cp -r run ../rescued";
    let Some(output) = place.in_own_world(script) else { return };
    assert!(output.status.success(), "{}", flat(&output.stderr));
    let told = flat(&fs::read(place.path("err")).unwrap());
    assert_eq!(fs::read_to_string(place.path("code")).unwrap().trim(), "4", "{told}");
    assert!(told.contains("No space left") && told.contains("make room on the disk"), "{told}");
    assert!(told.contains("is the last that is saved") && told.contains("scrnn train run --resume"), "{told}");
    let seen: serde_json::Value = serde_json::from_slice(&fs::read(place.path("seen")).unwrap()).unwrap();
    let epoch = seen["epoch"].as_u64().unwrap();
    assert!(epoch > 0 && epoch < 1500 && epoch.is_multiple_of(25), "{epoch}");
    assert!(told.contains(&format!("epoch {epoch} is the last")), "{told}");
    // With room it goes on to the same bits.
    place.ok("train sine.toml --out rescued --resume --set output.history_every=1");
    same(&place, "whole", "rescued");
    tidy(&place.path("rescued"));
}

#[test]
fn a_limit_on_the_size_of_files_is_told_from_a_full_disk() {
    let place = Place::new();
    place.ok("train sine.toml --out whole");
    // Blocks of 512 bytes: less than a checkpoint has.
    let script = format!("trap '' XFSZ; ulimit -f 8; exec {SCRNN} train sine.toml --out run --resume");
    fs::create_dir(place.path("run")).unwrap();
    let output = Command::new("sh").args(["-c", &script]).current_dir(&place.0).output().unwrap();
    let told = flat(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("cannot write run/checkpoint.safetensors") && told.contains("ulimit -f"), "{told}");
    // A signal ends it in the middle of the write: what it left half-written is swept away.
    let script = format!("ulimit -f 8; exec {SCRNN} train sine.toml --out run --resume");
    let output = Command::new("sh").args(["-c", &script]).current_dir(&place.0).output().unwrap();
    assert_eq!(output.status.code(), None, "{}", flat(&output.stderr));
    place.ok("train sine.toml --out run --resume");
    same(&place, "whole", "run");
    tidy(&place.path("run"));
}

#[test]
fn a_read_only_folder_is_refused_before_anything_is_trained() {
    let place = Place::new();
    place.ok("train sine.toml --out run --epochs 50");
    let before = fs::read(place.path("run/checkpoint.safetensors")).unwrap();
    let script = "mount --bind run run && mount -o remount,bind,ro run && \
        $SCRNN train sine.toml --out run --resume 2>err; echo $? >code; $SCRNN report run 2>err-report; echo $? >code-report";
    if let Some(output) = place.in_own_world(script) {
        assert!(output.status.success(), "{}", flat(&output.stderr));
        for (err, code) in [("err", "code"), ("err-report", "code-report")] {
            let told = flat(&fs::read(place.path(err)).unwrap());
            assert_eq!(fs::read_to_string(place.path(code)).unwrap().trim(), "4", "{told}");
            assert!(told.contains("Read-only file system") && told.contains("choose another folder"), "{told}");
        }
        assert!(before == fs::read(place.path("run/checkpoint.safetensors")).unwrap());
    }
    // A file where a folder should be is refused by every system, and for every user.
    let output = place.run("train sine.toml --out sine.toml/run");
    let told = flat(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("part of the path is a file"), "{told}");
    place.ok("train sine.toml --out run --resume");
}

#[test]
fn a_folder_that_vanishes_ends_the_training_with_a_word() {
    let place = Place::with(&SINE.replace("epochs = 1500", "epochs = 100000000"));
    let child = place.start("train sine.toml --out run");
    let begun = Instant::now();
    while !place.path("run/best.safetensors").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(1));
    }
    // The training may put a file back while the folder is emptied.
    while place.path("run").exists() {
        let _ = fs::remove_dir_all(place.path("run"));
    }
    let output = child.wait_with_output().unwrap();
    let told = flat(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("cannot write run/") && told.contains("the folder is still there"), "{told}");
    assert!(!place.path("run").exists());
}

#[test]
fn a_write_that_was_interrupted_leaves_nothing_behind() {
    let place = Place::new();
    place.ok("train sine.toml --out whole");
    place.ok("train sine.toml --out cut --epochs 700");
    let run = place.path("cut");
    let checkpoint = fs::read(run.join("checkpoint.safetensors")).unwrap();
    fs::write(run.join(".half-written-abc"), &checkpoint[..checkpoint.len() / 3]).unwrap();
    let history = fs::read_to_string(run.join("history.csv")).unwrap();
    fs::write(run.join("history.csv"), &history[..history.len() - 20]).unwrap();
    // The best network may be newer than the checkpoint, older, damaged or gone: it is found anew.
    fs::write(run.join("best.safetensors"), &checkpoint[..100]).unwrap();
    place.ok("train sine.toml --out cut --resume");
    same_networks(&place, "whole", "cut");
    tidy(&run);
}

/// As [`same`], where the history lost a row.
fn same_networks(place: &Place, a: &str, b: &str) {
    for name in ["checkpoint.safetensors", "best.safetensors"] {
        let [a, b] = [a, b].map(|run| fs::read(place.path(run).join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
}

#[test]
fn of_eight_processes_on_one_folder_one_trains_and_seven_are_refused() {
    let place = Place::with(&SINE.replace("epochs = 1500", "epochs = 100000000"));
    let mut children: Vec<Child> =
        (0..8).map(|_| place.start("train sine.toml --out run --resume --threads 1")).collect();
    let begun = Instant::now();
    let mut refused = 0;
    while refused < 7 {
        assert!(begun.elapsed() < Duration::from_secs(60), "only {refused} were refused");
        let mut running = Vec::new();
        for mut child in children {
            if let Some(status) = child.try_wait().unwrap() {
                let told = flat(&child.wait_with_output().unwrap().stderr);
                assert_eq!(status.code(), Some(5), "{told}");
                assert!(told.contains("another process is training in run") && told.contains("--out"), "{told}");
                refused += 1;
            } else {
                running.push(child);
            }
        }
        children = running;
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut last = children.pop().unwrap();
    assert!(children.is_empty());
    last.kill().unwrap();
    last.wait().unwrap();
    // The lock goes with the process, however it ended.
    fs::write(place.path("sine.toml"), SINE).unwrap();
    place.ok("train sine.toml --out run --overwrite --epochs 10");
}
