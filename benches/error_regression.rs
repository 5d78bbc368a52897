//! What a robot waits for: one control step of error regression, and how good what it comes to is.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench error_regression [-- [--only 30] [--json] [--rounds 300] [--instruction-set avx2] [--epochs 2000]]
//! ```
//!
//! An S-CTRNN of 60 units has learned the Lissajous curves, an S-MTRNN as in the thesis' chapter 5 (30 fast and 10 slow units, 8
//! channels, delay 5) the interactions of two robots, both by Adam for 2000 epochs. They follow other recordings of these, over windows of
//! 10, 30 and 100 steps and of 20 steps, by each rule in turn, sample by sample. Every sample is timed once the window is full.

mod arguments;
mod machine;

use std::ops::ControlFlow;
use std::time::Instant;

use arguments::Arguments;
use machine::{median, peak_gflops};
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::error_regression::{Ascent, ErrorRegression, ErrorRegressionOptions};
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Learner, Optimiser, Plan};
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn::topology::{Group, Prediction, Topology};
use scrnn_tasks::{interact, lissajous};
use serde_json::{Value, json};

/// A network that has learned, and streams that it has not.
struct Subject {
    network: Network,
    state: Vec<f64>,
    streams: Vec<Sequence>,
}

impl Subject {
    /// 60 units on the twelve Lissajous curves.
    fn lissajous(engine: &Engine, epochs: u64) -> Self {
        let make = |seed| lissajous::generate(&lissajous::Options::default(), seed).expect("the thesis' sizes").data;
        Self::of(Topology::s_ctrnn(2, 60, 2.0).expect("sizes above 0"), &make(1), &make(77), engine, epochs)
    }

    /// Chapter 5's network, on its 32 orders.
    fn interaction(engine: &Engine, epochs: u64) -> Self {
        let make = |seed| interact::make(interact::size(), seed, 0).expect("the thesis' sizes").data;
        let (learned, others) = (make(1), make(77));
        let scaling = Scaling::fit(&learned, Scaling::RANGE);
        let groups = vec![Group::fast(30, 5.0), Group::slow(10, 100.0)];
        let topology = Topology::new(8, 5, groups, Prediction::MeanAndVariance { floor: 0.0 }).expect("sizes above 0");
        let [learned, others] = [learned, others].map(|data| scaling.apply(&data).expect("the same channels"));
        Self::of(topology, &learned, &others, engine, epochs)
    }

    fn of(topology: Topology, learned: &Dataset, others: &Dataset, engine: &Engine, epochs: u64) -> Self {
        let (network, states) = initialize(&topology, learned.sequences().len(), 1);
        let plan = Plan::with(|it| {
            it.epochs = epochs;
            it.optimiser = Optimiser::Adam(Adam::with(|it| (it.rate, it.clip_norm) = (5e-3, 1.0)));
        });
        let mut learner = Learner::new(network, states, learned, plan, engine).expect("data made for the network");
        let _ = learner.run(&mut |_: &EpochReport, _: &Learner| ControlFlow::Continue(()));
        let state = learner.initial_states().mean().to_vec();
        Self { network: learner.network().clone(), state, streams: others.sequences().to_vec() }
    }

    fn topology(&self) -> &Topology {
        self.network.topology()
    }

    /// Useful operations of a pass forward and back over one step, and of one forward alone.
    fn operations(&self) -> (usize, usize) {
        let topology = self.topology();
        let (c, x, o) = (topology.context_units(), topology.channels(), topology.output_units());
        let forward = 2 * (c * c + c * x + c * o);
        (2 * forward, forward)
    }
}

/// How one rule did.
struct Measured {
    rule: &'static str,
    iterations: usize,
    /// Sorted.
    seconds: Vec<f64>,
    /// Nats a step, on average over all samples.
    ln_likelihood: f64,
    passes: f64,
}

fn rules(subject: &Subject, window: usize) -> Vec<(&'static str, ErrorRegressionOptions)> {
    let channels = subject.topology().channels();
    let rule = |ascent, iterations| {
        ErrorRegressionOptions::with(channels, |it| {
            (it.window, it.iterations) = (window, iterations);
            it.ascent = ascent;
        })
    };
    let momentum = Ascent::Momentum { rate: 1e-4 / channels as f64, momentum: 0.9 };
    let own = |iterations| rule(ErrorRegressionOptions::new(channels).ascent, iterations);
    // What a guard takes over is as likely as the open loop's predictions, which says nothing of the ascent.
    let without_guard = |iterations| {
        let mut options = own(iterations);
        options.guard = Some(false);
        options
    };
    vec![
        ("Adam 0.05", rule(Ascent::Adam { rate: 0.05 }, 10)),
        ("Adam 0.01", rule(Ascent::Adam { rate: 0.01 }, 100)),
        ("momentum, the thesis' rate", rule(momentum, 100)),
        ("L-BFGS, guarded (default)", own(15)),
        ("L-BFGS, no guard", without_guard(15)),
        ("L-BFGS, 10 steps, no guard", without_guard(10)),
    ]
}

/// All rules over the same samples, in turns, until `count` of each are timed.
fn measure(subject: &Subject, window: usize, engine: &Engine, count: usize) -> Vec<Measured> {
    let rules = rules(subject, window);
    let full = window + subject.topology().delay();
    let mut found: Vec<Measured> = rules
        .iter()
        .map(|(rule, options)| Measured {
            rule,
            iterations: options.iterations,
            seconds: Vec::with_capacity(count),
            ln_likelihood: 0.0,
            passes: 0.0,
        })
        .collect();
    // A few streams, all from the beginning.
    let each = count.div_ceil(4) + full;
    for stream in subject.streams.iter().step_by((subject.streams.len() / 4).max(1)) {
        let new = |(_, options): &(_, ErrorRegressionOptions)| {
            ErrorRegression::new(&subject.network, &subject.state, options.clone(), engine)
                .expect("options in their range")
        };
        let mut regressions: Vec<ErrorRegression> = rules.iter().map(new).collect();
        for t in 0..each.min(stream.len()) {
            for (regression, found) in regressions.iter_mut().zip(&mut found) {
                let start = Instant::now();
                let done = regression.observe(stream.sample(t), &mut || true).expect("finite samples");
                if t >= full {
                    assert_eq!(done.steps, window);
                    found.seconds.push(start.elapsed().as_secs_f64());
                    found.ln_likelihood += done.ln_likelihood[1] / window as f64;
                    found.passes += done.passes as f64;
                }
            }
        }
    }
    for found in &mut found {
        let samples = found.seconds.len() as f64;
        found.seconds.sort_by(f64::total_cmp);
        (found.ln_likelihood, found.passes) = (found.ln_likelihood / samples, found.passes / samples);
    }
    found
}

fn main() {
    let arguments = Arguments::read(300);
    let usual = if arguments.measures() { 2000 } else { 1 };
    let epochs = arguments.value("--epochs").map_or(usual, |epochs| epochs.parse().expect("a number of epochs"));
    let peak = peak_gflops(arguments.set, 1);
    let engine = Engine::new(1, arguments.set).expect("this processor has it");
    let mut report = Vec::<Value>::new();
    println!("instruction set {}, peak {peak:.1} GFLOP/s, one thread, networks of {epochs} epochs\n", arguments.set);
    println!(
        "{:12} {:26} {:>5} {:>10} {:>6} {:>10} {:>10} {:>10} {:>5}",
        "", "", "steps", "nats/step", "passes", "median ms", "99 % ms", "max ms", "peak"
    );
    let wanted = |name: &str| arguments.value("--only").is_none_or(|only| name.ends_with(only));
    let windows = [("window-10", 10), ("window-30", 30), ("window-100", 100)];
    let mut cases: Vec<(&str, usize, usize)> = windows.iter().map(|(name, window)| (*name, *window, 0)).collect();
    cases.push(("interaction", 20, 1));
    cases.retain(|(name, ..)| wanted(name));
    let make: [&dyn Fn() -> Subject; 2] =
        [&|| Subject::lissajous(&engine, epochs), &|| Subject::interaction(&engine, epochs)];
    let subjects = [0, 1].map(|which| cases.iter().any(|case| case.2 == which).then(make[which]));
    for (name, window, which) in cases {
        let Some(subject) = &subjects[which] else { continue };
        for found in measure(subject, window, &engine, arguments.rounds) {
            let at = |share: f64| 1e3 * found.seconds[(share * (found.seconds.len() - 1) as f64).round() as usize];
            let (middle, late, max) = (1e3 * median(found.seconds.clone()), at(0.99), at(1.0));
            let (both, forward) = subject.operations();
            let operations = window as f64 * (found.passes * both as f64 + forward as f64);
            let of_peak = operations / (middle * 1e6) / peak;
            let Measured { rule, iterations, ln_likelihood, passes, .. } = &found;
            println!(
                "{name:12} {rule:26} {window:5} {ln_likelihood:10.4} {passes:6.1} {middle:10.3} {late:10.3} {max:10.3} {:4.0}%",
                100.0 * of_peak
            );
            report.push(json!({
                "case": name, "rule": rule, "window": window, "iterations": iterations, "passes": passes,
                "nats_per_step": ln_likelihood, "samples": found.seconds.len(),
                "milliseconds": { "median": middle, "p99": late, "max": max }, "share_of_peak": of_peak,
            }));
        }
    }
    if arguments.has("--json") {
        println!("{:#}", Value::Array(report));
    }
}
