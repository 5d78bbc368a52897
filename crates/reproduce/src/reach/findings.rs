//! What is found for the networks of one seed, and what figures are drawn from.

use scrnn_sim::reach::agent::Performance;
use scrnn_sim::reach::channels::{REACHING, VISION};
use scrnn_sim::reach::stage::POSITIONS;
use scrnn_sim::reach::tutor::Demonstration;
use serde::Serialize;

use super::trials::{Found, Given, Shifted, pooled_spread_ratio};
use super::variance::ByPhase;

/// The figures of one seed.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// The demonstrations, one entry for each sequence.
    pub demonstrations: Vec<Found>,
    /// What came of each driver: by place, the three positions first, then those half way, then four at random.
    pub conditions: Vec<Driven>,
    /// After the sphere was put elsewhere.
    pub shifts: Vec<Shifted>,
    /// Variance over the cycle.
    pub variance: ByPhase,
    /// How many times faster than real time the closed loop ran on one processor: the median of all performances.
    pub speed: f64,
}

/// One driver at several places.
#[derive(Debug, Clone, Serialize)]
pub struct Driven {
    /// Its name.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// Touches per cycle over all places.
    pub rate: f64,
    /// Spread at the touch over spread after retraction, over all places.
    pub spread_ratio: Option<f64>,
    /// Place by place.
    pub places: Vec<Found>,
}

impl Driven {
    /// The places that were learned.
    pub fn learned(&self) -> &[Found] {
        &self.places[..POSITIONS.len().min(self.places.len())]
    }

    /// The others.
    pub fn others(&self) -> &[Found] {
        &self.places[POSITIONS.len().min(self.places.len())..]
    }

    /// The least touches per cycle over some places.
    pub fn least(found: &[Found]) -> f64 {
        found.iter().map(Found::rate).fold(f64::INFINITY, f64::min)
    }
}

impl Findings {
    /// A condition by its key.
    pub fn condition(&self, key: &str) -> Option<&Driven> {
        self.conditions.iter().find(|condition| condition.key == key)
    }

    /// Touches per cycle of a driver.
    pub fn rate(&self, key: &str) -> Option<f64> {
        self.condition(key).map(|condition| condition.rate)
    }

    /// Spread ratio of a driver.
    pub fn spread_ratio(&self, key: &str) -> Option<f64> {
        self.condition(key).and_then(|condition| condition.spread_ratio)
    }

    /// Spread ratio of the demonstrations.
    pub fn demonstrated_spread_ratio(&self) -> Option<f64> {
        pooled_spread_ratio(&self.demonstrations.iter().collect::<Vec<_>>())
    }

    /// Touches after a shift, from the second cycle on.
    pub fn rate_after_shift(&self) -> f64 {
        let sum = |of: fn(&Shifted) -> usize| self.shifts.iter().map(of).sum::<usize>() as f64;
        sum(|shift| shift.touched) / sum(|shift| shift.expected).max(1.0)
    }

    /// Mean samples to the first touch after a shift; none if one never came.
    pub fn steps_to_adapt(&self) -> Option<f64> {
        let steps: Option<Vec<f64>> = self.shifts.iter().map(|shift| shift.steps_to_adapt).collect();
        steps.map(|steps| steps.iter().sum::<f64>() / steps.len() as f64)
    }
}

/// What figures are drawn from.
pub struct Material {
    /// The demonstrations.
    pub demonstrations: Vec<Demonstration>,
    /// Performances with noise at the positions and half way between, from position 1 to position 3.
    pub performances: Vec<(Performance, Given)>,
}

/// The channel that a name of the thesis' figures stands for.
pub fn channel(name: &str) -> usize {
    REACHING.iter().position(|channel| *channel == name).unwrap_or(VISION)
}
