//! The interaction of two robots (thesis 5.2): one moves an object to the left or to the right, the other follows it.

mod film;
mod follower;
mod interaction;
mod order;

pub use film::Film;
pub use follower::{Branch, ControlStep, Controller, Followed, Outcome, follow, with_own_arm};
pub use interaction::{
    ARM, CHANNELS, Collision, Interaction, InteractionOptions, SensorNoise, arm_postures, record, record_while,
};
pub use order::{
    LEAD_IN, PERIOD, PRIMITIVE, all_orders, branchings, letters, parse_order, primitive_len, random_order, samples,
};
