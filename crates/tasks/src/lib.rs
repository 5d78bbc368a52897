//! The training data of chapters 3, 5 and 6.2.3, seeded, with the truth beside the samples.
//!
//! | module | data | noise | thesis |
//! |---|---|---|---|
//! | [`lissajous`] | twelve closed curves on two channels | constant, another level for every curve | 3.2, C.1 |
//! | [`patterns`] | 144 of them, turned and shrunk | the same levels | 6.2.3 |
//! | [`sinusoid`] | one sine wave | grows and falls within each period | 3.3 |
//! | [`limit_cycle`] | an oscillator that noise drives | depends on the last sample | 3.4 |
//! | [`interact`] | two robots and an object, from the physics | that of the sensors | 5.2 |
//!
//! [`make`] makes any of them by its [`TaskName`].
//!
//! The thesis' t runs from 1 to T: the sample at index k, counted from 0 as everywhere in this crate, is t = k + 1.
//! Sequences are named "1", "2", ... as in the thesis. Sequence s draws from a stream of its own
//! ([`scrnn::streams`]), so it does not depend on how many sequences are asked for, and a longer one begins like a shorter one.

use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scrnn::dataset::{Dataset, Sequence};
use scrnn::error::{Error, Result};
use scrnn::streams::{Purpose, stream};

pub mod interact;
pub mod limit_cycle;
pub mod lissajous;
mod name;
pub mod patterns;
pub mod sinusoid;

pub use name::{TaskName, make};

/// Most samples of one data set: a slip of the finger should not fill the memory.
const MAX_SAMPLES: usize = 100_000_000;

/// Samples with the truth beside them, on the same channels and of the same lengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// The samples, with noise.
    pub data: Dataset,
    /// What each sample would be without its own noise.
    pub means: Dataset,
    /// The variance of the noise in each sample.
    pub variances: Dataset,
}

/// Checks how much is asked for.
fn check(sequences: usize, steps: usize) -> Result<()> {
    for (what, found) in [("sequences", sequences), ("steps", steps)] {
        if found == 0 {
            return Err(Error::Setting { what, found: "0".to_owned(), needed: "at least 1" });
        }
    }
    match sequences.checked_mul(steps) {
        Some(samples) if samples <= MAX_SAMPLES => Ok(()),
        _ => {
            let found = format!("{sequences} x {steps}");
            Err(Error::Setting { what: "sequences x steps", found, needed: "at most 100 million samples" })
        }
    }
}

/// The generator of sequence `s`, counted from 0.
fn generator(seed: u64, s: usize) -> ChaCha8Rng {
    stream(seed, Purpose::TaskData, s as u64)
}

/// A sample of N(0, 1).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Sequences named "1", "2", ... from their values, row-major.
fn dataset(channels: &[&str], sequences: Vec<Vec<f64>>) -> Result<Dataset> {
    let named = |(s, values): (usize, Vec<f64>)| Sequence::new((s + 1).to_string(), channels.len(), values);
    let sequences = sequences.into_iter().enumerate().map(named).collect::<Result<_>>()?;
    Dataset::new(channels.iter().map(|&name| name.to_owned()).collect(), sequences)
}

/// Adds independent Gaussian noise to clean curves: `curve(s, t)` gives the means and the standard deviation.
fn noisy<const N: usize>(
    channels: [&str; N],
    (sequences, steps): (usize, usize),
    seed: u64,
    curve: impl Fn(usize, usize) -> ([f64; N], f64),
) -> Result<Task> {
    check(sequences, steps)?;
    let [mut data, mut means, mut variances] = [const { Vec::new() }; 3];
    for s in 0..sequences {
        let mut rng = generator(seed, s);
        let [mut samples, mut clean, mut spread] = [0; 3].map(|_| Vec::with_capacity(steps * N));
        for t in 1..=steps {
            let (mean, sigma) = curve(s, t);
            samples.extend(mean.map(|mean| mean + sigma * normal(&mut rng)));
            clean.extend(mean);
            spread.extend([sigma * sigma; N]);
        }
        data.push(samples);
        means.push(clean);
        variances.push(spread);
    }
    Ok(Task {
        data: dataset(&channels, data)?,
        means: dataset(&channels, means)?,
        variances: dataset(&channels, variances)?,
    })
}

#[cfg(test)]
mod tests {
    use scrnn::evaluation::correlation;
    use scrnn::initialization::initialize;
    use scrnn::topology::Topology;

    use super::*;

    /// Root mean square of (sample - mean) / true standard deviation, over the samples of sequence `s` that have noise.
    pub(super) fn standardised_deviation(task: &Task, s: usize) -> f64 {
        let [data, means, variances] =
            [&task.data, &task.means, &task.variances].map(|set| set.sequences()[s].values());
        let noise = |k: usize| (variances[k] > 0.0).then(|| (data[k] - means[k]).powi(2) / variances[k]);
        let squares: Vec<f64> = (0..data.len()).filter_map(noise).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    #[test]
    fn nothing_and_too_much_are_refused() {
        assert_eq!(check(0, 5).unwrap_err().to_string(), "sequences is 0; needed: at least 1");
        assert_eq!(check(5, 0).unwrap_err().to_string(), "steps is 0; needed: at least 1");
        assert!(check(2, usize::MAX).is_err());
        assert!(check(1, 1).is_ok());
    }

    #[test]
    fn every_sequence_has_a_stream_of_its_own() {
        let draw = |seed, s| normal(&mut generator(seed, s));
        assert_eq!(draw(1, 0), draw(1, 0));
        assert_ne!(draw(1, 0), draw(1, 1));
        assert_ne!(draw(1, 0), draw(2, 0));
    }

    #[test]
    fn initial_weights_and_the_noise_of_the_first_sequence_have_nothing_in_common() {
        let topology = Topology::s_ctrnn(2, 8, 2.0).unwrap();
        let (mut weights, mut noise) = (Vec::new(), Vec::new());
        for seed in 0..200 {
            // The first numbers that are drawn, before a draw that takes two of them sets the two apart.
            let (network, _) = initialize(&topology, 1, seed);
            weights.extend_from_slice(&network.parameters().as_slice()[..16]);
            let task = lissajous::generate(&lissajous::Options { sequences: 1, steps: 8 }, seed).unwrap();
            let [data, means] = [&task.data, &task.means].map(|set| set.sequences()[0].values());
            noise.extend(data.iter().zip(means).map(|(sample, mean)| sample - mean));
        }
        let n = weights.len() as f64;
        let alike = weights.iter().zip(&noise).filter(|(a, b)| a.is_sign_positive() == b.is_sign_positive()).count();
        // Five deviations of a coin.
        assert!((alike as f64 / n - 0.5).abs() < 2.5 / n.sqrt(), "{alike} of {n} signs are the same");
        let correlation = correlation(&weights, &noise).unwrap();
        assert!(correlation.abs() < 5.0 / n.sqrt(), "{correlation}");
    }
}
