//! Who is in the network and who projects to whom (thesis 2.5 and 2.10).
//!
//! One type covers the four networks of the thesis: with one context group it is a CTRNN, with variance units an
//! S-CTRNN; with a fast and a slow group it is an MTRNN or an S-MTRNN. Context units are all connected with each other;
//! a group's rules say whether the input reaches it and whether it drives the outputs (2.27).

use crate::error::{Error, Result};
use crate::skip::{Skip, positive};

/// Context units that share a time constant and a place in the hierarchy.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
pub struct Group {
    /// The group's name, e.g. `fast`.
    pub name: String,
    /// Number of units.
    pub units: usize,
    /// Time constant tau in steps, at least 1.
    pub time_constant: f64,
    /// Whether the input projects to the group.
    #[cfg_attr(feature = "serde", serde(default = "yes"))]
    pub receives_input: bool,
    /// Whether the group projects to the mean and variance units.
    #[cfg_attr(feature = "serde", serde(default = "yes"))]
    pub drives_output: bool,
    /// Whether the group's initial state is learned for each sequence; otherwise it starts from 0.
    #[cfg_attr(feature = "serde", serde(default = "yes"))]
    pub learns_initial_state: bool,
}

#[cfg(feature = "serde")]
fn yes() -> bool {
    true
}

impl Group {
    /// A group that is connected with everything, as in an S-CTRNN.
    #[must_use]
    pub fn full(name: &str, units: usize, time_constant: f64) -> Self {
        Self {
            name: name.to_owned(),
            units,
            time_constant,
            receives_input: true,
            drives_output: true,
            learns_initial_state: true,
        }
    }

    /// The fast context of an S-MTRNN: receives input, drives the outputs, starts from 0 (2.10.1).
    #[must_use]
    pub fn fast(units: usize, time_constant: f64) -> Self {
        Self { learns_initial_state: false, ..Self::full("fast", units, time_constant) }
    }

    /// The slow context of an S-MTRNN: sees only context units, and its initial state is learned (2.10.1).
    #[must_use]
    pub fn slow(units: usize, time_constant: f64) -> Self {
        Self { receives_input: false, drives_output: false, ..Self::full("slow", units, time_constant) }
    }
}

/// What the network predicts of the next sensory state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Prediction {
    /// The mean only; learning minimises the squared error (A.22).
    Mean,
    /// Mean and variance; learning maximises the Gaussian likelihood (2.11).
    MeanAndVariance {
        /// Added to every predicted variance, in likelihood and gradient alike. The thesis has none: 0.
        floor: f64,
    },
}

/// Channels, delay, context groups and the kind of prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    channels: usize,
    delay: usize,
    groups: Vec<Group>,
    prediction: Prediction,
    linear_mean: bool,
    velocity_inputs: Option<Vec<f64>>,
    skip: Option<Skip>,
}

impl Topology {
    /// Checks and builds a topology. `delay` is xi: the input at step t is the sample of step t - xi.
    ///
    /// # Errors
    /// [`Error::Topology`] for zero channels, units or delay, a time constant below 1, a negative floor, or rules
    /// under which no unit drives the outputs.
    pub fn new(channels: usize, delay: usize, groups: Vec<Group>, prediction: Prediction) -> Result<Self> {
        let refuse = |what: String, found: String, needed| Err(Error::Topology { what, found, needed });
        if channels == 0 {
            return refuse("number of channels".into(), "0".into(), "at least 1");
        }
        if delay == 0 {
            return refuse("delay".into(), "0".into(), "at least 1 step");
        }
        if groups.is_empty() {
            return refuse("list of context groups".into(), "empty".into(), "at least one group");
        }
        for (index, group) in groups.iter().enumerate() {
            let of = |what: &str| format!("{what} of context group `{}`", group.name);
            if group.units == 0 {
                return refuse(of("number of units"), "0".into(), "at least 1");
            }
            if !(group.time_constant >= 1.0 && group.time_constant.is_finite()) {
                return refuse(of("time constant"), group.time_constant.to_string(), "a number of steps, at least 1");
            }
            if groups[..index].iter().any(|other| other.name == group.name) {
                return refuse("name of a context group".into(), format!("`{}` twice", group.name), "distinct names");
            }
        }
        if !groups.iter().any(|group| group.drives_output) {
            return refuse("drives_output".into(), "false in every group".into(), "one group that drives the outputs");
        }
        if let Prediction::MeanAndVariance { floor } = prediction
            && !(floor >= 0.0 && floor.is_finite())
        {
            return refuse("variance floor".into(), floor.to_string(), "0 or a positive number");
        }
        Ok(Self { channels, delay, groups, prediction, linear_mean: false, velocity_inputs: None, skip: None })
    }

    /// The same with mean units that are linear, instead of tanh (2.4). Predictions then have no bounds.
    #[must_use]
    pub fn with_linear_mean(mut self, linear: bool) -> Self {
        self.linear_mean = linear;
        self
    }

    /// The same with velocity inputs: beside each sample its difference to the one before, divided by `deviations`, one for each
    /// channel ([`crate::features::velocity_deviations`]).
    ///
    /// # Errors
    /// [`Error::Length`] for another number of channels, [`Error::Setting`] for a deviation that is not above 0.
    pub fn with_velocity_inputs(mut self, deviations: Vec<f64>) -> Result<Self> {
        self.fits("the list of velocities' deviations", deviations.len())?;
        positive("a velocity's deviation", &deviations)?;
        self.velocity_inputs = Some(deviations);
        Ok(self)
    }

    /// The same with a skip connection from the samples to the mean.
    ///
    /// # Errors
    /// [`Error::Length`] for another number of channels.
    pub fn with_skip(mut self, skip: Skip) -> Result<Self> {
        self.fits("the skip connection's list of scales", skip.scale().len())?;
        self.skip = Some(skip);
        Ok(self)
    }

    fn fits(&self, what: &str, found: usize) -> Result<()> {
        match found == self.channels {
            true => Ok(()),
            false => Err(Error::Length { what: what.to_owned(), found, needed: self.channels }),
        }
    }

    /// Whether the mean units are linear.
    #[must_use]
    pub fn has_linear_mean(&self) -> bool {
        self.linear_mean
    }

    /// What velocity inputs are divided by, where there are some.
    #[must_use]
    pub fn velocity_inputs(&self) -> Option<&[f64]> {
        self.velocity_inputs.as_deref()
    }

    /// The skip connection, where there is one.
    #[must_use]
    pub fn skip(&self) -> Option<&Skip> {
        self.skip.as_ref()
    }

    /// Whether it has nothing that the thesis does not have: tanh means, samples as inputs, no skip connection.
    #[must_use]
    pub fn is_of_the_thesis(&self) -> bool {
        !self.linear_mean && self.velocity_inputs.is_none() && self.skip.is_none()
    }

    /// Number of inputs, N_I: the channels, twice as many with velocity inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.channels * if self.velocity_inputs.is_some() { 2 } else { 1 }
    }

    /// An S-CTRNN without variance floor and with delay 1 (thesis 2.3).
    ///
    /// # Errors
    /// As [`Topology::new`].
    pub fn s_ctrnn(channels: usize, units: usize, time_constant: f64) -> Result<Self> {
        let groups = vec![Group::full("context", units, time_constant)];
        Self::new(channels, 1, groups, Prediction::MeanAndVariance { floor: 0.0 })
    }

    /// Channels of the samples and so of the output, N_O.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The delay xi in steps.
    #[must_use]
    pub fn delay(&self) -> usize {
        self.delay
    }

    /// The context groups in the order of their units.
    #[must_use]
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// What is predicted.
    #[must_use]
    pub fn prediction(&self) -> Prediction {
        self.prediction
    }

    /// Whether there are variance units.
    #[must_use]
    pub fn has_variance(&self) -> bool {
        matches!(self.prediction, Prediction::MeanAndVariance { .. })
    }

    /// The variance floor; 0 where there are no variance units.
    #[must_use]
    pub fn variance_floor(&self) -> f64 {
        match self.prediction {
            Prediction::Mean => 0.0,
            Prediction::MeanAndVariance { floor } => floor,
        }
    }

    /// Number of context units, N_C.
    #[must_use]
    pub fn context_units(&self) -> usize {
        self.groups.iter().map(|group| group.units).sum()
    }

    /// Number of mean units plus number of variance units: N_O, or 2 N_O with variance.
    #[must_use]
    pub fn output_units(&self) -> usize {
        self.channels * if self.has_variance() { 2 } else { 1 }
    }

    /// One value for each context unit, taken from its group.
    pub fn per_unit<'a, T: Copy + 'a>(&'a self, of: impl Fn(&Group) -> T + 'a) -> impl Iterator<Item = T> + 'a {
        self.groups.iter().flat_map(move |group| std::iter::repeat_n(of(group), group.units))
    }

    /// The time constant of each context unit.
    #[must_use]
    pub fn time_constants(&self) -> Vec<f64> {
        self.per_unit(|group| group.time_constant).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn per_unit_values_follow_the_groups() {
        let groups = vec![Group::fast(2, 5.0), Group::slow(1, 70.0)];
        let topology = Topology::new(3, 5, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
        assert_eq!(topology.time_constants(), [5.0, 5.0, 70.0]);
        assert_eq!(topology.per_unit(|group| group.receives_input).collect::<Vec<_>>(), [true, true, false]);
        assert_eq!((topology.context_units(), topology.output_units()), (3, 6));
    }

    #[test]
    fn senseless_topologies_are_refused_by_name() {
        let message = |result: Result<Topology>| result.unwrap_err().to_string();
        assert!(message(Topology::s_ctrnn(0, 3, 2.0)).contains("number of channels is 0"));
        assert!(message(Topology::s_ctrnn(1, 3, 0.5)).contains("time constant of context group `context` is 0.5"));
        let silent = vec![Group::slow(2, 10.0)];
        assert!(message(Topology::new(1, 1, silent, Prediction::Mean)).contains("drives_output"));
    }
}
