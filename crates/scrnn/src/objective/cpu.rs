//! The objective on the processor: blocks in parallel, one ordered sum.
//!
//! Blocks are worked on by any thread; their gradients are added in the order of the blocks, so the bits do not depend
//! on the number of threads. All memory is taken on the calling thread, for the largest list of runs so far; an evaluation
//! that needs no more allocates nothing. Samples are read where the data set has them.
//!
//! Runs through sequences without missing values that are taught throughout know all of their inputs beforehand, and take the fast
//! way, see [`super::taught`], in the precision that is asked for. All others go step by step, see [`super::closed`], always in
//! float64; theirs are added after.

use aligned_vec::AVec;

use super::closed::{self, ClosedBlock, EvaluateClosed};
use super::taught::{Task, Taught};
use super::{Backend, ClosedLoopTerm, Evaluation, Objective, Precision, Request, Run, Want};
use crate::dataset::{Dataset, Sequence};
use crate::engine::{Engine, Run as _};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::parameters::{Block as Parameter, Parameters};
use crate::topology::Topology;

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
    /// Its weights are also those of the runs that go step by step.
    double: Taught<f64>,
    single: Option<Taught<f32>>,
    /// Whether the last parameters were of this network.
    fits: bool,
    order: Vec<usize>,
    sum: AVec<f64>,
    learns: Vec<bool>,
}

impl CpuObjective {
    fn new(request: &Request<'_>, engine: &Engine) -> Result<Self> {
        let topology = request.topology;
        let double = Taught::new(topology, engine);
        let features = Features::new(topology);
        let by_features =
            !features.are_plain() && request.data.missing() < request.data.total_samples() * topology.channels();
        Ok(Self {
            topology: topology.clone(),
            ln_scale: (0..topology.channels()).map(|i| features.scale(i).ln()).sum(),
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
            order: Vec::new(),
            sum: AVec::new(64),
            learns: topology.per_unit(|group| group.learns_initial_state).collect(),
            single: (request.precision == Precision::F32).then(|| Taught::new(topology, engine)),
            double,
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
        runs.iter().all(|run| run.steps > 0 && run.steps <= samples(run).saturating_sub(self.double.packed.delay))
    }
}

impl Objective for CpuObjective {
    fn set_parameters(&mut self, parameters: &Parameters) {
        self.fits = self.fits(parameters);
        if self.fits {
            self.double.packed.fill(parameters);
            self.single.iter_mut().for_each(|single| single.packed.fill(parameters));
        }
    }

    fn evaluate(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        evaluation.resize(runs.len());
        let states = runs.len() * self.double.packed.n_c;
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
        match self.single {
            Some(_) => "f32",
            None => "f64",
        }
    }
}

impl CpuObjective {
    /// The fast way: all inputs are known.
    fn evaluate_taught(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        let (inputs, targets) = match &self.taught {
            Some((inputs, targets)) => (inputs.sequences(), targets.sequences()),
            None => (self.data.sequences(), self.data.sequences()),
        };
        let task = Task {
            engine: &self.engine,
            topology: &self.topology,
            features: &self.features,
            ln_scale: self.ln_scale,
            learns: &self.learns,
            inputs,
            targets,
            recompute: self.recompute,
        };
        match &mut self.single {
            Some(single) => single.evaluate(&task, runs, initial, want, evaluation),
            None => self.double.evaluate(&task, runs, initial, want, evaluation),
        }
    }

    /// The runs that are taught, then those that are not.
    fn evaluate_mixed(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        let n_c = self.double.packed.n_c;
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
        let (packed, features, term) = (&self.double.packed, &self.features, self.closed_loop);
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

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "closed_tests.rs"]
mod closed_tests;
