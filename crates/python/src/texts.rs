//! JSON and TOML between Python's dicts and the types of the program.

use scrnn_run::failure::{Failure, Result};
use serde::Serialize;

/// Settings as JSON, in the form of an experiment file.
pub fn toml_of(json: &str) -> Result<String> {
    let value: serde_json::Value = serde_json::from_str(json)
        .map_err(|error| Failure::input(format!("the settings cannot be read: {error}"), ""))?;
    let table = toml::Table::try_from(value)
        .map_err(|error| Failure::input(format!("the settings are not those of an experiment: {error}"), ""))?;
    toml::to_string(&table).map_err(|error| Failure::input(format!("the settings cannot be written: {error}"), ""))
}

/// A result as JSON.
pub fn json_of(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Failure::input(format!("a result cannot be told: {error}"), ""))
}
