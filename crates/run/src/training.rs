//! One training, from a resolved experiment to a run folder: begun, gone on with, or begun anew.

use std::path::Path;

use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::initial_states::InitialStates;
use scrnn::initialization::initialize;
use scrnn::learning::{Learner, Outcome};
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn::topology::Topology;
use scrnn_data::Level;

use crate::character::still_channels;
use crate::digest::digest;
use crate::experiment::{self, Experiment, ScalingChoice, ScalingName};
use crate::failure::{Failure, Result};
use crate::familiar::ranges;
use crate::held_out::{self, Watch};
use crate::history::History;
use crate::interrupt::Interrupt;
use crate::messages::{Messages, Progress};
use crate::notes::{DataNotes, Notes, Score, learned_part};
use crate::recorder::{Record, Recorder};
use crate::resume;
use crate::run_folder::{BEST, CHECKPOINT, EXPERIMENT, FILES, HISTORY, RunFolder};
use crate::source::{self, Source};
use crate::trained::read_checkpoint;
use crate::trial;

/// What to do with a run that is in the folder already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// Leave it, and fail.
    Refuse,
    /// Go on with it; without one, start.
    GoOn,
    /// Throw it away.
    Overwrite,
}

/// A training that has ended.
#[derive(Debug)]
pub struct Training {
    /// The run folder.
    pub run: String,
    /// How it ended.
    pub outcome: Outcome,
    /// The learner, as it was left.
    pub learner: Learner,
    /// What it learned from.
    pub source: Source,
    /// Between the data's units and the network's.
    pub scaling: Scaling,
    /// Whether it ended before its last epoch because nothing got better on the sequences that are held out.
    pub out_of_patience: bool,
    /// Looks at networks on what is held out, if anything is.
    pub watch: Option<Watch>,
    /// The best network with its initial states, where it is known.
    pub best_network: Option<(Network, InitialStates)>,
    /// The variance of the prior over initial states.
    pub initial_state_variance: f64,
    /// How the network does, if its last epoch was evaluated.
    pub score: Option<Score>,
    /// The best epoch.
    pub best: Option<Score>,
    /// Seconds of training, those of earlier processes included.
    pub seconds: f64,
}

/// Trains, and keeps the run folder up to date.
///
/// # Errors
/// [`Failure::Refused`] if a run is there and may not be gone on with; whatever is wrong with experiment or data.
pub fn train(
    experiment: &Experiment,
    (path, wanted): (&Path, Found),
    (engine, interrupt): (&Engine, &Interrupt),
    progress: Box<dyn Progress>,
    messages: &dyn Messages,
) -> Result<Training> {
    let source = source::load_while(&experiment.data, engine.threads(), interrupt)?;
    train_on(experiment, source, (path, wanted), (engine, interrupt), progress, messages)
}

/// As [`train`], on what the experiment's data were found to be.
///
/// # Errors
/// As [`train`].
pub fn train_on(
    experiment: &Experiment,
    source: Source,
    (path, wanted): (&Path, Found),
    (engine, interrupt): (&Engine, &Interrupt),
    mut progress: Box<dyn Progress>,
    messages: &dyn Messages,
) -> Result<Training> {
    let source = held_out::split(source, experiment)?;
    if experiment.data.files.is_some() {
        introduce(experiment, &source, messages);
    }
    // Whoever refuses a run does so at once.
    let is_refused = wanted == Found::Refuse && path.join(CHECKPOINT).exists();
    let settled = match is_refused {
        true => experiment.clone(),
        false => trial::settle(experiment.clone(), &source, (engine, interrupt), &mut *progress, messages)?,
    };
    let experiment = &settled;
    progress.expect(experiment.training.epochs);
    if !experiment.comments.is_empty() {
        messages.say(&chosen(experiment, path));
    }
    let topology = experiment.bare_topology(source.data.channels().len())?;
    source.data.check_for(&topology)?;
    refuse_unbounded(&source.data, &topology)?;
    let scaling = experiment.data.scaling_for(&source.data)?;
    let scaled = scaling.apply(&source.data)?;
    let topology = experiment.topology(&scaled)?;
    if !topology.has_linear_mean() && topology.skip().is_none() {
        warn_out_of_reach(experiment, &scaled, messages);
    }
    let watch = Watch::new(experiment, (&source, &scaling, &scaled), topology.delay(), engine)?;

    let (network, initial_states) = initialize(&topology, scaled.sequences().len(), experiment.seed);
    let mut learner = Learner::new(network, initial_states, &scaled, experiment.plan(), engine)?;
    let notes = Notes {
        experiment: learned_part(experiment),
        data: DataNotes {
            digest: digest(&source.data),
            lengths: source.data.sequences().iter().map(|sequence| sequence.len()).collect(),
            ranges: ranges(&source.data).into_iter().map(Option::unwrap_or_default).collect(),
            held_out: held_out::notes(&source),
        },
        numerics: learner.numerics().to_owned(),
        score: None,
        best: None,
        variance_factor: None,
    };

    refuse_own_input(experiment, path)?;
    let run = RunFolder::open(path)?;
    let found = run.file(CHECKPOINT).exists();
    if found && wanted == Found::Refuse {
        return Err(Failure::refused(
            format!("{} already holds a run", path.display()),
            "--resume goes on with it, --overwrite throws it away, --out RUN writes elsewhere",
        ));
    }
    let (notes, history) = if found && wanted == Found::GoOn {
        let checkpoint = read_checkpoint(&run.file(CHECKPOINT))?;
        let notes = resume::check(&checkpoint, notes, experiment, path)?;
        learner = Learner::resume(&checkpoint, &scaled, experiment.plan(), engine)?;
        messages.say(&format!("going on with {} at epoch {}", path.display(), learner.epoch()));
        keep_experiment(&run, experiment)?;
        (notes, History::go_on(&run, (learner.epoch(), watch.is_some()), messages)?)
    } else {
        // In this order: a kill in between leaves a folder without a run rather than parts of two.
        for name in [CHECKPOINT, BEST, HISTORY] {
            run.remove(name)?;
        }
        write_experiment(&run, experiment)?;
        (notes, History::start(&run, watch.is_some())?)
    };
    let record = Record {
        scaling: scaling.clone(),
        channels: scaled.channels().to_vec(),
        sequences: scaled.sequences().iter().map(|sequence| sequence.name.clone()).collect(),
        first_inputs: first_inputs(&scaled, topology.delay()),
    };

    let observed = (interrupt, watch.as_ref());
    let mut recorder = Recorder::new(&run, record, notes, history, (progress, messages), experiment, observed);
    if found && wanted == Found::GoOn {
        recorder.take_up_best(&learner);
    } else {
        recorder.save(&learner)?;
    }
    let outcome = engine.enter(|| learner.run(&mut recorder));
    recorder.finish(&learner, &outcome)?;
    let (score, best, seconds) = (recorder.score_of(learner.epoch()), recorder.best(), recorder.seconds());
    let (best_network, out_of_patience) = (recorder.best_network(&learner)?, recorder.out_of_patience());
    drop(recorder);
    let run = run.path().display().to_string();
    let initial_state_variance = experiment.network.initial_state_variance;
    Ok(Training {
        run,
        outcome,
        learner,
        source,
        scaling,
        out_of_patience,
        watch,
        best_network,
        initial_state_variance,
        score,
        best,
        seconds,
    })
}

/// Refuses to write a run's files over the data that it learns.
fn refuse_own_input(experiment: &Experiment, run: &Path) -> Result<()> {
    let inputs =
        experiment.data.files.iter().flatten().flat_map(|pattern| scrnn_data::expand(pattern).unwrap_or_default());
    for input in inputs {
        if let Some(name) = FILES.iter().find(|name| scrnn_data::is_one_file(&run.join(name), &input)) {
            let message = format!("the run would write its {name} over the data: {}", input.display());
            return Err(Failure::refused(message, "choose another folder with --out"));
        }
    }
    Ok(())
}

/// Says what is learned, and what looks wrong in it, before anything is learned.
pub(crate) fn introduce(experiment: &Experiment, source: &Source, messages: &dyn Messages) {
    let data = &source.data;
    let lengths = || data.sequences().iter().map(|sequence| sequence.len());
    let (shortest, longest) = (lengths().min().unwrap_or(0), lengths().max().unwrap_or(0));
    let count = data.sequences().len();
    let mut line = format!("learns {count} sequence{}", if count == 1 { "" } else { "s" });
    line += &match shortest == longest {
        true => format!(" of {longest} samples"),
        false => format!(" of {shortest} to {longest} samples"),
    };
    if let Some(period) = source.period {
        line += &format!(", {} Hz", (1e3 / period).round() / 1e3);
    }
    let files = experiment.data.files.as_deref().unwrap_or_default();
    let names = files.iter().map(|file| file.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let names = names.collect::<Vec<_>>().join(", ");
    messages.say(&format!("{line}, channels: {} (from {names})", data.channels().join(", ")));
    if let Some(held_out) = &source.held_out {
        let names: Vec<&str> = held_out.sequences().iter().map(|sequence| sequence.name.as_str()).take(20).collect();
        let more = if held_out.sequences().len() > names.len() { ", ..." } else { "" };
        messages.say(&format!("holds {} out to judge by: {}{more}", held_out.sequences().len(), names.join(", ")));
    }
    for remark in &source.remarks {
        let kind = if remark.level() == Level::Warning { "warning" } else { "note" };
        let help = remark.help().map_or(String::new(), |help| format!(" ({help})"));
        messages.say(&format!("{kind}: {remark}{help}"));
    }
}

/// What was chosen where no experiment was given.
fn chosen(experiment: &Experiment, path: &Path) -> String {
    let groups = experiment.network.groups.iter();
    let units = groups.map(|group| format!("{} units of time constant {}", group.units, group.time_constant));
    format!(
        "without an experiment file: {}, {} epochs; {} has all settings and says why",
        units.collect::<Vec<_>>().join(" and "),
        experiment.training.epochs,
        path.join(EXPERIMENT).display()
    )
}

/// A channel that never changes lets its variance fall for ever: refuses it where no floor stops that.
fn refuse_unbounded(data: &Dataset, topology: &Topology) -> Result<()> {
    if !topology.has_variance() || topology.variance_floor() > 0.0 {
        return Ok(());
    }
    let n = data.channels().len();
    let is_there = |i: usize| {
        data.sequences().iter().any(|one| one.values().iter().skip(i).step_by(n).any(|value| !value.is_nan()))
    };
    if let Some(i) = (0..n).find(|i| !is_there(*i)) {
        let message = format!("channel {} was never observed: all its samples are missing", data.channels()[i]);
        return Err(Failure::input(message, "leave it out: `channels` in [data] names what to learn"));
    }
    let still = still_channels(data, topology.delay());
    let Some(first) = still.first() else { return Ok(()) };
    let what = if still.len() == 1 {
        format!("channel {first} never changes")
    } else {
        format!("channels {} never change", still.join(", "))
    };
    Err(Failure::input(
        format!("{what}: without noise its likelihood has no bound, and its variance would fall until numbers end"),
        "leave it out with `channels` in [data], or set `variance_floor` in [network], e.g. to 1e-4",
    ))
}

/// Writes the resolved experiment into its run folder.
pub(crate) fn write_experiment(run: &RunFolder, experiment: &Experiment) -> Result<()> {
    let head = match experiment.comments.is_empty() {
        true => "# Written by scrnn train: the experiment with every value explicit.\n",
        false => {
            "# Chosen and written by scrnn train, as no experiment file was given: every value, and why where there was a \
             choice.\n# To try others, copy this file, change it, and call `scrnn train` with the copy.\n\n"
        }
    };
    run.write(EXPERIMENT, format!("{head}{}", experiment.to_file()).as_bytes())
}

/// Writes the experiment of a run that goes on, unless the file says the same: its comments are kept.
fn keep_experiment(run: &RunFolder, experiment: &Experiment) -> Result<()> {
    let kept = experiment::read(&run.file(EXPERIMENT), &[]).is_ok_and(|kept| kept.says_the_same(experiment));
    if kept { Ok(()) } else { write_experiment(run, experiment) }
}

/// The first xi samples of each sequence: what a closed loop starts from. For a value that is missing stands what stood in for it as an
/// input.
fn first_inputs(scaled: &Dataset, delay: usize) -> Vec<f64> {
    let n = scaled.channels().len();
    let of = |sequence: &scrnn::dataset::Sequence| {
        let mut last = vec![0.0; n];
        let mut values = Vec::with_capacity(delay * n);
        for sample in sequence.values()[..delay * n].chunks_exact(n) {
            last.iter_mut().zip(sample).filter(|(_, x)| !x.is_nan()).for_each(|(last, x)| *last = *x);
            values.extend_from_slice(&last);
        }
        values
    };
    scaled.sequences().iter().flat_map(of).collect()
}

/// The mean units reach from -1 to 1: samples beyond cannot be predicted.
fn warn_out_of_reach(experiment: &Experiment, scaled: &Dataset, messages: &dyn Messages) {
    let robust = experiment.data.scaling == Some(ScalingChoice::Named(ScalingName::Robust));
    let what = match robust {
        true => "scaled without its spikes, as \"robust\" means it",
        false => "`scaling = \"fit\"` in [data] brings them inside",
    };
    for (i, name) in scaled.channels().iter().enumerate() {
        let samples =
            scaled.sequences().iter().flat_map(|sequence| sequence.values().chunks_exact(scaled.channels().len()));
        let beyond = samples.map(|sample| sample[i]).filter(|value| value.abs() >= 1.0).count();
        if beyond > 0 {
            let total = scaled.total_samples();
            messages.say(&format!(
                "warning: {beyond} of {total} samples of channel {name} lie outside of -1 to 1, where the network's \
                 predictions end; {what}"
            ));
        }
    }
}
