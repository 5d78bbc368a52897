//! Pages to look at: text, tables and figures in one file that needs nothing else, no network, no script, no font.
//!
//! A [`Page`] is built of [`Section`]s; [`write`](write()) puts it into a folder, each figure also as an SVG file and its
//! numbers as CSV.

mod chart;
mod page;
mod picture;
mod writing;

pub use chart::{Chart, Mark, Panel, Series, Tone};
pub use page::{Block, Drawing, Figure, Page, Section, Sheet};
pub use picture::{Picture, Pictures, View};
pub use writing::{FIGURES, PAGE, write};
