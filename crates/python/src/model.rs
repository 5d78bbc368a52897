//! Trained networks as Python holds them: what a run folder has, in memory.

use std::path::{Path, PathBuf};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::Dataset;
use scrnn::parameters::Block;
use scrnn_data::{Field, Selection};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::generating::unit_names;
use scrnn_run::messages::Messages;
use scrnn_run::notes::Notes;
use scrnn_run::run_folder::{BEST, CHECKPOINT, EXPERIMENT, HISTORY, RunFolder};
use scrnn_run::source::{self, Source};
use scrnn_run::trained::Trained;
use scrnn_run::{channels, familiar, members};

use crate::arrays::{Given, matrix};
use crate::failure::{compute, raise};

/// What samples at hand are called in a run folder.
pub const DATA: &str = "data.npz";

/// A trained network, or the members of a mixture. It never changes: what changes a network gives a new one.
#[pyclass(frozen, module = "scrnn._scrnn")]
pub struct Model {
    /// The networks that are used.
    pub all: Vec<Trained>,
    /// The best networks of the same trainings, where they are known.
    best: Vec<Trained>,
    /// The texts of history.csv, one for each network.
    histories: Vec<String>,
    /// The text of experiment.toml; empty where there is none.
    experiment: String,
    /// The samples that were learned or held out, where they are not in files.
    pub data: Option<Dataset>,
}

/// An array of one axis.
type Row<'py> = Bound<'py, PyArray1<f64>>;
/// An array of two.
type Rows<'py> = Bound<'py, PyArray2<f64>>;

/// A file of text that may not be there.
fn text(path: &Path) -> Result<String> {
    match path.exists() {
        true => Ok(String::from_utf8_lossy(&scrnn_data::read_bytes(path)?).into_owned()),
        false => Ok(String::new()),
    }
}

/// Refuses to write over a run.
fn refuse_run(folder: &Path, overwrite: bool) -> Result<()> {
    if folder.join(CHECKPOINT).exists() && !overwrite || !members::folders(folder).is_empty() {
        let message = format!("{} already holds a run", folder.display());
        return Err(Failure::refused(message, "overwrite=True replaces it, unless it is a mixture"));
    }
    Ok(())
}

impl Model {
    /// Reads a run folder or a checkpoint file.
    pub fn read(path: &Path, best: bool, data: Option<Dataset>) -> Result<Self> {
        let all = members::open(path, best)?;
        let folders = match members::folders(path) {
            none if none.is_empty() => vec![path.to_owned()],
            folders => folders,
        };
        let is_run = path.is_dir();
        let mut found = Vec::new();
        for folder in folders.iter().filter(|folder| is_run && folder.join(BEST).exists()) {
            found.push(Trained::open(folder, true)?);
        }
        let histories = match is_run {
            true => folders.iter().map(|folder| text(&folder.join(HISTORY))).collect::<Result<_>>()?,
            false => Vec::new(),
        };
        let experiment = if is_run { text(&path.join(EXPERIMENT))? } else { String::new() };
        let best = if found.len() == all.len() { found } else { Vec::new() };
        Ok(Self { all, best, histories, experiment, data })
    }

    /// The first network: what all members have in common is asked of it.
    pub fn first(&self) -> Result<&Trained> {
        self.all.first().ok_or_else(|| Failure::input("there is no network", ""))
    }

    /// The only network.
    pub fn only(&self) -> Result<&Trained> {
        match self.all.as_slice() {
            [only] => Ok(only),
            all => Err(Failure::input(
                format!("this is a mixture of {} networks", all.len()),
                "load one of its members: their folders lie in that of the run",
            )),
        }
    }

    /// What was learned and what was held out.
    pub fn source(&self, threads: usize) -> Result<Source> {
        let first = self.first()?;
        let Some(data) = &self.data else { return first.source(threads) };
        let notes =
            first.notes.as_ref().ok_or_else(|| Failure::input("the network does not say what it learned", ""))?;
        let experiment = notes.experiment().map_err(|error| Failure::input(error, ""))?;
        source::of_hand(&experiment, data.clone())
    }

    /// New data on the channels that were learned; what is far from it is said.
    pub fn fitted(&self, data: Dataset, place: &str, messages: &dyn Messages) -> Result<Dataset> {
        self.first()?.fitted_aloud(data, Path::new(place), messages)
    }

    /// The same with other networks.
    pub fn with(&self, all: Vec<Trained>) -> Self {
        let (histories, experiment) = (self.histories.clone(), self.experiment.clone());
        Self { all, best: Vec::new(), histories, experiment, data: self.data.clone() }
    }

    /// The checkpoint with its samples in another file.
    fn moved(checkpoint: &Checkpoint, file: &Path) -> Checkpoint {
        let mut checkpoint = checkpoint.clone();
        if let Some(data) = checkpoint.notes.get_mut("experiment").and_then(|experiment| experiment.get_mut("data")) {
            data["files"] = serde_json::json!([file.display().to_string()]);
        }
        checkpoint
    }

    /// The same with samples that are at hand, which are to lie in `file`.
    fn lying_in(&self, file: &Path) -> Result<Self> {
        let again = |one: &Trained| Trained::of(one.path.clone(), Self::moved(&one.checkpoint, file));
        let old = self.first()?.notes.as_ref().and_then(|notes| notes.experiment().ok());
        let old = old.and_then(|experiment| experiment.data.files?.first().map(|file| file.display().to_string()));
        let quoted = |path: String| toml::Value::String(path).to_string();
        let experiment = match old {
            Some(old) => self.experiment.replace(&quoted(old), &quoted(file.display().to_string())),
            None => self.experiment.clone(),
        };
        Ok(Self {
            all: self.all.iter().map(again).collect::<Result<_>>()?,
            best: self.best.iter().map(again).collect::<Result<_>>()?,
            histories: self.histories.clone(),
            experiment,
            data: self.data.clone(),
        })
    }

    /// Writes a run folder that the program can use.
    fn write(&self, folder: &Path, overwrite: bool) -> Result<()> {
        refuse_run(folder, overwrite)?;
        let run = RunFolder::open(folder)?;
        let only = self.only()?;
        let best = self.best.first();
        run.write(HISTORY, self.histories.first().map_or("", String::as_str).as_bytes())?;
        match best {
            Some(best) => run.write(BEST, &best.checkpoint.to_bytes()?)?,
            None => run.remove(BEST)?,
        }
        if !self.experiment.is_empty() {
            run.write(EXPERIMENT, self.experiment.as_bytes())?;
        }
        run.write(CHECKPOINT, &only.checkpoint.to_bytes()?)
    }

    /// Columns of a history.
    fn columns<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let mut lines = text.lines();
        let Some(head) = lines.next() else { return Ok(columns) };
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|field| field.parse().unwrap_or(f64::NAN)).collect()).collect();
        for (k, name) in head.split(',').enumerate() {
            let column: Vec<f64> = rows.iter().map(|row| row.get(k).copied().unwrap_or(f64::NAN)).collect();
            columns.set_item(name, PyArray1::from_vec(py, column))?;
        }
        Ok(columns)
    }
}

#[pymethods]
impl Model {
    /// Opens a run folder or a checkpoint file.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf, best: bool) -> PyResult<Self> {
        compute(py, || {
            let at_hand = path.join(DATA);
            let model = Self::read(&path, best, None)?;
            // A folder with samples of its own may have been moved.
            match at_hand.exists() && model.first()?.source(1).is_err() {
                true => {
                    let file = std::path::absolute(&at_hand).map_err(|error| Failure::disk("find", &at_hand, error))?;
                    model.lying_in(&file)
                }
                false => Ok(model),
            }
        })
    }

    /// Writes a run folder. Samples that are in no file are written beside.
    fn save(&self, py: Python<'_>, folder: PathBuf, overwrite: bool) -> PyResult<()> {
        compute(py, || match &self.data {
            None => self.write(&folder, overwrite),
            Some(data) => {
                std::fs::create_dir_all(&folder).map_err(|error| Failure::disk("make the folder", &folder, error))?;
                let folder = std::path::absolute(&folder).map_err(|error| Failure::disk("find", &folder, error))?;
                let file = folder.join(DATA);
                let moved = self.lying_in(&file)?;
                refuse_run(&folder, overwrite)?;
                scrnn_data::write(&file, &[Field { name: "", data }])?;
                moved.write(&folder, overwrite)
            }
        })
    }

    /// Writes a run folder to go on in for a while: its samples stay where they are.
    fn spill(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        compute(py, || self.write(&folder, true))
    }

    /// The best network of the same training.
    fn best(&self) -> PyResult<Self> {
        if self.best.is_empty() {
            let message = "the best network is not known";
            return Err(raise(Failure::input(message, "load the run folder that holds best.safetensors")));
        }
        let again = |one: &Trained| Trained::of(one.path.clone(), one.checkpoint.clone());
        let copies = || self.best.iter().map(again).collect::<Result<Vec<_>>>().map_err(raise);
        Ok(Self {
            all: copies()?,
            best: copies()?,
            histories: self.histories.clone(),
            experiment: self.experiment.clone(),
            data: self.data.clone(),
        })
    }

    /// All that makes it, to be pickled.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, this) = (slf.py(), slf.get());
        let bytes = |all: &[Trained]| -> PyResult<Vec<(String, Bound<'py, PyBytes>)>> {
            let one = |one: &Trained| -> PyResult<_> {
                let bytes = one.checkpoint.to_bytes().map_err(|error| raise(error.into()))?;
                Ok((one.path.display().to_string(), PyBytes::new(py, &bytes)))
            };
            all.iter().map(one).collect()
        };
        let data = match &this.data {
            None => None,
            Some(data) => Some(crate::arrays::arrays(py, data)?),
        };
        let state = (bytes(&this.all)?, bytes(&this.best)?, this.histories.clone(), this.experiment.clone(), data);
        Ok((slf.get_type().getattr("restore")?, state.into_pyobject(py)?))
    }

    /// What `__reduce__` took apart.
    #[staticmethod]
    fn restore(
        all: Vec<(PathBuf, Vec<u8>)>,
        best: Vec<(PathBuf, Vec<u8>)>,
        histories: Vec<String>,
        experiment: String,
        data: Option<Given<'_>>,
    ) -> PyResult<Self> {
        let one = |(path, bytes): &(PathBuf, Vec<u8>)| {
            Checkpoint::from_bytes(bytes).map_err(Failure::from).and_then(|found| Trained::of(path.clone(), found))
        };
        let data = data.map(|data| data.dataset()).transpose()?;
        let networks = |all: &[(PathBuf, Vec<u8>)]| all.iter().map(one).collect::<Result<Vec<_>>>().map_err(raise);
        Ok(Self { all: networks(&all)?, best: networks(&best)?, histories, experiment, data })
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    /// The bytes of the first network's checkpoint.
    fn checkpoint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = compute(py, || Ok(self.first()?.checkpoint.to_bytes()?))?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[getter]
    fn members(&self) -> usize {
        self.all.len()
    }

    #[getter]
    fn path(&self) -> PyResult<PathBuf> {
        Ok(self.first().map_err(raise)?.path.clone())
    }

    #[getter]
    fn experiment(&self) -> String {
        match self.experiment.is_empty() {
            false => self.experiment.clone(),
            true => {
                let experiment = self.all.first().and_then(|one| one.notes.as_ref()?.experiment().ok());
                experiment.map_or(String::new(), |experiment| experiment.to_file())
            }
        }
    }

    /// What is in force: the experiment as JSON; `null` for a network that something else wrote.
    #[getter]
    fn settings(&self) -> PyResult<String> {
        let notes = self.first().map_err(raise)?.notes.as_ref();
        Ok(notes.map_or("null".to_owned(), |notes| notes.experiment.to_string()))
    }

    #[getter]
    fn channels(&self) -> PyResult<Vec<String>> {
        Ok(self.first().map_err(raise)?.checkpoint.channels.clone())
    }

    #[getter]
    fn sequences(&self) -> PyResult<Vec<String>> {
        Ok(self.first().map_err(raise)?.checkpoint.sequences.clone())
    }

    #[getter]
    fn epoch(&self) -> PyResult<u64> {
        Ok(self.first().map_err(raise)?.checkpoint.epoch)
    }

    #[getter]
    fn delay(&self) -> PyResult<usize> {
        Ok(self.first().map_err(raise)?.checkpoint.topology.delay())
    }

    #[getter]
    fn has_variance(&self) -> PyResult<bool> {
        Ok(self.first().map_err(raise)?.checkpoint.topology.has_variance())
    }

    /// Name, units and time constant of each group.
    #[getter]
    fn groups(&self) -> PyResult<Vec<(String, usize, f64)>> {
        let groups = self.first().map_err(raise)?.checkpoint.topology.groups();
        Ok(groups.iter().map(|group| (group.name.clone(), group.units, group.time_constant)).collect())
    }

    #[getter]
    fn units(&self) -> PyResult<Vec<String>> {
        let groups = self.first().map_err(raise)?.checkpoint.topology.groups();
        Ok(groups.iter().flat_map(unit_names).collect())
    }

    /// nll, mse, and the same of what was held out, of the last epoch that was evaluated.
    #[getter]
    fn scores(&self) -> PyResult<String> {
        let notes = self.first().map_err(raise)?.notes.as_ref();
        let of = |notes: &Notes| serde_json::json!({ "score": notes.score, "best": notes.best });
        Ok(notes.map_or("{}".to_owned(), |notes| of(notes).to_string()))
    }

    /// What was done to the variances, if anything.
    #[getter]
    fn remark(&self) -> PyResult<Option<String>> {
        Ok(self.first().map_err(raise)?.remark())
    }

    /// The factors on the variances, if there are any.
    #[getter]
    fn variance_factors(&self) -> PyResult<Option<Vec<f64>>> {
        let notes = self.first().map_err(raise)?.notes.as_ref();
        Ok(notes.and_then(|notes| notes.variance_factor.as_ref()).map(|factor| factor.factors.clone()))
    }

    /// The least and the greatest learned value of each channel.
    #[getter]
    fn ranges(&self) -> PyResult<Vec<(f64, f64)>> {
        Ok(familiar::learned(self.first().map_err(raise)?))
    }

    /// Offset and scale of each channel: scaled = (raw - offset) * scale.
    #[getter]
    fn scaling<'py>(&self, py: Python<'py>) -> PyResult<(Row<'py>, Row<'py>)> {
        let scaling = &self.first().map_err(raise)?.checkpoint.scaling;
        Ok((PyArray1::from_slice(py, scaling.offset()), PyArray1::from_slice(py, scaling.scale())))
    }

    /// Columns of the histories, of each network.
    fn histories<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.histories.iter().map(|text| Self::columns(py, text)).collect()
    }

    /// Weights and biases by their names.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let checkpoint = &self.only().map_err(raise)?.checkpoint;
        let (topology, dict) = (&checkpoint.topology, PyDict::new(py));
        for block in Block::ALL {
            let values = PyArray1::from_slice(py, checkpoint.parameters.block(block));
            match block.shape(topology).as_slice() {
                &[rows, columns] => dict.set_item(block.name(), values.reshape([rows, columns])?)?,
                _ => dict.set_item(block.name(), values)?,
            }
        }
        Ok(dict)
    }

    /// u_0 of each learned sequence, and their mean.
    fn initial_states<'py>(&self, py: Python<'py>) -> PyResult<(Rows<'py>, Row<'py>)> {
        let states = &self.only().map_err(raise)?.checkpoint.initial_states;
        Ok((matrix(py, states.values().to_vec(), states.mean().len())?, PyArray1::from_slice(py, states.mean())))
    }

    /// The sequences that were learned and those that were held out, in their own units.
    fn learned_data<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(crate::arrays::Arrays<'py>, Option<crate::arrays::Arrays<'py>>)> {
        let source = compute(py, || self.source(0))?;
        let held_out = source.held_out.as_ref().map(|data| crate::arrays::arrays(py, data)).transpose()?;
        Ok((crate::arrays::arrays(py, &source.data)?, held_out))
    }

    /// How the data of a file are to be read that go with what was learned: the data on its channels.
    fn read_like<'py>(&self, py: Python<'py>, paths: Vec<PathBuf>) -> PyResult<crate::arrays::Arrays<'py>> {
        let data = compute(py, || {
            let first = self.first()?;
            let mut selection = Selection::default();
            if let Some(path) = paths.first() {
                selection = selection.or_as_learned(path, first.selection().unwrap_or_default());
            }
            let data = scrnn_data::read_all(&paths, &selection)?.data;
            let place = paths.first().map_or(String::new(), |path| path.display().to_string());
            channels::matched(data, &first.checkpoint.channels, &place)
        })?;
        crate::arrays::arrays(py, &data)
    }
}
