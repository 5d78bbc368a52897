//! `scrnn inspect`: what is in a run folder, a checkpoint or a data file.

use std::path::PathBuf;

use clap::Args;
use scrnn_pages::data_page::data_page;
use scrnn_pages::inspection::{network_object, network_text, reading_object, reading_text};
use serde_json::{Value, json};

use crate::args::{Part, Shared};
use crate::output;
use crate::outputs::check_distinct;
use scrnn_data::{self as files, Remark};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::members;
use scrnn_run::run_folder::CHECKPOINT;
use scrnn_run::trained::Trained;

/// Show what is in a run folder, a checkpoint or a data file
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn inspect runs/sinusoid        network, epoch, nll, sequences
  scrnn inspect mine.csv             channels with their ranges, sequences with their lengths
  scrnn inspect mine.csv --plot mine.html
  scrnn inspect runs/sinusoid --json | jq .epoch")]
pub struct Arguments {
    /// A run folder, a .safetensors file or a data file
    path: PathBuf,
    #[command(flatten)]
    part: Part,
    /// Of data: also write a page with all sequences of each channel over each other
    #[arg(long, value_name = "PAGE.html")]
    plot: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// Looks and tells.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let path = &arguments.path;
    let is_checkpoint = path.extension().is_some_and(|extension| extension == "safetensors");
    let is_run = path.is_dir() && path.join(CHECKPOINT).exists();
    check_distinct(&[("--plot", arguments.plot.as_deref())], &[("PATH", Some(path))])?;
    let members = if path.is_dir() { members::folders(path) } else { Vec::new() };
    let is_network = is_run || is_checkpoint || !members.is_empty();
    if is_network && arguments.plot.is_some() {
        let help = "`scrnn report` makes a page of a run";
        return Err(Failure::input("--plot draws data, and this is a network", help));
    }
    let (object, text) = if !members.is_empty() {
        let all = members::open(path, false)?;
        let objects: Vec<Value> = all.iter().map(network_object).collect();
        let texts = all.iter().zip(&members).map(|(trained, folder)| network_text(trained, folder));
        let head = format!("{}: a mixture of {} networks\n", path.display(), all.len());
        (json!({ "kind": "mixture", "members": objects }), head + &texts.collect::<String>())
    } else if is_network {
        let trained = Trained::open(path, false)?;
        (network_object(&trained), network_text(&trained, path))
    } else {
        let mut reading = files::read_all(&[path], &arguments.part.of(path, None))?;
        let suspicions = files::suspicions::look(&reading.data).into_iter();
        reading.remarks.extend(suspicions.map(|suspicion| Remark::Suspicion { suspicion }));
        if let Some(page) = &arguments.plot {
            files::replace(page, data_page(&reading, path).html().as_bytes())?;
        }
        (reading_object(&reading), reading_text(&reading, path))
    };
    if arguments.json {
        let mut object = object;
        object["path"] = json!(path.display().to_string());
        object["instruction_set"] = json!(shared.instruction_set().to_string());
        output::print_json(&object)?;
    } else {
        output::print(&format!("{text}instruction set: {}\n", shared.instruction_set()))?;
    }
    Ok(Ending::Done)
}
