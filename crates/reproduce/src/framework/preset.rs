//! The experiments that ship, as they lie in assets/experiments: one place holds the settings.
//!
//! Each study names those of its own networks with [`asset!`](asset).

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

/// Name and text of an experiment file that ships.
macro_rules! asset {
    ($name:literal) => {
        (
            concat!("assets/experiments/", $name),
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/experiments/", $name)),
        )
    };
}
pub(crate) use asset;

impl Preset {
    /// As it is written on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Fast => "fast",
        }
    }
}

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

    const WAVE: Kind =
        Kind { name: "S-CTRNN", suffix: "", presets: [asset!("sinusoid.toml"), asset!("sinusoid_fast.toml")] };

    #[test]
    fn only_keys_that_the_measures_allow_can_be_changed() {
        let changed = |text: &str| WAVE.experiment(Preset::Fast, 1, None, &[text.parse().unwrap()]);
        let decay = changed("training.adam.weight_decay=0.5").unwrap().training.adam.unwrap().weight_decay;
        assert_eq!(decay, 0.5);
        assert_eq!(changed("network.groups.context.units=7").unwrap().network.groups[0].units, 7);
        for refused in ["network.variance=false", "data.task=sinusoid", "data.scaling=fit", "seed=3", "network=1"] {
            let message = changed(refused).unwrap_err().to_string();
            assert!(message.contains("cannot be changed here"), "{refused}: {message}");
        }
    }
}
