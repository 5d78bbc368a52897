//! Runs that are taught throughout: all of their inputs are known, so that whole segments are computed at once.
//!
//! Blocks are worked on by any thread, and where there are more threads than blocks, others follow with the gradient of the
//! weights, see [`super::relay`]. The blocks' gradients are added in the order of the blocks.
//!
//! Written for both [elements](crate::kernels::element). In float32, states, weights, products, and the gradient of one segment are
//! float32; the likelihood, and the sums of gradients over segments and blocks, are float64.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::relay::{Gather, Relay, Segment, Total};
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

/// A block, and how its steps are cut.
#[derive(Debug, Default)]
struct Part {
    block: Block,
    cut: Cut,
}

/// What comes of a block besides the gradient of the weights.
#[derive(Debug, Default)]
struct Found {
    /// [column][unit].
    initial: Vec<f64>,
    /// [column][channel].
    ln_likelihood: Vec<f64>,
    squared_error: Vec<f64>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn own<T>(mutex: &mut Mutex<T>) -> &mut T {
    mutex.get_mut().unwrap_or_else(PoisonError::into_inner)
}

/// The weights of one element, and the memory for the largest list of runs so far.
#[derive(Debug)]
pub(super) struct Taught<E: Element> {
    pub packed: Packed<E>,
    /// The runs that the first `blocks` parts are made of.
    runs: Vec<Run>,
    parts: Vec<Part>,
    found_of: Vec<Mutex<Found>>,
    blocks: usize,
    relay: Relay<E>,
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
            parts: Vec::new(),
            found_of: Vec::new(),
            blocks: 0,
            relay: Relay::new(),
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
        let (packed, records, parts, relay) = (&self.packed, &self.records, &self.parts, &self.relay);
        let found_of = &self.found_of;
        let (inputs, targets) = (task.inputs, task.targets);
        let gather = |block: usize, segment: &Segment<E>, states: &[E], total: &mut Total<E>| {
            set.run(GatherSegment { packed, block: &parts[block].block, segment, states, total });
        };
        let run = |block: usize| {
            let part = &parts[block];
            let record = locked(records).pop();
            let mut trajectory = record.unwrap_or_else(|| {
                let mut record = Trajectory::new();
                record.fit(packed, &part.block, part.cut);
                record
            });
            if want == Want::Everything {
                relay.clear(block);
            }
            forward::start(packed, &part.block, initial, &mut trajectory);
            let found = &mut *locked(&found_of[block]);
            let way_back = WayBack { relay, block, gather: &gather };
            set.run(Evaluate { packed, inputs, targets, part, found, trajectory: &mut trajectory, want, way_back });
            locked(records).push(trajectory);
        };
        let most = if self.has_followers(task, want) { 2 * self.blocks } else { self.blocks };
        let mut threads = vec![(); task.engine.threads().min(most)];
        task.engine.for_each(&mut threads, |()| relay.work(run, gather));
        self.collect(task, want, evaluation);
    }

    /// Splits the runs into blocks, and takes the memory that they need.
    fn plan(&mut self, task: &Task<'_>, runs: &[Run], want: Want) {
        if self.runs != runs {
            self.runs.clear();
            self.runs.extend_from_slice(runs);
            self.blocks = 0;
            batch::split(task.topology, runs, &mut self.order, |index, columns| {
                if index == self.parts.len() {
                    self.parts.push(Part::default());
                    self.found_of.push(Mutex::default());
                }
                let (part, found) = (&mut self.parts[index], own(&mut self.found_of[index]));
                part.block.fill(runs, columns);
                part.cut = Cut::new(&self.packed, &part.block, task.recompute);
                found.initial.resize(columns.len() * self.packed.n_c, 0.0);
                found.ln_likelihood.resize(columns.len() * self.packed.n_y, 0.0);
                found.squared_error.resize(columns.len() * self.packed.n_y, 0.0);
                self.blocks = index + 1;
            });
            let records = own(&mut self.records);
            while records.len() < task.engine.threads().min(self.blocks) {
                records.push(Trajectory::new());
            }
            for record in records {
                self.parts[..self.blocks].iter().for_each(|part| record.fit(&self.packed, &part.block, part.cut));
            }
        }
        let parts = &self.parts[..self.blocks];
        let deltas = parts.iter().map(|part| part.cut.deltas(&self.packed, part.block.columns())).max();
        self.relay.prepare(self.blocks, deltas.filter(|_| self.has_followers(task, want)));
        if want == Want::Everything {
            let len = self.packed.gradient_len();
            self.sum.resize(len, 0.0);
            (0..self.blocks).for_each(|block| self.relay.total(block).resize(len));
        }
    }

    /// Whether threads without a block follow the others with the gradient of the weights.
    fn has_followers(&self, task: &Task<'_>, want: Want) -> bool {
        want == Want::Everything
            && task.engine.threads() > self.blocks
            && batch::is_worth_following(task.topology, &self.runs)
    }

    fn collect(&mut self, task: &Task<'_>, want: Want, evaluation: &mut Evaluation) {
        let (n_c, n_y) = (self.packed.n_c, self.packed.n_y);
        for (part, found) in self.parts[..self.blocks].iter().zip(&mut self.found_of) {
            let found = own(found);
            for (column, &run) in part.block.runs.iter().enumerate() {
                let own = column * n_y..(column + 1) * n_y;
                evaluation.ln_likelihood[run] = found.ln_likelihood[own.clone()].iter().sum();
                evaluation.squared_error[run] = found.squared_error[own.clone()].iter().sum();
                if task.features.has_skip() {
                    evaluation.ln_likelihood[run] -= part.block.lengths[column] as f64 * task.ln_scale;
                    let squares = found.squared_error[own].iter().enumerate();
                    evaluation.squared_error[run] = squares.map(|(i, sum)| task.features.scale(i).powi(2) * sum).sum();
                }
                if want != Want::Score {
                    let out = &mut evaluation.initial[run * n_c..(run + 1) * n_c];
                    let own = &found.initial[column * n_c..(column + 1) * n_c];
                    for ((out, own), &learns) in out.iter_mut().zip(own).zip(task.learns) {
                        *out = if learns { *own } else { 0.0 };
                    }
                }
            }
        }
        if want == Want::Everything {
            match self.blocks {
                0 => self.sum.fill(0.0),
                _ => self.sum.copy_from_slice(&self.relay.total(0).sum),
            }
            for block in 1..self.blocks {
                for (sum, own) in self.sum.iter_mut().zip(self.relay.total(block).sum.iter()) {
                    *sum += own;
                }
            }
            self.packed.unpack_gradient(&self.sum, &mut evaluation.gradients);
        }
    }
}

/// One block, forward and back.
struct Evaluate<'a, E: Element, G> {
    packed: &'a Packed<E>,
    inputs: &'a [Sequence],
    targets: &'a [Sequence],
    part: &'a Part,
    found: &'a mut Found,
    trajectory: &'a mut Trajectory<E>,
    want: Want,
    way_back: WayBack<'a, E, G>,
}

/// Where a block's segments go on the way back.
struct WayBack<'a, E, G> {
    relay: &'a Relay<E>,
    /// The block's number.
    block: usize,
    gather: &'a G,
}

/// A segment's part of the gradient of the weights.
struct GatherSegment<'a, E: Element> {
    packed: &'a Packed<E>,
    block: &'a Block,
    segment: &'a Segment<E>,
    states: &'a [E],
    total: &'a mut Total<E>,
}

impl<E: Element> WithSimd for GatherSegment<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { packed, block, segment: Segment { products, span_start, deltas }, states, total } = self;
        total.add(|gradient| {
            crate::backward::gather(simd, packed, block, products.clone(), *span_start, (deltas, states), gradient);
        });
    }
}

/// The segments of a span.
fn segments(cut: Cut, span: &Range<usize>) -> impl DoubleEndedIterator<Item = Range<usize>> {
    let (start, end) = (span.start, span.end);
    let count = (end - start).div_ceil(cut.segment);
    (0..count).map(move |i| start + i * cut.segment..(start + (i + 1) * cut.segment).min(end))
}

impl<E: Element, G: Gather<E>> WithSimd for Evaluate<'_, E, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.go_forward(simd);
        if self.want != Want::Score {
            self.go_back(simd);
        }
    }
}

impl<E: Element, G: Gather<E>> Evaluate<'_, E, G> {
    #[inline(always)]
    fn go_forward<S: Simd>(&mut self, simd: S) {
        let Self { packed, inputs, targets, part: Part { block, cut }, found, trajectory, .. } = self;
        let n = block.columns();
        found.ln_likelihood.fill(0.0);
        found.squared_error.fill(0.0);
        for index in 0..cut.spans() {
            let span = cut.span_range(index);
            if cut.spans() > 1 {
                let kept = &mut trajectory.span_starts[index * n * packed.rows..(index + 1) * n * packed.rows];
                kept.copy_from_slice(&trajectory.internal[..n * packed.rows]);
            }
            forward::enter_span(simd, packed, block, trajectory);
            for segment in segments(*cut, &span) {
                forward::run(simd, packed, (block, inputs), segment.clone(), span.start, true, trajectory);
                score(simd, packed, targets, (block, &mut **found), segment, trajectory);
            }
        }
        // A state that is no longer finite stays so: it must not hide behind the bounds of tanh.
        for (column, u) in trajectory.internal.chunks_exact(packed.rows).enumerate().take(n) {
            if !u[..packed.n_c].iter().all(|u| u.is_finite()) {
                found.ln_likelihood[column * packed.n_y] = f64::NAN;
            }
        }
    }

    #[inline(always)]
    fn go_back<S: Simd>(&mut self, simd: S) {
        let Self { packed, inputs, part: Part { block, cut }, found, trajectory, want, way_back, .. } = self;
        let WayBack { relay, block: number, gather } = *way_back;
        let n = block.columns();
        let row = n * packed.delta_stride;
        relay.rouse();
        for index in (0..cut.spans()).rev() {
            let span = cut.span_range(index);
            if index + 1 < cut.spans() {
                let kept = &trajectory.span_starts[index * n * packed.rows..(index + 1) * n * packed.rows];
                trajectory.internal[..n * packed.rows].copy_from_slice(kept);
                forward::enter_span(simd, packed, block, trajectory);
                forward::run(simd, packed, (block, inputs), span.clone(), span.start, false, trajectory);
            }
            relay.exchange(number, &mut trajectory.states);
            let states = relay.states(number);
            for segment in segments(*cut, &span).rev() {
                crate::backward::run(simd, packed, block, segment.clone(), span.start, &states, trajectory);
                // d/du of this segment's start is the end of the one before it; all of those are whole.
                let next = if segment.start == 0 { 0 } else { cut.segment * row };
                if segment.start == 0 {
                    let starts = trajectory.deltas.chunks_exact(packed.delta_stride);
                    for (out, start) in found.initial.chunks_exact_mut(packed.n_c).zip(starts) {
                        E::give(&start[..packed.n_c], out);
                    }
                }
                match want {
                    Want::Everything => {
                        relay.hand_over(number, segment, span.start, &mut trajectory.deltas, (row, next), gather);
                    }
                    _ => trajectory.deltas.copy_within(..row, next),
                }
            }
            drop(states);
            relay.finish(number, gather);
            relay.exchange(number, &mut trajectory.states);
        }
    }
}

/// Scores the predictions of a segment and sums them up for each column.
#[inline(always)]
fn score<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    targets: &[Sequence],
    (block, found): (&Block, &mut Found),
    segment: Range<usize>,
    trajectory: &mut Trajectory<E>,
) {
    let Found { ln_likelihood, squared_error, .. } = found;
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
