//! NAO's joints by name, in the order of the experiments' channels.
//!
//! Their limits, velocities and efforts stand in the robot's description. What a description cannot say is here: how far
//! the head may nod depends on how far it is turned.

/// The head's joints: yaw, positive to the left, and pitch, positive down.
pub const HEAD: [&str; 2] = ["HeadYaw", "HeadPitch"];

/// The right arm's joints.
pub const RIGHT_ARM: [&str; 4] = ["RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll"];

/// The left arm's joints.
pub const LEFT_ARM: [&str; 4] = ["LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll"];

/// |yaw|, lowest and highest pitch; straight lines in between. Beyond, the head would touch the shoulders.
const PITCH: [[f64; 3]; 7] = [
    [0.0, -0.671_951, 0.515_047],
    [0.486_074, -0.671_951, 0.422_021],
    [0.756_077, -0.548_033, 0.370_010],
    [0.903_033, -0.479_965, 0.330_041],
    [1.089_958, -0.430_049, 0.300_022],
    [1.526_988, -0.330_041, 0.200_015],
    [2.086_017, -0.449_073, 0.330_041],
];

/// Lowest and highest pitch of the head at a yaw.
#[must_use]
pub fn pitch_limits(yaw: f64) -> [f64; 2] {
    let yaw = yaw.abs();
    let last = PITCH[PITCH.len() - 1];
    let Some(pair) = PITCH.windows(2).find(|pair| yaw <= pair[1][0]) else { return [last[1], last[2]] };
    let share = (yaw - pair[0][0]) / (pair[1][0] - pair[0][0]);
    [1, 2].map(|column| pair[0][column] + share * (pair[1][column] - pair[0][column]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_nods_less_when_it_is_turned() {
        let published = |yaw: f64, low: f64, high: f64| {
            let [found_low, found_high] = pitch_limits(yaw);
            assert!((found_low - low).abs() < 1e-12 && (found_high - high).abs() < 1e-12, "at yaw {yaw}");
        };
        published(0.0, -0.671_951, 0.515_047);
        published(-0.756_077, -0.548_033, 0.370_010);
        published(1.526_988, -0.330_041, 0.200_015);
        // Half way between two published values, and beyond the last one.
        published((0.486_074 + 0.756_077) / 2.0, (-0.671_951 - 0.548_033) / 2.0, (0.422_021 + 0.370_010) / 2.0);
        published(3.0, -0.449_073, 0.330_041);
    }
}
