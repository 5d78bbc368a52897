//! Learns two waves and writes the network into a file.
//!
//! ```console
//! cargo run -p scrnn --example train -- waves.safetensors
//! ```

use std::ops::ControlFlow;

use scrnn::checkpoint::Checkpoint;
use scrnn::learning::EpochReport;
use scrnn::*;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
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
    // All cores; the bits are those of a single thread.
    let engine = Engine::new(0, InstructionSet::best())?;
    let mut learner = Learner::new(network, initial_states, &data, plan, &engine)?;
    let outcome = learner.run(&mut |report: &EpochReport, _: &Learner| {
        if report.epoch.is_multiple_of(200) {
            println!("epoch {:4}: nll {:.3} nats per step and channel", report.epoch, report.nll.unwrap_or(f64::NAN));
        }
        ControlFlow::Continue(())
    });
    if let Outcome::Diverged(divergence) = outcome {
        return Err(divergence.to_string().into());
    }
    let checkpoint = Checkpoint {
        topology: learner.network().topology().clone(),
        parameters: learner.network().parameters().clone(),
        initial_states: learner.initial_states().clone(),
        scaling: Scaling::identity(1),
        channels: data.channels().to_vec(),
        sequences: data.sequences().iter().map(|sequence| sequence.name.clone()).collect(),
        first_inputs: data.sequences().iter().map(|sequence| sequence.sample(0)[0]).collect(),
        epoch: learner.epoch(),
        optimiser: learner.optimiser_state(),
        notes: serde_json::Value::Null,
    };
    checkpoint.check()?;
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(&path, checkpoint.to_bytes()?)?;
        println!("written: {path}");
    }
    Ok(())
}
