//! Forward dynamics (thesis 2.5; multiple timescales 2.10.1).
//!
//! ```text
//! u_i <- (1 - 1/tau_i) u_i + (1/tau_i) (sum_j w_cx[i,j] x_j + sum_j w_cc[i,j] c_j + b_i)    (2.2), (2.27)
//! c_i <- tanh u_i                                                                           (2.3)
//! y_i  = tanh (sum_j w_yc[i,j] c_j + b_i)                                                   (2.2), (2.4)
//! v_i  = exp  (sum_j w_vc[i,j] c_j + b_i) + floor                                           (2.2), (2.5)
//! ```
//!
//! With a skip connection y and v are what [`crate::features`] makes of them, and so is x of the samples.
//!
//! Letters: `x` input, `u` internal state, `c` context, `y` mean, `v` variance, `w_ab` weight to a from b.
//!
//! [`Plain`] is the reference: one sequence, one step at a time. The fast version runs all columns of a block.

use pulp::Simd;

use crate::batch::Block;
use crate::dataset::Sequence;
use crate::error::{Error, Result};
use crate::features::{Features, Past};
use crate::kernels::element::Element;
use crate::kernels::panels::{Columns, End, Product, Way, multiply_into};
use crate::network::Network;
use crate::packed::Packed;
use crate::parameters::Block as Parameter;
use crate::trajectory::Trajectory;

/// One network at one moment, computed in plain loops.
#[derive(Debug, Clone)]
pub struct Plain<'a> {
    network: &'a Network,
    features: Features,
    past: Past,
    /// The means of the last xi steps, oldest first.
    means: Vec<Vec<f64>>,
    tau: Vec<f64>,
    /// Internal state u, N_C values.
    pub u: Vec<f64>,
    /// Context c = tanh u, N_C values.
    pub c: Vec<f64>,
    /// Mean y, N_O values; 0 before the first step.
    pub y: Vec<f64>,
    /// Variance v, N_O values; empty without variance units.
    pub v: Vec<f64>,
}

impl<'a> Plain<'a> {
    /// The network at its initial state `u0`, N_C values.
    ///
    /// # Errors
    /// [`Error::Length`] for a `u0` of another size.
    pub fn new(network: &'a Network, u0: &[f64]) -> Result<Self> {
        let needed = network.topology.context_units();
        if u0.len() != needed {
            return Err(Error::Length { what: "the initial state".into(), found: u0.len(), needed });
        }
        Ok(Self::at(network, u0))
    }

    pub(crate) fn at(network: &'a Network, u0: &[f64]) -> Self {
        let topology = &network.topology;
        let features = Features::new(topology);
        Self {
            network,
            past: Past::new(&features),
            features,
            means: Vec::new(),
            tau: topology.time_constants(),
            u: u0.to_vec(),
            c: u0.iter().map(|u| u.tanh()).collect(),
            y: vec![0.0; topology.channels()],
            v: vec![0.0; topology.output_units() - topology.channels()],
        }
    }

    /// Advances one step with the sample `x`, N_O values; NaN is missing.
    ///
    /// # Errors
    /// [`Error::Length`] for a sample of another size.
    pub fn step(&mut self, x: &[f64]) -> Result<()> {
        let needed = self.network.topology.channels();
        if x.len() != needed {
            return Err(Error::Length { what: "the sample".into(), found: x.len(), needed });
        }
        self.advance(x);
        Ok(())
    }

    pub(crate) fn advance(&mut self, x: &[f64]) {
        let topology = &self.network.topology;
        let due = (self.means.len() == topology.delay()).then(|| self.means.remove(0));
        let last = self.past.at(0).to_vec();
        let stand_in = |i: usize| due.as_ref().map_or(last[i], |due| due[i]);
        let x: Vec<f64> = x.iter().enumerate().map(|(i, x)| if x.is_nan() { stand_in(i) } else { *x }).collect();
        self.past.push(&x);
        let mut x = vec![0.0; topology.inputs()];
        self.features.inputs(|back| self.past.at(back), &mut x);
        let mut guess = vec![0.0; topology.channels()];
        self.features.guess(|back| self.past.at(back), &mut guess);

        let parameters = &self.network.parameters;
        let affine = |weights: Parameter, bias: Parameter, from: &[f64], i: usize| {
            let row = &parameters.block(weights)[i * from.len()..(i + 1) * from.len()];
            row.iter().zip(from).fold(parameters.block(bias)[i], |sum, (w, from)| sum + w * from)
        };
        let drive: Vec<f64> = (0..self.u.len())
            .map(|i| {
                let row = &parameters.block(Parameter::ContextFromInput)[i * x.len()..(i + 1) * x.len()];
                let input: f64 = row.iter().zip(&x).map(|(w, x)| w * x).sum();
                input + affine(Parameter::ContextFromContext, Parameter::ContextBias, &self.c, i)
            })
            .collect();
        for (i, drive) in drive.into_iter().enumerate() {
            self.u[i] = (1.0 - 1.0 / self.tau[i]) * self.u[i] + drive / self.tau[i];
            self.c[i] = self.u[i].tanh();
        }
        for (i, y) in self.y.iter_mut().enumerate() {
            let u = affine(Parameter::MeanFromContext, Parameter::MeanBias, &self.c, i);
            *y = self.features.mean(i, guess[i], if topology.has_linear_mean() { u } else { u.tanh() });
        }
        for (i, v) in self.v.iter_mut().enumerate() {
            let u = affine(Parameter::VarianceFromContext, Parameter::VarianceBias, &self.c, i);
            *v = self.features.variance(i, u.exp());
        }
        self.means.push(self.y.clone());
    }
}

/// `c <- tanh u` for `columns` columns.
#[inline(always)]
pub(crate) fn activate<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    internal: &[E],
    states: &mut [E],
    columns: usize,
) {
    for column in 0..columns {
        let u = &internal[column * packed.rows..][..packed.rows];
        E::tanh_rows(simd, u, &mut states[column * packed.state_stride..][..packed.rows]);
    }
}

/// `u <- (1 - 1/tau) u + drive`, `c <- tanh u` for `columns` columns (2.2), (2.3).
#[inline(always)]
pub(crate) fn advance<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    drive: &[E],
    internal: &mut [E],
    states: &mut [E],
    columns: usize,
) {
    let decay = E::vectors::<S>(&packed.decay);
    for column in 0..columns {
        let drive = E::vectors::<S>(&drive[column * packed.rows..][..packed.rows]);
        let internal = &mut internal[column * packed.rows..][..packed.rows];
        let u = E::vectors_mut::<S>(internal);
        for ((u, drive), decay) in u.iter_mut().zip(drive).zip(decay) {
            *u = E::mul_add(simd, *decay, *u, *drive);
        }
        E::tanh_rows(simd, internal, &mut states[column * packed.state_stride..][..packed.rows]);
    }
}

/// Puts initial states, one of N_C values for each run, into the running internal states.
pub(crate) fn start<E: Element>(packed: &Packed<E>, block: &Block, initial: &[f64], trajectory: &mut Trajectory<E>) {
    for (&run, u) in block.runs.iter().zip(trajectory.internal.chunks_exact_mut(packed.rows)) {
        u.fill(E::ZERO);
        E::take(&mut u[..packed.n_c], &initial[run * packed.n_c..(run + 1) * packed.n_c]);
    }
}

/// Prepares a span that starts in the running internal states: the context there.
#[inline(always)]
pub(crate) fn enter_span<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    block: &Block,
    trajectory: &mut Trajectory<E>,
) {
    activate(simd, packed, &trajectory.internal, &mut trajectory.states, block.columns());
}

/// Runs the products of `range`, which lies in the span that starts at `span_start`; `record` keeps the outputs.
#[inline(always)]
pub(crate) fn run<S: Simd, E: Element>(
    simd: S,
    packed: &Packed<E>,
    (block, sequences): (&Block, &[Sequence]),
    range: std::ops::Range<usize>,
    span_start: usize,
    record: bool,
    trajectory: &mut Trajectory<E>,
) {
    let (n, stride, rows) = (block.columns(), packed.state_stride, packed.rows);
    let (n_x, n_y, n_c) = (packed.n_x, packed.n_y, packed.n_c);
    let variance = packed.n_out > n_y;
    for k in range {
        let active = block.active(k);
        let at = (k - span_start) * n * stride;
        let (now, later) = trajectory.states[at..].split_at_mut(n * stride);
        let (next, ahead) = later.split_at_mut(n * stride);
        for column in 0..active {
            // A column that ends here has no input any more, and needs none.
            if let Some(x) = sequences[block.sequences[column]].values().get(k * n_x..(k + 1) * n_x) {
                let inputs = &mut now[column * stride + rows..][..n_x + 1];
                E::take(&mut inputs[..n_x], x);
                inputs[n_x] = E::ONE;
            }
        }
        let sources = [Columns { values: &now[rows..], stride }, Columns { values: now, stride }];
        let internal = &mut trajectory.internal[..n * rows];
        let matrices = [&packed.from_input, &packed.from_context];
        // Where the next step writes: that was read long ago, and left the cache since.
        let ahead = &ahead[..(n * stride).min(ahead.len())];
        let product = Product { matrices, sources, columns: active, start: &packed.bias, ahead };
        // u <- (1 - 1/tau) u + drive, at the end of each sum.
        let way = Way { backwards: k % 2 == 1, end: End::Keep(&packed.decay) };
        multiply_into(simd, product, way, internal);
        activate(simd, packed, internal, next, active);
        if record && k > 0 {
            let out = (k - 1) * n * n_y;
            for column in 0..active {
                let y = match packed.linear_mean {
                    false => &next[column * stride + n_c..][..n_y],
                    true => &internal[column * rows + n_c..][..n_y],
                };
                E::give(y, &mut trajectory.mean[out + column * n_y..][..n_y]);
                if variance {
                    let u = &internal[column * rows + n_c + n_y..][..n_y];
                    E::give(u, &mut trajectory.variance[out + column * n_y..][..n_y]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Parameters;
    use crate::topology::{Group, Prediction, Topology};

    fn set(parameters: &mut Parameters, values: &[(Parameter, &[f64])]) {
        for (block, values) in values {
            parameters.block_mut(*block).copy_from_slice(values);
        }
    }

    #[test]
    fn one_unit_by_hand() {
        let topology = Topology::s_ctrnn(1, 1, 2.0).unwrap();
        let mut parameters = Parameters::zeros(&topology);
        set(
            &mut parameters,
            &[
                (Parameter::ContextFromInput, &[0.5]),
                (Parameter::ContextFromContext, &[-1.0]),
                (Parameter::ContextBias, &[0.25]),
                (Parameter::MeanFromContext, &[2.0]),
                (Parameter::MeanBias, &[-0.5]),
                (Parameter::VarianceFromContext, &[1.0]),
                (Parameter::VarianceBias, &[-3.0]),
            ],
        );
        let network = Network { topology, parameters };
        let mut plain = Plain::at(&network, &[1.0]);
        plain.advance(&[0.8]);
        // u = 0.5 * 1 + 0.5 * (0.4 - tanh 1 + 0.25) = 0.825 - 0.380797077977882
        assert!((plain.u[0] - 0.444_202_922_022_118).abs() < 1e-14);
        // tanh 0.444202922022118 = 0.417137253072...; y = tanh(2 c - 0.5), v = exp(c - 3)
        let c = (0.444_202_922_022_118_f64.exp() - (-0.444_202_922_022_118_f64).exp())
            / (0.444_202_922_022_118_f64.exp() + (-0.444_202_922_022_118_f64).exp());
        assert!((plain.c[0] - c).abs() < 1e-14);
        assert!((plain.y[0] - (2.0 * c - 0.5).tanh()).abs() < 1e-14);
        assert!((plain.v[0] - (c - 3.0).exp()).abs() < 1e-15);
    }

    #[test]
    fn without_recurrence_a_unit_relaxes_by_the_closed_form() {
        // tau du/dt = -u + b in steps of 1: u_t = b + (u_0 - b) (1 - 1/tau)^t
        let groups = vec![Group::full("context", 1, 10.0)];
        let topology = Topology::new(1, 1, groups, Prediction::Mean).unwrap();
        let mut parameters = Parameters::zeros(&topology);
        set(&mut parameters, &[(Parameter::ContextBias, &[0.7])]);
        let network = Network { topology, parameters };
        let mut plain = Plain::at(&network, &[-1.0]);
        for t in 1..=50 {
            plain.advance(&[123.0]);
            let closed = 0.7 + (-1.0 - 0.7) * 0.9_f64.powi(t);
            assert!((plain.u[0] - closed).abs() < 1e-13, "step {t}: {} instead of {closed}", plain.u[0]);
        }
    }

    #[test]
    fn the_input_passes_slow_units_by_in_its_first_step() {
        let groups = vec![Group::fast(2, 2.0), Group::slow(1, 20.0)];
        let topology = Topology::new(1, 1, groups, Prediction::MeanAndVariance { floor: 0.0 }).unwrap();
        let (network, _) = crate::initialization::initialize(&topology, 1, 3);
        let run = |x: f64| {
            let mut plain = Plain::at(&network, &[0.0, 0.0, 0.5]);
            plain.advance(&[x]);
            let first = plain.u[2];
            plain.advance(&[x]);
            (first, plain.u[2])
        };
        assert_eq!(run(0.9).0, run(-0.9).0);
        assert_ne!(run(0.9).1, run(-0.9).1);
    }
}
