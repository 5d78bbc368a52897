//! Pages about trained networks and their data: what is drawn of a run wherever runs are shown, and what is told of files.

mod blocks;
mod chosen;
pub mod data_page;
mod held_out;
pub mod inspection;
pub mod live;
pub mod mixture_page;
mod playground;
pub mod run_page;
pub mod view;
mod writing;

pub use blocks::{calibration_blocks, learning_curves};
pub use playground::{Playground, STEP, Unplayable};
pub use writing::write;
