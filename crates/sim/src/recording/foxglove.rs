//! A scene as Foxglove's messages: bodies as the entities of a `foxglove.SceneUpdate`, frames as `foxglove.FrameTransforms`.
//!
//! Both are protocol buffers. Foxglove reads them also as JSON; rerun does not.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::Links;
use super::wire::Message;
use crate::world::scene::{Body, Form, Primitive, Scene};

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

/// The body's forms; the fields are 8 cubes, 9 spheres, 10 cylinders.
fn primitives(body: &Body, entity: &mut Message) {
    let color = body.part.colour();
    for Primitive { form, size, world_from_form } in body.primitives() {
        let field = match form {
            Form::Cuboid => 8,
            Form::Sphere => 9,
            Form::Cylinder => 10,
        };
        entity.message(field, |out| {
            out.message(1, |out| pose(world_from_form, out));
            out.message(2, |out| vector(size.into(), out));
            if form == Form::Cylinder {
                // As wide at the bottom as at the top.
                out.double(3, 1.0);
                out.double(4, 1.0);
                out.message(5, |out| rgba(color, out));
            } else {
                out.message(3, |out| rgba(color, out));
            }
        });
    }
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
