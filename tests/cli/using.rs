//! What is done with a trained network and around it: generate, recognize, inspect, data, schema, completions.

use crate::{Place, SINE, numbers};

/// A folder with a trained run of three short Lissajous curves.
fn trained() -> Place {
    let place = Place::with(
        "name = \"curves\"\n[data]\ntask = \"lissajous\"\nsteps = 60\nsequences = 3\n[network]\ndelay = 2\n\
         initial_state_variance = 10.0\n[[network.groups]]\nname = \"c\"\nunits = 10\ntime_constant = 2.0\n\
         [training]\nepochs = 600\noptimiser = \"adam\"\n[training.adam]\nrate = 0.02\n",
    );
    place.ok("train sine.toml --out run");
    place
}

fn sequences(value: &serde_json::Value) -> &Vec<serde_json::Value> {
    value["sequences"].as_array().unwrap()
}

#[test]
fn noise_follows_its_seed_and_samples_differ() {
    let place = trained();
    let line = "generate run --sequence 2 --samples 3 --steps 20 --json";
    let generated = place.json(line);
    assert_eq!(generated, place.json(line));
    assert_ne!(generated, place.json(&format!("{line} --seed 2")));
    let names: Vec<_> = sequences(&generated).iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["2/1", "2/2", "2/3"]);
    assert_ne!(sequences(&generated)[0]["sample"], sequences(&generated)[1]["sample"]);
    assert_eq!(sequences(&generated)[0]["mean"].as_array().unwrap().len(), 20);
    let still = place.json("generate run --sequence 2 --steps 20 --no-noise --json");
    assert_eq!(sequences(&still)[0]["mean"], sequences(&still)[0]["sample"]);
}

#[test]
fn by_default_all_learned_sequences_run_as_long_as_their_data() {
    let place = trained();
    let csv = place.ok("generate run");
    assert!(csv.starts_with("sequence,step,mean_y1,mean_y2,variance_y1,variance_y2,sample_y1,sample_y2\n"), "{csv}");
    assert_eq!(csv.lines().count(), 1 + 3 * 58);
    place.ok("generate run --out out.csv --contexts");
    let header = place.text("out.csv").lines().next().unwrap().to_owned();
    assert!(header.ends_with("sample_y2,context_c1,context_c2,context_c3,context_c4,context_c5,context_c6,context_c7,context_c8,context_c9,context_c10"), "{header}");
}

#[test]
fn the_open_loop_is_the_same_from_the_experiment_and_from_a_file() {
    let place = trained();
    place.ok("data lissajous --steps 60 --sequences 3 --out same.npz");
    let remade = place.json("generate run --mode open --json");
    let read = place.json("generate run --mode open --data same.npz --json");
    assert_eq!(sequences(&remade)[2]["mean"], sequences(&read)[2]["mean"]);
    let one = place.json("generate run --mode open --sequence 3 --json");
    assert_eq!(sequences(&remade)[2]["mean"], sequences(&one)[0]["mean"]);
    let mixed = place.json("generate run --mode mixed --mixing 1 --json");
    assert_eq!(sequences(&remade)[2]["mean"], sequences(&mixed)[2]["mean"]);
    let channels = place.json("generate run --open-channels y1,y2 --json");
    assert_eq!(sequences(&remade)[2]["mean"], sequences(&channels)[2]["mean"]);
    let closed = place.json("generate run --no-noise --json");
    assert_ne!(sequences(&remade)[2]["mean"], sequences(&closed)[2]["mean"]);
    let first = |value: &serde_json::Value| value["mean"].as_array().unwrap()[..2].to_vec();
    assert_eq!(first(&sequences(&remade)[2]), first(&sequences(&closed)[2]));
}

#[test]
fn states_pair_with_recorded_sequences() {
    let place = trained();
    place.ok("data lissajous --steps 60 --sequences 2 --out two.npz");
    let count = |line: &str| sequences(&place.json(line)).len();
    assert_eq!(count("generate run --mode open --mean --data two.npz --json"), 2);
    assert_eq!(count("generate run --mode open --sequence 3 --data two.npz --json"), 2);
    assert_eq!(count("generate run --mean --json"), 1);
    let (_, told) = place.fails(2, "generate run --mode open --data two.npz");
    assert!(told.contains("there are 3 initial states, but 2 recorded sequences"), "{told}");
}

#[test]
fn the_learned_sequences_are_recognised_and_their_states_generate() {
    let place = trained();
    place.ok("data lissajous --steps 60 --sequences 3 --seed 2 --out new.csv");
    let table = place.ok("recognize run new.csv --epochs 60 --starts 5 --out states.csv");
    assert!(table.starts_with("sequence  start"), "{table}");
    for (s, row) in table.lines().skip(1).enumerate() {
        let most_likely = row.split("  ").filter(|cell| !cell.is_empty()).nth(4).unwrap().trim();
        assert!(most_likely.starts_with(&format!("{} (", s + 1)), "{table}");
    }
    place.ok("recognize run new.csv --epochs 60 --starts 5 --out states.npz");
    let [from_csv, from_npz] = ["csv", "npz"].map(|kind| {
        place.json(&format!("generate run --mode open --data new.csv --initial-state states.{kind} --json"))
    });
    assert_eq!(sequences(&from_csv)[1]["mean"], sequences(&from_npz)[1]["mean"]);
    let found = place.json("recognize run new.csv --epochs 60 --starts 5 --json");
    let best = &sequences(&found)[1];
    let tried: Vec<f64> =
        best["trials"].as_array().unwrap().iter().map(|t| t["ln_likelihood"].as_f64().unwrap()).collect();
    assert!(tried.is_sorted_by(|a, b| a >= b) && tried[0] == best["ln_likelihood"].as_f64().unwrap(), "{tried:?}");
    // The error (3.5) of the table is that of the open loop from the state that was written.
    let means = numbers(&sequences(&from_csv)[1]["mean"]);
    let rows: Vec<Vec<f64>> = place
        .text("new.csv")
        .lines()
        .filter(|row| row.starts_with("2,"))
        .map(|row| row.split(',').skip(2).map(|field| field.parse().unwrap()).collect())
        .collect();
    let target = rows.concat().split_off(4);
    let squares: f64 = target.iter().zip(&means).map(|(a, b)| (a - b).powi(2)).sum();
    let error = squares / (2 * target.len()) as f64;
    assert!((error - best["error"].as_f64().unwrap()).abs() < 1e-12 * error, "{error}, {best}");
}

#[test]
fn a_partly_observed_sequence_is_completed() {
    let place = trained();
    place.ok("data lissajous --steps 60 --sequences 2 --seed 2 --out new.csv");
    let found = place.json("recognize run new.csv --epochs 60 --starts 5 --observed 30 --completed whole.csv --json");
    assert!(sequences(&found)[0]["completion_error"].as_f64().unwrap() > 0.0);
    let [new, whole] =
        ["new.csv", "whole.csv"].map(|name| place.text(name).lines().map(str::to_owned).collect::<Vec<_>>());
    assert_eq!(new.len(), whole.len());
    assert_eq!(new[..31], whole[..31]);
    assert!(new[31..61].iter().zip(&whole[31..61]).all(|(a, b)| a != b));
    let all = place.json("recognize run new.csv --epochs 60 --starts 5 --json");
    assert!(sequences(&all)[0]["completion_error"].is_null());
}

#[test]
fn inspect_shows_runs_checkpoints_and_data() {
    let place = trained();
    let run = place.ok("inspect run");
    for shown in ["epoch", "600 of 600", "nll", "2 steps ahead", "10 units, time constant 2", "of 60 samples", "adam"] {
        assert!(run.contains(shown), "{shown} is missing in\n{run}");
    }
    let best = place.json("inspect run/best.safetensors --json");
    assert_eq!(best["score"], place.json("inspect run --json")["best"]);
    place.ok("data lissajous --out data.npy --sequences 2 --steps 30");
    let data = place.ok("inspect data.npy");
    assert!(data.contains("2 sequences of 30 samples, 2 channels"), "{data}");
    let names: Vec<_> = place.json("inspect data.truth.npz --json")["sequences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["name"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(names, ["1", "2"]);
    assert!(run.contains("instruction set: ") && place.ok("--version").contains("instruction set"));
    let portable = place.json("inspect run --json --instruction-set portable");
    assert_eq!(portable["instruction_set"], "portable");
}

#[test]
fn tasks_follow_their_seed_and_train_from_the_file_as_from_the_name() {
    let place = Place::with(SINE);
    place.ok("data sinusoid --steps 80 --out wave.csv");
    assert_eq!(place.text("wave.csv"), place.ok("data sinusoid --steps 80"));
    assert_ne!(place.text("wave.csv"), place.ok("data sinusoid --steps 80 --seed 2"));
    assert!(place.text("wave.truth.csv").starts_with("sequence,step,mean_y,variance_y\n"));
    place.write(
        "file.toml",
        SINE.replace("task = \"sinusoid\"\nsteps = 80", "files = [\"wave.csv\"]\nscaling = \"none\""),
    );
    place.ok("train sine.toml --out a --epochs 5");
    place.ok("train file.toml --out b --epochs 5");
    assert_eq!(place.json("inspect a --json")["score"], place.json("inspect b --json")["score"]);
    assert!(place.ok("data limit-cycle --sequences 1 --steps 3").lines().count() == 4);
}

#[test]
fn the_schema_names_every_key_and_completions_every_command() {
    let place = Place::new();
    let schema = place.json("schema");
    let object = |name: &str| schema["$defs"][name]["properties"].as_object().unwrap().clone();
    assert!(object("Adam").contains_key("clip_norm") && object("Group").contains_key("time_constant"));
    assert_eq!(schema["additionalProperties"], false);
    for shell in ["bash", "zsh", "fish"] {
        let script = place.ok(&format!("completions {shell}"));
        assert!(script.contains("recognize") && script.contains("overwrite"));
    }
}

#[test]
fn help_teaches_by_examples() {
    let place = Place::new();
    assert!(place.ok("--help").contains("Exit codes"));
    for command in ["data", "train", "generate", "recognize", "reproduce", "report", "inspect", "completions", "schema"]
    {
        let help = place.ok(&format!("{command} --help"));
        assert!(help.contains("Example") && help.contains(&format!("scrnn {command}")), "{help}");
    }
}
