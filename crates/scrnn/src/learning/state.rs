//! An optimiser's memory, in and out of a checkpoint.

use crate::error::{Error, Result};

/// Tensors and numbers of an optimiser, enough to go on bit for bit. Any value is kept, also NaN and infinity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OptimiserState {
    /// Velocities, moments and their like. Names are distinct, and none is `numbers`.
    pub tensors: Vec<StateTensor>,
    /// Counters, rates and their like.
    pub numbers: Vec<(String, f64)>,
}

/// One tensor of an optimiser.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StateTensor {
    /// Its name, to which the file adds `optimiser.` in front.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its values, row-major.
    pub values: Vec<f64>,
}

/// Everything that an optimiser must find again to go on bit for bit, under its names.
pub(super) struct Fields<'a> {
    /// Name, shape, values.
    pub tensors: Vec<(&'static str, Vec<usize>, &'a mut Vec<f64>)>,
    pub numbers: Vec<(&'static str, &'a mut f64)>,
}

impl Fields<'_> {
    pub fn save(self) -> OptimiserState {
        let tensor = |(name, shape, values): (&str, _, &mut Vec<f64>)| StateTensor {
            name: name.to_owned(),
            shape,
            values: values.clone(),
        };
        OptimiserState {
            tensors: self.tensors.into_iter().map(tensor).collect(),
            numbers: self.numbers.into_iter().map(|(name, value)| (name.to_owned(), *value)).collect(),
        }
    }

    pub fn load(self, state: &OptimiserState) -> Result<()> {
        for (name, shape, values) in self.tensors {
            match state.tensors.iter().find(|tensor| tensor.name == name) {
                Some(tensor) if tensor.shape == shape => values.copy_from_slice(&tensor.values),
                Some(tensor) => {
                    let shapes = format!("optimiser.{name} has the shape {:?}; needed: {shape:?}", tensor.shape);
                    return Err(Error::Checkpoint(shapes));
                }
                None => return Err(Error::Checkpoint(format!("optimiser.{name} is missing"))),
            }
        }
        for (name, value) in self.numbers {
            let found = state.numbers.iter().find(|(other, _)| other == name);
            *value = found.ok_or_else(|| Error::Checkpoint(format!("the optimiser's {name} is missing")))?.1;
        }
        Ok(())
    }
}
