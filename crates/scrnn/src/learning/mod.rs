//! Predictive learning (thesis 2.6): evaluate the objective, ascend, again.
//!
//! Shared parameters ascend ln L_out, initial states and their mean ln L_all = ln L_out + ln L_init.

mod adam;
mod batches;
mod divergence;
mod guard;
mod lbfgs;
mod learner;
mod momentum;
mod non_centred;
mod plan;
mod state;

pub use divergence::Divergence;
pub use guard::Recovery;
pub use learner::{EpochReport, Learner, Observer, Outcome};
pub use plan::{Adam, AdaptiveRate, ClosedLoop, Lbfgs, Momentum, OnDivergence, Optimiser, Plan, PriorStep};
pub use state::{OptimiserState, StateTensor};

#[cfg(test)]
mod extremes_tests;
#[cfg(test)]
mod tests;
