//! Reads a robot's description, sets the robot into a world, moves its joints, and says where they come to.
//!
//! ```text
//! cargo run --release -p scrnn-sim --example urdf [FILE.urdf]
//! ```
//!
//! Without a file it is NAO's upper body.

use std::error::Error;

use nalgebra::Isometry3;
use scrnn_sim::robot::{Limits, Robot, nao};
use scrnn_sim::world::scene::Part;
use scrnn_sim::world::{Placement, World, WorldOptions};

fn main() -> Result<(), Box<dyn Error>> {
    let robot = match std::env::args().nth(1) {
        Some(path) => Robot::from_urdf(&std::fs::read_to_string(path)?)?,
        None => nao::load()?,
    };
    println!("{}: {} links, {} movable joints", robot.name, robot.links().len(), robot.dof());

    // All joints at 0, or as near as their limits let them; then a tenth of their range further, to the side with more room.
    let start: Vec<f64> = robot.movable().map(|(_, limits)| 0.0_f64.clamp(limits.lower, limits.upper)).collect();
    let further = |Limits { lower, upper, .. }: Limits, q: f64| {
        let step = 0.1 * (upper - lower).min(std::f64::consts::TAU);
        if upper - q >= q - lower { q + step } else { q - step }
    };
    let goals: Vec<f64> = robot.movable().zip(&start).map(|((_, limits), &q)| further(limits, q)).collect();

    let mut world = World::new(WorldOptions::default())?;
    let world_from_root = Isometry3::identity();
    let id = world.add_robot(
        &robot,
        &Placement { name: "robot", world_from_root, posture: &start, part: Part::Robot, hands: &[] },
    )?;
    world.set_goals(id, &goals)?;
    while world.time() < 1.0 {
        world.step();
    }
    println!("\n{:<20} {:>10} {:>10} {:>10}", "after a second, rad", "from", "goal", "angle");
    for (((joint, _), start), (goal, angle)) in
        robot.movable().zip(&start).zip(goals.iter().zip(world.robot(id)?.angles()))
    {
        println!("{:<20} {start:>10.4} {goal:>10.4} {angle:>10.4}", joint.name);
    }
    if let Some(contact) = world.self_collision(id)? {
        let [a, b] = contact.bodies;
        let (a, b) = (world.name(a)?, world.name(b)?);
        println!("\n{a} and {b} touch");
    }
    Ok(())
}
