//! metrics.json: all numbers of a reproduction. docs/reproduction.md says what each key means.

use scrnn::engine::InstructionSet;
use scrnn_run::experiment::Experiment;
use serde::Serialize;

use super::comparison::Compared;
use super::job_result::JobResult;
use super::measure::Summary;
use super::results::Results;
use super::table::{self, Table};
use super::verdict::Verdict;

/// The file's name.
pub const METRICS: &str = "metrics.json";

/// All of it.
#[derive(Debug)]
pub struct Metrics<'a, F> {
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
    /// Goals.
    pub verdicts: Vec<Verdict>,
    /// All jobs, and what was made of them.
    pub results: &'a Results<F>,
}

/// The file's keys.
#[derive(Serialize)]
struct File<'a, F> {
    format: u32,
    experiment: &'static str,
    preset: &'static str,
    command: &'a str,
    version: &'static str,
    machine: &'a Machine,
    seconds: f64,
    settings: Vec<&'a Experiment>,
    seeds: &'a [JobResult<F>],
    summary: &'a [Summary],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    comparisons: &'a [Compared],
    #[serde(skip_serializing_if = "<[_]>::is_empty", serialize_with = "table::by_key")]
    tables: &'a [Table],
    times: &'a [Summary],
    verdicts: &'a [Verdict],
}

impl<F: Serialize> Metrics<'_, F> {
    /// As the file has it.
    pub fn json(&self) -> String {
        let results = self.results;
        let file = File {
            format: self.format,
            experiment: self.experiment,
            preset: self.preset,
            command: &self.command,
            version: self.version,
            machine: &self.machine,
            seconds: self.seconds,
            settings: results.settings.iter().flatten().collect(),
            seeds: &results.jobs,
            summary: &results.summary,
            comparisons: &results.comparisons,
            tables: &results.tables,
            times: &results.times,
            verdicts: &self.verdicts,
        };
        serde_json::to_string_pretty(&file).expect("strings and numbers become JSON") + "\n"
    }
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
    pub fn in_words(&self) -> String {
        let processor = self.processor.as_deref().unwrap_or("unknown processor");
        let cores = if self.cores == 1 { "1 core".to_owned() } else { format!("{} cores", self.cores) };
        format!("{processor}, {cores}, {}, {}", self.instruction_set, self.system)
    }
}
