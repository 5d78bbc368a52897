//! `scrnn evaluate`, completions and forecasts as distributions, and mixtures of networks.

use std::fmt::Write as _;

use serde_json::Value;

use crate::{Place, numbers};

/// Movements of two kinds, three times each, with noise: `up1` to `up3` and `down1` to `down3`; the same with other noise for another salt.
fn movements(salt: u32, count: u32) -> String {
    let mut text = "sequence,x,y\n".to_owned();
    for (kind, sign) in [("up", 1.0), ("down", -1.0)] {
        for s in 1..=count {
            for k in 0..40_u32 {
                let t = f64::from(k) / 39.0;
                let noise = |c: u32| 0.02 * (f64::from((k + 7) * (s + salt) * (c + 3)) * 2654.435).sin();
                let (x, y) = (t + noise(1), sign * (3.0 * t).sin() + noise(2));
                writeln!(text, "{kind}{s},{x},{y}").unwrap();
            }
        }
    }
    text
}

const EXPERIMENT: &str = r#"
name = "two"
[data]
files = ["two.csv"]
[[network.groups]]
name = "context"
units = 10
time_constant = 2.0
[training]
epochs = 400
optimiser = "adam"
[training.adam]
rate = 0.01
"#;

fn place(experiment: &str) -> Place {
    let place = Place::new();
    place.write("two.csv", movements(0, 3));
    place.write("new.csv", movements(11, 2));
    place.write("two.toml", experiment);
    place
}

#[test]
fn a_network_is_judged_by_sequences_that_it_did_not_learn_beside_simple_models() {
    let place = place(EXPERIMENT);
    place.ok("train two.toml --out run");
    let report = place.json("evaluate run new.csv --json --starts 4 --epochs 60 --samples 10");
    let nll = |of: &str| report["one_step"][of]["nll"].as_f64().unwrap();
    assert!(nll("after_burn_in") < nll("constant"), "{report}");
    assert!(["before_burn_in", "from_recognised", "linear"].iter().all(|of| nll(of).is_finite()));
    assert_eq!(report["recognition"]["of"], 4);
    assert_eq!(report["recognition"]["right"], 4, "{report}");
    assert_eq!(report["recognition"]["kinds"][0]["label"], "up");
    let horizon = report["horizon"].as_array().unwrap();
    assert_eq!(horizon.iter().map(|one| one["steps"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 5, 10, 20]);
    assert_eq!(report["channels"].as_array().unwrap().len(), 2);
    // The bits do not depend on the number of threads.
    let line = "evaluate run new.csv --json --starts 2 --epochs 5 --samples 3";
    assert_eq!(place.ok(&format!("{line} --threads 1")), place.ok(&format!("{line} --threads 3")));
    let said = place.ok("evaluate run new.csv --starts 2 --epochs 5 --samples 3");
    assert!(said.contains("recognised as of their own kind: 4 of 4"), "{said}");
    // What is missing is not scored.
    let lose = |(k, line): (usize, &str)| match (k % 9, line.rsplit_once(',')) {
        (8, Some((rest, _))) => format!("{rest},\n"),
        _ => format!("{line}\n"),
    };
    place.write("gaps.csv", movements(11, 2).lines().enumerate().map(lose).collect::<String>());
    let with_gaps = place.json("evaluate run gaps.csv --json --starts 2 --epochs 5 --samples 3");
    assert!(with_gaps["one_step"]["after_burn_in"]["nll"].is_f64(), "{with_gaps}");
    assert!(with_gaps["closed_loop"]["distance"].is_f64());
    let (_, text) = place.fails(2, "evaluate run");
    assert!(text.contains("holds no sequences out"), "{text}");
    place.write("short.csv", "x,y\n1,2\n2,3\n3,4\n");
    let (_, text) = place.fails(2, "evaluate run short.csv");
    assert!(text.contains("3 samples to judge by"), "{text}");
}

#[test]
fn a_variance_factor_is_kept_beside_the_weights_and_every_command_uses_it_and_says_so() {
    let place = place(EXPERIMENT);
    place.ok("train two.toml --out run --set data.held_out=[\"up3\",\"down3\"]");
    let variances = |line: &str| numbers(&place.json(line)["sequences"][0]["variance"]);
    let before = variances("generate run --sequence 1 --json --no-noise");
    let (_, text) = place.fails(2, "evaluate run two.csv --calibrate");
    assert!(text.contains("was learned"), "{text}");
    let result = place.json("evaluate run --calibrate --json --starts 2 --epochs 5 --samples 3");
    let calibrated = &result["calibrated"][0];
    let factors = numbers(&calibrated["factor"]["factors"]);
    assert_eq!(factors.len(), 2);
    assert!(calibrated["nll"]["after"].as_f64().unwrap() <= calibrated["nll"]["before"].as_f64().unwrap());
    assert!(calibrated["nll"]["left_out"].is_f64());
    // Errors are now as large as predicted.
    for channel in result["channels"].as_array().unwrap() {
        let mean_square = channel["calibration"]["mean_square"].as_f64().unwrap();
        assert!((mean_square - 1.0).abs() < 1e-6, "{mean_square}");
    }
    let after = variances("generate run --sequence 1 --json --no-noise");
    for (k, (before, after)) in before.iter().zip(&after).enumerate() {
        assert!((after / before / factors[k % 2] - 1.0).abs() < 1e-9, "{k}: {before} {after}");
    }
    for line in [
        "generate run --steps 3",
        "recognize run new.csv --starts 1 --epochs 1",
        "report run",
        "recognize run new.csv --online",
    ] {
        let err = String::from_utf8(place.run(line).stderr).unwrap();
        assert!(err.contains("variances are multiplied by a factor that was found on 2 sequences"), "{line}: {err}");
    }
    assert_eq!(numbers(&place.json("inspect run --json")["variance_factor"]["factors"]), factors);
    // A second time finds the same, as the weights are as they were.
    let again = place.json("evaluate run --calibrate --json --starts 2 --epochs 5 --samples 3");
    assert_eq!(numbers(&again["calibrated"][0]["factor"]["factors"]), factors);
    // Going on with the training drops it.
    place.ok("train run --resume");
    assert!(place.json("inspect run --json")["variance_factor"].is_null());
}

/// Rows of a field of the first sequence.
fn rows<'a>(value: &'a Value, field: &str) -> &'a Vec<Value> {
    value["sequences"][0][field].as_array().unwrap()
}

#[test]
fn the_rest_of_a_sequence_comes_as_mean_variance_and_samples() {
    let place = place(EXPERIMENT);
    place.ok("train two.toml --out run");
    let line = "recognize run new.csv --observed 15 --samples 8 --starts 6 --epochs 60";
    let found = place.json(&format!("{line} --json --completed rest.csv"));
    let completion = &found["sequences"][0]["completion"];
    let count = |of: &str| completion[of].as_array().unwrap().len();
    assert_eq!((count("mean"), count("variance"), count("samples")), (25, 25, 8));
    assert!(completion["uncertainty"].as_str().unwrap().contains("starts"));
    assert!(completion["effective_states"].as_f64().unwrap() >= 1.0);
    assert!(completion["nll"].is_f64());
    let rest = place.text("rest.csv");
    assert!(rest.lines().next().unwrap().contains("sample"), "{rest}");
    assert_eq!(rest.lines().count(), 1 + 4 * 8 * 40);
    let said = place.ok(line);
    assert!(said.contains("nll beyond") && said.contains("within 1, 2 sd"), "{said}");

    // The same by generate: where the first samples lead, and beyond the end of a recording.
    let onward = place.json("generate run --from new.csv --observed 15 --samples 4 --json");
    assert_eq!((onward["sequences"].as_array().unwrap().len(), rows(&onward, "mean").len()), (16, 25));
    assert_eq!(rows(&onward, "mean"), onward["sequences"][1]["mean"].as_array().unwrap());
    assert_ne!(rows(&onward, "sample"), onward["sequences"][1]["sample"].as_array().unwrap());
    let beyond = place.json("generate run --from new.csv --steps 7 --json");
    assert_eq!(rows(&beyond, "variance").len(), 7);
    let (_, text) = place.fails(2, "generate run --from new.csv");
    assert!(text.contains("--steps"), "{text}");
    let (_, text) = place.fails(2, "generate run --from new.csv --observed 1 --steps 2");
    assert!(text.contains("observe at least 2"), "{text}");
}

#[test]
fn a_mixture_is_one_run_that_every_command_knows() {
    let place = place(&EXPERIMENT.replace("epochs = 400", "epochs = 400\nmembers = 3"));
    let held_out = "--set data.held_out=[\"up3\",\"down3\"]";
    let result = place.json(&format!("train two.toml --out run --json {held_out}"));
    assert_eq!(result["members"].as_array().unwrap().len(), 3);
    assert_eq!(result["held_out"]["sequences"], serde_json::json!(["up3", "down3"]));
    // The first member is the network of the same experiment without members.
    place.ok(&format!("train two.toml --out single {held_out} --set training.members=1"));
    let network = |run: &str| place.json(&format!("generate {run} --json --sequence 1"));
    assert_eq!(network("single"), network("run/member-1"));
    assert_ne!(network("single"), network("run/member-2"));

    let mixture = place.json("generate run --json --sequence 1 --no-noise");
    let each: Vec<Value> =
        (1..=3).map(|k| place.json(&format!("generate run/member-{k} --json --sequence 1 --no-noise"))).collect();
    let at = |value: &Value, field: &str, k: usize| numbers(&value["sequences"][0][field])[k];
    for k in [0, 5, 60] {
        let mean = each.iter().map(|one| at(one, "mean", k)).sum::<f64>() / 3.0;
        assert!((at(&mixture, "mean", k) - mean).abs() < 1e-9);
        let spread: f64 = each.iter().map(|one| (at(one, "mean", k) - mean).powi(2)).sum();
        let variance = each.iter().map(|one| at(one, "variance", k)).sum::<f64>() / 3.0 + spread / 2.0;
        assert!((at(&mixture, "variance", k) / variance - 1.0).abs() < 1e-6);
    }

    let report = place.json("evaluate run --json --starts 2 --epochs 20 --samples 5");
    assert_eq!(report["members"], 3);
    let of_members = (1..=3).map(|k| {
        let one = place.json(&format!("evaluate run/member-{k} --json --starts 2 --epochs 20 --samples 5"));
        one["one_step"]["after_burn_in"]["nll"].as_f64().unwrap()
    });
    // By Jensen's inequality a mixture is never worse than its members on average.
    let average = of_members.sum::<f64>() / 3.0;
    assert!(report["one_step"]["after_burn_in"]["nll"].as_f64().unwrap() <= average);

    let found = place.json("recognize run new.csv --observed 15 --samples 6 --starts 3 --epochs 20 --json");
    assert_eq!(found["sequences"][0]["members"].as_array().unwrap().len(), 3);
    assert_eq!(found["sequences"][0]["completion"]["samples"].as_array().unwrap().len(), 6);
    assert_eq!(place.json("inspect run --json")["kind"], "mixture");
    place.ok("generate run --from new.csv --observed 15 --samples 6 --out rest.npz");
    place.ok("report run");
    assert!(place.text("run/report.html").contains("A mixture of 3 networks"));
    let (_, text) = place.fails(2, "recognize run new.csv --online");
    assert!(text.contains("mixture of 3 networks") && text.contains("member-1"), "{text}");
    let (_, text) = place.fails(5, &format!("train two.toml --out run {held_out}"));
    assert!(text.contains("already holds a run"), "{text}");
    // Nothing is left to do, and nothing changes.
    let bytes = place.read("run/member-2/checkpoint.safetensors");
    place.ok("train run --resume");
    assert!(place.read("run/member-2/checkpoint.safetensors") == bytes);
}

#[test]
fn members_that_are_killed_come_to_the_same_bits() {
    let experiment = EXPERIMENT.replace("epochs = 400", "epochs = 2000\nmembers = 2");
    let place = place(&(experiment + "[output]\ncheckpoint_every = 50\n"));
    place.ok("train two.toml --out whole");
    for pause in [40, 90, 200, 300] {
        place.stopped_after(pause, "train two.toml --out cut --resume");
    }
    place.ok("train two.toml --out cut --resume");
    for name in ["member-1/checkpoint.safetensors", "member-2/checkpoint.safetensors", "member-2/best.safetensors"] {
        assert!(place.read(&format!("whole/{name}")) == place.read(&format!("cut/{name}")), "{name} differs");
    }
}
