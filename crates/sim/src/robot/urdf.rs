//! Reads a robot's description from a URDF.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use super::description::{Inertia, Joint, Limits, Link, Motion, Robot, bad_joint, bad_link};
use super::shape::Shape;
use crate::error::{Error, Result};

impl Robot {
    /// Reads a description.
    ///
    /// Shapes for contacts are boxes, spheres and cylinders. A cylinder with a sphere of its radius at either end becomes one
    /// [`Shape::Capsule`], and so does the `<capsule>` that some programs write, though the format does not know it.
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
                            locked_at: None,
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
    let shapes = join_capsules(shapes.collect::<Result<_>>()?);
    Ok(Link { name: link.name.clone(), inertia, shapes, joint })
}

/// How far a sphere may lie off the end of a cylinder and count as its round end, in metres.
const AT_THE_END: f64 = 1e-6;

/// A cylinder with a sphere of its own radius at either end has the surface of a capsule, and becomes one: a description's
/// standard shapes have none, and one body for contacts is cheaper and smoother than three. All other shapes stay, in
/// their order.
fn join_capsules(shapes: Vec<(Shape, Isometry3<f64>)>) -> Vec<(Shape, Isometry3<f64>)> {
    let mut shapes: Vec<Option<(Shape, Isometry3<f64>)>> = shapes.into_iter().map(Some).collect();
    for cylinder in 0..shapes.len() {
        let Some((Shape::Cylinder { half_length, radius }, place)) = shapes[cylinder] else { continue };
        let ends = [-half_length, half_length].map(|z| Point3::new(0.0, 0.0, z));
        let round = |end: &Point3<f64>| {
            shapes.iter().position(|other| match other {
                Some((Shape::Sphere { radius: own }, at)) => {
                    let off = at.translation.vector - (place * end).coords;
                    (own - radius).abs() <= AT_THE_END && off.norm() <= AT_THE_END
                }
                _ => false,
            })
        };
        if let [Some(first), Some(second)] = ends.map(|end| round(&end))
            && first != second
        {
            let [a, b] = ends;
            shapes[cylinder] = Some((Shape::Capsule { a, b, radius }, place));
            (shapes[first], shapes[second]) = (None, None);
        }
    }
    shapes.into_iter().flatten().collect()
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
