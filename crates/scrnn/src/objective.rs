//! The objective and its gradient over a whole set: blocks in parallel, one ordered sum.
//!
//! ```text
//! ln L_out(theta) and d ln L_out / d theta_share, d ln L_out / d u_0     (2.11), (2.20)-(2.22)
//! ```
//!
//! Blocks are worked on by any thread; their gradients are added in the order of the blocks, so the bits do not depend
//! on the number of threads. After the first call nothing is allocated.

use std::sync::{Mutex, PoisonError};

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use crate::batch::{self, Block, Item};
use crate::engine::{Engine, Run};
use crate::forward;
use crate::likelihood::Predictions;
use crate::packed::Packed;
use crate::parameters::{Gradients, Parameters};
use crate::topology::Topology;
use crate::trajectory::{Cut, Trajectory};

/// How much of the gradient is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Want {
    /// Likelihood and error only.
    Score,
    /// And the gradient of the initial states.
    InitialStates,
    /// And the gradient of all shared parameters.
    Everything,
}

/// A block and what came out of it.
#[derive(Debug)]
struct Job {
    block: Block,
    cut: Cut,
    gradient: AVec<f64>,
    /// [column][unit].
    initial: Vec<f64>,
    /// [column][channel].
    ln_likelihood: Vec<f64>,
    squared_error: Vec<f64>,
}

/// Evaluates the objective again and again on the same sequences.
#[derive(Debug)]
pub(crate) struct Objective {
    packed: Packed,
    floor: f64,
    engine: Engine,
    jobs: Vec<Job>,
    idle: Mutex<Vec<Trajectory>>,
    sum: AVec<f64>,
    /// d ln L_out / d theta_share of the last call.
    pub gradients: Gradients,
    /// d ln L_out / d u_0 of the last call, [item][unit]; 0 for units whose initial state is not learned.
    pub initial: Vec<f64>,
    /// ln L_out of each item; -E where there is no variance.
    pub ln_likelihood: Vec<f64>,
    /// Sum over steps and channels of squared errors, of each item.
    pub squared_error: Vec<f64>,
    learns: Vec<bool>,
}

impl Objective {
    /// Takes over the items; `recompute` trades a second forward pass for memory that grows with the square root of
    /// the length.
    pub fn new(topology: &Topology, items: &[Item<'_>], recompute: bool, engine: &Engine) -> Self {
        let packed = Packed::new(topology, engine.instruction_set());
        let jobs = batch::blocks(topology, items)
            .into_iter()
            .map(|block| Job {
                cut: Cut::new(&packed, &block, recompute),
                gradient: AVec::new(64),
                initial: vec![0.0; block.columns() * packed.n_c],
                ln_likelihood: vec![0.0; block.columns() * packed.n_x],
                squared_error: vec![0.0; block.columns() * packed.n_x],
                block,
            })
            .collect();
        Self {
            floor: topology.variance_floor(),
            jobs,
            engine: engine.clone(),
            idle: Mutex::new(Vec::new()),
            sum: AVec::new(64),
            gradients: Parameters::zeros(topology),
            initial: vec![0.0; items.len() * packed.n_c],
            ln_likelihood: vec![0.0; items.len()],
            squared_error: vec![0.0; items.len()],
            learns: topology.per_unit(|group| group.learns_initial_state).collect(),
            packed,
        }
    }

    /// Takes over weights.
    pub fn set_parameters(&mut self, parameters: &Parameters) {
        self.packed.fill(parameters);
    }

    /// Evaluates at `initial`, [item][unit].
    pub fn evaluate(&mut self, initial: &[f64], want: Want) {
        let engine = &self.engine;
        let (packed, floor, idle) = (&self.packed, self.floor, &self.idle);
        engine.for_each(&mut self.jobs, |job| {
            let lock = || idle.lock().unwrap_or_else(PoisonError::into_inner);
            let mut trajectory = lock().pop().unwrap_or_else(Trajectory::new);
            trajectory.fit(packed, &job.block, job.cut);
            if want == Want::Everything {
                job.gradient.resize(packed.gradient_len(), 0.0);
                job.gradient.fill(0.0);
            }
            forward::start(packed, &job.block, initial, &mut trajectory);
            engine.instruction_set().run(Evaluate { packed, floor, job, trajectory: &mut trajectory, want });
            lock().push(trajectory);
        });
        self.collect(want);
    }

    fn collect(&mut self, want: Want) {
        let (n_c, n_x) = (self.packed.n_c, self.packed.n_x);
        for job in &self.jobs {
            for (column, &item) in job.block.items.iter().enumerate() {
                let own = column * n_x..(column + 1) * n_x;
                self.ln_likelihood[item] = job.ln_likelihood[own.clone()].iter().sum();
                self.squared_error[item] = job.squared_error[own].iter().sum();
                if want != Want::Score {
                    let out = &mut self.initial[item * n_c..(item + 1) * n_c];
                    let own = &job.initial[column * n_c..(column + 1) * n_c];
                    for ((out, own), &learns) in out.iter_mut().zip(own).zip(&self.learns) {
                        *out = if learns { *own } else { 0.0 };
                    }
                }
            }
        }
        if want == Want::Everything {
            self.sum.resize(self.packed.gradient_len(), 0.0);
            let (first, others) = self.jobs.split_first().expect("a set has at least one block");
            self.sum.copy_from_slice(&first.gradient);
            for job in others {
                for (sum, own) in self.sum.iter_mut().zip(job.gradient.iter()) {
                    *sum += own;
                }
            }
            self.packed.unpack_gradient(&self.sum, &mut self.gradients);
        }
    }
}

/// One block, forward and back.
struct Evaluate<'a> {
    packed: &'a Packed,
    floor: f64,
    job: &'a mut Job,
    trajectory: &'a mut Trajectory,
    want: Want,
}

/// The segments of a span.
fn segments(cut: Cut, span: &std::ops::Range<usize>) -> impl DoubleEndedIterator<Item = std::ops::Range<usize>> {
    let (start, end) = (span.start, span.end);
    let count = (end - start).div_ceil(cut.segment);
    (0..count).map(move |i| start + i * cut.segment..(start + (i + 1) * cut.segment).min(end))
}

impl WithSimd for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { packed, floor, job, trajectory, want } = self;
        let cut = job.cut;
        let n = job.block.columns();
        job.ln_likelihood.fill(0.0);
        job.squared_error.fill(0.0);

        for index in 0..cut.spans() {
            let span = cut.span_range(index);
            if cut.spans() > 1 {
                let kept = &mut trajectory.span_starts[index * n * packed.rows..(index + 1) * n * packed.rows];
                kept.copy_from_slice(&trajectory.internal[..n * packed.rows]);
            }
            forward::enter_span(simd, packed, &job.block, span.clone(), trajectory);
            for segment in segments(cut, &span) {
                forward::run(simd, packed, &job.block, segment.clone(), span.start, true, trajectory);
                score(simd, packed, floor, job, segment, trajectory);
            }
        }
        // A state that is no longer finite stays so: it must not hide behind the bounds of tanh.
        for (column, u) in trajectory.internal.chunks_exact(packed.rows).enumerate().take(n) {
            if !u[..packed.n_c].iter().all(|u| u.is_finite()) {
                job.ln_likelihood[column * packed.n_x] = f64::NAN;
            }
        }
        if want == Want::Score {
            return;
        }

        let row = n * packed.delta_stride;
        for index in (0..cut.spans()).rev() {
            let span = cut.span_range(index);
            if index + 1 < cut.spans() {
                let kept = &trajectory.span_starts[index * n * packed.rows..(index + 1) * n * packed.rows];
                trajectory.internal[..n * packed.rows].copy_from_slice(kept);
                forward::enter_span(simd, packed, &job.block, span.clone(), trajectory);
                forward::run(simd, packed, &job.block, span.clone(), span.start, false, trajectory);
            }
            for segment in segments(cut, &span).rev() {
                if segment.end < cut.products {
                    // d/du of the later segment's start is this one's end.
                    trajectory.deltas.copy_within(..row, segment.len() * row);
                }
                crate::backward::run(simd, packed, &job.block, segment.clone(), span.start, trajectory);
                if want == Want::Everything {
                    let gradient = &mut job.gradient;
                    crate::backward::gather(simd, packed, &job.block, segment, span.start, trajectory, gradient);
                }
            }
        }
        let starts = trajectory.deltas.chunks_exact(packed.delta_stride);
        for (out, start) in job.initial.chunks_exact_mut(packed.n_c).zip(starts) {
            out.copy_from_slice(&start[..packed.n_c]);
        }
    }
}

/// Scores the predictions of a segment and sums them up for each column.
#[inline(always)]
fn score<S: Simd>(
    simd: S,
    packed: &Packed,
    floor: f64,
    job: &mut Job,
    segment: std::ops::Range<usize>,
    trajectory: &mut Trajectory,
) {
    let n = job.block.columns();
    let steps = segment.start.max(1) - 1..segment.end - 1;
    if job.block.active(segment.end - 1) == n {
        score_steps(simd, packed, floor, job, steps, n, trajectory);
    } else {
        for step in steps {
            let active = job.block.active(step + 1);
            score_steps(simd, packed, floor, job, step..step + 1, active, trajectory);
        }
    }
}

/// Scores the first `columns` columns of a range of steps; of several steps, all columns.
#[inline(always)]
fn score_steps<S: Simd>(
    simd: S,
    packed: &Packed,
    floor: f64,
    job: &mut Job,
    steps: std::ops::Range<usize>,
    columns: usize,
    trajectory: &mut Trajectory,
) {
    let (n, n_x) = (job.block.columns(), packed.n_x);
    let from = steps.start * n * n_x;
    let len = steps.len() * columns * n_x;
    let target = from + job.block.delay * n * n_x;
    let variance: &mut [f64] = if packed.n_out > n_x { &mut trajectory.variance[from..from + len] } else { &mut [] };
    Predictions {
        mean: &mut trajectory.mean[from..from + len],
        variance,
        target: &job.block.samples[target..target + len],
        terms: &mut trajectory.terms,
        squares: &mut trajectory.squares,
        precisions: &mut trajectory.precisions,
    }
    .score(simd, floor);
    let width = columns * n_x;
    add_rows(&mut job.ln_likelihood[..width], &trajectory.terms[..len]);
    add_rows(&mut job.squared_error[..width], &trajectory.squares[..len]);
}

/// `sums[k] += rows[0][k] + rows[1][k] + ...`, row after row.
#[inline(always)]
fn add_rows(sums: &mut [f64], rows: &[f64]) {
    for row in rows.chunks_exact(sums.len()) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
}

#[cfg(test)]
#[path = "objective_tests.rs"]
mod tests;
