//! Settings for data that come without an experiment, each with its reason.

use scrnn::dataset::{Dataset, Sequence};
use scrnn::learning::Adam;
use scrnn_data::suspicions::{Suspicion, look};

use crate::experiment::{Comment, Experiment, Group, Network, ScalingName, Training};
use crate::training::still_channels;

/// What to begin with.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Recipe {
    /// How samples are scaled.
    pub scaling: ScalingName,
    /// The network.
    pub network: Network,
    /// How it learns.
    pub training: Training,
    /// Why: a sentence for a key of the experiment file.
    pub reasons: Vec<Comment>,
}

/// Steps that a network of this recipe predicts ahead.
const DELAY: usize = 1;
/// Multiplications of one step of a network with `units` context units and `channels` channels, there and back.
const WORK: f64 = 6.0;
/// Multiplications of a training: about a minute of one core.
const BUDGET: f64 = 2e11;
/// Fewest and most epochs.
const EPOCHS: (f64, f64) = (300.0, 5_000.0);
/// Sequences from which on they are learned in batches, and how many there are in a batch.
const BATCHES: (usize, usize) = (20, 8);

/// An experiment of defaults alone, to be filled in.
pub(crate) fn bare() -> Experiment {
    let text = "name = \"data\"\n[data]\n[[network.groups]]\nname = \"context\"\nunits = 1\ntime_constant = 1.0\n[training]\nepochs = 1\noptimiser = \"adam\"\n";
    toml::from_str(text).expect("all that has no default is there")
}

/// Chooses settings by the size of the data and by how fast they change.
#[must_use]
pub fn choose(data: &Dataset) -> Recipe {
    let (channels, sequences) = (data.channels().len(), data.sequences().len());
    let samples = data.total_samples();
    let mut reasons = Vec::new();
    let mut because = |key: &str, why: String| reasons.push(Comment { key: key.to_owned(), text: why });

    let spikes = look(data).iter().any(|one| matches!(one, Suspicion::Spikes { .. }));
    let scaling = if spikes { ScalingName::Robust } else { ScalingName::Fit };
    because(
        "data.scaling",
        match spikes {
            true => "There are spikes: they are left out when the range of a channel is measured.".to_owned(),
            false => "Each channel fills the range that the network can predict.".to_owned(),
        },
    );

    because("network.delay", "The next sample is predicted from this one.".to_owned());
    let still = still_channels(data, DELAY);
    let variance_floor = if still.is_empty() { 1e-5 } else { 1e-4 };
    because(
        "network.variance_floor",
        match still.as_slice() {
            [] => "No variance is predicted below this (scaled units): smooth data have none to speak of.".to_owned(),
            still => format!("{} never changes: without a floor its likelihood has no bound.", still.join(", ")),
        },
    );
    because(
        "network.initial_state_variance",
        "Each sequence finds an initial state of its own, by which it is told from the others.".to_owned(),
    );

    let units = units(channels, sequences, samples);
    because(
        "network.groups.units",
        format!(
            "For {} on {}, and no more than {samples} samples can teach.",
            counted(sequences, "sequence"),
            counted(channels, "channel")
        ),
    );
    let (period, time_constant) = pace(data);
    because(
        "network.groups.time_constant",
        match period {
            Some(period) => format!("In steps. The data swing about once in {period:.0} steps."),
            None => "In steps.".to_owned(),
        },
    );

    let work = samples as f64 * ((units * units + 3 * units * channels) as f64) * WORK;
    let epochs = rounded((BUDGET / work).clamp(EPOCHS.0, EPOCHS.1));
    because("training.epochs", "About a minute of computing, or as many as a small set needs.".to_owned());
    because("training.optimiser", "Learns sooner than the thesis' rule.".to_owned());
    let adam = Adam::with(|it| {
        it.rate = if units <= 20 { 1e-2 } else { 5e-3 };
        it.weight_decay = 0.01;
        it.batch_size = if sequences > BATCHES.0 { BATCHES.1 } else { 0 };
    });
    because("training.adam.weight_decay", "Keeps the network from learning single samples by heart.".to_owned());
    if adam.batch_size > 0 {
        because("training.adam.batch_size", "Of many sequences, small batches learn sooner.".to_owned());
    }

    let Experiment { mut network, mut training, .. } = bare();
    network.delay = DELAY;
    network.variance_floor = variance_floor;
    network.groups = vec![Group::full("context", units, time_constant)];
    (training.epochs, training.adam) = (epochs, Some(adam));
    Recipe { scaling, network, training, reasons }
}

/// Context units: more for more to tell apart, fewer where there is little to learn from.
fn units(channels: usize, sequences: usize, samples: usize) -> usize {
    let wanted = 10.0 + 5.0 * ((channels * sequences) as f64).sqrt();
    let taught = (2.0 * (samples * channels) as f64).sqrt();
    (wanted.min(taught).round() as usize).clamp(8, 60)
}

/// Steps in which the data swing once, and the time constant that goes with it.
///
/// Of a wave of period P, the mean squared step over twice the variance is 1 - cos(2 pi / P).
fn pace(data: &Dataset) -> (Option<f64>, f64) {
    let channels = data.channels().len();
    let mut periods: Vec<f64> = (0..channels).filter_map(|channel| period(data, channel)).collect();
    if periods.is_empty() {
        return (None, 2.0);
    }
    periods.sort_by(f64::total_cmp);
    let period = periods[periods.len() / 2];
    (Some(period), (period / 12.0).round().clamp(2.0, 10.0))
}

fn period(data: &Dataset, channel: usize) -> Option<f64> {
    let n = data.channels().len();
    let (mut squares, mut steps, mut spread, mut count) = (0.0, 0_usize, 0.0, 0_usize);
    for sequence in data.sequences() {
        let values =
            |sequence: &Sequence| sequence.values().iter().skip(channel).step_by(n).copied().collect::<Vec<_>>();
        let values = values(sequence);
        let there = || values.iter().copied().filter(|value| value.is_finite());
        let mean = there().sum::<f64>() / there().count().max(1) as f64;
        spread += there().map(|value| (value - mean).powi(2)).sum::<f64>();
        count += there().count();
        for step in values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.is_finite()) {
            squares += step * step;
            steps += 1;
        }
    }
    let share = (squares / steps.max(1) as f64) / (2.0 * spread / count.max(1) as f64);
    let angle = (1.0 - share).clamp(-1.0, 1.0).acos();
    Some(std::f64::consts::TAU / angle).filter(|period| period.is_finite() && *period < 1e6)
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// To two digits.
fn rounded(count: f64) -> u64 {
    let unit = 10_f64.powf((count.log10().floor() - 1.0).max(0.0));
    ((count / unit).round() * unit) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(period: f64, sequences: usize, samples: usize) -> Dataset {
        let wave = |s: usize| {
            let values = (0..samples).map(|k| (std::f64::consts::TAU * k as f64 / period + s as f64).sin()).collect();
            Sequence::new(s.to_string(), 1, values).unwrap()
        };
        Dataset::new(vec!["y".into()], (0..sequences).map(wave).collect()).unwrap()
    }

    #[test]
    fn the_time_constant_follows_the_pace_of_the_data() {
        for (wave, constant) in [(24.0, 2.0), (60.0, 5.0), (400.0, 10.0)] {
            let (found, time_constant) = pace(&waves(wave, 2, 800));
            assert!((found.unwrap() / wave - 1.0).abs() < 0.02, "{found:?} for {wave}");
            assert_eq!(time_constant, constant);
        }
        let still = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, vec![1.0; 9]).unwrap()]).unwrap();
        assert_eq!(pace(&still), (None, 2.0));
    }

    #[test]
    fn more_to_tell_apart_takes_more_units_and_more_work_fewer_epochs() {
        let small = choose(&waves(24.0, 1, 60));
        let large = choose(&waves(24.0, 30, 2000));
        let of = |recipe: &Recipe| (recipe.network.groups[0].units, recipe.training.epochs);
        assert_eq!(of(&small), (11, 5000));
        assert!(of(&large).0 > 30 && of(&large).1 < 2000, "{:?}", of(&large));
        let batch = |recipe: &Recipe| recipe.training.adam.as_ref().unwrap().batch_size;
        assert_eq!((batch(&small), batch(&large)), (0, 8));
    }

    #[test]
    fn what_stands_still_gets_a_floor_and_what_has_spikes_is_scaled_without_them() {
        let still = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, vec![1.0; 9]).unwrap()]).unwrap();
        assert_eq!(choose(&still).network.variance_floor, 1e-4);
        let wave = waves(24.0, 1, 500);
        assert_eq!(choose(&wave).scaling, ScalingName::Fit);
        let mut values = wave.sequences()[0].values().to_vec();
        values[100] = 50.0;
        let spiked = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, values).unwrap()]).unwrap();
        assert_eq!(choose(&spiked).scaling, ScalingName::Robust);
    }

    #[test]
    fn numbers_are_rounded_to_two_digits() {
        assert_eq!([rounded(1234.0), rounded(987.0), rounded(56.0)], [1200, 990, 56]);
    }
}
