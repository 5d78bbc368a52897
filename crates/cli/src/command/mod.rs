//! One file for each command.

pub mod compare;
pub mod completions;
pub mod convert;
pub mod data;
pub mod evaluate;
pub mod export;
pub mod generate;
pub mod inspect;
pub mod recognize;
pub mod report;
pub mod reproduce;
pub mod schema;
pub mod simulate;
pub mod sweep;
pub mod train;
pub mod view;
