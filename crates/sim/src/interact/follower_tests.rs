//! How branchings are judged, and that an untrained network goes through the whole loop.

use scrnn::initialization::initialize;
use scrnn::topology::{Group, Prediction, Topology};

use super::*;
use crate::interact::interaction::{InteractionOptions, parse_order, samples};

fn moment(hand: f64) -> Moment {
    Moment {
        sensed: [0.0; 8],
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
    let mut moments = vec![moment(0.0); samples(&order)];
    let starts = branchings(5);
    let swing = |moments: &mut [Moment], from: usize, to: f64| {
        moments[from..from + 20].iter_mut().for_each(|moment| moment.hand = to);
    };
    swing(&mut moments, starts[0] + 15, 0.9);
    // First to the wrong side, then to the right one: a failure.
    swing(&mut moments, starts[1] + 15, -0.7);
    swing(&mut moments, starts[1] + 40, 0.9);
    // Not far enough to count.
    swing(&mut moments, starts[2] + 15, -0.5);
    swing(&mut moments, starts[3] + 15, 0.9);
    moments[starts[3] + 50].collision = Some(Collision::Hand);
    // A swing that begins in one primitive and ends in the next belongs to the first.
    swing(&mut moments, starts[4] - 5, -0.9);
    swing(&mut moments, starts[4] + 20, 0.9);
    moments[starts[3] + 20..starts[3] + 28].iter_mut().for_each(|moment| moment.error = 1.0);
    let found = judge(&moments, &order);
    let outcomes: Vec<Outcome> = found.iter().map(|branch| branch.outcome).collect();
    assert_eq!(outcomes, [Outcome::Success, Outcome::Opposite, Outcome::Stayed, Outcome::Collision, Outcome::Success]);
    assert_eq!(found[3].collision, Some(Collision::Hand));
    assert_eq!(found.iter().map(|branch| branch.reaction_time).collect::<Vec<_>>(), [0, 0, 0, 29, 0]);
}

#[test]
fn the_loop_runs_from_sensors_to_arm_and_the_same_seed_gives_the_same_bits() {
    let groups = vec![Group::fast(6, 5.0), Group::slow(3, 100.0)];
    let topology = Topology::new(8, 5, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
    let (network, states) = initialize(&topology, 1, 3);
    // Scaled 0 is the arm's centre.
    let [centre, ..] = arm_postures();
    let offset = [&[160.0, 120.0, 0.28, 0.28][..], &centre].concat();
    let scaling = Scaling::new(offset, [&[0.01, 0.1, 2.0, 20.0][..], &[4.0; 4]].concat()).unwrap();
    let mind = Mind {
        network: &network,
        scaling: &scaling,
        initial_state: states.sequence(0),
        instruction_set: InstructionSet::best(),
    };
    let options = with_own_arm(ErrorRegressionOptions { iterations: 2, ..ErrorRegressionOptions::new(8) });
    let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
    let run = || {
        let mut interaction = Interaction::new(&parse_order("R").unwrap(), &InteractionOptions::default(), 5).unwrap();
        let mut commands = Vec::new();
        let followed = follow(&mind, &options, &mut interaction, observe, |_, _, regression| {
            commands.push(regression.mean()[ARM.start]);
        });
        (followed.unwrap(), commands)
    };
    let (followed, commands) = run();
    assert_eq!(followed.moments.len(), 110);
    assert_eq!(followed.moments.iter().filter(|moment| moment.predicted.is_none()).count(), 5);
    // The arm is where it was told to be, up to the servo's lag and what gravity pulls.
    let shoulder = |k: usize| (followed.moments[k].sensed[4] - centre[0]) * 4.0;
    let off = (30..100).map(|k| (shoulder(k + 1) - commands[k]).abs()).fold(0.0, f64::max);
    assert!(off < 0.1, "{off}");
    assert_eq!(followed, run().0);
    let stranger = Topology::s_ctrnn(2, 3, 2.0).unwrap();
    let (network, states) = initialize(&stranger, 1, 3);
    let mind = Mind { network: &network, initial_state: states.sequence(0), ..mind };
    let mut interaction = Interaction::new(&[Side::Left], &InteractionOptions::default(), 5).unwrap();
    let refused = follow(&mind, &options, &mut interaction, observe, |_, _, _| {}).unwrap_err();
    assert!(refused.to_string().contains("channels holds 2 values; needed: 8"), "{refused}");
}
