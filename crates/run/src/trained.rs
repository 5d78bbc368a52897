//! A trained network as the commands take it: a run folder or a checkpoint file.

use std::path::{Path, PathBuf};

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::Dataset;
use scrnn::network::Network;

use crate::channels;
use crate::digest::digest;
use crate::experiment::Evaluation;
use crate::failure::{Failure, Result};
use crate::familiar;
use crate::messages::Messages;
use crate::notes::Notes;
use crate::run_folder::{self, BEST, CHECKPOINT};
use crate::source::{self, Source};
use scrnn_data::Selection;

/// Scaled samples from here on are refused: predictions lie between -1 and 1.
pub const TOO_FAR: f64 = 1e12;

/// A checkpoint with what the program noted in it.
#[derive(Debug)]
pub struct Trained {
    /// The file that was read.
    pub path: PathBuf,
    /// What it holds.
    pub checkpoint: Checkpoint,
    /// The program's own notes, unless something else wrote the checkpoint.
    pub notes: Option<Notes>,
    network: Network,
}

impl Trained {
    /// Reads a run folder's checkpoint (or its best one) or a checkpoint file.
    pub fn open(path: &Path, best: bool) -> Result<Self> {
        let file = if path.is_dir() {
            let name = if best { BEST } else { CHECKPOINT };
            let file = path.join(name);
            let members = run_folder::members(path).len();
            if members > 0 {
                let message = format!("{} holds a mixture of {members} networks", path.display());
                return Err(Failure::input(
                    message,
                    format!(
                        "give one of them: {}; a network that is to work alone is better trained without members",
                        run_folder::member(path, 1).display()
                    ),
                ));
            }
            if !file.exists() {
                let message = format!("{} holds no {name}", path.display());
                return Err(Failure::input(message, "give the folder that `scrnn train` wrote, or a checkpoint file"));
            }
            file
        } else {
            if best {
                let message = format!("--best needs a run folder, {} is a file", path.display());
                return Err(Failure::input(message, format!("give the folder that holds {BEST}")));
            }
            path.to_owned()
        };
        let checkpoint = read_checkpoint(&file)?;
        Self::of(file, checkpoint)
    }

    /// A checkpoint that is at hand, as if it had been read from `path`.
    ///
    /// # Errors
    /// [`Failure::Input`] for parts that do not fit each other.
    pub fn of(path: PathBuf, checkpoint: Checkpoint) -> Result<Self> {
        let notes = Notes::of(&checkpoint);
        let mut network = Network::new(checkpoint.topology.clone(), checkpoint.parameters.clone())?;
        if let Some(factor) = notes.as_ref().and_then(|notes| notes.variance_factor.as_ref()) {
            factor.apply(&mut network)?;
        }
        Ok(Self { path, checkpoint, notes, network })
    }

    /// What is to be said of its variances, if they are not as they were learned.
    pub fn remark(&self) -> Option<String> {
        let factor = self.notes.as_ref()?.variance_factor.as_ref()?;
        Some(factor.in_words(&self.checkpoint.channels))
    }

    /// The network itself, with the factor on its variances if one was found.
    pub fn network(&self) -> Network {
        self.network.clone()
    }

    /// The learned sequence of this name, or else of this number, counted from 1: its place.
    ///
    /// # Errors
    /// [`Failure::Input`] with the names there are.
    pub fn sequence(&self, wanted: &str) -> Result<usize> {
        let names = &self.checkpoint.sequences;
        let number = || wanted.parse::<usize>().ok().filter(|number| (1..=names.len()).contains(number));
        // Data from several files have the file's name before that of the sequence.
        let only_one_ending_so = || {
            let mut places = (0..names.len()).filter(|&place| names[place].rsplit('/').next() == Some(wanted));
            places.next().filter(|_| places.next().is_none())
        };
        let named = names.iter().position(|name| name == wanted);
        if let Some(place) = named.or_else(|| Some(number()? - 1)).or_else(only_one_ending_so) {
            return Ok(place);
        }
        let (count, shown) = (names.len(), names.iter().take(20).map(String::as_str).collect::<Vec<_>>().join(", "));
        let more = if count > 20 { ", ..." } else { "" };
        let help = format!("the network learned {count}, counted from 1: {shown}{more}");
        Err(Failure::input(format!("there is no learned sequence {wanted}"), help))
    }

    /// The initial state for an interaction in this order of sides, and its name: `mean`, `corresponding` for that of the order itself, or
    /// that of another learned order.
    ///
    /// # Errors
    /// [`Failure::Input`] with what there is.
    pub fn state_for_order(&self, wanted: &str, order: &str) -> Result<(String, &[f64])> {
        let (learned, names) = (&self.checkpoint.initial_states, &self.checkpoint.sequences);
        let wanted = match wanted {
            "mean" => return Ok(("mean".to_owned(), learned.mean())),
            "corresponding" => order,
            other => other,
        };
        // Data from several files have the file's name before that of the order.
        let is = |name: &String| name == wanted || name.rsplit('/').next() == Some(wanted);
        match names.iter().position(is) {
            Some(s) => Ok((wanted.to_owned(), learned.sequence(s))),
            None => {
                let help = format!("`mean`, `corresponding`, or one of {}", names.join(", "));
                Err(Failure::input(format!("the network did not learn `{wanted}`"), help))
            }
        }
    }

    /// Which part of its files it learned, where that is known.
    pub fn selection(&self) -> Option<Selection> {
        Some(self.notes.as_ref()?.experiment().ok()?.data.selection())
    }

    /// How its experiment judges networks on what it holds out, or how that is done by default.
    pub fn evaluation(&self) -> Evaluation {
        let experiment = self.notes.as_ref().and_then(|notes| notes.experiment().ok());
        experiment.and_then(|experiment| experiment.evaluation).unwrap_or_default()
    }

    /// sigma^2_IS of its training, or 1 where that is not known.
    pub fn initial_state_variance(&self) -> f64 {
        let notes = self.notes.as_ref();
        notes.and_then(|notes| notes.experiment["network"]["initial_state_variance"].as_f64()).unwrap_or(1.0)
    }

    /// The sequences that it learned, made (by simulated robots: on so many threads) or read again.
    pub fn learned_data(&self, threads: usize) -> Result<Dataset> {
        Ok(self.source(threads)?.data)
    }

    /// The sequences that it learned, with those that were held out of the training, made or read again.
    pub fn source(&self, threads: usize) -> Result<Source> {
        let other = "say with --data which sequences to use";
        let notes = self.notes.as_ref().ok_or_else(|| {
            Failure::input(format!("{} does not say what it was trained on", self.path.display()), other)
        })?;
        let experiment = notes.experiment().map_err(|error| {
            Failure::input(format!("the experiment in {} cannot be read: {error}", self.path.display()), other)
        })?;
        let source = source::of(&experiment, threads)?;
        let held_out = notes.data.held_out.as_ref().map(|notes| notes.digest.clone());
        if digest(&source.data) != notes.data.digest || source.held_out.as_ref().map(digest) != held_out {
            return Err(Failure::input("the data changed since the network learned them", other));
        }
        Ok(source)
    }

    /// `data`, from the file at `path`, on the channels that were learned and in their order (see [`channels::matched`]),
    /// checked to be numbers that the network can be given. Missing values are.
    ///
    /// # Errors
    /// [`Failure::Input`] for channels that do not match, and for samples far outside of what was learned.
    pub fn fitted(&self, data: Dataset, path: &Path) -> Result<Dataset> {
        let learned = &self.checkpoint.channels;
        let data = channels::matched(data, learned, &path.display().to_string())?;
        let scaled = self.checkpoint.scaling.apply(&data)?;
        let n = learned.len();
        for sequence in scaled.sequences() {
            if let Some(at) = sequence.values().iter().position(|value| value.abs() >= TOO_FAR) {
                let (name, step, channel) = (&sequence.name, at / n + 1, &learned[at % n]);
                let message = format!(
                    "{}: sequence {name}, step {step}, channel {channel} lies {:e} times as far out as anything that was learned",
                    path.display(),
                    sequence.values()[at].abs()
                );
                return Err(Failure::input(message, "are these data in the units of those that were learned?"));
            }
        }
        Ok(data)
    }
}

impl Trained {
    /// As [`Trained::fitted`]; channels far outside of what was learned are said.
    ///
    /// # Errors
    /// As [`Trained::fitted`].
    pub fn fitted_aloud(&self, data: Dataset, path: &Path, messages: &dyn Messages) -> Result<Dataset> {
        let data = self.fitted(data, path)?;
        for one in familiar::unfamiliar(self, &data) {
            messages.say(&format!("warning: {}: {one}", path.display()));
        }
        Ok(data)
    }
}

/// Reads a checkpoint file.
pub fn read_checkpoint(path: &Path) -> Result<Checkpoint> {
    let bytes = scrnn_data::read_bytes(path)?;
    Checkpoint::from_bytes(&bytes).map_err(|error| {
        let message = format!("{} is not a checkpoint that this version reads: {error}", path.display());
        Failure::input(message, "give a run folder, or a .safetensors file that `scrnn train` wrote")
    })
}
