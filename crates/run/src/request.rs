//! What a training is asked for: an experiment file, the folder of a run to go on with, or data alone.

use std::path::{Path, PathBuf};

use scrnn::dataset::Dataset;
use scrnn_data::Remark;
use scrnn_data::format::Format;

use crate::experiment::{self, Comment, Data, Experiment, Override, ScalingChoice};
use crate::failure::{Failure, Result};
use crate::held_out;
use crate::members;
use crate::recipe::{self, Recipe};
use crate::run_folder::{CHECKPOINT, EXPERIMENT};
use crate::source::{self, Source};

/// What the paths of a command line are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// An experiment file.
    Experiment(PathBuf),
    /// A run folder, which holds its own.
    Run(PathBuf),
    /// Data files, folders of such, or patterns.
    Files(Vec<PathBuf>),
}

/// A training, ready to begin.
#[derive(Debug)]
pub struct Asked {
    /// The experiment with every value explicit.
    pub experiment: Experiment,
    /// Its data, where they were looked at already.
    pub source: Option<Source>,
    /// The run folder, where it is given or known.
    pub folder: PathBuf,
}

impl Request {
    /// Tells by names and by what stands there. A name with an extension that no data have is an experiment file.
    ///
    /// # Errors
    /// [`Failure::Input`] for an experiment file beside others, and for paths to nothing that can be learned.
    pub fn of(paths: &[PathBuf], resume: bool) -> Result<Self> {
        let is_toml = |path: &PathBuf| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
        let [only] = paths else {
            return match paths.iter().find(|path| is_toml(path) && !path.is_dir()) {
                None => Ok(Self::Files(paths.to_vec())),
                Some(experiment) => Err(Failure::input(
                    format!("{} is an experiment file, and {} paths are given", experiment.display(), paths.len()),
                    "say with --files which data the experiment is to learn, or give data files alone",
                )),
            };
        };
        if only.is_dir() {
            let is_run = only.join(CHECKPOINT).exists() || only.join(EXPERIMENT).exists();
            return match (is_run, resume) {
                (true, true) => Ok(Self::Run(only.clone())),
                (true, false) => {
                    let folder = only.display();
                    let help = format!("to go on with the run in it: scrnn train {folder} --resume");
                    Err(Failure::input(format!("{folder} is a run folder, not an experiment file"), help))
                }
                (false, _) => Ok(Self::Files(vec![only.clone()])),
            };
        }
        let is_pattern = !only.exists() && only.to_string_lossy().contains(['*', '?', '[']);
        if !is_toml(only) && (is_pattern || Format::knows(only)) {
            return Ok(Self::Files(vec![only.clone()]));
        }
        // What is known to be no data says so itself, e.g. a spreadsheet.
        match Format::of(only) {
            Err(refused) if !is_toml(only) && only.exists() && only.extension().is_some() && !is_text(only) => {
                Err(refused.into())
            }
            _ => Ok(Self::Experiment(only.clone())),
        }
    }

    /// The experiment that is meant, with the options of the command line, to be trained in `out`. Data that come alone are
    /// read for it, and settings chosen: see [`recipe::choose`].
    ///
    /// # Errors
    /// What is wrong with experiment, data or options.
    pub fn experiment(&self, overrides: &[Override], out: Option<&Path>, resume: bool) -> Result<Asked> {
        match self {
            Self::Experiment(file) => {
                if let Some(begun) = asks_for_recipe(file) {
                    let name = file.display().to_string();
                    let folder = file.parent().unwrap_or(Path::new(""));
                    let (experiment, source) = by_recipe(&name, begun, (folder, None), overrides)?;
                    return Ok(Asked::of(experiment, Some(source), out));
                }
                let experiment = experiment::read(file, overrides)?;
                let experiment = experiment.resolved(file.parent().unwrap_or(Path::new("")))?;
                Ok(Asked::of(experiment, None, out))
            }
            Self::Run(folder) => {
                if out.is_some() {
                    let folder = folder.display();
                    return Err(Failure::input(
                        format!("--out says where to write, and so does {folder}"),
                        "leave --out away to go on in that folder",
                    ));
                }
                let experiment = experiment::read(&folder.join(EXPERIMENT), overrides)?.resolved(folder)?;
                Ok(Asked { folder: folder.clone(), ..Asked::of(experiment, None, None) })
            }
            Self::Files(files) => alone(files, overrides, out, resume),
        }
    }
}

impl Asked {
    fn of(experiment: Experiment, source: Option<Source>, out: Option<&Path>) -> Self {
        let folder = out.map_or_else(|| Path::new("runs").join(&experiment.name), Path::to_owned);
        Self { experiment, source, folder }
    }
}

/// The experiment in `text`, which has the form of an experiment file and is called `name`. Paths in it start from `folder`. Where the
/// sequences of its files are at hand, they are taken for what those hold.
///
/// # Errors
/// What is wrong with experiment or data.
pub fn of_text(name: &str, text: &str, folder: &Path, at_hand: Option<Dataset>) -> Result<(Experiment, Source)> {
    if let Some(begun) = recipe_asked_in(text) {
        return by_recipe(name, begun, (folder, at_hand), &[]);
    }
    let experiment = experiment::read_text(name, text, &[])?.resolved(folder)?;
    let source = source_of(&experiment.data, at_hand)?;
    Ok((experiment, source))
}

/// What is at hand, or what the files hold.
fn source_of(data: &Data, at_hand: Option<Dataset>) -> Result<Source> {
    match at_hand {
        Some(sequences) => {
            // Files tell it while they are read.
            let missing = Remark::of_missing(&sequences);
            let mut source = source::at_hand(sequences, data.rest)?;
            source.remarks.splice(0..0, missing);
            Ok(source)
        }
        None => source::load(data, 1),
    }
}

/// Data files of a command line, in place of those that an experiment names. Their paths start from the current folder.
///
/// # Errors
/// [`Failure::Disk`] if nobody knows the current folder.
pub fn files(files: &[PathBuf]) -> Result<Override> {
    texts(files)?;
    let absolute = |file: &PathBuf| std::path::absolute(file).map_err(|error| Failure::disk("find", file, error));
    let paths = files.iter().map(|file| Ok(absolute(file)?.display().to_string())).collect::<Result<Vec<_>>>()?;
    Ok(Override { typed: format!("--files {}", paths.join(",")), ..Override::list("--files", "data.files", &paths) })
}

/// Refuses paths that an experiment file cannot hold.
fn texts(files: &[PathBuf]) -> Result<()> {
    match files.iter().find(|file| file.to_str().is_none()) {
        None => Ok(()),
        Some(file) => {
            let message = format!("the path {} is not UTF-8", file.display());
            Err(Failure::input(message, "rename the folder or the file, or link to it by another name"))
        }
    }
}

/// Whether a file begins with what an editor would show.
fn is_text(path: &Path) -> bool {
    use std::io::Read as _;
    let mut begin = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(512).read_to_end(&mut begin));
    read.is_ok()
        && !begin.contains(&0)
        && String::from_utf8_lossy(&begin).chars().filter(|c| *c == '\u{fffd}').count() < 2
}

/// An experiment for data without one. A run that goes on keeps the experiment that it began with.
fn alone(files: &[PathBuf], overrides: &[Override], out: Option<&Path>, resume: bool) -> Result<Asked> {
    if let Some(twice) = overrides.iter().find(|change| change.path == ["data", "files"]) {
        let message = format!("data files are given twice: as arguments, and as {}", twice.typed);
        return Err(Failure::input(message, "leave one of the two out"));
    }
    texts(files)?;
    let name = name_for(files);
    let listed: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let begun = out.map_or_else(|| Path::new("runs").join(&name), Path::to_owned);
    let is_run = begun.join(CHECKPOINT).exists() || !members::folders(&begun).is_empty();
    if resume && is_run && begun.join(EXPERIMENT).exists() {
        let mut all = vec![self::files(files)?];
        all.extend_from_slice(overrides);
        let experiment = experiment::read(&begun.join(EXPERIMENT), &all)?.resolved(&begun)?;
        return Ok(Asked { experiment, source: None, folder: begun });
    }
    let files = Data { files: Some(files.to_vec()), ..Data::default() };
    let first = Experiment { name, data: files, ..recipe::bare() };
    let first = experiment::read_text("the experiment", &first.to_file(), &of_data(overrides))?;
    let members = members_asked(&toml::Table::new(), overrides);
    let (chosen, source, reasons) = choose(first, members, (Path::new(""), None))?;
    let mut experiment =
        experiment::read_text("the experiment", &chosen.to_file(), overrides)?.resolved(Path::new(""))?;
    experiment.comments = told_from(reasons, overrides);
    let from = format!("From {}.", listed.join(", "));
    experiment.comments.insert(0, Comment { key: "data.files".to_owned(), text: from });
    Ok(Asked::of(experiment, Some(source), out))
}

/// Reasons, but for the keys that the command line gives.
fn told_from(mut reasons: Vec<Comment>, overrides: &[Override]) -> Vec<Comment> {
    let given = |key: &str| overrides.iter().any(|change| plain(&change.path) == key);
    for reason in reasons.iter_mut().filter(|reason| given(&reason.key)) {
        reason.text = "Given on the command line.".to_owned();
    }
    reasons
}

/// The options that say which data are learned and how they are read: that is known before they are; what suits them, after.
fn of_data(overrides: &[Override]) -> Vec<Override> {
    let says = |change: &&Override| change.path.first().is_some_and(|part| part == "data" || part == "seed");
    overrides.iter().filter(says).cloned().collect()
}

/// Where the data of an experiment are: in files, whose paths start from this folder, or at hand.
type Place<'a> = (&'a Path, Option<Dataset>);

/// How many networks are asked for: `training.members`, on the command line or in an experiment file.
fn members_asked(given: &toml::Table, overrides: &[Override]) -> u64 {
    let typed = overrides.iter().rev().find(|change| change.path == ["training", "members"]);
    let value = typed.map(|change| &change.value).or_else(|| given.get("training")?.get("members"));
    value.and_then(toml::Value::as_integer).and_then(|members| u64::try_from(members).ok()).unwrap_or(1)
}

/// Reads the data of an experiment that says no more than that, and puts in what the recipe chooses for so many networks of them, with its
/// reasons. It chooses by what is learned; what is held out has no say.
fn choose(first: Experiment, members: u64, (folder, at_hand): Place<'_>) -> Result<(Experiment, Source, Vec<Comment>)> {
    let mut source = source_of(&first.clone().resolved(folder)?.data, at_hand)?;
    let Recipe { scaling, rest, network, training, reasons } =
        recipe::choose(&held_out::learned(&source.data, &first)?, members);
    if let (None, Some(rest)) = (first.data.rest, rest) {
        source.data = source::at_rest(&source.data, rest)?;
    }
    let data = Data {
        scaling: first.data.scaling.clone().or(Some(ScalingChoice::Named(scaling))),
        rest: first.data.rest.or(rest),
        ..first.data
    };
    Ok((Experiment { data, network, training, ..first }, source, reasons))
}

/// The key of a comment: groups have no names in it.
fn plain(path: &[String]) -> String {
    match path {
        [network, groups, _, rest @ ..] if network == "network" && groups == "groups" => {
            format!("network.groups.{}", rest.join("."))
        }
        path => path.join("."),
    }
}

/// The table of an experiment file that leaves settings to a recipe. What cannot be read is left to whoever says why.
fn asks_for_recipe(file: &Path) -> Option<toml::Table> {
    // What is no file has no end, perhaps.
    let text = if file.is_file() { std::fs::read_to_string(file).ok()? } else { return None };
    recipe_asked_in(&text)
}

/// The same, of the text of such a file.
fn recipe_asked_in(text: &str) -> Option<toml::Table> {
    let table: toml::Table = toml::from_str(text).ok()?;
    let recipe = table.get("training")?.get("recipe")?.as_str()?;
    (recipe == "auto").then_some(table)
}

/// The experiment of a file that leaves settings to the recipe: those that the file has, and the chosen ones for all else.
fn by_recipe(
    name: &str,
    given: toml::Table,
    (folder, at_hand): Place<'_>,
    overrides: &[Override],
) -> Result<(Experiment, Source)> {
    // The data first, with all else as it may be: what is wrong with them is said in their place.
    let mut first = toml::Table::try_from(recipe::bare()).expect("an experiment is a table");
    for key in ["name", "seed", "data"] {
        if let Some(value) = given.get(key) {
            first.insert(key.to_owned(), value.clone());
        }
    }
    let text = |table: &toml::Table| toml::to_string(table).expect("a table that was read can be written");
    let first = experiment::read_text(name, &text(&first), &of_data(overrides))?;
    if first.data.task.is_some() {
        let message = "`training.recipe` chooses settings for data from files, and these are a task of the thesis";
        return Err(Failure::input(message, "leave recipe out: assets/experiments has settings for the tasks"));
    }
    let (chosen, source, reasons) = choose(first, members_asked(&given, overrides), (folder, at_hand))?;
    let mut whole = toml::Table::try_from(&chosen).expect("an experiment is a table");
    let mut own = given;
    if let Some(training) = own.get_mut("training").and_then(toml::Value::as_table_mut) {
        training.remove("recipe");
    }
    let has = |key: &str| {
        let (first, rest) = key.split_once('.').unwrap_or((key, ""));
        let value = own.get(first).and_then(|table| rest.split('.').try_fold(table, |table, part| table.get(part)));
        value.is_some()
    };
    let reasons: Vec<Comment> = reasons.into_iter().filter(|reason| !has(&reason.key)).collect();
    lay_over(&mut whole, own);
    let mut experiment = experiment::read_text(name, &text(&whole), overrides)?.resolved(folder)?;
    experiment.comments = told_from(reasons, overrides);
    Ok((experiment, source))
}

/// Puts `upper` over `lower`, table by table; all else, lists of groups among it, is replaced.
fn lay_over(lower: &mut toml::Table, upper: toml::Table) {
    for (key, value) in upper {
        match (lower.get_mut(&key), value) {
            (Some(toml::Value::Table(lower)), toml::Value::Table(upper)) => lay_over(lower, upper),
            (_, value) => _ = lower.insert(key, value),
        }
    }
}

/// A name for the run: that of the only file or folder, or of the folder that all files are in.
fn name_for(files: &[PathBuf]) -> String {
    let is_pattern = |path: &Path| path.to_string_lossy().contains(['*', '?', '[']) && !path.exists();
    let folder = |path: &Path| path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    let stem = |path: &Path| path.file_stem().map(|name| name.to_string_lossy().into_owned());
    let name = match files {
        [only] if is_pattern(only) => folder(only),
        // A folder is called as it is, and `.` by what it stands for.
        [only] if only.is_dir() => std::path::absolute(only)
            .ok()
            .and_then(|path| path.file_name().map(|name| name.to_string_lossy().into_owned())),
        [only] => stem(only),
        [first, others @ ..] => match others.iter().all(|other| other.parent() == first.parent()) {
            true => folder(first).or_else(|| stem(first)),
            false => stem(first),
        },
        [] => None,
    };
    let allowed = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ') { c } else { '_' };
    let name: String = name.unwrap_or_default().chars().map(allowed).collect();
    let name = name.trim_matches(['.', ' ', '_']);
    if name.is_empty() { "data".to_owned() } else { name.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::SkipName;

    fn paths(paths: &[&str]) -> Vec<PathBuf> {
        paths.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn a_run_is_called_after_its_data() {
        let name = |files: &[&str]| name_for(&paths(files));
        assert_eq!(name(&["a/mine.csv"]), "mine");
        assert_eq!(name(&["a/demos/*.csv"]), "demos");
        assert_eq!(name(&["*.csv"]), "data");
        assert_eq!(name(&["demos/a.csv", "demos/b.csv"]), "demos");
        assert_eq!(name(&["a.csv", "b.csv"]), "a");
        assert_eq!(name(&["a/x.csv", "b/y.csv"]), "x");
        assert_eq!(name(&["a/..:.csv"]), "data");
    }

    #[test]
    fn names_tell_experiments_from_data() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = |name: &str| Request::of(&[at(name)], false);
        assert_eq!(of("mine.csv").unwrap(), Request::Files(vec![at("mine.csv")]));
        assert_eq!(of("demos/*").unwrap(), Request::Files(vec![at("demos/*")]));
        assert_eq!(of("mine.toml").unwrap(), Request::Experiment(at("mine.toml")));
        assert_eq!(of("mine").unwrap(), Request::Experiment(at("mine")));
        std::fs::write(at("table.xlsx"), b"PK\x03\x04\x00\x00").unwrap();
        assert!(of("table.xlsx").is_err());
        let several = [at("a.csv"), at("b.toml")];
        assert!(Request::of(&several, false).unwrap_err().to_string().contains("is an experiment file"));
        std::fs::create_dir(at("run")).unwrap();
        assert_eq!(of("run").unwrap(), Request::Files(vec![at("run")]));
        std::fs::write(at("run").join(EXPERIMENT), "").unwrap();
        assert!(of("run").is_err());
        assert_eq!(Request::of(&[at("run")], true).unwrap(), Request::Run(at("run")));
    }

    #[test]
    fn a_recipe_fills_in_what_an_experiment_leaves_out() {
        let folder = tempfile::tempdir().unwrap();
        let rows: String = (0..300).map(|k| format!("{}\n", (f64::from(k) * 0.1).sin())).collect();
        std::fs::write(folder.path().join("mine.csv"), format!("a\n{rows}")).unwrap();
        let asked = |text: &str| {
            let file = folder.path().join("mine.toml");
            std::fs::write(&file, text).unwrap();
            Request::of(&[file], false).unwrap().experiment(&[], None, false)
        };
        let data = "name = \"mine\"\n[data]\nfiles = [\"mine.csv\"]\n";
        let chosen = asked(&format!("{data}[training]\nrecipe = \"auto\"\n")).unwrap().experiment;
        assert_eq!(chosen.network.skip, SkipName::Autoregressive);
        assert!(chosen.training.closed_loop.is_some() && chosen.training.recipe.is_none());
        assert!(chosen.comments.iter().any(|comment| comment.key == "network.skip"));
        let own = format!("{data}[network]\nskip = \"residual\"\n[training]\nrecipe = \"auto\"\nepochs = 7\n");
        let own = asked(&own).unwrap().experiment;
        assert_eq!((own.network.skip, own.training.epochs), (SkipName::Residual, 7));
        assert_eq!(own.network.groups, chosen.network.groups);
        assert!(!own.comments.iter().any(|comment| comment.key == "network.skip"));
        let mixed = asked(&format!("{data}[training]\nrecipe = \"auto\"\nmembers = 4\n")).unwrap().experiment;
        assert_eq!(mixed.training.closed_loop.as_ref().unwrap().taught, 0.1);
        let typed = Request::of(&[folder.path().join("mine.csv")], false).unwrap();
        let typed = typed.experiment(&["training.members=4".parse().unwrap()], None, false).unwrap().experiment;
        assert_eq!((typed.training.epochs, typed.training.members), (mixed.training.epochs, Some(4)));
        assert!(typed.training.epochs > chosen.training.epochs);
        let task = asked("name = \"s\"\n[data]\ntask = \"sinusoid\"\n[training]\nrecipe = \"auto\"\n");
        assert!(task.unwrap_err().to_string().contains("a task of the thesis"));
    }

    #[test]
    fn data_alone_get_an_experiment_with_reasons_and_options_go_before_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.csv");
        let rows: String = (0..60).map(|k| format!("{},{}\n", (f64::from(k) * 0.3).sin(), f64::from(k % 7))).collect();
        std::fs::write(&file, format!("a,b\n{rows}")).unwrap();
        let set = |text: &str| text.parse::<Override>().unwrap();
        let overrides =
            [set("network.groups.context.units=9"), set("data.channels=[\"a\"]"), set("training.epochs=12")];
        let asked = Request::Files(vec![file.clone()]).experiment(&overrides, None, false).unwrap();
        let experiment = &asked.experiment;
        assert_eq!((experiment.network.groups[0].units, experiment.training.epochs), (9, 12));
        assert_eq!(asked.source.as_ref().unwrap().data.channels(), ["a"]);
        assert_eq!(asked.folder, Path::new("runs/mine"));
        let text = experiment.to_file();
        assert!(text.contains("# Given on the command line.\nunits = 9\n"), "{text}");
        assert!(text.contains("# Learns sooner than the thesis' rule.\noptimiser = \"adam\"\n"), "{text}");
        let again = experiment::read_text("x", &text, &[]).unwrap().resolved(Path::new("")).unwrap();
        assert!(again.says_the_same(experiment));
        // Not even its placeholder may break on a group of the recipe's.
        assert!(Request::Files(vec![file]).experiment(&[set("network.groups.slow.units=9")], None, false).is_err());
    }
}
