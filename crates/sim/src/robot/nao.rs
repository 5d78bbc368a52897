//! NAO, as the experiments use it.

use crate::error::Result;
use crate::robot::Robot;
use crate::robot::camera::Camera;
use crate::robot::joints::{HEAD, LEFT_ARM, RIGHT_ARM};

/// The description of NAO's upper body.
pub const URDF: &str = include_str!("../../assets/nao.urdf");

/// Either of NAO's cameras, at the size that the experiments use.
pub const CAMERA: Camera = Camera { horizontal_view: 1.0629, vertical_view: 0.8308, width: 320.0, height: 240.0 };

/// Pairs whose rough shapes overlap in postures that the true robot takes.
const MAY_OVERLAP: [(&str, &str); 4] =
    [("torso", "r_bicep"), ("torso", "l_bicep"), ("r_bicep", "r_forearm"), ("l_bicep", "l_forearm")];

/// A resting left arm: it hangs, a little bent.
const LEFT_ARM_AT_REST: [f64; 4] = [1.4, 0.3, -1.39, -1.01];

/// NAO's upper body with all ten joints.
///
/// # Errors
/// Never, as long as the description that ships with this crate is sound; a test reads it.
pub fn load() -> Result<Robot> {
    let mut robot = Robot::from_urdf(URDF)?;
    for (a, b) in MAY_OVERLAP {
        robot.ignore_contacts(a, b)?;
    }
    Ok(robot)
}

/// NAO with a resting left arm that is fixed: head and right arm move, in the order of the experiments' channels.
///
/// # Errors
/// As [`load`].
pub fn load_one_armed() -> Result<Robot> {
    let mut robot = load()?;
    for (joint, angle) in LEFT_ARM.iter().zip(LEFT_ARM_AT_REST) {
        robot.lock(joint, angle)?;
    }
    debug_assert_eq!(robot.joint_names(), [&HEAD[..], &RIGHT_ARM].concat());
    Ok(robot)
}

#[cfg(test)]
pub(crate) fn robot() -> Robot {
    load().unwrap()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Shape;

    #[test]
    fn the_description_says_what_the_maker_publishes() {
        let robot = robot();
        assert_eq!(robot.joint_names(), [&HEAD[..], &RIGHT_ARM, &LEFT_ARM].concat());
        let mass: f64 = robot.links.iter().filter_map(|link| link.inertia.as_ref()).map(|i| i.mass).sum();
        // Torso, neck and head, and two arms of five parts.
        let arm = 0.075_04 + 0.157_77 + 0.064_83 + 0.077_61 + 0.185_33;
        assert!((mass - (1.049_56 + 0.064_42 + 0.605_33 + 2.0 * arm)).abs() < 1e-12, "{mass}");
        let bend = robot.limits(robot.joint("RElbowRoll").unwrap()).unwrap();
        assert_eq!([bend.lower, bend.upper, bend.velocity, bend.effort], [0.034_906_6, 1.544_62, 7.194_07, 1.532]);
        let mirrored = robot.limits(robot.joint("LElbowRoll").unwrap()).unwrap();
        assert_eq!([mirrored.lower, mirrored.upper], [-1.544_62, -0.034_906_6]);
    }

    #[test]
    fn the_description_has_standard_shapes_alone_and_round_parts_are_capsules() {
        let description = urdf_rs::read_from_string(URDF).unwrap();
        for link in &description.links {
            let drawn = link.visual.iter().map(|visual| (&visual.geometry, &visual.origin));
            for (geometry, _) in drawn.clone().chain(link.collision.iter().map(|one| (&one.geometry, &one.origin))) {
                use urdf_rs::Geometry::{Box, Cylinder, Sphere};
                assert!(
                    matches!(geometry, Box { .. } | Cylinder { .. } | Sphere { .. }),
                    "{}: {geometry:?}",
                    link.name
                );
            }
            let shown: Vec<String> = drawn.map(|one| format!("{one:?}")).collect();
            let touched: Vec<String> =
                link.collision.iter().map(|one| format!("{:?}", (&one.geometry, &one.origin))).collect();
            assert_eq!(shown, touched, "{} looks other than it feels", link.name);
        }
        let robot = robot();
        let capsules = |name: &str| {
            let shapes = &robot.links[robot.link(name).unwrap()].shapes;
            let round = shapes.iter().filter(|(shape, _)| matches!(shape, Shape::Capsule { .. })).count();
            (shapes.len(), round)
        };
        for side in ["r", "l"] {
            let part = |name: &str| capsules(&format!("{side}_{name}"));
            assert_eq!([part("bicep"), part("forearm"), part("hand")], [(2, 1), (1, 1), (1, 1)]);
        }
    }

    #[test]
    fn one_arm_can_be_locked() {
        let robot = load_one_armed().unwrap();
        assert_eq!(robot.joint_names(), [&HEAD[..], &RIGHT_ARM].concat());
        let all = load().unwrap();
        let q = [0.3, -0.2, 0.2, -0.6, 0.1, 1.2];
        let with_left = [&q[..], &LEFT_ARM_AT_REST].concat();
        for (one, all) in robot.forward(&q).unwrap().iter().zip(all.forward(&with_left).unwrap()) {
            assert!((one.translation.vector - all.translation.vector).norm() < 1e-12);
            assert!(one.rotation.angle_to(&all.rotation) < 1e-7);
        }
    }
}
