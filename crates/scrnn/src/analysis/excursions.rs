//! Which side does a signal go to, and in which order? A signal that rests at a centre and swings out to one of two sides, as
//! an arm between its primitives (thesis 5.3.1), is read by events: it begins when the signal is well out, and ends when it is
//! nearly back. Timing may drift, and noise around either threshold does not count twice.

use serde::{Deserialize, Serialize};

/// Where the signal rests and how far it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// At rest.
    pub centre: f64,
    /// When it is out to the left; may lie above or below the centre.
    pub left: f64,
    /// When it is out to the right, on the other side of the centre.
    pub right: f64,
}

/// Share of the way out at which an excursion begins.
pub const BEGINS: f64 = 0.6;
/// Share at which it has ended.
pub const ENDS: f64 = 0.25;

/// One of two sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Side {
    /// L.
    #[serde(rename = "L")]
    Left,
    /// R.
    #[serde(rename = "R")]
    Right,
}

impl Side {
    /// L or R.
    #[must_use]
    pub fn letter(self) -> char {
        match self {
            Self::Left => 'L',
            Self::Right => 'R',
        }
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// A swing to one side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Excursion {
    /// Where it goes.
    pub side: Side,
    /// The step at which the signal is 0.6 of the way out.
    pub begins: usize,
}

impl Levels {
    /// How far out a value is: 0 at the centre, 1 at the left level, -1 at the right one.
    #[must_use]
    pub fn out(&self, value: f64) -> f64 {
        let (to_left, to_right) = (self.left - self.centre, self.right - self.centre);
        let left = (value - self.centre) / to_left;
        if left >= 0.0 { left } else { -(value - self.centre) / to_right }
    }

    /// The excursions of a signal, in order. Changing sides without a stop in the centre begins a new one.
    #[must_use]
    pub fn excursions(&self, signal: impl IntoIterator<Item = f64>) -> Vec<Excursion> {
        let mut found = Vec::new();
        let mut now = None;
        for (step, value) in signal.into_iter().enumerate() {
            let out = self.out(value);
            let side = if out >= 0.0 { Side::Left } else { Side::Right };
            if out.abs() < ENDS {
                now = None;
            } else if out.abs() > BEGINS && now != Some(side) {
                now = Some(side);
                found.push(Excursion { side, begins: step });
            }
        }
        found
    }
}

/// The sides as a string, e.g. `RLLLR`.
#[must_use]
pub fn order(excursions: &[Excursion]) -> String {
    excursions.iter().map(|excursion| excursion.side.letter()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: Levels = Levels { centre: 1.0, left: 3.0, right: 0.0 };

    #[test]
    fn each_side_has_its_own_way_out() {
        assert_eq!((LEVELS.out(1.0), LEVELS.out(2.0), LEVELS.out(0.5)), (0.0, 0.5, -0.5));
        let mirrored = Levels { centre: 0.0, left: -2.0, right: 1.0 };
        assert_eq!((mirrored.out(-2.0), mirrored.out(1.0)), (1.0, -1.0));
    }

    #[test]
    fn an_order_is_read_whatever_its_timing_and_in_spite_of_noise() {
        let signal = [1.0, 1.9, 2.5, 2.1, 2.3, 3.0, 1.2, 1.0, 0.1, 0.45, 0.1, 1.0, 2.9, 0.2, 1.0];
        let found = LEVELS.excursions(signal);
        assert_eq!(order(&found), "LRLR");
        assert_eq!(found.iter().map(|one| one.begins).collect::<Vec<_>>(), [2, 8, 12, 13]);
        assert_eq!(order(&LEVELS.excursions([1.0, 1.5, 2.1, 1.0, f64::NAN])), "");
    }
}
