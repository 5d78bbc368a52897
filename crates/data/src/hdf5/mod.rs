//! HDF5: demonstrations of robomimic and ALOHA, and any data sets of numbers by their paths.
//!
//! | what is in the file | what becomes of it |
//! |---|---|
//! | `data/demo_0/actions`, `data/demo_0/obs/...` (robomimic) | a sequence for each demo, in natural order |
//! | `observations/qpos`, `action` (ALOHA) | one sequence |
//! | several groups alike, e.g. `run_1/q`, `run_2/q` | a sequence for each group |
//! | data sets of one length | one sequence, with all of them side by side |
//! | one data set of three axes | sequences x steps x channels |
//!
//! `arrays` names data sets by their paths, in the file or within a demo. The channel 2 of `obs/q` is called `obs/q.2`.
//! A MATLAB 7.3 file is one of these with its axes in reverse. A reader of our own: `hdf5` needs a system library, and of
//! the readers in Rust one aborts on damaged files and the other is 38 crates.

use std::collections::BTreeSet;

use crate::problem::FormatProblem;
use crate::samples::Samples;
use crate::source::Source;
use crate::windows::Windows;
use crate::{FileError, Selection};

mod chunks;
mod dataset;
mod file;
mod filters;
mod group;
mod heap;
mod kind;
mod layout;
mod object;
mod tree;

use dataset::Description;
use file::File;
use group::{is_group, links};
use object::Object;

/// Groups in groups that are followed.
const DEEPEST: usize = 24;

/// A data set and where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its path, without a slash at the beginning.
    pub path: String,
    /// Its type and shape. Axes are in the order of the one who wrote them.
    pub about: Description,
    address: u64,
}

/// Reads a file.
///
/// # Errors
/// [`FileError`].
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    of_windows(Windows::of(source)?, source, selection)
}

/// Reads a file that is open already.
pub fn of_windows(windows: Windows<'_>, source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    // What was kept to find the data sets is given back before they are read.
    let budget = source.budget();
    let contents = File::open(&windows, budget).and_then(|file| Contents::read(&file));
    let contents = contents.map_err(|problem| windows.failure(source, problem))?;
    let windows = windows.forget(budget);
    let samples = File::open(&windows, budget).and_then(|file| layout::samples(&file, &contents, selection));
    samples.map_err(|problem| windows.failure(source, problem))
}

/// All data sets of a file.
#[derive(Debug, Default)]
pub struct Contents {
    /// In the natural order of their paths.
    pub data_sets: Vec<Found>,
    groups: BTreeSet<u64>,
}

impl Contents {
    fn read(file: &File<'_>) -> Result<Self, FormatProblem> {
        let mut contents = Self::default();
        let root = Object::read(file, file.root)?;
        contents.walk(file, &root, file.root, "", DEEPEST)?;
        contents.data_sets.sort_by(|a, b| crate::natural(&a.path, &b.path));
        Ok(contents)
    }

    fn walk(
        &mut self,
        file: &File<'_>,
        group: &Object<'_>,
        address: u64,
        path: &str,
        deeper: usize,
    ) -> Result<(), FormatProblem> {
        // A group may be linked from several places, and from below.
        let Some(deeper) = deeper.checked_sub(1).filter(|_| self.groups.insert(address)) else { return Ok(()) };
        for link in links(file, group)? {
            // What MATLAB keeps for itself: `#refs#`, `#subsystem#`.
            if link.name.starts_with('#') {
                continue;
            }
            let path = if path.is_empty() { link.name } else { format!("{path}/{}", link.name) };
            file.budget.take(path.len() + size_of::<Found>())?;
            let object = Object::read(file, link.address)?;
            if is_group(&object) {
                self.walk(file, &object, link.address, &path, deeper)?;
                continue;
            }
            let about = match Description::of(file, &object) {
                // What cannot be read may not be wanted.
                Err(FormatProblem::NotRead { .. }) => None,
                about => about?,
            };
            if let Some(mut about) = about {
                if file.is_matlab
                    && let Some(shape) = &mut about.shape
                {
                    shape.reverse();
                }
                self.data_sets.push(Found { path, about, address: link.address });
            }
        }
        Ok(())
    }

    /// The numbers of a data set, the last of its axes fastest.
    fn numbers(&self, file: &File<'_>, found: &Found) -> Result<Vec<f64>, FormatProblem> {
        let object = Object::read(file, found.address)?;
        let mut about = found.about.clone();
        if !file.is_matlab {
            return dataset::numbers(file, &object, &about);
        }
        let shape = about.shape.clone().unwrap_or_default();
        if let Some(shape) = &mut about.shape {
            shape.reverse();
        }
        let numbers = dataset::numbers(file, &object, &about)?;
        let (Some(&steps), false) = (shape.first(), numbers.is_empty()) else { return Ok(numbers) };
        // (c, t) as t x c.
        let columns = numbers.len() / steps.max(1);
        file.budget.take_values::<f64>(numbers.len())?;
        let turned = (0..steps).flat_map(|t| (0..columns).map(move |c| c * steps + t));
        let turned = turned.map(|index| numbers[index]).collect();
        file.budget.give_back(numbers.len() * size_of::<f64>());
        Ok(turned)
    }
}

#[cfg(test)]
mod tests;
