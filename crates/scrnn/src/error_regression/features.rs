//! The way back through a window whose inputs and predictions are made of features: a step's input depends on the sample before it
//! too, and its prediction on samples that were themselves predicted.

use aligned_vec::AVec;
use pulp::Simd;

use super::ErrorRegression;
use crate::backward::{Pass, retreat};
use crate::features::Features;
use crate::kernels::panels::{Columns, Product, multiply};

/// Of each row: what its mean units say, its target in their units, and d ln L_reg by its mean, its sample and its difference.
#[derive(Debug)]
pub(super) struct Slopes {
    pub rho: AVec<f64>,
    pub target: AVec<f64>,
    mean: AVec<f64>,
    sample: AVec<f64>,
    difference: AVec<f64>,
}

impl Slopes {
    pub fn new(features: &Features, channels: usize, rows: usize) -> Self {
        let len = if features.are_plain() { 0 } else { rows * channels };
        let zeros = || AVec::from_iter(64, std::iter::repeat_n(0.0, len));
        Self { rho: zeros(), target: zeros(), mean: zeros(), sample: zeros(), difference: zeros() }
    }
}

impl ErrorRegression {
    /// d ln L_reg / du of the window's tail, left in the first delta row. Row r stands for the step to it; with
    ///
    /// ```text
    /// gx_r, gd_r, gm_r = d ln L_reg by the step's sample, its difference to the one before, and the mean it predicts
    /// ```
    ///
    /// gm_r is complete once all later rows are done, then gd_r, then gx_r.
    #[inline(always)]
    pub(super) fn run_back_with_features<S: Simd>(&mut self, simd: S) {
        let packed = &self.packed;
        let (n, n_c, stride, features) = (packed.n_y, packed.n_c, packed.delta_stride, &self.features);
        let Slopes { rho, mean: gm, sample: gx, difference: gd, .. } = &mut self.slopes;
        gx.fill(0.0);
        gd.fill(0.0);
        for k in 0..self.length * n {
            gm[n + k] = match features.has_skip() {
                true => self.mean_delta[k] / features.scale(k % n),
                // Then the delta has the slope of the mean unit in it already.
                false => 0.0,
            };
        }
        self.deltas[self.length * stride..][..n_c].fill(0.0);
        for row in (1..=self.length).rev() {
            let at = row * n;
            let outputs = &mut self.deltas[row * stride + n_c..][..packed.n_out];
            for i in 0..n {
                let y = if features.has_skip() { rho[at + i] } else { self.mean[(self.delay + row) * n + i] };
                let slope = if packed.linear_mean { 1.0 } else { 1.0 - y * y };
                let scored = if features.has_skip() { 0.0 } else { self.mean_delta[at - n + i] };
                outputs[i] = scored + slope * features.scale(i) * gm[at + i];
            }
            if packed.n_out > n {
                outputs[n..].copy_from_slice(&self.variance_delta[at - n..at]);
            }
            if features.has_skip() {
                for i in 0..n {
                    gx[at + i] += gm[at + i];
                }
                for lag in (0..features.lags()).take_while(|lag| *lag < row) {
                    let own = (row - lag) * n;
                    features.back(lag, &gm[at..at + n], &mut gd[own..own + n]);
                }
            }

            let (before, after) = self.deltas.split_at_mut(row * stride);
            let states = &self.states[row * packed.state_stride..];
            retreat(simd, packed, after, states, &mut before[(row - 1) * stride..], 1, Pass::default());

            let du = &before[(row - 1) * stride..][..stride];
            let (matrices, sources) = ([&packed.to_input], [Columns { values: du, stride }]);
            let product = Product { matrices, sources, columns: 1, start: &packed.zeros, ahead: &[] };
            multiply(simd, product, &mut self.outputs);
            for i in 0..n {
                if let Some(rate) = features.velocity().get(i) {
                    gd[at + i] += rate * self.outputs[n + i];
                }
                gx[at + i] += self.outputs[i] + gd[at + i];
                gx[at - n + i] -= gd[at + i];
                if row > self.delay {
                    let missing = self.samples[at - n + i].is_nan();
                    let share = if missing { 1.0 } else { 1.0 - self.options.sensed_in_window[i] };
                    gm[at - self.delay * n + i] += share * gx[at + i];
                }
            }
        }
        // The tail: nothing lies before it.
        self.deltas[n_c..n_c + packed.n_out].fill(0.0);
        self.drive_with_input.copy_from_slice(&self.deltas[..packed.rows]);
        retreat(simd, packed, &self.drive_with_input, &self.states, &mut self.deltas, 1, Pass::default());
    }
}
