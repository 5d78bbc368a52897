//! How branchings are judged, and that an untrained network goes through the whole loop.

use scrnn::initialization::initialize;
use scrnn::topology::{Group, Prediction, Topology};

use super::*;
use crate::interact::{InteractionOptions, parse_order, samples};

fn step(hand: f64) -> ControlStep {
    ControlStep {
        sensed: [0.0; 8],
        object_in_view: true,
        predicted: None,
        variance: Vec::new(),
        context: Vec::new(),
        regression: Regression::default(),
        error: 0.0,
        hand,
        collision: None,
    }
}

#[test]
fn a_branching_is_judged_by_where_the_hand_goes_in_it() {
    let order = parse_order("LLLLL").unwrap();
    let mut steps = vec![step(0.0); samples(&order)];
    let starts = branchings(5);
    let swing = |steps: &mut [ControlStep], from: usize, to: f64| {
        steps[from..from + 20].iter_mut().for_each(|step| step.hand = to);
    };
    swing(&mut steps, starts[0] + 15, 0.9);
    // First to the wrong side, then to the right one: a failure.
    swing(&mut steps, starts[1] + 15, -0.7);
    swing(&mut steps, starts[1] + 40, 0.9);
    // Not far enough to count.
    swing(&mut steps, starts[2] + 15, -0.5);
    swing(&mut steps, starts[3] + 15, 0.9);
    steps[starts[3] + 50].collision = Some(Collision::Hand);
    // A swing that begins in one primitive and ends in the next belongs to the first.
    swing(&mut steps, starts[4] - 5, -0.9);
    swing(&mut steps, starts[4] + 20, 0.9);
    steps[starts[3] + 20..starts[3] + 28].iter_mut().for_each(|step| step.error = 1.0);
    let found = judge(&steps, &order);
    let outcomes: Vec<Outcome> = found.iter().map(|branch| branch.outcome).collect();
    assert_eq!(outcomes, [Outcome::Success, Outcome::Opposite, Outcome::Stayed, Outcome::Collision, Outcome::Success]);
    assert_eq!(found[3].collision, Some(Collision::Hand));
    assert_eq!(found.iter().map(|branch| branch.reaction_time).collect::<Vec<_>>(), [0, 0, 0, 29, 0]);
}

/// An untrained network, its initial state, and a scaling in which 0 is the arm's centre.
fn untrained() -> (Network, Vec<f64>, Scaling) {
    let groups = vec![Group::fast(6, 5.0), Group::slow(3, 100.0)];
    let topology = Topology::new(8, 5, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
    let (network, states) = initialize(&topology, 1, 3);
    let [centre, ..] = arm_postures();
    let offset = [&[160.0, 120.0, 0.28, 0.28][..], &centre].concat();
    let scaling = Scaling::new(offset, [&[0.01, 0.1, 2.0, 20.0][..], &[4.0; 4]].concat()).unwrap();
    (network, states.sequence(0).to_vec(), scaling)
}

#[test]
fn an_object_out_of_view_stays_where_it_was_seen_last_and_the_interaction_goes_on() {
    let (network, initial_state, scaling) = untrained();
    let engine = &Engine::serial();
    let controller = Controller { network: &network, scaling: &scaling, initial_state: &initial_state, engine };
    let options = with_own_arm(ErrorRegressionOptions::with(8, |it| {
        it.iterations = 1;
    }));
    let mut interaction = Interaction::new(&parse_order("R").unwrap(), &InteractionOptions::default(), 5, 0).unwrap();
    interaction.turn_away();
    let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
    let followed = follow(&controller, &options, &mut interaction, observe, |_, _, _| Ok::<(), Error>(())).unwrap();
    assert_eq!(followed.steps.len(), 110);
    let lost = followed.steps.iter().position(|step| !step.object_in_view).unwrap();
    assert!((1..10).contains(&lost), "{lost}");
    let held = followed.steps[lost - 1].sensed;
    for step in &followed.steps[lost..] {
        assert!(!step.object_in_view && step.sensed[..2] == held[..2], "{:?} for {held:?}", step.sensed);
        assert!(step.sensed[2] > 1.0, "the head is sensed all the same: {:?}", step.sensed);
    }
}

#[test]
fn whoever_watches_can_end_an_interaction() {
    #[derive(Debug, PartialEq)]
    enum Ended {
        ByRequest(usize),
        Failed(String),
    }
    impl From<Error> for Ended {
        fn from(error: Error) -> Self {
            Self::Failed(error.to_string())
        }
    }
    let (network, initial_state, scaling) = untrained();
    let engine = &Engine::serial();
    let controller = Controller { network: &network, scaling: &scaling, initial_state: &initial_state, engine };
    let options = with_own_arm(ErrorRegressionOptions::with(8, |it| {
        it.iterations = 0;
    }));
    let mut interaction = Interaction::new(&parse_order("R").unwrap(), &InteractionOptions::default(), 5, 0).unwrap();
    let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
    let mut seen = 0;
    let ended = follow(&controller, &options, &mut interaction, observe, |_, _, _| {
        seen += 1;
        if seen == 7 { Err(Ended::ByRequest(seen)) } else { Ok(()) }
    });
    assert_eq!((ended.unwrap_err(), seen), (Ended::ByRequest(7), 7));
}

#[test]
fn the_loop_runs_from_sensors_to_arm_and_the_same_seed_gives_the_same_bits() {
    let (network, initial_state, scaling) = untrained();
    let [centre, ..] = arm_postures();
    let engine = &Engine::serial();
    let controller = Controller { network: &network, scaling: &scaling, initial_state: &initial_state, engine };
    let options = with_own_arm(ErrorRegressionOptions::with(8, |it| {
        it.iterations = 2;
    }));
    let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
    let run = || {
        let mut interaction =
            Interaction::new(&parse_order("R").unwrap(), &InteractionOptions::default(), 5, 0).unwrap();
        let mut commands = Vec::new();
        let followed = follow(&controller, &options, &mut interaction, observe, |_, _, regression| {
            commands.push(regression.mean()[ARM.start]);
            Ok::<(), Error>(())
        });
        (followed.unwrap(), commands)
    };
    let (followed, commands) = run();
    assert_eq!(followed.steps.len(), 110);
    assert_eq!(followed.steps.iter().filter(|step| step.predicted.is_none()).count(), 5);
    // The arm is where it was told to be, up to the servo's lag and what gravity pulls.
    let shoulder = |k: usize| (followed.steps[k].sensed[4] - centre[0]) * 4.0;
    let off = (30..100).map(|k| (shoulder(k + 1) - commands[k]).abs()).fold(0.0, f64::max);
    assert!(off < 0.1, "{off}");
    assert_eq!(followed, run().0);
    let stranger = Topology::s_ctrnn(2, 3, 2.0).unwrap();
    let (network, states) = initialize(&stranger, 1, 3);
    let controller = Controller { network: &network, initial_state: states.sequence(0), ..controller };
    let mut interaction = Interaction::new(&[Side::Left], &InteractionOptions::default(), 5, 0).unwrap();
    let refused = follow(&controller, &options, &mut interaction, observe, |_, _, _| Ok::<(), Error>(())).unwrap_err();
    assert!(refused.to_string().contains("channels holds 2 values; needed: 8"), "{refused}");
}
