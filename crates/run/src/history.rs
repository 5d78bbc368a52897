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

/// Fields of a row: in files from before trainings were reset, today, and with sequences that are held out.
const FIELDS: (usize, usize, usize) = (7, 8, 16);

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
///
/// # Errors
/// [`Failure::Disk`].
pub fn read(path: &Path) -> Result<Vec<Row>> {
    Ok(rows(&read_bytes(path)?))
}

/// The rows of a history file's bytes, up to the first that is not whole.
pub fn rows(bytes: &[u8]) -> Vec<Row> {
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
    cut(bytes, u64::MAX).kept.lines().map_while(row).collect()
}

/// What of a history stays when a run goes on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cut {
    /// The whole rows, without the header.
    pub kept: String,
    /// Epoch and seconds of the last of them.
    pub last: Option<(u64, f64)>,
    /// Number of the line that ended them by being no row, unless that is a last one that was half written.
    pub damaged: Option<usize>,
}

/// The rows of a history's bytes up to `epoch`. Epochs ascend; what does not is no row.
pub fn cut(bytes: &[u8], epoch: u64) -> Cut {
    // A byte that is no text spoils its line, not what stands before it.
    let text = String::from_utf8_lossy(bytes);
    let mut found = Cut::default();
    let mut lines = text.split_inclusive('\n').enumerate().skip(1);
    while let Some((number, line)) = lines.next() {
        let whole = line.ends_with('\n');
        match row_of(line) {
            Some((row, seconds)) if whole && row <= epoch && found.last.is_none_or(|(last, _)| row > last) => {
                found.kept.push_str(line);
                found.last = Some((row, seconds));
            }
            // Ahead of the checkpoint, as all that follow; if not, this one is damaged.
            Some((row, _)) if row > epoch => {
                let back = lines.any(|(_, line)| row_of(line).is_some_and(|(row, _)| row <= epoch));
                found.damaged = back.then_some(number + 1);
                break;
            }
            _ => {
                found.damaged = whole.then_some(number + 1);
                break;
            }
        }
    }
    found
}

/// Epoch and seconds of a row. A field may be empty where a network has no nll, and where sequences that are held out were not looked
/// at.
fn row_of(line: &str) -> Option<(u64, f64)> {
    let fields: Vec<&str> = line.trim_end_matches(['\r', '\n']).split(',').take(FIELDS.2 + 1).collect();
    let numbers = fields
        .iter()
        .enumerate()
        .all(|(k, field)| (k == 1 || k >= FIELDS.1) && field.is_empty() || field.parse::<f64>().is_ok());
    // Files from before trainings were reset lack the last column.
    if !numbers
        || ![FIELDS.0, FIELDS.1, FIELDS.2].contains(&fields.len())
        || fields.get(7).is_some_and(|field| field.parse::<u64>().is_err())
    {
        return None;
    }
    let seconds = fields[6].parse().ok().filter(|seconds: &f64| seconds.is_finite() && *seconds >= 0.0)?;
    Some((fields[0].parse().ok()?, seconds))
}

fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    scrnn_data::read_bytes(path).map_err(Failure::from)
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
        let bytes = match path.exists() {
            true => read_bytes(&path)?,
            false => Vec::new(),
        };
        let Cut { kept, last, damaged } = cut(&bytes, epoch);
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
        let rows = |epochs: &[u64]| epochs.iter().map(|&epoch| row(epoch)).collect::<String>();
        let found = |text: &str, epoch| cut(text.as_bytes(), epoch);
        let of = |epochs: &[u64], damaged| {
            let last = epochs.last().map(|&epoch| (epoch, epoch as f64 + 0.25));
            Cut { kept: rows(epochs), last, damaged }
        };
        let text = format!("{HEADER}\n{}", rows(&[0, 10, 20]));
        assert_eq!(found(&text, 10), of(&[0, 10], None));
        assert_eq!(found(&text[..text.len() - 3], 100), of(&[0, 10], None));
        assert_eq!(found("", 100), Cut::default());
        for (from, to) in [
            ("10,0.5", "10,0\u{fffd}5"),
            ("\n10,", "\n1\u{fffd},"),
            ("10.250", "inf"),
            ("10.250", "NaN"),
            ("10.250", "-1.0"),
            ("10.250", "10.250,0.5"),
            ("10.250", "10.250,1,1"),
            (",10.250", ""),
            ("10,0.5,0.1", "10,0.5,"),
            ("\n10,", "\n-10,"),
            // A row again, one that goes back, one that jumps ahead though others follow.
            ("\n10,", "\n0,"),
            ("\n10,", "\n99,"),
        ] {
            let bad = text.replacen(from, to, 1);
            assert_ne!(bad, text);
            assert_eq!(found(&bad, 30), of(&[0], Some(3)), "{from} -> {to}");
        }
        let mut bytes = text.clone().into_bytes();
        let at = text.find("\n10,").unwrap() + 1;
        bytes[at] = 0xff;
        assert_eq!(cut(&bytes, 100), of(&[0], Some(3)));
    }
}
