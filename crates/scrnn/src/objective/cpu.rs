//! The objective on the processor: blocks in parallel, one ordered sum.
//!
//! Blocks are worked on by any thread, and where there are more threads than blocks, others follow with the gradient of the weights, see
//! [`super::relay`]; the blocks' gradients are added in the order of the blocks, so the bits do not depend on the number of threads. All memory is taken on the calling thread, for the largest list of runs so far; an evaluation
//! that needs no more allocates nothing. Samples are read where the data set has them.
//!
//! Runs through sequences without missing values that are taught throughout know all of their inputs beforehand, and take the fast
//! way. All others go step by step, see [`super::closed`]; theirs are added after.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::closed::{self, ClosedBlock, EvaluateClosed};
use super::relay::{Gather, Relay, Segment};
use super::{Backend, ClosedLoopTerm, Evaluation, Objective, Request, Run, Want};
use crate::batch::{self, Block};
use crate::dataset::{Dataset, Sequence};
use crate::engine::{Engine, Run as _};
use crate::error::{Error, Result};
use crate::features::Features;
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
        if let Some(ClosedLoopTerm { copies, weight }) = request.closed_loop {
            let setting = |what, found: String, needed| Err(Error::Setting { what, found, needed });
            if !(1..=1000).contains(&copies) {
                return setting("copies of the closed loop", copies.to_string(), "a number from 1 to 1000");
            }
            if !(weight >= 0.0 && weight.is_finite()) {
                return setting("weight of the closed loop", weight.to_string(), "0 or a number above it");
            }
        }
        Ok(Box::new(CpuObjective::new(request, self)?))
    }
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

/// Evaluates the objective again and again on runs through the same sequences.
#[derive(Debug)]
struct CpuObjective {
    topology: Topology,
    features: Features,
    data: Dataset,
    /// Inputs and targets of taught runs: the data, but for features.
    taught: Option<(Dataset, Dataset)>,
    /// sum ln s, and s of each channel: what the likelihood of scaled targets differs by.
    ln_scale: f64,
    closed_loop: ClosedLoopTerm,
    /// Blocks of runs that take in what they predicted; the first `closed_blocks` are in use.
    closed: Vec<ClosedBlock>,
    closed_blocks: usize,
    /// Of a mixed list: which runs are taught, and which are not; their initial states; what was found of the taught ones.
    ways: [Vec<usize>; 2],
    some: Vec<Run>,
    some_initial: Vec<f64>,
    found: Option<Box<Evaluation>>,
    engine: Engine,
    recompute: bool,
    packed: Packed,
    /// Whether the last parameters were of this network.
    fits: bool,
    /// The runs that the first `blocks` parts are made of.
    runs: Vec<Run>,
    parts: Vec<Part>,
    found_of: Vec<Mutex<Found>>,
    blocks: usize,
    relay: Relay,
    order: Vec<usize>,
    /// One for each block that can be worked on at the same time.
    records: Mutex<Vec<Trajectory>>,
    sum: AVec<f64>,
    learns: Vec<bool>,
}

impl CpuObjective {
    fn new(request: &Request<'_>, engine: &Engine) -> Result<Self> {
        let topology = request.topology;
        let packed = Packed::new(topology, engine.instruction_set());
        let features = Features::new(topology);
        let by_features = !features.are_plain() && request.data.missing() < request.data.total_samples() * packed.n_y;
        Ok(Self {
            topology: topology.clone(),
            ln_scale: (0..packed.n_y).map(|i| features.scale(i).ln()).sum(),
            taught: by_features.then(|| features.taught(request.data, topology.delay())).transpose()?,
            features,
            closed_loop: request.closed_loop.unwrap_or(ClosedLoopTerm { copies: 0, weight: 0.0 }),
            closed: Vec::new(),
            closed_blocks: 0,
            ways: [Vec::new(), Vec::new()],
            some: Vec::new(),
            some_initial: Vec::new(),
            found: None,
            data: request.data.clone(),
            engine: engine.clone(),
            recompute: request.recompute,
            fits: false,
            runs: Vec::new(),
            parts: Vec::new(),
            found_of: Vec::new(),
            blocks: 0,
            relay: Relay::default(),
            order: Vec::new(),
            records: Mutex::new(Vec::new()),
            sum: AVec::new(64),
            learns: topology.per_unit(|group| group.learns_initial_state).collect(),
            packed,
        })
    }

    /// Whether all inputs of a run are known beforehand, and its error is that of its targets in their own units.
    fn is_taught(&self, run: &Run) -> bool {
        let released = run.release.is_some_and(|release| self.closed_loop.copies > 0 && release.step < run.steps);
        let simple = self.topology.has_variance() || !self.features.has_skip();
        !released && simple && self.data.sequences()[run.sequence].missing() == 0
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
            batch::split(&self.topology, runs, &mut self.order, |index, columns| {
                if index == self.parts.len() {
                    self.parts.push(Part::default());
                    self.found_of.push(Mutex::default());
                }
                let (part, found) = (&mut self.parts[index], own(&mut self.found_of[index]));
                part.block.fill(runs, columns);
                part.cut = Cut::new(&self.packed, &part.block, self.recompute);
                found.initial.resize(columns.len() * self.packed.n_c, 0.0);
                found.ln_likelihood.resize(columns.len() * self.packed.n_y, 0.0);
                found.squared_error.resize(columns.len() * self.packed.n_y, 0.0);
                self.blocks = index + 1;
            });
            let records = own(&mut self.records);
            while records.len() < self.engine.threads().min(self.blocks) {
                records.push(Trajectory::new());
            }
            for record in records {
                self.parts[..self.blocks].iter().for_each(|part| record.fit(&self.packed, &part.block, part.cut));
            }
        }
        let parts = &self.parts[..self.blocks];
        let deltas = parts.iter().map(|part| part.cut.deltas(&self.packed, part.block.columns())).max();
        self.relay.prepare(self.blocks, deltas.filter(|_| self.has_followers(want)));
        if want == Want::Everything {
            let len = self.packed.gradient_len();
            self.sum.resize(len, 0.0);
            (0..self.blocks).for_each(|block| self.relay.gradient(block).resize(len, 0.0));
        }
    }

    /// Whether threads without a block follow the others with the gradient of the weights.
    fn has_followers(&self, want: Want) -> bool {
        want == Want::Everything
            && self.engine.threads() > self.blocks
            && batch::is_worth_following(&self.topology, &self.runs)
    }

    fn collect(&mut self, want: Want, evaluation: &mut Evaluation) {
        let (n_c, n_y) = (self.packed.n_c, self.packed.n_y);
        for (part, found) in self.parts[..self.blocks].iter().zip(&mut self.found_of) {
            let found = own(found);
            for (column, &run) in part.block.runs.iter().enumerate() {
                let own = column * n_y..(column + 1) * n_y;
                evaluation.ln_likelihood[run] = found.ln_likelihood[own.clone()].iter().sum();
                evaluation.squared_error[run] = found.squared_error[own.clone()].iter().sum();
                if self.features.has_skip() {
                    evaluation.ln_likelihood[run] -= part.block.lengths[column] as f64 * self.ln_scale;
                    let squares = found.squared_error[own].iter().enumerate();
                    evaluation.squared_error[run] = squares.map(|(i, sum)| self.features.scale(i).powi(2) * sum).sum();
                }
                if want != Want::Score {
                    let out = &mut evaluation.initial[run * n_c..(run + 1) * n_c];
                    let own = &found.initial[column * n_c..(column + 1) * n_c];
                    for ((out, own), &learns) in out.iter_mut().zip(own).zip(&self.learns) {
                        *out = if learns { *own } else { 0.0 };
                    }
                }
            }
        }
        if want == Want::Everything {
            match self.blocks {
                0 => self.sum.fill(0.0),
                _ => self.sum.copy_from_slice(self.relay.gradient(0)),
            }
            for block in 1..self.blocks {
                for (sum, own) in self.sum.iter_mut().zip(self.relay.gradient(block).iter()) {
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
        if runs.iter().all(|run| self.is_taught(run)) {
            return self.evaluate_taught(runs, initial, want, evaluation);
        }
        self.evaluate_mixed(runs, initial, want, evaluation);
    }

    fn numerics(&self) -> &str {
        "f64"
    }
}

impl CpuObjective {
    /// The fast way: all inputs are known.
    fn evaluate_taught(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        self.plan(runs, want);
        let set = self.engine.instruction_set();
        let (packed, records, parts, relay) = (&self.packed, &self.records, &self.parts, &self.relay);
        let found_of = &self.found_of;
        let (inputs, targets) = match &self.taught {
            Some((inputs, targets)) => (inputs.sequences(), targets.sequences()),
            None => (self.data.sequences(), self.data.sequences()),
        };
        let gather = |block: usize, segment: &Segment, states: &[f64], gradient: &mut [f64]| {
            set.run(GatherSegment { packed, block: &parts[block].block, segment, states, gradient });
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
        let most = if self.has_followers(want) { 2 * self.blocks } else { self.blocks };
        let mut threads = vec![(); self.engine.threads().min(most)];
        self.engine.for_each(&mut threads, |()| relay.work(run, gather));
        self.collect(want, evaluation);
    }

    /// The runs that are taught, then those that are not.
    fn evaluate_mixed(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        let n_c = self.packed.n_c;
        let [mut taught, mut others] = std::mem::take(&mut self.ways);
        taught.clear();
        others.clear();
        for (index, run) in runs.iter().enumerate() {
            if self.is_taught(run) { &mut taught } else { &mut others }.push(index);
        }
        let mut found = self.found.take().unwrap_or_else(|| Box::new(Evaluation::new(&self.topology)));
        evaluation.gradients.as_mut_slice().fill(0.0);
        for (which, way) in [(&taught, true), (&others, false)] {
            if which.is_empty() {
                continue;
            }
            let (mut own, mut own_initial) = (std::mem::take(&mut self.some), std::mem::take(&mut self.some_initial));
            own.clear();
            own_initial.clear();
            own.extend(which.iter().map(|&index| runs[index]));
            which.iter().for_each(|&index| own_initial.extend_from_slice(&initial[index * n_c..(index + 1) * n_c]));
            found.resize(own.len());
            match way {
                true => self.evaluate_taught(&own, &own_initial, want, &mut found),
                false => self.evaluate_closed(&own, &own_initial, want, &mut found),
            }
            for (from, &to) in which.iter().enumerate() {
                evaluation.ln_likelihood[to] = found.ln_likelihood[from];
                evaluation.squared_error[to] = found.squared_error[from];
                if want != Want::Score {
                    let own = &found.initial[from * n_c..(from + 1) * n_c];
                    evaluation.initial[to * n_c..(to + 1) * n_c].copy_from_slice(own);
                }
            }
            if want == Want::Everything {
                let sum = evaluation.gradients.as_mut_slice().iter_mut();
                sum.zip(found.gradients.as_slice()).for_each(|(sum, own)| *sum += own);
            }
            (self.some, self.some_initial) = (own, own_initial);
        }
        (self.ways, self.found) = ([taught, others], Some(found));
    }

    /// Step by step.
    fn evaluate_closed(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        let (packed, features, term) = (&self.packed, &self.features, self.closed_loop);
        let (blocks, used, mut order) = (&mut self.closed, &mut self.closed_blocks, std::mem::take(&mut self.order));
        *used = 0;
        closed::split(runs, term.copies, &mut order, |index, own| {
            if index == blocks.len() {
                blocks.push(ClosedBlock::new());
            }
            blocks[index].fill(packed, runs, own, term.copies);
            *used = index + 1;
        });
        self.order = order;
        let (set, sequences) = (self.engine.instruction_set(), self.data.sequences());
        self.engine.for_each(&mut self.closed[..self.closed_blocks], |block| {
            block.draw(runs, packed.n_y);
            set.run(EvaluateClosed { packed, features, sequences, term, starts: initial, block, want });
        });
        let n_c = packed.n_c;
        let blocks = &self.closed[..self.closed_blocks];
        for block in blocks {
            for (own, run) in block.runs().enumerate() {
                evaluation.ln_likelihood[run] = block.ln_likelihood[own];
                evaluation.squared_error[run] = block.squared_error[own];
                let states = block.initial[own * n_c..(own + 1) * n_c].iter().zip(&self.learns);
                let out = evaluation.initial[run * n_c..(run + 1) * n_c].iter_mut();
                out.zip(states).for_each(|(out, (own, learns))| *out = if *learns { *own } else { 0.0 });
            }
        }
        if want == Want::Everything {
            self.sum.resize(packed.gradient_len(), 0.0);
            self.sum.fill(0.0);
            for block in blocks {
                self.sum.iter_mut().zip(block.gradient.iter()).for_each(|(sum, own)| *sum += own);
            }
            packed.unpack_gradient(&self.sum, &mut evaluation.gradients);
        }
    }
}

/// One block, forward and back.
struct Evaluate<'a, G> {
    packed: &'a Packed,
    inputs: &'a [Sequence],
    targets: &'a [Sequence],
    part: &'a Part,
    found: &'a mut Found,
    trajectory: &'a mut Trajectory,
    want: Want,
    way_back: WayBack<'a, G>,
}

/// Where a block's segments go on the way back.
struct WayBack<'a, G> {
    relay: &'a Relay,
    /// The block's number.
    block: usize,
    gather: &'a G,
}

/// A segment's part of the gradient of the weights.
struct GatherSegment<'a> {
    packed: &'a Packed,
    block: &'a Block,
    segment: &'a Segment,
    states: &'a [f64],
    gradient: &'a mut [f64],
}

impl WithSimd for GatherSegment<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { packed, block, segment: Segment { products, span_start, deltas }, states, gradient } = self;
        crate::backward::gather(simd, packed, block, products.clone(), *span_start, (deltas, states), gradient);
    }
}

/// The segments of a span.
fn segments(cut: Cut, span: &Range<usize>) -> impl DoubleEndedIterator<Item = Range<usize>> {
    let (start, end) = (span.start, span.end);
    let count = (end - start).div_ceil(cut.segment);
    (0..count).map(move |i| start + i * cut.segment..(start + (i + 1) * cut.segment).min(end))
}

impl<G: Gather> WithSimd for Evaluate<'_, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.go_forward(simd);
        if self.want != Want::Score {
            self.go_back(simd);
        }
    }
}

impl<G: Gather> Evaluate<'_, G> {
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
            forward::enter_span(simd, packed, block, inputs, span.clone(), trajectory);
            for segment in segments(*cut, &span) {
                forward::run(simd, packed, block, segment.clone(), span.start, true, trajectory);
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
                forward::enter_span(simd, packed, block, inputs, span.clone(), trajectory);
                forward::run(simd, packed, block, span.clone(), span.start, false, trajectory);
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
                        out.copy_from_slice(&start[..packed.n_c]);
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
fn score<S: Simd>(
    simd: S,
    packed: &Packed,
    targets: &[Sequence],
    (block, found): (&Block, &mut Found),
    segment: Range<usize>,
    trajectory: &mut Trajectory,
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
fn take_targets(packed: &Packed, block: &Block, sequences: &[Sequence], steps: Range<usize>, targets: &mut [f64]) {
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

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "closed_tests.rs"]
mod closed_tests;
