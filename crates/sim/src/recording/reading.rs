//! Reads a recording back, for tests: the last joints and frames in it.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;

use crate::robot::Robot;

/// The last `/joint_states` and the last `/transforms`.
#[derive(Debug, Default)]
pub struct Last {
    /// Position by name.
    pub joints: BTreeMap<String, f64>,
    /// For each frame, the one that it hangs in, and its place there.
    frames: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl Last {
    pub fn of(bytes: &[u8]) -> Self {
        let mut last = Self::default();
        for message in mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap) {
            match message.channel.topic.as_str() {
                "/joint_states" => {
                    let value: Value = serde_json::from_slice(&message.data).unwrap();
                    let joint =
                        |one: &Value| (one["name"].as_str().unwrap().to_owned(), one["position"].as_f64().unwrap());
                    last.joints = value["joints"].as_array().unwrap().iter().map(joint).collect();
                }
                "/transforms" => last.frames = fields(&message.data).into_iter().map(|(_, one)| frame(one)).collect(),
                _ => {}
            }
        }
        last
    }

    fn world_from(&self, frame: &str) -> Isometry3<f64> {
        match self.frames.get(frame) {
            Some((parent, place)) => self.world_from(parent) * place,
            None => Isometry3::identity(),
        }
    }

    /// How far the links of a robot, placed by its description and the joint states, are from their frames at most, in
    /// metres. Frames begin with `links`, names of joints with `joints`.
    pub fn farthest(&self, robot: &Robot, links: &str, joints: &str) -> f64 {
        let angle = |name: &&str| {
            *self.joints.get(&format!("{joints}{name}")).unwrap_or_else(|| panic!("`{joints}{name}` is left out"))
        };
        let q: Vec<f64> = robot.joint_names().iter().map(angle).collect();
        let root = self.world_from(&format!("{links}{}", robot.links[0].name));
        let off = |(link, place): (&crate::robot::Link, Isometry3<f64>)| {
            let name = format!("{links}{}", link.name);
            assert!(self.frames.contains_key(&name), "no frame `{name}`");
            (self.world_from(&name).translation.vector - (root * place).translation.vector).norm()
        };
        robot.links.iter().zip(robot.forward(&q).unwrap()).map(off).fold(0.0, f64::max)
    }
}

/// Child, parent and place of a `foxglove.FrameTransform`.
fn frame(bytes: &[u8]) -> (String, (String, Isometry3<f64>)) {
    let (mut names, mut numbers) = ([String::new(), String::new()], [[0.0; 4]; 2]);
    for (field, value) in fields(bytes) {
        match field {
            2 | 3 => names[field as usize - 2] = String::from_utf8(value.to_vec()).unwrap(),
            4 | 5 => {
                for (axis, bytes) in fields(value) {
                    numbers[field as usize - 4][axis as usize - 1] = f64::from_le_bytes(bytes.try_into().unwrap());
                }
            }
            _ => {}
        }
    }
    let ([parent, child], [[x, y, z, _], [i, j, k, w]]) = (names, numbers);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    (child, (parent, Isometry3::from_parts(Translation3::new(x, y, z), turn)))
}

/// Number and bytes of each field that is text, a message or a double; integers are passed over.
fn fields(mut bytes: &[u8]) -> Vec<(u64, &[u8])> {
    fn varint(bytes: &mut &[u8]) -> u64 {
        let mut value = 0;
        for shift in (0..).step_by(7) {
            let (&first, rest) = bytes.split_first().unwrap();
            *bytes = rest;
            value |= u64::from(first & 0x7f) << shift;
            if first < 0x80 {
                break;
            }
        }
        value
    }
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        let length = match key & 7 {
            0 => {
                varint(&mut bytes);
                continue;
            }
            1 => 8,
            2 => varint(&mut bytes) as usize,
            other => panic!("a field of layout {other}"),
        };
        let (value, rest) = bytes.split_at(length);
        found.push((key >> 3, value));
        bytes = rest;
    }
    found
}
