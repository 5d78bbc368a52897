//! Works on a sweep: takes runs that nobody holds, trains them side by side, and does with each network what the sweep file says, until
//! nothing is left to do.
//!
//! Any number of workers may do so at a time. A run is finished once its outcome.json is there; who finds it there goes on to the next.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use scrnn::engine::{Engine, InstructionSet};
use scrnn::jobs::side_by_side;
use scrnn::learning::Outcome as Ending;
use scrnn_run::experiment::{Data, Experiment};
use scrnn_run::failure::{self, Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_run::members::MakeProgress;
use scrnn_run::messages::{Messages, Silent};
use scrnn_run::run_folder::CHECKPOINT;
use scrnn_run::source::{self, Source};
use scrnn_run::training::{Found, Training, train_on};
use serde::Serialize;

use crate::claim::{self, Claim, Keeper, PATIENCE, Taken};
use crate::outcome::{self, Ended, FAILED, Failed, OUTCOME, Outcome, TIMES, Times};
use crate::plan::{PLAN, Plan, Run};
use crate::then::Numbers;

/// Between two looks at runs that others hold.
const PAUSE: Duration = Duration::from_secs(1);
/// Between two looks at whether somebody asked to stop.
const LOOK: Duration = Duration::from_millis(50);
/// Between two sentences about the whole.
const NEWS: Duration = Duration::from_secs(10);
/// Data sets that are kept in memory, those that were used last.
const MOST_SOURCES: usize = 8;

/// How to work.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which part of the runs: (I, N) is every N-th, from the I-th on, counted from 1.
    pub shard: (usize, usize),
    /// How long a claim of another machine may go without being renewed.
    pub patience: Duration,
    /// Whether runs that diverged, or killed whoever worked on them, are trained anew.
    pub retry: bool,
    /// Whether to wait for runs that others work on, in case these are lost.
    pub wait: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { shard: (1, 1), patience: PATIENCE, retry: false, wait: true }
    }
}

/// The machine, and where news goes.
pub struct Context<'a> {
    /// Threads in all.
    pub threads: usize,
    /// The vector instructions to use.
    pub instruction_set: InstructionSet,
    /// A person's wish to stop.
    pub interrupt: &'a Interrupt,
    /// Takes sentences for a person.
    pub messages: &'a dyn Messages,
    /// Watches one training, by a label and its number of epochs.
    pub progress: &'a MakeProgress<'a>,
}

/// What one call came to, over the runs of its shard.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Worked {
    /// Runs of the shard.
    pub runs: usize,
    /// Those that are finished and whole, whoever trained them.
    pub finished: usize,
    /// Those that diverged.
    pub diverged: usize,
    /// Those that are left alone since whoever worked on them was killed.
    pub killed: usize,
    /// Those that could not be finished, by their folders.
    pub failed: Vec<(String, Failed)>,
    /// Those that others still work on.
    pub busy: usize,
    /// Whether a person asked to stop.
    pub interrupted: bool,
}

/// What became of one run.
#[derive(Debug)]
enum Done {
    Ended(Ended),
    Failed(Failed),
    Busy,
    Stopped,
}

/// A plan with the folder that it is worked on in.
struct Work<'a> {
    plan: &'a Plan,
    folder: &'a Path,
    options: &'a Options,
    context: &'a Context<'a>,
    keeper: Keeper,
    sources: Sources,
    whole: Whole<'a>,
}

/// Works on the runs of a shard until all are finished, failed, or held by others that are not to be waited for.
///
/// # Errors
/// What keeps the sweep from beginning: a shard that there is not, a folder that cannot be written. What goes wrong with one run does not
/// end the others.
pub fn work(plan: &Plan, folder: &Path, options: &Options, context: &Context<'_>) -> Result<Worked> {
    let (shard, shards) = options.shard;
    if shard == 0 || shard > shards {
        return Err(Failure::input(
            format!("there is no shard {shard} of {shards}"),
            "shards count from 1: --shard 1/4",
        ));
    }
    prepare(plan, folder, context.messages)?;
    let own: Vec<usize> = plan.order().into_iter().skip(shard - 1).step_by(shards).collect();
    let work = Work {
        plan,
        folder,
        options,
        context,
        keeper: Keeper::new(context.interrupt, options.patience),
        sources: Sources::default(),
        whole: Whole::new(own.len(), context.messages),
    };
    if options.retry {
        work.forget(&own);
    }
    let mut worked = Worked { runs: own.len(), ..Worked::default() };
    let mut left = own;
    loop {
        // What is finished already needs no thread.
        left.retain(|&place| match work.finished(place) {
            Some(ended) => {
                worked.count(ended);
                false
            }
            None => true,
        });
        work.whole.at(worked.runs - left.len());
        let done =
            side_by_side(left.len(), context.threads, |k, threads| Ok::<_, Failure>(work.one(left[k], threads)))?;
        let mut busy = Vec::new();
        for (&place, done) in left.iter().zip(done) {
            match done {
                Done::Ended(ended) => worked.count(ended),
                Done::Failed(failed) => worked.failed.push((plan.runs[place].folder.clone(), failed)),
                Done::Busy => busy.push(place),
                Done::Stopped => {}
            }
        }
        worked.interrupted = context.interrupt.asked();
        (worked.busy, left) = (busy.len(), busy);
        if left.is_empty() || worked.interrupted || !options.wait {
            return Ok(worked);
        }
        work.whole.waiting(left.len());
        let begun = Instant::now();
        while begun.elapsed() < PAUSE && !context.interrupt.asked() {
            thread::sleep(LOOK);
        }
    }
}

/// Works on one run, if nobody else does: for engines that hand out the work themselves. The same folder, files and bits as [`work`].
///
/// # Errors
/// As [`work`]; [`Failure::Input`] for a place that the plan has not.
pub fn work_on(
    plan: &Plan,
    (folder, place): (&Path, usize),
    options: &Options,
    context: &Context<'_>,
) -> Result<Worked> {
    let Some(run) = plan.runs.get(place) else {
        let message = format!("there is no run {place}; the sweep has {}", plan.runs.len());
        return Err(Failure::input(message, "runs count from 0"));
    };
    let work = Work {
        plan,
        folder,
        options,
        context,
        keeper: Keeper::new(context.interrupt, options.patience),
        sources: Sources::default(),
        whole: Whole::new(1, &Silent),
    };
    let mut worked = Worked { runs: 1, ..Worked::default() };
    loop {
        match work.one(place, context.threads) {
            Done::Ended(ended) => worked.count(ended),
            Done::Failed(failed) => worked.failed.push((run.folder.clone(), failed)),
            Done::Busy if options.wait && !context.interrupt.asked() => {
                thread::sleep(LOOK);
                continue;
            }
            Done::Busy => worked.busy = 1,
            Done::Stopped => {}
        }
        worked.interrupted = context.interrupt.asked();
        return Ok(worked);
    }
}

/// Makes the folder and writes the plan into it.
///
/// # Errors
/// [`Failure::Disk`]; [`Failure::Refused`] for a folder of something else.
pub fn prepare(plan: &Plan, folder: &Path, messages: &dyn Messages) -> Result<()> {
    if folder.join(CHECKPOINT).exists() {
        let message = format!("{} holds a run", folder.display());
        return Err(Failure::refused(message, "--out FOLDER writes the sweep elsewhere"));
    }
    std::fs::create_dir_all(folder).map_err(|error| Failure::disk("make the folder", folder, error))?;
    let _ = scrnn_data::sweep(folder);
    let text = plan.listed().text();
    let path = folder.join(PLAN);
    match std::fs::read_to_string(&path) {
        Ok(old) if old == text => return Ok(()),
        Ok(_) => messages.say(
            "the sweep changed since it began: what is finished stays, runs that are no longer in it are not looked at",
        ),
        Err(_) => {}
    }
    Ok(scrnn_data::replace(&path, text.as_bytes())?)
}

impl Worked {
    /// How the command ends. What could not be finished weighs more than what diverged.
    #[must_use]
    pub fn ending(&self) -> failure::Ending {
        match (&self.failed.first(), self.interrupted) {
            (_, true) => failure::Ending::Interrupted,
            (Some((_, failed)), _) => failure::Ending::Unfinished(failed.code),
            (None, _) if self.killed > 0 => failure::Ending::Unfinished(5),
            (None, _) if self.diverged > 0 => failure::Ending::Diverged,
            (None, _) => failure::Ending::Done,
        }
    }

    fn count(&mut self, ended: Ended) {
        match ended {
            Ended::Finished | Ended::OutOfPatience => self.finished += 1,
            Ended::Diverged => self.diverged += 1,
            Ended::Killed => self.killed += 1,
        }
    }
}

impl fmt::Display for Worked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} of {} networks are finished", self.finished, self.runs)?;
        for (count, what) in [
            (self.diverged, "diverged (--retry trains them anew)"),
            (self.killed, "left alone: whoever trained them was killed each time (--retry tries again)"),
            (self.failed.len(), "could not be finished; the next call tries again"),
            (self.busy, "being trained by others"),
        ] {
            if count > 0 {
                writeln!(f, "{count} {what}")?;
            }
        }
        Ok(())
    }
}

impl Work<'_> {
    fn place(&self, run: &Run) -> PathBuf {
        self.folder.join(&run.folder)
    }

    /// How a run ended, if it is finished, and the sweep still asks for the same.
    fn finished(&self, place: usize) -> Option<Ended> {
        let run = &self.plan.runs[place];
        let outcome = outcome::read::<Outcome>(&self.place(run), OUTCOME)?;
        (outcome.decided_by == self.plan.decided_by(run).ok()?).then_some(outcome.outcome)
    }

    /// Lets runs that came to nothing be trained anew.
    fn forget(&self, places: &[usize]) {
        for &place in places {
            if let Some(ended) = self.finished(place).filter(|ended| !ended.is_whole()) {
                let folder = self.place(&self.plan.runs[place]);
                if ended == Ended::Killed {
                    claim::forget(&folder);
                }
                for name in [OUTCOME, CHECKPOINT] {
                    outcome::remove(&folder, name);
                }
            }
        }
    }

    /// Takes a run and finishes it.
    fn one(&self, place: usize, threads: usize) -> Done {
        if self.context.interrupt.asked() {
            return Done::Stopped;
        }
        let run = &self.plan.runs[place];
        let folder = self.place(run);
        if let Some(ended) = self.finished(place) {
            self.whole.one_more();
            return Done::Ended(ended);
        }
        let done = match Claim::take(&folder, &folder.join(CHECKPOINT), self.options.patience) {
            Err(failure) => self.failed(run, &folder, &failure),
            Ok(Taken::Busy) => return Done::Busy,
            Ok(Taken::Deadly(lost)) => {
                let message = format!(
                    "{lost} workers were killed one after the other while they trained it, and none of them got further"
                );
                let note = |decided_by| {
                    outcome::write(&folder, OUTCOME, &Outcome::new(Ended::Killed, Some(message), decided_by))
                };
                match self.plan.decided_by(run).and_then(note) {
                    Ok(()) => Done::Ended(Ended::Killed),
                    Err(failure) => self.failed(run, &folder, &failure),
                }
            }
            Ok(Taken::Held(claim)) => {
                let (claim, interrupt) = self.keeper.keep(claim);
                let done = match self.held(place, &folder, threads, &interrupt) {
                    Ok(Some(ended)) => Done::Ended(ended),
                    Ok(None) if self.context.interrupt.asked() => Done::Stopped,
                    // Somebody took it over, and goes on with it.
                    Ok(None) => Done::Busy,
                    Err(failure) => self.failed(run, &folder, &failure),
                };
                self.keeper.give_back(claim);
                done
            }
        };
        if !matches!(done, Done::Busy | Done::Stopped) {
            self.whole.one_more();
        }
        done
    }

    /// Notes what went wrong, and says it.
    fn failed(&self, run: &Run, folder: &Path, failure: &Failure) -> Done {
        let failed = Failed::of(failure);
        self.context.messages.say(&format!("{}: {}", run.folder, failed.message));
        // A disk that is full does not take this either; then the next look says that the run is unfinished.
        let _ = outcome::write(folder, FAILED, &failed);
        Done::Failed(failed)
    }

    /// Trains a run that is held; none where somebody asked to stop, or it was taken over.
    fn held(&self, place: usize, folder: &Path, threads: usize, interrupt: &Interrupt) -> Result<Option<Ended>> {
        // Somebody may have finished it between the look and the claim.
        if let Some(ended) = self.finished(place) {
            return Ok(Some(ended));
        }
        let run = &self.plan.runs[place];
        let engine = Engine::new(threads, self.context.instruction_set)?;
        let experiment = self.plan.experiment(run)?;
        let source = self.sources.of(&experiment.data, threads)?;
        let progress = (self.context.progress)(&format!("{}: ", run.folder), experiment.training.epochs);
        let source = Source::clone(&source);
        let training = train_on(&experiment, source, (folder, Found::GoOn), (&engine, interrupt), progress, &Silent)?;
        let (ended, message) = match &training.outcome {
            Ending::Finished => (Ended::Finished, None),
            Ending::Stopped if training.out_of_patience => (Ended::OutOfPatience, None),
            Ending::Stopped => return Ok(None),
            Ending::Diverged(divergence) => (Ended::Diverged, Some(divergence.to_string())),
        };
        let mut outcome = Outcome::new(ended, message, self.plan.decided_by(run)?);
        outcome.measures = learned(&training, &experiment);
        let begun = Instant::now();
        if ended.is_whole() {
            let place = self.plan.place.parent().unwrap_or(Path::new(""));
            outcome.measures.extend(self.plan.file.then.run(folder, (&training.source, place), &engine)?);
        }
        let times = Times {
            training: training.seconds,
            then: begun.elapsed().as_secs_f64(),
            threads,
            instruction_set: self.context.instruction_set.to_string(),
        };
        outcome::write(folder, TIMES, &times)?;
        outcome::remove(folder, FAILED);
        // What others left who were killed while they looked.
        let _ = scrnn_data::sweep(folder);
        // Last: with it the run is finished.
        outcome::write(folder, OUTCOME, &outcome)?;
        Ok(Some(ended))
    }
}

/// The measures of the training itself.
fn learned(training: &Training, experiment: &Experiment) -> Numbers {
    let mut numbers = Numbers::new();
    let mut number = |key: &str, value: Option<f64>| {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            numbers.insert(key.to_owned(), value);
        }
    };
    number("nll", training.score.and_then(|score| score.nll));
    number("mse", training.score.map(|score| score.mse));
    number("epoch", Some(training.learner.epoch() as f64));
    number("recoveries", Some(training.learner.recoveries() as f64));
    if let Some(best) = training.best {
        number("best.nll", best.nll);
        number("best.mse", Some(best.mse));
        number("best.epoch", Some(best.epoch as f64));
        if experiment.data.held_out.is_some() {
            number("held_out.nll", best.held_out.and_then(|one| one.nll));
            number("held_out.mse", best.held_out.map(|one| one.mse));
        }
    }
    numbers
}

/// The data that runs learn: many learn the same, which are made or read once.
#[derive(Default)]
struct Sources(Mutex<Kept>);

#[derive(Default)]
struct Kept {
    all: HashMap<String, Arc<Mutex<Option<Arc<Source>>>>>,
    /// Their keys, that which was used last at the end.
    used: Vec<String>,
}

impl Sources {
    /// What the data of a resolved experiment are. Two that want the same wait for each other, and not for others.
    fn of(&self, data: &Data, threads: usize) -> Result<Arc<Source>> {
        let key = serde_json::to_string(data).unwrap_or_default();
        let slot = {
            let mut kept = lock(&self.0);
            kept.used.retain(|other| *other != key);
            kept.used.push(key.clone());
            if kept.used.len() > MOST_SOURCES {
                let oldest = kept.used.remove(0);
                kept.all.remove(&oldest);
            }
            Arc::clone(kept.all.entry(key).or_default())
        };
        let mut slot = lock(&slot);
        if let Some(source) = &*slot {
            return Ok(Arc::clone(source));
        }
        let source = Arc::new(source::load(data, threads)?);
        *slot = Some(Arc::clone(&source));
        Ok(source)
    }
}

/// Nothing panics while it holds the lock, but for what ends the program.
fn lock<T>(held: &Mutex<T>) -> MutexGuard<'_, T> {
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How far the whole is, and how long the rest takes.
struct Whole<'a> {
    messages: &'a dyn Messages,
    state: Mutex<State>,
}

struct State {
    all: usize,
    done: usize,
    /// How many were done when this began to count, and when.
    begun: (usize, Instant),
    said: Option<Instant>,
    waits: bool,
}

impl<'a> Whole<'a> {
    fn new(all: usize, messages: &'a dyn Messages) -> Self {
        Self {
            messages,
            state: Mutex::new(State { all, done: 0, begun: (0, Instant::now()), said: None, waits: false }),
        }
    }

    /// So many are finished, whoever did it.
    fn at(&self, done: usize) {
        let mut state = lock(&self.state);
        state.done = done;
        if state.said.is_none() {
            state.begun = (done, Instant::now());
            if done > 0 {
                self.messages.say(&format!("{done} of {} networks are finished already", state.all));
            }
            state.said = Some(Instant::now());
        }
    }

    fn one_more(&self) {
        let mut state = lock(&self.state);
        state.done += 1;
        let since = state.said.map_or(Duration::MAX, |said| said.elapsed());
        if since < NEWS && state.done < state.all {
            return;
        }
        state.said = Some(Instant::now());
        let (before, begun) = state.begun;
        let (done, all) = (state.done, state.all);
        let each = begun.elapsed().as_secs_f64() / (done - before).max(1) as f64;
        let left = Duration::try_from_secs_f64(each * all.saturating_sub(done) as f64).unwrap_or(Duration::MAX);
        let left = match all > done {
            true => format!(", about {} left", scrnn_report::in_words(left)),
            false => String::new(),
        };
        drop(state);
        self.messages.say(&format!("{done} of {all} networks{left}"));
    }

    fn waiting(&self, busy: usize) {
        let mut state = lock(&self.state);
        if !state.waits {
            state.waits = true;
            drop(state);
            let are = if busy == 1 { "network is" } else { "networks are" };
            self.messages.say(&format!("{busy} {are} being trained by others: waiting, to take over what is lost"));
        }
    }
}

#[cfg(test)]
#[path = "working_tests.rs"]
mod tests;
