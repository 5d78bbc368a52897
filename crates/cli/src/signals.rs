//! Signals that ask a long command to end: the first is heard when the epoch is over, and what was reached is saved.
//!
//! | signal | sent by | exit code |
//! |---|---|---|
//! | SIGHUP | a terminal that goes away | 129 |
//! | SIGINT | Ctrl-C | 130 |
//! | SIGUSR1 | a batch system, before it takes the machine away | 138 |
//! | SIGTERM | `kill`, a batch system | 143 |
//! | SIGXCPU | a limit on processor time | 152 |
//!
//! After the first, SIGINT and SIGTERM end the program at once. The others are often sent twice without a person's wish (a
//! terminal's by the system and by the shell, SIGXCPU every second), and change nothing then. What the parent ignores
//! (`nohup`, a shell's background jobs) stays ignored.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use scrnn_run::interrupt::Interrupt;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::output;

/// Added to a signal's number, this is the exit code of a command that the signal ended, as in shells.
const ENDED_BY: usize = 128;
/// Between two looks at whether there is something to say.
const PAUSE: Duration = Duration::from_millis(50);

/// The signals and their names.
const HEARD: &[(i32, &str)] = &[
    (SIGINT, "Ctrl-C"),
    (SIGTERM, "SIGTERM"),
    #[cfg(unix)]
    (signal_hook::consts::SIGHUP, "SIGHUP"),
    #[cfg(unix)]
    (signal_hook::consts::SIGUSR1, "SIGUSR1"),
    #[cfg(unix)]
    (signal_hook::consts::SIGXCPU, "SIGXCPU"),
];

/// Hears signals for one command.
#[derive(Debug, Clone, Default)]
pub struct Signals(Arc<AtomicUsize>);

impl Signals {
    /// The exit code of a command that ended because of a signal, if there was one.
    pub fn code(&self) -> Option<u8> {
        let signal = self.0.load(Ordering::SeqCst);
        (signal != 0).then(|| u8::try_from(ENDED_BY + signal).unwrap_or(u8::MAX))
    }

    /// Listens from now on.
    pub fn listen(&self) -> Interrupt {
        let interrupt = Interrupt::new();
        let ignored = ignored();
        for &(signal, name) in HEARD.iter().filter(|(signal, _)| ignored & (1_u64 << (signal - 1)) == 0) {
            if let Err(error) = self.hear(signal, &interrupt) {
                // Then it just kills, and the last checkpoint remains.
                output::say(format_args!("warning: cannot listen to {name}: {error}"));
            }
        }
        let signals = self.clone();
        let say = move || {
            while signals.code().is_none() {
                std::thread::sleep(PAUSE);
            }
            let signal = signals.0.load(Ordering::SeqCst);
            let name = HEARD.iter().find(|(number, _)| usize::try_from(*number) == Ok(signal)).map_or("", |one| one.1);
            output::say(format_args!(
                "\n{name}: finishing the epoch, or the sample of an evaluation; Ctrl-C once more ends at once"
            ));
        };
        // Without the thread nothing is said; the signals are heard all the same.
        let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(say);
        interrupt
    }

    /// The order matters: what ends at once must not see the wish of its own signal.
    fn hear(&self, signal: i32, interrupt: &Interrupt) -> std::io::Result<()> {
        let wish = interrupt.flag();
        if signal == SIGINT || signal == SIGTERM {
            flag::register_conditional_shutdown(signal, ENDED_BY as i32 + signal, Arc::clone(&wish))?;
        }
        flag::register_usize(signal, Arc::clone(&self.0), usize::try_from(signal).unwrap_or_default())?;
        flag::register(signal, wish)?;
        Ok(())
    }
}

/// A bit for each signal that the parent told the system to ignore, as far as the system says so (Linux does).
fn ignored() -> u64 {
    std::fs::read_to_string("/proc/self/status").map_or(0, |status| ignored_in(&status))
}

fn ignored_in(status: &str) -> u64 {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_from_what_the_system_says() {
        let status = "Name:\tscrnn\nSigBlk:\t0000000000000000\nSigIgn:\t0000000000001001\nSigCgt:\t0\n";
        assert_eq!(ignored_in(status), 1 << 12 | 1);
        assert_eq!((ignored_in(""), ignored_in("SigIgn:\tzz\n")), (0, 0));
    }
}
