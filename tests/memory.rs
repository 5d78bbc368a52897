//! The memory of a training, of all threads together: as much as docs/performance.md says, and no more of it after the first
//! epochs.

use std::alloc::System;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Learner, Momentum, Optimiser, Plan, PriorStep};
use scrnn::topology::{Prediction, Topology};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// All threads of the process are counted: one test at a time.
fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn waves(sequences: usize, steps: usize) -> Dataset {
    let of = |s: usize| {
        let values = (0..2 * (steps + 1)).map(|k| 0.6 * (0.3 * k as f64 + s as f64).sin()).collect();
        Sequence::new("", 2, values).unwrap()
    };
    Dataset::new(Dataset::numbered_channels(2), (0..sequences).map(of).collect()).unwrap()
}

/// Stops at an epoch.
fn until(last: u64) -> impl FnMut(&EpochReport, &Learner) -> ControlFlow<()> {
    move |report, _| if report.epoch < last { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

/// What docs/performance.md says that a training by Adam in batches takes, in bytes.
fn formula(topology: &Topology, sequences: usize, steps: usize, batches: usize, threads: usize) -> usize {
    let (c, i, n_out) = (topology.context_units(), topology.channels(), topology.output_units());
    let up = |count: usize| count.next_multiple_of(8);
    let odd = |count: usize| (count.div_ceil(8) | 1) * 8;
    let rows = up(c + n_out);
    let batch = sequences.div_ceil(batches);
    let blocks = match batch.div_ceil(6) {
        1 => 1,
        blocks => blocks.next_multiple_of(2),
    };
    let records = threads.min(blocks);
    let columns = batch.div_ceil(blocks);
    let (s, d) = (odd(rows + i + 1), odd(rows));
    let segment = steps.min((448 << 10) / (8 * columns * (s + d)));
    let record = 8 * columns * steps * (s + n_out) + 8 * columns * segment * (d + 4 * i);
    let gradient = 8 * (c + i + 1) * rows;
    let parameters = 8 * (c * (c + i + n_out + 1) + n_out);
    let weights = 8 * (rows * (c + i) + up(c) * (c + n_out));
    let each_sequence = 8 * c * 2 * 5 + 160;
    let each_of_a_batch = 8 * c * 3 + 8 * i * 4;
    records * record
        + (blocks + 1) * gradient
        + weights
        + 8 * parameters
        + sequences * each_sequence
        + batch * each_of_a_batch
}

#[test]
fn a_training_takes_the_bytes_that_are_promised_whatever_the_number_of_batches() {
    let _alone = alone();
    let (sequences, steps) = (500, 400);
    let data = waves(sequences, steps);
    let topology = Topology::s_ctrnn(2, 30, 2.0).unwrap();
    for threads in [1, 2] {
        let engine = Engine::new(threads, InstructionSet::best()).unwrap();
        for batches in [1, 10, 500] {
            let options = Adam::with(|it| {
                it.batch_size = sequences / batches;
            });
            let plan = Plan::with(|it| {
                it.epochs = 10;
                it.optimiser = Optimiser::Adam(options);
            });
            let region = Region::new(ALLOCATOR);
            let (network, states) = initialize(&topology, sequences, 1);
            let mut learner = Learner::new(network, states, &data, plan, &engine).unwrap();
            let _ = learner.run(&mut until(2));
            let taken = region.change();
            let taken = taken.bytes_allocated as f64 - taken.bytes_deallocated as f64;
            let promised = formula(&topology, sequences, steps, batches, threads) as f64;
            println!("{threads} threads, {batches} batches: {taken} bytes, {promised} by the formula");
            assert!((taken / promised - 1.0).abs() < 0.05, "{threads} threads, {batches} batches: {taken}, {promised}");
        }
    }
}

#[test]
fn after_the_first_epochs_two_threads_allocate_nothing_either() {
    let _alone = alone();
    let engine = Engine::new(2, InstructionSet::best()).unwrap();
    let data = waves(20, 60);
    let topology = Topology::new(2, 1, vec![scrnn::topology::Group::full("", 9, 2.0)], Prediction::Mean).unwrap();
    for optimiser in [
        Optimiser::Momentum(Momentum::with(|it| {
            it.prior = PriorStep::Thesis;
        })),
        Optimiser::Momentum(Momentum::default()),
        Optimiser::Adam(Adam::default()),
        Optimiser::Adam(Adam::with(|it| {
            it.batch_size = 7;
        })),
    ] {
        let (network, states) = initialize(&topology, 20, 1);
        let plan = Plan::with(|it| {
            it.epochs = 1000;
            it.optimiser = optimiser.clone();
        });
        let mut learner = Learner::new(network, states, &data, plan, &engine).unwrap();
        let _ = learner.run(&mut until(3));
        // The test's own surroundings allocate now and then: the least of three counts. The queue of the thread pool takes a block for
        // each 63 calls, of which an epoch makes one for each batch.
        let count = (1..=3).map(|nth| {
            let region = Region::new(ALLOCATOR);
            let _ = learner.run(&mut until(3 + 200 * nth));
            region.change().allocations + region.change().reallocations
        });
        let count = count.min().unwrap();
        let calls = if matches!(optimiser, Optimiser::Adam(Adam { batch_size: 7, .. })) { 3 * 200 } else { 200 };
        assert!(count <= calls / 63 + 1, "{optimiser:?}: {count} allocations");
    }
}

#[test]
fn a_thread_that_follows_with_the_gradient_allocates_nothing() {
    let _alone = alone();
    let engine = Engine::new(2, InstructionSet::best()).unwrap();
    // One block, and 2 ms of work: the second thread follows.
    let data = waves(3, 1500);
    let topology = Topology::s_ctrnn(2, 64, 2.0).unwrap();
    let (network, states) = initialize(&topology, 3, 1);
    let plan = Plan::with(|it| {
        it.epochs = 1000;
        it.optimiser = Optimiser::Adam(Adam::default());
    });
    let mut learner = Learner::new(network, states, &data, plan, &engine).unwrap();
    let _ = learner.run(&mut until(3));
    let count = (1..=3).map(|nth| {
        let region = Region::new(ALLOCATOR);
        let _ = learner.run(&mut until(3 + 60 * nth));
        region.change().allocations + region.change().reallocations
    });
    // The queue of the thread pool takes a block for each 63 calls.
    let count = count.min().unwrap();
    assert!(count <= 2, "{count} allocations");
}
