//! NAO learns to reach from demonstrations, and adapts (thesis, chapter 4).

mod findings;
mod goals;
mod page;
mod processor_time;
mod trials;
mod variance;
mod variance_page;

use std::io::Cursor;

use scrnn_sim::reach::agent::{NetworkDriver, Noise, Performance, Snapshot, perform};
use scrnn_sim::reach::channels::REACHING;
use scrnn_sim::reach::recording::ReachingRecording;
use scrnn_sim::reach::stage::{POSITIONS, gaze_at, places_between};
use scrnn_sim::robot::nao;

use crate::framework::preset::asset;
use crate::framework::{Condition, Desk, Film, Job, Kind, Learned, Measure, Result, Results, Study, Verdict, in_trial};
use findings::{Driven, Findings, Material};
use scrnn_report::Section;
use scrnn_run::assessment;
use trials::{Company, Found, Given, Played, Shifted, Trial, Who, pooled_rate, pooled_spread_ratio, samples, still};
use variance::by_phase;

/// The S-CTRNN of the reaching experiment.
const TAUGHT: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("reaching.toml"), asset!("reaching_fast.toml")] };
/// The same, learned from three exact positions.
const TAUGHT_EXACTLY: Kind = Kind {
    name: "S-CTRNN of exact positions",
    suffix: "-exact",
    presets: [asset!("reaching_exact.toml"), asset!("reaching_exact_fast.toml")],
};

/// Half way between neighbouring positions.
const BETWEEN: [f64; 2] = [-0.105, -0.035];

/// Shifts of the sphere, from where to where, one each at another moment of the cycle.
const SHIFTS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 1), (2, 0)];
/// Sample of the first shift: a hand that keeps time is far from the sphere then.
const FIRST_SHIFT: usize = 48;

/// The driver of the figures: the network with the noise that it predicts.
const WITH_NOISE: &str = "noise";

/// Cycles of a recording: its page stays small.
const FILMED: usize = 5;

/// Number of the first trial whose sphere is shifted; those before it are one for each place.
const FIRST_SHIFTED: u64 = 100;

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
        plan(WITH_NOISE, "S-CTRNN, predicted noise", network(Noise::Predicted), cycles),
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

/// The S-CTRNN at one of the learned positions, with the noise that it predicts.
fn film(learned: &Learned, (y, position): (f64, usize), seed: u64, desk: &Desk<'_>) -> Result<Film> {
    desk.at(|| format!("a recording at position {position}"))?;
    let seed = in_trial(seed, position as u64 - 1);
    let Learned { network, initial_states, scaling, .. } = learned;
    let mut driver =
        NetworkDriver::new(network, initial_states.mean(), scaling, &Noise::Predicted, seed, desk.engine())?;
    let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), None, &[("task", "reach")])?;
    recording.begin_sequence(0.0, &format!("position {position}"))?;
    let mut look = |snapshot: &Snapshot<'_>| -> Result<()> {
        recording.snapshot(snapshot)?;
        if snapshot.decision.is_some() { desk.go_on() } else { Ok(()) }
    };
    perform(&still(y, FILMED), &mut driver, &mut look)?;
    let about = format!("NAO reaches, the sphere at position {position}");
    Ok(Film { name: format!("reach-{position}"), about, bytes: recording.finish()?.into_inner() })
}

impl Study for Reach {
    type Findings = Findings;
    type Material = Material;

    fn title(&self) -> &'static str {
        "NAO learns to reach"
    }

    fn edition(&self) -> u32 {
        2
    }

    fn conditions(&self, _beyond: bool) -> Vec<Condition> {
        vec![Condition::only(&[TAUGHT, TAUGHT_EXACTLY])]
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Findings, Material)> {
        let &Job { networks, seed, .. } = job;
        let engine = desk.engine();
        let learned = &networks[0];
        let demonstrations = &learned.source.demonstrations;
        let scaling = &learned.scaling;
        let scaled = scaling.apply(&learned.source.data)?;
        let open = assessment::open_loop(&learned.network, &learned.states(), &scaled, engine)?;
        let n = REACHING.len();
        let mean_variance = |channel: usize| {
            let all = open.iter().flat_map(|one| one.variance.iter().skip(channel).step_by(n));
            all.clone().sum::<f64>() / all.count() as f64
        };
        let constant: Vec<f64> = (0..n).map(mean_variance).collect();

        let company = Company::new(networks, seed, desk)?;
        let mut places = [&POSITIONS[..], &BETWEEN].concat();
        places.extend(places_between(seed, 4));
        let frozen = gaze_at(&nao::load_one_armed()?, POSITIONS[1])?;
        let (mut conditions, mut speeds) = (Vec::new(), Vec::new());
        let mut with_noise: Vec<(Performance, Given)> = Vec::new();
        for Plan { key, label, who, cycles, places, frozen } in plans(self, &places, constant, frozen) {
            let trial = |(place, &y): (usize, &f64)| Trial {
                who: who.clone(),
                performance: Performance { frozen, ..still(y, cycles) },
                seed: in_trial(seed, place as u64),
                pictures: key == WITH_NOISE && place < POSITIONS.len(),
            };
            let trials: Vec<Trial> = places.iter().enumerate().map(trial).collect();
            let Played { found, speeds: own } = match key {
                // Figures show these performances, so they are given whatever was kept.
                WITH_NOISE => {
                    let given = company.give_all(label, &trials, desk)?;
                    let played = Played::of(&trials, &given, Found::in_performance);
                    with_noise = trials.iter().map(|trial| trial.performance.clone()).zip(given).collect();
                    played
                }
                _ => desk.part(label, || {
                    Ok(Played::of(&trials, &company.give_all(label, &trials, desk)?, Found::in_performance))
                })?,
            };
            speeds.extend(own);
            let all: Vec<&Found> = found.iter().collect();
            let (rate, spread_ratio) = (pooled_rate(&all), pooled_spread_ratio(&all));
            conditions.push(Driven { key, label, rate, spread_ratio, places: found });
        }
        let shift = |(k, &(from, to)): (usize, &(usize, usize))| {
            let at = FIRST_SHIFT + 2 * k;
            let shift = Some((at, POSITIONS[to]));
            let performance =
                Performance { shift, samples: at + samples(self.after_shift), ..still(POSITIONS[from], 0) };
            let who = Who::Network { index: 0, noise: Noise::Predicted };
            Trial { who, performance, seed: in_trial(seed, FIRST_SHIFTED + k as u64), pictures: false }
        };
        let trials: Vec<Trial> = SHIFTS.iter().enumerate().map(shift).collect();
        let shifted: Played<Option<Shifted>> = desk.part("shifts of the sphere", || {
            Ok(Played::of(&trials, &company.give_all("shifts of the sphere", &trials, desk)?, Shifted::of))
        })?;
        speeds.extend(shifted.speeds);
        let driving: Vec<_> = with_noise[..POSITIONS.len()]
            .iter()
            .map(|(_, given)| (given.performed.decisions.as_slice(), given.performed.cycles.as_slice()))
            .collect();
        let variance = by_phase(demonstrations, &scaled, &open, &driving, scaling.scale());
        speeds.sort_by(f64::total_cmp);
        let demonstrated = demonstrations.iter().map(|one| {
            let expected = one.samples.len() / n / scrnn_sim::reach::stage::CYCLE;
            Found::of(one.y, expected, &one.cycles)
        });
        let findings = Findings {
            demonstrations: demonstrated.collect(),
            conditions,
            shifts: shifted.found.into_iter().flatten().collect(),
            variance,
            speed: speeds[speeds.len() / 2],
        };
        // The positions and what lies half way, from right to left.
        let performances = [0, 3, 1, 4, 2].map(|k| with_noise[k].clone()).into_iter().collect();
        Ok((findings, Material { demonstrations: demonstrations.clone(), performances }))
    }

    fn films(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<Vec<Film>> {
        let places = POSITIONS.iter().zip(1..).filter(|_| job.first);
        places.map(|(&y, position)| film(&job.networks[0], (y, position), job.seed, desk)).collect()
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        goals::measures()
    }

    fn times(&self) -> Vec<Measure<Findings>> {
        goals::times()
    }

    fn verdicts(&self, results: &Results<Findings>) -> Vec<Verdict> {
        goals::verdicts(&results.jobs)
    }

    fn sections(&self, results: &Results<Findings>, materials: &[Material]) -> Vec<Section> {
        page::sections(&results.jobs, materials)
    }
}

#[cfg(test)]
mod tests;
