//! Recorded interactions of two robots (thesis 5.2.2): as data to learn from, and as a film.

use std::io::Cursor;
use std::path::Path;

use scrnn::analysis::excursions::Side;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::tasks::Task;
use scrnn_sim::interaction::{
    CHANNELS, Interaction, InteractionOptions, PERIOD, SensorNoise, all_orders, letters, record, samples,
};
use scrnn_sim::joints::{HEAD, RIGHT_ARM};
use scrnn_sim::nao;
use scrnn_sim::parallel::in_parallel;
use scrnn_sim::recording::{Heading, Joint, Recorder, Robot};

use crate::failure::{Failure, Result};
use crate::source;
use scrnn_data as files;

/// Branchings of an order.
pub const BRANCHES: usize = 5;

/// Number of orders, and of samples in each.
pub fn size() -> (usize, usize) {
    (1 << BRANCHES, samples(&[Side::Left; BRANCHES]))
}

/// The seed of order `k`.
fn seed_of(seed: u64, k: usize) -> u64 {
    seed.wrapping_add((k as u64) << 32)
}

/// The first orders, each with so many of its samples; a simulation for each of them, side by side on the cores.
pub fn make((sequences, steps): (usize, usize), seed: u64) -> Result<Task> {
    let (orders, longest) = size();
    if sequences == 0 || sequences > orders || steps == 0 || steps > longest {
        let message = format!("{sequences} sequences of {steps} samples");
        return Err(Failure::input(
            message,
            format!("interactions: 1 to {orders} sequences of 1 to {longest} samples"),
        ));
    }
    let orders = &all_orders(BRANCHES)[..sequences];
    let options = InteractionOptions::default();
    let quiet = SensorNoise([0.0; CHANNELS.len()]);
    let both = recorded(orders, seed, steps)?;
    let (data, means): (Vec<Sequence>, Vec<Sequence>) = both.into_iter().unzip();
    let channels = || CHANNELS.map(String::from).to_vec();
    let means = Dataset::new(channels(), means)?;
    debug_assert_ne!(options.noise, quiet);
    let variances = means.map(|channel, _| options.noise.0[channel].powi(2));
    Ok(Task { data: Dataset::new(channels(), data)?, means, variances })
}

/// Each order as the sensors gave it, and without their noise.
fn recorded(orders: &[Vec<Side>], seed: u64, steps: usize) -> Result<Vec<(Sequence, Sequence)>> {
    let one = |k: usize, order: &[Side]| -> Result<(Sequence, Sequence)> {
        let mut truth = Vec::new();
        let noisy = record(order, &InteractionOptions::default(), seed_of(seed, k), steps, |interaction, _| {
            truth.extend(interaction.truth());
        })?;
        Ok((noisy, Sequence::new(letters(order), CHANNELS.len(), truth)?))
    };
    in_parallel(orders.len(), source::threads(), |k| one(k, &orders[k]))
}

/// Films the first orders.
pub fn film(path: &Path, (sequences, steps): (usize, usize), seed: u64) -> Result<()> {
    let mut film = Film::new(&[("seed", &seed.to_string())])?;
    let mut failed = None;
    for (k, order) in all_orders(BRANCHES).iter().take(sequences).enumerate() {
        film.begin(&letters(order))?;
        record(order, &InteractionOptions::default(), seed_of(seed, k), steps, |interaction, sample| {
            if failed.is_none() {
                failed = film.frame(interaction, sample, None).err();
            }
        })?;
        if let Some(failure) = failed {
            return Err(failure);
        }
    }
    film.write(path)
}

/// An MCAP recording in the making.
pub struct Film {
    recorder: Recorder<Cursor<Vec<u8>>>,
    /// Nanoseconds before the present sequence, and at its last frame.
    begun: u64,
    now: u64,
}

impl Film {
    /// An empty one.
    pub fn new(notes: &[(&str, &str)]) -> Result<Self> {
        let channels = CHANNELS.map(String::from);
        let robots = ["self/", "other/"].map(|prefix| Robot { prefix, urdf: nao::URDF });
        let heading = Heading { robots: &robots, channels: &channels, notes, ..Heading::default() };
        Ok(Self { recorder: Recorder::new(Cursor::new(Vec::new()), &heading)?, begun: 0, now: 0 })
    }

    /// A sequence begins after the last one.
    pub fn begin(&mut self, name: &str) -> Result<()> {
        self.begun = match self.now {
            0 => 0,
            now => now + nanoseconds(PERIOD),
        };
        Ok(self.recorder.begin_sequence(self.begun, name)?)
    }

    /// The world at a sample; `predicted` are mean and variance of it.
    pub fn frame(
        &mut self,
        interaction: &Interaction,
        sample: &[f64; 8],
        predicted: Option<(&[f64], Option<&[f64]>)>,
    ) -> Result<()> {
        let time = self.begun + nanoseconds(interaction.time());
        self.now = time;
        let recorder = &mut self.recorder;
        recorder.scene(time, &interaction.scene())?;
        let [angles, goals] = interaction.joints();
        let names = || HEAD.into_iter().chain(RIGHT_ARM);
        let of = |values: &[f64]| names().zip(values).map(|(name, &q)| Joint::at(name, q)).collect::<Vec<_>>();
        recorder.joint_states(time, &of(&angles))?;
        recorder.joint_targets(time, &of(&goals))?;
        recorder.sensed(time, sample)?;
        if let Some((mean, variance)) = predicted {
            recorder.predicted(time, mean, variance)?;
        }
        if let Some(collision) = interaction.collision() {
            let depth = interaction.depth();
            recorder.event(time, &format!("collision with {collision:?}").to_lowercase(), &[("depth", depth)])?;
        }
        Ok(())
    }

    /// Completes the file.
    pub fn write(self, path: &Path) -> Result<()> {
        let bytes = self.recorder.finish()?.into_inner();
        Ok(files::replace(path, &bytes)?)
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interactions_are_the_same_for_any_split_and_their_truth_lies_beside_them() {
        let three = make((3, 40), 5).unwrap();
        let two = make((2, 40), 5).unwrap();
        assert_eq!(three.data.sequences()[..2], two.data.sequences()[..]);
        assert_eq!(three.data.channels()[4], "RShoulderPitch");
        assert_eq!(three.data.sequences()[1].name, "LLLLR");
        assert_eq!(three.data.sequences()[0].len(), 40);
        let difference = three.data.sequences()[0].sample(7)[0] - three.means.sequences()[0].sample(7)[0];
        assert!(difference != 0.0 && difference.abs() < 15.0, "{difference}");
        assert!(make((33, 40), 5).unwrap_err().to_string().contains("33 sequences of 40 samples"));
    }
}
