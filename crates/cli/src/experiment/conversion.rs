//! From the file's types to the library's, with every default filled in.

use std::path::{Path, PathBuf};

use scrnn::dataset::Dataset;
use scrnn::learning::{self, Optimiser, Plan};
use scrnn::scaling::Scaling;
use scrnn::tasks::{limit_cycle, lissajous, patterns, sinusoid};
use scrnn::topology::{self, Prediction, Topology};
use scrnn_sim::tutor::Tutoring;

use super::{
    Adam, AdaptiveRate, Data, Experiment, Group, Lbfgs, Momentum, OnDivergence, OptimiserName, PriorStep,
    ScalingChoice, ScalingConstants, ScalingName, ScalingRanges, TaskName, Training,
};
use crate::failure::{Failure, Result};
use scrnn_data::Selection;
use crate::interactions;

impl TaskName {
    /// As it is written in experiment files and on the command line.
    pub fn word(self) -> &'static str {
        match self {
            Self::Lissajous => "lissajous",
            Self::Patterns => "patterns",
            Self::Sinusoid => "sinusoid",
            Self::LimitCycle => "limit-cycle",
            Self::Reach => "reach",
            Self::Interact => "interact",
        }
    }

    /// Whether a simulated robot makes the data.
    pub fn has_robot(self) -> bool {
        matches!(self, Self::Reach | Self::Interact)
    }

    /// Number of sequences and of samples in each, as in the thesis.
    pub fn size(self) -> (usize, usize) {
        match self {
            Self::Lissajous => {
                let lissajous::Options { sequences, steps } = lissajous::Options::default();
                (sequences, steps)
            }
            Self::Patterns => {
                let patterns::Options { sequences, steps } = patterns::Options::default();
                (sequences, steps)
            }
            Self::Sinusoid => {
                let sinusoid::Options { sequences, steps } = sinusoid::Options::default();
                (sequences, steps)
            }
            Self::LimitCycle => {
                let limit_cycle::Options { sequences, steps } = limit_cycle::Options::default();
                (sequences, steps)
            }
            Self::Interact => interactions::size(),
            Self::Reach => {
                let Tutoring { sequences, samples, .. } = Tutoring::default();
                (sequences, samples)
            }
        }
    }
}

impl Experiment {
    /// The same experiment with every value explicit. `folder` is where its file lies.
    pub fn resolved(mut self, folder: &Path) -> Result<Self> {
        self.data.resolve(folder)?;
        self.training.resolve();
        let a_thousandth = (self.training.epochs / 1000).max(1);
        self.output.history_every.get_or_insert(a_thousandth);
        Ok(self)
    }

    /// The network's topology on `channels` channels.
    pub fn topology(&self, channels: usize) -> Result<Topology> {
        let network = &self.network;
        let prediction = if network.variance {
            Prediction::MeanAndVariance { floor: network.variance_floor }
        } else {
            Prediction::Mean
        };
        let groups = network.groups.iter().map(topology::Group::from).collect();
        Ok(Topology::new(channels, network.delay, groups, prediction)?)
    }

    /// How to learn. The experiment is a resolved one.
    pub fn plan(&self) -> Plan {
        let training = &self.training;
        let optimiser = match training.optimiser {
            OptimiserName::Momentum => {
                Optimiser::Momentum(training.momentum.as_ref().map(Into::into).unwrap_or_default())
            }
            OptimiserName::Adam => Optimiser::Adam(training.adam.as_ref().map(Into::into).unwrap_or_default()),
        };
        Plan {
            epochs: training.epochs,
            initial_state_variance: self.network.initial_state_variance,
            optimiser,
            lbfgs: training.lbfgs.as_ref().map(Into::into),
            recompute: training.recompute,
            on_divergence: match training.on_divergence {
                OnDivergence::Recover => learning::OnDivergence::Recover,
                OnDivergence::Stop => learning::OnDivergence::Stop,
            },
        }
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
        for file in self.files.iter_mut().flatten() {
            let path: PathBuf = folder.join(&*file);
            *file = std::path::absolute(&path).map_err(|error| Failure::disk("find", &path, error))?;
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
        Selection {
            topics: self.topic.iter().cloned().collect(),
            period: self.period,
            channels: self.channels.clone(),
            ..Selection::default()
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
        let largest = samples().fold(0.0_f64, |largest, value| largest.max(value.abs()));
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

impl From<&Group> for topology::Group {
    fn from(group: &Group) -> Self {
        Self {
            name: group.name.clone(),
            units: group.units,
            time_constant: group.time_constant,
            receives_input: group.receives_input,
            drives_output: group.drives_output,
            learns_initial_state: group.learns_initial_state,
        }
    }
}

impl From<&Momentum> for learning::Momentum {
    fn from(options: &Momentum) -> Self {
        Self {
            rate: options.rate,
            momentum: options.momentum,
            prior: match options.prior {
                PriorStep::Implicit => learning::PriorStep::Implicit,
                PriorStep::Thesis => learning::PriorStep::Thesis,
            },
            adaptive: options.adaptive_rate.as_ref().map(|adaptive| learning::AdaptiveRate {
                max_error_ratio: adaptive.max_error_ratio,
                decrease: adaptive.decrease,
                increase: adaptive.increase,
                max_tries: adaptive.max_tries,
            }),
        }
    }
}

impl Default for Momentum {
    fn default() -> Self {
        let learning::Momentum { rate, momentum, prior, .. } = learning::Momentum::default();
        let prior = match prior {
            learning::PriorStep::Implicit => PriorStep::Implicit,
            learning::PriorStep::Thesis => PriorStep::Thesis,
        };
        Self { rate, momentum, prior, adaptive_rate: None }
    }
}

impl Default for AdaptiveRate {
    fn default() -> Self {
        let learning::AdaptiveRate { max_error_ratio, decrease, increase, max_tries } =
            learning::AdaptiveRate::default();
        Self { max_error_ratio, decrease, increase, max_tries }
    }
}

impl From<&Lbfgs> for learning::Lbfgs {
    fn from(&Lbfgs { share, memory }: &Lbfgs) -> Self {
        Self { share, memory }
    }
}

impl Default for Lbfgs {
    fn default() -> Self {
        let learning::Lbfgs { share, memory } = learning::Lbfgs::default();
        Self { share, memory }
    }
}

impl From<&Adam> for learning::Adam {
    fn from(options: &Adam) -> Self {
        let &Adam {
            rate,
            warm_up,
            final_rate,
            clip_norm,
            weight_decay,
            batch_size,
            initial_state_factor,
            mean_factor,
            beta1,
            beta2,
            epsilon,
        } = options;
        Self {
            rate,
            warm_up,
            final_rate,
            clip_norm,
            weight_decay,
            batch_size,
            initial_state_factor,
            mean_factor,
            beta1,
            beta2,
            epsilon,
        }
    }
}

impl Default for Adam {
    fn default() -> Self {
        let learning::Adam {
            rate,
            warm_up,
            final_rate,
            clip_norm,
            weight_decay,
            batch_size,
            initial_state_factor,
            mean_factor,
            beta1,
            beta2,
            epsilon,
        } = learning::Adam::default();
        Self {
            rate,
            warm_up,
            final_rate,
            clip_norm,
            weight_decay,
            batch_size,
            initial_state_factor,
            mean_factor,
            beta1,
            beta2,
            epsilon,
        }
    }
}
