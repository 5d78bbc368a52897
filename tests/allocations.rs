//! What is promised to allocate nothing allocates nothing. (On several threads: `memory.rs`.)

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::error_regression::{Ascent, ErrorRegression, ErrorRegressionOptions};
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Lbfgs, Learner, Momentum, Optimiser, Plan, PriorStep};
use scrnn::topology::{Group, Prediction, Topology};
use std::ops::ControlFlow;

fn wave(steps: usize) -> Vec<f64> {
    (0..2 * steps).map(|k| 0.6 * (0.3 * k as f64).sin()).collect()
}

#[test]
fn a_control_step_of_error_regression_allocates_nothing() {
    let groups = vec![Group::fast(20, 2.0), Group::slow(7, 30.0)];
    let topology = Topology::new(2, 3, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
    let (network, states) = initialize(&topology, 1, 1);
    let momentum = Ascent::Momentum { rate: 1e-3, momentum: 0.9 };
    for set in InstructionSet::available() {
        // The default is L-BFGS, guarded.
        for (ascent, all) in [(None, false), (Some(momentum), true), (Some(Ascent::Adam { rate: 0.05 }), false)] {
            let options = ErrorRegressionOptions::with(2, |it| {
                it.window = 9;
                it.ascent = ascent.unwrap_or(it.ascent);
                if all {
                    (it.keep_best, it.tolerance, it.guard) = (true, Some(1e-3), Some(true));
                }
            });
            let mut regression =
                ErrorRegression::new(&network, states.sequence(0), options, &Engine::new(1, set).unwrap()).unwrap();
            let samples = wave(40);
            let counted = allocation_counter::measure(|| {
                for sample in samples.chunks(2) {
                    regression.observe(sample, &mut || true).unwrap();
                }
            });
            assert_eq!((counted.count_total, regression.window()), (0, 9), "{set}, {ascent:?}");
        }
    }
}

#[test]
fn after_the_first_epochs_an_epoch_allocates_nothing() {
    let sequences = [30, 45, 12].map(|steps| Sequence::new("", 2, wave(steps)).unwrap());
    let data = Dataset::new(Dataset::numbered_channels(2), sequences.to_vec()).unwrap();
    let topology = Topology::s_ctrnn(2, 13, 2.0).unwrap();
    let in_batches = Optimiser::Adam(Adam::with(|it| {
        it.batch_size = 2;
    }));
    let momentum = || Optimiser::Momentum(Momentum::default());
    for (recompute, optimiser, share) in [
        (false, momentum(), 0.0),
        (true, momentum(), 0.0),
        (
            false,
            Optimiser::Momentum(Momentum::with(|it| {
                it.prior = PriorStep::Thesis;
            })),
            0.0,
        ),
        (false, in_batches.clone(), 0.0),
        // L-BFGS from the start, and from the tenth of twenty epochs on.
        (false, momentum(), 1.0),
        (false, in_batches, 0.5),
    ] {
        let (network, states) = initialize(&topology, 3, 1);
        let lbfgs = (share > 0.0).then_some(Lbfgs::with(|it| {
            it.share = share;
            it.memory = 4;
        }));
        let plan = Plan::with(|it| {
            it.epochs = 20;
            it.recompute = recompute;
            it.optimiser = optimiser.clone();
            it.lbfgs = lbfgs;
        });
        let mut learner = Learner::new(network, states, &data, plan, &Engine::serial()).unwrap();
        // Counting begins and ends inside of the training, where the observer stands.
        let mut epochs = 0;
        let _ = learner.run(&mut |_: &EpochReport, _: &Learner| {
            epochs += 1;
            if epochs < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        let counted = allocation_counter::measure(|| {
            let _ = learner.run(&mut |_: &EpochReport, _: &Learner| {
                epochs += 1;
                if epochs < 15 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
        });
        assert_eq!((epochs, counted.count_total), (15, 0), "{optimiser:?}, recompute {recompute}, L-BFGS {share}");
    }
}
