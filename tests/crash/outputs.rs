//! Where outputs go: through links and into devices, never over each other or over an input.

use std::fs;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};

use super::{Place, SINE, flat, text};

#[test]
fn outputs_keep_links_modes_and_special_files() {
    let place = Place::new();
    place.ok("data sinusoid --steps 20 --out real.csv -q");
    let expected = fs::read(place.path("real.csv")).unwrap();
    fs::set_permissions(place.path("real.csv"), PermissionsExt::from_mode(0o600)).unwrap();
    symlink("real.csv", place.path("link.csv")).unwrap();
    place.ok("data sinusoid --steps 20 --seed 2 --out link.csv --truth t.csv -q");
    assert!(place.path("link.csv").is_symlink() && fs::read(place.path("real.csv")).unwrap() != expected);
    assert_eq!(fs::metadata(place.path("real.csv")).unwrap().permissions().mode() & 0o777, 0o600);
    let fifo = place.path("fifo.csv");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let reader = std::thread::spawn({
        let fifo = fifo.clone();
        move || fs::read(fifo).unwrap()
    });
    place.ok("data sinusoid --steps 20 --out fifo.csv --truth t.csv -q");
    assert_eq!(reader.join().unwrap(), expected);
    assert!(fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());
}

#[test]
fn two_outputs_or_an_output_and_an_input_that_are_one_file_are_refused() {
    let place = Place::new();
    place.ok("train sine.toml --out run --epochs 20");
    place.ok("data sinusoid --steps 60 --out new.csv -q");
    symlink("new.csv", place.path("link.csv")).unwrap();
    fs::create_dir(place.path("demos")).unwrap();
    fs::copy(place.path("new.csv"), place.path("demos/one.csv")).unwrap();
    let before = fs::read(place.path("new.csv")).unwrap();
    for line in [
        "data sinusoid --out a.csv --truth a.csv",
        "data sinusoid --out a.csv --truth ./a.csv",
        "recognize run new.csv --out new.csv",
        "recognize run new.csv --online --out link.csv",
        "recognize run new.csv --observed 40 --completed b.csv --out b.csv",
        "generate run --mode open --data new.csv --out link.csv",
        "recognize run demos --out demos/one.csv",
        "recognize run demos/o*.csv --out demos/one.csv",
        "simulate reach run --mcap run/checkpoint.safetensors",
        "generate run --out run/history.csv",
        "recognize run/best.safetensors new.csv --out run/../new.csv",
    ] {
        let output = place.run(line);
        assert_eq!(output.status.code(), Some(5), "{line}: {}", flat(&output.stderr));
        assert!(flat(&output.stderr).contains("are one file"), "{line}: {}", flat(&output.stderr));
    }
    assert!(before == fs::read(place.path("new.csv")).unwrap() && !place.path("a.csv").exists());
    assert!(before == fs::read(place.path("demos/one.csv")).unwrap());
    // A training whose data lie where it would write.
    let data = SINE.replace("task = \"sinusoid\"\nsteps = 60", "files = [\"own/history.csv\"]");
    fs::write(place.path("own.toml"), data).unwrap();
    fs::create_dir(place.path("own")).unwrap();
    fs::copy(place.path("new.csv"), place.path("own/history.csv")).unwrap();
    let output = place.run("train own.toml --out own --overwrite");
    assert_eq!(output.status.code(), Some(5), "{}", flat(&output.stderr));
    assert!(flat(&output.stderr).contains("would write its history.csv over the data"), "{}", flat(&output.stderr));
    assert!(before == fs::read(place.path("own/history.csv")).unwrap());
    place.ok("train own.toml --out other --epochs 5");
}

/// Nobody waits at a pipe that was put where a file belongs.
#[test]
fn pipes_in_the_place_of_files_are_refused_or_left_out() {
    let place = Place::new();
    place.ok("data sinusoid --steps 60 --out demos.csv -q");
    fs::create_dir(place.path("demos")).unwrap();
    fs::copy(place.path("demos.csv"), place.path("demos/a.csv")).unwrap();
    fs::create_dir(place.path("run")).unwrap();
    for name in ["demos/b.csv", "run/history.csv"] {
        assert!(std::process::Command::new("mkfifo").arg(place.path(name)).status().unwrap().success());
    }
    place.ok("inspect demos");
    place.ok("inspect demos/*.csv");
    let output = place.run("train sine.toml --out run");
    assert_eq!(output.status.code(), Some(5), "{}", flat(&output.stderr));
    assert!(flat(&output.stderr).contains("history.csv is no file"), "{}", flat(&output.stderr));
    // What has no end is left at a bound.
    for name in [
        "endless.csv",
        "endless.npy",
        "endless.npz",
        "endless.mcap",
        "endless.mat",
        "endless.safetensors",
        "endless.toml",
    ] {
        symlink("/dev/zero", place.path(name)).unwrap();
        let line = if name.ends_with("toml") { format!("train {name}") } else { format!("inspect {name}") };
        let output = place.run(&line);
        assert!(matches!(output.status.code(), Some(2 | 4)), "{line}: {}", flat(&output.stderr));
        let output = place.run(&format!("recognize {name} demos.csv"));
        assert!(matches!(output.status.code(), Some(2 | 4)), "{name}: {}", flat(&output.stderr));
    }
    // As is what has more bytes than the machine; a file of holes takes no room.
    let holes = fs::File::create(place.path("holes.csv")).unwrap();
    holes.set_len(1 << 43).unwrap();
    let output = place.run("inspect holes.csv");
    assert_eq!(output.status.code(), Some(2), "{}", flat(&output.stderr));
    assert!(flat(&output.stderr).contains("MB that this machine has"), "{}", flat(&output.stderr));
}

#[test]
fn names_with_control_characters_move_nothing_on_a_terminal() {
    let place = Place::new();
    fs::write(
        place.path("evil.csv"),
        "sequence,\"\u{1b}[31mred\u{1b}]0;pwn\u{7}\",\"=cmd|'/c calc'!A1\"\n1,0.5,2.5\n1,0.7,2.0\n",
    )
    .unwrap();
    let shown = place.run("inspect evil.csv");
    let seen = text(&shown.stdout);
    assert!(
        shown.status.success() && seen.contains("\\u{1b}[31mred") && !seen.contains(['\u{1b}', '\u{7}']),
        "{seen:?}"
    );
    let refused = place.run("inspect evil.csv --channels none");
    let seen = text(&refused.stderr);
    assert!(seen.contains("[31mred") && !seen.contains(['\u{1b}', '\u{7}']), "{seen:?}");
}
