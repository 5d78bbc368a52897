//! Numbers that people may type: each option and key at the ends of what can be written.

use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::numbers_table::OPTIONS;
use super::{Place, SINE};

const VALUES: [&str; 10] =
    ["0", "1", "2", "-1", "2147483648", "4294967296", "9223372036854775808", "18446744073709551615", "1e308", "NaN"];

/// Keys of the experiment file.
const KEYS: [&str; 50] = [
    "seed",
    "data.left",
    "data.seed",
    "data.sequences",
    "data.steps",
    "network.delay",
    "network.variance_floor",
    "network.initial_state_variance",
    "network.groups.context.units",
    "network.groups.context.time_constant",
    "training.epochs",
    "training.patience",
    "data.held_out",
    "evaluation.every",
    "evaluation.burn_in",
    "evaluation.observed",
    "training.momentum.rate",
    "training.momentum.momentum",
    "training.momentum.rate_initial",
    "training.adam.rate",
    "training.adam.clip_norm",
    "training.adam.batch_size",
    "training.adam.beta1",
    "training.adam.beta2",
    "training.adam.epsilon",
    "training.adam.final_rate",
    "training.adam.initial_state_factor",
    "training.adam.mean_factor",
    "training.adam.warm_up",
    "training.adam.weight_decay",
    "training.momentum.adaptive_rate.decrease",
    "training.momentum.adaptive_rate.increase",
    "training.momentum.adaptive_rate.max_error_ratio",
    "training.momentum.adaptive_rate.max_tries",
    "data.period",
    "training.lbfgs.share",
    "training.lbfgs.memory",
    "training.on_divergence.recoveries",
    "output.history_every",
    "output.checkpoint_every",
    "output.checkpoint_seconds",
    "data.rest",
    "training.members",
    "network.skip_damping",
    "network.skip_lags",
    "training.closed_loop.copies",
    "training.closed_loop.weight",
    "training.closed_loop.taught",
    "training.closed_loop.earliest",
    "training.closed_loop.latest",
];

/// Runs a line for so long at most; the exit code, unless it had to be stopped, and what it said.
fn ends(place: &Place, line: &str, within: Duration) -> (Option<i32>, String) {
    let log = place.path("log");
    let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
    command.current_dir(&place.0).args(line.split_whitespace()).stdin(Stdio::null()).stdout(Stdio::null());
    let mut child = command.stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap();
    let begun = Instant::now();
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break Some(status.code().unwrap_or(-1));
        }
        if begun.elapsed() > within {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(3));
    };
    (code, String::from_utf8_lossy(&std::fs::read(&log).unwrap()).into_owned())
}

/// The exit code, which is none if the line was still at work.
fn check(place: &Place, line: &str, codes: &[i32], is_long: bool) -> Option<i32> {
    let within = if is_long { Duration::from_millis(500) } else { Duration::from_secs(60) };
    let (code, told) = ends(place, line, within);
    assert!(!told.contains("panicked") && !told.contains("allocation"), "{line}: {told}");
    match code {
        Some(code) => assert!(codes.contains(&code), "{line}: exit code {code}, {told}"),
        None => assert!(is_long, "{line} does not end: {told}"),
    }
    code
}

#[test]
fn every_numeric_option_takes_a_value_or_refuses_it_and_never_panics() {
    let place = Place::with(&SINE.replace("epochs = 120", "epochs = 5"));
    place.ok("train sine.toml --out run -q");
    place.ok("data sinusoid --steps 20 --seed 3 --out new.csv -q");
    let rows: String = (0..20).map(|k| format!("{k},{:?}\n", (0.3 * f64::from(k)).sin())).collect();
    place.write("timed.csv", format!("time,y\n{rows}"));
    place.write("sine.toml", super::reaching::REACH.replace("epochs = 300", "epochs = 2"));
    place.ok("train sine.toml --out reach -q");
    place.write("sine.toml", super::following::INTERACT.replace("epochs = 5", "epochs = 2"));
    place.ok("train sine.toml --out interact -q");
    place.write("sine.toml", SINE.replace("epochs = 120", "epochs = 5"));
    place.write("sweep.toml", "name = \"many\"\nexperiment = \"sine.toml\"\nseeds = 2\n");
    for (command, option, line) in OPTIONS {
        // Whoever asks for 2^31 epochs of training gets them.
        let is_long = *option == "epochs";
        let codes = VALUES.map(|value| check(&place, &format!("{line} --{option}={value}"), &[0, 2], is_long));
        // A line that is refused whatever the number would prove nothing, nor would one that takes NaN.
        assert!(codes.contains(&Some(0)) || is_long && codes.contains(&None), "{command} --{option}: {codes:?}");
        assert_eq!(codes[VALUES.len() - 1], Some(2), "{command} --{option}=NaN");
    }
}

#[test]
fn every_numeric_key_takes_a_value_or_is_refused_and_never_panics() {
    let place = Place::with(&SINE.replace("epochs = 120", "epochs = 3"));
    for key in KEYS {
        for value in VALUES {
            let value = if value == "NaN" { "nan" } else { value };
            let optimiser = if key.contains("adam") { "--set training.optimiser=adam" } else { "" };
            let line = format!("train sine.toml --out t --overwrite {optimiser} --set {key}={value}");
            // A rate of 1e308 may be a divergence.
            check(&place, &line, &[0, 2, 3], key == "training.epochs");
        }
    }
}

/// The last parts of all keys of the experiment file that are numbers.
fn numeric_keys(schema: &serde_json::Value, found: &mut BTreeSet<String>) {
    let serde_json::Value::Object(entries) = schema else {
        schema.as_array().into_iter().flatten().for_each(|entry| numeric_keys(entry, found));
        return;
    };
    let is_number = |schema: &serde_json::Value| {
        let text = schema["type"].to_string();
        text.contains("number") || text.contains("integer")
    };
    for (key, below) in schema["properties"].as_object().into_iter().flatten() {
        if is_number(below) {
            found.insert(key.clone());
        }
    }
    entries.values().for_each(|below| numeric_keys(below, found));
}

#[test]
fn every_numeric_key_of_the_schema_is_in_the_table() {
    let place = Place::new();
    let mut found = BTreeSet::new();
    numeric_keys(&serde_json::from_str(&place.ok("schema")).unwrap(), &mut found);
    let listed: BTreeSet<&str> = KEYS.iter().filter_map(|key| key.rsplit('.').next()).collect();
    let missing: Vec<_> = found.iter().filter(|key| !listed.contains(key.as_str())).collect();
    assert!(missing.is_empty() && found.len() > 15, "{missing:?}");
}

#[test]
fn what_does_not_fit_into_memory_is_refused_with_the_amount() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run --epochs 1 -q");
    for line in [
        "data sinusoid --sequences 1000000 --steps 1000000000",
        "generate run --steps 1000000000 --samples 1000000",
        "train sine.toml --out t --set network.groups.context.units=1000000",
    ] {
        let (_, told) = place.fails(2, line);
        assert!(told.contains("needs ") && told.contains("this machine has"), "{line}: {told}");
    }
    let (_, told) = place.fails(2, "inspect run --threads 1025");
    assert!(told.contains("from 0 to 1024"), "{told}");
}

#[cfg(target_os = "linux")]
#[test]
fn paths_and_bytes_that_are_no_text_are_refused_or_cut_with_a_word() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let folder = place.0.path().join(OsStr::from_bytes(b"nu\xff"));
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("d.csv"), "a,b\n1,2\n2,3\n3,1\n2,2\n").unwrap();
    let experiment = "name = \"f\"\n[data]\nfiles = [\"d.csv\"]\n[[network.groups]]\nname = \"c\"\nunits = 3\n\
                      time_constant = 2.0\n[training]\nepochs = 3\noptimiser = \"adam\"\n";
    std::fs::write(folder.join("f.toml"), experiment).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
    let output = command.current_dir(&place.0).arg("train").arg(folder.join("f.toml")).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && told.contains("is not UTF-8"), "{told}");
    place.write("bad.toml", b"name = \"\xff\"\n");
    let (_, told) = place.fails(2, "train bad.toml");
    assert!(told.contains("byte 9 (line 1) is not UTF-8"), "{told}");
    // One bad byte in the history is said, cut, and gone on from.
    place.write("sine.toml", SINE);
    place.ok("train sine.toml --out run --epochs 40 -q");
    let mut history = place.read("run/history.csv");
    let at = history.len() * 3 / 4;
    history[at] = 0xff;
    place.write("run/history.csv", &history);
    let output = place.run("train sine.toml --out run --resume --epochs 60");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(0) && told.contains("is damaged"), "{told}");
    let epochs = super::epochs(&place.text("run/history.csv"));
    assert!(epochs.last() == Some(&60) && epochs.windows(2).all(|pair| pair[0] < pair[1]), "{epochs:?}");
}
