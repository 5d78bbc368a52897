//! L-BFGS at the window's tail ([`quasi_newton`](crate::quasi_newton)), with pairs that live on when the window slides.
//!
//! A window that has slid begins one row later, so the pairs of the last sample are of no use to this one. But whoever moved
//! the tail by s moved row r by s_r, and the way back passes the gradient there:
//!
//! ```text
//! s_r = u'_r - u_r,   d_r = g_r - g'_r,   g_r = d ln L_reg / d u_r        pairs of the window that will begin at row r
//! ```
//!
//! That window drops the samples before row r and takes in new ones, so these pairs tell its curvature nearly, not exactly: enough for a
//! metric. Pairs are kept for the next two windows, and an ascent that would have to begin with nothing begins with these.
//!
//! A short window does not say all of a state, and what it does not say must not wander off from sample to sample until no state nearby
//! explains what comes. So the ascent is held back by a unit normal around the state that it begins from,
//!
//! ```text
//! ln L_reg - 1/2 |u - u_start|^2
//! ```
//!
//! which is little beside what tells anything (precisions of 100 to 10 000), and begins anew with each sample.

use pulp::Simd;

use super::{ErrorRegression, Regression};
use crate::quasi_newton::{Pairs, dot};

/// How many windows that are still to come get pairs.
const LATER: usize = 2;
/// A step must gain this share of what its slope promises (Armijo).
const GAIN: f64 = 1e-4;
/// Of what holds the ascent back, for each squared unit of way.
const STIFFNESS: f64 = 1.0;
/// No step moves a unit further than this.
const LONGEST: f64 = 0.1;
/// Length of the first try where there is no pair yet from which the scale is known.
const FIRST: f64 = 0.1;
/// Tries along one direction.
const TRIES: usize = 10;
/// An ascent ends before a step that promises less than this share of the tolerance.
const WORTH: f64 = 0.3;

/// What is remembered.
#[derive(Debug)]
pub(super) struct Memory {
    /// The units that are moved.
    units: Vec<usize>,
    /// Pairs of the window that begins at row r.
    pairs: Vec<Pairs>,
    /// u and gradient of row r at the best iterate.
    best: Vec<(Vec<f64>, Vec<f64>)>,
    /// Where the ascent began.
    start: Vec<f64>,
    /// The gradient at the best iterate, with what holds the ascent back.
    gradient: Vec<f64>,
    direction: Vec<f64>,
    s: Vec<f64>,
    d: Vec<f64>,
}

impl Memory {
    /// Of so many pairs for each window.
    pub fn new(moves: &[bool], memory: usize) -> Self {
        let units: Vec<usize> = (0..moves.len()).filter(|&i| moves[i]).collect();
        let n = units.len();
        let zeros = || vec![0.0; n];
        Self {
            units,
            pairs: (0..=LATER).map(|_| Pairs::new(n, memory)).collect(),
            best: (0..=LATER).map(|_| (zeros(), zeros())).collect(),
            start: zeros(),
            gradient: zeros(),
            direction: zeros(),
            s: zeros(),
            d: zeros(),
        }
    }

    /// The window begins one row later.
    pub fn slide(&mut self) {
        self.pairs.rotate_left(1);
        if let Some(last) = self.pairs.last_mut() {
            last.forget();
        }
    }

    /// Starts anew.
    pub fn forget(&mut self) {
        self.pairs.iter_mut().for_each(Pairs::forget);
    }

    /// Takes up u and gradient of row `row` as those of the best iterate, and a pair with the best before, if there was one.
    fn take(&mut self, row: usize, u: &[f64], gradient: &[f64], follows: bool) {
        let (best_u, best_gradient) = &mut self.best[row];
        for (k, &i) in self.units.iter().enumerate() {
            (self.s[k], self.d[k]) = (u[i] - best_u[k], best_gradient[k] - gradient[i]);
            (best_u[k], best_gradient[k]) = (u[i], gradient[i]);
        }
        if follows {
            self.d.iter_mut().zip(&self.s).for_each(|(d, s)| *d += STIFFNESS * s);
            self.pairs[row].remember(&self.s, &self.d);
        }
    }

    /// H g and its slope, with what holds the ascent back. Pairs that lead downhill are forgotten.
    fn turn(&mut self) -> f64 {
        let (u, gradient) = &self.best[0];
        for (k, own) in self.gradient.iter_mut().enumerate() {
            *own = gradient[k] - STIFFNESS * (u[k] - self.start[k]);
        }
        self.pairs[0].direction(&self.gradient, &mut self.direction);
        let slope = dot(&self.direction, &self.gradient);
        if slope > 0.0 && slope.is_finite() {
            return slope;
        }
        self.forget();
        self.direction.copy_from_slice(&self.gradient);
        dot(&self.direction, &self.direction)
    }

    /// What the tail `step` along the direction is held back by, beyond what the best one is.
    fn held_back(&self, step: f64) -> f64 {
        let (mut sum, mut before) = (0.0, 0.0);
        for (k, p) in self.direction.iter().enumerate() {
            let way = self.best[0].0[k] - self.start[k];
            (sum, before) = (sum + (way + step * p).powi(2), before + way * way);
        }
        0.5 * STIFFNESS * (sum - before)
    }

    /// Puts the tail `step` along the direction from the best one; with 0, on it.
    fn put(&self, step: f64, tail: &mut [f64]) {
        for (k, &i) in self.units.iter().enumerate() {
            tail[i] = self.best[0].0[k] + step * self.direction[k];
        }
    }
}

impl ErrorRegression {
    /// Climbs from the tail as it is. No step is taken that does not lead uphill.
    #[inline(always)]
    pub(super) fn climb<S: Simd>(
        &mut self,
        simd: S,
        memory: &mut Memory,
        go_on: &mut dyn FnMut() -> bool,
        done: &mut Regression,
    ) {
        if self.options.iterations == 0 || !go_on() {
            return;
        }
        let tolerance = self.options.tolerance_of_a_step() * self.length as f64;
        self.run_window(simd);
        let (mut value, squares) = self.score(simd);
        self.run_back(simd);
        (done.ln_likelihood, done.squared_error, done.passes) = ([value; 2], [squares; 2], 1);
        if !(value.is_finite() && self.gradient_is_finite()) {
            done.diverged = true;
            return;
        }
        self.remember(memory, false);
        memory.start.copy_from_slice(&memory.best[0].0);
        let mut first = FIRST;
        while done.iterations < self.options.iterations {
            let slope = memory.turn();
            if !(slope > 0.0 && slope.is_finite()) {
                done.converged = slope == 0.0;
                break;
            }
            let known = memory.pairs[0].held() > 0;
            if known && 0.5 * slope < WORTH * tolerance {
                done.converged = true;
                break;
            }
            let longest = memory.direction.iter().fold(0.0, |longest: f64, p| longest.max(p.abs()));
            let whole = if known { 1.0 } else { first / dot(&memory.direction, &memory.direction).sqrt() };
            let Some((step, gain, [ln_likelihood, squares])) =
                self.search(simd, memory, (whole.min(LONGEST / longest), slope, value), go_on, done)
            else {
                // The tail of the last try is not the best one.
                memory.put(0.0, &mut self.internal);
                self.run_window(simd);
                break;
            };
            value = ln_likelihood;
            (done.ln_likelihood[1], done.squared_error[1], done.kept) = (value, squares, done.iterations);
            self.run_back(simd);
            done.passes += 1;
            if !self.gradient_is_finite() {
                done.diverged = true;
                memory.forget();
                break;
            }
            self.remember(memory, true);
            if memory.pairs[0].held() == 0 {
                // No curvature was met on the way: further along.
                first = 4.0 * step * dot(&memory.direction, &memory.direction).sqrt();
            }
            if gain < tolerance {
                done.converged = true;
                break;
            }
        }
    }

    /// Tries steps along the memory's direction until one gains enough: the step, its gain, and there ln L_reg and the sum of squared errors.
    /// None where no step does, or there is no time.
    #[inline(always)]
    fn search<S: Simd>(
        &mut self,
        simd: S,
        memory: &mut Memory,
        (mut step, slope, value): (f64, f64, f64),
        go_on: &mut dyn FnMut() -> bool,
        done: &mut Regression,
    ) -> Option<(f64, f64, [f64; 2])> {
        for _ in 0..TRIES {
            if done.iterations == self.options.iterations || !go_on() {
                return None;
            }
            memory.put(step, &mut self.internal);
            self.run_window(simd);
            let (ln_likelihood, squares) = self.score(simd);
            done.iterations += 1;
            let gain = ln_likelihood - value - memory.held_back(step);
            if gain.is_finite() && gain >= GAIN * step * slope {
                return Some((step, gain, [ln_likelihood, squares]));
            }
            done.diverged |= !gain.is_finite();
            // The top of the parabola through what is known, but no leap.
            let top = slope * step / (2.0 * (slope * step - gain));
            step *= if gain.is_finite() { top.clamp(0.1, 0.5) } else { 0.1 };
        }
        // Whatever this direction was made of is of no use.
        memory.forget();
        None
    }

    fn gradient_is_finite(&self) -> bool {
        self.deltas[..self.packed.n_c].iter().all(|g| g.is_finite())
    }

    /// Takes up where the window's first rows are, and the gradients there.
    fn remember(&self, memory: &mut Memory, follows: bool) {
        let (n_c, rows, stride) = (self.packed.n_c, self.packed.rows, self.packed.delta_stride);
        for row in 0..=LATER.min(self.length) {
            let gradient = match row {
                0 => &self.deltas[..n_c],
                // The tail's gradient took its place; it was put aside before.
                1 => &self.drive_with_input[..n_c],
                row => &self.deltas[(row - 1) * stride..][..n_c],
            };
            memory.take(row, &self.internal[row * rows..][..n_c], gradient, follows);
        }
    }
}
