//! The reaching experiment from outside: demonstrations, a network that drives the robot, recordings. Networks are hardly
//! trained here; how well they do in earnest stands in docs/reproduction.md.

use crate::{Place, numbers};

/// A network that has seen a little of three short demonstrations.
pub const REACH: &str = "name = \"reach\"\n[data]\ntask = \"reach\"\nsequences = 3\nsteps = 30\n[network]\n\
                     initial_state_variance = 0.001\n[[network.groups]]\nname = \"c\"\nunits = 8\ntime_constant = 2.0\n\
                     [training]\nepochs = 300\noptimiser = \"adam\"\n[training.adam]\nrate = 0.01\n";

fn trained() -> Place {
    let place = Place::with(REACH);
    place.ok("train sine.toml --out run");
    place
}

#[test]
fn demonstrations_are_the_same_in_every_form_and_for_any_number_of_threads() {
    let place = Place::new();
    let line = "data reach --sequences 4 --steps 26 --seed 3";
    let csv = place.ok(line);
    let header = "sequence,step,HeadYaw,HeadPitch,RShoulderPitch,RShoulderRoll,RElbowYaw,RElbowRoll\n";
    assert!(csv.starts_with(header), "{csv}");
    assert_eq!(csv.lines().count(), 1 + 4 * 26);
    assert_eq!(csv, place.ok(&format!("{line} --threads 1")));
    assert_ne!(csv, place.ok("data reach --sequences 4 --steps 26 --seed 4"));
    let exact = place.ok(&format!("{line} --exact-positions"));
    assert_ne!(csv, exact);
    // At exact positions the first and the fourth demonstration have the object at the same place, up to the head's noise.
    let yaw = |csv: &str, sequence: &str| {
        let rows = csv.lines().filter(|row| row.starts_with(&format!("{sequence},")));
        let values: Vec<f64> = rows.map(|row| row.split(',').nth(2).unwrap().parse().unwrap()).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    assert!((yaw(&exact, "1-01") - yaw(&exact, "1-02")).abs() < 0.005, "{exact}");
    assert!((yaw(&exact, "1-01") - yaw(&exact, "3-01")).abs() > 0.5);

    place.ok(&format!("{line} --out reach.npz"));
    place.ok(&format!("{line} --out reach.mcap"));
    place.ok(&format!("{line} --out again.mcap --threads 1"));
    assert!(place.read("reach.mcap") == place.read("again.mcap"));
    let samples = |name: &str, options: &str| {
        let seen = place.json(&format!("inspect {name} {options} --json"));
        assert_eq!(seen["channels"].as_array().unwrap().len(), 6, "{seen}");
        seen["channels"].clone()
    };
    assert_eq!(samples("reach.npz", "")[3]["min"], samples("reach.mcap", "--topic /sensed")[3]["min"]);
}

#[test]
fn options_that_do_not_go_together_are_refused() {
    let place = Place::with(&REACH.replace("task = \"reach\"", "task = \"sinusoid\"\nexact_positions = true"));
    let (_, told) = place.fails(2, "train sine.toml");
    assert!(told.contains("`data.exact_positions` is given without the task \"reach\""), "{told}");
    let (_, told) = place.fails(2, "data sinusoid --exact-positions");
    assert!(told.contains("does not go with sinusoid"), "{told}");
    let (_, told) = place.fails(2, "data reach --truth t.npz");
    assert!(told.contains("--truth does not go with reach"), "{told}");
}

#[test]
fn a_network_drives_the_robot_and_the_same_seed_gives_the_same_recording() {
    let place = trained();
    let line = "simulate reach run --position 3 --cycles 2 --seed 5 --shift-at 12 --to -0.105";
    let found = place.json(&format!("{line} --json --mcap one.mcap"));
    assert_eq!((found["samples"].as_u64(), found["expected"].as_u64()), (Some(24), Some(2)));
    assert_eq!((found["position"].as_f64(), &found["shift"]), (Some(0.0), &serde_json::json!([12, -0.105])));
    assert!(found["touched"].is_u64() && found["beyond_limits"].is_u64() && found["self_collisions"].is_u64());
    for cycle in found["cycles"].as_array().unwrap() {
        assert_eq!(numbers(&cycle["touch"]["hand"]).len(), 3, "{cycle}");
    }
    assert_eq!(found, place.json(&format!("{line} --json --mcap two.mcap")));
    assert!(place.read("one.mcap") == place.read("two.mcap"), "two runs of one seed differ");
    place.ok("simulate reach run --position 3 --cycles 2 --seed 6 --mcap three.mcap");
    assert!(place.read("one.mcap") != place.read("three.mcap"));

    // What was predicted can be looked at and learned from; what is attached says what the network was.
    let seen = place.json("inspect one.mcap --topic /predicted_mean --json");
    assert_eq!(seen["channels"].as_array().unwrap().len(), 6);
    let recording = String::from_utf8_lossy(&place.read("one.mcap")).into_owned();
    assert!(recording.contains("<robot name=\"nao\">") && recording.contains("initial_state_variance"));

    let table = place.ok("simulate reach run --cycles 1 --no-noise");
    assert!(table.starts_with("cycle") && table.contains("times in 1 cycles"), "{table}");
}

#[test]
fn what_cannot_drive_the_robot_is_refused() {
    let place = Place::with(crate::SINE);
    place.ok("train sine.toml --out wave");
    let (_, told) = place.fails(2, "simulate reach wave");
    assert!(told.contains("predicts y") && told.contains("HeadYaw, HeadPitch"), "{told}");
    let place = trained();
    let (_, told) = place.fails(2, "simulate reach run --position 4");
    assert!(told.contains("between positions 1 and 3"), "{told}");
    let (_, told) = place.fails(2, "simulate reach run --cycles 2 --shift-at 24 --to 2");
    assert!(told.contains("--shift-at 24 is after the last of 24 samples"), "{told}");
    place.fails(2, "simulate reach run --shift-at 3");
}
