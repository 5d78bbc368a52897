//! How messages and progress leave: the caller hands in where they go.

use std::fmt;

use scrnn::learning::EpochReport;

use crate::held_out::Glance;

/// Takes sentences for a person: warnings, and what is going on.
pub trait Messages: Sync {
    /// Says one, which may have several lines.
    fn say(&self, message: &str);
}

/// Watches one training, from whichever thread it runs on.
pub trait Progress: fmt::Debug + Send {
    /// An epoch is over.
    fn epoch(&mut self, report: &EpochReport);

    /// The network was looked at on sequences that it does not learn. Comes before the epoch that it belongs to.
    fn held_out(&mut self, _glance: &Glance) {}

    /// Before it begins, something is tried by learning; this is where that stands.
    fn trying(&mut self, _what: &str, _epoch: u64, _epochs: u64) {}

    /// It was found out how many epochs there will be.
    fn expect(&mut self, _total: u64) {}

    /// Something worth a sentence happened to this training.
    fn say(&self, message: &str);

    /// Nothing more will come.
    fn finish(&self) {}
}

/// Says nothing and shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Messages for Silent {
    fn say(&self, _message: &str) {}
}

impl Progress for Silent {
    fn epoch(&mut self, _report: &EpochReport) {}

    fn say(&self, _message: &str) {}
}
