//! A page into a folder: figures first, the page last, so that a page is never without its files.

use std::fs;
use std::path::Path;

use super::page::Page;
use crate::failure::{Failure, Result};
use scrnn_data::replace;

/// The page.
pub const PAGE: &str = "report.html";
/// Where each figure lies as SVG, and its numbers as CSV.
pub const FIGURES: &str = "figures";

/// Writes `page` into `folder`. Each file is replaced as a whole.
pub fn write(page: &Page, folder: &Path) -> Result<()> {
    let figures = folder.join(FIGURES);
    fs::create_dir_all(&figures).map_err(|error| Failure::disk("make the folder", &figures, error))?;
    for figure in page.figures() {
        replace(&figures.join(format!("{}.svg", figure.file)), figure.file_svg().as_bytes())?;
        replace(&figures.join(format!("{}.csv", figure.file)), figure.csv().as_bytes())?;
    }
    replace(&folder.join(PAGE), page.html().as_bytes())?;
    Ok(())
}
