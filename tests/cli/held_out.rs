//! Sequences that are held out: what is said of them, which network is the best, when a training ends, and that it comes to the same
//! bits however often it stops.

use std::fmt::Write as _;

use crate::resuming::same_results;
use crate::{Place, epochs};

/// Eight arcs of different phases, each a sequence of its own.
fn arcs() -> String {
    let mut text = "sequence,x,y\n".to_owned();
    for s in 0..8 {
        for k in 0..40 {
            let phase = 0.2 * f64::from(k) + 0.15 * f64::from(s);
            let noise = 0.01 * f64::from((k * k * (s + 3)) % 17 - 8);
            writeln!(text, "arc{s},{},{}", phase.sin() + noise, (0.5 * phase).cos() - noise).unwrap();
        }
    }
    text
}

const EXPERIMENT: &str = r#"
name = "arcs"
[data]
files = ["arcs.csv"]
held_out = 0.25
[[network.groups]]
name = "context"
units = 8
time_constant = 2.0
[training]
epochs = 300
optimiser = "adam"
[training.adam]
batch_size = 3
[evaluation]
every = 10
[output]
checkpoint_every = 7
"#;

fn place(experiment: &str) -> Place {
    let place = Place::new();
    place.write("arcs.csv", arcs());
    place.write("arcs.toml", experiment);
    place
}

/// The numbers of a column of a history, by the column's name; rows without one are left out.
fn column(history: &str, name: &str) -> Vec<(u64, f64)> {
    let at = history.lines().next().unwrap().split(',').position(|head| head == name).unwrap();
    let row = |line: &str| -> Option<(u64, f64)> {
        let fields: Vec<&str> = line.split(',').collect();
        Some((fields[0].parse().unwrap(), fields[at].parse().ok()?))
    };
    history.lines().skip(1).filter_map(row).collect()
}

#[test]
fn what_is_held_out_is_told_in_the_history_the_checkpoint_the_end_and_on_the_page() {
    let place = place(EXPERIMENT);
    let result = place.json("train arcs.toml --out run --json");
    let held_out = &result["held_out"];
    assert_eq!(held_out["sequences"].as_array().unwrap().len(), 2);
    let nll = |of: &str| held_out[of]["nll"].as_f64().unwrap();
    assert!(nll("from_mean") < nll("constant"), "{held_out}");
    assert!(nll("from_recognised").is_finite() && nll("linear").is_finite());
    let distances = held_out["closed_loop"]["after"].as_array().unwrap();
    assert_eq!(distances.iter().map(|one| one["steps"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 5, 20]);

    // The best epoch is the best on what was held out, and no other.
    let history = place.text("run/history.csv");
    let looks = column(&history, "held_out_nll");
    assert_eq!(looks.iter().map(|look| look.0).collect::<Vec<_>>(), (0..=30).map(|k| 10 * k).collect::<Vec<_>>());
    let best = looks.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert_eq!(result["best"]["epoch"], best.0);
    assert_eq!(result["best"]["held_out"]["nll"], best.1);
    assert_eq!(held_out["epoch"], best.0);
    assert_eq!(nll("from_mean"), best.1);
    let noted = place.json("inspect run/best.safetensors --json");
    assert_eq!(noted["epoch"], best.0);
    assert_eq!(noted["sequences"].as_array().unwrap().len(), 6);
    assert!(column(&history, "within_2").iter().all(|(_, share)| (0.0..=1.0).contains(share)));

    let said = place.ok("train arcs.toml --out other --epochs 60");
    assert!(said.contains("On 2 sequences that were held out, the best network (epoch "), "{said}");
    assert!(said.contains("of a linear predictor on the last 4 samples: "), "{said}");
    assert!(said.contains("Alone after the first 30 %, it is "), "{said}");
    place.ok("report run");
    assert!(place.text("run/report.html").contains("Sequences that were not learned"));
}

#[test]
fn a_network_that_learned_nothing_is_said_to_be_no_better_than_simple_models() {
    let place = place(EXPERIMENT);
    let said = place.ok("train arcs.toml --out run --epochs 0");
    assert!(said.contains("it is no better than either: what it learned does not hold on new sequences"), "{said}");
}

#[test]
fn sequences_are_held_out_by_share_by_name_or_as_files_and_the_scaling_does_not_know_them() {
    let place = place(EXPERIMENT);
    let train = |out: &str, held_out: &str| {
        place
            .json(&format!("train arcs.toml --out {out} --overwrite --epochs 0 --json --set data.held_out={held_out}"));
        place.json(&format!("inspect {out} --json"))
    };
    let sequences = |network: &serde_json::Value| -> Vec<String> {
        let list = network["sequences"].as_array().unwrap();
        list.iter().map(|name| name.as_str().unwrap().to_owned()).collect()
    };
    let named = train("named", "[\"arc2\",\"arc7\"]");
    assert_eq!(sequences(&named), ["arc0", "arc1", "arc3", "arc4", "arc5", "arc6"]);
    // The same share by the same seed is the same, by another seed another.
    let drawn =
        [1, 1, 2, 3, 4].map(|seed| sequences(&train(&format!("seed{seed}"), &format!("{{share=0.25,seed={seed}}}"))));
    assert!(drawn[0] == drawn[1] && drawn[1..].iter().any(|other| *other != drawn[0]), "{drawn:?}");

    // One sequence reaches twice as far as the others.
    let mut wide = arcs();
    for k in 0..40 {
        writeln!(wide, "wide,{},0", 3.0 * (0.2 * f64::from(k)).sin()).unwrap();
    }
    place.write("arcs.csv", wide);
    let high = |network: &serde_json::Value| network["channels"][0]["high"].as_f64().unwrap();
    let (without, with) = (high(&train("without", "[\"wide\"]")), high(&train("with", "[\"arc0\"]")));
    assert!(without < 1.5 && with > 3.0, "{without} {with}");

    place.write("arcs.csv", arcs());
    let lines: Vec<String> = arcs().lines().map(|line| line.replace("arc", "new")).collect();
    place.write("new.csv", lines[..81].join("\n"));
    let files = train("files", "{files=[\"new.csv\"]}");
    assert_eq!(sequences(&files).len(), 8);
    assert_eq!(place.json("train files --resume --json")["held_out"]["sequences"], serde_json::json!(["new0", "new1"]));
}

#[test]
fn patience_ends_a_training_and_however_often_it_is_stopped_it_comes_to_the_same_bits() {
    let place = place(&EXPERIMENT.replace("[training.adam]", "patience = 3\n[training.adam]\nrate = 0.05"));
    let result = place.json("train arcs.toml --out whole --json --set training.epochs=2000 --set evaluation.every=10");
    let (end, best) = (result["epoch"].as_u64().unwrap(), result["best"]["epoch"].as_u64().unwrap());
    assert_eq!(result["outcome"], "out of patience");
    assert!(end < 2000 && end == best + 30, "{end} {best}");
    // It does not go on by itself; with more patience it does.
    assert_eq!(place.json("train whole --resume --json")["epoch"], end);
    let mut pieces = 0;
    while pieces < 40 {
        let output = place.stopped_after(30, "train arcs.toml --out cut --resume --set training.epochs=2000");
        pieces += 1;
        if output {
            break;
        }
    }
    place.ok("train arcs.toml --out cut --resume --set training.epochs=2000");
    same_results(&place, "whole", "cut");
    let on = place.json("train whole --resume --json --set training.patience=5");
    assert!(on["epoch"].as_u64().unwrap() > end, "{on}");
    assert_eq!(epochs(&place.text("whole/history.csv")).last(), on["epoch"].as_u64().as_ref());
}

#[test]
fn what_cannot_be_held_out_is_refused_with_what_can() {
    let place = place(EXPERIMENT);
    let fails = |set: &str, expected: &str| {
        let (_, text) = place.fails(2, &format!("train arcs.toml --out run {set}"));
        assert!(text.contains(expected), "{text}");
    };
    fails("--set data.held_out=1.0", "a share above 0 and below 1");
    fails("--set data.held_out=[\"nobody\"]", "there is no sequence `nobody` to hold out");
    fails("--set data.held_out=[\"nobody\"]", "the sequences are arc0, arc1,");
    fails("--set evaluation.observed=1", "a share from 0 to below 1");
    fails("--set training.patience=0", "at least 1 evaluation");
    let (_, text) = place.fails(4, "train arcs.toml --out run --set data.held_out={files=[\"none.csv\"]}");
    assert!(text.contains("none.csv"), "{text}");
    place.write("arcs.toml", EXPERIMENT.replace("held_out = 0.25\n", ""));
    fails("--set training.patience=3", "needs sequences that are held out");
    place.write("arcs.toml", EXPERIMENT);
    place.ok("train arcs.toml --out run --epochs 3");
    let (_, text) = place.fails(5, "train arcs.toml --out run --epochs 3 --resume --set data.held_out=0.5");
    assert!(text.contains("data.held_out: 0.25 -> 0.5"), "{text}");
}

#[test]
fn the_recipe_does_not_look_at_what_is_held_out() {
    let chosen = |odd: &dyn Fn(u32) -> f64| {
        let mut text = arcs();
        for k in 0..40 {
            writeln!(text, "odd,{},{}", odd(k), -odd(k)).unwrap();
        }
        let place = Place::new();
        place.write("arcs.csv", text);
        place.ok("train arcs.csv --out run --set data.held_out=[\"odd\"] --epochs 1 --quiet");
        // The folder is another one each time.
        place
            .text("run/experiment.toml")
            .lines()
            .filter(|line| !line.starts_with("files"))
            .collect::<Vec<_>>()
            .join("\n")
    };
    let spikes = |k: u32| if k.is_multiple_of(13) { 90.0 } else { f64::from(k * k % 7) };
    let still = |_: u32| 0.0;
    let text = chosen(&spikes);
    assert!(text.contains("held_out = [\"odd\"]"), "{text}");
    assert_eq!(text, chosen(&still));
}
