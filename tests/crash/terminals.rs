//! Terminals that go away, second wishes to end, and a night with everything at once.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::{Place, SCRNN, SINE, flat, same, text, tidy};

/// Waits until something holds.
fn until(what: &str, holds: impl Fn() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A training on a terminal of its own, which `script` keeps. The shell that leads the terminal does `trap` when it is hung up,
/// and writes the training's exit code to a file.
fn on_a_terminal(place: &Place, trap: &str, arguments: &str) -> Child {
    let line = format!(
        "trap '' HUP; {} {SCRNN} {arguments} --threads 1 & pid=$!; trap '{trap}' HUP; wait $pid; code=$?; \
         while kill -0 $pid 2>/dev/null; do wait $pid; code=$?; done; echo $code > code",
        if trap.is_empty() { "" } else { "env --default-signal=HUP" }
    );
    // A shell cannot trap what its parent ignores, as under `nohup`.
    let mut command = Command::new("env");
    command
        .args(["--default-signal=HUP", "script", "-q", "-e", "-f", "-c", &line, "/dev/null"])
        .current_dir(&place.0)
        .env("SHELL", "/bin/sh");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills what keeps the terminal, and says what had been shown on it.
fn hang_up(mut script: Child) -> String {
    let out = script.stdout.take().unwrap();
    let shown = std::thread::spawn(move || {
        let mut all = String::new();
        for line in BufReader::new(out).split(b'\r').map_while(Result::ok) {
            all += &String::from_utf8_lossy(&line);
        }
        all
    });
    script.kill().unwrap();
    script.wait().unwrap();
    shown.join().unwrap()
}

#[test]
fn a_terminal_that_goes_away_ends_a_training_with_its_state_saved() {
    let place = Place::new();
    place.ok("train sine.toml --out whole --threads 1");
    fs::write(place.path("sine.toml"), SINE.replace("epochs = 1500", "epochs = 100000000")).unwrap();
    let script = on_a_terminal(&place, "kill -HUP $pid", "train sine.toml --out run");
    until("no checkpoint", || place.path("run/checkpoint.safetensors").exists());
    std::thread::sleep(Duration::from_millis(300));
    let shown = hang_up(script);
    assert!(shown.contains("epochs/s"), "the bar of a terminal: {shown:?}");
    until("no exit code", || fs::read_to_string(place.path("code")).is_ok_and(|code| code.ends_with('\n')));
    assert_eq!(fs::read_to_string(place.path("code")).unwrap().trim(), "129");
    let seen: serde_json::Value = serde_json::from_slice(&place.run("inspect run --json").stdout).unwrap();
    let epoch = seen["epoch"].as_u64().unwrap();
    let history = fs::read_to_string(place.path("run/history.csv")).unwrap();
    assert!(epoch > 0 && history.ends_with('\n'), "{epoch}");
    tidy(&place.path("run"));
    // It goes on from there, to the bits of one that had no terminal.
    fs::write(place.path("sine.toml"), SINE.replace("epochs = 1500", &format!("epochs = {}", epoch + 200))).unwrap();
    place.ok("train sine.toml --out run --resume --threads 1 --set output.history_every=1000");
    place.ok("train sine.toml --out again --threads 1 --set output.history_every=1000");
    for name in ["checkpoint.safetensors", "best.safetensors"] {
        let [a, b] = ["run", "again"].map(|run| fs::read(place.path(run).join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
}

#[test]
fn a_training_whose_hang_up_is_ignored_goes_on_without_its_terminal() {
    let place = Place::new();
    place.ok("train sine.toml --out whole --threads 1 --epochs 20000");
    let script = on_a_terminal(&place, "", "train sine.toml --out run --epochs 20000");
    until("no checkpoint", || place.path("run/checkpoint.safetensors").exists());
    hang_up(script);
    assert!(!place.path("code").exists(), "the terminal went away after the training");
    until("no exit code", || fs::read_to_string(place.path("code")).is_ok_and(|code| code.ends_with('\n')));
    // The result had nowhere to go; the files are whole.
    assert_eq!(fs::read_to_string(place.path("code")).unwrap().trim(), "6");
    same(&place, "whole", "run");
    tidy(&place.path("run"));
}

/// Epochs of a second and more, so that the first wish is still waiting when the second comes.
const SLOW: &str = r#"
name = "slow"
[data]
task = "sinusoid"
steps = 60000
[[network.groups]]
name = "context"
units = 80
time_constant = 2.0
[training]
epochs = 3
optimiser = "momentum"
"#;

#[test]
fn a_second_ctrl_c_ends_at_once_and_what_was_saved_remains() {
    let place = Place::with(SLOW);
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let mut command = Command::new("env");
        command.args(["--default-signal", SCRNN, "train", "sine.toml", "--out", signal, "--threads", "1"]);
        let mut child = command.current_dir(&place.0).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        until("no checkpoint", || place.path(signal).join("checkpoint.safetensors").exists());
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        super::endings::send(&child, signal);
        assert!(lines.any(|line| line.contains("once more ends at once")), "{signal}: the first wish was not heard");
        let begun = Instant::now();
        super::endings::send(&child, signal);
        assert_eq!(child.wait().unwrap().code(), Some(code), "{signal}");
        assert!(begun.elapsed() < Duration::from_millis(500), "{signal}: {:?}", begun.elapsed());
        assert!(!lines.any(|line| line.contains("is saved")), "{signal}: the epoch was over before the second wish");
        let seen: serde_json::Value =
            serde_json::from_slice(&place.run(&format!("inspect {signal} --json")).stdout).unwrap();
        assert_eq!(seen["epoch"].as_u64(), Some(0), "{signal}");
    }
}

/// Half a minute of training (`SCRNN_NIGHT_SECONDS` says otherwise, e.g. 600) under nohup, its stderr on a disk that fills, hung up,
/// killed without warning, gone on with: the undisturbed bits.
#[test]
fn a_night_of_hang_ups_full_disks_and_kills_ends_in_the_undisturbed_bits() {
    let seconds: u64 = std::env::var("SCRNN_NIGHT_SECONDS").map_or(30, |seconds| seconds.parse().unwrap());
    let place = Place::with(&SINE.replace("checkpoint_every = 25", "checkpoint_seconds = 1.0\nhistory_every = 500"));
    // How many epochs take so long.
    let begun = Instant::now();
    place.ok("train sine.toml --out trial --threads 1 --epochs 20000");
    let epochs = (20_000.0 / begun.elapsed().as_secs_f64() * seconds as f64) as u64;
    let train = format!("train sine.toml --threads 1 --epochs {epochs} --out");
    let undisturbed = Instant::now();
    place.ok(&format!("{train} whole"));
    let undisturbed = undisturbed.elapsed();
    // Three times: nohup, with stderr on a disk that has room for a page of it, hung up twice a second; at a quarter, a half and three quarters of the epochs kill -9.
    fs::create_dir(place.path("small")).unwrap();
    let script = format!(
        "mount -t tmpfs -o size=16k tmpfs small && head -c 12288 /dev/zero > small/full; \
         for part in 1 2 3; do \
           nohup $SCRNN {train} run --resume > out 2>> small/err & pid=$!; epoch=0; \
           while [ $epoch -lt $(({epochs} * part / 4)) ] && kill -0 $pid; do \
             sleep 0.5; kill -HUP $pid && echo \"hung up $part\" >> log; \
             epoch=$(tail -n 1 run/history.csv | cut -d, -f1 | grep '^[0-9]*$' || echo 0); \
           done; \
           kill -9 $pid && echo \"killed $part at $epoch\" >> log; wait $pid; echo \"code $?\" >> log; \
         done; \
         nohup $SCRNN {train} run --resume > out 2>> small/err; echo \"code $?\" >> log; cat small/err > said"
    );
    let Some(output) = place.in_own_world(&script) else { return };
    let told = fs::read_to_string(place.path("log")).unwrap_or_default();
    assert!(output.status.success(), "{}\n{told}", flat(&output.stderr));
    assert!((1..=3).all(|part| told.contains(&format!("hung up {part}"))), "{told}");
    assert_eq!(told.matches("killed").count(), 3, "{told}");
    assert_eq!(told.matches("code 137").count(), 3, "{told}");
    assert!(told.ends_with("code 0\n"), "{told}");
    // Progress comes every five seconds: what it has to say in eight minutes is more than the disk takes.
    let said = fs::read(place.path("said")).unwrap();
    assert!(said.len() <= 4096 && (said.len() == 4096 || seconds < 480), "{} bytes: {}", said.len(), text(&said));
    same(&place, "whole", "run");
    tidy(&place.path("run"));
    println!("{epochs} epochs, {undisturbed:?} undisturbed, {} bytes of stderr\n{told}", said.len());
}
