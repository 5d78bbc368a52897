//! Ctrl-C (or a polite request to end, as of a batch system): the first finishes the epoch, the second ends at once.

use scrnn_run::interrupt::Interrupt;

/// Listens from now on.
pub fn listen() -> Interrupt {
    let interrupt = Interrupt::new();
    let wish = interrupt.clone();
    let handler = move || {
        if wish.ask() {
            std::process::exit(130);
        }
        eprintln!("\nfinishing the epoch, or the sample of an evaluation; once more ends at once");
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        // Then Ctrl-C just kills, and the last checkpoint remains.
        eprintln!("warning: cannot listen to Ctrl-C: {error}");
    }
    interrupt
}
