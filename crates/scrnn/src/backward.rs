//! Back-propagation through time (thesis 2.6.3, appendix B.1).
//!
//! ```text
//! d/du_t,i = (1 - c_t,i^2) ( sum_k (w_cc[k,i] / tau_k) d/du_{t+1,k} + sum_o w_oc[o,i] d/du_t,o )
//!            + (1 - 1/tau_i) d/du_{t+1,i}                                                    (2.22), context
//! d/dw_ij  = (1/tau_i) sum_t d/du_t,i x_t,j   or   c_{t-1,j}                                 (2.20), context
//! d/dw_ij  = sum_t d/du_t,i c_t,j                                                            (2.20), outputs
//! d/db_i   = the same with 1 in place of the sender                                          (2.21)
//! ```
//!
//! A delta row k holds d/du_{k+1} of the context and d/du of the outputs made from c_k: the joint product of
//! [`crate::packed`] read backwards. Its outer product with the state row k is the whole gradient of that step.

use pulp::Simd;

use crate::batch::Block;
use crate::kernels::element::Element;
use crate::kernels::outer::{Rows, Taken, accumulate};
use crate::kernels::panels::{Columns, End, Product, Way, multiply_into};
use crate::packed::Packed;
use crate::trajectory::Trajectory;

/// What a product back may know of those around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pass<'a, E = f64> {
    /// Whether it is an odd one: even and odd ones walk the weights in opposite directions.
    pub is_odd: bool,
    /// The states of the one before it, if they have left the cache.
    pub ahead: &'a [E],
}

impl<E> Default for Pass<'_, E> {
    fn default() -> Self {
        Self { is_odd: false, ahead: &[] }
    }
}

/// One product back, for `columns` columns (2.22): `after` holds their delta rows, `states` the contexts that they were made from.
/// Leaves d/du of these contexts in the delta rows `before`; their outputs' places hold nothing of use.
#[inline(always)]
pub(crate) fn retreat<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    after: &[E],
    states: &[E],
    before: &mut [E],
    columns: usize,
    Pass { is_odd, ahead }: Pass<'_, E>,
) {
    let after = Columns { values: after, stride: packed.delta_stride };
    let c = Columns { values: states, stride: packed.state_stride };
    let product = Product { matrices: [&packed.backward], sources: [after], columns, start: &packed.zeros, ahead };
    let way = Way { backwards: is_odd, end: End::Slope { keep: &packed.decay, c, after } };
    multiply_into(simd, product, way, before);
}

/// Goes back through the products of `range`, a segment of the span that starts at `span_start` and has these `states`. The delta row
/// behind the segment's last product must hold d/du of the step after it; afterwards, row 0 holds d/du of the segment's start.
#[inline(always)]
pub(crate) fn run<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    block: &Block,
    range: std::ops::Range<usize>,
    span_start: usize,
    states: &[E],
    trajectory: &mut Trajectory<E>,
) {
    let (n, n_y, n_c) = (block.columns(), packed.n_y, packed.n_c);
    let (state_stride, delta_stride) = (packed.state_stride, packed.delta_stride);
    let first = range.start;
    for k in range.rev() {
        let active = block.active(k);
        let later = block.active(k + 1);
        let at = (k - first) * n * delta_stride;
        let (before, after) = trajectory.deltas[at..at + 2 * n * delta_stride].split_at_mut(n * delta_stride);
        for column in 0..active {
            let delta = &mut after[column * delta_stride..][..n_c + packed.n_out];
            if column >= later {
                delta[..n_c].fill(E::ZERO);
            }
            let outputs = &mut delta[n_c..];
            if k == 0 {
                outputs.fill(E::ZERO);
            } else {
                let step = ((k - 1) * n + column) * n_y;
                E::take(&mut outputs[..n_y], &trajectory.mean[step..step + n_y]);
                if packed.n_out > n_y {
                    E::take(&mut outputs[n_y..], &trajectory.variance[step..step + n_y]);
                }
            }
        }
        let at = (k - span_start) * n * state_stride;
        let own = &states[at..at + n * state_stride];
        // The states of the step before: they were written long ago, and left the cache since.
        let ahead = &states[at - (n * state_stride).min(at)..at];
        retreat(simd, packed, after, own, before, active, Pass { is_odd: k % 2 == 1, ahead });
    }
}

/// Adds the outer products of a segment to the gradient of [`Packed::gradient_len`] values: between two ends of columns all
/// steps at once.
#[inline(always)]
pub(crate) fn gather<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    block: &Block,
    range: std::ops::Range<usize>,
    span_start: usize,
    (deltas, states): (&[E], &[E]),
    gradient: &mut [E],
) {
    let n = block.columns();
    let (context, input) = gradient.split_at_mut(packed.gradient_split());
    for (part, active) in block.stretches(range.clone()) {
        let taken = match active == n {
            true => Taken::from(part.len() * n),
            false => Taken { groups: part.len(), width: active, period: n },
        };
        let deltas = &deltas[(part.start - range.start + 1) * n * packed.delta_stride..];
        let states = &states[(part.start - span_start) * n * packed.state_stride..];
        let deltas = Rows { values: deltas, stride: packed.delta_stride };
        let states = Rows { values: states, stride: packed.state_stride };
        accumulate(simd, deltas, states, taken, packed.rows, (0, packed.n_c), context);
        let inputs = (packed.rows, packed.rows + packed.n_x + 1);
        accumulate(simd, deltas, states, taken, packed.rows, inputs, input);
    }
}
