//! Runs that are taught throughout: all of their inputs are known, so that whole segments are computed at once.
//!
//! Written for both [elements](crate::kernels::element). In float32, states, weights, products, and the gradient of one segment are
//! float32; the likelihood, and the sums of gradients over segments and blocks, are float64.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::{Evaluation, Run, Want};
use crate::batch::{self, Block};
use crate::dataset::Sequence;
use crate::engine::{Engine, Run as _};
use crate::features::Features;
use crate::forward;
use crate::kernels::copy_few;
use crate::kernels::element::Element;
use crate::likelihood::Predictions;
use crate::packed::Packed;
use crate::topology::Topology;
use crate::trajectory::{Cut, Trajectory};

/// What all evaluations have in common.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub engine: &'a Engine,
    pub topology: &'a Topology,
    pub features: &'a Features,
    /// sum ln s: what the likelihood of scaled targets differs by.
    pub ln_scale: f64,
    pub learns: &'a [bool],
    pub inputs: &'a [Sequence],
    pub targets: &'a [Sequence],
    pub recompute: bool,
}

/// A block and its results.
#[derive(Debug)]
struct Job<E> {
    block: Block,
    cut: Cut,
    gradient: AVec<f64>,
    /// The gradient of one segment, where products are not float64.
    segment: AVec<E>,
    /// [column][unit].
    initial: Vec<f64>,
    /// [column][channel].
    ln_likelihood: Vec<f64>,
    squared_error: Vec<f64>,
}

impl<E: Element> Job<E> {
    fn new() -> Self {
        Self {
            block: Block::default(),
            cut: Cut::default(),
            gradient: AVec::new(64),
            segment: AVec::new(64),
            initial: Vec::new(),
            ln_likelihood: Vec::new(),
            squared_error: Vec::new(),
        }
    }

    /// Takes over the columns `own` of `runs`.
    fn fill(&mut self, packed: &Packed<E>, runs: &[Run], own: &[usize], recompute: bool) {
        self.block.fill(runs, own);
        self.cut = Cut::new(packed, &self.block, recompute);
        self.initial.resize(own.len() * packed.n_c, 0.0);
        self.ln_likelihood.resize(own.len() * packed.n_y, 0.0);
        self.squared_error.resize(own.len() * packed.n_y, 0.0);
    }
}

/// The weights of one element, and the memory for the largest list of runs so far.
#[derive(Debug)]
pub(super) struct Taught<E: Element> {
    pub packed: Packed<E>,
    /// The runs that the first `blocks` jobs are made for.
    runs: Vec<Run>,
    jobs: Vec<Job<E>>,
    blocks: usize,
    order: Vec<usize>,
    /// One for each block that can be worked on at the same time.
    records: Mutex<Vec<Trajectory<E>>>,
    sum: AVec<f64>,
}

impl<E: Element> Taught<E> {
    pub fn new(topology: &Topology, engine: &Engine) -> Self {
        Self {
            packed: Packed::new(topology, engine.instruction_set()),
            runs: Vec::new(),
            jobs: Vec::new(),
            blocks: 0,
            order: Vec::new(),
            records: Mutex::new(Vec::new()),
            sum: AVec::new(64),
        }
    }

    /// Evaluates runs whose inputs are all known.
    pub fn evaluate(
        &mut self,
        task: &Task<'_>,
        runs: &[Run],
        initial: &[f64],
        want: Want,
        evaluation: &mut Evaluation,
    ) {
        self.plan(task, runs, want);
        let set = task.engine.instruction_set();
        let (packed, records) = (&self.packed, &self.records);
        let (inputs, targets) = (task.inputs, task.targets);
        task.engine.for_each(&mut self.jobs[..self.blocks], |job| {
            let lock = || records.lock().unwrap_or_else(PoisonError::into_inner);
            let record = lock().pop();
            let mut trajectory = record.unwrap_or_else(|| {
                let mut record = Trajectory::new();
                record.fit(packed, &job.block, job.cut);
                record
            });
            if want == Want::Everything {
                job.gradient.fill(0.0);
            }
            forward::start(packed, &job.block, initial, &mut trajectory);
            set.run(Evaluate { packed, inputs, targets, job, trajectory: &mut trajectory, want });
            lock().push(trajectory);
        });
        self.collect(task, want, evaluation);
    }

    /// Splits the runs into blocks, and takes the memory that they need.
    fn plan(&mut self, task: &Task<'_>, runs: &[Run], want: Want) {
        if self.runs != runs {
            self.runs.clear();
            self.runs.extend_from_slice(runs);
            self.blocks = 0;
            batch::split(task.topology, runs, &mut self.order, |index, own| {
                if index == self.jobs.len() {
                    self.jobs.push(Job::new());
                }
                self.jobs[index].fill(&self.packed, runs, own, task.recompute);
                self.blocks = index + 1;
            });
            let records = self.records.get_mut().unwrap_or_else(PoisonError::into_inner);
            while records.len() < task.engine.threads().min(self.blocks) {
                records.push(Trajectory::new());
            }
            for record in records {
                self.jobs[..self.blocks].iter().for_each(|job| record.fit(&self.packed, &job.block, job.cut));
            }
        }
        if want == Want::Everything {
            let len = self.packed.gradient_len();
            self.sum.resize(len, 0.0);
            let (rows, own) = (&mut self.jobs[..self.blocks], E::own(&mut []).is_some());
            rows.iter_mut().for_each(|job| job.gradient.resize(len, 0.0));
            rows.iter_mut().filter(|_| !own).for_each(|job| job.segment.resize(len, E::ZERO));
        }
    }

    fn collect(&mut self, task: &Task<'_>, want: Want, evaluation: &mut Evaluation) {
        let (n_c, n_y) = (self.packed.n_c, self.packed.n_y);
        let jobs = &self.jobs[..self.blocks];
        for job in jobs {
            for (column, &run) in job.block.runs.iter().enumerate() {
                let own = column * n_y..(column + 1) * n_y;
                evaluation.ln_likelihood[run] = job.ln_likelihood[own.clone()].iter().sum();
                evaluation.squared_error[run] = job.squared_error[own.clone()].iter().sum();
                if task.features.has_skip() {
                    evaluation.ln_likelihood[run] -= job.block.lengths[column] as f64 * task.ln_scale;
                    let squares = job.squared_error[own].iter().enumerate();
                    evaluation.squared_error[run] = squares.map(|(i, sum)| task.features.scale(i).powi(2) * sum).sum();
                }
                if want != Want::Score {
                    let out = &mut evaluation.initial[run * n_c..(run + 1) * n_c];
                    let own = &job.initial[column * n_c..(column + 1) * n_c];
                    for ((out, own), &learns) in out.iter_mut().zip(own).zip(task.learns) {
                        *out = if learns { *own } else { 0.0 };
                    }
                }
            }
        }
        if want == Want::Everything {
            match jobs.split_first() {
                Some((first, _)) => self.sum.copy_from_slice(&first.gradient),
                None => self.sum.fill(0.0),
            }
            for job in jobs.iter().skip(1) {
                for (sum, own) in self.sum.iter_mut().zip(job.gradient.iter()) {
                    *sum += own;
                }
            }
            self.packed.unpack_gradient(&self.sum, &mut evaluation.gradients);
        }
    }
}
/// One block, forward and back.
struct Evaluate<'a, E: Element> {
    packed: &'a Packed<E>,
    inputs: &'a [Sequence],
    targets: &'a [Sequence],
    job: &'a mut Job<E>,
    trajectory: &'a mut Trajectory<E>,
    want: Want,
}

/// The segments of a span.
fn segments(cut: Cut, span: &Range<usize>) -> impl DoubleEndedIterator<Item = Range<usize>> {
    let (start, end) = (span.start, span.end);
    let count = (end - start).div_ceil(cut.segment);
    (0..count).map(move |i| start + i * cut.segment..(start + (i + 1) * cut.segment).min(end))
}

impl<E: Element> WithSimd for Evaluate<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { packed, inputs, targets, job, trajectory, want } = self;
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
            forward::enter_span(simd, packed, &job.block, inputs, span.clone(), trajectory);
            for segment in segments(cut, &span) {
                forward::run(simd, packed, &job.block, segment.clone(), span.start, true, trajectory);
                score(simd, packed, targets, job, segment, trajectory);
            }
        }
        // A state that is no longer finite stays so: it must not hide behind the bounds of tanh.
        for (column, u) in trajectory.internal.chunks_exact(packed.rows).enumerate().take(n) {
            if !u[..packed.n_c].iter().all(|u| u.is_finite()) {
                job.ln_likelihood[column * packed.n_y] = f64::NAN;
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
                forward::enter_span(simd, packed, &job.block, inputs, span.clone(), trajectory);
                forward::run(simd, packed, &job.block, span.clone(), span.start, false, trajectory);
            }
            for segment in segments(cut, &span).rev() {
                if segment.end < cut.products {
                    // d/du of the later segment's start is this one's end.
                    trajectory.deltas.copy_within(..row, segment.len() * row);
                }
                crate::backward::run(simd, packed, &job.block, segment.clone(), span.start, trajectory);
                if want == Want::Everything {
                    gather(simd, packed, job, segment, span.start, trajectory);
                }
            }
        }
        let starts = trajectory.deltas.chunks_exact(packed.delta_stride);
        for (out, start) in job.initial.chunks_exact_mut(packed.n_c).zip(starts) {
            E::give(&start[..packed.n_c], out);
        }
    }
}

/// Adds the outer products of a segment to the job's gradient.
#[inline(always)]
fn gather<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    job: &mut Job<E>,
    segment: Range<usize>,
    span_start: usize,
    trajectory: &Trajectory<E>,
) {
    let Job { block, gradient, segment: own, .. } = job;
    if let Some(gradient) = E::own(gradient) {
        return crate::backward::gather(simd, packed, block, segment, span_start, trajectory, gradient);
    }
    own.fill(E::ZERO);
    crate::backward::gather(simd, packed, block, segment, span_start, trajectory, own);
    gradient.iter_mut().zip(own.iter()).for_each(|(sum, own)| *sum += own.to_f64());
}

/// Scores the predictions of a segment and sums them up for each column.
#[inline(always)]
fn score<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    targets: &[Sequence],
    job: &mut Job<E>,
    segment: Range<usize>,
    trajectory: &mut Trajectory<E>,
) {
    let Job { block, ln_likelihood, squared_error, .. } = job;
    let (n, n_y) = (block.columns(), packed.n_y);
    let products = segment.start.max(1)..segment.end;
    let first = products.start;
    take_targets(packed, block, targets, first - 1..segment.end - 1, &mut trajectory.targets);
    for (products, active) in block.stretches(products) {
        // Columns that have ended leave gaps between the steps of the others.
        let at_once = if active == n { products.len() } else { 1 };
        for product in products.step_by(at_once) {
            let (from, target, len) = ((product - 1) * n * n_y, (product - first) * n * n_y, at_once * active * n_y);
            let variance: &mut [f64] =
                if packed.n_out > n_y { &mut trajectory.variance[from..from + len] } else { &mut [] };
            Predictions {
                mean: &mut trajectory.mean[from..from + len],
                variance,
                target: &trajectory.targets[target..target + len],
                terms: &mut trajectory.terms,
                squares: &mut trajectory.squares,
                precisions: &mut trajectory.precisions,
                linear: packed.linear_mean,
            }
            .score(simd, packed.floor);
            add_rows(&mut ln_likelihood[..active * n_y], &trajectory.terms[..len]);
            add_rows(&mut squared_error[..active * n_y], &trajectory.squares[..len]);
        }
    }
}

/// Copies the targets of a range of steps side by side, [step][column][channel]; of columns that have ended, nothing.
#[inline(always)]
fn take_targets<E: Element>(
    packed: &Packed<E>,
    block: &Block,
    sequences: &[Sequence],
    steps: Range<usize>,
    targets: &mut [f64],
) {
    let (n, n_y) = (block.columns(), packed.n_y);
    for (column, (&sequence, &length)) in block.sequences.iter().zip(&block.lengths).enumerate() {
        if length <= steps.start {
            break;
        }
        let own = steps.start + packed.delay..steps.end.min(length) + packed.delay;
        let samples = &sequences[sequence].values()[own.start * n_y..own.end * n_y];
        for (sample, targets) in samples.chunks_exact(n_y).zip(targets.chunks_exact_mut(n * n_y)) {
            copy_few(&mut targets[column * n_y..(column + 1) * n_y], sample);
        }
    }
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
