//! NAO learns to reach from demonstrations, and adapts (thesis, chapter 4).

mod goals;
mod page;
mod trials;
mod variance;

use scrnn::engine::Engine;
use scrnn_sim::agent::{Noise, Performance};
use scrnn_sim::channels::{REACHING, VISION};
use scrnn_sim::nao;
use scrnn_sim::reaching::{POSITIONS, gaze_at, places_between};
use scrnn_sim::tutor::Demonstration;
use serde::Serialize;

use super::preset::{self, Kind};
use super::study::{Learned, Measure, SeedResult, Study, Verdict};
use scrnn_report::Section;
use scrnn_run::assessment;
use scrnn_run::failure::Result;
use trials::{Company, Found, Given, Shifted, Trial, Who, pooled_rate, pooled_spread_ratio, samples, still};
use variance::{ByPhase, by_phase};

/// Half way between neighbouring positions.
const BETWEEN: [f64; 2] = [-0.105, -0.035];

/// Shifts of the sphere, from where to where, one each at another moment of the cycle.
const SHIFTS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 1), (2, 0)];
/// Sample of the first shift: a hand that keeps time is far from the sphere then.
const FIRST_SHIFT: usize = 48;

/// Sets the noise of performances apart from other numbers of a seed.
const NOISE: u64 = 1000;

/// The experiment.
#[derive(Debug)]
pub struct Reach {
    /// Cycles of a performance with noise.
    cycles: usize,
    /// Cycles of the others.
    fewer: usize,
    /// Cycles after the sphere was put elsewhere.
    after_shift: usize,
}

/// At its full length.
pub const REACH: Reach = Reach { cycles: 30, fewer: 10, after_shift: 15 };

/// The figures of one seed.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// The demonstrations, one entry for each sequence.
    pub demonstrations: Vec<Found>,
    /// What came of each driver: by place, the three positions first, then those half way, then four at random.
    pub conditions: Vec<Condition>,
    /// After the sphere was put elsewhere.
    pub shifts: Vec<Shifted>,
    /// Variance over the cycle.
    pub variance: ByPhase,
    /// How many times faster than real time the closed loop ran on one processor: the median of all performances.
    pub speed: f64,
}

/// One driver at several places.
#[derive(Debug, Clone, Serialize)]
pub struct Condition {
    /// Its name.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// Touches per cycle over all places.
    pub rate: f64,
    /// Spread at the touch over spread after retraction, over all places.
    pub spread_ratio: Option<f64>,
    /// Place by place.
    pub places: Vec<Found>,
}

impl Condition {
    /// The places that were learned.
    pub fn learned(&self) -> &[Found] {
        &self.places[..POSITIONS.len().min(self.places.len())]
    }

    /// The others.
    pub fn others(&self) -> &[Found] {
        &self.places[POSITIONS.len().min(self.places.len())..]
    }

    /// The least touches per cycle over some places.
    pub fn least(found: &[Found]) -> f64 {
        found.iter().map(Found::rate).fold(f64::INFINITY, f64::min)
    }
}

impl Findings {
    /// A condition by its key.
    pub fn condition(&self, key: &str) -> Option<&Condition> {
        self.conditions.iter().find(|condition| condition.key == key)
    }

    fn rate(&self, key: &str) -> Option<f64> {
        self.condition(key).map(|condition| condition.rate)
    }

    fn spread_ratio(&self, key: &str) -> Option<f64> {
        self.condition(key).and_then(|condition| condition.spread_ratio)
    }

    /// Spread ratio of the demonstrations.
    pub fn demonstrated_spread_ratio(&self) -> Option<f64> {
        pooled_spread_ratio(&self.demonstrations.iter().collect::<Vec<_>>())
    }

    /// Touches after a shift, from the second cycle on.
    pub fn rate_after_shift(&self) -> f64 {
        let sum = |of: fn(&Shifted) -> usize| self.shifts.iter().map(of).sum::<usize>() as f64;
        sum(|shift| shift.touched) / sum(|shift| shift.expected).max(1.0)
    }

    /// Mean samples to the first touch after a shift; none if one never came.
    pub fn steps_to_adapt(&self) -> Option<f64> {
        let steps: Option<Vec<f64>> = self.shifts.iter().map(|shift| shift.steps_to_adapt).collect();
        steps.map(|steps| steps.iter().sum::<f64>() / steps.len() as f64)
    }
}

/// What figures are drawn from.
pub struct Material {
    /// The demonstrations.
    pub demonstrations: Vec<Demonstration>,
    /// Performances with noise at the positions and half way between, from position 1 to position 3.
    pub performances: Vec<(Performance, Given)>,
}

/// A driver and where it is tried.
struct Plan {
    key: &'static str,
    label: &'static str,
    who: Who,
    cycles: usize,
    places: Vec<f64>,
    frozen: Option<[f64; 2]>,
}

/// All drivers. `constant` is the variance of the noise that does not change.
fn plans(study: &Reach, places: &[f64], constant: Vec<f64>, frozen: [f64; 2]) -> Vec<Plan> {
    let &Reach { cycles, fewer, .. } = study;
    let learned_and_between = places[..POSITIONS.len() + BETWEEN.len()].to_vec();
    let plan = |key, label, who, cycles| Plan { key, label, who, cycles, places: places.to_vec(), frozen: None };
    let network = |noise| Who::Network { index: 0, noise };
    vec![
        plan("noise", "S-CTRNN, predicted noise", network(Noise::Predicted), cycles),
        plan("no_noise", "S-CTRNN, no noise", network(Noise::Off), fewer),
        plan("constant_noise", "S-CTRNN, noise of constant variance", network(Noise::Constant(constant)), fewer),
        Plan {
            frozen: Some(frozen),
            ..plan("frozen", "S-CTRNN, head frozen at position 2", network(Noise::Predicted), fewer)
        },
        Plan {
            places: learned_and_between,
            ..plan(
                "exact",
                "S-CTRNN that learned three exact positions",
                Who::Network { index: 1, noise: Noise::Predicted },
                fewer,
            )
        },
        plan("replay", "replay of the nearest mean demonstration", Who::Replay, fewer),
        plan("mixture", "GMM/GMR, mean", Who::Mixture { noise: false }, fewer),
        plan("mixture_noise", "GMM/GMR, noise of its covariance", Who::Mixture { noise: true }, fewer),
    ]
}

impl Study for Reach {
    type Findings = Findings;
    type Material = Material;

    fn networks(&self) -> &'static [Kind] {
        &[preset::REACH, preset::REACH_EXACT]
    }

    fn evaluate(&self, networks: &[Learned], seed: u64, engine: &Engine) -> Result<(Findings, Material)> {
        let learned = &networks[0];
        let demonstrations = &learned.source.demonstrations;
        let scaling = learned.experiment.data.scaling_for(&learned.source.data)?;
        let scaled = scaling.apply(&learned.source.data);
        let open = assessment::open_loop(&learned.network, &learned.states(), &scaled, engine)?;
        let n = REACHING.len();
        let mean_variance = |channel: usize| {
            let all = open.iter().flat_map(|one| one.variance.iter().skip(channel).step_by(n));
            all.clone().sum::<f64>() / all.count() as f64
        };
        let constant: Vec<f64> = (0..n).map(mean_variance).collect();

        let company = Company::new(networks, seed, engine.instruction_set())?;
        let mut places = [&POSITIONS[..], &BETWEEN].concat();
        places.extend(places_between(seed, 4));
        let frozen = gaze_at(&nao::load_one_armed()?, POSITIONS[1])?;
        let plans = plans(self, &places, constant, frozen);
        let mut trials = Vec::new();
        for plan in &plans {
            for (place, &y) in plan.places.iter().enumerate() {
                let performance = Performance { frozen: plan.frozen, ..still(y, plan.cycles) };
                let pictures = plan.key == "noise" && place < POSITIONS.len();
                trials.push(Trial {
                    who: plan.who.clone(),
                    performance,
                    seed: seed + NOISE * (1 + place as u64),
                    pictures,
                });
            }
        }
        let shifts = trials.len();
        for (k, &(from, to)) in SHIFTS.iter().enumerate() {
            let at = FIRST_SHIFT + 2 * k;
            let shift = Some((at, POSITIONS[to]));
            let performance =
                Performance { shift, samples: at + samples(self.after_shift), ..still(POSITIONS[from], 0) };
            let who = Who::Network { index: 0, noise: Noise::Predicted };
            trials.push(Trial { who, performance, seed: seed + NOISE * (100 + k as u64), pictures: false });
        }
        let given = company.give_all(&trials, engine.threads())?;

        let mut conditions = Vec::new();
        let mut next = 0;
        for Plan { key, label, places, .. } in plans {
            let own = next..next + places.len();
            next = own.end;
            let found: Vec<Found> =
                own.map(|k| Found::in_performance(&trials[k].performance, &given[k].performed)).collect();
            let all: Vec<&Found> = found.iter().collect();
            let (rate, spread_ratio) = (pooled_rate(&all), pooled_spread_ratio(&all));
            conditions.push(Condition { key, label, rate, spread_ratio, places: found });
        }
        let after = trials[shifts..].iter().zip(&given[shifts..]);
        let shifted = after.filter_map(|(trial, given)| Shifted::of(&trial.performance, &given.performed)).collect();
        let driving: Vec<_> = given[..POSITIONS.len()]
            .iter()
            .map(|given| (given.performed.decisions.as_slice(), given.performed.cycles.as_slice()))
            .collect();
        let variance = by_phase(demonstrations, &scaled, &open, &driving, scaling.scale());
        let mut speeds: Vec<f64> = given.iter().map(|given| given.speed).collect();
        speeds.sort_by(f64::total_cmp);
        let demonstrated = demonstrations.iter().map(|one| {
            let expected = one.samples.len() / n / scrnn_sim::reaching::CYCLE;
            Found::of(one.y, expected, &one.cycles)
        });
        let findings = Findings {
            demonstrations: demonstrated.collect(),
            conditions,
            shifts: shifted,
            variance,
            speed: speeds[speeds.len() / 2],
        };
        // The positions and what lies half way, from right to left.
        let performances =
            [0, 3, 1, 4, 2].map(|k| (trials[k].performance.clone(), given[k].clone())).into_iter().collect();
        Ok((findings, Material { demonstrations: demonstrations.clone(), performances }))
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        goals::measures()
    }

    fn verdicts(&self, seeds: &[SeedResult<Findings>]) -> Vec<Verdict> {
        goals::verdicts(seeds)
    }

    fn sections(&self, seed: &SeedResult<Findings>, material: &Material) -> Vec<Section> {
        page::sections(&seed.findings, material)
    }
}

/// The channel that a name of the thesis' figures stands for.
pub fn channel(name: &str) -> usize {
    REACHING.iter().position(|channel| *channel == name).unwrap_or(VISION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use crate::study::TrainingFacts;
    use scrnn::initialization::initialize;
    use scrnn_report::Page;
    use scrnn_run::source;

    /// Networks that have learned nothing, beside three short demonstrations.
    fn networks() -> Vec<Learned> {
        let learned = |kind: &Kind| {
            let mut experiment = kind.experiment(Preset::Fast, 2, Some(1), &[]).unwrap();
            (experiment.data.sequences, experiment.data.steps) = (Some(3), Some(36));
            let source = source::load(&experiment.data, 2).unwrap();
            let (network, initial_states) = initialize(&experiment.topology(6).unwrap(), 3, 2);
            let training = TrainingFacts {
                network: kind.name,
                folder: String::new(),
                epochs: 0,
                nll: None,
                mse: None,
                seconds: 0.0,
                recoveries: 0,
                diverged: None,
            };
            Learned { name: kind.name, experiment, network, initial_states, source, history: Vec::new(), training }
        };
        REACH.networks().iter().map(learned).collect()
    }

    #[test]
    fn a_short_reproduction_judges_every_driver_and_the_same_seed_comes_to_the_same() {
        let study = Reach { cycles: 6, fewer: 1, after_shift: 1 };
        let networks = networks();
        let evaluate = |threads| {
            let engine = Engine::new(threads, scrnn::engine::InstructionSet::best()).unwrap();
            let (mut findings, material) = study.evaluate(&networks, 2, &engine).unwrap();
            findings.speed = 0.0;
            (serde_json::to_value(&findings).unwrap(), findings, material)
        };
        let (first, findings, material) = evaluate(2);
        assert_eq!(first, evaluate(1).0);
        let keys: Vec<&str> = findings.conditions.iter().map(|condition| condition.key).collect();
        let expected = ["noise", "no_noise", "constant_noise", "frozen", "exact", "replay", "mixture", "mixture_noise"];
        assert_eq!(keys, expected);
        assert_eq!((findings.conditions[0].places.len(), findings.conditions[4].places.len()), (9, 5));
        // A tutor touches, an untrained network does not, and a replayed demonstration does where it was given.
        assert!(findings.demonstrations.iter().all(|one| one.rate() == 1.0));
        assert!(findings.rate("noise").unwrap() < 0.5);
        assert!(findings.condition("replay").unwrap().learned().iter().any(|found| found.touched > 0));
        assert_eq!((findings.shifts.len(), findings.variance.phase.len()), (6, 12));

        let seed = SeedResult { seed: 2, seconds: 1.0, threads: 1, trainings: Vec::new(), findings };
        let page = Page { title: "t".into(), lede: String::new(), sections: study.sections(&seed, &material) };
        let files: Vec<&str> = page.figures().map(|figure| figure.file.as_str()).collect();
        assert_eq!(files, ["over-time", "snapshots", "phase-plots", "variance-by-phase"]);
        assert!(!page.html().contains("NaN"));
        let verdicts = study.verdicts(&[seed]);
        assert_eq!(verdicts.len(), 17);
        let met = |goal: &str| verdicts.iter().find(|verdict| verdict.goal.starts_with(goal)).unwrap().met;
        assert!(!met("touches per cycle, no noise") && !met("touches per cycle, pooled") && met("time of a seed"));
    }
}
