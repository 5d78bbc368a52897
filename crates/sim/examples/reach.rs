//! NAO touches the sphere and draws its hand back, three times, by arms that inverse kinematics found.
//!
//! ```text
//! cargo run --release -p scrnn-sim --example reach [OUT.mcap]
//! ```
//!
//! With a file, the performance is recorded; Foxglove and rerun show it. A trained network takes the place of
//! [`Replay`] as a [`NetworkDriver`](scrnn_sim::reach::agent::NetworkDriver).

use std::error::Error;
use std::io::Cursor;

use scrnn_sim::reach::agent::{Performance, Replay, Snapshot, perform};
use scrnn_sim::reach::recording::ReachingRecording;
use scrnn_sim::reach::stage::{CYCLE, PERIOD, POSITIONS, retracted_arm, touching_arm};
use scrnn_sim::robot::nao;
use scrnn_sim::world::WorldOptions;

fn main() -> Result<(), Box<dyn Error>> {
    let (robot, y) = (nao::load_one_armed()?, POSITIONS[1]);
    let (far, near) = (retracted_arm(&robot, y)?, touching_arm(&robot, y, [0.0; 3], &[0.0; 4])?);
    // A cosine between the two, one touch in every cycle of 12 samples.
    let arms = (0..CYCLE).map(|sample| {
        let share = (1.0 - (std::f64::consts::TAU * sample as f64 / CYCLE as f64).cos()) / 2.0;
        std::array::from_fn(|joint| far[joint] + share * (near[joint] - far[joint]))
    });
    let mut driver = Replay::new(arms.collect())?;

    let performance = Performance { y, samples: 3 * CYCLE, shift: None, frozen: None, world: WorldOptions::default() };
    let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), None, &[("example", "reach")])?;
    let mut observe = |snapshot: &Snapshot<'_>| -> Result<(), Box<dyn Error>> { Ok(recording.snapshot(snapshot)?) };
    let performed = perform(&performance, &mut driver, &mut observe)?;

    println!("{} samples, one every {PERIOD} s", performed.decisions.len());
    for (number, cycle) in performed.cycles.iter().enumerate() {
        let (time, gap) = (cycle.touch.time, 1000.0 * cycle.touch.gap);
        let touched = if cycle.touched { "touched" } else { "missed" };
        println!("cycle {}: {touched} at {time:.2} s, with {gap:.1} mm between hand and sphere", number + 1);
    }
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, recording.finish()?.into_inner())?;
    }
    Ok(())
}
