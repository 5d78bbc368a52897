//! Which networks are trained on which recordings: the thesis' two conditions, and what 5.4.3 asks for beyond them.

use std::path::Path;

use scrnn::dataset::{Dataset, Sequence};
use scrnn_sim::interaction::{CHANNELS, InteractionOptions, random_order, record};

use crate::preset::{INTERACTION_NARROW, INTERACTION_WIDE, Kind, Preset};
use scrnn_data::{self as files, Field};
use scrnn_run::experiment::{Data, Experiment, Override, ScalingChoice, ScalingName};
use scrnn_run::failure::Result;
use scrnn_tasks::interact::{self, BRANCHES};

/// Networks that learn under the same condition.
#[derive(Debug, Clone, Copy)]
pub struct Condition {
    /// Names its run folders and its part of metrics.json.
    pub key: &'static str,
    /// For the eye.
    pub label: &'static str,
    /// The experiment that it departs from.
    pub kind: Kind,
    /// sigma^2_IS, if it is not the experiment's.
    pub variance: Option<f64>,
    /// The share of branchings to the left, if orders are drawn at random; otherwise all orders are learned.
    pub left: Option<f64>,
    /// Whether the thesis has it.
    pub of_thesis: bool,
}

/// Initial states held together.
pub const NARROW: Condition =
    Condition { key: "narrow", label: "narrow", kind: INTERACTION_NARROW, variance: None, left: None, of_thesis: true };
/// Each order with an initial state of its own.
pub const WIDE: Condition = Condition { key: "wide", label: "wide", kind: INTERACTION_WIDE, ..NARROW };

/// What 5.4.3 leaves to the future: variances in between, and branchings with a bias.
pub const BEYOND: [Condition; 5] = [
    between("between-1e-4", "variance 1e-4", 1e-4),
    between("between-1e-3", "variance 0.001", 1e-3),
    between("between-1e-2", "variance 0.01", 1e-2),
    Condition { key: "narrow-biased", label: "narrow, 80 % left", left: Some(0.8), of_thesis: false, ..NARROW },
    Condition { key: "wide-biased", label: "wide, 80 % left", left: Some(0.8), of_thesis: false, ..WIDE },
];

const fn between(key: &'static str, label: &'static str, variance: f64) -> Condition {
    Condition { key, label, variance: Some(variance), of_thesis: false, ..NARROW }
}

impl Condition {
    /// The file of its recordings.
    pub fn file(&self) -> String {
        match self.left {
            None => "recordings.csv".to_owned(),
            Some(left) => format!("recordings-{:.0}-left.csv", 100.0 * left),
        }
    }

    /// The experiment of one network: everything resolved, on the recordings in `folder`.
    pub fn experiment(
        &self,
        folder: &Path,
        preset: Preset,
        seed: u64,
        (epochs, changed): (Option<u64>, &[Override]),
    ) -> Result<Experiment> {
        let mut experiment = self.kind.experiment(preset, seed, epochs, changed)?;
        if let Some(variance) = self.variance {
            experiment.network.initial_state_variance = variance;
        }
        experiment.name = format!("{}_{}", experiment.name, self.key.replace('-', "_"));
        experiment.data = Data {
            task: None,
            sequences: None,
            steps: None,
            seed: None,
            exact_positions: None,
            files: Some(vec![self.file().into()]),
            topic: None,
            period: None,
            channels: None,
            scaling: Some(ScalingChoice::Named(ScalingName::Fit)),
        };
        experiment.resolved(folder)
    }

    /// Makes its recordings, unless they are there.
    pub fn record(&self, folder: &Path, seed: u64, threads: usize) -> Result<Dataset> {
        let path = folder.join(self.file());
        if !path.exists() {
            let data = match self.left {
                None => interact::make(interact::size(), seed, threads)?.data,
                Some(left) => drawn(left, seed)?,
            };
            files::write(&path, &[Field { name: "", data: &data }])?;
        }
        Ok(files::read(&path)?)
    }
}

/// sigma^2_IS of a condition.
pub fn variance_of(condition: &Condition, settings: &[Experiment]) -> Option<f64> {
    let suffix = format!("_{}", condition.key.replace('-', "_"));
    let own = settings.iter().find(|experiment| experiment.name.ends_with(&suffix));
    own.map(|experiment| experiment.network.initial_state_variance)
}

/// As many orders as there are, drawn at random.
fn drawn(left: f64, seed: u64) -> Result<Dataset> {
    let (sequences, steps) = interact::size();
    let options = InteractionOptions::default();
    let rows = (0..sequences).map(|k| {
        let seed = seed.wrapping_add((k as u64) << 32);
        let mut sequence = record(&random_order(BRANCHES, left, seed), &options, seed, steps, |_, _| {})?;
        // An order may come twice; a table tells sequences apart by their names.
        sequence.name = format!("{} {}", sequence.name, k + 1);
        Ok(sequence)
    });
    let rows: scrnn_sim::error::Result<Vec<Sequence>> = rows.collect();
    Ok(Dataset::new(CHANNELS.map(String::from).to_vec(), rows?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_differ_in_variance_and_recordings_alone() {
        let experiment =
            |condition: &Condition| condition.experiment(Path::new("/place"), Preset::Fast, 3, (Some(7), &[])).unwrap();
        let narrow = experiment(&NARROW);
        assert_eq!((narrow.seed, narrow.training.epochs, narrow.network.delay), (3, 7, 5));
        assert_eq!(narrow.data.files, Some(vec!["/place/recordings.csv".into()]));
        for condition in BEYOND.iter().chain([&WIDE]) {
            let other = experiment(condition);
            assert_eq!(other.network.groups, narrow.network.groups);
            assert_eq!(
                variance_of(condition, &[narrow.clone(), other.clone()]),
                Some(other.network.initial_state_variance)
            );
        }
        assert_eq!(narrow.network.initial_state_variance, 1e-5);
        assert_eq!(experiment(&WIDE).network.initial_state_variance, 10.0);
        assert_eq!(experiment(&BEYOND[1]).network.initial_state_variance, 1e-3);
        assert_eq!(experiment(&BEYOND[4]).data.files, Some(vec!["/place/recordings-80-left.csv".into()]));
    }

    #[test]
    fn the_thesis_presets_have_the_settings_of_chapter_5() {
        for (condition, variance) in [(NARROW, 1e-5), (WIDE, 10.0)] {
            let experiment = condition.experiment(Path::new("/place"), Preset::Thesis, 1, (None, &[])).unwrap();
            let [fast, slow] = experiment.network.groups.as_slice() else { panic!("two groups") };
            assert_eq!((fast.units, fast.time_constant, slow.units, slow.time_constant), (30, 5.0, 10, 100.0));
            assert_eq!((experiment.training.epochs, experiment.network.initial_state_variance), (500_000, variance));
            let momentum = experiment.training.momentum.unwrap();
            assert_eq!((momentum.rate, momentum.momentum), (1e-4, 0.9));
            let adaptive = momentum.adaptive_rate.unwrap();
            assert_eq!((adaptive.max_error_ratio, adaptive.decrease, adaptive.increase), (1.1, 0.7, 1.05));
        }
    }
}
