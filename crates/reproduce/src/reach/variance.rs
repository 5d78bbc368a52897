//! Predicted variance over the cycle of touch and retraction, beside how much the demonstrations themselves vary.

use scrnn::dataset::Dataset;
use scrnn::evaluation::correlation;
use scrnn::generation::Generated;
use scrnn_sim::reach::agent::Decision;
use scrnn_sim::reach::channels::{REACHING, VISION};
use scrnn_sim::reach::stage::{CYCLE, PERIOD};
use scrnn_sim::reach::touching::Cycle;
use scrnn_sim::reach::tutor::Demonstration;
use serde::Serialize;

/// Samples of a movement's beginning that are left out: the network has seen too little yet.
const SETTLING: usize = CYCLE / 2;

/// Variances of the arm's channels by phase, averaged over channels, in the network's units. Phase 0 is the touch; the
/// first entry is half a cycle before it.
#[derive(Debug, Clone, Serialize)]
pub struct ByPhase {
    /// Samples from the touch.
    pub phase: Vec<i32>,
    /// Of the demonstrations at this phase, within each sequence.
    pub within: Vec<f64>,
    /// Predicted one step ahead of the demonstrations.
    pub predicted: Vec<f64>,
    /// Squared errors of these predictions.
    pub residual: Vec<f64>,
    /// Predicted while the network drives the robot; by the robot's own touches.
    pub driving: Vec<f64>,
    /// Rank correlation of predicted and within.
    pub rank_correlation: Option<f64>,
    /// Rank correlation of driving and within.
    pub rank_correlation_driving: Option<f64>,
    /// Phase of the lowest predicted variance.
    pub lowest: i32,
    /// Predicted at the touch over predicted half a cycle away.
    pub touch_over_retraction: f64,
    /// Predicted over residual, least and most over phases.
    pub predicted_over_residual: [f64; 2],
}

/// Sums by phase.
#[derive(Debug, Clone, Default)]
struct Bins {
    sums: Vec<f64>,
    counts: Vec<f64>,
}

impl Bins {
    fn new() -> Self {
        Self { sums: vec![0.0; CYCLE], counts: vec![0.0; CYCLE] }
    }

    fn add(&mut self, bin: usize, value: f64) {
        self.sums[bin] += value;
        self.counts[bin] += 1.0;
    }

    fn means(&self) -> Vec<f64> {
        self.sums.iter().zip(&self.counts).map(|(sum, count)| sum / count).collect()
    }
}

/// The phase of a sample as an index from 0, by the nearest touch; none where no touch is near.
fn bin(sample: usize, cycles: &[Cycle]) -> Option<usize> {
    let time = sample as f64 * PERIOD;
    let from = |cycle: &Cycle| (time - cycle.touch.time) / PERIOD;
    let nearest = cycles.iter().map(from).min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let half = CYCLE as i32 / 2;
    let phase = nearest.round() as i32;
    (-half..=half).contains(&phase).then(|| (phase + half).rem_euclid(CYCLE as i32) as usize)
}

/// Puts everything together. `data` are the demonstrations in the network's units, `open` what the network predicted ahead
/// of them, `driving` decisions with the cycles that they led to, and `scale` leads to the network's units.
pub fn by_phase(
    demonstrations: &[Demonstration],
    data: &Dataset,
    open: &[Generated],
    driving: &[(&[Decision], &[Cycle])],
    scale: &[f64],
) -> ByPhase {
    let n = REACHING.len();
    let [mut within, mut predicted, mut residual, mut driven] = std::array::from_fn(|_| Bins::new());
    for ((demonstration, sequence), generated) in demonstrations.iter().zip(data.sequences()).zip(open) {
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); CYCLE];
        for sample in SETTLING..sequence.len() {
            let Some(bin) = bin(sample, &demonstration.cycles) else { continue };
            own[bin].push(sample);
            // Row k of what was generated is about sample k + 1.
            let row = (sample - 1) * n;
            for channel in VISION..n {
                let error = sequence.sample(sample)[channel] - generated.mean[row + channel];
                residual.add(bin, error * error);
                predicted.add(bin, generated.variance[row + channel]);
            }
        }
        for (bin, samples) in own.iter().enumerate().filter(|(_, samples)| samples.len() > 1) {
            for channel in VISION..n {
                let values = || samples.iter().map(|&sample| sequence.sample(sample)[channel]);
                let mean = values().sum::<f64>() / samples.len() as f64;
                let squares: f64 = values().map(|x| (x - mean).powi(2)).sum();
                within.add(bin, squares / (samples.len() - 1) as f64);
            }
        }
    }
    for (decisions, cycles) in driving {
        for (k, decision) in decisions.iter().enumerate().skip(SETTLING) {
            let Some(bin) = bin(k + 1, cycles) else { continue };
            for (variance, scale) in decision.variance[VISION..].iter().zip(&scale[VISION..]) {
                driven.add(bin, variance * scale.powi(2));
            }
        }
    }
    let [within, predicted, residual, driving] = [within, predicted, residual, driven].map(|bins| bins.means());
    let half = CYCLE / 2;
    let phase: Vec<i32> = (0..CYCLE as i32).map(|bin| bin - half as i32).collect();
    let lowest = (0..CYCLE).min_by(|&a, &b| predicted[a].total_cmp(&predicted[b])).unwrap_or(0);
    let ratios = predicted.iter().zip(&residual).map(|(predicted, residual)| predicted / residual);
    let extent = ratios.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], ratio| [low.min(ratio), high.max(ratio)]);
    ByPhase {
        rank_correlation: rank_correlation(&predicted, &within),
        rank_correlation_driving: rank_correlation(&driving, &within),
        lowest: phase[lowest],
        touch_over_retraction: predicted[half] / predicted[0],
        predicted_over_residual: extent,
        phase,
        within,
        predicted,
        residual,
        driving,
    }
}

/// Spearman's: the correlation of ranks.
fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let ranks = |values: &[f64]| -> Vec<f64> {
        values
            .iter()
            .map(|value| {
                let below = values.iter().filter(|other| *other < value).count() as f64;
                let equal = values.iter().filter(|other| *other == value).count() as f64;
                below + (equal + 1.0) / 2.0
            })
            .collect()
    };
    let finite = a.iter().chain(b).all(|value| value.is_finite());
    if finite { correlation(&ranks(a), &ranks(b)) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn_sim::reach::touching::HandState;

    #[test]
    fn phases_count_from_the_nearest_touch() {
        let cycle = |time| {
            let touch = HandState { time, gap: 0.0, aim: 0.0, hand: [0.0; 3] };
            Cycle { touch, touched: true, retraction: None, retracted: false }
        };
        let cycles = [cycle(3.0), cycle(9.1)];
        assert_eq!(bin(6, &cycles), Some(6));
        assert_eq!(bin(5, &cycles), Some(5));
        assert_eq!((bin(0, &cycles), bin(12, &cycles)), (Some(0), Some(0)));
        assert_eq!((bin(13, &cycles), bin(18, &cycles), bin(40, &cycles)), (Some(1), Some(6), None));
    }

    #[test]
    fn ranks_correlate_whatever_the_scale() {
        assert!((rank_correlation(&[1.0, 2.0, 3.0, 9.0], &[0.1, 0.4, 0.5, 1e6]).unwrap() - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(rank_correlation(&[1.0, f64::NAN], &[1.0, 2.0]), None);
    }
}
