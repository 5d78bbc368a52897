//! Ctrl-C (or a polite request to end, as of a batch system): the first finishes the epoch, the second ends at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the user wants to stop.
#[derive(Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on.
    pub fn listen() -> Self {
        let asked = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&asked);
        let handler = move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!("\nfinishing the epoch; once more ends at once");
        };
        if let Err(error) = ctrlc::set_handler(handler) {
            // Then Ctrl-C just kills, and the last checkpoint remains.
            eprintln!("warning: cannot listen to Ctrl-C: {error}");
        }
        Self(asked)
    }

    /// Whether the user asked to stop.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
