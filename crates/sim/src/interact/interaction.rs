//! Two NAOs face each other (thesis 5.2): the other robot moves an object it holds to the left or to the right, the self-robot
//! looks at it and moves its right arm to the same side.
//!
//! Sides are the self-robot's: left is its +y. The other robot follows an order of primitives, each of them out, hold, back
//! and rest, by minimum-jerk movements between three postures. The self-robot's head fixates the object with a lag, so that
//! the object's place in the image says how it moves; its arm is led by a tutor or by the caller of [`Interaction::step`].
//! A sample is taken every 100 ms, before the arm gets its target for the next one.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scrnn::analysis::excursions::Side;
use scrnn::dataset::Sequence;
use scrnn::streams::{Purpose, stream};

use super::order::{PERIOD, branchings, letters, out, samples};
use crate::error::{Error, Result};
use crate::robot::gaze::{Gaze, LaggingGaze};
use crate::robot::joints::{HEAD, RIGHT_ARM};
use crate::robot::nao;
use crate::world::scene::{Part, Scene, Shape};
use crate::world::{BodyId, Contact, JointState, Placement, RobotId, World, WorldOptions};

/// Channels of a sample: the object's centre in the image, head and right arm of the self-robot.
pub const CHANNELS: [&str; 8] =
    ["object_x", "object_y", HEAD[0], HEAD[1], RIGHT_ARM[0], RIGHT_ARM[1], RIGHT_ARM[2], RIGHT_ARM[3]];

/// Where the arm's angles stand in a sample.
pub const ARM: std::ops::Range<usize> = 4..8;

/// Distance of the torsos, in metres.
const DISTANCE: f64 = 0.43;
/// Radius of the object, and how far its centre lies beyond the effector, in metres.
const OBJECT: (f64, f64) = (0.025, 0.04);
/// Share of what is missing that the head makes good in a second, to begin with.
const HEAD_RATE: f64 = 1.0;

/// Right arms: centre, to the self-robot's left, to its right.
const SELF_ARM: [[f64; 4]; 3] =
    [[0.025, -0.280, 0.487, 1.020], [-0.165, 0.272, 0.204, 0.547], [0.148, -0.597, 0.754, 0.992]];
const OTHER_ARM: [[f64; 4]; 3] =
    [[0.068, -0.253, 0.504, 0.855], [0.069, -0.575, 0.500, 0.871], [-0.055, 0.278, 0.510, 0.389]];

/// Standard deviations of what the sensors add to a sample: pixels, then radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise(pub [f64; 8]);

impl SensorNoise {
    /// How far each channel reaches over all orders, in its unit: what shares of noise are counted in.
    const SWING: [f64; 8] = [120.5, 12.6, 0.599, 0.047, 0.315, 0.868, 0.551, 0.473];

    /// Noise that is a share of each channel's swing.
    #[must_use]
    pub fn of_swing(share: f64) -> Self {
        Self(Self::SWING.map(|swing| share * swing))
    }
}

/// How samples are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InteractionOptions {
    /// Of the sensors.
    pub noise: SensorNoise,
    /// How the world runs.
    pub world: WorldOptions,
}

impl Default for InteractionOptions {
    /// Noise of 1.9 % of each channel's swing: 2.3 pixels, 0.6 degrees of the head's yaw, 0.3 to 0.9 degrees of the arm.
    fn default() -> Self {
        Self { noise: SensorNoise::of_swing(0.019), world: WorldOptions::default() }
    }
}

fn between(arm: &[[f64; 4]; 3], (share, side): (f64, Side)) -> [f64; 4] {
    let end = match side {
        Side::Left => &arm[1],
        Side::Right => &arm[2],
    };
    std::array::from_fn(|joint| arm[0][joint] + share * (end[joint] - arm[0][joint]))
}

/// The self-robot's arm in the centre, to the left, to the right.
#[must_use]
pub fn arm_postures() -> [[f64; 4]; 3] {
    SELF_ARM
}

/// Two robots and an object, as they are now.
#[derive(Debug)]
pub struct Interaction {
    world: World,
    order: Vec<Side>,
    noise: SensorNoise,
    random: ChaCha8Rng,
    own: RobotId,
    other: RobotId,
    object: BodyId,
    gaze: Gaze,
    head: LaggingGaze,
    camera: usize,
    effector: usize,
    hands: [BodyId; 2],
    /// Where the object was in the image when it was seen last, truly and with the sensors' noise.
    seen: [f64; 2],
    sensed: [f64; 2],
    /// Samples taken.
    taken: usize,
    collision: Option<Collision>,
    depth: f64,
}

/// What the self-robot ran into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Collision {
    /// The other robot's hand.
    Hand,
    /// The object.
    Object,
    /// Another part of the other robot, or with another part than the hand.
    Body,
}

impl Interaction {
    /// Both robots with their arms in the centre; the head fixates the object. The sensors' noise is that of a trial: an
    /// interaction that is [recorded](record) with the same seed draws other numbers, so that no network meets the noise
    /// that it has learned. Trials of one seed differ in `index`.
    ///
    /// # Errors
    /// [`Error::Setting`] for senseless options.
    pub fn new(order: &[Side], options: &InteractionOptions, seed: u64, index: u64) -> Result<Self> {
        Self::with_noise(order, options, stream(seed, Purpose::TrialSensors, index))
    }

    fn with_noise(order: &[Side], options: &InteractionOptions, random: ChaCha8Rng) -> Result<Self> {
        if let Some(bad) = options.noise.0.iter().find(|sd| !(**sd >= 0.0 && sd.is_finite())) {
            return Err(Error::Setting {
                what: "a sensor's noise",
                found: bad.to_string(),
                needed: "0 or a positive number",
            });
        }
        let mut world = World::new(options.world)?;
        let robot = nao::load_one_armed()?;
        let facing = Isometry3::from_parts(
            Translation3::new(DISTANCE, 0.0, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI),
        );
        let posture = |head: [f64; 2], arm: [f64; 4]| [&head[..], &arm].concat();
        let effector = robot.link("r_effector")?;
        let place = |world_from_root: &Isometry3<f64>, arm: [f64; 4], beyond: f64| {
            let root_from_link = robot.forward(&posture([0.0, 0.0], arm))?;
            Ok::<_, Error>(world_from_root * root_from_link[effector] * Point3::new(beyond, 0.0, 0.0))
        };
        let gaze = Gaze::new(&robot, "camera_top")?;
        let angles = gaze.fixate(&place(&facing, OTHER_ARM[0], OBJECT.1)?);
        // The other robot looks at the self-robot's hand.
        let other_looks = gaze.fixate_in(&facing, &place(&Isometry3::identity(), SELF_ARM[0], 0.0)?);
        let own = world.add_robot(
            &robot,
            &Placement {
                name: "self",
                world_from_root: Isometry3::identity(),
                posture: &posture(angles, SELF_ARM[0]),
                part: Part::Robot,
                hands: &["r_hand"],
            },
        )?;
        let other = world.add_robot(
            &robot,
            &Placement {
                name: "other",
                world_from_root: facing,
                posture: &posture(other_looks, OTHER_ARM[0]),
                part: Part::OtherRobot,
                hands: &["r_hand"],
            },
        )?;
        let held = Isometry3::translation(OBJECT.1, 0.0, 0.0);
        let sphere = Shape::Sphere { radius: OBJECT.0 };
        let object = world.attach(other, "r_effector", "object", Part::Object, sphere, held)?;
        let hands = [world.body("self/r_hand")?, world.body("other/r_hand")?];
        let centre = [nao::CAMERA.width / 2.0, nao::CAMERA.height / 2.0];
        let mut interaction = Self {
            order: order.to_vec(),
            noise: options.noise,
            random,
            head: LaggingGaze { rate: HEAD_RATE, angles },
            camera: robot.link("camera_top")?,
            effector,
            world,
            own,
            other,
            object,
            gaze,
            hands,
            seen: centre,
            sensed: centre,
            taken: 0,
            collision: None,
            depth: 0.0,
        };
        interaction.look();
        interaction.sensed = interaction.seen;
        Ok(interaction)
    }

    /// Where the object goes, branching by branching.
    #[must_use]
    pub fn order(&self) -> &[Side] {
        &self.order
    }

    /// Samples until the order is at its end.
    #[must_use]
    pub fn samples(&self) -> usize {
        samples(&self.order)
    }

    /// What the self-robot senses now, in pixels and radians, with the sensors' noise.
    ///
    /// While the object is [out of view](Interaction::object_in_view), its channels repeat what was sensed of it last, as a
    /// tracker does that has lost its object.
    pub fn sense(&mut self) -> [f64; 8] {
        let mut sample = self.truth();
        for (value, sd) in sample.iter_mut().zip(self.noise.0) {
            let z: f64 = StandardNormal.sample(&mut self.random);
            *value += sd * z;
        }
        match self.object_in_view() {
            true => self.sensed = [sample[0], sample[1]],
            false => [sample[0], sample[1]] = self.sensed,
        }
        sample
    }

    /// The same without noise.
    #[must_use]
    pub fn truth(&self) -> [f64; 8] {
        let angles = self.world.own(self.own).angles();
        let [yaw, pitch] = self.gaze.joints();
        let [x, y] = self.seen;
        [x, y, angles[yaw], angles[pitch], angles[2], angles[3], angles[4], angles[5]]
    }

    /// Whether the object's centre lies in the image of the self-robot's camera. The head turns to the object by itself, so
    /// that it always does in the experiments of the thesis.
    #[must_use]
    pub fn object_in_view(&self) -> bool {
        self.object_in_image().is_some()
    }

    /// The object's centre in the image.
    fn object_in_image(&self) -> Option<[f64; 2]> {
        let world_from_camera = self.world.own(self.own).of_link(self.camera);
        nao::CAMERA.project(&world_from_camera, &self.object_place()).filter(|place| nao::CAMERA.sees(*place))
    }

    fn look(&mut self) {
        self.seen = self.object_in_image().unwrap_or(self.seen);
    }

    /// Where a tutor who knows the order leads the arm, one sample from now.
    #[must_use]
    pub fn tutor(&self) -> [f64; 4] {
        between(&SELF_ARM, out(&self.order, (self.taken + 1) as f64 * PERIOD))
    }

    /// Lets a sample's time pass while the arm moves evenly to `arm`.
    pub fn step(&mut self, arm: [f64; 4]) {
        let from: Vec<f64> = self.world.own(self.own).goals()[2..].to_vec();
        self.pass(|share| std::array::from_fn(|joint| from[joint] + share * (arm[joint] - from[joint])));
    }

    /// Lets a sample's time pass while a tutor leads the arm.
    pub fn step_tutored(&mut self) {
        let (order, taken) = (self.order.clone(), self.taken as f64);
        self.pass(|share| between(&SELF_ARM, out(&order, (taken + share) * PERIOD)));
    }

    fn pass(&mut self, arm: impl Fn(f64) -> [f64; 4]) {
        let dt = self.world.options().step;
        let steps = (PERIOD / dt).round().max(1.0) as usize;
        (self.collision, self.depth) = (None, 0.0);
        for k in 1..=steps {
            let share = k as f64 / steps as f64;
            let seconds = (self.taken as f64 + share) * PERIOD;
            let look = self.gaze.fixate(&self.object_place());
            let head = self.head.follow(look, PERIOD / steps as f64);
            self.world.steer(self.own, &[&head[..], &arm(share)].concat());
            let mut goals = self.world.own(self.other).goals();
            goals[2..].copy_from_slice(&between(&OTHER_ARM, out(&self.order, seconds)));
            self.world.steer(self.other, &goals);
            self.world.step();
            self.find_collisions();
        }
        self.look();
        self.taken += 1;
    }

    fn find_collisions(&mut self) {
        for contact in self.world.contacts_with(self.own) {
            let [a, b] = contact.bodies;
            let (mine, theirs) = if self.world.belongs_to(a, self.own) { (a, b) } else { (b, a) };
            let kind = match (mine == self.hands[0], theirs) {
                (true, body) if body == self.hands[1] => Collision::Hand,
                (true, body) if body == self.object => Collision::Object,
                _ => Collision::Body,
            };
            if contact.depth > self.depth || self.collision.is_none() {
                (self.collision, self.depth) = (Some(kind), contact.depth);
            }
        }
    }

    /// What the self-robot ran into since the last sample; the deepest contact, if there were several.
    #[must_use]
    pub fn collision(&self) -> Option<Collision> {
        self.collision
    }

    /// All that touch each other now: names of two bodies, how deep they are in each other in metres, and the force in newtons.
    #[must_use]
    pub fn contacts(&self) -> Vec<([&str; 2], f64, f64)> {
        let named =
            |contact: Contact| (contact.bodies.map(|body| self.world.name_of(body)), contact.depth, contact.force);
        self.world.contacts().into_iter().map(named).collect()
    }

    /// The branching that begins now, in words: its number, from 1, and the side to which the object goes.
    #[must_use]
    pub fn branching(&self) -> Option<String> {
        let sample = (self.time() / PERIOD).round() as usize;
        let branch = branchings(self.order.len()).iter().position(|at| *at == sample)?;
        let side = if self.order[branch] == Side::Left { "left" } else { "right" };
        Some(format!("branching {} to the {side}", branch + 1))
    }

    /// How deep it ran into it, in metres.
    #[must_use]
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// The object's centre in the world.
    #[must_use]
    pub fn object_place(&self) -> Point3<f64> {
        self.world.pose_of(self.object).translation.vector.into()
    }

    /// The self-robot's hand in the world.
    #[must_use]
    pub fn hand_place(&self) -> Point3<f64> {
        self.world.own(self.own).of_link(self.effector).translation.vector.into()
    }

    /// All that can be seen now.
    #[must_use]
    pub fn scene(&self) -> Scene {
        self.world.scene()
    }

    /// Seconds since the start.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.world.time()
    }

    /// How all joints stand, of the self-robot and of the other one, those too that the experiment locks.
    #[must_use]
    pub fn joint_states(&self) -> [Vec<JointState<'_>>; 2] {
        [self.own, self.other].map(|robot| self.world.own(robot).joint_states())
    }

    /// Angles, and goals, of the self-robot's head and right arm.
    #[must_use]
    pub fn joints(&self) -> [Vec<f64>; 2] {
        [self.world.own(self.own).angles(), self.world.own(self.own).goals()]
    }
}

#[cfg(test)]
impl Interaction {
    /// From now on the head turns to the left and stays there.
    pub(super) fn turn_away(&mut self) {
        self.head = LaggingGaze { rate: 0.0, angles: [2.0, 0.0] };
    }
}

/// Records the first `count` samples of an order with a tutored arm. `watch` sees the world at each of them. The sensors'
/// noise comes from a seed and the recording's number; it is not that of an [`Interaction`] with the same two.
///
/// # Errors
/// [`Error::Setting`] for senseless options.
pub fn record(
    order: &[Side],
    options: &InteractionOptions,
    (seed, index): (u64, u64),
    count: usize,
    mut watch: impl FnMut(&Interaction, &[f64; 8]),
) -> Result<Sequence> {
    record_while(order, options, (seed, index), count, |interaction, sample| {
        watch(interaction, sample);
        Ok::<(), Error>(())
    })
}

/// As [`record`]; an error of `watch` ends the recording.
///
/// # Errors
/// As [`record`], and those of `watch`.
pub fn record_while<E: From<Error>>(
    order: &[Side],
    options: &InteractionOptions,
    (seed, index): (u64, u64),
    count: usize,
    mut watch: impl FnMut(&Interaction, &[f64; 8]) -> std::result::Result<(), E>,
) -> std::result::Result<Sequence, E> {
    let mut interaction = Interaction::with_noise(order, options, stream(seed, Purpose::RecordingSensors, index))?;
    let count = count.min(samples(order));
    let mut values = Vec::with_capacity(count * CHANNELS.len());
    for _ in 0..count {
        let sample = interaction.sense();
        watch(&interaction, &sample)?;
        values.extend(sample);
        interaction.step_tutored();
    }
    Ok(Sequence::new(letters(order), CHANNELS.len(), values).map_err(Error::from)?)
}

#[cfg(test)]
#[path = "interaction_tests.rs"]
mod tests;
