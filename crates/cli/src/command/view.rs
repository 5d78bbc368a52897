//! `scrnn view`: a recording as a page that plays it.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn_data as files;
use scrnn_pages::view;
use scrnn_run::failure::{Ending, Failure, Result};

use crate::output;
use crate::outputs::check_distinct;

/// Write a page that plays a recording: the robots in 3-D, and what was sensed and predicted
///
/// The page needs nothing else, asks for nothing, and plays in any browser with WebGL. Bodies come from foxglove.SceneUpdate
/// messages, as in the recordings that `scrnn simulate` writes; or from joint states (sensor_msgs/JointState, foxglove.JointStates) and
/// a URDF: that of --urdf, or the one on /robot_description. Meshes are left out. What a recording does not hold, the page says.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn view between.mcap                                writes between.html
  scrnn view arm.mcap --urdf arm.urdf --out arm.html     a robot of your own")]
pub struct Arguments {
    /// A recording: .mcap, .db3, or the folder of a bag
    recording: PathBuf,
    /// The robot's description, where the recording has none
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Where to write [default: beside the recording, as .html]
    #[arg(long, short, value_name = "PAGE.html")]
    out: Option<PathBuf>,
}

/// Reads and writes.
pub fn run(arguments: &Arguments) -> Result<Ending> {
    let Arguments { recording, urdf, out } = arguments;
    let out = out.clone().unwrap_or_else(|| recording.with_extension("html"));
    let inputs = [("RECORDING", Some(recording.as_path())), ("--urdf", urdf.as_deref())];
    check_distinct(&[("--out", Some(&out))], &inputs)?;
    let read = |path: &PathBuf| std::fs::read_to_string(path).map_err(|error| Failure::disk("read", path, error));
    let urdf = urdf.as_ref().map(read).transpose()?;
    files::replace(&out, view::page(recording, None, urdf.as_deref())?.html().as_bytes())?;
    output::print(&format!("{}\n", out.display()))?;
    Ok(Ending::Done)
}

/// Writes the page about a recording that is still in memory.
pub fn write(page: &Path, bytes: &[u8]) -> Result<()> {
    // It is called what it would be called beside its page.
    let name = page.with_extension("mcap");
    Ok(files::replace(page, view::page(&name, Some(bytes), None)?.html().as_bytes())?)
}
