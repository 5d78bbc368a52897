//! `scrnn schema`: the JSON schema of the experiment file.

use crate::output;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::{Ending, Result};

/// Prints the schema.
pub fn run() -> Result<Ending> {
    output::print_json(&schemars::schema_for!(Experiment))?;
    Ok(Ending::Done)
}
