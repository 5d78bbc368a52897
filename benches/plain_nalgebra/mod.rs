//! The same epoch as one would write it with nalgebra: all sequences as columns of dense matrices, products by its
//! `gemm`, tanh and exp of the standard library, and the weight gradient as one product over all steps.

use nalgebra::{DMatrix, DVector};
use scrnn::dataset::Dataset;
use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::parameters::Block;

/// ln(2 pi).
const LN_2PI: f64 = 1.837_877_066_409_345_3;

/// An S-CTRNN with its data and room for all that an epoch computes. Columns are (step, sequence), steps outermost.
pub struct Epoch {
    sequences: usize,
    steps: usize,
    w_cx: DMatrix<f64>,
    w_cc: DMatrix<f64>,
    b_c: DVector<f64>,
    /// Mean units, then variance units.
    w_oc: DMatrix<f64>,
    b_o: DVector<f64>,
    tau: DVector<f64>,
    u0: DMatrix<f64>,
    /// Samples: the input of step k is block k, its target block k + 1.
    x: DMatrix<f64>,
    /// Context before step 0 and after each.
    c: DMatrix<f64>,
    /// d ln L / du of the context, divided by tau, and of the outputs, after each step.
    du_c: DMatrix<f64>,
    du_o: DMatrix<f64>,
}

/// ln L_out, and its gradient.
pub struct Gradient {
    pub ln_likelihood: f64,
    /// Of `w_cx`, `w_cc`, `b_c`, of weights and biases of the outputs, and of u_0.
    blocks: [DMatrix<f64>; 6],
}

impl Gradient {
    /// Length of the gradient of the shared parameters.
    pub fn norm(&self) -> f64 {
        self.blocks[..5].iter().map(DMatrix::norm_squared).sum::<f64>().sqrt()
    }
}

impl Epoch {
    /// Takes over a network of delay 1 and sequences of one length.
    pub fn new(network: &Network, states: &InitialStates, data: &Dataset) -> Self {
        let (topology, parameters) = (network.topology(), network.parameters());
        let (units, channels, outputs) = (topology.context_units(), topology.channels(), topology.output_units());
        let sequences = data.sequences().len();
        let samples = data.sequences()[0].len();
        let matrix = |rows, columns, blocks: &[Block]| {
            let values: Vec<f64> = blocks.iter().flat_map(|&block| parameters.block(block)).copied().collect();
            DMatrix::from_row_slice(rows, columns, &values)
        };
        let sample = |row, column: usize| data.sequences()[column % sequences].sample(column / sequences)[row];
        Self {
            sequences,
            steps: samples - 1,
            w_cx: matrix(units, channels, &[Block::ContextFromInput]),
            w_cc: matrix(units, units, &[Block::ContextFromContext]),
            b_c: matrix(units, 1, &[Block::ContextBias]).column(0).into_owned(),
            w_oc: matrix(outputs, units, &[Block::MeanFromContext, Block::VarianceFromContext]),
            b_o: matrix(outputs, 1, &[Block::MeanBias, Block::VarianceBias]).column(0).into_owned(),
            tau: DVector::from_vec(topology.time_constants()),
            u0: DMatrix::from_column_slice(units, sequences, states.values()),
            x: DMatrix::from_fn(channels, samples * sequences, sample),
            c: DMatrix::zeros(units, samples * sequences),
            du_c: DMatrix::zeros(units, (samples - 1) * sequences),
            du_o: DMatrix::zeros(outputs, (samples - 1) * sequences),
        }
    }

    /// One evaluation of likelihood and gradient.
    pub fn run(&mut self) -> Gradient {
        let ln_likelihood = self.forward();
        let u0 = self.backward();
        let inputs = self.x.columns(0, self.steps * self.sequences).transpose();
        let before = self.c.columns(0, self.steps * self.sequences).transpose();
        let after = self.c.columns(self.sequences, self.steps * self.sequences).transpose();
        let sum = |du: &DMatrix<f64>| DMatrix::from_column_slice(du.nrows(), 1, du.column_sum().as_slice());
        let (du_c, du_o) = (&self.du_c, &self.du_o);
        let blocks = [du_c * inputs, du_c * before, sum(du_c), du_o * after, sum(du_o), u0];
        Gradient { ln_likelihood, blocks }
    }

    /// (2.2)-(2.5), and (2.11) with its gradient at the outputs.
    fn forward(&mut self) -> f64 {
        let (n, channels) = (self.sequences, self.x.nrows());
        let mut u = self.u0.clone();
        let mut drive = DMatrix::zeros(u.nrows(), n);
        let mut out = DMatrix::zeros(self.b_o.len(), n);
        let mut ln_likelihood = 0.0;
        self.c.columns_mut(0, n).copy_from(&u.map(f64::tanh));
        for k in 0..self.steps {
            fill(&mut drive, &self.b_c);
            drive.gemm(1.0, &self.w_cx, &self.x.columns(k * n, n), 1.0);
            drive.gemm(1.0, &self.w_cc, &self.c.columns(k * n, n), 1.0);
            for (index, (u, drive)) in u.iter_mut().zip(&drive).enumerate() {
                *u += (drive - *u) / self.tau[index % self.tau.len()];
            }
            let mut c = self.c.columns_mut((k + 1) * n, n);
            c.zip_apply(&u, |c, u| *c = u.tanh());
            fill(&mut out, &self.b_o);
            out.gemm(1.0, &self.w_oc, &c, 1.0);
            for s in 0..n {
                for i in 0..channels {
                    let (y, v) = (out[(i, s)].tanh(), out[(channels + i, s)].exp());
                    let e = self.x[(i, (k + 1) * n + s)] - y;
                    ln_likelihood -= 0.5 * (LN_2PI + out[(channels + i, s)] + e * e / v);
                    self.du_o[(i, k * n + s)] = (1.0 - y * y) * e / v;
                    self.du_o[(channels + i, k * n + s)] = 0.5 * (e * e / v - 1.0);
                }
            }
        }
        ln_likelihood
    }

    /// (2.22); gives d ln L / du_0.
    fn backward(&mut self) -> DMatrix<f64> {
        let n = self.sequences;
        let (from_context, from_outputs) = (self.w_cc.transpose(), self.w_oc.transpose());
        let mut du = DMatrix::zeros(self.w_cc.nrows(), n);
        let mut sums = du.clone();
        for k in (0..=self.steps).rev() {
            sums.fill(0.0);
            if k < self.steps {
                sums.gemm(1.0, &from_context, &self.du_c.columns(k * n, n), 0.0);
            }
            if k > 0 {
                sums.gemm(1.0, &from_outputs, &self.du_o.columns((k - 1) * n, n), 1.0);
            }
            let c = self.c.columns(k * n, n);
            for s in 0..n {
                for i in 0..self.tau.len() {
                    let slope = 1.0 - c[(i, s)] * c[(i, s)];
                    du[(i, s)] = slope * sums[(i, s)] + (1.0 - 1.0 / self.tau[i]) * du[(i, s)];
                    if k > 0 {
                        self.du_c[(i, (k - 1) * n + s)] = du[(i, s)] / self.tau[i];
                    }
                }
            }
        }
        du
    }
}

/// Puts a bias into every column.
fn fill(to: &mut DMatrix<f64>, bias: &DVector<f64>) {
    for mut column in to.column_iter_mut() {
        column.copy_from(bias);
    }
}
