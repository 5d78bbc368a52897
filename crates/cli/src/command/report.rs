//! `scrnn report`: a run folder as a page.

use std::path::PathBuf;

use clap::Args;
use scrnn_pages::mixture_page::page as mixture_page;
use scrnn_pages::run_page::page;
use scrnn_report::{PAGE, Page};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::history;
use scrnn_run::members;
use scrnn_run::run_folder::HISTORY;
use scrnn_run::trained::Trained;

use crate::args::Shared;
use crate::output;

/// Write a page about a training run: how it learned, how it predicts, how it runs on its own
///
/// The run folder receives report.html, one page that needs nothing else, and figures/, each figure as SVG with its
/// numbers as CSV. Other files in the folder are left as they are; a run that is still in training can be looked at too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn report runs/mine                       writes runs/mine/report.html
  scrnn report runs/mine --best --out page     of the best network, into the folder page")]
pub struct Arguments {
    /// The run folder
    run: PathBuf,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Where to write [default: the run folder]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the closed loop's noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
}

/// Looks and writes.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    if !arguments.run.is_dir() {
        let message = format!("{} is not a run folder", arguments.run.display());
        return Err(Failure::input(message, "give the folder that `scrnn train` wrote"));
    }
    let engine = shared.engine()?;
    let folders = members::folders(&arguments.run);
    if !folders.is_empty() {
        let all = members::open(&arguments.run, arguments.best)?;
        all.iter().for_each(|trained| shared.say_of(trained));
        let mut rows = Vec::new();
        for folder in &folders {
            rows.push(history::read(&folder.join(HISTORY))?);
        }
        return finish(arguments, &mixture_page(&all, &rows, &engine)?);
    }
    let trained = Trained::open(&arguments.run, arguments.best)?;
    shared.say_of(&trained);
    let source = trained.source(engine.threads())?;
    let rows = history::read(&arguments.run.join(HISTORY))?;
    finish(arguments, &page(&trained, &source, &rows, arguments.seed, &engine)?)
}

fn finish(arguments: &Arguments, page: &Page) -> Result<Ending> {
    let out = arguments.out.as_ref().unwrap_or(&arguments.run);
    scrnn_pages::write(page, out)?;
    output::print(&format!("{}\n", out.join(PAGE).display()))?;
    Ok(Ending::Done)
}
