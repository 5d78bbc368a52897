//! Descriptions, sound and broken.

use super::*;
use crate::robot::nao;

const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision></link>
  <joint name="swivel" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 2"/>
    <limit effort="3" velocity="4"/></joint>
</robot>"#;

const SECOND: &str = r#"<joint name="swivel" type="fixed"><parent link="base"/><child link="upper"/></joint></robot>"#;

fn complaint(from: &str, to: &str) -> String {
    assert!(ARM.contains(from), "{from}");
    Robot::from_urdf(&ARM.replace(from, to)).unwrap_err().to_string()
}

#[test]
fn any_tree_of_turning_joints_is_read() {
    let robot = Robot::from_urdf(ARM).unwrap();
    assert_eq!(robot.joint_names(), ["swivel"]);
    let (joint, limits) = robot.movable().next().unwrap();
    assert_eq!((joint.parent, joint.child, limits.effort, limits.velocity), (0, 1, 3.0, 4.0));
    assert_eq!(robot.links[1].shapes[0].0, Shape::Cylinder { half_length: 0.25, radius: 0.1 });
    let Motion::Revolute { axis, .. } = joint.motion else { panic!() };
    assert_eq!(axis.into_inner(), Vector3::z());
}

#[test]
fn a_cylinder_with_round_ends_is_one_capsule_and_other_shapes_stay() {
    let with = |shapes: &str| {
        let cylinder = r#"<collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>"#;
        Robot::from_urdf(&ARM.replace(cylinder, shapes)).unwrap().links[1].shapes.clone()
    };
    let shape = |x: f64, y: f64, turn: &str, geometry: &str| {
        format!(r#"<collision><origin xyz="{x} {y} 0" rpy="{turn}"/><geometry>{geometry}</geometry></collision>"#)
    };
    let (sphere, lying) = (r#"<sphere radius="0.1"/>"#, "0 1.5707963267948966 0");
    let cylinder = shape(0.3, 0.2, lying, r#"<cylinder radius="0.1" length="0.4"/>"#);
    let (left, right) = (shape(0.1, 0.2, "0 0 0", sphere), shape(0.5, 0.2, "0 0 0", sphere));
    let other = shape(0.0, 0.0, "0 0 0", r#"<sphere radius="0.2"/>"#);

    let joined = with(&[&left[..], &other, &cylinder, &right].concat());
    assert_eq!(joined.len(), 2, "{joined:?}");
    assert_eq!(joined[0].0, Shape::Sphere { radius: 0.2 });
    let (Shape::Capsule { a, b, radius }, place) = &joined[1] else { panic!("{joined:?}") };
    assert_eq!(*radius, 0.1);
    assert!(
        (place * a - Point3::new(0.1, 0.2, 0.0)).norm() < 1e-12
            && (place * b - Point3::new(0.5, 0.2, 0.0)).norm() < 1e-12
    );
    // The extension says the same.
    assert_eq!(with(&shape(0.3, 0.2, lying, r#"<capsule radius="0.1" length="0.4"/>"#))[0], joined[1]);

    // One end alone, an end elsewhere, another radius: nothing is joined.
    let elsewhere = shape(0.5, 0.21, "0 0 0", sphere);
    let thin = shape(0.5, 0.2, "0 0 0", r#"<sphere radius="0.09"/>"#);
    for shapes in [vec![&left, &cylinder], vec![&left, &cylinder, &elsewhere], vec![&left, &cylinder, &thin]] {
        let kept = with(&shapes.iter().map(|shape| shape.as_str()).collect::<String>());
        assert_eq!(kept.len(), shapes.len());
        assert_eq!(kept[1].0, Shape::Cylinder { half_length: 0.2, radius: 0.1 });
    }
}

#[test]
fn what_is_wrong_is_named() {
    let cases = [
        ("<robot", "<obot", "cannot be read"),
        (r#"link name="base""#, r#"link name="upper""#, "link `upper`: is described twice"),
        (
            r#"<parent link="base"/>"#,
            r#"<parent link="bse"/>"#,
            "joint `swivel`: names a link `bse` that is not described",
        ),
        ("continuous", "prismatic", "joint `swivel`: is of type Prismatic; needed: revolute"),
        ("0 0 2", "0 0 0", "joint `swivel`: turns about [0.0, 0.0, 0.0]; needed: a direction"),
        (r#"effort="3""#, r#"effort="0""#, "joint `swivel`: has the effort limit 0"),
        ("continuous", "revolute", "joint `swivel`: has limits 0 to 0; needed: a range"),
        (r#"mass value="1""#, r#"mass value="0""#, "link `upper`: has no mass, but joint `swivel` moves it"),
        (r#"mass value="1""#, r#"mass value="-1""#, "link `upper`: has a mass of -1"),
        (r#"izz="1""#, r#"izz="-1""#, "link `upper`: has an inertia that is not positive"),
        (r#"radius="0.1""#, r#"radius="0""#, "link `upper`: has a cylinder of size 0"),
        (
            r#"<cylinder radius="0.1" length="0.5"/>"#,
            r#"<mesh filename="a.stl"/>"#,
            "link `upper`: has the mesh `a.stl`",
        ),
        (r#"<link name="base"/>"#, r#"<link name="base"/><link name="loose"/>"#, "link `loose`: hangs on no joint"),
        (r#"<parent link="base"/>"#, r#"<parent link="upper"/>"#, "joint `swivel`: does not hang on the root"),
        ("</robot>", SECOND, "joint `swivel`: is described twice"),
        (
            "</robot>",
            &SECOND.replace("swivel", "other"),
            "link `upper`: is carried by two joints, `swivel` and `other`",
        ),
        (r#"<axis xyz"#, r#"<origin xyz="0 nan 0"/><axis xyz"#, "joint `swivel`: has an origin that holds NaN"),
        ("<limit", r#"<mimic joint="other"/><limit"#, "joint `swivel`: mimics another joint"),
    ];
    for (from, to, expected) in cases {
        let found = complaint(from, to);
        assert!(found.contains(expected), "{found}\nneeded: {expected}");
    }
}

#[test]
fn a_locked_joint_holds_its_angle_and_links_keep_their_place() {
    let mut robot = nao::robot();
    let mut q: Vec<f64> = (0..robot.dof()).map(|k| 0.1 + 0.03 * k as f64).collect();
    robot.clamp(&mut q);
    let before = robot.forward(&q).unwrap();
    let joint = robot.joint("RElbowYaw").unwrap();
    robot.lock("RElbowYaw", q[joint]).unwrap();
    q.remove(joint);
    for (a, b) in before.iter().zip(robot.forward(&q).unwrap()) {
        assert!((a.translation.vector - b.translation.vector).norm() < 1e-12);
    }
    let by_name = robot.all_angles(&q);
    assert_eq!(by_name.len(), 10);
    assert!(by_name.contains(&("RElbowYaw", 0.1 + 0.03 * 4.0)), "{by_name:?}");
    assert!(robot.joint("RElbowYaw").unwrap_err().to_string().contains("there is no movable joint `RElbowYaw`"));
    assert!(robot.lock("HeadYaw", 9.0).is_err());
}

#[test]
fn neighbours_may_overlap_and_others_may_not() {
    let robot = nao::robot();
    let may = |a, b| robot.may_overlap(robot.link(a).unwrap(), robot.link(b).unwrap());
    // The neck and the shoulder have no shape: head and torso are neighbours.
    assert!(may("torso", "head") && may("r_bicep", "r_hand") && may("r_forearm", "r_hand") && may("torso", "r_bicep"));
    assert!(
        !may("torso", "r_hand") && !may("torso", "r_forearm") && !may("head", "r_hand") && !may("r_hand", "l_hand")
    );
}

#[test]
fn a_link_that_is_not_there_is_refused_with_those_that_are() {
    let message = Robot::from_urdf(ARM).unwrap().link("lower").unwrap_err().to_string();
    assert!(message.contains("lower") && message.contains("base, upper"), "{message}");
}
