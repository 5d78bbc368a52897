//! The closed loop of the reaching experiment (thesis 4.2.3): what the robot senses, what is made of it, where the arm goes.
//!
//! ```text
//! x_t^(p) = y_{t-1}^(p) + eps_{t-1}^(p)    the arm's own prediction, with noise of the predicted variance   (4.1)
//! x_t^(v) = y-hat_{t-1}^(v)                where the head truly looks
//! ```
//!
//! The prediction of the arm's next sample is where its joints go. Whatever decides that is a [`Driver`]: the network, or
//! what it is compared with. Here a network meets the world.

use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scrnn::analysis::mixture::MixtureRegression;
use scrnn::engine::Engine;
use scrnn::generation::{ChannelFeedback, Feedback, Running};
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn::streams::{Purpose, stream};

use crate::error::{Error, Result};
use crate::reach::channels::{ARM, REACHING, VISION};
use crate::reach::stage::{Stage, retracted_arm, samples_to_steps};
use crate::reach::touching::{Cycle, TouchDetector};
use crate::world::WorldOptions;

/// Which stream of [`Purpose::StandIn`] is whose.
const CONSTANT_NOISE: u64 = 0;
const MIXTURE_NOISE: u64 = 1;

/// What is expected of the next sample, and where the arm is to go, by channel in rad.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Decision {
    /// The expected sample.
    pub mean: Vec<f64>,
    /// How far off it is expected to be, in rad^2; empty where nothing is known.
    pub variance: Vec<f64>,
    /// Where the arm is to go.
    pub target: [f64; 4],
    /// The network's context; empty without a network.
    pub context: Vec<f64>,
}

/// Decides where the arm goes.
pub trait Driver {
    /// Takes in a sample and looks ahead to the next one.
    ///
    /// # Errors
    /// Those of a network of another size.
    fn decide(&mut self, sensed: &[f64]) -> Result<Decision>;
}

/// The noise on what the network feeds back to itself.
#[derive(Debug, Clone, PartialEq)]
pub enum Noise {
    /// Of the predicted variance, as in (4.1).
    Predicted,
    /// None.
    Off,
    /// Of the same variance at all times, one for each channel in the network's units: a control.
    Constant(Vec<f64>),
}

/// A trained network that drives the arm.
#[derive(Debug)]
pub struct NetworkDriver {
    running: Running,
    scaling: Scaling,
    /// Deviations of constant noise, with its generator; then the arm's next input is made here.
    constant: Option<(Vec<f64>, ChaCha8Rng)>,
    next: Option<Vec<f64>>,
}

impl NetworkDriver {
    /// A network at an initial state. `scaling` leads from angles to the network's units.
    ///
    /// # Errors
    /// [`Error::Setting`] for a network that does not predict head and arm one sample ahead, and those of
    /// [`Running::new`].
    pub fn new(
        network: &Network,
        initial_state: &[f64],
        scaling: &Scaling,
        noise: &Noise,
        seed: u64,
        engine: &Engine,
    ) -> Result<Self> {
        let (channels, delay) = (network.topology().channels(), network.topology().delay());
        if channels != REACHING.len() || delay != 1 {
            let found = format!("on {channels} channels with a delay of {delay}");
            return Err(Error::Setting {
                what: "the network",
                found,
                needed: "6 channels, head and arm, and a delay of 1",
            });
        }
        let arm = match noise {
            Noise::Predicted => ChannelFeedback { sensed: 0.0, noise: true },
            Noise::Off => ChannelFeedback { sensed: 0.0, noise: false },
            Noise::Constant(_) => ChannelFeedback { sensed: 1.0, noise: false },
        };
        let head = ChannelFeedback { sensed: 1.0, noise: false };
        let feedback = Feedback((0..channels).map(|channel| if channel < VISION { head } else { arm }).collect());
        let constant = match noise {
            Noise::Constant(variance) if variance.len() != channels => {
                return Err(Error::Length { what: "the constant variance", found: variance.len(), needed: channels });
            }
            Noise::Constant(variance) => {
                Some((variance.iter().map(|v| v.sqrt()).collect(), stream(seed, Purpose::StandIn, CONSTANT_NOISE)))
            }
            _ => None,
        };
        let running = Running::new(network, initial_state, feedback, seed, engine)?;
        Ok(Self { running, scaling: scaling.clone(), constant, next: None })
    }
}

impl Driver for NetworkDriver {
    fn decide(&mut self, sensed: &[f64]) -> Result<Decision> {
        if sensed.len() != REACHING.len() {
            return Err(Error::Length { what: "the sample", found: sensed.len(), needed: REACHING.len() });
        }
        let scaled = |(channel, &angle): (usize, &f64)| self.scaling.to_scaled(channel, angle);
        let mut input: Vec<f64> = sensed.iter().enumerate().map(scaled).collect();
        if let Some(next) = &self.next {
            input[VISION..].copy_from_slice(&next[VISION..]);
        }
        self.running.step(&input)?;
        let mut sample = self.running.sample().to_vec();
        if let Some((deviations, random)) = &mut self.constant {
            for (value, deviation) in sample.iter_mut().zip(deviations.iter()) {
                let z: f64 = StandardNormal.sample(random);
                *value += deviation * z;
            }
            self.next = Some(sample.clone());
        }
        let raw = |(channel, &value): (usize, &f64)| self.scaling.to_raw(channel, value);
        Ok(Decision {
            mean: self.running.mean().iter().enumerate().map(raw).collect(),
            variance: self
                .running
                .variance()
                .iter()
                .enumerate()
                .map(|(c, &v)| self.scaling.variance_to_raw(c, v))
                .collect(),
            target: std::array::from_fn(|joint| self.scaling.to_raw(VISION + joint, sample[VISION + joint])),
            context: self.running.context().to_vec(),
        })
    }
}

/// A recording that is played again and again, whatever the head sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    arms: Vec<[f64; 4]>,
    at: usize,
}

impl Replay {
    /// Plays the arms of a recording one after the other, from the second on.
    ///
    /// # Errors
    /// [`Error::Length`] for no arm at all.
    pub fn new(arms: Vec<[f64; 4]>) -> Result<Self> {
        match arms.is_empty() {
            true => Err(Error::Length { what: "the recording", found: 0, needed: 1 }),
            false => Ok(Self { arms, at: 0 }),
        }
    }
}

impl Driver for Replay {
    fn decide(&mut self, sensed: &[f64]) -> Result<Decision> {
        self.at = (self.at + 1) % self.arms.len();
        let target = self.arms[self.at];
        Ok(Decision { mean: [&sensed[..VISION], &target].concat(), target, ..Decision::default() })
    }
}

/// Gaussian mixture regression of the arm on the phase of the metronome and on the head (thesis 1.4.2).
#[derive(Debug)]
pub struct MixtureDriver {
    regression: MixtureRegression,
    /// Samples of a cycle.
    cycle: usize,
    at: usize,
    random: Option<ChaCha8Rng>,
}

impl MixtureDriver {
    /// `regression` gives the arm's four angles where [`MixtureDriver::given`] are given. With a seed, noise of the
    /// regression's covariance is added.
    #[must_use]
    pub fn new(regression: MixtureRegression, cycle: usize, noise: Option<u64>) -> Self {
        Self { regression, cycle, at: 0, random: noise.map(|seed| stream(seed, Purpose::StandIn, MIXTURE_NOISE)) }
    }

    /// What is given for sample `at`: the phase within the metronome's beat, from 0 to 1, then the head's angles.
    #[must_use]
    pub fn given(at: usize, cycle: usize, head: &[f64]) -> Vec<f64> {
        vec![(at % cycle) as f64 / cycle as f64, head[0], head[1]]
    }
}

impl Driver for MixtureDriver {
    fn decide(&mut self, sensed: &[f64]) -> Result<Decision> {
        self.at += 1;
        let regressed = self.regression.predict(&Self::given(self.at, self.cycle, &sensed[..VISION]))?;
        let mut target: [f64; 4] = std::array::from_fn(|joint| regressed.mean[joint]);
        if let Some(random) = &mut self.random {
            let covariance = nalgebra::Matrix4::from_row_slice(&regressed.covariance);
            let z = nalgebra::Vector4::from_fn(|_, _| StandardNormal.sample(random));
            // Where rounding has left the covariance without a factor, noise is drawn by its diagonal.
            let noise = covariance.cholesky().map_or_else(
                || z.component_mul(&covariance.diagonal().map(|v| v.max(0.0).sqrt())),
                |factor| factor.l() * z,
            );
            target = std::array::from_fn(|joint| target[joint] + noise[joint]);
        }
        let variance = [0.0; VISION].into_iter().chain((0..ARM).map(|joint| regressed.covariance[joint * ARM + joint]));
        let mean = sensed[..VISION].iter().copied().chain(regressed.mean.iter().copied()).collect();
        Ok(Decision { mean, variance: variance.collect(), target, context: Vec::new() })
    }
}

/// One performance: where the sphere lies, and for how long.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    /// Where the sphere lies across, in metres.
    pub y: f64,
    /// Samples to go through.
    pub samples: usize,
    /// Puts the sphere elsewhere at a sample.
    pub shift: Option<(usize, f64)>,
    /// Yaw and pitch of a head that does not follow the sphere: a control.
    pub frozen: Option<[f64; 2]>,
    /// How the world runs.
    pub world: WorldOptions,
}

/// The result of a performance, sample by sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Performed {
    /// What the robot sensed: samples x channels, row-major, in rad.
    pub sensed: Vec<f64>,
    /// What was decided on it.
    pub decisions: Vec<Decision>,
    /// Touches and retractions.
    pub cycles: Vec<Cycle>,
    /// Targets that lay beyond a joint's limits and were cut.
    pub beyond_limits: usize,
    /// Samples within which links of the robot touched that should not.
    pub self_collisions: usize,
}

/// The stage between two steps of the world, as an observer sees it.
#[derive(Debug)]
pub struct Snapshot<'a> {
    /// The stage as it is.
    pub stage: &'a Stage,
    /// Where the joints are led now, by channel.
    pub goals: Vec<f64>,
    /// What was sensed and decided, if this is a sample.
    pub decision: Option<(&'a [f64], &'a Decision)>,
    /// The number of a cycle, from 0, of which this is the first contact.
    pub contact: Option<usize>,
}

/// Lets a driver move the arm. The observer sees the stage at each sample and at each step of the world.
///
/// # Errors
/// Those of stage, driver and observer.
pub fn perform<E: From<Error>>(
    performance: &Performance,
    driver: &mut dyn Driver,
    observer: &mut dyn FnMut(&Snapshot<'_>) -> std::result::Result<(), E>,
) -> std::result::Result<Performed, E> {
    let Performance { y, samples, shift, frozen, world } = performance;
    let robot = crate::robot::nao::load_one_armed()?;
    let steps = samples_to_steps(world)?;
    let mut arm = retracted_arm(&robot, *y)?;
    let mut stage = Stage::new(*world, *y, &arm, *frozen)?;
    let mut detector = TouchDetector::default();
    let mut performed = Performed::default();
    for sample in 0..*samples {
        if let Some((_, to)) = shift.filter(|(at, _)| *at == sample) {
            stage.move_sphere(to)?;
            detector.interrupt();
        }
        let sensed = stage.angles();
        let decision = driver.decide(&sensed)?;
        let goals = stage.world.own(stage.robot()).goals();
        observer(&Snapshot { stage: &stage, goals, decision: Some((&sensed, &decision)), contact: None })?;
        let mut target = decision.target;
        for (joint, angle) in target.iter_mut().enumerate() {
            let limits = robot.limits(VISION + joint)?;
            if !(limits.lower..=limits.upper).contains(angle) {
                performed.beyond_limits += 1;
                *angle = angle.clamp(limits.lower, limits.upper);
            }
        }
        let mut collided = false;
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            let way: [f64; 4] = std::array::from_fn(|joint| arm[joint] + share * (target[joint] - arm[joint]));
            stage.step(&way);
            let contact = detector.observe(stage.hand_state());
            collided |= step % 5 == 0 && stage.world.self_collision(stage.robot())?.is_some();
            let goals = stage.world.own(stage.robot()).goals();
            observer(&Snapshot { stage: &stage, goals, decision: None, contact })?;
        }
        performed.self_collisions += usize::from(collided);
        performed.sensed.extend(sensed);
        performed.decisions.push(decision);
        arm = target;
    }
    performed.cycles = detector.finish();
    Ok(performed)
}

/// Performs without an observer.
///
/// # Errors
/// As [`perform`].
pub fn perform_unobserved(performance: &Performance, driver: &mut dyn Driver) -> Result<Performed> {
    perform(performance, driver, &mut |_| Ok::<(), Error>(()))
}

#[cfg(test)]
#[path = "agent_tests.rs"]
mod tests;
