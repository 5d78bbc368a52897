//! What a prediction is worth, and its gradient at the output units (thesis 2.6).
//!
//! ```text
//! ln L_out = sum ( -ln(2 pi v) / 2 - (target - y)^2 / (2 v) )        (2.11), constant included: nats
//! d/du_y   = (1 - y^2) (target - y) / v                              (2.22)
//! d/du_v   = -1/2 + (target - y)^2 / (2 v)                           (2.22); times (v - floor) / v with a floor
//! -E       = -sum (target - y)^2 / 2                                 (A.22) where there is no variance
//! ```
//!
//! All gradients point uphill: d ln L, or d(-E).

use pulp::Simd;

use crate::error::{Error, Result};
use crate::forward::Plain;
use crate::kernels::activation::{exp_slice, ln_slice};
use crate::network::Network;

/// ln(2 pi).
pub(crate) const LN_2PI: f64 = 1.837_877_066_409_345_3;

/// ln N(target | y, v) in nats (2.9).
#[must_use]
pub fn ln_gaussian(target: f64, y: f64, v: f64) -> f64 {
    -0.5 * (LN_2PI + v.ln() + (target - y).powi(2) / v)
}

/// ln L_out of one sequence (-E without variance) and its sum of squared errors, in plain loops: the reference.
/// `samples` is row-major; the first `steps` + xi are used, and NaN does not count.
///
/// # Errors
/// [`Error::Length`] for an initial state of another size, or too few samples.
pub fn plain(network: &Network, u0: &[f64], samples: &[f64], steps: usize) -> Result<(f64, f64)> {
    let (n_x, delay) = (network.topology.channels(), network.topology.delay());
    let needed = steps.saturating_add(delay).saturating_mul(n_x);
    if samples.len() < needed {
        return Err(Error::Length { what: "the sequence".into(), found: samples.len(), needed });
    }
    let mut state = Plain::new(network, u0)?;
    let (mut ln_likelihood, mut squared_error) = (0.0, 0.0);
    for k in 0..steps {
        state.advance(&samples[k * n_x..(k + 1) * n_x]);
        for (i, target) in samples[(k + delay) * n_x..][..n_x].iter().enumerate().filter(|(_, target)| !target.is_nan())
        {
            let squared = (target - state.y[i]).powi(2);
            squared_error += squared;
            ln_likelihood += match state.v.get(i) {
                Some(&v) => ln_gaussian(*target, state.y[i], v),
                None => -0.5 * squared,
            };
        }
    }
    Ok((ln_likelihood, squared_error))
}

/// The same values of many predictions, side by side.
pub(crate) struct Predictions<'a> {
    /// In: y. Out: d/du_y.
    pub mean: &'a mut [f64],
    /// In: u of the variance units. Out: d/du_v. Empty without variance.
    pub variance: &'a mut [f64],
    pub target: &'a [f64],
    /// Out: terms of ln L, or of -E.
    pub terms: &'a mut [f64],
    /// Out: squared errors.
    pub squares: &'a mut [f64],
    /// Scratch.
    pub precisions: &'a mut [f64],
    /// Whether the mean units are linear.
    pub linear: bool,
}

impl Predictions<'_> {
    /// Scores all predictions. All lists have the same length.
    #[inline(always)]
    pub fn score<S: Simd>(self, simd: S, floor: f64) {
        let Self { mean, variance, target, terms, squares, precisions, linear } = self;
        let n = target.len();
        let (mean, terms, squares) = (&mut mean[..n], &mut terms[..n], &mut squares[..n]);
        // d mean / d u of the mean unit.
        let slope = |y: f64| if linear { 1.0 } else { 1.0 - y * y };
        if variance.is_empty() {
            for k in 0..n {
                let y = mean[k];
                let e = target[k] - y;
                squares[k] = e * e;
                terms[k] = -0.5 * (e * e);
                mean[k] = slope(y) * e;
            }
            return;
        }
        let (variance, precisions) = (&mut variance[..n], &mut precisions[..n]);
        if floor == 0.0 {
            precisions.copy_from_slice(variance);
            exp_slice(simd, -1.0, precisions);
            for k in 0..n {
                let y = mean[k];
                let e = target[k] - y;
                let weighted = e * e * precisions[k];
                squares[k] = e * e;
                terms[k] = -0.5 * (LN_2PI + variance[k] + weighted);
                mean[k] = slope(y) * e * precisions[k];
                variance[k] = 0.5 * (weighted - 1.0);
            }
        } else {
            exp_slice(simd, 1.0, variance);
            for k in 0..n {
                precisions[k] = variance[k] + floor;
            }
            ln_slice(precisions, terms);
            for k in 0..n {
                let y = mean[k];
                let e = target[k] - y;
                let v = precisions[k];
                let weighted = e * e / v;
                squares[k] = e * e;
                terms[k] = -0.5 * (LN_2PI + terms[k] + weighted);
                mean[k] = slope(y) * e / v;
                variance[k] = 0.5 * (weighted - 1.0) * (variance[k] / v);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_likelihood_of_a_standard_normal_has_its_constant() {
        assert!((ln_gaussian(0.0, 0.0, 1.0) + 0.918_938_533_204_672_7).abs() < 1e-15);
        assert!((ln_gaussian(1.5, 0.5, 4.0) - (-0.918_938_533_204_672_7 - 2.0_f64.ln() - 0.125)).abs() < 1e-15);
    }
}
