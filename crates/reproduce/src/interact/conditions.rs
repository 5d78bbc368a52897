//! Which networks are trained on which recordings: the thesis' two conditions, and what 5.4.3 asks for beyond them.

use std::path::Path;

use scrnn_data::{self as files, Field};
use scrnn_run::experiment::{Data, Experiment, ScalingChoice, ScalingName};
use scrnn_tasks::interact;

use crate::framework::options::Options;
use crate::framework::preset::asset;
use crate::framework::{Condition, Desk, Kind, Result};

/// The S-MTRNN with initial states held together.
const HELD_TOGETHER: Kind = Kind {
    name: "S-MTRNN",
    suffix: "",
    presets: [asset!("interaction_narrow.toml"), asset!("interaction_narrow_fast.toml")],
};
/// The S-MTRNN whose sequences have initial states of their own.
const FREE: Kind = Kind {
    name: "S-MTRNN",
    suffix: "",
    presets: [asset!("interaction_wide.toml"), asset!("interaction_wide_fast.toml")],
};
/// Networks for each condition beyond the thesis.
const NETWORKS_BEYOND: u64 = 3;

/// A condition, and what is set for it.
#[derive(Debug, Clone, Copy)]
pub struct Setting {
    /// The condition.
    pub condition: Condition,
    /// sigma^2_IS, if it is not the experiment's.
    pub variance: Option<f64>,
    /// The share of branchings to the left, if orders are drawn at random; otherwise all orders are learned.
    pub left: Option<f64>,
    /// Whether the thesis has it.
    pub of_thesis: bool,
}

/// Initial states held together.
pub const NARROW: Setting = thesis("narrow", &[HELD_TOGETHER]);
/// Each order with an initial state of its own.
pub const WIDE: Setting = thesis("wide", &[FREE]);

/// The thesis' conditions, and what 5.4.3 leaves to the future: variances in between, and branchings with a bias.
pub static ALL: [Setting; 7] = [
    NARROW,
    WIDE,
    between("between-1e-4", "variance 1e-4", 1e-4),
    between("between-1e-3", "variance 0.001", 1e-3),
    between("between-1e-2", "variance 0.01", 1e-2),
    biased("narrow-biased", "narrow, 80 % left", &[HELD_TOGETHER]),
    biased("wide-biased", "wide, 80 % left", &[FREE]),
];

const fn thesis(key: &'static str, networks: &'static [Kind]) -> Setting {
    let condition = Condition { key, label: key, networks, most: None };
    Setting { condition, variance: None, left: None, of_thesis: true }
}

const fn between(key: &'static str, label: &'static str, variance: f64) -> Setting {
    let condition = Condition { key, label, networks: &[HELD_TOGETHER], most: Some(NETWORKS_BEYOND) };
    Setting { condition, variance: Some(variance), left: None, of_thesis: false }
}

const fn biased(key: &'static str, label: &'static str, networks: &'static [Kind]) -> Setting {
    let condition = Condition { key, label, networks, most: Some(NETWORKS_BEYOND) };
    Setting { condition, variance: None, left: Some(0.8), of_thesis: false }
}

/// What is set for a condition.
pub fn setting(key: &str) -> &'static Setting {
    ALL.iter().find(|setting| setting.condition.key == key).unwrap_or(&ALL[0])
}

impl Setting {
    /// The file of its recordings.
    pub fn file(&self) -> String {
        match self.left {
            None => "recordings.csv".to_owned(),
            Some(left) => format!("recordings-{:.0}-left.csv", 100.0 * left),
        }
    }

    /// The experiment of one network: everything resolved, on the recordings in `folder`.
    pub fn experiment(&self, folder: &Path, seed: u64, options: &Options) -> Result<Experiment> {
        let kind = &self.condition.networks[0];
        let mut experiment = kind.experiment(options.preset, seed, options.epochs, &options.set)?;
        if let Some(variance) = self.variance {
            experiment.network.initial_state_variance = variance;
        }
        experiment.name = format!("{}_{}", experiment.name, self.condition.key.replace('-', "_"));
        experiment.data = Data {
            files: Some(vec![self.file().into()]),
            scaling: Some(ScalingChoice::Named(ScalingName::Fit)),
            ..Data::default()
        };
        Ok(experiment.resolved(folder)?)
    }

    /// Makes its recordings, unless they are there.
    pub fn record(&self, folder: &Path, seed: u64, threads: usize, desk: &Desk<'_>) -> Result<()> {
        let path = folder.join(self.file());
        if path.exists() {
            return Ok(());
        }
        desk.say(&format!("{}: recordings of two robots", self.condition.label));
        let (sequences, steps) = interact::size();
        let at = |k: usize| desk.at(|| format!("{}: recording {} of {sequences}", self.condition.label, k + 1));
        let data = match self.left {
            None => interact::make_while((sequences, steps), seed, threads, at)?.data,
            Some(left) => interact::drawn_while(left, (sequences, steps), seed, threads, at)?,
        };
        Ok(files::write(&path, &[Field { name: "", data: &data }])?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framework::preset::Preset;

    fn options(preset: Preset, epochs: Option<u64>) -> Options {
        let (seeds, seed, out, set) = (1, 1, None, Vec::new());
        Options { preset, seeds, seed, out, epochs, set, beyond: false, overwrite: false }
    }

    #[test]
    fn conditions_differ_in_variance_and_recordings_alone() {
        let experiment =
            |setting: &Setting| setting.experiment(Path::new("/place"), 3, &options(Preset::Fast, Some(7))).unwrap();
        let narrow = experiment(&NARROW);
        assert_eq!((narrow.seed, narrow.training.epochs, narrow.network.delay), (3, 7, 5));
        assert_eq!(narrow.data.files, Some(vec!["/place/recordings.csv".into()]));
        for setting in &ALL {
            assert_eq!(experiment(setting).network.groups, narrow.network.groups);
        }
        assert_eq!(narrow.network.initial_state_variance, 1e-5);
        assert_eq!(experiment(&WIDE).network.initial_state_variance, 10.0);
        assert_eq!(experiment(&ALL[3]).network.initial_state_variance, 1e-3);
        assert_eq!(experiment(&ALL[6]).data.files, Some(vec!["/place/recordings-80-left.csv".into()]));
        assert!(ALL.iter().all(|one| setting(one.condition.key).condition.label == one.condition.label));
    }

    /// The sweep that ships comes to the bytes of the study's checkpoints, but for names and for where the data lie.
    #[test]
    fn the_sweep_of_the_seven_conditions_comes_to_the_same_checkpoints() {
        use scrnn::checkpoint::Checkpoint;
        use scrnn_run::interrupt::Interrupt;
        use scrnn_run::messages::Silent;
        use scrnn_run::training::{Found, train};
        use scrnn_sweep::file::SweepFile;
        use scrnn_sweep::plan::Plan;

        let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/sweeps/interaction.toml");
        let mut file = SweepFile::read(&place).unwrap();
        // In short: three orders of 60 samples, five epochs.
        for (key, value) in [("training.epochs", 5), ("data.sequences", 3), ("data.steps", 60)] {
            file.set.insert(key.to_owned(), toml::Value::Integer(value));
        }
        let plan = Plan::of(file, place).unwrap();
        assert_eq!((plan.settings.len(), plan.runs.len()), (7, 21));
        let folder = tempfile::tempdir().unwrap();
        // As `record` makes them, in short.
        let size = (3, 60);
        let all = interact::make(size, 1, 2).unwrap().data;
        let left = interact::drawn_while::<scrnn_sim::error::Error>(0.8, size, 1, 2, |_| Ok(())).unwrap();
        for (setting, data) in [(&ALL[0], &all), (&ALL[5], &left)] {
            files::write(&folder.path().join(setting.file()), &[Field { name: "", data }]).unwrap();
        }
        let seed = 2;
        let checkpoint = |experiment: &Experiment, name: &str| {
            let run = folder.path().join(name);
            let engine = scrnn::engine::Engine::serial();
            let asked = (&engine, &Interrupt::new());
            train(experiment, (&run, Found::Refuse), asked, Box::new(Silent), &Silent).unwrap();
            let file = files::read_bytes(&run.join("checkpoint.safetensors")).unwrap();
            let mut checkpoint = Checkpoint::from_bytes(&file).unwrap();
            checkpoint.notes["experiment"]["name"] = "one".into();
            checkpoint.notes["experiment"]["data"] = "these".into();
            checkpoint.to_bytes().unwrap()
        };
        for (setting, planned) in ALL.iter().zip(&plan.settings) {
            let key = setting.condition.key;
            assert_eq!(planned.name, key);
            let run = plan.runs.iter().find(|run| run.folder == format!("{key}/seed-{seed}")).unwrap();
            let swept = checkpoint(&plan.experiment(run).unwrap(), &format!("swept-{key}"));
            let study = setting.experiment(folder.path(), seed, &options(Preset::Fast, Some(5))).unwrap();
            assert!(swept == checkpoint(&study, &format!("study-{key}")), "{key}");
        }
    }

    #[test]
    fn the_thesis_presets_have_the_settings_of_chapter_5() {
        for (setting, variance) in [(NARROW, 1e-5), (WIDE, 10.0)] {
            let experiment = setting.experiment(Path::new("/place"), 1, &options(Preset::Thesis, None)).unwrap();
            let [fast, slow] = experiment.network.groups.as_slice() else { panic!("two groups") };
            assert_eq!((fast.units, fast.time_constant, slow.units, slow.time_constant), (30, 5.0, 10, 100.0));
            assert_eq!((experiment.training.epochs, experiment.network.initial_state_variance), (500_000, variance));
            let momentum = experiment.training.momentum.unwrap();
            assert_eq!((momentum.rate, momentum.momentum), (1e-4, 0.9));
            let adaptive = momentum.adaptive_rate.unwrap();
            assert_eq!((adaptive.max_error_ratio, adaptive.decrease, adaptive.increase), (1.1, 0.7, 1.05));
        }
        let wide = FREE.experiment(Preset::Fast, 1, None, &[]).unwrap();
        assert_eq!(FREE.called(&wide), "S-MTRNN");
    }
}
