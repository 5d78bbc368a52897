//! A robot's description: links with masses and shapes, joints with limits, read from a URDF.
//!
//! Joints turn about an axis or hold still. Links and joints are kept in an order in which every parent comes before its
//! children. The angles of the movable joints, in the order of the description, are the robot's q.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::error::{Error, Result};
use crate::scene::Shape;

/// Mass and inertia of a link, about its centre of mass, in the link's axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Inertia {
    /// In kg.
    pub mass: f64,
    /// In the link's frame, in metres.
    pub centre: Point3<f64>,
    /// In kg m^2.
    pub tensor: Matrix3<f64>,
}

/// A rigid part.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Unique in the robot.
    pub name: String,
    /// Its mass, unless it is a mere frame.
    pub inertia: Option<Inertia>,
    /// Shapes for contacts, each with its place in the link's frame.
    pub shapes: Vec<(Shape, Isometry3<f64>)>,
    /// The joint that carries it, an index into [`Robot::joints`]; the root has none.
    pub joint: Option<usize>,
}

/// What a motor can do, and how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Smallest angle, in rad.
    pub lower: f64,
    /// Largest angle, in rad.
    pub upper: f64,
    /// Fastest turn, in rad/s.
    pub velocity: f64,
    /// Strongest torque, in N m.
    pub effort: f64,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Not at all.
    Fixed,
    /// About an axis of its own frame.
    Revolute {
        /// In the joint's frame.
        axis: Unit<Vector3<f64>>,
        /// Of its motor.
        limits: Limits,
        /// Its place in q.
        index: usize,
    },
}

/// Connects two links.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique in the robot.
    pub name: String,
    /// Index of the link that carries it.
    pub parent: usize,
    /// Index of the link that it carries.
    pub child: usize,
    /// Leads from the joint's frame at angle 0, which is the child's, to the parent's.
    pub parent_from_joint: Isometry3<f64>,
    /// How it moves.
    pub motion: Motion,
}

/// A tree of links.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// As its description calls it.
    pub name: String,
    /// The first is the root.
    pub links: Vec<Link>,
    /// Sorted: a joint's parent link comes before its child link.
    pub joints: Vec<Joint>,
    /// For each angle of q, the index of its joint.
    movable: Vec<usize>,
    /// Pairs of links that may overlap, beyond those that a joint connects; see [`Robot::ignore_contacts`].
    pub(crate) ignored: Vec<(usize, usize)>,
}

impl Robot {
    /// Reads a description.
    ///
    /// # Errors
    /// [`Error::Unreadable`] when the text is no URDF, and [`Error::Link`] or [`Error::Joint`] with the name of what is
    /// wrong in it.
    pub fn from_urdf(text: &str) -> Result<Self> {
        let urdf = urdf_rs::read_from_string(text).map_err(|error| Error::Unreadable(error.to_string()))?;
        let mut by_name = HashMap::new();
        for (index, link) in urdf.links.iter().enumerate() {
            if by_name.insert(link.name.as_str(), index).is_some() {
                return Err(bad_link(&link.name, "is described twice"));
            }
        }
        let mut carried_by: Vec<Option<usize>> = vec![None; urdf.links.len()];
        let mut names = HashMap::new();
        for (index, joint) in urdf.joints.iter().enumerate() {
            if names.insert(joint.name.as_str(), ()).is_some() {
                return Err(bad_joint(&joint.name, "is described twice"));
            }
            for link in [&joint.parent.link, &joint.child.link] {
                if !by_name.contains_key(link.as_str()) {
                    return Err(bad_joint(&joint.name, &format!("names a link `{link}` that is not described")));
                }
            }
            let child = by_name[joint.child.link.as_str()];
            if let Some(other) = carried_by[child].replace(index) {
                let what = format!("is carried by two joints, `{}` and `{}`", urdf.joints[other].name, joint.name);
                return Err(bad_link(&joint.child.link, &what));
            }
        }
        let roots: Vec<usize> = (0..urdf.links.len()).filter(|&link| carried_by[link].is_none()).collect();
        let root = match roots[..] {
            [root] => root,
            [] => return Err(Error::Unreadable("no link is the root: each hangs on a joint".to_owned())),
            [_, second, ..] => {
                let what =
                    format!("hangs on no joint; neither does `{}`, and only one can be", urdf.links[roots[0]].name);
                return Err(bad_link(&urdf.links[second].name, &what));
            }
        };

        let mut robot = Self {
            name: urdf.name.clone(),
            links: vec![read_link(&urdf.links[root], None)?],
            joints: Vec::with_capacity(urdf.joints.len()),
            movable: Vec::new(),
            ignored: Vec::new(),
        };
        // New indices of links, in the order in which they are reached from the root.
        let mut reached = vec![None; urdf.links.len()];
        reached[root] = Some(0);
        let mut open: Vec<usize> = (0..urdf.joints.len()).collect();
        while !open.is_empty() {
            let before = open.len();
            let mut later = Vec::new();
            for index in open {
                let joint = &urdf.joints[index];
                let child = by_name[joint.child.link.as_str()];
                match reached[by_name[joint.parent.link.as_str()]] {
                    None => later.push(index),
                    Some(parent) => {
                        reached[child] = Some(robot.links.len());
                        let motion = read_motion(joint, robot.movable.len())?;
                        if matches!(motion, Motion::Revolute { .. }) {
                            robot.movable.push(robot.joints.len());
                        }
                        robot.links.push(read_link(&urdf.links[child], Some(robot.joints.len()))?);
                        robot.joints.push(Joint {
                            name: joint.name.clone(),
                            parent,
                            child: robot.links.len() - 1,
                            parent_from_joint: finite_pose(&joint.origin)
                                .map_err(|what| bad_joint(&joint.name, &what))?,
                            motion,
                        });
                    }
                }
            }
            if later.len() == before {
                return Err(bad_joint(&urdf.joints[later[0]].name, "does not hang on the root: joints form a ring"));
            }
            open = later;
        }
        robot.check_masses()?;
        Ok(robot)
    }

    /// Number of angles.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.movable.len()
    }

    /// The movable joints in the order of q.
    pub fn movable(&self) -> impl Iterator<Item = (&Joint, Limits)> {
        self.movable.iter().filter_map(|&index| {
            let joint = &self.joints[index];
            match joint.motion {
                Motion::Revolute { limits, .. } => Some((joint, limits)),
                Motion::Fixed => None,
            }
        })
    }

    /// Names of the movable joints in the order of q.
    #[must_use]
    pub fn joint_names(&self) -> Vec<&str> {
        self.movable().map(|(joint, _)| joint.name.as_str()).collect()
    }

    /// The place of a movable joint in q.
    ///
    /// # Errors
    /// [`Error::Missing`] with the names that there are.
    pub fn joint(&self, name: &str) -> Result<usize> {
        self.movable().position(|(joint, _)| joint.name == name).ok_or_else(|| {
            let present = self.joint_names().join(", ");
            Error::Missing { what: "movable joint", name: name.to_owned(), present }
        })
    }

    /// The places in q of several joints.
    ///
    /// # Errors
    /// As [`Robot::joint`].
    pub fn joints_named(&self, names: &[&str]) -> Result<Vec<usize>> {
        names.iter().map(|name| self.joint(name)).collect()
    }

    /// The limits of the angle at place `index` of q.
    ///
    /// # Panics
    /// If there is no such angle.
    #[must_use]
    pub fn limits(&self, index: usize) -> Limits {
        match self.joints[self.movable[index]].motion {
            Motion::Revolute { limits, .. } => limits,
            Motion::Fixed => Limits { lower: 0.0, upper: 0.0, velocity: 0.0, effort: 0.0 },
        }
    }

    /// The index of a link.
    ///
    /// # Errors
    /// [`Error::Missing`] with the names that there are.
    pub fn link(&self, name: &str) -> Result<usize> {
        self.links.iter().position(|link| link.name == name).ok_or_else(|| {
            let present = self.links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>().join(", ");
            Error::Missing { what: "link", name: name.to_owned(), present }
        })
    }

    /// Brings each angle within its joint's limits.
    pub fn clamp(&self, q: &mut [f64]) {
        for (q, (_, limits)) in q.iter_mut().zip(self.movable()) {
            *q = q.clamp(limits.lower, limits.upper);
        }
    }

    /// Makes a movable joint a fixed one, at an angle: joints that an experiment does not use cost nothing then.
    ///
    /// # Errors
    /// [`Error::Missing`] for a joint that is not there, [`Error::Joint`] for an angle beyond its limits.
    pub fn lock(&mut self, name: &str, angle: f64) -> Result<()> {
        let index = self.joint(name)?;
        let Limits { lower, upper, .. } = self.limits(index);
        if !(lower..=upper).contains(&angle) {
            return Err(bad_joint(name, &format!("cannot be locked at {angle} rad; needed: {lower} to {upper}")));
        }
        let joint = &mut self.joints[self.movable.remove(index)];
        if let Motion::Revolute { axis, .. } = joint.motion {
            joint.parent_from_joint *= UnitQuaternion::from_axis_angle(&axis, angle);
        }
        joint.motion = Motion::Fixed;
        for (place, &joint) in self.movable.iter().enumerate() {
            if let Motion::Revolute { index, .. } = &mut self.joints[joint].motion {
                *index = place;
            }
        }
        Ok(())
    }

    /// Lets two links overlap freely, e.g. because their shapes are rough. Links next to each other, with no more than
    /// links without a shape in between, always may.
    ///
    /// # Errors
    /// [`Error::Missing`] for a link that is not there.
    pub fn ignore_contacts(&mut self, a: &str, b: &str) -> Result<()> {
        let pair = (self.link(a)?, self.link(b)?);
        self.ignored.push(pair);
        Ok(())
    }

    /// Whether contacts of two links are left out.
    #[must_use]
    pub fn may_overlap(&self, a: usize, b: usize) -> bool {
        self.ignored.iter().any(|&(c, d)| (a, b) == (c, d) || (a, b) == (d, c))
            || self.next_above(a) == Some(b)
            || self.next_above(b) == Some(a)
            || self.group(a) == self.group(b)
    }

    /// The nearest link above that has a shape and does not hold still against this one.
    fn next_above(&self, link: usize) -> Option<usize> {
        let mut at = self.group(link);
        while let Some(joint) = self.links[at].joint {
            at = self.joints[joint].parent;
            if !self.links[at].shapes.is_empty() {
                return Some(at);
            }
        }
        None
    }

    /// The link that `link` is fixed to: the uppermost that fixed joints lead to.
    #[must_use]
    pub fn group(&self, link: usize) -> usize {
        let mut at = link;
        while let Some(joint) = self.links[at].joint {
            let joint = &self.joints[joint];
            match joint.motion {
                Motion::Fixed => at = joint.parent,
                Motion::Revolute { .. } => break,
            }
        }
        at
    }

    /// A joint can only be moved if there is a mass to move.
    fn check_masses(&self) -> Result<()> {
        for (joint, _) in self.movable() {
            let moved = (0..self.links.len()).filter(|&link| self.group(link) == joint.child);
            if moved.filter_map(|link| self.links[link].inertia.as_ref()).map(|i| i.mass).sum::<f64>() <= 0.0 {
                let what = format!("has no mass, but joint `{}` moves it; needed: an <inertial>", joint.name);
                return Err(bad_link(&self.links[joint.child].name, &what));
            }
        }
        Ok(())
    }
}

fn bad_link(link: &str, what: &str) -> Error {
    Error::Link { link: link.to_owned(), what: what.to_owned() }
}

fn bad_joint(joint: &str, what: &str) -> Error {
    Error::Joint { joint: joint.to_owned(), what: what.to_owned() }
}

fn pose(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let ([x, y, z], [roll, pitch, yaw]) = (pose.xyz.0, pose.rpy.0);
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

fn finite_pose(origin: &urdf_rs::Pose) -> std::result::Result<Isometry3<f64>, String> {
    match origin.xyz.0.iter().chain(&origin.rpy.0).find(|x| !x.is_finite()) {
        Some(bad) => Err(format!("has an origin that holds {bad}; needed: finite numbers")),
        None => Ok(pose(origin)),
    }
}

fn read_motion(joint: &urdf_rs::Joint, index: usize) -> Result<Motion> {
    use urdf_rs::JointType::{Continuous, Fixed, Revolute};
    let fail = |what: &str| Err(bad_joint(&joint.name, what));
    if joint.mimic.is_some() {
        return fail("mimics another joint; needed: a joint of its own, or a fixed one");
    }
    let endless = match joint.joint_type {
        Fixed => return Ok(Motion::Fixed),
        Revolute => false,
        Continuous => true,
        ref other => return fail(&format!("is of type {other:?}; needed: revolute, continuous or fixed")),
    };
    let Some(axis) = Unit::try_new(Vector3::from(joint.axis.xyz.0), 1e-9).filter(|a| a.iter().all(|x| x.is_finite()))
    else {
        return fail(&format!("turns about {:?}; needed: a direction", joint.axis.xyz.0));
    };
    let given = &joint.limit;
    let (lower, upper) = if endless { (-f64::MAX, f64::MAX) } else { (given.lower, given.upper) };
    if lower.is_nan() || upper.is_nan() || lower >= upper {
        return fail(&format!("has limits {lower} to {upper}; needed: a range"));
    }
    for (what, value) in [("velocity", given.velocity), ("effort", given.effort)] {
        if value.is_nan() || value <= 0.0 {
            return fail(&format!("has the {what} limit {value}; needed: a positive number"));
        }
    }
    let limits = Limits { lower, upper, velocity: given.velocity, effort: given.effort };
    Ok(Motion::Revolute { axis, limits, index })
}

fn read_link(link: &urdf_rs::Link, joint: Option<usize>) -> Result<Link> {
    let fail = |what: &str| bad_link(&link.name, what);
    let shapes = link.collision.iter().map(|collision| {
        let place = finite_pose(&collision.origin).map_err(|what| fail(&what))?;
        Ok((read_shape(&collision.geometry).map_err(|what| fail(&what))?, place))
    });
    let inertia = &link.inertial;
    let mass = inertia.mass.value;
    if !mass.is_finite() || mass < 0.0 {
        return Err(fail(&format!("has a mass of {mass}; needed: a number from 0")));
    }
    let inertia = match mass > 0.0 {
        false => None,
        true => {
            let i = &inertia.inertia;
            let own = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
            if own.iter().any(|x| !x.is_finite()) || own.symmetric_eigenvalues().min() <= 0.0 {
                return Err(fail("has an inertia that is not positive; needed: the tensor about its centre of mass"));
            }
            let place = finite_pose(&inertia.origin).map_err(|what| fail(&what))?;
            let turn: Rotation3<f64> = place.rotation.to_rotation_matrix();
            let tensor = turn.matrix() * own * turn.matrix().transpose();
            Some(Inertia { mass, centre: place.translation.vector.into(), tensor })
        }
    };
    Ok(Link { name: link.name.clone(), inertia, shapes: shapes.collect::<Result<_>>()?, joint })
}

fn read_shape(geometry: &urdf_rs::Geometry) -> std::result::Result<Shape, String> {
    use urdf_rs::Geometry::{Box, Capsule, Cylinder, Mesh, Sphere};
    let positive = |what: &str, values: &[f64]| match values.iter().find(|v| !v.is_finite() || **v <= 0.0) {
        Some(bad) => Err(format!("has a {what} of size {bad}; needed: positive numbers")),
        None => Ok(()),
    };
    match geometry {
        Sphere { radius } => positive("sphere", &[*radius]).map(|()| Shape::Sphere { radius: *radius }),
        Box { size } => {
            positive("box", &size.0)?;
            Ok(Shape::Cuboid { half_extents: size.0.map(|x| x / 2.0) })
        }
        Capsule { radius, length } => {
            positive("capsule", &[*radius, *length])?;
            let (a, b) = (Point3::new(0.0, 0.0, -length / 2.0), Point3::new(0.0, 0.0, length / 2.0));
            Ok(Shape::Capsule { a, b, radius: *radius })
        }
        Cylinder { radius, length } => {
            positive("cylinder", &[*radius, *length])?;
            Ok(Shape::Cylinder { half_length: length / 2.0, radius: *radius })
        }
        Mesh { filename, .. } => {
            Err(format!("has the mesh `{filename}` for contacts; needed: a box, sphere, cylinder or capsule"))
        }
    }
}

#[cfg(test)]
#[path = "robot_tests.rs"]
mod tests;
