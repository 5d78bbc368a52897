//! What a reproduction is given besides its options: the machine, and where news goes.

use scrnn::engine::InstructionSet;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::{Messages, Progress};

/// Makes what watches one training, from a label to go before what is shown of it and the number of its epochs.
pub type ProgressOf<'a> = dyn Fn(&str, u64) -> Box<dyn Progress> + Sync + 'a;

/// The machine, and where news goes.
pub struct Context<'a> {
    /// Threads to work with in all.
    pub threads: usize,
    /// The vector instructions to use.
    pub instruction_set: InstructionSet,
    /// A person's wish to stop.
    pub interrupt: &'a Interrupt,
    /// Takes sentences for a person.
    pub messages: &'a dyn Messages,
    /// Watches trainings.
    pub progress: &'a ProgressOf<'a>,
}
