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
use crate::held_out::Glance;
use crate::messages::Messages;
use crate::run_folder::{HISTORY, RunFolder};

const HEADER: &str = "epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds,recoveries";

/// What follows where sequences are held out; empty in rows of epochs without a look at them. One step ahead from the mean initial state,
/// after the burn-in; then the closed loop: root mean squared distances after so many steps and at the end, and shares of samples within
/// one and two standard deviations.
const HELD_OUT: &str =
    ",held_out_nll,held_out_mse,closed_loop_1,closed_loop_5,closed_loop_20,closed_loop_end,within_1,within_2";

fn header(held_out: bool) -> String {
    format!("{HEADER}{}\n", if held_out { HELD_OUT } else { "" })
}

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
    /// nll, or the squared error without variance units, on sequences that are held out, where they were looked at.
    pub held_out: Option<f64>,
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
        let nll = nll.parse().ok();
        let held_out: [Option<f64>; 2] = [(); 2].map(|()| fields.next().and_then(|field| field.parse().ok()));
        let held_out = if nll.is_some() { held_out[0] } else { held_out[1] };
        Some(Row { epoch, nll, mse, recoveries, held_out })
    };
    let (kept, _, _) = rows_up_to(&text, u64::MAX);
    Ok(kept.lines().map_while(row).collect())
}

/// The history that is being written.
#[derive(Debug)]
pub struct History {
    waiting: String,
    held_out: bool,
    last_epoch: Option<u64>,
    seconds_before: f64,
}

impl History {
    /// Starts an empty file, with columns for sequences that are held out or without them.
    pub fn start(run: &RunFolder, held_out: bool) -> Result<Self> {
        run.write(HISTORY, header(held_out).as_bytes())?;
        Ok(Self { waiting: String::new(), held_out, last_epoch: None, seconds_before: 0.0 })
    }

    /// Goes on with the file of a run whose checkpoint stands at `epoch`.
    ///
    /// Damage before that is said: the rows from there on are lost, the training is not.
    pub fn go_on(run: &RunFolder, (epoch, held_out): (u64, bool), messages: &dyn Messages) -> Result<Self> {
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
        run.write(HISTORY, format!("{}{kept}", header(held_out)).as_bytes())?;
        let (last_epoch, seconds_before) = last.map_or((None, 0.0), |(epoch, seconds)| (Some(epoch), seconds));
        Ok(Self { waiting: String::new(), held_out, last_epoch, seconds_before })
    }

    /// Seconds that earlier processes spent on the run.
    pub fn seconds_before(&self) -> f64 {
        self.seconds_before
    }

    /// Takes a row; `seconds` count from the start of this process' training.
    pub fn row(&mut self, report: &EpochReport, seconds: f64, glance: Option<&Glance>) {
        if self.last_epoch.is_some_and(|last| report.epoch <= last) {
            return;
        }
        self.last_epoch = Some(report.epoch);
        let nll = report.nll.map_or(String::new(), |nll| format!("{nll:?}"));
        let EpochReport { epoch, mse, rate_shared, rate_initial, gradient_norm, recoveries, .. } = report;
        let seconds = self.seconds_before + seconds;
        let held_out = match (self.held_out, glance) {
            (false, _) => String::new(),
            (true, None) => ",".repeat(HELD_OUT.matches(',').count()),
            (true, Some(glance)) => held_out(glance),
        };
        writeln!(
            self.waiting,
            "{epoch},{nll},{mse:?},{rate_shared:?},{rate_initial:?},{gradient_norm:?},{seconds:.3},{recoveries}{held_out}"
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

/// The columns of a look at what is held out.
fn held_out(glance: &Glance) -> String {
    let Glance { one_step, closed_loop } = glance;
    let mut values = vec![one_step.nll, Some(one_step.mse)];
    values.extend(closed_loop.after.iter().map(|after| after.distance));
    values.extend([Some(closed_loop.end), closed_loop.within_one, closed_loop.within_two]);
    values.into_iter().map(|value| value.map_or(",".to_owned(), |value| format!(",{value:?}"))).collect()
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
        let text = format!("{HEADER}\n0,1.5,0.25,1e-7,1e-4,2.0,0.000,0\n5,,0.125,1e-7,1e-4,2.0,0.100,2\n9,0.5,0.");
        std::fs::write(&path, text).unwrap();
        let rows = [
            Row { epoch: 0, nll: Some(1.5), mse: 0.25, recoveries: 0, held_out: None },
            Row { epoch: 5, nll: None, mse: 0.125, recoveries: 2, held_out: None },
        ];
        assert_eq!(read(&path).unwrap(), rows);
        let text = format!(
            "{}0,1.5,0.25,1,1,2.0,0.0,0{}\n5,1.5,0.25,1,1,2.0,0.0,0,-0.5,0.1,1,,,2,,\n",
            header(true),
            ",".repeat(8)
        );
        std::fs::write(&path, text).unwrap();
        let held_out: Vec<Option<f64>> = read(&path).unwrap().iter().map(|row| row.held_out).collect();
        assert_eq!(held_out, [None, Some(-0.5)]);
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
        let text = format!("{HEADER}\n{}{}{}", row(0), row(10), row(20));
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
