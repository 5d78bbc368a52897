//! The sweep file: which networks, and what is done with each.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use scrnn_run::experiment;
use scrnn_run::failure::{Failure, Result};
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::then::Then;

/// Most seeds of a setting.
pub const MOST_SEEDS: u64 = 10_000;

/// Many networks: a base experiment, what varies, and what is done with each network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "scrnn sweep")]
pub struct SweepFile {
    /// Its name. The folder is called after it: runs/NAME.
    pub name: String,
    /// What all networks begin from, relative to this file: an experiment file; or data, for which settings are chosen as `scrnn train`
    /// does. Needed unless each condition has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<PathBuf>,
    /// How many seeds each setting gets, from 1 on; or a list of them; or { from, count }. Default 1.
    #[serde(default)]
    pub seeds: Seeds,
    /// The keys that a seed sets. Default: `seed`, that of the weights alone. With "data.seed" too, a task's data are made anew.
    #[serde(default = "weights_alone")]
    pub seeded: Vec<String>,
    /// Keys of the experiment that are the same for all networks.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub set: Table,
    /// Knobs: keys of the experiment, each with a list of values or a range { from, to, count, scale = "linear" or "log" }. Every value
    /// is combined with every value of the others.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub grid: Table,
    /// Knobs whose values are drawn at random, all together `draws` times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<Random>,
    /// Settings that differ in several keys at once, or begin from experiments of their own. Each is combined with the grid and the draws.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<Condition>,
    /// What is done with each trained network, and what is measured.
    #[serde(default)]
    pub then: Then,
}

fn weights_alone() -> Vec<String> {
    vec!["seed".to_owned()]
}

/// Which seeds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "seeds is a number as 10, a list as [1, 5, 9] or { from = 1, count = 10 }")]
pub enum Seeds {
    /// So many, from 1 on.
    Count(u64),
    /// These.
    List(Vec<u64>),
    /// So many from one on.
    From(SeedsFrom),
}

/// Seeds in a row.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeedsFrom {
    /// The first.
    pub from: u64,
    /// How many.
    pub count: u64,
}

impl Default for Seeds {
    fn default() -> Self {
        Self::Count(1)
    }
}

/// Knobs whose values are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Random {
    /// How many settings are drawn. More draws begin with the same ones.
    pub draws: u64,
    /// Seed of the draws. Default 1.
    #[serde(default = "one")]
    pub seed: u64,
    /// Keys of the experiment, each with a list of values or a range { from, to, scale = "linear" or "log" }. Drawn numbers are rounded to
    /// four digits; ranges between whole numbers give whole numbers.
    #[serde(flatten)]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub knobs: Table,
}

fn one() -> u64 {
    1
}

/// A setting with a name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Names it in folders, tables and figures.
    pub name: String,
    /// The experiment that it begins from, in place of the sweep's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<PathBuf>,
    /// Its seeds, in place of the sweep's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seeds: Option<Seeds>,
    /// Keys of the experiment that it sets.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub set: Table,
}

impl SweepFile {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`Failure::Disk`]; [`Failure::Input`] with the place that is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = scrnn_data::read_bytes(path)?;
        let text = String::from_utf8(bytes)
            .map_err(|_| Failure::input(format!("{} is not text", path.display()), "save the file as UTF-8"))?;
        Self::of_text(&path.display().to_string(), &text)
    }

    /// The sweep in `text`, which stands in a file called `name`.
    ///
    /// # Errors
    /// [`Failure::Input`].
    pub fn of_text(name: &str, text: &str) -> Result<Self> {
        let file: Self = experiment::table(name, text).map_err(|failure| match failure {
            // Who gives an experiment file here wants to train one network.
            failure if ["data", "network", "training"].iter().any(|key| failure.to_string().contains(&format!("field `{key}`"))) => Failure::input(
                format!("{name} is an experiment file, not a sweep file"),
                format!(
                    "train one network with `scrnn train {name}`, or name it in a sweep file: experiment = \"{name}\""
                ),
            ),
            failure => failure,
        })?;
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<()> {
        let allowed = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ');
        let is_name =
            |name: &str| !name.trim_matches(['.', ' ']).is_empty() && name.chars().all(allowed) && name.len() <= 100;
        if !is_name(&self.name) {
            let help = "a name has letters, digits, - _ . and spaces: a folder is called after it";
            return Err(Failure::input(format!("the sweep's name is {:?}", self.name), help));
        }
        if self.experiment.is_none()
            && (self.conditions.is_empty() || self.conditions.iter().any(|one| one.experiment.is_none()))
        {
            let help = "add e.g. experiment = \"mine.toml\"; paths are relative to the sweep file";
            return Err(Failure::input("the sweep has no `experiment` to begin from", help));
        }
        for (k, condition) in self.conditions.iter().enumerate() {
            if !is_name(&condition.name) || self.conditions[..k].iter().any(|other| other.name == condition.name) {
                let message = format!("condition {} is called {:?}", k + 1, condition.name);
                return Err(Failure::input(
                    message,
                    "give each condition a name of its own, of letters, digits, - _ . and spaces",
                ));
            }
        }
        for seeds in std::iter::once(&self.seeds).chain(self.conditions.iter().filter_map(|one| one.seeds.as_ref())) {
            seeds.check()?;
        }
        if let Some(random) = &self.random
            && (!(1..=100_000).contains(&random.draws) || random.knobs.is_empty())
        {
            let message = format!("[random] has {} draws of {} knobs", random.draws, random.knobs.len());
            return Err(Failure::input(message, "give 1 to 100000 draws, and keys with lists or ranges to draw from"));
        }
        if self.seeded.is_empty() {
            return Err(Failure::input("`seeded` names no key", "give [\"seed\"], or leave it out"));
        }
        self.then.check()
    }
}

impl Seeds {
    fn check(&self) -> Result<()> {
        let fits = |seed: u64| i64::try_from(seed).is_ok();
        let help = "give 1 to 10000 seeds, each once, from 0 to 9223372036854775807";
        let sound = match self {
            Self::Count(count) => (1..=MOST_SEEDS).contains(count),
            Self::List(list) => {
                let mut sorted = list.clone();
                sorted.sort_unstable();
                sorted.dedup();
                !list.is_empty()
                    && list.len() as u64 <= MOST_SEEDS
                    && sorted.len() == list.len()
                    && list.iter().all(|&seed| fits(seed))
            }
            Self::From(SeedsFrom { from, count }) => {
                (1..=MOST_SEEDS).contains(count) && from.checked_add(*count).is_some_and(fits)
            }
        };
        match sound {
            true => Ok(()),
            false => Err(Failure::input("there is something wrong with `seeds`", help)),
        }
    }

    /// All of them.
    #[must_use]
    pub fn all(&self) -> Vec<u64> {
        match self {
            Self::Count(count) => (1..=*count).collect(),
            Self::List(list) => list.clone(),
            Self::From(SeedsFrom { from, count }) => (*from..*from + *count).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<SweepFile> {
        SweepFile::of_text("s.toml", &format!("name = \"s\"\nexperiment = \"e.toml\"\n{text}"))
    }

    #[test]
    fn seeds_are_a_number_a_list_or_a_beginning() {
        assert_eq!(read("seeds = 3").unwrap().seeds.all(), [1, 2, 3]);
        assert_eq!(read("seeds = [7, 2]").unwrap().seeds.all(), [7, 2]);
        assert_eq!(read("seeds = { from = 5, count = 2 }").unwrap().seeds.all(), [5, 6]);
        assert_eq!(read("").unwrap().seeds.all(), [1]);
        for wrong in [
            "0",
            "[]",
            "[1, 1]",
            "10001",
            "{ from = 9223372036854775807, count = 2 }",
            "\"x\"",
            "{ from = 1, cuont = 2 }",
        ] {
            assert!(read(&format!("seeds = {wrong}")).is_err(), "{wrong}");
        }
    }

    #[test]
    fn unknown_keys_are_told_with_the_nearest_name() {
        let told = format!("{:?}", read("seed = 3").unwrap_err());
        assert!(told.contains("did you mean `seeds`"), "{told}");
        let told = format!("{:?}", read("[then.evalute]\n").unwrap_err());
        assert!(told.contains("did you mean `evaluate`"), "{told}");
        let told = read("[network]\ndelay = 1\n").unwrap_err().to_string();
        assert!(told.contains("is an experiment file"), "{told}");
    }

    #[test]
    fn what_cannot_be_a_sweep_is_refused() {
        for text in
            ["[random]\ndraws = 0\na = [1]", "[random]\ndraws = 3", "seeded = []", "[[conditions]]\nname = \"a/b\""]
        {
            assert!(read(text).is_err(), "{text}");
        }
        assert!(SweepFile::of_text("s.toml", "name = \"s\"").unwrap_err().to_string().contains("no `experiment`"));
        assert!(SweepFile::of_text("s.toml", "name = \"../s\"\nexperiment = \"e\"").is_err());
        let twice = "[[conditions]]\nname = \"a\"\n[[conditions]]\nname = \"a\"\n";
        assert!(read(twice).unwrap_err().to_string().contains("condition 2"));
    }

    #[test]
    fn the_schema_knows_every_key() {
        let schema = serde_json::to_string(&schemars::schema_for!(SweepFile)).unwrap();
        for key in
            ["experiment", "seeds", "seeded", "grid", "random", "draws", "conditions", "then", "measures", "recognise"]
        {
            assert!(schema.contains(&format!("\"{key}\"")), "{key}");
        }
    }
}
