//! `scrnn compare`: many networks on one page.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn_data::replace;
use scrnn_report::PAGE;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_sweep::compare::{METRICS, NETWORKS, compare};

use crate::args::Shared;
use crate::output;
use crate::progress::Busy;

/// Compare the networks of a sweep, or any runs, on one page
///
/// The folder receives report.html, one page that needs nothing else: means and spreads over seeds, a curve or a heat map for each measure,
/// tests between settings, learning curves over each other, closed loops and initial states side by side, links to each run's page, and
/// which setting is best over all seeds, and networks to play with: drag an initial state and see what each makes of it. And metrics.csv, a row
/// for each run. A sweep that is not finished can be looked at too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn compare runs/variances                     a sweep; writes runs/variances/report.html
  scrnn compare runs/a runs/b runs/c --out page    any runs: what differs between their experiments makes the settings")]
pub struct Arguments {
    /// The folder of a sweep, or run folders
    #[arg(required = true, value_name = "SWEEP|RUN")]
    paths: Vec<PathBuf>,
    /// Where to write [default: the sweep's folder; for runs it has to be given]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Networks to play with on the page, 0 to 100, the best of each setting first; as many as fit into 5 MB
    #[arg(long, value_name = "N", default_value_t = NETWORKS, value_parser = crate::args::count(0, 100))]
    networks: usize,
    /// Print the best setting as a JSON object
    #[arg(long)]
    json: bool,
}

/// Compares and writes.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let paths: Vec<&Path> = arguments.paths.iter().map(PathBuf::as_path).collect();
    let out = match (&arguments.out, paths.as_slice()) {
        (Some(out), _) => out.as_path(),
        (None, [only]) if only.join(scrnn_sweep::plan::PLAN).is_file() => only,
        (None, _) => {
            return Err(Failure::input(
                "runs have no common folder for their page",
                "say where to write it: --out DIR",
            ));
        }
    };
    let compared = {
        let _busy = Busy::with("comparing", shared.quiet);
        compare(&paths, out, arguments.networks)?
    };
    std::fs::create_dir_all(out).map_err(|error| Failure::disk("make the folder", out, error))?;
    replace(&out.join(METRICS), compared.csv.as_bytes())?;
    scrnn_pages::write(&compared.page, out)?;
    if arguments.json {
        output::print_json(&compared.best)?;
    } else {
        let best = compared.best.map_or(String::new(), |best| {
            format!("best over all seeds by {}: {} ({:.4})\n", best.measure, best.setting, best.summary.mean)
        });
        output::print(&format!("{best}{}\n", out.join(PAGE).display()))?;
    }
    Ok(Ending::Done)
}
