//! What is wrong is shown at its place, with what to do, and ends with the documented exit code.

use crate::{Place, SINE};

/// The line that is shown must be followed by one with a mark under it.
fn marks(err: &str, line: &str) {
    let mut lines = err.lines().skip_while(|shown| !shown.trim_end().ends_with(line));
    assert!(lines.next().is_some(), "`{line}` is not shown in\n{err}");
    let below = lines.next().unwrap_or_default();
    // A bracket, a tick under a single character, an arrow between two; plain carets where there is no Unicode.
    assert!(below.contains(['\u{2500}', '\u{252c}', '\u{25b2}', '^']), "no mark in\n{err}");
}

#[test]
fn an_unknown_key_is_shown_with_near_names() {
    let place = Place::with(&SINE.replace("time_constant", "time_konstant"));
    let (err, told) = place.fails(2, "train sine.toml");
    marks(&err, "time_konstant = 2.0");
    assert!(told.contains("did you mean `time_constant`?"), "{told}");
    assert!(!place.path("runs").exists());
}

#[test]
fn a_value_out_of_range_is_shown_with_what_is_needed() {
    for (from, to, needed) in [
        ("time_constant = 2.0", "time_constant = 0.5", "at least 1"),
        ("units = 6", "units = 0", "1 to 1e6 units"),
        ("rate = 1e-3", "rate = -1e-3", "a number above 0"),
        ("checkpoint_every = 10", "checkpoint_every = 0", "at least 1 epoch"),
        ("name = \"sine\"", "name = \"a/b\"", "a folder can have"),
    ] {
        let place = Place::with(&SINE.replace(from, to));
        let (err, told) = place.fails(2, "train sine.toml");
        marks(&err, to);
        assert!(told.contains(needed), "{told}");
    }
}

#[test]
fn broken_toml_and_wrong_types_are_shown() {
    for (from, to, shown) in [
        ("units = 6", "units = ", "units ="),
        ("units = 6", "units = \"six\"", "units = \"six\""),
        ("optimiser = \"momentum\"", "optimiser = \"momentun\"", "optimiser = \"momentun\""),
        ("steps = 80", "scaling = \"fitted\"", "scaling = \"fitted\""),
    ] {
        let place = Place::with(&SINE.replace(from, to));
        let (err, _) = place.fails(2, "train sine.toml");
        marks(&err, shown);
    }
}

#[test]
fn data_must_come_from_one_place() {
    let place = Place::with(&SINE.replace("steps = 80", "files = [\"a.csv\"]"));
    let (_, told) = place.fails(2, "train sine.toml");
    assert!(told.contains("both `task` and `files`"), "{told}");
    place.write("sine.toml", SINE.replace("task = \"sinusoid\"\nsteps = 80\n", ""));
    let (err, told) = place.fails(2, "train sine.toml");
    marks(&err, "[data]");
    assert!(told.contains("files = [\"mine.csv\"]"), "{told}");
}

#[test]
fn a_wrong_override_is_shown_on_the_command_line() {
    let place = Place::with(SINE);
    for (option, needed) in [
        ("--set training.momentum.rat=1", "did you mean `rate`?"),
        ("--set training.momentum.rate=fast", "invalid type: string \"fast\""),
        ("--set training.momentum.rate=0", "a number above 0"),
        ("--set network.groups.slow.units=3", "there are `context`"),
        ("--set training.adam.rate=0.1", "no effect"),
    ] {
        let (err, told) = place.fails(2, &format!("train sine.toml {option}"));
        marks(&err, option);
        assert!(told.contains(needed), "{told}");
    }
    let (_, told) = place.fails(2, "train sine.toml --set training.epochs");
    assert!(told.contains("no `=`"), "{told}");
}

#[test]
fn a_bad_line_of_data_is_shown() {
    let place = Place::with(&SINE.replace("task = \"sinusoid\"\nsteps = 80", "files = [\"bad.csv\"]"));
    place.write("bad.csv", "a,b\n1,2\n3,oops\n");
    let (err, told) = place.fails(2, "train sine.toml");
    marks(&err, "3,oops");
    assert!(told.contains("bad.csv, line 3"), "{told}");
    place.write("bad.csv", "a,b\n1,2\n3,NaN\n4,5\n");
    let (err, told) = place.fails(2, "train sine.toml --set data.missing=refuse");
    marks(&err, "3,NaN");
    assert!(told.contains("sequence 1, step 2, channel b"), "{told}");
}

#[test]
fn sequences_shorter_than_the_delay_are_named_from_one() {
    let place = Place::with(&SINE.replace("[[network.groups]]", "[network]\ndelay = 3\n[[network.groups]]"));
    place.write("short.csv", "sequence,y\na,1\na,2\na,3\na,4\nb,1\nb,2\nb,3\n");
    let text = place.text("sine.toml").replace("task = \"sinusoid\"\nsteps = 80", "files = [\"short.csv\"]");
    place.write("sine.toml", text);
    let (_, told) = place.fails(2, "train sine.toml");
    assert!(told.contains("sequence 2 has 3 samples"), "{told}");
}

#[test]
fn files_that_cannot_be_read_or_written_end_with_four() {
    let place = Place::with(SINE);
    let (_, told) = place.fails(4, "train none.toml");
    assert!(told.contains("cannot read none.toml"), "{told}");
    place.write("file", "");
    place.fails(4, "train sine.toml --out file/run");
    place.fails(4, "inspect none.csv");
    place.fails(4, "data sinusoid --out none/sine.csv");
}

#[test]
fn wrong_arguments_end_with_two() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --epochs 1 --out run");
    place.ok("data sinusoid --steps 20 --out s.csv");
    place.ok("data lissajous --steps 20 --sequences 2 --out two.csv");
    for (line, needed) in [
        ("train sine.toml --out r --instruction-set mmx", "available"),
        ("train run", "--resume"),
        ("train run --resume --out other", "--out"),
        ("generate run --sequence 2", "the network learned 1"),
        ("generate run --sequence 1 --mean", "cannot be used with"),
        ("generate run --mode mixed --mixing 1.5", "from 0 to 1"),
        ("generate run --open-channels z", "the channels are y"),
        ("generate run --initial-state s.csv", "6 context units"),
        ("generate run --mode open --data two.csv", "2 (y1, y2)"),
        ("generate sine.toml", "not a checkpoint"),
        ("generate .", "holds no checkpoint.safetensors"),
        ("recognize run two.csv", "2 (y1, y2)"),
        ("recognize run s.csv --observed 1", "at least 2 samples"),
        ("recognize run s.csv --completed c.csv", "--observed"),
        ("inspect sine.toml", ".npz"),
        ("data circle", "lissajous"),
        ("data lissajous --sequences 13", "12"),
    ] {
        let (_, told) = place.fails(2, line);
        assert!(told.contains(needed), "{line}: {told}");
    }
}

#[test]
fn a_damaged_checkpoint_is_no_reason_to_panic() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --epochs 1 --out run");
    let whole = place.read("run/checkpoint.safetensors");
    place.write("run/checkpoint.safetensors", &whole[..whole.len() / 2]);
    for line in ["generate run", "inspect run", "train run --resume"] {
        let (_, told) = place.fails(2, line);
        assert!(told.contains("not a checkpoint that this version reads"), "{line}: {told}");
    }
}
