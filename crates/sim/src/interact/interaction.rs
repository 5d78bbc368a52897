//! Two NAOs face each other (thesis 5.2): the other robot moves an object it holds to the left or to the right, the self-robot
//! looks at it and moves its right arm to the same side.
//!
//! Sides are the self-robot's: left is its +y. The other robot follows an order of primitives, each of them out, hold, back
//! and rest, by minimum-jerk movements between three postures. The self-robot's head fixates the object with a lag, so that
//! the object's place in the image says how it moves; its arm is led by a tutor or by whoever calls [`Interaction::step`].
//! A sample is taken every 100 ms, before the arm is told where to be at the next one.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use scrnn::analysis::excursions::Side;
use scrnn::dataset::Sequence;

use crate::error::{Error, Result};
use crate::robot::gaze::{Gaze, LaggingGaze};
use crate::robot::joints::{HEAD, RIGHT_ARM};
use crate::robot::nao;
use crate::world::scene::{Part, Scene, Shape};
use crate::world::{BodyId, Placement, RobotId, World, WorldOptions};

/// Channels of a sample: the object's centre in the image, head and right arm of the self-robot.
pub const CHANNELS: [&str; 8] =
    ["object_x", "object_y", HEAD[0], HEAD[1], RIGHT_ARM[0], RIGHT_ARM[1], RIGHT_ARM[2], RIGHT_ARM[3]];

/// Where the arm's angles stand in a sample.
pub const ARM: std::ops::Range<usize> = 4..8;

/// Seconds between samples.
pub const PERIOD: f64 = 0.1;
/// Samples before the first branching.
pub const LEAD_IN: usize = 20;
/// Samples of a primitive: out, hold, back, rest.
pub const PRIMITIVE: [usize; 4] = [30, 20, 30, 10];

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

/// Samples of a whole primitive.
#[must_use]
pub fn primitive_len() -> usize {
    PRIMITIVE.iter().sum()
}

/// The sample at which the object begins to move for each branching.
#[must_use]
pub fn branchings(count: usize) -> Vec<usize> {
    (0..count).map(|k| LEAD_IN + k * primitive_len()).collect()
}

/// Samples of an order.
#[must_use]
pub fn samples(order: &[Side]) -> usize {
    LEAD_IN + order.len() * primitive_len()
}

/// All orders of `branches` primitives, left before right.
#[must_use]
pub fn all_orders(branches: usize) -> Vec<Vec<Side>> {
    let side = |number: usize, branch: usize| match number >> (branches - 1 - branch) & 1 {
        0 => Side::Left,
        _ => Side::Right,
    };
    (0..1_usize << branches).map(|number| (0..branches).map(|branch| side(number, branch)).collect()).collect()
}

/// An order drawn at random; each side is left with probability `left`.
#[must_use]
pub fn random_order(branches: usize, left: f64, seed: u64) -> Vec<Side> {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ ORDERS);
    let side = |_| if random.random::<f64>() < left { Side::Left } else { Side::Right };
    (0..branches).map(side).collect()
}

/// An order from its letters, e.g. `RLLLR`.
///
/// # Errors
/// [`Error::Setting`] for an empty text or other letters.
pub fn parse_order(text: &str) -> Result<Vec<Side>> {
    let side = |letter: char| match letter {
        'L' | 'l' => Some(Side::Left),
        'R' | 'r' => Some(Side::Right),
        _ => None,
    };
    let order: Option<Vec<Side>> = text.chars().map(side).collect();
    order.filter(|order| !order.is_empty()).ok_or_else(|| Error::Setting {
        what: "the order",
        found: format!("`{text}`"),
        needed: "letters L and R, one for each branching",
    })
}

/// An order as letters.
#[must_use]
pub fn letters(order: &[Side]) -> String {
    order.iter().map(|side| side.letter()).collect()
}

/// How far out the object is at a time in seconds, and to which side: 0 in the centre, 1 at the end.
fn out(order: &[Side], seconds: f64) -> (f64, Side) {
    let at = seconds / PERIOD - LEAD_IN as f64;
    let branch = (at / primitive_len() as f64).floor().max(0.0) as usize;
    let (Some(&side), true) = (order.get(branch), at > 0.0) else { return (0.0, Side::Left) };
    let mut rest = at - (branch * primitive_len()) as f64;
    let [to, hold, back, _] = PRIMITIVE.map(|steps| steps as f64);
    let minimum_jerk = |s: f64| s * s * s * (10.0 + s * (6.0 * s - 15.0));
    if rest < to {
        return (minimum_jerk(rest / to), side);
    }
    rest -= to;
    if rest < hold {
        return (1.0, side);
    }
    rest -= hold;
    (if rest < back { 1.0 - minimum_jerk(rest / back) } else { 0.0 }, side)
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

/// Two robots and an object at one moment.
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
    /// Samples taken.
    taken: usize,
    collision: Option<Collision>,
    depth: f64,
}

/// What the self-robot ran into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
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
    /// Both robots with their arms in the centre; the head fixates the object.
    ///
    /// # Errors
    /// [`Error::Setting`] for senseless options.
    pub fn new(order: &[Side], options: &InteractionOptions, seed: u64) -> Result<Self> {
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
            let root_from_link = robot.forward(&posture([0.0, 0.0], arm));
            world_from_root * root_from_link[effector] * Point3::new(beyond, 0.0, 0.0)
        };
        let gaze = Gaze::new(&robot, "camera_top")?;
        let angles = gaze.fixate(&place(&facing, OTHER_ARM[0], OBJECT.1));
        // The other robot looks at the self-robot's hand.
        let other_looks = gaze.fixate_in(&facing, &place(&Isometry3::identity(), SELF_ARM[0], 0.0));
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
        Ok(Self {
            order: order.to_vec(),
            noise: options.noise,
            random: ChaCha8Rng::seed_from_u64(seed ^ DOMAIN),
            head: LaggingGaze { rate: HEAD_RATE, angles },
            camera: robot.link("camera_top")?,
            effector,
            world,
            own,
            other,
            object,
            gaze,
            hands,
            taken: 0,
            collision: None,
            depth: 0.0,
        })
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
    pub fn sense(&mut self) -> [f64; 8] {
        let mut sample = self.truth();
        for (value, sd) in sample.iter_mut().zip(self.noise.0) {
            let z: f64 = StandardNormal.sample(&mut self.random);
            *value += sd * z;
        }
        sample
    }

    /// The same without noise.
    #[must_use]
    pub fn truth(&self) -> [f64; 8] {
        let angles = self.world.angles(self.own);
        let [yaw, pitch] = self.gaze.joints();
        let seen = nao::CAMERA.project(&self.world.link(self.own, self.camera), &self.object_place());
        let [x, y] = seen.unwrap_or([f64::NAN; 2]);
        [x, y, angles[yaw], angles[pitch], angles[2], angles[3], angles[4], angles[5]]
    }

    /// Where a tutor who knows the order leads the arm, one sample from now.
    #[must_use]
    pub fn tutor(&self) -> [f64; 4] {
        between(&SELF_ARM, out(&self.order, (self.taken + 1) as f64 * PERIOD))
    }

    /// Lets a sample's time pass while the arm moves evenly to `arm`.
    pub fn step(&mut self, arm: [f64; 4]) {
        let from: Vec<f64> = self.world.goals(self.own)[2..].to_vec();
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
            self.world.set_goals(self.own, &[&head[..], &arm(share)].concat());
            for (joint, angle) in between(&OTHER_ARM, out(&self.order, seconds)).into_iter().enumerate() {
                self.world.set_goal(self.other, 2 + joint, angle);
            }
            self.world.step();
            self.look_for_collisions();
        }
        self.taken += 1;
    }

    fn look_for_collisions(&mut self) {
        for contact in self.world.contacts() {
            let own = |body: BodyId| self.world.name(body).starts_with("self/");
            let (mine, theirs) = match contact.bodies.map(own) {
                [true, false] => (contact.bodies[0], contact.bodies[1]),
                [false, true] => (contact.bodies[1], contact.bodies[0]),
                _ => continue,
            };
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

    /// How deep it ran into it, in metres.
    #[must_use]
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// The object's centre in the world.
    #[must_use]
    pub fn object_place(&self) -> Point3<f64> {
        self.world.pose(self.object).translation.vector.into()
    }

    /// The self-robot's hand in the world.
    #[must_use]
    pub fn hand_place(&self) -> Point3<f64> {
        self.world.link(self.own, self.effector).translation.vector.into()
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

    /// Angles, and goals, of the self-robot's head and right arm.
    #[must_use]
    pub fn joints(&self) -> [Vec<f64>; 2] {
        [self.world.angles(self.own), self.world.goals(self.own)]
    }
}

/// Sets the sensors' noise apart from other noise of the same seed.
const DOMAIN: u64 = 0x696E_7465_7261_6374;

/// Sets random orders apart.
const ORDERS: u64 = 0x6F72_6465_7273_0000;

/// Records the first `count` samples of an order with a tutored arm. `watch` sees the world at each of them.
///
/// # Errors
/// [`Error::Setting`] for senseless options.
pub fn record(
    order: &[Side],
    options: &InteractionOptions,
    seed: u64,
    count: usize,
    mut watch: impl FnMut(&Interaction, &[f64; 8]),
) -> Result<Sequence> {
    let mut interaction = Interaction::new(order, options, seed)?;
    let count = count.min(samples(order));
    let mut values = Vec::with_capacity(count * CHANNELS.len());
    for _ in 0..count {
        let sample = interaction.sense();
        watch(&interaction, &sample);
        values.extend(sample);
        interaction.step_tutored();
    }
    Ok(Sequence::new(letters(order), CHANNELS.len(), values)?)
}

#[cfg(test)]
#[path = "interaction_tests.rs"]
mod tests;
