//! How long to learn, by sequences that are left out for the choice.
//!
//! After so many updates a network knows the noise of its sequences by heart, and does worse on new ones; before, it does not know the
//! movement yet. How many that are is not to be seen in the data: one set of noisy movements wants thirty times as many as another. So
//! the recipe for noisy data asks: it leaves a fifth of what is learned out, trains for its usual number of epochs, for three and for ten
//! times as many, and stops where that does not help on what was left out. Sequences that a person holds out have no say.

use std::ops::ControlFlow;

use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::initialization::initialize;
use scrnn::learning::{EpochReport, Learner, Outcome};

use crate::evaluation::{Bench, Member, SimpleModels};
use crate::experiment::{Data, Evaluation, Experiment, HeldOut, HeldOutDrawn};
use crate::failure::{Failure, Result};
use crate::held_out;
use crate::interrupt::Interrupt;
use crate::messages::{Messages, Progress};
use crate::recipe;
use crate::source::Source;

/// The share of the sequences that is left out, and how many there must be at least.
const SHARE: f64 = 0.2;
const FEWEST: usize = 10;
/// How many times as long as the recipe says.
const LONGER: [u64; 3] = [1, 3, 10];
/// Nats per step and channel that a longer training has to gain, one step ahead and alone together.
const GAIN: f64 = 0.02;
/// Closed loops of each sequence.
const COPIES: usize = 20;

/// The experiment with the number of epochs that suits what it learns, where a recipe left that open; all others as they are. What is
/// held out is not in `source` as data any more.
///
/// # Errors
/// [`Failure::Stopped`] if somebody asked to stop; whatever is wrong with experiment or data.
pub(crate) fn settle(
    mut experiment: Experiment,
    source: &Source,
    (engine, interrupt): (&Engine, &Interrupt),
    progress: &mut dyn Progress,
    messages: &dyn Messages,
) -> Result<Experiment> {
    let Some(at) = experiment.comments.iter().position(recipe::leaves_open) else { return Ok(experiment) };
    let learned = &source.data;
    let Some(trial) = Trial::new(learned, &experiment, engine)? else { return Ok(experiment) };
    let (count, of) = (trial.bench.data.sequences().len(), learned.sequences().len());
    messages.say(&format!("finding out how long to learn, on {count} of {of} sequences that are left out for it"));
    let most = recipe::most_epochs(&experiment, learned);
    let usual = experiment.training.epochs;
    let mut tried: Vec<(u64, f64)> = Vec::new();
    for longer in LONGER {
        let epochs = (longer * usual).min(most);
        if tried.last().is_some_and(|(last, _)| *last >= epochs) {
            break;
        }
        let mut one = experiment.clone();
        one.training.epochs = epochs;
        let Some(score) = trial.score(&one, engine, interrupt, progress)? else { return Err(Failure::Stopped) };
        let gained = tried.last().is_none_or(|(_, before)| score < before - GAIN);
        tried.push((epochs, score));
        if !gained {
            break;
        }
    }
    let best = tried.iter().copied().reduce(|best, one| if one.1 < best.1 - GAIN { one } else { best });
    if let Some((epochs, _)) = best {
        experiment.training.epochs = epochs;
    }
    let tried: Vec<String> = tried.iter().map(|(epochs, score)| format!("{epochs}: {score:.2}")).collect();
    let tried = tried.join(", ");
    experiment.comments[at].text = format!(
        "Tried with {count} of {of} sequences left out; nats per step and channel on these, one step ahead and alone added: {tried}."
    );
    messages.say(&format!("nats on these, one step ahead and alone added, by number of epochs: {tried}"));
    Ok(experiment)
}

/// What is learned and what is left out.
struct Trial {
    scaled: Dataset,
    bench: Bench,
}

impl Trial {
    /// Nothing where there are too few sequences, or one is too short to judge by.
    fn new(data: &Dataset, experiment: &Experiment, engine: &Engine) -> Result<Option<Self>> {
        if data.sequences().len() < FEWEST {
            return Ok(None);
        }
        let held_out = Some(HeldOut::Drawn(HeldOutDrawn { share: SHARE, seed: experiment.seed }));
        let drawn = Experiment { data: Data { held_out, ..experiment.data.clone() }, ..experiment.clone() };
        let Some((learned, left_out)) = held_out::both(data, &drawn)? else { return Ok(None) };
        let scaling = experiment.data.scaling_for(&learned)?;
        let scaled = scaling.apply(&learned)?;
        let delay = experiment.network.delay;
        let models = SimpleModels::fit(&scaled, delay);
        let Evaluation { burn_in, observed, .. } = Evaluation::default();
        let bench =
            Bench::new(scaling.apply(&left_out)?, models, (burn_in, observed), (delay, experiment.seed), engine);
        Ok(bench.ok().map(|bench| Self { scaled, bench }))
    }

    /// How a training of this experiment does on what it did not learn: nats per step and channel one step ahead and alone, added.
    /// Infinite where it diverged; nothing if somebody asked to stop.
    fn score(
        &self,
        experiment: &Experiment,
        engine: &Engine,
        interrupt: &Interrupt,
        progress: &mut dyn Progress,
    ) -> Result<Option<f64>> {
        let topology = experiment.topology(&self.scaled)?;
        let (network, states) = initialize(&topology, self.scaled.sequences().len(), experiment.seed);
        let mut learner = Learner::new(network, states, &self.scaled, experiment.plan(), engine)?;
        let epochs = experiment.training.epochs;
        let mut watch = |report: &EpochReport, _: &Learner| {
            progress.trying("how long to learn", report.epoch, epochs);
            if interrupt.asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        match engine.enter(|| learner.run(&mut watch)) {
            Outcome::Stopped => return Ok(None),
            Outcome::Diverged(_) => return Ok(Some(f64::INFINITY)),
            Outcome::Finished => {}
        }
        let members = [Member { network: learner.network(), states: learner.initial_states() }];
        let ahead = self.bench.from_mean(&members, &self.bench.scored)?.one_step().nll;
        let size = (self.bench.data.sequences().len(), COPIES);
        let alone = self.bench.closed_loop(&members, None, size)?.nll.filter(|nll| nll.is_finite());
        Ok(Some(ahead.unwrap_or(f64::INFINITY) + alone.unwrap_or(f64::INFINITY)))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::messages::Silent;
    use crate::request;

    /// Noisy waves of one period, or noise without any order.
    fn data(sequences: usize, samples: usize, size_of_noise: f64) -> Dataset {
        let mut state = 1_u64;
        let mut noise = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..4).map(|_| uniform()).sum::<f64>() - 2.0
        };
        let mut one = |s: usize| {
            let clean = |k: usize| (std::f64::consts::TAU * k as f64 / 12.0).sin() * (1.0 - size_of_noise);
            let values = (0..samples).map(|k| clean(k) + size_of_noise * noise()).collect();
            scrnn::dataset::Sequence::new(s.to_string(), 1, values).unwrap()
        };
        Dataset::new(vec!["y".into()], (0..sequences).map(&mut one).collect()).unwrap()
    }

    fn engine() -> Engine {
        Engine::new(1, scrnn::engine::InstructionSet::best()).unwrap()
    }

    fn settled(data: Dataset, more: &str) -> (Experiment, Experiment) {
        let text = format!("name = \"x\"\n[data]\nfiles = [\"at_hand.csv\"]\n[training]\nrecipe = \"auto\"\n{more}");
        let (experiment, source) = request::of_text("x", &text, Path::new(""), Some(data)).unwrap();
        let settled =
            settle(experiment.clone(), &source, (&engine(), &Interrupt::new()), &mut Silent, &Silent).unwrap();
        (experiment, settled)
    }

    #[test]
    fn what_has_no_order_is_not_learned_for_longer_and_the_reason_says_what_was_tried() {
        let (before, after) = settled(data(10, 40, 1.0), "");
        assert_eq!(after.training.epochs, before.training.epochs);
        let reason = after.comments.iter().find(|reason| reason.key == "training.epochs").unwrap();
        assert!(reason.text.starts_with("Tried with 2 of 10 sequences left out"), "{}", reason.text);
        assert!(reason.text.contains(&format!("{}: ", before.training.epochs)), "{}", reason.text);
    }

    #[test]
    fn few_sequences_and_numbers_that_are_given_are_left_alone() {
        let (before, after) = settled(data(9, 40, 1.0), "");
        assert_eq!(after, before);
        let (before, after) = settled(data(10, 40, 1.0), "epochs = 7");
        assert_eq!((after.training.epochs, before == after), (7, true));
        // Too short to judge by.
        let (before, after) = settled(data(10, 5, 1.0), "");
        assert_eq!(after, before);
    }

    #[test]
    fn a_wish_to_stop_ends_it() {
        let text = "name = \"x\"\n[data]\nfiles = [\"at_hand.csv\"]\n[training]\nrecipe = \"auto\"\n";
        let (experiment, source) = request::of_text("x", text, Path::new(""), Some(data(10, 40, 1.0))).unwrap();
        let interrupt = Interrupt::new();
        interrupt.ask();
        let stopped = settle(experiment, &source, (&engine(), &interrupt), &mut Silent, &Silent).unwrap_err();
        assert!(matches!(stopped, Failure::Stopped), "{stopped}");
    }
}
