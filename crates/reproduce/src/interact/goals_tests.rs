//! The goals on findings that are made up.

use super::super::findings::Regression;
use super::super::scan;
use super::super::trials::{ClosedLoop, Peak, Reactions, Regressed};
use super::super::{INTERACT, conditions};
use super::*;
use crate::framework::study::Study;
use crate::framework::{Cell, JobResult};

fn reactions(mean: f64) -> Reactions {
    Reactions { mean, literal: 0.0, by_side: [mean; 2], times: Vec::new() }
}

fn world(success: f64) -> InWorld {
    InWorld { success, failures: [0; 3], reaction_time: 0.0, branches: Vec::new() }
}

fn network(condition: &'static str, seed: u64, (own, other, ers): (f64, f64, f64)) -> JobResult<Findings> {
    let wide = condition == "wide";
    let jitter = 0.1 * seed as f64;
    let peak = Peak { steps: 9, over_median: if wide { 1.1 } else { 7.0 } };
    let regressed = || Regressed {
        reactions: reactions(ers + jitter),
        causal: reactions(ers + 5.0),
        milliseconds: [0.2, 0.4, 0.9],
    };
    let findings = Findings {
        closed_loop: ClosedLoop {
            regenerated: if wide { 32 } else { 1 },
            orders: Vec::new(),
            distinct_from_one: if wide { 1 } else { 15 },
            orders_from_one: Vec::new(),
            variance_open: peak,
            variance_closed: peak,
        },
        corresponding: reactions(own + jitter),
        other: reactions(other + jitter),
        regression: wide.then(|| Regression {
            default: regressed(),
            thesis: regressed(),
            without_arm: regressed(),
            world: world(0.95),
            scan: vec![(ers, 0.2); scan::settings(8).len()],
        }),
        world: Some(world(if wide { 0.5 } else { 1.0 })),
    };
    let (seconds, seconds_of_evaluation, threads, trainings) = (20.0, 1.0, 1, Vec::new());
    JobResult { condition: Some(condition), seed, seconds, seconds_of_evaluation, threads, trainings, findings }
}

/// As the driver puts them together.
fn together(jobs: Vec<JobResult<Findings>>) -> Results<Findings> {
    let summary: Vec<Summary> = measures().iter().map(|one| Summary::of(one, &jobs)).collect();
    let comparisons = comparisons().iter().filter_map(|one| one.made(&summary)).collect();
    let conditions = vec![conditions::NARROW.condition, conditions::WIDE.condition];
    let (settings, times, tables) = (Vec::new(), Vec::new(), Vec::new());
    let mut results = Results { conditions, settings, jobs, summary, times, comparisons, tables };
    results.tables = INTERACT.tables(&results);
    results
}

fn all(wide: (f64, f64, f64)) -> Results<Findings> {
    let narrow = (1..=4).map(|seed| network("narrow", seed, (19.0, 19.0, 0.0)));
    together(narrow.chain((1..=4).map(|seed| network("wide", seed, wide))).collect())
}

#[test]
fn every_goal_is_met_by_what_the_thesis_found_and_missed_by_its_opposite() {
    let good = all((0.0, 50.0, 6.0));
    let verdicts = verdicts(&good);
    let missed: Vec<&str> = verdicts.iter().filter(|goal| !goal.met).map(|goal| goal.goal.as_str()).collect();
    assert!(missed.is_empty(), "{missed:?}");
    assert_eq!((good.comparisons.len(), verdicts.len()), (6, 18));
    assert_eq!(good.table("scan").unwrap().rows[0][7], Cell::Numbers(vec![6.0; 4]));

    // A wide network that is late with its own order, quick with others, and no better for error regression.
    let bad = super::verdicts(&all((30.0, 10.0, 20.0)));
    let met = |goal: &str| bad.iter().find(|one| one.goal == goal).unwrap().met;
    for goal in [
        "wide: reaction time, corresponding",
        "wide: reaction time with error regression",
        "wide: other against corresponding",
        "corresponding: narrow against wide",
        "other: wide against narrow",
        "wide, other: without against with regression",
        "other: narrow against wide with regression",
    ] {
        assert!(!met(goal), "{goal}");
    }
    assert!(met("narrow: corresponding against other"));
}

#[test]
fn a_single_network_has_measures_and_no_comparisons() {
    let one = together(vec![network("narrow", 1, (19.0, 19.0, 0.0))]);
    assert!(one.comparisons.is_empty() && one.tables.is_empty());
    assert_eq!(one.measure("narrow_other").unwrap().known(), [19.1]);
    assert!(one.measure("wide_other").is_none());
}
