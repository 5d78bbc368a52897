//! Step by step: for loops that need each prediction before they know the next input.
//!
//! Columns are independent copies of the network. The context's product and the outputs' product are taken apart, since
//! the next input may be made from the outputs (2.25b).

use aligned_vec::AVec;
use pulp::Simd;

use crate::forward::activate;
use crate::kernels::activation::{exp, tanh_rows};
use crate::kernels::padded;
use crate::kernels::panels::{Columns, End, Product, Way, multiply, multiply_into};
use crate::packed::Packed;

/// Copies of one network at one moment.
#[derive(Debug)]
pub(crate) struct Stepper {
    columns: usize,
    /// [column][state_stride]: c, then x.
    states: AVec<f64>,
    /// [column][rows].
    internal: AVec<f64>,
    /// [column][padded outputs]: u of the mean and variance units, and what becomes of them.
    outputs: AVec<f64>,
    mean: AVec<f64>,
    variance: AVec<f64>,
}

impl Stepper {
    pub fn new(packed: &Packed, columns: usize) -> Self {
        let zeros = |count: usize| AVec::from_iter(64, std::iter::repeat_n(0.0, count));
        let outputs = columns * padded(packed.n_out);
        Self {
            columns,
            states: zeros(columns * packed.state_stride),
            internal: zeros(columns * packed.rows),
            outputs: zeros(outputs),
            mean: zeros(outputs),
            variance: zeros(outputs),
        }
    }

    /// Starts a column from an initial state.
    pub fn start(&mut self, packed: &Packed, column: usize, u0: &[f64]) {
        let u = &mut self.internal[column * packed.rows..(column + 1) * packed.rows];
        u.fill(0.0);
        u[..packed.n_c].copy_from_slice(u0);
    }

    /// Computes the contexts of the initial states.
    #[inline(always)]
    pub fn enter<S: Simd>(&mut self, simd: S, packed: &Packed) {
        activate(simd, packed, &self.internal, &mut self.states, self.columns);
    }

    /// The next input of a column, N_I values.
    pub fn input(&mut self, packed: &Packed, column: usize) -> &mut [f64] {
        &mut self.states[column * packed.state_stride + packed.rows..][..packed.n_x]
    }

    /// The context of a column, N_C values.
    pub fn context(&self, packed: &Packed, column: usize) -> &[f64] {
        &self.states[column * packed.state_stride..][..packed.n_c]
    }

    /// What the mean units of a column say, N_O values: y, where there is no skip connection.
    pub fn mean(&self, packed: &Packed, column: usize) -> &[f64] {
        let outputs = if packed.linear_mean { &self.outputs } else { &self.mean };
        &outputs[column * padded(packed.n_out)..][..packed.n_y]
    }

    /// exp u of the variance units of a column; empty without them. The floor is not in it.
    pub fn variance(&self, packed: &Packed, column: usize) -> &[f64] {
        &self.variance[column * padded(packed.n_out)..][packed.n_y..packed.n_out]
    }

    /// Takes the inputs in, and predicts.
    #[inline(always)]
    pub fn step<S: Simd>(&mut self, simd: S, packed: &Packed) {
        let (rows, stride, columns) = (packed.rows, packed.state_stride, self.columns);
        let sources = [Columns { values: &self.states[rows..], stride }, Columns { values: &self.states, stride }];
        let matrices = [&packed.from_input, &packed.from_context];
        let product = Product { matrices, sources, columns, start: &packed.bias, ahead: &[] };
        let way = Way { end: End::Keep(&packed.decay), ..Way::default() };
        multiply_into(simd, product, way, &mut self.internal);
        activate(simd, packed, &self.internal, &mut self.states, columns);

        let sources = [Columns { values: &self.states, stride }];
        let product = Product { matrices: [&packed.outputs], sources, columns, start: &packed.output_bias, ahead: &[] };
        multiply(simd, product, &mut self.outputs);
        let outputs = padded(packed.n_out);
        for (u, y) in self.outputs.chunks_exact(outputs).zip(self.mean.chunks_exact_mut(outputs)) {
            tanh_rows(simd, u, y);
        }
        let (u, _) = S::as_simd_f64s(&self.outputs);
        let (variance, _) = S::as_mut_simd_f64s(&mut self.variance);
        for (v, u) in variance.iter_mut().zip(u) {
            *v = exp(simd, *u);
        }
    }
}
