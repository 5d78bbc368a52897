//! Principal components: the directions along which points differ most (thesis 3.2.6).

use nalgebra::DMatrix;

/// Points seen along their own main directions.
#[derive(Debug, Clone, PartialEq)]
pub struct PrincipalComponents {
    count: usize,
    /// Variance along each component (divided by n), largest first.
    pub variances: Vec<f64>,
    /// Each point's coordinates, row-major `[points, components]`.
    pub coordinates: Vec<f64>,
}

/// Differences up to this share of a coordinate are rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl PrincipalComponents {
    /// Of points with `dimensions` coordinates each, row-major. There are as many components as the smaller of points and
    /// dimensions. A component's sign is free; here the point that lies farthest out on it lies on its positive side.
    ///
    /// None if the values do not fill whole points, or there are none.
    #[must_use]
    pub fn of(points: &[f64], dimensions: usize) -> Option<Self> {
        if points.is_empty() || dimensions == 0 || !points.len().is_multiple_of(dimensions) {
            return None;
        }
        let n = points.len() / dimensions;
        let mut centred = DMatrix::from_row_slice(n, dimensions, points);
        for mut column in centred.column_iter_mut() {
            let mean = column.sum() / n as f64;
            let rounding = ROUNDING * column.amax();
            column.add_scalar_mut(-mean);
            // What differs by rounding alone is the same: its directions mean nothing, and no iteration would find them.
            if column.amax() <= rounding {
                column.fill(0.0);
            }
        }
        // centred = U S V', and its rows along the axes V are U S.
        let svd = centred.svd(true, false);
        let u = svd.u?;
        let count = svd.singular_values.len();
        let mut coordinates = vec![0.0; n * count];
        for (k, &sigma) in svd.singular_values.iter().enumerate() {
            let column = u.column(k);
            let sign = if column[column.iamax()] < 0.0 { -1.0 } else { 1.0 };
            for s in 0..n {
                coordinates[s * count + k] = sign * sigma * column[s];
            }
        }
        let variances = svd.singular_values.iter().map(|sigma| sigma * sigma / n as f64).collect();
        Some(Self { count, variances, coordinates })
    }

    /// The first `count` coordinates of each point, row-major.
    #[must_use]
    pub fn first(&self, count: usize) -> Vec<f64> {
        self.coordinates.chunks_exact(self.count).flat_map(|point| &point[..count.min(self.count)]).copied().collect()
    }

    /// The share of all variance that the first `count` components have; 0 where nothing differs.
    #[must_use]
    pub fn share(&self, count: usize) -> f64 {
        let total: f64 = self.variances.iter().sum();
        if total > 0.0 { self.variances.iter().take(count).sum::<f64>() / total } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_tilted_line_have_one_component() {
        // Along (3, 4) / 5, at distances -5, 0 and 5 from the centre, which is (1, 1).
        let found = PrincipalComponents::of(&[-2.0, -3.0, 1.0, 1.0, 4.0, 5.0], 2).unwrap();
        assert!((found.variances[0] - 50.0 / 3.0).abs() < 1e-12 && found.variances[1] < 1e-12);
        let along = found.first(1);
        assert!((along[0] + along[2]).abs() < 1e-12 && (along[0].abs() - 5.0).abs() < 1e-12 && along[1].abs() < 1e-12);
        assert!((found.share(1) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn components_come_largest_first_and_keep_distances() {
        let points = [2.0, 0.0, 0.1, -2.0, 0.0, -0.1, 0.0, 1.0, 0.3, 0.0, -1.0, -0.3];
        let found = PrincipalComponents::of(&points, 3).unwrap();
        assert!(found.variances.is_sorted_by(|a, b| a >= b));
        let distance = |list: &[f64], width: usize, a: usize, b: usize| {
            (0..width).map(|i| (list[a * width + i] - list[b * width + i]).powi(2)).sum::<f64>()
        };
        for (a, b) in [(0, 1), (0, 3), (1, 2)] {
            let difference = distance(&points, 3, a, b) - distance(&found.coordinates, 3, a, b);
            assert!(difference.abs() < 1e-12);
        }
        assert_eq!(PrincipalComponents::of(&[1.0, 1.0, 1.0, 1.0], 2).unwrap().share(1), 0.0);
        assert!(
            [(&[1.0, 2.0, 3.0][..], 2), (&[], 2), (&[1.0], 0)]
                .iter()
                .all(|(points, n)| PrincipalComponents::of(points, *n).is_none())
        );
        // Points that are all one, up to the last digit.
        let one: Vec<f64> = (0..60).map(|i| 0.1 * (1.0 + (7.3 * f64::from(i)).sin())).collect();
        let points: Vec<f64> = (0..25).flat_map(|_| one.clone()).collect();
        assert_eq!(PrincipalComponents::of(&points, 60).unwrap().variances, vec![0.0; 25]);
    }
}
