//! Training as such: what a run folder holds, what is printed, and that threads and overrides do what they say.

use crate::{Place, SINE, epochs, numbers};

#[test]
fn a_run_folder_holds_all_that_is_promised() {
    let place = Place::with(SINE);
    let out = place.ok("train sine.toml");
    assert!(out.contains("nats per step and channel") && out.contains("a model that always predicts"), "{out}");
    assert!(out.contains("standard deviations correlate"), "{out}");
    let history = place.text("runs/sine/history.csv");
    assert!(
        history.starts_with("epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds,recoveries\n"),
        "{history}"
    );
    assert_eq!(epochs(&history), (0..=120).collect::<Vec<_>>());
    let resolved = place.text("runs/sine/experiment.toml");
    for explicit in ["seed = 1", "sequences = 1", "momentum = 0.9", "variance_floor = 0.0", "history_every = 1"] {
        assert!(resolved.contains(explicit), "{explicit} is missing in\n{resolved}");
    }
    for name in ["checkpoint.safetensors", "best.safetensors"] {
        assert!(place.read(&format!("runs/sine/{name}")).len() > 1000);
    }
}

#[test]
fn the_resolved_experiment_trains_to_the_same_bits() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out a --seed 3 --set network.groups.context.units=4");
    place.write("again.toml", place.read("a/experiment.toml"));
    place.ok("train again.toml --out b");
    assert_eq!(place.read("a/checkpoint.safetensors"), place.read("b/checkpoint.safetensors"));
    let other = place.json("inspect a --json");
    assert_eq!((&other["experiment"]["seed"], &other["groups"][0]["units"]), (&3.into(), &4.into()));
}

#[test]
fn one_two_and_four_threads_give_the_same_bits() {
    let place = Place::with(
        "name = \"curves\"\n[data]\ntask = \"lissajous\"\nsteps = 40\n[[network.groups]]\nname = \"fast\"\nunits = 9\n\
         time_constant = 2.0\nlearns_initial_state = false\n[[network.groups]]\nname = \"slow\"\nunits = 3\n\
         time_constant = 20.0\nreceives_input = false\ndrives_output = false\n\
         [training]\nepochs = 20\noptimiser = \"adam\"\n",
    );
    for threads in [1, 2, 4] {
        place.ok(&format!("train sine.toml --out r{threads} --threads {threads}"));
        for name in ["checkpoint.safetensors", "best.safetensors"] {
            assert_eq!(place.read(&format!("r1/{name}")), place.read(&format!("r{threads}/{name}")), "{threads}");
        }
    }
}

#[test]
fn a_short_training_finds_the_noise_of_the_sine_wave() {
    let place = Place::with(
        &SINE.replace("steps = 80", "steps = 500").replace("[training.momentum]", "[training.adam]\nwarm_up = 0.05"),
    );
    let result = place.json(
        "train sine.toml --epochs 2500 --set training.optimiser=adam --set training.adam.rate=0.01 \
         --set output.checkpoint_every=100000 --json",
    );
    assert_eq!((&result["outcome"], &result["epoch"]), (&"finished".into(), &2500.into()));
    let number = |pointer: &str| result.pointer(pointer).and_then(serde_json::Value::as_f64).unwrap();
    assert!(number("/nll") < number("/constant_model/nll") - 2.0, "{result}");
    assert!(number("/mse") < 0.02 * number("/constant_model/mse"), "{result}");
    assert!(number("/truth/sd_correlation/open") > 0.9, "{result}");
    assert!(number("/best/nll") <= number("/nll"), "{result}");
}

#[test]
fn the_last_epoch_has_a_row_whatever_lies_between_rows() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --set output.history_every=50");
    assert_eq!(epochs(&place.text("runs/sine/history.csv")), [0, 50, 100, 120]);
}

#[test]
fn the_truth_is_compared_step_by_step() {
    let place = Place::with(SINE);
    let result = place.json("train sine.toml --json");
    place.ok("data sinusoid --steps 80 --out wave.csv");
    let truth = place.text("wave.truth.csv");
    // The first sample is an input only.
    let true_sd = truth.lines().skip(2).map(|row| row.rsplit(',').next().unwrap().parse::<f64>().unwrap().sqrt());
    let true_sd: Vec<f64> = true_sd.collect();
    for mode in ["open", "closed"] {
        let generated = place.json(&format!("generate runs/sine --mode {mode} --json"));
        let predicted: Vec<f64> = numbers(&generated["sequences"][0]["variance"]).iter().map(|v| v.sqrt()).collect();
        let expected = scrnn::evaluation::correlation(&predicted, &true_sd).unwrap();
        let told = result["truth"]["sd_correlation"][mode].as_f64().unwrap();
        assert!((told - expected).abs() < 1e-9, "{mode}: {told}, {expected}");
    }
}

#[test]
fn variances_that_are_constant_are_compared_by_their_mean() {
    let curves = SINE.replace("task = \"sinusoid\"\nsteps = 80", "task = \"lissajous\"\nsteps = 60\nsequences = 2");
    let place = Place::with(&curves);
    let result = place.json("train sine.toml --json");
    let generated = place.json("generate runs/sine --mode open --json");
    let mut errors = Vec::new();
    for (sequence, truth) in generated["sequences"].as_array().unwrap().iter().zip([0.01_f64.powi(2), 0.03_f64.powi(2)])
    {
        let variances = numbers(&sequence["variance"]);
        for channel in 0..2 {
            let mean = variances.iter().skip(channel).step_by(2).sum::<f64>() / 59.0;
            errors.push((mean - truth).abs() / truth);
        }
    }
    let expected = errors.iter().sum::<f64>() / 4.0;
    let told = result["truth"]["mean_variance_error"]["open"].as_f64().unwrap();
    assert!((told - expected).abs() < 1e-9 * expected, "{told}, {expected}");
}

#[test]
fn the_closed_loop_of_a_limit_cycle_has_a_truth_of_its_own() {
    let place = Place::with(
        &SINE.replace("task = \"sinusoid\"\nsteps = 80", "task = \"limit-cycle\"\nsteps = 60\nsequences = 1"),
    );
    let result = place.json("train sine.toml --json");
    let generated = place.json("generate runs/sine --json");
    let sequence = &generated["sequences"][0];
    let predicted: Vec<f64> = numbers(&sequence["variance"]).iter().map(|v| v.sqrt()).collect();
    let first: f64 =
        place.ok("data limit-cycle --steps 1 --sequences 1").trim_end().rsplit(',').next().unwrap().parse().unwrap();
    let mut last = vec![first];
    last.extend(numbers(&sequence["sample"]));
    let true_sd: Vec<f64> = last[..59].iter().map(|y| 0.03 * y.max(0.0)).collect();
    let expected = scrnn::evaluation::correlation(&predicted, &true_sd).unwrap();
    let told = result["truth"]["sd_correlation"]["closed"].as_f64().unwrap();
    assert!((told - expected).abs() < 1e-9, "{told}, {expected}");
}

#[test]
fn no_epochs_write_the_initial_network() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --epochs 0");
    let seen = place.json("inspect runs/sine --json");
    assert_eq!((&seen["epoch"], &seen["best"]["epoch"]), (&0.into(), &0.into()));
    let history = place.text("runs/sine/history.csv");
    assert_eq!(epochs(&history), [0]);
}

#[test]
fn a_network_without_variance_learns_and_generates() {
    let place = Place::with(SINE);
    let out = place.ok("train sine.toml --set network.variance=false --set training.momentum.rate=0.01");
    assert!(out.contains("mean squared error") && !out.contains("nats"), "{out}");
    let history = place.text("runs/sine/history.csv");
    assert!(history.lines().nth(1).unwrap().starts_with("0,,"), "{history}");
    let header = place.ok("generate runs/sine --steps 2");
    assert!(header.starts_with("sequence,step,mean_y,sample_y\n"), "{header}");
    place.ok("data sinusoid --steps 50 --out s.csv");
    let found = place.json("recognize runs/sine s.csv --starts 2 --epochs 5 --json");
    assert!(found["sequences"][0]["ln_likelihood"].is_null() && found["sequences"][0]["error"].is_number());
}

#[test]
fn every_experiment_that_is_shipped_is_valid() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/experiments");
    let place = Place::new();
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        place.write("experiment.toml", std::fs::read(&path).unwrap());
        place.ok("train experiment.toml --epochs 0 --set data.steps=50");
        assert!(place.path(&format!("runs/{name}/checkpoint.safetensors")).exists(), "{name} is named otherwise");
        names.push(name);
    }
    for name in ["sinusoid", "lissajous", "limit_cycle", "sinusoid_fast", "lissajous_fast", "limit_cycle_fast"] {
        assert!(names.iter().any(|other| other == name), "{name}");
    }
}

#[test]
fn divergence_is_reported_rolled_back_and_saved() {
    let place = Place::with(SINE);
    let (_, told) =
        place.fails(3, "train sine.toml --set training.momentum.rate=1e9 --set training.on_divergence=stop");
    assert!(told.contains("diverged at epoch") && told.contains("is not finite"), "{told}");
    assert!(told.contains("rolled back to epoch"), "{told}");
    let seen = place.json("inspect runs/sine --json");
    assert!(seen["score"]["nll"].is_number(), "{seen}");
    let generated = place.ok("generate runs/sine --best --steps 3");
    assert_eq!(generated.lines().count(), 4);
    let output =
        place.run("train sine.toml --out r --set training.momentum.rate=1e9 --set training.on_divergence=stop --json");
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["outcome"], "diverged");
    assert!(result["divergence"]["quantity"].is_string(), "{result}");
}

#[test]
fn samples_out_of_reach_bring_a_warning() {
    let place = Place::with(SINE);
    place.write("far.csv", "y\n1\n2\n3\n1\n2\n3\n");
    place.write(
        "far.toml",
        SINE.replace("task = \"sinusoid\"\nsteps = 80", "files = [\"far.csv\"]\nscaling = \"none\""),
    );
    let output = place.run("train far.toml");
    let err = String::from_utf8(output.stderr).unwrap();
    assert!(err.contains("6 of 6 samples of channel y lie outside"), "{err}");
    let output = place.run("train far.toml --out fit --set data.scaling=fit");
    assert!(!String::from_utf8(output.stderr).unwrap().contains("outside"));
}

#[test]
fn scaling_can_be_given_and_sets_how_far_predictions_reach() {
    let place = Place::with(&SINE.replace("task = \"sinusoid\"\nsteps = 80", "files = [\"far.csv\"]"));
    place.write("far.csv", "y\n1\n2\n3\n1\n2\n3\n");
    for (run, scaling, low, high) in [
        ("fit", "\"fit\"", 0.75, 3.25),
        ("ranges", "{ranges=[[0,4]]}", -0.5, 4.5),
        ("constants", "{offset=[2],scale=[0.5]}", 0.0, 4.0),
        ("none", "none", -1.0, 1.0),
    ] {
        place.ok(&format!("train sine.toml --out {run} --epochs 2 --set data.scaling={scaling}"));
        let channel = &place.json(&format!("inspect {run} --json"))["channels"][0];
        let near = |key: &str, value: f64| (channel[key].as_f64().unwrap() - value).abs() < 1e-12;
        assert!(near("low", low) && near("high", high), "{run}: {channel}");
    }
    let (_, told) = place.fails(2, "train sine.toml --out r --set data.scaling={ranges=[[0,4],[0,1]]}");
    assert!(told.contains("2 ranges") && told.contains("1 channels"), "{told}");
    let (_, told) = place.fails(2, "train sine.toml --out r --set data.scaling={range=[[0,4]]}");
    assert!(told.contains("scaling is one of \"none\", \"fit\""), "{told}");
}
