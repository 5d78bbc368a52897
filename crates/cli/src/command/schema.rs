//! `scrnn schema`: the JSON schema of the experiment file.

use crate::experiment::Experiment;
use crate::failure::{Ending, Result};
use crate::output;

/// Prints the schema.
pub fn run() -> Result<Ending> {
    output::print_json(&schemars::schema_for!(Experiment))?;
    Ok(Ending::Done)
}
