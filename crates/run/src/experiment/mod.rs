//! The experiment file: everything that decides the result of a training.
//!
//! The types here are the file's format. [`read()`] turns a file and `--set` options into an [`Experiment`], checked, with
//! every default filled in; the run folder keeps it in that form.

mod checks;
mod comments;
mod conversion;
mod difference;
mod overrides;
mod reading;
#[cfg(test)]
mod reading_tests;
mod robust;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use comments::{Comment, in_lines};
pub use difference::{Difference, differences};
pub use overrides::Override;
pub use reading::{Base, read, read_text, table};
pub use scrnn::learning::{Adam, AdaptiveRate, ClosedLoop, Lbfgs, Momentum, OnDivergence, PriorStep};
pub use scrnn::objective::Precision;
pub use scrnn::topology::Group;
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
    /// How it is judged on sequences that are held out of the training. Goes with `data.held_out`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluation: Option<Evaluation>,
    /// What is written while it learns. Has no influence on what is learned.
    #[serde(default)]
    pub output: Output,
    /// Words on values, for the file in the run folder. A file that is read has none.
    #[serde(skip)]
    pub comments: Vec<Comment>,
}

fn one() -> u64 {
    1
}

/// The sequences to learn: either a task of the thesis or files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// For the task "interact": orders are drawn at random, and a branching goes to the left with this probability. Default: all 32 orders,
    /// each once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left: Option<f64>,
    /// Files and folders to read, relative to the experiment file; `*` stands for any part of a name. The sequences of all of
    /// them are learned together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<Vec<PathBuf>>,
    /// The topic whose messages are samples, in recordings. Default: /sensed, or the only one that can be meant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Topics of a recording that are joined, each brought to `period`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topics: Option<Vec<String>>,
    /// What tells when a sample was taken: "header", "publish" or "log" in recordings; "rows" takes rows as even steps whatever
    /// their clock says. Default: the best there is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeSourceName>,
    /// Arrays or data sets of a file that holds several, by name or path, in this order. Default: the reader chooses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arrays: Option<Vec<String>>,
    /// What the axes of an array are, a letter for each: n sequences, t steps, c channels, e.g. "nct".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<String>,
    /// Channels that are angles: their jumps of a whole turn are taken out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unwrap: Option<Vec<String>>,
    /// Seconds between samples, to which the messages of .mcap files are brought. Default: as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
    /// For movements that come to rest: the last sample of each sequence is held for so long, as a share of its length, so that the
    /// network learns to stay there. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<f64>,
    /// Names of the channels to learn, in this order. Default: all that the files have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channels: Option<Vec<String>>,
    /// What is done about missing samples (NaN, empty cells, null): "accept" learns around them, "refuse" ends with an error.
    /// Default: "accept".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<MissingName>,
    /// How samples are brought into the reach of the mean units, which is -1 to 1. Default: "fit" for files and robots,
    /// "none" for other tasks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scaling: Option<ScalingChoice>,
    /// Whole sequences that are not learned: the network is judged on them while it learns, the best one is the best on them, and
    /// the scaling does not know them. A share of all, drawn by the experiment's seed; or their names; or files of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
}

/// Which sequences are held out of the training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "held_out is a share as 0.2, a list of names of sequences, { share = 0.2, seed = 1 } or { files = [...] }"
)]
pub enum HeldOut {
    /// This share of the sequences, at least one of them, drawn by the experiment's seed.
    Share(f64),
    /// The sequences of these names.
    Names(Vec<String>),
    /// A share, drawn by a seed of its own: the same sequences for any seed of the experiment.
    Drawn(HeldOutDrawn),
    /// The sequences of files that are read as `files` are.
    Files(HeldOutFiles),
}

/// A share of the sequences, and the seed that draws them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOutDrawn {
    /// Above 0, below 1.
    pub share: f64,
    /// Draws them.
    pub seed: u64,
}

/// Files with sequences that are not learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOutFiles {
    /// Files and folders, relative to the experiment file; `*` stands for any part of a name.
    pub files: Vec<PathBuf>,
}

/// How a network is judged on sequences that it does not learn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Evaluation {
    /// Epochs between two evaluations. Default: a hundredth of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// Share of each sequence at its beginning that the network listens to before its predictions count: it starts from the mean
    /// initial state, and has yet to find out which movement this is.
    pub burn_in: f64,
    /// Share of each sequence that the network hears before it goes on alone, in its closed loop.
    pub observed: f64,
}

impl Default for Evaluation {
    fn default() -> Self {
        Self { every: None, burn_in: 0.1, observed: 0.3 }
    }
}

/// What tells when a sample was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TimeSourceName {
    /// The stamp inside of a message.
    Header,
    /// When a message was published.
    Publish,
    /// When a message was logged.
    Log,
    /// Nothing: rows and messages are steps.
    Rows,
}

/// What is done about missing samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MissingName {
    /// They do not count, and the network's own prediction stands in for them as an input.
    Accept,
    /// They are an error.
    Refuse,
}

/// How samples are scaled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "scaling is one of \"none\", \"fit\", \"robust\", { ranges = [[low, high], ...] } or { offset = [...], scale = [...] }"
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
    /// As "fit", but samples far outside of nearly all others do not count: they lie outside of -0.8 to 0.8.
    Robust,
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
    /// Variance of the prior over initial states (2.15): large lets each sequence find its own, small keeps them together, and with 0
    /// all sequences share one.
    #[serde(default = "unit")]
    pub initial_state_variance: f64,
    /// Whether the mean units are bounded, as in the thesis ("tanh"), or not ("linear").
    #[serde(default, skip_serializing_if = "is_default")]
    pub mean: MeanUnits,
    /// Whether the network sees, beside each sample, its difference to the one before.
    #[serde(default, skip_serializing_if = "is_default")]
    pub velocity_inputs: bool,
    /// What the mean units add to: nothing, as in the thesis ("none"), the last sample ("residual"), the last sample and a share of its
    /// last change ("extrapolation"), or a linear map of the last samples that is fitted to the data ("autoregressive"). For smooth
    /// movements. Predicted means and variances are then in units of what is left to predict, and so is `variance_floor`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub skip: SkipName,
    /// For "extrapolation": the share of the last change, 0 to 1. Default 0.7.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skip_damping: Option<f64>,
    /// For "autoregressive": how many differences are used, one less than samples. Default 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skip_lags: Option<usize>,
    /// The context units.
    pub groups: Vec<Group>,
}

/// What bounds a mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MeanUnits {
    /// y = tanh u, in -1 to 1 (2.4).
    #[default]
    Tanh,
    /// y = u.
    Linear,
}

/// What the mean units add to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SkipName {
    /// Nothing.
    #[default]
    None,
    /// The last sample.
    Residual,
    /// The last sample and a share of its last change.
    Extrapolation,
    /// A linear map of the last samples, fitted to the data.
    Autoregressive,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn recover() -> OnDivergence {
    OnDivergence::Recover
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

/// How the network learns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// "auto" chooses whatever the file does not say of `[network]` and `[training]`, by the data, as where there is no experiment file;
    /// then neither `epochs` nor `optimiser` nor groups need be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recipe: Option<RecipeName>,
    /// How often all sequences are seen. Each time is one update, but for Adam in batches.
    pub epochs: u64,
    /// The rule of ascent. Only the table of the same name is used.
    pub optimiser: OptimiserName,
    /// Saves memory on long sequences: states are not all kept but computed again, which takes a third more time. What is
    /// learned stays the same to the bit.
    #[serde(default)]
    pub recompute: bool,
    /// The numbers that states and products are computed in: "f32" is faster, and comes to other bits than "f64". The likelihood and
    /// sums over sequences are float64 in any case, and so are closed loops and sequences with missing values.
    #[serde(default, skip_serializing_if = "is_default")]
    pub precision: Precision,
    /// What to do when training becomes unstable: a value is not finite, or the likelihood collapses.
    #[serde(default = "recover")]
    pub on_divergence: OnDivergence,
    /// Ends the training once so many evaluations in a row brought no better nll on the held-out sequences. Default: never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patience: Option<u64>,
    /// Trains so many networks side by side, from `seed` and those after it: a mixture, whose folders lie in the run folder.
    /// Default: one network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub members: Option<u64>,
    /// Options of "momentum".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub momentum: Option<Momentum>,
    /// Options of "adam".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adam: Option<Adam>,
    /// Learns a part of the sequences in the closed loop, with "adam"; an empty table turns it on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed_loop: Option<ClosedLoop>,
    /// Lets L-BFGS make the last epochs; an empty table turns it on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lbfgs: Option<Lbfgs>,
}

/// A way to choose settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RecipeName {
    /// By the data.
    Auto,
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
