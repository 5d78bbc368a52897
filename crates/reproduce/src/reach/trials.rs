//! Performances of the reaching experiment: who drives the arm, where the sphere lies, and the result.

use scrnn::analysis::mixture::{GaussianMixture, MixtureOptions};
use scrnn::engine::Engine;
use scrnn::jobs::side_by_side;
use scrnn_sim::reach::agent::{
    Decision, Driver, MixtureDriver, NetworkDriver, Noise, Performance, Performed, Replay, Snapshot, perform,
};
use scrnn_sim::reach::channels::{REACHING, VISION};
use scrnn_sim::reach::stage::{CYCLE, PERIOD, POSITIONS};
use scrnn_sim::reach::touching::{Cycle, spread};
use scrnn_sim::reach::tutor::Demonstration;
use scrnn_sim::world::WorldOptions;
use scrnn_sim::world::scene::Scene;
use serde::{Deserialize, Serialize};

use super::processor_time::ProcessorTime;
use crate::framework::{Desk, Learned, Result};

/// Components of the mixture: with 41 of them it has as many numbers as the network, about 1480.
pub const COMPONENTS: usize = 41;

/// Who drives the arm.
#[derive(Debug, Clone)]
pub enum Who {
    /// One of the trained networks.
    Network {
        /// Its place among them.
        index: usize,
        /// On what it feeds back.
        noise: Noise,
    },
    /// The mean demonstration at the nearest position.
    Replay,
    /// Gaussian mixture regression, with noise of its covariance or without.
    Mixture {
        /// Whether there is noise.
        noise: bool,
    },
}

/// One performance to give.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The driver.
    pub who: Who,
    /// The stage.
    pub performance: Performance,
    /// Of the noise.
    pub seed: u64,
    /// Whether to keep pictures.
    pub pictures: bool,
}

/// The result of one performance.
#[derive(Debug, Clone)]
pub struct Given {
    /// All of it.
    pub performed: Performed,
    /// Pictures with their times, ten in a second; empty unless asked for.
    pub pictures: Vec<(f64, Scene)>,
    /// How many times faster than real time it was, by the processor's time.
    pub speed: f64,
}

/// Samples that a performance of so many cycles takes.
pub fn samples(cycles: usize) -> usize {
    cycles * CYCLE
}

/// A stage with the sphere at one place.
pub fn still(y: f64, cycles: usize) -> Performance {
    Performance { y, samples: samples(cycles), shift: None, frozen: None, world: WorldOptions::default() }
}

/// What trials need to know.
#[derive(Debug)]
pub struct Company<'a> {
    networks: &'a [Learned],
    engine: Engine,
    /// The mean arm at each sample, for each position.
    replays: Vec<Vec<[f64; 4]>>,
    mixture: GaussianMixture,
}

impl<'a> Company<'a> {
    /// Fits what the network is compared with.
    pub fn new(networks: &'a [Learned], seed: u64, desk: &Desk<'_>) -> Result<Self> {
        let demonstrations = &networks[0].source.demonstrations;
        let replays = (0..POSITIONS.len()).map(|position| mean_arms(demonstrations, position)).collect();
        let mut points = Vec::new();
        for demonstration in demonstrations {
            for (at, sample) in demonstration.samples.chunks_exact(REACHING.len()).enumerate() {
                points.extend(MixtureDriver::given(at, CYCLE, &sample[..VISION]));
                points.extend_from_slice(&sample[VISION..]);
            }
        }
        let options = MixtureOptions { components: COMPONENTS, seed, ..MixtureOptions::default() };
        desk.say(&format!("a Gaussian mixture of {COMPONENTS} components to compare with"));
        let mut go_on =
            |step| desk.at(|| format!("a Gaussian mixture, step {} of {} at most", step + 1, options.iterations));
        let mixture = GaussianMixture::fit_while(&points, 1 + REACHING.len(), &options, &mut go_on)?;
        Ok(Self { networks, engine: desk.engine().clone(), replays, mixture })
    }

    fn driver(&self, trial: &Trial) -> Result<Box<dyn Driver>> {
        Ok(match &trial.who {
            Who::Network { index, noise } => {
                let Learned { network, initial_states, scaling, .. } = &self.networks[*index];
                Box::new(NetworkDriver::new(network, initial_states.mean(), scaling, noise, trial.seed, &self.engine)?)
            }
            Who::Replay => {
                let distance = |k: &usize| (POSITIONS[*k] - trial.performance.y).abs();
                let nearest = (0..POSITIONS.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
                Box::new(Replay::new(self.replays[nearest].clone())?)
            }
            Who::Mixture { noise } => {
                let regression = self.mixture.regression(1 + VISION)?;
                Box::new(MixtureDriver::new(regression, CYCLE, noise.then_some(trial.seed)))
            }
        })
    }

    /// Gives one performance.
    fn give(&self, trial: &Trial, desk: &Desk<'_>) -> Result<Given> {
        let mut driver = self.driver(trial)?;
        let mut pictures = Vec::new();
        let clock = ProcessorTime::start();
        let mut look = |glimpse: &Snapshot<'_>| -> Result<()> {
            let time = glimpse.stage.world().time();
            if trial.pictures && glimpse.decision.is_none() && time + 1e-9 > 0.1 * (pictures.len() + 1) as f64 {
                pictures.push((time, glimpse.stage.world().scene()));
            }
            if glimpse.decision.is_some() { desk.go_on() } else { Ok(()) }
        };
        let performed = perform(&trial.performance, driver.as_mut(), &mut look)?;
        let speed = trial.performance.samples as f64 * PERIOD / clock.seconds();
        Ok(Given { performed, pictures, speed })
    }

    /// Gives all of them, side by side on the engine's threads.
    pub fn give_all(&self, label: &str, trials: &[Trial], desk: &Desk<'_>) -> Result<Vec<Given>> {
        side_by_side(trials.len(), desk.engine().threads(), |k, _| {
            desk.at(|| format!("{label}, {} of {}", k + 1, trials.len()))?;
            self.give(&trials[k], desk)
        })
    }
}

/// What is kept of several performances.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Played<T> {
    /// What came of each.
    pub found: Vec<T>,
    /// How many times faster than real time each was.
    pub speeds: Vec<f64>,
}

impl<T> Played<T> {
    /// Of performances, each judged by `judge`.
    pub fn of(trials: &[Trial], given: &[Given], judge: impl Fn(&Performance, &Performed) -> T) -> Self {
        let both = trials.iter().zip(given);
        Self {
            found: both.map(|(trial, given)| judge(&trial.performance, &given.performed)).collect(),
            speeds: given.iter().map(|given| given.speed).collect(),
        }
    }
}

/// The arm at each sample, averaged over all demonstrations at a position.
fn mean_arms(demonstrations: &[Demonstration], position: usize) -> Vec<[f64; 4]> {
    let own: Vec<&Demonstration> = demonstrations.iter().filter(|one| one.position == position).collect();
    let n = REACHING.len();
    let samples = own.iter().map(|one| one.samples.len() / n).min().unwrap_or(0);
    let mean = |at: usize, joint: usize| {
        own.iter().map(|one| one.samples[at * n + VISION + joint]).sum::<f64>() / own.len().max(1) as f64
    };
    (0..samples).map(|at| std::array::from_fn(|joint| mean(at, joint))).collect()
}

/// What came of a movement with the sphere at one place.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Found {
    /// Across, in metres.
    pub y: f64,
    /// Cycles that there should be.
    pub expected: usize,
    /// Cycles that there were.
    pub cycles: usize,
    /// Cycles that were touches.
    pub touched: usize,
    /// Cycles that ended far enough away.
    pub retracted: usize,
    /// Mean gap at the touch, in metres; negative in overlap.
    pub gap: Option<f64>,
    /// Mean distance from where the hand was taught to be at the touch, in metres.
    pub aim: Option<f64>,
    /// 95 % of these distances are smaller.
    pub aim_95: Option<f64>,
    /// Spread of the hand at the touch, in metres.
    pub spread_touch: Option<f64>,
    /// Spread of the hand after retraction, in metres.
    pub spread_retraction: Option<f64>,
    /// Mean time between touches, in samples.
    pub period: Option<f64>,
    /// Joint targets beyond limits.
    pub beyond_limits: usize,
    /// Samples within which the robot touched itself.
    pub self_collisions: usize,
}

impl Found {
    /// In a movement of so many cycles.
    pub fn of(y: f64, expected: usize, cycles: &[Cycle]) -> Self {
        let some = |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let gaps: Vec<f64> = cycles.iter().map(|cycle| cycle.touch.gap).collect();
        let mut aims: Vec<f64> = cycles.iter().map(|cycle| cycle.touch.aim).collect();
        let aim = some(&aims);
        aims.sort_by(f64::total_cmp);
        let away: Vec<[f64; 3]> = cycles.iter().filter_map(|cycle| Some(cycle.retraction?.hand)).collect();
        let periods: Vec<f64> = cycles.windows(2).map(|two| (two[1].touch.time - two[0].touch.time) / PERIOD).collect();
        Self {
            y,
            expected,
            cycles: cycles.len(),
            touched: cycles.iter().filter(|cycle| cycle.touched).count(),
            retracted: cycles.iter().filter(|cycle| cycle.retracted).count(),
            gap: some(&gaps),
            aim,
            aim_95: (!aims.is_empty())
                .then(|| aims[((aims.len() as f64 * 0.95).ceil() as usize - 1).min(aims.len() - 1)]),
            spread_touch: spread(cycles.iter().map(|cycle| &cycle.touch.hand)),
            spread_retraction: spread(&away),
            period: some(&periods),
            beyond_limits: 0,
            self_collisions: 0,
        }
    }

    /// In a performance.
    pub fn in_performance(performance: &Performance, performed: &Performed) -> Self {
        let found = Self::of(performance.y, performance.samples / CYCLE, &performed.cycles);
        let Performed { beyond_limits, self_collisions, .. } = *performed;
        Self { beyond_limits, self_collisions, ..found }
    }

    /// Touches per cycle. Missing cycles are failures, and more cycles than there should be are no merit.
    pub fn rate(&self) -> f64 {
        self.touched as f64 / self.expected.max(self.cycles) as f64
    }
}

/// Touches per cycle over several movements.
pub fn pooled_rate(found: &[&Found]) -> f64 {
    let cycles: usize = found.iter().map(|one| one.expected.max(one.cycles)).sum();
    found.iter().map(|one| one.touched).sum::<usize>() as f64 / cycles.max(1) as f64
}

/// Spread at the touch over spread after retraction, each the root mean square over movements.
pub fn pooled_spread_ratio(found: &[&Found]) -> Option<f64> {
    let both = found.iter().filter_map(|one| Some((one.spread_touch?, one.spread_retraction?)));
    let (touch, away) = both.fold((0.0, 0.0), |(touch, away), (a, b)| (touch + a * a, away + b * b));
    (away > 0.0).then(|| (touch / away).sqrt())
}

/// After the sphere was put elsewhere.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Shifted {
    /// From where, in metres.
    pub from: f64,
    /// To where, in metres.
    pub to: f64,
    /// At which sample.
    pub at: usize,
    /// Samples until the first touch at the new place; none if there was none.
    pub steps_to_adapt: Option<f64>,
    /// Cycles that there should be after the first one at the new place.
    pub expected: usize,
    /// Those of them that were touches.
    pub touched: usize,
}

impl Shifted {
    /// In a performance with a shift.
    pub fn of(performance: &Performance, performed: &Performed) -> Option<Self> {
        let (at, to) = performance.shift?;
        let time = at as f64 * PERIOD;
        let after: Vec<&Cycle> = performed.cycles.iter().filter(|cycle| cycle.touch.time > time).collect();
        let first = after.iter().find(|cycle| cycle.touched);
        let later = after.get(1..).unwrap_or_default();
        let expected = ((performance.samples - at) / CYCLE).saturating_sub(1).max(later.len());
        Some(Self {
            from: performance.y,
            to,
            at,
            steps_to_adapt: first.map(|cycle| (cycle.touch.time - time) / PERIOD),
            expected,
            touched: later.iter().filter(|cycle| cycle.touched).count(),
        })
    }
}

/// Values of one channel, decision by decision.
pub fn decided(decisions: &[Decision], value: impl Fn(&Decision) -> Option<f64>) -> Vec<(f64, f64)> {
    decisions.iter().enumerate().filter_map(|(k, decision)| Some(((k + 1) as f64, value(decision)?))).collect()
}
