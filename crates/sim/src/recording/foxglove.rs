//! A scene as Foxglove's messages: bodies as the entities of a `foxglove.SceneUpdate`, frames as `foxglove.FrameTransforms`.
//!
//! Both are protocol buffers. Foxglove reads them also as JSON; rerun does not.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::Links;
use super::wire::Message;
use crate::world::scene::{Body, Part, Scene, Shape};

/// The frame that all others stand in.
pub const WORLD: &str = "world";

/// A `foxglove.SceneUpdate` that shows all bodies.
pub fn scene_update(time: u64, scene: &Scene) -> Vec<u8> {
    let mut update = Message::default();
    for body in &scene.bodies {
        update.message(2, |entity| {
            entity.message(1, |out| timestamp(time, out));
            entity.text(2, WORLD);
            entity.text(3, &body.name);
            // A lifetime of zero: until the entity is replaced.
            entity.message(4, |_| ());
            entity.integer(5, 1);
            primitives(body, entity);
        });
    }
    update.into_bytes()
}

/// A `foxglove.FrameTransforms` of all frames: each in the frame of the link that it hangs on, or in the world.
pub fn frame_transforms(time: u64, scene: &Scene, links: &Links) -> Vec<u8> {
    let mut message = Message::default();
    for frame in &scene.frames {
        let parent = links.parent(&frame.name);
        let parent = parent.and_then(|name| scene.frames.iter().find(|frame| frame.name == name));
        let place = match parent {
            Some(parent) => parent.world_from_frame.inv_mul(&frame.world_from_frame),
            None => frame.world_from_frame,
        };
        message.message(1, |out| {
            out.message(1, |out| timestamp(time, out));
            out.text(2, parent.map_or(WORLD, |parent| &parent.name));
            out.text(3, &frame.name);
            out.message(4, |out| vector(place.translation.vector, out));
            out.message(5, |out| quaternion(place.rotation, out));
        });
    }
    message.into_bytes()
}

fn timestamp(time: u64, out: &mut Message) {
    out.integer(1, time / 1_000_000_000);
    out.integer(2, time % 1_000_000_000);
}

/// The body's shape; the fields are 8 cubes, 9 spheres, 10 cylinders.
fn primitives(body: &Body, entity: &mut Message) {
    let place = body.world_from_shape;
    let color = color(body.part);
    match &body.shape {
        Shape::Cuboid { half_extents: [x, y, z] } => {
            entity.message(8, |out| primitive(place, Vector3::new(*x, *y, *z) * 2.0, color, out));
        }
        Shape::Sphere { radius } => {
            entity.message(9, |out| primitive(place, Vector3::repeat(2.0 * radius), color, out));
        }
        Shape::Capsule { a, b, radius } => {
            for end in [a, b] {
                let place = place * Translation3::from(end.coords);
                entity.message(9, |out| primitive(place, Vector3::repeat(2.0 * radius), color, out));
            }
            let (along, length) = cylinder_from_axis(a, b);
            entity.message(10, |out| cylinder(place * along, *radius, length, color, out));
        }
        Shape::Cylinder { half_length, radius } => {
            entity.message(10, |out| cylinder(place, *radius, 2.0 * half_length, color, out));
        }
    }
}

/// A cylinder around its z axis, as wide at the top as at the bottom.
fn cylinder(place: Isometry3<f64>, radius: f64, length: f64, color: [f64; 4], out: &mut Message) {
    out.message(1, |out| pose(place, out));
    out.message(2, |out| vector(Vector3::new(2.0 * radius, 2.0 * radius, length), out));
    out.double(3, 1.0);
    out.double(4, 1.0);
    out.message(5, |out| rgba(color, out));
}

/// Where a cylinder around its z axis stands that reaches from `a` to `b`, and how long it is.
fn cylinder_from_axis(a: &Point3<f64>, b: &Point3<f64>) -> (Isometry3<f64>, f64) {
    let axis = b - a;
    // Opposite to z, any half turn will do.
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    (Isometry3::from_parts((a + axis / 2.0).coords.into(), rotation), axis.norm())
}

/// A cube or a sphere: pose, size, colour.
fn primitive(place: Isometry3<f64>, size: Vector3<f64>, color: [f64; 4], out: &mut Message) {
    out.message(1, |out| pose(place, out));
    out.message(2, |out| vector(size, out));
    out.message(3, |out| rgba(color, out));
}

fn pose(place: Isometry3<f64>, out: &mut Message) {
    out.message(1, |out| vector(place.translation.vector, out));
    out.message(2, |out| quaternion(place.rotation, out));
}

fn vector(vector: Vector3<f64>, out: &mut Message) {
    for (field, &value) in (1..).zip(vector.iter()) {
        out.double(field, value);
    }
}

fn quaternion(rotation: UnitQuaternion<f64>, out: &mut Message) {
    // nalgebra keeps x, y, z, w in this order.
    for (field, &value) in (1..).zip(rotation.coords.iter()) {
        out.double(field, value);
    }
}

fn rgba(color: [f64; 4], out: &mut Message) {
    for (field, value) in (1..).zip(color) {
        out.double(field, value);
    }
}

fn color(part: Part) -> [f64; 4] {
    match part {
        Part::Robot => [0.85, 0.86, 0.88, 1.0],
        Part::Hand => [0.16, 0.40, 0.75, 1.0],
        Part::OtherRobot => [0.55, 0.58, 0.62, 1.0],
        Part::Object => [0.85, 0.15, 0.12, 1.0],
        Part::Furniture => [0.70, 0.60, 0.46, 1.0],
    }
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
