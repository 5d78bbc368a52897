//! Whether goals are reached. Goals are of science; how long something takes is reported beside them, and never judged.

use serde::Serialize;

use super::job_result::JobResult;
use super::measure::Summary;

/// Whether a goal is reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// What is asked for.
    pub goal: String,
    /// How much of it.
    pub needed: String,
    /// What was found over all seeds; none where each seed is judged by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<String>,
    /// Each seed's; empty where all are judged together.
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
        jobs: &[JobResult<F>],
        goal: &str,
        needed: &str,
        judge: impl Fn(&JobResult<F>) -> (String, bool),
    ) -> Self {
        Self::most(jobs, goal, needed, 1.0, |seed| {
            let (found, met) = judge(seed);
            (found, met, met)
        })
    }

    /// A goal that a share of the seeds must reach, while none may fall short of another: `judge` tells what was found,
    /// whether that reaches the goal, and whether it can be borne.
    pub fn most<F>(
        jobs: &[JobResult<F>],
        goal: &str,
        needed: &str,
        share: f64,
        judge: impl Fn(&JobResult<F>) -> (String, bool, bool),
    ) -> Self {
        let judged: Vec<_> = jobs.iter().map(|job| (job.seed, judge(job))).collect();
        let reached = judged.iter().filter(|(_, (_, met, _))| *met).count() as f64;
        let met = reached >= share * jobs.len() as f64 - 1e-9 && judged.iter().all(|(_, (.., borne))| *borne);
        let seeds = judged.into_iter().map(|(seed, (found, met, _))| SeedVerdict { seed, found, met }).collect();
        Self { goal: goal.to_owned(), needed: needed.to_owned(), found: None, seeds, met }
    }

    /// A goal for all seeds together.
    pub fn overall(goal: &str, needed: &str, found: String, met: bool) -> Self {
        Self { goal: goal.to_owned(), needed: needed.to_owned(), found: Some(found), seeds: Vec::new(), met }
    }

    /// A goal for a measure over all seeds.
    pub fn of_measure(goal: &str, needed: &str, summary: &Summary, met: impl Fn(&Summary) -> bool) -> Self {
        let (least, most) = summary.extent();
        let mean = summary.mean.unwrap_or(f64::NAN);
        let found = format!("{mean:.2}, from {least:.2} to {most:.2}");
        Self::overall(goal, needed, found, met(summary))
    }

    /// "met" or "missed".
    pub fn word(&self) -> &'static str {
        if self.met { "met" } else { "missed" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jobs(values: &[f64]) -> Vec<JobResult<f64>> {
        let job = |(k, &findings): (usize, &f64)| JobResult {
            condition: None,
            seed: k as u64 + 1,
            seconds: 1.0,
            seconds_of_evaluation: 1.0,
            threads: 1,
            trainings: Vec::new(),
            findings,
        };
        values.iter().enumerate().map(job).collect()
    }

    #[test]
    fn a_goal_for_most_seeds_still_has_a_lowest_bound() {
        let judge = |job: &JobResult<f64>| (job.findings.to_string(), job.findings >= 12.0, job.findings >= 11.0);
        let met = |values: &[f64]| Verdict::most(&jobs(values), "g", "n", 0.8, judge).met;
        assert!(met(&[12.0, 12.0, 11.0, 12.0, 12.0]) && met(&[12.0]));
        assert!(!met(&[12.0, 12.0, 10.0, 12.0, 12.0]) && !met(&[11.0, 12.0, 11.0, 12.0, 12.0]) && !met(&[11.0]));
        let every = Verdict::every(&jobs(&[1.0, 2.0]), "g", "n", |job| (String::new(), job.findings > 1.5));
        assert_eq!((every.met, every.seeds[0].met, every.seeds[1].met), (false, false, true));
    }
}
