//! What there is to see at one moment: shapes with their places. Recordings and pictures are made from it.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

pub use crate::robot::Shape;

/// What a body is, for its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A robot that a network or a tutor moves.
    Robot,
    /// Its hand.
    Hand,
    /// The other robot of an interaction.
    OtherRobot,
    /// The object to touch or to follow.
    Object,
    /// What stands around.
    Furniture,
}

impl Part {
    /// Red, green, blue and opacity, each from 0 to 1.
    #[must_use]
    pub fn colour(self) -> [f64; 4] {
        match self {
            Self::Robot => [0.85, 0.86, 0.88, 1.0],
            Self::Hand => [0.16, 0.40, 0.75, 1.0],
            Self::OtherRobot => [0.55, 0.58, 0.62, 1.0],
            Self::Object => [0.85, 0.15, 0.12, 1.0],
            Self::Furniture => [0.70, 0.60, 0.46, 1.0],
        }
    }
}

/// A form that everybody can draw, of size 1 around the origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A box.
    Cuboid,
    /// A ball.
    Sphere,
    /// Around its z axis, as wide at the top as at the bottom.
    Cylinder,
}

/// A form with its size and its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Primitive {
    /// What is drawn.
    pub form: Form,
    /// Along x, y and z of the form's frame, in metres.
    pub size: [f64; 3],
    /// Leads from the form's frame to the world.
    pub world_from_form: Isometry3<f64>,
}

/// A shape in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Unique in its scene, e.g. `self/r_forearm`.
    pub name: String,
    /// What it is.
    pub part: Part,
    /// Its form.
    pub shape: Shape,
    /// Leads from the shape's frame to the world.
    pub world_from_shape: Isometry3<f64>,
}

impl Body {
    /// The forms that draw it: one, or the two ends and the middle of a capsule.
    #[must_use]
    pub fn primitives(&self) -> Vec<Primitive> {
        let place = self.world_from_shape;
        let one = |form, size, world_from_form| Primitive { form, size, world_from_form };
        match &self.shape {
            Shape::Cuboid { half_extents } => vec![one(Form::Cuboid, half_extents.map(|half| 2.0 * half), place)],
            Shape::Sphere { radius } => vec![one(Form::Sphere, [2.0 * radius; 3], place)],
            Shape::Capsule { a, b, radius } => {
                let (along, length) = cylinder_from_axis(a, b);
                let end =
                    |at: &Point3<f64>| one(Form::Sphere, [2.0 * radius; 3], place * Translation3::from(at.coords));
                vec![end(a), end(b), one(Form::Cylinder, [2.0 * radius, 2.0 * radius, length], place * along)]
            }
            Shape::Cylinder { half_length, radius } => {
                vec![one(Form::Cylinder, [2.0 * radius, 2.0 * radius, 2.0 * half_length], place)]
            }
        }
    }
}

/// Where a cylinder around its z axis stands that reaches from `a` to `b`, and how long it is.
fn cylinder_from_axis(a: &Point3<f64>, b: &Point3<f64>) -> (Isometry3<f64>, f64) {
    let axis = b - a;
    // Opposite to z, any half turn will do.
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    (Isometry3::from_parts((a + axis / 2.0).coords.into(), rotation), axis.norm())
}

/// A frame of reference, e.g. of a link, in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Unique in its scene, e.g. `self/r_hand`; links are named as in the robot's description.
    pub name: String,
    /// Leads from the frame to the world.
    pub world_from_frame: Isometry3<f64>,
}

/// All bodies and frames of one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// What can be seen.
    pub bodies: Vec<Body>,
    /// Frames of all links.
    pub frames: Vec<Frame>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cylinder_reaches_from_end_to_end_whatever_its_direction() {
        let origin = Point3::new(0.1, -0.2, 0.3);
        for direction in [[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [3.0, 0.0, 0.0], [1.0, -2.0, 0.5]] {
            let other = origin + Vector3::from(direction);
            let (place, length) = cylinder_from_axis(&origin, &other);
            let ends = [-0.5, 0.5].map(|half| place * Point3::new(0.0, 0.0, half * length));
            assert!((ends[0] - origin).norm() < 1e-12 && (ends[1] - other).norm() < 1e-12, "{direction:?}: {ends:?}");
        }
        // A capsule without length is a sphere; its cylinder has no direction, but numbers.
        let (place, length) = cylinder_from_axis(&origin, &origin);
        assert!(length == 0.0 && place.rotation.coords.iter().all(|value| value.is_finite()));
    }
}
