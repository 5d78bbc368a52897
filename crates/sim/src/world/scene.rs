//! What there is to see at one moment: shapes with their places. Recordings and pictures are made from it.

use nalgebra::Isometry3;

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
