//! Epochs as shares of the machine's peak, beside the plain nalgebra path, and how their cost grows.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench share_of_peak
//!     [-- [--only lissajous|grid|steps] [--json] [--rounds 5] [--instruction-set avx2]]
//! ```
//!
//! Every round measures the peak, an epoch on one thread, the peak of two threads, an epoch on two, and an epoch by
//! nalgebra, one after the other; what is printed are medians over the rounds, and as "best" the fastest epoch on one
//! thread against the highest peak. Only useful operations count: products
//! with weights that exist, 2 (3 C^2 + 2 C I + 3 C N_out) for each step of each sequence.

mod arguments;
mod cache;
mod machine;
mod plain_nalgebra;
mod training;

use std::ops::ControlFlow;
use std::time::Duration;

use arguments::Arguments;
use cache::read_gbytes;
use machine::{median, peak_gflops, seconds_per_call};
use scrnn::dataset::Dataset;
use scrnn::engine::{Engine, InstructionSet};
use scrnn::initialization::initialize;
use scrnn::kernels::padded;
use scrnn::learning::{EpochReport, Learner};
use scrnn::objective::Precision;
use scrnn::topology::Topology;
use scrnn_tasks::lissajous;
use serde_json::{Value, json};
use training::{Training, waves};

const UNITS: [usize; 7] = [16, 32, 64, 128, 256, 512, 1024];
const SEQUENCES: [usize; 5] = [1, 4, 12, 64, 256];
/// Channels of all shapes, as in the first task.
const CHANNELS: usize = 2;
/// Mean and variance units.
const OUTPUTS: usize = 2 * CHANNELS;
/// What one measurement takes at least.
const BURST: Duration = Duration::from_millis(30);

/// Sizes of an S-CTRNN and its data.
#[derive(Debug, Clone, Copy)]
struct Shape {
    units: usize,
    sequences: usize,
    steps: usize,
}

impl Shape {
    /// The first task of the thesis.
    const LISSAJOUS: Self = Self { units: 60, sequences: 12, steps: 1000 };

    fn topology(self) -> Topology {
        Topology::s_ctrnn(CHANNELS, self.units, 2.0).expect("sizes above 0")
    }

    /// Useful operations of one step of one sequence.
    fn operations(self) -> f64 {
        let c = self.units;
        (2 * (3 * c * c + 2 * c * CHANNELS + 3 * c * OUTPUTS)) as f64
    }

    /// Useful operations of an epoch, in units of 1e9.
    fn giga(self) -> f64 {
        self.operations() * (self.sequences * self.steps) as f64 / 1e9
    }

    /// 1000 steps, or fewer where an epoch would take more than 40e9 operations.
    fn in_grid(units: usize, sequences: usize) -> Self {
        let whole = Self { units, sequences, steps: 1000 };
        Self { steps: ((40.0 / whole.giga() * 1000.0) as usize).clamp(100, 1000), ..whole }
    }
}

/// Medians over the rounds.
struct Measured {
    shape: Shape,
    /// Seconds of an epoch on one thread and on two.
    seconds: [f64; 2],
    /// Shares of the peak of as many threads.
    share: [f64; 2],
    /// The fastest epoch on one thread as a share of the highest peak: what a machine that others use gives when they rest.
    undisturbed: f64,
    /// Seconds of the plain nalgebra path, on one thread.
    nalgebra: f64,
    /// Of a single sequence: what reading the weights and computing the gradient would take, as a share of what it took.
    reach: Option<f64>,
}

fn main() {
    let arguments = Arguments::read(5);
    let only = if arguments.measures() { arguments.value("--only") } else { Some("lissajous") };
    let wants = |part: &str| only.is_none_or(|only| only == part);
    let measure_on = |shape: Shape, data| {
        eprintln!("{shape:?}");
        measure(shape, &data, arguments.rounds, arguments.set)
    };
    let measure = |shape: Shape| measure_on(shape, waves(&shape.topology(), shape.sequences, shape.steps));
    let first = wants("lissajous").then(|| {
        // One sample more than there are steps: every step has its target.
        let options = lissajous::Options { sequences: 12, steps: 1001 };
        measure_on(Shape::LISSAJOUS, lissajous::generate(&options, 1).expect("twelve curves").data)
    });
    let steps: Vec<_> = match wants("steps") {
        true => [100, 1000, 10_000].map(|steps| measure(Shape { steps, ..Shape::LISSAJOUS })).into(),
        false => Vec::new(),
    };
    let grid: Vec<_> = match wants("grid") {
        true => UNITS.iter().flat_map(|&c| SEQUENCES.map(|s| measure(Shape::in_grid(c, s)))).collect(),
        false => Vec::new(),
    };
    let peak = [1, 2].map(|threads| median((0..9).map(|_| peak_gflops(arguments.set, threads)).collect()));
    if arguments.has("--json") {
        let all = first.iter().chain(&steps).chain(&grid).map(Measured::json).collect::<Vec<_>>();
        let set = arguments.set.to_string();
        let report = json!({ "instruction_set": set, "peak_gflops": peak, "rounds": arguments.rounds, "epochs": all });
        println!("{report:#}");
    } else {
        println!("instruction set {}, peak {:.1} GFLOP/s, of two threads {:.1}\n", arguments.set, peak[0], peak[1]);
        table(first.iter().chain(&steps).chain(&grid));
        slopes(&steps, &grid);
        extremes(&grid);
    }
}

/// All on a thread of the two: were it another one that takes turns with both, the system would for a while leave both on one core.
fn measure(shape: Shape, data: &Dataset, rounds: usize, set: InstructionSet) -> Measured {
    let engines = [1, 2].map(|threads| Engine::new(threads, set).expect("an instruction set that this processor has"));
    engines[1].enter(|| measure_on(shape, data, rounds, &engines))
}

fn measure_on(shape: Shape, data: &Dataset, rounds: usize, engines: &[Engine; 2]) -> Measured {
    let (sequences, set) = (shape.sequences, engines[0].instruction_set());
    let topology = shape.topology();
    let mut trainings =
        engines.each_ref().map(|engine| Training::on(&topology, data, engine.clone(), Precision::default()));
    let (network, states) = initialize(&shape.topology(), sequences, 1);
    let mut plain = plain_nalgebra::Epoch::new(&network, &states, data);
    agree(&mut trainings[0].learner, &plain.run());

    let [mut seconds, mut shares] = [const { [const { Vec::new() }; 2] }; 2];
    let (mut fastest, mut highest) = (f64::INFINITY, 0.0_f64);
    let (mut nalgebra, mut reach) = (Vec::new(), Vec::new());
    let epochs = trainings.each_mut().map(|training| {
        let one = training.time(1).max(Duration::from_micros(1));
        BURST.as_micros().div_ceil(one.as_micros()) as u64
    });
    for _ in 0..rounds {
        for (index, training) in trainings.iter_mut().enumerate() {
            let peak = peak_gflops(set, index + 1);
            let time = training.time(epochs[index]).as_secs_f64() / epochs[index] as f64;
            seconds[index].push(time);
            shares[index].push(shape.giga() / time / peak);
            if index == 0 {
                (fastest, highest) = (fastest.min(time), highest.max(peak));
            }
            if index == 0 && sequences == 1 {
                reach.push(floor(shape, peak, set) / time);
            }
        }
        nalgebra.push(seconds_per_call(BURST, |calls| {
            for _ in 0..calls {
                std::hint::black_box(plain.run());
            }
        }));
    }
    let reach = (!reach.is_empty()).then(|| median(reach));
    let undisturbed = shape.giga() / fastest / highest;
    Measured {
        shape,
        seconds: seconds.map(median),
        share: shares.map(median),
        undisturbed,
        nalgebra: median(nalgebra),
        reach,
    }
}

/// Both paths must compute the same thing.
fn agree(learner: &mut Learner, plain: &plain_nalgebra::Gradient) {
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
    let _ = learner.run(&mut |report: &EpochReport, _: &Learner| {
        let (ours, theirs) = (report.ln_likelihood, plain.ln_likelihood);
        assert!(close(ours, theirs), "ln L is {ours}, by nalgebra {theirs}");
        // The report's length is for one step and channel.
        let terms = -report.ln_likelihood / report.nll.expect("an S-CTRNN has variance units");
        let (ours, theirs) = (report.gradient_norm, plain.norm() / terms);
        assert!(close(ours, theirs), "the gradient is {ours} long, by nalgebra {theirs}");
        ControlFlow::Break(())
    });
}

/// Seconds of an epoch of a single sequence if each step only read its weights, forward and back, from the cache that
/// holds them, and the weight gradient ran at the peak.
fn floor(shape: Shape, peak: f64, set: InstructionSet) -> f64 {
    let c = shape.units;
    let bytes = [padded(c + OUTPUTS) * (c + CHANNELS), padded(c) * (c + OUTPUTS)].map(|values| 8 * values);
    let reads: f64 = bytes.iter().map(|&bytes| bytes as f64 / read_gbytes(set, bytes)).sum();
    let gradient = (2 * (c * c + c * CHANNELS + c * OUTPUTS)) as f64 / peak;
    (reads + gradient) * shape.steps as f64 / 1e9
}

impl Measured {
    fn json(&self) -> Value {
        let Shape { units, sequences, steps } = self.shape;
        json!({
            "units": units, "sequences": sequences, "steps": steps,
            "milliseconds": self.seconds.map(|seconds| 1e3 * seconds),
            "gflops": self.seconds.map(|seconds| self.shape.giga() / seconds),
            "share_of_peak": self.share,
            "share_of_peak_undisturbed": self.undisturbed,
            "nalgebra_milliseconds": 1e3 * self.nalgebra,
            "share_of_cache_bandwidth": self.reach,
        })
    }
}

fn table<'a>(all: impl Iterator<Item = &'a Measured>) {
    println!(
        "{:>5} {:>9} {:>6}  {:>9} {:>7} {:>5} {:>5}  {:>9} {:>7} {:>5} {:>6}  {:>9} {:>7} {:>6}",
        "units",
        "sequences",
        "steps",
        "ms",
        "GFLOP/s",
        "peak",
        "best",
        "ms, 2 thr",
        "GFLOP/s",
        "peak",
        "ratio",
        "nalgebra",
        "faster",
        "cache"
    );
    for Measured { shape, seconds: [one, two], share, undisturbed, nalgebra, reach } in all {
        println!(
            "{:5} {:9} {:6}  {:9.3} {:7.1} {:4.0}% {:4.0}%  {:9.3} {:7.1} {:4.0}% {:6.2}  {:9.3} {:6.1}x {:>6}",
            shape.units,
            shape.sequences,
            shape.steps,
            1e3 * one,
            shape.giga() / one,
            100.0 * share[0],
            100.0 * undisturbed,
            1e3 * two,
            shape.giga() / two,
            100.0 * share[1],
            one / two,
            1e3 * nalgebra,
            nalgebra / one,
            reach.map_or(String::new(), |reach| format!("{:.0}%", 100.0 * reach)),
        );
    }
}

/// The exponent of a power law through points of (size, cost), by least squares of the logarithms.
fn exponent(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let logs: Vec<(f64, f64)> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    covariance / logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum::<f64>()
}

/// Prints exponents: cost in proportion to a size has exponent 1.
fn slopes(steps: &[Measured], grid: &[Measured]) {
    let per_step = |m: &Measured| m.seconds[0] / m.shape.steps as f64;
    if !steps.is_empty() {
        let points = steps.iter().map(|m| (m.shape.steps as f64, m.seconds[0]));
        println!("\ncost grows with steps to the power {:.3}", exponent(points));
    }
    if grid.is_empty() {
        return;
    }
    println!("\ncost of a step grows with sequences to the power");
    for units in UNITS {
        let points = grid.iter().filter(|m| m.shape.units == units && m.shape.sequences >= 4);
        println!("  {units:4} units: {:.3}", exponent(points.map(|m| (m.shape.sequences as f64, per_step(m)))));
    }
    println!("cost of a step grows with weights to the power");
    for sequences in SEQUENCES {
        let points = grid.iter().filter(|m| m.shape.sequences == sequences && m.shape.units >= 32);
        println!("  {sequences:3} sequences: {:.3}", exponent(points.map(|m| (m.shape.operations(), per_step(m)))));
    }
}

/// Prints where the grid is worst.
fn extremes(grid: &[Measured]) {
    let line = |what: &str, least: Option<(f64, &Measured)>| {
        if let Some((value, Measured { shape, .. })) = least {
            println!("{what}: {value:.2}, at {} units, {} sequences", shape.units, shape.sequences);
        }
    };
    let least = |of: &dyn Fn(&Measured) -> Option<f64>| {
        let values = grid.iter().filter_map(|m| of(m).map(|value| (value, m)));
        values.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    println!();
    let many = |m: &Measured| m.shape.sequences >= 4;
    line(
        "least share of peak from 32 units and 4 sequences on",
        least(&|m| (many(m) && m.shape.units >= 32).then_some(m.share[0])),
    );
    line("least share of what the cache allows a single sequence", least(&|m| m.reach));
    line("least speed in terms of nalgebra's", least(&|m| Some(m.nalgebra / m.seconds[0])));
    line(
        "least gain by a second thread from 4 sequences on",
        least(&|m| many(m).then_some(m.seconds[0] / m.seconds[1])),
    );
}
