//! All runs of a sweep, or any runs, on one page beside each other, with `metrics.csv`.
//!
//! `collected.rs` gathers what there is, `statistics.rs` makes means, tests and the choice of the best, `figures.rs` draws, `playing.rs` takes
//! networks into the page, `page.rs` puts them together.

mod collected;
mod figures;
mod learned;
mod page;
mod playing;
mod statistics;

use std::path::Path;

pub use collected::{Collected, Row, collect};
pub use statistics::{Best, Summary, best};

use scrnn_report::Page;
use scrnn_run::failure::Result;

/// The file with a row for each run.
pub const METRICS: &str = "metrics.csv";
/// Networks that a page holds to be played with, unless somebody says otherwise.
pub const NETWORKS: usize = 12;

/// What came of a comparison.
#[derive(Debug)]
pub struct Compared {
    /// The page.
    pub page: Page,
    /// The text of `metrics.csv`.
    pub csv: String,
    /// The best setting, if there is a measure to tell it by.
    pub best: Option<Best>,
}

/// Compares what is at `paths`: the folder of a sweep, or several run folders. The page will lie in `out`, and holds so many networks to be
/// played with, if they fit into 5 MB.
///
/// # Errors
/// [`Failure::Input`](scrnn_run::failure::Failure::Input) for folders that hold neither.
pub fn compare(paths: &[&Path], out: &Path, networks: usize) -> Result<Compared> {
    let collected = collect(paths, out)?;
    let best = best(&collected);
    Ok(Compared { page: page::page(&collected, best.as_ref(), networks), csv: collected.csv(), best })
}
