//! `scrnn train`: from an experiment to a run folder.

mod interrupt;
mod recorder;
mod resume;
mod verdict;

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::Dataset;
use scrnn::initialization::initialize;
use scrnn::learning::{Learner, Outcome};
use scrnn::network::Network;

use crate::args::Shared;
use crate::experiment::{self, Experiment, Override};
use crate::failure::{Ending, Failure, Result};
use crate::history::History;
use crate::notes::{DataNotes, Notes, learned_part};
use crate::output;
use crate::progress::Progress;
use crate::run_folder::{BEST, CHECKPOINT, EXPERIMENT, HISTORY, RunFolder};
use crate::source;
use crate::trained::read_checkpoint;
use interrupt::Interrupt;
use recorder::{Record, Recorder};
use verdict::Verdict;

/// Train a network as an experiment file says
///
/// The run folder receives experiment.toml (every value explicit), checkpoint.safetensors (the newest state),
/// best.safetensors (the lowest nll so far) and history.csv (how training went). Ctrl-C ends the epoch, saves, and says
/// how to go on; a run that was killed goes on from its last checkpoint. Either way the result is the same to the bit as
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
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let (file, folder) = arguments.experiment_file()?;
    let experiment = experiment::read(&file, &arguments.overrides()?)?;
    let experiment = experiment.resolved(file.parent().unwrap_or(Path::new("")))?;
    let default_folder = || Path::new("runs").join(&experiment.name);
    let path = folder.map(Path::to_owned).or_else(|| arguments.out.clone()).unwrap_or_else(default_folder);

    let engine = shared.engine()?;
    let source = source::load(&experiment.data)?;
    let topology = experiment.topology(source.data.channels().len())?;
    source.data.check_for(&topology)?;
    let scaling = experiment.data.scaling_for(&source.data)?;
    let scaled = scaling.apply(&source.data);
    warn_out_of_reach(&scaled, shared);

    let (network, initial_states) = initialize(&topology, scaled.sequences().len(), experiment.seed);
    let mut learner = Learner::new(network, initial_states, &scaled, experiment.plan(), &engine)?;
    let notes = Notes {
        experiment: learned_part(&experiment),
        data: DataNotes {
            digest: source::digest(&source.data),
            lengths: source.data.sequences().iter().map(|sequence| sequence.len()).collect(),
        },
        score: None,
        best: None,
    };

    let run = RunFolder::open(&path)?;
    let found = run.file(CHECKPOINT).exists();
    if found && !arguments.resume && !arguments.overwrite {
        return Err(Failure::refused(
            format!("{} already holds a run", path.display()),
            "--resume goes on with it, --overwrite throws it away, --out RUN writes elsewhere",
        ));
    }
    let (notes, history) = if found && arguments.resume {
        let checkpoint = read_checkpoint(&run.file(CHECKPOINT))?;
        let notes = resume::check(&checkpoint, notes, &experiment, &path)?;
        learner = go_on(checkpoint, &scaled, &experiment, &engine)?;
        shared.say(format_args!("going on with {} at epoch {}", path.display(), learner.epoch()));
        write_experiment(&run, &experiment)?;
        (notes, History::go_on(&run, learner.epoch())?)
    } else {
        if arguments.resume {
            shared.say(format_args!("{} holds no checkpoint: starting from epoch 0", path.display()));
        }
        // In this order: a kill in between leaves a folder without a run rather than parts of two.
        for name in [CHECKPOINT, BEST, HISTORY] {
            run.remove(name)?;
        }
        write_experiment(&run, &experiment)?;
        (notes, History::start(&run)?)
    };
    let record = Record {
        scaling: scaling.clone(),
        channels: scaled.channels().to_vec(),
        sequences: scaled.sequences().iter().map(|sequence| sequence.name.clone()).collect(),
        first_inputs: first_inputs(&scaled, topology.delay()),
    };

    let interrupt = Interrupt::listen();
    let progress = Progress::new(experiment.training.epochs, shared.quiet);
    let mut recorder = Recorder::new(&run, record, notes, history, progress, &experiment, &interrupt);
    if found && arguments.resume {
        recorder.take_up_best(&learner);
    } else {
        recorder.save(&learner)?;
    }
    let outcome = learner.run(&mut recorder);
    recorder.finish(&learner, &outcome)?;

    let verdict = Verdict::new(&recorder, &learner, &source, &scaling, &outcome, &engine)?;
    if arguments.json {
        output::print_json(&verdict)?;
    } else {
        output::print(&verdict.to_string())?;
    }
    Ok(ending(&outcome, &learner, &path, shared))
}

/// Tells what to do about an end before the last epoch.
fn ending(outcome: &Outcome, learner: &Learner, path: &Path, shared: &Shared) -> Ending {
    let folder = path.display();
    match outcome {
        Outcome::Finished => Ending::Done,
        Outcome::Stopped => {
            shared.say(format_args!(
                "interrupted: epoch {} is saved. To go on:\n  scrnn train {folder} --resume",
                learner.epoch()
            ));
            Ending::Interrupted
        }
        Outcome::Diverged(divergence) => {
            eprintln!(
                "{divergence}, which is saved in {folder}; the best network is {folder}/{BEST}.\n\
                 Train anew with a smaller rate, a variance_floor above 0 or, with adam, a smaller clip_norm."
            );
            Ending::Diverged
        }
    }
}

/// A learner that stands where the checkpoint stands.
fn go_on(
    checkpoint: Checkpoint,
    scaled: &Dataset,
    experiment: &Experiment,
    engine: &scrnn::engine::Engine,
) -> Result<Learner> {
    let Checkpoint { topology, parameters, initial_states, epoch, optimiser, .. } = checkpoint;
    let network = Network { topology, parameters };
    let mut learner = Learner::new(network, initial_states, scaled, experiment.plan(), engine)?;
    learner.restore(epoch, &optimiser)?;
    Ok(learner)
}

fn write_experiment(run: &RunFolder, experiment: &Experiment) -> Result<()> {
    let text = toml::to_string(experiment).expect("the experiment came from such a file");
    let head = "# Written by scrnn train: the experiment with every value explicit.\n";
    run.write(EXPERIMENT, format!("{head}{text}").as_bytes())
}

/// The first xi samples of each sequence: what a closed loop starts from.
fn first_inputs(scaled: &Dataset, delay: usize) -> Vec<f64> {
    let values = delay * scaled.channels().len();
    scaled.sequences().iter().flat_map(|sequence| &sequence.values()[..values]).copied().collect()
}

/// The mean units reach from -1 to 1: samples beyond cannot be predicted.
fn warn_out_of_reach(scaled: &Dataset, shared: &Shared) {
    for (i, name) in scaled.channels().iter().enumerate() {
        let samples =
            scaled.sequences().iter().flat_map(|sequence| sequence.values().chunks_exact(scaled.channels().len()));
        let beyond = samples.map(|sample| sample[i]).filter(|value| value.abs() >= 1.0).count();
        if beyond > 0 {
            let total = scaled.total_samples();
            shared.say(format_args!(
                "warning: {beyond} of {total} samples of channel {name} lie outside of -1 to 1, where the network's \
                 predictions end; `scaling = \"fit\"` in [data] brings them inside"
            ));
        }
    }
}
