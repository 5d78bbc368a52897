//! What is found for the networks of one seed, and what figures are drawn from.

use scrnn::analysis::clustering::Clustering;
use scrnn::dataset::Dataset;
use scrnn::generation::Generated;
use scrnn_run::assessment::Assessment;
use serde::Serialize;

/// The figures of one seed.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// Each pattern.
    pub patterns: Vec<Pattern>,
    /// How many the closed loop with noise regenerates.
    pub regenerated: usize,
    /// |mean predicted variance - true| / true, averaged over patterns and channels (3.4).
    pub variance_error_mean: f64,
    /// The largest of these.
    pub variance_error_max: f64,
    /// The CTRNN, where there is one.
    pub ctrnn: Option<Ctrnn>,
    /// Recognition, where it was tried.
    pub recognition: Option<Recognised>,
    /// Initial states by their noise, in the plane of the first two components.
    pub clustering_plane: Option<Clustering>,
    /// In all dimensions.
    pub clustering_all: Option<Clustering>,
    /// Share of the initial states' variance in that plane.
    pub plane_share: f64,
    /// One step ahead.
    pub assessment: Assessment,
}

/// One pattern.
#[derive(Debug, Serialize)]
pub struct Pattern {
    /// From 1, as in the thesis.
    pub number: usize,
    /// The variance of its noise.
    pub true_variance: f64,
    /// Predicted variance of each channel in the closed loop, averaged over steps (3.4).
    pub mean_variance: Vec<f64>,
    /// Its standard deviation over steps.
    pub variance_deviation: Vec<f64>,
    /// (3.5) in the closed loop with noise, against the ideal curve.
    pub error: f64,
    /// The most it may be (3.2.5).
    pub bound: f64,
    /// Whether it is within the bound.
    pub regenerated: bool,
    /// (3.5) against the ideal curve at the phase that suits best: small where only the phase is off.
    pub error_at_best_phase: f64,
    /// Of the trials of recognition, those from whose state the closed loop regenerates the pattern.
    pub recognised: Option<usize>,
    /// Those that are within the bound in the open loop.
    pub recognised_listening: Option<usize>,
}

/// The CTRNN in the closed loop.
#[derive(Debug, Serialize)]
pub struct Ctrnn {
    /// How many patterns it regenerates.
    pub regenerated: usize,
    /// Those it does not, from 1.
    pub failed: Vec<usize>,
    /// (3.5) of each.
    pub errors: Vec<f64>,
}

/// Recognition of all patterns.
#[derive(Debug, Serialize)]
pub struct Recognised {
    /// Starts, over all patterns.
    pub trials: usize,
    /// From whose state the closed loop regenerates the pattern (3.2.5).
    pub succeeded: usize,
    /// Within the same bound in the open loop.
    pub succeeded_listening: usize,
}

/// What figures are drawn from.
pub struct Material {
    /// The sequences that were learned.
    pub data: Dataset,
    /// The closed loop with noise.
    pub closed: Vec<Generated>,
    /// The CTRNN's closed loop.
    pub ctrnn: Option<Vec<Generated>>,
    /// Context units.
    pub units: usize,
    /// Initial states in the plane.
    pub plane: Vec<f64>,
    /// Level of noise of each pattern, from 0.
    pub levels: Vec<usize>,
}
