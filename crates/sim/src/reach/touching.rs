//! What counts as a touch, and the result of a movement of touches and retractions.
//!
//! A cycle begins when the hand comes within 60 mm of the sphere and ends when it is more than 90 mm away. It was a touch
//! if, at one moment, hand and sphere were no more than 5 mm apart and the hand was within 15 mm of where it was taught to
//! be. Without the second condition an arm that goes for a neighbouring place would graze the sphere and count.

use serde::Serialize;

/// A gap that counts as contact, in metres.
pub const CONTACT: f64 = 0.005;
/// How far from the taught place the hand may touch, in metres.
pub const AIM: f64 = 0.015;
/// Gaps that begin and end a cycle, and one that the hand must exceed to be retracted, in metres.
const NEAR: f64 = 0.060;
const FAR: f64 = 0.090;
const RETRACTED: f64 = 0.100;

/// Where the hand is, and how far from the sphere, at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HandState {
    /// In seconds.
    pub time: f64,
    /// Between hand and sphere, in metres; negative by as much as they overlap.
    pub gap: f64,
    /// From the hand's effector to where it was taught to be at the touch, in metres.
    pub aim: f64,
    /// The effector in the torso's frame, in metres.
    pub hand: [f64; 3],
}

/// One touch and retraction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cycle {
    /// The hand when the gap was smallest.
    pub touch: HandState,
    /// Whether it was a touch.
    pub touched: bool,
    /// The hand when the gap was largest before the next cycle, unless the movement ended near the sphere.
    pub retraction: Option<HandState>,
    /// Whether the hand went far enough away.
    pub retracted: bool,
}

/// Finds touches and retractions in the states of the hand as they come.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TouchDetector {
    cycles: Vec<Cycle>,
    near: bool,
}

impl TouchDetector {
    /// Takes in the next state. Gives the cycle's number, from 0, if this is its first contact.
    pub fn observe(&mut self, state: HandState) -> Option<usize> {
        if !self.near && state.gap < NEAR {
            self.near = true;
            self.cycles.push(Cycle { touch: state, touched: false, retraction: None, retracted: false });
        }
        let number = self.cycles.len().checked_sub(1)?;
        let cycle = &mut self.cycles[number];
        if self.near && state.gap > FAR {
            self.near = false;
        }
        if self.near {
            if state.gap < cycle.touch.gap {
                cycle.touch = state;
            }
            let contact = state.gap <= CONTACT && state.aim <= AIM;
            let first = contact && !cycle.touched;
            cycle.touched |= contact;
            return first.then_some(number);
        }
        if cycle.retraction.is_none_or(|farthest| state.gap > farthest.gap) {
            cycle.retraction = Some(state);
            cycle.retracted |= state.gap > RETRACTED;
        }
        None
    }

    /// The sphere was put elsewhere: what comes now belongs to another cycle.
    pub fn interrupt(&mut self) {
        self.near = false;
    }

    /// The cycles, once the movement is over.
    #[must_use]
    pub fn finish(self) -> Vec<Cycle> {
        self.cycles
    }
}

/// Of all points, the root of the mean squared distance from their mean.
#[must_use]
pub fn spread<'a>(points: impl IntoIterator<Item = &'a [f64; 3]>) -> Option<f64> {
    let points: Vec<&[f64; 3]> = points.into_iter().collect();
    if points.len() < 2 {
        return None;
    }
    let n = points.len() as f64;
    let variance = |axis: usize| {
        let mean = points.iter().map(|p| p[axis]).sum::<f64>() / n;
        points.iter().map(|p| (p[axis] - mean).powi(2)).sum::<f64>() / n
    };
    Some((variance(0) + variance(1) + variance(2)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detect(gaps: &[(f64, f64)]) -> (Vec<Cycle>, Vec<usize>) {
        let mut detector = TouchDetector::default();
        let mut contacts = Vec::new();
        for (k, &(gap, aim)) in gaps.iter().enumerate() {
            let state = HandState { time: k as f64, gap, aim, hand: [0.0; 3] };
            contacts.extend(detector.observe(state));
        }
        (detector.finish(), contacts)
    }

    #[test]
    fn a_cycle_runs_from_near_to_far_and_may_hesitate_between() {
        let (cycles, contacts) = detect(&[
            (0.15, 0.1),
            (0.05, 0.02),
            (0.004, 0.01),
            (0.03, 0.02),
            (0.001, 0.004),
            (0.07, 0.05),
            (0.12, 0.1),
            (0.14, 0.1),
            (0.08, 0.06),
            (0.02, 0.02),
            (0.095, 0.1),
        ]);
        assert_eq!((cycles.len(), contacts), (2, vec![0]));
        assert!(cycles[0].touched && cycles[0].retracted);
        assert_eq!((cycles[0].touch.time, cycles[0].retraction.unwrap().time), (4.0, 7.0));
        assert!(!cycles[1].touched && !cycles[1].retracted);
    }

    #[test]
    fn a_graze_elsewhere_is_no_touch() {
        let (cycles, contacts) = detect(&[(0.1, 0.1), (-0.002, 0.03), (0.02, 0.01), (0.1, 0.1)]);
        assert!(!cycles[0].touched && contacts.is_empty());
    }

    #[test]
    fn a_sphere_that_is_taken_away_ends_the_cycle() {
        let mut detector = TouchDetector::default();
        let state = |time, gap, aim| HandState { time, gap, aim, hand: [0.0; 3] };
        assert_eq!(detector.observe(state(0.0, 0.001, 0.001)), Some(0));
        detector.interrupt();
        // It lies now where the hand overlaps it, but not as it was taught to.
        assert_eq!(detector.observe(state(1.0, -0.014, 0.05)), None);
        let cycles = detector.finish();
        assert_eq!((cycles.len(), cycles[0].touched, cycles[0].touch.time, cycles[1].touched), (2, true, 0.0, false));
    }

    #[test]
    fn spread_is_the_root_mean_square_distance_from_the_mean() {
        let points = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, -2.0, 0.0]];
        assert!((spread(&points).unwrap() - 2.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(spread(&points[..1]), None);
    }
}
