//! What a network senses and predicts, by channel: which joints, in which order.

use crate::robot::joints::{HEAD, RIGHT_ARM};

/// Channels of the reaching experiment (thesis 4.2.2): where the head looks stands for where the object is, and the arm's
/// joints follow. They are named after the joints, and stand in the order of a one-armed NAO's q.
pub const REACHING: [&str; 6] = [HEAD[0], HEAD[1], RIGHT_ARM[0], RIGHT_ARM[1], RIGHT_ARM[2], RIGHT_ARM[3]];

/// How many of the first channels are vision.
pub const VISION: usize = 2;

/// How many channels follow for the arm.
pub const ARM: usize = 4;
