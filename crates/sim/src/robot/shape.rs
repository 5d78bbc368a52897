//! Simple shapes, for contacts and for pictures.

use nalgebra::Point3;

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
