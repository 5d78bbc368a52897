//! Where all random numbers come from: one stream for each (seed, purpose, index).
//!
//! ```text
//! key of ChaCha8 = mixed(seed, purpose, index)       256 bits from 192, one-to-one
//! ```
//!
//! Two generators with the same key draw the same numbers, and numbers that are drawn for two purposes from one key are not
//! independent: noise that a network learned from would come back as its starting weights, or as what it generates. So no other
//! file makes a generator. The mixing can be undone, step by step, so no two triples share a key; and every bit of the key depends on
//! every bit of the triple, so that neighbouring seeds and indices have nothing in common. The index says which sequence, start,
//! epoch or trial the numbers are for, so results do not depend on the thread that draws.
//!
//! The numbers of [`Purpose`] are part of what a seed means: they are never changed and never given anew.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// What random numbers are drawn for, and what the index counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[repr(u64)]
pub enum Purpose {
    /// Weights, biases and the mean of the initial states before learning; index 0.
    InitialWeights = 1,
    /// Which sequences make a batch; index 0.
    BatchMembers = 2,
    /// In which order an epoch takes its batches; index: the epoch.
    BatchOrder = 3,
    /// The noise of a generated sequence, and what it begins from; index: the start.
    Generation = 4,
    /// Random starts of recognition; index: the sequence.
    RecognitionStarts = 5,
    /// Centres that a mixture begins from; index 0.
    MixtureCentres = 6,
    /// Orders of labels that a permutation test compares with; index 0.
    PermutationTest = 7,
    /// Samples of the thesis' data; index: the sequence.
    TaskData = 8,
    /// Demonstrations that a tutor gives; index: the demonstration.
    Demonstrations = 9,
    /// Noise of the sensors in recordings that are learned from; index: the recording.
    RecordingSensors = 10,
    /// Noise of the sensors in trials of what was learned; index: the trial.
    TrialSensors = 11,
    /// Orders of events in recordings that are learned from; index: the recording.
    RecordingOrders = 12,
    /// Orders of events in trials of what was learned; index: the trial.
    TrialOrders = 13,
    /// Where things are put in trials; index: the trial.
    TrialPlaces = 14,
    /// What a controller that stands in for a network draws; index: the kind of its noise.
    StandIn = 15,
    /// What is kept out of a training to judge it: which sequences of the data (index 0), or a seed for data that are made anew
    /// (index: the set, from 1).
    HeldOut = 16,
    /// A seed for closed loops that a study generates; index: the loop's kind.
    StudyLoops = 17,
    /// A seed for the trials of a study; index: the trial.
    StudyTrials = 18,
    /// Where a training's closed loops begin, and seeds of their noise; index: the epoch.
    ClosedLoopStarts = 19,
    /// The noise of a training's closed loops; index: the copy.
    ClosedLoopNoise = 20,
    /// Random settings of a sweep; index: the draw.
    SweepDraws = 21,
}

/// The generator of `purpose`.
///
/// ```
/// use rand::RngExt;
/// use scrnn::streams::{Purpose, stream};
///
/// let mut noise = stream(1, Purpose::TaskData, 0);
/// let mut other = stream(1, Purpose::Generation, 0);
/// assert_ne!(noise.random::<u64>(), other.random::<u64>());
/// ```
#[must_use]
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut bytes = [0; 32];
    for (bytes, word) in bytes.as_chunks_mut().0.iter_mut().zip(key(seed, purpose, index)) {
        *bytes = word.to_le_bytes();
    }
    ChaCha8Rng::from_seed(bytes)
}

/// A seed for whatever takes one and draws for purposes of its own: the first number of the stream. Of 64 bits there are fewer than
/// of triples, so that two may come to the same; by chance, once in 10^19.
#[must_use]
pub fn derived_seed(seed: u64, purpose: Purpose, index: u64) -> u64 {
    stream(seed, purpose, index).random()
}

/// Rounds of the mixing. Two let every word depend on every other; the rest is for good measure.
const ROUNDS: u64 = 4;

/// The four words are mixed in turn, each with the one before it, by steps that can be undone.
fn key(seed: u64, purpose: Purpose, index: u64) -> [u64; 4] {
    let mut words = [seed, purpose as u64, index, 0];
    for round in 0..ROUNDS {
        for at in 0..4 {
            let before = words[(at + 3) % 4] ^ (4 * round + at as u64 + 1);
            words[at] = scramble(words[at].wrapping_add(scramble(before)));
        }
    }
    words
}

/// The output function of SplitMix64 (Steele, Lea and Flood 2014), one-to-one on 64 bits.
fn scramble(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    const PURPOSES: [Purpose; 21] = [
        Purpose::InitialWeights,
        Purpose::BatchMembers,
        Purpose::BatchOrder,
        Purpose::Generation,
        Purpose::RecognitionStarts,
        Purpose::MixtureCentres,
        Purpose::PermutationTest,
        Purpose::TaskData,
        Purpose::Demonstrations,
        Purpose::RecordingSensors,
        Purpose::TrialSensors,
        Purpose::RecordingOrders,
        Purpose::TrialOrders,
        Purpose::TrialPlaces,
        Purpose::StandIn,
        Purpose::HeldOut,
        Purpose::StudyLoops,
        Purpose::StudyTrials,
        Purpose::ClosedLoopStarts,
        Purpose::ClosedLoopNoise,
        Purpose::SweepDraws,
    ];

    #[test]
    fn every_purpose_is_among_those_that_are_tested() {
        let numbers: Vec<u64> = PURPOSES.iter().map(|purpose| *purpose as u64).collect();
        let last =
            include_str!("streams.rs").lines().filter_map(|line| line.trim().strip_suffix(',')?.split_once(" = "));
        let last = last.filter_map(|(_, number)| number.parse::<u64>().ok()).max().unwrap();
        assert_eq!(numbers, (1..=last).collect::<Vec<_>>());
    }

    #[test]
    fn no_two_triples_draw_the_same_first_number() {
        let mut met = HashSet::new();
        let some = [0, 1, 2, 3, 7, 42, 1 << 32, (1 << 32) + 1, u64::MAX - 1, u64::MAX];
        for purpose in PURPOSES {
            for seed in some {
                for index in some {
                    assert!(met.insert(derived_seed(seed, purpose, index)), "{seed}, {purpose:?}, {index}");
                }
            }
        }
        assert_eq!(met.len(), PURPOSES.len() * 100);
    }

    #[test]
    fn a_bit_of_the_triple_turns_half_of_the_key() {
        let difference = |a: [u64; 4], b: [u64; 4]| a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
        let base = key(1, Purpose::TaskData, 5);
        for bit in 0..64 {
            for other in [key(1 ^ (1 << bit), Purpose::TaskData, 5), key(1, Purpose::TaskData, 5 ^ (1 << bit))] {
                // 128 of 256 expected, with a deviation of 8.
                assert!((88..=168).contains(&difference(base, other)), "{bit}: {}", difference(base, other));
            }
        }
        for purpose in PURPOSES.into_iter().filter(|purpose| *purpose != Purpose::TaskData) {
            assert!((88..=168).contains(&difference(base, key(1, purpose, 5))), "{purpose:?}");
        }
    }

    #[test]
    fn streams_of_neighbours_are_not_correlated() {
        let draw = |seed, purpose, index| -> Vec<f64> {
            let mut stream = stream(seed, purpose, index);
            (0..20_000).map(|_| stream.random::<f64>()).collect()
        };
        let one = draw(1, Purpose::TaskData, 0);
        for other in [
            draw(2, Purpose::TaskData, 0),
            draw(1, Purpose::TaskData, 1),
            draw(1, Purpose::Generation, 0),
            draw(1, Purpose::InitialWeights, 0),
            draw(0, Purpose::TaskData, 1),
        ] {
            let correlation = crate::evaluation::correlation(&one, &other).unwrap();
            // Five deviations of 1 / sqrt(20 000).
            assert!(correlation.abs() < 0.036, "{correlation}");
        }
        assert_eq!(one, draw(1, Purpose::TaskData, 0));
    }

    #[test]
    fn a_seed_means_what_it_always_meant() {
        assert_eq!(derived_seed(1, Purpose::InitialWeights, 0), 4_024_409_968_976_376_052);
        assert_eq!(derived_seed(42, Purpose::TaskData, 3), 270_016_207_375_419_911);
    }
}
