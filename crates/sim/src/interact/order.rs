//! Orders of an interaction: to which side the object goes at each branching, and when.

use rand::RngExt;
use scrnn::analysis::excursions::Side;
use scrnn::streams::{Purpose, stream};

use crate::error::{Error, Result};

/// Seconds between samples.
pub const PERIOD: f64 = 0.1;
/// Samples before the first branching.
pub const LEAD_IN: usize = 20;
/// Samples of a primitive: out, hold, back, rest.
pub const PRIMITIVE: [usize; 4] = [30, 20, 30, 10];

/// Samples of a whole primitive.
#[must_use]
pub fn primitive_len() -> usize {
    PRIMITIVE.iter().sum()
}

/// The sample at which the object begins to move for each branching.
#[must_use]
pub fn branchings(count: usize) -> Vec<usize> {
    (0..count).map(|k| LEAD_IN + k * primitive_len()).collect()
}

/// Samples of an order.
#[must_use]
pub fn samples(order: &[Side]) -> usize {
    LEAD_IN + order.len() * primitive_len()
}

/// All orders of `branches` primitives, left before right.
#[must_use]
pub fn all_orders(branches: usize) -> Vec<Vec<Side>> {
    let side = |number: usize, branch: usize| match number >> (branches - 1 - branch) & 1 {
        0 => Side::Left,
        _ => Side::Right,
    };
    (0..1_usize << branches).map(|number| (0..branches).map(|branch| side(number, branch)).collect()).collect()
}

/// An order drawn at random; each side is left with probability `left`. `purpose` and `index` say which of a seed's streams
/// it comes from: [`Purpose::RecordingOrders`] or [`Purpose::TrialOrders`].
#[must_use]
pub fn random_order(branches: usize, left: f64, seed: u64, purpose: Purpose, index: u64) -> Vec<Side> {
    let mut random = stream(seed, purpose, index);
    let side = |_| if random.random::<f64>() < left { Side::Left } else { Side::Right };
    (0..branches).map(side).collect()
}

/// An order from its letters, e.g. `RLLLR`.
///
/// # Errors
/// [`Error::Setting`] for an empty text or other letters.
pub fn parse_order(text: &str) -> Result<Vec<Side>> {
    let side = |letter: char| match letter {
        'L' | 'l' => Some(Side::Left),
        'R' | 'r' => Some(Side::Right),
        _ => None,
    };
    let order: Option<Vec<Side>> = text.chars().map(side).collect();
    order.filter(|order| !order.is_empty()).ok_or_else(|| Error::Setting {
        what: "the order",
        found: format!("`{text}`"),
        needed: "letters L and R, one for each branching",
    })
}

/// An order as letters.
#[must_use]
pub fn letters(order: &[Side]) -> String {
    order.iter().map(|side| side.letter()).collect()
}

/// How far out the object is at a time in seconds, and to which side: 0 in the centre, 1 at the end.
pub(super) fn out(order: &[Side], seconds: f64) -> (f64, Side) {
    let at = seconds / PERIOD - LEAD_IN as f64;
    let branch = (at / primitive_len() as f64).floor().max(0.0) as usize;
    let (Some(&side), true) = (order.get(branch), at > 0.0) else { return (0.0, Side::Left) };
    let mut rest = at - (branch * primitive_len()) as f64;
    let [to, hold, back, _] = PRIMITIVE.map(|steps| steps as f64);
    let minimum_jerk = |s: f64| s * s * s * (10.0 + s * (6.0 * s - 15.0));
    if rest < to {
        return (minimum_jerk(rest / to), side);
    }
    rest -= to;
    if rest < hold {
        return (1.0, side);
    }
    rest -= hold;
    (if rest < back { 1.0 - minimum_jerk(rest / back) } else { 0.0 }, side)
}
