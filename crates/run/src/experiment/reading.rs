//! From a file and `--set` options to a checked experiment; whatever is wrong is shown at its place.

use std::ops::Range;
use std::path::Path;

use serde::Deserialize;
use toml::Table;
use toml::de::{DeTable, DeValue};

use super::checks::{self, Complaint};
use super::{Experiment, OptimiserName, Override};
use crate::failure::{Failure, Result};

/// Reads the experiment at `path` and applies `overrides` in their order. Defaults are not yet filled in.
///
/// # Errors
/// [`Failure::Disk`]; [`Failure::Input`] with the line of the file, or the option, that is wrong.
pub fn read(path: &Path, overrides: &[Override]) -> Result<Experiment> {
    let bytes = scrnn_data::read_bytes(path)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
        let message = format!("{} is not text: byte {} (line {line}) is not UTF-8", path.display(), at + 1);
        Failure::input(message, "save the file as UTF-8")
    })?;
    read_text(&path.display().to_string(), &text, overrides)
}

/// Reads the experiment in `text`, which stands in a file called `name`, and applies `overrides` as [`read`] does.
///
/// # Errors
/// [`Failure::Input`].
pub fn read_text(name: &str, text: &str, overrides: &[Override]) -> Result<Experiment> {
    let mut experiment: Experiment = toml::from_str(text).map_err(|error| bad_toml(&error, (name, text)))?;
    if !overrides.is_empty() {
        let mut table: Table = toml::from_str(text).map_err(|error| bad_toml(&error, (name, text)))?;
        for change in overrides {
            change.apply(&mut table).map_err(|message| in_option(change, message, None))?;
            experiment = Experiment::deserialize(table.clone()).map_err(|error| {
                let (message, near) = (error.message().to_owned(), near_names(error.message()));
                in_option(change, message, near)
            })?;
        }
        no_effect(&experiment, overrides)?;
    }
    checks::check(&experiment).map_err(|complaint| place(complaint, overrides, (name, text)))?;
    Ok(experiment)
}

/// An experiment file that many sets of changes are applied to, each to the file as it is: see the crate `scrnn-sweep`.
#[derive(Debug, Clone)]
pub struct Base {
    name: String,
    text: String,
    table: Table,
}

impl Base {
    /// The experiment in `text`, which stands in a file called `name`. What it lacks may come with the changes.
    ///
    /// # Errors
    /// [`Failure::Input`] for what is no TOML.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Result<Self> {
        let (name, text) = (name.into(), text.into());
        let table = table(&name, &text)?;
        Ok(Self { name, text, table })
    }

    /// The same as [`read_text`] gives, and quickly: the file is not read again.
    ///
    /// # Errors
    /// As [`read_text`].
    pub fn with(&self, overrides: &[Override]) -> Result<Experiment> {
        let mut table = self.table.clone();
        if overrides.iter().all(|change| change.apply(&mut table).is_ok())
            && let Ok(experiment) = Experiment::deserialize(table)
            && no_effect(&experiment, overrides).is_ok()
            && checks::check(&experiment).is_ok()
        {
            return Ok(experiment);
        }
        // What is wrong is shown in its place.
        read_text(&self.name, &self.text, overrides)
    }
}

/// The TOML of a file called `name`, as any type; whatever is wrong is shown at its place, with the names that come near.
///
/// # Errors
/// [`Failure::Input`].
pub fn table<T: serde::de::DeserializeOwned>(name: &str, text: &str) -> Result<T> {
    toml::from_str(text).map_err(|error| bad_toml(&error, (name, text)))
}

/// What the TOML reader says, with a caret under the place.
fn bad_toml(error: &toml::de::Error, source: (&str, &str)) -> Failure {
    let help = near_names(error.message()).unwrap_or_else(|| "`scrnn schema` prints what the file may hold".to_owned());
    Failure::input_at(error.message(), Some(help), source, error.span(), "here")
}

/// What is wrong with an option, with a caret under its value.
fn in_option(change: &Override, message: String, help: Option<String>) -> Failure {
    let help = help.or_else(|| Some("`scrnn schema` prints all keys".to_owned()));
    let start = change.typed.find(' ').map_or(0, |space| space + 1);
    Failure::input_at(message, help, ("the command line", &change.typed), Some(start..change.typed.len()), "here")
}

/// An option that would change nothing is a mistake: refuses options of the optimiser that is not used.
fn no_effect(experiment: &Experiment, overrides: &[Override]) -> Result<()> {
    let (used, unused) = match experiment.training.optimiser {
        OptimiserName::Momentum => ("momentum", "adam"),
        OptimiserName::Adam => ("adam", "momentum"),
    };
    match overrides.iter().find(|change| change.path.starts_with(&["training".to_owned(), unused.to_owned()])) {
        None => Ok(()),
        Some(change) => {
            let message = format!("this has no effect: the optimiser is \"{used}\"");
            Err(in_option(change, message, Some(format!("add --set training.optimiser={unused}, or leave it out"))))
        }
    }
}

/// Shows a complaint where its value came from: the last option that set it, or the file.
fn place(complaint: Complaint, overrides: &[Override], source: (&str, &str)) -> Failure {
    let Complaint { path, message, needed } = complaint;
    let help = format!("needed: {needed}");
    match overrides.iter().rev().find(|change| path.starts_with(&change.path)) {
        Some(change) => in_option(change, message, Some(help)),
        None => Failure::input_at(message, Some(help), source, locate(source.1, &path), "here"),
    }
}

/// Where the value of a key stands in a TOML text; for a key that is not there, where its table stands.
fn locate(text: &str, path: &[String]) -> Option<Range<usize>> {
    let root = DeTable::parse(text).ok()?;
    let (first, rest) = path.split_first()?;
    let (key, value) = root.get_ref().get_key_value(first.as_str())?;
    let mut span = if matches!(value.get_ref(), DeValue::Table(_)) { key.span() } else { value.span() };
    let mut here = value.get_ref();
    for part in rest {
        match here {
            DeValue::Table(table) => {
                let Some((key, value)) = table.get_key_value(part.as_str()) else { return Some(span) };
                span = if matches!(value.get_ref(), DeValue::Table(_)) { key.span() } else { value.span() };
                here = value.get_ref();
            }
            DeValue::Array(entries) => {
                // Of two groups of one name the second is the culprit.
                let named =
                    |value: &DeValue<'_>| value.get("name").and_then(|name| name.get_ref().as_str().map(str::to_owned));
                let Some(entry) = entries.iter().rev().find(|entry| named(entry.get_ref()).as_ref() == Some(part))
                else {
                    return Some(span);
                };
                span = entry.span();
                here = entry.get_ref();
            }
            _ => return Some(span),
        }
    }
    Some(span)
}

/// For serde's "unknown field `rat`, expected one of `rate`, ...": the names that come near, then all.
fn near_names(message: &str) -> Option<String> {
    let message = message.trim();
    if !message.starts_with("unknown ") {
        return None;
    }
    let mut names = message.split('`').skip(1).step_by(2);
    let unknown = names.next()?;
    let known: Vec<&str> = names.collect();
    let mut near: Vec<(f64, &str)> = known
        .iter()
        .map(|name| (strsim::jaro_winkler(unknown, name), *name))
        .filter(|(score, _)| *score > 0.75)
        .collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0));
    match near.as_slice() {
        [] => Some(format!("there are: {}", known.join(", "))),
        near => {
            let names: Vec<String> = near.iter().take(3).map(|(_, name)| format!("`{name}`")).collect();
            Some(format!("did you mean {}?", names.join(" or ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_come_near_are_offered_first() {
        let help = near_names("unknown field `momentun`, expected one of `rate`, `momentum`, `prior`").unwrap();
        assert_eq!(help, "did you mean `momentum`?");
        assert_eq!(near_names("unknown field `zzz`, expected `a` or `b`").unwrap(), "there are: a, b");
        assert_eq!(near_names("missing field `name`"), None);
    }

    #[test]
    fn a_key_is_found_in_the_text_also_within_a_group() {
        let text =
            "seed = 3\n[[network.groups]]\nname = \"a\"\nunits = 3\n[[network.groups]]\nname = \"b\"\nunits = 0\n";
        let at = |path: &str| {
            let path: Vec<String> = path.split('.').map(str::to_owned).collect();
            &text[locate(text, &path).unwrap()]
        };
        assert_eq!(at("seed"), "3");
        assert_eq!(at("network.groups.b.units"), "0");
        assert!(at("network.groups.b.time_constant").contains("groups"));
    }
}
