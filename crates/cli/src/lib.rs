//! The `scrnn` program: parse, dispatch, and map the result to an exit code.
//!
//! A library only so that its readers can be fuzzed: [`run`] is the program, [`readers`] is what `fuzz/` calls.

mod args;
mod assessment;
mod command;
mod experiment;
mod failure;
mod history;
mod interactions;
mod notes;
mod output;
mod processor_time;
mod progress;
#[doc(hidden)]
pub mod readers;
mod report;
mod run_folder;
mod source;
mod table;
mod trained;
mod truth;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use failure::{Ending, Result};

/// Does what the command line says; the process' exit code.
#[must_use]
pub fn run() -> ExitCode {
    let Cli { shared, command } = Cli::parse();
    let ending = match command {
        Command::Data(arguments) => command::data::run(&arguments, &shared),
        Command::Train(arguments) => command::train::run(&arguments, &shared),
        Command::Generate(arguments) => command::generate::run(&arguments, &shared),
        Command::Recognize(arguments) => command::recognize::run(&arguments, &shared),
        Command::Simulate(arguments) => command::simulate::run(&arguments, &shared),
        Command::Reproduce(arguments) => command::reproduce::run(&arguments, &shared),
        Command::Report(arguments) => command::report::run(&arguments, &shared),
        Command::Inspect(arguments) => command::inspect::run(&arguments, &shared),
        Command::Schema => command::schema::run(),
        Command::Completions(arguments) => command::completions::run(&arguments),
    };
    exit_code(ending)
}

fn exit_code(ending: Result<Ending>) -> ExitCode {
    match ending {
        Ok(ending) => ExitCode::from(ending.code()),
        Err(failure) => {
            let code = failure.code();
            eprintln!("{:?}", miette::Report::new(failure));
            ExitCode::from(code)
        }
    }
}
