//! Networks in training at given sizes, and the time that their epochs take.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Learner, Optimiser, Plan};
use scrnn::objective::Precision;
use scrnn::topology::Topology;

/// Smooth sequences that give `steps` steps of prediction each, between -0.8 and 0.8, no two alike.
pub fn waves(topology: &Topology, sequences: usize, steps: usize) -> Dataset {
    let channels = topology.channels();
    let samples = steps + topology.delay();
    let value = |s: usize, t: usize, i: usize| 0.8 * ((0.05 + 0.01 * s as f64) * t as f64 + 1.7 * i as f64).sin();
    let sequence = |s: usize| {
        let values = (0..samples * channels).map(|k| value(s % 29, k / channels, k % channels)).collect();
        Sequence::new((s + 1).to_string(), channels, values).expect("whole samples")
    };
    let sequences = (0..sequences).map(sequence).collect();
    Dataset::new(Dataset::numbered_channels(channels), sequences).expect("finite samples on the same channels")
}

/// A network in training.
pub struct Training {
    /// The learner, made but not run.
    pub learner: Learner,
    engine: Engine,
}

impl Training {
    /// A new network on `data`, in float64, with Adam on a schedule so long that its rate stays near 0: all epochs cost the same.
    #[allow(dead_code, reason = "one bench compares precisions and names both")]
    pub fn new(topology: &Topology, data: &Dataset, threads: usize, set: InstructionSet) -> Self {
        Self::with(topology, data, threads, set, Precision::F64)
    }

    /// The same in a precision.
    pub fn with(
        topology: &Topology,
        data: &Dataset,
        threads: usize,
        set: InstructionSet,
        precision: Precision,
    ) -> Self {
        let engine = Engine::new(threads, set).expect("an instruction set that this processor has");
        Self::on(topology, data, engine, precision)
    }

    /// The same on an engine.
    pub fn on(topology: &Topology, data: &Dataset, engine: Engine, precision: Precision) -> Self {
        let (network, states) = initialize(topology, data.sequences().len(), 1);
        let plan = Plan::with(|it| {
            it.epochs = 1 << 50;
            it.precision = precision;
            it.optimiser = Optimiser::Adam(Adam::default());
        });
        let learner = Learner::new(network, states, data, plan, &engine).expect("data made for the network");
        Self { learner, engine }
    }

    /// The time of `epochs` epochs, each an update and the evaluation after it. What comes before the first and after
    /// the last is left out.
    pub fn time(&mut self, epochs: u64) -> Duration {
        let (mut seen, mut start, mut elapsed) = (0, Instant::now(), Duration::ZERO);
        let Self { learner, engine } = self;
        let mut watch = |_: &EpochReport, _: &Learner| {
            if seen == 0 {
                start = Instant::now();
            } else if seen == epochs {
                elapsed = start.elapsed();
                return ControlFlow::Break(());
            }
            seen += 1;
            ControlFlow::Continue(())
        };
        // As a training runs in the program.
        let _ = engine.enter(|| learner.run(&mut watch));
        assert!(seen == epochs, "the training ended after {seen} of {epochs} epochs");
        elapsed
    }
}
