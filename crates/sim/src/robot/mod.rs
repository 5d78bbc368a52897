//! A robot as its description says it: links, joints, shapes, kinematics, cameras and gaze; and NAO.

pub mod camera;
pub mod gaze;
pub mod joints;
pub mod kinematics;
pub mod looks;
pub mod nao;

mod description;
mod shape;
mod urdf;

#[cfg(test)]
mod damaged_tests;

pub use description::{Inertia, Joint, Limits, Link, Motion, Robot};
pub use shape::Shape;
