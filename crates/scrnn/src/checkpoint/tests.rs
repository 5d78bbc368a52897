//! Round trips to the bit, every refusal by its message, and damaged bytes.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt, SeedableRng};
use serde_json::{Value, json};

use super::*;
use crate::initialization::initialize;

/// Two groups, delay 2, and an optimiser whose names are not in alphabetical order.
fn sample() -> Checkpoint {
    let groups = vec![Group::fast(3, 2.5), Group::slow(2, 70.0)];
    let topology = Topology::new(2, 2, groups, Prediction::MeanAndVariance { floor: 0.001 }).unwrap();
    let (network, mut initial_states) = initialize(&topology, 3, 5);
    for s in 0..3 {
        initial_states.sequence_mut(s)[3..].copy_from_slice(&[0.1 * (s as f64 + 1.0), -0.0]);
    }
    let tensor = |name: &str, shape: &[usize], values: &[f64]| StateTensor {
        name: name.into(),
        shape: shape.into(),
        values: values.into(),
    };
    Checkpoint {
        topology,
        parameters: network.parameters,
        initial_states,
        scaling: Scaling::new(vec![10.0, -0.1], vec![0.3, 7.0]).unwrap(),
        channels: vec!["x".into(), "y \"2\"".into()],
        sequences: vec!["one".into(), String::new(), "drei-\u{fc}".into()],
        first_inputs: (0..12).map(|k| 0.1 * f64::from(k)).collect(),
        epoch: u64::MAX,
        optimiser: OptimiserState {
            tensors: vec![tensor("velocity", &[2, 2], &[1e-320, -0.0, 0.1, 3.0]), tensor("count", &[], &[7.0])],
            numbers: vec![("rate".into(), 0.1 + 0.2), ("beta".into(), 5e-324)],
        },
        notes: json!({ "z": [1, 0.1, null], "a": "text" }),
    }
}

fn mean_only() -> Checkpoint {
    let full = sample();
    let topology = Topology::new(2, 2, full.topology.groups().to_vec(), Prediction::Mean).unwrap();
    let (network, _) = initialize(&topology, 3, 5);
    Checkpoint { topology, parameters: network.parameters, ..full }
}

/// Dtype, shape and bytes of each tensor.
type Tensors = BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>;

struct Raw(Dtype, Vec<usize>, Vec<u8>);

impl View for Raw {
    fn dtype(&self) -> Dtype {
        self.0
    }

    fn shape(&self) -> &[usize] {
        &self.1
    }

    fn data(&self) -> Cow<'_, [u8]> {
        (&self.2).into()
    }

    fn data_len(&self) -> usize {
        self.2.len()
    }
}

/// A file of these parts, whatever they are.
fn file(tensors: Tensors, metadata: Option<HashMap<String, String>>) -> Vec<u8> {
    let views = tensors.into_iter().map(|(name, (dtype, shape, data))| (name, Raw(dtype, shape, data)));
    safetensors::serialize(views, metadata).unwrap()
}

/// The record and the tensors of a checkpoint.
fn parts(checkpoint: &Checkpoint) -> (Value, Tensors) {
    let bytes = checkpoint.to_bytes().unwrap();
    let (record, stored) = open(&bytes).unwrap();
    let tensors = stored.0.into_iter().map(|(name, (info, data))| (name, (info.dtype, info.shape, data.to_vec())));
    (serde_json::from_str(&record).unwrap(), tensors.collect())
}

/// What the reader says to a checkpoint after `edit`.
fn refused(checkpoint: &Checkpoint, edit: impl FnOnce(&mut Value, &mut Tensors)) -> String {
    let (mut record, mut tensors) = parts(checkpoint);
    edit(&mut record, &mut tensors);
    let metadata = HashMap::from([(KEY.to_owned(), record.to_string())]);
    message(&file(tensors, Some(metadata)))
}

fn message(bytes: &[u8]) -> String {
    match Checkpoint::from_bytes(bytes) {
        Err(Error::Checkpoint(message)) => message,
        other => panic!("not refused as a checkpoint: {other:?}"),
    }
}

/// A float64 tensor.
fn f64s(shape: &[usize], values: &[f64]) -> (Dtype, Vec<usize>, Vec<u8>) {
    (Dtype::F64, shape.to_vec(), values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// Overwrites one value.
fn set(tensors: &mut Tensors, name: &str, index: usize, value: f64) {
    tensors.get_mut(name).unwrap().2[8 * index..8 * (index + 1)].copy_from_slice(&value.to_le_bytes());
}

#[test]
fn what_is_written_is_read_back_equal_and_gives_the_same_bytes() {
    for checkpoint in [sample(), mean_only()] {
        let bytes = checkpoint.to_bytes().unwrap();
        let read = Checkpoint::from_bytes(&bytes).unwrap();
        assert_eq!(read, checkpoint);
        assert_eq!(read.to_bytes().unwrap(), bytes);
        assert_eq!(checkpoint.clone().to_bytes().unwrap(), bytes);
        assert_eq!(read.initial_states.sequence(0)[4].to_bits(), (-0.0_f64).to_bits());
    }
}

#[test]
fn a_network_of_mean_units_has_no_variance_tensors() {
    let names: Vec<String> = parts(&mean_only()).1.into_keys().collect();
    assert!(names.iter().all(|name| !name.starts_with("variance")), "{names:?}");
    assert!(parts(&sample()).1.contains_key("variance_bias"));
}

#[test]
fn the_optimiser_keeps_the_bits_of_nan_and_infinity() {
    let mut checkpoint = sample();
    let odd = [f64::from_bits(0x7ff8_0000_dead_beef), f64::NEG_INFINITY];
    checkpoint.optimiser.numbers[0].1 = odd[0];
    checkpoint.optimiser.tensors[0].values[1..3].copy_from_slice(&odd);
    let read = Checkpoint::from_bytes(&checkpoint.to_bytes().unwrap()).unwrap().optimiser;
    assert_eq!(read.numbers[0].1.to_bits(), odd[0].to_bits());
    assert_eq!([1, 2].map(|k| read.tensors[0].values[k].to_bits()), odd.map(f64::to_bits));
}

#[test]
fn a_newer_version_is_refused_whatever_else_it_holds() {
    let message = refused(&sample(), |record, _| *record = json!({ "format_version": 7, "shape": "unheard of" }));
    assert_eq!(message, "format version 7 is newer than 2, which this program reads");
    let error = Error::Checkpoint(message).to_string();
    assert_eq!(error, "checkpoint: format version 7 is newer than 2, which this program reads");
    let message = refused(&sample(), |record, _| record["format_version"] = json!(0));
    assert_eq!(message, "format version 0 does not exist");
}

#[test]
fn a_record_that_is_not_of_version_1_is_refused() {
    let says = |part: &str, edit: fn(&mut Value)| {
        let message = refused(&sample(), |record, _| edit(record));
        assert!(message.starts_with("the JSON of metadata key scrnn: ") && message.contains(part), "{message}");
    };
    says("missing field `format_version`", |record| *record = json!({}));
    says("unknown field `colour`", |record| record["colour"] = json!("red"));
    says("unknown field `colour`", |record| record["topology"]["colour"] = json!("red"));
    says("unknown field `colour`", |record| record["topology"]["groups"][0]["colour"] = json!("red"));
    says("missing field `notes`", |record| drop(record.as_object_mut().unwrap().remove("notes")));
    says("unknown variant `median`", |record| record["topology"]["prediction"] = json!("median"));
    says("invalid type", |record| record["epoch"] = json!("many"));
}

#[test]
fn metadata_is_the_one_key_and_json() {
    let (record, tensors) = parts(&sample());
    let says = |pairs: &[(&str, &str)]| {
        let metadata = pairs.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        message(&file(tensors.clone(), Some(metadata)))
    };
    let missing = "the metadata key scrnn is missing: not a file of this program";
    assert_eq!(message(&file(tensors.clone(), None)), missing);
    assert_eq!(says(&[("format", "pt")]), missing);
    assert_eq!(
        says(&[(KEY, &record.to_string()), ("format", "pt")]),
        "the metadata key format is not known; needed: scrnn alone"
    );
    assert!(says(&[(KEY, "{\"format_version\": 1,")]).starts_with("the JSON of metadata key scrnn: EOF"));
}

#[test]
fn each_missing_tensor_is_named() {
    let (record, tensors) = parts(&sample());
    assert_eq!(tensors.len(), 16);
    for name in tensors.keys() {
        let mut tensors = tensors.clone();
        tensors.remove(name);
        let metadata = HashMap::from([(KEY.to_owned(), record.to_string())]);
        assert_eq!(message(&file(tensors, Some(metadata))), format!("tensor {name} is missing"));
    }
}

#[test]
fn a_tensor_that_nothing_asks_for_is_named() {
    let message = refused(&sample(), |_, tensors| drop(tensors.insert("optimiser.extra".into(), f64s(&[1], &[0.0]))));
    assert_eq!(message, "tensor optimiser.extra is not known to format version 2");
    let message = refused(&mean_only(), |_, tensors| {
        tensors.insert("variance_bias".into(), f64s(&[2], &[0.0, 0.0]));
    });
    assert_eq!(message, "tensor variance_bias is not known to format version 2");
}

#[test]
fn another_dtype_is_named() {
    let edit = |_: &mut Value, tensors: &mut Tensors| {
        tensors.insert("mean_bias".into(), (Dtype::F32, vec![2], vec![0; 8]));
    };
    assert_eq!(refused(&sample(), edit), "tensor mean_bias is F32; needed: F64");
}

#[test]
fn another_shape_is_named_with_both_shapes() {
    let says = |name: &str, shape: &[usize], needed: &str| {
        let size = shape.iter().product();
        let message = refused(&sample(), |_, tensors| {
            tensors.insert(name.into(), f64s(shape, &vec![0.5; size]));
        });
        assert_eq!(message, format!("tensor {name} has shape {shape:?}; needed: {needed}"));
    };
    says("mean_bias", &[3], "[2]");
    says("context_from_input", &[2, 5], "[5, 2]");
    says("context_from_context", &[25], "[5, 5]");
    says("initial_state", &[2, 5], "[3, 5]");
    says("first_inputs", &[3, 1, 2], "[3, 2, 2]");
    says("scaling_scale", &[1], "[2]");
    says("time_constant", &[4], "[5]");
    says("optimiser.numbers", &[1], "[2]");
}

#[test]
fn sizes_that_no_tensor_bears_out_are_refused_before_memory_is_asked_for() {
    let says = |edit: fn(&mut Value)| refused(&sample(), |record, _| edit(record));
    let huge = says(|record| record["topology"]["groups"][0]["units"] = json!(u64::MAX / 4));
    assert_eq!(huge, format!("tensor time_constant has shape [5]; needed: [{}]", u64::MAX / 4 + 2));
    let overflow = says(|record| record["topology"]["groups"][0]["units"] = json!(u64::MAX));
    assert_eq!(overflow, "the groups' units are too many to count");
    let delay = says(|record| record["topology"]["delay"] = json!(u64::MAX));
    assert_eq!(delay, format!("tensor first_inputs has shape [3, 2, 2]; needed: [3, {}, 2]", u64::MAX));
}

#[test]
fn values_that_are_not_finite_are_named_by_their_place() {
    let says = |name: &str, index: usize, value: f64, place: &str| {
        let message = refused(&sample(), |_, tensors| set(tensors, name, index, value));
        assert_eq!(message, format!("tensor {name} holds {value} at {place}; needed: a finite number"));
    };
    says("context_from_context", 11, f64::NAN, "[2, 1]");
    says("mean_bias", 1, f64::INFINITY, "[1]");
    says("initial_state", 14, f64::NEG_INFINITY, "[2, 4]");
    says("first_inputs", 7, f64::NAN, "[1, 1, 1]");
}

#[test]
fn values_that_the_topology_does_not_have_must_be_zero() {
    let says = |name: &str, index: usize, place: &str| {
        let message = refused(&sample(), |_, tensors| set(tensors, name, index, 0.5));
        assert_eq!(
            message,
            format!("tensor {name} holds 0.5 at {place}; needed: 0, as the topology has no such value")
        );
    };
    says("context_from_input", 6, "[3, 0]");
    says("mean_from_context", 9, "[1, 4]");
    says("variance_from_context", 3, "[0, 3]");
    says("initial_state", 2, "[0, 2]");
    says("initial_state_mean", 0, "[0]");
}

#[test]
fn what_topology_and_scaling_refuse_is_refused() {
    let says = |part: &str, edit: fn(&mut Value, &mut Tensors)| {
        let message = refused(&sample(), edit);
        assert!(message.contains(part), "{message}");
    };
    says("delay is 0", |record, _| record["topology"]["delay"] = json!(0));
    says("number of channels is 0", |record, _| record["channels"] = json!([]));
    says("variance floor is -1", |record, _| record["topology"]["variance_floor"] = json!(-1));
    says("variance_floor is 0.001 without variance units", |record, _| {
        record["topology"]["prediction"] = json!("mean")
    });
    says("scaling_scale: a scale is 0", |_, tensors| set(tensors, "scaling_scale", 1, 0.0));
    says("time_constant holds 69 at [4], the unit's group says 70", |_, tensors| {
        set(tensors, "time_constant", 4, 69.0)
    });
}

#[test]
fn parts_that_do_not_fit_each_other_are_found_before_they_are_written() {
    let says = |part: &str, edit: fn(&mut Checkpoint)| {
        let mut checkpoint = sample();
        assert_eq!(checkpoint.check(), Ok(()));
        edit(&mut checkpoint);
        let error = checkpoint.check().unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    };
    says("the number of channel names is 1; needed: 2", |c| drop(c.channels.pop()));
    says("the number of scaling's channels is 3; needed: 2", |c| c.scaling = Scaling::identity(3));
    says("tensor initial_state has 15 values for its shape [2, 5]", |c| drop(c.sequences.pop()));
    says("tensor first_inputs has 11 values for its shape [3, 2, 2]", |c| c.first_inputs.truncate(11));
    says("tensor variance_from_context has 0 values for its shape [2, 5]", |c| c.parameters = mean_only().parameters);
    says("tensor variance_from_context has 10 values for its shape [0, 5]", |c| c.topology = mean_only().topology);
    says("tensor optimiser.count has 1 values for its shape [2]", |c| c.optimiser.tensors[1].shape = vec![2]);
    says("two tensors are named optimiser.numbers", |c| {
        c.optimiser.tensors[0] = StateTensor { name: "numbers".into(), shape: vec![0], values: vec![] };
    });
    says("tensor mean_bias holds NaN at [0]", |c| c.parameters.block_mut(Block::MeanBias)[0] = f64::NAN);
}

#[test]
fn a_file_that_was_cut_short_or_is_something_else_says_so() {
    let whole = sample().to_bytes().unwrap();
    let says = |bytes: &[u8], part: &str| {
        let message = message(bytes);
        assert!(message.starts_with("not a whole safetensors file: ") && message.contains(part), "{message}");
    };
    says(&[], "it has 0 bytes");
    says(&whole[..100], "its header should take");
    says(&whole[..whole.len() - 1], "its tensors should take");
    says(&[&whole[..], &[0]].concat(), "its tensors should take");
    says(b"x, y\n0.1, 0.2\n0.3, 0.4\n", "its header should take");
    says(&[&8_u64.to_le_bytes()[..], b"not json"].concat(), "its header is broken");
}

#[test]
fn a_forged_header_whose_sizes_overflow_is_refused() {
    let size = (1_u64 << 61) - 8;
    let tensors = (0..8).map(|k| {
        let info = json!({ "dtype": "F64", "shape": [size / 8], "data_offsets": [k * size, (k + 1) * size] });
        (format!("t{k}"), info)
    });
    let header = Value::Object(tensors.collect()).to_string();
    let bytes = [&(header.len() as u64).to_le_bytes(), header.as_bytes()].concat();
    let needed = format!("its tensors should take {} bytes, 0 are there", 8 * size);
    assert_eq!(message(&bytes), format!("not a whole safetensors file: {needed}"));
}

/// Whatever damage is overlooked must give a checkpoint that is sound.
#[test]
fn damaged_bytes_are_refused_or_read_but_never_panic() {
    let whole = sample().to_bytes().unwrap();
    let header = 8 + u64::from_le_bytes(*whole.first_chunk().unwrap()) as usize;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut refusals, mut readings) = (0, 0);
    for _ in 0..20_000 {
        let mut bytes = whole.clone();
        for _ in 0..random.random_range(1..4) {
            // Half of the damage in the header, where it does most.
            let end = if random.random() { header } else { bytes.len() };
            let at = random.random_range(0..end);
            match random.random_range(0..4) {
                0 => bytes[at] ^= 1 << random.random_range(0..8),
                1 => bytes[at] = random.next_u32() as u8,
                2 => {
                    for byte in bytes[at..end].iter_mut().take_while(|byte| byte.is_ascii_digit()) {
                        *byte = b'0' + random.random_range(0..10_u8);
                    }
                }
                _ => {
                    let other = random.random_range(0..end);
                    bytes.swap(at, other);
                }
            }
        }
        if random.random_ratio(1, 8) {
            bytes.truncate(random.random_range(0..=bytes.len()));
        }
        match Checkpoint::from_bytes(&bytes) {
            Ok(read) => {
                readings += 1;
                let again = read.to_bytes().unwrap();
                assert_eq!(Checkpoint::from_bytes(&again).unwrap().to_bytes().unwrap(), again);
            }
            Err(Error::Checkpoint(_)) => refusals += 1,
            Err(other) => panic!("not an error of a checkpoint: {other}"),
        }
    }
    assert!(refusals > 10_000 && readings > 1_000, "{refusals} refused, {readings} read");
}

#[test]
fn the_documentation_shows_this_very_record_and_every_tensor() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/checkpoint.md");
    let text = std::fs::read_to_string(path).unwrap();
    let example = text.split("```json\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let record = Record::parse(example).unwrap();
    assert_eq!(record.topology().unwrap().groups().len(), 2);
    let value: Value = serde_json::from_str(example).unwrap();
    assert_eq!(serde_json::to_value(&record).unwrap(), value);
    for name in parts(&sample()).1.keys().filter(|name| !name.starts_with(OPTIMISER)) {
        assert!(text.contains(&format!("| `{name}` |")), "{name}");
    }
}
