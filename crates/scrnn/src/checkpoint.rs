//! A network, its data's scaling and its optimiser's state as bytes: a versioned safetensors file in memory.
//!
//! Every number that learning changes is a float64 tensor, so that no bit is lost; names and settings are JSON under one
//! metadata key. Equal checkpoints give equal bytes. docs/checkpoint.md lists the tensors and the keys. The caller reads
//! and writes the file.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap, HashSet};

use safetensors::tensor::{Dtype, Metadata, TensorInfo, View};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::features::Skip;
use crate::initial_states::InitialStates;
pub use crate::learning::{OptimiserState, StateTensor};
use crate::parameters::{Block, Parameters};
use crate::scaling::Scaling;
use crate::topology::{Group, Prediction, Topology};

/// The newest version of the format. It is written where the network has what version 1 does not know: linear means, velocity inputs,
/// a skip connection; all else is written as version 1. Both are read.
pub const FORMAT_VERSION: u64 = 2;

/// The one metadata key. The container keeps its keys in a hash map: with two, bytes would differ between runs.
const KEY: &str = "scrnn";

/// What the names of the optimiser's tensors begin with.
const OPTIMISER: &str = "optimiser.";

/// The tensor that holds the optimiser's numbers.
const NUMBERS: &str = "optimiser.numbers";

/// All that is needed to generate, to recognise, and to go on with learning.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// Groups, delay and kind of prediction.
    pub topology: Topology,
    /// Weights and biases.
    pub parameters: Parameters,
    /// u_0 of every sequence, and their mean.
    pub initial_states: InitialStates,
    /// Between the data's units and the network's.
    pub scaling: Scaling,
    /// Names of the channels, O of them.
    pub channels: Vec<String>,
    /// Names of the learned sequences, S of them.
    pub sequences: Vec<String>,
    /// The first xi samples of every sequence, scaled, [S, xi, O]: what a closed loop starts from.
    pub first_inputs: Vec<f64>,
    /// Epochs done.
    pub epoch: u64,
    /// Where the optimiser stands.
    pub optimiser: OptimiserState,
    /// Whatever the caller keeps beside it: the experiment, the data's digest, ...
    pub notes: serde_json::Value,
}

impl Checkpoint {
    /// The checkpoint as a safetensors file.
    ///
    /// Values are written as they are. Where a parameter may be NaN or infinite, ask [`Checkpoint::check`] first:
    /// [`Checkpoint::from_bytes`] refuses such a file.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if the parts do not fit each other, or if names and notes take more than the 100 MB that
    /// safetensors grants to a header.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.check_lengths()?;
        let unwritable = |error: &dyn std::fmt::Display| Error::Checkpoint(format!("cannot be written: {error}"));
        let record = serde_json::to_string(&Record::of(self)).map_err(|error| unwritable(&error))?;
        let metadata = HashMap::from([(KEY.to_owned(), record)]);
        safetensors::serialize(self.tensors(), Some(metadata)).map_err(|error| unwritable(&error))
    }

    /// Reads a safetensors file.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for anything but a whole checkpoint of this version: a newer version, broken JSON, a key or
    /// a tensor that is missing or not known, another dtype or shape, and all that [`Checkpoint::check`] refuses.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (record, mut stored) = open(bytes)?;
        let record = Record::parse(&record)?;
        let topology = record.topology()?;
        // Sizes in the record are only claims. Each is compared with a tensor that the file holds before it is used.
        let units = record.topology.groups.iter().try_fold(0_usize, |sum, group| sum.checked_add(group.units));
        let units = units.ok_or_else(|| refusal("the groups' units are too many to count"))?;
        let time_constants = stored.take("time_constant", &[units])?;
        for (i, (&found, needed)) in time_constants.iter().zip(topology.time_constants()).enumerate() {
            if found.to_bits() != needed.to_bits() {
                let message = format!("tensor time_constant holds {found} at [{i}], the unit's group says {needed}");
                return Err(refusal(message));
            }
        }
        let parameters = stored.take_parameters(&topology)?;
        let (sequences, channels) = (record.sequences.len(), record.channels.len());
        let initial_states = stored.take_initial_states(&topology, sequences)?;
        let (offset, scale) = (stored.take("scaling_offset", &[channels])?, stored.take("scaling_scale", &[channels])?);
        let scaling = Scaling::new(offset, scale)
            .map_err(|error| refusal(format!("tensors scaling_offset and scaling_scale: {error}")))?;
        let first_inputs = stored.take("first_inputs", &[sequences, topology.delay(), channels])?;
        let optimiser = record.optimiser(&mut stored)?;
        if let Some(name) = stored.0.keys().next() {
            return Err(refusal(format!("tensor {name} is not known to format version {FORMAT_VERSION}")));
        }
        let Record { channels, sequences, epoch, notes, .. } = record;
        let checkpoint = Self {
            topology,
            parameters,
            initial_states,
            scaling,
            channels,
            sequences,
            first_inputs,
            epoch,
            optimiser,
            notes,
        };
        checkpoint.check()?;
        Ok(checkpoint)
    }

    /// Whether the parts fit each other and the values make sense, so that what is written can be read.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a list of another length than topology, channels and sequences ask for; for a tensor's
    /// name that occurs twice; for NaN or infinity outside of the optimiser; and for a weight or an initial state that
    /// the topology does not have and that is not 0.
    pub fn check(&self) -> Result<()> {
        self.check_lengths()?;
        for (name, tensor) in self.tensors().iter().filter(|(name, _)| !name.starts_with(OPTIMISER)) {
            tensor.require(name, "a finite number", |_, value| value.is_finite())?;
        }
        self.check_zeros()
    }

    fn check_lengths(&self) -> Result<()> {
        let named = [("channel names", self.channels.len()), ("scaling's channels", self.scaling.channels())];
        for (what, found) in named {
            let needed = self.topology.channels();
            if found != needed {
                return Err(refusal(format!("the number of {what} is {found}; needed: {needed}")));
            }
        }
        let mut names = HashSet::new();
        for (name, Tensor { shape, values }) in self.tensors() {
            if shape.iter().try_fold(1_usize, |size, &n| size.checked_mul(n)) != Some(values.len()) {
                return Err(refusal(format!("tensor {name} has {} values for its shape {shape:?}", values.len())));
            }
            if let Some(twice) = names.replace(name) {
                return Err(refusal(format!("two tensors are named {twice}")));
            }
        }
        Ok(())
    }

    /// What a group's rules rule out must be 0: input weights, output weights, initial states.
    fn check_zeros(&self) -> Result<()> {
        let unit_rules = |rule: fn(&Group) -> bool| self.topology.per_unit(rule).collect::<Vec<_>>();
        let receives = unit_rules(|group| group.receives_input);
        let drives = unit_rules(|group| group.drives_output);
        let learns = unit_rules(|group| group.learns_initial_state);
        let (units, inputs) = (self.topology.context_units(), self.topology.inputs());
        for (name, tensor) in self.tensors() {
            let exists: &dyn Fn(usize) -> bool = match name.as_str() {
                "context_from_input" => &|index| receives[index / inputs],
                "mean_from_context" | "variance_from_context" => &|index| drives[index % units],
                "initial_state" | "initial_state_mean" => &|index| learns[index % units],
                _ => continue,
            };
            tensor
                .require(&name, "0, as the topology has no such value", |index, value| exists(index) || value == 0.0)?;
        }
        Ok(())
    }

    /// Every tensor by its name in the file.
    fn tensors(&self) -> Vec<(String, Tensor<'_>)> {
        fn named<'a>(name: &str, shape: Vec<usize>, values: impl Into<Cow<'a, [f64]>>) -> (String, Tensor<'a>) {
            (name.to_owned(), Tensor { shape, values: values.into() })
        }
        let units = self.topology.context_units();
        let (sequences, channels) = (self.sequences.len(), self.topology.channels());
        let numbers: Vec<f64> = self.optimiser.numbers.iter().map(|&(_, value)| value).collect();
        let mut all = vec![
            named("time_constant", vec![units], self.topology.time_constants()),
            named("initial_state", vec![sequences, units], self.initial_states.values()),
            named("initial_state_mean", vec![units], self.initial_states.mean()),
            named("scaling_offset", vec![channels], self.scaling.offset()),
            named("scaling_scale", vec![channels], self.scaling.scale()),
            named("first_inputs", vec![sequences, self.topology.delay(), channels], &self.first_inputs),
            named(NUMBERS, vec![numbers.len()], numbers),
        ];
        for block in Block::ALL {
            let (shape, values) = (block.shape(&self.topology), self.parameters.block(block));
            if !(shape.contains(&0) && values.is_empty()) {
                all.push(named(block.name(), shape, values));
            }
        }
        for StateTensor { name, shape, values } in &self.optimiser.tensors {
            all.push(named(&format!("{OPTIMISER}{name}"), shape.clone(), values));
        }
        all
    }
}

/// A tensor on its way into the file.
struct Tensor<'a> {
    shape: Vec<usize>,
    values: Cow<'a, [f64]>,
}

impl Tensor<'_> {
    /// Refuses the first value that is not `accepted(index, value)`, by its place.
    fn require(&self, name: &str, needed: &str, accepted: impl Fn(usize, f64) -> bool) -> Result<()> {
        let Some(index) = (0..self.values.len()).find(|&index| !accepted(index, self.values[index])) else {
            return Ok(());
        };
        let (mut place, mut rest) = (vec![0; self.shape.len()], index);
        for (at, size) in place.iter_mut().zip(&self.shape).rev() {
            (*at, rest) = (rest % size, rest / size);
        }
        Err(refusal(format!("tensor {name} holds {} at {place:?}; needed: {needed}", self.values[index])))
    }
}

impl View for Tensor<'_> {
    fn dtype(&self) -> Dtype {
        Dtype::F64
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        self.values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    fn data_len(&self) -> usize {
        size_of_val::<[f64]>(&self.values)
    }
}

/// The tensors of a file that have not been taken yet.
struct Stored<'a>(BTreeMap<String, (TensorInfo, &'a [u8])>);

impl Stored<'_> {
    fn take_parameters(&mut self, topology: &Topology) -> Result<Parameters> {
        let mut blocks = Vec::new();
        for block in Block::ALL {
            let shape = block.shape(topology);
            if !shape.contains(&0) {
                blocks.push((block, self.take(block.name(), &shape)?));
            }
        }
        let mut parameters = Parameters::zeros(topology);
        for (block, values) in blocks {
            parameters.block_mut(block).copy_from_slice(&values);
        }
        Ok(parameters)
    }

    fn take_initial_states(&mut self, topology: &Topology, sequences: usize) -> Result<InitialStates> {
        let units = topology.context_units();
        let values = self.take("initial_state", &[sequences, units])?;
        let mean = self.take("initial_state_mean", &[units])?;
        let mut states = InitialStates::zeros(topology, sequences);
        states.values_mut().copy_from_slice(&values);
        states.mean_mut().copy_from_slice(&mean);
        Ok(states)
    }

    /// Takes a tensor of this very shape.
    fn take(&mut self, name: &str, needed: &[usize]) -> Result<Vec<f64>> {
        let (shape, values) = self.take_any(name)?;
        if shape == needed {
            Ok(values)
        } else {
            Err(refusal(format!("tensor {name} has shape {shape:?}; needed: {needed:?}")))
        }
    }

    /// Takes a tensor of whatever shape.
    fn take_any(&mut self, name: &str) -> Result<(Vec<usize>, Vec<f64>)> {
        let (info, data) = self.0.remove(name).ok_or_else(|| refusal(format!("tensor {name} is missing")))?;
        if info.dtype != Dtype::F64 {
            return Err(refusal(format!("tensor {name} is {:?}; needed: F64", info.dtype)));
        }
        let (values, _) = data.as_chunks();
        Ok((info.shape, values.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect()))
    }
}

/// Takes a safetensors file apart: the text under the metadata key, and the tensors.
///
/// Not by `SafeTensors::deserialize`: its sum of sizes can overflow on a forged header.
fn open(bytes: &[u8]) -> Result<(String, Stored<'_>)> {
    let not_ours = |why: String| refusal(format!("not a whole safetensors file: {why}"));
    let Some((length, rest)) = bytes.split_first_chunk() else {
        return Err(not_ours(format!("it has {} bytes, the length of its header alone takes 8", bytes.len())));
    };
    let length = u64::from_le_bytes(*length);
    let Some((header, data)) = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)) else {
        return Err(not_ours(format!("its header should take {length} bytes, {} are there", rest.len())));
    };
    let header: Metadata =
        serde_json::from_slice(header).map_err(|error| not_ours(format!("its header is broken: {error}")))?;
    if header.data_len() != data.len() {
        return Err(not_ours(format!("its tensors should take {} bytes, {} are there", header.data_len(), data.len())));
    }
    let mut keys = header.metadata().clone().unwrap_or_default();
    let Some(record) = keys.remove(KEY) else {
        return Err(refusal(format!("the metadata key {KEY} is missing: not a file of this program")));
    };
    if let Some(key) = keys.keys().min() {
        return Err(refusal(format!("the metadata key {key} is not known; needed: {KEY} alone")));
    }
    let views = header.tensors().into_iter().map(|(name, info)| {
        let (start, end) = info.data_offsets;
        (name, (info.clone(), &data[start..end]))
    });
    Ok((record, Stored(views.collect())))
}

fn refusal(message: impl Into<String>) -> Error {
    Error::Checkpoint(message.into())
}

/// The JSON under the metadata key.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    format_version: u64,
    epoch: u64,
    channels: Vec<String>,
    sequences: Vec<String>,
    topology: TopologyRecord,
    optimiser: OptimiserRecord,
    notes: serde_json::Value,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TopologyRecord {
    delay: usize,
    prediction: PredictionRecord,
    variance_floor: f64,
    groups: Vec<Group>,
    /// From version 2 on.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    linear_mean: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    velocity_inputs: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    skip: Option<Skip>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum PredictionRecord {
    Mean,
    MeanAndVariance,
}

/// Names only, in the optimiser's order. The values are tensors, as JSON knows neither NaN nor infinity.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OptimiserRecord {
    tensors: Vec<String>,
    numbers: Vec<String>,
}

impl Record {
    fn of(checkpoint: &Checkpoint) -> Self {
        Self {
            format_version: if checkpoint.topology.is_of_the_thesis() { 1 } else { FORMAT_VERSION },
            epoch: checkpoint.epoch,
            channels: checkpoint.channels.clone(),
            sequences: checkpoint.sequences.clone(),
            topology: TopologyRecord {
                delay: checkpoint.topology.delay(),
                prediction: match checkpoint.topology.prediction() {
                    Prediction::Mean => PredictionRecord::Mean,
                    Prediction::MeanAndVariance { .. } => PredictionRecord::MeanAndVariance,
                },
                variance_floor: checkpoint.topology.variance_floor(),
                groups: checkpoint.topology.groups().to_vec(),
                linear_mean: checkpoint.topology.has_linear_mean(),
                velocity_inputs: checkpoint.topology.velocity_inputs().map(<[f64]>::to_vec),
                skip: checkpoint.topology.skip().cloned(),
            },
            optimiser: OptimiserRecord {
                tensors: checkpoint.optimiser.tensors.iter().map(|tensor| tensor.name.clone()).collect(),
                numbers: checkpoint.optimiser.numbers.iter().map(|(name, _)| name.clone()).collect(),
            },
            notes: checkpoint.notes.clone(),
        }
    }

    /// Looks at the version alone before all else: another version may hold other fields.
    fn parse(text: &str) -> Result<Self> {
        #[derive(Deserialize)]
        struct Version {
            format_version: u64,
        }
        let broken = |error| refusal(format!("the JSON of metadata key {KEY}: {error}"));
        match serde_json::from_str(text).map_err(broken)? {
            Version { format_version: 1..=FORMAT_VERSION } => serde_json::from_str(text).map_err(broken),
            Version { format_version: 0 } => Err(refusal("format version 0 does not exist")),
            Version { format_version } => Err(refusal(format!(
                "format version {format_version} is newer than {FORMAT_VERSION}, which this program reads"
            ))),
        }
    }

    fn topology(&self) -> Result<Topology> {
        let floor = self.topology.variance_floor;
        let prediction = match self.topology.prediction {
            PredictionRecord::Mean if floor == 0.0 => Prediction::Mean,
            PredictionRecord::Mean => {
                return Err(refusal(format!("variance_floor is {floor} without variance units; needed: 0")));
            }
            PredictionRecord::MeanAndVariance => Prediction::MeanAndVariance { floor },
        };
        let groups = self.topology.groups.clone();
        let TopologyRecord { delay, linear_mean, velocity_inputs, skip, .. } = &self.topology;
        let built = || {
            let mut topology =
                Topology::new(self.channels.len(), *delay, groups, prediction)?.with_linear_mean(*linear_mean);
            if let Some(deviations) = velocity_inputs {
                topology = topology.with_velocity_inputs(deviations.clone())?;
            }
            if let Some(skip) = skip {
                topology = topology.with_skip(Skip::new(skip.taps().to_vec(), skip.scale().to_vec())?)?;
            }
            Ok(topology)
        };
        built().map_err(|error: Error| refusal(error.to_string()))
    }

    fn optimiser(&self, stored: &mut Stored<'_>) -> Result<OptimiserState> {
        let OptimiserRecord { tensors, numbers } = &self.optimiser;
        let values = stored.take(NUMBERS, &[numbers.len()])?;
        let tensor = |name: &String| {
            let (shape, values) = stored.take_any(&format!("{OPTIMISER}{name}"))?;
            Ok(StateTensor { name: name.clone(), shape, values })
        };
        let tensors = tensors.iter().map(tensor).collect::<Result<_>>()?;
        Ok(OptimiserState { tensors, numbers: numbers.iter().cloned().zip(values).collect() })
    }
}

#[cfg(test)]
mod tests;
