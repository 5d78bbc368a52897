//! A topology with values for its shared parameters.

use crate::parameters::Parameters;
use crate::topology::Topology;

/// What generates: everything but the initial states.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// Who is connected with whom.
    pub topology: Topology,
    /// Weights and biases.
    pub parameters: Parameters,
}
