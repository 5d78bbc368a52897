//! The robots of the thesis' experiments in a simulated world, and networks that move them.
//!
//! A [`robot::Robot`] is read from a description and set into a [`world::World`], which moves it by rapier's physics.
//! Everything public is in nalgebra's types, metres, radians, seconds and newtons. Nothing here opens a file, prints, or
//! reads a clock, and the same calls in the same order give the same bits.

pub mod agent;
pub mod camera;
pub mod channels;
pub mod error;
pub mod film;
pub mod follower;
pub mod gaze;
pub mod interaction;
pub mod joints;
pub mod kinematics;
pub mod nao;
pub mod parallel;
pub mod reaching;
pub mod reaching_recording;
pub mod recording;
pub mod robot;
pub mod scene;
pub mod touching;
pub mod tutor;
pub mod world;

mod articulation;
#[cfg(test)]
mod description_tests;
