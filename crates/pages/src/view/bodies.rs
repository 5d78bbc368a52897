//! Shapes and where they were, picture after picture.

use std::collections::HashMap;

use scrnn_sim::robot::Shape;
use scrnn_sim::robot::looks::Looks;
use serde_json::{Value, json};

/// A shape with its colour, and where it was.
#[derive(Debug, Clone, PartialEq)]
struct Body {
    name: String,
    /// `box`, `sphere` or `cylinder`.
    form: &'static str,
    /// Along x, y and z, in metres.
    size: [f64; 3],
    colour: [f64; 3],
    /// For each picture: x, y, z and the quaternion x, y, z, w.
    places: Vec<[f32; 7]>,
}

/// All shapes of a recording.
#[derive(Debug, Default)]
pub struct Bodies {
    bodies: Vec<Body>,
    index: HashMap<(String, &'static str, usize), usize>,
    times: Vec<i64>,
}

/// A shape of a robot without a colour, and colours of others that follow.
const GREY: [f64; 3] = [0.72, 0.74, 0.77];

impl Bodies {
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    pub fn count(&self) -> usize {
        self.bodies.len()
    }

    pub fn times(&self) -> &[i64] {
        &self.times
    }

    /// Begins a picture; whatever is not in it stays where it was.
    fn begin(&mut self, time: i64) {
        if self.times.last().is_some_and(|last| *last >= time) {
            return;
        }
        self.times.push(time);
        for body in &mut self.bodies {
            if let Some(&last) = body.places.last() {
                body.places.push(last);
            }
        }
    }

    fn put(&mut self, (name, form, k): (&str, &'static str, usize), size: [f64; 3], colour: [f64; 3], place: [f64; 7]) {
        if place.iter().chain(&size).any(|value| !value.is_finite()) || self.times.is_empty() {
            return;
        }
        let place = place.map(|value| value as f32);
        let index = *self.index.entry((name.to_owned(), form, k)).or_insert_with(|| {
            let places = vec![place; self.times.len()];
            self.bodies.push(Body { name: name.to_owned(), form, size, colour, places });
            self.bodies.len() - 1
        });
        if let Some(last) = self.bodies[index].places.last_mut() {
            *last = place;
        }
    }

    /// A `foxglove.SceneUpdate`.
    pub fn scene(&mut self, time: i64, update: &Value) {
        self.begin(time);
        for entity in update["entities"].as_array().into_iter().flatten() {
            let name = entity["id"].as_str().unwrap_or_default();
            for (key, form) in [("cubes", "box"), ("spheres", "sphere"), ("cylinders", "cylinder")] {
                for (k, shape) in entity[key].as_array().into_iter().flatten().enumerate() {
                    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
                    let three = |value: &Value| ["x", "y", "z"].map(|axis| number(&value[axis]));
                    let [x, y, z] = three(&shape["pose"]["position"]);
                    let turn = &shape["pose"]["orientation"];
                    let [i, j, l] = three(turn);
                    let w = number(&turn["w"]);
                    // No rotation at all is how protobuf leaves out what is 0.
                    let w = if [i, j, l, w] == [0.0; 4] { 1.0 } else { w };
                    let colour = ["r", "g", "b"].map(|part| number(&shape["color"][part]));
                    self.put((name, form, k), three(&shape["size"]), colour, [x, y, z, i, j, l, w]);
                }
            }
        }
    }

    /// A robot whose pieces are at these places.
    pub fn posture(&mut self, time: i64, looks: &Looks, places: &[nalgebra::Isometry3<f64>]) {
        self.begin(time);
        for (k, (piece, place)) in looks.pieces.iter().zip(places).enumerate() {
            let colour = piece.colour.unwrap_or(GREY);
            let mut put = |form, part, size, place: nalgebra::Isometry3<f64>| {
                let (at, turn) = (place.translation.vector, place.rotation.coords);
                self.put(
                    (&piece.link, form, 10 * k + part),
                    size,
                    colour,
                    [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w],
                );
            };
            match &piece.shape {
                Shape::Sphere { radius } => put("sphere", 0, [2.0 * radius; 3], *place),
                Shape::Cuboid { half_extents } => put("box", 0, half_extents.map(|half| 2.0 * half), *place),
                Shape::Cylinder { half_length, radius } => {
                    put("cylinder", 0, [2.0 * radius, 2.0 * radius, 2.0 * half_length], *place);
                }
                // A description's capsules lie along z.
                Shape::Capsule { a, b, radius } => {
                    put("sphere", 0, [2.0 * radius; 3], place * nalgebra::Translation3::from(a.coords));
                    put("sphere", 1, [2.0 * radius; 3], place * nalgebra::Translation3::from(b.coords));
                    put("cylinder", 2, [2.0 * radius, 2.0 * radius, (b - a).norm()], *place);
                }
            }
        }
    }

    /// Leaves out pictures until the places of all bodies that move fit into so many bytes. Says how many, where some are.
    pub fn thin_out(&mut self, bytes: usize) -> Option<String> {
        let moving = self.bodies.iter().filter(|body| body.moves()).count();
        let all = moving * self.times.len() * 28;
        if all <= bytes {
            return None;
        }
        let (count, every) = (self.times.len(), all.div_ceil(bytes));
        // The last picture is where the recording ends.
        let kept: Vec<usize> = (0..count).filter(|k| k % every == 0 || k + 1 == count).collect();
        self.times = kept.iter().map(|&k| self.times[k]).collect();
        for body in &mut self.bodies {
            body.places = kept.iter().map(|&k| body.places[k]).collect();
        }
        Some(format!("One of {every} pictures is in the page, so that it stays small: {} of {count}.", kept.len()))
    }

    pub fn json(&self) -> Value {
        let one = |body: &Body| {
            // What never moves is written once.
            let places = if body.moves() { body.places.as_slice() } else { &body.places[..body.places.len().min(1)] };
            let bytes: Vec<u8> = places.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            json!({ "name": body.name, "form": body.form, "size": body.size, "colour": body.colour, "places": base64(&bytes) })
        };
        self.bodies.iter().map(one).collect()
    }
}

impl Body {
    fn moves(&self) -> bool {
        self.places.iter().any(|place| Some(place) != self.places.first())
    }
}

/// Bytes as text (RFC 4648).
pub fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let number = three.iter().fold(0_u32, |number, &byte| number << 8 | u32::from(byte)) << (8 * (3 - three.len()));
        for place in 0..4 {
            match place <= three.len() {
                true => out.push(char::from(LETTERS[(number >> (18 - 6 * place) & 63) as usize])),
                false => out.push('='),
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_written_as_the_standard_says() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xff, 0xfe, 0xfd]), "//79");
    }

    fn scene(x: f64) -> Value {
        json!({ "entities": [
            { "id": "hand", "spheres": [{ "pose": { "position": { "x": x }, "orientation": {} }, "size": { "x": 0.1, "y": 0.1, "z": 0.1 } }] },
            { "id": "bench", "cubes": [{ "size": { "x": 1.0, "y": 1.0, "z": 0.1 } }] },
        ] })
    }

    #[test]
    fn what_never_moves_is_written_once_and_the_last_picture_stays() {
        let mut bodies = Bodies::default();
        for k in 0..101 {
            bodies.scene(k * 1_000, &scene(k as f64));
        }
        assert!(bodies.bodies[0].moves() && !bodies.bodies[1].moves());
        assert_eq!(bodies.json()[1]["places"].as_str().unwrap().len(), 40);
        assert!(bodies.thin_out(28 * 50).unwrap().contains("One of 3 pictures"));
        assert_eq!(bodies.times().last(), Some(&100_000));
        assert_eq!(bodies.bodies[0].places.last().unwrap()[0], 100.0);
        assert!(bodies.bodies[0].places.len() == bodies.times().len() && bodies.bodies[0].places[0][6] == 1.0);
    }
}
