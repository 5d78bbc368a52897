//! Follows samples while they arrive, by error regression (thesis 2.10.2), in the data's units.

mod ascending;
mod deadline;
mod locking;

pub use ascending::{Conflict, Rule, Wanted};
pub use deadline::{Deadline, Latency};
pub use locking::bound;

use std::sync::Arc;

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions, Regression};
use serde::Serialize;

use crate::failure::{Failure, Result};
use crate::generating::{Fields, unit_names};
use crate::memory::{self, product};
use crate::trained::{TOO_FAR, Trained};
use locking::Choice;

/// Where following begins.
#[derive(Debug, Clone, Default)]
pub enum Begin {
    /// From the mean of the learned states for the first samples, then from the learned state from which these are most likely.
    #[default]
    Likely,
    /// From the mean of the learned states.
    Mean,
    /// From the state of the learned sequence of this name or, counted from 1, number.
    Sequence(String),
}

/// What became of one sample.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Observed {
    /// Its number, from 1.
    pub sample: usize,
    /// Updates of the internal state that were tried.
    pub iterations: usize,
    /// Whether the network predicted the window better without regression, and goes on so.
    pub given_up: bool,
    /// Nats per observed value of the window before and after, in scaled units; none without variance units.
    pub ln_likelihood: Option<[f64; 2]>,
    /// (3.5) over the window before and after, in scaled units.
    pub error: Option<[f64; 2]>,
    /// Whether the window is as likely as what was learned, but for one nat per step and channel.
    pub locked: Option<bool>,
    /// How long it took.
    pub milliseconds: f64,
    /// The whole window, if it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view: Option<View>,
}

/// What a stream is answered with, in the data's units.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Answer<'a> {
    /// The number of the sample, from 1.
    pub sample: usize,
    /// Mean of the next sample; empty before the network's delay is over.
    pub mean: Vec<f64>,
    /// Its variance; empty without variance units.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub variance: Vec<f64>,
    /// The means of the samples after it.
    pub forecast: Vec<Vec<f64>>,
    /// Nats per observed value of the window before and after, in scaled units; none without variance units.
    pub ln_likelihood: Option<[f64; 2]>,
    /// Whether the window is as likely as what was learned, but for one nat per step and channel.
    pub locked: Option<bool>,
    /// How long it took.
    pub milliseconds: f64,
    /// The channels that had no value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<&'a str>,
}

/// The network's view at one moment, in the data's units: rows of channels, or of context units.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct View {
    /// Number of the window's first sample, from 1.
    pub from: usize,
    /// What the window now says about its samples.
    pub smoothed: Vec<Vec<f64>>,
    /// The contexts that go with them.
    pub contexts: Vec<Vec<f64>>,
    /// What is predicted of the samples to come: the next one, then those of the forecast.
    pub predicted: Vec<Vec<f64>>,
    /// The variances of these; empty without variance units.
    pub variance: Vec<Vec<f64>>,
}

/// What a [`View`] holds, row after row in one list each, for callers that have no time for lists of lists.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Flat {
    /// What the window now says about its samples, in the network's units: steps x channels. Few look at it each time.
    pub smoothed: Vec<f64>,
    /// The contexts that go with them, if they were asked for: steps x context units.
    pub contexts: Vec<f64>,
    /// What is predicted of the samples to come: the next one, then those of the forecast.
    pub predicted: Vec<f64>,
    /// The variances of these; empty without variance units.
    pub variance: Vec<f64>,
}

/// One sequence, followed to its end.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Followed {
    /// Its name.
    pub sequence: String,
    /// Its length.
    pub samples: usize,
    /// Averages over all samples.
    pub ln_likelihood: Option<[f64; 2]>,
    /// Averages over all samples.
    pub error: [f64; 2],
    /// (3.5) of each sample against what it was predicted as just before, in the data's units.
    pub prediction_error: f64,
    /// Share of the samples at which the window was as likely as what was learned, but for one nat per step and channel.
    pub locked: Option<f64>,
    /// How long samples took.
    pub latency: Option<Latency>,
    /// Each sample.
    pub steps: Vec<Observed>,
    #[serde(skip)]
    rows: Rows,
}

/// What goes into a file: a row for each sample from the first predicted one on.
#[derive(Debug, Clone, Default)]
struct Rows {
    mean: Vec<f64>,
    variance: Vec<f64>,
    smoothed: Vec<f64>,
    context: Vec<f64>,
}

/// A network that follows one sequence of samples, in the data's units.
#[derive(Debug)]
pub struct Following {
    trained: Arc<Trained>,
    engine: Engine,
    options: ErrorRegressionOptions,
    regression: ErrorRegression,
    deadline: Deadline,
    taken: usize,
    scaled: Vec<f64>,
    /// Channels whose values are not there in the sample that came last.
    missing: Vec<usize>,
    /// Waits for the first samples, unless it is said where to start.
    choice: Option<Choice>,
    begin: Begin,
    bound: Option<f64>,
}

impl Following {
    /// Begins to follow. `deadline` is the clock of the control loop.
    ///
    /// # Errors
    /// [`Failure::Input`] for options and states that do not fit the network, and for a window that does not fit into memory.
    pub fn new(
        trained: Arc<Trained>,
        options: ErrorRegressionOptions,
        begin: Begin,
        deadline: Deadline,
        engine: Engine,
    ) -> Result<Self> {
        let (topology, channels) = (&trained.checkpoint.topology, trained.checkpoint.channels.len());
        let wide = 2 * topology.context_units() + 4 * channels;
        // Under a guard the network without regression runs beside.
        let networks = 1 + usize::from(options.is_guarded() && options.iterations > 0);
        let bytes = product(&[options.window.saturating_add(options.ahead), wide, networks, size_of::<f64>()]);
        memory::check("a window of that length", bytes)?;
        let learned = &trained.checkpoint.initial_states;
        let start = match &begin {
            Begin::Likely | Begin::Mean => learned.mean(),
            Begin::Sequence(wanted) => learned.sequence(trained.sequence(wanted)?),
        };
        let regression = ErrorRegression::new(&trained.network(), start, options.clone(), &engine)?;
        let choice = matches!(begin, Begin::Likely).then(|| Choice::new(&trained));
        let (bound, scaled, missing) = (locking::bound(&trained), vec![0.0; channels], Vec::new());
        Ok(Self { trained, engine, options, regression, deadline, taken: 0, scaled, missing, choice, begin, bound })
    }

    /// The same from its beginning, for another sequence; the clock goes on.
    ///
    /// # Errors
    /// As [`Following::new`].
    pub fn begin_anew(self) -> Result<Self> {
        Self::new(self.trained, self.options, self.begin, self.deadline, self.engine)
    }

    /// Takes a sample, in the data's units and in the order of the channels: regresses, and predicts anew. What is not finite, or lies further
    /// out than [`TOO_FAR`] times what was learned, is missing: it does not count, and the network's own prediction stands in.
    ///
    /// # Errors
    /// [`Failure::Input`] for a sample of another size.
    pub fn observe(&mut self, sample: &[f64]) -> Result<Regression> {
        if sample.len() != self.scaled.len() {
            let message =
                format!("a sample has {} values, and the network {} channels", sample.len(), self.scaled.len());
            return Err(Failure::input(message, "give one value for each channel"));
        }
        let scaling = &self.trained.checkpoint.scaling;
        self.missing.clear();
        for (channel, (scaled, raw)) in self.scaled.iter_mut().zip(sample).enumerate() {
            let value = scaling.to_scaled(channel, *raw);
            if value.is_finite() && value.abs() < TOO_FAR {
                *scaled = value;
                continue;
            }
            self.missing.push(channel);
            // It does not count; the network's own prediction stands in as an input.
            *scaled = f64::NAN;
        }
        self.taken += 1;
        if let Some(choice) = &mut self.choice
            && choice.take(&self.scaled)
        {
            if let Some(better) = choice.begin(&self.trained, self.options.clone(), &self.engine)? {
                self.regression = better;
            }
            self.choice = None;
        }
        let (regression, scaled) = (&mut self.regression, &self.scaled);
        Ok(self.deadline.sample(|go_on| regression.observe(scaled, go_on))?)
    }

    /// What became of the last sample. `view` asks for the whole window.
    pub fn told(&self, done: &Regression, view: bool) -> Observed {
        let values = done.values as f64;
        let has_variance = self.trained.checkpoint.topology.has_variance();
        let regressed = (done.iterations > 0 || done.converged || done.given_up) && done.values > 0;
        let ln_likelihood = (regressed && has_variance).then(|| done.ln_likelihood.map(|sum| sum / values));
        Observed {
            sample: self.taken,
            iterations: done.iterations,
            given_up: done.given_up,
            ln_likelihood,
            locked: ln_likelihood.zip(self.bound).map(|([_, after], bound)| after >= bound),
            error: regressed.then(|| done.squared_error.map(|sum| sum / (2.0 * values))),
            milliseconds: 1e3 * self.deadline.last().as_secs_f64(),
            view: view.then(|| self.view()),
        }
    }

    /// What a stream is answered with.
    pub fn answer(&self, done: &Regression) -> Answer<'_> {
        let Observed { sample, ln_likelihood, locked, milliseconds, .. } = self.told(done, false);
        let (scaling, channels) = (&self.trained.checkpoint.scaling, &self.trained.checkpoint.channels);
        let raw = |mean: &[f64]| mean.iter().enumerate().map(|(i, &y)| scaling.to_raw(i, y)).collect::<Vec<_>>();
        let (mut mean, mut variance, mut forecast) = (Vec::new(), Vec::new(), Vec::new());
        if self.predicts() {
            mean = raw(self.regression.mean());
            let v = self.regression.variance().iter().enumerate();
            variance = v.map(|(i, &v)| scaling.variance_to_raw(i, v)).collect();
            forecast = (1..=self.options.ahead).filter_map(|k| self.regression.forecast_mean(k)).map(raw).collect();
        }
        let missing = self.missing.iter().map(|&channel| channels[channel].as_str()).collect();
        Answer { sample, mean, variance, forecast, ln_likelihood, locked, milliseconds, missing }
    }

    /// Whether enough samples came for a prediction of the next one.
    pub fn predicts(&self) -> bool {
        self.taken >= self.trained.checkpoint.topology.delay()
    }

    /// The mean of the next sample; none before enough samples came.
    pub fn next_mean(&self) -> Option<Vec<f64>> {
        let scaling = &self.trained.checkpoint.scaling;
        let raw = |(i, y): (usize, &f64)| scaling.to_raw(i, *y);
        self.predicts().then(|| self.regression.mean().iter().enumerate().map(raw).collect())
    }

    /// The variance of the next sample; none before enough samples came, and none without variance units.
    pub fn next_variance(&self) -> Option<Vec<f64>> {
        let scaling = &self.trained.checkpoint.scaling;
        let raw = |(i, v): (usize, &f64)| scaling.variance_to_raw(i, *v);
        let known = self.predicts() && self.trained.checkpoint.topology.has_variance();
        known.then(|| self.regression.variance().iter().enumerate().map(raw).collect())
    }

    /// What the network makes of the window and of what is to come.
    pub fn view(&self) -> View {
        let scaling = &self.trained.checkpoint.scaling;
        let raw = |mean: &[f64]| mean.iter().enumerate().map(|(i, &y)| scaling.to_raw(i, y)).collect::<Vec<_>>();
        let raw_variance =
            |v: &[f64]| v.iter().enumerate().map(|(i, &v)| scaling.variance_to_raw(i, v)).collect::<Vec<_>>();
        let window = self.regression.window();
        let forecast = if self.predicts() { 0..self.options.ahead + 1 } else { 0..0 };
        let has_variance = self.trained.checkpoint.topology.has_variance();
        View {
            from: self.taken + 1 - window,
            smoothed: (0..window).filter_map(|k| self.regression.smoothed_mean(k)).map(raw).collect(),
            contexts: (0..window).filter_map(|k| self.regression.context(k)).map(<[f64]>::to_vec).collect(),
            predicted: forecast.clone().filter_map(|k| self.regression.forecast_mean(k)).map(raw).collect(),
            variance: match has_variance {
                true => forecast.filter_map(|k| self.regression.forecast_variance(k)).map(raw_variance).collect(),
                false => Vec::new(),
            },
        }
    }

    /// The same as [`Following::view`], row after row, but what is smoothed as the network has it; contexts only if they are wanted.
    pub fn flat(&self, contexts: bool) -> Flat {
        let scaling = &self.trained.checkpoint.scaling;
        let (window, n) = (self.regression.window(), self.scaled.len());
        let ahead = if self.predicts() { self.options.ahead + 1 } else { 0 };
        let mut flat = Flat::default();
        flat.smoothed.reserve_exact(window * n);
        (0..window)
            .filter_map(|k| self.regression.smoothed_mean(k))
            .for_each(|row| flat.smoothed.extend_from_slice(row));
        if contexts {
            flat.contexts.reserve_exact(window * self.trained.checkpoint.topology.context_units());
            (0..window).filter_map(|k| self.regression.context(k)).for_each(|row| flat.contexts.extend_from_slice(row));
        }
        flat.predicted.reserve_exact(ahead * n);
        for row in (0..ahead).filter_map(|k| self.regression.forecast_mean(k)) {
            flat.predicted.extend(row.iter().enumerate().map(|(i, &y)| scaling.to_raw(i, y)));
        }
        if self.trained.checkpoint.topology.has_variance() {
            flat.variance.reserve_exact(ahead * n);
            for row in (0..ahead).filter_map(|k| self.regression.forecast_variance(k)) {
                flat.variance.extend(row.iter().enumerate().map(|(i, &v)| scaling.variance_to_raw(i, v)));
            }
        }
        flat
    }

    /// How many samples came.
    pub fn taken(&self) -> usize {
        self.taken
    }

    /// The channels that had no value in the last sample.
    pub fn missing(&self) -> &[usize] {
        &self.missing
    }

    /// How long samples took; none before the first.
    pub fn latency(&self) -> Option<Latency> {
        self.deadline.latency()
    }

    /// How long the last sample took.
    pub fn last_took(&self) -> std::time::Duration {
        self.deadline.last()
    }

    /// The network that follows.
    pub fn trained(&self) -> &Arc<Trained> {
        &self.trained
    }
}

/// Follows one sequence to its end, from the beginning of `session`. At the samples of these numbers, from 1, the whole window is shown.
///
/// # Errors
/// As [`Following::observe`].
pub fn follow(session: Following, sequence: &Sequence, views: &[usize]) -> Result<Followed> {
    follow_watched(session, sequence, views, &mut |_, _, _| ())
}

/// As [`follow`]; `watch` sees each sample with what became of it.
///
/// # Errors
/// As [`Following::observe`].
pub fn follow_watched(
    mut session: Following,
    sequence: &Sequence,
    views: &[usize],
    watch: &mut dyn FnMut(&Following, &[f64], &Regression),
) -> Result<Followed> {
    let trained = session.trained.clone();
    let (scaling, delay) = (&trained.checkpoint.scaling, trained.checkpoint.topology.delay());
    let (mut steps, mut rows) = (Vec::with_capacity(sequence.len()), Rows::default());
    let (mut squares, mut values) = (0.0, 0_usize);
    for k in 0..sequence.len() {
        let sample = sequence.sample(k);
        if k >= delay {
            for (i, &y) in session.regression.mean().iter().enumerate() {
                rows.mean.push(scaling.to_raw(i, y));
                if !sample[i].is_nan() {
                    squares += (scaling.to_raw(i, y) - sample[i]).powi(2);
                    values += 1;
                }
            }
            let v = session.regression.variance().iter().enumerate();
            rows.variance.extend(v.map(|(i, &v)| scaling.variance_to_raw(i, v)));
        }
        let done = session.observe(sample)?;
        watch(&session, sample, &done);
        if k >= delay {
            let last = session.regression.window() - 1;
            let smoothed = session.regression.smoothed_mean(last).into_iter().flatten().enumerate();
            rows.smoothed.extend(smoothed.map(|(i, &y)| scaling.to_raw(i, y)));
            rows.context.extend(session.regression.context(last).into_iter().flatten());
        }
        steps.push(session.told(&done, views.contains(&(k + 1))));
    }
    let mean = |of: &dyn Fn(&Observed) -> Option<[f64; 2]>| {
        let pairs: Vec<[f64; 2]> = steps.iter().filter_map(of).collect();
        let n = pairs.len() as f64;
        (!pairs.is_empty()).then(|| [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / n))
    };
    let locked: Vec<bool> = steps.iter().filter_map(|step| step.locked).collect();
    let share = locked.iter().filter(|locked| **locked).count() as f64 / locked.len() as f64;
    Ok(Followed {
        sequence: sequence.name.clone(),
        samples: sequence.len(),
        ln_likelihood: mean(&|step| step.ln_likelihood),
        error: mean(&|step| step.error).unwrap_or_default(),
        prediction_error: squares / (2.0 * values.max(1) as f64),
        locked: (!locked.is_empty()).then_some(share),
        latency: session.latency(),
        steps,
        rows,
    })
}

/// Each sample as predicted just before it came and as the window has it afterwards, in the data's units.
///
/// # Errors
/// None that what [`follow`] made can cause.
pub fn fields(trained: &Trained, followed: &[Followed]) -> Result<Fields> {
    let channels = &trained.checkpoint.channels;
    let units: Vec<String> = trained.checkpoint.topology.groups().iter().flat_map(unit_names).collect();
    let field = |names: &[String], of: &dyn Fn(&Rows) -> &Vec<f64>| -> Result<Dataset> {
        let rows = followed.iter().map(|one| Sequence::new(one.sequence.clone(), names.len(), of(&one.rows).clone()));
        Ok(Dataset::new(names.to_vec(), rows.collect::<scrnn::error::Result<_>>()?)?)
    };
    let mut fields = vec![("mean", field(channels, &|rows| &rows.mean)?)];
    if trained.checkpoint.topology.has_variance() {
        fields.push(("variance", field(channels, &|rows| &rows.variance)?));
    }
    fields.push(("smoothed", field(channels, &|rows| &rows.smoothed)?));
    fields.push(("context", field(&units, &|rows| &rows.context)?));
    Ok(fields)
}
