//! Under which circumstances networks learn.

use super::preset::Kind;

/// Networks that learn under the same circumstances.
#[derive(Debug, Clone, Copy)]
pub struct Condition {
    /// Names its run folders and its part of metrics.json; empty where a study has one condition only.
    pub key: &'static str,
    /// As it is shown.
    pub label: &'static str,
    /// The networks to train for each seed; keys that a person changes are the first one's.
    pub networks: &'static [Kind],
    /// The most seeds that it gets.
    pub most: Option<u64>,
}

impl Condition {
    /// The only one of a study.
    pub const fn only(networks: &'static [Kind]) -> Self {
        Self { key: "", label: "", networks, most: None }
    }

    /// The name of a seed's run folder.
    pub fn run(&self, seed: u64, kind: &Kind) -> String {
        let name = if self.key.is_empty() { "seed" } else { self.key };
        format!("{name}-{seed}{}", kind.suffix)
    }
}
