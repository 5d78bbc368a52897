//! One epoch of learning: evaluation of all sequences, gradient, update; in time steps a second.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench epoch [-- lissajous]
//! ```
//!
//! The first five are the tasks of the thesis at their sizes; the others vary one size of the first task. Shares of the
//! machine's peak, and slopes, are printed by `share_of_peak`.

mod training;

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};
use scrnn::dataset::Dataset;
use scrnn::engine::InstructionSet;
use scrnn::topology::{Group, Prediction, Topology};
use scrnn_tasks::{limit_cycle, lissajous, sinusoid};
use training::{Training, waves};

const THREADS: [usize; 2] = [1, 2];

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1500))
        .configure_from_args();
    tasks(&mut criterion);
    sweeps(&mut criterion);
    criterion.final_summary();
}

/// An S-CTRNN with delay 1.
fn s_ctrnn(channels: usize, units: usize) -> Topology {
    Topology::s_ctrnn(channels, units, 2.0).expect("sizes above 0")
}

/// The S-MTRNN of chapter 5.
fn s_mtrnn() -> Topology {
    let groups = vec![Group::fast(30, 5.0), Group::slow(10, 100.0)];
    Topology::new(8, 5, groups, Prediction::MeanAndVariance { floor: 0.0 }).expect("sizes above 0")
}

fn tasks(criterion: &mut Criterion) {
    // One sample more than there are steps: every step has its target.
    let lissajous = lissajous::Options { sequences: 12, steps: 1001 };
    let lissajous = lissajous::generate(&lissajous, 1).expect("twelve curves").data;
    let sinusoid = sinusoid::Options { sequences: 1, steps: 1001 };
    let sinusoid = sinusoid::generate(&sinusoid, 1).expect("one curve").data;
    let limit_cycle = limit_cycle::Options { sequences: 10, steps: 1001 };
    let limit_cycle = limit_cycle::generate(&limit_cycle, 1).expect("ten sequences").task.data;
    epoch(criterion, "lissajous", &s_ctrnn(2, 60), &lissajous);
    epoch(criterion, "sinusoid", &s_ctrnn(1, 10), &sinusoid);
    epoch(criterion, "limit_cycle", &s_ctrnn(1, 10), &limit_cycle);
    // The robot's sequences come from the simulation; smooth ones of their sizes cost the same.
    epoch(criterion, "reaching", &s_ctrnn(6, 30), &waves(&s_ctrnn(6, 30), 30, 180));
    epoch(criterion, "interaction", &s_mtrnn(), &waves(&s_mtrnn(), 32, 470));
}

fn sweeps(criterion: &mut Criterion) {
    for units in [16, 32, 64, 128, 256, 512, 1024] {
        let topology = s_ctrnn(2, units);
        let steps = if units <= 256 { 1000 } else { 200 };
        epoch(criterion, &format!("units-{units}"), &topology, &waves(&topology, 12, steps));
    }
    let topology = s_ctrnn(2, 60);
    for sequences in [1, 2, 4, 8, 12, 16, 32, 64, 128, 256] {
        epoch(criterion, &format!("sequences-{sequences}"), &topology, &waves(&topology, sequences, 1000));
    }
    for steps in [100, 1000, 10_000, 100_000] {
        epoch(criterion, &format!("steps-{steps}"), &topology, &waves(&topology, 4, steps));
    }
}

fn epoch(criterion: &mut Criterion, name: &str, topology: &Topology, data: &Dataset) {
    let mut group = criterion.benchmark_group("epoch");
    group.throughput(Throughput::Elements(data.total_steps(topology.delay()) as u64)).sampling_mode(SamplingMode::Flat);
    for threads in THREADS {
        let id = BenchmarkId::new(name, format!("threads-{threads}"));
        // Only what is asked for is made.
        let mut training = None;
        group.bench_function(id, |bencher| {
            let new = || Training::new(topology, data, threads, InstructionSet::best());
            let training = training.get_or_insert_with(new);
            bencher.iter_custom(|epochs| training.time(epochs));
        });
    }
    group.finish();
}
