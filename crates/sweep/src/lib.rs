//! Many networks from one file: what is trained, by whom, and what came of it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`file`](mod@file), [`axes`] | the sweep file: its types, lists, ranges and random draws of values |
//! | [`plan`] | all settings and runs of a sweep, each with a folder whose name says what differs |
//! | [`claim`] | one worker at a time for each run, without a server |
//! | [`then`], [`measures`] | what is done with each trained network, and the numbers that are collected |
//! | [`outcome`] | what a run came to, in files beside it |
//! | [`working`] | works on a sweep: trainings side by side, whatever others do |
//! | [`status`] | how far a sweep is, read from its folder |
//! | [`slurm`] | a sweep as an array job |
//! | [`compare`] | all runs on one page, with metrics.csv |
//!
//! Everything in the files of a run, in `plan.json`, `metrics.csv` and the page is the same to the byte however often the work was
//! interrupted and whoever did it. Times and machines stand in `times.json` and in the seconds of `history.csv`, and nowhere else.

pub mod axes;
pub mod claim;
pub mod compare;
pub mod file;
pub mod measures;
pub mod outcome;
pub mod plan;
pub mod slurm;
pub mod status;
pub mod then;
pub mod working;
