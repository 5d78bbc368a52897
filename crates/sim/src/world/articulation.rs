//! A robot as rapier's multibody: one rigid body for each group of links that hold still against each other.
//!
//! Joints are motors on springs, `torque = stiffness (target - angle) + damping (target's velocity - velocity)`, no stronger than their effort.
//! The spring's target follows the goal no faster than the joint's velocity allows.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Matrix, Pose, Rotation, Vector};
use rapier3d_f64::parry::mass_properties::MassProperties;
use rapier3d_f64::prelude::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MotorModel, MultibodyJointHandle, PhysicsWorld,
    RigidBodyBuilder, RigidBodyHandle, SharedShape,
};

use crate::error::{Error, Result};
use crate::robot::Shape;
use crate::robot::{Inertia, Joint, Limits, Motion, Robot};

/// The spring that stands for a motor's control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Servo {
    /// In N m/rad.
    pub stiffness: f64,
    /// In N m s/rad.
    pub damping: f64,
}

impl Default for Servo {
    fn default() -> Self {
        Self { stiffness: 100.0, damping: 3.0 }
    }
}

/// A movable joint in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motor {
    handle: MultibodyJointHandle,
    limits: Limits,
    servo: Servo,
    pub goal: f64,
    /// Where the spring pulls at the moment.
    target: f64,
}

/// A robot in the world.
#[derive(Debug)]
pub(crate) struct Articulation {
    /// For each link, its rigid body and its place in it.
    pub links: Vec<(RigidBodyHandle, Isometry3<f64>)>,
    pub motors: Vec<Motor>,
}

impl Articulation {
    /// Sets a robot into the world, at rest.
    ///
    /// # Errors
    /// [`Error::Joint`] for a joint that rapier would refuse; nothing of the robot is in the world then.
    pub fn insert(
        physics: &mut PhysicsWorld,
        robot: &Robot,
        world_from_root: &Isometry3<f64>,
        q: &[f64],
    ) -> Result<Self> {
        check_tree(robot)?;
        let rest = robot.forward(&vec![0.0; robot.dof()])?;
        let place = |link: usize| (robot.group(link), rest[robot.group(link)].inv_mul(&rest[link]));
        let mut bodies = vec![None; robot.links.len()];
        let mut links = Vec::with_capacity(robot.links.len());
        for link in 0..robot.links.len() {
            let (group, body_from_link) = place(link);
            let body = *bodies[group].get_or_insert_with(|| {
                let world_from_body = to_pose(&(world_from_root * rest[group]));
                let builder = match group {
                    0 => RigidBodyBuilder::fixed(),
                    _ => RigidBodyBuilder::dynamic()
                        .can_sleep(false)
                        .additional_mass_properties(masses(robot, group, &rest)),
                };
                physics.insert_body(builder.pose(world_from_body))
            });
            links.push((body, body_from_link));
        }
        let mut motors = Vec::with_capacity(robot.dof());
        for ((joint, limits), &goal) in robot.movable().zip(q) {
            let Motion::Revolute { axis, .. } = joint.motion else { continue };
            let basis = Pose::from_rotation(GenericJoint::complete_ang_frame(to_vector(&axis)));
            let (parent, body_from_parent) = links[joint.parent];
            let servo = Servo::default();
            let mut data = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
                .local_frame1(to_pose(&(body_from_parent * joint.parent_from_joint)) * basis)
                .local_frame2(basis)
                .motor_model(JointAxis::AngX, MotorModel::ForceBased)
                .motor_position(JointAxis::AngX, goal, servo.stiffness, servo.damping)
                .motor_max_force(JointAxis::AngX, limits.effort);
            if limits.upper < f64::MAX {
                data = data.limits(JointAxis::AngX, [limits.lower, limits.upper]);
            }
            let child = links[joint.child].0;
            let handle = physics.multibody_joints.insert(parent, child, data.build(), true);
            let handle = handle.ok_or_else(|| refused(robot, joint))?;
            motors.push(Motor { handle, limits, servo, goal, target: goal });
        }
        let articulation = Self { links, motors };
        articulation.pose(physics, q);
        Ok(articulation)
    }

    /// Brings the joints to their first angles.
    fn pose(&self, physics: &mut PhysicsWorld, q: &[f64]) {
        let Some(first) = self.motors.first() else { return };
        let Some((multibody, _)) = physics.multibody_joints.get_mut(first.handle) else { return };
        multibody.forward_kinematics(&physics.bodies, true);
        multibody.damping_mut().fill(0.0);
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (motor, q) in self.motors.iter().zip(q) {
            let of_motor = multibody.links().find(|link| link.rigid_body_handle().0 == motor.handle.0);
            if let Some(link) = of_motor {
                displacement[link.assembly_id()] = *q;
            }
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&physics.bodies, false);
        multibody.update_rigid_bodies(&mut physics.bodies, true);
    }

    /// Lets the springs' targets follow the goals for one step.
    pub fn drive(&mut self, physics: &mut PhysicsWorld, seconds: f64) {
        for motor in &mut self.motors {
            let Limits { lower, upper, velocity, .. } = motor.limits;
            let most = velocity * seconds;
            let before = motor.target;
            motor.target = (before + (motor.goal - before).clamp(-most, most)).clamp(lower, upper);
            let speed = (motor.target - before) / seconds;
            if let Some((multibody, link)) = physics.multibody_joints.get_mut(motor.handle)
                && let Some(link) = multibody.link_mut(link)
            {
                let Servo { stiffness, damping } = motor.servo;
                link.joint.data.set_motor(JointAxis::AngX, motor.target, speed, stiffness, damping);
            }
        }
    }

    /// Sets where a joint is to go, within its limits.
    pub fn go(&mut self, joint: usize, angle: f64) {
        if let Some(motor) = self.motors.get_mut(joint) {
            motor.goal = angle.clamp(motor.limits.lower, motor.limits.upper);
        }
    }

    pub fn set_servo(&mut self, joint: usize, servo: Servo) {
        self.motors[joint].servo = servo;
    }

    /// Angle and velocity of each joint.
    pub fn state<'a>(&'a self, physics: &'a PhysicsWorld) -> impl Iterator<Item = [f64; 2]> + 'a {
        self.motors.iter().map(|motor| {
            let joint = physics.multibody_joints.get(motor.handle);
            joint
                .and_then(|(multibody, link)| multibody.link(link).map(|link| (multibody, link)))
                .map_or([f64::NAN; 2], |(multibody, link)| {
                    [link.joint().coords()[3], multibody.joint_velocity(link)[0]]
                })
        })
    }
}

/// A joint is refused by rapier if its child hangs on a joint already, or if it closes a ring. It is asked before anything
/// is inserted: rapier cannot take back a tree of which it has refused a part.
fn check_tree(robot: &Robot) -> Result<()> {
    let mut tree: Vec<usize> = (0..robot.links.len()).collect();
    let mut carried = vec![false; robot.links.len()];
    for (joint, _) in robot.movable() {
        let (parent, child) = (robot.group(joint.parent), robot.group(joint.child));
        if carried[child] || tree[parent] == tree[child] {
            return Err(refused(robot, joint));
        }
        carried[child] = true;
        let (from, to) = (tree[child], tree[parent]);
        tree.iter_mut().filter(|one| **one == from).for_each(|one| *one = to);
    }
    Ok(())
}

fn refused(robot: &Robot, joint: &Joint) -> Error {
    let (child, parent) = (&robot.links[joint.child].name, &robot.links[joint.parent].name);
    let what = format!("is refused by the physics; needed: a tree, in which `{child}` hangs on `{parent}` by it alone");
    Error::Joint { joint: joint.name.clone(), what }
}

/// Mass properties of all links of a group, in the group's frame.
fn masses(robot: &Robot, group: usize, rest: &[Isometry3<f64>]) -> MassProperties {
    let members = (0..robot.links.len()).filter(|&link| robot.group(link) == group);
    members
        .filter_map(|link| {
            let Inertia { mass, centre, tensor } = robot.links[link].inertia.as_ref()?;
            let tensor = Matrix::from_cols_array(&(*tensor).into_owned().as_slice().try_into().ok()?);
            let own = MassProperties::with_inertia_matrix(to_vector(&centre.coords), *mass, tensor);
            Some(own.transform_by(&to_pose(&rest[group].inv_mul(&rest[link]))))
        })
        .fold(MassProperties::default(), |sum, own| sum + own)
}

pub(crate) fn to_vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub(crate) fn to_pose(pose: &Isometry3<f64>) -> Pose {
    let q = pose.rotation.quaternion();
    Pose::from_parts(to_vector(&pose.translation.vector), Rotation::from_xyzw(q.i, q.j, q.k, q.w))
}

pub(crate) fn from_pose(pose: &Pose) -> Isometry3<f64> {
    let (t, q) = (pose.translation, pose.rotation);
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), turn)
}

/// A shape, and its place in the frame of what it belongs to: rapier's cylinders stand along y.
pub(crate) fn to_shape(shape: &Shape) -> (SharedShape, Isometry3<f64>) {
    let point = |p: &Point3<f64>| to_vector(&p.coords);
    match shape {
        Shape::Sphere { radius } => (SharedShape::ball(*radius), Isometry3::identity()),
        Shape::Capsule { a, b, radius } => (SharedShape::capsule(point(a), point(b), *radius), Isometry3::identity()),
        Shape::Cuboid { half_extents: [x, y, z] } => (SharedShape::cuboid(*x, *y, *z), Isometry3::identity()),
        Shape::Cylinder { half_length, radius } => {
            let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            (SharedShape::cylinder(*half_length, *radius), Isometry3::from_parts(Translation3::identity(), upright))
        }
    }
}
