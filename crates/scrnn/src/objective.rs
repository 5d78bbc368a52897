//! What learning and recognition climb, and its gradient: the seam where another way to compute can be put in.
//!
//! ```text
//! ln L_out(theta) and d ln L_out / d theta_share, d ln L_out / d u_0     (2.11), (2.20)-(2.22)
//! ```
//!
//! [`crate::learning::Learner`] and [`crate::recognition::recognize`] ask a [`Backend`] for an [`Objective`] of their data
//! and know nothing else of how it is computed. [`crate::engine::Engine`] is the backend of this crate: float64 on the
//! processor's cores, the same bits for any number of threads and any instruction set. A graphics card, single
//! precision, or several machines are other backends. Which runs belong together (a batch, the starts of a recognition)
//! is said anew at each evaluation, so that an objective needs room for the largest of them only.

use std::fmt;

use crate::dataset::Dataset;
use crate::error::Result;
use crate::parameters::{Gradients, Parameters};
use crate::topology::Topology;

mod closed;
mod cpu;
mod relay;
mod taught;

/// Makes objectives.
pub trait Backend {
    /// An objective of the requested network and data.
    ///
    /// # Errors
    /// What the backend cannot compute, and data that do not fit the network.
    fn objective(&self, request: &Request<'_>) -> Result<Box<dyn Objective>>;
}

/// What an objective is asked for.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Request<'a> {
    /// The network's sizes and constants. What a backend does not know of them it must refuse.
    pub topology: &'a Topology,
    /// The sequences, in the network's units. Cloning them copies no sample.
    pub data: &'a Dataset,
    /// Trade a second forward pass for memory that grows with the square root of the length, where the backend can.
    pub recompute: bool,
    /// How runs that go on in a closed loop count. A backend that cannot run them must refuse.
    pub closed_loop: Option<ClosedLoopTerm>,
    /// What states and products are computed in. A backend that has one way only may take it, and says which by
    /// [`Objective::numerics`].
    pub precision: Precision,
}

/// The numbers that states, weights and their products are computed in. The likelihood, and sums over a whole sequence, are float64
/// in any case, and so are runs that go step by step: in a closed loop, or past missing values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum Precision {
    /// float64.
    #[default]
    F64,
    /// float32: faster, with gradients to some six digits. Its bits differ from those of float64, and are the same for any number of
    /// threads and any instruction set, too.
    F32,
}

/// The likelihood of closed loops: what the network predicts of a sequence when it runs on what it predicted itself.
///
/// ```text
/// x_t = y_t + sqrt(v_t) e_t   from some step on, in K copies that differ in e alone
/// M = mean_k y_k,   V = mean_k v_k + sum_k (y_k - M)^2 / (K - 1)
/// weight * ln N(y-hat | M, V)   in place of ln N(y-hat | y, v)
/// ```
///
/// The gradient runs through the copies' own inputs, their noise included.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ClosedLoopTerm {
    /// K.
    pub copies: usize,
    /// What a step in the closed loop counts; a taught one counts 1.
    pub weight: f64,
}

impl ClosedLoopTerm {
    /// So many copies, at this weight.
    #[must_use]
    pub fn new(copies: usize, weight: f64) -> Self {
        Self { copies, weight }
    }
}

/// Where a run leaves the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Release {
    /// The first step whose input is the network's own, counted from 0 and at least xi.
    pub step: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl Release {
    /// From this step on, with noise of this seed.
    #[must_use]
    pub fn new(step: usize, seed: u64) -> Self {
        Self { step, seed }
    }
}

impl<'a> Request<'a> {
    /// Without recomputation.
    #[must_use]
    pub fn new(topology: &'a Topology, data: &'a Dataset) -> Self {
        Self { topology, data, recompute: false, closed_loop: None, precision: Precision::F64 }
    }
}

/// One run of the network through a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Run {
    /// The sequence, from 0.
    pub sequence: usize,
    /// Steps T, at least 1: the first T + xi samples count.
    pub steps: usize,
    /// Where it goes on in a closed loop; none is teacher forcing throughout.
    pub release: Option<Release>,
}

impl Run {
    /// The first `steps` steps of a sequence.
    #[must_use]
    pub fn new(sequence: usize, steps: usize) -> Self {
        Self { sequence, steps, release: None }
    }

    /// The same, going on in a closed loop.
    #[must_use]
    pub fn released(mut self, release: Release) -> Self {
        self.release = Some(release);
        self
    }

    /// One run through the whole of each sequence.
    #[must_use]
    pub fn through_all(data: &Dataset, delay: usize) -> Vec<Self> {
        let whole = |(sequence, values): (usize, &crate::dataset::Sequence)| Self {
            sequence,
            steps: values.len().saturating_sub(delay),
            release: None,
        };
        data.sequences().iter().enumerate().map(whole).collect()
    }
}

/// How much of the gradient is wanted. A backend that does not know a variant computes everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Want {
    /// Likelihood and error only.
    Score,
    /// And the gradient of the initial states.
    InitialStates,
    /// And the gradient of all shared parameters.
    Everything,
}

/// Evaluates the objective again and again on runs through the same sequences.
pub trait Objective: fmt::Debug + Send + Sync {
    /// Takes over weights and biases for the evaluations that follow.
    fn set_parameters(&mut self, parameters: &Parameters);

    /// Evaluates `runs`, each from its own initial state; `initial` is `[run, unit]`. Gradients of weights that do not exist, and of
    /// initial states that are not learned, are 0.
    ///
    /// What cannot be evaluated is NaN, and learning and recognition take it as they take a value that overflowed: so it is with a run
    /// that the data do not have, with parameters or an evaluation of another network, and with a device that fails.
    fn evaluate(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation);

    /// Names the arithmetic: where two names are equal, so are the bits of a training.
    fn numerics(&self) -> &str;
}

/// What an evaluation found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Evaluation {
    /// d ln L_out / d theta_share over all runs, where everything was wanted.
    pub gradients: Gradients,
    /// d ln L_out / d u_0, `[run, unit]`, where it was wanted.
    pub initial: Vec<f64>,
    /// ln L_out of each run in nats; -E (A.22) without variance units.
    pub ln_likelihood: Vec<f64>,
    /// Sum over steps and channels of squared errors, of each run.
    pub squared_error: Vec<f64>,
    units: usize,
}

impl Evaluation {
    /// Of no run.
    #[must_use]
    pub fn new(topology: &Topology) -> Self {
        Self {
            gradients: Parameters::zeros(topology),
            initial: Vec::new(),
            ln_likelihood: Vec::new(),
            squared_error: Vec::new(),
            units: topology.context_units(),
        }
    }

    /// Makes room for `runs` runs; allocates only where there never were so many.
    pub fn resize(&mut self, runs: usize) {
        self.initial.resize(runs * self.units, 0.0);
        self.ln_likelihood.resize(runs, 0.0);
        self.squared_error.resize(runs, 0.0);
    }

    /// Says of all values that they could not be found.
    pub fn fill_with_nan(&mut self) {
        self.gradients.as_mut_slice().fill(f64::NAN);
        for list in [&mut self.initial, &mut self.ln_likelihood, &mut self.squared_error] {
            list.fill(f64::NAN);
        }
    }
}
