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

/// A robot of the world it came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotId(usize);

/// A body of the world it came from: a link with its shapes, or a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BodyId(usize);

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
        let id = RobotId(self.robots.len());
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
    /// [`Error::Taken`], and [`Error::Missing`] for a link that is not there.
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
        let PlacedRobot { description, articulation, name: of, .. } = &self.robots[robot.0];
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
    pub fn ignore_contacts(&mut self, a: BodyId, b: BodyId) {
        self.ignored.insert(a.0, b.0);
    }

    /// Moves a thing at once, e.g. when an experimenter puts it elsewhere.
    pub fn place(&mut self, body: BodyId, world_from_shape: &Isometry3<f64>) {
        let carrier = self.bodies[body.0].carrier;
        if let Some(carrier) = self.physics.bodies.get_mut(carrier).filter(|carrier| !carrier.is_dynamic()) {
            carrier.set_position(to_pose(world_from_shape), true);
        }
    }

    /// Moves a kinematic thing within the next step.
    pub fn move_kinematic(&mut self, body: BodyId, world_from_shape: &Isometry3<f64>) {
        let carrier = self.bodies[body.0].carrier;
        if let Some(carrier) = self.physics.bodies.get_mut(carrier).filter(|carrier| carrier.is_kinematic()) {
            carrier.set_next_kinematic_position(to_pose(world_from_shape));
        }
    }

    /// Sets where a joint is to go, within its limits.
    pub fn set_goal(&mut self, robot: RobotId, joint: usize, angle: f64) {
        let limits = self.robots[robot.0].description.limits(joint);
        self.robots[robot.0].articulation.motors[joint].goal = angle.clamp(limits.lower, limits.upper);
    }

    /// Sets where all joints are to go.
    pub fn set_goals(&mut self, robot: RobotId, angles: &[f64]) {
        angles.iter().enumerate().for_each(|(joint, &angle)| self.set_goal(robot, joint, angle));
    }

    /// Makes a joint's motor stiffer or softer.
    pub fn set_servo(&mut self, robot: RobotId, joint: usize, servo: Servo) {
        self.robots[robot.0].articulation.set_servo(joint, servo);
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

    /// A robot's description.
    #[must_use]
    pub fn robot(&self, robot: RobotId) -> &Robot {
        &self.robots[robot.0].description
    }

    /// Leads from a robot's root to the world.
    #[must_use]
    pub fn world_from_root(&self, robot: RobotId) -> Isometry3<f64> {
        self.robots[robot.0].world_from_root
    }

    /// True angles of a robot's joints.
    #[must_use]
    pub fn angles(&self, robot: RobotId) -> Vec<f64> {
        self.robots[robot.0].articulation.state(&self.physics).map(|[angle, _]| angle).collect()
    }

    /// True velocities of a robot's joints, in rad/s.
    #[must_use]
    pub fn velocities(&self, robot: RobotId) -> Vec<f64> {
        self.robots[robot.0].articulation.state(&self.physics).map(|[_, velocity]| velocity).collect()
    }

    /// How all joints stand that a robot's description calls movable. Those that are [locked](Robot::lock) hold still.
    #[must_use]
    pub fn joint_states(&self, robot: RobotId) -> Vec<JointState<'_>> {
        let description = &self.robots[robot.0].description;
        let velocities = self.velocities(robot);
        let velocity = |name: &str| description.joint(name).map_or(0.0, |index| velocities[index]);
        let angles = description.all_angles(&self.angles(robot));
        angles.into_iter().map(|(name, angle)| JointState { name, angle, velocity: velocity(name) }).collect()
    }

    /// Where a robot's joints are to go.
    #[must_use]
    pub fn goals(&self, robot: RobotId) -> Vec<f64> {
        self.robots[robot.0].articulation.motors.iter().map(|motor| motor.goal).collect()
    }

    /// Leads from a link to the world; the index is the one in the robot's description.
    #[must_use]
    pub fn link(&self, robot: RobotId, link: usize) -> Isometry3<f64> {
        let (carrier, carrier_from_link) = self.robots[robot.0].articulation.links[link];
        from_pose(self.physics.bodies[carrier].position()) * carrier_from_link
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
    #[must_use]
    pub fn name(&self, body: BodyId) -> &str {
        &self.bodies[body.0].name
    }

    /// Leads from a thing's shape, or from the first shape of a link, to the world.
    #[must_use]
    pub fn pose(&self, body: BodyId) -> Isometry3<f64> {
        let record = &self.bodies[body.0];
        from_pose(self.physics.bodies[record.carrier].position()) * record.colliders[0].carrier_from_shape
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
        for (index, one) in self.robots.iter().enumerate() {
            for (link, description) in one.description.links.iter().enumerate() {
                let name = format!("{}/{}", one.name, description.name);
                scene.frames.push(Frame { name, world_from_frame: self.link(RobotId(index), link) });
            }
        }
        scene
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
        let id = BodyId(self.bodies.len());
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

#[cfg(test)]
mod tests;
