//! `scrnn convert`: data from one kind of file to another.

use std::path::PathBuf;

use clap::Args;
use scrnn_run::conversion::convert;
use scrnn_run::failure::{Ending, Result};

use crate::args::{Part, Shared};
use crate::output;

/// Write data as another kind of file
///
/// The name of OUT decides: .csv, .tsv, .txt, .npy, .npz, .mcap (`foxglove.JointStates`, to look at in Foxglove), .parquet, or
/// without an extension the folder of a LeRobot data set (v3.0). Names of sequences and channels are kept, and every bit of a
/// number. Recordings and LeRobot data sets need the seconds between samples: --period tells them where the data do not. What
/// is read is never written over.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn convert bag/ arm.csv --topic /joint_states --period 0.02
  scrnn convert demos.hdf5 demos.npz
  scrnn convert mine.csv mine.mcap --period 0.02
  scrnn convert mine.csv mine_lerobot --period 0.02 --task 'wave the arm'")]
pub struct Arguments {
    /// What to read: a file, a folder, or a pattern such as 'demos/*.csv'
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// What to write
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    part: Part,
    /// For LeRobot: what is done, in a sentence
    #[arg(long, value_name = "TEXT")]
    task: Option<String>,
}

/// Reads and writes.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let Arguments { input, output, part, task } = arguments;
    let written = convert(input, output, &part.of(input, None), task.as_deref(), shared)?;
    let lines: String = written.iter().map(|path| format!("{}\n", path.display())).collect();
    output::print(&lines)?;
    Ok(Ending::Done)
}
