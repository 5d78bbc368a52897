//! Pages about trained networks: what is drawn of a run wherever runs are shown.

mod blocks;
pub mod run_page;
mod writing;

pub use blocks::{calibration_blocks, learning_curves};
pub use writing::write;
