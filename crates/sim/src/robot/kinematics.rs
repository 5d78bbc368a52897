//! From angles to places, and back.
//!
//! Frames are named `destination_from_source`. Places come in the frame of the robot's root.

use nalgebra::{DVector, Isometry3, Matrix3, Matrix3xX, Point3, UnitQuaternion, Vector3};

use crate::error::{Error, Result};
use crate::robot::{Motion, Robot};

impl Robot {
    /// Leads from each link's frame to the root's, at the angles q.
    ///
    /// # Errors
    /// [`Error::Length`] if q does not hold one angle for each movable joint.
    pub fn forward(&self, q: &[f64]) -> Result<Vec<Isometry3<f64>>> {
        if q.len() != self.dof() {
            return Err(Error::Length { what: "the posture", found: q.len(), needed: self.dof() });
        }
        let mut root_from_link = vec![Isometry3::identity(); self.links.len()];
        for joint in &self.joints {
            let turn = match joint.motion {
                Motion::Fixed => UnitQuaternion::identity(),
                Motion::Revolute { axis, index, .. } => UnitQuaternion::from_axis_angle(&axis, q[index]),
            };
            root_from_link[joint.child] = root_from_link[joint.parent] * joint.parent_from_joint * turn;
        }
        Ok(root_from_link)
    }

    /// How a link's origin moves with each angle, in m/rad: one column for each angle of q.
    fn jacobian(&self, root_from_link: &[Isometry3<f64>], link: usize) -> Matrix3xX<f64> {
        let mut columns = Matrix3xX::zeros(self.dof());
        let tip = root_from_link[link].translation.vector;
        let mut at = link;
        while let Some(joint) = self.links[at].joint.map(|joint| &self.joints[joint]) {
            if let Motion::Revolute { axis, index, .. } = joint.motion {
                let frame = root_from_link[joint.child];
                let turn = frame.rotation * axis.into_inner();
                columns.set_column(index, &turn.cross(&(tip - frame.translation.vector)));
            }
            at = joint.parent;
        }
        columns
    }
}

/// Inverse kinematics by damped least squares, within the joints' limits.
///
/// ```text
/// dq = J^T (J J^T + lambda^2 I)^-1 e,    lambda^2 = damping^2 min(1, |e| / reach)
/// ```
///
/// Damping fades with the error, so that the last steps are as fast as Newton's. An angle at its limit is left out of a
/// step that would take it further.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseKinematics {
    /// lambda far from the target, in m/rad.
    pub damping: f64,
    /// Error at which damping begins to fade, in metres.
    pub reach: f64,
    /// Steps to make at most.
    pub iterations: usize,
    /// Distance that will do, in metres.
    pub tolerance: f64,
}

impl Default for InverseKinematics {
    fn default() -> Self {
        Self { damping: 0.03, reach: 0.05, iterations: 100, tolerance: 1e-7 }
    }
}

impl InverseKinematics {
    /// Turns the angles at the places `joints` of q so that the origin of `link` comes to `target`, in the root's frame.
    /// Of all such postures it finds one near `start`.
    ///
    /// # Errors
    /// [`Error::OutOfReach`] with the distance that is left; [`Error::Length`] for a start of another size, and
    /// [`Error::NoSuch`] for a link or a joint that is not there.
    pub fn solve(
        &self,
        robot: &Robot,
        link: usize,
        joints: &[usize],
        start: &[f64],
        target: &Point3<f64>,
    ) -> Result<Vec<f64>> {
        let no_such = |what, index, count| Error::NoSuch { what, index, count };
        let tip = robot.links.get(link).ok_or_else(|| no_such("link", link, robot.links.len()))?;
        if let Some(&joint) = joints.iter().find(|&&joint| joint >= robot.dof()) {
            return Err(no_such("movable joint", joint, robot.dof()));
        }
        let mut q = start.to_vec();
        robot.clamp(&mut q);
        let mut best = (f64::INFINITY, q.clone());
        for _ in 0..self.iterations {
            let root_from_link = robot.forward(&q)?;
            let error = target.coords - root_from_link[link].translation.vector;
            if error.norm() < best.0 {
                best = (error.norm(), q.clone());
            }
            if best.0 <= self.tolerance {
                return Ok(best.1);
            }
            let step = self.step(robot, &robot.jacobian(&root_from_link, link), joints, &q, &error);
            for (q, step) in q.iter_mut().zip(step.iter()) {
                *q += step;
            }
            robot.clamp(&mut q);
        }
        let [x, y, z] = target.coords.into();
        Err(Error::OutOfReach { link: tip.name.clone(), distance: best.0, x, y, z })
    }

    /// One step of all angles; those that are not free stay.
    fn step(
        &self,
        robot: &Robot,
        jacobian: &Matrix3xX<f64>,
        joints: &[usize],
        q: &[f64],
        error: &Vector3<f64>,
    ) -> DVector<f64> {
        let mut free = vec![false; q.len()];
        joints.iter().for_each(|&joint| free[joint] = true);
        let limits: Vec<_> = robot.movable().map(|(_, limits)| limits).collect();
        let lambda = self.damping.powi(2) * (error.norm() / self.reach).min(1.0);
        loop {
            let mut used = jacobian.clone();
            for (index, free) in free.iter().enumerate() {
                if !free {
                    used.set_column(index, &Vector3::zeros());
                }
            }
            let damped = &used * used.transpose() + Matrix3::identity() * (lambda + 1e-12);
            let step =
                damped.lu().solve(error).map_or_else(|| DVector::zeros(q.len()), |solved| used.transpose() * solved);
            let blocked = (0..q.len()).filter(|&index| {
                free[index]
                    && ((q[index] >= limits[index].upper && step[index] > 0.0)
                        || (q[index] <= limits[index].lower && step[index] < 0.0))
            });
            let blocked: Vec<usize> = blocked.collect();
            if blocked.is_empty() {
                return step;
            }
            blocked.into_iter().for_each(|index| free[index] = false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::joints::{HEAD, LEFT_ARM, RIGHT_ARM};
    use crate::robot::nao;
    use proptest::prelude::*;

    /// Some posture within the limits, from shares 0 to 1 of each joint's range.
    fn posture(robot: &Robot, shares: &[f64]) -> Vec<f64> {
        robot.movable().zip(shares).map(|((_, l), share)| l.lower + share * (l.upper - l.lower)).collect()
    }

    /// The right effector in closed form, with all products of rotations written out.
    fn right_effector([pitch, roll, yaw, bend]: [f64; 4]) -> [f64; 3] {
        // In the elbow's frame: bent about z, then turned about the upper arm.
        let (along, down) = (0.055_95 + 0.057_75, -0.012_31);
        let (x, side) = (along * bend.cos(), along * bend.sin());
        let (y, z) = (side * yaw.cos() - down * yaw.sin(), side * yaw.sin() + down * yaw.cos());
        // From the shoulder: along the upper arm, then turned inward about z, then lowered about y.
        let (x, y) = (x + 0.105, y - 0.015);
        let (x, y) = (x * roll.cos() - y * roll.sin(), x * roll.sin() + y * roll.cos());
        [x * pitch.cos() + z * pitch.sin(), y - 0.098, -x * pitch.sin() + z * pitch.cos() + 0.1]
    }

    proptest! {
        #[test]
        fn forward_kinematics_agree_with_a_closed_form(shares in proptest::collection::vec(0.0..1.0, 10)) {
            let robot = nao::robot();
            let q = posture(&robot, &shares);
            let places = robot.forward(&q).unwrap();
            let arm: Vec<f64> = robot.joints_named(&RIGHT_ARM).unwrap().into_iter().map(|joint| q[joint]).collect();
            let right = places[robot.link("r_effector").unwrap()].translation.vector;
            let expected = right_effector(arm.try_into().unwrap());
            prop_assert!((right - Vector3::from(expected)).norm() < 1e-9);
            // The left arm is the right one in a mirror: pitch turns alike, all other angles the other way.
            let arm: Vec<f64> = robot.joints_named(&LEFT_ARM).unwrap().into_iter().map(|joint| q[joint]).collect();
            let left = places[robot.link("l_effector").unwrap()].translation.vector;
            let [x, y, z] = right_effector([arm[0], -arm[1], -arm[2], -arm[3]]);
            prop_assert!((left - Vector3::new(x, -y, z)).norm() < 1e-9);
            // The camera: turned to the side about z, then nodding about y.
            let [yaw, pitch] = robot.joints_named(&HEAD).unwrap()[..] else { unreachable!() };
            let (ahead, up) = (0.058_71 * q[pitch].cos() + 0.063_64 * q[pitch].sin(), 0.063_64 * q[pitch].cos() - 0.058_71 * q[pitch].sin());
            let expected = Vector3::new(ahead * q[yaw].cos(), ahead * q[yaw].sin(), up + 0.1265);
            prop_assert!((places[robot.link("camera_top").unwrap()].translation.vector - expected).norm() < 1e-9);
        }

        #[test]
        fn inverse_kinematics_find_what_can_be_reached(shares in proptest::collection::vec(0.1..0.9, 10)) {
            let robot = nao::robot();
            let (link, joints) = (robot.link("r_effector").unwrap(), robot.joints_named(&RIGHT_ARM).unwrap());
            let target: Point3<f64> = robot.forward(&posture(&robot, &shares)).unwrap()[link].translation.vector.into();
            // From a posture nearby.
            let near: Vec<f64> = shares.iter().map(|share| share + 0.06 * (40.0 * share).sin()).collect();
            let start = posture(&robot, &near);
            let q = InverseKinematics::default().solve(&robot, link, &joints, &start, &target).unwrap();
            prop_assert!((robot.forward(&q).unwrap()[link].translation.vector - target.coords).norm() <= 1e-7);
            for (index, q) in q.iter().enumerate() {
                let limits = robot.limits(index).unwrap();
                prop_assert!((limits.lower..=limits.upper).contains(q));
                prop_assert!(joints.contains(&index) || *q == start[index]);
            }
        }
    }

    #[test]
    fn what_the_robot_does_not_have_is_refused() {
        let robot = nao::robot();
        let solve = |link, joints: &[usize], start: &[f64]| {
            let found = InverseKinematics::default().solve(&robot, link, joints, start, &Point3::origin());
            found.unwrap_err().to_string()
        };
        assert_eq!(
            solve(99, &[0], &[0.0; 10]),
            format!("there is no link 99; there are {}, counted from 0", robot.links.len())
        );
        assert_eq!(solve(0, &[10], &[0.0; 10]), "there is no movable joint 10; there are 10, counted from 0");
        assert_eq!(solve(0, &[0], &[0.0; 9]), "the posture holds 9 values; needed: 10");
        assert_eq!(robot.forward(&[0.0; 11]).unwrap_err().to_string(), "the posture holds 11 values; needed: 10");
        assert_eq!(robot.limits(10).unwrap_err().to_string(), solve(0, &[10], &[0.0; 10]));
    }

    #[test]
    fn what_is_out_of_reach_is_refused_with_the_distance() {
        let robot = nao::robot();
        let (link, joints) = (robot.link("r_effector").unwrap(), robot.joints_named(&RIGHT_ARM).unwrap());
        // 0.4 m ahead of the shoulder; the arm is 0.22 m long.
        let target = Point3::new(0.4, -0.098, 0.1);
        let start = posture(&robot, &[0.5; 10]);
        let error = InverseKinematics::default().solve(&robot, link, &joints, &start, &target).unwrap_err();
        let Error::OutOfReach { distance, .. } = error else { panic!("{error}") };
        assert!((distance - 0.18).abs() < 0.005, "{distance}");
    }
}
