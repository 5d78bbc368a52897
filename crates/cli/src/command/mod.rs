//! One file for each command.

pub mod completions;
pub mod data;
pub mod generate;
pub mod inspect;
pub mod recognize;
pub mod schema;
pub mod train;
