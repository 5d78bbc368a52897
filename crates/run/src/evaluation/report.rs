//! All that `scrnn evaluate` says of a network and sequences that it did not learn.

use std::fmt;
use std::ops::Range;

use scrnn::analysis::calibration::Calibration;
use scrnn::dataset::Dataset;
use scrnn::recognition::{RecognitionOptions, WarmStart, recognize};
use scrnn::scaling::Scaling;
use serde::Serialize;

use super::labels::Recognised;
use super::{Ahead, Bench, ClosedLoop, LAGS, Member, OneStep, Rest, Search};
use crate::failure::Result;

/// Groups of similar predicted variance.
const BINS: usize = 10;
/// Steps after which the closed loop's error is told in data units, as far as sequences reach.
const STEPS: [usize; 10] = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

/// What came of it. In scaled units where nothing else is said.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The sequences.
    pub sequences: Vec<String>,
    /// Networks that were mixed; 1 for one.
    pub members: usize,
    /// Whether the simple models were fitted to what was learned; else to these very sequences.
    pub simple_models_fitted_to_learned: bool,
    /// Share of each sequence that is listened to before predictions count.
    pub burn_in: f64,
    /// Share of each sequence that is heard before the closed loop.
    pub observed: f64,
    /// One step ahead, per step and channel.
    pub one_step: Steps,
    /// Errors beside predicted variances, one step ahead after the burn-in; none without variance units.
    pub calibration: Option<Calibration>,
    /// For each channel: mean of squared error over predicted variance, and coverage.
    pub channels: Vec<Channel>,
    /// The closed loop from the mean initial state.
    pub closed_loop: ClosedLoop,
    /// The closed loop from states that are recognised in what is heard.
    pub closed_loop_from_recognised: ClosedLoop,
    /// The closed loop's error over the horizon, from states that are recognised, in the data's units.
    pub horizon: Vec<Horizon>,
    /// Whether sequences are recognised as of their own kind.
    pub recognition: Option<Recognised>,
}

/// One step ahead.
#[derive(Debug, Clone, Serialize)]
pub struct Steps {
    /// From the mean initial state, before the burn-in is over.
    pub before_burn_in: Option<OneStep>,
    /// From the mean initial state, after the burn-in.
    pub after_burn_in: OneStep,
    /// From the recognised state, after the part it was recognised in.
    pub from_recognised: OneStep,
    /// Always each channel's mean and variance, on the samples of `after_burn_in`.
    pub constant: OneStep,
    /// A linear predictor, on the samples of `after_burn_in`.
    pub linear: Option<OneStep>,
}

/// One channel.
#[derive(Debug, Clone, Serialize)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// Root mean squared error one step ahead after the burn-in, in the data's units.
    pub rmse: f64,
    /// The rest without variance units is none.
    pub calibration: Option<ChannelCalibration>,
}

/// Errors of one channel beside their variances.
#[derive(Debug, Clone, Serialize)]
pub struct ChannelCalibration {
    /// Mean of squared error over variance: 1 for predictions that are right.
    pub mean_square: f64,
    /// Share within one predicted standard deviation.
    pub within_one: f64,
    /// Share within two.
    pub within_two: f64,
}

/// The closed loop's error so many steps after the last sample that was heard.
#[derive(Debug, Clone, Serialize)]
pub struct Horizon {
    /// So many steps.
    pub steps: usize,
    /// Sequences that are that long.
    pub sequences: usize,
    /// Root mean squared error of each channel, in the data's units.
    pub rmse: Vec<f64>,
}

impl Report {
    /// Judges one network, or a mixture. `scaling` leads back to the data's units.
    pub fn new(
        bench: &Bench,
        members: &[Member<'_>],
        (scaling, learned): (&Scaling, &[String]),
        (search, copies): (Search, usize),
    ) -> Result<Self> {
        let recognised = bench.recognised(members, search)?;
        let after = bench.from_mean(members, &bench.scored)?;
        let before: Vec<Range<usize>> = bench.scored.iter().map(|range| bench.delay..range.start).collect();
        let before = bench.from_mean(members, &before)?;
        let size = (bench.data.sequences().len(), copies);
        let rests = bench.rests(members, Some(&recognised), size)?;
        Ok(Self {
            sequences: bench.data.sequences().iter().map(|sequence| sequence.name.clone()).collect(),
            members: members.len(),
            simple_models_fitted_to_learned: true,
            burn_in: bench.burn_in,
            observed: bench.observed,
            one_step: Steps {
                before_burn_in: (!before.moments.errors.is_empty()).then(|| before.one_step()),
                after_burn_in: after.one_step(),
                from_recognised: bench.from_states(members, &recognised)?.one_step(),
                constant: bench.models.constant(&bench.data, &bench.scored),
                linear: bench.models.linear(&bench.data, &bench.scored),
            },
            calibration: match after.moments.variances.is_empty() {
                true => None,
                false => Calibration::of(&after.moments.errors, &after.moments.variances, BINS),
            },
            channels: channels(bench, members, scaling)?,
            closed_loop: bench.closed_loop(members, None, size)?,
            closed_loop_from_recognised: super::closed_loop(&bench.data, &bench.heard, &rests, &bench.models),
            horizon: horizon(&bench.data, &bench.heard, &rests, scaling),
            recognition: recognition(bench, members, learned)?,
        })
    }
}

/// Errors one step ahead, channel by channel.
fn channels(bench: &Bench, members: &[Member<'_>], scaling: &Scaling) -> Result<Vec<Channel>> {
    let ahead = bench.from_mean(members, &bench.scored)?;
    let Ahead { moments, .. } = &ahead;
    let places = bench.data.sequences().iter().zip(&bench.scored).flat_map(|(sequence, range)| {
        let samples = range.clone().flat_map(|k| sequence.sample(k).iter().enumerate());
        samples.filter(|(_, target)| !target.is_nan()).map(|(i, _)| i)
    });
    let places: Vec<usize> = places.collect();
    let channel = |(i, name): (usize, &String)| {
        let own: Vec<usize> = (0..places.len()).filter(|&at| places[at] == i).collect();
        let count = own.len() as f64;
        let mean = |of: &dyn Fn(usize) -> f64| own.iter().map(|&at| of(at)).sum::<f64>() / count;
        let square = |at: usize| moments.errors[at].powi(2);
        let within = |k: f64| mean(&|at| f64::from(u8::from(square(at) <= k * k * moments.variances[at])));
        Channel {
            name: name.clone(),
            rmse: scaling.variance_to_raw(i, mean(&square)).sqrt(),
            calibration: (!moments.variances.is_empty()).then(|| ChannelCalibration {
                mean_square: mean(&|at| square(at) / moments.variances[at]),
                within_one: within(1.0),
                within_two: within(2.0),
            }),
        }
    };
    Ok(bench.data.channels().iter().enumerate().map(channel).collect())
}

/// Root mean squared errors of what followed, step by step.
fn horizon(data: &Dataset, heard: &[usize], rests: &[Rest], scaling: &Scaling) -> Vec<Horizon> {
    let n = data.channels().len();
    let at = |steps: usize| {
        let mut squares = vec![0.0; n];
        let mut counts = vec![0_usize; n];
        let mut sequences = 0;
        for ((sequence, heard), rest) in data.sequences().iter().zip(heard).zip(rests) {
            if heard + steps > sequence.len() {
                continue;
            }
            sequences += 1;
            for (i, target) in sequence.sample(heard + steps - 1).iter().enumerate().filter(|(_, x)| !x.is_nan()) {
                squares[i] += (target - rest.mean[(steps - 1) * n + i]).powi(2);
                counts[i] += 1;
            }
        }
        let rmse = |i: usize| scaling.variance_to_raw(i, squares[i] / counts[i] as f64).sqrt();
        Horizon { steps, sequences, rmse: (0..n).map(rmse).collect() }
    };
    STEPS.into_iter().map(at).take_while(|horizon| horizon.sequences > 0).collect()
}

/// Which learned sequence each is taken for: the one from whose initial state it is most likely, by the mean of the members' densities.
fn recognition(bench: &Bench, members: &[Member<'_>], learned: &[String]) -> Result<Option<Recognised>> {
    let mut scores = vec![vec![Vec::new(); learned.len()]; bench.data.sequences().len()];
    for member in members {
        let states = member.states;
        let shared = (0..states.sequences()).all(|s| states.sequence(s) == states.mean());
        if states.sequences() != learned.len() || shared {
            return Ok(None);
        }
        let options = RecognitionOptions::with(|it| {
            (it.starts, it.epochs, it.polish, it.ranked) = (1, 0, 0, learned.len());
            it.warm_starts = vec![WarmStart::Mean];
        });
        let found = recognize(member.network, member.states, &bench.data, &options, &bench.engine)?;
        for (s, found) in found.iter().enumerate() {
            for ranked in &found.ranking {
                scores[s][ranked.sequence].push(ranked.ln_likelihood);
            }
        }
    }
    let total = |each: &Vec<f64>| {
        let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if largest.is_finite() {
            largest + each.iter().map(|ln| (ln - largest).exp()).sum::<f64>().ln()
        } else {
            largest
        }
    };
    let best =
        |scores: &Vec<Vec<f64>>| (0..learned.len()).max_by(|&a, &b| total(&scores[a]).total_cmp(&total(&scores[b])));
    let names = bench.data.sequences().iter().map(|sequence| sequence.name.as_str());
    let taken: Vec<(&str, &str)> =
        names.zip(&scores).filter_map(|(name, scores)| Some((name, learned[best(scores)?].as_str()))).collect();
    Ok(Recognised::of(&taken, learned))
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn nats(one: &OneStep) -> String {
    let nll = one.nll.map_or("-".to_owned(), |nll| format!("{nll:.4}"));
    format!("{nll:>10}  {:.3e}", one.mse)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mixture =
            if self.members > 1 { format!(", a mixture of {} networks", self.members) } else { String::new() };
        let (burn_in, observed) = (percent(self.burn_in), percent(self.observed));
        writeln!(f, "{} sequences{mixture}", self.sequences.len())?;
        writeln!(f, "\none step ahead, per step and channel, in scaled units:")?;
        writeln!(f, "  {:<52}{:>10}  squared error", "", "nll")?;
        let steps = &self.one_step;
        let mut row = |name: String, one: &OneStep| writeln!(f, "  {name:<52}{}", nats(one));
        if let Some(before) = &steps.before_burn_in {
            row(format!("mean initial state, first {burn_in}"), before)?;
        }
        row("mean initial state, after them (A)".into(), &steps.after_burn_in)?;
        row(format!("state recognised in the first {observed}, after them"), &steps.from_recognised)?;
        row("always each channel's mean and variance, on (A)".into(), &steps.constant)?;
        if let Some(linear) = &steps.linear {
            row(format!("linear in the last {LAGS} samples, on (A)"), linear)?;
        }
        if !self.simple_models_fitted_to_learned {
            writeln!(f, "  (what was learned cannot be read: the simple models were fitted to these very sequences)")?;
        }
        if let Some(calibration) = &self.calibration {
            writeln!(
                f,
                "\nerrors on (A) within one and two predicted sd: {} and {} (Gaussian: 68.3 and 95.4 %); squared error over \
                 variance {:.3}",
                percent(calibration.within_one),
                percent(calibration.within_two),
                calibration.mean_square
            )?;
            for Channel { name, calibration, rmse } in &self.channels {
                if let Some(one) = calibration {
                    let (a, b) = (percent(one.within_one), percent(one.within_two));
                    writeln!(
                        f,
                        "  {name}: rmse {rmse:.4e}, {a} and {b}, squared error over variance {:.3}",
                        one.mean_square
                    )?;
                }
            }
        }
        writeln!(f, "\nalone after the first {observed}, from the recognised state (from the mean state):")?;
        let both = [&self.closed_loop_from_recognised, &self.closed_loop];
        let pair = |of: &dyn Fn(&ClosedLoop) -> Option<f64>| {
            let [a, b] = both.map(|one| of(one).map_or("-".to_owned(), |value| format!("{value:.4}")));
            format!("{a} ({b})")
        };
        writeln!(
            f,
            "  distance {}, at the end {}; of the channels' means {:.4} (rms per channel, scaled units)",
            pair(&|one| Some(one.distance)),
            pair(&|one| Some(one.end)),
            self.closed_loop.distance_of_constant
        )?;
        writeln!(
            f,
            "  nll {}, within one sd {}, within two {}",
            pair(&|one| one.nll),
            pair(&|one| one.within_one),
            pair(&|one| one.within_two)
        )?;
        if self.closed_loop_from_recognised.leaves_the_data() {
            writeln!(f, "  the closed loop leaves the data: the channels' means are nearer to them")?;
        }
        for Horizon { steps, sequences, rmse } in &self.horizon {
            let each = self.channels.iter().zip(rmse).map(|(channel, rmse)| format!("{} {rmse:.4e}", channel.name));
            writeln!(f, "  step {steps} ({sequences} sequences): rmse {}", each.collect::<Vec<_>>().join(", "))?;
        }
        match &self.recognition {
            Some(found) => {
                writeln!(f, "\nrecognised as of their own kind: {} of {}", found.right, found.of)?;
                for kind in &found.kinds {
                    writeln!(f, "  {}: {} of {}", kind.label, kind.right, kind.of)?;
                }
                Ok(())
            }
            None => writeln!(
                f,
                "\nrecognition: the names do not tell several learned kinds, or all sequences share one initial state"
            ),
        }
    }
}
