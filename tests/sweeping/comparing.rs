//! `scrnn compare` from outside: what the page and the table say, and how large they get.

use std::fs;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::{Place, SINE, thousand};

fn sine(epochs: u32) -> String {
    SINE.replace("epochs = 1500", &format!("epochs = {epochs}"))
}

#[test]
fn one_knob_is_a_curve_two_are_a_heat_map_and_the_best_is_named_over_all_seeds() {
    let place = Place::new(&sine(150), "seeds = 3\n[grid]\n\"training.adam.rate\" = [1e-6, 1e-3, 1e-2]\n");
    place.ends(0, "sweep s.toml --quiet");
    let best = place.json("compare runs/s --json");
    assert_eq!((best["measure"].as_str(), best["setting"].as_str()), (Some("nll"), Some("rate=0.01")), "{best}");
    let html = fs::read_to_string(place.path("runs/s/report.html")).unwrap();
    for part in [
        "Over all seeds the best setting is rate=0.01",
        "log10 of training.adam.rate",
        "one sd over seeds",
        "Learning curves",
        "Closed loops",
        "Initial states",
        "rate=0.01 against rate=1e-6",
        "Holm",
        "href=\"./rate=1e-3/seed-2/report.html\"",
    ] {
        assert!(html.contains(part), "{part} is missing");
    }
    let csv = fs::read_to_string(place.path("runs/s/metrics.csv")).unwrap();
    assert!(csv.starts_with("run,setting,training.adam.rate,seed,outcome,nll,mse,"), "{csv}");
    assert_eq!(csv.lines().count(), 10);
    // Any runs: what differs between their experiments makes the settings.
    let err = place.ends(2, "compare runs/s/rate=1e-3/seed-1 runs/s/rate=0.01/seed-1").1;
    assert!(err.contains("--out DIR"), "{err}");
    let runs = ["rate=1e-3/seed-1", "rate=1e-3/seed-2", "rate=0.01/seed-1", "rate=0.01/seed-2"]
        .map(|run| format!("runs/s/{run}"));
    let best = place.json(&format!("compare {} --out page --json", runs.join(" ")));
    assert_eq!(best["setting"].as_str(), Some("rate=0.01"), "{best}");
    let html = fs::read_to_string(place.path("page/report.html")).unwrap();
    assert!(
        html.contains("that differ in training.adam.rate") && html.contains("../runs/s/rate=0.01/seed-2/report.html")
    );

    let sweep = "[grid]\n\"training.adam.rate\" = [1e-3, 1e-2]\n\"network.groups.context.units\" = [3, 4, 5]\n[then]\nreport = false\n";
    let place = Place::new(&sine(40), sweep);
    place.ends(0, "sweep s.toml --quiet");
    place.ends(0, "compare runs/s");
    let html = fs::read_to_string(place.path("runs/s/report.html")).unwrap();
    assert!(html.contains("the stronger the colour, the better") && html.contains("opacity=\"0.55\""));
    assert!(html.contains("Each setting has one network only") && html.contains("No run has a page of its own"));
}

/// The networks that a page holds, by their names; none where there is nothing to play with.
fn playable(html: &str) -> Vec<String> {
    let Some((_, rest)) = html.split_once("id=\"playground-data\">") else { return Vec::new() };
    let data: Value = serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap();
    data["networks"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_page_holds_networks_the_best_of_each_setting_first_until_it_is_full_and_says_who_is_left_out() {
    let sweep = "seeds = 2\n[grid]\n\"training.adam.rate\" = [1e-6, 1e-2]\n[then]\nreport = false\n";
    let place = Place::new(&sine(150), sweep);
    place.ends(0, "sweep s.toml --quiet");
    let page = |more: &str| {
        place.ends(0, &format!("compare runs/s --out page{more}"));
        fs::read_to_string(place.path("page/report.html")).unwrap()
    };
    let html = page("");
    let all = playable(&html);
    let settings: Vec<&str> = all.iter().map(|name| name.split('/').next().unwrap()).collect();
    assert_eq!(settings, ["rate=0.01", "rate=1e-6", "rate=0.01", "rate=1e-6"], "{all:?}");
    assert!(html.contains("holds all 4 finished networks"));
    // The best seed of a setting is its first.
    let csv = fs::read_to_string(place.path("page/metrics.csv")).unwrap();
    let nll = |run: &str| -> f64 {
        let line = csv.lines().find(|line| line.starts_with(run)).unwrap();
        line.split(',').nth(5).unwrap().parse().unwrap()
    };
    assert!(nll(&all[0]) <= nll(&all[2]) && nll(&all[1]) <= nll(&all[3]), "{all:?}: {csv}");
    let html = page(" --networks 1");
    assert!(playable(&html) == all[..1] && html.contains("3 more were not tried"));
    let html = page(" --networks 0");
    assert!(playable(&html).is_empty() && !html.contains("Play with them") && html.contains("script-src 'none'"));

    // Networks of 1 to 1.6 MB each.
    let sweep = "[grid]\n\"network.groups.context.units\" = [220, 230, 240, 250, 260, 1]\n[then]\nreport = false\n";
    let place = Place::new(&sine(1), sweep);
    place.ends(0, "sweep s.toml --quiet");
    place.ends(0, "compare runs/s");
    let html = fs::read_to_string(place.path("runs/s/report.html")).unwrap();
    let held = playable(&html);
    assert!(html.len() < 5_000_000 && (3..5).contains(&held.len()), "{} bytes, {held:?}", html.len());
    assert!(html.contains(&format!("holds {} of 6 finished networks", held.len())));
    let (_, left_out) = html.split_once("no room for their numbers in a page of less than 5 MB: ").unwrap();
    let left_out = left_out.split_once("</p>").unwrap().0;
    for units in [220, 230, 240, 250, 260] {
        let name = format!("units={units}/seed-1");
        assert_ne!(held.contains(&name), left_out.contains(&format!("{name} (1.")), "{name}: {left_out}");
    }
    assert!(html.contains("a single context unit has no plane of initial states: units=1/seed-1."));
}

#[test]
fn a_page_of_a_thousand_networks_is_small_and_made_in_no_time() {
    let place = Place::new(&sine(200), "");
    thousand::make(place.0.path(), &|line| place.ends(0, line).0);
    let begun = Instant::now();
    place.ends(0, "compare runs/s");
    let taken = begun.elapsed();
    let size = fs::metadata(place.path("runs/s/report.html")).unwrap().len();
    assert!(size < 5_000_000, "{size} bytes");
    assert!(taken < Duration::from_secs(60), "{taken:?}");
    let html = fs::read_to_string(place.path("runs/s/report.html")).unwrap();
    assert_eq!(html.matches("/report.html\">").count(), 1000);
    assert_eq!(playable(&html).len(), 12);
    assert_eq!(fs::read_to_string(place.path("runs/s/metrics.csv")).unwrap().lines().count(), 1001);
}
