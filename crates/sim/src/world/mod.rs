//! Robots and things in one world, moved by rapier in steps of fixed length.
//!
//! Each robot has a name and a place; its links are bodies named `robot/link`. Things are bodies with names of their own.
//! Two bodies touch when the distance of their shapes, which is negative in overlap, falls to nothing: the solver's own
//! notion of contact begins a centimetre earlier.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::prelude::{
    ActiveHooks, ColliderBuilder, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, SharedShape,
};

use crate::error::{Error, Result};
use crate::robot::{Robot, Shape};
use articulation::{Articulation, from_pose, to_pose, to_shape, to_vector};
use contacts::Ignored;
use scene::{Body, Frame, Part, Scene};

pub mod scene;

mod articulation;
mod contacts;

pub use articulation::Servo;
pub use contacts::Contact;

/// How the world runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldOptions {
    /// Length of a step, in seconds.
    pub step: f64,
    /// Downwards, in m/s^2.
    pub gravity: f64,
    /// Parts into which the solver cuts a step.
    pub substeps: usize,
}

impl Default for WorldOptions {
    fn default() -> Self {
        Self { step: 0.005, gravity: 9.81, substeps: 4 }
    }
}

/// Where and how a robot is set into the world.
#[derive(Debug, Clone)]
pub struct Placement<'a> {
    /// Its name, which comes before those of its links.
    pub name: &'a str,
    /// Leads from its root to the world.
    pub world_from_root: Isometry3<f64>,
    /// One angle for each movable joint, in rad.
    pub posture: &'a [f64],
    /// What its links are.
    pub part: Part,
    /// Links that are hands.
    pub hands: &'a [&'a str],
}

/// A robot of the world it came from. Another world takes it only for a robot of the same name and place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotId(usize, u64);

/// A body of the world it came from: a link with its shapes, or a thing. Another world takes it only for a body of the same name
/// and place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BodyId(usize, u64);

/// A number for a name, by which another world's is told (FNV-1a).
fn mark(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |mark, byte| (mark ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// How a joint stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState<'a> {
    /// Its name in the description.
    pub name: &'a str,
    /// In rad.
    pub angle: f64,
    /// In rad/s.
    pub velocity: f64,
}

/// One shape of a body.
#[derive(Debug)]
struct Collider {
    shape: Shape,
    carrier_from_shape: Isometry3<f64>,
    /// As rapier has it, with its place in the carrier.
    physical: SharedShape,
    carrier_from_physical: Isometry3<f64>,
}

#[derive(Debug)]
struct BodyRecord {
    name: String,
    part: Part,
    /// The robot of which it is a link.
    robot: Option<RobotId>,
    carrier: RigidBodyHandle,
    colliders: Vec<Collider>,
}

#[derive(Debug)]
struct PlacedRobot {
    name: String,
    description: Robot,
    world_from_root: Isometry3<f64>,
    articulation: Articulation,
}

/// Robots and things, and the physics that moves them.
pub struct World {
    options: WorldOptions,
    physics: PhysicsWorld,
    robots: Vec<PlacedRobot>,
    bodies: Vec<BodyRecord>,
    by_name: BTreeMap<String, BodyId>,
    ignored: Ignored,
    steps: u64,
}

impl std::fmt::Debug for World {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("World")
            .field("bodies", &self.by_name.keys())
            .field("steps", &self.steps)
            .finish_non_exhaustive()
    }
}

impl World {
    /// An empty world.
    ///
    /// # Errors
    /// [`Error::Setting`] for a step that is not a positive number.
    pub fn new(options: WorldOptions) -> Result<Self> {
        if !(options.step > 0.0 && options.step <= 0.1) {
            let found = format!("{} s", options.step);
            return Err(Error::Setting { what: "the length of a step", found, needed: "more than 0, and 0.1 at most" });
        }
        let mut physics =
            PhysicsWorld { gravity: to_vector(&Vector3::new(0.0, 0.0, -options.gravity)), ..PhysicsWorld::default() };
        physics.integration_parameters.dt = options.step;
        physics.integration_parameters.num_solver_iterations = options.substeps.max(1);
        // Its tolerance of 5 cm is a robot's hand here.
        physics.integration_parameters.contact_recycling = false;
        let (robots, bodies, by_name) = (Vec::new(), Vec::new(), BTreeMap::new());
        Ok(Self { options, physics, robots, bodies, by_name, ignored: Ignored::default(), steps: 0 })
    }

    /// Sets a robot into the world. Its root holds still.
    ///
    /// # Errors
    /// [`Error::Taken`], [`Error::Length`] for a posture of another size, [`Error::Joint`] for an angle beyond its limits or
    /// a joint that the physics refuses, [`Error::Missing`] for a hand that is not there. The world is as before then.
    pub fn add_robot(&mut self, robot: &Robot, placement: &Placement<'_>) -> Result<RobotId> {
        let Placement { name, world_from_root, posture, part, hands } = placement;
        if self.robots.iter().any(|one| one.name == *name) {
            return Err(Error::Taken((*name).to_owned()));
        }
        if posture.len() != robot.dof() {
            return Err(Error::Length { what: "the posture", found: posture.len(), needed: robot.dof() });
        }
        for ((joint, limits), q) in robot.movable().zip(*posture) {
            if !(limits.lower..=limits.upper).contains(q) {
                let what = format!("cannot start at {q} rad; needed: {} to {}", limits.lower, limits.upper);
                return Err(Error::Joint { joint: joint.name.clone(), what });
            }
        }
        let hands = hands.iter().map(|hand| robot.link(hand)).collect::<Result<Vec<_>>>()?;
        for link in &robot.links {
            self.check_free(&format!("{name}/{}", link.name))?;
        }
        let id = RobotId(self.robots.len(), mark(name));
        let articulation = Articulation::insert(&mut self.physics, robot, world_from_root, posture)?;
        let mut own = Vec::new();
        for (index, link) in robot.links.iter().enumerate() {
            if !link.shapes.is_empty() {
                let part = if hands.contains(&index) { Part::Hand } else { *part };
                let (carrier, carrier_from_link) = articulation.links[index];
                let shapes = link.shapes.iter().map(|(shape, place)| (shape.clone(), carrier_from_link * place));
                own.push((index, self.insert(format!("{name}/{}", link.name), part, Some(id), carrier, shapes)));
            }
        }
        for (a, &(link_a, body_a)) in own.iter().enumerate() {
            for &(link_b, body_b) in &own[a + 1..] {
                if robot.may_overlap(link_a, link_b) {
                    self.ignored.insert(body_a.0, body_b.0);
                }
            }
        }
        let (name, description, world_from_root) = ((*name).to_owned(), robot.clone(), *world_from_root);
        self.robots.push(PlacedRobot { name, description, world_from_root, articulation });
        Ok(id)
    }

    /// Puts a thing into the world that stays where it is, unless it is [placed](World::place) elsewhere.
    ///
    /// # Errors
    /// [`Error::Taken`].
    pub fn add_fixed(
        &mut self,
        name: &str,
        part: Part,
        shape: Shape,
        world_from_shape: Isometry3<f64>,
    ) -> Result<BodyId> {
        self.add(name, part, shape, RigidBodyBuilder::fixed().pose(to_pose(&world_from_shape)))
    }

    /// Puts a kinematic thing into the world: it goes where [`World::move_kinematic`] puts it, and pushes away what
    /// it meets.
    ///
    /// # Errors
    /// [`Error::Taken`].
    pub fn add_kinematic(
        &mut self,
        name: &str,
        part: Part,
        shape: Shape,
        world_from_shape: Isometry3<f64>,
    ) -> Result<BodyId> {
        self.add(name, part, shape, RigidBodyBuilder::kinematic_position_based().pose(to_pose(&world_from_shape)))
    }

    /// Fixes a thing without mass to a link of a robot.
    ///
    /// # Errors
    /// [`Error::Taken`], [`Error::Elsewhere`], and [`Error::Missing`] for a link that is not there.
    pub fn attach(
        &mut self,
        robot: RobotId,
        link: &str,
        name: &str,
        part: Part,
        shape: Shape,
        link_from_shape: Isometry3<f64>,
    ) -> Result<BodyId> {
        self.check_free(name)?;
        let PlacedRobot { description, articulation, name: of, .. } = self.robot(robot)?.one;
        let link = description.link(link)?;
        let (carrier, carrier_from_link) = articulation.links[link];
        // It may overlap what holds it, and whatever that may overlap.
        let mut overlaps = Vec::new();
        for (index, other) in description.links.iter().enumerate() {
            if let Some(&body) = self.by_name.get(&format!("{of}/{}", other.name))
                && (description.group(index) == description.group(link) || description.may_overlap(index, link))
            {
                overlaps.push(body);
            }
        }
        let shapes = std::iter::once((shape, carrier_from_link * link_from_shape));
        let body = self.insert(name.to_owned(), part, None, carrier, shapes);
        overlaps.into_iter().for_each(|other| self.ignored.insert(body.0, other.0));
        Ok(body)
    }

    /// Lets two bodies pass through each other.
    ///
    /// # Errors
    /// [`Error::Elsewhere`]; as all of the following.
    pub fn ignore_contacts(&mut self, a: BodyId, b: BodyId) -> Result<()> {
        self.check(a).and_then(|()| self.check(b))?;
        self.ignored.insert(a.0, b.0);
        Ok(())
    }

    /// Moves a thing at once, e.g. when an experimenter puts it elsewhere.
    ///
    /// # Errors
    /// [`Error::Elsewhere`].
    pub fn place(&mut self, body: BodyId, world_from_shape: &Isometry3<f64>) -> Result<()> {
        self.check(body)?;
        let carrier = self.bodies[body.0].carrier;
        if let Some(carrier) = self.physics.bodies.get_mut(carrier).filter(|carrier| !carrier.is_dynamic()) {
            carrier.set_position(to_pose(world_from_shape), true);
        }
        Ok(())
    }

    /// Moves a kinematic thing within the next step.
    ///
    /// # Errors
    /// [`Error::Elsewhere`].
    pub fn move_kinematic(&mut self, body: BodyId, world_from_shape: &Isometry3<f64>) -> Result<()> {
        self.check(body)?;
        let carrier = self.bodies[body.0].carrier;
        if let Some(carrier) = self.physics.bodies.get_mut(carrier).filter(|carrier| carrier.is_kinematic()) {
            carrier.set_next_kinematic_position(to_pose(world_from_shape));
        }
        Ok(())
    }

    /// Sets where a joint is to go, within its limits.
    ///
    /// # Errors
    /// [`Error::Elsewhere`], and [`Error::NoSuch`] for a joint that is not there.
    pub fn set_goal(&mut self, robot: RobotId, joint: usize, angle: f64) -> Result<()> {
        self.robot(robot)?.description().limits(joint)?;
        self.robots[robot.0].articulation.go(joint, angle);
        Ok(())
    }

    /// Sets where all joints are to go.
    ///
    /// # Errors
    /// [`Error::Elsewhere`], and [`Error::Length`] unless there is an angle for each joint.
    pub fn set_goals(&mut self, robot: RobotId, angles: &[f64]) -> Result<()> {
        let needed = self.robot(robot)?.description().dof();
        if angles.len() != needed {
            return Err(Error::Length { what: "the goals", found: angles.len(), needed });
        }
        self.steer(robot, angles);
        Ok(())
    }

    /// Makes a joint's motor stiffer or softer.
    ///
    /// # Errors
    /// [`Error::Elsewhere`], and [`Error::NoSuch`] for a joint that is not there.
    pub fn set_servo(&mut self, robot: RobotId, joint: usize, servo: Servo) -> Result<()> {
        self.robot(robot)?.description().limits(joint)?;
        self.robots[robot.0].articulation.set_servo(joint, servo);
        Ok(())
    }

    /// One step.
    pub fn step(&mut self) {
        for one in &mut self.robots {
            one.articulation.drive(&mut self.physics, self.options.step);
        }
        self.physics.step_with_events(&self.ignored, &());
        self.steps += 1;
    }

    /// Seconds since the start.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.options.step
    }

    /// How the world runs.
    #[must_use]
    pub fn options(&self) -> WorldOptions {
        self.options
    }

    /// A robot as it stands now.
    ///
    /// # Errors
    /// [`Error::Elsewhere`].
    pub fn robot(&self, robot: RobotId) -> Result<RobotState<'_>> {
        match self.robots.get(robot.0) {
            Some(one) if mark(&one.name) == robot.1 => Ok(self.own(robot)),
            _ => {
                let present = self.robots.iter().map(|one| one.name.as_str()).collect::<Vec<_>>().join(", ");
                Err(Error::Elsewhere { what: "robot", present })
            }
        }
    }

    /// A body by name.
    ///
    /// # Errors
    /// [`Error::Missing`] with the names that there are.
    pub fn body(&self, name: &str) -> Result<BodyId> {
        self.by_name.get(name).copied().ok_or_else(|| {
            let present = self.by_name.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
            Error::Missing { what: "body", name: name.to_owned(), present }
        })
    }

    /// A body's name.
    ///
    /// # Errors
    /// [`Error::Elsewhere`].
    pub fn name(&self, body: BodyId) -> Result<&str> {
        self.check(body)?;
        Ok(self.name_of(body))
    }

    /// Leads from a thing's shape, or from the first shape of a link, to the world.
    ///
    /// # Errors
    /// [`Error::Elsewhere`].
    pub fn pose(&self, body: BodyId) -> Result<Isometry3<f64>> {
        self.check(body)?;
        Ok(self.pose_of(body))
    }

    /// All that can be seen now.
    #[must_use]
    pub fn scene(&self) -> Scene {
        let mut scene = Scene::default();
        for record in &self.bodies {
            let world_from_carrier = from_pose(self.physics.bodies[record.carrier].position());
            for (index, collider) in record.colliders.iter().enumerate() {
                let name = match index {
                    0 => record.name.clone(),
                    _ => format!("{}.{index}", record.name),
                };
                let world_from_shape = world_from_carrier * collider.carrier_from_shape;
                scene.bodies.push(Body { name, part: record.part, shape: collider.shape.clone(), world_from_shape });
            }
        }
        for one in &self.robots {
            for (link, description) in one.description.links.iter().enumerate() {
                let name = format!("{}/{}", one.name, description.name);
                scene
                    .frames
                    .push(Frame { name, world_from_frame: RobotState { one, physics: &self.physics }.of_link(link) });
            }
        }
        scene
    }

    fn check(&self, body: BodyId) -> Result<()> {
        match self.bodies.get(body.0) {
            Some(one) if mark(&one.name) == body.1 => Ok(()),
            _ => {
                let present = self.by_name.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
                Err(Error::Elsewhere { what: "body", present })
            }
        }
    }

    fn check_free(&self, name: &str) -> Result<()> {
        match self.by_name.contains_key(name) {
            true => Err(Error::Taken(name.to_owned())),
            false => Ok(()),
        }
    }

    fn add(&mut self, name: &str, part: Part, shape: Shape, builder: RigidBodyBuilder) -> Result<BodyId> {
        self.check_free(name)?;
        let carrier = self.physics.insert_body(builder);
        Ok(self.insert(name.to_owned(), part, None, carrier, std::iter::once((shape, Isometry3::identity()))))
    }

    fn insert(
        &mut self,
        name: String,
        part: Part,
        robot: Option<RobotId>,
        carrier: RigidBodyHandle,
        shapes: impl Iterator<Item = (Shape, Isometry3<f64>)>,
    ) -> BodyId {
        let id = BodyId(self.bodies.len(), mark(&name));
        let colliders = shapes.map(|(shape, carrier_from_shape)| {
            let (physical, shape_from_physical) = to_shape(&shape);
            let carrier_from_physical = carrier_from_shape * shape_from_physical;
            let collider = ColliderBuilder::new(physical.clone())
                .position(to_pose(&carrier_from_physical))
                .density(0.0)
                .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
                .user_data(id.0 as u128);
            self.physics.insert_collider(collider, Some(carrier));
            Collider { shape, carrier_from_shape, physical, carrier_from_physical }
        });
        let colliders = colliders.collect();
        self.bodies.push(BodyRecord { name: name.clone(), part, robot, carrier, colliders });
        self.by_name.insert(name, id);
        id
    }
}

/// What the experiments of this crate ask of a world that they have made, with what it gave them.
impl World {
    pub(crate) fn own(&self, robot: RobotId) -> RobotState<'_> {
        RobotState { one: &self.robots[robot.0], physics: &self.physics }
    }

    pub(crate) fn steer(&mut self, robot: RobotId, angles: &[f64]) {
        let articulation = &mut self.robots[robot.0].articulation;
        angles.iter().enumerate().for_each(|(joint, &angle)| articulation.go(joint, angle));
    }

    pub(crate) fn name_of(&self, body: BodyId) -> &str {
        &self.bodies[body.0].name
    }

    pub(crate) fn pose_of(&self, body: BodyId) -> Isometry3<f64> {
        let record = &self.bodies[body.0];
        from_pose(self.physics.bodies[record.carrier].position()) * record.colliders[0].carrier_from_shape
    }
}

/// A robot of a world, as it stands now.
#[derive(Clone, Copy)]
pub struct RobotState<'a> {
    one: &'a PlacedRobot,
    physics: &'a PhysicsWorld,
}

impl std::fmt::Debug for RobotState<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RobotState").field("name", &self.one.name).field("angles", &self.angles()).finish()
    }
}

impl<'a> RobotState<'a> {
    /// Its description.
    #[must_use]
    pub fn description(&self) -> &'a Robot {
        &self.one.description
    }

    /// Leads from its root to the world.
    #[must_use]
    pub fn world_from_root(&self) -> Isometry3<f64> {
        self.one.world_from_root
    }

    /// True angles of its joints.
    #[must_use]
    pub fn angles(&self) -> Vec<f64> {
        self.one.articulation.state(self.physics).map(|[angle, _]| angle).collect()
    }

    /// True velocities of its joints, in rad/s.
    #[must_use]
    pub fn velocities(&self) -> Vec<f64> {
        self.one.articulation.state(self.physics).map(|[_, velocity]| velocity).collect()
    }

    /// How all joints stand that its description calls movable. Those that are [locked](Robot::lock) hold still.
    #[must_use]
    pub fn joint_states(&self) -> Vec<JointState<'a>> {
        let velocities = self.velocities();
        let velocity = |name: &str| self.description().joint(name).map_or(0.0, |index| velocities[index]);
        let angles = self.description().all_angles(&self.angles());
        angles.into_iter().map(|(name, angle)| JointState { name, angle, velocity: velocity(name) }).collect()
    }

    /// Where its joints are to go.
    #[must_use]
    pub fn goals(&self) -> Vec<f64> {
        self.one.articulation.motors.iter().map(|motor| motor.goal).collect()
    }

    /// Leads from a link to the world; the index is the one in its description.
    ///
    /// # Errors
    /// [`Error::NoSuch`] if there is no such link.
    pub fn link(&self, link: usize) -> Result<Isometry3<f64>> {
        let count = self.one.articulation.links.len();
        if link < count { Ok(self.of_link(link)) } else { Err(Error::NoSuch { what: "link", index: link, count }) }
    }

    pub(crate) fn of_link(&self, link: usize) -> Isometry3<f64> {
        let (carrier, carrier_from_link) = self.one.articulation.links[link];
        from_pose(self.physics.bodies[carrier].position()) * carrier_from_link
    }
}

#[cfg(test)]
mod tests;
