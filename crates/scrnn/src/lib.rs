//! Predictive learning with uncertainty in recurrent networks.

pub mod checkpoint;
pub mod dataset;
pub mod engine;
pub mod error;
pub mod evaluation;
pub mod forward;
pub mod generation;
pub mod initial_states;
pub mod initialization;
pub mod kernels;
pub mod learning;
pub mod likelihood;
pub mod network;
pub mod parameters;
pub mod recognition;
pub mod scaling;
pub mod tasks;
pub mod topology;

mod backward;
mod batch;
mod objective;
mod packed;
mod stepper;
mod trajectory;
