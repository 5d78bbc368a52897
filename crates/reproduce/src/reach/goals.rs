//! What of the reaching experiment is compared with the thesis, and the goals (thesis 4.3).

use super::findings::{Driven, Findings};
use super::trials::{Found, pooled_rate};

use crate::framework::{JobResult, Measure, Verdict};

/// What is compared with the thesis and over seeds.
pub fn measures() -> Vec<Measure<Findings>> {
    let measure = Measure::<Findings>::new;
    vec![
        measure(
            "touched",
            "Touches per cycle, predicted noise",
            "pooled over nine places: positions 1 to 3, half way between, four at random",
            "\"able to produce the reaching movement not only ... at the learned positions\"",
            3,
            |f| f.rate("noise"),
        ),
        measure("touched_no_noise", "Touches per cycle, no noise", "the same places", "", 3, |f| f.rate("no_noise")),
        measure(
            "aim",
            "Hand off its place at the touch, mm",
            "from where it was taught to be, mean over places, with noise",
            "",
            1,
            |f| {
                let places = &f.condition("noise")?.places;
                let aims: Option<Vec<f64>> = places.iter().map(|found| found.aim).collect();
                aims.map(|aims| 1e3 * aims.iter().sum::<f64>() / aims.len() as f64)
            },
        ),
        measure(
            "spread_ratio",
            "Spread of the hand, touch over retraction",
            "with noise, over all places",
            "\"converged\" at the touch, \"diverges\" after it (Fig. 4.5)",
            3,
            |f| f.spread_ratio("noise"),
        ),
        measure(
            "spread_ratio_demonstrated",
            "The same in the demonstrations",
            "within each sequence",
            "",
            3,
            Findings::demonstrated_spread_ratio,
        ),
        measure(
            "touched_after_shift",
            "Touches per cycle after a shift",
            "from the second cycle at the new place on",
            "\"able to adaptively touch the object even if the object was shifted\"",
            3,
            |f| Some(f.rate_after_shift()),
        ),
        measure(
            "steps_to_adapt",
            "Samples to the first touch after a shift",
            "half seconds; a cycle has 12",
            "",
            1,
            Findings::steps_to_adapt,
        ),
        measure(
            "rank_correlation",
            "Predicted variance over the cycle",
            "rank correlation with the demonstrations' own variance",
            "lowest \"at the very moment of touching\" (Fig. 4.4)",
            3,
            |f| f.variance.rank_correlation,
        ),
        measure(
            "rank_correlation_driving",
            "The same while the network drives the robot",
            "by the robot's own touches",
            "",
            3,
            |f| f.variance.rank_correlation_driving,
        ),
        measure(
            "touch_over_retraction",
            "Predicted variance, touch over retraction",
            "one step ahead of the demonstrations",
            "",
            4,
            |f| Some(f.variance.touch_over_retraction),
        ),
        measure("touched_frozen", "Control: head frozen at position 2", "touches per cycle", "", 3, |f| {
            f.rate("frozen")
        }),
        measure(
            "spread_ratio_constant",
            "Control: noise of constant variance, spread ratio",
            "the same mean variance at all times",
            "",
            3,
            |f| f.spread_ratio("constant_noise"),
        ),
        measure(
            "touched_exact_between",
            "Control: learned from exact positions, half way between",
            "touches per cycle",
            "as in the thesis' text, which reports success",
            3,
            |f| f.condition("exact").map(|exact| pooled_rate(&exact.others().iter().collect::<Vec<_>>())),
        ),
        measure(
            "touched_replay",
            "Instead: replay of the nearest mean demonstration",
            "touches per cycle",
            "",
            3,
            |f| f.rate("replay"),
        ),
        measure("touched_mixture", "Instead: GMM/GMR, mean", "touches per cycle", "", 3, |f| f.rate("mixture")),
        measure("touched_mixture_noise", "Instead: GMM/GMR with its noise", "touches per cycle", "", 3, |f| {
            f.rate("mixture_noise")
        }),
    ]
}

/// Reported, and not judged.
pub fn times() -> Vec<Measure<Findings>> {
    let measure = Measure::<Findings>::new;
    vec![measure(
        "speed",
        "Closed loop, times real time",
        "median of all performances, by the time that one processor spends on it",
        "",
        0,
        |f| Some(f.speed),
    )]
}

/// Whether the goals are reached.
pub fn verdicts(seeds: &[JobResult<Findings>]) -> Vec<Verdict> {
    let condition = |key: &'static str, goal: &str, needed: &str, judge: fn(&Driven) -> (String, bool)| {
        Verdict::every(seeds, goal, needed, |seed| {
            seed.findings.condition(key).map_or(("none".to_owned(), false), judge)
        })
    };
    let number = |goal: &str, needed: &str, of: fn(&Findings) -> Option<f64>, met: fn(f64) -> bool| {
        Verdict::every(seeds, goal, needed, |seed| {
            let value = of(&seed.findings);
            (value.map_or("none".into(), |value| format!("{value:.3}")), value.is_some_and(met))
        })
    };
    vec![
        condition(
            "noise",
            "touches per cycle at the learned positions, predicted noise",
            "at least 0.92 at each",
            |c| {
                let least = Driven::least(c.learned());
                (format!("least {least:.3}"), least >= 0.92)
            },
        ),
        condition("noise", "touches per cycle at other places, predicted noise", "at least 0.88 at each", |c| {
            let least = Driven::least(c.others());
            (format!("least {least:.3}"), least >= 0.88)
        }),
        condition("noise", "touches per cycle, pooled, predicted noise", "at least 0.93", |c| {
            (format!("{:.3}", c.rate), c.rate >= 0.93)
        }),
        condition("noise", "every movement keeps going", "29 to 31 cycles of 30", |c| {
            let counts = c.places.iter().map(|found| found.cycles);
            let (least, most) = counts.fold((usize::MAX, 0), |(low, high), n| (low.min(n), high.max(n)));
            (format!("{least} to {most}"), least >= 29 && most <= 31)
        }),
        condition("no_noise", "touches per cycle, no noise", "at least 0.99", |c| {
            (format!("{:.3}", c.rate), c.rate >= 0.99)
        }),
        number(
            "touches per cycle after a shift, from the second on",
            "at least 0.92",
            |f| Some(f.rate_after_shift()),
            |r| r >= 0.92,
        ),
        Verdict::every(seeds, "joint targets beyond limits; samples with self-collision", "0; 0", |seed| {
            let ours = seed.findings.conditions.iter().filter(|c| ["noise", "no_noise"].contains(&c.key));
            let places: Vec<&Found> = ours.flat_map(|c| &c.places).collect();
            let beyond: usize = places.iter().map(|found| found.beyond_limits).sum();
            let collisions: usize = places.iter().map(|found| found.self_collisions).sum();
            (format!("{beyond}; {collisions}"), beyond + collisions == 0)
        }),
        number(
            "spread at the touch over spread after retraction, demonstrations",
            "at most 0.3",
            Findings::demonstrated_spread_ratio,
            |r| r <= 0.3,
        ),
        number("the same in the robot's own movement", "at most 0.3", |f| f.spread_ratio("noise"), |r| r <= 0.3),
        number(
            "rank correlation of predicted variance with the demonstrations' own",
            "above 0.9",
            |f| f.variance.rank_correlation,
            |r| r > 0.9,
        ),
        Verdict::every(seeds, "phase of the lowest predicted variance", "within 1 sample of the touch", |seed| {
            let lowest = seed.findings.variance.lowest;
            (lowest.to_string(), lowest.abs() <= 1)
        }),
        number(
            "predicted variance, touch over retraction",
            "below 0.1",
            |f| Some(f.variance.touch_over_retraction),
            |r| r < 0.1,
        ),
        Verdict::every(seeds, "predicted variance over squared error, by phase", "0.5 to 2 at every phase", |seed| {
            let [low, high] = seed.findings.variance.predicted_over_residual;
            (format!("{low:.2} to {high:.2}"), low >= 0.5 && high <= 2.0)
        }),
        number("control: touches per cycle with the head frozen", "at most 0.3", |f| f.rate("frozen"), |r| r <= 0.3),
        number(
            "control: spread ratio with noise of constant variance",
            "above 0.35",
            |f| f.spread_ratio("constant_noise"),
            |r| r > 0.35,
        ),
    ]
}
