//! `scrnn simulate`: a trained network moves a robot in a simulated world (thesis, chapters 4 and 5).

mod interact;
mod reach;

use clap::{Args, Subcommand};

use crate::args::Shared;
use scrnn_run::failure::{Ending, Result};

/// Let a trained network move a robot in a simulated world
///
/// The robot is NAO, its world is simulated by rapier, many times faster than real time. A recording of what happened opens
/// in Foxglove and rerun.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    experiment: Name,
}

/// The experiments.
#[derive(Debug, Subcommand)]
enum Name {
    Reach(reach::Arguments),
    Interact(Box<interact::Arguments>),
}

/// Simulates.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    match &arguments.experiment {
        Name::Reach(arguments) => reach::run(arguments, shared),
        Name::Interact(arguments) => interact::run(arguments, shared),
    }
}
