//! All runs of a sweep: which settings there are, with which seeds, and where each lies.
//!
//! A plan is made of the sweep file alone and is the same wherever it is made: workers need not agree on anything but the file. Its digest
//! in the folder, `plan.json`, is for whoever reads the folder without the file.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use scrnn::streams::{Purpose, stream};
use scrnn_run::experiment::{Base, Experiment, HeldOut, HeldOutDrawn, Override};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::notes::learned_part;
use scrnn_run::request::Request;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use toml::{Table, Value};

use crate::axes::{Axis, axes};
use crate::file::SweepFile;

/// The plan, for whoever reads the folder.
pub const PLAN: &str = "plan.json";
/// Most runs of a sweep.
const MOST_RUNS: usize = 1_000_000;
/// The longest name of a setting; what is longer is cut, and told apart by a digest.
const LONGEST: usize = 120;
/// What lies in the folder beside the settings.
const TAKEN: [&str; 6] = [PLAN, "figures", "report.html", "metrics.csv", "slurm", "sweep.sh"];

/// All that is to be trained.
#[derive(Debug)]
pub struct Plan {
    /// The sweep's file.
    pub file: SweepFile,
    /// Where that file lies.
    pub place: PathBuf,
    /// The keys that differ between settings, dotted.
    pub knobs: Vec<String>,
    /// The settings.
    pub settings: Vec<Setting>,
    /// A network each: setting after setting, with all seeds of each.
    pub runs: Vec<Run>,
    bases: Vec<Base>,
    folders: Vec<PathBuf>,
}

/// The values of all knobs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// What differs, in short: it names the folder.
    pub name: String,
    /// The name of its condition, if the sweep has some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The value of each knob.
    pub values: Vec<serde_json::Value>,
    #[serde(skip)]
    changes: Vec<Override>,
    #[serde(skip)]
    base: usize,
}

/// One network.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Its folder in that of the sweep.
    pub folder: String,
    /// The place of its setting.
    pub setting: usize,
    /// Its seed.
    pub seed: u64,
}

/// What `plan.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// Grows when a key changes its meaning.
    pub format: u32,
    /// The sweep's name.
    pub name: String,
    /// The keys that differ, dotted.
    pub knobs: Vec<String>,
    /// The measures that are asked for, the first of which says which setting is best; all where there are none.
    pub measures: Vec<String>,
    /// The settings.
    pub settings: Vec<Setting>,
    /// The runs.
    pub runs: Vec<Run>,
}

impl Plan {
    /// Plans the sweep whose file stands at `path`, and checks every setting.
    ///
    /// # Errors
    /// What is wrong with the file, the experiment or a setting.
    pub fn read(path: &Path) -> Result<Self> {
        let file = SweepFile::read(path)?;
        let place = std::path::absolute(path).map_err(|error| Failure::disk("find", path, error))?;
        Self::of(file, place)
    }

    /// Plans a sweep; paths in `file` start from the folder of `place`.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn of(file: SweepFile, place: PathBuf) -> Result<Self> {
        let folder = place.parent().unwrap_or(Path::new("")).to_owned();
        let (mut bases, mut folders) = (Vec::new(), Vec::new());
        let mut base_of = |path: &Path| -> Result<usize> {
            let (base, own) = begin_from(&folder.join(path))?;
            bases.push(base);
            folders.push(own);
            Ok(bases.len() - 1)
        };
        let usual = file.experiment.as_ref().map(|path| base_of(path)).transpose()?;
        let mut conditions = Vec::new();
        for condition in &file.conditions {
            let own = condition.experiment.as_ref().map(|path| base_of(path)).transpose()?;
            conditions.push(Combined {
                condition: Some(condition.name.clone()),
                base: own.or(usual).unwrap_or(0),
                seeds: condition.seeds.as_ref().unwrap_or(&file.seeds).all(),
                changes: flat(&condition.set),
                values: Vec::new(),
            });
        }
        if conditions.is_empty() {
            let seeds = file.seeds.all();
            conditions.push(Combined {
                condition: None,
                base: usual.unwrap_or(0),
                seeds,
                changes: Vec::new(),
                values: Vec::new(),
            });
        }
        let grid = axes("grid", &file.grid)?;
        let drawn = file.random.as_ref().map(|random| axes("random", &random.knobs)).transpose()?.unwrap_or_default();
        no_key_twice(&file, &grid, &drawn)?;
        let mut all = conditions;
        for axis in &grid {
            let values = axis.all()?;
            check_size(all.len().saturating_mul(values.len()))?;
            all = all.iter().flat_map(|one| values.iter().map(|value| one.with([(axis, value.clone())]))).collect();
        }
        if let Some(random) = &file.random {
            let count = usize::try_from(random.draws).unwrap_or(usize::MAX);
            check_size(all.len().saturating_mul(count))?;
            let draw = |index: u64| {
                let mut rng = stream(random.seed, Purpose::SweepDraws, index);
                drawn.iter().map(|axis| axis.draw(&mut rng)).collect::<Vec<Value>>()
            };
            let draws: Vec<Vec<Value>> = (0..random.draws).map(draw).collect();
            all =
                all.iter().flat_map(|one| draws.iter().map(|draw| one.with(drawn.iter().zip(draw.clone())))).collect();
        }
        let knobs: Vec<String> = grid.iter().chain(&drawn).map(Axis::name).collect();
        let same = flat(&file.set);
        let short = short_names(&knobs);
        let (mut names, mut settings, mut runs) = (HashSet::new(), Vec::new(), Vec::new());
        check_size(all.iter().map(|one| one.seeds.len()).sum())?;
        for one in all {
            let name = unused(&one.name(&short), &mut names);
            let mut changes = same.clone();
            changes.extend(one.changes);
            for &seed in &one.seeds {
                let folder = if name.is_empty() { format!("seed-{seed}") } else { format!("{name}/seed-{seed}") };
                runs.push(Run { folder, setting: settings.len(), seed });
            }
            let values = one.values.iter().map(json).collect();
            settings.push(Setting { name, condition: one.condition, values, changes, base: one.base });
        }
        let plan = Self { file, place, knobs, settings, runs, bases, folders };
        plan.check()?;
        Ok(plan)
    }

    /// Every setting must be an experiment: nobody wants to learn that after a night.
    fn check(&self) -> Result<()> {
        let mut checked = HashSet::new();
        for run in self.runs.iter().filter(|run| checked.insert(run.setting)) {
            let experiment = self.bare(run)?;
            if experiment.training.members.is_some_and(|members| members > 1) {
                let message =
                    "the experiment trains a mixture (`training.members`), and a sweep trains single networks";
                return Err(Failure::input(
                    message,
                    "leave `training.members` out: `seeds` says how many networks each setting gets",
                ));
            }
        }
        Ok(())
    }

    /// The experiment of a run, with every value explicit.
    ///
    /// # Errors
    /// None for a run of this plan, but where the current folder is not known.
    pub fn experiment(&self, run: &Run) -> Result<Experiment> {
        self.bare(run)?.resolved(&self.folders[self.settings[run.setting].base])
    }

    fn bare(&self, run: &Run) -> Result<Experiment> {
        let setting = &self.settings[run.setting];
        let base = &self.bases[setting.base];
        let mut changes = setting.changes.clone();
        for key in &self.file.seeded {
            changes.push(change(key.split('.').map(str::to_owned).collect(), Value::Integer(run.seed.cast_signed())));
        }
        let mut experiment = base.with(&changes)?;
        // All seeds are judged by the same sequences.
        if let Some(HeldOut::Share(share)) = experiment.data.held_out {
            experiment.data.held_out = Some(HeldOut::Drawn(HeldOutDrawn { share, seed: 1 }));
        }
        Ok(experiment)
    }

    /// A digest of everything that decides a run's files: its experiment, but for where its data lie, and what is done with the network.
    ///
    /// # Errors
    /// As [`Plan::experiment`].
    pub fn decided_by(&self, run: &Run) -> Result<String> {
        let mut experiment = self.experiment(run)?;
        experiment.data.files = None;
        if let Some(HeldOut::Files(_)) = experiment.data.held_out {
            experiment.data.held_out = None;
        }
        let mut then = serde_json::to_value(&self.file.then).unwrap_or_default();
        if let Some(then) = then.as_object_mut() {
            then.remove("measures");
        }
        let text = format!("{}\n{then}", learned_part(&experiment));
        Ok(Sha256::digest(text.as_bytes()).iter().take(16).map(|byte| format!("{byte:02x}")).collect())
    }

    /// What `plan.json` says.
    #[must_use]
    pub fn listed(&self) -> Listed {
        Listed {
            format: 1,
            name: self.file.name.clone(),
            knobs: self.knobs.clone(),
            measures: self.file.then.measures.clone(),
            settings: self.settings.clone(),
            runs: self.runs.clone(),
        }
    }

    /// The places of all runs in the order in which they are best worked on: settings take turns, so that whatever is interrupted has
    /// networks of each.
    #[must_use]
    pub fn order(&self) -> Vec<usize> {
        let mut seen = vec![0_usize; self.settings.len()];
        let mut order: Vec<(usize, usize)> = Vec::with_capacity(self.runs.len());
        for (place, run) in self.runs.iter().enumerate() {
            order.push((seen[run.setting], place));
            seen[run.setting] += 1;
        }
        order.sort_unstable();
        order.into_iter().map(|(_, place)| place).collect()
    }
}

impl Listed {
    /// Reads the plan of a sweep's folder.
    ///
    /// # Errors
    /// [`Failure::Input`] for a folder without one.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PLAN);
        if !path.is_file() {
            let help = "give the folder that `scrnn sweep` wrote";
            return Err(Failure::input(
                format!("{} is not the folder of a sweep: it holds no {PLAN}", folder.display()),
                help,
            ));
        }
        let bytes = scrnn_data::read_bytes(&path)?;
        let listed: Self = serde_json::from_slice(&bytes).map_err(|error| {
            Failure::input(
                format!("{} cannot be read: {error}", path.display()),
                "call `scrnn sweep` again: it writes the plan anew",
            )
        })?;
        let sound = listed.runs.iter().all(|run| run.setting < listed.settings.len() && is_inside(&run.folder))
            && listed.settings.iter().all(|setting| setting.values.len() == listed.knobs.len());
        match sound {
            true => Ok(listed),
            false => Err(Failure::input(
                format!("{} contradicts itself", path.display()),
                "call `scrnn sweep` again: it writes the plan anew",
            )),
        }
    }

    /// As the file's text.
    #[must_use]
    pub fn text(&self) -> String {
        serde_json::to_string(self).expect("strings, numbers and lists become JSON") + "\n"
    }
}

/// Whether a path leads below the folder that it starts from.
fn is_inside(path: &str) -> bool {
    let is_plain = |part: std::path::Component<'_>| matches!(part, std::path::Component::Normal(_));
    !path.is_empty() && Path::new(path).components().all(is_plain)
}

/// A setting while it is put together.
struct Combined {
    condition: Option<String>,
    base: usize,
    seeds: Vec<u64>,
    changes: Vec<Override>,
    values: Vec<Value>,
}

impl Combined {
    fn with<'a>(&self, knobs: impl IntoIterator<Item = (&'a Axis, Value)>) -> Self {
        let (mut changes, mut values) = (self.changes.clone(), self.values.clone());
        for (axis, value) in knobs {
            changes.push(change(axis.key.clone(), value.clone()));
            values.push(value);
        }
        Self { condition: self.condition.clone(), base: self.base, seeds: self.seeds.clone(), changes, values }
    }

    /// `condition,knob=value,...`
    fn name(&self, short: &[String]) -> String {
        let knobs = short.iter().zip(&self.values).map(|(knob, value)| format!("{knob}={}", shown(&json(value))));
        self.condition.iter().cloned().chain(knobs).collect::<Vec<_>>().join(",")
    }
}

fn change(path: Vec<String>, value: Value) -> Override {
    let typed = format!("--set {}={value}", path.join("."));
    Override { path, value, typed, instead_of: None }
}

/// All keys of a table of keys, which may be dotted or nested.
fn flat(table: &Table) -> Vec<Override> {
    fn below(above: &[String], table: &Table, found: &mut Vec<Override>) {
        for (key, value) in table {
            let mut path = above.to_vec();
            path.extend(key.split('.').map(|part| part.trim().to_owned()));
            match value {
                Value::Table(inner) if !inner.is_empty() => below(&path, inner, found),
                value => found.push(change(path, value.clone())),
            }
        }
    }
    let mut found = Vec::new();
    below(&[], table, &mut found);
    found
}

/// The experiment at `path`, or one that suits the data there; and the folder that its paths start from.
fn begin_from(path: &Path) -> Result<(Base, PathBuf)> {
    let request = Request::of(&[path.to_owned()], false)?;
    let name = path.display().to_string();
    if let Request::Experiment(file) = &request {
        let bytes = scrnn_data::read_bytes(file)?;
        let text = String::from_utf8(bytes)
            .map_err(|_| Failure::input(format!("{name} is not text"), "save the file as UTF-8"))?;
        let base = Base::new(&name, &text)?;
        let is_recipe = || {
            let table: Option<Table> = toml::from_str(&text).ok();
            table.is_some_and(|table| table.get("training").is_some_and(|training| training.get("recipe").is_some()))
        };
        if !is_recipe() {
            return Ok((base, file.parent().unwrap_or(Path::new("")).to_owned()));
        }
    }
    let asked = request.experiment(&[], None, false)?;
    Ok((Base::new(name, asked.experiment.to_file())?, PathBuf::new()))
}

fn check_size(count: usize) -> Result<()> {
    if count <= MOST_RUNS {
        return Ok(());
    }
    let help = "fewer values or seeds; [random] draws from a large grid";
    Err(Failure::input(format!("that makes {count} networks; at most {MOST_RUNS} are planned"), help))
}

/// A key in two places of the file would mean two things.
fn no_key_twice(file: &SweepFile, grid: &[Axis], drawn: &[Axis]) -> Result<()> {
    let mut places: Vec<(String, &str)> = Vec::new();
    places.extend(flat(&file.set).iter().map(|one| (one.path.join("."), "[set]")));
    places.extend(grid.iter().map(|axis| (axis.name(), "[grid]")));
    places.extend(drawn.iter().map(|axis| (axis.name(), "[random]")));
    places.extend(file.seeded.iter().map(|key| (key.clone(), "`seeded`")));
    for (k, (key, place)) in places.iter().enumerate() {
        if let Some((_, other)) = places[..k].iter().find(|(other, _)| other == key) {
            return Err(Failure::input(
                format!("`{key}` is set by {other} and by {place}"),
                "leave one of the two out",
            ));
        }
    }
    let knobs = || grid.iter().chain(drawn).map(Axis::name).chain(file.seeded.iter().cloned());
    for condition in &file.conditions {
        let set = flat(&condition.set);
        if let Some(key) = knobs().find(|key| set.iter().any(|one| one.path.join(".") == *key)) {
            let message = format!("`{key}` is set by the condition `{}` and varies for all", condition.name);
            return Err(Failure::input(message, "leave one of the two out"));
        }
    }
    Ok(())
}

/// The last parts of each key, as many as tell it from the others.
fn short_names(keys: &[String]) -> Vec<String> {
    let tail = |key: &str, parts: usize| {
        let all: Vec<&str> = key.split('.').collect();
        all[all.len().saturating_sub(parts)..].join(".")
    };
    let short = |key: &String| {
        let most = key.split('.').count();
        let alone = |parts: &usize| keys.iter().filter(|other| tail(other, *parts) == tail(key, *parts)).count() == 1;
        tail(key, (1..=most).find(alone).unwrap_or(most))
    };
    keys.iter().map(short).collect()
}

/// A value as names and tables have it: numbers as short as they can be.
#[must_use]
pub fn shown(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::String(text) => text.clone(),
        serde_json::Value::Number(number) => match number.as_f64().filter(|_| number.is_f64()) {
            Some(value) if value != 0.0 && !(1e-2..1e6).contains(&value.abs()) => format!("{value:e}"),
            Some(value) => value.to_string(),
            None => number.to_string(),
        },
        serde_json::Value::Array(list) => list.iter().map(shown).collect::<Vec<_>>().join("_"),
        other => other.to_string(),
    }
}

/// TOML's value as JSON; what JSON has no word for becomes text.
fn json(value: &Value) -> serde_json::Value {
    match value {
        Value::Float(number) if !number.is_finite() => serde_json::Value::String(number.to_string()),
        Value::Datetime(moment) => serde_json::Value::String(moment.to_string()),
        other => serde_json::to_value(other).unwrap_or(serde_json::Value::Null),
    }
}

/// A name of a folder that no other has, not even where the case of letters does not count.
fn unused(wanted: &str, names: &mut HashSet<String>) -> String {
    let allowed = |c: char| if c.is_alphanumeric() || "-_.+=, ".contains(c) { c } else { '_' };
    let mut name: String = wanted.chars().map(allowed).collect();
    if name.len() > LONGEST {
        let digest: String =
            Sha256::digest(wanted.as_bytes()).iter().take(4).map(|byte| format!("{byte:02x}")).collect();
        let end = (0..=LONGEST - 9).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
        name = format!("{}-{digest}", &name[..end]);
    }
    if TAKEN.contains(&name.to_lowercase().as_str()) || name.starts_with('.') {
        name = format!("_{name}");
    }
    let mut own = name.clone();
    for k in 2.. {
        if names.insert(own.to_lowercase()) {
            break;
        }
        own = format!("{name}-{k}");
    }
    own
}

#[cfg(test)]
#[path = "plan_tests.rs"]
mod tests;
