//! The robots of the thesis' experiments in a simulated world, and networks that move them.
//!
//! | module | what it holds | stands on |
//! |---|---|---|
//! | [`robot`] | a robot from its URDF: links, joints, kinematics, cameras, gaze; NAO | |
//! | [`world`] | robots and things, moved by rapier; contacts; what there is to see | `robot` |
//! | [`recording`] | what happened, as an MCAP file | `world` |
//! | [`reach`] | NAO learns to touch a sphere (thesis 4.2) | all of them |
//! | [`interact`] | two NAOs, one follows the other (thesis 5.2) | all of them |
//!
//! A [`robot::Robot`] is read from a description and set into a [`world::World`], which moves it by rapier's physics.
//! Everything public is in nalgebra's types, metres, radians, seconds and newtons. Nothing here opens a file, prints, or
//! reads a clock, and the same calls in the same order give the same bits.

pub mod error;
pub mod interact;
pub mod reach;
pub mod recording;
pub mod robot;
pub mod world;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
