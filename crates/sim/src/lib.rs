//! The robots of the thesis' experiments in a simulated world, and networks that move them.
//!
//! A [`robot::Robot`] is read from a description and set into a [`world::World`], which moves it by rapier's physics.
//! Everything public is in nalgebra's types, metres, radians, seconds and newtons. Nothing here opens a file, prints, or
//! reads a clock, and the same calls in the same order give the same bits.

pub mod camera;
#[cfg(test)]
mod description_tests;
pub mod error;
pub mod gaze;
pub mod interaction;
pub mod joints;
pub mod kinematics;
pub mod nao;
pub mod recording;
pub mod robot;
pub mod scene;
pub mod world;

mod articulation;
