//! The non-centred parametrisation of initial states, which no prior makes stiff.
//!
//! ```text
//! u_0 = mean + s z,   s = min(sigma_IS, 1)
//! d ln L_all / dz = s d ln L_out / du_0 - (s / sigma_IS)^2 z
//! ```
//!
//! Moving the mean moves all u_0 with it, so that its gradient has no prior term. Units whose initial states are not learned
//! have z = 0. (Recognition, which does not know learning, has its own, in the same form.)

use crate::initial_states::InitialStates;
use crate::topology::Topology;

/// The scale of z, and which units have one.
#[derive(Debug, Clone)]
pub(super) struct NonCentred {
    s: f64,
    /// (s / sigma_IS)^2.
    pull: f64,
    learns: Vec<bool>,
}

impl NonCentred {
    /// Those of a prior with `variance`, sigma_IS^2.
    pub fn new(topology: &Topology, variance: f64) -> Self {
        let s = variance.sqrt().min(1.0);
        let learns = topology.per_unit(|group| group.learns_initial_state).collect();
        // Where all share one state, z is 0 and stays so.
        Self { s, pull: if variance > 0.0 { s * s / variance } else { 1.0 }, learns }
    }

    /// (s / sigma_IS)^2: ln L_init is -z^2 / 2 times that, but for a constant.
    pub fn pull(&self) -> f64 {
        self.pull
    }

    /// z of all sequences, [sequence][unit].
    pub fn read(&self, states: &InitialStates, z: &mut [f64]) {
        let units = self.learns.len();
        for (z, u0) in z.chunks_exact_mut(units).zip(states.values().chunks_exact(units)) {
            for (i, (z, u0)) in z.iter_mut().zip(u0).enumerate() {
                *z = if self.learns[i] && self.s > 0.0 { (u0 - states.mean()[i]) / self.s } else { 0.0 };
            }
        }
    }

    /// u_0 of all sequences from `z`, [sequence][unit], and the mean that `states` has.
    pub fn write(&self, z: &[f64], states: &mut InitialStates) {
        for (sequence, z) in z.chunks_exact(self.learns.len()).enumerate() {
            self.write_one(z, sequence, states);
        }
    }

    /// The same for one sequence, from its own z.
    pub fn write_one(&self, z: &[f64], sequence: usize, states: &mut InitialStates) {
        for (i, z) in z.iter().enumerate() {
            if self.learns[i] {
                states.sequence_mut(sequence)[i] = states.mean()[i] + self.s * z;
            }
        }
    }

    /// d ln L_all / dz of `unit`, where `gradient` is d ln L_out / du_0.
    pub fn slope(&self, unit: usize, gradient: f64, z: f64) -> f64 {
        if self.learns[unit] { self.s * gradient - self.pull * z } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Group, Prediction};

    #[test]
    fn states_come_back_from_z_and_follow_the_mean() {
        let groups = vec![Group::full("context", 2, 2.0), Group::fast(1, 2.0)];
        let topology = Topology::new(1, 1, groups, Prediction::Mean).unwrap();
        for (variance, s) in [(0.25, 0.5), (100.0, 1.0)] {
            let coordinates = NonCentred::new(&topology, variance);
            let mut states = InitialStates::zeros(&topology, 2);
            states.values_mut().copy_from_slice(&[0.5, -1.0, 0.0, 0.25, 2.0, 0.0]);
            states.mean_mut().copy_from_slice(&[0.25, 0.5, 0.0]);
            let mut z = [9.0; 6];
            coordinates.read(&states, &mut z);
            assert_eq!(z, [0.25 / s, -1.5 / s, 0.0, 0.0, 1.5 / s, 0.0]);
            let before = states.clone();
            coordinates.write(&z, &mut states);
            assert_eq!(states, before);
            states.mean_mut()[0] += 1.0;
            coordinates.write(&z, &mut states);
            assert_eq!(states.values(), [1.5, -1.0, 0.0, 1.25, 2.0, 0.0]);
            assert_eq!(coordinates.slope(0, 3.0, 2.0), s * 3.0 - s * s / variance * 2.0);
            assert_eq!(coordinates.slope(2, 3.0, 2.0), 0.0);
        }
    }
}
