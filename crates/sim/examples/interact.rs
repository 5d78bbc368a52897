//! Two NAOs: one moves an object to the left and to the right, a tutor leads the other one's arm to the same side.
//!
//! ```text
//! cargo run --release -p scrnn-sim --example interact [OUT.mcap]
//! ```
//!
//! Prints every tenth sample as the robot senses it. With a file, both robots are recorded.

use std::error::Error;

use scrnn_sim::interact::{CHANNELS, Film, Interaction, InteractionOptions, PERIOD, parse_order};

fn main() -> Result<(), Box<dyn Error>> {
    let order = parse_order("LR")?;
    let mut interaction = Interaction::new(&order, &InteractionOptions::default(), 1, 0)?;
    let mut film = Film::new(&[("example", "interact")])?;
    film.begin("LR")?;
    println!("seconds {}", CHANNELS.map(|name| format!("{name:>15}")).concat());
    for sample in 0..interaction.samples() {
        let sensed = interaction.sense();
        film.frame(&interaction, &sensed, None)?;
        if sample % 10 == 0 {
            println!("{:>7.1} {}", sample as f64 * PERIOD, sensed.map(|value| format!("{value:>15.3}")).concat());
        }
        interaction.step_tutored();
        if let Some(collision) = interaction.collision() {
            println!("        ran into: {collision:?}");
        }
    }
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, film.finish()?)?;
    }
    Ok(())
}
