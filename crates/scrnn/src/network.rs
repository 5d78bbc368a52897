//! A topology with values for its shared parameters.

use crate::error::{Error, Result};
use crate::parameters::{Block, Parameters};
use crate::topology::Topology;

/// What generates: everything but the initial states. Its parameters have the shape that its topology asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    pub(crate) topology: Topology,
    pub(crate) parameters: Parameters,
}

impl Network {
    /// Puts a topology and its parameters together.
    ///
    /// # Errors
    /// [`Error::Length`] if these are the parameters of another topology.
    pub fn new(topology: Topology, parameters: Parameters) -> Result<Self> {
        let fitting = Parameters::zeros(&topology);
        if !parameters.has_the_shape_of(&fitting) {
            let what = "the network's list of parameters".to_owned();
            return Err(Error::Length { what, found: parameters.len(), needed: fitting.len() });
        }
        Ok(Self { topology, parameters })
    }

    /// Who is connected with whom.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Weights and biases.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Weights and biases, to change. Their number stays.
    pub fn parameters_mut(&mut self) -> &mut [f64] {
        self.parameters.as_mut_slice()
    }

    /// One block of weights or biases, row-major, to change.
    pub fn block_mut(&mut self, block: Block) -> &mut [f64] {
        self.parameters.block_mut(block)
    }

    /// Topology and parameters, apart.
    #[must_use]
    pub fn into_parts(self) -> (Topology, Parameters) {
        (self.topology, self.parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Group, Prediction};

    #[test]
    fn parameters_of_another_topology_make_no_network() {
        let topology = |units| Topology::s_ctrnn(2, units, 2.0).unwrap();
        let error = Network::new(topology(3), Parameters::zeros(&topology(4))).unwrap_err();
        assert!(error.to_string().starts_with("the network's list of parameters holds"), "{error}");
        assert!(Network::new(topology(3), Parameters::zeros(&topology(3))).is_ok());
        // Two groups of as many units have other blocks.
        let groups = vec![Group::full("a", 1, 2.0), Group::full("b", 2, 2.0)];
        let two = Topology::new(2, 1, groups, Prediction::Mean).unwrap();
        assert!(Network::new(two, Parameters::zeros(&topology(3))).is_err());
    }
}
