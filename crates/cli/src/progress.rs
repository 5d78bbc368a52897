//! How training is coming along: a bar on a terminal, a line every few seconds elsewhere. All of it on stderr.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use scrnn::learning::EpochReport;

/// Between two lines off a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);
/// Between two updates of the bar.
const BETWEEN_UPDATES: Duration = Duration::from_millis(100);

/// Shows the epochs as they pass.
#[derive(Debug)]
pub struct Progress {
    label: String,
    display: Display,
    total: u64,
    start: Option<(u64, Instant)>,
    shown: Instant,
}

#[derive(Debug)]
enum Display {
    Quiet,
    Lines,
    Bar(ProgressBar),
}

impl Progress {
    /// For a training of `total` epochs.
    pub fn new(total: u64, quiet: bool) -> Self {
        Self::labelled("", total, quiet, &MultiProgress::new())
    }

    /// For one of several trainings that go on side by side; `label` goes before what is shown of it.
    pub fn labelled(label: &str, total: u64, quiet: bool, all: &MultiProgress) -> Self {
        let display = if quiet {
            Display::Quiet
        } else if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template("{prefix}{bar:24} {human_pos}/{human_len} epochs  {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            Display::Bar(all.add(ProgressBar::new(total).with_style(style).with_prefix(label.to_owned())))
        } else {
            Display::Lines
        };
        Self { label: label.to_owned(), display, total, start: None, shown: Instant::now() }
    }

    /// Shows where training stands, if it is time to.
    pub fn epoch(&mut self, report: &EpochReport) {
        let now = Instant::now();
        let (first, begun) = *self.start.get_or_insert((report.epoch, now));
        let pause = match self.display {
            Display::Quiet => return,
            Display::Lines => BETWEEN_LINES,
            Display::Bar(_) => BETWEEN_UPDATES,
        };
        if now.duration_since(self.shown) < pause && report.epoch != self.total {
            return;
        }
        self.shown = now;
        let speed = (report.epoch - first) as f64 / now.duration_since(begun).as_secs_f64().max(1e-9);
        let mut message = match report.nll {
            Some(nll) => format!("nll {nll:.4}"),
            None => format!("mse {:.3e}", report.mse),
        };
        message += &format!("  rate {:.1e}", report.rate_shared);
        if speed > 0.0 {
            let left = Duration::from_secs_f64((self.total - report.epoch.min(self.total)) as f64 / speed);
            message += &format!("  {} epochs/s  {} left", rounded(speed), in_words(left));
        }
        match &self.display {
            Display::Quiet => {}
            Display::Lines => eprintln!("{}epoch {}/{}  {message}", self.label, report.epoch, self.total),
            Display::Bar(bar) => {
                bar.set_position(report.epoch);
                bar.set_message(message);
            }
        }
    }

    /// Says something that stays.
    pub fn say(&self, message: &str) {
        match &self.display {
            Display::Quiet => {}
            Display::Lines => eprintln!("{}{message}", self.label),
            Display::Bar(bar) => bar.println(format!("{}{message}", self.label)),
        }
    }

    /// Leaves the terminal in order.
    pub fn finish(&self) {
        if let Display::Bar(bar) = &self.display {
            bar.abandon();
        }
    }
}

/// Three digits are enough for a speed.
fn rounded(speed: f64) -> String {
    if speed < 100.0 { format!("{speed:.1}") } else { format!("{speed:.0}") }
}

/// A duration as people say it.
pub fn in_words(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round().min(9e15) as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_as_people_say_them() {
        let words = [0.4, 59.0, 75.0, 3723.0].map(|seconds| in_words(Duration::from_secs_f64(seconds)));
        assert_eq!(words, ["0 s", "59 s", "1 min 15 s", "1 h 02 min"]);
    }
}
