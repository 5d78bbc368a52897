//! Lets a network run on its own: mean, standard deviation and a sample of each step.
//!
//! ```console
//! cargo run -p scrnn --example generate
//! ```

mod common;

use scrnn::*;

fn main() -> Result<()> {
    let (network, states, data) = common::learned()?;
    let starts: Vec<Start<'_>> = (0..states.sequences())
        .map(|s| Start { initial_state: states.sequence(s), sensed: data.sequences()[s].sample(0) })
        .collect();
    let options = GenerationOptions::new(30, Feedback::closed(1, true)).seed(7);
    let generated = generate(&network, &starts, &options, &Engine::serial())?;
    for (sequence, generated) in data.sequences().iter().zip(&generated) {
        println!("{}", sequence.name);
        for step in 0..options.steps {
            let sd = generated.variance[step].sqrt();
            println!("{:3}  {:7.3} +- {sd:.3}  sample {:7.3}", step + 1, generated.mean[step], generated.sample[step]);
        }
    }
    Ok(())
}
