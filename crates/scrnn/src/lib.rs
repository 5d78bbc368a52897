//! Predictive learning with uncertainty in recurrent networks.
//!
//! A network sees a sequence sample by sample and predicts, for a sample that is still to come, its mean and its
//! variance. It learns both by maximising the likelihood of what it has seen; the variance is never shown to it. One
//! type of network covers the conventional CTRNN and MTRNN, which predict the mean alone, and the stochastic S-CTRNN and
//! S-MTRNN, which predict both. Equations are numbered as in the thesis that the crate follows; `docs/equations.md` in
//! the repository lists them with their tests.
//!
//! # The model
//!
//! ```text
//! u_t,i <- (1 - 1/tau_i) u_t-1,i + (1/tau_i) (sum_j w_ij x_t,j + sum_j w_ij c_t-1,j + b_i)   context (2.2), (2.27)
//! c_t    = tanh u_t                                                                          context (2.3)
//! y_t    = tanh (W_yc c_t + b_y)                                                             mean (2.2), (2.4)
//! v_t    = exp  (W_vc c_t + b_v)                                                             variance (2.2), (2.5)
//!
//! x_t    = y-hat_{t-xi}                   the input is the sample of xi steps ago
//! ln L   = sum_t,i ln N(y-hat_t,i | y_t,i, v_t,i)                        what learning maximises (2.11)
//! u_0    ~ N(u, sigma^2_IS)               each sequence starts from an initial state of its own (2.13)
//! ```
//!
//! The initial state u_0 is the network's handle: learned for each sequence, it makes one network generate many of them
//! (generation), and it is what is searched for when a new sequence is to be explained (recognition).
//!
//! # Quick start
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use scrnn::learning::EpochReport;
//! use scrnn::*;
//!
//! # fn main() -> Result<()> {
//! // Two waves on one channel, within reach of the mean units, which is -1 to 1.
//! let wave = |name: &str, period: f64| {
//!     let sample = |t: i32| 0.7 * (6.2832 * f64::from(t) / period).sin() + 0.04 * f64::from(t * t).sin();
//!     Sequence::new(name, 1, (0..100).map(sample).collect())
//! };
//! let data = Dataset::new(vec!["y".into()], vec![wave("slow", 25.0)?, wave("fast", 10.0)?])?;
//!
//! // An S-CTRNN: 12 context units with a time constant of 2 steps.
//! let topology = Topology::s_ctrnn(1, 12, 2.0)?;
//! let (network, initial_states) = initialize(&topology, 2, 1);
//! let plan = Plan::with(|plan| {
//!     plan.epochs = 800;
//!     plan.initial_state_variance = 10.0;
//!     plan.optimiser = Optimiser::Adam(Adam::with(|adam| adam.rate = 0.02));
//! });
//! let engine = Engine::serial();
//! let mut learner = Learner::new(network, initial_states, &data, plan, &engine)?;
//! let mut nll = Vec::new();
//! let outcome = learner.run(&mut |report: &EpochReport, _: &Learner| {
//!     nll.extend(report.nll);
//!     ControlFlow::Continue(())
//! });
//! assert_eq!(outcome, Outcome::Finished);
//! assert!(nll[800] < nll[0] - 1.0, "nats per step and channel: {} to {}", nll[0], nll[800]);
//!
//! // Closed loop: from the initial state of "fast" and its first sample, fed with its own noisy predictions.
//! let (network, learned) = (learner.network(), learner.initial_states());
//! let start = Start { initial_state: learned.sequence(1), sensed: data.sequences()[1].sample(0) };
//! let options = GenerationOptions::new(50, Feedback::closed(1, true));
//! let generated = generate(network, &[start], &options, &engine)?;
//! assert_eq!(generated[0].sample.len(), 50);
//! assert!(generated[0].variance.iter().all(|v| *v > 0.0));
//!
//! // Recognition: which initial state explains a sequence, and which learned sequence is it like?
//! let unknown = Dataset::new(vec!["y".into()], vec![data.sequences()[1].truncated(40)])?;
//! let options = RecognitionOptions::with(|options| {
//!     options.starts = 4;
//!     options.epochs = 20;
//! });
//! let recognised = recognize(network, learned, &unknown, &options, &engine)?;
//! assert_eq!(recognised[0].ranking[0].sequence, 1);
//! # Ok(())
//! # }
//! ```
//!
//! # Modules in reading order
//!
//! | module | what it holds | thesis |
//! |---|---|---|
//! | [`topology`], [`parameters`], [`network`] | groups of context units, weights and biases, both together | 2.5, 2.10 |
//! | [`features`] | what is shown of samples, and what outputs are added to: velocity inputs, skip connection | |
//! | [`initial_states`], [`initialization`] | u_0 of each sequence and their mean; random starting values | 2.6.1, 2.7 |
//! | [`dataset`], [`scaling`] | sequences, and their way into the network's range | 2.6.1, 4.2 |
//! | [`kernels`], [`engine`] | products, tanh and exp in SIMD; instruction set and threads | |
//! | [`jobs`] | whole trainings or simulations side by side on the cores | |
//! | [`forward`], [`likelihood`] | the dynamics and their score, each with a plain reference | 2.5, 2.6 |
//! | [`objective`] | the seam: what is climbed, and who computes it | 2.6 |
//! | [`learning`] | momentum ascent, its adaptive rate, Adam; the loop with its observer | 2.6.2, D.1 |
//! | [`generation`], [`recognition`] | open, closed and mixed loop; the search for u_0 | 2.8, 2.9 |
//! | [`error_regression`] | recognition while samples arrive, over a sliding window | 2.10.2 |
//! | [`streams`] | where random numbers come from: a stream for each seed, purpose and index | |
//! | [`evaluation`], [`analysis`] | errors and bounds; components, clusters, calibration, simple models | 3.2.4-3.2.6 |
//! | [`checkpoint`] | a trained network as bytes | |
//! | [`error`] | what can be wrong with a request | |
//!
//! # Features
//!
//! | feature | what it adds | default |
//! |---|---|---|
//! | `rayon` | threads; without it everything runs on the thread that calls | yes |
//! | `checkpoint` | trained networks as safetensors bytes | yes |
//! | `analysis` | components, clusters, calibration, simple models, t-tests | yes |
//! | `serde` | options to and from other formats | |
//! | `schemars` | JSON schemas of the options | |
//!
//! # What holds everywhere
//!
//! - The crate opens no file, prints nothing and reads no clock. Randomness enters as a seed.
//! - The same data, settings and seed give the same bits, whatever the number of threads.
//! - Samples and predictions are in the network's units; [`scaling`] leads to and from the data's own.
//! - Sequences, steps, channels and units count from 0.
//! - A training whose values become non-finite is no error but an [`Outcome`]: it is rolled back to the
//!   last good epoch and says where it happened.

#[cfg(feature = "analysis")]
pub mod analysis;
#[cfg(feature = "checkpoint")]
pub mod checkpoint;
pub mod dataset;
pub mod engine;
pub mod error;
pub mod error_regression;
pub mod evaluation;
pub mod features;
pub mod forward;
pub mod generation;
pub mod initial_states;
pub mod initialization;
pub mod jobs;
#[doc(hidden)]
pub mod kernels;
pub mod learning;
pub mod likelihood;
pub mod network;
pub mod objective;
pub mod parameters;
pub mod recognition;
pub mod scaling;
pub mod streams;
pub mod topology;

#[cfg(feature = "checkpoint")]
pub use checkpoint::Checkpoint;
pub use dataset::{Dataset, Sequence};
pub use engine::{Engine, InstructionSet};
pub use error::{Error, Result};
pub use error_regression::{ErrorRegression, ErrorRegressionOptions};
pub use features::{Skip, SkipKind};
pub use generation::{Feedback, Generated, GenerationOptions, Start, generate};
pub use initial_states::InitialStates;
pub use initialization::initialize;
pub use learning::{Adam, Learner, Momentum, Observer, Optimiser, Outcome, Plan};
pub use network::Network;
pub use recognition::{Recognition, RecognitionOptions, recognize};
pub use scaling::Scaling;
pub use topology::{Group, Prediction, Topology};

mod backward;
mod batch;
mod packed;
mod quasi_newton;
mod skip;
mod stepper;
mod trajectory;
