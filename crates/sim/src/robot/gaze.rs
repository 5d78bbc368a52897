//! Looking at a place: the angles that bring it to the centre of a camera's image, and a head that gets there in time.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::error::{Error, Result};
use crate::robot::joints::{HEAD, pitch_limits};
use crate::robot::{Motion, Robot};

/// Fixation with one of the head's cameras.
///
/// The head turns by yaw about z, then by pitch about y, both about the neck. The camera sits in the head's x-z plane at c
/// and looks along a. In the plane of the yaw, the target at (r, z) must come to lie on the camera's axis, which is to
/// say that turned back by the pitch it is as far from the neck across a as the camera is.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaze {
    /// The neck in the root's frame.
    neck: Point3<f64>,
    /// Angle of the camera's axis below the head's x axis.
    tilt: f64,
    /// How far the camera's axis passes above the neck.
    above: f64,
    /// Limits of the yaw.
    yaw: [f64; 2],
    joints: [usize; 2],
}

impl Gaze {
    /// Fixation with the camera at the link `camera` of a robot that has NAO's head joints.
    ///
    /// # Errors
    /// [`Error::Missing`] when a joint or the camera is not there, [`Error::Link`] for a camera elsewhere than in the
    /// head's plane.
    pub fn new(robot: &Robot, camera: &str) -> Result<Self> {
        let joints = [robot.joint(HEAD[0])?, robot.joint(HEAD[1])?];
        let camera_link = robot.link(camera)?;
        let rest = robot.forward(&vec![0.0; robot.dof()])?;
        let neck = robot
            .joints
            .iter()
            .find(|joint| matches!(joint.motion, Motion::Revolute { index, .. } if index == joints[0]));
        let neck: Point3<f64> = neck.map_or(Point3::origin(), |joint| rest[joint.child].translation.vector.into());
        let place = rest[camera_link];
        let axis = place.rotation * Vector3::x();
        let at = place.translation.vector - neck.coords;
        if axis.y.abs() > 1e-9 || at.y.abs() > 1e-9 {
            let what = "does not sit in the middle of the head and look ahead; needed for gaze control".to_owned();
            return Err(Error::Link { link: camera.to_owned(), what });
        }
        let tilt = (-axis.z).atan2(axis.x);
        let above = at.x * tilt.sin() + at.z * tilt.cos();
        let limits = robot.limits(joints[0])?;
        Ok(Self { neck, tilt, above, yaw: [limits.lower, limits.upper], joints })
    }

    /// The places of yaw and pitch in the robot's q.
    #[must_use]
    pub fn joints(&self) -> [usize; 2] {
        self.joints
    }

    /// Yaw and pitch that bring `target`, in the root's frame, to the image's centre, or as near as the head's limits let
    /// them.
    #[must_use]
    pub fn fixate(&self, target: &Point3<f64>) -> [f64; 2] {
        let to = target - self.neck;
        let yaw = to.y.atan2(to.x).clamp(self.yaw[0], self.yaw[1]);
        let ahead = to.x.hypot(to.y);
        let distance = ahead.hypot(to.z);
        // Down to the target from the neck, and down from the camera's axis to what it passes at this distance.
        let down = (-to.z).atan2(ahead);
        let passes = (self.above / distance.max(self.above.abs())).asin();
        let [low, high] = pitch_limits(yaw);
        [yaw, (down + passes - self.tilt).clamp(low, high)]
    }

    /// The same for a target in the world, of a robot whose root stands at `world_from_root`.
    #[must_use]
    pub fn fixate_in(&self, world_from_root: &Isometry3<f64>, target: &Point3<f64>) -> [f64; 2] {
        self.fixate(&world_from_root.inverse_transform_point(target))
    }
}

/// A head that follows with a lag: each second it makes good a part of what is missing, `rate` of it to begin with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaggingGaze {
    /// In 1/s.
    pub rate: f64,
    /// Yaw and pitch, in rad.
    pub angles: [f64; 2],
}

impl LaggingGaze {
    /// Moves on by `seconds` towards `goal`.
    pub fn follow(&mut self, goal: [f64; 2], seconds: f64) -> [f64; 2] {
        let share = -(-self.rate * seconds).exp_m1();
        for (angle, goal) in self.angles.iter_mut().zip(goal) {
            *angle += share * (goal - *angle);
        }
        self.angles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nao;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_fixated_place_is_in_the_image_s_centre(x in 0.12..0.5, y in -0.2..0.2, z in 0.02..0.12) {
            let robot = nao::robot();
            for camera in ["camera_top", "camera_bottom"] {
                let gaze = Gaze::new(&robot, camera).unwrap();
                let target = Point3::new(x, y, z);
                let [yaw, pitch] = gaze.fixate(&target);
                let [low, high] = pitch_limits(yaw);
                let mut q = vec![0.0; robot.dof()];
                [q[gaze.joints()[0]], q[gaze.joints()[1]]] = [yaw, pitch];
                let seen = nao::CAMERA.project(&robot.forward(&q).unwrap()[robot.link(camera).unwrap()], &target).unwrap();
                if pitch > low && pitch < high {
                    prop_assert!((seen[0] - 160.0).abs() < 1e-6 && (seen[1] - 120.0).abs() < 1e-6, "{camera} {seen:?}");
                } else {
                    // The head cannot nod that far, but it turns to the place.
                    prop_assert!((seen[0] - 160.0).abs() < 1e-6, "{camera} {seen:?}");
                }
            }
        }
    }

    #[test]
    fn the_bottom_camera_sees_the_workbench_within_the_head_s_limits() {
        let gaze = Gaze::new(&nao::robot(), "camera_bottom").unwrap();
        // Computed apart from this code for the three places on the bench.
        for (y, yaw, pitch) in [(-0.14, -0.6350, -0.1232), (-0.07, -0.3530, -0.0414), (0.0, 0.0, -0.0052)] {
            let found = gaze.fixate(&Point3::new(0.19, y, 0.03));
            assert!((found[0] - yaw).abs() < 1e-4 && (found[1] - pitch).abs() < 1e-4, "{found:?} for {yaw} {pitch}");
        }
    }

    #[test]
    fn a_lagging_gaze_closes_in_exponentially_whatever_the_step() {
        let mut coarse = LaggingGaze { rate: 2.0, angles: [0.0, 0.3] };
        let mut fine = coarse;
        coarse.follow([1.0, 0.3], 0.5);
        for _ in 0..100 {
            fine.follow([1.0, 0.3], 0.005);
        }
        assert!((coarse.angles[0] - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        assert!((coarse.angles[0] - fine.angles[0]).abs() < 1e-12 && (coarse.angles[1] - 0.3).abs() < 1e-12);
    }
}
