//! `scrnn schema`: the JSON schema of the experiment file, or of the sweep file.

use clap::Args;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::{Ending, Result};
use scrnn_sweep::file::SweepFile;

use crate::output;

/// Print the JSON schema of the experiment file, or of the sweep file
///
/// Editors with a TOML language server complete and check an experiment file that begins with
///   #:schema ./scrnn.schema.json
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples:\n  scrnn schema > scrnn.schema.json\n  scrnn schema --sweep > sweep.schema.json"
)]
pub struct Arguments {
    /// The sweep file's
    #[arg(long)]
    sweep: bool,
}

/// Prints the schema.
pub fn run(arguments: &Arguments) -> Result<Ending> {
    match arguments.sweep {
        true => output::print_json(&schemars::schema_for!(SweepFile))?,
        false => output::print_json(&schemars::schema_for!(Experiment))?,
    }
    Ok(Ending::Done)
}
