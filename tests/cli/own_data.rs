//! Data without an experiment: trained on, gone on with, told about, converted, drawn.

use assert_cmd::Command;
use serde_json::json;

use crate::Place;

/// Two sequences of two channels, named and timed.
fn table(factor: f64) -> String {
    let mut text = "sequence,time,shoulder,elbow\n".to_owned();
    for (name, phase) in [("reach", 0.0_f64), ("wave", 2.0)] {
        for k in 0..60 {
            let angle = f64::from(k) * 0.4;
            let (a, b) = (factor * (angle + phase).sin(), factor * (0.5 * (angle - phase).cos() + 1.0));
            text += &format!("{name},{:.2},{a},{b}\n", 0.02 * f64::from(k));
        }
    }
    text
}

#[test]
fn data_alone_are_learned_with_settings_that_are_explained() {
    let place = Place::new();
    place.write("mine.csv", table(1.0));
    let (said, told) = place.says("train mine.csv --epochs 300 --seed 2");
    assert!(
        told.contains("learns 2 sequences of 60 samples, 50 Hz, channels: shoulder, elbow (from mine.csv)"),
        "{told}"
    );
    assert!(told.contains("without an experiment file:") && told.contains("300 epochs"), "{told}");
    assert!(said.contains("shoulder") && said.contains(" %  "), "{said}");
    let text = String::from_utf8(place.read("runs/mine/experiment.toml")).unwrap();
    assert!(text.contains("# Given on the command line.\nepochs = 300\n"), "{text}");
    assert!(text.contains("# From mine.csv.\n") && text.contains("seed = 2\n"), "{text}");

    // The file trains to the same bits as an experiment of one's own.
    place.write("own.toml", &text);
    place.ok("train own.toml --out own");
    let nll = |run: &str| place.json(&format!("inspect {run} --json"))["score"]["nll"].as_f64().unwrap().to_bits();
    assert_eq!(nll("own"), nll("runs/mine"));

    // Going on keeps the experiment and its words, by the data or by the folder.
    place.fails(5, "train mine.csv");
    place.ok("train mine.csv --resume");
    place.ok("train runs/mine --resume");
    assert_eq!(String::from_utf8(place.read("runs/mine/experiment.toml")).unwrap(), text);
    let (_, told) = place.fails(2, "train runs/mine");
    assert!(told.contains("is a run folder") && told.contains("--resume"), "{told}");
}

#[test]
fn folders_patterns_and_lists_of_files_are_learned_together() {
    let place = Place::new();
    std::fs::create_dir(place.path("demos")).unwrap();
    for (name, factor) in [("a", 1.0), ("b", 1.1), ("c", 0.9)] {
        place.write(&format!("demos/{name}.csv"), table(factor));
    }
    for (given, out, count) in [
        ("demos", "runs/demos", 6),
        ("demos/[ab].csv --out patterns", "patterns", 4),
        ("demos/a.csv demos/c.csv --out list", "list", 4),
    ] {
        place.ok(&format!("train {given} --epochs 2"));
        let seen = place.json(&format!("inspect {out} --json"));
        assert_eq!(seen["sequences"].as_array().unwrap().len(), count, "{seen}");
    }
    // An experiment learns other data than those that it names.
    let text = String::from_utf8(place.read("list/experiment.toml")).unwrap();
    place.write("own.toml", text);
    place.ok("train own.toml --files demos/b.csv --channels elbow --out other");
    let seen = place.json("inspect other --json");
    assert_eq!((&seen["sequences"], seen["channels"].as_array().unwrap().len()), (&json!(["reach", "wave"]), 1));
    let (_, told) = place.fails(2, "train own.toml demos/b.csv");
    assert!(told.contains("is an experiment file") && told.contains("--files"), "{told}");
    let (_, told) = place.fails(2, "train demos --files demos/b.csv");
    assert!(told.contains("data files are given twice"), "{told}");
    let (_, told) = place.fails(4, "train nothing.csv");
    assert!(told.contains("cannot read ") && told.contains("nothing.csv"), "{told}");
    std::fs::create_dir(place.path("empty")).unwrap();
    let (_, told) = place.fails(2, "train empty");
    assert!(told.contains("no data file is in this folder"), "{told}");
    place.write("sheet.xlsx", [0x50, 0x4b, 3, 4, 0, 0, 0, 0]);
    let (_, told) = place.fails(2, "train sheet.xlsx");
    assert!(told.contains("sheet.xlsx"), "{told}");
}

#[test]
fn sequences_are_called_by_their_names_in_and_out() {
    let place = Place::new();
    place.write("mine.csv", table(1.0));
    place.ok("train mine.csv --epochs 20");
    let by = |wanted: &str| place.json(&format!("generate runs/mine --sequence {wanted} --steps 3 --json"));
    assert_eq!(by("wave"), by("2"));
    assert_eq!(by("reach")["sequences"][0]["name"], "reach");
    let (_, told) = place.fails(2, "generate runs/mine --sequence run");
    assert!(told.contains("there is no learned sequence run") && told.contains("reach, wave"), "{told}");
    place.fails(2, "generate runs/mine --sequence 0");
    place.fails(2, "generate runs/mine --sequence 3");
    place.fails(2, "recognize runs/mine mine.csv --online --sequence 3");
    place.ok("recognize runs/mine mine.csv --online --sequence wave");
    // Names are in every kind of file.
    for file in ["out.csv", "out.txt", "out.npz"] {
        place.ok(&format!("generate runs/mine --out {file}"));
        let seen = place.json(&format!("inspect {file} --json"));
        let names: Vec<_> = seen["sequences"].as_array().unwrap().iter().map(|one| &one["name"]).collect();
        assert_eq!(names, ["reach", "wave"], "{file}");
    }
    place.ok("recognize runs/mine mine.csv --starts 2 --epochs 3 --out states.npz");
    let seen = place.json("inspect states.npz --axes tc --json");
    assert_eq!((&seen["sequences"][1]["name"], &seen["channels"][0]["name"]), (&json!("wave"), &json!("context1")));
    assert_eq!(
        place.json("generate runs/mine --initial-state states.npz --steps 2 --json")["sequences"][1]["name"],
        "wave"
    );
}

#[test]
fn data_far_from_what_was_learned_are_told() {
    let place = Place::new();
    place.write("mine.csv", table(1.0));
    place.write("degrees.csv", table(57.295_779_5));
    place.ok("train mine.csv --epochs 20");
    let (_, quiet) = place.says("recognize runs/mine mine.csv --starts 2 --epochs 2");
    assert!(!quiet.contains("warning"), "{quiet}");
    for line in [
        "recognize runs/mine degrees.csv --starts 2 --epochs 2",
        "recognize runs/mine degrees.csv --online",
        "generate runs/mine --mode open --data degrees.csv",
    ] {
        let (_, told) = place.says(line);
        assert!(told.contains("warning: degrees.csv: channel shoulder reaches -57.2"), "{line}: {told}");
        assert!(told.contains("was learned: degrees and radians?"), "{line}: {told}");
    }
    let mut command = Command::cargo_bin("scrnn").unwrap();
    command.current_dir(&place.0).args(["recognize", "runs/mine", "-", "--online"]);
    let output = command.write_stdin("0.5,1\n0.4,1.1\n40,1.1\n41,1\n").output().unwrap();
    let [said, told] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(said.lines().count(), 5, "{said}");
    assert_eq!(told.matches("channel shoulder reaches 40, and ").count(), 1, "{told}");
    assert!(told.contains("warning: line 3: "), "{told}");
}

#[test]
fn data_go_through_formats_and_are_never_written_over() {
    let place = Place::new();
    place.write("mine.csv", table(1.0));
    let seen = |file: &str| {
        let mut seen = place.json(&format!("inspect {file} --json"));
        [seen["channels"].take(), seen["sequences"].take(), seen["samples"].take()]
    };
    let first = seen("mine.csv");
    for (from, to) in [("mine.csv", "b.npz"), ("mine.csv", "c.mcap"), ("c.mcap", "d.tsv"), ("d.tsv", "e.txt")] {
        let said = place.ok(&format!("convert {from} {to}"));
        assert_eq!(said.trim(), to);
        assert_eq!(seen(to), first, "{to}");
    }
    let said = place.ok("convert c.mcap set --task wave");
    assert!(said.contains("info.json"), "{said}");
    assert_eq!(seen("set")[1], first[1]);
    let (_, told) = place.fails(2, "convert d.tsv f.mcap");
    assert!(told.contains("nothing tells how many seconds"), "{told}");
    place.ok("convert d.tsv f.mcap --period 0.02");
    assert_eq!(seen("f.mcap"), first);
    let (_, told) = place.fails(5, "convert mine.csv mine.csv");
    assert!(told.contains("is read from"), "{told}");
    let (_, told) = place.fails(2, "convert mine.csv mine.bvh");
    assert!(told.contains("mine.bvh"), "{told}");
    assert_eq!(String::from_utf8(place.read("mine.csv")).unwrap(), table(1.0));
}

#[test]
fn data_are_drawn_on_a_page_that_needs_nothing_else() {
    let place = Place::new();
    place.write("mine.csv", table(1.0));
    place.ok("inspect mine.csv --plot page.html");
    let page = String::from_utf8(place.read("page.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 2, "{page}");
    assert!(page.contains("All 2 sequences over each other") && page.contains("seconds"), "{page}");
    assert!(!page.contains("<script") && !page.contains("src=") && !page.contains("@import"), "{page}");
    let (_, told) = place.fails(5, "inspect mine.csv --plot mine.csv");
    assert!(told.contains("one file"), "{told}");
}

#[test]
fn spikes_do_not_rule_a_robust_scaling() {
    let place = Place::new();
    let rows: String =
        (0..400).map(|k| format!("{}\n", if k == 200 { 80.0 } else { (f64::from(k) * 0.3).sin() })).collect();
    place.write("spiked.csv", format!("angle\n{rows}"));
    let (_, told) = place.says("train spiked.csv --epochs 2");
    assert!(told.contains("1 of 400 samples of channel angle lie outside") && told.contains("\"robust\""), "{told}");
    let text = String::from_utf8(place.read("runs/spiked/experiment.toml")).unwrap();
    assert!(text.contains("scaling = \"robust\""), "{text}");
    let reach = |run: &str| place.json(&format!("inspect {run} --json"))["channels"][0]["high"].as_f64().unwrap();
    assert!((reach("runs/spiked") - 1.25).abs() < 0.01, "{}", reach("runs/spiked"));
    place.ok("train spiked.csv --epochs 2 --set data.scaling=fit --out fit");
    assert!(reach("fit") > 80.0);
}

#[test]
fn samples_that_are_missing_are_learned_around() {
    let place = Place::new();
    let gaps = |text: &str| {
        let cell = |(row, line): (usize, &str)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if row > 0 && row % 5 == 0 {
                cells[2 + row % 2] = ["", "NaN", "null"][row % 3];
            }
            cells.join(",") + "\n"
        };
        text.lines().enumerate().map(cell).collect::<String>()
    };
    place.write("mine.csv", gaps(&table(1.0)));
    let (said, told) = place.says("train mine.csv --epochs 400");
    assert!(told.contains("note: channel shoulder: 12 of 120 samples are missing"), "{told}");
    assert!(said.contains(" %  ") && !said.contains("NaN"), "{said}");
    let seen = place.json("inspect runs/mine --json");
    assert!(seen["score"]["nll"].as_f64().is_some(), "{seen}");
    let found = place.json("recognize runs/mine mine.csv --starts 3 --epochs 30 --json");
    for (s, one) in found["sequences"].as_array().unwrap().iter().enumerate() {
        assert_eq!(one["learned"][0]["number"], s + 1, "{one}");
        assert!(one["error"].as_f64().unwrap() < 0.1 && one["ln_likelihood"].as_f64().is_some(), "{one}");
    }
    let along = place.json("generate runs/mine --mode open --data mine.csv --json");
    assert_eq!(along["sequences"][0]["mean"].as_array().unwrap().len(), 59);
    let followed = place.json("recognize runs/mine mine.csv --online --json");
    assert!(followed["sequences"][0]["prediction_error"].as_f64().is_some(), "{followed}");
    place.ok("report runs/mine");
    place.ok("inspect mine.csv --plot page.html");
    assert!(place.text("page.html").contains("12 samples are missing"));
    let (_, told) = place.fails(2, "train mine.csv --set data.missing=refuse --out other");
    assert!(told.contains("is missing") || told.contains("is NaN"), "{told}");
    assert!(told.contains("`missing = \"refuse\"` is set"), "{told}");
    // A channel that nobody observed is said.
    place.write(
        "never.csv",
        "a,b\n".to_owned() + &(0..60).map(|k| format!("{},\n", (f64::from(k) * 0.3).sin())).collect::<String>(),
    );
    let (_, told) = place.says("inspect never.csv --channels a,b");
    assert!(!told.contains("panicked"), "{told}");
    assert!(place.ok("inspect never.csv --channels a,b").contains("warning: channel b was never observed"));
}
