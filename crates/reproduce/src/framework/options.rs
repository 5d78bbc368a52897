//! How an experiment is to be reproduced, and the result.

use std::path::PathBuf;

use scrnn_run::experiment::Override;
use scrnn_run::failure::Ending;

use super::preset::Preset;

/// How.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which settings.
    pub preset: Preset,
    /// Number of seeds. Where a study has several conditions: of networks in each.
    pub seeds: u64,
    /// The first seed.
    pub seed: u64,
    /// The folder; by default `runs/reproduce/EXPERIMENT-PRESET`.
    pub out: Option<PathBuf>,
    /// Number of epochs, instead of the preset's.
    pub epochs: Option<u64>,
    /// Keys of the first network's training or network that are changed.
    pub set: Vec<Override>,
    /// Also conditions that the thesis leaves to the future, where a study has some.
    pub beyond: bool,
    /// Train and evaluate anew what is in the folder already.
    pub overwrite: bool,
}

impl Options {
    /// The command that does the same again.
    #[must_use]
    pub fn command(&self, experiment: &str) -> String {
        let mut line = format!("scrnn reproduce {experiment} --preset {}", self.preset.word());
        line += &format!(" --seeds {} --seed {}", self.seeds, self.seed);
        if let Some(epochs) = self.epochs {
            line += &format!(" --epochs {epochs}");
        }
        if self.beyond {
            line += " --beyond";
        }
        for change in &self.set {
            let key_and_value = change.typed.trim_start_matches("--set ");
            line += &format!(" --set '{}'", key_and_value.replace('\'', "'\\''"));
        }
        line
    }
}

/// The result of a reproduction.
#[derive(Debug)]
pub struct Reproduced {
    /// How it ended.
    pub ending: Ending,
    /// `metrics.json` as text; empty if it was interrupted.
    pub json: String,
    /// Measures and goals as tables; empty if it was interrupted.
    pub text: String,
}
