//! Do points lie together by their labels? The silhouette, against the same points with shuffled labels.
//!
//! ```text
//! a = mean distance of a point to the others of its label
//! b = mean distance to the points of the nearest other label
//! s = (b - a) / max(a, b)           from -1 to 1; the silhouette is its mean over points
//! ```

use rand::RngExt;
use serde::Serialize;

use crate::evaluation::mean_and_deviation;
use crate::streams::{Purpose, stream};

/// A silhouette beside those of shuffled labels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Clustering {
    /// The silhouette of the true labels.
    pub silhouette: f64,
    /// Mean silhouette of shuffled labels.
    pub shuffled_mean: f64,
    /// Its standard deviation.
    pub shuffled_deviation: f64,
    /// Share of shuffled labels (the true ones counted among them) with at least this silhouette.
    pub p_value: f64,
}

/// The mean silhouette of points with `dimensions` coordinates each, row-major; a point alone with its label counts 0.
/// None unless there are two labels.
#[must_use]
pub fn silhouette(points: &[f64], dimensions: usize, labels: &[usize]) -> Option<f64> {
    let distances = distances(points, dimensions);
    of_distances(&distances, labels)
}

/// Compares the silhouette of `labels` with those of `shuffles` random orders of them.
#[must_use]
pub fn against_chance(
    points: &[f64],
    dimensions: usize,
    labels: &[usize],
    shuffles: usize,
    seed: u64,
) -> Option<Clustering> {
    let distances = distances(points, dimensions);
    let silhouette = of_distances(&distances, labels)?;
    let mut random = stream(seed, Purpose::PermutationTest, 0);
    let mut shuffled = labels.to_vec();
    let mut values = Vec::with_capacity(shuffles);
    for _ in 0..shuffles {
        for last in (1..shuffled.len()).rev() {
            shuffled.swap(last, random.random_range(0..=last));
        }
        values.extend(of_distances(&distances, &shuffled));
    }
    // The order of a sum may differ between two orders that are equally good.
    let as_good = values.iter().filter(|&&value| value >= silhouette - 1e-12).count();
    let (shuffled_mean, shuffled_deviation) = mean_and_deviation(&values);
    let p_value = (as_good + 1) as f64 / (values.len() + 1) as f64;
    Some(Clustering { silhouette, shuffled_mean, shuffled_deviation, p_value })
}

fn distances(points: &[f64], dimensions: usize) -> Vec<Vec<f64>> {
    let points: Vec<&[f64]> = points.chunks_exact(dimensions).collect();
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    points.iter().map(|a| points.iter().map(|b| distance(a, b)).collect()).collect()
}

fn of_distances(distances: &[Vec<f64>], labels: &[usize]) -> Option<f64> {
    let groups = labels.iter().max()? + 1;
    let mut sizes = vec![0_usize; groups];
    labels.iter().for_each(|&label| sizes[label] += 1);
    if sizes.iter().filter(|&&size| size > 0).count() < 2 {
        return None;
    }
    let mut total = 0.0;
    let mut sums = vec![0.0; groups];
    for (own, row) in labels.iter().zip(distances) {
        if sizes[*own] < 2 {
            continue;
        }
        sums.fill(0.0);
        row.iter().zip(labels).for_each(|(distance, &label)| sums[label] += distance);
        let a = sums[*own] / (sizes[*own] - 1) as f64;
        let others = (0..groups).filter(|label| label != own && sizes[*label] > 0);
        let b = others.map(|label| sums[label] / sizes[label] as f64).fold(f64::INFINITY, f64::min);
        if a.max(b) > 0.0 {
            total += (b - a) / a.max(b);
        }
    }
    Some(total / labels.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silhouette_by_hand() {
        // On a line: 0 and 1 are of one label, 4 alone of another. a = 1; b = 4 and 3.
        let found = silhouette(&[0.0, 1.0, 4.0], 1, &[0, 0, 1]).unwrap();
        assert!((found - (0.75 + 2.0 / 3.0 + 0.0) / 3.0).abs() < 1e-15);
        assert_eq!(silhouette(&[0.0, 1.0], 1, &[2, 2]), None);
    }

    #[test]
    fn true_clusters_stand_out_and_mixed_labels_do_not() {
        let points: Vec<f64> = (0..24).map(|k| f64::from(k / 6) * 10.0 + f64::from(k % 6)).collect();
        let apart: Vec<usize> = (0..24).map(|k| k / 6).collect();
        let mixed: Vec<usize> = (0..24).map(|k| k % 4).collect();
        let clear = against_chance(&points, 1, &apart, 999, 1).unwrap();
        assert!(clear.silhouette > 0.6 && clear.p_value == 0.001, "{clear:?}");
        assert!(clear.shuffled_mean < 0.0);
        let none = against_chance(&points, 1, &mixed, 999, 1).unwrap();
        assert!(none.silhouette < 0.0 && none.p_value > 0.1, "{none:?}");
        assert_eq!(clear, against_chance(&points, 1, &apart, 999, 1).unwrap());
    }
}
