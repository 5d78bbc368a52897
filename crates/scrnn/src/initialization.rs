//! Random starting values (thesis 2.7).
//!
//! Weights from the input are uniform in `[-1/N_I, 1/N_I]`, all other weights in `[-1/N_C, 1/N_C]`, biases in [-1, 1]; every
//! initial state starts from 0 and the mean of a learned one from a uniform value in `[-1/N_C, 1/N_C]`.

use rand::RngExt;

use crate::initial_states::InitialStates;
use crate::network::Network;
use crate::parameters::{Block, Parameters};
use crate::streams::{Purpose, stream};
use crate::topology::Topology;

/// A network and the initial states of `sequences` sequences before learning.
#[must_use]
pub fn initialize(topology: &Topology, sequences: usize, seed: u64) -> (Network, InitialStates) {
    let mut random = stream(seed, Purpose::InitialWeights, 0);
    let mut uniform = |bound: f64| bound * (2.0 * random.random::<f64>() - 1.0);
    let (n_x, n_c) = (topology.inputs(), topology.context_units());
    let from_input = 1.0 / n_x as f64;
    let from_context = 1.0 / n_c as f64;

    let receives: Vec<bool> = topology.per_unit(|group| group.receives_input).collect();
    let drives: Vec<bool> = topology.per_unit(|group| group.drives_output).collect();
    let mut parameters = Parameters::zeros(topology);
    for block in Block::ALL {
        let bound = match block {
            Block::ContextFromInput => from_input,
            Block::ContextFromContext | Block::MeanFromContext | Block::VarianceFromContext => from_context,
            Block::ContextBias | Block::MeanBias | Block::VarianceBias => 1.0,
        };
        for (index, value) in parameters.block_mut(block).iter_mut().enumerate() {
            let exists = match block {
                Block::ContextFromInput => receives[index / n_x],
                Block::MeanFromContext | Block::VarianceFromContext => drives[index % n_c],
                _ => true,
            };
            if exists {
                *value = uniform(bound);
            }
        }
    }

    let mut initial_states = InitialStates::zeros(topology, sequences);
    let learned = topology.per_unit(|group| group.learns_initial_state);
    for (mean, learned) in initial_states.mean_mut().iter_mut().zip(learned) {
        if learned {
            *mean = uniform(from_context);
        }
    }
    (Network { topology: topology.clone(), parameters }, initial_states)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Group, Prediction};

    #[test]
    fn values_lie_in_their_intervals_and_missing_weights_are_zero() {
        let groups = vec![Group::fast(6, 5.0), Group::slow(4, 70.0)];
        let topology = Topology::new(2, 1, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
        let (network, states) = initialize(&topology, 3, 7);
        let largest = |block| network.parameters.block(block).iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        assert!((0.3..=0.5).contains(&largest(Block::ContextFromInput)));
        assert!((0.08..=0.1).contains(&largest(Block::ContextFromContext)));
        assert!((0.4..=1.0).contains(&largest(Block::ContextBias)));
        assert!(network.parameters.block(Block::ContextFromInput)[12..].iter().all(|&w| w == 0.0));
        assert!(network.parameters.block(Block::MeanFromContext)[6..10].iter().all(|&w| w == 0.0));
        assert!(states.values().iter().all(|&u| u == 0.0));
        assert!(states.mean()[..6].iter().all(|&u| u == 0.0) && states.mean()[6..].iter().all(|&u| u != 0.0));
        assert_eq!(initialize(&topology, 3, 7), (network.clone(), states));
        assert_ne!(initialize(&topology, 3, 8).0, network);
    }
}
