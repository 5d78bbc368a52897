//! Settings for data that come without an experiment, each with its reason.

use scrnn::dataset::{Dataset, Sequence};
use scrnn::learning::{Adam, ClosedLoop};
use scrnn_data::suspicions::{Suspicion, look};

use crate::character::{Character, still_channels};
use crate::experiment::{Comment, Experiment, Group, MeanUnits, Network, ScalingName, SkipName, Training};

/// What to begin with.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Recipe {
    /// How samples are scaled.
    pub scaling: ScalingName,
    /// How long the last sample is held, as a share of its sequence; none for not at all.
    pub rest: Option<f64>,
    /// The network.
    pub network: Network,
    /// How it learns.
    pub training: Training,
    /// Why: a sentence for a key of the experiment file.
    pub reasons: Vec<Comment>,
}

/// Steps that a network of this recipe predicts ahead.
const DELAY: usize = 1;
/// Multiplications of a training: a minute or two of one core.
const BUDGET: f64 = 1e12;
/// Multiplications for each weight and step: forward, back, and the gradient.
const WORK: f64 = 3.0;
/// Sequences from which on they are learned in batches, and how many there are in a batch.
const BATCHES: (usize, usize) = (20, 10);
/// Updates after which a single network gains little more.
const UPDATES: (f64, f64) = (300.0, 10_000.0);
/// Epochs and updates after which a network learns the noise of its sequences by heart.
const NOISY: (f64, f64) = (1000.0, 4000.0);
/// What keeps it from that.
const DECAY: f64 = 0.3;
/// How long a movement that comes to rest is held there.
const REST: f64 = 0.25;
/// How much longer each network of a mixture learns smooth movements, and the share of its sequences that are taught throughout. One that
/// learned for so long may be too sure of which movement it is; where that is not known, the networks of a mixture disagree.
const MIXED: (f64, f64) = (2.0, 0.1);

/// Why noisy data are not learned for longer, until that was tried.
const UNTRIED: &str = "After more the network knows single samples by heart, and does worse on new ones.";

/// Whether this is the reason for a number of epochs that a trial may better.
pub(crate) fn leaves_open(reason: &Comment) -> bool {
    reason.key == "training.epochs" && reason.text == UNTRIED
}

/// The most epochs that the budget allows for this experiment on `data`, taught step by step.
pub(crate) fn most_epochs(experiment: &Experiment, data: &Dataset) -> u64 {
    let units = experiment.network.groups.iter().map(|group| group.units).sum();
    let batch = experiment.training.adam.as_ref().map_or(0, |adam| adam.batch_size);
    epochs(data.total_samples() as f64, units, data.channels().len(), updates(data, batch))
}

/// An experiment of defaults alone, to be filled in.
pub(crate) fn bare() -> Experiment {
    let text = "name = \"data\"\n[data]\n[[network.groups]]\nname = \"context\"\nunits = 1\ntime_constant = 1.0\n[training]\nepochs = 1\noptimiser = \"adam\"\n";
    toml::from_str(text).expect("all that has no default is there")
}

/// Reasons, each for a key.
#[derive(Default)]
struct Reasons(Vec<Comment>);

impl Reasons {
    fn add(&mut self, key: &str, why: impl Into<String>) {
        self.0.push(Comment { key: key.to_owned(), text: why.into() });
    }
}

/// Chooses settings by what kind of movement the data are, by how fast they change, by how much there is of them, and by how many networks
/// learn them side by side.
#[must_use]
pub fn choose(data: &Dataset, members: u64) -> Recipe {
    let mut reasons = Reasons::default();
    let spikes = look(data).iter().any(|one| matches!(one, Suspicion::Spikes { .. }));
    let scaling = if spikes { ScalingName::Robust } else { ScalingName::Fit };
    reasons.add(
        "data.scaling",
        match spikes {
            true => "There are spikes: they are left out when the range of a channel is measured.",
            false => "Each channel fills the range that the network can predict.",
        },
    );
    reasons.add("network.delay", "The next sample is predicted from this one.");
    let character = Character::of(data);
    let (rest, network, training) = match character.is_smooth() {
        true => smooth(data, character, members > 1, &mut reasons),
        false => noisy(data, character, &mut reasons),
    };
    Recipe { scaling, rest, network, training, reasons: reasons.0 }
}

/// Smooth movements: what a straight line does not predict, in a closed loop as well as one step ahead.
fn smooth(
    data: &Dataset,
    character: Character,
    mixed: bool,
    reasons: &mut Reasons,
) -> (Option<f64>, Network, Training) {
    let Experiment { mut network, mut training, .. } = bare();
    let rest = character.rests.then_some(REST);
    if rest.is_some() {
        reasons.add("data.rest", "The movements come to rest: the network learns to stay where they end.");
    }
    network.delay = DELAY;
    network.mean = MeanUnits::Linear;
    network.skip = SkipName::Autoregressive;
    network.velocity_inputs = true;
    network.initial_state_variance = 0.0;
    network.variance_floor = if character.rests { 1e-3 } else { 1e-4 };
    let turn = 100.0 * character.turn;
    reasons.add(
        "network.skip",
        format!(
            "The data are smooth: from step to step a change keeps all but {turn:.0} % of itself. So the network predicts what a linear \
             map of the last samples leaves over."
        ),
    );
    reasons.add("network.velocity_inputs", "With that, the change of a sample says more than its place.");
    reasons.add("network.mean", "What is left over has no bounds.");
    reasons.add(
        "network.variance_floor",
        "In units of what is left over: a place where nothing moves has no likelihood without it.",
    );
    reasons.add(
        "network.initial_state_variance",
        "All sequences share one initial state, and new ones need no search for theirs. Where sequences begin alike and part later, \
         try 1: each has a state of its own then.",
    );
    let (_, time_constant) = pace(data);
    let units = units(data, 1.5);
    network.groups = vec![Group::full("context", units, time_constant)];
    size_reasons(data, time_constant, reasons);

    let (longer, taught) = if mixed { MIXED } else { (1.0, 0.0) };
    let closed_loop = ClosedLoop::with(|it| (it.weight, it.taught) = (1.0, taught));
    // Up to somewhere, and then in copies; the few that are taught cost less.
    let passes = 1.0 + closed_loop.copies as f64;
    let samples = data.total_samples() as f64 * (1.0 + rest.unwrap_or(0.0));
    let batch = batch(data, reasons);
    let epochs = epochs(samples * passes, units, 2 * data.channels().len(), updates(data, batch));
    training.epochs = rounded(longer * epochs as f64);
    reasons.add("training.epochs", match mixed {
        true => {
            "Some minutes of one core for each network. A single one learns half as long: after that it may be too sure of which movement \
             it is. In a mixture the networks disagree where that is not known."
        }
        false => {
            "A minute or two of one core. `members = 4` mixes four networks, each of which learns twice as long: its closed loops \
             come nearer, and are likelier."
        }
    });
    reasons.add("training.optimiser", "Learns sooner than the thesis' rule.");
    reasons.add(
        "training.closed_loop.copies",
        "The network learns in the closed loop, so that it can go on from its own predictions, and knows how far they can be trusted.",
    );
    reasons.add(
        "training.closed_loop.taught",
        match mixed {
            true => "A tenth of the sequences of an epoch is taught step by step instead, which is better for the next step.",
            false => "No sequence is taught step by step to its end.",
        },
    );
    training.closed_loop = Some(closed_loop);
    training.adam = Some(Adam::with(|it| it.batch_size = batch));
    (rest, network, training)
}

/// Noisy movements: the network of the thesis, with one initial state, and not for long.
fn noisy(data: &Dataset, character: Character, reasons: &mut Reasons) -> (Option<f64>, Network, Training) {
    let Experiment { mut network, mut training, .. } = bare();
    network.delay = DELAY;
    let still = still_channels(data, DELAY);
    network.variance_floor = if still.is_empty() { 1e-5 } else { 1e-4 };
    reasons.add("network.variance_floor", match still.as_slice() {
        [] => format!(
            "The data are noisy: a change turns by {:.1} times its size in the next step. No variance is predicted below this (scaled \
             units).",
            character.turn
        ),
        still => format!("{} never changes: without a floor its likelihood has no bound.", still.join(", ")),
    });
    network.initial_state_variance = 0.0;
    reasons.add(
        "network.initial_state_variance",
        "All sequences share one initial state: of noisy ones a state of their own is soon learned by heart. Where sequences begin \
         alike and part later, try 1: each has a state of its own then.",
    );
    let (_, time_constant) = pace(data);
    let units = units(data, 1.0);
    network.groups = vec![Group::full("context", units, time_constant)];
    size_reasons(data, time_constant, reasons);
    let batch = batch(data, reasons);
    let updates = updates(data, batch);
    let most = rounded(NOISY.0.min((NOISY.1 / updates as f64).max(1.0)));
    training.epochs = epochs(data.total_samples() as f64, units, data.channels().len(), updates).min(most);
    reasons.add("training.epochs", UNTRIED);
    reasons.add("training.optimiser", "Learns sooner than the thesis' rule.");
    reasons.add("training.adam.weight_decay", "Keeps the network from learning single samples by heart.");
    training.adam = Some(Adam::with(|it| {
        it.rate = if units <= 20 { 1e-2 } else { 5e-3 };
        it.weight_decay = DECAY;
        it.batch_size = batch;
    }));
    (None, network, training)
}

fn size_reasons(data: &Dataset, time_constant: f64, reasons: &mut Reasons) {
    let (channels, sequences, samples) = (data.channels().len(), data.sequences().len(), data.total_samples());
    reasons.add(
        "network.groups.units",
        format!(
            "For {} on {}, and no more than {samples} samples can teach.",
            counted(sequences, "sequence"),
            counted(channels, "channel")
        ),
    );
    reasons.add(
        "network.groups.time_constant",
        match pace(data).0 {
            Some(period) => format!("In steps. The data swing about once in {period:.0} steps."),
            None => format!("In steps. {time_constant} suits data that do not swing."),
        },
    );
}

/// Sequences of a batch; 0 takes all.
fn batch(data: &Dataset, reasons: &mut Reasons) -> usize {
    if data.sequences().len() < BATCHES.0 {
        return 0;
    }
    reasons.add("training.adam.batch_size", "Of many sequences, small batches learn sooner.");
    BATCHES.1
}

/// Updates of an epoch.
fn updates(data: &Dataset, batch: usize) -> usize {
    if batch == 0 { 1 } else { data.sequences().len().div_ceil(batch) }
}

/// Epochs that the budget allows, of so many steps each, and no more updates than do any good.
fn epochs(steps: f64, units: usize, inputs: usize, updates: usize) -> u64 {
    let work = steps * ((units * units + 3 * units * inputs) as f64) * WORK;
    let few = |count: f64| (count / updates as f64).max(1.0);
    rounded((BUDGET / work).clamp(few(UPDATES.0), few(UPDATES.1)))
}

/// Context units: more for more to tell apart, fewer where there is little to learn from.
fn units(data: &Dataset, factor: f64) -> usize {
    let (channels, sequences, samples) = (data.channels().len(), data.sequences().len(), data.total_samples());
    let wanted = factor * (10.0 + 5.0 * ((channels * sequences) as f64).sqrt());
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
        let small = choose(&waves(24.0, 1, 60), 1);
        let large = choose(&waves(24.0, 30, 2000), 1);
        let of = |recipe: &Recipe| (recipe.network.groups[0].units, recipe.training.epochs);
        assert_eq!(of(&small), (11, 10_000));
        assert!(of(&large).0 > 30 && of(&large).1 < 2000, "{:?}", of(&large));
        let batch = |recipe: &Recipe| recipe.training.adam.as_ref().unwrap().batch_size;
        assert_eq!((batch(&small), batch(&large)), (0, 10));
    }

    #[test]
    fn networks_of_a_mixture_learn_smooth_movements_for_longer() {
        let data = waves(200.0, 20, 400);
        let [one, four] = [1, 4].map(|members| choose(&data, members).training);
        let taught = |training: &Training| training.closed_loop.as_ref().unwrap().taught;
        assert_eq!((taught(&one), taught(&four)), (0.0, 0.1));
        let ratio = four.epochs as f64 / one.epochs as f64;
        assert!((1.9..2.1).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_stands_still_gets_a_floor_and_what_has_spikes_is_scaled_without_them() {
        let still = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, vec![1.0; 9]).unwrap()]).unwrap();
        assert_eq!(choose(&still, 1).network.variance_floor, 1e-4);
        let wave = waves(24.0, 1, 500);
        assert_eq!(choose(&wave, 1).scaling, ScalingName::Fit);
        let mut values = wave.sequences()[0].values().to_vec();
        values[100] = 50.0;
        let spiked = Dataset::new(vec!["y".into()], vec![Sequence::new("", 1, values).unwrap()]).unwrap();
        assert_eq!(choose(&spiked, 1).scaling, ScalingName::Robust);
    }

    #[test]
    fn noisy_sequences_share_a_state_and_are_not_learned_for_long() {
        let noisy = |sequences: usize| {
            let noise = |k: usize| ((k * k * 7919) % 1009) as f64 / 504.5 - 1.0;
            let values = |s: usize| (0..100).map(|k| noise(k + 101 * s)).collect();
            let one = |s: usize| Sequence::new(s.to_string(), 1, values(s)).unwrap();
            choose(&Dataset::new(vec!["y".into()], (0..sequences).map(one).collect()).unwrap(), 1)
        };
        for (sequences, epochs) in [(3, 1000), (40, 1000), (100, 400), (2000, 20)] {
            let Recipe { network, training, .. } = noisy(sequences);
            assert_eq!((network.skip, network.initial_state_variance), (SkipName::None, 0.0));
            assert_eq!((training.epochs, training.adam.unwrap().weight_decay), (epochs, DECAY));
        }
    }

    #[test]
    fn numbers_are_rounded_to_two_digits() {
        assert_eq!([rounded(1234.0), rounded(987.0), rounded(56.0)], [1200, 990, 56]);
    }
}
