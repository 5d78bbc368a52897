//! One step as an ONNX model: `sample` and `state` in, `mean`, `variance` and `state_after` out.
//!
//! The state is one vector, the parts of [`OneStep`] behind each other. What it is before the first step stands in the metadata
//! under the key `scrnn`, which is JSON, beside names, shapes and the delay. Operators are those of opset 17 for which onnxruntime's
//! CPU has double kernels.

use serde_json::json;

use super::graph::{Graph, Name};
use super::{Member, OneStep};
use crate::failure::{Failure, Result};

/// Largest protobuf message that is read everywhere.
const MOST_BYTES: usize = i32::MAX as usize;

/// A channel loses this share of its learned range by rounding its samples: told from here on.
const TOO_COARSE: f64 = 1e-3;

/// What a model computes with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// As the library.
    #[default]
    Float64,
    /// Half as many bytes; what runs on most accelerators.
    Float32,
}

impl Precision {
    /// Its `TensorProto.DataType`.
    pub(super) fn data_type(self) -> u64 {
        match self {
            Self::Float64 => 11,
            Self::Float32 => 1,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Float64 => "float64",
            Self::Float32 => "float32",
        }
    }
}

impl OneStep {
    /// The step as the bytes of an ONNX file.
    ///
    /// # Errors
    /// [`Failure::Input`] for numbers that are none in float32, for a channel of which float32 leaves too little, and for a network
    /// that takes 2 GB.
    pub fn onnx(&self, precision: Precision) -> Result<Vec<u8>> {
        if precision == Precision::Float32 {
            self.check_float32()?;
        }
        let (m, n, kind) = (self.members.len(), self.channels.len(), self.kind);
        let (units, inputs, delay, past) = (kind.units, kind.inputs, kind.delay, kind.past());
        let state_len = self.start().len();
        let weights = self.members.iter().map(|one| one.from_context.len() + one.from_input.len()).sum::<usize>();
        if weights.saturating_mul(size_of::<f64>()) > MOST_BYTES / 2 {
            let message = "the network is too large for a file of protobuf, which ends at 2 GB";
            return Err(Failure::input(message, "export it as C, or a member of the mixture alone"));
        }

        let mut g = Graph::new(precision);
        let sample = g.input("sample", &[n], "in the data's units; NaN or infinite: missing");
        let state =
            g.input("state", &[state_len], "state_after of the last step; before the first: start in the metadata");
        let mut at = 0;
        let [u, before, means, steps] = self.state().map(|(_, shape)| {
            let len: usize = shape.iter().product();
            let part = g.slice(&state, 0, at..at + len);
            at += len;
            let shape = if shape.len() == 2 { vec![m, 1, units] } else { shape };
            if shape.len() == 1 { part } else { g.reshape(&part, &shape) }
        });

        // The sample, scaled; where it is missing, what was predicted for it, or the last input.
        let (offset, scale) = (g.constant(&[n], &self.offset), g.constant(&[n], &self.scale));
        let shifted = g.node("Sub", &[&sample, &offset]);
        let scaled = g.node("Mul", &[&shifted, &scale]);
        let (nan, infinite) = (g.node("IsNaN", &[&scaled]), g.node("IsInf", &[&scaled]));
        let missing = g.node("Or", &[&nan, &infinite]);
        let xi = g.constant(&[1], &[delay as f64]);
        let due = g.slice(&means, 1, 0..1);
        let last = g.slice(&before, 1, 0..1);
        let early = g.node("Less", &[&steps, &xi]);
        let stand_in = g.node("Where", &[&early, &last, &due]);
        let x = g.node("Where", &[&missing, &stand_in, &scaled]);
        let samples = match past {
            0 => x.clone(),
            _ => {
                let kept = g.slice(&before, 1, 0..past);
                let moved = g.concat(&[&x, &kept], 1);
                let first = g.expand(&x, &[m, past + 1, n]);
                let none = g.constant(&[1], &[0.0]);
                let begun = g.node("Greater", &[&steps, &none]);
                g.node("Where", &[&begun, &moved, &first])
            }
        };
        let mut input = x.clone();
        if kind.velocity {
            let rate = self.rows(&mut g, n, |one| &one.velocity);
            let before = g.slice(&samples, 1, 1..2);
            let change = g.node("Sub", &[&x, &before]);
            let rates = g.node("Mul", &[&change, &rate]);
            input = g.concat(&[&x, &rates], 2);
        }

        // u <- (1 - 1/tau) u + (1/tau) (W x + W c + b),  c = tanh u
        let c = g.node("Tanh", &[&u]);
        let (decay, bias) = (self.rows(&mut g, units, |one| &one.decay), self.rows(&mut g, units, |one| &one.bias));
        let from_input = self.turned(&mut g, (units, inputs), |one| &one.from_input);
        let from_context = self.turned(&mut g, (units, units), |one| &one.from_context);
        let (of_input, of_context) = (g.node("MatMul", &[&input, &from_input]), g.node("MatMul", &[&c, &from_context]));
        let drive = g.node("Add", &[&of_input, &of_context]);
        let drive = g.node("Add", &[&drive, &bias]);
        let kept = g.node("Mul", &[&decay, &u]);
        let u = g.node("Add", &[&kept, &drive]);
        let c = g.node("Tanh", &[&u]);

        let mut y = self.said(&mut g, &c, |one| (&one.mean_from_context, &one.mean_bias));
        if !kind.linear_mean {
            y = g.node("Tanh", &[&y]);
        }
        let of_skip = kind.skip.then(|| self.rows(&mut g, n, |one| &one.skip_scale));
        if let Some(s) = &of_skip {
            let mut guess = x;
            if kind.lags > 0 {
                let (newer, older) = (g.slice(&samples, 1, 0..kind.lags), g.slice(&samples, 1, 1..kind.lags + 1));
                let changes = g.node("Sub", &[&newer, &older]);
                let changes = g.reshape(&changes, &[m, 1, kind.lags * n]);
                let taps = self.taps(&mut g);
                let taken = g.node("MatMul", &[&changes, &taps]);
                guess = g.node("Add", &[&guess, &taken]);
            }
            let left = g.node("Mul", &[s, &y]);
            y = g.node("Add", &[&guess, &left]);
        }
        let v = kind.variance.then(|| {
            let said = self.said(&mut g, &c, |one| (&one.variance_from_context, &one.variance_bias));
            let exp = g.node("Exp", &[&said]);
            let floor = g.constant(&[1], &[kind.floor]);
            let v = g.node("Add", &[&exp, &floor]);
            match &of_skip {
                Some(s) => {
                    let square = g.node("Mul", &[s, s]);
                    g.node("Mul", &[&square, &v])
                }
                None => v,
            }
        });

        // The moments of the mixture, in the units of the data.
        let mixed = g.mean_of_first_axis(&y);
        let mean = g.node("Div", &[&mixed, &scale]);
        let mean = g.node("Add", &[&mean, &offset]);
        let mean = g.reshape(&mean, &[n]);
        g.output(&mean, "mean", &[n], &format!("of {}", self.forecast()));
        if let Some(v) = v {
            let whole = match m {
                1 => v,
                _ => {
                    let off = g.node("Sub", &[&y, &mixed]);
                    let spread = g.node("Mul", &[&off, &off]);
                    g.node("Add", &[&v, &spread])
                }
            };
            let variance = g.mean_of_first_axis(&whole);
            let squares: Vec<f64> = self.scale.iter().map(|scale| scale.powi(2)).collect();
            let squares = g.constant(&[n], &squares);
            let variance = g.node("Div", &[&variance, &squares]);
            let variance = g.reshape(&variance, &[n]);
            g.output(&variance, "variance", &[n], "of the same");
        }

        let means = match delay {
            1 => y,
            _ => {
                let kept = g.slice(&means, 1, 1..delay);
                g.concat(&[&kept, &y], 1)
            }
        };
        let one = g.constant(&[1], &[1.0]);
        let more = g.node("Add", &[&steps, &one]);
        let steps = g.node("Min", &[&more, &xi]);
        let flat: [Name; 3] = [(&u, units), (&samples, (past + 1) * n), (&means, delay * n)]
            .map(|(part, len)| g.reshape(part, &[m * len]));
        let after = g.concat(&[&flat[0], &flat[1], &flat[2], &steps], 0);
        g.output(&after, "state_after", &[state_len], "the state of the next step");

        let about = format!("One step of {}: predicts {}.", self.about, self.forecast());
        let bytes = g.into_model(&about, &[("scrnn", &self.note(precision))]);
        Ok(bytes)
    }

    /// What a program has to know beside the graph.
    fn note(&self, precision: Precision) -> String {
        let mut at = 0;
        let parts = self.state().map(|(name, shape)| {
            let part = json!({ "name": name, "from": at, "shape": shape });
            at += shape.iter().product::<usize>();
            part
        });
        let start = self.start().into_iter().map(|value| match precision {
            Precision::Float64 => value,
            Precision::Float32 => f64::from(value as f32),
        });
        json!({
            "format": 1,
            "about": self.about,
            "version": env!("CARGO_PKG_VERSION"),
            "precision": precision.word(),
            "channels": self.channels,
            "delay": self.kind.delay,
            "period": self.period,
            "members": self.members.len(),
            "state": parts,
            "start": start.collect::<Vec<_>>(),
            "begins": self.begins,
            "variances": self.remark,
        })
        .to_string()
    }

    /// A row of `count` numbers for each member: `[members, 1, count]`.
    fn rows(&self, g: &mut Graph, count: usize, of: impl Fn(&Member) -> &Vec<f64>) -> Name {
        let values: Vec<f64> = self.members.iter().flat_map(|one| of(one).iter().copied()).collect();
        g.constant(&[self.members.len(), 1, count], &values)
    }

    /// Each member's matrix `[to, from]`, turned to `[members, from, to]`.
    fn turned(&self, g: &mut Graph, (to, from): (usize, usize), of: impl Fn(&Member) -> &Vec<f64>) -> Name {
        let of = &of;
        let turned = |one| (0..from * to).map(move |k| of(one)[k % to * from + k / to]);
        let values: Vec<f64> = self.members.iter().flat_map(turned).collect();
        g.constant(&[self.members.len(), from, to], &values)
    }

    /// The taps `[lag][to][from]` as matrices `[members, lag from, to]`.
    fn taps(&self, g: &mut Graph) -> Name {
        let (n, lags) = (self.channels.len(), self.kind.lags);
        let of = |one: &Member| -> Vec<f64> {
            (0..lags * n * n).map(|k| one.taps[k / (n * n) * n * n + k % n * n + k / n % n]).collect()
        };
        let values: Vec<f64> = self.members.iter().flat_map(of).collect();
        g.constant(&[self.members.len(), lags * n, n], &values)
    }

    /// What output units say: W c + b, `[members, 1, channels]`.
    fn said(&self, g: &mut Graph, c: &Name, of: impl Fn(&Member) -> (&Vec<f64>, &Vec<f64>)) -> Name {
        let n = self.channels.len();
        let weights = self.turned(g, (n, self.kind.units), |one| of(one).0);
        let bias = self.rows(g, n, |one| of(one).1);
        let product = g.node("MatMul", &[c, &weights]);
        g.node("Add", &[&product, &bias])
    }

    /// Refuses what float32 cannot hold.
    fn check_float32(&self) -> Result<()> {
        let help = "leave --float32 out";
        for (k, name) in self.channels.iter().enumerate() {
            // Samples near the offset are rounded to half of its last place.
            let lost = (self.offset[k] * self.scale[k]).abs() * f64::from(f32::EPSILON) / 2.0;
            if lost > TOO_COARSE {
                let message = format!(
                    "channel {name} lies around {:e}: float32 rounds its samples by {:.1e} of what was learned of it",
                    self.offset[k], lost
                );
                return Err(Failure::input(message, help));
            }
        }
        let squares = self.scale.iter().map(|scale| scale.powi(2));
        let numbers = self.members.iter().flat_map(Member::numbers).chain(&self.offset).chain(&self.scale).copied();
        let lost = |value: f64| !(value as f32).is_finite() || value != 0.0 && !(value as f32).is_normal();
        match squares.chain(self.members.iter().flat_map(|one| one.skip_scale.iter().map(|s| s * s))).find(|v| lost(*v))
        {
            Some(value) => Err(Failure::input(format!("a factor of {value:e} is out of float32's range"), help)),
            None => match numbers.into_iter().find(|value| !(*value as f32).is_finite()) {
                Some(value) => Err(Failure::input(format!("the number {value:e} is out of float32's range"), help)),
                None => Ok(()),
            },
        }
    }
}

impl Member {
    /// All its numbers.
    fn numbers(&self) -> impl Iterator<Item = &f64> {
        let lists = [
            &self.internal,
            &self.decay,
            &self.from_input,
            &self.from_context,
            &self.bias,
            &self.mean_from_context,
            &self.mean_bias,
            &self.variance_from_context,
            &self.variance_bias,
            &self.velocity,
            &self.taps,
            &self.skip_scale,
        ];
        lists.into_iter().flatten()
    }
}
