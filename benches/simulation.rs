//! The closed loop of the reaching experiment: a network of the thesis' size drives NAO for a cycle of touch and retraction,
//! six seconds of simulated time.
//!
//! ```text
//! cargo bench -p scrnn-checks --bench simulation
//! ```
//!
//! Throughput is in simulated seconds a second, so that it is how many times faster than real time the loop runs.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use scrnn::engine::Engine;
use scrnn::initialization::initialize;
use scrnn::scaling::Scaling;
use scrnn::topology::Topology;
use scrnn_sim::reach::agent::{NetworkDriver, Noise, Performance, Replay, perform_unobserved};
use scrnn_sim::reach::stage::{CYCLE, PERIOD, POSITIONS, retracted_arm, touching_arm};
use scrnn_sim::reach::tutor::{Tutoring, demonstrate};
use scrnn_sim::robot::nao;
use scrnn_sim::world::WorldOptions;

fn performance() -> Performance {
    Performance { y: POSITIONS[1], samples: CYCLE, shift: None, frozen: None, world: WorldOptions::default() }
}

fn simulation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("simulation");
    group.throughput(Throughput::Elements((CYCLE as f64 * PERIOD) as u64));
    group.sample_size(10).measurement_time(Duration::from_secs(5));

    // Untrained: where the arm goes makes no difference to what a step costs.
    let topology = Topology::s_ctrnn(6, 30, 2.0).expect("sizes above 0");
    let (network, states) = initialize(&topology, 1, 1);
    let scaling = Scaling::new(vec![0.0; 6], vec![1.0; 6]).expect("scales other than 0");
    group.bench_function("closed_loop", |bencher| {
        bencher.iter(|| {
            let engine = Engine::serial();
            let driver = NetworkDriver::new(&network, states.mean(), &scaling, &Noise::Predicted, 1, &engine);
            let mut driver = driver.expect("a network on six channels");
            black_box(perform_unobserved(&performance(), &mut driver).expect("a stage with a robot"))
        });
    });

    // With the contact that an untrained network does not make.
    let robot = nao::load_one_armed().expect("the description that ships");
    let y = POSITIONS[1];
    let near = touching_arm(&robot, y, [0.0; 3], &[0.0; 4]).expect("within reach");
    let far = retracted_arm(&robot, y).expect("within reach");
    group.bench_function("touch_and_retract", |bencher| {
        bencher.iter(|| {
            let arms = [[far; CYCLE / 2], [near; CYCLE / 2]].concat();
            let mut driver = Replay::new(arms).expect("twelve arms");
            let performed = perform_unobserved(&performance(), &mut driver).expect("a stage with a robot");
            assert!(performed.cycles.iter().any(|cycle| cycle.touched));
            black_box(performed)
        });
    });

    group.bench_function("demonstration", |bencher| {
        let tutoring = Tutoring { sequences: 1, samples: CYCLE, ..Tutoring::default() };
        bencher.iter(|| black_box(demonstrate(&tutoring, 1, 1).expect("one demonstration")));
    });
    group.finish();
}

criterion_group!(benches, simulation);
criterion_main!(benches);
