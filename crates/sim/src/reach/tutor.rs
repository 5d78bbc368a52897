//! Kinesthetic teaching (thesis 4.2.2): a tutor leads the robot's arm to the sphere and back, again and again.
//!
//! The tutor is precise at the touch and free after it. Led is the simulated arm: the tutor pulls it by springs along
//! minimum-jerk paths, the sphere stops it, and what is recorded is what the robot's own joints say. What a human does not
//! do twice alike is drawn anew: the moments, which follow a metronome up to small errors; the place of the touch, to a few
//! millimetres; the arm after each retraction; and on the way a slow wander, which fades near the touch.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use scrnn::dataset::{Dataset, Sequence};
use scrnn::jobs::side_by_side;
use scrnn::streams::{Purpose, stream};

use crate::error::{Error, Result};
use crate::reach::channels::REACHING;
use crate::reach::stage::{CYCLE, CYCLES, PERIOD, POSITIONS, RETRACTION, Stage, samples_to_steps, touching_arm};
use crate::reach::touching::{Cycle, TouchDetector};
use crate::robot::Robot;
use crate::robot::joints::RIGHT_ARM;
use crate::robot::nao;
use crate::world::{Servo, WorldOptions};

/// What the tutor does, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Tutoring {
    /// How many demonstrations; the positions take turns.
    pub sequences: usize,
    /// Samples of each, one every half second.
    pub samples: usize,
    /// How far the sphere is put off its position for each demonstration, at most, in metres.
    pub placement: f64,
    /// How the world runs.
    pub world: WorldOptions,
}

impl Default for Tutoring {
    /// Ten demonstrations of fifteen touches at each of the three positions, the sphere put up to 10 mm off.
    fn default() -> Self {
        let world = WorldOptions::default();
        Self { sequences: 30, samples: CYCLE * CYCLES, placement: 0.010, world }
    }
}

/// Largest shift of a demonstration's first touch, in seconds.
const FIRST: f64 = 0.25;
/// Deviation of each touch from the metronome, in seconds.
const RHYTHM: f64 = 0.08;
/// Time that the hand stays at the touch and after retraction, in seconds.
const DWELL: f64 = 0.25;
/// Deviation of the touch along the sphere's surface and across it, in metres.
const ALONG: f64 = 0.002;
const ACROSS: f64 = 0.0006;
/// How far inside of the sphere the tutor aims, to be sure that the hand meets it, in metres.
const PRESSURE: f64 = 0.0015;
/// Deviation of the arm that touches, of which what moves the hand is taken back, in rad.
const LEAN: f64 = 0.01;
/// Largest deviation of the arm after retraction from the middle, in rad.
const FREEDOM: [f64; 4] = [0.15, 0.15, 0.25, 0.15];
/// The wander's memory over a sample and its deviation, in rad.
const MEMORY: f64 = 0.6;
const WANDER: f64 = 0.07;
/// Within this time of a touch there is no wander; from there it grows, and half a cycle away there is all of it, in seconds.
const CALM: f64 = 0.5;
/// Noise of the arm's sensors, and of the head's together with what its gaze control does, in rad.
const ARM_NOISE: f64 = 0.002;
const HEAD_NOISE: f64 = 0.005;

/// One sequence of touches at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Demonstration {
    /// Which position, from 0.
    pub position: usize,
    /// Where the sphere lay across, in metres.
    pub y: f64,
    /// What the robot sensed: samples x channels, row-major, in rad.
    pub samples: Vec<f64>,
    /// The result of the movement.
    pub cycles: Vec<Cycle>,
}

/// Gives all demonstrations, on `threads` threads; their number does not change a bit of the result.
///
/// # Errors
/// [`Error::Setting`] for nothing to demonstrate, or a placement beyond the bench.
pub fn demonstrate(tutoring: &Tutoring, seed: u64, threads: usize) -> Result<Vec<Demonstration>> {
    demonstrate_while(tutoring, seed, threads, &|| Ok::<(), Error>(()))
}

/// The same, as long as `go_on`, which is asked before each sample, finds nothing against it; an error of it ends everything.
///
/// # Errors
/// As [`demonstrate`], and those of `go_on`.
pub fn demonstrate_while<E: From<Error> + Send>(
    tutoring: &Tutoring,
    seed: u64,
    threads: usize,
    go_on: &(dyn Fn() -> std::result::Result<(), E> + Sync),
) -> std::result::Result<Vec<Demonstration>, E> {
    let all = demonstrations(tutoring, seed, threads, &|_, _| go_on())?;
    Ok(all.into_iter().map(|(demonstration, _)| demonstration).collect())
}

/// The same, with what `look` makes of the stage and of what the robot senses at each sample.
///
/// # Errors
/// As [`demonstrate`].
pub fn demonstrate_with<T: Send>(
    tutoring: &Tutoring,
    seed: u64,
    threads: usize,
    look: &(dyn Fn(&Stage, &[f64]) -> T + Sync),
) -> Result<Vec<(Demonstration, Vec<T>)>> {
    demonstrations(tutoring, seed, threads, &|stage, sensed| Ok::<T, Error>(look(stage, sensed)))
}

/// Gives them all; an error of `look` ends everything.
fn demonstrations<T: Send, E: From<Error> + Send>(
    tutoring: &Tutoring,
    seed: u64,
    threads: usize,
    look: &(impl Fn(&Stage, &[f64]) -> std::result::Result<T, E> + Sync),
) -> std::result::Result<Vec<(Demonstration, Vec<T>)>, E> {
    let Tutoring { sequences, samples, placement, .. } = tutoring;
    for (what, count) in [("the number of demonstrations", *sequences), ("samples of a demonstration", *samples)] {
        if count == 0 {
            return Err(Error::Setting { what, found: "0".to_owned(), needed: "at least 1" }.into());
        }
    }
    if !(0.0..=0.02).contains(placement) {
        let found = format!("{placement} m");
        return Err(Error::Setting { what: "the placement's error", found, needed: "0 to 0.02 m" }.into());
    }
    let robot = nao::load_one_armed()?;
    side_by_side(*sequences, threads, |sequence, _| demonstration(tutoring, &robot, seed, sequence, look))
}

/// The demonstrations as sequences to learn, named after position and take, e.g. `2-07`.
///
/// # Errors
/// [`Error::Network`] if there is none.
pub fn dataset(demonstrations: &[Demonstration]) -> Result<Dataset> {
    let named = |(index, one): (usize, &Demonstration)| {
        let name = format!("{}-{:02}", one.position + 1, index / POSITIONS.len() + 1);
        Sequence::new(name, REACHING.len(), one.samples.clone())
    };
    let sequences = demonstrations.iter().enumerate().map(named).collect::<scrnn::error::Result<_>>()?;
    Ok(Dataset::new(REACHING.map(str::to_owned).to_vec(), sequences)?)
}

/// Gives one demonstration.
fn demonstration<T, E: From<Error>>(
    tutoring: &Tutoring,
    robot: &Robot,
    seed: u64,
    sequence: usize,
    look: &impl Fn(&Stage, &[f64]) -> std::result::Result<T, E>,
) -> std::result::Result<(Demonstration, Vec<T>), E> {
    let mut random = stream(seed, Purpose::Demonstrations, sequence as u64);
    let position = sequence % POSITIONS.len();
    let y = POSITIONS[position] + random.random_range(-1.0..1.0) * tutoring.placement;
    let path = Path::draw(robot, y, tutoring.samples, &mut random)?;

    let mut stage = Stage::new(tutoring.world, y, &path.at(0.0), None)?;
    for joint in 2..robot.dof() {
        stage.world.set_servo(stage.robot(), joint, Servo { stiffness: 60.0, damping: 2.5 })?;
    }
    let steps = samples_to_steps(&tutoring.world)?;
    let mut detector = TouchDetector::default();
    let mut samples = Vec::with_capacity(tutoring.samples * REACHING.len());
    let mut seen = Vec::with_capacity(tutoring.samples);
    for sample in 0..tutoring.samples {
        let noise = [HEAD_NOISE, HEAD_NOISE, ARM_NOISE, ARM_NOISE, ARM_NOISE, ARM_NOISE];
        let sensed: Vec<f64> =
            stage.angles().iter().zip(noise).map(|(angle, noise)| angle + noise * normal(&mut random)).collect();
        seen.push(look(&stage, &sensed)?);
        samples.extend(sensed);
        for step in 1..=steps {
            stage.step(&path.at((sample as f64 + step as f64 / steps as f64) * PERIOD));
            detector.observe(stage.hand_state());
        }
    }
    Ok((Demonstration { position, y, samples, cycles: detector.finish() }, seen))
}

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Where the tutor leads the arm.
#[derive(Debug, Clone)]
struct Path {
    /// Moments and arms to be at, retracted and touching in turn.
    keys: Vec<(f64, [f64; 4])>,
    /// Moments of the touches.
    touches: Vec<f64>,
    /// The wander at each sample.
    wander: Vec<[f64; 4]>,
    /// Smallest and largest angles.
    limits: [[f64; 2]; 4],
}

impl Path {
    fn draw(robot: &Robot, y: f64, samples: usize, random: &mut ChaCha8Rng) -> Result<Self> {
        let period = CYCLE as f64 * PERIOD;
        let end = samples as f64 * PERIOD;
        let first = period / 2.0 + FIRST * random.random_range(-1.0..1.0);
        let count = ((end - first) / period).ceil().max(1.0) as usize + 1;
        let touches: Vec<f64> = (0..count).map(|k| first + k as f64 * period + RHYTHM * normal(random)).collect();
        let mut keys = Vec::with_capacity(2 * count + 1);
        for (k, &touch) in touches.iter().enumerate() {
            let before = if k == 0 { touch - period / 2.0 } else { f64::midpoint(touches[k - 1], touch) };
            keys.push((before, retracted(robot, y, random)?));
            let offset = [ACROSS * normal(random) - PRESSURE, ALONG * normal(random), ALONG * normal(random)];
            let lean = [0.0; 4].map(|_: f64| LEAN * normal(random));
            keys.push((touch, touching_arm(robot, y, offset, &lean)?));
        }
        let last = touches[count - 1] + period / 2.0;
        keys.push((last, retracted(robot, y, random)?));

        let innovation = WANDER * (1.0 - MEMORY * MEMORY).sqrt();
        let mut wander = vec![[0.0; 4].map(|_: f64| WANDER * normal(random))];
        for _ in 0..samples {
            let before = wander[wander.len() - 1];
            wander.push(before.map(|w| MEMORY * w + innovation * normal(random)));
        }
        let arm = robot.joints_named(&RIGHT_ARM)?;
        let mut limits = [[0.0; 2]; 4];
        for (limits, &joint) in limits.iter_mut().zip(&arm) {
            let of_joint = robot.limits(joint)?;
            *limits = [of_joint.lower, of_joint.upper];
        }
        Ok(Self { keys, touches, wander, limits })
    }

    /// The arm at a time, in seconds.
    fn at(&self, time: f64) -> [f64; 4] {
        let next = self.keys.partition_point(|(moment, _)| *moment <= time).clamp(1, self.keys.len() - 1);
        let ((from, start), (to, goal)) = (self.keys[next - 1], self.keys[next]);
        let share = ((time - from - DWELL / 2.0) / (to - from - DWELL)).clamp(0.0, 1.0);
        let done = share * share * share * (10.0 + share * (6.0 * share - 15.0));

        let sample = (time / PERIOD).clamp(0.0, (self.wander.len() - 1) as f64);
        let (index, part) = ((sample as usize).min(self.wander.len() - 2), sample.fract());
        let nearest = self.touches.iter().map(|touch| (touch - time).abs()).fold(f64::INFINITY, f64::min);
        let free = ((nearest - CALM) / (CYCLE as f64 * PERIOD / 2.0 - CALM)).clamp(0.0, 1.0);
        std::array::from_fn(|joint| {
            let wander = (1.0 - part) * self.wander[index][joint] + part * self.wander[index + 1][joint];
            let angle = start[joint] + done * (goal[joint] - start[joint]) + free * wander;
            angle.clamp(self.limits[joint][0], self.limits[joint][1])
        })
    }
}

/// An arm after retraction.
fn retracted(robot: &Robot, y: f64, random: &mut ChaCha8Rng) -> Result<[f64; 4]> {
    let touching = touching_arm(robot, y, [0.0; 3], &[0.0; 4])?;
    Ok(std::array::from_fn(|joint| {
        touching[joint] + RETRACTION[joint] + FREEDOM[joint] * random.random_range(-1.0..1.0)
    }))
}

#[cfg(test)]
#[path = "tutor_tests.rs"]
mod tests;
