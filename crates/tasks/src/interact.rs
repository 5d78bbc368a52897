//! Recorded interactions of two robots (thesis 5.2.2), as data to learn from and as a film.

use scrnn::analysis::excursions::Side;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::jobs::side_by_side;
use scrnn::streams::Purpose;
use scrnn_sim::error::{Error, Result};
use scrnn_sim::interact::Film;
use scrnn_sim::interact::{
    CHANNELS, InteractionOptions, SensorNoise, all_orders, letters, random_order, record, record_while, samples,
};
use scrnn_sim::recording::RecordingError;

use crate::Task;

/// Branchings of an order.
pub const BRANCHES: usize = 5;

/// Number of orders, and of samples in each.
pub fn size() -> (usize, usize) {
    (1 << BRANCHES, samples(&[Side::Left; BRANCHES]))
}

/// The first orders, each with so many of its samples; a simulation for each of them, side by side on the cores.
///
/// # Errors
/// [`Error::Setting`] for a size that there is not.
pub fn make(size: (usize, usize), seed: u64, threads: usize) -> Result<Task> {
    make_while(size, seed, threads, |_| Ok(()))
}

/// The same; `at` gets the number of the order at each of its samples; an error of it ends everything.
///
/// # Errors
/// As [`make`], and those of `at`.
pub fn make_while<E: From<Error> + Send>(
    (sequences, steps): (usize, usize),
    seed: u64,
    threads: usize,
    at: impl Fn(usize) -> std::result::Result<(), E> + Sync,
) -> std::result::Result<Task, E> {
    let (orders, longest) = size();
    if sequences == 0 || sequences > orders || steps == 0 || steps > longest {
        let found = format!("{sequences} sequences of {steps} samples");
        let needed = "1 to 32 sequences of 1 to 470 samples";
        return Err(Error::Setting { what: "the size of the task interact", found, needed }.into());
    }
    let orders = &all_orders(BRANCHES)[..sequences];
    let options = InteractionOptions::default();
    let quiet = SensorNoise([0.0; CHANNELS.len()]);
    let one = |k: usize, _threads: usize| -> std::result::Result<_, E> {
        recorded(&orders[k], (seed, k as u64), steps, || at(k))
    };
    let both = side_by_side(sequences, threads, one)?;
    let (data, means): (Vec<Sequence>, Vec<Sequence>) = both.into_iter().unzip();
    let channels = || CHANNELS.map(String::from).to_vec();
    let means = Dataset::new(channels(), means).map_err(Error::from)?;
    debug_assert_ne!(options.noise, quiet);
    let variances = means.map(|channel, _| options.noise.0[channel].powi(2));
    let data = Dataset::new(channels(), data).map_err(Error::from)?;
    Ok(Task { data, means, variances })
}

/// So many orders drawn at random, as many as there are by default: each branching goes to the left with this probability. An order may come
/// twice; their numbers tell them apart. `at` is as in [`make_while`].
///
/// # Errors
/// As [`make_while`]; [`Error::Setting`] for what is no probability.
pub fn drawn_while<E: From<Error> + Send>(
    left: f64,
    (sequences, steps): (usize, usize),
    seed: u64,
    threads: usize,
    at: impl Fn(usize) -> std::result::Result<(), E> + Sync,
) -> std::result::Result<Dataset, E> {
    let (_, longest) = size();
    if sequences == 0 || steps == 0 || steps > longest || !(0.0..=1.0).contains(&left) {
        let found = format!("{sequences} orders of {steps} samples, to the left with probability {left}");
        let needed = "at least 1 order of 1 to 470 samples, and a probability from 0 to 1";
        return Err(Error::Setting { what: "what is drawn for the task interact", found, needed }.into());
    }
    let options = InteractionOptions::default();
    let rows = side_by_side(sequences, threads, |k, _| -> std::result::Result<Sequence, E> {
        let order = random_order(BRANCHES, left, seed, Purpose::RecordingOrders, k as u64);
        let mut sequence = record_while(&order, &options, (seed, k as u64), steps, |_, _| at(k))?;
        sequence.name = format!("{} {}", sequence.name, k + 1);
        Ok(sequence)
    })?;
    Ok(Dataset::new(CHANNELS.map(String::from).to_vec(), rows).map_err(Error::from)?)
}

/// An order as the sensors gave it, and without their noise.
fn recorded<E: From<Error>>(
    order: &[Side],
    seed: (u64, u64),
    steps: usize,
    at: impl Fn() -> std::result::Result<(), E>,
) -> std::result::Result<(Sequence, Sequence), E> {
    let mut truth = Vec::new();
    let noisy = record_while(order, &InteractionOptions::default(), seed, steps, |interaction, _| {
        truth.extend(interaction.truth());
        at()
    })?;
    Ok((noisy, Sequence::new(letters(order), CHANNELS.len(), truth).map_err(Error::from)?))
}

/// A recording of the first orders, as the bytes of an MCAP file.
///
/// # Errors
/// As [`make`], and what the recorder refuses.
pub fn film((sequences, steps): (usize, usize), seed: u64) -> std::result::Result<Vec<u8>, RecordingError> {
    let mut film = Film::new(&[("seed", &seed.to_string())])?;
    let mut failed = None;
    for (k, order) in all_orders(BRANCHES).iter().take(sequences).enumerate() {
        film.begin(&letters(order))?;
        record(order, &InteractionOptions::default(), (seed, k as u64), steps, |interaction, sample| {
            if failed.is_none() {
                failed = film.frame(interaction, sample, None).err();
            }
        })?;
        if let Some(failure) = failed {
            return Err(failure);
        }
    }
    film.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_that_is_refused_is_the_one_that_there_is() {
        assert_eq!(size(), (32, 470));
    }

    #[test]
    fn drawn_orders_go_where_they_are_told_and_have_names_of_their_own() {
        let drawn = |left, size| drawn_while::<Error>(left, size, 1, 2, |_| Ok(()));
        let names = |data: &Dataset| data.sequences().iter().map(|one| one.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&drawn(1.0, (2, 20)).unwrap()), ["LLLLL 1", "LLLLL 2"]);
        assert_eq!(names(&drawn(0.0, (1, 20)).unwrap()), ["RRRRR 1"]);
        for (left, size) in [(1.5, (1, 20)), (f64::NAN, (1, 20)), (0.5, (0, 20)), (0.5, (1, 471))] {
            assert!(drawn(left, size).is_err(), "{left} {size:?}");
        }
    }

    #[test]
    fn interactions_are_the_same_for_any_split_and_their_truth_lies_beside_them() {
        let three = make((3, 40), 5, 2).unwrap();
        let two = make((2, 40), 5, 1).unwrap();
        assert_eq!(three.data.sequences()[..2], two.data.sequences()[..]);
        assert_eq!(three.data.channels()[4], "RShoulderPitch");
        assert_eq!(three.data.sequences()[1].name, "LLLLR");
        assert_eq!(three.data.sequences()[0].len(), 40);
        let difference = three.data.sequences()[0].sample(7)[0] - three.means.sequences()[0].sample(7)[0];
        assert!(difference != 0.0 && difference.abs() < 15.0, "{difference}");
        assert!(make((33, 40), 5, 1).unwrap_err().to_string().contains("33 sequences of 40 samples"));
    }
}
