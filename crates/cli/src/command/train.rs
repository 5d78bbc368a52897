//! `scrnn train`: from an experiment to a run folder.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn::engine::Engine;
use scrnn::learning::Outcome;

use crate::args::{MOST_IN_TOML, Part, Shared, whole};
use crate::output;
use crate::progress::{Bars, Busy};
use crate::signals::Signals;
use scrnn_pages::live::{Ends, Live, Many, OneOfMany, Stands};
use scrnn_run::experiment::{Experiment, Override};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_run::members::{self, train_members};
use scrnn_run::request::{self, Asked, Request};
use scrnn_run::run_folder::{BEST, CHECKPOINT};
use scrnn_run::source;
use scrnn_run::training::{Found, Training, train_on};
use scrnn_run::verdict::Verdict;

/// Train a network as an experiment file says, or on data files alone
///
/// The run folder receives experiment.toml (every value explicit), checkpoint.safetensors (the newest state),
/// best.safetensors (the lowest nll so far) and history.csv (how training went). Given data files alone, settings are chosen by
/// the data; experiment.toml then says why, and is a good beginning for an experiment of your own. Ctrl-C (also SIGTERM,
/// SIGHUP, SIGUSR1 and SIGXCPU, unless the parent ignores them as nohup does) ends the epoch, saves, and says how to go on; a
/// run that was killed goes on from its last checkpoint. Either way the result is the same to the bit as
/// if the run had never stopped.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn train assets/experiments/sinusoid.toml
  scrnn train mine.csv                                       into runs/mine, with settings that suit the data
  scrnn train bags/ --topic /joint_states --period 0.02      all recordings in a folder
  scrnn train sinusoid.toml --seed 2 --out runs/sinusoid-2 --set training.momentum.rate=1e-3
  scrnn train runs/sinusoid --resume --epochs 200000")]
pub struct Arguments {
    /// The experiment file, or data files, folders of them or patterns; with --resume also a run folder
    #[arg(required = true, value_name = "EXPERIMENT|DATA")]
    paths: Vec<PathBuf>,
    /// The run folder [default: runs/NAME, after the experiment's name or the data]
    #[arg(long, short, value_name = "RUN")]
    out: Option<PathBuf>,
    /// Go on with the run in the run folder, or start it if there is none
    #[arg(long)]
    resume: bool,
    /// Throw away the run that is in the run folder
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Number of epochs, 0 to 9223372036854775807; 0 writes the initial network. Short for --set training.epochs=N
    #[arg(long, value_name = "N", value_parser = whole(0, MOST_IN_TOML))]
    epochs: Option<u64>,
    /// Seed of the initial weights, 0 to 9223372036854775807. Short for --set seed=N
    #[arg(long, value_name = "N", value_parser = whole(0, MOST_IN_TOML))]
    seed: Option<u64>,
    /// Data to learn instead of those that the experiment names
    #[arg(long, value_name = "FILE,...", value_delimiter = ',')]
    files: Vec<PathBuf>,
    #[command(flatten)]
    part: Part,
    /// Replace a value of the experiment, e.g. training.adam.rate=0.001 or network.groups.context.units=20
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// Serve a page on this machine that shows the training as it goes on, at this port or any that is free
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    watch: Option<u16>,
    /// Print the result as a JSON object
    #[arg(long)]
    json: bool,
}

impl Arguments {
    fn overrides(&self) -> Result<Vec<Override>> {
        let shorthands = [("--epochs", "training.epochs", self.epochs), ("--seed", "seed", self.seed)];
        let mut overrides = self.set.clone();
        for (option, key, value) in shorthands {
            if let Some(value) = value {
                overrides.push(Override::shorthand(option, key, value).map_err(|message| Failure::input(message, ""))?);
            }
        }
        if !self.files.is_empty() {
            overrides.push(request::files(&self.files)?);
        }
        overrides.extend(self.part.overrides());
        Ok(overrides)
    }
}

/// Trains.
pub fn run(arguments: &Arguments, (shared, signals): (&Shared, &Signals)) -> Result<Ending> {
    let overrides = arguments.overrides()?;
    let asked = Request::of(&arguments.paths, arguments.resume)?;
    let Asked { experiment, source, folder: path } =
        asked.experiment(&overrides, arguments.out.as_deref(), arguments.resume)?;

    let engine = shared.engine()?;
    let interrupt = signals.listen();
    let mixture = experiment.training.members.is_some_and(|members| members > 1);
    let found = if arguments.resume {
        if !path.join(CHECKPOINT).exists() && members::folders(&path).is_empty() {
            shared.say(format_args!("{} holds no checkpoint: starting from epoch 0", path.display()));
        }
        Found::GoOn
    } else if arguments.overwrite {
        Found::Overwrite
    } else {
        Found::Refuse
    };
    if mixture {
        return train_mixture(&experiment, (&path, found), (shared, &engine, &interrupt), arguments);
    }
    if !members::folders(&path).is_empty() {
        let message = format!("{} holds a mixture of networks", path.display());
        return Err(Failure::refused(message, "--out RUN writes elsewhere; or set training.members"));
    }
    let source = match source {
        Some(source) => source,
        None => {
            let _busy = Busy::with("making the data", shared.quiet);
            source::load_while(&experiment.data, engine.threads(), &interrupt)?
        }
    };
    let mut progress = Bars::new(shared.quiet).bar("", experiment.training.epochs);
    let live = arguments
        .watch
        .map(|port| Live::start(port, (&experiment.name, experiment.training.epochs), path.clone(), &source.data));
    let live = live.transpose()?;
    if let Some(live) = &live {
        output::say(format_args!("watch it at {}", live.url()));
        progress = live.watching(progress);
    }
    let training = train_on(&experiment, source, (&path, found), (&engine, &interrupt), progress, shared)?;
    let verdict = {
        let _busy = Busy::with("judging the network", shared.quiet);
        Verdict::new(&training, &engine)?
    };
    if arguments.json {
        output::print_json(&verdict)?;
    } else if output::is_for_a_person() {
        // For a person: whole words in a line, and what to type next. Who reads a file or a pipe gets the sentences as they are.
        output::print(&format!("{}\nTo see it:\n  scrnn report {}\n", wrapped(&verdict.to_string()), path.display()))?;
    } else {
        output::print(&verdict.to_string())?;
    }
    Ok(ending(&training, &path, shared))
}

/// Long lines of a text in pieces of whole words.
fn wrapped(text: &str) -> String {
    const WIDTH: usize = 80;
    let mut out = String::new();
    for line in text.lines() {
        if line.starts_with(' ') || line.chars().count() <= WIDTH {
            out += line;
        } else {
            let mut column = 0;
            for word in line.split(' ') {
                let length = word.chars().count();
                match column {
                    0 => {}
                    _ if column + 1 + length > WIDTH => {
                        out.push('\n');
                        column = 0;
                    }
                    _ => {
                        out.push(' ');
                        column += 1;
                    }
                }
                out += word;
                column += length;
            }
        }
        out.push('\n');
    }
    out
}

/// Trains the members of a mixture side by side.
fn train_mixture(
    experiment: &Experiment,
    (path, found): (&Path, Found),
    (shared, engine, interrupt): (&Shared, &Engine, &Interrupt),
    &Arguments { watch, json, .. }: &Arguments,
) -> Result<Ending> {
    let bars = Bars::new(shared.quiet);
    let ends = Ends::default();
    let progress = |label: &str, epochs: u64| ends.watching(label, bars.bar(label, epochs));
    let page = watch.map(|port| {
        let (path, ends) = (path.to_owned(), ends.clone());
        let members = usize::try_from(experiment.training.members.unwrap_or(1)).unwrap_or(1);
        let look = move || Ok((1..=members).map(|k| member(k, &path, &ends)).collect());
        Many::start(port, &format!("Mixture: {}", experiment.name), experiment.training.epochs, Box::new(look))
    });
    let page = page.transpose()?;
    if let Some(page) = &page {
        output::say(format_args!("watch it at {}", page.url()));
    }
    let machine = (engine.threads(), engine.instruction_set(), interrupt);
    let verdict = train_members(experiment, (path, found), machine, &progress, shared)?;
    match json {
        true => output::print_json(&verdict)?,
        false => output::print(&verdict.to_string())?,
    }
    if verdict.interrupted() {
        let folder = path.display();
        shared.say(format_args!("interrupted; all members are saved. To go on:\n  scrnn train {folder} --resume"));
        return Ok(Ending::Interrupted);
    }
    Ok(if verdict.diverged() { Ending::Diverged } else { Ending::Done })
}

/// Where a member stands that this process trains.
fn member(k: usize, run: &Path, ends: &Ends) -> OneOfMany {
    let folder = members::folder(run, k);
    let stands = match (ends.contains(&members::label(k)), folder.join(CHECKPOINT).exists()) {
        (true, _) => Stands::Finished,
        (false, true) => Stands::Working,
        (false, false) => Stands::Waiting,
    };
    OneOfMany { name: format!("member {k}"), folder, stands, message: String::new() }
}

/// Tells what to do about an end before the last epoch.
fn ending(training: &Training, path: &Path, shared: &Shared) -> Ending {
    let folder = path.display();
    match &training.outcome {
        Outcome::Finished => Ending::Done,
        Outcome::Stopped if training.out_of_patience => Ending::Done,
        Outcome::Stopped => {
            shared.say(format_args!(
                "interrupted: epoch {} is saved. To go on:\n  scrnn train {folder} --resume",
                training.learner.epoch()
            ));
            Ending::Interrupted
        }
        Outcome::Diverged(divergence) => {
            output::say(format_args!(
                "{divergence}, which is saved in {folder}; the best network is {folder}/{BEST}.\n\
                 Train anew with a smaller rate, a variance_floor above 0 or, with adam, a smaller clip_norm."
            ));
            Ending::Diverged
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_wrap_at_words_and_tables_stay() {
        let text = format!("{}\n  a table {}\nshort\n", "word and ".repeat(20).trim_end(), "x".repeat(100));
        let found = wrapped(&text);
        assert!(found.lines().filter(|line| !line.starts_with(' ')).all(|line| line.len() <= 80), "{found}");
        assert_eq!(found.split_whitespace().collect::<Vec<_>>(), text.split_whitespace().collect::<Vec<_>>());
        assert!(found.contains(&format!("\n  a table {}\nshort\n", "x".repeat(100))));
    }
}
