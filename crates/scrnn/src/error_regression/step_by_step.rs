//! The rules that take each step, wherever it leads: momentum, as in the thesis (2.17), (2.18), and Adam.

use pulp::Simd;

use super::{Ascent, ErrorRegression, Regression};

impl ErrorRegression {
    /// The iterations of the rules that take each step, wherever it leads.
    #[inline(always)]
    pub(super) fn step_by_step<S: Simd>(&mut self, simd: S, go_on: &mut dyn FnMut() -> bool, done: &mut Regression) {
        self.first.fill(0.0);
        self.second.fill(0.0);
        let n_c = self.packed.n_c;
        let tolerance = self.options.tolerance_of_a_step() * self.length as f64;
        let (mut best, mut last) = ([f64::NEG_INFINITY, 0.0], f64::NAN);
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        while done.iterations < self.options.iterations && go_on() {
            self.run_window(simd);
            let (ln_likelihood, squared_error) = self.score(simd);
            if done.iterations == 0 {
                (done.ln_likelihood, done.squared_error) = ([ln_likelihood; 2], [squared_error; 2]);
            }
            if self.options.keep_best && ln_likelihood > best[0] {
                (best, done.kept) = ([ln_likelihood, squared_error], done.iterations);
                self.tail_best.copy_from_slice(&self.internal[..n_c]);
            }
            if (ln_likelihood - last).abs() < tolerance {
                done.converged = true;
                break;
            }
            last = ln_likelihood;
            self.run_back(simd);
            done.passes += 1;
            if !(ln_likelihood.is_finite() && finite(&self.deltas[..n_c])) {
                done.diverged = true;
                break;
            }
            self.tail_before.copy_from_slice(&self.internal[..n_c]);
            self.move_tail(done.iterations);
            done.iterations += 1;
            if !finite(&self.internal[..n_c]) {
                done.diverged = true;
                break;
            }
        }
        if done.iterations == 0 {
            return;
        }
        if !done.diverged {
            self.run_window(simd);
            (done.ln_likelihood[1], done.squared_error[1]) = self.score(simd);
            done.diverged = !done.ln_likelihood[1].is_finite();
        }
        if done.diverged {
            // The tail before the last step had a finite score.
            done.iterations -= 1;
            self.internal[..n_c].copy_from_slice(&self.tail_before);
            self.run_window(simd);
            (done.ln_likelihood[1], done.squared_error[1]) = self.score(simd);
        }
        if self.options.keep_best && best[0] > done.ln_likelihood[1] {
            self.internal[..n_c].copy_from_slice(&self.tail_best);
            self.run_window(simd);
            (done.ln_likelihood[1], done.squared_error[1]) = (best[0], best[1]);
        } else {
            done.kept = done.iterations;
        }
    }

    /// Moves the tail; `iteration` counts from 0.
    #[inline(always)]
    fn move_tail(&mut self, iteration: usize) {
        const BETA: (f64, f64) = (0.9, 0.999);
        let n_c = self.packed.n_c;
        let (u, gradient) = (&mut self.internal[..n_c], &self.deltas[..n_c]);
        let square = gradient.iter().zip(&self.moves).map(|(g, moves)| if *moves { g * g } else { 0.0 }).sum::<f64>();
        let scale = match self.options.max_norm {
            Some(most) if square > most * most => most / square.sqrt(),
            _ => 1.0,
        };
        let count = i32::try_from(iteration + 1).unwrap_or(i32::MAX);
        let (correct_first, correct_second) = (1.0 / (1.0 - BETA.0.powi(count)), 1.0 / (1.0 - BETA.1.powi(count)));
        for i in 0..n_c {
            if !self.moves[i] {
                continue;
            }
            let g = scale * gradient[i];
            u[i] += match self.options.ascent {
                Ascent::Momentum { rate, momentum } => {
                    self.first[i] = rate * g + momentum * self.first[i];
                    self.first[i]
                }
                // It has a way of its own, in `lbfgs`.
                Ascent::Lbfgs { .. } => 0.0,
                Ascent::Adam { rate } => {
                    self.first[i] = BETA.0 * self.first[i] + (1.0 - BETA.0) * g;
                    self.second[i] = BETA.1 * self.second[i] + (1.0 - BETA.1) * g * g;
                    rate * self.first[i] * correct_first / ((self.second[i] * correct_second).sqrt() + 1e-8)
                }
            };
        }
    }
}
