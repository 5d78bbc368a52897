//! The results of all jobs of a study, and what is made of them.

use scrnn_run::experiment::Experiment;

use super::comparison::Compared;
use super::condition::Condition;
use super::job_result::JobResult;
use super::measure::Summary;
use super::table::Table;

/// All jobs, condition by condition, and what was made of them so far.
#[derive(Debug)]
pub struct Results<F> {
    /// The conditions.
    pub conditions: Vec<Condition>,
    /// For each condition, the experiments of its first seed.
    pub settings: Vec<Vec<Experiment>>,
    /// The jobs, condition by condition.
    pub jobs: Vec<JobResult<F>>,
    /// Each measure over seeds.
    pub summary: Vec<Summary>,
    /// Times over seeds.
    pub times: Vec<Summary>,
    /// Measures compared with each other.
    pub comparisons: Vec<Compared>,
    /// The study's own tables.
    pub tables: Vec<Table>,
}

impl<F> Results<F> {
    /// Jobs of one condition.
    pub fn of<'a>(&'a self, condition: &'a str) -> impl Iterator<Item = &'a JobResult<F>> + Clone {
        self.jobs.iter().filter(move |job| job.condition.unwrap_or("") == condition)
    }

    /// A measure by its key, if any job has it.
    pub fn measure(&self, key: &str) -> Option<&Summary> {
        self.summary.iter().find(|summary| summary.key == key).filter(|summary| !summary.known().is_empty())
    }

    /// A table of the study by its key.
    pub fn table(&self, key: &str) -> Option<&Table> {
        self.tables.iter().find(|table| table.key == key)
    }
}
