//! Another way to compute, put in from outside: plain loops and differences in place of the engine.

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::error::Result;
use scrnn::initialization::initialize;
use scrnn::learning::{Adam, EpochReport, Lbfgs, Learner, Momentum, Optimiser, Plan};
use scrnn::likelihood;
use scrnn::network::Network;
use scrnn::objective::{Backend, Evaluation, Objective, Request, Run, Want};
use scrnn::parameters::Parameters;
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn::topology::Topology;
use std::ops::ControlFlow;

/// Counts nothing, remembers nothing, and is slow.
struct Differences;

#[derive(Debug)]
struct ByDifferences {
    network: Network,
    data: Dataset,
}

impl Backend for Differences {
    fn objective(&self, request: &Request<'_>) -> Result<Box<dyn Objective>> {
        request.data.check_for(request.topology)?;
        let topology = request.topology.clone();
        let parameters = Parameters::zeros(&topology);
        let network = Network::new(topology, parameters)?;
        Ok(Box::new(ByDifferences { network, data: request.data.clone() }))
    }
}

/// Fourth-order central difference.
fn slope(mut value: impl FnMut(f64) -> f64) -> f64 {
    let h = 1e-3;
    (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h)
}

impl ByDifferences {
    fn score(&self, run: Run, initial: &[f64]) -> (f64, f64) {
        likelihood::plain(&self.network, initial, self.data.sequences()[run.sequence].values(), run.steps).unwrap()
    }
}

impl Objective for ByDifferences {
    fn set_parameters(&mut self, parameters: &Parameters) {
        self.network.parameters_mut().copy_from_slice(parameters.as_slice());
    }

    fn evaluate(&mut self, runs: &[Run], initial: &[f64], want: Want, evaluation: &mut Evaluation) {
        evaluation.resize(runs.len());
        let units = self.network.topology().context_units();
        let starts = || runs.iter().zip(initial.chunks_exact(units));
        for (index, (run, u0)) in starts().enumerate() {
            (evaluation.ln_likelihood[index], evaluation.squared_error[index]) = self.score(*run, u0);
            if want != Want::Score {
                for i in 0..units {
                    let mut moved = u0.to_vec();
                    evaluation.initial[index * units + i] = slope(|h| {
                        moved[i] = u0[i] + h;
                        self.score(*run, &moved).0
                    });
                }
            }
        }
        if want == Want::Everything {
            for k in 0..self.network.parameters().as_slice().len() {
                let at = self.network.parameters().as_slice()[k];
                let all = slope(|h| {
                    self.network.parameters_mut()[k] = at + h;
                    starts().map(|(run, u0)| self.score(*run, u0).0).sum()
                });
                self.network.parameters_mut()[k] = at;
                evaluation.gradients.as_mut_slice()[k] = all;
            }
        }
    }

    fn numerics(&self) -> &str {
        "differences"
    }
}

fn data() -> Dataset {
    let of = |s: usize| {
        let values = (0..14 + s).map(|t| 0.5 * (0.5 * t as f64 + s as f64).sin()).collect();
        Sequence::new("", 1, values).unwrap()
    };
    Dataset::new(vec!["y".into()], (0..3).map(of).collect()).unwrap()
}

#[test]
fn learning_and_recognition_compute_on_whatever_backend_they_get() {
    let topology = Topology::s_ctrnn(1, 3, 2.0).unwrap();
    let in_batches = Optimiser::Adam(Adam::with(|it| {
        it.batch_size = 2;
    }));
    let momentum = Optimiser::Momentum(Momentum::with(|it| {
        it.rate = 0.01;
    }));
    for (optimiser, lbfgs) in [
        (
            in_batches,
            Some(Lbfgs::with(|it| {
                it.share = 0.2;
                it.memory = 3;
            })),
        ),
        (momentum, None),
    ] {
        let learn = |backend: &dyn Backend| {
            let plan = Plan::with(|it| {
                it.epochs = 15;
                it.optimiser = optimiser.clone();
                it.lbfgs = lbfgs.clone();
            });
            let (network, states) = initialize(&topology, 3, 7);
            let mut learner = Learner::new(network, states, &data(), plan, backend).unwrap();
            let mut history = Vec::new();
            let _ = learner.run(&mut |report: &EpochReport, _: &Learner| {
                history.push(report.ln_likelihood);
                ControlFlow::Continue(())
            });
            let options = RecognitionOptions::with(|it| {
                it.starts = 3;
                it.epochs = 10;
            });
            let found = recognize(learner.network(), learner.initial_states(), &data(), &options, backend).unwrap();
            history.extend(found.iter().flat_map(|one| one.trials.iter().map(|trial| trial.ln_likelihood)));
            (learner.numerics().to_owned(), history)
        };
        let (engine, differences) = (learn(&Engine::serial()), learn(&Differences));
        assert_eq!((engine.0.as_str(), differences.0.as_str()), ("f64", "differences"));
        assert!(engine.1[15] > engine.1[0]);
        for (a, b) in engine.1.iter().zip(&differences.1) {
            assert!((a - b).abs() < 1e-5 * (1.0 + a.abs()), "{a} and {b}");
        }
    }
}
