//! The shared parameters theta_share: weights and biases, in blocks of a fixed order (thesis 2.6.2).
//!
//! All blocks lie in one flat list so that an optimiser sees one vector. Weights read "to from": row = receiving unit,
//! column = sending unit, row-major. Weights that the topology does not have (e.g. input to slow units) are kept as
//! zeros, and their gradients are zero.

use std::ops::Range;

use crate::topology::Topology;

/// A block of shared parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Block {
    /// `w_cx`, `[N_C, N_I]`.
    ContextFromInput,
    /// `w_cc`, `[N_C, N_C]`.
    ContextFromContext,
    /// `b_c`, `[N_C]`.
    ContextBias,
    /// `w_yc`, `[N_O, N_C]`.
    MeanFromContext,
    /// `b_y`, `[N_O]`.
    MeanBias,
    /// `w_vc`, `[N_O, N_C]`; empty without variance units.
    VarianceFromContext,
    /// `b_v`, `[N_O]`; empty without variance units.
    VarianceBias,
}

impl Block {
    /// Every block, in storage order.
    pub const ALL: [Self; 7] = [
        Self::ContextFromInput,
        Self::ContextFromContext,
        Self::ContextBias,
        Self::MeanFromContext,
        Self::MeanBias,
        Self::VarianceFromContext,
        Self::VarianceBias,
    ];

    /// Whether it holds biases.
    #[must_use]
    pub const fn is_bias(self) -> bool {
        matches!(self, Self::ContextBias | Self::MeanBias | Self::VarianceBias)
    }

    /// The block's public name, as in a checkpoint.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ContextFromInput => "context_from_input",
            Self::ContextFromContext => "context_from_context",
            Self::ContextBias => "context_bias",
            Self::MeanFromContext => "mean_from_context",
            Self::MeanBias => "mean_bias",
            Self::VarianceFromContext => "variance_from_context",
            Self::VarianceBias => "variance_bias",
        }
    }

    /// Rows and columns; a bias has one column.
    fn size(self, topology: &Topology) -> (usize, usize) {
        let (n_c, n_o) = (topology.context_units(), topology.channels());
        let n_v = if topology.has_variance() { n_o } else { 0 };
        match self {
            Self::ContextFromInput => (n_c, topology.inputs()),
            Self::ContextFromContext => (n_c, n_c),
            Self::ContextBias => (n_c, 1),
            Self::MeanFromContext => (n_o, n_c),
            Self::MeanBias => (n_o, 1),
            Self::VarianceFromContext => (n_v, n_c),
            Self::VarianceBias => (n_v, 1),
        }
    }

    /// The block's shape as a tensor: `[rows, columns]` for weights, `[rows]` for biases.
    #[must_use]
    pub fn shape(self, topology: &Topology) -> Vec<usize> {
        let (rows, columns) = self.size(topology);
        match self {
            Self::ContextBias | Self::MeanBias | Self::VarianceBias => vec![rows],
            _ => vec![rows, columns],
        }
    }

    /// Where the block lies in the flat list.
    #[must_use]
    pub fn range(self, topology: &Topology) -> Range<usize> {
        let mut start = 0;
        for block in Self::ALL {
            let (rows, columns) = block.size(topology);
            if block == self {
                return start..start + rows * columns;
            }
            start += rows * columns;
        }
        unreachable!("ALL lists every block")
    }
}

/// Values of all shared parameters, or of anything of their shape: gradients, velocities, moments.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    values: Vec<f64>,
    ranges: [Range<usize>; 7],
}

impl Parameters {
    /// All zeros.
    #[must_use]
    pub fn zeros(topology: &Topology) -> Self {
        let ranges = Block::ALL.map(|block| block.range(topology));
        Self { values: vec![0.0; ranges[6].end], ranges }
    }

    /// How many values there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none, which no topology allows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Whether the blocks are as large as those of `other`.
    #[must_use]
    pub fn has_the_shape_of(&self, other: &Self) -> bool {
        self.ranges == other.ranges
    }

    /// All blocks as one list.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.values
    }

    /// All blocks as one list, to change.
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// One block, row-major.
    #[must_use]
    pub fn block(&self, block: Block) -> &[f64] {
        &self.values[self.ranges[block as usize].clone()]
    }

    /// One block, row-major, to change.
    pub fn block_mut(&mut self, block: Block) -> &mut [f64] {
        &mut self.values[self.ranges[block as usize].clone()]
    }

    /// The block that holds the value at `index` of the flat list.
    #[must_use]
    pub fn block_at(&self, index: usize) -> Option<Block> {
        Block::ALL.into_iter().find(|&block| self.ranges[block as usize].contains(&index))
    }
}

/// d ln L_out / d theta_share, in the shape of the parameters: always the direction of ascent.
pub type Gradients = Parameters;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_tile_the_flat_list() {
        let topology = Topology::s_ctrnn(2, 5, 2.0).unwrap();
        let parameters = Parameters::zeros(&topology);
        let mut end = 0;
        for block in Block::ALL {
            let range = block.range(&topology);
            assert_eq!(range.start, end);
            assert_eq!(range.len(), block.shape(&topology).iter().product::<usize>());
            end = range.end;
        }
        assert_eq!(end, parameters.as_slice().len());
        assert_eq!(parameters.block_at(10), Some(Block::ContextFromContext));
    }
}
