//! The experiment file: everything that decides what a training comes to.
//!
//! The types here are the file's format. [`read()`] turns a file and `--set` options into an [`Experiment`], checked, with
//! every default filled in; the run folder keeps it in that form.

mod checks;
mod conversion;
mod difference;
mod overrides;
mod reading;
#[cfg(test)]
mod reading_tests;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use difference::{Difference, differences};
pub use overrides::Override;
pub use reading::{read, read_text};
pub use scrnn_tasks::TaskName;

/// What to learn, with which network and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "scrnn experiment")]
pub struct Experiment {
    /// The experiment's name. The run folder is called after it.
    pub name: String,
    /// Seed of the initial weights and biases.
    #[serde(default = "one")]
    pub seed: u64,
    /// The sequences to learn.
    pub data: Data,
    /// The network.
    pub network: Network,
    /// How the network learns.
    pub training: Training,
    /// What is written while it learns. Has no influence on what is learned.
    #[serde(default)]
    pub output: Output,
}

fn one() -> u64 {
    1
}

/// The sequences to learn: either a task of the thesis or files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// A task of the thesis. Its data are made anew for each run, the same for the same seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<TaskName>,
    /// Number of sequences of the task. Default: as in the thesis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequences: Option<usize>,
    /// Samples in each sequence of the task. Default: as in the thesis, 1000, or 180 for "reach".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Seed of the task's noise. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// For the task "reach": whether the object lies exactly at its three positions, instead of being placed up to 10 mm
    /// off for each sequence. Default false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact_positions: Option<bool>,
    /// Files to read, relative to the experiment file: .csv, .txt, .npy, .npz or .mcap. The sequences of all of them are
    /// learned together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<Vec<PathBuf>>,
    /// The topic whose messages are samples, in .mcap files. Default: /sensed, or the only one whose messages are JSON.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Seconds between samples, to which the messages of .mcap files are brought. Default: as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
    /// Names of the channels to learn, in this order. Default: all that the files have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channels: Option<Vec<String>>,
    /// How samples are brought into the reach of the mean units, which is -1 to 1. Default: "fit" for files and robots,
    /// "none" for other tasks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scaling: Option<ScalingChoice>,
}

/// How samples are scaled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "scaling is one of \"none\", \"fit\", { ranges = [[low, high], ...] } or { offset = [...], scale = [...] }"
)]
pub enum ScalingChoice {
    /// By name.
    Named(ScalingName),
    /// Each channel's range is mapped to -0.8 ... 0.8.
    Ranges(ScalingRanges),
    /// scaled = (raw - offset) * scale
    Constants(ScalingConstants),
}

/// A scaling that needs no numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ScalingName {
    /// Samples are used as they are.
    None,
    /// Each channel's smallest and largest sample are mapped to -0.8 and 0.8.
    Fit,
}

/// One range for each channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScalingRanges {
    /// `[low, high]` for each channel.
    pub ranges: Vec<(f64, f64)>,
}

/// Two constants for each channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScalingConstants {
    /// The raw value that becomes 0, for each channel.
    pub offset: Vec<f64>,
    /// The factor for each channel.
    pub scale: Vec<f64>,
}

/// The network: one context group makes it a CTRNN, a fast and a slow one an MTRNN.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// The delay xi: the network predicts the sample that many steps ahead.
    #[serde(default = "one_step")]
    pub delay: usize,
    /// Whether the variance is predicted too; `false` makes it a conventional CTRNN or MTRNN.
    #[serde(default = "yes")]
    pub variance: bool,
    /// Added to each predicted variance. The thesis has none: 0.
    #[serde(default)]
    pub variance_floor: f64,
    /// Variance of the prior over initial states (2.15): large lets each sequence find its own, small keeps them together.
    #[serde(default = "unit")]
    pub initial_state_variance: f64,
    /// The context units.
    pub groups: Vec<Group>,
}

fn one_step() -> usize {
    1
}

fn yes() -> bool {
    true
}

fn unit() -> f64 {
    1.0
}

/// Context units that share a time constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// The group's name.
    pub name: String,
    /// Number of units.
    pub units: usize,
    /// Time constant in steps, at least 1.
    pub time_constant: f64,
    /// Whether the input projects to the group.
    #[serde(default = "yes")]
    pub receives_input: bool,
    /// Whether the group projects to the outputs.
    #[serde(default = "yes")]
    pub drives_output: bool,
    /// Whether each sequence has an initial state of its own here; otherwise the group starts from 0.
    #[serde(default = "yes")]
    pub learns_initial_state: bool,
}

/// How the network learns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// How often all sequences are seen. Each time is one update, but for Adam in batches.
    pub epochs: u64,
    /// The rule of ascent. Only the table of the same name is used.
    pub optimiser: OptimiserName,
    /// Saves memory on long sequences: states are not all kept but computed again, which takes a third more time. What is
    /// learned stays the same to the bit.
    #[serde(default)]
    pub recompute: bool,
    /// What to do when training leaves its course.
    #[serde(default)]
    pub on_divergence: OnDivergence,
    /// Options of "momentum".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub momentum: Option<Momentum>,
    /// Options of "adam".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adam: Option<Adam>,
    /// Lets L-BFGS make the last epochs; an empty table turns it on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lbfgs: Option<Lbfgs>,
}

/// What to do when training leaves its course.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OnDivergence {
    /// Goes back to the best network, halves the rate and goes on: when a value is not finite, and when the nll rises by more
    /// than 10 nats above its best. After twenty times it stops.
    #[default]
    Recover,
    /// Stops when a value is not finite, at the last good epoch. The rule of ascent is never interfered with.
    Stop,
}

/// The rules of ascent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OptimiserName {
    /// The thesis' gradient ascent with a momentum term (2.17-2.19).
    Momentum,
    /// Adam with warm-up, cosine decay and norm clipping.
    Adam,
}

/// Gradient ascent with momentum (2.17-2.19, 2.7).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Momentum {
    /// The thesis' alpha with a tilde: divided by the number of steps and channels it is the rate of the weights.
    pub rate: f64,
    /// eta: how much of the last step is taken again.
    pub momentum: f64,
    /// How initial states follow their prior.
    pub prior: PriorStep,
    /// The adaptive rate of appendix D.1; an empty table turns it on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive_rate: Option<AdaptiveRate>,
}

/// How initial states follow their prior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PriorStep {
    /// An implicit step, stable for any variance of the prior.
    Implicit,
    /// The thesis' literal rule; unstable where the prior is narrow.
    Thesis,
}

/// The adaptive rate (D.1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AdaptiveRate {
    /// r_th: a step that makes the squared error larger than this many times is undone.
    pub max_error_ratio: f64,
    /// alpha_dec: the rate's factor after an undone step.
    pub decrease: f64,
    /// alpha_inc: the rate's factor after a step that made the error smaller.
    pub increase: f64,
    /// Largest number of tries in one epoch.
    pub max_tries: u32,
}

/// Adam. The weights' rate warms up, then decays to `final_rate` along a cosine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Adam {
    /// The peak rate.
    pub rate: f64,
    /// Share of the epochs in which the rate climbs to its peak.
    pub warm_up: f64,
    /// The rate at the last epoch.
    pub final_rate: f64,
    /// The gradient's norm is cut down to this; 0 never cuts.
    pub clip_norm: f64,
    /// Every update takes this times the rate off each weight; biases keep theirs.
    pub weight_decay: f64,
    /// Sequences that an update learns from; 0 takes all. An epoch makes as many updates as it takes to meet every sequence once.
    pub batch_size: usize,
    /// Initial states learn at this many times the rate.
    pub initial_state_factor: f64,
    /// Their mean learns at this many times the rate.
    pub mean_factor: f64,
    /// Decay of the gradient's average.
    pub beta1: f64,
    /// Decay of the squared gradient's average.
    pub beta2: f64,
    /// Keeps the division finite.
    pub epsilon: f64,
}

/// L-BFGS over all sequences at once, after the optimiser. Where a small network has to be exact it gets far further; it climbs to the
/// nearest maximum. An epoch is an update, which sees all sequences 1.1 times on average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lbfgs {
    /// Share of the epochs, the last ones, that are its own; 1 leaves none to the optimiser.
    pub share: f64,
    /// How many updates it remembers.
    pub memory: usize,
}

/// What is written while the network learns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Epochs between checkpoints. Default: by time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checkpoint_every: Option<u64>,
    /// Seconds between checkpoints where `checkpoint_every` is not given.
    pub checkpoint_seconds: f64,
    /// Epochs between rows of history.csv. Default: a thousandth of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history_every: Option<u64>,
}

impl Default for Output {
    fn default() -> Self {
        Self { checkpoint_every: None, checkpoint_seconds: 10.0, history_every: None }
    }
}
