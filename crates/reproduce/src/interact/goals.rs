//! What of the interaction is compared with the thesis, between conditions, and the goals (thesis 5.3).

use super::findings::Findings;
use super::world::InWorld;
use crate::framework::comparison::{Comparison, Test};
use crate::framework::{Measure, Results, Summary, Verdict};

/// A measure of one condition.
fn of_condition(
    condition: &'static str,
    (key, label, thesis): (&'static str, &'static str, &'static str),
    of: fn(&Findings) -> Option<f64>,
) -> Measure<Findings> {
    Measure { condition: Some(condition), ..Measure::new(key, label, "", thesis, 2, of) }
}

type Of = fn(&Findings) -> Option<f64>;

fn narrow(key: &'static str, label: &'static str, thesis: &'static str, of: Of) -> Measure<Findings> {
    of_condition("narrow", (key, label, thesis), of)
}

fn wide(key: &'static str, label: &'static str, thesis: &'static str, of: Of) -> Measure<Findings> {
    of_condition("wide", (key, label, thesis), of)
}

fn percent(world: &InWorld) -> f64 {
    100.0 * world.success
}

fn collided(world: &InWorld) -> f64 {
    world.failures[0] as f64
}

/// Reaction times and other measures. Reaction times are in samples of 100 ms, means over 160 branchings; 90 where the arm
/// never recovered.
pub fn measures() -> Vec<Measure<Findings>> {
    vec![
        narrow("narrow_corresponding", "reaction time, narrow, corresponding state", "17.77 \u{b1} 4.37", |f| {
            Some(f.corresponding.mean)
        }),
        narrow("narrow_other", "reaction time, narrow, other state", "17.80 \u{b1} 4.36", |f| Some(f.other.mean)),
        wide("wide_corresponding", "reaction time, wide, corresponding state", "0.004 \u{b1} 0.008", |f| {
            Some(f.corresponding.mean)
        }),
        wide("wide_other", "reaction time, wide, other state", "36.64 \u{b1} 4.19", |f| Some(f.other.mean)),
        wide("wide_regression", "the same with error regression", "8.22 \u{b1} 2.75", |f| {
            f.regression.as_ref().map(|one| one.default.reactions.mean)
        }),
        wide("wide_regression_causal", "the same, predicted when the input came (causal)", "", |f| {
            f.regression.as_ref().map(|one| one.default.causal.mean)
        }),
        wide("wide_regression_without_arm", "the same, the arm's errors left out", "", |f| {
            f.regression.as_ref().map(|one| one.without_arm.reactions.mean)
        }),
        wide("wide_regression_thesis", "error regression at the thesis' rate", "8.22 \u{b1} 2.75", |f| {
            f.regression.as_ref().map(|one| one.thesis.reactions.mean)
        }),
        wide("wide_regression_thesis_causal", "the same, causal", "", |f| {
            f.regression.as_ref().map(|one| one.thesis.causal.mean)
        }),
        wide("wide_regenerated", "orders that the wide networks regenerate, of 32", "32", |f| {
            Some(f.closed_loop.regenerated as f64)
        }),
        narrow("narrow_regenerated", "orders that the narrow networks regenerate, of 32", "by chance", |f| {
            Some(f.closed_loop.regenerated as f64)
        }),
        narrow("narrow_distinct", "orders from one state, narrow, of 32", "\"various\"", |f| {
            Some(f.closed_loop.distinct_from_one as f64)
        }),
        wide("wide_distinct", "orders from one state, wide, of 32", "1", |f| {
            Some(f.closed_loop.distinct_from_one as f64)
        }),
        narrow("narrow_peak_open", "variance, narrow: peak / median while fed", "sharp peak", |f| {
            Some(f.closed_loop.variance_open.over_median)
        }),
        narrow("narrow_peak_at", "variance, narrow: steps from branching to peak", "", |f| {
            Some(f.closed_loop.variance_open.steps as f64)
        }),
        narrow("narrow_peak_closed", "variance, narrow: peak / median in the closed loop", "sharp peak", |f| {
            Some(f.closed_loop.variance_closed.over_median)
        }),
        wide("wide_peak_open", "variance, wide: peak / median while fed", "nearly zero", |f| {
            Some(f.closed_loop.variance_open.over_median)
        }),
        wide("wide_peak_closed", "variance, wide: peak / median in the closed loop", "nearly zero", |f| {
            Some(f.closed_loop.variance_closed.over_median)
        }),
        narrow("narrow_world", "in the world, narrow: success, %", "no failure", |f| f.world.as_ref().map(percent)),
        wide("wide_world", "in the world, wide: success, %", "fails", |f| f.world.as_ref().map(percent)),
        wide("wide_world_regression", "in the world, wide with error regression: success, %", "cooperates", |f| {
            f.regression.as_ref().map(|one| percent(&one.world))
        }),
        narrow("narrow_collisions", "collisions in 30 branchings, narrow", "none", |f| f.world.as_ref().map(collided)),
        wide("wide_collisions", "collisions in 30 branchings, wide", "some", |f| f.world.as_ref().map(collided)),
        wide("wide_collisions_regression", "collisions in 30 branchings, wide with error regression", "", |f| {
            f.regression.as_ref().map(|one| collided(&one.world))
        }),
    ]
}

/// Reported, and not judged.
pub fn times() -> Vec<Measure<Findings>> {
    vec![
        wide("milliseconds", "error regression: median ms a control step", "", |f| {
            f.regression.as_ref().map(|one| one.default.milliseconds[0])
        }),
        wide("milliseconds_p99", "error regression: 99 % within ms", "", |f| {
            f.regression.as_ref().map(|one| one.default.milliseconds[1])
        }),
    ]
}

/// t-tests.
pub fn comparisons() -> Vec<Comparison> {
    let comparison = |what, thesis, test, measures| Comparison { what, thesis, measures, test, within: None };
    let compare = |what, thesis, test, larger, smaller| comparison(what, thesis, test, [larger, smaller]);
    use Test::{Paired, Welch};
    vec![
        Comparison {
            within: Some(0.5),
            ..compare(
                "narrow: corresponding against other",
                "t(18) = 0.71, n.s.",
                Paired,
                "narrow_corresponding",
                "narrow_other",
            )
        },
        compare(
            "wide: other against corresponding",
            "t(18) = 11.63, p < 0.001",
            Paired,
            "wide_other",
            "wide_corresponding",
        ),
        compare(
            "corresponding: narrow against wide",
            "t(18) = 12.21, p < 0.001",
            Welch,
            "narrow_corresponding",
            "wide_corresponding",
        ),
        compare("other: wide against narrow", "t(18) = 9.34, p < 0.001", Welch, "wide_other", "narrow_other"),
        compare(
            "wide, other: without against with regression",
            "t(18) = 8.54, p < 0.001",
            Paired,
            "wide_other",
            "wide_regression",
        ),
        compare(
            "other: narrow against wide with regression",
            "t(18) = 5.57, p < 0.001",
            Welch,
            "narrow_other",
            "wide_regression",
        ),
    ]
}

/// Whether the goals are reached.
pub fn verdicts(results: &Results<Findings>) -> Vec<Verdict> {
    let least = |one: &Summary| one.extent().0;
    let most = |one: &Summary| one.extent().1;
    let mean = |one: &Summary| one.mean.unwrap_or(f64::NAN);
    let judge = |goal: &str, needed: &str, key: &str, met: &dyn Fn(&Summary) -> bool| {
        results.measure(key).map(|summary| Verdict::of_measure(goal, needed, summary, met))
    };
    let goals = [
        judge("wide: own orders regenerated", "31 of 32 on average, 28 at least", "wide_regenerated", &|one| {
            mean(one) >= 31.0 && least(one) >= 28.0
        }),
        judge("wide: variance over the cycle", "peak / median 1.3 at most", "wide_peak_closed", &|one| {
            most(one) <= 1.3
        }),
        judge("narrow: variance's peak", "peak / median 5 at least, while fed", "narrow_peak_open", &|one| {
            least(one) >= 5.0
        }),
        judge("narrow: where it peaks", "5 to 12 steps after the branching", "narrow_peak_at", &|one| {
            least(one) >= 5.0 && most(one) <= 12.0
        }),
        judge("narrow: orders from one state", "12 of 32 at least", "narrow_distinct", &|one| least(one) >= 12.0),
        // Of 32 draws with probability 1/32 each, more than 5 come with a probability of 0.0006.
        judge("narrow: own orders by chance", "5 of 32 at most", "narrow_regenerated", &|one| most(one) <= 5.0),
        judge("narrow: no network loses the reaction", "reaction time below 40", "narrow_other", &|one| {
            most(one) < 40.0
        }),
        judge("wide: reaction time, corresponding", "2 at most, on average", "wide_corresponding", &|one| {
            mean(one) <= 2.0
        }),
        judge("wide: reaction time with error regression", "9 at most, on average", "wide_regression", &|one| {
            mean(one) <= 9.0
        }),
        judge("in the world: narrow succeeds", "90 %", "narrow_world", &|one| mean(one) >= 90.0),
        judge("in the world: wide fails without error regression", "below 90 %", "wide_world", &|one| mean(one) < 90.0),
        judge("in the world: wide succeeds with it", "90 %", "wide_world_regression", &|one| mean(one) >= 90.0),
    ];
    goals.into_iter().flatten().chain(results.comparisons.iter().map(|one| one.verdict())).collect()
}

#[cfg(test)]
#[path = "goals_tests.rs"]
mod tests;
