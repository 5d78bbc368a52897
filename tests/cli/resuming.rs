//! Runs that stop and go on: killed, interrupted, prolonged, or refused because something changed.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::{Place, SINE, epochs, sine_in_batches, sine_with_adam, sine_with_lbfgs};

/// The files that must come out the same.
const RESULTS: [&str; 2] = ["checkpoint.safetensors", "best.safetensors"];

pub fn same_results(place: &Place, a: &str, b: &str) {
    for name in RESULTS {
        assert!(place.read(&format!("{a}/{name}")) == place.read(&format!("{b}/{name}")), "{name} differs");
    }
    let [a, b] = [a, b].map(|run| epochs(&place.text(&format!("{run}/history.csv"))));
    assert_eq!(a, b);
}

fn start(place: &Place, line: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_scrnn"))
        .current_dir(&place.0)
        .args(line.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

pub fn wait_for(place: &Place, name: &str) {
    let begun = Instant::now();
    while !place.path(name).exists() {
        assert!(begun.elapsed() < Duration::from_secs(30), "{name} does not appear");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_run_that_is_killed_again_and_again_comes_to_the_same_bits() {
    for experiment in [SINE.to_owned(), sine_with_adam(), sine_in_batches(), sine_with_lbfgs()] {
        let place = Place::with(&experiment.replace("epochs = 120", "epochs = 6000"));
        place.ok("train sine.toml --out whole --set output.checkpoint_every=3000");
        let mut killed = 0;
        for pause in [3, 6, 12, 25, 50, 90, 130, 170] {
            let mut child = start(&place, "train sine.toml --out cut --resume");
            std::thread::sleep(Duration::from_millis(pause));
            killed += usize::from(child.try_wait().unwrap().is_none());
            child.kill().unwrap();
            child.wait().unwrap();
        }
        let reached = place.json("inspect cut --json")["epoch"].as_u64().unwrap();
        assert!(killed >= 3 && reached > 0, "{killed} were killed, the last at epoch {reached}");
        place.ok("train sine.toml --out cut --resume --set output.checkpoint_every=3000");
        same_results(&place, "whole", "cut");
        // experiment, checkpoint, best, history, lock, and nothing half-written
        assert_eq!(std::fs::read_dir(place.path("cut")).unwrap().count(), 5);
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_and_says_how_to_go_on() {
    let place = Place::with(&sine_with_adam().replace("epochs = 120", "epochs = 40000"));
    place.ok("train sine.toml --out whole");
    let child = Command::new(env!("CARGO_BIN_EXE_scrnn"))
        .current_dir(&place.0)
        .args(["train", "sine.toml", "--out", "cut", "--set", "output.checkpoint_every=100000"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for(&place, "cut/checkpoint.safetensors");
    std::thread::sleep(Duration::from_millis(50));
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{err}");
    assert!(err.contains("scrnn train cut --resume"), "{err}");
    let stopped = place.json("inspect cut --json")["epoch"].as_u64().unwrap();
    assert!(stopped < 40000);
    place.ok("train cut --resume");
    same_results(&place, "whole", "cut");
}

#[test]
fn a_longer_momentum_run_goes_on_from_a_shorter_one() {
    // The last rate is too large: there the best epoch lies in the first part.
    for (extra, rate, best) in
        [("", "1e-3", 150), ("[training.momentum.adaptive_rate]\n", "1e-3", 142), ("", "0.025", 45)]
    {
        let experiment = SINE.replace("[output]", &format!("{extra}[output]\nhistory_every = 7"));
        let experiment = experiment.replace("[training]", "[training]\non_divergence = \"stop\"");
        let place = Place::with(&experiment.replace("rate = 1e-3", &format!("rate = {rate}")));
        place.ok("train sine.toml --out whole --epochs 150");
        place.ok("train sine.toml --out parts --epochs 91");
        place.ok("train parts --resume --epochs 150");
        same_results(&place, "whole", "parts");
        let seen = place.json("inspect parts --json")["best"]["epoch"].as_u64().unwrap();
        assert!(seen.abs_diff(best) <= 5, "{seen}");
    }
}

#[test]
fn a_training_in_float32_goes_on_in_float32_and_says_so() {
    let place = Place::with(SINE);
    let single = "--epochs 150 --set training.precision=f32";
    let found =
        place.json(&format!("train sine.toml --out whole {single} --threads 1 --instruction-set portable --json"));
    place.ok("train sine.toml --out parts --epochs 91 --set training.precision=f32 --threads 2");
    place.ok("train parts --resume --epochs 150");
    same_results(&place, "whole", "parts");
    let double = place.json("train sine.toml --out double --epochs 150 --json");
    let nll = |found: &serde_json::Value| found["nll"].as_f64().unwrap();
    assert!(nll(&found) != nll(&double) && (nll(&found) - nll(&double)).abs() < 1e-3, "{found} {double}");
    let noted = |run: &str| {
        String::from_utf8_lossy(&place.read(&format!("{run}/checkpoint.safetensors")))
            .contains(r#"\"numerics\":\"f32\""#)
    };
    assert!(noted("parts") && !noted("double"));
    let (_, told) = place.fails(5, "train parts --resume --epochs 160 --set training.precision=f64");
    assert!(told.contains("training.precision"), "{told}");
    let (_, told) = place.fails(2, "train sine.toml --out other --set training.precision=f16");
    assert!(told.contains("f16") && told.contains("f32"), "{told}");
}

#[test]
fn resuming_a_finished_run_changes_nothing() {
    let place = Place::with(&sine_with_adam());
    let first = place.json("train sine.toml --out run --json");
    let before = place.read("run/checkpoint.safetensors");
    let again = place.json("train run --resume --json");
    assert_eq!(before, place.read("run/checkpoint.safetensors"));
    assert_eq!((&first["nll"], &first["epoch"]), (&again["nll"], &again["epoch"]));
}

#[test]
fn a_run_killed_before_its_first_checkpoint_starts_anew() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out whole");
    std::fs::create_dir(place.path("cut")).unwrap();
    place.write("cut/experiment.toml", place.read("whole/experiment.toml"));
    place.write("cut/history.csv", "epoch,nll\n0,1");
    place.ok("train cut --resume");
    same_results(&place, "whole", "cut");
}

#[test]
fn history_beyond_the_checkpoint_is_cut_off() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run");
    let history = place.text("run/history.csv");
    let last = history.lines().last().unwrap().replacen("120,", "121,", 1);
    place.write("run/history.csv", format!("{history}{last}\n122,0.1,0."));
    place.ok("train run --resume --epochs 140");
    assert_eq!(epochs(&place.text("run/history.csv")), (0..=140).collect::<Vec<_>>());
}

#[test]
fn a_changed_experiment_is_refused_with_the_difference() {
    let place = Place::with(&sine_with_adam());
    place.ok("train sine.toml --out run");
    let before = place.read("run/checkpoint.safetensors");
    let (_, told) = place.fails(5, "train run --resume --seed 2 --set training.adam.rate=0.5");
    assert!(told.contains("seed: 1 -> 2") && told.contains("training.adam.rate: 0.001 -> 0.5"), "{told}");
    let (_, told) = place.fails(5, "train run --resume --epochs 200");
    assert!(told.contains("training.epochs: 120 -> 200") && told.contains("shapes the rate"), "{told}");
    let (_, told) = place.fails(5, "train run --resume --set training.optimiser=momentum");
    assert!(told.contains("training.optimiser: \"adam\" -> \"momentum\""), "{told}");
    assert_eq!(before, place.read("run/checkpoint.safetensors"));
    place.ok("train run --resume --set output.history_every=5 --set training.recompute=true");
}

#[test]
fn lbfgs_makes_the_last_epochs_and_their_number_is_part_of_the_experiment() {
    let place = Place::with(&sine_with_lbfgs());
    let found = place.json("train sine.toml --out run --set output.history_every=1 --json");
    // 40 epochs of Adam, whose rate ends at 0; then steps of 1 as a rule.
    let history = place.text("run/history.csv");
    let column = |name: &str| {
        let index = history.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
        let cells = history.lines().skip(1).map(move |line| line.split(',').nth(index).unwrap());
        cells.map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<f64>>()
    };
    let (rate, nll) = (column("rate_shared"), column("nll"));
    assert_eq!((rate.len(), rate[40]), (121, 1.0));
    assert!(rate[..40].iter().all(|&rate| rate <= 1e-3), "{rate:?}");
    assert!(rate[41..].iter().filter(|&&step| step == 1.0).count() > 40, "{rate:?}");
    assert_eq!(found["nll"].as_f64(), Some(nll[120]));
    assert!(nll[120] < nll[40] - 0.5, "{} to {}", nll[40], nll[120]);
    assert!(place.ok("inspect run").contains("adam, then L-BFGS"));
    let (_, told) = place.fails(5, "train run --resume --epochs 200");
    assert!(told.contains("training.epochs: 120 -> 200") && told.contains("where L-BFGS begins"), "{told}");
    let (_, told) = place.fails(2, "train sine.toml --out other --set training.lbfgs.share=1.5");
    assert!(told.contains("`training.lbfgs.share` is 1.5") && told.contains("from 0 to 1"), "{told}");
}

#[test]
fn fewer_epochs_than_are_done_are_refused() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run");
    let (_, told) = place.fails(5, "train run --resume --epochs 60");
    assert!(told.contains("training.epochs: 120 -> 60") && told.contains("already at epoch 120"), "{told}");
}

#[test]
fn changed_data_are_refused_and_moved_data_are_not() {
    let place = Place::new();
    place.ok("data sinusoid --steps 60 --out wave.csv");
    place.write("sine.toml", SINE.replace("task = \"sinusoid\"\nsteps = 80", "files = [\"wave.csv\"]"));
    place.ok("train sine.toml --out run");
    let wave = place.text("wave.csv");
    let last = wave.trim_end().rfind('\n').unwrap();
    place.write("wave.csv", &wave[..last + 1]);
    let (_, told) = place.fails(5, "train run --resume --epochs 130");
    assert!(told.contains("the data changed") && told.contains("samples in each sequence: 60 -> 59"), "{told}");
    let (_, told) = place.fails(2, "generate run --mode open");
    assert!(told.contains("the data changed") && told.contains("--data"), "{told}");
    place.write("elsewhere.csv", wave);
    place.write("sine.toml", place.text("sine.toml").replace("wave.csv", "elsewhere.csv"));
    place.ok("train sine.toml --out run --resume --epochs 130");
}

#[test]
fn a_folder_in_use_is_refused() {
    let place = Place::with(&SINE.replace("epochs = 120", "epochs = 100000000"));
    let mut child = start(&place, "train sine.toml --out run");
    wait_for(&place, "run/checkpoint.safetensors");
    let (_, told) = place.fails(5, "train sine.toml --out run --resume");
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(told.contains("another process is training in run"), "{told}");
}

#[test]
fn a_run_is_not_overwritten_unless_asked() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run");
    let before = place.read("run/checkpoint.safetensors");
    let (_, told) = place.fails(5, "train sine.toml --out run --seed 2");
    assert!(told.contains("already holds a run") && told.contains("--overwrite"), "{told}");
    place.ok("train sine.toml --out run --seed 2 --overwrite");
    assert_ne!(before, place.read("run/checkpoint.safetensors"));
    place.ok("train sine.toml --out fresh --seed 2");
    same_results(&place, "run", "fresh");
}
