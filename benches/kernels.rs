//! The kernels by themselves, as shares of the peak that is measured in the same run, and the same products by nalgebra.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench kernels [-- [--rounds 9] [--instruction-set avx2]]
//! ```

mod arguments;
mod cache;
mod fixtures;
mod machine;

use std::hint::black_box;
use std::time::Duration;

use arguments::Arguments;
use cache::read_gbytes;
use fixtures::{Elements, Kernel, Repeat, Size, values};
use machine::{median, on, peak_gflops, seconds_per_call};
use nalgebra::DMatrix;
use scrnn::engine::InstructionSet;
use scrnn::kernels::padded;

/// What one measurement takes.
const BURST: Duration = Duration::from_millis(4);

const SIZES: [Size; 8] = [
    Size::new(60, 2, 6),
    Size::new(60, 2, 1),
    Size::new(10, 1, 1),
    Size::new(10, 1, 5),
    Size::new(40, 8, 6),
    Size::new(256, 2, 6),
    Size::new(256, 2, 24),
    Size::new(1024, 2, 24),
];

fn main() {
    let arguments = Arguments::read(9);
    let (set, rounds) = (arguments.set, arguments.rounds);
    let peak = || peak_gflops(set, 1);
    println!("instruction set {set}, one thread, peak {:.1} GFLOP/s\n", median((0..9).map(|_| peak()).collect()));
    println!("{:36} {:>11} {:>8} {:>6} {:>9} {:>8}", "", "time", "GFLOP/s", "peak", "nalgebra", "faster");
    for size in SIZES {
        let Size { units, channels, columns } = size;
        let name = |kernel: &str| format!("{kernel} {units} units x {columns}");
        let (all, inputs) = (size.all(), units + channels);
        let forward = size.forward(set);
        row(&name("forward"), rounds, set, all * inputs * columns, &forward, &Naive::new(all, inputs, columns));
        let backward = size.backward(set);
        row(&name("backward"), rounds, set, units * all * columns, &backward, &Naive::new(units, all, columns));
        if columns == 1 {
            let bytes = 8 * padded(all) * inputs;
            let read = median((0..9).map(|_| read_gbytes(set, bytes)).collect());
            println!("{:36} {:>11} {:8.1}", "  as fast as its weights are read", "", read / 4.0);
        }
    }
    for (units, channels) in [(10, 1), (40, 8), (60, 2), (256, 2), (1024, 2)] {
        let size = Size::new(units, channels, 1);
        let (all, outer) = (size.all(), size.gradient());
        let (inputs, count) = (outer.inner, outer.count);
        let name = format!("gradient {units} units, {count} rows");
        row(&name, rounds, set, all * inputs * count, &outer, &Naive::new(all, count, inputs));
    }
    println!();
    elements("tanh", set, rounds, true, f64::tanh);
    elements("exp", set, rounds, false, f64::exp);
}

/// Prints one line: `terms` multiply-adds by the kernel and by nalgebra, alternating with the peak.
fn row(name: &str, rounds: usize, set: InstructionSet, terms: usize, kernel: &impl Kernel, naive: &Naive) {
    let mut out = values(kernel.len());
    let mut times = Vec::new();
    let (mut shares, mut naive_times) = (Vec::new(), Vec::new());
    let operations = 2.0 * terms as f64;
    for _ in 0..rounds {
        let peak = peak_gflops(set, 1);
        let seconds = seconds_per_call(BURST, |calls| on(set, Repeat { kernel, out: &mut out, calls }));
        times.push(seconds);
        shares.push(operations / seconds / 1e9 / peak);
        naive_times.push(naive.seconds());
    }
    let (seconds, naive) = (median(times), median(naive_times));
    println!(
        "{name:36} {:8.2} us {:8.1} {:5.0}% {:9.1} {:7.1}x",
        1e6 * seconds,
        operations / seconds / 1e9,
        100.0 * median(shares),
        operations / naive / 1e9,
        naive / seconds
    );
}

/// A product of the same size by nalgebra, into memory that is there.
struct Naive {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
}

impl Naive {
    fn new(rows: usize, inner: usize, columns: usize) -> Self {
        let a = DMatrix::from_column_slice(rows, inner, &values(rows * inner));
        Self { a, b: DMatrix::from_column_slice(inner, columns, &values(inner * columns)) }
    }

    fn seconds(&self) -> f64 {
        let mut out = DMatrix::zeros(self.a.nrows(), self.b.ncols());
        seconds_per_call(BURST, |calls| {
            for _ in 0..calls {
                black_box(&mut out).gemm(1.0, black_box(&self.a), &self.b, 0.0);
            }
        })
    }
}

/// Prints the time of a function by the element, and that of the standard library.
fn elements(name: &str, set: InstructionSet, rounds: usize, hyperbolic: bool, standard: impl Fn(f64) -> f64) {
    let source = values(4096);
    let kernel = Elements { source: &source, hyperbolic };
    let mut out = values(source.len());
    let (mut fast, mut plain) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        fast.push(seconds_per_call(BURST, |calls| on(set, Repeat { kernel: &kernel, out: &mut out, calls })));
        plain.push(seconds_per_call(BURST, |calls| {
            for _ in 0..calls {
                for (out, x) in black_box(&mut out).iter_mut().zip(source.iter()) {
                    *out = standard(*x);
                }
            }
        }));
    }
    let per_element = |times| 1e9 * median(times) / source.len() as f64;
    let (fast, plain) = (per_element(fast), per_element(plain));
    println!("{name:6} {fast:5.2} ns an element; std {plain:5.2} ns, {:.1}x", plain / fast);
}
