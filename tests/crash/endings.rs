//! Streams that nobody reads or that are full, and signals: what a training does about them.

use std::fs::{self, File};
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::{Place, SCRNN, SINE, flat, same, text};

/// Something that cannot be written to.
fn full() -> File {
    File::options().write(true).open("/dev/full").unwrap()
}

#[test]
fn a_training_whose_stderr_is_a_closed_pipe_or_a_full_disk_comes_to_the_same_bits() {
    let place = Place::new();
    place.ok("train sine.toml --out whole");
    let mut child = place.start("train sine.toml --out closed");
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    same(&place, "whole", "closed");
    let status = place.command("train sine.toml --out full").stdout(Stdio::null()).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    same(&place, "whole", "full");
    // An error keeps its code, also where nobody can be told.
    for line in ["train none.toml", "train sine.toml --out whole", "train --nonsense"] {
        let told = place.run(line).status.code();
        assert_eq!(place.command(line).stderr(full()).status().unwrap().code(), told, "{line}");
    }
}

/// A pipe that is full, and that nobody reads: what is said waits, the training does not.
#[test]
fn a_training_whose_stderr_nobody_reads_comes_to_the_same_bits() {
    let place = Place::new();
    place.ok("train sine.toml --out whole");
    let (reader, writer) = std::io::pipe().unwrap();
    let mut filling = writer.try_clone().unwrap();
    let filler = std::thread::spawn(move || while filling.write_all(&[b'x'; 4096]).is_ok() {});
    std::thread::sleep(Duration::from_millis(300));
    for (line, code) in [("train sine.toml --out run", 0), ("train none.toml", 4), ("train --nonsense", 2)] {
        let mut command = place.command(line);
        let mut child = command.stdout(Stdio::null()).stderr(writer.try_clone().unwrap()).spawn().unwrap();
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if begun.elapsed() > Duration::from_secs(60) {
                child.kill().unwrap();
                panic!("{line} waits for whoever reads its stderr");
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        assert_eq!(status.code(), Some(code), "{line}");
    }
    same(&place, "whole", "run");
    drop((reader, writer));
    filler.join().unwrap();
}

#[test]
fn results_that_cannot_be_written_have_a_code_of_their_own_and_the_state_is_saved() {
    let place = Place::new();
    place.ok("train sine.toml --out whole");
    let output = place.command("train sine.toml --out run").stdout(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", flat(&output.stderr));
    assert!(flat(&output.stderr).contains("cannot write the results to stdout"), "{}", flat(&output.stderr));
    same(&place, "whole", "run");
    for line in ["--help", "--version", "schema", "inspect whole", "completions bash", "generate whole"] {
        assert_eq!(place.command(line).stdout(full()).output().unwrap().status.code(), Some(6), "{line}");
        // A reader that has seen enough is no fault.
        let mut child = place.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{line}");
    }
}

/// A training that goes on until it is told to end, and has saved something.
fn endless(script: &str) -> (Place, Child) {
    let place = Place::with(&SINE.replace("epochs = 1500", "epochs = 100000000"));
    // Whoever started the tests may ignore signals, as `nohup` does.
    let listening = if cfg!(target_os = "linux") && script.is_empty() { "env --default-signal" } else { "" };
    let script = format!("{script} exec {listening} {SCRNN} train sine.toml --out run --threads 1");
    let mut command = Command::new("sh");
    command.args(["-c", &script]).current_dir(&place.0).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    let begun = Instant::now();
    while !place.path("run/checkpoint.safetensors").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    }
    (place, child)
}

/// Sends a signal, by its name, as a shell does.
pub fn send(child: &Child, signal: &str) {
    let status = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status().unwrap();
    assert!(status.success(), "{signal}");
}

#[test]
fn each_signal_that_asks_to_end_saves_and_has_its_code() {
    for (signal, code) in [("HUP", 129), ("INT", 130), ("USR1", 138), ("TERM", 143), ("XCPU", 152)] {
        let (place, child) = endless("");
        send(&child, signal);
        if !["INT", "TERM"].contains(&signal) {
            // The system or the shell may send it again before the epoch is over.
            let _ = Command::new("sh").args(["-c", &format!("kill -{signal} {} 2>/dev/null", child.id())]).status();
        }
        let output = child.wait_with_output().unwrap();
        let told = flat(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{signal}: {told}");
        let seen: serde_json::Value = serde_json::from_slice(&place.run("inspect run --json").stdout).unwrap();
        assert!(told.contains(&format!("interrupted: epoch {} is saved", seen["epoch"])), "{signal}: {told}");
    }
}

#[test]
fn signals_that_the_parent_ignores_stay_ignored() {
    let (place, mut child) = endless("trap '' HUP INT USR1;");
    for signal in ["HUP", "INT", "USR1", "HUP", "INT"] {
        send(&child, signal);
    }
    let saved = || fs::metadata(place.path("run/checkpoint.safetensors")).and_then(|file| file.modified()).unwrap();
    let (before, begun) = (saved(), Instant::now());
    while begun.elapsed() < Duration::from_millis(500) || saved() == before {
        assert!(child.try_wait().unwrap().is_none() && begun.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(10));
    }
    send(&child, "TERM");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", flat(&output.stderr));
}
