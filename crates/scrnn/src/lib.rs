//! Predictive learning with uncertainty in recurrent networks.
pub mod dataset;
pub mod error;
pub mod initial_states;
pub mod parameters;
pub mod scaling;
pub mod topology;
