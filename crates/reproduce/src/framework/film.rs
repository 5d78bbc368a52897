//! A closed loop of a robot as it was recorded, for the page to link to.

use scrnn_report::Block;
use scrnn_run::failure;
use scrnn_run::run_folder::RunFolder;

/// One recording.
#[derive(Debug)]
pub struct Film {
    /// Name of its files, without extension.
    pub name: String,
    /// What it shows.
    pub about: String,
    /// The bytes of an MCAP file.
    pub bytes: Vec<u8>,
}

/// Writes recordings beside the page, each with a page of its own that plays it; links to these.
pub fn write(films: &[Film], folder: &RunFolder) -> failure::Result<Option<Block>> {
    let mut links = Vec::new();
    for Film { name, about, bytes } in films {
        let (recording, page) = (format!("{name}.mcap"), format!("{name}.html"));
        let played = scrnn_pages::view::page(&folder.file(&recording), Some(bytes), None)?;
        folder.write(&recording, bytes)?;
        folder.write(&page, played.html().as_bytes())?;
        links.push((about.clone(), page));
    }
    Ok((!links.is_empty()).then_some(Block::Links(links)))
}
