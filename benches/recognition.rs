//! Recognition at the thesis' size: 12 sequences of 1000 steps, 20 starts each, 60 units.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench recognition [-- [--full] [--rounds 5] [--instruction-set avx2]]
//! ```
//!
//! What an epoch costs is the difference between a long and a short recognition; 300 epochs are extrapolated from it.
//! `--full` runs all 300 as well.

mod arguments;
mod machine;

use std::time::Instant;

use arguments::Arguments;
use machine::{median, peak_gflops};
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::initial_states::InitialStates;
use scrnn::initialization::initialize;
use scrnn::network::Network;
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn::topology::Topology;
use scrnn_tasks::lissajous;

/// Epochs of the short and of the long recognition, and those of the thesis.
const EPOCHS: [u64; 3] = [2, 12, 300];
/// Starts for each sequence.
const STARTS: usize = 20;
const STEPS: usize = 1000;
const UNITS: usize = 60;
/// Useful operations of a step, forward and back: 2 (2 C^2 + C I + 2 C N_out). Shared parameters get no gradient.
const OPERATIONS: f64 = (2 * (2 * UNITS * UNITS + UNITS * 2 + 2 * UNITS * 4)) as f64;

fn main() {
    let arguments = Arguments::read(5);
    // One sample more than there are steps: every step has its target.
    let data =
        lissajous::generate(&lissajous::Options { sequences: 12, steps: STEPS + 1 }, 1).expect("twelve curves").data;
    let topology = Topology::s_ctrnn(2, UNITS, 2.0).expect("sizes above 0");
    let (network, learned) = initialize(&topology, data.sequences().len(), 1);
    let columns = (data.sequences().len() * STARTS) as f64;
    let giga = columns * STEPS as f64 * OPERATIONS / 1e9;
    println!("{} sequences x {STARTS} starts x {STEPS} steps, {UNITS} units", data.sequences().len());
    for threads in [1, 2] {
        let engine = Engine::new(threads, arguments.set).expect("an instruction set that this processor has");
        let time = |epochs| seconds(&network, &learned, &data, &engine, epochs);
        let [short, long, thesis] = EPOCHS;
        let [mut epoch, mut first, mut share] = [const { Vec::new() }; 3];
        for _ in 0..arguments.rounds {
            let (shorter, longer) = (time(short), time(long));
            let seconds = (longer - shorter) / (long - short) as f64;
            share.push(100.0 * giga / seconds / peak_gflops(arguments.set, threads));
            epoch.push(seconds);
            first.push(shorter);
        }
        let (epoch, share) = (median(epoch), median(share));
        let extrapolated = median(first) + epoch * (thesis - short) as f64;
        println!("threads {threads}: {:.1} ms an epoch, {share:.0}% of the peak", 1e3 * epoch);
        println!("           {thesis} epochs, extrapolated: {extrapolated:.2} s");
        if arguments.has("--full") {
            println!("           {thesis} epochs, measured once: {:.2} s", time(thesis));
        }
    }
}

/// Seconds of one recognition.
fn seconds(network: &Network, learned: &InitialStates, data: &Dataset, engine: &Engine, epochs: u64) -> f64 {
    let options = RecognitionOptions::with(|it| {
        it.starts = STARTS;
        it.epochs = epochs;
    });
    let start = Instant::now();
    let results = recognize(network, learned, data, &options, engine).expect("data made for the network");
    assert_eq!(results.len(), data.sequences().len());
    start.elapsed().as_secs_f64()
}
