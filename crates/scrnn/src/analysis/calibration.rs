//! Are predicted standard deviations as large as the errors that come?

use serde::Serialize;

/// Share of a Gaussian within one standard deviation.
pub const WITHIN_ONE: f64 = 0.682_689_492_137_085_9;
/// Share of a Gaussian within two.
pub const WITHIN_TWO: f64 = 0.954_499_736_103_641_6;

/// Errors beside the variances that were predicted for them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Share of errors within one predicted standard deviation.
    pub within_one: f64,
    /// Share of errors within two.
    pub within_two: f64,
    /// Mean of error^2 / variance: 1 for predictions that are right, more if they promise too much.
    pub mean_square: f64,
    /// Errors in groups of similar predicted variance, smallest first.
    pub bins: Vec<Bin>,
}

/// Errors of similar predicted variance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bin {
    /// Root mean predicted variance.
    pub predicted: f64,
    /// Root mean squared error.
    pub observed: f64,
    /// How many errors.
    pub count: usize,
}

impl Calibration {
    /// Of errors and variances in pairs, in at most `bins` groups of equal size. None if there are no pairs, or if the
    /// lists differ in length.
    #[must_use]
    pub fn of(errors: &[f64], variances: &[f64], bins: usize) -> Option<Self> {
        if errors.len() != variances.len() {
            return None;
        }
        let mut pairs: Vec<(f64, f64)> = variances.iter().copied().zip(errors.iter().copied()).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = pairs.len() as f64;
        let within = |k: f64| pairs.iter().filter(|(v, e)| e * e <= k * k * v).count() as f64 / n;
        let size = pairs.len().div_ceil(bins.max(1)).max(1);
        let bin = |pairs: &[(f64, f64)]| {
            let count = pairs.len();
            let root = |sum: f64| (sum / count as f64).sqrt();
            Bin {
                predicted: root(pairs.iter().map(|(v, _)| v).sum()),
                observed: root(pairs.iter().map(|(_, e)| e * e).sum()),
                count,
            }
        };
        (!pairs.is_empty()).then(|| Self {
            within_one: within(1.0),
            within_two: within(2.0),
            mean_square: pairs.iter().map(|(v, e)| e * e / v).sum::<f64>() / n,
            bins: pairs.chunks(size).map(bin).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn shares_and_groups_by_hand() {
        let found = Calibration::of(&[0.5, -1.5, 3.0, 0.0], &[1.0, 1.0, 4.0, 4.0], 2).unwrap();
        assert_eq!((found.within_one, found.within_two), (0.5, 1.0));
        assert_eq!(found.mean_square, (0.25 + 2.25 + 2.25) / 4.0);
        let bins: Vec<(f64, f64)> = found.bins.iter().map(|bin| (bin.predicted, bin.observed)).collect();
        assert_eq!(bins, [(1.0, 1.25_f64.sqrt()), (2.0, 4.5_f64.sqrt())]);
        assert_eq!(Calibration::of(&[], &[], 4), None);
        assert_eq!(Calibration::of(&[0.5], &[1.0, 1.0], 4), None);
    }

    #[test]
    fn gaussian_errors_fall_within_their_shares() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let variances: Vec<f64> = (0..40_000).map(|k| 0.01 + f64::from(k % 7)).collect();
        let draw = |v: &f64, random: &mut ChaCha8Rng| -> f64 {
            v.sqrt() * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, random)
        };
        let errors: Vec<f64> = variances.iter().map(|v| draw(v, &mut random)).collect();
        let found = Calibration::of(&errors, &variances, 7).unwrap();
        assert!((found.within_one - WITHIN_ONE).abs() < 0.01 && (found.within_two - WITHIN_TWO).abs() < 0.005);
        assert!(found.bins.iter().all(|bin| (bin.observed / bin.predicted - 1.0).abs() < 0.05), "{found:?}");
    }
}
