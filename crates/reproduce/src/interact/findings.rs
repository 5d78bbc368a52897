//! What is found for each network and over all of them.

use scrnn::analysis::comparison::TTest;
use scrnn::error_regression::{Ascent, ErrorRegressionOptions};
use scrnn::evaluation::mean_and_deviation;
use serde::Serialize;

use super::conditions::Condition;
use super::scan::{self, Scanned};
use super::trials::{ClosedLoop, Reactions, Regressed, Subject};
use super::world::InWorld;
use crate::study::TrainingFacts;
use scrnn_run::failure::Result;

/// Interactions in the world for each network and mode.
const TRIALS: u64 = 6;

/// Of one network.
#[derive(Debug, Clone, Serialize)]
pub struct Findings {
    /// Its condition.
    pub condition: &'static str,
    /// Of its first weights.
    pub seed: u64,
    /// How it was trained.
    pub training: TrainingFacts,
    /// 5.3.1.
    pub closed_loop: ClosedLoop,
    /// From the state of each recording's own order.
    pub corresponding: Reactions,
    /// From the state of LLRRL, whatever the order.
    pub other: Reactions,
    /// From that state with error regression.
    pub regression: Option<Regression>,
    /// In the world, from that state, without error regression.
    pub world: Option<InWorld>,
}

/// Error regression of one network.
#[derive(Debug, Clone, Serialize)]
pub struct Regression {
    /// At the default setting.
    pub default: Regressed,
    /// With momentum at the thesis' rate.
    pub thesis: Regressed,
    /// At the default setting, the arm's errors left out: what a robot can know.
    pub without_arm: Regressed,
    /// In the world at the default setting.
    pub world: InWorld,
    /// Mean reaction time and median milliseconds for each setting of the scan.
    #[serde(skip)]
    pub scan: Vec<(f64, f64)>,
}

impl Findings {
    /// Puts a network through everything. Only the thesis' conditions meet the world, only the wide one regresses.
    pub fn of(condition: &Condition, seed: u64, training: TrainingFacts, subject: &Subject<'_>) -> Result<Self> {
        let state = subject.states.sequence(subject.other());
        let channels = subject.data.channels().len();
        let default = ErrorRegressionOptions::new(channels);
        let regression = match condition.key {
            "wide" => {
                let regress = |options: &ErrorRegressionOptions| {
                    subject.regressed(state, &subject.regression(options.clone()), 1)
                };
                let mut without_arm = default.clone();
                without_arm.heeded[scrnn_sim::interaction::ARM].fill(0.0);
                Some(Regression {
                    default: regress(&default)?,
                    thesis: regress(&thesis(channels))?,
                    without_arm: regress(&without_arm)?,
                    world: subject.in_world(state, &default, TRIALS)?,
                    scan: scan::one(subject, state)?,
                })
            }
            _ => None,
        };
        let quiet = ErrorRegressionOptions { iterations: 0, ..default };
        Ok(Self {
            condition: condition.key,
            seed,
            training,
            closed_loop: subject.closed_loop()?,
            corresponding: subject.reactions(|s| subject.states.sequence(s))?,
            other: subject.reactions(|_| state)?,
            regression,
            world: if condition.of_thesis { Some(subject.in_world(state, &quiet, TRIALS)?) } else { None },
        })
    }
}

/// The thesis' ascent: momentum at alpha_init of the training (5.3.4).
pub fn thesis(channels: usize) -> ErrorRegressionOptions {
    let ascent = Ascent::Momentum { rate: 1e-4 / channels as f64, momentum: 0.9 };
    ErrorRegressionOptions { ascent, max_norm: None, ..ErrorRegressionOptions::new(channels) }
}

/// A comparison of two lists of mean reaction times.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// What is compared.
    pub what: &'static str,
    /// What the thesis found.
    pub thesis: &'static str,
    /// paired, or Welch.
    pub test: &'static str,
    /// What was found.
    #[serde(flatten)]
    pub found: TTest,
    /// For the pair that should be equal: the p-value of a difference of half a step or more.
    pub p_of_equivalence: Option<f64>,
}

/// A number over networks.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Its name.
    pub key: &'static str,
    /// For the eye.
    pub label: &'static str,
    /// What the thesis has.
    pub thesis: &'static str,
    /// Over networks.
    pub mean: f64,
    /// Standard deviation; 0 for a single network.
    pub deviation: f64,
    /// Each network's.
    pub values: Vec<f64>,
}

/// A goal.
#[derive(Debug, Clone, Serialize)]
pub struct Goal {
    /// What is asked for.
    pub goal: &'static str,
    /// How much of it.
    pub needed: &'static str,
    /// What was found.
    pub found: String,
    /// Whether that is enough.
    pub met: bool,
}

/// Over all networks.
#[derive(Debug, Clone, Serialize)]
pub struct Overall {
    /// Reaction times and other measures.
    pub summary: Vec<Summary>,
    /// t-tests.
    pub comparisons: Vec<Comparison>,
    /// Error regression.
    pub scan: Vec<Scanned>,
    /// What was asked for.
    pub goals: Vec<Goal>,
}

/// The networks of one condition.
pub fn of<'a>(networks: &'a [Findings], key: &str) -> Vec<&'a Findings> {
    networks.iter().filter(|one| one.condition == key).collect()
}

impl Overall {
    /// Puts all networks together.
    pub fn of(networks: &[Findings], channels: usize, seconds: f64) -> Self {
        let (narrow, wide) = (of(networks, "narrow"), of(networks, "wide"));
        let list =
            |of: &dyn Fn(&Findings) -> f64, from: &[&Findings]| from.iter().map(|one| of(one)).collect::<Vec<f64>>();
        let regressed = |of: &dyn Fn(&Regression) -> f64| -> Vec<f64> {
            wide.iter().filter_map(|one| one.regression.as_ref()).map(of).collect()
        };
        let narrow_own = list(&|one| one.corresponding.mean, &narrow);
        let narrow_other = list(&|one| one.other.mean, &narrow);
        let wide_own = list(&|one| one.corresponding.mean, &wide);
        let wide_other = list(&|one| one.other.mean, &wide);
        let ers = regressed(&|one| one.default.reactions.mean);
        let summary = |key, label, thesis, values: Vec<f64>| {
            let (mean, deviation) = mean_and_deviation(&values);
            Summary { key, label, thesis, mean, deviation, values }
        };
        let percent = |world: &InWorld| 100.0 * world.success;
        let collided = |world: &InWorld| world.failures[0] as f64;
        let in_world = |of: &dyn Fn(&InWorld) -> f64, from: &[&Findings]| -> Vec<f64> {
            from.iter().filter_map(|one| one.world.as_ref()).map(of).collect()
        };
        let summaries = vec![
            summary(
                "narrow_corresponding",
                "reaction time, narrow, corresponding state",
                "17.77 \u{b1} 4.37",
                narrow_own.clone(),
            ),
            summary("narrow_other", "reaction time, narrow, other state", "17.80 \u{b1} 4.36", narrow_other.clone()),
            summary(
                "wide_corresponding",
                "reaction time, wide, corresponding state",
                "0.004 \u{b1} 0.008",
                wide_own.clone(),
            ),
            summary("wide_other", "reaction time, wide, other state", "36.64 \u{b1} 4.19", wide_other.clone()),
            summary("wide_regression", "the same with error regression", "8.22 \u{b1} 2.75", ers.clone()),
            summary(
                "wide_regression_causal",
                "the same, predicted when the input came (causal)",
                "",
                regressed(&|one| one.default.causal.mean),
            ),
            summary(
                "wide_regression_without_arm",
                "the same, the arm's errors left out",
                "",
                regressed(&|one| one.without_arm.reactions.mean),
            ),
            summary(
                "wide_regression_thesis",
                "error regression at the thesis' rate",
                "8.22 \u{b1} 2.75",
                regressed(&|one| one.thesis.reactions.mean),
            ),
            summary("wide_regression_thesis_causal", "the same, causal", "", regressed(&|one| one.thesis.causal.mean)),
            summary(
                "wide_regenerated",
                "orders that the wide networks regenerate, of 32",
                "32",
                list(&|one| one.closed_loop.regenerated as f64, &wide),
            ),
            summary(
                "narrow_regenerated",
                "orders that the narrow networks regenerate, of 32",
                "by chance",
                list(&|one| one.closed_loop.regenerated as f64, &narrow),
            ),
            summary(
                "narrow_distinct",
                "orders from one state, narrow, of 32",
                "\"various\"",
                list(&|one| one.closed_loop.distinct_from_one as f64, &narrow),
            ),
            summary(
                "wide_distinct",
                "orders from one state, wide, of 32",
                "1",
                list(&|one| one.closed_loop.distinct_from_one as f64, &wide),
            ),
            summary(
                "narrow_peak_open",
                "variance, narrow: peak / median while fed",
                "sharp peak",
                list(&|one| one.closed_loop.variance_open.over_median, &narrow),
            ),
            summary(
                "narrow_peak_at",
                "variance, narrow: steps from branching to peak",
                "",
                list(&|one| one.closed_loop.variance_open.steps as f64, &narrow),
            ),
            summary(
                "narrow_peak_closed",
                "variance, narrow: peak / median in the closed loop",
                "sharp peak",
                list(&|one| one.closed_loop.variance_closed.over_median, &narrow),
            ),
            summary(
                "wide_peak_open",
                "variance, wide: peak / median while fed",
                "nearly zero",
                list(&|one| one.closed_loop.variance_open.over_median, &wide),
            ),
            summary(
                "wide_peak_closed",
                "variance, wide: peak / median in the closed loop",
                "nearly zero",
                list(&|one| one.closed_loop.variance_closed.over_median, &wide),
            ),
            summary("narrow_world", "in the world, narrow: success, %", "no failure", in_world(&percent, &narrow)),
            summary("wide_world", "in the world, wide: success, %", "fails", in_world(&percent, &wide)),
            summary(
                "wide_world_regression",
                "in the world, wide with error regression: success, %",
                "cooperates",
                regressed(&|one| percent(&one.world)),
            ),
            summary("narrow_collisions", "collisions in 30 branchings, narrow", "none", in_world(&collided, &narrow)),
            summary("wide_collisions", "collisions in 30 branchings, wide", "some", in_world(&collided, &wide)),
            summary(
                "wide_collisions_regression",
                "collisions in 30 branchings, wide with error regression",
                "",
                regressed(&|one| collided(&one.world)),
            ),
            summary(
                "milliseconds",
                "error regression: median ms a control step",
                "",
                regressed(&|one| one.default.milliseconds[0]),
            ),
            summary(
                "milliseconds_p99",
                "error regression: 99 % within ms",
                "",
                regressed(&|one| one.default.milliseconds[1]),
            ),
        ];
        let mut comparisons = Vec::new();
        let mut compare = |what, thesis, paired: bool, a: &[f64], b: &[f64], equal: bool| {
            let found = if paired { TTest::paired(a, b) } else { TTest::welch(a, b) };
            if let Some(found) = found {
                let test = if paired { "paired" } else { "Welch" };
                let p_of_equivalence = equal.then(|| found.p_of_equivalence(0.5));
                comparisons.push(Comparison { what, thesis, test, found, p_of_equivalence });
            }
        };
        compare("narrow: corresponding against other", "t(18) = 0.71, n.s.", true, &narrow_own, &narrow_other, true);
        compare("wide: other against corresponding", "t(18) = 11.63, p < 0.001", true, &wide_other, &wide_own, false);
        compare("corresponding: narrow against wide", "t(18) = 12.21, p < 0.001", false, &narrow_own, &wide_own, false);
        compare("other: wide against narrow", "t(18) = 9.34, p < 0.001", false, &wide_other, &narrow_other, false);
        compare(
            "wide, other: without against with regression",
            "t(18) = 8.54, p < 0.001",
            true,
            &wide_other,
            &ers,
            false,
        );
        compare(
            "other: narrow against wide with regression",
            "t(18) = 5.57, p < 0.001",
            false,
            &narrow_other,
            &ers,
            false,
        );
        let scans: Vec<&Vec<(f64, f64)>> =
            wide.iter().filter_map(|one| one.regression.as_ref()).map(|one| &one.scan).collect();
        let scan = if scans.is_empty() { Vec::new() } else { scan::all(channels, &scans) };
        let goals = goals(&summaries, &comparisons, networks, seconds);
        Self { summary: summaries, comparisons, scan, goals }
    }
}

fn goals(summary: &[Summary], comparisons: &[Comparison], networks: &[Findings], seconds: f64) -> Vec<Goal> {
    let at = |key: &str| summary.iter().find(|one| one.key == key).filter(|one| !one.values.is_empty());
    let least = |one: &Summary| one.values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = |one: &Summary| one.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let told = |one: &Summary| format!("{:.2}, from {:.2} to {:.2}", one.mean, least(one), most(one));
    let mut goals = Vec::new();
    let mut judge = |goal, needed, key: &str, met: &dyn Fn(&Summary) -> bool| {
        if let Some(one) = at(key) {
            goals.push(Goal { goal, needed, found: told(one), met: met(one) });
        }
    };
    judge("wide: own orders regenerated", "31 of 32 on average, 28 at least", "wide_regenerated", &|one| {
        one.mean >= 31.0 && least(one) >= 28.0
    });
    judge("wide: variance over the cycle", "peak / median 1.3 at most", "wide_peak_closed", &|one| most(one) <= 1.3);
    judge("narrow: variance's peak", "peak / median 5 at least, while fed", "narrow_peak_open", &|one| {
        least(one) >= 5.0
    });
    judge("narrow: where it peaks", "5 to 12 steps after the branching", "narrow_peak_at", &|one| {
        least(one) >= 5.0 && most(one) <= 12.0
    });
    judge("narrow: orders from one state", "12 of 32 at least", "narrow_distinct", &|one| least(one) >= 12.0);
    // Of 32 draws with probability 1/32 each, more than 5 come with a probability of 0.0006.
    judge("narrow: own orders by chance", "5 of 32 at most", "narrow_regenerated", &|one| most(one) <= 5.0);
    judge("narrow: no network loses the reaction", "reaction time below 40", "narrow_other", &|one| most(one) < 40.0);
    judge("wide: reaction time, corresponding", "2 at most, on average", "wide_corresponding", &|one| one.mean <= 2.0);
    judge("wide: reaction time with error regression", "9 at most, on average", "wide_regression", &|one| {
        one.mean <= 9.0
    });
    judge("in the world: narrow succeeds", "90 %", "narrow_world", &|one| one.mean >= 90.0);
    judge("in the world: wide fails without error regression", "below 90 %", "wide_world", &|one| one.mean < 90.0);
    judge("in the world: wide succeeds with it", "90 %", "wide_world_regression", &|one| one.mean >= 90.0);
    judge("error regression: a control step", "99 % within 1 ms", "milliseconds_p99", &|one| most(one) < 1.0);
    for one in comparisons {
        let TTest { difference, t, degrees, p, .. } = one.found;
        let found = format!("{difference:.2}, t({degrees:.1}) = {t:.2}, p = {p:.1e}");
        goals.push(match one.p_of_equivalence {
            Some(p) => {
                let found = format!("{found}; of half a step or more p = {p:.1e}");
                Goal { goal: one.what, needed: "less than half a step apart, p < 0.05", found, met: p < 0.05 }
            }
            None => Goal { goal: one.what, needed: "more, p < 0.001", found, met: difference > 0.0 && p < 0.001 },
        });
    }
    // Networks train side by side, one core each: two cores have one done in half the time that a core takes for it.
    let slowest = networks.iter().map(|one| one.training.seconds).fold(0.0, f64::max);
    goals.push(Goal {
        goal: "time to train one network",
        needed: "30 s of two cores",
        found: format!("{:.0} s at most: {slowest:.0} s of one core", slowest / 2.0),
        met: slowest / 2.0 < 30.0,
    });
    goals.push(Goal {
        goal: "time of everything",
        needed: "30 min",
        found: format!("{:.1} min", seconds / 60.0),
        met: seconds < 1800.0,
    });
    goals
}

#[cfg(test)]
mod tests {
    use super::super::trials::Peak;
    use super::*;

    fn reactions(mean: f64) -> Reactions {
        Reactions { mean, literal: 0.0, by_side: [mean; 2], times: Vec::new() }
    }

    fn world(success: f64) -> InWorld {
        InWorld { success, failures: [0; 3], reaction_time: 0.0, branches: Vec::new() }
    }

    fn network(condition: &'static str, seed: u64, (own, other, ers): (f64, f64, f64)) -> Findings {
        let wide = condition == "wide";
        let jitter = 0.1 * seed as f64;
        let peak = Peak { steps: 9, over_median: if wide { 1.1 } else { 7.0 } };
        let regressed = || Regressed {
            reactions: reactions(ers + jitter),
            causal: reactions(ers + 5.0),
            milliseconds: [0.2, 0.4, 0.9],
        };
        Findings {
            condition,
            seed,
            training: TrainingFacts {
                network: "S-MTRNN",
                folder: String::new(),
                epochs: 1,
                nll: None,
                mse: None,
                seconds: 20.0,
                recoveries: 0,
                diverged: None,
            },
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
        }
    }

    fn all(wide: (f64, f64, f64)) -> Vec<Findings> {
        let narrow = (1..=4).map(|seed| network("narrow", seed, (19.0, 19.0, 0.0)));
        narrow.chain((1..=4).map(|seed| network("wide", seed, wide))).collect()
    }

    #[test]
    fn every_goal_is_met_by_what_the_thesis_found_and_missed_by_its_opposite() {
        let good = Overall::of(&all((0.0, 50.0, 6.0)), 8, 900.0);
        let missed: Vec<&str> = good.goals.iter().filter(|goal| !goal.met).map(|goal| goal.goal).collect();
        assert!(missed.is_empty(), "{missed:?}");
        assert_eq!(good.comparisons.len(), 6);
        assert_eq!(good.scan[0].values, [6.0; 4]);

        // A wide network that is late with its own order, quick with others, and no better for error regression.
        let bad = Overall::of(&all((30.0, 10.0, 20.0)), 8, 2000.0);
        let met = |goal: &str| bad.goals.iter().find(|one| one.goal == goal).unwrap().met;
        for goal in [
            "wide: reaction time, corresponding",
            "wide: reaction time with error regression",
            "wide: other against corresponding",
            "corresponding: narrow against wide",
            "other: wide against narrow",
            "wide, other: without against with regression",
            "other: narrow against wide with regression",
            "time of everything",
        ] {
            assert!(!met(goal), "{goal}");
        }
        assert!(met("narrow: corresponding against other"));
    }

    #[test]
    fn a_single_network_has_measures_and_no_comparisons() {
        let one = Overall::of(&[network("narrow", 1, (19.0, 19.0, 0.0))], 8, 1.0);
        assert!(one.comparisons.is_empty() && one.scan.is_empty());
        assert_eq!(one.summary.iter().find(|summary| summary.key == "narrow_other").unwrap().values.len(), 1);
    }
}
