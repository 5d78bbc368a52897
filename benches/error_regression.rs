//! What a robot waits for: one control step of error regression.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench error_regression [-- [--only 30] [--json] [--rounds 300] [--instruction-set avx2]]
//! ```
//!
//! An S-CTRNN of 60 units on 2 channels regresses 100 times over windows of 10, 30 and 100 steps; an S-MTRNN as in the
//! thesis' chapter 5 (30 fast and 10 slow units, 8 channels, delay 5) 10 times over 20 steps. Every sample is timed once
//! the window is full.

mod arguments;
mod machine;

use std::time::Instant;

use arguments::Arguments;
use machine::{median, peak_gflops};
use scrnn::engine::Engine;
use scrnn::error_regression::{Ascent, ErrorRegression, ErrorRegressionOptions};
use scrnn::initialization::initialize;
use scrnn::topology::{Group, Prediction, Topology};
use serde_json::{Value, json};

/// A network and how it regresses.
struct Case {
    name: &'static str,
    topology: Topology,
    window: usize,
    iterations: usize,
}

fn cases() -> Vec<Case> {
    let s_ctrnn = |name, window| Case {
        name,
        topology: Topology::s_ctrnn(2, 60, 2.0).expect("sizes above 0"),
        window,
        iterations: 100,
    };
    let groups = vec![Group::fast(30, 5.0), Group::slow(10, 100.0)];
    let interaction = Topology::new(8, 5, groups, Prediction::MeanAndVariance { floor: 0.0 });
    let interaction = interaction.expect("sizes above 0");
    vec![
        s_ctrnn("window-10", 10),
        s_ctrnn("window-30", 30),
        s_ctrnn("window-100", 100),
        Case { name: "interaction", topology: interaction, window: 20, iterations: 10 },
    ]
}

impl Case {
    /// Useful operations of one control step: passes forward and back, and one pass forward more at the end.
    fn operations(&self) -> f64 {
        let (c, x, o) = (self.topology.context_units(), self.topology.channels(), self.topology.output_units());
        let (forward, backward) = (2 * (c * c + c * x + c * o), 2 * (c * c + c * x + c * o));
        (self.window * (self.iterations * (forward + backward) + forward)) as f64
    }

    /// Sorted seconds of `count` control steps.
    fn seconds(&self, arguments: &Arguments, count: usize) -> Vec<f64> {
        let (network, states) = initialize(&self.topology, 1, 1);
        let channels = self.topology.channels();
        let options = ErrorRegressionOptions::with(channels, |it| {
            it.window = self.window;
            it.iterations = self.iterations;
            it.ascent = Ascent::Adam { rate: 0.01 };
        });
        let regression = ErrorRegression::new(
            &network,
            states.sequence(0),
            options,
            &Engine::new(1, arguments.set).expect("this processor has it"),
        );
        let mut regression = regression.expect("options in their range");
        let full = self.window + self.topology.delay();
        let mut seconds = Vec::with_capacity(count);
        let mut sample = vec![0.0; channels];
        for t in 0..full + count {
            for (i, x) in sample.iter_mut().enumerate() {
                *x = 0.6 * (0.25 * t as f64 + i as f64).sin();
            }
            let start = Instant::now();
            let done = regression.observe(&sample, &mut || true).expect("finite samples");
            if t >= full {
                assert_eq!((done.steps, done.iterations), (self.window, self.iterations));
                seconds.push(start.elapsed().as_secs_f64());
            }
        }
        seconds.sort_by(f64::total_cmp);
        seconds
    }
}

fn main() {
    let arguments = Arguments::read(300);
    let peak = peak_gflops(arguments.set, 1);
    let mut report = Vec::<Value>::new();
    println!("instruction set {}, peak {peak:.1} GFLOP/s, one thread\n", arguments.set);
    println!(
        "{:12} {:>5} {:>7} {:>10} {:>10} {:>10} {:>5}",
        "", "steps", "its", "median ms", "99 % ms", "max ms", "peak"
    );
    for case in cases() {
        if arguments.value("--only").is_some_and(|only| !case.name.ends_with(only)) {
            continue;
        }
        let seconds = case.seconds(&arguments, arguments.rounds);
        let at = |share: f64| 1e3 * seconds[(share * (seconds.len() - 1) as f64).round() as usize];
        let (middle, late, max) = (1e3 * median(seconds.clone()), at(0.99), at(1.0));
        let of_peak = case.operations() / (middle * 1e6) / peak;
        println!(
            "{:12} {:5} {:7} {middle:10.3} {late:10.3} {max:10.3} {:4.0}%",
            case.name,
            case.window,
            case.iterations,
            100.0 * of_peak
        );
        report.push(json!({
            "case": case.name, "window": case.window, "iterations": case.iterations, "samples": seconds.len(),
            "milliseconds": { "median": middle, "p99": late, "max": max }, "share_of_peak": of_peak,
        }));
    }
    if arguments.has("--json") {
        println!("{:#}", Value::Array(report));
    }
}
