//! The closed loop, piece by piece.

use scrnn::analysis::mixture::{GaussianMixture, MixtureOptions};
use scrnn::initialization::initialize;
use scrnn::topology::Topology;

use super::*;
use crate::reach::stage::{CYCLE, POSITIONS, gaze_at, touching_arm};
use crate::robot::nao;

fn performance(samples: usize) -> Performance {
    Performance { y: POSITIONS[1], samples, shift: None, frozen: None, world: WorldOptions::default() }
}

/// Touches and retracts as it was taught, in six samples each.
fn ideal(y: f64) -> Replay {
    let robot = nao::load_one_armed().unwrap();
    let (near, far) = (touching_arm(&robot, y, [0.0; 3], &[0.0; 4]).unwrap(), retracted_arm(&robot, y).unwrap());
    let arms = (0..CYCLE).map(|k| {
        let share = (1.0 - (std::f64::consts::TAU * k as f64 / CYCLE as f64).cos()) / 2.0;
        std::array::from_fn(|joint| far[joint] + share * (near[joint] - far[joint]))
    });
    Replay::new(arms.collect()).unwrap()
}

fn driver(noise: &Noise) -> NetworkDriver {
    let topology = Topology::s_ctrnn(6, 8, 2.0).unwrap();
    let (network, states) = initialize(&topology, 1, 3);
    NetworkDriver::new(&network, states.mean(), &Scaling::identity(6), noise, 5, &Engine::serial()).unwrap()
}

#[test]
fn an_arm_that_goes_where_it_was_taught_touches_every_time() {
    let performed = perform_unobserved(&performance(5 * CYCLE), &mut ideal(POSITIONS[1])).unwrap();
    assert_eq!(performed.cycles.len(), 5);
    assert!(performed.cycles.iter().all(|cycle| cycle.touched && cycle.retracted));
    assert_eq!((performed.beyond_limits, performed.self_collisions), (0, 0));
    assert_eq!((performed.sensed.len(), performed.decisions.len()), (60 * 6, 60));
}

#[test]
fn an_arm_that_goes_for_another_place_does_not() {
    let performed = perform_unobserved(&performance(3 * CYCLE), &mut ideal(POSITIONS[1] + 0.035)).unwrap();
    assert!(performed.cycles.iter().all(|cycle| !cycle.touched), "{:?}", performed.cycles);
    // Nor does one whose sphere is taken away on the way.
    let shifted = Performance { shift: Some((CYCLE, POSITIONS[0])), ..performance(3 * CYCLE) };
    let performed = perform_unobserved(&shifted, &mut ideal(POSITIONS[1])).unwrap();
    assert!(performed.cycles[0].touched && performed.cycles.iter().skip(1).all(|cycle| !cycle.touched));
}

#[test]
fn the_head_follows_the_sphere_unless_it_is_frozen() {
    let robot = nao::load_one_armed().unwrap();
    let off = |performance: &Performance, y: f64| {
        let performed = perform_unobserved(performance, &mut ideal(POSITIONS[1])).unwrap();
        let last = &performed.sensed[performed.sensed.len() - 6..];
        last[..2].iter().zip(gaze_at(&robot, y).unwrap()).map(|(q, goal)| (q - goal).abs()).fold(0.0, f64::max)
    };
    let shifted = Performance { shift: Some((3, POSITIONS[0])), ..performance(8) };
    assert!(off(&shifted, POSITIONS[0]) < 0.005);
    let frozen = Performance { frozen: Some(gaze_at(&robot, POSITIONS[1]).unwrap()), ..shifted };
    assert!(off(&frozen, POSITIONS[1]) < 0.005);
}

#[test]
fn vision_is_sensed_and_the_arm_runs_on_its_own_prediction() {
    let topology = Topology::s_ctrnn(6, 8, 2.0).unwrap();
    let (network, states) = initialize(&topology, 1, 3);
    let mut driver = driver(&Noise::Predicted);
    let mut plain = scrnn::forward::Plain::new(&network, states.mean()).unwrap();
    let mut arm = None;
    for k in 0..5 {
        let sensed: Vec<f64> = (0..6).map(|channel| 0.1 * f64::from(channel + k)).collect();
        let decision = driver.decide(&sensed).unwrap();
        let input = [&sensed[..2], arm.as_ref().map_or(&sensed[2..], |arm: &[f64; 4]| &arm[..])].concat();
        plain.step(&input).unwrap();
        assert!(decision.mean.iter().zip(&plain.y).all(|(a, b)| (a - b).abs() < 1e-12), "step {k}");
        assert!(decision.target.iter().zip(&decision.mean[2..]).all(|(target, mean)| target != mean));
        arm = Some(decision.target);
    }
}

#[test]
fn constant_noise_is_as_large_as_asked_for_and_no_noise_is_none() {
    let mut quiet = driver(&Noise::Off);
    let mut noisy = driver(&Noise::Constant(vec![0.04; 6]));
    let (mut squares, mut count) = (0.0, 0.0);
    for _ in 0..500 {
        let decision = quiet.decide(&[0.1; 6]).unwrap();
        assert_eq!(decision.target[..], decision.mean[2..]);
        let decision = noisy.decide(&[0.1; 6]).unwrap();
        squares += decision.target.iter().zip(&decision.mean[2..]).map(|(t, m)| (t - m).powi(2)).sum::<f64>();
        count += 4.0;
    }
    assert!((squares / count / 0.04 - 1.0).abs() < 0.1, "{}", squares / count);
}

#[test]
fn networks_of_another_kind_are_refused() {
    let topology = Topology::s_ctrnn(5, 8, 2.0).unwrap();
    let (network, states) = initialize(&topology, 1, 3);
    let new =
        |noise: &Noise| NetworkDriver::new(&network, states.mean(), &Scaling::identity(5), noise, 5, &Engine::serial());
    let message = new(&Noise::Off).unwrap_err().to_string();
    assert!(message.contains("on 5 channels with a delay of 1; needed: 6 channels"), "{message}");
    assert!(driver(&Noise::Off).decide(&[0.0; 5]).is_err());
    assert!(Replay::new(Vec::new()).is_err());
}

#[test]
fn regression_on_phase_and_gaze_follows_what_it_was_fitted_to() {
    // An arm that is a function of phase and yaw.
    let arm = |phase: f64, yaw: f64| (std::f64::consts::TAU * phase).sin() + yaw;
    let mut points = Vec::new();
    for k in 0..600 {
        let yaw = -0.6 + 0.3 * f64::from(k / 12 % 3);
        let given = MixtureDriver::given(k as usize, 12, &[yaw, 0.1 * yaw]);
        let value = arm(given[0], yaw);
        points.extend(given);
        points.extend([value, -value, 0.5 * value, yaw]);
    }
    let options = MixtureOptions { components: 20, ..MixtureOptions::default() };
    let regression = || GaussianMixture::fit(&points, 7, &options).unwrap().regression(3).unwrap();
    let mut driver = MixtureDriver::new(regression(), 12, None);
    for k in 1..24 {
        let decision = driver.decide(&[-0.3, -0.03, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let expected = arm(f64::from(k % 12) / 12.0, -0.3);
        assert!((decision.target[0] - expected).abs() < 0.25, "sample {k}: {} for {expected}", decision.target[0]);
        assert_eq!(decision.target[..], decision.mean[2..]);
    }
    let noisy = MixtureDriver::new(regression(), 12, Some(1)).decide(&[-0.3, -0.03, 0.0, 0.0, 0.0, 0.0]).unwrap();
    assert_ne!(noisy.target[..], noisy.mean[2..]);
}
