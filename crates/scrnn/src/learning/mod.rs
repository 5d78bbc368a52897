//! Predictive learning (thesis 2.6): evaluate the objective, ascend, again.
//!
//! Shared parameters ascend ln L_out, initial states and their mean ln L_all = ln L_out + ln L_init.

mod adam;
mod divergence;
mod learner;
mod momentum;
mod plan;
mod state;

pub use divergence::Divergence;
pub use learner::{Control, EpochReport, Learner, Observer, Outcome};
pub use plan::{Adam, AdaptiveRate, Momentum, Optimiser, Plan, PriorStep};

#[cfg(test)]
mod tests;
