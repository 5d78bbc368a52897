//! A study: one experiment of the thesis over conditions and seeds.

use std::path::Path;

use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn_report::Section;
use scrnn_run::experiment::Experiment;
use scrnn_run::history::Row;
use scrnn_run::source::Source;
use serde::Serialize;

use super::comparison::Comparison;
use super::condition::Condition;
use super::desk::Desk;
use super::film::Film;
use super::job_result::TrainingFacts;
use super::measure::Measure;
use super::options::Options;
use super::results::Results;
use super::stop::Result;
use super::table::Table;
use super::verdict::Verdict;

/// One experiment of the thesis.
pub trait Study: Sync {
    /// The figures of one job: a part of metrics.json.
    type Findings: Serialize + Send;
    /// What figures are drawn from.
    type Material: Send;

    /// The page's title.
    fn title(&self) -> &'static str;

    /// What a seed draws, as a sentence goes on after "Each seed has".
    fn seed_draws(&self) -> &'static str {
        "data and initial weights of its own"
    }

    /// Grows whenever an evaluation gives other numbers for the same networks: what was kept before is then not used.
    fn edition(&self) -> u32 {
        1
    }

    /// Under which conditions networks learn; with `beyond` also those that the thesis leaves to the future.
    fn conditions(&self, beyond: bool) -> Vec<Condition>;

    /// What has to lie in the folder before anything is trained, made on so many threads.
    fn prepare(&self, _conditions: &[Condition], _folder: &Path, _threads: usize, _desk: &Desk<'_>) -> Result<()> {
        Ok(())
    }

    /// The resolved experiment of one network, whose data may lie in `folder`. `index` counts the networks of a job; keys that
    /// a person changed are the first one's.
    fn experiment(
        &self,
        condition: &Condition,
        index: usize,
        seed: u64,
        options: &Options,
        _folder: &Path,
    ) -> Result<Experiment> {
        let changed = if index == 0 { options.set.as_slice() } else { &[] };
        Ok(condition.networks[index].experiment(options.preset, seed, options.epochs, changed)?)
    }

    /// Lets the trained networks generate and recognise, and looks at the result.
    ///
    /// What takes long is a [`Desk::part`], and asks the desk whether to go on.
    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Self::Findings, Self::Material)>;

    /// Closed loops of robots to be watched, of the jobs that the page shows.
    fn films(&self, _job: &Job<'_>, _desk: &Desk<'_>) -> Result<Vec<Film>> {
        Ok(Vec::new())
    }

    /// What is compared with the thesis and over seeds.
    fn measures(&self) -> Vec<Measure<Self::Findings>>;

    /// Times that an evaluation took, for the table of times: they are reported, and never judged.
    fn times(&self) -> Vec<Measure<Self::Findings>> {
        Vec::new()
    }

    /// Measures that are compared with each other.
    fn comparisons(&self) -> Vec<Comparison> {
        Vec::new()
    }

    /// Tables over all jobs.
    fn tables(&self, _results: &Results<Self::Findings>) -> Vec<Table> {
        Vec::new()
    }

    /// Whether the goals are reached.
    fn verdicts(&self, results: &Results<Self::Findings>) -> Vec<Verdict>;

    /// Figures and tables, from the findings and the material of all jobs, in the same order.
    fn sections(&self, results: &Results<Self::Findings>, materials: &[Self::Material]) -> Vec<Section>;
}

/// A seed under a condition, with its trained networks.
#[derive(Debug)]
pub struct Job<'a> {
    /// The condition.
    pub condition: &'a Condition,
    /// The seed.
    pub seed: u64,
    /// Whether it is the condition's first.
    pub first: bool,
    /// In the order of the condition's networks.
    pub networks: &'a [Learned],
}

/// A trained network with what it learned from.
#[derive(Debug)]
pub struct Learned {
    /// CTRNN, S-CTRNN or S-MTRNN.
    pub name: &'static str,
    /// Its experiment, with every value explicit.
    pub experiment: Experiment,
    /// The network.
    pub network: Network,
    /// Its initial states.
    pub initial_states: InitialStates,
    /// Between the data's units and the network's.
    pub scaling: Scaling,
    /// The sequences that it learned, with the truth.
    pub source: Source,
    /// How training went.
    pub history: Vec<Row>,
    /// In numbers.
    pub training: TrainingFacts,
}

impl Learned {
    /// The learned initial states, in the order of the sequences.
    pub fn states(&self) -> Vec<&[f64]> {
        (0..self.initial_states.sequences()).map(|s| self.initial_states.sequence(s)).collect()
    }
}
