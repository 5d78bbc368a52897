//! What the robots do, see and run into.

use super::*;
use crate::interact::order::{all_orders, branchings, parse_order};

fn quiet() -> InteractionOptions {
    InteractionOptions { noise: SensorNoise([0.0; 8]), ..InteractionOptions::default() }
}

fn one(order: &str) -> Sequence {
    record(&parse_order(order).unwrap(), &quiet(), (1, 0), usize::MAX, |_, _| {}).unwrap()
}

#[test]
fn orders_are_all_there_and_read_back() {
    let orders = all_orders(5);
    assert_eq!(orders.len(), 32);
    assert_eq!(
        (letters(&orders[0]), letters(&orders[6]), letters(&orders[31])),
        ("LLLLL".into(), "LLRRL".into(), "RRRRR".into())
    );
    for order in &orders {
        assert_eq!(&parse_order(&letters(order)).unwrap(), order);
    }
    assert!(parse_order("").is_err());
    assert!(parse_order("LXR").unwrap_err().to_string().contains("`LXR`"));
    assert_eq!((samples(&orders[0]), branchings(5)), (470, vec![20, 110, 200, 290, 380]));
}

#[test]
fn the_tutored_arm_goes_to_the_object_s_side_and_comes_back() {
    let data = one("LR");
    let roll = |sample: usize| data.sample(sample)[5];
    for (sample, target) in [(0, -0.280), (20, -0.280), (60, 0.272), (108, -0.280), (150, -0.597), (199, -0.280)] {
        assert!((roll(sample) - target).abs() < 0.02, "sample {sample}: {} for {target}", roll(sample));
    }
}

#[test]
fn the_head_lags_behind_so_that_the_image_shows_the_movement() {
    let data = one("LR");
    let x = |sample: usize| data.sample(sample)[0];
    assert!((x(0) - 160.0).abs() < 1.0, "{}", x(0));
    // The object moves to the left of the image, then the head catches up.
    let leftmost = (20..70).map(x).fold(f64::INFINITY, f64::min);
    assert!((110.0..130.0).contains(&leftmost), "{leftmost}");
    assert!((x(69) - 160.0).abs() < 5.0, "{}", x(69));
    // The head still lags behind the way back when the object goes on to the right. For an object that stays in a plane, and a
    // head that does not nod, this was computed apart: 217.
    let rightmost = (110..140).map(x).fold(0.0, f64::max);
    assert!((210.0..225.0).contains(&rightmost), "{rightmost}");
    // What the head's yaw settles at was computed apart from this code.
    let yaw = data.sample(69)[2];
    assert!((yaw - 0.565).abs() < 0.02, "{yaw}");
}

#[test]
fn nothing_touches_while_the_robots_agree_and_hands_collide_when_they_do_not() {
    let touched = |order: &str, arm: Option<Side>| {
        let mut interaction = Interaction::new(&parse_order(order).unwrap(), &quiet(), 1, 0).unwrap();
        let mut found = Vec::new();
        for _ in 0..70 {
            match arm {
                None => interaction.step_tutored(),
                Some(side) => {
                    let led = out(&[side], (interaction.taken + 1) as f64 * PERIOD);
                    interaction.step(between(&SELF_ARM, led));
                }
            }
            found.extend(interaction.collision());
        }
        found
    };
    assert_eq!(touched("L", None), []);
    assert_eq!(touched("R", None), []);
    assert_eq!(touched("R", Some(Side::Right)), []);
    assert!(!touched("R", Some(Side::Left)).is_empty());
}

#[test]
fn noise_has_the_deviation_that_was_asked_for_and_the_same_seed_the_same_bits() {
    let order = parse_order("L").unwrap();
    let options = InteractionOptions::default();
    let noisy = record(&order, &options, (3, 0), usize::MAX, |_, _| {}).unwrap();
    assert_eq!(noisy, record(&order, &options, (3, 0), usize::MAX, |_, _| {}).unwrap());
    assert_ne!(noisy, record(&order, &options, (4, 0), usize::MAX, |_, _| {}).unwrap());
    let clean = record(&order, &quiet(), (3, 0), usize::MAX, |_, _| {}).unwrap();
    for channel in 0..8 {
        let squares: f64 = noisy
            .values()
            .chunks(8)
            .zip(clean.values().chunks(8))
            .map(|(a, b)| (a[channel] - b[channel]).powi(2))
            .sum();
        let ratio = (squares / 110.0).sqrt() / options.noise.0[channel];
        assert!((0.75..1.25).contains(&ratio), "{}: {ratio}", CHANNELS[channel]);
    }
}

#[test]
fn a_trial_draws_other_noise_than_the_recording_of_its_seed() {
    let order = parse_order("L").unwrap();
    let (options, seed) = (InteractionOptions::default(), 3);
    let standardised = |noisy: &[f64; 8], truth: &[f64; 8]| -> Vec<f64> {
        (0..8).map(|channel| (noisy[channel] - truth[channel]) / options.noise.0[channel]).collect()
    };
    let mut recorded = Vec::new();
    record(&order, &options, (seed, 0), usize::MAX, |interaction, sample| {
        recorded.extend(standardised(sample, &interaction.truth()));
    })
    .unwrap();
    let mut trial = Interaction::new(&order, &options, seed, 0).unwrap();
    let mut sensed = Vec::new();
    for _ in 0..trial.samples() {
        let sample = trial.sense();
        sensed.extend(standardised(&sample, &trial.truth()));
        trial.step_tutored();
    }
    assert_eq!((recorded.len(), sensed.len()), (880, 880));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let correlation = product(&recorded, &sensed) / (product(&recorded, &recorded) * product(&sensed, &sensed)).sqrt();
    // Of 880 independent pairs it has a deviation of 0.034.
    assert!(correlation.abs() < 0.1, "{correlation}");
}

#[test]
fn a_noise_that_is_no_number_is_refused() {
    for bad in [-0.1, f64::NAN, f64::INFINITY] {
        let mut options = quiet();
        options.noise.0[3] = bad;
        let message = Interaction::new(&[Side::Left], &options, 1, 0).err().unwrap().to_string();
        assert!(message.contains("a sensor's noise") && message.contains(&bad.to_string()), "{message}");
    }
}
