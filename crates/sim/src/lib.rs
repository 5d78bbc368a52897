//! The robots of the thesis' experiments in a simulated world, and networks that move them.
//!
//! A [`robot::Robot`] is read from a description and set into a [`world::World`], which moves it by rapier's physics.
//! Everything public is in nalgebra's types, metres, radians, seconds and newtons. Nothing here opens a file, prints, or
//! reads a clock, and the same calls in the same order give the same bits.

pub mod error;
pub mod interact;
pub mod parallel;
pub mod reach;
pub mod recording;
pub mod robot;
pub mod world;

// The paths before the modules had folders, for callers that still use them.
#[doc(hidden)]
pub use interact::{film, follower, interaction};
#[doc(hidden)]
pub use reach::{agent, channels, recording as reaching_recording, stage as reaching, touching, tutor};
#[doc(hidden)]
pub use robot::{camera, gaze, joints, kinematics, nao};
#[doc(hidden)]
pub use world::scene;
