//! The experiments of the thesis, and trained networks in the simulated robots.

use std::path::PathBuf;

use pyo3::prelude::*;
use scrnn::engine::InstructionSet;
use scrnn::error_regression::{Ascent, ErrorRegressionOptions};
use scrnn::streams::Purpose;
use scrnn_reproduce::{Context, Options, Preset, STUDIES};
use scrnn_run::experiment::Override;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_run::trained::Trained;
use scrnn_sim::interact::{
    CHANNELS, Controller, Interaction, InteractionOptions, follow, letters, parse_order, random_order, with_own_arm,
};
use scrnn_sim::reach::agent::{NetworkDriver, Noise, Performance, perform_unobserved};
use scrnn_sim::reach::channels::REACHING;
use scrnn_sim::reach::stage::{CYCLE, POSITIONS};
use scrnn_sim::world::WorldOptions;
use scrnn_tasks::interact::BRANCHES;
use serde_json::json;

use crate::failure::raise;
use crate::machine::{News, attended, engine, watched};
use crate::model::Model;

/// The studies' words, with what they are.
#[pyfunction]
pub fn studies() -> Vec<(&'static str, &'static str)> {
    STUDIES.iter().map(|study| (study.word, study.about)).collect()
}

/// Reproduces a study: tables as text, metrics.json, and whether it was interrupted.
#[pyfunction]
#[pyo3(signature = (name, *, preset="fast", seeds=1, seed=1, out=None, epochs=None, settings=vec![], beyond=false, overwrite=false,
    threads=0, show=None, say=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn reproduce(
    py: Python<'_>,
    name: &str,
    preset: &str,
    seeds: u64,
    seed: u64,
    out: Option<PathBuf>,
    epochs: Option<u64>,
    settings: Vec<String>,
    beyond: bool,
    overwrite: bool,
    threads: usize,
    show: Option<Py<PyAny>>,
    say: Option<Py<PyAny>>,
) -> PyResult<(String, String, bool, Option<Py<PyAny>>)> {
    let study = STUDIES.iter().find(|study| study.word == name).ok_or_else(|| {
        let words = STUDIES.map(|study| study.word).join(", ");
        raise(Failure::input(format!("there is no study `{name}`"), format!("there are {words}")))
    })?;
    let preset = match preset {
        "fast" => Preset::Fast,
        "thesis" => Preset::Thesis,
        other => {
            return Err(raise(Failure::input(format!("there is no preset `{other}`"), "give \"fast\" or \"thesis\"")));
        }
    };
    if !(1..=1000).contains(&seeds) {
        return Err(raise(Failure::input(format!("seeds is {seeds}"), "give a number from 1 to 1000")));
    }
    let set = settings.iter().map(|text| text.parse::<Override>()).collect::<std::result::Result<Vec<_>, String>>();
    let set = set.map_err(|message| raise(Failure::input(message, "")))?;
    let (interrupt, news) = (Interrupt::new(), News::new(show, say));
    let (reproduced, signal) = attended(py, (&interrupt, &news), || {
        let progress = |label: &str, total: u64| news.training(label, total);
        let context = Context {
            threads: engine(threads, None)?.threads(),
            instruction_set: InstructionSet::best(),
            interrupt: &interrupt,
            messages: &news,
            progress: &progress,
        };
        let options = Options { preset, seeds, seed, out, epochs, set, beyond, overwrite };
        study.run(&options, &context)
    })?;
    let interrupted = reproduced.ending == Ending::Interrupted;
    let signal = signal.map(|error| error.into_value(py).into_any());
    Ok((reproduced.text, reproduced.json, interrupted, signal))
}

/// Where the sphere lies: position 1, 2 or 3, or metres.
fn place(text: &str) -> Result<f64> {
    let y = match text {
        "1" => POSITIONS[0],
        "2" => POSITIONS[1],
        "3" => POSITIONS[2],
        other => {
            other.parse().map_err(|_| Failure::input(format!("the position is {other:?}"), "give 1, 2, 3 or metres"))?
        }
    };
    match (POSITIONS[0] - 0.02..=POSITIONS[2] + 0.02).contains(&y) {
        true => Ok(y),
        false => Err(Failure::input(
            format!("the position is {y}"),
            "the sphere lies between positions 1 and 3: -0.14 to 0 m, and 0.02 m beyond at most",
        )),
    }
}

/// Lets a network that learned to reach touch the sphere; what came of it as JSON.
#[pyfunction]
#[pyo3(signature = (model, *, position="1", cycles=15, noise=true, seed=1, shift_at=None, to=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn simulate_reach(
    py: Python<'_>,
    model: &Model,
    position: &str,
    cycles: usize,
    noise: bool,
    seed: u64,
    shift_at: Option<usize>,
    to: Option<&str>,
) -> PyResult<String> {
    watched(py, &News::default(), || {
        let trained: &Trained = model.only()?;
        let checkpoint = &trained.checkpoint;
        if checkpoint.channels != REACHING {
            let message = format!("the network predicts {}", checkpoint.channels.join(", "));
            return Err(Failure::input(message, format!("needed: a network that learned {}", REACHING.join(", "))));
        }
        if !(1..=100_000).contains(&cycles) {
            return Err(Failure::input(format!("cycles is {cycles}"), "give a number from 1 to 100000"));
        }
        let noise = if noise { Noise::Predicted } else { Noise::Off };
        let mean = checkpoint.initial_states.mean();
        let network = trained.network();
        let mut driver = NetworkDriver::new(&network, mean, &checkpoint.scaling, &noise, seed, &engine(1, None)?)?;
        let shift = shift_at.zip(to.map(place).transpose()?);
        let samples = cycles * CYCLE;
        if let Some((at, _)) = shift.filter(|(at, _)| *at >= samples) {
            let message = format!("shift_at={at} is after the last of {samples} samples");
            return Err(Failure::input(message, "shift earlier, or ask for more cycles"));
        }
        let performance =
            Performance { y: place(position)?, samples, shift, frozen: None, world: WorldOptions::default() };
        let performed = perform_unobserved(&performance, &mut driver)?;
        let touched = performed.cycles.iter().filter(|cycle| cycle.touched).count();
        Ok(json!({
            "position": performance.y,
            "shift": shift,
            "samples": samples,
            "seed": seed,
            "expected": cycles,
            "touched": touched,
            "beyond_limits": performed.beyond_limits,
            "self_collisions": performed.self_collisions,
            "cycles": performed.cycles,
        })
        .to_string())
    })
}

/// Two robots: the network follows the other robot's object with its arm; the trials as JSON.
#[pyfunction]
#[pyo3(signature = (model, *, order=None, begin="mean", trials=1, ers=false, seed=1, window=50, iterations=10, rate=None))]
#[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
pub fn simulate_interact(
    py: Python<'_>,
    model: &Model,
    order: Option<&str>,
    begin: &str,
    trials: u64,
    ers: bool,
    seed: u64,
    window: usize,
    iterations: usize,
    rate: Option<f64>,
) -> PyResult<String> {
    let (interrupt, news) = (Interrupt::new(), News::default());
    let (told, signal) = attended(py, (&interrupt, &news), || {
        let trained = model.only()?;
        let checkpoint = &trained.checkpoint;
        if checkpoint.channels.len() != CHANNELS.len() {
            let message = format!("the network's channels are {}", checkpoint.channels.join(", "));
            return Err(Failure::input(message, format!("an interaction has {}", CHANNELS.join(", "))));
        }
        let mut options = ErrorRegressionOptions::adam(checkpoint.channels.len());
        (options.window, options.iterations) = (window, if ers { iterations } else { 0 });
        if let Some(rate) = rate {
            options.ascent = Ascent::Adam { rate };
        }
        let options = with_own_arm(options);
        let (network, engine) = (trained.network(), engine(1, None)?);
        let mut all = Vec::new();
        for trial in 0..trials {
            if interrupt.asked() {
                break;
            }
            let order = match order {
                Some(text) => parse_order(text)?,
                None => random_order(BRANCHES, 0.5, seed, Purpose::TrialOrders, trial),
            };
            let (name, state) = trained.state_for_order(begin, &letters(&order))?;
            let scaling = &checkpoint.scaling;
            let controller = Controller { network: &network, scaling, initial_state: state, engine: &engine };
            let mut interaction = Interaction::new(&order, &InteractionOptions::default(), seed, trial)?;
            let followed = follow(
                &controller,
                &options,
                &mut interaction,
                |regression, sample| regression.observe(sample, &mut || true),
                |_, _, _| Ok::<(), Failure>(()),
            )?;
            all.push(json!({ "order": letters(&order), "initial_state": name, "branches": followed.branches }));
        }
        Ok(json!({ "trials": all }).to_string())
    })?;
    match signal {
        Some(signal) => Err(signal),
        None => Ok(told),
    }
}
