//! Initial internal states u_0 of each sequence and their mean (thesis 2.6.1).
//!
//! ```text
//! ln L_init = sum_s sum_i ( -ln(2 pi var_IS) / 2 - (u_0,i^(s) - u_i)^2 / (2 var_IS) )    (2.16)
//! ```
//!
//! The sums run over units whose group learns its initial state; all others start from 0 and stay there.

use crate::error::{Error, Result};
use crate::topology::Topology;

/// u_0 for every sequence, and the mean u.
#[derive(Debug, Clone, PartialEq)]
pub struct InitialStates {
    units: usize,
    values: Vec<f64>,
    mean: Vec<f64>,
}

impl InitialStates {
    /// All zeros, for `sequences` sequences.
    #[must_use]
    pub fn zeros(topology: &Topology, sequences: usize) -> Self {
        let units = topology.context_units();
        Self { units, values: vec![0.0; sequences * units], mean: vec![0.0; units] }
    }

    /// Given values: u_0 of all sequences, row-major `[S, N_C]`, and their mean.
    ///
    /// # Errors
    /// [`Error::Length`] if they do not fit the topology's context units.
    pub fn new(topology: &Topology, values: Vec<f64>, mean: Vec<f64>) -> Result<Self> {
        let units = topology.context_units();
        if !values.len().is_multiple_of(units) {
            let needed = values.len().next_multiple_of(units);
            return Err(Error::Length { what: "the list of initial states".to_owned(), found: values.len(), needed });
        }
        let states = Self { units, values, mean };
        states.check_for(topology)?;
        Ok(states)
    }

    /// Checks that these are states of a network of this topology.
    ///
    /// # Errors
    /// [`Error::Length`] for another number of context units.
    pub fn check_for(&self, topology: &Topology) -> Result<()> {
        let needed = topology.context_units();
        for (what, found) in [("an initial state", self.units), ("the mean of the initial states", self.mean.len())] {
            if found != needed {
                return Err(Error::Length { what: what.to_owned(), found, needed });
            }
        }
        Ok(())
    }

    /// Number of sequences.
    #[must_use]
    pub fn sequences(&self) -> usize {
        self.values.len() / self.units
    }

    /// u_0 of sequence `s`, N_C values. A sequence that is not there panics, as in a slice.
    #[must_use]
    pub fn sequence(&self, s: usize) -> &[f64] {
        &self.values[s * self.units..(s + 1) * self.units]
    }

    /// u_0 of sequence `s`, to change. Panics as [`InitialStates::sequence`].
    pub fn sequence_mut(&mut self, s: usize) -> &mut [f64] {
        &mut self.values[s * self.units..(s + 1) * self.units]
    }

    /// u_0 of all sequences, row-major `[S, N_C]`.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// u_0 of all sequences, to change.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The mean u, N_C values.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The mean u, to change.
    pub fn mean_mut(&mut self) -> &mut [f64] {
        &mut self.mean
    }

    /// Sets all learned states to their mean, as where the prior has no variance.
    pub fn share(&mut self, topology: &Topology) {
        let learns: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
        for u0 in self.values.chunks_exact_mut(self.units) {
            let own = u0.iter_mut().zip(&self.mean).zip(&learns);
            own.filter(|(_, learns)| **learns).for_each(|((u0, mean), _)| *u0 = *mean);
        }
    }

    /// ln L_init of (2.16) in nats, constant included; 0 where the variance is 0 and all states are their mean.
    #[must_use]
    pub fn ln_prior(&self, topology: &Topology, variance: f64) -> f64 {
        let states = self.values.chunks_exact(self.units);
        states.fold(0.0, |sum, u0| add_ln_prior(sum, topology, variance, u0, &self.mean))
    }

    /// Adds the prior's part of the gradient to `states`, and writes the mean's gradient into `mean`:
    ///
    /// ```text
    /// d ln L_all / d u_0,i^(s) = d ln L_out / d u_0,i^(s) - (u_0,i^(s) - u_i) / var_IS    (2.23)
    /// d ln L_all / d u_i       = sum_s (u_0,i^(s) - u_i) / var_IS                          (2.24)
    /// ```
    pub fn add_prior_gradient(&self, topology: &Topology, variance: f64, gradient: &mut InitialStates) {
        gradient.mean.fill(0.0);
        for (i, learned) in topology.per_unit(|group| group.learns_initial_state).enumerate() {
            if !learned {
                continue;
            }
            for s in 0..self.sequences() {
                let pull = (self.values[s * self.units + i] - self.mean[i]) / variance;
                gradient.values[s * self.units + i] -= pull;
                gradient.mean[i] += pull;
            }
        }
    }
}

/// Adds ln L_init of one sequence (2.16) to `sum`, unit after unit.
pub(crate) fn add_ln_prior(mut sum: f64, topology: &Topology, variance: f64, u0: &[f64], mean: &[f64]) -> f64 {
    if variance == 0.0 {
        return sum;
    }
    let constant = -0.5 * (2.0 * std::f64::consts::PI * variance).ln();
    let learned = topology.per_unit(|group| group.learns_initial_state);
    for ((&u0, &mean), learned) in u0.iter().zip(mean).zip(learned) {
        if learned {
            sum += constant - (u0 - mean).powi(2) / (2.0 * variance);
        }
    }
    sum
}
