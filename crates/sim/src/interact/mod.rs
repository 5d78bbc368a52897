//! The interaction of two robots (thesis 5.2): one moves an object to the left or to the right, the other follows it.

pub mod film;
pub mod follower;
pub mod interaction;
