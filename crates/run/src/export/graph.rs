//! ONNX on the wire: a graph of operators, its constants, and the model around it (onnx.proto, <https://onnx.ai>).
//!
//! Constants are initializers. Values are named by numbers, so that equal graphs give equal bytes.

use scrnn_sim::recording::ProtobufMessage as Message;

use super::onnx::Precision;

/// Version of the file's form, and of the operators.
const IR_VERSION: u64 = 8;
const OPSET: u64 = 17;

/// `TensorProto.DataType` of indices.
const INT64: u64 = 7;

/// `AttributeProto.AttributeType`.
const INT: u64 = 2;
const INTS: u64 = 7;

/// A value of the graph, by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name(String);

/// A graph under construction.
#[derive(Debug)]
pub struct Graph {
    precision: Precision,
    nodes: Vec<Message>,
    constants: Vec<Message>,
    inputs: Vec<Message>,
    outputs: Vec<Message>,
    indices: Vec<(Vec<i64>, Name)>,
    count: usize,
}

impl Graph {
    pub fn new(precision: Precision) -> Self {
        let none = Vec::new;
        let indices = Vec::new();
        Self { precision, nodes: none(), constants: none(), inputs: none(), outputs: none(), indices, count: 0 }
    }

    /// An input of the whole graph.
    pub fn input(&mut self, name: &str, shape: &[usize], about: &str) -> Name {
        self.inputs.push(described(name, self.precision, shape, about));
        Name(name.to_owned())
    }

    /// Makes a value an output of the whole graph.
    pub fn output(&mut self, value: &Name, name: &str, shape: &[usize], about: &str) {
        self.outputs.push(described(name, self.precision, shape, about));
        self.push("Identity", &[value], name, &[], &[]);
    }

    /// Numbers that do not change.
    pub fn constant(&mut self, shape: &[usize], values: &[f64]) -> Name {
        let name = self.fresh();
        let mut bytes = Vec::with_capacity(values.len() * 8);
        for value in values {
            match self.precision {
                Precision::Float64 => bytes.extend(value.to_le_bytes()),
                Precision::Float32 => bytes.extend((*value as f32).to_le_bytes()),
            }
        }
        self.constants.push(tensor(&name, self.precision.data_type(), shape, &bytes));
        name
    }

    /// A list of whole numbers, which some operators take as an input.
    fn integers(&mut self, values: &[i64]) -> Name {
        if let Some((_, name)) = self.indices.iter().find(|(known, _)| known == values) {
            return name.clone();
        }
        let name = self.fresh();
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constants.push(tensor(&name, INT64, &[values.len()], &bytes));
        self.indices.push((values.to_vec(), name.clone()));
        name
    }

    /// What an operator makes of its inputs.
    pub fn node(&mut self, operator: &str, inputs: &[&Name]) -> Name {
        self.node_with(operator, inputs, &[], &[])
    }

    /// These side by side along an axis.
    pub fn concat(&mut self, values: &[&Name], axis: u64) -> Name {
        self.node_with("Concat", values, &[("axis", axis)], &[])
    }

    /// From one place along an axis up to another.
    pub fn slice(&mut self, value: &Name, axis: i64, range: std::ops::Range<usize>) -> Name {
        let [from, to] = [range.start, range.end].map(|place| self.integers(&[place as i64]));
        let axis = self.integers(&[axis]);
        self.node("Slice", &[value, &from, &to, &axis])
    }

    /// The same numbers in another shape.
    pub fn reshape(&mut self, value: &Name, shape: &[usize]) -> Name {
        let shape = self.integers(&shape.iter().map(|size| *size as i64).collect::<Vec<_>>());
        self.node("Reshape", &[value, &shape])
    }

    /// The same numbers as often as they fit into a shape.
    pub fn expand(&mut self, value: &Name, shape: &[usize]) -> Name {
        let shape = self.integers(&shape.iter().map(|size| *size as i64).collect::<Vec<_>>());
        self.node("Expand", &[value, &shape])
    }

    /// The mean along the first axis, which is gone then.
    pub fn mean_of_first_axis(&mut self, value: &Name) -> Name {
        self.node_with("ReduceMean", &[value], &[("keepdims", 0)], &[("axes", 0)])
    }

    fn node_with(&mut self, operator: &str, inputs: &[&Name], int: &[(&str, u64)], ints: &[(&str, u64)]) -> Name {
        let name = self.fresh();
        self.push(operator, inputs, &name.0, int, ints);
        name
    }

    /// `int` are attributes that are numbers, `ints` such that are lists of one.
    fn push(&mut self, operator: &str, inputs: &[&Name], output: &str, int: &[(&str, u64)], ints: &[(&str, u64)]) {
        let mut node = Message::default();
        inputs.iter().for_each(|input| node.text(1, &input.0));
        node.text(2, output);
        node.text(4, operator);
        for (field, kind, (name, value)) in
            int.iter().map(|one| (3, INT, one)).chain(ints.iter().map(|one| (8, INTS, one)))
        {
            node.message(5, |attribute| {
                attribute.text(1, name);
                attribute.integer_or_zero(field, *value);
                attribute.integer(20, kind);
            });
        }
        self.nodes.push(node);
    }

    fn fresh(&mut self) -> Name {
        self.count += 1;
        Name(format!("v{}", self.count))
    }

    /// The model: the graph, who wrote it, and what is to be known of it.
    pub fn into_model(self, about: &str, notes: &[(&str, &str)]) -> Vec<u8> {
        let mut graph = Message::default();
        let list = |graph: &mut Message, field: u32, messages: Vec<Message>| {
            messages.into_iter().for_each(|message| graph.bytes(field, &message.into_bytes()));
        };
        list(&mut graph, 1, self.nodes);
        graph.text(2, "scrnn_step");
        list(&mut graph, 5, self.constants);
        list(&mut graph, 11, self.inputs);
        list(&mut graph, 12, self.outputs);
        let mut model = Message::default();
        model.integer(1, IR_VERSION);
        model.text(2, "scrnn");
        model.text(3, env!("CARGO_PKG_VERSION"));
        model.text(6, about);
        model.bytes(7, &graph.into_bytes());
        model.message(8, |operators| operators.integer(2, OPSET));
        for (key, value) in notes {
            model.message(14, |note| {
                note.text(1, key);
                note.text(2, value);
            });
        }
        model.into_bytes()
    }
}

/// A `ValueInfoProto`.
fn described(name: &str, precision: Precision, shape: &[usize], about: &str) -> Message {
    let mut value = Message::default();
    value.text(1, name);
    value.message(2, |kind| {
        kind.message(1, |tensor| {
            tensor.integer(1, precision.data_type());
            tensor.message(2, |dimensions| {
                for size in shape {
                    dimensions.message(1, |dimension| dimension.integer(1, *size as u64));
                }
            });
        });
    });
    value.text(3, about);
    value
}

/// A `TensorProto`.
fn tensor(name: &Name, data_type: u64, shape: &[usize], bytes: &[u8]) -> Message {
    let mut tensor = Message::default();
    shape.iter().for_each(|size| tensor.integer_or_zero(1, *size as u64));
    tensor.integer(2, data_type);
    tensor.text(8, &name.0);
    tensor.bytes(9, bytes);
    tensor
}
