//! The `scrnn` program: parse, dispatch, and map the result to an exit code.

mod args;
mod cli;
mod command;
mod output;
mod outputs;
mod progress;
mod signals;
mod watching;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};
use scrnn_run::failure::{Ending, Failure, Result};
use signals::Signals;

fn main() -> ExitCode {
    let code = run();
    output::finish();
    ExitCode::from(code)
}

/// Does what the command line says; the exit code.
fn run() -> u8 {
    let Cli { shared, command } = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(usage) => return told(&usage),
    };
    let signals = Signals::default();
    let ending = match command {
        Command::Data(arguments) => command::data::run(&arguments, &shared),
        Command::Train(arguments) => command::train::run(&arguments, (&shared, &signals)),
        Command::Sweep(arguments) => command::sweep::run(&arguments, (&shared, &signals)),
        Command::Compare(arguments) => command::compare::run(&arguments, &shared),
        Command::Generate(arguments) => command::generate::run(&arguments, &shared),
        Command::Recognize(arguments) => command::recognize::run(&arguments, &shared),
        Command::Evaluate(arguments) => command::evaluate::run(&arguments, &shared),
        Command::Simulate(arguments) => command::simulate::run(&arguments, &shared),
        Command::Reproduce(arguments) => command::reproduce::run(&arguments, (&shared, &signals)),
        Command::Report(arguments) => command::report::run(&arguments, &shared),
        Command::View(arguments) => command::view::run(&arguments),
        Command::Inspect(arguments) => command::inspect::run(&arguments, &shared),
        Command::Convert(arguments) => command::convert::run(&arguments, &shared),
        Command::Export(arguments) => command::export::run(&arguments, &shared),
        Command::Schema(arguments) => command::schema::run(&arguments),
        Command::Completions(arguments) => command::completions::run(&arguments),
    };
    code(ending, signals.code())
}

/// Shows help, version or what is wrong with the arguments; the exit code.
fn told(usage: &clap::Error) -> u8 {
    if usage.use_stderr() && !std::io::stderr().is_terminal() {
        output::say(usage.render().to_string().trim_end());
        return u8::try_from(usage.exit_code()).unwrap_or(2);
    }
    match usage.print() {
        // The text to stdout is a result; on stderr it is a message.
        Err(source) if !usage.use_stderr() && source.kind() != std::io::ErrorKind::BrokenPipe => {
            code(Err(Failure::Output { source }), None)
        }
        _ => u8::try_from(usage.exit_code()).unwrap_or(2),
    }
}

/// The exit code, after an error was told. A signal explains an early end, and results that its terminal does not take.
fn code(ending: Result<Ending>, signal: Option<u8>) -> u8 {
    match ending {
        Ok(Ending::Interrupted) => signal.unwrap_or(Ending::Interrupted.code()),
        Ok(ending) => ending.code(),
        Err(failure) => {
            let code = match (&failure, signal) {
                (Failure::Output { .. } | Failure::Stopped, Some(signal)) => signal,
                _ => failure.code(),
            };
            output::show(failure);
            code
        }
    }
}
