//! The experiments that ship, as they lie in assets/experiments: one place holds the settings.

use serde::Serialize;

use scrnn_run::experiment::{self, Experiment, Override};
use scrnn_run::failure::{Failure, Result};

/// Which settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The thesis' optimiser and number of epochs
    Thesis,
    /// What gets there soonest
    Fast,
}

/// One network of a study.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// What the thesis calls it.
    pub name: &'static str,
    /// Goes behind the seed in the name of its run folder.
    pub suffix: &'static str,
    /// File names and texts of its experiment, thesis and fast.
    pub presets: [(&'static str, &'static str); 2],
}

macro_rules! asset {
    ($name:literal) => {
        (
            concat!("assets/experiments/", $name),
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/experiments/", $name)),
        )
    };
}

/// The S-CTRNN of the Lissajous curves.
pub const LISSAJOUS: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("lissajous.toml"), asset!("lissajous_fast.toml")] };
/// The CTRNN that it is compared with.
pub const LISSAJOUS_CTRNN: Kind = Kind {
    name: "CTRNN",
    suffix: "-ctrnn",
    presets: [asset!("lissajous_ctrnn.toml"), asset!("lissajous_ctrnn_fast.toml")],
};
/// The S-CTRNN of 144 patterns; in the fast preset it has two time constants.
pub const PATTERNS: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("patterns.toml"), asset!("patterns_fast.toml")] };
/// The S-CTRNN of the sine wave.
pub const SINUSOID: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("sinusoid.toml"), asset!("sinusoid_fast.toml")] };
/// The S-CTRNN of the noise-driven oscillator.
pub const LIMIT_CYCLE: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("limit_cycle.toml"), asset!("limit_cycle_fast.toml")] };

/// The S-CTRNN of the reaching experiment.
pub const REACH: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("reaching.toml"), asset!("reaching_fast.toml")] };
/// The same, learned from three exact positions.
pub const REACH_EXACT: Kind = Kind {
    name: "S-CTRNN of exact positions",
    suffix: "-exact",
    presets: [asset!("reaching_exact.toml"), asset!("reaching_exact_fast.toml")],
};
/// The S-MTRNN with initial states held together.
pub const INTERACTION_NARROW: Kind = Kind {
    name: "S-MTRNN",
    suffix: "",
    presets: [asset!("interaction_narrow.toml"), asset!("interaction_narrow_fast.toml")],
};
/// The S-MTRNN whose sequences have initial states of their own.
pub const INTERACTION_WIDE: Kind = Kind {
    name: "S-MTRNN",
    suffix: "",
    presets: [asset!("interaction_wide.toml"), asset!("interaction_wide_fast.toml")],
};

impl Kind {
    /// What the thesis calls the network of `experiment`: one with several time constants is an MTRNN.
    pub fn called(&self, experiment: &Experiment) -> &'static str {
        let several = experiment.network.groups.windows(2).any(|pair| pair[0].time_constant != pair[1].time_constant);
        if several && self.name == "S-CTRNN" { "S-MTRNN" } else { self.name }
    }

    /// The resolved experiment with some of its keys changed. `seed` is that of the weights and of the data's noise alike.
    pub fn experiment(
        &self,
        preset: Preset,
        seed: u64,
        epochs: Option<u64>,
        changed: &[Override],
    ) -> Result<Experiment> {
        let (name, text) = self.presets[preset as usize];
        let mut changes = vec![("--seed", "seed", seed), ("--seed", "data.seed", seed)];
        changes.extend(epochs.map(|epochs| ("--epochs", "training.epochs", epochs)));
        let overrides: std::result::Result<Vec<Override>, String> =
            changes.into_iter().map(|(option, key, value)| Override::shorthand(option, key, value)).collect();
        let mut overrides = overrides.map_err(|message| Failure::input(message, ""))?;
        for change in changed {
            // What is measured is made for the experiment's own data and kind of network; seeds have their own options.
            let free = match change.path.first().map(String::as_str) {
                Some("training") => true,
                Some("network") => change.path.get(1).is_some_and(|key| key != "variance"),
                _ => false,
            };
            if !free {
                let help = "Keys of `training` and `network` can be changed, except `network.variance`; for others write \
                            an experiment file and take `scrnn train` and `scrnn report`.";
                return Err(Failure::input(format!("`{}` cannot be changed here", change.typed), help));
            }
        }
        overrides.extend_from_slice(changed);
        experiment::read_text(name, text, &overrides)?.resolved(std::path::Path::new(""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_sound_experiment_on_unscaled_data() {
        for kind in [LISSAJOUS, LISSAJOUS_CTRNN, PATTERNS, SINUSOID, LIMIT_CYCLE] {
            for preset in [Preset::Thesis, Preset::Fast] {
                let experiment = kind.experiment(preset, 3, Some(7), &[]).unwrap();
                assert_eq!((experiment.seed, experiment.data.seed, experiment.training.epochs), (3, Some(3), 7));
                assert!(experiment.data.task.is_some(), "{}", experiment.name);
                let scaling = serde_json::to_value(&experiment.data.scaling).unwrap();
                assert_eq!(scaling, "none", "{}", experiment.name);
                assert_eq!(experiment.network.variance, kind.name == "S-CTRNN");
            }
        }
    }

    #[test]
    fn a_network_of_several_time_constants_is_called_an_mtrnn() {
        let called = |kind: Kind, preset| kind.called(&kind.experiment(preset, 1, None, &[]).unwrap());
        assert_eq!(called(PATTERNS, Preset::Thesis), "S-CTRNN");
        assert_eq!(called(PATTERNS, Preset::Fast), "S-MTRNN");
        assert_eq!(called(LISSAJOUS_CTRNN, Preset::Fast), "CTRNN");
        assert_eq!(called(INTERACTION_WIDE, Preset::Fast), "S-MTRNN");
    }

    #[test]
    fn the_robot_learns_scaled_angles_by_the_settings_of_chapter_4() {
        for (kind, exact) in [(REACH, false), (REACH_EXACT, true)] {
            for preset in [Preset::Thesis, Preset::Fast] {
                let experiment = kind.experiment(preset, 3, None, &[]).unwrap();
                let (network, data) = (&experiment.network, &experiment.data);
                assert_eq!((network.groups[0].units, network.groups[0].time_constant, network.delay), (30, 2.0, 1));
                assert_eq!((network.initial_state_variance, network.variance_floor), (0.001, 0.0));
                assert_eq!((data.sequences, data.steps, data.exact_positions), (Some(30), Some(180), Some(exact)));
                assert_eq!(serde_json::to_value(&data.scaling).unwrap(), "fit");
            }
            let thesis = kind.experiment(Preset::Thesis, 3, None, &[]).unwrap().training;
            let momentum = thesis.momentum.unwrap();
            assert_eq!((thesis.epochs, momentum.rate, momentum.momentum), (500_000, 1e-4, 0.9));
        }
    }

    #[test]
    fn only_keys_that_the_measures_allow_can_be_changed() {
        let changed = |text: &str| LISSAJOUS.experiment(Preset::Fast, 1, None, &[text.parse().unwrap()]);
        let decay = changed("training.adam.weight_decay=0.5").unwrap().training.adam.unwrap().weight_decay;
        assert_eq!(decay, 0.5);
        assert_eq!(changed("network.groups.context.units=7").unwrap().network.groups[0].units, 7);
        for refused in ["network.variance=false", "data.task=sinusoid", "data.scaling=fit", "seed=3", "network=1"] {
            let message = changed(refused).unwrap_err().to_string();
            assert!(message.contains("cannot be changed here"), "{refused}: {message}");
        }
    }

    #[test]
    fn the_thesis_presets_have_the_settings_of_chapter_3() {
        for (kind, units, epochs, variance, rate) in [
            (LISSAJOUS, 60, 500_000, 100.0, 1e-4),
            (LISSAJOUS_CTRNN, 60, 500_000, 100.0, 1e-2),
            (SINUSOID, 10, 100_000, 1.0, 1e-4),
            (LIMIT_CYCLE, 10, 500_000, 1.0, 1e-4),
        ] {
            let experiment = kind.experiment(Preset::Thesis, 1, None, &[]).unwrap();
            let group = &experiment.network.groups[0];
            assert_eq!((group.units, group.time_constant, experiment.training.epochs), (units, 2.0, epochs));
            assert_eq!(experiment.network.initial_state_variance, variance);
            let momentum = experiment.training.momentum.unwrap();
            assert_eq!((momentum.rate, momentum.momentum), (rate, 0.9));
        }
    }
}
