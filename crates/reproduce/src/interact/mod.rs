//! The thesis' chapter 5, from two robots in a world to a page.

mod conditions;
mod figures;
mod findings;
mod goals;
mod page;
mod scan;
mod trials;
mod world;

use std::path::Path;

use scrnn_report::Section;
use scrnn_run::experiment::Experiment;

use crate::framework::options::Options;
use crate::framework::{Comparison, Condition, Desk, Film, Job, Measure, Result, Results, Study, Table, Verdict};
use conditions::setting;
use figures::Material;
use findings::Findings;
use trials::Subject;

/// Seed of the recordings: the thesis' networks differ in their first weights alone.
const RECORDINGS: u64 = 1;

/// The experiment.
#[derive(Debug)]
pub struct Interact {
    /// Interactions in the world for each network and mode.
    trials: u64,
    /// Settings of the scan of error regression, at most.
    scanned: usize,
}

/// At its full length.
pub const INTERACT: Interact = Interact { trials: 6, scanned: usize::MAX };

impl Study for Interact {
    type Findings = Findings;
    /// Of the first network of each condition of the thesis.
    type Material = Option<Material>;

    fn title(&self) -> &'static str {
        "Two robots interact"
    }

    fn seed_draws(&self) -> &'static str {
        "initial weights of its own, on the same recordings"
    }

    fn edition(&self) -> u32 {
        2
    }

    fn conditions(&self, beyond: bool) -> Vec<Condition> {
        conditions::ALL.iter().filter(|one| beyond || one.of_thesis).map(|one| one.condition).collect()
    }

    fn prepare(&self, conditions: &[Condition], folder: &Path, threads: usize, desk: &Desk<'_>) -> Result<()> {
        let record = |condition: &Condition| setting(condition.key).record(folder, RECORDINGS, threads, desk);
        conditions.iter().try_for_each(record)
    }

    fn experiment(
        &self,
        condition: &Condition,
        _index: usize,
        seed: u64,
        options: &Options,
        folder: &Path,
    ) -> Result<Experiment> {
        setting(condition.key).experiment(folder, seed, options)
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Findings, Option<Material>)> {
        let (setting, learned) = (setting(job.condition.key), &job.networks[0]);
        let scaled = learned.scaling.apply(&learned.source.data)?;
        let subject = Subject {
            network: &learned.network,
            states: &learned.initial_states,
            scaling: &learned.scaling,
            data: &scaled,
            seed: job.seed,
            desk,
        };
        let findings = Findings::of(setting, &subject, self)?;
        let material = match job.first && setting.of_thesis {
            true => Some(Material::of(setting.condition.key, &subject)?),
            false => None,
        };
        Ok((findings, material))
    }

    fn films(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<Vec<Film>> {
        let (setting, learned) = (setting(job.condition.key), &job.networks[0]);
        if !(job.first && setting.of_thesis) {
            return Ok(Vec::new());
        }
        desk.at(|| format!("{}: a recording", setting.condition.label))?;
        let scaled = learned.scaling.apply(&learned.source.data)?;
        let subject = Subject {
            network: &learned.network,
            states: &learned.initial_states,
            scaling: &learned.scaling,
            data: &scaled,
            seed: job.seed,
            desk,
        };
        Ok(vec![subject.film(setting.condition.key, setting.condition.label)?])
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        goals::measures()
    }

    fn times(&self) -> Vec<Measure<Findings>> {
        goals::times()
    }

    fn comparisons(&self) -> Vec<Comparison> {
        goals::comparisons()
    }

    fn tables(&self, results: &Results<Findings>) -> Vec<Table> {
        let scans = results.jobs.iter().filter_map(|job| job.findings.regression.as_ref());
        let scans: Vec<&[(f64, f64)]> = scans.map(|one| one.scan.as_slice()).collect();
        scan::table(scrnn_sim::interact::CHANNELS.len(), &scans).into_iter().collect()
    }

    fn verdicts(&self, results: &Results<Findings>) -> Vec<Verdict> {
        goals::verdicts(results)
    }

    fn sections(&self, results: &Results<Findings>, materials: &[Option<Material>]) -> Vec<Section> {
        page::sections(results, &materials.iter().flatten().collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests;
