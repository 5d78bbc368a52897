//! The gradient of error regression, what it finds, and what it refuses.

use super::*;
use crate::engine::Engine;
use crate::forward::Plain;
use crate::generation::{Feedback, GenerationOptions, Start, generate};
use crate::initialization::initialize;
use crate::likelihood::ln_gaussian;
use crate::topology::{Group, Prediction, Topology};

#[path = "error_regression/lbfgs_tests.rs"]
mod lbfgs;

/// A network of uneven sizes with weights that matter.
fn network(delay: usize, variance: bool, groups: Vec<Group>) -> Network {
    let prediction = if variance { Prediction::MeanAndVariance { floor: 0.01 } } else { Prediction::Mean };
    let topology = Topology::new(3, delay, groups, prediction).unwrap();
    let (mut network, _) = initialize(&topology, 1, 11);
    for (k, w) in network.parameters.as_mut_slice().iter_mut().enumerate() {
        *w = 3.0 * *w + 0.2 * (1.3 * k as f64).sin();
    }
    network
}

fn fast_and_slow() -> Vec<Group> {
    vec![Group::fast(9, 2.0), Group::slow(4, 8.0)]
}

fn sample(t: usize) -> [f64; 3] {
    let t = t as f64;
    [0.6 * (0.7 * t).sin(), 0.5 * (0.3 * t).cos(), 0.3 * (0.4 * t + 1.0).sin()]
}

fn u0(network: &Network) -> Vec<f64> {
    (0..network.topology.context_units()).map(|i| 0.8 * (2.1 * i as f64).cos()).collect()
}

fn observe_all(regression: &mut ErrorRegression, count: usize) -> Regression {
    let mut last = Regression::default();
    for t in 0..count {
        last = regression.observe(&sample(t), &mut || true).unwrap();
    }
    last
}

/// Runs the window, scores it and goes back; gives ln L_reg and the gradient at its tail.
struct Evaluate<'a>(&'a mut ErrorRegression);

impl WithSimd for Evaluate<'_> {
    type Output = (f64, Vec<f64>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (f64, Vec<f64>) {
        self.0.run_window(simd);
        let (ln_likelihood, _) = self.0.score(simd);
        self.0.run_back(simd);
        (ln_likelihood, self.0.deltas[..self.0.packed.n_c].to_vec())
    }
}

/// (2.28) in plain loops. `means` are those predicted before the window, oldest first; `first` is the number of the
/// window's first step.
fn plain(
    network: &Network,
    tail: &[f64],
    means: &[f64],
    first: usize,
    steps: usize,
    shares: &[f64],
    mask: &[f64],
) -> f64 {
    let delay = network.topology.delay();
    let mut state = Plain::at(network, tail);
    let mut means: Vec<Vec<f64>> = means.chunks(3).map(<[f64]>::to_vec).collect();
    let mut sum = 0.0;
    for step in first..first + steps {
        let sensed = sample(step);
        let fed_back = &means[step - first];
        let mix = |i: usize| shares[i] * sensed[i] + (1.0 - shares[i]) * fed_back[i];
        let x: Vec<f64> = if step < delay { sensed.to_vec() } else { (0..3).map(mix).collect() };
        state.advance(&x);
        means.push(state.y.clone());
        for (i, target) in sample(step + delay).iter().enumerate() {
            let term = match state.v.get(i) {
                Some(&v) => ln_gaussian(*target, state.y[i], v),
                None => -0.5 * (target - state.y[i]).powi(2),
            };
            sum += mask[i] * term;
        }
    }
    sum
}

#[test]
fn the_gradient_at_the_tail_agrees_with_central_differences() {
    for (delay, variance, count, shares, mask) in [
        (1, true, 30, [0.0; 3], [1.0; 3]),
        (1, false, 5, [0.0; 3], [1.0; 3]),
        (2, true, 30, [0.25, 0.0, 1.0], [1.0; 3]),
        (5, true, 40, [0.0; 3], [1.0, 0.5, 0.0]),
        (5, false, 9, [0.5; 3], [0.0, 1.0, 1.0]),
    ] {
        let network = network(delay, variance, fast_and_slow());
        let options = ErrorRegressionOptions {
            window: 12,
            iterations: 0,
            sensed_in_window: shares.to_vec(),
            mask: mask.to_vec(),
            ..ErrorRegressionOptions::new(3)
        };
        for set in InstructionSet::available() {
            let mut regression =
                ErrorRegression::new(&network, &u0(&network), options.clone(), &Engine::new(1, set).unwrap()).unwrap();
            observe_all(&mut regression, count);
            let (steps, tail) = (regression.window(), regression.tail().to_vec());
            assert_eq!(steps, 12.min(count - delay));
            let first = count - delay - steps;
            let before = regression.mean[3..3 * (delay + 1)].to_vec();
            let (ln_likelihood, gradient) = set.run(Evaluate(&mut regression));
            let at = |tail: &[f64]| plain(&network, tail, &before, first, steps, &shares, &mask);
            assert!((ln_likelihood - at(&tail)).abs() < 1e-10 * (1.0 + ln_likelihood.abs()));
            for i in 0..tail.len() {
                let moved = |by: f64| {
                    let mut tail = tail.clone();
                    tail[i] += by;
                    at(&tail)
                };
                let (h, d) = (1e-3, |h: f64| (moved(h) - moved(-h)) / (2.0 * h));
                let differences = (4.0 * d(h) - d(2.0 * h)) / 3.0;
                let error = (gradient[i] - differences).abs();
                assert!(
                    error < 1e-6 * (1.0 + differences.abs()),
                    "{set}, delay {delay}, unit {i}: {} against {differences}",
                    gradient[i]
                );
            }
        }
    }
}

#[test]
fn without_iterations_it_predicts_as_the_open_loop_does() {
    for delay in [1, 3] {
        let network = network(delay, true, fast_and_slow());
        let options = ErrorRegressionOptions { window: 4, iterations: 0, ..ErrorRegressionOptions::new(3) };
        let u0 = u0(&network);
        let mut regression = ErrorRegression::new(&network, &u0, options, &Engine::serial()).unwrap();
        let sensed: Vec<f64> = (0..25).flat_map(sample).collect();
        let options = GenerationOptions { steps: 25, feedback: Feedback::open(3), seed: 1, contexts: true };
        let start = Start { initial_state: &u0, sensed: &sensed };
        let open = &generate(&network, &[start], &options, &Engine::serial()).unwrap()[0];
        for t in 0..25 {
            regression.observe(&sample(t), &mut || true).unwrap();
            // Sample t + 1 is what step t + 1 - delay predicts.
            let Some(step) = (t + 1).checked_sub(delay) else { continue };
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13);
            assert!(near(regression.mean(), &open.mean[3 * step..3 * step + 3]), "step {step}");
            assert!(near(regression.variance(), &open.variance[3 * step..3 * step + 3]), "step {step}");
            assert!(near(regression.context(regression.window()).unwrap(), &open.contexts[13 * step..13 * step + 13]));
        }
    }
}

#[test]
fn regression_finds_the_state_that_explains_a_stream_and_leaves_fast_units_alone() {
    // A network with a long memory follows its own sequence; the stream comes from another initial state.
    let groups = vec![Group::fast(9, 2.0), Group::slow(4, 60.0)];
    let network = network(2, false, groups);
    let made = |slow: f64| {
        let mut u0 = vec![0.0; 13];
        u0[9..].fill(slow);
        let options = GenerationOptions { steps: 60, feedback: Feedback::closed(3, false), seed: 1, contexts: false };
        let start = Start { initial_state: &u0, sensed: &[0.1; 6] };
        (u0.clone(), generate(&network, &[start], &options, &Engine::serial()).unwrap().remove(0).mean)
    };
    let ((other, _), (_, stream)) = (made(-0.9), made(0.9));
    let ascent = Ascent::Adam { rate: 0.05 };
    let options = ErrorRegressionOptions {
        window: 15,
        iterations: 20,
        ascent,
        max_norm: None,
        sensed: vec![0.0; 3],
        ..ErrorRegressionOptions::new(3)
    };
    let run = |iterations| {
        let options = ErrorRegressionOptions { iterations, ..options.clone() };
        let mut regression = ErrorRegression::new(&network, &other, options, &Engine::serial()).unwrap();
        let (mut late, mut first) = (0.0, None);
        for (t, sample) in [[0.1; 3]; 2].iter().map(|x| &x[..]).chain(stream.chunks(3)).enumerate() {
            if t >= 40 {
                late += regression.mean().iter().zip(sample).map(|(y, x)| (y - x).powi(2)).sum::<f64>();
            }
            let done = regression.observe(sample, &mut || true).unwrap();
            if done.steps == 1 {
                first = Some(regression.tail().to_vec());
            }
        }
        (late, first.unwrap())
    };
    let ((with, tail), (without, _)) = (run(20), run(0));
    assert!(with < 0.05 * without, "{ascent:?}: {with} with, {without} without");
    assert_eq!(tail[..9], other[..9]);
    assert!(tail[9..].iter().zip(&other[9..]).all(|(a, b)| a != b));
}

#[test]
fn small_steps_always_lead_uphill() {
    let network = network(2, true, fast_and_slow());
    for momentum in [0.0, 0.5] {
        let ascent = Ascent::Momentum { rate: 1e-4, momentum };
        let options = ErrorRegressionOptions { ascent, iterations: 10, ..ErrorRegressionOptions::new(3) };
        let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
        for t in 0..60 {
            let done = regression.observe(&sample(t), &mut || true).unwrap();
            assert_eq!(done.iterations, if t < 2 { 0 } else { 10 });
            assert!(t < 2 || done.ln_likelihood[1] > done.ln_likelihood[0], "sample {t}: {:?}", done.ln_likelihood);
        }
    }
}

#[test]
fn a_step_to_non_finite_values_is_taken_back_and_reported() {
    let network = network(1, true, fast_and_slow());
    let ascent = Ascent::Momentum { rate: 1e307, momentum: 0.9 };
    let options = ErrorRegressionOptions { ascent, ..ErrorRegressionOptions::new(3) };
    let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
    let mut diverged = 0;
    for t in 0..40 {
        // Far from all that the network can predict: steep enough for the rate to overflow.
        let done = regression.observe(&sample(t).map(|x| 1e3 * x), &mut || true).unwrap();
        diverged += usize::from(done.diverged);
        assert!(regression.mean().iter().chain(regression.variance()).chain(regression.tail()).all(|x| x.is_finite()));
        assert!(done.ln_likelihood.iter().all(|x| x.is_finite()));
    }
    assert!(diverged > 0);
}

#[test]
fn a_control_loop_can_stop_it_at_any_iteration() {
    let network = network(1, true, fast_and_slow());
    // L-BFGS asks once more: before it looks at where it begins.
    for (options, iterations) in [(ErrorRegressionOptions::adam(3), 3), (ErrorRegressionOptions::new(3), 2)] {
        let (tolerance, guard) = (Some(0.0), Some(false));
        let options = ErrorRegressionOptions { iterations: 50, tolerance, guard, ..options };
        let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
        observe_all(&mut regression, 5);
        let mut asked = 0;
        let mut go_on = || {
            asked += 1;
            asked <= 3
        };
        let done = regression.observe(&sample(5), &mut go_on).unwrap();
        assert_eq!((done.iterations, done.steps), (iterations, 5));
        assert!((2..=3).contains(&done.passes), "{done:?}");
        assert!(done.ln_likelihood[1] > done.ln_likelihood[0]);
        let tail = regression.tail().to_vec();
        let done = regression.observe(&sample(6), &mut || false).unwrap();
        assert_eq!((done.iterations, done.passes, regression.tail()), (0, 0, &tail[..]));
    }
}

/// What the window's ln L_reg really is.
fn now(regression: &mut ErrorRegression) -> f64 {
    let set = regression.set;
    set.run(Evaluate(regression)).0
}

#[test]
fn the_best_state_that_was_met_is_kept_where_it_is_asked_for() {
    let network = network(2, true, fast_and_slow());
    for ascent in [Ascent::Momentum { rate: 100.0, momentum: 0.9 }, Ascent::Adam { rate: 1.0 }] {
        let options = ErrorRegressionOptions { ascent, window: 30, ..ErrorRegressionOptions::new(3) };
        let run = |keep_best| {
            let options = ErrorRegressionOptions { keep_best, ..options.clone() };
            let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
            let (mut worse, mut earlier) = (0, 0);
            for t in 0..40 {
                let done = regression.observe(&sample(t), &mut || true).unwrap();
                if done.iterations == 0 {
                    continue;
                }
                worse += usize::from(done.ln_likelihood[1] < done.ln_likelihood[0]);
                earlier += usize::from(done.kept < done.iterations);
                assert_eq!(now(&mut regression), done.ln_likelihood[1], "{ascent:?}, sample {t}");
            }
            (worse, earlier)
        };
        let (worse, earlier) = run(false);
        assert!(worse > 0 && earlier == 0, "{ascent:?}: at this rate the last step is worse {worse} times");
        let (worse, earlier) = run(true);
        assert!(worse == 0 && earlier > 0, "{ascent:?}: {worse} worse, {earlier} kept from before");
    }
}

#[test]
fn a_tolerance_ends_the_ascent_early_and_it_says_so() {
    let network = network(1, true, fast_and_slow());
    let ascents =
        [Ascent::Momentum { rate: 1e-3, momentum: 0.5 }, Ascent::Adam { rate: 0.01 }, Ascent::Lbfgs { memory: 8 }];
    for ascent in ascents {
        let run = |tolerance: f64| {
            let options = ErrorRegressionOptions {
                ascent,
                iterations: 200,
                tolerance: Some(tolerance),
                guard: Some(false),
                ..ErrorRegressionOptions::new(3)
            };
            let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
            let done = observe_all(&mut regression, 30);
            assert_eq!(now(&mut regression), done.ln_likelihood[1], "{ascent:?}");
            done
        };
        let (early, late) = (run(1e-2), run(0.0));
        assert!(early.converged && early.iterations < 100, "{ascent:?}: {early:?}");
        assert!(early.iterations < late.iterations, "{ascent:?}: {early:?}, {late:?}");
        if !matches!(ascent, Ascent::Lbfgs { .. }) {
            assert!(!late.converged && late.iterations == 200, "{ascent:?}: {late:?}");
        }
    }
}

#[test]
fn senseless_requests_are_refused_and_leave_no_trace() {
    let network = network(1, true, fast_and_slow());
    let set = InstructionSet::best();
    let refuse = |change: &dyn Fn(&mut ErrorRegressionOptions)| {
        let mut options = ErrorRegressionOptions::new(3);
        change(&mut options);
        ErrorRegression::new(&network, &u0(&network), options, &Engine::new(1, set).unwrap()).unwrap_err().to_string()
    };
    assert!(refuse(&|options| options.window = 0).starts_with("the window is 0"));
    assert!(refuse(&|options| options.ascent = Ascent::Adam { rate: -1.0 }).contains("rate is -1"));
    assert!(refuse(&|options| options.ascent = Ascent::Lbfgs { memory: 0 }).contains("is 0; needed: 1 to 1000 pairs"));
    assert!(refuse(&|options| options.ascent = Ascent::Lbfgs { memory: usize::MAX }).contains("1 to 1000 pairs"));
    assert!(refuse(&|options| options.tolerance = Some(f64::NAN)).contains("tolerance is NaN"));
    assert!(refuse(&|options| options.sensed = vec![1.0; 2]).contains("holds 2 values; needed: 3"));
    assert!(refuse(&|options| options.sensed_in_window[1] = 1.5).contains("is 1.5; needed: numbers from 0 to 1"));

    let options = ErrorRegressionOptions::new(3);
    let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::new(1, set).unwrap()).unwrap();
    observe_all(&mut regression, 4);
    let before = regression.mean().to_vec();
    assert!(regression.observe(&[0.0, f64::INFINITY, 0.0], &mut || true).unwrap_err().to_string().contains("is inf"));
    assert!(regression.observe(&[0.0], &mut || true).is_err());
    assert_eq!((regression.mean(), regression.window()), (&before[..], 3));
}

#[test]
fn what_is_forecast_is_what_generation_gives_once_samples_run_out() {
    for (delay, count) in [(1, 9), (3, 2), (3, 3), (3, 4), (5, 30)] {
        let network = network(delay, true, fast_and_slow());
        let (iterations, ahead) = (0, 8);
        let options = ErrorRegressionOptions {
            iterations,
            ahead,
            window: 6,
            sensed: vec![1.0, 0.0, 0.5],
            ..ErrorRegressionOptions::new(3)
        };
        let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
        observe_all(&mut regression, count);
        if count < delay {
            continue;
        }
        let sensed: Vec<f64> = (0..count).flat_map(sample).collect();
        let mut feedback = Feedback::mixed(3, 1.0, false);
        (feedback.0[1].sensed, feedback.0[2].sensed) = (0.0, 0.5);
        let steps = count - delay + 1 + ahead;
        let options = GenerationOptions { steps, feedback, seed: 1, contexts: true };
        let start = Start { initial_state: &u0(&network), sensed: &sensed };
        let generated = generate(&network, &[start], &options, &Engine::serial()).unwrap().remove(0);
        let close = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        for steps in 0..=ahead {
            let row = count - delay + steps;
            let own = |list: &[f64], size: usize| list[row * size..(row + 1) * size].to_vec();
            let found = regression.forecast_mean(steps).unwrap();
            assert!(close(found, &own(&generated.mean, 3)), "delay {delay}, {count} samples, {steps} ahead: {found:?}");
            assert!(close(regression.forecast_variance(steps).unwrap(), &own(&generated.variance, 3)));
            assert!(close(regression.forecast_context(steps).unwrap(), &own(&generated.contexts, 13)));
        }
        assert_eq!(regression.forecast_mean(0), Some(regression.mean()));
        let beyond = regression.window() + 1;
        assert!(regression.smoothed_mean(beyond).is_none() && regression.context(beyond).is_none());
        assert!(regression.forecast_mean(99).is_none() && regression.forecast_variance(99).is_none());
        assert!(regression.forecast_context(99).is_none());
    }
}

/// Samples of which some values are missing, the first one's among them.
fn gapped(t: usize) -> [f64; 3] {
    let mut x = sample(t);
    if t.is_multiple_of(3) {
        x[t % 2] = f64::NAN;
    }
    if t % 7 == 5 {
        x = [f64::NAN; 3];
    }
    x
}

/// The same network with features, one kind after the other.
fn with_features(delay: usize, variance: bool) -> Vec<Network> {
    use crate::features::{Skip, SkipKind, velocity_deviations};
    let data = crate::dataset::Sequence::new("s", 3, (0..40).flat_map(sample).collect()).unwrap();
    let data = crate::dataset::Dataset::new(crate::dataset::Dataset::numbered_channels(3), vec![data]).unwrap();
    let bare = network(delay, variance, fast_and_slow()).topology;
    let skip = |kind| Skip::fit(kind, &data, delay).unwrap();
    // Taps that were fitted to these waves would let a closed loop run away.
    let taps = (0..3 * 9).map(|k| 0.1 * (1.7 * k as f64).sin()).collect();
    let topologies = [
        bare.clone(),
        bare.clone().with_linear_mean(true),
        bare.clone().with_velocity_inputs(velocity_deviations(&data)).unwrap(),
        bare.clone().with_skip(skip(SkipKind::Residual)).unwrap(),
        bare.clone()
            .with_linear_mean(true)
            .with_velocity_inputs(velocity_deviations(&data))
            .unwrap()
            .with_skip(skip(SkipKind::Extrapolation { damping: 0.7 }))
            .unwrap(),
        bare.with_linear_mean(true).with_skip(Skip::new(taps, vec![0.3, 0.2, 0.1]).unwrap()).unwrap(),
    ];
    let build = |topology: Topology| {
        let (mut network, _) = initialize(&topology, 1, 11);
        network.parameters.as_mut_slice().iter_mut().enumerate().for_each(|(k, w)| *w += 0.1 * (1.3 * k as f64).sin());
        network
    };
    topologies.into_iter().map(build).collect()
}

#[test]
fn values_that_are_missing_or_masked_are_not_counted() {
    let network = network(1, true, fast_and_slow());
    for (mask, last) in [([1.0; 3], 3), ([0.0, 1.0, 0.5], 2), ([0.0; 3], 0)] {
        let options =
            ErrorRegressionOptions { window: 6, iterations: 1, mask: mask.to_vec(), ..ErrorRegressionOptions::new(3) };
        let mut regression = ErrorRegression::new(&network, &u0(&network), options, &Engine::serial()).unwrap();
        let counts = |t: usize| gapped(t).iter().zip(mask).filter(|(x, share)| !x.is_nan() && *share > 0.0).count();
        for t in 0..20 {
            let done = regression.observe(&gapped(t), &mut || true).unwrap();
            // The first sample is an input alone.
            let window = t.saturating_sub(5).max(1)..t + 1;
            assert_eq!(
                (done.steps, done.values),
                (window.len(), window.map(counts).sum()),
                "sample {t}, mask {mask:?}"
            );
        }
        assert_eq!(counts(1), last);
    }
}

#[test]
fn features_and_missing_values_have_the_gradient_of_differences() {
    for (delay, variance, count, shares) in
        [(1, true, 30, [0.0; 3]), (1, false, 9, [0.3; 3]), (2, true, 30, [0.25, 0.0, 1.0]), (4, true, 40, [0.0; 3])]
    {
        for (kind, network) in with_features(delay, variance).iter().enumerate() {
            let options = ErrorRegressionOptions {
                window: 12,
                iterations: 0,
                sensed_in_window: shares.to_vec(),
                ..ErrorRegressionOptions::new(3)
            };
            let mut regression = ErrorRegression::new(network, &u0(network), options, &Engine::serial()).unwrap();
            for t in 0..count {
                regression.observe(&gapped(t), &mut || true).unwrap();
            }
            let set = regression.set;
            let (_, gradient) = set.run(Evaluate(&mut regression));
            for (i, found) in gradient.iter().enumerate() {
                let before = regression.internal[i];
                let mut at = |offset: f64| {
                    regression.internal[i] = before + offset;
                    let value = set.run(Evaluate(&mut regression)).0;
                    regression.internal[i] = before;
                    value
                };
                // The likelihood is large where a loop runs away: a smaller step would drown in its last digits.
                let h = 1e-4;
                let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                let near = (found - slope).abs() < 1e-6 * (1.0 + slope.abs());
                assert!(near, "delay {delay}, kind {kind}, unit {i}: {found} instead of {slope}");
            }
        }
    }
}

#[test]
fn with_features_and_missing_values_it_forecasts_what_generation_gives() {
    for (delay, count) in [(1, 9), (3, 4), (4, 30)] {
        for (kind, network) in with_features(delay, true).iter().enumerate() {
            let (iterations, ahead) = (0, 8);
            let options = ErrorRegressionOptions {
                iterations,
                ahead,
                window: 6,
                sensed: vec![1.0; 3],
                sensed_in_window: vec![1.0; 3],
                ..ErrorRegressionOptions::new(3)
            };
            let mut regression = ErrorRegression::new(network, &u0(network), options, &Engine::serial()).unwrap();
            for t in 0..count {
                regression.observe(&gapped(t), &mut || true).unwrap();
            }
            let sensed: Vec<f64> = (0..count).flat_map(gapped).collect();
            let steps = count - delay + 1 + ahead;
            let options =
                GenerationOptions { steps, feedback: Feedback::mixed(3, 1.0, false), seed: 1, contexts: false };
            let start = Start { initial_state: &u0(network), sensed: &sensed };
            let generated = generate(network, &[start], &options, &Engine::serial()).unwrap();
            for step in 0..=ahead {
                let row = count - delay + step;
                for i in 0..3 {
                    let (found, expected) =
                        (regression.forecast_mean(step).unwrap()[i], generated[0].mean[3 * row + i]);
                    let name = format!("delay {delay}, kind {kind}, {step} ahead, channel {i}");
                    assert!((found - expected).abs() < 1e-11, "{name}: {found} instead of {expected}");
                    let (found, expected) =
                        (regression.forecast_variance(step).unwrap()[i], generated[0].variance[3 * row + i]);
                    assert!((found / expected - 1.0).abs() < 1e-11, "{name}: variance {found} instead of {expected}");
                }
            }
        }
    }
}
