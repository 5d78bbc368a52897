//! A robot's description: links with masses and shapes, joints with limits.
//!
//! Joints turn about an axis or hold still. Links and joints are kept in an order in which every parent comes before its
//! children. The angles of the movable joints, in the order of the description, are the robot's q.

use nalgebra::{Isometry3, Matrix3, Point3, Unit, UnitQuaternion, Vector3};

use super::shape::Shape;
use crate::error::{Error, Result};

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
    /// The angle at which [`Robot::lock`] holds it, of a joint that the description calls movable.
    pub locked_at: Option<f64>,
}

/// A tree of links.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// As its description calls it.
    pub name: String,
    /// The first is the root.
    pub(crate) links: Vec<Link>,
    /// Sorted: a joint's parent link comes before its child link.
    pub(crate) joints: Vec<Joint>,
    /// For each angle of q, the index of its joint.
    pub(super) movable: Vec<usize>,
    /// Pairs of links that may overlap, beyond those that a joint connects; see [`Robot::ignore_contacts`].
    pub(crate) ignored: Vec<(usize, usize)>,
}

impl Robot {
    /// All links. The first is the root.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints, sorted: a joint's parent link comes before its child link.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
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

    /// Name and angle of every joint that the description calls movable: those of q, and those that are
    /// [locked](Robot::lock). Without a world, these place all links.
    #[must_use]
    pub fn all_angles(&self, q: &[f64]) -> Vec<(&str, f64)> {
        let angle = |joint: &Joint| match joint.motion {
            Motion::Revolute { index, .. } => q.get(index).copied(),
            Motion::Fixed => joint.locked_at,
        };
        self.joints.iter().filter_map(|joint| Some((joint.name.as_str(), angle(joint)?))).collect()
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
    /// # Errors
    /// [`Error::NoSuch`] if there is no such angle.
    pub fn limits(&self, index: usize) -> Result<Limits> {
        let limits = self.movable().nth(index).map(|(_, limits)| limits);
        limits.ok_or(Error::NoSuch { what: "movable joint", index, count: self.dof() })
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
        let Limits { lower, upper, .. } = self.limits(index)?;
        if !(lower..=upper).contains(&angle) {
            return Err(bad_joint(name, &format!("cannot be locked at {angle} rad; needed: {lower} to {upper}")));
        }
        let joint = &mut self.joints[self.movable.remove(index)];
        if let Motion::Revolute { axis, .. } = joint.motion {
            joint.parent_from_joint *= UnitQuaternion::from_axis_angle(&axis, angle);
        }
        joint.motion = Motion::Fixed;
        joint.locked_at = Some(angle);
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
    pub(crate) fn may_overlap(&self, a: usize, b: usize) -> bool {
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
    pub(crate) fn group(&self, link: usize) -> usize {
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
    pub(super) fn check_masses(&self) -> Result<()> {
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

pub(super) fn bad_link(link: &str, what: &str) -> Error {
    Error::Link { link: link.to_owned(), what: what.to_owned() }
}

pub(super) fn bad_joint(joint: &str, what: &str) -> Error {
    Error::Joint { joint: joint.to_owned(), what: what.to_owned() }
}

#[cfg(test)]
#[path = "description_tests.rs"]
mod tests;
