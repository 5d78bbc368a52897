//! Random numbers: each purpose draws from a stream of its own, so that one seed serves them all.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// What random numbers are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Where the sphere of a reaching trial lies.
    Places,
    /// What a tutor does not do twice alike.
    Tutor,
    /// Orders of an interaction.
    Orders,
    /// The sensors' noise on a recorded interaction, which a network learns.
    RecordedNoise,
    /// The sensors' noise while a network acts.
    TrialNoise,
    /// Noise of constant variance on what a network feeds back.
    ConstantNoise,
    /// Noise of a mixture regression's covariance.
    MixtureNoise,
}

impl Purpose {
    /// Eight letters as a number: no two have the same.
    const fn domain(self) -> u64 {
        match self {
            Self::Places => 0x706C_6163_6573,
            Self::Tutor => 0x7475_746F_7269_6E67,
            Self::Orders => 0x6F72_6465_7273_0000,
            Self::RecordedNoise => 0x696E_7465_7261_6374,
            Self::TrialNoise => u64::from_be_bytes(*b"trialing"),
            Self::ConstantNoise => u64::from_be_bytes(*b"constant"),
            Self::MixtureNoise => u64::from_be_bytes(*b"mixtures"),
        }
    }
}

/// The stream for the `index`-th use of a purpose.
pub(crate) fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ purpose.domain());
    random.set_stream(index);
    random
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    #[test]
    fn no_two_purposes_or_indices_share_their_numbers() {
        use Purpose::{ConstantNoise, MixtureNoise, Orders, Places, RecordedNoise, TrialNoise, Tutor};
        let mut seen = std::collections::BTreeSet::new();
        let all = [Places, Tutor, Orders, RecordedNoise, TrialNoise, ConstantNoise, MixtureNoise];
        for purpose in all {
            for (seed, index) in [(0, 0), (1, 0), (1, 1), (1 << 32, 0)] {
                let mut random = stream(seed, purpose, index);
                assert!((0..8).all(|_| seen.insert(random.random::<u64>())), "{purpose:?} {seed} {index}");
            }
        }
        // Nor with numbers that are drawn from the seed itself.
        assert!(seen.insert(ChaCha8Rng::seed_from_u64(1).random()));
    }
}
