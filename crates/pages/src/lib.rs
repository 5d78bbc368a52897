//! Pages about trained networks and their data: what is drawn of a run wherever runs are shown, and what is told of files.

mod blocks;
pub mod data_page;
mod held_out;
pub mod inspection;
pub mod mixture_page;
pub mod run_page;
mod writing;

pub use blocks::{calibration_blocks, learning_curves};
pub use writing::write;
