//! Which of the learned sequences is a new one like, and how does it go on?
//!
//! ```console
//! cargo run -p scrnn --example recognise
//! ```

mod common;

use scrnn::*;

fn main() -> Result<()> {
    let (network, states, data) = common::learned()?;
    let unknown = Dataset::new(data.channels().to_vec(), vec![data.sequences()[1].truncated(40)])?;
    let options = RecognitionOptions::with(|options| {
        options.starts = 4;
        options.epochs = 50;
    });
    let engine = Engine::serial();
    let found = &recognize(&network, &states, &unknown, &options, &engine)?[0];
    for ranked in &found.ranking {
        println!("{:6} ln L = {:8.1} nats", data.sequences()[ranked.sequence].name, ranked.ln_likelihood);
    }
    // From the state that explains it best, the closed loop goes on where the samples end.
    let start = Start { initial_state: &found.trials[0].initial_state, sensed: unknown.sequences()[0].values() };
    let options = GenerationOptions::new(60, Feedback::closed(1, false));
    let completed = &generate(&network, &[start], &options, &engine)?[0];
    println!("steps 41 to 50: {:.3?}", &completed.mean[40..50]);
    Ok(())
}
