//! A page into a folder: figures first, the page last, so that a page is never without its files.

use std::fs;
use std::path::Path;

use scrnn_data::replace;
use scrnn_report::{FIGURES, Page};
use scrnn_run::failure::{Failure, Result};

/// Writes `page` into `folder`. Each file is replaced as a whole.
///
/// # Errors
/// [`Failure::Disk`].
pub fn write(page: &Page, folder: &Path) -> Result<()> {
    let figures = folder.join(FIGURES);
    fs::create_dir_all(&figures).map_err(|error| Failure::disk("make the folder", &figures, error))?;
    for (file, text) in page.files() {
        replace(&folder.join(file), text.as_bytes())?;
    }
    Ok(())
}
