//! What a robot looks like, for pictures alone: any URDF, with what it says is to be seen, or else its shapes for contacts.
//!
//! A [`super::Robot`] is for a simulation and refuses what that cannot do. Here joints may slide, and may follow others; meshes are
//! left out and counted; a joint that is not known of stays at 0.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use super::shape::Shape;
use crate::error::{Error, Result};

/// A shape on a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// The link's name.
    pub link: String,
    /// Its form.
    pub shape: Shape,
    /// Red, green, blue, from 0 to 1, where the description says so.
    pub colour: Option<[f64; 3]>,
    /// Of its link, an index.
    of: usize,
    link_from_shape: Isometry3<f64>,
}

#[derive(Debug, Clone, PartialEq)]
struct Joint {
    name: String,
    parent: usize,
    child: usize,
    parent_from_joint: Isometry3<f64>,
    motion: Motion,
    /// Another joint whose angle it takes, times a factor, plus an offset.
    mimics: Option<(String, f64, f64)>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    Still,
    Turns(Unit<Vector3<f64>>),
    Slides(Unit<Vector3<f64>>),
}

/// What there is to see of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Looks {
    /// As its description calls it.
    pub name: String,
    /// All shapes.
    pub pieces: Vec<Piece>,
    /// Shapes that are meshes, which are not shown.
    pub meshes: usize,
    /// Joints that move in a way that is not shown: planar and floating ones.
    pub still: Vec<String>,
    links: usize,
    /// Sorted: a joint's parent comes before its child.
    joints: Vec<Joint>,
}

impl Looks {
    /// Reads a description.
    ///
    /// # Errors
    /// [`Error::Unreadable`] for what is no URDF, or whose joints form a ring.
    pub fn from_urdf(text: &str) -> Result<Self> {
        let urdf = urdf_rs::read_from_string(text).map_err(|error| Error::Unreadable(error.to_string()))?;
        let index: HashMap<&str, usize> =
            urdf.links.iter().enumerate().map(|(k, link)| (link.name.as_str(), k)).collect();
        let materials: HashMap<&str, [f64; 3]> = urdf
            .materials
            .iter()
            .filter_map(|material| {
                let [r, g, b, _] = material.color.as_ref()?.rgba.0;
                Some((material.name.as_str(), [r, g, b]))
            })
            .collect();
        let (mut pieces, mut meshes) = (Vec::new(), 0);
        for (of, link) in urdf.links.iter().enumerate() {
            let seen = link.visual.iter().map(|visual| {
                let material = visual.material.as_ref();
                let own = material.and_then(|material| material.color.as_ref()).map(|color| {
                    let [r, g, b, _] = color.rgba.0;
                    [r, g, b]
                });
                let named = || materials.get(material?.name.as_str()).copied();
                (&visual.geometry, &visual.origin, own.or_else(named))
            });
            let touched = link.collision.iter().map(|collision| (&collision.geometry, &collision.origin, None));
            let seen: Vec<_> = seen.collect();
            let are_meshes = seen.iter().all(|(geometry, ..)| matches!(geometry, urdf_rs::Geometry::Mesh { .. }));
            meshes += seen.iter().filter(|(geometry, ..)| matches!(geometry, urdf_rs::Geometry::Mesh { .. })).count();
            // Simple shapes for contacts stand in for meshes, and for what nobody described.
            let shown: Vec<_> = if are_meshes { touched.collect() } else { seen };
            for (geometry, origin, colour) in shown {
                if let Some(shape) = shape(geometry) {
                    pieces.push(Piece { link: link.name.clone(), shape, colour, of, link_from_shape: pose(origin)? });
                }
            }
        }
        let mut joints = Vec::new();
        let mut still = Vec::new();
        for joint in &urdf.joints {
            let ends = (index.get(joint.parent.link.as_str()), index.get(joint.child.link.as_str()));
            let (Some(&parent), Some(&child)) = ends else {
                return Err(Error::Unreadable(format!("joint `{}` names a link that is not described", joint.name)));
            };
            let axis =
                Unit::try_new(Vector3::from(joint.axis.xyz.0), 1e-9).filter(|axis| axis.iter().all(|x| x.is_finite()));
            let motion = match (&joint.joint_type, axis) {
                (urdf_rs::JointType::Revolute | urdf_rs::JointType::Continuous, Some(axis)) => Motion::Turns(axis),
                (urdf_rs::JointType::Prismatic, Some(axis)) => Motion::Slides(axis),
                (urdf_rs::JointType::Fixed, _) => Motion::Still,
                _ => {
                    still.push(joint.name.clone());
                    Motion::Still
                }
            };
            let mimics = joint
                .mimic
                .as_ref()
                .map(|other| (other.joint.clone(), other.multiplier.unwrap_or(1.0), other.offset.unwrap_or(0.0)));
            let parent_from_joint = pose(&joint.origin)?;
            joints.push(Joint { name: joint.name.clone(), parent, child, parent_from_joint, motion, mimics });
        }
        let links = urdf.links.len();
        Ok(Self { name: urdf.name.clone(), pieces, meshes, still, links, joints: sorted(joints, links)? })
    }

    /// Names of the joints that move.
    pub fn joints(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().filter(|joint| joint.motion != Motion::Still).map(|joint| joint.name.as_str())
    }

    /// Where each piece is in the frame of the robot's root, with these joints at these places, in rad or m.
    #[must_use]
    pub fn places(&self, at: &BTreeMap<String, f64>) -> Vec<Isometry3<f64>> {
        let known = |name: &str| at.get(name).copied().filter(|value| value.is_finite()).unwrap_or(0.0);
        let mut root_from_link = vec![Isometry3::identity(); self.links];
        for joint in &self.joints {
            let value = match &joint.mimics {
                Some((other, factor, offset)) if !at.contains_key(&joint.name) => factor * known(other) + offset,
                _ => known(&joint.name),
            };
            let moved = match joint.motion {
                Motion::Still => Isometry3::identity(),
                Motion::Turns(axis) => {
                    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, value))
                }
                Motion::Slides(axis) => Translation3::from(axis.into_inner() * value).into(),
            };
            root_from_link[joint.child] = root_from_link[joint.parent] * joint.parent_from_joint * moved;
        }
        self.pieces.iter().map(|piece| root_from_link[piece.of] * piece.link_from_shape).collect()
    }
}

/// Joints in an order in which every parent comes before its children.
fn sorted(mut open: Vec<Joint>, links: usize) -> Result<Vec<Joint>> {
    let mut hangs = vec![false; links];
    open.iter().for_each(|joint| hangs[joint.child] = true);
    let mut reached: Vec<bool> = hangs.iter().map(|hangs| !hangs).collect();
    let mut joints = Vec::with_capacity(open.len());
    while !open.is_empty() {
        let (now, later): (Vec<Joint>, Vec<Joint>) = open.into_iter().partition(|joint| reached[joint.parent]);
        if now.is_empty() {
            return Err(Error::Unreadable(format!(
                "joint `{}` does not hang on the root: joints form a ring",
                later[0].name
            )));
        }
        now.iter().for_each(|joint| reached[joint.child] = true);
        joints.extend(now);
        open = later;
    }
    Ok(joints)
}

fn pose(pose: &urdf_rs::Pose) -> Result<Isometry3<f64>> {
    let ([x, y, z], [roll, pitch, yaw]) = (pose.xyz.0, pose.rpy.0);
    match [x, y, z, roll, pitch, yaw].iter().find(|value| !value.is_finite()) {
        Some(bad) => Err(Error::Unreadable(format!("an origin holds {bad}; needed: finite numbers"))),
        None => {
            Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
        }
    }
}

/// None for a mesh, and for what has no size.
fn shape(geometry: &urdf_rs::Geometry) -> Option<Shape> {
    use nalgebra::Point3;
    let sound = |sizes: &[f64]| sizes.iter().all(|size| size.is_finite() && *size > 0.0);
    match geometry {
        urdf_rs::Geometry::Sphere { radius } => sound(&[*radius]).then_some(Shape::Sphere { radius: *radius }),
        urdf_rs::Geometry::Box { size } => {
            sound(&size.0).then(|| Shape::Cuboid { half_extents: size.0.map(|x| x / 2.0) })
        }
        urdf_rs::Geometry::Cylinder { radius, length } => {
            sound(&[*radius, *length]).then_some(Shape::Cylinder { half_length: length / 2.0, radius: *radius })
        }
        urdf_rs::Geometry::Capsule { radius, length } => {
            let (a, b) = (Point3::new(0.0, 0.0, -length / 2.0), Point3::new(0.0, 0.0, length / 2.0));
            sound(&[*radius, *length]).then_some(Shape::Capsule { a, b, radius: *radius })
        }
        urdf_rs::Geometry::Mesh { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<robot name="arm"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry><material name="red"/></visual></link>
<link name="rail"><visual><geometry><mesh filename="rail.stl"/></geometry></visual></link>
<link name="upper"><visual><origin xyz="0.5 0 0"/><geometry><cylinder radius="0.05" length="1"/></geometry></visual></link>
<link name="finger"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="rail"/><child link="upper"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="base"/><child link="rail"/><axis xyz="0 1 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="grip" type="revolute"><parent link="upper"/><child link="finger"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/><mimic joint="turn" multiplier="-1"/></joint></robot>"#;

    #[test]
    fn any_robot_is_placed_by_its_joints_and_meshes_are_counted() {
        let looks = Looks::from_urdf(ARM).unwrap();
        let links: Vec<&str> = looks.pieces.iter().map(|piece| piece.link.as_str()).collect();
        assert_eq!((links, looks.meshes), (vec!["base", "upper", "finger"], 1));
        assert_eq!(looks.pieces[0].colour, Some([1.0, 0.0, 0.0]));
        assert_eq!(looks.joints().collect::<Vec<_>>(), ["slide", "turn", "grip"]);
        let at = BTreeMap::from([("slide".to_owned(), 0.3), ("turn".to_owned(), std::f64::consts::FRAC_PI_2)]);
        let places = looks.places(&at);
        let near =
            |k: usize, expected: [f64; 3]| (places[k].translation.vector - Vector3::from(expected)).norm() < 1e-12;
        assert!(near(0, [0.0; 3]) && near(1, [0.0, 0.8, 0.0]) && near(2, [0.0, 1.3, 0.0]), "{places:?}");
        // The finger follows the other way, and points where the base does.
        assert!(places[2].rotation.angle() < 1e-12);
        // Joints that nobody knows of stay at 0.
        assert!((looks.places(&BTreeMap::new())[2].translation.vector - Vector3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn the_nao_is_placed_as_the_simulation_places_it() {
        let (looks, robot) = (Looks::from_urdf(super::super::nao::URDF).unwrap(), super::super::nao::robot());
        let q: Vec<f64> = robot.movable().map(|(_, limits)| 0.3 * limits.lower + 0.7 * limits.upper).collect();
        let at = robot.all_angles(&q).into_iter().map(|(name, angle)| (name.to_owned(), angle)).collect();
        let frames = robot.forward(&q).unwrap();
        for (piece, place) in looks.pieces.iter().zip(looks.places(&at)) {
            let link = frames[robot.link(&piece.link).unwrap()];
            let off = (link * piece.link_from_shape).translation.vector - place.translation.vector;
            assert!(off.norm() < 1e-9, "{}: {off}", piece.link);
        }
    }

    #[test]
    fn what_is_no_robot_is_refused() {
        for text in ["", "<robot", "hello", &ARM.replace("xyz=\"1 0 0\"", "xyz=\"1 nan 0\"")] {
            assert!(matches!(Looks::from_urdf(text), Err(Error::Unreadable(_))));
        }
    }
}
