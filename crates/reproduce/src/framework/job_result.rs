//! The results of one job: its trainings and its findings.

use scrnn::learning::Outcome;
use scrnn_run::training::Training;
use serde::Serialize;

/// A training in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct TrainingFacts {
    /// CTRNN, S-CTRNN or S-MTRNN.
    pub network: &'static str,
    /// The run folder, beside metrics.json.
    pub folder: String,
    /// Epochs done.
    pub epochs: u64,
    /// Nats per step and channel at the end; none without variance units.
    pub nll: Option<f64>,
    /// Mean squared error per step and channel at the end.
    pub mse: Option<f64>,
    /// Seconds of training, those of earlier processes included.
    pub seconds: f64,
    /// How often it was reset to its best network, at half the rate.
    pub recoveries: u64,
    /// Where a value became non-finite, if one did.
    pub diverged: Option<String>,
}

impl TrainingFacts {
    /// Of a training that is over.
    pub fn of(network: &'static str, folder: &str, training: &Training) -> Self {
        Self {
            network,
            folder: folder.to_owned(),
            epochs: training.learner.epoch(),
            nll: training.score.and_then(|score| score.nll),
            mse: training.score.map(|score| score.mse),
            seconds: training.seconds,
            recoveries: training.learner.recoveries(),
            diverged: match &training.outcome {
                Outcome::Diverged(divergence) => Some(divergence.to_string()),
                _ => None,
            },
        }
    }

    /// Of a network that was not trained.
    #[cfg(test)]
    pub fn none(network: &'static str) -> Self {
        let (folder, epochs, nll, mse, seconds, recoveries, diverged) = (String::new(), 0, None, None, 0.0, 0, None);
        Self { network, folder, epochs, nll, mse, seconds, recoveries, diverged }
    }
}

/// All of one job.
#[derive(Debug, Serialize)]
pub struct JobResult<F> {
    /// The condition's key; none where there is one condition only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<&'static str>,
    /// Of initial weights, and of whatever else the study says.
    pub seed: u64,
    /// Training and evaluation together.
    pub seconds: f64,
    /// Evaluation alone, parts of earlier processes included.
    pub seconds_of_evaluation: f64,
    /// Threads that worked on it.
    pub threads: usize,
    /// Its trainings.
    pub trainings: Vec<TrainingFacts>,
    /// What was found.
    pub findings: F,
}

impl<F> JobResult<F> {
    /// As it is shown: the seed, with the condition where there are several.
    pub fn called(&self) -> String {
        match self.condition {
            None => format!("seed {}", self.seed),
            Some(condition) => format!("{condition}, seed {}", self.seed),
        }
    }
}
