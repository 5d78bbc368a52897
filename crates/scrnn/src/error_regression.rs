//! Error regression (ERS): recognition while it happens (thesis 2.10.2).
//!
//! ```text
//! ln L_reg = sum_{t' = t-W+1..t} sum_i ln N(y-hat_t',i | y_t',i, v_t',i)                      (2.28)
//! u_{t-W}  <- u_{t-W} + delta u,    delta u_n = alpha_reg d ln L_reg / d u_{t-W} + eta delta u_{n-1}   (2.17), (2.18)
//! ```
//!
//! Whenever a sample arrives, the last W steps are run again from the internal state before them, in the closed loop
//! without noise, and that state is moved uphill; then the window's past is overwritten with what follows from it, and
//! so is the prediction of the next sample. Only the groups whose initial state is learned are moved.
//!
//! Missing values of samples (NaN) do not count; as inputs, the means that were predicted for them stand in.
//!
//! Channels can be left out of ln L_reg, or count in part. The gradient is exact: it also runs through the means that the window
//! feeds back to itself. Inputs of the window's first xi steps are the means predicted before it, which stay as they were, or
//! samples where there was no prediction yet.
//!
//! # Which ascent
//!
//! [`Ascent::Lbfgs`], the default, takes no step that does not lead uphill, knows the curvature from the samples before, and
//! ends when nothing is left to gain. [`Ascent::Momentum`] is the thesis', [`Ascent::Adam`] has steps of one size; both end where their last step leads, unless
//! [`ErrorRegressionOptions::keep_best`] is set.
//!
//! None of them can help where no state lets the closed loop follow the samples for a whole window, though the open loop
//! predicts them well. [`ErrorRegressionOptions::guard`] runs the network without regression beside: where its predictions made the window
//! more likely than the regression now does, it is its state from which the network goes on.
//!
//! # At the thesis' rate the ascent is chaotic
//!
//! alpha_reg is a fixed step, however steep the likelihood is. On trained networks with many context units the iterations do not
//! converge at the thesis' rate but jump about, and small differences grow: two regressions whose states differ by 1e-15 differ by
//! 0.26 ten samples later. The same samples still give the same bits, on any instruction set. But whatever rounds otherwise (samples
//! that went through another unit, a network that was trained by another version) leads to other states, and so to other reaction
//! times. Compare averages over many trials, never one trial with another.

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use crate::backward::{Pass, retreat};
use crate::engine::{Engine, InstructionSet, Run};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::forward::{activate, advance};
use crate::kernels::activation::{exp_slice, tanh_rows};
use crate::kernels::panels::{Columns, Product, multiply};
use crate::kernels::{ROWS, copy_few};
use crate::likelihood::Predictions;
use crate::network::Network;
use crate::packed::Packed;

mod features;
mod lbfgs;
mod options;
mod step_by_step;

pub use options::{Ascent, ErrorRegressionOptions, Regression};

/// A network that runs beside a stream of samples. Everything is allocated at the start.
///
/// Row r of the window is the state after its r-th step; row 0 is the tail, u_{t-W}. One row more is the step that
/// predicts the sample to come, and as many more as are asked for look further ahead: their inputs are samples as long as
/// there are some, then what was predicted.
#[derive(Debug)]
pub struct ErrorRegression {
    packed: Packed,
    set: InstructionSet,
    options: ErrorRegressionOptions,
    delay: usize,
    features: Features,
    /// How many inputs from before the window are kept.
    past: usize,
    /// Samples observed.
    observed: usize,
    /// Steps in the window, at most W.
    length: usize,
    /// [row][rows]: u.
    internal: AVec<f64>,
    /// [row][state_stride]: c, then the input of the next row's step.
    states: AVec<f64>,
    /// [xi + row][channel]: y of the row's step; the first xi are from before the window. Row r + 1 is what sample
    /// number r of `samples` was predicted as.
    mean: AVec<f64>,
    /// [row][channel]: u of the variance units.
    variance: AVec<f64>,
    /// [row][channel]: row r is the sample that can be the input of the next row's step.
    samples: AVec<f64>,
    /// [past + row][channel]: the sample, or its stand-in, that the next row's step took in, after those from before the window.
    taken: AVec<f64>,
    /// Gradients along the window, where there are features.
    slopes: features::Slopes,
    /// [row][delta_stride]: d/du of the next row's context, then of this row's outputs.
    deltas: AVec<f64>,
    /// [row][channel]: d/du of the mean and the variance units.
    mean_delta: AVec<f64>,
    variance_delta: AVec<f64>,
    terms: AVec<f64>,
    squares: AVec<f64>,
    precisions: AVec<f64>,
    drive: AVec<f64>,
    drive_with_input: AVec<f64>,
    /// tanh of the rows that hold outputs; on the way back, d/dx.
    outputs: AVec<f64>,
    /// One for each unit: whether it is moved, and the memory of the ascent.
    moves: Vec<bool>,
    first: Vec<f64>,
    second: Vec<f64>,
    /// The tail before the last step, and the best one.
    tail_before: Vec<f64>,
    tail_best: Vec<f64>,
    /// Pairs of L-BFGS; none for the other rules.
    memory: Option<Box<lbfgs::Memory>>,
    /// The same network without regression, where it is to be compared with.
    open: Option<Box<ErrorRegression>>,
    /// v of the samples to come.
    next_variance: Vec<f64>,
}

impl ErrorRegression {
    /// A network at its initial state, before the first sample.
    ///
    /// # Errors
    /// [`Error::Length`] for an initial state or shares of another size than the network's, and [`Error::Setting`] for
    /// an option out of its range.
    pub fn new(
        network: &Network,
        initial_state: &[f64],
        options: ErrorRegressionOptions,
        engine: &Engine,
    ) -> Result<Self> {
        let topology = &network.topology;
        let (n_y, n_c, delay) = (topology.channels(), topology.context_units(), topology.delay());
        options.check(n_y)?;
        if initial_state.len() != n_c {
            let what = "the initial state".to_owned();
            return Err(Error::Length { what, found: initial_state.len(), needed: n_c });
        }
        let set = engine.instruction_set();
        let mut packed = Packed::new(topology, set);
        packed.fill(&network.parameters);
        let features = Features::new(topology);
        let past = features.past().max(1);
        let window = options.window;
        let zeros = |count: usize| AVec::from_iter(64, std::iter::repeat_n(0.0, count));
        let n_v = packed.n_out - n_y;
        let rows = window + 2 + options.ahead;
        let moves: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
        let memory = match options.ascent {
            Ascent::Lbfgs { memory } => Some(Box::new(lbfgs::Memory::new(&moves, memory))),
            _ => None,
        };
        let open = match options.iterations > 0 && options.is_guarded() {
            true => {
                let without = ErrorRegressionOptions { iterations: 0, ahead: 0, ..options.clone() };
                Some(Box::new(Self::new(network, initial_state, without, engine)?))
            }
            false => None,
        };
        let mut regression = Self {
            internal: zeros(rows * packed.rows),
            states: zeros(rows * packed.state_stride),
            mean: zeros((delay + rows) * n_y),
            variance: zeros(rows * n_v),
            samples: zeros((window + delay + 1) * n_y),
            taken: zeros((past + rows) * n_y),
            slopes: features::Slopes::new(&features, n_y, rows),
            deltas: zeros((window + 2) * packed.delta_stride),
            mean_delta: zeros((window + 1) * n_y),
            variance_delta: zeros((window + 1) * n_v),
            terms: zeros(window * n_y),
            squares: zeros(window * n_y),
            precisions: zeros(window * n_y),
            drive: zeros(packed.rows),
            drive_with_input: zeros(packed.rows),
            outputs: zeros(packed.rows.max(packed.to_input.rows())),
            moves,
            first: vec![0.0; n_c],
            second: vec![0.0; n_c],
            tail_before: vec![0.0; n_c],
            tail_best: vec![0.0; n_c],
            memory,
            open,
            next_variance: vec![0.0; (1 + options.ahead) * n_v],
            observed: 0,
            length: 0,
            delay,
            options,
            set,
            features,
            past,
            packed,
        };
        regression.internal[..n_c].copy_from_slice(initial_state);
        set.run(Enter(&mut regression));
        Ok(regression)
    }

    /// Takes in one sample of N_O values (NaN is a missing one), regresses over the window, and predicts the next sample. `go_on` is asked
    /// before each iteration; it lets a control loop keep its deadline. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Length`] for a sample of another size, [`Error::Setting`] for an infinite one; neither is taken in.
    pub fn observe(&mut self, sample: &[f64], go_on: &mut dyn FnMut() -> bool) -> Result<Regression> {
        let n_y = self.packed.n_y;
        if sample.len() != n_y {
            return Err(Error::Length { what: "the sample".to_owned(), found: sample.len(), needed: n_y });
        }
        if let Some(value) = sample.iter().find(|value| value.is_infinite()) {
            let (what, needed) = ("a value of the sample", "a finite number, or NaN for a missing one");
            return Err(Error::Setting { what, found: value.to_string(), needed });
        }
        let mut done = Regression::default();
        if let Some(open) = &mut self.open {
            open.observe(sample, &mut || false)?;
        }
        if self.observed >= self.delay {
            // The step that predicted this sample joins the window.
            if self.length == self.options.window {
                self.slide();
            } else {
                self.length += 1;
            }
        }
        // Sample k is the input of step k, which leads to row k + 1 as long as nothing has slid away.
        let row = self.length + (self.delay - 1).min(self.observed);
        self.samples[row * n_y..(row + 1) * n_y].copy_from_slice(sample);
        self.observed += 1;
        if self.observed > self.delay {
            let set = self.set;
            done = set.run(Regress { regression: self, go_on });
        }
        if self.observed >= self.delay {
            let set = self.set;
            set.run(Predict(self));
        }
        Ok(done)
    }

    /// Steps in the window.
    #[must_use]
    pub fn window(&self) -> usize {
        self.length
    }

    /// y of the sample to come, N_O values; 0 before xi samples are there.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        self.mean_of(self.length + 1)
    }

    /// v of the sample to come, N_O values; empty without variance units.
    #[must_use]
    pub fn variance(&self) -> &[f64] {
        &self.next_variance[..self.next_variance.len() / (1 + self.options.ahead)]
    }

    /// y of the sample `steps` after the next one, of 0 to [`ErrorRegressionOptions::ahead`]; from the options' xi on it is
    /// predicted from predictions alone. None further ahead.
    #[must_use]
    pub fn forecast_mean(&self, steps: usize) -> Option<&[f64]> {
        (steps <= self.options.ahead).then(|| self.mean_of(self.length + 1 + steps))
    }

    /// v of that sample; empty without variance units.
    #[must_use]
    pub fn forecast_variance(&self, steps: usize) -> Option<&[f64]> {
        let n_v = self.next_variance.len() / (1 + self.options.ahead);
        (steps <= self.options.ahead).then(|| &self.next_variance[steps * n_v..(steps + 1) * n_v])
    }

    /// The context that predicts it, N_C values.
    #[must_use]
    pub fn forecast_context(&self, steps: usize) -> Option<&[f64]> {
        (steps <= self.options.ahead).then(|| self.context_of(self.length + 1 + steps))
    }

    /// The mean that the window now holds for its step `step` of 0 to [`ErrorRegression::window`]; the last is the
    /// sample to come. None beyond.
    #[must_use]
    pub fn smoothed_mean(&self, step: usize) -> Option<&[f64]> {
        (step <= self.length).then(|| self.mean_of(step + 1))
    }

    /// The context after step `step` of 0 to [`ErrorRegression::window`], N_C values. None beyond.
    #[must_use]
    pub fn context(&self, step: usize) -> Option<&[f64]> {
        (step <= self.length).then(|| self.context_of(step + 1))
    }

    fn context_of(&self, step: usize) -> &[f64] {
        &self.states[step * self.packed.state_stride..][..self.packed.n_c]
    }

    /// u at the window's tail, which regression moves, N_C values.
    #[must_use]
    pub fn tail(&self) -> &[f64] {
        &self.internal[..self.packed.n_c]
    }

    fn mean_of(&self, row: usize) -> &[f64] {
        &self.mean[(self.delay + row) * self.packed.n_y..][..self.packed.n_y]
    }

    /// Forgets the window's first step.
    fn slide(&mut self) {
        if let Some(memory) = &mut self.memory {
            memory.slide();
        }
        let (packed, rows) = (&self.packed, self.length + 2);
        let n_v = packed.n_out - packed.n_y;
        self.internal.copy_within(packed.rows..rows * packed.rows, 0);
        self.states.copy_within(packed.state_stride..rows * packed.state_stride, 0);
        self.mean.copy_within(packed.n_y.., 0);
        self.variance.copy_within(n_v.., 0);
        self.samples.copy_within(packed.n_y.., 0);
        self.taken.copy_within(packed.n_y.., 0);
    }

    /// The input of the step to row `row`: row `row - 1` of the samples, or what it was predicted as xi steps before.
    #[inline(always)]
    fn set_input(&mut self, row: usize, in_window: bool) {
        let (n_y, past) = (self.packed.n_y, self.past);
        // Counted from the first step ever, the step is number `step`, and its prediction was made in step - xi.
        let step = self.observed - self.delay + row - self.length;
        let known = row <= self.length + self.delay;
        let at = (past + row - 1) * n_y;
        for i in 0..n_y {
            let predicted = (step > self.delay).then(|| self.mean[row * n_y + i]);
            let sample = if known { self.samples[(row - 1) * n_y + i] } else { f64::NAN };
            self.taken[at + i] = match predicted {
                Some(predicted) if sample.is_nan() => predicted,
                Some(predicted) => {
                    let share = self.sensed_share(i, in_window);
                    share * sample + (1.0 - share) * predicted
                }
                None if !sample.is_nan() => sample,
                // Nothing was seen or said of it yet, or what was taken in last still stands.
                None if step > 1 => self.taken[at - n_y + i],
                None => 0.0,
            };
        }
        if step == 1 {
            // A sample before the first is taken to be the first one.
            for earlier in 0..past + row - 1 {
                self.taken.copy_within(at..at + n_y, earlier * n_y);
            }
        }
        let x = &mut self.states[(row - 1) * self.packed.state_stride + self.packed.rows..][..self.packed.n_x];
        self.features.inputs(|back| &self.taken[at - back * n_y..][..n_y], x);
    }

    /// The share of the sample in an input that was predicted too.
    #[inline(always)]
    fn sensed_share(&self, channel: usize, in_window: bool) -> f64 {
        if in_window { self.options.sensed_in_window[channel] } else { self.options.sensed[channel] }
    }

    /// The context's product of the step to row `row`, and with it the outputs of the row before.
    #[inline(always)]
    fn leave<S: Simd>(&mut self, simd: S, row: usize) {
        let packed = &self.packed;
        let (n_y, n_c, rows) = (packed.n_y, packed.n_c, packed.rows);
        let now = &self.states[(row - 1) * packed.state_stride..][..packed.state_stride];
        let sources = [Columns { values: now, stride: packed.state_stride }];
        let matrices = [&packed.from_context];
        let product = Product { matrices, sources, columns: 1, start: &packed.bias, ahead: &[] };
        multiply(simd, product, &mut self.drive);
        if row == 1 {
            return;
        }
        let from = n_c / ROWS * ROWS;
        tanh_rows(simd, &self.drive[from..rows], &mut self.outputs[from..rows]);
        let rho = if packed.linear_mean { &self.drive[n_c..n_c + n_y] } else { &self.outputs[n_c..n_c + n_y] };
        let mean = &mut self.mean[(self.delay + row - 1) * n_y..][..n_y];
        match self.features.has_skip() {
            false => copy_few(mean, rho),
            true => {
                let at = (self.past + row - 2) * n_y;
                self.features.guess(|back| &self.taken[at - back * n_y..][..n_y], mean);
                let own = &mut self.slopes.rho[(row - 1) * n_y..][..n_y];
                for (i, ((y, own), rho)) in mean.iter_mut().zip(own).zip(rho).enumerate() {
                    *own = *rho;
                    *y = self.features.mean(i, *y, *rho);
                }
            }
        }
        if packed.n_out > n_y {
            copy_few(&mut self.variance[(row - 1) * n_y..][..n_y], &self.drive[n_c + n_y..n_c + 2 * n_y]);
        }
    }

    /// The step to row `row`, once its context's product and its input are there (2.27).
    #[inline(always)]
    fn arrive<S: Simd>(&mut self, simd: S, row: usize) {
        let packed = &self.packed;
        let (rows, stride) = (packed.rows, packed.state_stride);
        let (before, after) = self.states.split_at_mut(row * stride);
        let x = &before[(row - 1) * stride + rows..];
        let (matrices, sources) = ([&packed.from_input], [Columns { values: x, stride }]);
        let product = Product { matrices, sources, columns: 1, start: &self.drive, ahead: &[] };
        multiply(simd, product, &mut self.drive_with_input);
        self.internal.copy_within((row - 1) * rows..row * rows, row * rows);
        advance(simd, packed, &self.drive_with_input, &mut self.internal[row * rows..], after, 1);
    }

    /// Runs the window from its tail.
    #[inline(always)]
    fn run_window<S: Simd>(&mut self, simd: S) {
        activate(simd, &self.packed, &self.internal, &mut self.states, 1);
        for row in 1..=self.length {
            self.leave(simd, row);
            self.set_input(row, true);
            self.arrive(simd, row);
        }
        self.leave(simd, self.length + 1);
    }

    /// (2.28) and its gradient at the window's outputs: d/du of the mean units, or with a skip connection d/drho.
    #[inline(always)]
    fn score<S: Simd>(&mut self, simd: S) -> (f64, f64) {
        let n_y = self.packed.n_y;
        let len = self.length * n_y;
        // The target of row r's step is xi samples after its input.
        let target = &self.samples[self.delay * n_y..][..len];
        let skip = self.features.has_skip();
        let target: &[f64] = match skip {
            false => {
                self.mean_delta[..len].copy_from_slice(&self.mean[(self.delay + 1) * n_y..][..len]);
                target
            }
            true => {
                self.mean_delta[..len].copy_from_slice(&self.slopes.rho[n_y..][..len]);
                let mean = &self.mean[(self.delay + 1) * n_y..][..len];
                let own = target.iter().zip(mean).zip(&self.slopes.rho[n_y..]).enumerate();
                for (at, (out, (k, ((target, y), rho)))) in self.slopes.target.iter_mut().zip(own).enumerate() {
                    debug_assert_eq!(at, k);
                    *out = rho + (target - y) / self.features.scale(k % n_y);
                }
                &self.slopes.target[..len]
            }
        };
        let variance: &mut [f64] = match self.variance_delta.is_empty() {
            true => &mut [],
            false => {
                self.variance_delta[..len].copy_from_slice(&self.variance[n_y..][..len]);
                &mut self.variance_delta[..len]
            }
        };
        Predictions {
            mean: &mut self.mean_delta[..len],
            variance,
            target,
            terms: &mut self.terms,
            squares: &mut self.squares,
            precisions: &mut self.precisions,
            linear: skip || self.packed.linear_mean,
        }
        .score(simd, self.packed.floor);
        let is_missing = |k: usize| self.samples[self.delay * n_y + k].is_nan();
        if (0..len).any(is_missing) {
            for k in (0..len).filter(|k| is_missing(*k)) {
                (self.mean_delta[k], self.terms[k], self.squares[k]) = (0.0, 0.0, 0.0);
                if let Some(delta) = self.variance_delta.get_mut(k) {
                    *delta = 0.0;
                }
            }
        }
        if skip {
            for k in (0..len).filter(|k| !is_missing(*k)) {
                let s = self.features.scale(k % n_y);
                self.squares[k] *= s * s;
                self.terms[k] = match self.variance_delta.is_empty() {
                    false => self.terms[k] - s.ln(),
                    true => -0.5 * self.squares[k],
                };
                if self.variance_delta.is_empty() {
                    self.mean_delta[k] *= s * s;
                }
            }
        }
        if self.options.mask.iter().any(|share| *share != 1.0) {
            let lists = [&mut self.mean_delta, &mut self.variance_delta, &mut self.terms, &mut self.squares];
            for row in lists.into_iter().flat_map(|list| list.chunks_exact_mut(n_y).take(self.length)) {
                row.iter_mut().zip(&self.options.mask).for_each(|(value, share)| *value *= share);
            }
        }
        (self.terms[..len].iter().sum(), self.squares[..len].iter().sum())
    }

    /// How many values of the window count: those that are there, on channels of a share above 0.
    fn values(&self) -> usize {
        let n_y = self.packed.n_y;
        let window = self.samples[self.delay * n_y..][..self.length * n_y].chunks_exact(n_y);
        let counts = |row: &[f64]| row.iter().zip(&self.options.mask).filter(|(x, s)| !x.is_nan() && **s > 0.0).count();
        window.map(counts).sum()
    }

    /// d ln L_reg / du of the window's tail, left in the first delta row (2.22).
    #[inline(always)]
    fn run_back<S: Simd>(&mut self, simd: S) {
        if !self.features.are_plain() {
            return self.run_back_with_features(simd);
        }
        let packed = &self.packed;
        let (n_x, n_c, stride) = (packed.n_y, packed.n_c, packed.delta_stride);
        self.deltas[self.length * stride..][..n_c].fill(0.0);
        for row in (0..=self.length).rev() {
            let outputs = &mut self.deltas[row * stride + n_c..][..packed.n_out];
            if row == 0 {
                outputs.fill(0.0);
            } else {
                copy_few(&mut outputs[..n_x], &self.mean_delta[(row - 1) * n_x..][..n_x]);
                if packed.n_out > n_x {
                    copy_few(&mut outputs[n_x..], &self.variance_delta[(row - 1) * n_x..][..n_x]);
                }
            }
            let states = &self.states[row * packed.state_stride..];
            if row == 0 {
                // Nothing lies before the tail: its gradient takes the place of the row after it.
                self.drive_with_input.copy_from_slice(&self.deltas[..packed.rows]);
                retreat(simd, packed, &self.drive_with_input, states, &mut self.deltas, 1, Pass::default());
                return;
            }
            let (before, after) = self.deltas.split_at_mut(row * stride);
            retreat(simd, packed, after, states, &mut before[(row - 1) * stride..], 1, Pass::default());
            // The row's input was predicted xi steps before, perhaps in the window.
            if row > self.delay {
                let du = &before[(row - 1) * stride..][..stride];
                let (matrices, sources) = ([&packed.to_input], [Columns { values: du, stride }]);
                let product = Product { matrices, sources, columns: 1, start: &packed.zeros, ahead: &[] };
                multiply(simd, product, &mut self.outputs);
                let made = row - self.delay;
                let y = &self.mean[(self.delay + made) * n_x..][..n_x];
                let delta = &mut self.mean_delta[(made - 1) * n_x..][..n_x];
                for i in 0..n_x {
                    let missing = self.samples[(row - 1) * n_x + i].is_nan();
                    let share = if missing { 1.0 } else { 1.0 - self.options.sensed_in_window[i] };
                    let slope = if packed.linear_mean { 1.0 } else { 1.0 - y[i] * y[i] };
                    delta[i] += slope * share * self.outputs[i];
                }
            }
        }
    }

    /// Goes on from the state of the network without regression, if its predictions made the window more likely than it is now.
    #[inline(always)]
    fn compare<S: Simd>(&mut self, simd: S, done: &mut Regression) {
        let Some(open) = &mut self.open else { return };
        let (ln_likelihood, squared_error) = open.score(simd);
        if done.passes == 0 || !ln_likelihood.is_finite() || ln_likelihood <= done.ln_likelihood[1] {
            return;
        }
        // It looks no further ahead than the next sample, so its lists are as long or shorter.
        for (own, open) in [
            (&mut self.internal, &open.internal),
            (&mut self.states, &open.states),
            (&mut self.mean, &open.mean),
            (&mut self.variance, &open.variance),
            (&mut self.taken, &open.taken),
        ] {
            own[..open.len()].copy_from_slice(open);
        }
        (done.ln_likelihood[1], done.squared_error[1], done.given_up) = (ln_likelihood, squared_error, true);
        if let Some(memory) = &mut self.memory {
            memory.forget();
        }
    }
}

/// The context of the initial state.
struct Enter<'a>(&'a mut ErrorRegression);

impl WithSimd for Enter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        activate(simd, &self.0.packed, &self.0.internal, &mut self.0.states, 1);
    }
}

/// The steps that predict the samples to come.
struct Predict<'a>(&'a mut ErrorRegression);

impl WithSimd for Predict<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let regression = self.0;
        let first = regression.length + 1;
        for row in first..=first + regression.options.ahead {
            regression.leave(simd, row);
            regression.set_input(row, false);
            regression.arrive(simd, row);
        }
        regression.leave(simd, first + regression.options.ahead + 1);
        let n_y = regression.packed.n_y;
        if !regression.next_variance.is_empty() {
            let len = regression.next_variance.len();
            regression.next_variance.copy_from_slice(&regression.variance[first * n_y..][..len]);
            exp_slice(simd, 1.0, &mut regression.next_variance);
            let features = &regression.features;
            regression.next_variance.iter_mut().enumerate().for_each(|(k, v)| *v = features.variance(k % n_y, *v));
        }
    }
}

/// The iterations over one window.
struct Regress<'a> {
    regression: &'a mut ErrorRegression,
    go_on: &'a mut dyn FnMut() -> bool,
}

impl WithSimd for Regress<'_> {
    type Output = Regression;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Regression {
        let Self { regression, go_on } = self;
        let (steps, values) = (regression.length, regression.values());
        let mut done = Regression { steps, values, ..Regression::default() };
        match regression.memory.take() {
            Some(mut memory) => {
                regression.climb(simd, &mut memory, go_on, &mut done);
                regression.memory = Some(memory);
            }
            None => regression.step_by_step(simd, go_on, &mut done),
        }
        regression.compare(simd, &mut done);
        done
    }
}

#[cfg(test)]
#[path = "error_regression_tests.rs"]
mod tests;
