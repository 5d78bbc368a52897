//! `scrnn reproduce` and `scrnn report` from outside: what they leave behind, and that it can be trusted. Networks are
//! hardly trained here; how well they do in earnest stands in docs/reproduction.md.

use std::process::{Command, Stdio};

use serde_json::Value;

use crate::resuming::wait_for;
use crate::{Place, SINE};

/// What a page needs to stand on its own, and to be read by all.
fn check_page(whole: &str) {
    // The network that a page holds is tried in tests/browser_pages.rs; all else has no script.
    let html = &match whole.split_once("<div id=\"playground\" ") {
        Some((before, rest)) => {
            let (_, after) = rest.split_once("</script>\n</div>").expect("the applet ends");
            format!("{before}{after}")
        }
        None => whole.to_owned(),
    };
    let beyond = html.replace("http://www.w3.org/2000/svg", "");
    for part in ["http://", "https://", "<script", "<link rel=\"stylesheet", "@import", "url(", "src=", "NaN", "inf\""]
    {
        assert!(!beyond.contains(part), "the page has {part}");
    }
    assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
    for part in ["name=\"viewport\"", "prefers-color-scheme:dark", "@media print"] {
        assert!(html.contains(part), "{part} is missing");
    }
    let figures = html.matches("<figure").count();
    assert!(figures > 2, "{figures} figures");
    for part in ["<figcaption>", "<svg ", "role=\"img\""] {
        assert_eq!(html.matches(part).count(), figures, "{part}");
    }
    // The page's own, one of each figure, and of what is named within it.
    assert!(html.matches("<title>").count() > figures);
}

/// The names of the figures on a page, each of which must lie beside it as SVG and CSV.
fn check_figures(place: &Place, folder: &str) -> Vec<String> {
    let html = place.text(&format!("{folder}/report.html"));
    check_page(&html);
    let names: Vec<String> =
        html.split("<figure id=\"").skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()).collect();
    for name in &names {
        let svg = place.text(&format!("{folder}/figures/{name}.svg"));
        assert!(svg.starts_with("<svg ") && svg.contains("<text") && !svg.contains("var("), "{name}");
        let csv = place.text(&format!("{folder}/figures/{name}.csv"));
        assert!(csv.starts_with("panel,series,x,y\n") && csv.lines().count() > 2, "{name}");
    }
    names
}

/// The metrics without what a clock says.
fn without_times(mut metrics: Value) -> Value {
    for key in ["seconds", "machine", "command", "times"] {
        metrics.as_object_mut().unwrap().remove(key).unwrap();
    }
    for seed in metrics["seeds"].as_array_mut().unwrap() {
        for key in ["seconds", "seconds_of_evaluation", "threads"] {
            seed.as_object_mut().unwrap().remove(key);
        }
        for training in seed["trainings"].as_array_mut().unwrap() {
            training.as_object_mut().unwrap().remove("seconds");
        }
    }
    metrics
}

fn metrics(place: &Place, folder: &str) -> Value {
    serde_json::from_slice(&place.read(&format!("{folder}/metrics.json"))).unwrap()
}

#[test]
fn the_sine_wave_is_reproduced_with_all_that_belongs_to_it() {
    let place = Place::new();
    let table = place.ok("reproduce sinusoid --epochs 60 --seeds 3 --seed 4 --out wave");
    for part in
        ["seed 4", "seed 6", "correlation of standard deviations, closed loop", "above 0.99", "wave/report.html"]
    {
        assert!(table.contains(part), "{part} is missing in\n{table}");
    }
    assert_eq!(check_figures(&place, "wave"), ["time", "calibration", "learning-s-ctrnn"]);
    let found = metrics(&place, "wave");
    assert_eq!((found["experiment"].as_str(), found["preset"].as_str()), (Some("sinusoid"), Some("fast")));
    assert_eq!(found["seeds"].as_array().unwrap().len(), 3);
    assert_eq!(found["settings"][0]["training"]["epochs"], 60);
    for key in ["sd_correlation_closed", "sd_correlation_held_out", "distance_closed", "variance_error_mean"] {
        assert!(found["seeds"][2]["findings"][key].is_number(), "{key}");
    }
    let floor = found["seeds"][0]["findings"]["assessment"]["entropy_of_noise"].as_f64().unwrap();
    assert!((floor + 1.919).abs() < 0.001, "{floor}");
    // Each seed has noise and weights of its own, and its run folder is one like any other.
    assert_ne!(found["seeds"][0]["trainings"][0]["nll"], found["seeds"][1]["trainings"][0]["nll"]);
    assert_eq!(place.json("inspect wave/seed-5 --json")["epoch"], 60);

    // Again: nothing is trained a second time, and all comes to the same.
    let checkpoint = place.read("wave/seed-5/checkpoint.safetensors");
    let again = place.json("reproduce sinusoid --epochs 60 --seeds 3 --seed 4 --out wave --json");
    assert_eq!(without_times(again), without_times(found.clone()));
    assert_eq!(place.read("wave/seed-5/checkpoint.safetensors"), checkpoint);
    // One thread, one seed at a time: the same bits.
    place.ok("reproduce sinusoid --epochs 60 --seeds 3 --seed 4 --out serial --threads 1");
    assert_eq!(without_times(metrics(&place, "serial")), without_times(found));
    assert_eq!(place.read("serial/seed-5/checkpoint.safetensors"), checkpoint);
}

#[cfg(unix)]
#[test]
fn an_interrupted_reproduction_leaves_no_page_and_goes_on() {
    let place = Place::new();
    let line = "reproduce sinusoid --epochs 3000 --seeds 2 --threads 2 --out";
    place.ok(&format!("{line} whole"));
    let child = Command::new(env!("CARGO_BIN_EXE_scrnn"))
        .current_dir(&place.0)
        .args(line.split_whitespace())
        .arg("cut")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for(&place, "cut/seed-1/checkpoint.safetensors");
    wait_for(&place, "cut/seed-2/checkpoint.safetensors");
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{err}");
    assert!(err.contains("the same command goes on"), "{err}");
    assert!(!place.path("cut/report.html").exists() && !place.path("cut/metrics.json").exists());
    place.ok(&format!("{line} cut"));
    assert_eq!(without_times(metrics(&place, "cut")), without_times(metrics(&place, "whole")));
}

/// How many threads of a command worked: those that were seen twice and neither wait for signals nor write messages or progress.
#[cfg(target_os = "linux")]
fn workers(place: &Place, line: &str) -> usize {
    let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
    let silent =
        command.current_dir(&place.0).args(line.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = silent.spawn().unwrap();
    let tasks = format!("/proc/{}/task", child.id());
    let mut seen = std::collections::HashMap::new();
    while child.try_wait().unwrap().is_none() {
        for task in std::fs::read_dir(&tasks).into_iter().flatten().flatten() {
            // A thread gets its name once it runs, which on a busy machine is late: the last look counts.
            let name = std::fs::read_to_string(task.path().join("comm")).unwrap_or_default();
            if !name.is_empty() {
                let (looks, last) = seen.entry(task.file_name()).or_insert((0, String::new()));
                *looks += 1;
                *last = name.trim_end().to_owned();
            }
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert!(child.wait().unwrap().success(), "{line}");
    let works = |name: &str| !["signals", "stderr", "progress"].contains(&name);
    seen.values().filter(|(looks, name)| *looks > 1 && works(name)).count()
}

#[cfg(target_os = "linux")]
#[test]
fn one_thread_means_one_for_seeds_and_worlds_alike() {
    let place = Place::new();
    for line in ["reproduce sinusoid --epochs 600 --seeds 3", "data reach --sequences 4 --steps 24"] {
        let workers = |threads: usize, attempt: usize| {
            let out = format!("{}-{threads}-{attempt}.csv", line.len());
            self::workers(&place, &format!("{line} --threads {threads} --out {out}"))
        };
        assert_eq!(workers(1, 0), 1, "{line}");
        // Threads that live shortly are not seen by every look on a busy machine.
        assert!((0..10).any(|attempt| workers(2, attempt) > 1), "{line}");
    }
}

#[test]
fn other_settings_need_another_folder_or_permission_to_overwrite() {
    let place = Place::new();
    place.ok("reproduce sinusoid --epochs 20 --out wave");
    let (_, told) = place.fails(5, "reproduce sinusoid --epochs 30 --out wave");
    assert!(told.contains("training.epochs") && told.contains("--overwrite"), "{told}");
    // The page that is there still speaks of the trainings that are there.
    check_page(&place.text("wave/report.html"));
    place.ok("reproduce sinusoid --epochs 30 --out wave --overwrite");
    assert_eq!(metrics(&place, "wave")["seeds"][0]["trainings"][0]["epochs"], 30);
}

#[test]
fn the_curves_are_compared_with_the_tables_of_the_thesis() {
    let place = Place::new();
    let table = place.ok("reproduce lissajous --epochs 2 --out curves");
    for part in ["patterns regenerated, of 12", "trials of recognition that succeed, of 240", "missed"] {
        assert!(table.contains(part), "{part} is missing in\n{table}");
    }
    let names = check_figures(&place, "curves");
    for name in [
        "training-data",
        "closed-loop-ctrnn",
        "closed-loop",
        "contexts",
        "variances",
        "initial-states",
        "calibration",
        "learning-s-ctrnn",
        "learning-ctrnn",
    ] {
        assert!(names.contains(&name.to_owned()), "{name} is missing in {names:?}");
    }
    let html = place.text("curves/report.html");
    for part in ["Table 3.1", "Table 3.2", "0.000084", "Fig. 3.5", "Fig. 3.2A"] {
        assert!(html.contains(part), "{part}");
    }
    let found = &metrics(&place, "curves")["seeds"][0]["findings"];
    assert_eq!(found["patterns"].as_array().unwrap().len(), 12);
    assert_eq!(found["recognition"]["trials"], 240);
    assert!(found["clustering_all"]["p_value"].is_number() && found["ctrnn"]["errors"][11].is_number());
}

#[test]
fn the_oscillator_is_judged_on_sequences_that_were_not_learned() {
    let place = Place::new();
    place.ok("reproduce limit-cycle --epochs 20 --out cycle");
    assert_eq!(check_figures(&place, "cycle"), ["time", "phase", "calibration", "learning-s-ctrnn"]);
    let found = metrics(&place, "cycle");
    let oscillator = &found["seeds"][0]["findings"]["oscillator"];
    assert!((oscillator["period"].as_f64().unwrap() - 75.5).abs() < 2.0, "{oscillator}");
    assert!(oscillator["cycles"].as_u64().unwrap() > 39_000);
    // Times are reported beside the goals, and none asks for them.
    let goals: Vec<&str> =
        found["verdicts"].as_array().unwrap().iter().map(|one| one["goal"].as_str().unwrap()).collect();
    assert_eq!((goals.len(), goals.iter().any(|goal| goal.contains("time"))), (2, false));
    assert_eq!(found["times"][1]["key"], "evaluation");
    assert!(found["times"][1]["mean"].as_f64().unwrap() > 0.0);

    // What was evaluated is not evaluated again.
    let kept = place.text("cycle/seed-1/evaluation.toml");
    assert!(kept.contains("swings of the oscillator"), "{kept}");
    let again = place.json("reproduce limit-cycle --epochs 20 --out cycle --json");
    assert_eq!(place.text("cycle/seed-1/evaluation.toml"), kept);
    assert_eq!(without_times(again), without_times(found));
}

#[test]
fn a_run_of_ones_own_becomes_a_page() {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run");
    assert_eq!(place.ok("report run").trim(), "run/report.html");
    assert_eq!(check_figures(&place, "run"), ["on-its-own-1", "ahead-1", "calibration", "learning"]);
    place.ok("report run --best --out best");
    check_figures(&place, "best");
    // On data of one's own, in their units, without variance and without a known truth.
    place.ok("data lissajous --sequences 3 --steps 60 --out three.csv");
    let experiment = "name = \"mine\"\n[data]\nfiles = [\"three.csv\"]\n[network]\nvariance = false\n[[network.groups]]\n\
                      name = \"c\"\nunits = 5\ntime_constant = 2.0\n[training]\nepochs = 20\noptimiser = \"adam\"\n";
    place.write("mine.toml", experiment);
    place.ok("train mine.toml");
    place.ok("report runs/mine");
    let names = ["plane-1-2", "on-its-own-1", "on-its-own-2", "ahead-1", "ahead-2", "initial-states", "learning"];
    assert_eq!(check_figures(&place, "runs/mine"), names);
    let (_, told) = place.fails(2, "report mine.toml");
    assert!(told.contains("is not a run folder"), "{told}");
}
