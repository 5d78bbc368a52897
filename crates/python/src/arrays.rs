//! numpy's arrays to sequences and back.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use scrnn::dataset::{Dataset, Sequence};
use scrnn_run::failure::Failure;
use scrnn_run::generating::Fields;

use crate::failure::raise;

/// Sequences as they come from Python: names of channels, names of sequences, and an array of float64, steps x channels, for each.
#[derive(FromPyObject)]
pub struct Given<'py>(Vec<String>, Vec<String>, Vec<PyReadonlyArray2<'py, f64>>);

impl Given<'_> {
    /// Copies the samples, once.
    pub fn dataset(&self) -> PyResult<Dataset> {
        let Self(channels, names, arrays) = self;
        let mut sequences = Vec::with_capacity(arrays.len());
        for (name, array) in names.iter().zip(arrays) {
            let n = array.shape()[1];
            if n != channels.len() {
                let message = format!("sequence {name} has {n} channels, and {} are named", channels.len());
                return Err(raise(Failure::input(message, "all sequences need the same channels")));
            }
            let values = match array.as_slice() {
                Ok(values) => values.to_vec(),
                Err(_) => array.as_array().iter().copied().collect(),
            };
            let sequence = Sequence::new(name.clone(), n, values);
            sequences.push(sequence.map_err(|error| raise(error.into()))?);
        }
        Dataset::new(channels.clone(), sequences).map_err(|error| raise(error.into()))
    }
}

/// What Python gets of a data set: names of channels, names of sequences, arrays.
pub type Arrays<'py> = (Vec<String>, Vec<String>, Vec<Bound<'py, PyArray2<f64>>>);

/// A data set as arrays.
pub fn arrays<'py>(py: Python<'py>, data: &Dataset) -> PyResult<Arrays<'py>> {
    let n = data.channels().len();
    let rows = data.sequences().iter().map(|sequence| matrix(py, sequence.values().to_vec(), n));
    let names = data.sequences().iter().map(|sequence| sequence.name.clone()).collect();
    Ok((data.channels().to_vec(), names, rows.collect::<PyResult<_>>()?))
}

/// Fields as a dict of data sets.
pub fn fields<'py>(py: Python<'py>, fields: &Fields) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, data) in fields {
        dict.set_item(name, arrays(py, data)?)?;
    }
    Ok(dict)
}

/// Values as rows of `columns`; the array takes them over.
pub fn matrix(py: Python<'_>, values: Vec<f64>, columns: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let rows = values.len().checked_div(columns).unwrap_or(0);
    PyArray1::from_vec(py, values).reshape([rows, columns])
}

/// Rows of `columns` values each as one array.
pub fn rows<'py>(py: Python<'py>, rows: &[Vec<f64>], columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    matrix(py, rows.concat(), columns)
}

/// Blocks of rows as one array; all blocks have as many rows.
pub fn blocks<'py>(py: Python<'py>, blocks: &[Vec<Vec<f64>>], columns: usize) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let steps = blocks.first().map_or(0, Vec::len);
    let values: Vec<f64> = blocks.iter().flatten().flatten().copied().collect();
    PyArray1::from_vec(py, values).reshape([blocks.len(), steps, columns])
}
