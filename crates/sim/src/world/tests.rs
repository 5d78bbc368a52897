//! Servos, limits, contacts, determinism.

use nalgebra::{Point3, Translation3, UnitQuaternion};

use super::*;
use crate::robot::joints::RIGHT_ARM;
use crate::robot::nao;

const REST: [f64; 6] = [0.0, 0.0, 0.3, -0.6, 0.4, 1.0];

fn with_nao(posture: &[f64]) -> (World, RobotId) {
    let mut world = World::new(WorldOptions::default()).unwrap();
    let robot = nao::load_one_armed().unwrap();
    let placement = Placement {
        name: "self",
        world_from_root: Isometry3::translation(0.1, 0.2, 0.3),
        posture,
        part: Part::Robot,
        hands: &["r_hand"],
    };
    let id = world.add_robot(&robot, &placement).unwrap();
    (world, id)
}

fn run(world: &mut World, seconds: f64) {
    let end = world.time() + seconds;
    while world.time() < end - 1e-9 {
        world.step();
    }
}

#[test]
fn links_are_where_forward_kinematics_say() {
    let (mut world, nao) = with_nao(&REST);
    for moment in 0..5 {
        let q = world.robot(nao).unwrap().angles();
        let expected = world.robot(nao).unwrap().description().forward(&q).unwrap();
        for (index, root_from_link) in expected.iter().enumerate() {
            let off = (world.robot(nao).unwrap().world_from_root() * root_from_link).translation.vector
                - world.robot(nao).unwrap().link(index).unwrap().translation.vector;
            assert!(
                off.norm() < 1e-9,
                "{} is off by {} m at time {moment}",
                world.robot(nao).unwrap().description().links[index].name,
                off.norm()
            );
        }
        if moment == 0 {
            assert!(q.iter().zip(REST).all(|(q, rest)| (q - rest).abs() < 1e-12), "{q:?}");
        }
        let mut goal = REST;
        goal[moment % 6] += 0.2;
        world.set_goals(nao, &goal).unwrap();
        run(&mut world, 0.1);
    }
}

#[test]
fn the_arm_follows_a_movement_to_milliradians() {
    let (mut world, nao) = with_nao(&REST);
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0.0);
    for k in 0..1000 {
        let t = 0.005 * f64::from(k);
        let goal: Vec<f64> = REST
            .iter()
            .enumerate()
            .map(|(j, q)| q + 0.25 * (1.0 - (std::f64::consts::PI * t / 2.5).cos()) * (0.6 + 0.1 * j as f64))
            .collect();
        world.set_goals(nao, &goal).unwrap();
        world.step();
        for (q, goal) in world.robot(nao).unwrap().angles().iter().zip(&goal) {
            worst = worst.max((q - goal).abs());
            sum += (q - goal).abs();
            count += 1.0;
        }
    }
    // Gravity's torque, 0.54 N m at most, pulls a spring of 100 N m/rad down by 5.4 mrad, and by twice as much when it
    // sets in at once.
    assert!(sum / count < 0.002 && worst < 0.011, "mean {} worst {worst}", sum / count);
}

#[test]
fn limits_of_angle_velocity_and_effort_are_kept() {
    let (mut world, nao) = with_nao(&REST);
    let bend = world.robot(nao).unwrap().description().joint("RElbowRoll").unwrap();
    world.set_goal(nao, bend, 9.0).unwrap();
    let upper = world.robot(nao).unwrap().description().limits(bend).unwrap().upper;
    assert_eq!(world.robot(nao).unwrap().goals()[bend], upper);
    let mut fastest = 0.0_f64;
    for _ in 0..200 {
        world.step();
        fastest = fastest.max(world.robot(nao).unwrap().velocities()[bend].abs());
    }
    let allowed = world.robot(nao).unwrap().description().limits(bend).unwrap().velocity;
    assert!(world.robot(nao).unwrap().angles()[bend] < upper + 0.003);
    assert!(fastest < 1.15 * allowed, "{fastest} rad/s of {allowed}");

    // A shoulder with a tenth of its effort cannot hold the arm up.
    let urdf = nao::URDF.replacen(r#"effort="1.329""#, r#"effort="0.1329""#, 1);
    assert_ne!(urdf, nao::URDF);
    let weak = Robot::from_urdf(&urdf).unwrap();
    let posture: Vec<f64> = weak.movable().map(|(_, l)| 0.0_f64.clamp(l.lower, l.upper)).collect();
    let placement = Placement {
        name: "weak",
        world_from_root: Isometry3::identity(),
        posture: &posture,
        part: Part::Robot,
        hands: &[],
    };
    let mut world = World::new(WorldOptions::default()).unwrap();
    let id = world.add_robot(&weak, &placement).unwrap();
    run(&mut world, 1.0);
    let (right, left) = (weak.joint("RShoulderPitch").unwrap(), weak.joint("LShoulderPitch").unwrap());
    let q = world.robot(id).unwrap().angles();
    assert!(q[right] > 0.5 && q[left].abs() < 0.02, "{} {}", q[right], q[left]);
}

#[test]
fn distances_are_geometric_and_contacts_are_true() {
    let (mut world, nao) = with_nao(&REST);
    let effector = world.robot(nao).unwrap().description().link("r_effector").unwrap();
    let tip = world.robot(nao).unwrap().link(effector).unwrap().translation.vector;
    let place = |gap: f64| {
        Isometry3::from_parts(Translation3::from(tip + Vector3::new(0.05 + gap, 0.0, 0.0)), UnitQuaternion::identity())
    };
    let sphere = world.add_fixed("sphere", Part::Object, Shape::Sphere { radius: 0.025 }, place(0.008)).unwrap();
    let hand = world.body("self/r_hand").unwrap();
    // The hand's capsule ends in a half-sphere of 25 mm around the effector, but may be nearer elsewhere.
    let gap = world.gap(hand, sphere).unwrap();
    assert!(gap > 0.0 && gap <= 0.008 + 1e-9, "{gap}");
    world.step();
    assert_eq!(world.contacts(), []);
    world.place(sphere, &place(-0.01)).unwrap();
    assert!(
        (world.gap(hand, sphere).unwrap() - world.gap(sphere, hand).unwrap()).abs() < 1e-9
            && world.gap(hand, sphere).unwrap() < -0.009
    );
    world.step();
    world.step();
    let contacts = world.contacts();
    assert!(contacts.iter().any(|c| c.bodies == [hand, sphere] && c.force > 0.1), "{contacts:?}");
    // A fixed sphere pushes the hand away, against the springs.
    run(&mut world, 0.5);
    assert!(world.gap(hand, sphere).unwrap() > -0.004, "{}", world.gap(hand, sphere).unwrap());
    assert!((world.robot(nao).unwrap().link(effector).unwrap().translation.vector - tip).norm() > 0.004);
}

#[test]
fn arms_stop_at_the_body_and_the_collision_is_seen() {
    // The right hand is swung inward at the height of the chest.
    let (mut world, nao) = with_nao(&[0.0, 0.0, 1.2, 0.0, 0.0, 0.1]);
    assert_eq!(world.self_collision(nao).unwrap(), None);
    for (joint, angle) in RIGHT_ARM.iter().zip([1.2, 0.31, -0.3, 1.54]) {
        let joint = world.robot(nao).unwrap().description().joint(joint).unwrap();
        world.set_goal(nao, joint, angle).unwrap();
    }
    let mut seen = None;
    for _ in 0..300 {
        world.step();
        seen = seen.or(world.self_collision(nao).unwrap());
    }
    let names = seen.unwrap().bodies.map(|body| world.name(body).unwrap().to_owned());
    assert_eq!(names[0], "self/torso");
    assert!(["self/r_hand", "self/r_forearm"].contains(&names[1].as_str()), "{names:?}");
    assert!(world.gap(world.body("self/torso").unwrap(), world.body(&names[1]).unwrap()).unwrap() > -0.01);
}

#[test]
fn what_is_named_like_a_link_is_none() {
    let (mut world, nao) = with_nao(&REST);
    let effector = world.robot(nao).unwrap().description().link("r_effector").unwrap();
    let tip = Isometry3::from(world.robot(nao).unwrap().link(effector).unwrap().translation.vector);
    let ball = world.add_fixed("self/ball", Part::Object, Shape::Sphere { radius: 0.025 }, tip).unwrap();
    world.step();
    let hand = world.body("self/r_hand").unwrap();
    assert!(world.contacts().iter().any(|contact| contact.bodies == [hand, ball]));
    assert_eq!(world.self_collision(nao).unwrap(), None);
    assert_eq!(world.contacts_of(nao).unwrap(), world.contacts());
    assert!(world.is_link_of(hand, nao).unwrap() && !world.is_link_of(ball, nao).unwrap());
}

#[test]
fn a_joint_that_the_physics_refuses_is_named_and_the_world_is_as_before() {
    let mut robot = nao::load_one_armed().unwrap();
    let joint = |name: &str| robot.joints.iter().position(|joint| joint.name == name).unwrap();
    // Both would carry the forearm.
    let (yaw, roll) = (joint("RElbowYaw"), joint("RElbowRoll"));
    robot.joints[yaw].child = robot.joints[roll].child;
    let placement = |robot: &Robot| robot.movable().map(|(_, l)| 0.0_f64.clamp(l.lower, l.upper)).collect::<Vec<_>>();
    let posture = placement(&robot);
    let mut world = World::new(WorldOptions::default()).unwrap();
    let mut add = |robot: &Robot| {
        let world_from_root = Isometry3::identity();
        let hands = &["r_hand"];
        world
            .add_robot(robot, &Placement { name: "self", world_from_root, posture: &posture, part: Part::Robot, hands })
    };
    let message = add(&robot).unwrap_err().to_string();
    assert!(message.starts_with("joint `RElbowRoll`: is refused by the physics"), "{message}");
    // The name is free, and the world runs on.
    let id = add(&nao::load_one_armed().unwrap()).unwrap();
    run(&mut world, 0.1);
    assert_eq!(world.robot(id).unwrap().angles().len(), 6);
    assert!(world.robot(id).unwrap().angles().iter().all(|angle| angle.is_finite()));
}

#[test]
fn every_joint_of_the_description_has_a_state_also_a_locked_one() {
    let (mut world, nao) = with_nao(&REST);
    world.set_goal(nao, 2, 0.8).unwrap();
    run(&mut world, 0.1);
    let states = world.robot(nao).unwrap().joint_states();
    let names: Vec<&str> = states.iter().map(|state| state.name).collect();
    assert_eq!(names, nao::robot().joint_names());
    let whole = nao::robot();
    let q: Vec<f64> = states.iter().map(|state| state.angle).collect();
    for (index, root_from_link) in whole.forward(&q).unwrap().iter().enumerate() {
        let off = (world.robot(nao).unwrap().world_from_root() * root_from_link).translation.vector
            - world.robot(nao).unwrap().link(index).unwrap().translation.vector;
        assert!(off.norm() < 1e-9, "{} is off by {} m", whole.links[index].name, off.norm());
    }
    assert!(states[2].velocity > 0.5 && states[6..].iter().all(|state| state.velocity == 0.0), "{states:?}");
}

#[test]
fn two_robots_share_a_world_and_one_can_hold_a_thing() {
    let (mut world, _) = with_nao(&REST);
    let robot = nao::load_one_armed().unwrap();
    let facing = Isometry3::from_parts(
        Translation3::new(0.53, 0.2, 0.3),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI),
    );
    let placement = Placement {
        name: "other",
        world_from_root: facing,
        posture: &REST,
        part: Part::OtherRobot,
        hands: &["r_hand"],
    };
    let other = world.add_robot(&robot, &placement).unwrap();
    assert_eq!(world.add_robot(&robot, &placement).unwrap_err(), Error::Taken("other".into()));
    let held = Isometry3::translation(0.04, 0.0, 0.0);
    let ball = world.attach(other, "r_effector", "ball", Part::Object, Shape::Sphere { radius: 0.025 }, held).unwrap();
    let effector = robot.link("r_effector").unwrap();
    run(&mut world, 0.3);
    let expected = world.robot(other).unwrap().link(effector).unwrap() * Point3::new(0.04, 0.0, 0.0);
    assert!((world.pose(ball).unwrap().translation.vector - expected.coords).norm() < 1e-9);
    // What is held does not push the hand that holds it.
    assert_eq!(world.contacts(), []);
    assert!(world.robot(other).unwrap().angles().iter().zip(REST).all(|(q, rest)| (q - rest).abs() < 0.02));
    let scene = world.scene();
    let mut names: Vec<&str> = scene.bodies.iter().map(|body| body.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), scene.bodies.len());
    assert!(scene.frames.iter().any(|frame| frame.name == "other/r_effector"));
    assert_eq!(scene.bodies.iter().filter(|body| body.part == Part::Hand).count(), 2);
}

#[test]
fn a_kinematic_thing_pushes_an_arm_away() {
    let (mut world, nao) = with_nao(&REST);
    let effector = world.robot(nao).unwrap().description().link("r_effector").unwrap();
    let tip = world.robot(nao).unwrap().link(effector).unwrap().translation.vector;
    let place = |share: f64| {
        Isometry3::from_parts(
            Translation3::from(tip + Vector3::new(0.10 - 0.08 * share, 0.0, 0.0)),
            UnitQuaternion::identity(),
        )
    };
    let ball = world.add_kinematic("ball", Part::Object, Shape::Sphere { radius: 0.025 }, place(0.0)).unwrap();
    for k in 1..=100 {
        world.move_kinematic(ball, &place(f64::from(k) / 100.0)).unwrap();
        world.step();
    }
    assert!((world.pose(ball).unwrap().translation.vector - place(1.0).translation.vector).norm() < 1e-9);
    assert!(world.robot(nao).unwrap().link(effector).unwrap().translation.x < tip.x - 0.01);
}

#[test]
fn the_same_calls_give_the_same_bits() {
    let run = || {
        let (mut world, nao) = with_nao(&REST);
        world
            .add_fixed("sphere", Part::Object, Shape::Sphere { radius: 0.025 }, Isometry3::translation(0.3, 0.1, 0.35))
            .unwrap();
        for k in 0..400 {
            let goal: Vec<f64> = REST.iter().map(|q| q + 0.5 * (0.03 * f64::from(k)).sin()).collect();
            world.set_goals(nao, &goal).unwrap();
            world.step();
        }
        let bits: Vec<u64> = world
            .robot(nao)
            .unwrap()
            .angles()
            .iter()
            .chain(&world.robot(nao).unwrap().velocities())
            .map(|x| x.to_bits())
            .collect();
        (bits, world.scene())
    };
    let alone = run();
    let beside: Vec<_> =
        std::thread::scope(|scope| [scope.spawn(run), scope.spawn(run)].map(|one| one.join().unwrap()).into());
    assert!(beside.iter().all(|one| *one == alone));
}

#[test]
fn a_world_refuses_what_it_cannot_hold() {
    for step in [0.0, -0.005, f64::NAN, 0.2] {
        let message = World::new(WorldOptions { step, ..WorldOptions::default() }).err().unwrap().to_string();
        assert!(message.contains("length of a step") && message.contains("0.1 at most"), "{message}");
    }
    let robot = nao::load_one_armed().unwrap();
    let mut world = World::new(WorldOptions::default()).unwrap();
    let mut add = |name, posture: &[f64]| {
        let world_from_root = Isometry3::identity();
        world.add_robot(&robot, &Placement { name, world_from_root, posture, part: Part::Robot, hands: &["r_hand"] })
    };
    let message = add("short", &REST[..5]).unwrap_err().to_string();
    assert!(message.contains("posture") && message.contains('5') && message.contains('6'), "{message}");
    let mut twisted = REST;
    twisted[0] = 9.0;
    let message = add("twisted", &twisted).unwrap_err().to_string();
    assert!(message.contains("cannot start at 9 rad"), "{message}");
    add("self", &REST).unwrap();
    assert!(add("self", &REST).unwrap_err().to_string().contains("self"));
    let message = world.body("ball").unwrap_err().to_string();
    assert!(message.contains("ball") && message.contains("self/r_hand"), "{message}");
    let ball = |world: &mut World| {
        world.add_fixed("ball", Part::Object, Shape::Sphere { radius: 0.1 }, Isometry3::translation(1.0, 0.0, 0.0))
    };
    ball(&mut world).unwrap();
    assert!(ball(&mut world).unwrap_err().to_string().contains("ball"));
    assert!(format!("{world:?}").contains("self/r_hand"));
}

#[test]
fn a_cylinder_stands_along_z_as_a_description_says() {
    let mut world = World::new(WorldOptions::default()).unwrap();
    let cylinder = Shape::Cylinder { half_length: 0.5, radius: 0.1 };
    let turned = |turn| Isometry3::from_parts(Translation3::identity(), turn);
    let column = world.add_fixed("column", Part::Object, cylinder, turned(UnitQuaternion::identity())).unwrap();
    let mut ball = |name: &str, x: f64, z: f64| {
        let place = Isometry3::translation(x, 0.0, z);
        world.add_fixed(name, Part::Object, Shape::Sphere { radius: 0.05 }, place).unwrap()
    };
    let (above, beside) = (ball("above", 0.0, 0.6), ball("beside", 0.2, 0.3));
    assert!((world.gap(column, above).unwrap() - 0.05).abs() < 1e-6, "{}", world.gap(column, above).unwrap());
    assert!((world.gap(column, beside).unwrap() - 0.05).abs() < 1e-6, "{}", world.gap(column, beside).unwrap());
    // Lying along x it reaches the ball beside it, and no longer the one above.
    let lying = UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    world.place(column, &turned(lying)).unwrap();
    world.step();
    assert!((world.gap(column, above).unwrap() - 0.45).abs() < 1e-6, "{}", world.gap(column, above).unwrap());
    assert!((world.gap(column, beside).unwrap() - 0.15).abs() < 1e-6, "{}", world.gap(column, beside).unwrap());
}

#[test]
fn what_another_world_has_and_what_is_not_there_is_refused() {
    let robot = nao::load().unwrap();
    let with = |name: &str| {
        let mut world = World::new(WorldOptions::default()).unwrap();
        let posture: Vec<f64> = robot.movable().map(|(_, limits)| 0.0_f64.clamp(limits.lower, limits.upper)).collect();
        let (world_from_root, part) = (Isometry3::identity(), Part::Robot);
        let id =
            world.add_robot(&robot, &Placement { name, world_from_root, posture: &posture, part, hands: &[] }).unwrap();
        let far = Isometry3::translation(5.0, 0.0, 0.0);
        let ball =
            world.add_fixed(&format!("{name}'s ball"), Part::Object, Shape::Sphere { radius: 0.1 }, far).unwrap();
        (world, id, ball)
    };
    let (mut here, id, ball) = with("here");
    let (_, other, other_ball) = with("elsewhere");
    let sphere = || Shape::Sphere { radius: 0.1 };
    let place = Isometry3::identity();
    let refused = [
        here.robot(other).err(),
        here.set_goal(other, 0, 0.1).err(),
        here.set_goals(other, &[0.0; 10]).err(),
        here.set_servo(other, 0, Servo::default()).err(),
        here.attach(other, "torso", "new", Part::Object, sphere(), place).err(),
        here.contacts_of(other).err(),
        here.self_collision(other).err(),
        here.is_link_of(ball, other).err(),
        here.is_link_of(other_ball, id).err(),
        here.gap(ball, other_ball).err(),
        here.name(other_ball).err(),
        here.pose(other_ball).err(),
        here.place(other_ball, &place).err(),
        here.move_kinematic(other_ball, &place).err(),
        here.ignore_contacts(other_ball, ball).err(),
    ];
    for (number, error) in refused.into_iter().enumerate() {
        let message = error.unwrap_or_else(|| panic!("{number} is taken")).to_string();
        assert!(message.contains("of another world; those of this one are: here"), "{number}: {message}");
    }
    let missing = [
        here.set_goal(id, 10, 0.1).err(),
        here.set_servo(id, 10, Servo::default()).err(),
        here.robot(id).unwrap().link(999).err(),
    ];
    assert!(missing.iter().all(|error| matches!(error, Some(Error::NoSuch { .. }))), "{missing:?}");
    assert!(matches!(here.set_goals(id, &[0.0; 9]), Err(Error::Length { found: 9, needed: 10, .. })));
    assert!(here.gap(ball, ball).is_ok() && here.name(ball).unwrap() == "here's ball");
}
