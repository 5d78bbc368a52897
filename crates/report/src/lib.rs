//! Pages to look at: text, tables and figures in one file that needs nothing else, no network, no font, and no script but those of
//! an [`Applet`], which stand in the page.
//!
//! A [`Page`] is built of [`Section`]s; [`Page::files`] gives the files that it consists of, each figure also as an SVG file
//! and its numbers as CSV. Nothing here knows a network, and nothing opens a file.
//!
//! | feature | what it adds |
//! |---|---|
//! | `scenes` (default) | pictures of simulated scenes, see `Picture` |

mod axis;
mod chart;
mod escape;
mod page;
mod paper;
#[cfg(feature = "scenes")]
mod picture;
mod table;
mod words;

pub use chart::{Chart, Mark, Panel, Series, Tone};
pub use page::{Applet, Block, Drawing, FIGURES, Figure, PAGE, Page, Section, Sheet};
#[cfg(feature = "scenes")]
pub use picture::{Picture, Pictures, View};
pub use table::Table;
pub use words::in_words;
