//! What the other examples have in common: a small network that learned two waves.

use std::ops::ControlFlow;

use scrnn::learning::EpochReport;
use scrnn::*;

/// Two waves and a network that learned them, with their initial states.
pub fn learned() -> Result<(Network, InitialStates, Dataset)> {
    let wave = |name: &str, period: f64| {
        let sample = |t: u32| 0.7 * (std::f64::consts::TAU * f64::from(t) / period).sin();
        let noise = |t: u32| 0.04 * f64::from(t * t % 97).sin();
        Sequence::new(name, 1, (0..100).map(|t| sample(t) + noise(t)).collect())
    };
    let data = Dataset::new(vec!["y".into()], vec![wave("slow", 25.0)?, wave("fast", 10.0)?])?;
    let topology = Topology::s_ctrnn(1, 12, 2.0)?;
    let (network, initial_states) = initialize(&topology, data.sequences().len(), 1);
    let plan = Plan::with(|plan| {
        plan.epochs = 800;
        plan.initial_state_variance = 10.0;
        plan.optimiser = Optimiser::Adam(Adam::with(|adam| adam.rate = 0.02));
    });
    let mut learner = Learner::new(network, initial_states, &data, plan, &Engine::serial())?;
    let outcome = learner.run(&mut |_: &EpochReport, _: &Learner| ControlFlow::Continue(()));
    assert_eq!(outcome, Outcome::Finished);
    Ok((learner.network().clone(), learner.initial_states().clone(), data))
}
