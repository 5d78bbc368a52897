//! One step of a trained network, for programs that have no `scrnn`: what it takes in, what it holds, and what it gives.
//!
//! ```text
//! sample in the data's units, state  ->  mean and variance in the data's units, state
//! ```
//!
//! [`OneStep`] describes it in plain lists of numbers. [`OneStep::c`], [`OneStep::onnx`] and [`OneStep::json`] write it down, and have no
//! other source. The state is all that goes from step to step:
//!
//! | part | shape | what it is |
//! |---|---|---|
//! | internal | `[members, units]` | u of the context units |
//! | past | `[members, past + 1, channels]` | the last inputs, newest first |
//! | means | `[members, delay, channels]` | the means of the last steps, oldest first: the first is due now |
//! | steps | `[1]` | steps taken, up to the delay |
//!
//! `past` and `means` are in the network's units. A value that is missing (NaN, or not finite once it is scaled) is stood in for
//! by the mean that is due, before there is one by the channel's last input, or 0, as everywhere in the library
//! ([`scrnn::generation::Running`]). The members of a mixture run side by side, each on its own stand-ins; mean and variance are
//! those of the mixture.

use scrnn::parameters::Block;
use serde::Serialize;

use crate::failure::{Failure, Result};
use crate::trained::Trained;

mod c;
mod graph;
mod json;
mod onnx;

pub use onnx::Precision;

/// What `--sequence` calls the mean of the learned initial states.
pub const MEAN: &str = "mean";

/// One step of a network, or of a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct OneStep {
    /// Name of the run's experiment, and the epochs of each member.
    about: String,
    /// Where the state begins, in words.
    begins: String,
    /// What was done to the variances, in words.
    remark: Option<String>,
    /// Seconds between samples, where data were brought to a period.
    period: Option<f64>,
    channels: Vec<String>,
    /// scaled = (raw - offset) scale
    offset: Vec<f64>,
    scale: Vec<f64>,
    kind: Kind,
    members: Vec<Member>,
}

/// What the members of a mixture have in common.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Kind {
    /// xi.
    delay: usize,
    units: usize,
    inputs: usize,
    variance: bool,
    linear_mean: bool,
    velocity: bool,
    skip: bool,
    /// Differences that the skip connection takes.
    lags: usize,
    floor: f64,
}

impl Kind {
    /// Inputs before the newest that are kept.
    fn past(&self) -> usize {
        self.lags.max(usize::from(self.velocity))
    }
}

/// The numbers of one network; weights are row-major and read "to from".
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Member {
    /// u_0.
    internal: Vec<f64>,
    /// 1 - 1/tau of each unit.
    decay: Vec<f64>,
    /// (1/tau) w_cx, (1/tau) w_cc, (1/tau) b_c.
    from_input: Vec<f64>,
    from_context: Vec<f64>,
    bias: Vec<f64>,
    mean_from_context: Vec<f64>,
    mean_bias: Vec<f64>,
    variance_from_context: Vec<f64>,
    variance_bias: Vec<f64>,
    /// 1 / sd of each channel's differences; empty without velocity inputs.
    velocity: Vec<f64>,
    /// A_l, `[lag][to][from]`, and s; empty without a skip connection.
    taps: Vec<f64>,
    skip_scale: Vec<f64>,
}

/// One part of the state, by its name and shape.
type Part = (&'static str, Vec<usize>);

impl OneStep {
    /// The step of one network or of the members of a mixture, as [`crate::members::open`] gives them. The state begins from that
    /// of the learned sequence of this name or number, or from the mean of all, which is also called [`MEAN`].
    ///
    /// # Errors
    /// [`Failure::Input`] for a sequence that was not learned, and for members that are not of one kind.
    pub fn of(all: &[Trained], sequence: Option<&str>) -> Result<Self> {
        let Some(first) = all.first() else { return Err(Failure::input("there is no network to export", "")) };
        let checkpoint = &first.checkpoint;
        let kind = kind(first);
        for (k, one) in all.iter().enumerate() {
            let other = &one.checkpoint;
            let alike = (&checkpoint.channels, &checkpoint.scaling) == (&other.channels, &other.scaling);
            if self::kind(one) != kind || !alike {
                let message = format!("member {} is not of the same kind as member 1, or not scaled as it is", k + 1);
                let help = format!("export one of them: {}", first.path.parent().unwrap_or(&first.path).display());
                return Err(Failure::input(message, help));
            }
        }
        let mean = |name: &str| name == MEAN && checkpoint.sequences.iter().all(|learned| learned != MEAN);
        let sequence = sequence.filter(|name| !mean(name));
        let begins = match sequence {
            Some(wanted) => {
                format!("the initial state of the learned sequence {}", checkpoint.sequences[first.sequence(wanted)?])
            }
            None => "the mean of the learned initial states".to_owned(),
        };
        let members = all.iter().map(|one| member(one, sequence)).collect::<Result<Vec<_>>>()?;
        let notes = first.notes.as_ref();
        let name = notes.and_then(|notes| notes.experiment["name"].as_str()).unwrap_or("a checkpoint without notes");
        let epochs: Vec<String> = all.iter().map(|one| one.checkpoint.epoch.to_string()).collect();
        let s = if all.len() > 1 { "s" } else { "" };
        Ok(Self {
            about: format!("{name}, epoch{s} {}", epochs.join(", ")),
            begins,
            remark: first.remark(),
            period: first.selection().and_then(|selection| selection.period),
            channels: checkpoint.channels.clone(),
            offset: checkpoint.scaling.offset().to_vec(),
            scale: checkpoint.scaling.scale().to_vec(),
            kind,
            members,
        })
    }

    /// The parts of the state, in their order.
    fn state(&self) -> [Part; 4] {
        let (m, n, Kind { units, delay, .. }) = (self.members.len(), self.channels.len(), self.kind);
        [
            ("internal", vec![m, units]),
            ("past", vec![m, self.kind.past() + 1, n]),
            ("means", vec![m, delay, n]),
            ("steps", vec![1]),
        ]
    }

    /// The state before the first step, part after part.
    fn start(&self) -> Vec<f64> {
        let mut state: Vec<f64> = self.members.iter().flat_map(|member| member.internal.iter().copied()).collect();
        let size = self.state().iter().map(|(_, shape)| shape.iter().product::<usize>()).sum();
        state.resize(size, 0.0);
        state
    }

    /// What the mean is a forecast of, in words.
    fn forecast(&self) -> String {
        match self.kind.delay {
            1 => "the next sample".to_owned(),
            delay => format!("the sample {delay} steps after the one that is given"),
        }
    }
}

fn kind(trained: &Trained) -> Kind {
    let topology = &trained.checkpoint.topology;
    let n = topology.channels();
    Kind {
        delay: topology.delay(),
        units: topology.context_units(),
        inputs: topology.inputs(),
        variance: topology.has_variance(),
        linear_mean: topology.has_linear_mean(),
        velocity: topology.velocity_inputs().is_some(),
        skip: topology.skip().is_some(),
        lags: topology.skip().map_or(0, |skip| skip.taps().len() / (n * n)),
        floor: topology.variance_floor(),
    }
}

fn member(trained: &Trained, sequence: Option<&str>) -> Result<Member> {
    let network = trained.network();
    let (topology, parameters) = (network.topology(), network.parameters());
    let states = &trained.checkpoint.initial_states;
    let internal = match sequence {
        Some(wanted) => states.sequence(trained.sequence(wanted)?),
        None => states.mean(),
    };
    let tau = topology.time_constants();
    let rated = |block: Block| -> Vec<f64> {
        let values = parameters.block(block);
        let columns = values.len() / tau.len();
        values.iter().enumerate().map(|(k, value)| 1.0 / tau[k / columns] * value).collect()
    };
    let as_is = |block: Block| parameters.block(block).to_vec();
    let of_skip = |of: fn(&scrnn::Skip) -> &[f64]| topology.skip().map(|skip| of(skip).to_vec()).unwrap_or_default();
    Ok(Member {
        internal: internal.to_vec(),
        decay: tau.iter().map(|tau| 1.0 - 1.0 / tau).collect(),
        from_input: rated(Block::ContextFromInput),
        from_context: rated(Block::ContextFromContext),
        bias: rated(Block::ContextBias),
        mean_from_context: as_is(Block::MeanFromContext),
        mean_bias: as_is(Block::MeanBias),
        variance_from_context: as_is(Block::VarianceFromContext),
        variance_bias: as_is(Block::VarianceBias),
        velocity: topology.velocity_inputs().unwrap_or_default().iter().map(|sd| 1.0 / sd).collect(),
        taps: of_skip(scrnn::Skip::taps),
        skip_scale: of_skip(scrnn::Skip::scale),
    })
}
