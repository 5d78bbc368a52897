//! metrics.json: all numbers of a reproduction. docs/reproduction.md says what each key means.

use scrnn::engine::InstructionSet;
use serde::Serialize;

use super::study::{SeedResult, Summary, Verdict};
use scrnn_run::experiment::Experiment;

/// The file's name.
pub const METRICS: &str = "metrics.json";

/// All of it.
#[derive(Debug, Serialize)]
pub struct Metrics<F> {
    /// Grows when a key changes its meaning.
    pub format: u32,
    /// Which experiment.
    pub experiment: &'static str,
    /// Which settings.
    pub preset: &'static str,
    /// How to get the same.
    pub command: String,
    /// The version of scrnn.
    pub version: &'static str,
    /// Where it ran.
    pub machine: Machine,
    /// From start to page.
    pub seconds: f64,
    /// The first seed's experiments.
    pub settings: Vec<Experiment>,
    /// Each seed.
    pub seeds: Vec<SeedResult<F>>,
    /// Over seeds.
    pub summary: Vec<Summary>,
    /// Goals.
    pub verdicts: Vec<Verdict>,
}

/// A computer.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// The processor's name, where the system tells it.
    pub processor: Option<String>,
    /// Cores that were used.
    pub cores: usize,
    /// Vector instructions.
    pub instruction_set: String,
    /// Operating system and architecture.
    pub system: String,
}

impl Machine {
    /// This one.
    pub fn here(cores: usize, instruction_set: InstructionSet) -> Self {
        let processor = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        });
        let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        Self { processor, cores, instruction_set: instruction_set.to_string(), system }
    }

    /// In a line.
    pub fn told(&self) -> String {
        let processor = self.processor.as_deref().unwrap_or("unknown processor");
        let cores = if self.cores == 1 { "1 core".to_owned() } else { format!("{} cores", self.cores) };
        format!("{processor}, {cores}, {}, {}", self.instruction_set, self.system)
    }
}
