//! Error regression while samples arrive.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use scrnn::error_regression::ErrorRegressionOptions;
use scrnn_run::failure::Failure;
use scrnn_run::following::{Begin, Conflict, Deadline, Following, Rule, Wanted};
use scrnn_run::trained::Trained;

use crate::arrays::matrix;
use crate::failure::compute;
use crate::machine::engine;
use crate::model::Model;

/// What became of one sample, in the data's units.
///
/// >>> step = net.follow(window=5, ahead=3).observe(wave[0])
/// >>> step.sample, step.mean.shape, step.forecast.shape, step.missing
/// (1, (2,), (3, 2), [])
#[pyclass(frozen, module = "scrnn._scrnn")]
pub struct Step {
    /// Its number, from 1.
    #[pyo3(get)]
    sample: usize,
    /// The next sample's mean, (C,); None before the network's delay is over.
    #[pyo3(get)]
    mean: Option<Py<PyArray1<f64>>>,
    /// The next sample's variance, (C,); None without variance units.
    #[pyo3(get)]
    variance: Option<Py<PyArray1<f64>>>,
    /// Means of the samples after the next one, (ahead, C).
    #[pyo3(get)]
    forecast: Py<PyArray2<f64>>,
    /// Their variances; None without variance units.
    #[pyo3(get)]
    forecast_variance: Option<Py<PyArray2<f64>>>,
    /// What the window now says about its samples, in the network's units, and as Python gets it once it asks.
    window: Vec<f64>,
    trained: Arc<Trained>,
    smoothed: PyOnceLock<Py<PyArray2<f64>>>,
    /// The contexts that go with them, (window, units); None unless they were asked for.
    #[pyo3(get)]
    contexts: Option<Py<PyArray2<f64>>>,
    /// Nats per observed value of the window, before and after.
    #[pyo3(get)]
    log_likelihood: Option<(f64, f64)>,
    /// Half the mean squared error over the window, before and after, in scaled units.
    #[pyo3(get)]
    error: Option<(f64, f64)>,
    /// Whether the window is as likely as what was learned, but for one nat per step and channel.
    #[pyo3(get)]
    locked: Option<bool>,
    /// Updates that were tried.
    #[pyo3(get)]
    iterations: usize,
    /// Whether the network predicted the window better without regression, and goes on so.
    #[pyo3(get)]
    given_up: bool,
    /// How long it took.
    #[pyo3(get)]
    milliseconds: f64,
    /// Channels that had no value.
    #[pyo3(get)]
    missing: Vec<String>,
}

/// A network that follows samples.
#[pyclass(frozen, module = "scrnn._scrnn")]
pub struct Follower {
    following: Mutex<Following>,
    trained: Arc<Trained>,
    channels: Vec<String>,
    units: usize,
    /// Whether contexts are told.
    contexts: bool,
}

#[pymethods]
impl Follower {
    #[new]
    #[pyo3(signature = (model, *, window=50, iterations=None, ahead=10, optimiser=None, rate=None, momentum=None, max_norm=None,
        keep_best=false, tolerance=None, guard=None, deadline=None, closed_channels=vec![], masked_channels=vec![], begin=None, sequence=None, contexts=false, instruction_set=None))]
    #[expect(clippy::too_many_arguments, reason = "they come by name, from one place in the Python layer")]
    fn new(
        py: Python<'_>,
        model: &Model,
        window: usize,
        iterations: Option<usize>,
        ahead: usize,
        optimiser: Option<&str>,
        rate: Option<f64>,
        momentum: Option<f64>,
        max_norm: Option<f64>,
        keep_best: bool,
        tolerance: Option<f64>,
        guard: Option<bool>,
        deadline: Option<f64>,
        closed_channels: Vec<String>,
        masked_channels: Vec<String>,
        begin: Option<&str>,
        sequence: Option<String>,
        contexts: bool,
        instruction_set: Option<&str>,
    ) -> PyResult<Self> {
        compute(py, || {
            let only = model.only()?;
            let channels = only.checkpoint.channels.clone();
            let mut options = ErrorRegressionOptions::new(channels.len());
            (options.window, options.ahead) = (window, ahead);
            (options.keep_best, options.tolerance, options.guard) = (keep_best, tolerance, guard);
            let named = |name: &str| {
                let help = "give \"lbfgs\", \"adam\" or \"momentum\"";
                Rule::named(name).ok_or_else(|| Failure::input(format!("there is no optimiser {name:?}"), help))
            };
            let rule = optimiser.map(named).transpose()?;
            let wanted = Wanted { rule, rate, momentum, max_norm, iterations };
            wanted.change(&mut options).map_err(|Conflict { what, rule }| {
                let message = format!("{what} does not go with optimiser={:?}", rule.name());
                Failure::input(message, "leave one of them out")
            })?;
            for (names, shares) in [(&closed_channels, &mut options.sensed), (&masked_channels, &mut options.mask)] {
                for name in names {
                    let place = channels.iter().position(|channel| channel == name).ok_or_else(|| {
                        let help = format!("the channels are {}", channels.join(", "));
                        Failure::input(format!("the network has no channel `{name}`"), help)
                    })?;
                    shares[place] = 0.0;
                }
            }
            let begin = match (begin, sequence) {
                (_, Some(wanted)) => Begin::Sequence(wanted),
                (Some("mean"), None) => Begin::Mean,
                _ => Begin::Likely,
            };
            let limit = match deadline {
                None => None,
                Some(ms) => match Duration::try_from_secs_f64(ms / 1e3) {
                    Ok(limit) if ms > 0.0 => Some(limit),
                    _ => return Err(Failure::input(format!("deadline is {ms}"), "give milliseconds, more than 0")),
                },
            };
            let trained = Arc::new(Trained::of(only.path.clone(), only.checkpoint.clone())?);
            let units = trained.checkpoint.topology.context_units();
            let engine = engine(1, instruction_set)?;
            let following = Following::new(trained.clone(), options, begin, Deadline::new(limit), engine)?;
            Ok(Self { following: Mutex::new(following), trained, channels, units, contexts })
        })
    }

    /// Takes one sample of float64.
    fn observe(&self, py: Python<'_>, sample: PyReadonlyArray1<'_, f64>) -> PyResult<Step> {
        let own;
        let values: &[f64] = match sample.as_slice() {
            Ok(values) => values,
            Err(_) => {
                own = sample.as_array().to_vec();
                &own
            }
        };
        let (told, flat, missing) = compute(py, || {
            let mut following = self.following.lock().unwrap_or_else(PoisonError::into_inner);
            let done = following.observe(values)?;
            let missing: Vec<String> = following.missing().iter().map(|&c| self.channels[c].clone()).collect();
            Ok((following.told(&done, false), following.flat(self.contexts), missing))
        })?;
        let n = self.channels.len();
        let first = |values: &[f64]| values.get(..n).map(|row| PyArray1::from_slice(py, row).unbind());
        let rest = |mut values: Vec<f64>| {
            values.drain(..n.min(values.len()));
            matrix(py, values, n).map(Bound::unbind)
        };
        let pair = |pair: Option<[f64; 2]>| pair.map(|[before, after]| (before, after));
        let has_variance = !flat.variance.is_empty();
        Ok(Step {
            sample: told.sample,
            mean: first(&flat.predicted),
            variance: first(&flat.variance),
            forecast: rest(flat.predicted)?,
            forecast_variance: if has_variance { Some(rest(flat.variance)?) } else { None },
            window: flat.smoothed,
            trained: self.trained.clone(),
            smoothed: PyOnceLock::new(),
            contexts: if self.contexts { Some(matrix(py, flat.contexts, self.units)?.unbind()) } else { None },
            log_likelihood: pair(told.ln_likelihood),
            error: pair(told.error),
            locked: told.locked,
            iterations: told.iterations,
            given_up: told.given_up,
            milliseconds: told.milliseconds,
            missing,
        })
    }

    /// Samples so far.
    #[getter]
    fn taken(&self) -> usize {
        self.following.lock().unwrap_or_else(PoisonError::into_inner).taken()
    }

    #[getter]
    fn channels(&self) -> Vec<String> {
        self.channels.clone()
    }

    /// Median, 99th percentile, shortest and longest in milliseconds, and how many samples missed the deadline.
    #[getter]
    fn latency(&self) -> Option<(f64, f64, f64, f64, Option<usize>)> {
        let latency = self.following.lock().unwrap_or_else(PoisonError::into_inner).latency()?;
        Some((latency.median, latency.p99, latency.shortest, latency.longest, latency.missed))
    }
}

/// A step that is shown.
#[pymethods]
impl Step {
    /// What the window now says about its samples, (window, C).
    #[getter]
    fn smoothed(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let raw = || {
            let scaling = &self.trained.checkpoint.scaling;
            let n = scaling.channels();
            let values = self.window.iter().enumerate().map(|(k, &y)| scaling.to_raw(k % n, y)).collect();
            Ok::<_, PyErr>(matrix(py, values, n)?.unbind())
        };
        Ok(self.smoothed.get_or_try_init(py, raw)?.clone_ref(py))
    }

    fn __repr__(&self) -> String {
        let found = match self.locked {
            Some(true) => ", locked",
            Some(false) => ", not locked",
            None => "",
        };
        format!("<Step {}: {} iterations, {:.3} ms{found}>", self.sample, self.iterations, self.milliseconds)
    }
}
