//! From the file's types to the library's, with every default filled in.

use std::path::{Path, PathBuf};

use scrnn::dataset::Dataset;
use scrnn::features::{Skip, SkipKind, velocity_deviations};
use scrnn::learning::{Optimiser, Plan};
use scrnn::scaling::Scaling;
use scrnn::topology::{Prediction, Topology};

use super::{
    Data, Experiment, HeldOut, HeldOutFiles, MeanUnits, MissingName, OptimiserName, ScalingChoice, ScalingConstants,
    ScalingName, ScalingRanges, SkipName, TaskName, TimeSourceName, Training, checks, robust,
};
use crate::failure::{Failure, Result};
use scrnn_data::{Missing, Selection, TimeSource};

/// Default share of the last change.
const DAMPING: f64 = 0.7;
/// Default number of differences.
const LAGS: usize = 3;

impl Experiment {
    /// The same experiment with every value explicit. `folder` is where its file lies.
    pub fn resolved(mut self, folder: &Path) -> Result<Self> {
        self.data.resolve(folder)?;
        self.training.resolve();
        match self.network.skip {
            SkipName::Extrapolation => _ = self.network.skip_damping.get_or_insert(DAMPING),
            SkipName::Autoregressive => _ = self.network.skip_lags.get_or_insert(LAGS),
            SkipName::None | SkipName::Residual => {}
        }
        let a_thousandth = (self.training.epochs / 1000).max(1);
        self.output.history_every.get_or_insert(a_thousandth);
        if self.data.held_out.is_some() {
            let a_hundredth = (self.training.epochs / 100).max(1);
            self.evaluation.get_or_insert_default().every.get_or_insert(a_hundredth);
        }
        Ok(self)
    }

    /// Whether all values are in their ranges.
    ///
    /// # Errors
    /// What is wrong, and what would do.
    pub fn check(&self) -> std::result::Result<(), String> {
        checks::check(self).map_err(|complaint| format!("{}; needed: {}", complaint.message, complaint.needed))
    }

    /// The network's topology on these data, which are in the network's units: constants of the skip connection and of velocity inputs
    /// are fitted to them.
    pub fn topology(&self, data: &Dataset) -> Result<Topology> {
        let network = &self.network;
        let mut topology =
            self.bare_topology(data.channels().len())?.with_linear_mean(network.mean == MeanUnits::Linear);
        if network.velocity_inputs {
            topology = topology.with_velocity_inputs(velocity_deviations(data))?;
        }
        let kind = match network.skip {
            SkipName::None => return Ok(topology),
            SkipName::Residual => SkipKind::Residual,
            SkipName::Extrapolation => SkipKind::Extrapolation { damping: network.skip_damping.unwrap_or(DAMPING) },
            SkipName::Autoregressive => SkipKind::Autoregressive { lags: network.skip_lags.unwrap_or(LAGS) },
        };
        Ok(topology.with_skip(Skip::fit(kind, data, network.delay)?)?)
    }

    /// The topology on `channels` channels, without what has to be fitted to data.
    pub fn bare_topology(&self, channels: usize) -> Result<Topology> {
        let network = &self.network;
        let prediction = if network.variance {
            Prediction::MeanAndVariance { floor: network.variance_floor }
        } else {
            Prediction::Mean
        };
        Ok(Topology::new(channels, network.delay, network.groups.clone(), prediction)?)
    }

    /// How to learn. The experiment is a resolved one.
    pub fn plan(&self) -> Plan {
        let training = &self.training;
        let optimiser = match training.optimiser {
            OptimiserName::Momentum => Optimiser::Momentum(training.momentum.clone().unwrap_or_default()),
            OptimiserName::Adam => Optimiser::Adam(training.adam.clone().unwrap_or_default()),
        };
        Plan::with(|it| {
            it.epochs = training.epochs;
            it.initial_state_variance = self.network.initial_state_variance;
            it.optimiser = optimiser;
            it.closed_loop = training.closed_loop.clone();
            it.lbfgs = training.lbfgs.clone();
            it.recompute = training.recompute;
            it.precision = training.precision;
            it.on_divergence = training.on_divergence;
        })
    }
}

impl Data {
    fn resolve(&mut self, folder: &Path) -> Result<()> {
        if let Some(task) = self.task {
            let (sequences, steps) = task.size();
            self.sequences.get_or_insert(sequences);
            self.steps.get_or_insert(steps);
            self.seed.get_or_insert(1);
            if task == TaskName::Reach {
                self.exact_positions.get_or_insert(false);
            }
        }
        let held_out = match &mut self.held_out {
            Some(HeldOut::Files(HeldOutFiles { files })) => files.as_mut_slice(),
            _ => &mut [],
        };
        for file in self.files.iter_mut().flatten().chain(held_out) {
            let path: PathBuf = folder.join(&*file);
            *file = std::path::absolute(&path).map_err(|error| Failure::disk("find", &path, error))?;
            if file.to_str().is_none() {
                // The run notes the paths of its data as text.
                let message = format!("the path {} is not UTF-8", file.display());
                return Err(Failure::input(message, "rename the folder or the file, or link to it by another name"));
            }
        }
        let by_default = match self.task {
            Some(task) if !task.has_robot() => ScalingName::None,
            _ => ScalingName::Fit,
        };
        self.scaling.get_or_insert(ScalingChoice::Named(by_default));
        Ok(())
    }

    /// Which part of its files is meant.
    pub fn selection(&self) -> Selection {
        let mut topics = self.topics.clone().unwrap_or_default();
        topics.extend(self.topic.iter().filter(|topic| !topics.contains(topic)).cloned().collect::<Vec<_>>());
        Selection {
            topics,
            period: self.period,
            time: self.time.map(|time| match time {
                TimeSourceName::Header => TimeSource::Header,
                TimeSourceName::Publish => TimeSource::Publish,
                TimeSourceName::Log => TimeSource::Log,
                TimeSourceName::Rows => TimeSource::Rows,
            }),
            channels: self.channels.clone(),
            arrays: self.arrays.clone().unwrap_or_default(),
            axes: self.axes.as_ref().and_then(|axes| axes.parse().ok()),
            unwrap: self.unwrap.clone().unwrap_or_default(),
            missing: match self.missing {
                Some(MissingName::Refuse) => Missing::Refuse,
                Some(MissingName::Accept) | None => Missing::Accept,
            },
        }
    }

    /// The scaling that the experiment asks for, fitted to `data` if that is asked for.
    pub fn scaling_for(&self, data: &Dataset) -> Result<Scaling> {
        let scaling = self.chosen_scaling(data)?;
        check_reach(data, &scaling)?;
        Ok(scaling)
    }

    fn chosen_scaling(&self, data: &Dataset) -> Result<Scaling> {
        let channels = data.channels().len();
        let fits = |what: &str, count: usize| {
            if count == channels {
                return Ok(());
            }
            let message = format!("`data.scaling` has {count} {what}, the data have {channels} channels");
            Err(Failure::input(message, format!("channels: {}", data.channels().join(", "))))
        };
        match &self.scaling {
            Some(ScalingChoice::Named(ScalingName::Fit)) => Ok(Scaling::fit(data, Scaling::RANGE)),
            Some(ScalingChoice::Named(ScalingName::Robust)) => {
                Ok(Scaling::from_ranges(&robust::ranges(data), Scaling::RANGE))
            }
            Some(ScalingChoice::Ranges(ScalingRanges { ranges })) => {
                fits("ranges", ranges.len())?;
                Ok(Scaling::from_ranges(ranges, Scaling::RANGE))
            }
            Some(ScalingChoice::Constants(ScalingConstants { offset, scale })) => {
                fits("offsets", offset.len())?;
                Ok(Scaling::new(offset.clone(), scale.clone())?)
            }
            Some(ScalingChoice::Named(ScalingName::None)) | None => Ok(Scaling::identity(channels)),
        }
    }
}

/// Numbers up to this, and as little as its inverse apart, have variances that float64 can hold.
const REACH: f64 = 1e150;

/// Refuses channels whose samples are too large, or too close to each other, to compute their variances.
fn check_reach(data: &Dataset, scaling: &Scaling) -> Result<()> {
    for (i, name) in data.channels().iter().enumerate() {
        let samples = || data.sequences().iter().flat_map(|s| s.values().iter().skip(i).step_by(data.channels().len()));
        let largest =
            samples().filter(|value| !value.is_nan()).fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let scale = scaling.scale()[i].abs();
        let help = "bring the data to other units, or leave the channel out with `channels` in [data]";
        if largest > REACH {
            return Err(Failure::input(format!("channel {name} reaches {largest:e}; needed: at most {REACH:e}"), help));
        }
        if !(1.0 / REACH..=REACH).contains(&scale) || samples().any(|&x| scaling.to_scaled(i, x).abs() > REACH) {
            let message =
                format!("the samples of channel {name} cannot be scaled: a factor of {scale:e} would be needed");
            return Err(Failure::input(message, help));
        }
    }
    Ok(())
}

impl Training {
    /// Keeps the table of the optimiser that is used, and fills it in.
    fn resolve(&mut self) {
        match self.optimiser {
            OptimiserName::Momentum => {
                self.momentum.get_or_insert_default();
                self.adam = None;
            }
            OptimiserName::Adam => {
                self.adam.get_or_insert_default();
                self.momentum = None;
            }
        }
    }
}
