//! What looks wrong in numbers that were read, as a pure function of them.

use serde::Serialize;

/// One thing that looks wrong.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "suspicion", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Suspicion {
    /// A channel grows by the same amount at every step: a clock or a counter.
    #[error("channel {channel} grows in even steps of {step}, as a clock or a counter does")]
    EvenSteps {
        /// The channel.
        channel: String,
        /// By how much it grows.
        step: f64,
    },
}

impl Suspicion {
    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::EvenSteps { .. } => Some("leave it out: `channels = [...]` names what to learn".to_owned()),
        }
    }
}
