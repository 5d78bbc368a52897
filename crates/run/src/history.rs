//! history.csv of a run folder: how training went, one row every so many epochs.
//!
//! Rows wait in memory until the next checkpoint. After a crash the file may thus be ahead of the checkpoint, never
//! behind it: rows beyond the checkpoint's epoch are cut off, also a last line that was half written.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use scrnn::learning::EpochReport;

use crate::failure::{Failure, Result};
use crate::messages::Messages;
use crate::run_folder::{HISTORY, RunFolder};

const HEADER: &str = "epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds,recoveries\n";

/// What a row says that learning curves are drawn from.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The number of updates made before.
    pub epoch: u64,
    /// Nats per step and channel, in scaled units; none without variance units.
    pub nll: Option<f64>,
    /// Mean squared error per step and channel, in scaled units.
    pub mse: f64,
    /// How often the training was reset to its best network so far.
    pub recoveries: u64,
}

/// The rows of a history file, up to the first that is not whole.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let bytes = std::fs::read(path).map_err(|error| Failure::disk("read", path, error))?;
    let text = String::from_utf8_lossy(&bytes);
    let row = |line: &str| {
        let mut fields = line.split(',');
        let epoch = fields.next()?.parse().ok()?;
        let nll = fields.next()?;
        let mse = fields.next()?.parse().ok()?;
        // Files from before trainings were reset lack the last column.
        let recoveries = fields.nth(4).map_or(Some(0), |field| field.parse().ok())?;
        Some(Row { epoch, nll: nll.parse().ok(), mse, recoveries })
    };
    let (kept, _, _) = rows_up_to(&text, u64::MAX);
    Ok(kept.lines().map_while(row).collect())
}

/// The history that is being written.
#[derive(Debug)]
pub struct History {
    waiting: String,
    last_epoch: Option<u64>,
    seconds_before: f64,
}

impl History {
    /// Starts an empty file.
    pub fn start(run: &RunFolder) -> Result<Self> {
        run.write(HISTORY, HEADER.as_bytes())?;
        Ok(Self { waiting: String::new(), last_epoch: None, seconds_before: 0.0 })
    }

    /// Goes on with the file of a run whose checkpoint stands at `epoch`.
    ///
    /// Damage before that is said: the rows from there on are lost, the training is not.
    pub fn go_on(run: &RunFolder, epoch: u64, messages: &dyn Messages) -> Result<Self> {
        let path = run.file(HISTORY);
        // A byte that is no text spoils its line, not what stands before it.
        let text = match std::fs::read(&path) {
            Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(Failure::disk("read", &path, error)),
        };
        let (kept, last, damaged) = rows_up_to(&text, epoch);
        if let Some(line) = damaged {
            messages.say(&format!(
                "{}: line {line} is damaged; the history is cut before it and goes on from epoch {epoch}",
                path.display()
            ));
        }
        run.write(HISTORY, format!("{HEADER}{kept}").as_bytes())?;
        let (last_epoch, seconds_before) = last.map_or((None, 0.0), |(epoch, seconds)| (Some(epoch), seconds));
        Ok(Self { waiting: String::new(), last_epoch, seconds_before })
    }

    /// Seconds that earlier processes spent on the run.
    pub fn seconds_before(&self) -> f64 {
        self.seconds_before
    }

    /// Takes a row; `seconds` count from the start of this process' training.
    pub fn row(&mut self, report: &EpochReport, seconds: f64) {
        if self.last_epoch.is_some_and(|last| report.epoch <= last) {
            return;
        }
        self.last_epoch = Some(report.epoch);
        let nll = report.nll.map_or(String::new(), |nll| format!("{nll:?}"));
        let EpochReport { epoch, mse, rate_shared, rate_initial, gradient_norm, recoveries, .. } = report;
        let seconds = self.seconds_before + seconds;
        writeln!(
            self.waiting,
            "{epoch},{nll},{mse:?},{rate_shared:?},{rate_initial:?},{gradient_norm:?},{seconds:.3},{recoveries}"
        )
        .expect("a string takes all");
    }

    /// Appends the waiting rows to the file.
    pub fn flush(&mut self, run: &RunFolder) -> Result<()> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let path = run.file(HISTORY);
        let append = || -> std::io::Result<()> {
            let mut file = File::options().append(true).create(true).open(&path)?;
            file.write_all(self.waiting.as_bytes())?;
            file.sync_all()
        };
        append().map_err(|error| Failure::disk("write", &path, error))?;
        self.waiting.clear();
        Ok(())
    }
}

/// The whole rows up to `epoch`, epoch and seconds of the last of them, and the number of the line that ended them by being no
/// row, unless that is a last one that was half written.
fn rows_up_to(text: &str, epoch: u64) -> (String, Option<(u64, f64)>, Option<usize>) {
    let (mut kept, mut last, mut damaged) = (String::new(), None, None);
    for (number, line) in text.split_inclusive('\n').enumerate().skip(1) {
        let mut fields = line.trim_end().split(',');
        let row = fields.next().and_then(|field| field.parse::<u64>().ok());
        let seconds = fields.nth(5).and_then(|field| field.parse::<f64>().ok());
        let whole = line.trim_end().split(',').all(|field| field.is_empty() || field.parse::<f64>().is_ok());
        match (row.filter(|_| whole), seconds) {
            (Some(row), Some(seconds)) if row <= epoch && line.ends_with('\n') => {
                kept.push_str(line);
                last = Some((row, seconds));
            }
            (Some(row), Some(_)) if row > epoch => break,
            _ => {
                damaged = line.ends_with('\n').then_some(number + 1);
                break;
            }
        }
    }
    (kept, last, damaged)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn learning_curves_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(HISTORY);
        let text = format!("{HEADER}0,1.5,0.25,1e-7,1e-4,2.0,0.000,0\n5,,0.125,1e-7,1e-4,2.0,0.100,2\n9,0.5,0.");
        std::fs::write(&path, text).unwrap();
        let rows = [
            Row { epoch: 0, nll: Some(1.5), mse: 0.25, recoveries: 0 },
            Row { epoch: 5, nll: None, mse: 0.125, recoveries: 2 },
        ];
        assert_eq!(read(&path).unwrap(), rows);
        // A file of an earlier version.
        std::fs::write(
            &path,
            "epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds\n0,1.5,0.25,1e-7,1e-4,2.0,0.0\n",
        )
        .unwrap();
        assert_eq!(read(&path).unwrap(), rows[..1]);
    }

    #[test]
    fn rows_beyond_the_checkpoint_and_half_lines_are_cut_off() {
        let row = |epoch| format!("{epoch},0.5,0.1,1e-7,1e-4,2.0,{epoch}.250\n");
        let text = format!("{HEADER}{}{}{}", row(0), row(10), row(20));
        assert_eq!(rows_up_to(&text, 10), (format!("{}{}", row(0), row(10)), Some((10, 10.25)), None));
        let half = &text[..text.len() - 3];
        assert_eq!(rows_up_to(half, 100).1, Some((10, 10.25)));
        assert_eq!(rows_up_to("", 100), (String::new(), None, None));
        let bad = text.replace("10,0.5", "10,0\u{fffd}5");
        assert_eq!(rows_up_to(&bad, 100), (row(0), Some((0, 0.25)), Some(3)));
        let bad = text.replace("\n10,", "\n1\u{fffd},");
        assert_eq!(rows_up_to(&bad, 100), (row(0), Some((0, 0.25)), Some(3)));
    }
}
