//! The weights as the kernels want them.
//!
//! The recurrence and the outputs share one product. With z_k = [c_k; x_k] the rows
//!
//! ```text
//! context   (1/tau) (w_cx x_k + w_cc c_k + b_c)    -> drive of u_{k+1}
//! mean      w_yc c_k + b_y                         -> u of the mean units, from c_k
//! variance  w_vc c_k + b_v                         -> u of the variance units, from c_k
//! ```
//!
//! give the next drive and the prediction made from c_k at once; the transposed matrix takes both gradients back.

use aligned_vec::AVec;

use crate::engine::InstructionSet;
use crate::kernels::element::Element;
use crate::kernels::panels::{Panels, chains_for};
use crate::parameters::{Block, Gradients, Parameters};
use crate::topology::Topology;

/// Weights in panels, and the layout of the rows that they are multiplied with.
#[derive(Debug, Clone)]
pub(crate) struct Packed<E: Element = f64> {
    /// N_C.
    pub n_c: usize,
    /// N_I.
    pub n_x: usize,
    /// N_O.
    pub n_y: usize,
    /// xi.
    pub delay: usize,
    /// Mean and variance units together.
    pub n_out: usize,
    /// Rows of the joint product: context, mean, variance, padding.
    pub rows: usize,
    /// A state row holds `rows` activations, then the input, then a 1.
    pub state_stride: usize,
    /// A delta row holds the gradients of the context's and the outputs' internal states.
    pub delta_stride: usize,
    pub from_context: Panels<E>,
    pub from_input: Panels<E>,
    pub bias: AVec<E>,
    /// 1 - 1/tau for context rows, 0 for output rows.
    pub decay: AVec<E>,
    /// 1/tau for context rows, 1 for output rows.
    pub rate: AVec<f64>,
    /// Rows: context units (from); inner: context units, then outputs (to).
    pub backward: Panels<E>,
    /// The output rows alone, for loops that need the prediction before the next input.
    pub outputs: Panels<E>,
    pub output_bias: AVec<E>,
    /// Back from the context to the input. Rows: inputs.
    pub to_input: Panels<E>,
    /// The variance floor.
    pub floor: f64,
    /// Whether the mean units are linear.
    pub linear_mean: bool,
    /// Start of sums that start from nothing.
    pub zeros: AVec<E>,
    receives: Vec<bool>,
    drives: Vec<bool>,
}

fn filled<E: Element>(count: usize, value: E) -> AVec<E> {
    AVec::from_iter(64, std::iter::repeat_n(value, count))
}

impl<E: Element> Packed<E> {
    pub fn new(topology: &Topology, set: InstructionSet) -> Self {
        let (n_c, n_x, n_out) = (topology.context_units(), topology.inputs(), topology.output_units());
        let rows = E::padded(n_c + n_out);
        let mut decay = filled(rows, E::ZERO);
        let mut rate = filled(rows, 1.0);
        for (i, tau) in topology.time_constants().into_iter().enumerate() {
            decay[i] = E::from_f64(1.0 - 1.0 / tau);
            rate[i] = 1.0 / tau;
        }
        let panels = |rows, inner| Panels::zeros(rows, inner, chains_for::<E>(rows), set);
        Self {
            n_c,
            n_x,
            n_y: topology.channels(),
            delay: topology.delay(),
            n_out,
            rows,
            state_stride: E::stride(rows + n_x + 1),
            delta_stride: E::stride(rows),
            from_context: panels(rows, n_c),
            from_input: panels(rows, n_x),
            bias: filled(rows, E::ZERO),
            decay,
            rate,
            backward: panels(n_c, n_c + n_out),
            outputs: panels(n_out, n_c),
            output_bias: filled(E::padded(n_out), E::ZERO),
            to_input: panels(n_x, n_c),
            floor: topology.variance_floor(),
            linear_mean: topology.has_linear_mean(),
            zeros: filled(rows.max(E::padded(n_x)), E::ZERO),
            receives: topology.per_unit(|group| group.receives_input).collect(),
            drives: topology.per_unit(|group| group.drives_output).collect(),
        }
    }

    /// Takes over new values; allocates nothing.
    pub fn fill(&mut self, parameters: &Parameters) {
        let (n_c, n_x) = (self.n_c, self.n_x);
        let [w_cx, w_cc, b_c, w_yc, b_y, w_vc, b_v] = Block::ALL.map(|block| parameters.block(block));
        let n_y = b_y.len();
        let output = |o: usize, j: usize| if o < n_y { w_yc[o * n_c + j] } else { w_vc[(o - n_y) * n_c + j] };
        let rate = &self.rate;
        self.from_context.fill(n_c + self.n_out, |row, k| match row.checked_sub(n_c) {
            None => rate[row] * w_cc[row * n_c + k],
            Some(o) => output(o, k),
        });
        self.from_input.fill(n_c, |row, k| rate[row] * w_cx[row * n_x + k]);
        self.backward.fill(n_c, |row, k| match k.checked_sub(n_c) {
            None => rate[k] * w_cc[k * n_c + row],
            Some(o) => output(o, row),
        });
        self.outputs.fill(self.n_out, output);
        self.to_input.fill(n_x, |i, k| rate[k] * w_cx[k * n_x + i]);
        for (i, b) in b_c.iter().enumerate() {
            self.bias[i] = E::from_f64(self.rate[i] * b);
        }
        for (o, b) in b_y.iter().chain(b_v).enumerate() {
            self.bias[n_c + o] = E::from_f64(*b);
            self.output_bias[o] = E::from_f64(*b);
        }
    }

    /// Length of an accumulated gradient: `rows` values for each context unit, each input and the constant.
    pub fn gradient_len(&self) -> usize {
        (self.n_c + self.n_x + 1) * self.rows
    }

    /// Where the rows of the inputs and the constant begin in an accumulated gradient.
    pub fn gradient_split(&self) -> usize {
        self.n_c * self.rows
    }

    /// Brings an accumulated gradient into the blocks of (2.20) and (2.21).
    pub fn unpack_gradient(&self, accumulated: &[f64], gradients: &mut Gradients) {
        let (n_c, n_x, rows) = (self.n_c, self.n_x, self.rows);
        let at = |k: usize, row: usize| accumulated[k * rows + row] * self.rate[row];
        for (i, out) in gradients.block_mut(Block::ContextFromInput).chunks_exact_mut(n_x).enumerate() {
            for (j, out) in out.iter_mut().enumerate() {
                *out = if self.receives[i] { at(n_c + j, i) } else { 0.0 };
            }
        }
        for (i, out) in gradients.block_mut(Block::ContextFromContext).chunks_exact_mut(n_c).enumerate() {
            for (j, out) in out.iter_mut().enumerate() {
                *out = at(j, i);
            }
        }
        let mut row = 0;
        let pairs = [
            (Block::ContextBias, None),
            (Block::MeanBias, Some(Block::MeanFromContext)),
            (Block::VarianceBias, Some(Block::VarianceFromContext)),
        ];
        for (bias, weights) in pairs {
            let first = row;
            for out in gradients.block_mut(bias) {
                *out = at(n_c + n_x, row);
                row += 1;
            }
            let Some(weights) = weights else { continue };
            for (o, out) in gradients.block_mut(weights).chunks_exact_mut(n_c).enumerate() {
                for (j, out) in out.iter_mut().enumerate() {
                    *out = if self.drives[j] { at(j, first + o) } else { 0.0 };
                }
            }
        }
    }
}
