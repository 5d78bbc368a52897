//! Keeps a training's run folder up to date: checkpoints, the best network, the history; and watches for Ctrl-C.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use scrnn::checkpoint::{Checkpoint, OptimiserState};
use scrnn::initial_states::InitialStates;
use scrnn::learning::{EpochReport, Learner, Observer, Outcome, Recovery};
use scrnn::network::Network;
use scrnn::parameters::Parameters;
use scrnn::scaling::Scaling;

use crate::experiment::Experiment;
use crate::failure::{Failure, Result};
use crate::held_out::{Glance, Watch};
use crate::history::History;
use crate::interrupt::Interrupt;
use crate::messages::{Messages, Progress};
use crate::notes::{HeldOutScore, Notes, Score};
use crate::run_folder::{BEST, CHECKPOINT, RunFolder};
use crate::trained::read_checkpoint;

/// What all checkpoints of a run have in common.
#[derive(Debug)]
pub struct Record {
    /// Between the data's units and the network's.
    pub scaling: Scaling,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// The first xi samples of each sequence, scaled.
    pub first_inputs: Vec<f64>,
}

/// The observer of a training.
pub struct Recorder<'a> {
    run: &'a RunFolder,
    record: Record,
    notes: Notes,
    history: History,
    progress: Box<dyn Progress>,
    messages: &'a dyn Messages,
    interrupt: &'a Interrupt,
    epochs: u64,
    history_every: u64,
    checkpoint_every: Option<u64>,
    checkpoint_pause: Duration,
    begun: Instant,
    saved: Instant,
    saved_epoch: Option<u64>,
    /// The best network so far, if it is known, and whether its file is yet to be written.
    best: Option<(Parameters, InitialStates)>,
    best_waits: bool,
    /// Looks at the network on what is held out.
    watch: Option<&'a Watch>,
    /// Whether it was ended because nothing got better on what is held out.
    out_of_patience: bool,
    /// Whether the training was just reset to its best network: that is worth a row of the history.
    recovered: bool,
    failure: Option<Failure>,
}

impl<'a> Recorder<'a> {
    /// An observer for a training that is about to begin or to go on.
    pub fn new(
        run: &'a RunFolder,
        record: Record,
        notes: Notes,
        history: History,
        (progress, messages): (Box<dyn Progress>, &'a dyn Messages),
        experiment: &Experiment,
        (interrupt, watch): (&'a Interrupt, Option<&'a Watch>),
    ) -> Self {
        let output = &experiment.output;
        Self {
            run,
            record,
            notes,
            history,
            progress,
            messages,
            interrupt,
            epochs: experiment.training.epochs,
            history_every: output.history_every.unwrap_or(1),
            checkpoint_every: output.checkpoint_every,
            checkpoint_pause: Duration::try_from_secs_f64(output.checkpoint_seconds).unwrap_or(Duration::MAX),
            begun: Instant::now(),
            saved: Instant::now(),
            saved_epoch: None,
            best: None,
            best_waits: false,
            watch,
            out_of_patience: false,
            recovered: false,
            failure: None,
        }
    }

    /// Takes up the best network of the run that goes on, and will write it again: its notes then speak of the experiment
    /// as it is now. A file of a later epoch than the checkpoint's is left to be found anew.
    pub fn take_up_best(&mut self, learner: &Learner) {
        let Some(best) = self.notes.best else { return };
        if let Ok(file) = read_checkpoint(&self.run.file(BEST))
            && file.epoch == best.epoch
            && file.topology == *learner.network().topology()
            && file.sequences == self.record.sequences
        {
            self.best = Some((file.parameters, file.initial_states));
            self.best_waits = true;
        }
    }

    /// Writes history, best network and checkpoint, in this order: the checkpoint speaks for the others.
    pub fn save(&mut self, learner: &Learner) -> Result<()> {
        self.history.flush(self.run)?;
        if let (Some((parameters, initial_states)), true) = (&self.best, self.best_waits) {
            let notes = Notes { score: self.notes.best, ..self.notes.clone() };
            let epoch = self.notes.best.map_or(0, |best| best.epoch);
            let best = self.checkpoint(learner, parameters, initial_states, (epoch, OptimiserState::default()), &notes);
            best.check()?;
            self.run.write(BEST, &best.to_bytes()?)?;
            self.best_waits = false;
        }
        let notes = Notes { score: self.score_of(learner.epoch()), ..self.notes.clone() };
        let state = (learner.epoch(), learner.optimiser_state());
        let newest = self.checkpoint(learner, learner.network().parameters(), learner.initial_states(), state, &notes);
        // Never replace a good file by one that could not be read back.
        newest.check()?;
        self.run.write(CHECKPOINT, &newest.to_bytes()?)?;
        self.saved = Instant::now();
        self.saved_epoch = Some(learner.epoch());
        Ok(())
    }

    /// Ends the recording: what is not yet saved is saved, and what went wrong before is reported.
    pub fn finish(&mut self, learner: &Learner, outcome: &Outcome) -> Result<()> {
        self.progress.finish();
        if let Some(failure) = self.failure.take() {
            if let Some(epoch) = self.saved_epoch {
                let folder = self.run.path().display();
                self.messages.say(&format!(
                    "epoch {epoch} is the last that is saved in {folder}. Once what follows is put right, go on from there:\n  \
                     scrnn train {folder} --resume"
                ));
            }
            return Err(failure);
        }
        if matches!(outcome, Outcome::Diverged(_)) || self.saved_epoch != Some(learner.epoch()) {
            self.save(learner)?;
        }
        Ok(())
    }

    /// How the network did at `epoch`, if that is the last one that was evaluated.
    pub fn score_of(&self, epoch: u64) -> Option<Score> {
        self.notes.score.filter(|score| score.epoch == epoch)
    }

    /// The best epoch so far.
    pub fn best(&self) -> Option<Score> {
        self.notes.best
    }

    /// The best network so far, as it learned in `learner`.
    ///
    /// # Errors
    /// None for networks of one training.
    pub fn best_network(&self, learner: &Learner) -> Result<Option<(Network, InitialStates)>> {
        let Some((parameters, states)) = &self.best else { return Ok(None) };
        Ok(Some((Network::new(learner.network().topology().clone(), parameters.clone())?, states.clone())))
    }

    /// Whether the training was ended because nothing got better on what is held out.
    pub fn out_of_patience(&self) -> bool {
        self.out_of_patience
    }

    /// A look at what is held out, if this epoch is one for it.
    fn glance(&self, learner: &Learner, last: bool) -> Result<Option<Glance>> {
        match self.watch.filter(|watch| watch.is_due(learner.epoch(), last)) {
            Some(watch) => Ok(Some(watch.look(learner.network(), learner.initial_states())?)),
            None => Ok(None),
        }
    }

    /// Seconds of training, those of earlier processes included.
    pub fn seconds(&self) -> f64 {
        self.history.seconds_before() + self.begun.elapsed().as_secs_f64()
    }

    fn checkpoint(
        &self,
        learner: &Learner,
        parameters: &Parameters,
        initial_states: &InitialStates,
        (epoch, optimiser): (u64, OptimiserState),
        notes: &Notes,
    ) -> Checkpoint {
        Checkpoint {
            topology: learner.network().topology().clone(),
            parameters: parameters.clone(),
            initial_states: initial_states.clone(),
            scaling: self.record.scaling.clone(),
            channels: self.record.channels.clone(),
            sequences: self.record.sequences.clone(),
            first_inputs: self.record.first_inputs.clone(),
            epoch,
            optimiser,
            notes: notes.to_value(),
        }
    }

    /// Keeps a copy of a network that is better than all before.
    fn compare(&mut self, score: Score, learner: &Learner) {
        if self.notes.best.is_some_and(|best| best.value() <= score.value()) {
            return;
        }
        self.notes.best = Some(score);
        self.best_waits = true;
        let (parameters, initial_states) = (learner.network().parameters(), learner.initial_states());
        match &mut self.best {
            Some((best, states)) => {
                best.as_mut_slice().copy_from_slice(parameters.as_slice());
                states.values_mut().copy_from_slice(initial_states.values());
                states.mean_mut().copy_from_slice(initial_states.mean());
            }
            none => *none = Some((parameters.clone(), initial_states.clone())),
        }
    }

    fn is_time_to_save(&self, epoch: u64) -> bool {
        match self.checkpoint_every {
            Some(epochs) => epoch.is_multiple_of(epochs) && self.saved_epoch != Some(epoch),
            None => self.saved.elapsed() >= self.checkpoint_pause,
        }
    }
}

impl Observer for Recorder<'_> {
    fn epoch(&mut self, report: &EpochReport, learner: &Learner) -> ControlFlow<()> {
        let last = report.epoch >= self.epochs;
        let glance = match self.glance(learner, last) {
            Ok(glance) => glance,
            Err(failure) => {
                self.failure = Some(failure);
                return ControlFlow::Break(());
            }
        };
        let held_out = glance.as_ref().map(Glance::score);
        let score = Score { epoch: report.epoch, nll: report.nll, mse: report.mse, held_out };
        self.notes.score = Some(score);
        // What left the finite numbers on new sequences is not the best.
        let comparable = |one: HeldOutScore| one.nll.is_some() == report.nll.is_some() && one.mse.is_finite();
        if self.watch.is_none() || held_out.is_some_and(comparable) {
            self.compare(score, learner);
        }
        let recovered = std::mem::take(&mut self.recovered);
        if last || recovered || glance.is_some() || report.epoch.is_multiple_of(self.history_every) {
            self.history.row(report, self.begun.elapsed().as_secs_f64(), glance.as_ref());
        }
        if let Some(glance) = &glance {
            self.progress.held_out(glance);
        }
        self.progress.epoch(report);
        let best = self.notes.best.map(|best| best.epoch);
        self.out_of_patience =
            !last && glance.is_some() && self.watch.is_some_and(|watch| watch.is_enough(report.epoch, best));
        let stop = (self.interrupt.asked() || self.out_of_patience) && !last;
        if (last || stop || self.is_time_to_save(report.epoch))
            && let Err(failure) = self.save(learner)
        {
            self.failure = Some(failure);
            return ControlFlow::Break(());
        }
        if stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn recovered(&mut self, recovery: &Recovery) {
        self.recovered = true;
        let Recovery { divergence, number, rate_factor } = recovery;
        self.progress.say(&format!(
            "{divergence}, the best one; going on from there at {rate_factor} of the rate (recovery {number})"
        ));
    }
}
