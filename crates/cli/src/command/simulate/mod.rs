//! `scrnn simulate`: a trained network moves a robot in a simulated world.

mod interact;

use clap::{Args, Subcommand};

use crate::args::Shared;
use crate::failure::{Ending, Result};

/// Let a trained network move a robot in a simulated world
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    world: World,
}

/// Which world.
#[derive(Debug, Subcommand)]
enum World {
    Interact(Box<interact::Arguments>),
}

/// Simulates.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    match &arguments.world {
        World::Interact(arguments) => interact::run(arguments, shared),
    }
}
