//! `scrnn train`: from an experiment to a run folder.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn::learning::Outcome;

use crate::args::Shared;
use crate::output;
use crate::progress::Bars;
use crate::signals::Signals;
use scrnn_run::experiment::{self, Override};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::run_folder::{BEST, CHECKPOINT, EXPERIMENT};
use scrnn_run::training::{Found, Training, train};
use scrnn_run::verdict::Verdict;

/// Train a network as an experiment file says
///
/// The run folder receives experiment.toml (every value explicit), checkpoint.safetensors (the newest state),
/// best.safetensors (the lowest nll so far) and history.csv (how training went). Ctrl-C (also SIGTERM,
/// SIGHUP, SIGUSR1 and SIGXCPU, unless the parent ignores them as nohup does) ends the epoch, saves, and says how to go on; a
/// run that was killed goes on from its last checkpoint. Either way the result is the same to the bit as
/// if the run had never stopped.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn train assets/experiments/sinusoid.toml
  scrnn train sinusoid.toml --seed 2 --out runs/sinusoid-2 --set training.momentum.rate=1e-3
  scrnn train runs/sinusoid --resume --epochs 200000")]
pub struct Arguments {
    /// The experiment file; with --resume also a run folder, which holds its own
    experiment: PathBuf,
    /// The run folder [default: runs/NAME, after the experiment's name]
    #[arg(long, short, value_name = "RUN")]
    out: Option<PathBuf>,
    /// Go on with the run in the run folder, or start it if there is none
    #[arg(long)]
    resume: bool,
    /// Throw away the run that is in the run folder
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Number of epochs; 0 writes the initial network. Short for --set training.epochs=N
    #[arg(long, value_name = "N")]
    epochs: Option<u64>,
    /// Seed of the initial weights. Short for --set seed=N
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// In .mcap files, the topic whose messages are samples. Short for --set data.topic=TOPIC
    #[arg(long, value_name = "TOPIC")]
    topic: Option<String>,
    /// Replace a value of the experiment, e.g. training.adam.rate=0.001 or network.groups.context.units=20
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
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
        if let Some(topic) = &self.topic {
            overrides.push(Override::text("--topic", "data.topic", topic));
        }
        Ok(overrides)
    }

    /// The experiment file and, where the first argument is a run folder, that folder.
    fn experiment_file(&self) -> Result<(PathBuf, Option<&Path>)> {
        if !self.experiment.is_dir() {
            return Ok((self.experiment.clone(), None));
        }
        let folder = self.experiment.display();
        if !self.resume {
            let help = format!("to go on with the run in it: scrnn train {folder} --resume");
            return Err(Failure::input(format!("{folder} is a folder, not an experiment file"), help));
        }
        if self.out.is_some() {
            return Err(Failure::input(
                format!("--out says where to write, and so does {folder}"),
                "leave --out away to go on in that folder",
            ));
        }
        Ok((self.experiment.join(EXPERIMENT), Some(&self.experiment)))
    }
}

/// Trains.
pub fn run(arguments: &Arguments, (shared, signals): (&Shared, &Signals)) -> Result<Ending> {
    let (file, folder) = arguments.experiment_file()?;
    let experiment = experiment::read(&file, &arguments.overrides()?)?;
    let experiment = experiment.resolved(file.parent().unwrap_or(Path::new("")))?;
    let default_folder = || Path::new("runs").join(&experiment.name);
    let path = folder.map(Path::to_owned).or_else(|| arguments.out.clone()).unwrap_or_else(default_folder);

    let engine = shared.engine()?;
    let interrupt = signals.listen();
    let progress = Bars::new(shared.quiet).bar("", experiment.training.epochs);
    let found = if arguments.resume {
        if !path.join(CHECKPOINT).exists() {
            shared.say(format_args!("{} holds no checkpoint: starting from epoch 0", path.display()));
        }
        Found::GoOn
    } else if arguments.overwrite {
        Found::Overwrite
    } else {
        Found::Refuse
    };
    let training = train(&experiment, (&path, found), (&engine, &interrupt), progress, shared)?;
    let verdict = Verdict::new(&training, &engine)?;
    if arguments.json {
        output::print_json(&verdict)?;
    } else {
        output::print(&verdict.to_string())?;
    }
    Ok(ending(&training, &path, shared))
}

/// Tells what to do about an end before the last epoch.
fn ending(training: &Training, path: &Path, shared: &Shared) -> Ending {
    let folder = path.display();
    match &training.outcome {
        Outcome::Finished => Ending::Done,
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
