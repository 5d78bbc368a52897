//! Runs that take in what they predicted themselves: where values are missing, and in the closed loop. Forward and back, step by step.
//!
//! ```text
//! x_t = y-hat_t                       where it is there and the run is taught
//!       y_t                           where it is missing
//!       y_t + sqrt(v_t) e_t           in a copy that runs closed
//! gx_t = d ln L / dx_t,  gd_t = d ln L / dd_t,  gm_t and gv_t = d ln L / d of the prediction made in step t
//! gm_t += gx_{t+xi},   gv_t += gx_{t+xi} e / (2 sqrt(v_t))           where x_{t+xi} was made of it
//! gx_t += gd_t - gd_{t+1} + gm_t,   gd_{t-l} += A_l' gm_t            (crate::features)
//! ```
//!
//! A run that is released has one column up to there and K columns from there on, which begin as copies of the first. Columns lie in
//! the order in which they begin, so that at any step those that run are the first ones. A column that has ended runs on, on zeros,
//! and counts for nothing.

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};
use rand_distr::{Distribution, StandardNormal};

use super::{ClosedLoopTerm, Run, Want};
use crate::backward::{Pass, retreat};
use crate::dataset::Sequence;
use crate::features::Features;
use crate::forward::{activate, advance};
use crate::kernels::activation::{exp_slice, ln_slice, tanh_rows};
use crate::kernels::outer::{Rows, Taken, accumulate};
use crate::kernels::padded;
use crate::kernels::panels::{Columns, Product, multiply};
use crate::likelihood::LN_2PI;
use crate::packed::Packed;
use crate::streams::{Purpose, stream};

/// Columns that a block is filled up to.
const COLUMNS: usize = 24;
/// Runs of a block that have no copies.
const RUNS: usize = 6;

/// What an input is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    /// A sample, or nothing that can be changed.
    Given,
    /// The mean that was predicted for it.
    Mean,
    /// The same with noise.
    Drawn,
}

/// One column of a block.
#[derive(Debug, Clone, Copy)]
struct Column {
    /// Index into the list of runs.
    run: usize,
    sequence: usize,
    /// T.
    steps: usize,
    /// The first step that is its own.
    start: usize,
    /// The column that it was copied from; its own number if from none.
    from: usize,
}

/// What all columns hold of every step, [step][column][channel].
#[derive(Debug, Default)]
struct Record {
    x: Vec<f64>,
    origin: Vec<u8>,
    noise: Vec<f64>,
    rho: Vec<f64>,
    exp_u: Vec<f64>,
    mean: Vec<f64>,
    variance: Vec<f64>,
    gx: Vec<f64>,
    gd: Vec<f64>,
    gm: Vec<f64>,
    gv: Vec<f64>,
}

/// A block of runs and its results.
#[derive(Debug)]
pub(super) struct ClosedBlock {
    columns: Vec<Column>,
    runs: usize,
    steps: usize,
    record: Record,
    /// [product][column][state_stride] and [product][column][delta_stride]: as in a trajectory.
    states: AVec<f64>,
    deltas: AVec<f64>,
    internal: AVec<f64>,
    drive: AVec<f64>,
    outputs: AVec<f64>,
    scratch: [Vec<f64>; 2],
    pub gradient: AVec<f64>,
    /// [run of the block][unit].
    pub initial: Vec<f64>,
    pub ln_likelihood: Vec<f64>,
    pub squared_error: Vec<f64>,
}

/// Splits runs into blocks: a number that hangs on the runs alone. Gives each block its runs, as indices.
pub(super) fn split(runs: &[Run], copies: usize, order: &mut Vec<usize>, mut take: impl FnMut(usize, &[usize])) {
    order.clear();
    order.extend(0..runs.len());
    order.sort_unstable_by_key(|&run| (runs[run].release.is_none(), std::cmp::Reverse(runs[run].steps), run));
    let released = runs.iter().filter(|run| run.release.is_some()).count();
    let (first, second) = order.split_at(released);
    let mut index = 0;
    for (part, width) in [(first, (COLUMNS / (1 + copies)).max(1)), (second, RUNS)] {
        if part.is_empty() {
            continue;
        }
        let count = part.len().div_ceil(width);
        let count = if count == 1 { 1 } else { count.next_multiple_of(2).min(part.len()) };
        let mut rest = part;
        for block in 0..count {
            let (own, others) = rest.split_at(part.len() / count + usize::from(block < part.len() % count));
            rest = others;
            take(index, own);
            index += 1;
        }
    }
}

impl ClosedBlock {
    pub fn new() -> Self {
        let empty = || AVec::new(64);
        Self {
            columns: Vec::new(),
            runs: 0,
            steps: 0,
            record: Record::default(),
            states: empty(),
            deltas: empty(),
            internal: empty(),
            drive: empty(),
            outputs: empty(),
            scratch: [Vec::new(), Vec::new()],
            gradient: empty(),
            initial: Vec::new(),
            ln_likelihood: Vec::new(),
            squared_error: Vec::new(),
        }
    }

    /// Which runs of the list the results are of, in their order.
    pub fn runs(&self) -> impl Iterator<Item = usize> {
        self.columns[..self.runs].iter().map(|column| column.run)
    }

    /// Takes over the runs `own` of `runs`, and makes room.
    pub fn fill(&mut self, packed: &Packed, runs: &[Run], own: &[usize], copies: usize) {
        let n = packed.n_y;
        self.columns.clear();
        let column = |(from, &run): (usize, &usize)| {
            let Run { sequence, steps, .. } = runs[run];
            Column { run, sequence, steps, start: 0, from }
        };
        self.columns.extend(own.iter().enumerate().map(column));
        self.runs = own.len();
        self.steps = own.iter().map(|&run| runs[run].steps).max().unwrap_or(0);
        for (from, &run) in own.iter().enumerate() {
            // A run that ends before it would be released is taught throughout.
            if let Some(release) = runs[run].release.filter(|release| release.step < runs[run].steps) {
                let copy = Column { start: release.step.max(packed.delay), from, ..self.columns[from] };
                self.columns.extend(std::iter::repeat_n(copy, copies));
            }
        }
        self.columns[self.runs..].sort_by_key(|column| (column.start, column.from));
        let count = self.columns.len();
        let Record { x, origin, noise, rho, exp_u, mean, variance, gx, gd, gm, gv } = &mut self.record;
        let values = self.steps * count * n;
        // What is read of these was written in the same evaluation.
        for list in [x, noise, rho, exp_u, mean, variance] {
            list.resize(values, 0.0);
        }
        for list in [gx, gd, gm, gv] {
            list.clear();
            list.resize(values, 0.0);
        }
        origin.clear();
        origin.resize(values, Origin::Given as u8);
        // The same holds for states and deltas, megabytes that would take longer to clear than to use, but for the ends below.
        let (rows, n_c, n_out) = (packed.rows, packed.n_c, packed.n_out);
        let (states, deltas) = (packed.state_stride, packed.delta_stride);
        self.states.resize(((self.steps + 2) * count + 1) * states, 0.0);
        self.deltas.resize(((self.steps + 2) * count + 1) * deltas, 0.0);
        for column in 0..count {
            let last = self.steps * count + column;
            // No input comes after the last step, and nothing comes back from there; only the outputs' biases want their constant.
            self.states[last * states + rows..][..packed.n_x].fill(0.0);
            self.states[last * states + rows + packed.n_x] = 1.0;
            self.deltas[last * deltas..][..n_c].fill(0.0);
        }
        let clear = |list: &mut AVec<f64>, len: usize| {
            list.clear();
            list.resize(len, 0.0);
        };
        clear(&mut self.internal, count * rows);
        clear(&mut self.drive, count * rows.max(packed.to_input.rows()));
        clear(&mut self.outputs, count * padded(n_out).max(deltas));
        self.initial.clear();
        self.initial.resize(self.runs * packed.n_c, 0.0);
        self.ln_likelihood.clear();
        self.ln_likelihood.resize(self.runs, 0.0);
        self.squared_error.clear();
        self.squared_error.resize(self.runs, 0.0);
    }

    /// Draws the noise of the copies.
    pub fn draw(&mut self, runs: &[Run], channels: usize) {
        let (count, mut copy, mut last) = (self.columns.len(), 0, usize::MAX);
        for index in self.runs..count {
            let column = self.columns[index];
            copy = if column.from == last { copy + 1 } else { 0 };
            last = column.from;
            let seed = runs[column.run].release.map_or(0, |release| release.seed);
            let mut random = stream(seed, Purpose::ClosedLoopNoise, copy);
            for k in column.start..column.steps {
                for e in &mut self.record.noise[(k * count + index) * channels..][..channels] {
                    *e = StandardNormal.sample(&mut random);
                }
            }
        }
    }

    /// How many columns run at step `k`.
    fn running(&self, k: usize) -> usize {
        self.runs + self.columns[self.runs..].partition_point(|column| column.start <= k)
    }

    /// Where a column keeps its values of step `k`: those from before its start are of the column that it was copied from.
    fn place(&self, column: usize, k: usize) -> usize {
        let Column { start, from, .. } = self.columns[column];
        k * self.columns.len() + if k < start { from } else { column }
    }
}

/// One block, forward and back.
pub(super) struct EvaluateClosed<'a> {
    pub packed: &'a Packed,
    pub features: &'a Features,
    pub sequences: &'a [Sequence],
    pub term: ClosedLoopTerm,
    /// One of N_C values for each run of the list.
    pub starts: &'a [f64],
    pub block: &'a mut ClosedBlock,
    pub want: Want,
}

impl WithSimd for EvaluateClosed<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.run(simd);
        self.score();
        if self.want == Want::Score {
            return;
        }
        self.back(simd);
        let n_c = self.packed.n_c;
        for (run, out) in self.block.initial.chunks_exact_mut(n_c).enumerate() {
            // The first row holds d/du_1; what `back` leaves behind the last is d/du_0.
            out.copy_from_slice(&self.block.internal[run * self.packed.rows..][..n_c]);
        }
        if self.want == Want::Everything {
            self.gather(simd);
        }
    }
}

impl EvaluateClosed<'_> {
    /// All steps forward.
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S) {
        let (packed, features) = (self.packed, self.features);
        let (n, n_c, rows, stride) = (packed.n_y, packed.n_c, packed.rows, packed.state_stride);
        let count = self.block.columns.len();
        for run in 0..self.block.runs {
            let from = self.block.columns[run].run * n_c;
            self.block.internal[run * rows..][..n_c].copy_from_slice(&self.starts[from..from + n_c]);
        }
        activate(simd, packed, &self.block.internal, &mut self.block.states, self.block.runs);
        let padded_out = padded(packed.n_out);
        for k in 0..self.block.steps {
            let running = self.block.running(k);
            let before = if k == 0 { self.block.runs } else { self.block.running(k - 1) };
            for column in before..running {
                let from = self.block.columns[column].from;
                self.block.internal.copy_within(from * rows..(from + 1) * rows, column * rows);
                let at = (k * count + from) * stride;
                self.block.states.copy_within(at..at + rows, (k * count + column) * stride);
            }
            for column in 0..running {
                self.take_input(column, k);
            }
            let block = &mut *self.block;
            let (now, next) = block.states[k * count * stride..].split_at_mut(count * stride);
            let sources = [Columns { values: &now[rows..], stride }, Columns { values: now, stride }];
            let matrices = [&packed.from_input, &packed.from_context];
            let product = Product { matrices, sources, columns: running, start: &packed.bias, ahead: &[] };
            multiply(simd, product, &mut block.drive);
            advance(simd, packed, &block.drive, &mut block.internal, next, running);

            let (matrices, sources) = ([&packed.outputs], [Columns { values: next, stride }]);
            let product = Product { matrices, sources, columns: running, start: &packed.output_bias, ahead: &[] };
            multiply(simd, product, &mut block.outputs);
            for column in 0..running {
                let at = (k * count + column) * n;
                let u = &mut block.outputs[column * padded_out..][..padded_out];
                if packed.n_out > n {
                    block.record.exp_u[at..at + n].copy_from_slice(&u[n..2 * n]);
                }
                if packed.linear_mean {
                    block.record.rho[at..at + n].copy_from_slice(&u[..n]);
                } else {
                    // The context's rows of this column are free here.
                    let y = &mut block.drive[column * rows..][..padded_out];
                    tanh_rows(simd, u, y);
                    block.record.rho[at..at + n].copy_from_slice(&y[..n]);
                }
            }
            let all = k * count * n..(k * count + running) * n;
            exp_slice(simd, 1.0, &mut block.record.exp_u[all]);
            for column in 0..running {
                let at = (k * count + column) * n;
                let block = &mut *self.block;
                let Column { start, from, .. } = block.columns[column];
                let Record { x, mean, .. } = &mut block.record;
                let place = |step: usize| step * count + if step < start { from } else { column };
                let mean = &mut mean[at..at + n];
                features.guess(|back| &x[place(k.saturating_sub(back)) * n..][..n], mean);
                for i in 0..n {
                    let guess = block.record.mean[at + i];
                    block.record.mean[at + i] = features.mean(i, guess, block.record.rho[at + i]);
                    block.record.variance[at + i] = features.variance(i, block.record.exp_u[at + i]);
                }
            }
        }
    }

    /// The input of a column's step: its sample and what stands in for it, and the features of both.
    #[inline(always)]
    fn take_input(&mut self, column: usize, k: usize) {
        let packed = self.packed;
        let (n, count) = (packed.n_y, self.block.columns.len());
        let Column { sequence, steps, start, from, .. } = self.block.columns[column];
        let at = (k * count + column) * n;
        let state = (k * count + column) * packed.state_stride + packed.rows;
        self.block.states[state + packed.n_x] = 1.0;
        if k >= steps {
            // It has ended.
            self.block.states[state..state + packed.n_x].fill(0.0);
            self.block.record.x[at..at + n].fill(0.0);
            return;
        }
        let is_copy = column != from && k >= start;
        let made = k.checked_sub(packed.delay).map(|made| self.block.place(column, made) * n);
        for i in 0..n {
            let sample = self.sequences[sequence].values()[k * n + i];
            let record = &mut self.block.record;
            let (x, origin) = match made {
                Some(made) if is_copy => {
                    let e = record.noise[at + i];
                    let spread = if packed.n_out > n { record.variance[made + i].sqrt() * e } else { 0.0 };
                    (record.mean[made + i] + spread, Origin::Drawn)
                }
                _ if !sample.is_nan() => (sample, Origin::Given),
                Some(made) => (record.mean[made + i], Origin::Mean),
                None if k > 0 => (record.x[at - count * n + i], Origin::Given),
                None => (0.0, Origin::Given),
            };
            record.x[at + i] = x;
            record.origin[at + i] = origin as u8;
        }
        let ClosedBlock { record, columns, states, .. } = &mut *self.block;
        let place = |step: usize| step * count + if step < columns[column].start { from } else { column };
        let input = &mut states[state..state + packed.n_x];
        self.features.inputs(|back| &record.x[place(k.saturating_sub(back)) * n..][..n], input);
    }

    /// ln L of every run, and its gradient by the predictions.
    #[inline(always)]
    fn score(&mut self) {
        let packed = self.packed;
        let (n, delay, has_variance) = (packed.n_y, packed.delay, packed.n_out > packed.n_y);
        let copies = self.term.copies;
        let block = &mut *self.block;
        let count = block.columns.len();
        for run in 0..block.runs {
            let Column { sequence, steps, .. } = block.columns[run];
            let first = block.columns.iter().skip(block.runs).position(|copy| copy.from == run);
            let first = first.map(|first| first + block.runs);
            let released = first.map_or(steps, |first| block.columns[first].start);
            let targets = &self.sequences[sequence].values()[delay * n..(delay + steps) * n];
            let [variances, logs] = &mut block.scratch;
            let record = &mut block.record;
            let mut sum = 0.0;
            variances.clear();
            for (k, target) in targets.chunks_exact(n).enumerate() {
                for (i, target) in target.iter().enumerate().filter(|(_, target)| !target.is_nan()) {
                    let own = |column: usize| (k * count + column) * n + i;
                    let (ks, weight) = match first {
                        Some(first) if k >= released => (first..first + copies, self.term.weight),
                        _ => (run..run + 1, 1.0),
                    };
                    let many = ks.len() as f64;
                    let mean = ks.clone().map(|column| record.mean[own(column)]).sum::<f64>() / many;
                    let e = target - mean;
                    block.squared_error[run] += e * e;
                    if !has_variance {
                        sum -= 0.5 * weight * (e * e);
                        ks.for_each(|column| record.gm[own(column)] = weight * e / many);
                        continue;
                    }
                    let within = ks.clone().map(|column| record.variance[own(column)]).sum::<f64>() / many;
                    let between = match ks.len() {
                        1 => 0.0,
                        _ => {
                            ks.clone().map(|column| (record.mean[own(column)] - mean).powi(2)).sum::<f64>()
                                / (many - 1.0)
                        }
                    };
                    let variance = within + between;
                    let (a, b) = (e / variance, 0.5 * (e * e / variance - 1.0) / variance);
                    for column in ks {
                        let at = own(column);
                        let apart = if many > 1.0 { 2.0 * b * (record.mean[at] - mean) / (many - 1.0) } else { 0.0 };
                        record.gm[at] = weight * (a / many + apart);
                        record.gv[at] = weight * b / many;
                    }
                    variances.push(variance);
                    // ln V follows for all at once.
                    sum -= 0.5 * weight * (LN_2PI + e * e / variance);
                }
                if k + 1 == released || k + 1 == steps {
                    logs.resize(variances.len(), 0.0);
                    ln_slice(variances, logs);
                    let weight = if k < released { 1.0 } else { self.term.weight };
                    sum -= 0.5 * weight * logs.iter().sum::<f64>();
                    variances.clear();
                    logs.clear();
                }
            }
            // A state that is no longer finite stays so: it must not hide behind the bounds of tanh.
            let columns = std::iter::once(run).chain(first.into_iter().flat_map(|first| first..first + copies));
            let mut states = columns.map(|column| &block.internal[column * packed.rows..][..packed.n_c]);
            let finite = states.all(|u| u.iter().all(|u| u.is_finite()));
            block.ln_likelihood[run] = if finite { sum } else { f64::NAN };
        }
    }

    /// All steps back; leaves d/du_0 of the runs in the internal states.
    #[inline(always)]
    fn back<S: Simd>(&mut self, simd: S) {
        let (packed, features) = (self.packed, self.features);
        let (n, n_c, rows) = (packed.n_y, packed.n_c, packed.rows);
        let (stride, inputs) = (packed.delta_stride, packed.to_input.rows());
        let block = &mut *self.block;
        let count = block.columns.len();
        for k in (0..=block.steps).rev() {
            // Row k holds d/du_{k+1} of the contexts, and d/du of the outputs that were made from c_k, in step k - 1.
            let running = if k == block.steps { block.running(k - 1) } else { block.running(k) };
            if k < block.steps {
                let du = &block.deltas[k * count * stride..][..count * stride];
                let (matrices, sources) = ([&packed.to_input], [Columns { values: du, stride }]);
                let product = Product { matrices, sources, columns: running, start: &packed.zeros, ahead: &[] };
                multiply(simd, product, &mut block.drive);
                for column in 0..running {
                    let at = (k * count + column) * n;
                    let by_input = &block.drive[column * inputs..][..packed.n_x];
                    let earlier = k.checked_sub(1).map(|earlier| block.place(column, earlier) * n);
                    let made = k.checked_sub(packed.delay).map(|made| block.place(column, made) * n);
                    let record = &mut block.record;
                    for i in 0..n {
                        if let Some(rate) = features.velocity().get(i) {
                            record.gd[at + i] += rate * by_input[n + i];
                        }
                        // d_0 is 0, whatever x_0 is.
                        if let Some(earlier) = earlier {
                            record.gx[at + i] += record.gd[at + i];
                            record.gx[earlier + i] -= record.gd[at + i];
                        }
                        let gx = record.gx[at + i] + by_input[i];
                        let Some(made) = made.map(|made| made + i) else { continue };
                        if record.origin[at + i] == Origin::Given as u8 {
                            continue;
                        }
                        record.gm[made] += gx;
                        if record.origin[at + i] == Origin::Drawn as u8 && packed.n_out > n {
                            record.gv[made] += gx * record.noise[at + i] / (2.0 * record.variance[made].sqrt());
                        }
                    }
                }
            }
            // Columns that have not begun by step k - 1 have no prediction there.
            let before = if k == 0 { 0 } else { block.running(k - 1) };
            for column in 0..before {
                let at = ((k - 1) * count + column) * n;
                let Record { gx, gd, gm, gv, rho, exp_u, .. } = &mut block.record;
                if features.has_skip() {
                    for i in at..at + n {
                        gx[i] += gm[i];
                    }
                    let columns = &block.columns;
                    let place = |step: usize| {
                        step * count + if step < columns[column].start { columns[column].from } else { column }
                    };
                    for lag in (0..features.lags()).take_while(|lag| *lag < k) {
                        let own = place(k - 1 - lag) * n;
                        features.back(lag, &gm[at..at + n], &mut gd[own..own + n]);
                    }
                }
                let outputs = &mut block.deltas[(k * count + column) * stride + n_c..][..packed.n_out];
                for i in 0..n {
                    let slope = if packed.linear_mean { 1.0 } else { 1.0 - rho[at + i] * rho[at + i] };
                    let s = features.scale(i);
                    outputs[i] = s * slope * gm[at + i];
                    if packed.n_out > n {
                        outputs[n + i] = s * s * exp_u[at + i] * gv[at + i];
                    }
                }
            }
            // Of what begins here no output was made before, nor of c_0.
            for column in before..running {
                block.deltas[(k * count + column) * stride + n_c..][..packed.n_out].fill(0.0);
            }
            let (earlier, after) = block.deltas.split_at_mut(k * count * stride);
            let states = &block.states[k * count * packed.state_stride..];
            // d/du_k. That of columns which were there before goes into the row before; its outputs are written after it.
            if k > 0 {
                let to = &mut earlier[(k - 1) * count * stride..];
                retreat(simd, packed, after, states, to, before, Pass::default());
            }
            if before == running {
                continue;
            }
            // What begins here was a copy of its run, whose share it adds to; and the runs began with u_0.
            let (first, width) = (before * stride, running - before);
            let states = &states[before * packed.state_stride..];
            retreat(simd, packed, &after[first..], states, &mut block.outputs, width, Pass::default());
            for (column, own) in (before..running).zip(block.outputs.chunks_exact(stride)) {
                match k {
                    0 => block.internal[column * rows..][..n_c].copy_from_slice(&own[..n_c]),
                    _ => {
                        let to = ((k - 1) * count + block.columns[column].from) * stride;
                        earlier[to..to + n_c].iter_mut().zip(own).for_each(|(to, own)| *to += own);
                    }
                }
            }
        }
    }

    /// The weights' gradient: all outer products.
    #[inline(always)]
    fn gather<S: Simd>(&mut self, simd: S) {
        let packed = self.packed;
        let block = &mut *self.block;
        let count = block.columns.len();
        block.gradient.clear();
        block.gradient.resize(packed.gradient_len(), 0.0);
        let (context, input) = block.gradient.split_at_mut(packed.gradient_split());
        let mut first = 0;
        let running = |k: usize| {
            let k = k.min(block.steps.saturating_sub(1));
            block.runs + block.columns[block.runs..].partition_point(|column| column.start <= k)
        };
        while first <= block.steps {
            let width = running(first);
            let end = (first..=block.steps).find(|k| running(*k) != width).unwrap_or(block.steps + 1);
            let taken = match width == count {
                true => Taken::from((end - first) * count),
                false => Taken { groups: end - first, width, period: count },
            };
            let deltas =
                Rows { values: &block.deltas[first * count * packed.delta_stride..], stride: packed.delta_stride };
            let states =
                Rows { values: &block.states[first * count * packed.state_stride..], stride: packed.state_stride };
            accumulate(simd, deltas, states, taken, packed.rows, (0, packed.n_c), context);
            let inputs = (packed.rows, packed.rows + packed.n_x + 1);
            accumulate(simd, deltas, states, taken, packed.rows, inputs, input);
            first = end;
        }
    }
}
