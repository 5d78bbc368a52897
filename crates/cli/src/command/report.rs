//! `scrnn report`: a run folder as a page.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use scrnn_pages::mixture_page::page as mixture_page;
use scrnn_pages::run_page::page;
use scrnn_report::{Figure, PAGE, Page};
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::history;
use scrnn_run::members;
use scrnn_run::run_folder::HISTORY;
use scrnn_run::trained::Trained;

use crate::args::Shared;
use crate::output;
use crate::progress::Busy;

/// Write a page about a training run: how it learned, how it predicts, how it runs on its own
///
/// The run folder receives report.html, one page that needs nothing else, and figures/, each figure as SVG with its
/// numbers as CSV. Other files in the folder are left as they are; a run that is still in training can be looked at too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn report runs/mine                       writes runs/mine/report.html
  scrnn report runs/mine --best --out page     of the best network, into the folder page
  scrnn report runs/mine --figures paper --format pdf --width 85mm     also each figure, for a column of a paper")]
pub struct Arguments {
    /// The run folder
    run: PathBuf,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Where to write [default: the run folder]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also write each figure on its own into this folder, with text in the size of print
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// What kind of files the figures are
    #[arg(long, value_enum, default_value_t = Format::Svg, requires = "figures")]
    format: Format,
    /// How wide the figures are, 20mm to 1000mm; also in cm or in
    #[arg(long, value_name = "WIDTH", default_value = "85mm", requires = "figures")]
    width: Width,
    /// Seed of the closed loop's noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
}

/// Kinds of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Text stays text, in the reader's font
    Svg,
    /// Text is in Helvetica
    Pdf,
}

/// A width in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Width(f64);

impl FromStr for Width {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let units = [("mm", 1.0), ("cm", 10.0), ("in", 25.4)];
        let found =
            units.iter().find_map(|(unit, size)| Some(text.strip_suffix(unit)?.trim().parse::<f64>().ok()? * size));
        match found {
            Some(width) if (20.0..=1000.0).contains(&width) => Ok(Self(width)),
            _ => Err("needed: 20mm to 1000mm, or as much in cm or in, e.g. 85mm".to_owned()),
        }
    }
}

/// Looks and writes.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    if !arguments.run.is_dir() {
        let message = format!("{} is not a run folder", arguments.run.display());
        return Err(Failure::input(message, "give the folder that `scrnn train` wrote"));
    }
    let engine = shared.engine()?;
    let busy = Busy::with("running the network", shared.quiet);
    let folders = members::folders(&arguments.run);
    if !folders.is_empty() {
        let all = members::open(&arguments.run, arguments.best)?;
        all.iter().for_each(|trained| shared.say_of(trained));
        let mut rows = Vec::new();
        for folder in &folders {
            rows.push(history::read(&folder.join(HISTORY))?);
        }
        let page = mixture_page(&all, &rows, &engine)?;
        drop(busy);
        return finish(arguments, &page);
    }
    let trained = Trained::open(&arguments.run, arguments.best)?;
    shared.say_of(&trained);
    let source = trained.source(engine.threads())?;
    let rows = history::read(&arguments.run.join(HISTORY))?;
    let page = page(&trained, &source, &rows, arguments.seed, &engine)?;
    drop(busy);
    finish(arguments, &page)
}

fn finish(arguments: &Arguments, page: &Page) -> Result<Ending> {
    let out = arguments.out.as_ref().unwrap_or(&arguments.run);
    scrnn_pages::write(page, out)?;
    output::print(&format!("{}\n", out.join(PAGE).display()))?;
    if let Some(folder) = &arguments.figures {
        let file = |figure: &Figure| match arguments.format {
            Format::Svg => Some((format!("{}.svg", figure.file), figure.svg_in_print(arguments.width.0).into_bytes())),
            Format::Pdf => Some((format!("{}.pdf", figure.file), figure.pdf(arguments.width.0)?)),
        };
        std::fs::create_dir_all(folder).map_err(|error| Failure::disk("make the folder", folder, error))?;
        for (name, bytes) in page.figures().filter_map(file) {
            let path = folder.join(name);
            scrnn_data::replace(&path, &bytes)?;
            output::print(&format!("{}\n", path.display()))?;
        }
    }
    Ok(Ending::Done)
}
