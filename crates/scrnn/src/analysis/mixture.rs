//! Gaussian mixtures and regression on them (GMM and GMR): what is often used to learn movements from demonstrations
//! (thesis 1.4.2), for comparison.
//!
//! ```text
//! p(z)         = sum_k w_k N(z | m_k, S_k)                                      with z = (x, y)
//! p(y | x)     = sum_k h_k(x) N(y | m_k(x), S_k')      h_k(x) ~ w_k N(x | m_k,x, S_k,xx), summing to 1
//! m_k(x)       = m_k,y + S_k,yx S_k,xx^-1 (x - m_k,x)
//! S_k'         = S_k,yy - S_k,yx S_k,xx^-1 S_k,xy
//! E[y | x]     = sum_k h_k m_k(x)
//! Cov[y | x]   = sum_k h_k (S_k' + m_k(x) m_k(x)') - E[y | x] E[y | x]'
//! ```

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::RngExt;

use crate::error::{Error, Result};
use crate::streams::{Purpose, stream};

/// Points between two questions whether to go on.
const BETWEEN_QUESTIONS: usize = 256;

/// How to fit a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureOptions {
    /// K.
    pub components: usize,
    /// Most steps of expectation and maximisation.
    pub iterations: usize,
    /// Fitting ends when ln p of a point grows by less than this, in nats.
    pub tolerance: f64,
    /// Is added to each covariance's diagonal, as a share of the dimension's variance over all points: a component on few
    /// points would otherwise shrink to nothing.
    pub regularisation: f64,
    /// Of the first centres.
    pub seed: u64,
}

impl Default for MixtureOptions {
    fn default() -> Self {
        Self { components: 8, iterations: 200, tolerance: 1e-6, regularisation: 1e-4, seed: 1 }
    }
}

/// A mixture of Gaussians with full covariances.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianMixture {
    components: Vec<Component>,
    /// ln p of a point, averaged over the points that it was fitted to.
    pub ln_density: f64,
    /// Steps that fitting took.
    pub iterations: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct Component {
    weight: f64,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// The distribution of some dimensions given the others.
#[derive(Debug, Clone)]
pub struct MixtureRegression {
    given: usize,
    components: Vec<Conditional>,
}

/// A component, cut into what is given (x) and what is sought (y).
#[derive(Debug, Clone)]
struct Conditional {
    ln_weight: f64,
    mean_x: DVector<f64>,
    mean_y: DVector<f64>,
    /// The factor of S_xx.
    factor: Cholesky<f64, Dyn>,
    /// S_yx S_xx^-1.
    gain: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

/// What a regression says.
#[derive(Debug, Clone, PartialEq)]
pub struct Regressed {
    /// E[y | x].
    pub mean: Vec<f64>,
    /// Cov[y | x], row-major.
    pub covariance: Vec<f64>,
}

impl GaussianMixture {
    /// Fits a mixture to points with `dimensions` coordinates each, row-major, by expectation and maximisation from centres
    /// that are drawn far from each other (k-means++).
    ///
    /// # Errors
    /// [`Error::Length`] if the values do not fill whole points or there are fewer points than components, and
    /// [`Error::Setting`] for values that are not finite, no components, or a regularisation that is not positive.
    pub fn fit(points: &[f64], dimensions: usize, options: &MixtureOptions) -> Result<Self> {
        Self::fit_while(points, dimensions, options, &mut |_| Ok(()))
    }

    /// As [`GaussianMixture::fit`], as long as `go_on` is content. It is asked many times within a step, and given the number of steps that are
    /// done; what it asks changes no bit.
    ///
    /// # Errors
    /// As [`GaussianMixture::fit`], and those of `go_on`.
    pub fn fit_while<E: From<Error>>(
        points: &[f64],
        dimensions: usize,
        options: &MixtureOptions,
        go_on: &mut dyn FnMut(usize) -> std::result::Result<(), E>,
    ) -> std::result::Result<Self, E> {
        let points = Self::points(points, dimensions, options)?;
        let floor = floor(&points, options.regularisation);
        let mut responsibilities = nearest_centres(&points, options, &mut || go_on(0))?;
        let mut mixture = Self { components: Vec::new(), ln_density: f64::NEG_INFINITY, iterations: 0 };
        while mixture.iterations < options.iterations.max(1) {
            let done = mixture.iterations;
            mixture.maximise(&points, &responsibilities, &floor, &mut || go_on(done))?;
            let before = mixture.ln_density;
            mixture.ln_density = mixture.expect(&points, &mut responsibilities, &mut || go_on(done))?;
            mixture.iterations += 1;
            if mixture.ln_density - before < options.tolerance {
                break;
            }
        }
        Ok(mixture)
    }

    /// The points of a request that can be met.
    fn points(points: &[f64], dimensions: usize, options: &MixtureOptions) -> Result<Vec<DVector<f64>>> {
        let setting = |what, found: String, needed| Err(Error::Setting { what, found, needed });
        if options.components == 0 {
            return setting("the number of components", "0".into(), "at least 1");
        }
        if !(options.regularisation > 0.0 && options.regularisation.is_finite()) {
            return setting("the regularisation", options.regularisation.to_string(), "a positive number");
        }
        if dimensions == 0 || !points.len().is_multiple_of(dimensions) {
            let what = format!("the list of points with {dimensions} coordinates");
            return Err(Error::Length { what, found: points.len(), needed: dimensions });
        }
        if let Some(value) = points.iter().find(|value| !value.is_finite()) {
            return setting("a coordinate", value.to_string(), "a finite number");
        }
        let points: Vec<DVector<f64>> = points.chunks_exact(dimensions).map(DVector::from_column_slice).collect();
        if points.len() < options.components {
            let what = "the list of points".to_owned();
            return Err(Error::Length { what, found: points.len(), needed: options.components });
        }
        Ok(points)
    }

    /// ln p(z) of a point.
    ///
    /// # Errors
    /// [`Error::Length`] for a point with another number of coordinates.
    pub fn ln_density_at(&self, point: &[f64]) -> Result<f64> {
        let needed = self.components[0].mean.len();
        if point.len() != needed {
            return Err(Error::Length { what: "the point".to_owned(), found: point.len(), needed });
        }
        let point = DVector::from_column_slice(point);
        let terms: Vec<f64> = self
            .components
            .iter()
            .map(|c| c.weight.ln() + ln_normal(&point, &c.mean, &factor(&c.covariance)))
            .collect();
        Ok(ln_sum(&terms))
    }

    /// The regression of all other dimensions, in their order, on the first `given` ones.
    ///
    /// # Errors
    /// [`Error::Setting`] if nothing would be given, or nothing be left.
    pub fn regression(&self, given: usize) -> Result<MixtureRegression> {
        let dimensions = self.components[0].mean.len();
        if given == 0 || given >= dimensions {
            let needed = "at least 1, and fewer than the mixture has";
            return Err(Error::Setting { what: "the number of given dimensions", found: given.to_string(), needed });
        }
        let sought = dimensions - given;
        let cut = |component: &Component| {
            let Component { weight, mean, covariance } = component;
            let factor = factor(&covariance.view((0, 0), (given, given)).into_owned());
            let across = covariance.view((0, given), (given, sought)).into_owned();
            let gain = factor.solve(&across).transpose();
            let covariance = covariance.view((given, given), (sought, sought)) - &gain * across;
            Conditional {
                ln_weight: weight.ln(),
                mean_x: mean.rows(0, given).into_owned(),
                mean_y: mean.rows(given, sought).into_owned(),
                factor,
                gain,
                covariance,
            }
        };
        Ok(MixtureRegression { given, components: self.components.iter().map(cut).collect() })
    }

    /// Weights, means and covariances that suit the responsibilities best.
    fn maximise<E>(
        &mut self,
        points: &[DVector<f64>],
        responsibilities: &DMatrix<f64>,
        floor: &DVector<f64>,
        go_on: &mut dyn FnMut() -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let dimensions = floor.len();
        let before = std::mem::take(&mut self.components);
        for (k, shares) in responsibilities.column_iter().enumerate() {
            go_on()?;
            let total = shares.sum();
            if total < 1e-9 * points.len() as f64
                && let Some(component) = before.get(k).or(self.components.first())
            {
                // A component that explains nothing stays where it is, with next to no weight. Before there is one, any
                // place will do.
                self.components.push(Component { weight: 1e-12, ..component.clone() });
                continue;
            }
            let mut mean = DVector::zeros(dimensions);
            for (point, &share) in points.iter().zip(shares.iter()) {
                mean.axpy(share / total, point, 1.0);
            }
            let mut covariance = DMatrix::from_diagonal(floor);
            for (point, &share) in points.iter().zip(shares.iter()) {
                let off = point - &mean;
                covariance.ger(share / total, &off, &off, 1.0);
            }
            self.components.push(Component { weight: total / points.len() as f64, mean, covariance });
        }
        Ok(())
    }

    /// The share of each component in each point; gives the mean of ln p.
    fn expect<E>(
        &self,
        points: &[DVector<f64>],
        responsibilities: &mut DMatrix<f64>,
        go_on: &mut dyn FnMut() -> std::result::Result<(), E>,
    ) -> std::result::Result<f64, E> {
        let factors: Vec<_> = self.components.iter().map(|component| factor(&component.covariance)).collect();
        let mut sum = 0.0;
        for (row, point) in points.iter().enumerate() {
            if row % BETWEEN_QUESTIONS == 0 {
                go_on()?;
            }
            let terms: Vec<f64> = (self.components.iter().zip(&factors))
                .map(|(component, factor)| component.weight.ln() + ln_normal(point, &component.mean, factor))
                .collect();
            let ln_density = ln_sum(&terms);
            sum += ln_density;
            for (k, term) in terms.iter().enumerate() {
                responsibilities[(row, k)] = (term - ln_density).exp();
            }
        }
        Ok(sum / points.len() as f64)
    }
}

impl MixtureRegression {
    /// The distribution of what is sought where `x` is given.
    ///
    /// # Errors
    /// [`Error::Length`] for another number of values than are given.
    pub fn predict(&self, x: &[f64]) -> Result<Regressed> {
        if x.len() != self.given {
            return Err(Error::Length { what: "the given point".to_owned(), found: x.len(), needed: self.given });
        }
        let x = DVector::from_column_slice(x);
        let terms: Vec<f64> =
            self.components.iter().map(|c| c.ln_weight + ln_normal(&x, &c.mean_x, &c.factor)).collect();
        let total = ln_sum(&terms);
        let sought = self.components[0].mean_y.len();
        let mut mean = DVector::zeros(sought);
        let mut square = DMatrix::zeros(sought, sought);
        for (component, term) in self.components.iter().zip(&terms) {
            let share = (term - total).exp();
            let own = &component.mean_y + &component.gain * (&x - &component.mean_x);
            square += share * &component.covariance;
            square.ger(share, &own, &own, 1.0);
            mean.axpy(share, &own, 1.0);
        }
        square.ger(-1.0, &mean, &mean, 1.0);
        Ok(Regressed { mean: mean.as_slice().to_vec(), covariance: square.as_slice().to_vec() })
    }
}

/// What keeps each dimension's variance from vanishing; where a dimension never changes, a share of 1.
fn floor(points: &[DVector<f64>], regularisation: f64) -> DVector<f64> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<DVector<f64>>() / n;
    let variance = points.iter().map(|point| (point - &mean).map(|off| off * off)).sum::<DVector<f64>>() / n;
    variance.map(|variance| regularisation * if variance > 0.0 { variance } else { 1.0 })
}

/// One component for each point: that of the nearest of K centres, which are drawn with a probability that grows with the
/// squared distance to those drawn before. Distances are in units of each dimension's deviation.
fn nearest_centres<E>(
    points: &[DVector<f64>],
    options: &MixtureOptions,
    go_on: &mut dyn FnMut() -> std::result::Result<(), E>,
) -> std::result::Result<DMatrix<f64>, E> {
    let scale = floor(points, 1.0);
    let distance = |a: &DVector<f64>, b: &DVector<f64>| (a - b).map(|off| off * off).component_div(&scale).sum();
    let mut generator = stream(options.seed, Purpose::MixtureCentres, 0);
    let mut nearest = vec![(f64::INFINITY, 0); points.len()];
    for k in 0..options.components {
        go_on()?;
        let total: f64 = nearest.iter().map(|(distance, _)| distance).sum();
        let mut left = generator.random::<f64>() * total;
        let drawn = match k {
            0 => generator.random_range(0..points.len()),
            // Where all points are covered already, any will do.
            _ if total <= 0.0 => k,
            _ => (nearest.iter().position(|(distance, _)| {
                left -= distance;
                left < 0.0
            }))
            .unwrap_or(points.len() - 1),
        };
        let centre = points[drawn].clone();
        for (point, nearest) in points.iter().zip(&mut nearest) {
            let here = distance(point, &centre);
            if here < nearest.0 {
                *nearest = (here, k);
            }
        }
    }
    Ok(DMatrix::from_fn(points.len(), options.components, |row, k| f64::from(u8::from(nearest[row].1 == k))))
}

/// The factor of a covariance. The floor keeps it positive definite. If rounding still spoils that, the factor is that of its diagonal.
fn factor(covariance: &DMatrix<f64>) -> Cholesky<f64, Dyn> {
    covariance.clone().cholesky().unwrap_or_else(|| {
        let diagonal = covariance.diagonal().map(|value| value.max(f64::MIN_POSITIVE));
        Cholesky::pack_dirty(DMatrix::from_diagonal(&diagonal.map(f64::sqrt)))
    })
}

fn ln_normal(point: &DVector<f64>, mean: &DVector<f64>, factor: &Cholesky<f64, Dyn>) -> f64 {
    let lower = factor.l_dirty();
    let mut off = point - mean;
    let solved = lower.solve_lower_triangular_mut(&mut off);
    debug_assert!(solved, "the diagonal of a factor is positive");
    let ln_root: f64 = lower.diagonal().iter().map(|value| value.ln()).sum();
    -0.5 * off.norm_squared() - ln_root - 0.5 * point.len() as f64 * (2.0 * std::f64::consts::PI).ln()
}

/// ln sum exp, without overflow.
fn ln_sum(terms: &[f64]) -> f64 {
    let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + terms.iter().map(|term| (term - largest).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn normal(generator: &mut ChaCha8Rng) -> f64 {
        StandardNormal.sample(generator)
    }

    #[test]
    fn one_component_is_linear_regression() {
        // y = 2 x - 1 + noise of variance 0.01.
        let mut generator = ChaCha8Rng::seed_from_u64(3);
        let mut points = Vec::new();
        let (mut sxx, mut sxy, mut sx, mut sy) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..400 {
            let x = normal(&mut generator);
            let y = 2.0 * x - 1.0 + 0.1 * normal(&mut generator);
            points.extend([x, y]);
            (sx, sy, sxx, sxy) = (sx + x / 400.0, sy + y / 400.0, sxx + x * x / 400.0, sxy + x * y / 400.0);
        }
        let options = MixtureOptions { components: 1, regularisation: 1e-12, ..MixtureOptions::default() };
        let mixture = GaussianMixture::fit(&points, 2, &options).unwrap();
        let slope = (sxy - sx * sy) / (sxx - sx * sx);
        let predicted = mixture.regression(1).unwrap().predict(&[0.7]).unwrap();
        assert!((predicted.mean[0] - (sy + slope * (0.7 - sx))).abs() < 1e-9);
        assert!((predicted.covariance[0] - 0.01).abs() < 0.002, "{predicted:?}");
        assert!((slope - 2.0).abs() < 0.02);
    }

    #[test]
    fn two_clouds_are_told_apart_and_the_likelihood_never_falls() {
        let mut generator = ChaCha8Rng::seed_from_u64(5);
        let cloud =
            |generator: &mut ChaCha8Rng, x: f64, y: f64| [x + 0.2 * normal(generator), y + 0.1 * normal(generator)];
        let points: Vec<f64> = (0..600)
            .flat_map(|k| if k % 3 == 0 { cloud(&mut generator, -2.0, 1.0) } else { cloud(&mut generator, 2.0, 3.0) })
            .collect();
        let fit = |iterations| {
            let options = MixtureOptions { components: 2, iterations, tolerance: 0.0, ..MixtureOptions::default() };
            GaussianMixture::fit(&points, 2, &options).unwrap()
        };
        let climb: Vec<f64> = (1..6).map(|iterations| fit(iterations).ln_density).collect();
        assert!(climb.windows(2).all(|pair| pair[1] >= pair[0] - 1e-9), "{climb:?}");
        let regression = fit(50).regression(1).unwrap();
        for (x, y) in [(-2.0, 1.0), (2.0, 3.0)] {
            let there = regression.predict(&[x]).unwrap();
            assert!((there.mean[0] - y).abs() < 0.05 && (there.covariance[0] - 0.01).abs() < 0.003, "{there:?}");
        }
        // Half-way between them the answer is a mixture: its variance holds the distance of the clouds.
        let between = (-100..100).map(|k| regression.predict(&[0.01 * f64::from(k)]).unwrap().covariance[0]);
        assert!(between.fold(0.0, f64::max) > 0.9);
        // The density integrates to 1.
        let mixture = fit(50);
        let sum: f64 = (0..200)
            .flat_map(|i| (0..200).map(move |j| (i, j)))
            .map(|(i, j)| {
                mixture.ln_density_at(&[-5.0 + 0.05 * f64::from(i), -3.0 + 0.05 * f64::from(j)]).unwrap().exp() * 0.0025
            })
            .sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn equal_seeds_fit_equal_mixtures() {
        let points: Vec<f64> = (0..300).map(|k| f64::from(k * k % 97)).collect();
        let fit = || GaussianMixture::fit(&points, 3, &MixtureOptions::default()).unwrap();
        assert_eq!(fit(), fit());
    }

    #[test]
    fn a_fit_tells_its_steps_and_ends_where_it_is_told_to() {
        let points: Vec<f64> = (0..3000).map(|k| f64::from(k * k % 97)).collect();
        let options = MixtureOptions { iterations: 9, tolerance: 0.0, ..MixtureOptions::default() };
        let mut told = Vec::new();
        let watched = GaussianMixture::fit_while::<Error>(&points, 3, &options, &mut |step| {
            told.push(step);
            Ok(())
        });
        assert_eq!(watched.unwrap(), GaussianMixture::fit(&points, 3, &options).unwrap());
        // For each component in turn, and for each few hundred of a thousand points; first for the centres.
        assert!(
            told.is_sorted() && (0..9).all(|step| told.iter().filter(|told| **told == step).count() >= 12),
            "{told:?}"
        );
        #[derive(Debug, PartialEq)]
        enum Ended {
            Asked(usize),
            Wrong(String),
        }
        impl From<Error> for Ended {
            fn from(error: Error) -> Self {
                Self::Wrong(error.to_string())
            }
        }
        let mut ends = |step| if step == 3 { Err(Ended::Asked(step)) } else { Ok(()) };
        assert_eq!(GaussianMixture::fit_while(&points, 3, &options, &mut ends), Err(Ended::Asked(3)));
        assert!(matches!(GaussianMixture::fit_while(&points, 7, &options, &mut ends), Err(Ended::Wrong(_))));
    }

    #[test]
    fn points_that_are_all_equal_and_senseless_requests_do_not_panic() {
        let options = MixtureOptions { components: 3, ..MixtureOptions::default() };
        let same = GaussianMixture::fit(&[2.0; 20], 2, &options).unwrap();
        let there = same.regression(1).unwrap().predict(&[2.0]).unwrap();
        assert!((there.mean[0] - 2.0).abs() < 1e-9 && there.covariance[0].is_finite());
        let message = |result: Result<GaussianMixture>| result.unwrap_err().to_string();
        assert!(message(GaussianMixture::fit(&[1.0; 5], 2, &options)).contains("points"));
        assert!(message(GaussianMixture::fit(&[1.0; 4], 2, &options)).contains("needed: 3"));
        assert!(message(GaussianMixture::fit(&[f64::NAN; 8], 2, &options)).contains("finite"));
        let none = MixtureOptions { components: 0, ..MixtureOptions::default() };
        assert!(message(GaussianMixture::fit(&[1.0; 4], 2, &none)).contains("at least 1"));
        assert!(same.regression(2).is_err() && same.regression(1).unwrap().predict(&[]).is_err());
        assert!(same.ln_density_at(&[1.0]).is_err());
    }
}
