//! Networks of every kind that a checkpoint can hold, each with samples and what the library predicts from them, step by step.

use std::path::{Path, PathBuf};

use scrnn::checkpoint::{Checkpoint, OptimiserState};
use scrnn::features::velocity_deviations;
use scrnn::generation::Running;
use scrnn::{Dataset, Engine, Feedback, Group, Prediction, Scaling, Sequence, Skip, SkipKind, Topology, initialize};
use scrnn_run::members;
use scrnn_run::trained::Trained;
use serde_json::{Value, json};

/// Steps that are compared.
pub const STEPS: usize = 600;

/// From here on no sample comes for a while.
pub const BLIND: std::ops::Range<usize> = 200..215;

/// The learned sequences; the third begins from no other state than the mean.
pub const SEQUENCES: [&str; 3] = ["left", "right/2", ""];

/// One network, or a mixture, in a run folder.
pub struct Variant {
    pub name: &'static str,
    /// Where its state begins; none for the mean.
    pub sequence: Option<&'static str>,
    /// Where it lies.
    pub run: PathBuf,
    /// Opened.
    pub all: Vec<Trained>,
    /// `[STEPS, channels]`, raw; NaN is missing.
    pub samples: Vec<f64>,
    /// What the library predicts from them, raw; no variance for a network without.
    pub mean: Vec<f64>,
    pub variance: Vec<f64>,
    /// Range of each channel.
    pub ranges: Vec<(f64, f64)>,
}

/// What is made of a variant besides its topology.
struct Plan {
    topology: Topology,
    sequence: Option<&'static str>,
    members: usize,
    factor: bool,
    scaling: Scaling,
}

/// Names with all that could break a text or a comment.
fn channels(n: usize) -> Vec<String> {
    let names = ["shoulder \"left\" */ \\", "elbow /* ??/\n%s", "hand \u{fc} [rad]"];
    (0..n).map(|i| names[i].to_owned()).collect()
}

/// Movements far away from 0 and of very different sizes.
fn sample(k: usize, i: usize, phase: f64) -> f64 {
    let angle = k as f64 / 7.0 + phase + i as f64;
    match i {
        0 => 1200.0 + 100.0 * angle.sin() + 20.0 * (2.3 * angle).cos(),
        1 => 0.003 + 0.001 * angle.cos() * (0.1 * angle).sin(),
        _ => -2.0 * (angle + (0.7 * angle).sin()).cos(),
    }
}

fn data(n: usize) -> Dataset {
    let sequence = |(s, name): (usize, &&str)| {
        let values = (0..150).flat_map(|k| (0..n).map(move |i| sample(k, i, s as f64))).collect();
        Sequence::new(*name, n, values).unwrap()
    };
    Dataset::new(channels(n), SEQUENCES.iter().enumerate().map(sequence).collect()).unwrap()
}

/// Some values are missing, the very first as well; all are for a while; two are infinite.
fn samples(n: usize) -> Vec<f64> {
    let mut samples: Vec<f64> = (0..STEPS).flat_map(|k| (0..n).map(move |i| sample(k, i, 0.4))).collect();
    for k in 0..STEPS {
        for i in 0..n {
            let some = (7 * k + 3 * i) % 19 == 0 || k < 2 && i == n - 1;
            if some || BLIND.contains(&k) {
                samples[k * n + i] = f64::NAN;
            }
        }
    }
    samples[300 * n] = f64::INFINITY;
    samples[310 * n + n - 1] = f64::NEG_INFINITY;
    samples
}

fn topology(n: usize, delay: usize, groups: Vec<Group>, floor: Option<f64>) -> Topology {
    let prediction = floor.map_or(Prediction::Mean, |floor| Prediction::MeanAndVariance { floor });
    Topology::new(n, delay, groups, prediction).unwrap()
}

fn one_group() -> Vec<Group> {
    vec![Group::full("context /* */", 9, 3.0)]
}

fn two_groups() -> Vec<Group> {
    vec![Group::fast(8, 2.0), Group::slow(3, 30.0)]
}

/// All of them, in folders of `place`.
pub fn all(place: &Path) -> Vec<Variant> {
    let scaled = |n: usize| Scaling::fit(&data(n), Scaling::RANGE).apply(&data(n)).unwrap();
    let skip = |topology: Topology, kind: SkipKind| {
        let fitted = Skip::fit(kind, &scaled(topology.channels()), topology.delay()).unwrap();
        topology.with_skip(fitted).unwrap()
    };
    let velocity = |topology: Topology| {
        let deviations = velocity_deviations(&scaled(topology.channels()));
        topology.with_velocity_inputs(deviations).unwrap()
    };
    let plain = |topology: Topology| {
        let scaling = Scaling::fit(&data(topology.channels()), Scaling::RANGE);
        Plan { topology, sequence: None, members: 1, factor: false, scaling }
    };
    let damped = SkipKind::Extrapolation { damping: 0.8 };
    let lags = |lags| SkipKind::Autoregressive { lags };
    let plans = [
        ("s_ctrnn", plain(topology(2, 1, one_group(), Some(0.0)))),
        ("one_channel", plain(topology(1, 1, one_group(), Some(0.0)))),
        ("ctrnn", plain(topology(2, 1, one_group(), None))),
        ("s_mtrnn", Plan { sequence: Some("right/2"), ..plain(topology(3, 1, two_groups(), Some(1e-4))) }),
        ("mtrnn", plain(topology(3, 2, two_groups(), None))),
        ("delay", Plan { sequence: Some("1"), ..plain(topology(2, 5, two_groups(), Some(0.0))) }),
        ("linear", plain(topology(2, 1, one_group(), Some(0.0)).with_linear_mean(true))),
        ("velocity", plain(velocity(topology(2, 2, two_groups(), Some(0.0))))),
        ("residual", plain(skip(topology(2, 1, one_group(), Some(1e-3)), SkipKind::Residual))),
        ("extrapolation", plain(skip(topology(2, 3, one_group(), Some(0.0)), damped))),
        ("autoregressive", plain(skip(topology(3, 1, two_groups(), Some(1e-3)), lags(4)))),
        ("skip_of_the_mean_alone", plain(skip(topology(2, 2, one_group(), None), lags(1)))),
        (
            "all_at_once",
            Plan {
                factor: true,
                sequence: Some("left"),
                ..plain(velocity(skip(topology(2, 3, two_groups(), Some(1e-3)), lags(3)).with_linear_mean(true)))
            },
        ),
        ("calibrated", Plan { factor: true, ..plain(topology(2, 1, one_group(), Some(0.0))) }),
        (
            "robust_scaling",
            Plan {
                // Half of what comes is further out than what counted, and one channel is turned over.
                scaling: Scaling::new(vec![1210.0, 0.0028], vec![0.016, -1200.0]).unwrap(),
                ..plain(topology(2, 1, one_group(), Some(0.0)))
            },
        ),
        ("unscaled", Plan { scaling: Scaling::identity(1), ..plain(topology(1, 1, one_group(), Some(0.0))) }),
        ("mixture", Plan { members: 3, sequence: Some("left"), ..plain(topology(2, 2, two_groups(), Some(0.0))) }),
        ("mixture_of_means", Plan { members: 2, ..plain(skip(topology(2, 1, one_group(), None), lags(2))) }),
    ];
    plans.into_iter().map(|(name, plan)| variant(name, plan, place)).collect()
}

fn notes(factor: Option<Value>) -> Value {
    let mut notes =
        json!({ "experiment": { "name": "arm */ 1" }, "data": { "digest": "", "lengths": [150, 150, 150] } });
    if let Some(factor) = factor {
        notes["variance_factor"] = factor;
    }
    notes
}

/// A checkpoint of random weights.
fn checkpoint(plan: &Plan, seed: u64) -> Checkpoint {
    let topology = plan.topology.clone();
    let n = topology.channels();
    let (mut network, mut initial_states) = initialize(&topology, SEQUENCES.len(), seed);
    network.parameters_mut().iter_mut().for_each(|w| *w *= 1.5);
    let learns: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
    for s in 0..SEQUENCES.len() {
        for (i, u) in initial_states.sequence_mut(s).iter_mut().enumerate().filter(|(i, _)| learns[*i]) {
            *u = 0.9 * (1.7 * i as f64 + s as f64 + seed as f64).sin();
        }
    }
    let factor = json!({ "factors": vec![2.5; n], "sequences": 2, "samples": 100, "digest": "" });
    Checkpoint {
        first_inputs: vec![0.0; SEQUENCES.len() * topology.delay() * n],
        parameters: network.into_parts().1,
        initial_states,
        scaling: plan.scaling.clone(),
        channels: channels(n),
        sequences: SEQUENCES.map(str::to_owned).to_vec(),
        epoch: 1234,
        optimiser: OptimiserState::default(),
        notes: notes(plan.factor.then_some(factor)),
        topology,
    }
}

fn variant(name: &'static str, plan: Plan, place: &Path) -> Variant {
    let run = place.join(name);
    for k in 1..=plan.members {
        let folder = if plan.members > 1 { members::folder(&run, k) } else { run.clone() };
        std::fs::create_dir_all(&folder).unwrap();
        let bytes = checkpoint(&plan, k as u64).to_bytes().unwrap();
        std::fs::write(folder.join("checkpoint.safetensors"), bytes).unwrap();
    }
    let all = members::open(&run, false).unwrap();
    let (n, has_variance) = (plan.topology.channels(), plan.topology.has_variance());
    let samples = samples(n);
    let (mean, variance) = predicted(&all, plan.sequence, &samples);
    assert_eq!(variance.len(), if has_variance { mean.len() } else { 0 });
    let ranges = (0..n).map(|i| {
        let own = samples.iter().skip(i).step_by(n).copied().filter(|x| x.is_finite());
        own.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    });
    Variant { name, sequence: plan.sequence, run, ranges: ranges.collect(), all, samples, mean, variance }
}

/// The library's own steps: each network beside a world, and the moments of their mixture.
pub fn predicted(all: &[Trained], sequence: Option<&str>, samples: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let scaling = &all[0].checkpoint.scaling;
    let n = scaling.channels();
    let start = |one: &Trained| {
        let states = &one.checkpoint.initial_states;
        let u0 = sequence.map_or(states.mean(), |name| states.sequence(one.sequence(name).unwrap()));
        Running::new(&one.network(), u0, Feedback::open(n), 1, &Engine::serial()).unwrap()
    };
    let mut running: Vec<Running> = all.iter().map(start).collect();
    let m = running.len() as f64;
    let (mut means, mut variances) = (Vec::new(), Vec::new());
    for sample in samples.chunks_exact(n) {
        // Programs beside a robot take what is infinite for missing.
        let finite = |x: f64| if x.is_finite() { x } else { f64::NAN };
        let x: Vec<f64> = sample.iter().enumerate().map(|(i, x)| finite(scaling.to_scaled(i, *x))).collect();
        running.iter_mut().for_each(|one| one.step(&x).unwrap());
        for i in 0..n {
            let y = running.iter().map(|one| one.mean()[i]).sum::<f64>() / m;
            means.push(scaling.to_raw(i, y));
            if running.iter().all(|one| !one.variance().is_empty()) {
                let spread = |one: &Running| one.variance()[i] + (one.mean()[i] - y).powi(2);
                variances.push(scaling.variance_to_raw(i, running.iter().map(spread).sum::<f64>() / m));
            }
        }
    }
    (means, variances)
}

/// The greatest difference of what was computed elsewhere, over the first `steps`. Means are compared by the width of their channel, or by
/// how far the library's go away from its middle where that is more; variances by themselves.
pub fn greatest_difference(variant: &Variant, mean: &[f64], variance: &[f64], steps: usize) -> (f64, f64) {
    let n = variant.ranges.len();
    assert_eq!((mean.len(), variance.len()), (variant.mean.len(), variant.variance.len()), "{}", variant.name);
    // A NaN must not get lost.
    let greater = |most: f64, d: f64| if d > most || d.is_nan() { d } else { most };
    let means = mean.iter().zip(&variant.mean).enumerate().map(|(k, (a, b))| {
        let (low, high) = variant.ranges[k % n];
        (a - b).abs() / (high - low).max((b - f64::midpoint(low, high)).abs())
    });
    let variances = variance.iter().zip(&variant.variance).map(|(a, b)| (a / b - 1.0).abs());
    (means.take(steps * n).fold(0.0, greater), variances.take(steps * n).fold(0.0, greater))
}
