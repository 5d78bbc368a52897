//! The robots of the thesis' experiments in a simulated world, and networks that move them.

pub mod recording;
pub mod scene;
