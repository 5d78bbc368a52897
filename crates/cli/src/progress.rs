//! How training is coming along: a bar on a terminal, a line every few seconds elsewhere. All of it on stderr.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use scrnn::learning::EpochReport;
use scrnn_report::in_words;
use scrnn_run::held_out::Glance;
use scrnn_run::messages::{self, Messages};

use crate::output;

/// Between two lines off a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(2);
/// Beyond this nobody waits.
const LONGEST: Duration = Duration::from_secs(1000 * 365 * 86400);
/// Between two updates of the bar.
const BETWEEN_UPDATES: Duration = Duration::from_millis(100);

/// Trainings that go on side by side, each with a bar or lines of its own.
#[derive(Debug)]
pub struct Bars {
    all: MultiProgress,
    quiet: bool,
    /// Whether a bar goes away with its training.
    passing: bool,
}

impl Bars {
    /// None yet.
    pub fn new(quiet: bool) -> Self {
        Self { all: MultiProgress::new(), quiet, passing: false }
    }

    /// The same for so many trainings that nobody wants to see those that are over.
    pub fn passing(quiet: bool) -> Self {
        Self { passing: true, ..Self::new(quiet) }
    }

    /// For a training of `total` epochs; `label` goes before what is shown of it.
    pub fn bar(&self, label: &str, total: u64) -> Box<dyn messages::Progress> {
        Box::new(Progress { passing: self.passing, ..Progress::labelled(label, total, self.quiet, &self.all) })
    }
}

/// Something that takes a while and knows no epochs, until this is dropped: on a terminal, what it is and for how long; elsewhere a line
/// whenever nothing was said for two seconds.
#[derive(Debug)]
pub struct Busy {
    /// What it is, and since when.
    what: Arc<Mutex<(String, Instant)>>,
    bar: Option<ProgressBar>,
    /// Ends the thread of the lines when it is dropped.
    _lines: Option<Sender<()>>,
}

impl Busy {
    /// From now on; `what` is the beginning of a sentence, e.g. "making the data".
    pub fn with(what: &str, quiet: bool) -> Self {
        Self::beside(what, quiet, None)
    }

    fn beside(what: &str, quiet: bool, others: Option<&MultiProgress>) -> Self {
        let message = what.to_owned();
        let what = Arc::new(Mutex::new((message.clone(), Instant::now())));
        if quiet {
            return Self { what, bar: None, _lines: None };
        }
        if !std::io::stderr().is_terminal() {
            let lines = lines(Arc::clone(&what));
            return Self { what, bar: None, _lines: lines };
        }
        let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed}")
            .unwrap_or_else(|_| ProgressStyle::default_spinner());
        let bar = ProgressBar::new_spinner().with_style(style);
        let bar = others.map_or_else(|| bar.clone(), |others| others.add(bar.clone()));
        bar.set_message(message);
        bar.enable_steady_tick(BETWEEN_UPDATES);
        Self { what, bar: Some(bar), _lines: None }
    }

    /// It is at something else from now on.
    fn at(&self, what: &str) {
        *self.what.lock().unwrap_or_else(PoisonError::into_inner) = (what.to_owned(), Instant::now());
        if let Some(bar) = &self.bar {
            bar.reset_elapsed();
            bar.set_message(output::escaped(what).into_owned());
        }
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Says what goes on, and for how long, whenever all else is silent. Without the thread nothing is said.
fn lines(what: Arc<Mutex<(String, Instant)>>) -> Option<Sender<()>> {
    let (until, over) = channel::<()>();
    let begun = Instant::now();
    let say = move || {
        loop {
            let silent = output::silence().min(begun.elapsed());
            let left = BETWEEN_LINES.saturating_sub(silent);
            if left.is_zero() {
                let (what, since) = what.lock().unwrap_or_else(PoisonError::into_inner).clone();
                output::say(format_args!("{what}, {}", in_words(since.elapsed())));
            }
            match over.recv_timeout(left.max(BETWEEN_UPDATES)) {
                Err(RecvTimeoutError::Timeout) => {}
                _ => return,
            }
        }
    };
    std::thread::Builder::new().name("progress".to_owned()).spawn(say).ok()?;
    Some(until)
}

/// A long command with trainings and with work that knows no epochs: it is never silent for long.
#[derive(Debug)]
pub struct Work {
    bars: Bars,
    busy: Busy,
}

impl Work {
    /// It begins; `what` is as in [`Busy::with`].
    pub fn begin(what: &str, quiet: bool) -> Self {
        let bars = Bars::new(quiet);
        let busy = Busy::beside(what, quiet, Some(&bars.all));
        Self { bars, busy }
    }

    /// As [`Bars::bar`].
    pub fn bar(&self, label: &str, total: u64) -> Box<dyn messages::Progress> {
        self.bars.bar(label, total)
    }
}

impl Messages for Work {
    fn say(&self, message: &str) {
        if self.bars.quiet {
            return;
        }
        self.busy.at(message.lines().next_back().unwrap_or(message));
        match &self.busy.bar {
            // Above the bars, not through them.
            Some(bar) => bar.println(output::escaped(message)),
            None => output::say(message),
        }
    }
}

/// Shows the epochs as they pass.
#[derive(Debug)]
struct Progress {
    label: String,
    display: Display,
    total: u64,
    start: Option<(u64, Instant)>,
    shown: Instant,
    /// What the last look at sequences that are held out came to.
    held_out: Option<String>,
    passing: bool,
}

#[derive(Debug)]
enum Display {
    Quiet,
    Lines,
    Bar(ProgressBar),
}

impl Progress {
    fn labelled(label: &str, total: u64, quiet: bool, all: &MultiProgress) -> Self {
        let display = if quiet {
            Display::Quiet
        } else if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template("{prefix}{bar:24} {human_pos}/{human_len} epochs  {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            Display::Bar(all.add(ProgressBar::new(total).with_style(style).with_prefix(label.to_owned())))
        } else {
            Display::Lines
        };
        Self {
            label: label.to_owned(),
            display,
            total,
            start: None,
            shown: Instant::now(),
            held_out: None,
            passing: false,
        }
    }
}

impl messages::Progress for Progress {
    fn expect(&mut self, total: u64) {
        self.total = total;
        if let Display::Bar(bar) = &self.display {
            bar.set_length(total);
        }
    }

    /// Keeps what is shown with the next epochs.
    fn held_out(&mut self, glance: &Glance) {
        let value = glance.one_step.nll.map_or(format!("{:.3e}", glance.one_step.mse), |nll| format!("{nll:.4}"));
        self.held_out = Some(format!("{value}, alone {:.3} off", glance.closed_loop.distance));
    }

    fn trying(&mut self, what: &str, epoch: u64, epochs: u64) {
        match &self.display {
            Display::Quiet => {}
            Display::Lines if self.shown.elapsed() < BETWEEN_LINES => {}
            Display::Lines => {
                self.shown = Instant::now();
                output::say(format_args!("{}{what}: epoch {epoch}/{epochs}", self.label));
            }
            Display::Bar(bar) if epoch == epochs || self.shown.elapsed() >= BETWEEN_UPDATES => {
                self.shown = Instant::now();
                bar.set_length(epochs);
                bar.set_position(epoch);
                bar.set_message(what.to_owned());
            }
            Display::Bar(_) => {}
        }
    }

    /// Shows where training stands, if it is time to.
    fn epoch(&mut self, report: &EpochReport) {
        let now = Instant::now();
        let (first, begun) = *self.start.get_or_insert((report.epoch, now));
        let pause = match self.display {
            Display::Quiet => return,
            Display::Lines => BETWEEN_LINES,
            Display::Bar(_) => BETWEEN_UPDATES,
        };
        if now.duration_since(self.shown) < pause && (self.passing || report.epoch != self.total) {
            return;
        }
        self.shown = now;
        let speed = (report.epoch - first) as f64 / now.duration_since(begun).as_secs_f64().max(1e-9);
        let mut message = match report.nll {
            Some(nll) => format!("nll {nll:.4}"),
            None => format!("mse {:.3e}", report.mse),
        };
        if let Some(held_out) = &self.held_out {
            message += &format!("  held out {held_out}");
        }
        message += &format!("  rate {:.1e}", report.rate_shared);
        if speed > 0.0 {
            let left = left(self.total.saturating_sub(report.epoch), speed);
            message += &format!("  {} epochs/s  {left} left", rounded(speed));
        }
        match &self.display {
            Display::Quiet => {}
            Display::Lines => {
                output::say(format_args!("{}epoch {}/{}  {message}", self.label, report.epoch, self.total));
            }
            Display::Bar(bar) => {
                bar.set_position(report.epoch);
                bar.set_message(message);
            }
        }
    }

    /// Says something that stays.
    fn say(&self, message: &str) {
        match &self.display {
            Display::Quiet => {}
            Display::Lines => output::say(format_args!("{}{message}", self.label)),
            Display::Bar(bar) => bar.println(output::escaped(&format!("{}{message}", self.label))),
        }
    }

    /// Leaves the terminal in order.
    fn finish(&self) {
        if let Display::Bar(bar) = &self.display {
            if self.passing {
                return bar.finish_and_clear();
            }
            bar.abandon();
        }
    }
}

/// How long so many epochs take at so many a second. Who asks for 2^63 of them gets more than a `Duration` holds.
fn left(epochs: u64, speed: f64) -> String {
    match Duration::try_from_secs_f64(epochs as f64 / speed) {
        Ok(left) if left < LONGEST => in_words(left),
        _ => "more than 1000 years".to_owned(),
    }
}

/// Three digits are enough for a speed.
fn rounded(speed: f64) -> String {
    if speed < 100.0 { format!("{speed:.1}") } else { format!("{speed:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epochs_that_nobody_can_wait_for_are_told_and_no_panic() {
        assert_eq!(left(100, 10.0), in_words(Duration::from_secs(10)));
        for (epochs, speed) in [(u64::MAX, 0.1), (i64::MAX as u64, 1.9), (u64::MAX, f64::MIN_POSITIVE)] {
            assert_eq!(left(epochs, speed), "more than 1000 years");
        }
    }
}
