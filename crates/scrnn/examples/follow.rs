//! Follows samples while they arrive: error regression over a sliding window (thesis 2.10.2).
//!
//! ```console
//! cargo run -p scrnn --example follow
//! ```

mod common;

use scrnn::*;

fn main() -> Result<()> {
    let (network, states, data) = common::learned()?;
    // It starts as if the slow wave would come, but the fast one does.
    let stream = &data.sequences()[1];
    let options = ErrorRegressionOptions::with(1, |options| {
        options.window = 20;
        options.iterations = 20;
    });
    let mut regression = ErrorRegression::new(&network, states.sequence(0), options, &Engine::serial())?;
    for step in 0..stream.len() {
        let sample = stream.sample(step);
        let forecast = (step > 0).then(|| regression.mean()[0]);
        regression.observe(sample, &mut || true)?;
        if let Some(forecast) = forecast.filter(|_| step % 10 == 9) {
            println!("sample {:3}: {:6.3}, forecast {forecast:6.3}", step + 1, sample[0]);
        }
    }
    Ok(())
}
