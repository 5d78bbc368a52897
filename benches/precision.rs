//! Epochs in float32 beside the same epochs in float64.
//!
//! ```text
//! cargo bench -p scrnn --bench precision [-- [--rounds 9] [--instruction-set avx2]]
//! ```
//!
//! The two take turns, on one thread and on two; what is printed are medians over the rounds, and the median of the
//! rounds' ratios.

mod arguments;
mod training;

use std::time::Duration;

use arguments::Arguments;
use scrnn::objective::Precision;
use scrnn::topology::Topology;
use training::{Training, waves};

/// Units, sequences and steps.
const SHAPES: [(usize, usize, usize); 6] =
    [(60, 12, 1000), (16, 12, 1000), (32, 64, 1000), (120, 144, 500), (256, 12, 1000), (512, 12, 300)];
/// What one measurement takes at least.
const BURST: Duration = Duration::from_millis(40);

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let arguments = Arguments::read(9);
    let shapes = if arguments.measures() { &SHAPES[..] } else { &SHAPES[..1] };
    println!(
        "instruction set {}\n\nunits  sequences  steps  threads   float64 ms   float32 ms    faster",
        arguments.set
    );
    for &(units, sequences, steps) in shapes {
        let topology = Topology::s_ctrnn(2, units, 2.0).expect("sizes above 0");
        let data = waves(&topology, sequences, steps);
        for threads in [1, 2] {
            let mut both = [Precision::F64, Precision::F32]
                .map(|precision| Training::with(&topology, &data, threads, arguments.set, precision));
            let epochs = both.each_mut().map(|training| {
                let one = training.time(1).max(Duration::from_micros(1));
                (BURST.as_secs_f64() / one.as_secs_f64()).ceil().max(1.0) as u64
            });
            let mut seconds = [Vec::new(), Vec::new()];
            for _ in 0..arguments.rounds {
                for (k, training) in both.iter_mut().enumerate() {
                    seconds[k].push(training.time(epochs[k]).as_secs_f64() / epochs[k] as f64);
                }
            }
            let ratio = median(seconds[0].iter().zip(&seconds[1]).map(|(double, single)| double / single).collect());
            let [double, single] = seconds.map(|list| 1e3 * median(list));
            println!("{units:5} {sequences:10} {steps:6} {threads:8} {double:12.3} {single:12.3} {ratio:8.2}x");
        }
    }
}
