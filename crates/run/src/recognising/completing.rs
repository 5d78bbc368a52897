//! The rest of each sequence as a distribution.

use crate::assessment::Predictions;
use crate::channel_scores::observed_error;
use crate::completion::{UNCERTAINTY, effective_states, forecast};
use crate::evaluation::{Member, Rest};
use crate::failure::Result;
use crate::generating::Fields;
use crate::trained::Trained;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::recognition::Recognition;
use serde::Serialize;

/// The rest of one sequence, in the data's units where nothing else is said.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Completion {
    /// The mean of the loops' means, a row for each sample.
    pub mean: Vec<Vec<f64>>,
    /// The mean of the loops' variances and the spread of their means; empty without variance units.
    pub variance: Vec<Vec<f64>>,
    /// What each loop drew.
    pub samples: Vec<Vec<Vec<f64>>>,
    /// How the uncertainty of the recognised state enters.
    pub uncertainty: &'static str,
    /// How many states count, averaged over the members: 1 where one explains the observed samples far better than all others.
    pub effective_states: f64,
    /// Nats per step and channel of what really followed, in scaled units.
    pub nll: Option<f64>,
    /// Share of what really followed within one standard deviation.
    pub within_one: Option<f64>,
    /// Share within two.
    pub within_two: Option<f64>,
    /// (3.5) of the mean over what really followed.
    #[serde(skip)]
    pub error: f64,
}

/// Completes each sequence that has a rest; `recognitions` of each member, sequence by sequence.
pub(super) fn complete(
    trained: &Trained,
    (members, recognitions): (&[Member<'_>], &[Vec<Recognition>]),
    (data, heard): (&Dataset, usize),
    (loops, seed): (usize, u64),
    engine: &Engine,
) -> Result<Vec<Option<Completion>>> {
    let scaled = trained.checkpoint.scaling.apply(data)?;
    let of = |(s, sequence): (usize, &Sequence)| {
        if heard >= sequence.len() {
            return Ok(None);
        }
        let own: Vec<&Recognition> = recognitions.iter().map(|one| &one[s]).collect();
        let part = (sequence.values(), heard, sequence.len() - heard);
        let rest = forecast(members, &own, part, (loops, seed), engine)?;
        let states = own.iter().map(|one| effective_states(one)).sum::<f64>() / own.len() as f64;
        Ok(Some(Completion::of(trained, (&data.sequences()[s], sequence, heard), &rest, (loops, states))))
    };
    scaled.sequences().iter().enumerate().map(of).collect()
}

impl Completion {
    /// nll and coverage of what really followed.
    pub fn told(&self) -> [String; 2] {
        let share = |share: Option<f64>| share.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        [
            self.nll.map_or("-".to_owned(), |nll| format!("{nll:.4}")),
            format!("{}, {}", share(self.within_one), share(self.within_two)),
        ]
    }

    fn of(
        trained: &Trained,
        (sequence, scaled, heard): (&Sequence, &Sequence, usize),
        rest: &Rest,
        (loops, effective_states): (usize, f64),
    ) -> Self {
        let scaling = &trained.checkpoint.scaling;
        let n = scaling.channels();
        let rows = |values: &[f64], raw: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
            values.chunks(n).map(|row| row.iter().enumerate().map(|(i, &value)| raw(i, value)).collect()).collect()
        };
        let raw = |i: usize, value: f64| scaling.to_raw(i, value);
        let mean = rows(&rest.mean, &raw);
        let mut known = Predictions { errors: Vec::new(), variances: Vec::new() };
        for (at, target) in scaled.values()[heard * n..].iter().enumerate().filter(|(_, target)| !target.is_nan()) {
            known.errors.push(target - rest.mean[at]);
            known.variances.extend(rest.variance.get(at));
        }
        let within = |k: f64| {
            let inside = known.errors.iter().zip(&known.variances).filter(|(e, v)| *e * *e <= k * k * *v).count();
            (!known.variances.is_empty()).then(|| inside as f64 / known.variances.len() as f64)
        };
        Self {
            error: observed_error(&sequence.values()[heard * n..], &mean.concat()),
            mean,
            variance: rows(&rest.variance, &|i, value| scaling.variance_to_raw(i, value)),
            samples: rest.samples.iter().take(loops).map(|sample| rows(sample, &raw)).collect(),
            uncertainty: UNCERTAINTY,
            effective_states,
            nll: known.nll().filter(|nll| nll.is_finite()),
            within_one: within(1.0),
            within_two: within(2.0),
        }
    }
}

/// Names and values of what is written: mean, variance and a sample in each of as many rows as there are samples. What was heard has no
/// variance.
pub(super) fn fields(data: &Dataset, heard: usize, completions: &[Option<&Completion>]) -> Result<Fields> {
    let n = data.channels().len();
    let field = |of: &dyn Fn(&Completion, usize) -> Vec<f64>, known: bool| -> Result<Dataset> {
        let mut sequences = Vec::new();
        for (sequence, completion) in data.sequences().iter().zip(completions) {
            let begun = sequence.truncated(heard);
            let begun: Vec<f64> = begun.values().iter().map(|value| if known { *value } else { 0.0 }).collect();
            let count = completion.as_ref().map_or(1, |one| one.samples.len());
            for k in 0..count {
                let name = if count > 1 { format!("{}/{}", sequence.name, k + 1) } else { sequence.name.clone() };
                let rest = completion.as_ref().map_or(Vec::new(), |one| of(one, k));
                sequences.push(Sequence::new(name, n, [begun.clone(), rest].concat())?);
            }
        }
        Ok(Dataset::new(data.channels().to_vec(), sequences)?)
    };
    let mut fields = vec![("mean", field(&|one, _| one.mean.concat(), true)?)];
    if completions.iter().flatten().all(|one| !one.variance.is_empty()) {
        fields.push(("variance", field(&|one, _| one.variance.concat(), false)?));
    }
    fields.push(("sample", field(&|one, k| one.samples[k].concat(), true)?));
    Ok(fields)
}
