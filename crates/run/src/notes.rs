//! What the program keeps in a checkpoint beside the network. No time and no path of the run is among it: the bytes of
//! a checkpoint must not depend on how often a training was interrupted.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::experiment::Experiment;
use crate::variance_factor::VarianceFactor;

/// The notes of a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Notes {
    /// The resolved experiment without what does not matter to what is learned.
    pub experiment: Value,
    /// The sequences that were learned.
    pub data: DataNotes,
    /// The arithmetic that computes, by its [name](scrnn::learning::Learner::numerics). It is written only where it is not the
    /// one whose bits are promised, which all earlier runs were made with.
    #[serde(default = "promised", skip_serializing_if = "is_promised")]
    pub numerics: String,
    /// How well the network of this checkpoint does, once it was evaluated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// The best epoch up to this one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best: Option<Score>,
    /// A factor on the predicted variances, if one was found after the training. Going on with the training drops it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variance_factor: Option<VarianceFactor>,
}

/// The arithmetic whose bits are the same on all processors.
const PROMISED: &str = "f64";

fn promised() -> String {
    PROMISED.to_owned()
}

fn is_promised(numerics: &str) -> bool {
    numerics == PROMISED
}

/// What is known of the sequences.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataNotes {
    /// Fingerprint of names, lengths and samples.
    pub digest: String,
    /// Samples in each sequence.
    pub lengths: Vec<usize>,
    /// The least and the greatest sample of each channel, in the data's units. Empty in checkpoints of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ranges: Vec<(f64, f64)>,
    /// The sequences that were held out, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutNotes>,
}

/// What is known of the sequences that were held out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOutNotes {
    /// Fingerprint of names, lengths and samples.
    pub digest: String,
    /// Their names.
    pub names: Vec<String>,
}

/// How well the network of an epoch predicts the sequences that it learned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The number of updates made before.
    pub epoch: u64,
    /// Nats per step and channel, in scaled units; none without variance units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nll: Option<f64>,
    /// Mean squared error per step and channel, in scaled units.
    pub mse: f64,
    /// The same on the sequences that were held out, if there are any and they were looked at in this epoch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutScore>,
}

/// How well the network of an epoch predicts the sequences that were held out, from the mean initial state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOutScore {
    /// Nats per step and channel, in scaled units; none without variance units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nll: Option<f64>,
    /// Mean squared error per step and channel, in scaled units.
    pub mse: f64,
}

impl Score {
    /// What tells the best epoch: the nll, or the squared error where there is no variance; of the sequences that were held out, where
    /// they were looked at.
    pub fn value(self) -> f64 {
        match self.held_out {
            Some(HeldOutScore { nll, mse }) => nll.unwrap_or(mse),
            None => self.nll.unwrap_or(self.mse),
        }
    }
}

impl Notes {
    /// Reads them from a checkpoint; none if something else than this program wrote it.
    pub fn of(checkpoint: &scrnn::checkpoint::Checkpoint) -> Option<Self> {
        serde_json::from_value(checkpoint.notes.clone()).ok()
    }

    /// The experiment, checked as one from a file is: a checkpoint may come from anywhere.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn experiment(&self) -> Result<Experiment, String> {
        let experiment = Experiment::deserialize(&self.experiment).map_err(|error| error.to_string())?;
        experiment.check().map(|()| experiment)
    }

    /// As a checkpoint holds them.
    pub fn to_value(&self) -> Value {
        serde_json::to_value(self).expect("strings and finite numbers become JSON")
    }
}

/// The part of an experiment that decides what is learned: all but `output` and `training.recompute`.
pub fn learned_part(experiment: &Experiment) -> Value {
    let mut value = serde_json::to_value(experiment).expect("strings and finite numbers become JSON");
    if let Some(entries) = value.as_object_mut() {
        entries.remove("output");
    }
    if let Some(entries) = value["training"].as_object_mut() {
        entries.remove("recompute");
    }
    value
}
