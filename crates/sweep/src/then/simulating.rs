//! A trained network in a simulated robot (thesis, chapters 4 and 5), and how it did there.

use std::path::Path;

use schemars::JsonSchema;
use scrnn::engine::Engine;
use scrnn::error_regression::ErrorRegressionOptions;
use scrnn::streams::Purpose;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::trained::Trained;
use scrnn_sim::interact::{
    Branch, CHANNELS, Controller, Interaction, InteractionOptions, Outcome, follow, letters, random_order, with_own_arm,
};
use scrnn_sim::reach::agent::{NetworkDriver, Noise, Performance, perform_unobserved};
use scrnn_sim::reach::channels::REACHING;
use scrnn_sim::reach::stage::{CYCLE, POSITIONS};
use scrnn_sim::world::WorldOptions;
use scrnn_tasks::interact::BRANCHES;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{Numbers, Simulate, number};

/// The experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Simulated {
    /// Touch and retract (chapter 4).
    Reach,
    /// Follow another robot's object (chapter 5).
    Interact,
}

/// Simulates, and writes simulated.json into `folder`.
pub fn simulate(trained: &Trained, options: &Simulate, folder: &Path, engine: &Engine) -> Result<Numbers> {
    let channels = &trained.checkpoint.channels;
    let (needed, word): (&[&str], _) = match options.experiment {
        Simulated::Reach => (&REACHING, "reach"),
        Simulated::Interact => (&CHANNELS, "interact"),
    };
    if channels != needed {
        let message = format!("then.simulate = \"{word}\": the network predicts {}", channels.join(", "));
        return Err(Failure::input(message, format!("needed: a network that learned {}", needed.join(", "))));
    }
    match options.experiment {
        Simulated::Reach => reach(trained, options, folder, engine),
        Simulated::Interact => interact(trained, options, folder, engine),
    }
}

/// Cycles at each of the three positions.
fn reach(trained: &Trained, options: &Simulate, folder: &Path, engine: &Engine) -> Result<Numbers> {
    let checkpoint = &trained.checkpoint;
    let network = trained.network();
    let (mut all, mut touched, mut cycles) = (Vec::new(), 0_usize, 0_usize);
    for (place, &y) in (0..).zip(POSITIONS.iter()) {
        let seed = options.seed.wrapping_add(place);
        let mean = checkpoint.initial_states.mean();
        let mut driver = NetworkDriver::new(&network, mean, &checkpoint.scaling, &Noise::Predicted, seed, engine)?;
        let samples = usize::try_from(options.trials).unwrap_or(usize::MAX).saturating_mul(CYCLE);
        let performance = Performance { y, samples, shift: None, frozen: None, world: WorldOptions::default() };
        let performed = perform_unobserved(&performance, &mut driver)?;
        touched += performed.cycles.iter().filter(|cycle| cycle.touched).count();
        cycles += usize::try_from(options.trials).unwrap_or(usize::MAX);
        all.push(json!({ "position": y, "cycles": performed.cycles, "self_collisions": performed.self_collisions }));
    }
    crate::outcome::write(folder, "simulated.json", &json!({ "positions": all }))?;
    let mut numbers = Numbers::new();
    number(&mut numbers, "simulate.touched", Some(touched as f64 / cycles.max(1) as f64));
    Ok(numbers)
}

/// Random orders, the same for every network.
fn interact(trained: &Trained, options: &Simulate, folder: &Path, engine: &Engine) -> Result<Numbers> {
    let checkpoint = &trained.checkpoint;
    let network = trained.network();
    let mut regression = ErrorRegressionOptions::adam(checkpoint.channels.len());
    (regression.window, regression.iterations) = (options.window, options.iterations);
    let regression = with_own_arm(regression);
    let (mut all, mut branches): (Vec<_>, Vec<Branch>) = (Vec::new(), Vec::new());
    for trial in 0..options.trials {
        let order = random_order(BRANCHES, 0.5, options.seed, Purpose::TrialOrders, trial);
        let (name, state) = trained.state_for_order(&options.begin, &letters(&order))?;
        let controller = Controller { network: &network, scaling: &checkpoint.scaling, initial_state: state, engine };
        let mut interaction = Interaction::new(&order, &InteractionOptions::default(), options.seed, trial)?;
        let followed = follow(
            &controller,
            &regression,
            &mut interaction,
            |regression, sample| regression.observe(sample, &mut || true),
            |_, _, _| Ok::<(), Failure>(()),
        )?;
        all.push(json!({ "order": letters(&order), "initial_state": name, "branches": followed.branches }));
        branches.extend(followed.branches);
    }
    crate::outcome::write(folder, "simulated.json", &json!({ "trials": all }))?;
    let count = branches.len().max(1) as f64;
    let mut numbers = Numbers::new();
    let successes = branches.iter().filter(|branch| branch.outcome == Outcome::Success).count();
    let collisions = branches.iter().filter(|branch| branch.collision.is_some()).count();
    number(&mut numbers, "simulate.success", Some(successes as f64 / count));
    number(&mut numbers, "simulate.collisions", Some(collisions as f64));
    number(
        &mut numbers,
        "simulate.reaction",
        Some(branches.iter().map(|branch| branch.reaction_time as f64).sum::<f64>() / count),
    );
    Ok(numbers)
}
