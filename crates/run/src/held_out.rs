//! Sequences that a training does not learn: which they are, how the network does on them while it learns, and what that says in the
//! end.

use std::fmt;

use rand::seq::SliceRandom;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn::streams::{Purpose, stream};
use scrnn_data::read_all;
use serde::Serialize;

use crate::assessment::Predictions;
use crate::channels;
use crate::digest::digest;
use crate::evaluation::{self, Bench, ClosedLoop, Distance, Member, OneStep, Search, SimpleModels};
use crate::experiment::{Experiment, HeldOut, HeldOutDrawn, HeldOutFiles};
use crate::failure::{Failure, Result};
use crate::notes::{HeldOutNotes, HeldOutScore};
use crate::source::Source;

/// Closed loops of each sequence while the network learns: enough for a trend.
const COPIES: usize = 10;
/// Closed loops of each sequence at the end.
pub const FINAL_COPIES: usize = 50;
/// Sequences that run on alone while the network learns, the first of them.
const ALONE: usize = 20;

/// Takes the sequences out that the experiment does not want learned.
pub(crate) fn split(mut source: Source, experiment: &Experiment) -> Result<Source> {
    if let Some(HeldOut::Files(HeldOutFiles { files })) = &experiment.data.held_out {
        let held_out = read_all(files, &experiment.data.selection())?.data;
        source.held_out = Some(channels::matched(held_out, source.data.channels(), "held_out")?);
        return Ok(source);
    }
    let Some(held) = held(&source.data, experiment)? else { return Ok(source) };
    if let Some(truth) = &mut source.truth {
        truth.variances = part(&truth.variances, &held, false)?;
    }
    source.held_out = Some(part(&source.data, &held, true)?);
    source.data = part(&source.data, &held, false)?;
    Ok(source)
}

/// What the experiment wants learned of `data`.
pub(crate) fn learned(data: &Dataset, experiment: &Experiment) -> Result<Dataset> {
    match held(data, experiment)? {
        Some(held) => part(data, &held, false),
        None => Ok(data.clone()),
    }
}

/// What the experiment wants learned of `data`, and what not; nothing where it holds out none of these.
pub(crate) fn both(data: &Dataset, experiment: &Experiment) -> Result<Option<(Dataset, Dataset)>> {
    let Some(held) = held(data, experiment)? else { return Ok(None) };
    Ok(Some((part(data, &held, false)?, part(data, &held, true)?)))
}

/// Whether each sequence is held out; none where the experiment holds out none of these.
fn held(data: &Dataset, experiment: &Experiment) -> Result<Option<Vec<bool>>> {
    match &experiment.data.held_out {
        Some(HeldOut::Share(share)) => drawn(data, *share, experiment.seed).map(Some),
        Some(HeldOut::Drawn(HeldOutDrawn { share, seed })) => drawn(data, *share, *seed).map(Some),
        Some(HeldOut::Names(names)) => named(data, names).map(Some),
        Some(HeldOut::Files(_)) | None => Ok(None),
    }
}

/// Whether each sequence is held out: a share of them, at least one, and never all.
fn drawn(data: &Dataset, share: f64, seed: u64) -> Result<Vec<bool>> {
    let count = data.sequences().len();
    if count < 2 {
        let help = "give files = [...] to held_out, or leave it out";
        return Err(Failure::input("there is only one sequence: none can be held out", help));
    }
    let wanted = ((share * count as f64).round() as usize).clamp(1, count - 1);
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut stream(seed, Purpose::HeldOut, 0));
    let chosen = &order[..wanted];
    Ok((0..count).map(|s| chosen.contains(&s)).collect())
}

/// Whether each sequence is held out: those of these names.
fn named(data: &Dataset, names: &[String]) -> Result<Vec<bool>> {
    let there: Vec<&str> = data.sequences().iter().map(|sequence| sequence.name.as_str()).collect();
    if let Some(missing) = names.iter().find(|name| !there.contains(&name.as_str())) {
        let shown = there.iter().take(20).copied().collect::<Vec<_>>().join(", ");
        let more = if there.len() > 20 { ", ..." } else { "" };
        let message = format!("there is no sequence `{missing}` to hold out");
        return Err(Failure::input(message, format!("the sequences are {shown}{more}")));
    }
    let held: Vec<bool> = there.iter().map(|name| names.iter().any(|one| one == name)).collect();
    if held.iter().all(|held| *held) {
        return Err(Failure::input("all sequences are held out", "leave at least one to learn"));
    }
    Ok(held)
}

/// The sequences that are held out, or the others.
fn part(data: &Dataset, held: &[bool], out: bool) -> Result<Dataset> {
    let kept =
        data.sequences().iter().zip(held).filter(|(_, held)| **held == out).map(|(sequence, _)| sequence.clone());
    Ok(Dataset::new(data.channels().to_vec(), kept.collect())?)
}

/// What a checkpoint notes of the sequences that were held out.
pub(crate) fn notes(source: &Source) -> Option<HeldOutNotes> {
    let held_out = source.held_out.as_ref()?;
    let names = held_out.sequences().iter().map(|sequence| sequence.name.clone()).collect();
    Some(HeldOutNotes { digest: digest(held_out), names })
}

/// A look at the network while it learns.
#[derive(Debug, Clone, PartialEq)]
pub struct Glance {
    /// One step ahead, from the mean initial state, after the burn-in.
    pub one_step: OneStep,
    /// Alone after the first part of each sequence.
    pub closed_loop: ClosedLoop,
}

impl Glance {
    /// What decides which epoch is the best.
    pub fn score(&self) -> HeldOutScore {
        HeldOutScore { nll: self.one_step.nll, mse: self.one_step.mse }
    }
}

/// Watches a training on the sequences that it does not learn.
#[derive(Debug)]
pub struct Watch {
    bench: Bench,
    every: u64,
    patience: Option<u64>,
}

impl Watch {
    /// For a resolved experiment that holds sequences out, and none for others.
    ///
    /// # Errors
    /// [`Failure::Input`] for a sequence that is too short to judge anything by.
    pub fn new(
        experiment: &Experiment,
        (source, scaling, learned): (&Source, &Scaling, &Dataset),
        delay: usize,
        engine: &Engine,
    ) -> Result<Option<Self>> {
        let (Some(held_out), Some(options)) = (&source.held_out, &experiment.evaluation) else { return Ok(None) };
        let models = SimpleModels::fit(learned, delay);
        let shares = (options.burn_in, options.observed);
        let bench = Bench::new(scaling.apply(held_out)?, models, shares, (delay, experiment.seed), engine)?;
        let every = options.every.unwrap_or(1);
        Ok(Some(Self { bench, every, patience: experiment.training.patience }))
    }

    /// Whether this epoch is looked at.
    pub fn is_due(&self, epoch: u64, last: bool) -> bool {
        last || epoch.is_multiple_of(self.every)
    }

    /// Whether patience is at its end: so many looks since the best epoch, and none that was better.
    pub fn is_enough(&self, epoch: u64, best: Option<u64>) -> bool {
        let (Some(patience), Some(best)) = (self.patience, best) else { return false };
        epoch.saturating_sub(best) / self.every >= patience
    }

    /// Looks at a network.
    pub fn look(&self, network: &Network, states: &InitialStates) -> Result<Glance> {
        let members = [Member { network, states }];
        Ok(Glance {
            one_step: self.bench.from_mean(&members, &self.bench.scored)?.one_step(),
            closed_loop: self.bench.closed_loop(&members, None, (ALONE, COPIES))?,
        })
    }

    /// One step ahead of what is scored, from the mean initial state.
    pub fn predictions(&self, members: &[Member<'_>]) -> Result<Predictions> {
        Ok(self.bench.from_mean(members, &self.bench.scored)?.moments)
    }

    /// Judges the network that a training ended with, or a mixture of them: also from states that are recognised.
    pub fn judge(&self, members: &[Member<'_>], epoch: u64, initial_state_variance: f64) -> Result<Judgement> {
        let bench = &self.bench;
        let search = Search { starts: 8, epochs: 150, initial_state_variance };
        let recognised = bench.recognised(members, search)?;
        let size = (bench.data.sequences().len(), FINAL_COPIES);
        Ok(Judgement {
            members: members.len(),
            epoch,
            sequences: bench.data.sequences().iter().map(|sequence| sequence.name.clone()).collect(),
            burn_in: bench.burn_in,
            observed: bench.observed,
            from_mean: bench.from_mean(members, &bench.scored)?.one_step(),
            from_recognised: bench.from_states(members, &recognised)?.one_step(),
            constant: bench.models.constant(&bench.data, &bench.scored),
            linear: bench.models.linear(&bench.data, &bench.scored),
            closed_loop: bench.closed_loop(members, None, size)?,
            closed_loop_from_recognised: bench.closed_loop(members, Some(&recognised), size)?,
        })
    }
}

/// How the best network does on the sequences that were held out, all in scaled units.
#[derive(Debug, Clone, Serialize)]
pub struct Judgement {
    /// Networks that are mixed; 1 for one.
    pub members: usize,
    /// The epoch of the network that is judged, the best one; of a mixture, the latest of its members'.
    pub epoch: u64,
    /// The sequences that were held out.
    pub sequences: Vec<String>,
    /// Share of each sequence that is listened to before predictions count.
    pub burn_in: f64,
    /// Share of each sequence that is heard before the closed loop, and from which states are recognised.
    pub observed: f64,
    /// One step ahead from the mean initial state, after the burn-in.
    pub from_mean: OneStep,
    /// One step ahead from the state that explains the observed part best, after that part.
    pub from_recognised: OneStep,
    /// Mean and variance of each channel over the learned sequences, on the samples of `from_mean`.
    pub constant: OneStep,
    /// A linear predictor on the last four samples, fitted to the learned sequences, on the samples of `from_mean`.
    pub linear: Option<OneStep>,
    /// Alone after the observed part, from the mean initial state.
    pub closed_loop: ClosedLoop,
    /// The same from the recognised state.
    pub closed_loop_from_recognised: ClosedLoop,
}

impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.sequences.len();
        let (sequences, have) = if count == 1 { ("sequence", "was") } else { ("sequences", "were") };
        let (measure, value): (_, fn(&OneStep) -> String) = match self.from_mean.nll {
            Some(_) => ("nll", |one| one.nll.map_or("without a bound".to_owned(), |nll| format!("{nll:.4}"))),
            None => ("mean squared error", |one| format!("{:.4e}", one.mse)),
        };
        let (burn_in, observed) = (percent(self.burn_in), percent(self.observed));
        let linear = self.linear.as_ref().map_or(String::new(), |linear| {
            format!(" and {} of a linear predictor on the last {} samples", value(linear), evaluation::LAGS)
        });
        let subject = match self.members {
            1 => format!("the best network (epoch {})", self.epoch),
            members => format!("the mixture of the {members} best networks"),
        };
        let article = if measure == "nll" { "an" } else { "a" };
        writeln!(
            f,
            "On {count} {sequences} that {have} held out, {subject} has {article} {measure} of {} from the mean initial \
             state, after it listened to the first {burn_in}, and of {} from the state recognised in the first {observed}, after \
             those; against {} of the constant model{linear}: {}.",
            value(&self.from_mean),
            value(&self.from_recognised),
            value(&self.constant),
            self.standing()
        )?;
        let alone = &self.closed_loop;
        let after: Vec<String> = alone
            .after
            .iter()
            .filter_map(|Distance { steps, distance }| {
                let step = if *steps == 1 { "step" } else { "steps" };
                distance.map(|distance| format!("{distance:.3} after {steps} {step}"))
            })
            .collect();
        let coverage = match (alone.within_one, alone.within_two) {
            (Some(one), Some(two)) => {
                format!(
                    "; {} and {} of the samples lie within one and two of its sd (68 % and 95 % would)",
                    percent(one),
                    percent(two)
                )
            }
            _ => String::new(),
        };
        writeln!(
            f,
            "Alone after the first {observed}, it is {}, {:.3} at the end away from them (rms in scaled units), where the channels' means are \
             {:.3} away{coverage}.",
            after.join(", "),
            alone.end,
            alone.distance_of_constant
        )?;
        if alone.leaves_the_data() {
            writeln!(
                f,
                "Its closed loop leaves the data: over all that it did not hear it is {:.3} away, further than the channels' means. Do \
                 not let it run alone on such movements.",
                alone.distance
            )?;
        }
        Ok(())
    }
}

impl Judgement {
    /// What to think of the network one step ahead.
    fn standing(&self) -> &'static str {
        let constant = self.from_mean.beats(&self.constant);
        let linear = self.linear.as_ref().is_none_or(|linear| self.from_mean.beats(linear));
        match (constant, linear) {
            (true, true) if self.linear.is_none() => "it is better than that",
            (true, true) => "it is better than both",
            (true, false) => "one step ahead it is no better than the linear predictor",
            (false, true) => "it is no better than the constant model",
            (false, false) => "it is no better than either: what it learned does not hold on new sequences",
        }
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judgement(nll: f64, linear: f64, distance: f64) -> Judgement {
        let one = |nll: f64| OneStep { nll: Some(nll), mse: 0.1 };
        let closed_loop = ClosedLoop {
            after: vec![Distance { steps: 1, distance: Some(0.01) }, Distance { steps: 20, distance: None }],
            end: 0.5,
            distance,
            distance_of_constant: 0.4,
            nll: Some(1.0),
            within_one: Some(0.6),
            within_two: Some(0.9),
        };
        Judgement {
            members: 1,
            epoch: 7,
            sequences: vec!["a".into()],
            burn_in: 0.1,
            observed: 0.3,
            from_mean: one(nll),
            from_recognised: one(-1.0),
            constant: one(0.0),
            linear: Some(one(linear)),
            closed_loop: closed_loop.clone(),
            closed_loop_from_recognised: closed_loop,
        }
    }

    #[test]
    fn what_a_network_is_worth_on_new_sequences_is_said_plainly() {
        let good = judgement(-1.5, -1.0, 0.1).to_string();
        assert!(
            good.contains("On 1 sequence that was held out, the best network (epoch 7) has an nll of -1.5000"),
            "{good}"
        );
        assert!(good.contains("it is better than both"), "{good}");
        assert!(good.contains("it is 0.010 after 1 step, 0.500 at the end away"), "{good}");
        assert!(
            good.contains("60 % and 90 % of the samples lie within") && !good.contains("leaves the data"),
            "{good}"
        );
        let linear = judgement(-0.5, -1.0, 0.1).to_string();
        assert!(linear.contains("one step ahead it is no better than the linear predictor"), "{linear}");
        let lost = judgement(0.5, -1.0, 0.6).to_string();
        assert!(lost.contains("it is no better than either"), "{lost}");
        assert!(lost.contains("Its closed loop leaves the data") && lost.contains("0.600 away"), "{lost}");
        assert!(judgement(-1.5, -1.0, f64::NAN).to_string().contains("leaves the data"));
    }
}
