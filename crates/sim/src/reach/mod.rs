//! The reaching experiment (thesis 4.2): a tutor leads NAO's arm to a sphere and back, a network learns it and drives the arm.

pub mod agent;
pub mod channels;
pub mod recording;
pub mod stage;
pub mod touching;
pub mod tutor;
