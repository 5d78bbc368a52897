//! What the experiments of chapter 3 have in common: networks to train, findings of a seed, measures, verdicts, a page.

use scrnn::engine::Engine;
use scrnn::evaluation::mean_and_deviation;
use scrnn::initial_states::InitialStates;
use scrnn::learning::Outcome;
use scrnn::network::Network;
use serde::Serialize;

use super::preset::Kind;
use scrnn_report::Section;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::Result;
use scrnn_run::history::Row;
use scrnn_run::source::Source;
use scrnn_run::training::Training;

/// One experiment of the thesis.
pub trait Study: Sync {
    /// The figures of one seed: a part of metrics.json.
    type Findings: Serialize + Send;
    /// What figures are drawn from.
    type Material: Send;

    /// The networks to train for each seed; the S-CTRNN is the first.
    fn networks(&self) -> &'static [Kind];

    /// Lets the trained networks generate and recognise, and looks at the result.
    fn evaluate(&self, networks: &[Learned], seed: u64, engine: &Engine) -> Result<(Self::Findings, Self::Material)>;

    /// What is compared with the thesis and over seeds.
    fn measures(&self) -> Vec<Measure<Self::Findings>>;

    /// Whether the goals are reached.
    fn verdicts(&self, seeds: &[SeedResult<Self::Findings>]) -> Vec<Verdict>;

    /// Figures and tables of the first seed.
    fn sections(&self, seed: &SeedResult<Self::Findings>, material: &Self::Material) -> Vec<Section>;
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
    /// How often it was brought back to its best network, at half the rate.
    pub recoveries: u64,
    /// Where it left the finite numbers, if it did.
    pub diverged: Option<String>,
}

impl TrainingFacts {
    /// What is told of a training that is over.
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
}

/// All of one seed.
#[derive(Debug, Serialize)]
pub struct SeedResult<F> {
    /// Of initial weights and of the data's noise.
    pub seed: u64,
    /// Training and evaluation together.
    pub seconds: f64,
    /// Threads that worked on it.
    pub threads: usize,
    /// Its trainings.
    pub trainings: Vec<TrainingFacts>,
    /// What was found.
    pub findings: F,
}

/// A number that is compared.
pub struct Measure<F> {
    /// Its name in metrics.json.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// What it means, in one line.
    pub explanation: &'static str,
    /// What the thesis has; may be empty.
    pub thesis: &'static str,
    /// Digits behind the point.
    pub digits: usize,
    /// Where it stands; none where it does not exist.
    pub of: fn(&F) -> Option<f64>,
}

impl<F> Measure<F> {
    /// All of it.
    pub fn new(
        key: &'static str,
        label: &'static str,
        explanation: &'static str,
        thesis: &'static str,
        digits: usize,
        of: fn(&F) -> Option<f64>,
    ) -> Self {
        Self { key, label, explanation, thesis, digits, of }
    }
}

/// A measure over seeds.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Its name.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// What it means.
    pub explanation: &'static str,
    /// What the thesis has.
    pub thesis: &'static str,
    /// Over the seeds that have it.
    pub mean: Option<f64>,
    /// Standard deviation over seeds; none for a single one.
    pub deviation: Option<f64>,
    /// Each seed's.
    pub values: Vec<Option<f64>>,
    #[serde(skip)]
    digits: usize,
}

impl Summary {
    /// Of a measure.
    pub fn of<F>(measure: &Measure<F>, seeds: &[SeedResult<F>]) -> Self {
        let values: Vec<Option<f64>> = seeds.iter().map(|seed| (measure.of)(&seed.findings)).collect();
        let known: Vec<f64> = values.iter().flatten().copied().collect();
        let (mean, deviation) = mean_and_deviation(&known);
        let &Measure { key, label, explanation, thesis, digits, .. } = measure;
        let (mean, deviation) = (Some(mean).filter(|x| x.is_finite()), Some(deviation).filter(|_| known.len() > 1));
        Self { key, label, explanation, thesis, mean, deviation, values, digits }
    }

    /// A value as it is shown.
    pub fn shown(&self, value: Option<f64>) -> String {
        value.map_or("\u{2013}".to_owned(), |value| format!("{value:.*}", self.digits))
    }

    /// Mean and spread as they are shown.
    pub fn shown_mean(&self) -> String {
        match self.deviation {
            Some(deviation) => {
                format!("{} \u{b1} {deviation:.*}", self.shown(self.mean), self.digits.max(1))
            }
            None => self.shown(self.mean),
        }
    }
}

/// Whether a goal is reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// What is asked for.
    pub goal: String,
    /// How much of it.
    pub needed: String,
    /// Each seed's.
    pub seeds: Vec<SeedVerdict>,
    /// Over all seeds.
    pub met: bool,
}

/// A seed's share in a verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeedVerdict {
    /// The seed.
    pub seed: u64,
    /// What was found.
    pub found: String,
    /// Whether that alone reaches the goal.
    pub met: bool,
}

impl Verdict {
    /// A goal that every seed must reach.
    pub fn every<F>(
        seeds: &[SeedResult<F>],
        goal: &str,
        needed: &str,
        judge: impl Fn(&SeedResult<F>) -> (String, bool),
    ) -> Self {
        Self::most(seeds, goal, needed, 1.0, |seed| {
            let (found, met) = judge(seed);
            (found, met, met)
        })
    }

    /// A goal that a share of the seeds must reach, while none may fall short of another: `judge` tells what was found,
    /// whether that reaches the goal, and whether it can be borne.
    pub fn most<F>(
        seeds: &[SeedResult<F>],
        goal: &str,
        needed: &str,
        share: f64,
        judge: impl Fn(&SeedResult<F>) -> (String, bool, bool),
    ) -> Self {
        let judged: Vec<_> = seeds.iter().map(|seed| (seed.seed, judge(seed))).collect();
        let reached = judged.iter().filter(|(_, (_, met, _))| *met).count() as f64;
        let met = reached >= share * seeds.len() as f64 - 1e-9 && judged.iter().all(|(_, (.., borne))| *borne);
        let seeds = judged.into_iter().map(|(seed, (found, met, _))| SeedVerdict { seed, found, met }).collect();
        Self { goal: goal.to_owned(), needed: needed.to_owned(), seeds, met }
    }

    /// "met" or "missed".
    pub fn word(&self) -> &'static str {
        if self.met { "met" } else { "missed" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seeds(values: &[f64]) -> Vec<SeedResult<f64>> {
        let seed = |(k, &findings): (usize, &f64)| SeedResult {
            seed: k as u64 + 1,
            seconds: 1.0,
            threads: 1,
            trainings: Vec::new(),
            findings,
        };
        values.iter().enumerate().map(seed).collect()
    }

    #[test]
    fn a_goal_for_most_seeds_still_has_a_lowest_bound() {
        let judge = |seed: &SeedResult<f64>| (seed.findings.to_string(), seed.findings >= 12.0, seed.findings >= 11.0);
        let met = |values: &[f64]| Verdict::most(&seeds(values), "g", "n", 0.8, judge).met;
        assert!(met(&[12.0, 12.0, 11.0, 12.0, 12.0]) && met(&[12.0]));
        assert!(!met(&[12.0, 12.0, 10.0, 12.0, 12.0]) && !met(&[11.0, 12.0, 11.0, 12.0, 12.0]) && !met(&[11.0]));
        let every = Verdict::every(&seeds(&[1.0, 2.0]), "g", "n", |seed| (String::new(), seed.findings > 1.5));
        assert_eq!((every.met, every.seeds[0].met, every.seeds[1].met), (false, false, true));
    }

    #[test]
    fn a_summary_shows_mean_and_spread() {
        let measure =
            Measure { key: "k", label: "l", explanation: "", thesis: "", digits: 2, of: |&value| Some(value) };
        let summary = Summary::of(&measure, &seeds(&[1.0, 3.0]));
        assert_eq!(summary.shown_mean(), "2.00 \u{b1} 1.41");
        assert_eq!(Summary::of(&measure, &seeds(&[1.0])).shown_mean(), "1.00");
        let none = Measure { of: |_: &f64| None, ..measure };
        assert_eq!(Summary::of(&none, &seeds(&[1.0])).shown_mean(), "\u{2013}");
    }
}
