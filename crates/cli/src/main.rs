//! The `scrnn` program: parse, dispatch, and map the result to an exit code.

mod args;
mod cli;
mod command;
mod output;
mod progress;
mod signals;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};
use scrnn_run::failure::{Ending, Result};

fn main() -> ExitCode {
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
