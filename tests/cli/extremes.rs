//! Rates that are too large, data without extent or beyond all measure: what a user gets to see.

use std::path::Path;

use crate::{Place, SINE, epochs, numbers};

/// The sine wave's experiment on a file.
fn on_file(name: &str) -> String {
    SINE.replace("task = \"sinusoid\"\nsteps = 80", &format!("files = [\"{name}\"]"))
}

fn table(rows: impl Iterator<Item = (f64, f64)>) -> String {
    format!("a,b\n{}", rows.map(|(a, b)| format!("{a:?},{b:?}\n")).collect::<String>())
}

/// The numbers of a column of a history.
fn column(history: &str, name: &str) -> Vec<f64> {
    let at = history.lines().next().unwrap().split(',').position(|field| field == name).unwrap();
    history.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

/// The thesis' experiments at ten times its rate: the limit cycle, whose likelihood has no bound, and the sine wave.
#[test]
fn at_ten_times_the_thesis_rate_training_is_reset_and_says_so() {
    let experiments = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/experiments");
    let place = Place::new();
    for (name, seed, epochs_needed) in [("sinusoid", 2, 1300), ("limit_cycle", 1, 1000)] {
        let file = experiments.join(format!("{name}.toml"));
        let line = format!("train {} --seed {seed} --set training.momentum.rate=1e-3", file.display());
        let recover = format!("{line} --set training.on_divergence=recover");
        let output = place.run(&format!("{recover} --out {name} --epochs {epochs_needed} --json"));
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{told}");
        let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let recoveries = result["recoveries"].as_u64().unwrap();
        assert!(recoveries >= 1, "{name}: {result}");
        assert!(told.contains("the nll rose by") && told.contains("going on from there at 0.5 of the rate"), "{told}");

        let history = place.text(&format!("{name}/history.csv"));
        let (counts, rates) = (column(&history, "recoveries"), column(&history, "rate_shared"));
        assert_eq!(counts.last(), Some(&(recoveries as f64)));
        assert!((rates[0] / rates[rates.len() - 1] - 2.0_f64.powi(recoveries as i32)).abs() < 1e-9);
        let page = |run: &str| {
            place.ok(&format!("report {run}"));
            place.text(&format!("{run}/report.html"))
        };
        assert!(page(name).contains(&format!("training became unstable {recoveries} times")));
        let said = place.ok(&format!("train {name} --resume"));
        assert!(said.contains(&format!("Training became unstable {recoveries} times")), "{said}");

        // Stopped and gone on with, it comes to the same bits.
        let before = place.read(&format!("{name}/checkpoint.safetensors"));
        place.ok(&format!("{recover} --out {name}-parts --epochs 700"));
        place.ok(&format!("train {name}-parts --resume --epochs {epochs_needed}"));
        assert!(before == place.read(&format!("{name}-parts/checkpoint.safetensors")));

        // Left alone, the same rate does worse.
        place.ok(&format!("{line} --out {name}-alone --epochs {epochs_needed} --set training.on_divergence=stop"));
        let alone = place.text(&format!("{name}-alone/history.csv"));
        assert_eq!(column(&alone, "recoveries").last(), Some(&0.0));
        let last = |history: &str| *column(history, "nll").last().unwrap();
        assert!(last(&history) < last(&alone), "{name}: {} and {} alone", last(&history), last(&alone));
        assert!(!page(&format!("{name}-alone")).contains("became unstable"));
    }
}

#[test]
fn a_channel_that_never_changes_is_refused_with_a_reason_or_meets_its_floor() {
    let wave = |k: u32| (0.3 * f64::from(k)).sin();
    let place = Place::with(&on_file("still.csv"));
    place.write("still.csv", table((0..60).map(|k| (wave(k), 7.25))));
    let (_, told) = place.fails(2, "train sine.toml");
    assert!(told.contains("channel b never changes") && told.contains("variance_floor"), "{told}");
    assert!(told.contains("leave it out with `channels`") && !place.path("runs").exists(), "{told}");
    // Both ways out work.
    place.ok("train sine.toml --out part --set data.channels=[\"a\"]");
    let said = place.ok("train sine.toml --out floor --set network.variance_floor=1e-4 --epochs 400");
    assert!(said.contains("Channel b never changes: its predicted variance falls to the variance_floor"), "{said}");
    let generated = place.json("generate floor --no-noise --steps 30 --json");
    let values = numbers(&generated["sequences"][0]["mean"]);
    assert!(values.iter().skip(1).step_by(2).all(|b| (b - 7.25).abs() < 0.5), "{values:?}");
    // A network without variance has nothing against it.
    place.ok("train sine.toml --out mean --set network.variance=false");
    // Nor is one that changes once refused.
    place.write("still.csv", table((0..60).map(|k| (wave(k), if k == 30 { 7.5 } else { 7.25 }))));
    place.ok("train sine.toml --out once");
}

#[test]
fn numbers_without_measure_are_refused_and_large_ones_are_not() {
    let place = Place::with(&on_file("large.csv"));
    let wave = |k: u32| (0.3 * f64::from(k)).sin();
    for (scale, offset, said) in [
        (1e300, 0.0, Some("channel b reaches")),
        (1.1e308, 0.0, Some("channel b reaches")),
        (1e-200, 0.0, Some("the samples of channel b cannot be scaled")),
        (5e-324, 0.0, Some("the samples of channel b cannot be scaled")),
        (1e140, 0.0, None),
        (1e-140, 0.0, None),
        (1.0, 1e12, None),
    ] {
        place.write(
            "large.csv",
            table((0..60).map(|k| (wave(k), scale * wave(k).round() + scale * wave(k) * 0.5 + offset))),
        );
        match said {
            Some(said) => {
                let (_, told) = place.fails(2, "train sine.toml --overwrite --out run");
                assert!(told.contains(said), "{scale:e}: {told}");
            }
            None => {
                place.ok("train sine.toml --overwrite --out run");
                let generated = place.json("generate run --steps 50 --json");
                let all =
                    [&generated["sequences"][0]["mean"], &generated["sequences"][0]["variance"]].map(numbers).concat();
                assert!(all.iter().all(|value| value.is_finite()), "{scale:e}");
            }
        }
    }
    // Data of other units than the learned ones.
    place.write("large.csv", table((0..60).map(|k| (wave(k), wave(k)))));
    place.ok("train sine.toml --overwrite --out run");
    place.write("other.csv", table((0..60).map(|k| (wave(k), 1e30 * wave(k)))));
    for line in ["recognize run other.csv", "generate run --mode open --data other.csv"] {
        let (_, told) = place.fails(2, line);
        assert!(told.contains("channel b lies") && told.contains("in the units of those"), "{told}");
    }
}

#[test]
fn sequences_that_stand_there_twice_and_samples_that_all_agree_are_no_trouble() {
    let place = Place::with(&on_file("twice.csv"));
    let rows = |name: &str| (0..40).map(|k| format!("{name},{:?}\n", (0.3 * f64::from(k)).sin())).collect::<String>();
    place.write("twice.csv", format!("sequence,y\n{}{}{}", rows("a"), rows("b"), rows("c")));
    place.ok("train sine.toml --out run");
    let found = place.json("recognize run twice.csv --starts 3 --epochs 10 --json");
    assert_eq!(found["sequences"].as_array().unwrap().len(), 3);
    assert_eq!(epochs(&place.text("run/history.csv")).last(), Some(&120));
    place.ok("report run");
    place.write("twice.csv", "y\n0\n0\n0\n0\n");
    let (_, told) = place.fails(2, "train sine.toml --overwrite --out run");
    assert!(told.contains("channel y never changes"), "{told}");
    place.ok("train sine.toml --overwrite --out run --set network.variance_floor=0.01");
    place.ok("report run");
}
