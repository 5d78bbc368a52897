//! What there is to see at one moment: shapes with their places. Recordings and pictures are made from it.

use nalgebra::{Isometry3, Point3};

/// A simple body, in a frame of its own.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Around the origin.
    Sphere {
        /// In metres.
        radius: f64,
    },
    /// A cylinder with round ends.
    Capsule {
        /// Centre of one end, in metres.
        a: Point3<f64>,
        /// Centre of the other end, in metres.
        b: Point3<f64>,
        /// In metres.
        radius: f64,
    },
    /// Around the origin, along z.
    Cylinder {
        /// Half of its length, in metres.
        half_length: f64,
        /// In metres.
        radius: f64,
    },
    /// A box around the origin.
    Cuboid {
        /// Half of its size along x, y and z, in metres.
        half_extents: [f64; 3],
    },
}

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
