//! One step as JSON, for a page that holds the network: the same numbers as in [`OneStep::c`].

use serde_json::{Value, json};

use super::OneStep;

impl OneStep {
    /// The numbers of the step. Each is written so that it is read as what it is.
    #[must_use]
    pub fn json(&self) -> Value {
        let Self { channels, offset, scale, kind, members, .. } = self;
        json!({ "channels": channels, "offset": offset, "scale": scale, "kind": kind, "members": members })
    }
}
