//! Trains as an experiment file says, into a folder, without a terminal.
//!
//! ```console
//! cargo run --release -p scrnn-run --example train_in_folder -- assets/experiments/sinusoid_fast.toml /tmp/run
//! ```

use std::path::PathBuf;

use scrnn::{Engine, InstructionSet};
use scrnn_run::experiment;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::Silent;
use scrnn_run::training::{Found, train};
use scrnn_run::verdict::Verdict;

const SHORT: &str = r#"
name = "short"
[data]
task = "sinusoid"
steps = 100
[[network.groups]]
name = "context"
units = 6
time_constant = 2.0
[training]
epochs = 200
optimiser = "adam"
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let experiment = match arguments.next() {
        Some(file) => experiment::read(&file, &[])?.resolved(file.parent().unwrap_or(&file))?,
        None => experiment::read_text("short.toml", SHORT, &[])?.resolved("".as_ref())?,
    };
    let folder = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("scrnn-example"));
    let engine = Engine::new(0, InstructionSet::best())?;
    let place = (folder.as_path(), Found::Overwrite);
    let training = train(&experiment, place, (&engine, &Interrupt::new()), Box::new(Silent), &Silent)?;
    print!("{}", Verdict::new(&training, &engine)?);
    Ok(())
}
