//! The kernels by themselves, as shares of the peak that is measured in the same run, and the same products by nalgebra.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench kernels [-- [--rounds 9] [--instruction-set avx2]]
//! ```

mod arguments;
mod cache;
mod machine;

use std::hint::black_box;
use std::time::Duration;

use aligned_vec::AVec;
use arguments::Arguments;
use cache::read_gbytes;
use machine::{median, on, peak_gflops, seconds_per_call};
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};
use scrnn::engine::InstructionSet;
use scrnn::kernels::activation::{exp_slice, tanh_rows};
use scrnn::kernels::outer::{Rows, accumulate};
use scrnn::kernels::panels::{Columns, Panels, Product, chains_for, multiply};
use scrnn::kernels::{padded, stride};

/// What one measurement takes.
const BURST: Duration = Duration::from_millis(4);

/// Sizes of a network and the columns of a block.
#[derive(Clone, Copy)]
struct Size {
    units: usize,
    channels: usize,
    columns: usize,
}

impl Size {
    const fn new(units: usize, channels: usize, columns: usize) -> Self {
        Self { units, channels, columns }
    }

    /// Mean and variance units.
    fn outputs(self) -> usize {
        2 * self.channels
    }
}

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
        let (all, inputs) = (units + size.outputs(), units + channels);
        let forward = Fixture::new(all, &[channels, units], columns, set);
        row(&name("forward"), rounds, set, all * inputs * columns, &forward, &Naive::new(all, inputs, columns));
        let backward = Fixture::new(units, &[all], columns, set);
        row(&name("backward"), rounds, set, units * all * columns, &backward, &Naive::new(units, all, columns));
        if columns == 1 {
            let bytes = 8 * padded(all) * inputs;
            let read = median((0..9).map(|_| read_gbytes(set, bytes)).collect());
            println!("{:36} {:>11} {:8.1}", "  as fast as its weights are read", "", read / 4.0);
        }
    }
    for (units, channels) in [(10, 1), (40, 8), (60, 2), (256, 2), (1024, 2)] {
        let size = Size::new(units, channels, 1);
        // As many rows as a segment has in training.
        let (all, inputs) = (units + size.outputs(), units + channels + 1);
        let count = ((448 << 10) / (8 * (stride(all) + stride(padded(all) + inputs)))).max(64);
        let name = format!("gradient {units} units, {count} rows");
        let outer = Outer::new(all, inputs, count);
        row(&name, rounds, set, all * inputs * count, &outer, &Naive::new(all, count, inputs));
    }
    println!();
    elements("tanh", set, rounds, true, f64::tanh);
    elements("exp", set, rounds, false, f64::exp);
}

/// A kernel with its data, ready to run.
trait Kernel {
    fn run<S: Simd>(&self, simd: S, out: &mut [f64]);
    /// Length of `out`.
    fn len(&self) -> usize;
}

struct Repeat<'a, K> {
    kernel: &'a K,
    out: &'a mut [f64],
    calls: u32,
}

impl<K: Kernel> WithSimd for Repeat<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for _ in 0..self.calls {
            self.kernel.run(simd, black_box(&mut *self.out));
        }
    }
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

/// Values between -1 and 1 that do not repeat, aligned as in training.
fn values(count: usize) -> AVec<f64> {
    AVec::from_iter(64, (0..count).map(|k| (k as f64 * 0.618_033_988_75).fract() * 2.0 - 1.0))
}

/// A product with one or two matrices, laid out as in training.
struct Fixture {
    matrices: Vec<Panels>,
    columns: usize,
    rows: usize,
    state: AVec<f64>,
    state_stride: usize,
    start: AVec<f64>,
}

impl Fixture {
    fn new(rows: usize, inner: &[usize], columns: usize, set: InstructionSet) -> Self {
        let matrix = |&inner: &usize| {
            let mut panels = Panels::zeros(rows, inner, chains_for::<f64>(rows), set);
            panels.fill(rows, |row, k| ((row * 7 + k * 3) as f64).sin() / inner as f64);
            panels
        };
        let state_stride = stride(padded(rows) + inner.iter().sum::<usize>());
        Self {
            matrices: inner.iter().map(matrix).collect(),
            columns,
            rows: padded(rows),
            state: values(columns * state_stride + state_stride),
            state_stride,
            start: values(padded(rows)),
        }
    }

    fn product<'a, const P: usize>(&'a self, matrices: [&'a Panels; P]) -> Product<'a, P> {
        let source = Columns { values: &self.state, stride: self.state_stride };
        Product { matrices, sources: [source; P], columns: self.columns, start: &self.start, ahead: &[] }
    }
}

impl Kernel for Fixture {
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, out: &mut [f64]) {
        match self.matrices.as_slice() {
            [first, second] => multiply(simd, self.product([first, second]), out),
            [only] => multiply(simd, self.product([only]), out),
            _ => {}
        }
    }

    fn len(&self) -> usize {
        self.columns * self.rows
    }
}

/// The weight gradient of a segment.
struct Outer {
    rows: usize,
    inner: usize,
    count: usize,
    delta: AVec<f64>,
    delta_stride: usize,
    state: AVec<f64>,
    state_stride: usize,
}

impl Outer {
    fn new(rows: usize, inner: usize, count: usize) -> Self {
        let (delta_stride, state_stride) = (stride(padded(rows)), stride(inner));
        Self {
            rows: padded(rows),
            inner,
            count,
            delta: values((count + 1) * delta_stride),
            delta_stride,
            state: values((count + 1) * state_stride),
            state_stride,
        }
    }
}

impl Kernel for Outer {
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, out: &mut [f64]) {
        let delta = Rows { values: &self.delta, stride: self.delta_stride };
        let state = Rows { values: &self.state, stride: self.state_stride };
        accumulate(simd, delta, state, self.count, self.rows, (0, self.inner), out);
    }

    fn len(&self) -> usize {
        self.rows * self.inner
    }
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

struct Elements<'a> {
    source: &'a [f64],
    hyperbolic: bool,
}

impl Kernel for Elements<'_> {
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, out: &mut [f64]) {
        if self.hyperbolic {
            tanh_rows(simd, self.source, out);
        } else {
            out.copy_from_slice(self.source);
            exp_slice(simd, 1.0, out);
        }
    }

    fn len(&self) -> usize {
        self.source.len()
    }
}
