//! The objective on the processor: blocks in parallel, one ordered sum.
//!
//! Blocks are worked on by any thread; their gradients are added in the order of the blocks, so the bits do not depend
//! on the number of threads. All memory is taken on the calling thread, for the largest list of runs so far; an evaluation
//! that needs no more allocates nothing. Samples are read where the data set has them.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::{Backend, Evaluation, Objective, Request, Run, Want};
use crate::batch::{self, Block};
use crate::dataset::{Dataset, Sequence};
use crate::engine::{Engine, Run as _};
use crate::error::Result;
use crate::forward;
use crate::kernels::copy_few;
use crate::likelihood::Predictions;
use crate::packed::Packed;
use crate::parameters::{Block as Parameter, Parameters};
use crate::topology::Topology;
use crate::trajectory::{Cut, Trajectory};

impl Backend for Engine {
    fn objective(&self, request: &Request<'_>) -> Result<Box<dyn Objective>> {
        request.data.check_for(request.topology)?;
        Ok(Box::new(CpuObjective::new(request, self)))
    }
}

/// A block and its results.
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

impl Job {
    fn new() -> Self {
        Self {
            block: Block::default(),
            cut: Cut::default(),
            gradient: AVec::new(64),
            initial: Vec::new(),
            ln_likelihood: Vec::new(),
            squared_error: Vec::new(),
        }
    }

    /// Takes over the columns `own` of `runs`.
    fn fill(&mut self, packed: &Packed, runs: &[Run], own: &[usize], recompute: bool) {
        self.block.fill(runs, own);
        self.cut = Cut::new(packed, &self.block, recompute);
        self.initial.resize(own.len() * packed.n_c, 0.0);
        self.ln_likelihood.resize(own.len() * packed.n_x, 0.0);
        self.squared_error.resize(own.len() * packed.n_x, 0.0);
    }
}

/// Evaluates the objective again and again on runs through the same sequences.
#[derive(Debug)]
struct CpuObjective {
    topology: Topology,
    data: Dataset,
    engine: Engine,
    recompute: bool,
    packed: Packed,
    /// Whether the last parameters were of this network.
    fits: bool,
    /// The runs that the first `blocks` jobs are made for.
    runs: Vec<Run>,
    jobs: Vec<Job>,
    blocks: usize,
    order: Vec<usize>,
    /// One for each block that can be worked on at the same time.
    records: Mutex<Vec<Trajectory>>,
    sum: AVec<f64>,
    learns: Vec<bool>,
}

impl CpuObjective {
    fn new(request: &Request<'_>, engine: &Engine) -> Self {
        let topology = request.topology;
        let packed = Packed::new(topology, engine.instruction_set());
        Self {
            topology: topology.clone(),
            data: request.data.clone(),
            engine: engine.clone(),
            recompute: request.recompute,
            fits: false,
            runs: Vec::new(),
            jobs: Vec::new(),
            blocks: 0,
            order: Vec::new(),
            records: Mutex::new(Vec::new()),
            sum: AVec::new(64),
            learns: topology.per_unit(|group| group.learns_initial_state).collect(),
            packed,
        }
    }

    /// Whether parameters, or gradients, are of this network.
    fn fits(&self, parameters: &Parameters) -> bool {
        Parameter::ALL.into_iter().all(|block| parameters.block(block).len() == block.range(&self.topology).len())
    }

    /// Whether every run is through samples that are there.
    fn has(&self, runs: &[Run]) -> bool {
        let samples = |run: &Run| self.data.sequences().get(run.sequence).map_or(0, Sequence::len);
        runs.iter().all(|run| run.steps > 0 && run.steps <= samples(run).saturating_sub(self.packed.delay))
    }

    /// Splits the runs into blocks, and takes the memory that they need.
    fn plan(&mut self, runs: &[Run], want: Want) {
        if self.runs != runs {
            self.runs.clear();
            self.runs.extend_from_slice(runs);
            self.blocks = 0;
            batch::split(&self.topology, runs, &mut self.order, |index, own| {
                if index == self.jobs.len() {
                    self.jobs.push(Job::new());
                }
                self.jobs[index].fill(&self.packed, runs, own, self.recompute);
                self.blocks = index + 1;
            });
            let records = self.records.get_mut().unwrap_or_else(PoisonError::into_inner);
            while records.len() < self.engine.threads().min(self.blocks) {
                records.push(Trajectory::new());
            }
            for record in records {
                self.jobs[..self.blocks].iter().for_each(|job| record.fit(&self.packed, &job.block, job.cut));
            }
        }
        if want == Want::Everything {
            let len = self.packed.gradient_len();
            self.sum.resize(len, 0.0);
            self.jobs[..self.blocks].iter_mut().for_each(|job| job.gradient.resize(len, 0.0));
        }
    }

    fn collect(&mut self, want: Want, evaluation: &mut Evaluation) {
        let (n_c, n_x) = (self.packed.n_c, self.packed.n_x);
        let jobs = &self.jobs[..self.blocks];
        for job in jobs {
            for (column, &run) in job.block.runs.iter().enumerate() {
                let own = column * n_x..(column + 1) * n_x;
                evaluation.ln_likelihood[run] = job.ln_likelihood[own.clone()].iter().sum();
                evaluation.squared_error[run] = job.squared_error[own].iter().sum();
                if want != Want::Score {
                    let out = &mut evaluation.initial[run * n_c..(run + 1) * n_c];
                    let own = &job.initial[column * n_c..(column + 1) * n_c];
                    for ((out, own), &learns) in out.iter_mut().zip(own).zip(&self.learns) {
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

impl Objective for CpuObjective {
    fn set_parameters(&mut self, parameters: &Parameters) {
        self.fits = self.fits(parameters);
        if self.fits {
            self.packed.fill(parameters);
        }
    }

    fn evaluate(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        evaluation.resize(runs.len());
        let states = runs.len() * self.packed.n_c;
        let has_room = evaluation.initial.len() == states && self.fits(&evaluation.gradients);
        if !self.fits || !has_room || !self.has(runs) || initial.len() != states {
            return evaluation.fill_with_nan();
        }
        self.plan(runs, want);
        let set = self.engine.instruction_set();
        let (packed, floor, records) = (&self.packed, self.topology.variance_floor(), &self.records);
        let sequences = self.data.sequences();
        self.engine.for_each(&mut self.jobs[..self.blocks], |job| {
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
            set.run(Evaluate { packed, floor, sequences, job, trajectory: &mut trajectory, want });
            lock().push(trajectory);
        });
        self.collect(want, evaluation);
    }

    fn numerics(&self) -> &str {
        "f64"
    }
}

/// One block, forward and back.
struct Evaluate<'a> {
    packed: &'a Packed,
    floor: f64,
    sequences: &'a [Sequence],
    job: &'a mut Job,
    trajectory: &'a mut Trajectory,
    want: Want,
}

/// The segments of a span.
fn segments(cut: Cut, span: &Range<usize>) -> impl DoubleEndedIterator<Item = Range<usize>> {
    let (start, end) = (span.start, span.end);
    let count = (end - start).div_ceil(cut.segment);
    (0..count).map(move |i| start + i * cut.segment..(start + (i + 1) * cut.segment).min(end))
}

impl WithSimd for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { packed, floor, sequences, job, trajectory, want } = self;
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
            forward::enter_span(simd, packed, &job.block, sequences, span.clone(), trajectory);
            for segment in segments(cut, &span) {
                forward::run(simd, packed, &job.block, segment.clone(), span.start, true, trajectory);
                score(simd, packed, floor, sequences, job, segment, trajectory);
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
                forward::enter_span(simd, packed, &job.block, sequences, span.clone(), trajectory);
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
    sequences: &[Sequence],
    job: &mut Job,
    segment: Range<usize>,
    trajectory: &mut Trajectory,
) {
    let Job { block, ln_likelihood, squared_error, .. } = job;
    let (n, n_x) = (block.columns(), packed.n_x);
    let products = segment.start.max(1)..segment.end;
    let first = products.start;
    take_targets(packed, block, sequences, first - 1..segment.end - 1, &mut trajectory.targets);
    for (products, active) in block.stretches(products) {
        // Columns that have ended leave gaps between the steps of the others.
        let at_once = if active == n { products.len() } else { 1 };
        for product in products.step_by(at_once) {
            let (from, target, len) = ((product - 1) * n * n_x, (product - first) * n * n_x, at_once * active * n_x);
            let variance: &mut [f64] =
                if packed.n_out > n_x { &mut trajectory.variance[from..from + len] } else { &mut [] };
            Predictions {
                mean: &mut trajectory.mean[from..from + len],
                variance,
                target: &trajectory.targets[target..target + len],
                terms: &mut trajectory.terms,
                squares: &mut trajectory.squares,
                precisions: &mut trajectory.precisions,
            }
            .score(simd, floor);
            add_rows(&mut ln_likelihood[..active * n_x], &trajectory.terms[..len]);
            add_rows(&mut squared_error[..active * n_x], &trajectory.squares[..len]);
        }
    }
}

/// Copies the targets of a range of steps side by side, [step][column][channel]; of columns that have ended, nothing.
#[inline(always)]
fn take_targets(packed: &Packed, block: &Block, sequences: &[Sequence], steps: Range<usize>, targets: &mut [f64]) {
    let (n, n_x) = (block.columns(), packed.n_x);
    for (column, (&sequence, &length)) in block.sequences.iter().zip(&block.lengths).enumerate() {
        if length <= steps.start {
            break;
        }
        let own = steps.start + packed.delay..steps.end.min(length) + packed.delay;
        let samples = &sequences[sequence].values()[own.start * n_x..own.end * n_x];
        for (sample, targets) in samples.chunks_exact(n_x).zip(targets.chunks_exact_mut(n * n_x)) {
            copy_few(&mut targets[column * n_x..(column + 1) * n_x], sample);
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

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;
