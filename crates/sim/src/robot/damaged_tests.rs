//! Robot descriptions that are damaged: read, or refused with a message, never a panic. Seeded, so that a failure comes again.

use crate::recording::{Heading, Recorder, Robot as Recorded};
use crate::robot::Robot;
use crate::robot::nao::URDF;

/// Numbers that look random (splitmix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

const PIECES: &str = "< > /> \" = & &amp; <!-- --> <![CDATA[ <link <joint name= type= \"revolute\" \"prismatic\" <parent <child <origin \
    xyz= rpy= <limit lower= upper= nan inf 1e999 -0 0 <mass value= <inertia ixx= <geometry> <box size= <cylinder <sphere radius= \u{e9}";

#[test]
fn a_damaged_description_is_read_or_refused_and_never_a_panic() {
    let pieces: Vec<&str> = PIECES.split(' ').collect();
    let mut dice = Dice(1);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..400 {
        let mut text: Vec<char> = URDF.chars().collect();
        for _ in 0..=dice.below(3) {
            let at = dice.below(text.len());
            match dice.below(5) {
                0 => drop(text.remove(at)),
                1 => drop(text.splice(at..at, pieces[dice.below(pieces.len())].chars())),
                2 => drop(
                    text.splice(at..text.len().min(at + 1 + dice.below(60)), pieces[dice.below(pieces.len())].chars()),
                ),
                3 => text[at] = char::from(32 + dice.below(95) as u8),
                _ => text.truncate(at.max(1)),
            }
        }
        let text: String = text.into_iter().collect();
        match Robot::from_urdf(&text) {
            Ok(robot) => {
                read += 1;
                assert!(robot.joint_names().len() >= robot.dof());
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().is_empty());
            }
        }
        // A recording takes the tree of the links from the same text.
        let robots = [Recorded { prefix: "", urdf: &text }];
        let _ = Recorder::new(std::io::Cursor::new(Vec::new()), &Heading { robots: &robots, ..Heading::default() });
    }
    assert!(read > 20 && refused > 100, "{read} read, {refused} refused");
}
