//! The reaching experiment's stage (thesis 4.2.1): NAO behind a workbench with a red sphere.
//!
//! The sphere lies at one of three positions, 7 cm apart on a line across, or anywhere between them; position 3 is straight
//! ahead of the robot. The head keeps the sphere in the centre of its lower camera, whatever the arm does.

use nalgebra::{Isometry3, Point3, Vector3};
use rand::RngExt;
use scrnn::streams::{Purpose, stream};

use crate::error::{Error, Result};
use crate::reach::touching::HandState;
use crate::robot::Robot;
use crate::robot::gaze::Gaze;
use crate::robot::joints::RIGHT_ARM;
use crate::robot::kinematics::InverseKinematics;
use crate::robot::nao;
use crate::world::scene::{Part, Shape};
use crate::world::{BodyId, Placement, RobotId, World, WorldOptions};

/// Seconds between two samples, and between two joint targets.
pub const PERIOD: f64 = 0.5;

/// Samples of one touch-and-retract movement.
pub const CYCLE: usize = 12;

/// Touches of a demonstration.
pub const CYCLES: usize = 15;

/// Where the three positions lie across, y in metres.
pub const POSITIONS: [f64; 3] = [-0.14, -0.07, 0.0];

/// How far the sphere is ahead of the torso's origin, and how far above it.
const AHEAD: f64 = 0.19;
const ABOVE: f64 = 0.03;

/// Radius of the sphere. The hand ends in a half-sphere of the same radius around its effector.
const RADIUS: f64 = 0.025;

/// From the sphere's centre to the hand that touches it as it was taught: from above, from the right and from behind.
const NORMAL: [f64; 3] = [-0.502_5, -0.703_5, 0.502_5];

/// Arms that touch the sphere at the three positions; others lie between them.
const TOUCHING: [[f64; 4]; 3] =
    [[0.1180, -0.8498, -0.1390, 0.9671], [0.2501, -0.6139, 0.0899, 1.2226], [0.2470, -0.1307, 0.0918, 1.0538]];

/// From a touching arm to the middle of the postures after retraction: high enough to be clear of the sphere, and not so far
/// to the right that the shoulder comes near its limit.
pub const RETRACTION: [f64; 4] = [-0.66, -0.15, 0.70, -0.55];

/// Height of the torso's origin over the floor, of a standing NAO.
const STANDING: f64 = 0.333_09;

/// Steps of the world between two samples.
///
/// # Errors
/// [`Error::Setting`] for steps that do not fill the half second.
pub fn samples_to_steps(options: &WorldOptions) -> Result<usize> {
    let steps = (PERIOD / options.step).round();
    match (steps * options.step - PERIOD).abs() < 1e-9 && steps >= 1.0 {
        true => Ok(steps as usize),
        false => {
            let found = format!("{} s", options.step);
            Err(Error::Setting { what: "the length of a step", found, needed: "a part of 0.5 s, like 0.005 s" })
        }
    }
}

/// The robot, the bench and the sphere.
#[derive(Debug)]
pub struct Stage {
    /// The robot, the bench and the sphere in it.
    pub(crate) world: World,
    robot: RobotId,
    gaze: Gaze,
    sphere: BodyId,
    hand: BodyId,
    effector: usize,
    y: f64,
    /// Yaw and pitch of a head that does not follow.
    frozen: Option<[f64; 2]>,
}

impl Stage {
    /// The stage with the sphere at `y`, the arm in a posture, and the head on the sphere, or frozen at two angles.
    ///
    /// # Errors
    /// [`Error::Setting`] for a sphere beyond the positions, [`Error::Joint`] for an arm beyond its limits.
    pub fn new(options: WorldOptions, y: f64, arm: &[f64; 4], frozen: Option<[f64; 2]>) -> Result<Self> {
        check(y)?;
        let robot = nao::load_one_armed()?;
        let gaze = Gaze::new(&robot, "camera_bottom")?;
        let world_from_root = Isometry3::translation(0.0, 0.0, STANDING);
        let place = world_from_root * sphere_at(y);
        let [yaw, pitch] = frozen.unwrap_or_else(|| gaze.fixate_in(&world_from_root, &place));
        let posture = [yaw, pitch, arm[0], arm[1], arm[2], arm[3]];
        let mut world = World::new(options)?;
        let placement =
            Placement { name: "self", world_from_root, posture: &posture, part: Part::Robot, hands: &["r_hand"] };
        let effector = robot.link("r_effector")?;
        let robot = world.add_robot(&robot, &placement)?;
        let bench = Shape::Cuboid { half_extents: [0.12, 0.20, 0.01] };
        let bench_at = world_from_root * Isometry3::translation(AHEAD + 0.02, POSITIONS[1], ABOVE - RADIUS - 0.01);
        let bench = world.add_fixed("bench", Part::Furniture, bench, bench_at)?;
        let sphere = Shape::Sphere { radius: RADIUS };
        let sphere = world.add_fixed("sphere", Part::Object, sphere, Isometry3::from(place.coords))?;
        world.ignore_contacts(bench, sphere)?;
        let hand = world.body("self/r_hand")?;
        Ok(Self { world, robot, gaze, sphere, hand, effector, y, frozen })
    }

    /// Puts the sphere elsewhere, at once.
    ///
    /// # Errors
    /// [`Error::Setting`] for a place beyond the positions.
    pub fn move_sphere(&mut self, y: f64) -> Result<()> {
        check(y)?;
        self.y = y;
        let place = self.world.own(self.robot).world_from_root() * sphere_at(y);
        self.world.place(self.sphere, &Isometry3::from(place.coords))
    }

    /// Its world.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The robot.
    #[must_use]
    pub fn robot(&self) -> RobotId {
        self.robot
    }

    /// One step of the world, in which the arm goes for `arm`, and the head for the sphere.
    pub fn step(&mut self, arm: &[f64; 4]) {
        let head = self.frozen.unwrap_or_else(|| self.gaze.fixate(&sphere_at(self.y)));
        self.world.steer(self.robot, &[head[0], head[1], arm[0], arm[1], arm[2], arm[3]]);
        self.world.step();
    }

    /// True angles of head and arm, by channel.
    #[must_use]
    pub fn angles(&self) -> Vec<f64> {
        self.world.own(self.robot).angles()
    }

    /// Where the hand is, and how far from the sphere.
    #[must_use]
    pub fn hand_state(&self) -> HandState {
        let robot = self.world.own(self.robot);
        let tip = Point3::from(robot.of_link(self.effector).translation.vector);
        let hand = robot.world_from_root().inverse_transform_point(&tip);
        let expected = touching_hand(self.y);
        let gap = self.world.distance(self.hand, self.sphere);
        HandState { time: self.world.time(), gap, aim: (hand - expected).norm(), hand: hand.coords.into() }
    }
}

fn check(y: f64) -> Result<()> {
    let (low, high) = (POSITIONS[0] - 0.0201, POSITIONS[2] + 0.0201);
    match (low..=high).contains(&y) {
        true => Ok(()),
        false => {
            let found = format!("{y} m");
            Err(Error::Setting { what: "the object's place across", found, needed: "-0.16 m to 0.02 m" })
        }
    }
}

/// The sphere's centre, in the torso's frame.
fn sphere_at(y: f64) -> Point3<f64> {
    Point3::new(AHEAD, y, ABOVE)
}

/// Where the hand's effector is when it touches the sphere at `y` as it was taught, in the torso's frame.
#[must_use]
pub fn touching_hand(y: f64) -> Point3<f64> {
    sphere_at(y) + 2.0 * RADIUS * Vector3::from(NORMAL).normalize()
}

/// An arm whose hand is off the place of touching by `offset`: the first coordinate along the sphere's normal, the others
/// along its surface. Of all such arms it is one near `touching arms + lean`.
///
/// # Errors
/// [`Error::OutOfReach`].
pub fn touching_arm(robot: &Robot, y: f64, offset: [f64; 3], lean: &[f64; 4]) -> Result<[f64; 4]> {
    let normal = Vector3::from(NORMAL).normalize();
    let across = normal.cross(&Vector3::z()).normalize();
    let along = normal.cross(&across);
    let target = touching_hand(y) + offset[0] * normal + offset[1] * across + offset[2] * along;
    let joints = robot.joints_named(&RIGHT_ARM)?;
    let between = interpolated(y);
    let mut start = vec![0.0; robot.dof()];
    for (index, &joint) in joints.iter().enumerate() {
        start[joint] = between[index] + lean[index];
    }
    let q = InverseKinematics::default().solve(robot, robot.link("r_effector")?, &joints, &start, &target)?;
    Ok(std::array::from_fn(|index| q[joints[index]]))
}

/// The parabola through the three arms.
fn interpolated(y: f64) -> [f64; 4] {
    let weight = |k: usize| -> f64 {
        (0..3).filter(|&j| j != k).map(|j| (y - POSITIONS[j]) / (POSITIONS[k] - POSITIONS[j])).product()
    };
    std::array::from_fn(|joint| (0..3).map(|k| weight(k) * TOUCHING[k][joint]).sum())
}

/// The middle of the arms after retraction from a sphere at `y`.
///
/// # Errors
/// [`Error::OutOfReach`].
pub fn retracted_arm(robot: &Robot, y: f64) -> Result<[f64; 4]> {
    let touching = touching_arm(robot, y, [0.0; 3], &[0.0; 4])?;
    Ok(std::array::from_fn(|joint| touching[joint] + RETRACTION[joint]))
}

/// Where the head looks when it fixates a sphere at `y`.
///
/// # Errors
/// Those of a robot without NAO's head.
pub fn gaze_at(robot: &Robot, y: f64) -> Result<[f64; 2]> {
    Ok(Gaze::new(robot, "camera_bottom")?.fixate(&sphere_at(y)))
}

/// Places drawn evenly between positions 1 and 3.
#[must_use]
pub fn places_between(seed: u64, count: usize) -> Vec<f64> {
    let mut random = stream(seed, Purpose::TrialPlaces, 0);
    (0..count).map(|_| random.random_range(POSITIONS[0]..POSITIONS[2])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_does_not_fill_half_a_second_is_refused() {
        let steps = |step| samples_to_steps(&WorldOptions { step, ..WorldOptions::default() });
        assert_eq!((steps(0.005).unwrap(), steps(0.5).unwrap()), (100, 1));
        for step in [0.003, 0.7, f64::NAN] {
            let message = steps(step).unwrap_err().to_string();
            assert!(message.contains(&format!("{step} s")) && message.contains("a part of 0.5 s"), "{message}");
        }
    }

    #[test]
    fn a_sphere_out_of_reach_is_refused_and_stays_where_it_was() {
        let arm = retracted_arm(&nao::load_one_armed().unwrap(), POSITIONS[1]).unwrap();
        let new = |y| Stage::new(WorldOptions::default(), y, &arm, None);
        assert!(new(0.1).err().unwrap().to_string().contains("0.1 m"));
        let mut stage = new(POSITIONS[1]).unwrap();
        let before = stage.hand_state().gap;
        assert!(stage.move_sphere(f64::NAN).is_err());
        assert_eq!(stage.hand_state().gap, before);
    }
}
