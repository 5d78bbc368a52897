//! `scrnn completions`: what the shell needs to complete commands and options.

use clap::{Args, CommandFactory};

use crate::cli::Cli;
use crate::output;
use scrnn_run::failure::{Ending, Result};

/// Print a script that lets your shell complete commands and options
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn completions bash > ~/.local/share/bash-completion/completions/scrnn
  scrnn completions fish > ~/.config/fish/completions/scrnn.fish")]
pub struct Arguments {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the script.
pub fn run(arguments: &Arguments) -> Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "scrnn", &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Ending::Done)
}
