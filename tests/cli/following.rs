//! A network beside samples that arrive: `recognize --online`, and `simulate interact` with what it learns from.

use assert_cmd::Command;
use serde_json::Value;

use super::{Place, SINE, numbers};

fn trained() -> Place {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run -q");
    place.ok("data sinusoid --steps 60 --seed 3 --out new.csv");
    place
}

#[test]
fn a_recorded_sequence_is_followed_sample_by_sample() {
    let place = trained();
    let line = "recognize run new.csv --online --window 8 --steps 5 --ahead 3 --at 1,30 --json";
    let found = place.json(line);
    let sequence = &found["sequences"][0];
    let steps = sequence["steps"].as_array().unwrap();
    assert_eq!((steps.len(), sequence["samples"].as_u64()), (60, Some(60)));
    // L-BFGS ends where there is less to gain than its tolerance; Adam makes all steps.
    let iterations = |step: &Value| step["iterations"].as_u64().unwrap();
    assert_eq!(iterations(&steps[0]), 0);
    assert!(steps[1..].iter().all(|step| (1..=5).contains(&iterations(step))), "{steps:?}");
    let by_adam = place.json(&format!("{line} --optimiser adam"));
    assert!(by_adam["sequences"][0]["steps"].as_array().unwrap()[1..].iter().all(|step| iterations(step) == 5));
    let gained =
        steps[1..].iter().map(|step| numbers(&step["ln_likelihood"])).filter(|pair| pair[1] >= pair[0]).count();
    assert!(gained > 40, "{gained} of 59");
    // Before xi samples there is no window; later it is as long as asked for, and so is the future.
    let first = &steps[0]["view"];
    assert_eq!((numbers(&first["smoothed"]).len(), numbers(&first["predicted"]).len()), (0, 4));
    let view = &steps[29]["view"];
    assert_eq!((view["from"].as_u64(), numbers(&view["smoothed"]).len()), (Some(23), 8));
    assert_eq!((numbers(&view["predicted"]).len(), numbers(&view["variance"]).len()), (4, 4));
    assert_eq!(numbers(&view["contexts"]).len(), 8 * 6);
    assert!(steps[10].get("view").is_none());
    let latency = &sequence["latency"];
    assert!(latency["median"].as_f64() <= latency["p99"].as_f64() && latency["missed"].is_null(), "{latency}");

    // The file has each sample as it was predicted and as it was smoothed.
    let table = place.ok("recognize run new.csv --online --window 8 --steps 5 --out followed.csv");
    assert!(table.starts_with("sequence  samples  ln L in the window"), "{table}");
    let text = place.text("followed.csv");
    assert!(text.starts_with("sequence,step,mean_y,variance_y,smoothed_y,context_context1"), "{text}");
    assert_eq!(text.lines().count(), 60);
    let again: Value = place.json(line);
    let without_times = |value: &Value| numbers(&value["sequences"][0]["steps"][29]["view"]["predicted"]);
    assert_eq!(without_times(&found), without_times(&again));
}

#[test]
fn a_stream_is_answered_line_by_line_with_what_a_file_gives() {
    let place = trained();
    let stream = |arguments: &str, input: &str| {
        let mut command = Command::cargo_bin("scrnn").unwrap();
        let arguments = arguments.split_whitespace();
        let output = command.current_dir(&place.0).args(arguments).write_stdin(input).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let samples = place.text("new.csv");
    let (code, out, told) = stream("recognize run - --online --window 8 --steps 5 --json --full", &samples);
    assert_eq!(code, Some(0), "{told}");
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 60);
    assert!(told.contains("ms a sample"), "{told}");
    let file = place.json("recognize run new.csv --online --window 8 --steps 5 --at 40 --json");
    assert_eq!(lines[39]["view"], file["sequences"][0]["steps"][39]["view"]);
    // By default an answer is short: the next samples with their variance.
    let (_, out, _) = stream("recognize run - --online --window 8 --steps 5 --ahead 2 --json", &samples);
    let answer: Value = serde_json::from_str(out.lines().nth(39).unwrap()).unwrap();
    let keys: Vec<&str> = answer.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["forecast", "ln_likelihood", "locked", "mean", "milliseconds", "sample", "variance"]);
    let predicted = numbers(&lines[39]["view"]["predicted"]);
    assert_eq!([numbers(&answer["mean"]), numbers(&answer["forecast"])].concat(), predicted[..3]);
    // A table for those who do not want JSON: the next sample as predicted.
    let (_, table, _) = stream("recognize run - --online --window 8 --steps 5 -q", "0.1\n0.2\n");
    assert!(table.starts_with("sample,iterations,milliseconds,y\n1,0,"), "{table}");
    assert_eq!(table.lines().count(), 3);
    let (code, _, told) = stream("recognize run - --online", "0.1\nabc\n");
    assert!(code == Some(2) && told.contains("line 2, y is `abc`"), "{told}");
}

/// A network on two channels.
const TWO: &str = r#"
name = "two"
[data]
task = "lissajous"
sequences = 1
steps = 60
[[network.groups]]
name = "context"
units = 6
time_constant = 2.0
[training]
epochs = 20
optimiser = "adam"
"#;

#[test]
fn missing_and_absurd_values_of_a_stream_disable_nothing() {
    let place = Place::with(TWO);
    place.ok("train sine.toml --out run -q");
    let follow = |input: &str, options: &str| {
        let mut command = Command::cargo_bin("scrnn").unwrap();
        let line = format!("recognize run - --online --window 8 --steps 5 --optimiser adam --json {options}");
        let output = command.current_dir(&place.0).args(line.split_whitespace()).write_stdin(input).output().unwrap();
        let lines: Vec<Value> =
            String::from_utf8_lossy(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        (output.status.code(), lines, String::from_utf8(output.stderr).unwrap())
    };
    for bad in ["1e300,1e300", ",", "NaN,-inf", "null,1e999"] {
        let (code, lines, told) = follow(&format!("0.1,0.2\n{bad}\n0.1,0.2\n0.1,0.2\n"), "--full");
        assert_eq!((code, lines.len()), (Some(0), 4), "{bad}: {told}");
        let iterations: Vec<u64> = lines.iter().map(|line| line["iterations"].as_u64().unwrap()).collect();
        assert_eq!(iterations, [0, 5, 5, 5], "{bad}");
        assert!(told.contains("line 2, ") && told.contains("the network's prediction stands in"), "{told}");
    }
    let (_, lines, _) = follow("0.1,0.2\n0.1,\n0.1,0.2\n", "");
    assert_eq!((lines[1]["missing"].as_array().map(Vec::len), lines[2].get("missing")), (Some(1), None));
    // A line that is cut is no sample, extra fields are refused, and so is a first line that is neither numbers nor names.
    let (code, lines, told) = follow("0.1,0.2\n0.2,0.12", "");
    assert_eq!((code, lines.len()), (Some(0), 1));
    assert!(told.contains("has no end"), "{told}");
    for (input, message) in
        [("5,0.1,0.2\n", "has 3 fields"), ("0x1,0.2\n0.1,0.2\n", "neither all numbers nor all names")]
    {
        let (code, lines, told) = follow(input, "");
        assert!(code == Some(2) && lines.is_empty() && told.contains(message), "{told}");
    }
    // What is not regarded does not dilute what is.
    let likelihood = |options: &str| numbers(&follow("0.1,0.2\n0.1,0.2\n", options).1[1]["ln_likelihood"])[0];
    let channels: Vec<String> =
        serde_json::from_value::<Vec<Value>>(place.json("inspect run --json")["channels"].clone())
            .unwrap()
            .iter()
            .map(|channel| channel["name"].as_str().unwrap().to_owned())
            .collect();
    let [first, second] = [0, 1].map(|k| likelihood(&format!("--masked-channels {}", channels[k])));
    assert!((likelihood("") - (first + second) / 2.0).abs() < 1e-9, "{first} {second}");
}

#[cfg(unix)]
#[test]
fn a_stream_whose_reader_has_left_ends() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::{Command, Stdio};
    let place = trained();
    for options in ["--json", ""] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
        command
            .current_dir(&place.0)
            .args("recognize run - --online -q".split_whitespace())
            .args(options.split_whitespace());
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (mut stdin, mut stdout) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        stdin.write_all(b"0.1\n").unwrap();
        stdout.read_line(&mut String::new()).unwrap();
        drop(stdout);
        // It sees at one of its next answers that nobody reads them, and takes no more samples.
        let mut taken = 0;
        while stdin.write_all(b"0.1\n").is_ok() {
            taken += 1;
            assert!(taken < 10_000);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert_eq!(child.wait().unwrap().code(), Some(0));
    }
}

#[test]
fn a_deadline_is_kept_when_the_steps_do_not_fit() {
    let place = trained();
    let found =
        place.json("recognize run new.csv --online --optimiser adam --window 20 --steps 1000000 --deadline 20 --json");
    let sequence = &found["sequences"][0];
    let iterations = |step: &Value| step["iterations"].as_u64().unwrap();
    let steps = &sequence["steps"].as_array().unwrap()[1..];
    assert!(steps.iter().all(|step| iterations(step) < 1_000_000));
    // That none is late by a clock of its own is shown beside `Deadline`. By the machine's, which others may take away for a while,
    // the counts must be those of the samples, and without a deadline each of them would take a hundred times as long.
    let latency = &sequence["latency"];
    let taken: Vec<f64> =
        sequence["steps"].as_array().unwrap().iter().map(|step| numbers(&step["milliseconds"])[0]).collect();
    let late = taken.iter().filter(|taken| **taken > 20.0).count() as u64;
    assert_eq!(latency["missed"].as_u64(), Some(late));
    let extremes = (taken.iter().copied().fold(f64::MAX, f64::min), taken.iter().copied().fold(0.0, f64::max));
    assert_eq!((latency["shortest"].as_f64(), latency["longest"].as_f64()), (Some(extremes.0), Some(extremes.1)));
    let on_time = steps.iter().filter(|step| numbers(&step["milliseconds"])[0] <= 20.0);
    let total: u64 = on_time.clone().map(iterations).sum();
    assert!(total > 10 * on_time.count() as u64, "{total} iterations in time");
}

#[test]
fn requests_that_do_not_go_together_are_refused() {
    let place = trained();
    for (line, expected) in [
        ("recognize run new.csv --window 5", "go with --online"),
        ("recognize run new.csv --online --optimiser adam --momentum 0.5", "--momentum does not go with"),
        ("recognize run new.csv --online --deadline 0", "give a number above 0"),
        ("recognize run new.csv --online --sequence 7", "there is no learned sequence 7"),
        ("recognize run new.csv --online --closed-channels z", "no channel `z`"),
        ("recognize run new.csv --online --window 0", "from 1 to 1000000"),
        ("recognize run - --online --out f.csv", "do not go with a stream"),
        ("simulate interact run --order RLLLR", "the network's channels are y"),
        ("data sinusoid --out world.mcap", "sinusoid has none"),
        ("data interact --sequences 40", "40 sequences of 470 samples"),
    ] {
        let (_, told) = place.fails(2, line);
        assert!(told.contains(expected), "{line}: {told}");
    }
}

pub const INTERACT: &str = r#"
name = "interact"
[data]
task = "interact"
sequences = 2
steps = 40
[network]
delay = 5
[[network.groups]]
name = "fast"
units = 6
time_constant = 5.0
learns_initial_state = false
[[network.groups]]
name = "slow"
units = 3
time_constant = 100.0
receives_input = false
drives_output = false
[training]
epochs = 5
optimiser = "adam"
"#;

#[test]
fn two_robots_are_recorded_learned_from_and_followed() {
    let place = Place::with(INTERACT);
    place.ok("data interact --sequences 1 --steps 12 --out one.mcap");
    assert!(place.read("one.mcap").starts_with(b"\x89MCAP0\r\n"));
    place.ok("train sine.toml --out run -q");
    let line = "simulate interact run --order LLLLR --initial-state corresponding --ers --steps 1 --json";
    let found = place.json(&format!("{line} --out followed.csv --mcap world.mcap"));
    let trial = &found["trials"][0];
    assert_eq!((trial["order"].as_str(), trial["initial_state"].as_str()), (Some("LLLLR"), Some("LLLLR")));
    let branches = trial["branches"].as_array().unwrap();
    assert_eq!(branches.len(), 5);
    assert_eq!((branches[4]["side"].as_str(), branches[0]["side"].as_str()), (Some("R"), Some("L")));
    assert!(branches.iter().all(|branch| branch["reaction_time"].as_u64().unwrap() <= 90));
    let text = place.text("followed.csv");
    assert!(text.starts_with("sequence,step,sensed_object_x,"), "{}", &text[..200]);
    assert_eq!(text.lines().count(), 1 + 470 - 5);
    assert!(place.read("world.mcap").starts_with(b"\x89MCAP0\r\n"));
    assert_eq!(place.json(line)["trials"][0]["branches"], trial["branches"]);
    let (_, told) = place.fails(2, "simulate interact run --initial-state RRRRR");
    assert!(told.contains("did not learn `RRRRR`") && told.contains("LLLLR"), "{told}");
    let (_, told) = place.fails(2, "simulate interact run --order LX");
    assert!(told.contains("`LX`"), "{told}");
}

/// Three learned waves that begin at different places, and one that none of them is like.
fn waves(place: &Place) {
    let wave = |name: &str, phase: f64, scale: f64, rate: f64| -> String {
        let row =
            |k: u32| format!("{name},{}\n", scale * (rate * f64::from(k) + phase).sin() + 0.02 * f64::from(k * k % 7));
        (0..60).map(row).collect()
    };
    let learned: String = (0..3_u32).map(|s| wave(&format!("w{s}"), 2.0 * f64::from(s), 1.0, 0.3)).collect();
    place.write("waves.csv", format!("sequence,y\n{learned}"));
    place.write("known.csv", format!("sequence,y\n{}", wave("k", 2.0, 1.0, 0.3)));
    place.write("strange.csv", format!("sequence,y\n{}", wave("s", 0.0, 1.0, 2.5)));
    let experiment = "name = \"waves\"\n[data]\nfiles = [\"waves.csv\"]\n[[network.groups]]\nname = \"context\"\nunits = 8\n\
                      time_constant = 2.0\n[training]\nepochs = 600\noptimiser = \"adam\"\n[training.adam]\nrate = 0.01\n";
    place.write("waves.toml", experiment);
    place.ok("train waves.toml --out run -q");
}

#[test]
fn following_begins_from_the_best_learned_state_and_says_when_nothing_learned_is_found() {
    let place = Place::new();
    waves(&place);
    let line = "--online --window 10 --steps 5 --json";
    let followed = |arguments: &str| place.json(&format!("recognize run {arguments} {line}"))["sequences"][0].clone();
    let known = followed("known.csv");
    assert!(known["locked"].as_f64().unwrap() > 0.6, "{}", known["locked"]);
    assert_eq!(known["steps"].as_array().unwrap().last().unwrap()["locked"], true);
    let strange = followed("strange.csv");
    assert!(strange["locked"].as_f64().unwrap() < 0.4, "{}", strange["locked"]);
    let err = String::from_utf8(place.run("recognize run strange.csv --online --window 10 --steps 5").stderr).unwrap();
    assert!(err.contains("was not found: the window at its end is less likely than what was learned"), "{err}");
    // After a few samples the learned state takes the mean's place; before that nothing differs.
    let from_mean = followed("known.csv --mean");
    let likelihood = |one: &Value, k: usize| numbers(&one["steps"][k]["ln_likelihood"])[0];
    assert_eq!(likelihood(&known, 2), likelihood(&from_mean, 2));
    assert!(
        likelihood(&known, 7) > likelihood(&from_mean, 7),
        "{} {}",
        likelihood(&known, 7),
        likelihood(&from_mean, 7)
    );
}
