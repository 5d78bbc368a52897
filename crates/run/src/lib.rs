//! Trainings in folders: from an experiment file and data to a network that other commands find again.
//!
//! | module | what it holds |
//! |---|---|
//! | [`experiment`] | the experiment file: its types, how it is read, checked, overridden and compared |
//! | [`request`], [`recipe`] | what `train` is given: an experiment file, a run folder, or data alone, for which settings are chosen |
//! | `trial` | how long to learn, by sequences that are left out for the choice |
//! | [`source`], [`digest`] | the sequences of an experiment, made or read, and their fingerprint |
//! | [`character`] | what kind of movement data are: smooth or noisy, and whether it comes to rest |
//! | [`training`] | one training, from a resolved experiment to a run folder: begun, gone on with, or begun anew |
//! | [`verdict`] | the result of a training, in words and as JSON |
//! | [`run_folder`], [`history`], [`notes`] | what a training leaves behind |
//! | [`resume`] | whether a run may go on |
//! | [`trained`], [`channels`] | a trained network as it is found again, and new data brought to its channels by name |
//! | [`stream`] | samples that come line by line while they are made |
//! | [`assessment`], [`truth`], [`channel_scores`] | how well it predicts, beside simple models and what is known of the noise |
//! | [`generating`], [`recognising`], [`following`] | what a trained network is used for, in the data's units |
//! | [`export`] | one step of a trained network for other programs: as C, as ONNX |
//! | [`familiar`] | new data beside the range of what was learned |
//! | [`conversion`] | data from one kind of file to another |
//! | [`likeness`] | which learned sequence a new one is like, where all share one initial state |
//! | [`held_out`] | which sequences are not learned, and how a network does on them while it learns |
//! | [`evaluation`] | how a network does on sequences that it did not learn, beside simple models |
//! | [`completion`] | the rest of a sequence as a distribution |
//! | [`members`] | a mixture of networks as one run |
//! | [`variance_factor`] | predicted variances made as large as the errors on such sequences |
//! | [`messages`], [`interrupt`] | how news and progress leave, and how a person's wish to stop comes in |
//! | [`memory`] | what would not fit is refused before it is tried |
//! | [`failure`] | what ends a request early, and with which exit code |
//!
//! Nothing here knows a terminal or a command line: progress and messages are handed in.

pub mod assessment;
pub mod channel_scores;
pub mod channels;
pub mod character;
pub mod completion;
pub mod conversion;
pub mod digest;
pub mod evaluation;
pub mod experiment;
pub mod export;
pub mod failure;
pub mod familiar;
pub mod following;
pub mod generating;
pub mod held_out;
pub mod history;
pub mod interrupt;
pub mod likeness;
pub mod members;
pub mod memory;
pub mod messages;
pub mod notes;
pub mod recipe;
pub mod recognising;
pub mod request;
pub mod resume;
pub mod run_folder;
pub mod source;
pub mod stream;
pub mod trained;
pub mod training;
mod trial;
pub mod truth;
pub mod variance_factor;
pub mod verdict;

mod recorder;
