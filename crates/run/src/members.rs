//! A mixture of networks as one run: the same experiment from several seeds, side by side on the cores.
//!
//! Member k is trained with seed + k - 1 in the folder `member-k` of the run, which is a run folder of its own; all hold out the same
//! sequences. A mixture predicts by the mean of its members' densities, each of the same weight.

use std::fmt;
use std::path::Path;

use scrnn::engine::{Engine, InstructionSet};
use scrnn::jobs::side_by_side;
use scrnn::learning::Outcome;
use serde::Serialize;

use crate::evaluation::Member;
use crate::experiment::{Experiment, HeldOut, HeldOutDrawn};
use crate::failure::{Failure, Result};
use crate::held_out::{self, Judgement, Watch};
use crate::interrupt::Interrupt;
use crate::messages::{Messages, Progress};
use crate::notes::Score;
use crate::recipe;
use crate::run_folder::{BEST, CHECKPOINT, EXPERIMENT, HISTORY, RunFolder};
pub use crate::run_folder::{member as folder, members as folders};
use crate::source;
use crate::trained::Trained;
use crate::training::{Found, introduce, train, write_experiment};
use crate::trial;

/// Most networks of a mixture.
pub const MOST: u64 = 100;

/// What goes before what is shown of member `k`, from 1.
pub fn label(k: usize) -> String {
    format!("member {k}: ")
}

/// All networks of a run folder or a checkpoint file: one, or the members of a mixture.
///
/// # Errors
/// As [`Trained::open`].
pub fn open(path: &Path, best: bool) -> Result<Vec<Trained>> {
    match folders(path) {
        none if none.is_empty() => Ok(vec![Trained::open(path, best)?]),
        folders => folders.iter().map(|folder| Trained::open(folder, best)).collect(),
    }
}

/// The experiment of member `k`, from 1.
pub fn experiment_of(experiment: &Experiment, k: usize) -> Experiment {
    let mut own = experiment.clone();
    own.training.members = None;
    own.seed = experiment.seed.wrapping_add(k as u64 - 1);
    if let Some(HeldOut::Share(share)) = own.data.held_out {
        own.data.held_out = Some(HeldOut::Drawn(HeldOutDrawn { share, seed: experiment.seed }));
    }
    own
}

/// How the training of one member ended.
#[derive(Debug, Clone, Serialize)]
pub struct Ended {
    /// Its folder.
    pub run: String,
    /// "finished", "out of patience", "interrupted" or "diverged".
    pub outcome: &'static str,
    /// The epoch that it ended at.
    pub epoch: u64,
    /// How the last network does.
    pub score: Option<Score>,
    /// The best epoch.
    pub best: Option<Score>,
    /// Seconds of training.
    pub seconds: f64,
}

/// How the training of a mixture ended.
#[derive(Debug, Clone, Serialize)]
pub struct MixtureVerdict {
    /// The folder of the run.
    pub run: String,
    /// Its members.
    pub members: Vec<Ended>,
    /// How the mixture of the best networks does on what is held out.
    pub held_out: Option<Judgement>,
}

/// Gives a training its progress, by a label and its number of epochs.
pub type MakeProgress<'a> = dyn Fn(&str, u64) -> Box<dyn Progress> + Sync + 'a;

/// Trains all members of an experiment that has some.
///
/// # Errors
/// [`Failure::Refused`] for a folder that holds another kind of run; as [`train`].
pub fn train_members(
    experiment: &Experiment,
    (path, wanted): (&Path, Found),
    (cores, instruction_set, interrupt): (usize, InstructionSet, &Interrupt),
    progress: &MakeProgress<'_>,
    messages: &dyn Messages,
) -> Result<MixtureVerdict> {
    let count = usize::try_from(experiment.training.members.unwrap_or(1)).unwrap_or(1);
    let run = RunFolder::open(path)?;
    let single = run.file(CHECKPOINT).exists();
    let there = folders(path).len();
    if single && wanted != Found::Overwrite || there > 0 && wanted == Found::Refuse {
        let what = if single { "a run of one network" } else { "a run" };
        return Err(Failure::refused(
            format!("{} already holds {what}", path.display()),
            "--overwrite throws it away, --out RUN writes elsewhere",
        ));
    }
    if there > count && wanted == Found::GoOn {
        return Err(Failure::refused(
            format!("{} holds {there} members, the experiment asks for {count}", path.display()),
            "undo the change, or start anew with --overwrite or in another folder with --out",
        ));
    }
    if wanted == Found::Overwrite {
        for name in [CHECKPOINT, BEST, HISTORY] {
            run.remove(name)?;
        }
        for k in count + 1..=there {
            let member = RunFolder::open(&folder(path, k))?;
            [CHECKPOINT, BEST, HISTORY, EXPERIMENT].into_iter().try_for_each(|name| member.remove(name))?;
        }
    }
    // What a recipe leaves open is found out once, for all of them.
    let (settled, introduced) = match experiment.comments.iter().any(recipe::leaves_open) {
        true => {
            let source = source::load_while(&experiment.data, cores, interrupt)?;
            let source = held_out::split(source, experiment)?;
            introduce(experiment, &source, messages);
            let engine = Engine::new(cores, instruction_set)?;
            let mut bar = progress("", experiment.training.epochs);
            let settled = trial::settle(experiment.clone(), &source, (&engine, interrupt), &mut *bar, messages)?;
            bar.finish();
            (settled, true)
        }
        false => (experiment.clone(), false),
    };
    let experiment = &settled;
    write_experiment(&run, experiment)?;
    messages.say(&format!(
        "trains {count} networks, seeds {} to {}",
        experiment.seed,
        experiment_of(experiment, count).seed
    ));
    let members = side_by_side(count, cores, |index, threads| {
        let (k, engine) = (index + 1, Engine::new(threads, instruction_set)?);
        let (own, place) = (experiment_of(experiment, k), folder(path, k));
        let quiet = Quiet;
        let heard: &dyn Messages = if k == 1 && !introduced { messages } else { &quiet };
        let bar = progress(&label(k), own.training.epochs);
        let training = train(&own, (&place, wanted), (&engine, interrupt), bar, heard)?;
        Ok::<_, Failure>(Ended {
            run: place.display().to_string(),
            outcome: match &training.outcome {
                Outcome::Finished => "finished",
                Outcome::Stopped if training.out_of_patience => "out of patience",
                Outcome::Stopped => "interrupted",
                Outcome::Diverged(_) => "diverged",
            },
            epoch: training.learner.epoch(),
            score: training.score,
            best: training.best,
            seconds: training.seconds,
        })
    })?;
    let interrupted = members.iter().any(|member| member.outcome == "interrupted");
    let held_out = match interrupted {
        true => None,
        false => judge(&open(path, true)?, experiment, &Engine::new(cores, instruction_set)?)?,
    };
    Ok(MixtureVerdict { run: path.display().to_string(), members, held_out })
}

/// The members' warnings are those of the first.
struct Quiet;

impl Messages for Quiet {
    fn say(&self, _message: &str) {}
}

/// How the mixture does on what the experiment, that of a member or of all, holds out, if anything.
///
/// # Errors
/// What is wrong with the data.
pub fn judge(all: &[Trained], experiment: &Experiment, engine: &Engine) -> Result<Option<Judgement>> {
    let Some(first) = all.first().filter(|_| experiment.data.held_out.is_some()) else { return Ok(None) };
    let source = first.source(engine.threads())?;
    let checkpoint = &first.checkpoint;
    let scaled = checkpoint.scaling.apply(&source.data)?;
    let watch = Watch::new(experiment, (&source, &checkpoint.scaling, &scaled), checkpoint.topology.delay(), engine)?;
    let Some(watch) = watch else { return Ok(None) };
    let networks: Vec<_> = all.iter().map(Trained::network).collect();
    let members = mixed(all, &networks);
    let epoch = all.iter().map(|one| one.checkpoint.epoch).max().unwrap_or(0);
    Ok(Some(watch.judge(&members, epoch, experiment.network.initial_state_variance)?))
}

/// The members, with their networks beside them.
pub fn mixed<'a>(all: &'a [Trained], networks: &'a [scrnn::network::Network]) -> Vec<Member<'a>> {
    let member = |(one, network): (&'a Trained, &'a scrnn::network::Network)| Member {
        network,
        states: &one.checkpoint.initial_states,
    };
    all.iter().zip(networks).map(member).collect()
}

impl MixtureVerdict {
    /// Whether some member was stopped by a person.
    pub fn interrupted(&self) -> bool {
        self.members.iter().any(|member| member.outcome == "interrupted")
    }

    /// Whether some member diverged.
    pub fn diverged(&self) -> bool {
        self.members.iter().any(|member| member.outcome == "diverged")
    }
}

impl fmt::Display for MixtureVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = |score: Option<Score>| match score {
            Some(Score { nll: Some(nll), .. }) => format!("nll {nll:.4}"),
            Some(Score { mse, .. }) => format!("mse {mse:.4e}"),
            None => "no score".to_owned(),
        };
        for Ended { run, outcome, epoch, score, best, .. } in &self.members {
            let held_out = best.and_then(|best| best.held_out.map(|held_out| (held_out, best.epoch)));
            let held_out = held_out.map_or(String::new(), |(held_out, epoch)| {
                let value = held_out.nll.map_or(format!("mse {:.4e}", held_out.mse), |nll| format!("nll {nll:.4}"));
                format!("; best on what is held out at epoch {epoch}: {value}")
            });
            writeln!(f, "{run}: {outcome} at epoch {epoch}, {}{held_out}", value(*score))?;
        }
        match &self.held_out {
            Some(held_out) => write!(f, "{held_out}"),
            None => Ok(()),
        }
    }
}
