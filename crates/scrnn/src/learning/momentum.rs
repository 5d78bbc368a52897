//! Gradient ascent with momentum (thesis 2.6.2, 2.7).
//!
//! ```text
//! theta_n = theta_{n-1} + alpha Delta_n                              (2.17)
//! Delta_n = d ln L / d theta + eta Delta_{n-1},  Delta_0 = 0         (2.18), (2.19)
//! ```
//!
//! The prior of the initial states is stiff where its variance is small. Its implicit step takes u* = u_0 + alpha Delta
//! of ln L_out alone and solves, for each unit, with kappa = alpha / ((1 - eta) var_IS),
//!
//! ```text
//! u_0^(s) = u*^(s) - kappa (u_0^(s) - u),   u = u_before + kappa sum_s (u_0^(s) - u)
//! ```
//!
//! for the u_0 and the mean u where the step ends. The fixed point is that of (2.23) and (2.24): momentum lengthens the
//! steps along ln L_out by 1 / (1 - eta), and kappa does the same for the prior.

use super::plan::{Momentum, PriorStep};
use super::state::Fields;
use crate::initial_states::InitialStates;
use crate::parameters::{Gradients, Parameters};
use crate::topology::Topology;

/// What the rule remembers.
#[derive(Debug, Clone)]
pub(super) struct MomentumRule {
    pub options: Momentum,
    shared: Vec<f64>,
    initial: Vec<f64>,
    mean: Vec<f64>,
    /// The factor of the adaptive rate; 1 otherwise.
    pub factor: f64,
    /// The guard's factor; 1 unless the training became unstable.
    pub guarded: f64,
    /// d ln L_all / d u_0 and of the mean, where the prior acts as printed.
    gradient: Option<InitialStates>,
    learns: Vec<bool>,
    /// alpha_share and alpha_init for a factor of 1.
    rates: (f64, f64),
    variance: f64,
}

impl MomentumRule {
    pub fn new(options: Momentum, topology: &Topology, states: &InitialStates, terms: f64, variance: f64) -> Self {
        let n_o = topology.channels() as f64;
        Self {
            rates: (options.rate / terms, options.rate / n_o),
            gradient: (options.prior == PriorStep::Thesis).then(|| InitialStates::zeros(topology, states.sequences())),
            options,
            shared: vec![0.0; Parameters::zeros(topology).as_slice().len()],
            initial: vec![0.0; states.values().len()],
            mean: vec![0.0; states.mean().len()],
            factor: 1.0,
            guarded: 1.0,
            learns: topology.per_unit(|group| group.learns_initial_state).collect(),
            variance,
        }
    }

    /// alpha_share, alpha_init.
    pub fn rates(&self) -> (f64, f64) {
        let factor = self.factor * self.guarded;
        (self.rates.0 * factor, self.rates.1 * factor)
    }

    /// Delta_n from the gradients of ln L_out at `states`.
    pub fn accumulate(&mut self, topology: &Topology, gradients: &Gradients, initial: &[f64], states: &InitialStates) {
        let eta = self.options.momentum;
        for (delta, g) in self.shared.iter_mut().zip(gradients.as_slice()) {
            *delta = g + eta * *delta;
        }
        let Some(gradient) = &mut self.gradient else {
            for (delta, g) in self.initial.iter_mut().zip(initial) {
                *delta = g + eta * *delta;
            }
            return;
        };
        gradient.values_mut().copy_from_slice(initial);
        states.add_prior_gradient(topology, self.variance, gradient);
        for (delta, g) in self.initial.iter_mut().zip(gradient.values()) {
            *delta = g + eta * *delta;
        }
        for (delta, g) in self.mean.iter_mut().zip(gradient.mean()) {
            *delta = g + eta * *delta;
        }
    }

    /// theta_n from theta_{n-1}, in place.
    pub fn apply(&self, parameters: &mut Parameters, states: &mut InitialStates) {
        let (alpha_share, alpha_init) = self.rates();
        for (theta, delta) in parameters.as_mut_slice().iter_mut().zip(&self.shared) {
            *theta += alpha_share * delta;
        }
        for (u0, delta) in states.values_mut().iter_mut().zip(&self.initial) {
            *u0 += alpha_init * delta;
        }
        match self.options.prior {
            PriorStep::Implicit => {
                let kappa = alpha_init / ((1.0 - self.options.momentum) * self.variance);
                prior_step(states, kappa, &self.learns);
            }
            PriorStep::Thesis => {
                for (mean, delta) in states.mean_mut().iter_mut().zip(&self.mean) {
                    *mean += alpha_init * delta;
                }
            }
        }
    }

    /// Takes over what another rule of the same training remembers; allocates nothing.
    pub fn copy_from(&mut self, other: &Self) {
        self.shared.copy_from_slice(&other.shared);
        self.initial.copy_from_slice(&other.initial);
        self.mean.copy_from_slice(&other.mean);
        self.factor = other.factor;
        self.guarded = other.guarded;
    }

    /// What has to be kept to go on.
    pub fn fields(&mut self) -> Fields<'_> {
        let (parameters, units) = (self.shared.len(), self.mean.len());
        let sequences = self.initial.len() / units;
        Fields {
            tensors: vec![
                ("velocity.shared", vec![parameters], &mut self.shared),
                ("velocity.initial_state", vec![sequences, units], &mut self.initial),
                ("velocity.initial_state_mean", vec![units], &mut self.mean),
            ],
            numbers: vec![("rate_factor", &mut self.factor)],
        }
    }
}

/// The prior's implicit step for all units.
fn prior_step(states: &mut InitialStates, kappa: f64, learns: &[bool]) {
    let (sequences, units) = (states.sequences(), learns.len());
    let shrink = kappa / (1.0 + kappa);
    for i in (0..units).filter(|&i| learns[i]) {
        let sum: f64 = (0..sequences).map(|s| states.values()[s * units + i]).sum();
        let mean = (states.mean()[i] + shrink * sum) / (1.0 + shrink * sequences as f64);
        states.mean_mut()[i] = mean;
        for s in 0..sequences {
            let u0 = &mut states.values_mut()[s * units + i];
            *u0 = (*u0 + kappa * mean) / (1.0 + kappa);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_prior_steps_end_at_the_maximum_of_the_joint_likelihood() {
        // With ln L_out = -sum_s (u_s - a_s)^2 / 2 the maximum is mean = average of a, u = (var a + mean) / (var + 1).
        let (a, variance) = ([0.4, -1.0, 2.0], 0.5);
        let topology = Topology::s_ctrnn(1, 1, 2.0).unwrap();
        let gradients = Parameters::zeros(&topology);
        for prior in [PriorStep::Implicit, PriorStep::Thesis] {
            let mut states = InitialStates::zeros(&topology, 3);
            let mut parameters = Parameters::zeros(&topology);
            let options = Momentum { rate: 0.01, prior, ..Momentum::default() };
            let mut rule = MomentumRule::new(options, &topology, &states, 10.0, variance);
            for _ in 0..3000 {
                let g: Vec<f64> = a.iter().zip(states.values()).map(|(a, u)| a - u).collect();
                rule.accumulate(&topology, &gradients, &g, &states);
                rule.apply(&mut parameters, &mut states);
            }
            let mean = a.iter().sum::<f64>() / 3.0;
            assert!((states.mean()[0] - mean).abs() < 1e-9, "{prior:?}: {}", states.mean()[0]);
            for (u, a) in states.values().iter().zip(a) {
                assert!((u - (variance * a + mean) / (variance + 1.0)).abs() < 1e-9, "{prior:?}: {u}");
            }
        }
    }

    #[test]
    fn the_implicit_step_solves_its_equations() {
        let topology = Topology::s_ctrnn(1, 1, 2.0).unwrap();
        for kappa in [1e-9, 0.3, 7.0, 1e6] {
            let mut states = InitialStates::zeros(&topology, 3);
            let start = [0.4, -1.0, 2.0];
            states.values_mut().copy_from_slice(&start);
            states.mean_mut()[0] = 0.1;
            prior_step(&mut states, kappa, &[true]);
            let mean = states.mean()[0];
            let pulls: Vec<f64> = states.values().iter().map(|u| kappa * (u - mean)).collect();
            for s in 0..3 {
                assert!((states.values()[s] - (start[s] - pulls[s])).abs() < 1e-9);
            }
            assert!((mean - (0.1 + pulls.iter().sum::<f64>())).abs() < 1e-9);
        }
    }
}
