//! Sequences from tables of text.
//!
//! - Fields stand between commas, semicolons, tabs or spaces; the first line of numbers tells which, or `sep=;` above.
//! - Lines that begin with `#` or `%` are comments. `# columns: NAME ...` and `# sequence: NAME` in them give names, and so
//!   does a comment of as many names as there are columns.
//! - The lines above the first row of numbers are the header: names in one line or in several, and units ([`header`]).
//! - Columns that tell the time, count rows or tell sequences apart are no channels. They are known by their names
//!   ([`roles`]) and by how their values behave ([`assembly`], [`clock`]). What is asked for by name is a channel.
//! - Rows belong together that have the same label. Without labels a blank line ends a sequence, and so does a clock or
//!   counter that begins again. Rows keep the order they have in the file.
//! - A table without a header whose rows are series with their class before them, is taken so ([`classes`]). Headers of motion
//!   capture are known ([`markers`]).
//! - Sequences may differ in length. Without a name they are called 1, 2, ...

use std::ops::Range;

use crate::budget::OverBudget;
use crate::excerpt::{excerpt, shortened};
use crate::remark::Remark;
use crate::samples::Samples;
use crate::source::Source;
use crate::{FileError, LineError, LineProblem, Selection};

use assembly::{Assembly, assemble};
use fields::DetectionOrder;
use header::{Layout, Unclear};
use lines::Line;
use numbers::{Value, has_decimal_comma};
use rows::{Bad, Plan, Rows, Stop, plans};

mod assembly;
mod classes;
mod clock;
mod dates;
mod decode;
mod fields;
mod header;
mod lines;
mod markers;
mod numbers;
mod roles;
mod rows;
pub mod writing;

pub use writing::unguarded;

/// Reads a table whose fields stand between commas, or whatever else is found.
pub fn read_csv(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    read(source, DetectionOrder::CommaFirst, selection)
}

/// Reads a table whose fields stand between tabs, or whatever else is found.
pub fn read_tsv(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    read(source, DetectionOrder::TabFirst, selection)
}

fn read(source: &Source<'_>, order: DetectionOrder, selection: &Selection) -> Result<Samples, FileError> {
    let (path, bytes) = (source.name(), source.bytes()?);
    let over = |problem: OverBudget| FileError::OverBudget { path: path.to_owned(), problem };
    let decoded = decode::decode(path, &bytes)?;
    let table = Table { path, text: &decoded.text };
    let layout = Layout::find(table.text, order).map_err(|unclear| table.unclear(unclear))?;
    source.budget().take(layout.columns.len().saturating_mul(512)).map_err(over)?;
    let plans = plans(&layout, selection);
    let rows = Rows::read(table.text, &layout, &plans, source.budget()).map_err(|stop| match stop {
        Stop::Count(line, found) => table.wrong_count(&layout, line, found),
        Stop::Budget(problem) => over(problem),
    })?;
    if rows.count == 0 {
        return Err(FileError::Empty { path: path.to_owned() });
    }
    let (bad, trailing): (Vec<[Option<Box<Bad>>; 2]>, usize) =
        (rows.columns.iter().map(|kept| kept.bad.clone()).collect(), rows.trailing_comments);
    let asked = selection.channels.is_some();
    let assembly = assemble(&layout, &plans, rows, source.budget(), asked).map_err(over)?;
    // What is no number at all is a typing error, and is shown.
    let typed = bad.iter().all(|[_, other]| other.is_none());
    if typed && !layout.named && !asked && selection.period.is_none() && !selection.ignores_time() {
        source
            .budget()
            .take_values::<f64>(assembly.samples.tracks.iter().map(|one| one.values.len()).sum())
            .map_err(over)?;
        if let Some(samples) = classes::by_rows(&assembly.samples) {
            return Ok(samples);
        }
    }
    if let Some(error) = table.first_error(&assembly, &plans, bad, selection) {
        return Err(error);
    }
    if assembly.channels.is_empty() {
        return Err(table.no_channel(&layout, selection));
    }
    let mut samples = assembly.samples;
    if let Some(rate) = layout.rate.filter(|_| samples.facts.clock.is_none()) {
        samples.period = Some(1.0 / rate);
        samples.remarks.push(Remark::Understood { what: format!("{rate} images a second, as the lines above tell") });
    }
    if trailing > 0 {
        let what = format!("what stands behind `#` at the end of {trailing} lines was passed over");
        samples.remarks.push(Remark::Understood { what });
    }
    if let Some(from) = decoded.from {
        samples.remarks.push(Remark::Understood { what: format!("the text is encoded in {from}") });
    }
    Ok(samples)
}

/// A file and its text, for messages.
struct Table<'a> {
    path: &'a str,
    text: &'a str,
}

impl Table<'_> {
    /// What is wrong with a line of this number that begins there, at the span within it.
    fn error(
        &self,
        (line, start): (usize, usize),
        span: Range<usize>,
        problem: LineProblem,
        help: Option<String>,
    ) -> FileError {
        let (text, span) = excerpt(self.path, self.text, start + span.start..start + span.end);
        FileError::Line(Box::new(LineError { path: self.path.to_owned(), line, problem, help, text, span }))
    }

    fn unclear(&self, unclear: Unclear<'_>) -> FileError {
        match unclear {
            Unclear::Empty => FileError::Empty { path: self.path.to_owned() },
            Unclear::Line(line, found, needed, first, help) => {
                let problem = LineProblem::FieldCount { found, needed, first };
                self.error((line.number, line.start), 0..line.text.trim_end().len(), problem, Some(help))
            }
            Unclear::Ambiguous(line, what) => {
                let problem = LineProblem::Ambiguous { what };
                self.error((line.number, line.start), 0..line.text.trim_end().len(), problem, None)
            }
        }
    }

    fn wrong_count(&self, layout: &Layout, line: Line<'_>, found: usize) -> FileError {
        let needed = layout.columns.len() * if layout.joined { 2 } else { 1 };
        let problem = LineProblem::FieldCount { found, needed, first: layout.counted };
        let name = layout.separator.map_or("spaces or tabs", fields::Separator::name);
        let last = line.start + line.text.len() >= self.text.len();
        let help = if last && found < needed && self.text.matches('\n').count() > 1 {
            format!("the last line is cut off: delete it. Fields stand between {name} in this file")
        } else {
            format!("fields stand between {name} in this file")
        };
        self.error((line.number, line.start), 0..line.text.trim_end().len(), problem, Some(help))
    }

    fn no_channel(&self, layout: &Layout, selection: &Selection) -> FileError {
        let names =
            || layout.columns.iter().filter_map(|column| column.name.as_deref()).filter(|name| !name.is_empty());
        let columns = names().collect::<Vec<_>>().join(", ");
        match selection.channels.as_deref().and_then(|channels| channels.first()) {
            Some(found) => FileError::NoSuchChannel {
                path: self.path.to_owned(),
                found: found.clone(),
                channels: shortened(&columns),
            },
            None => FileError::NoChannel { path: self.path.to_owned(), columns: shortened(&columns) },
        }
    }

    /// The first cell of a channel that is not what a sample must be.
    fn first_error(
        &self,
        assembly: &Assembly,
        plans: &[Plan],
        bad: Vec<[Option<Box<Bad>>; 2]>,
        selection: &Selection,
    ) -> Option<FileError> {
        let wrong = |bad: &Bad| bad.value != Value::Missing || selection.refuses_missing();
        let of_channels = assembly.channels.iter().flat_map(|&index| {
            bad[index].iter().flatten().filter(|bad| wrong(bad)).map(move |bad| (index, (**bad).clone()))
        });
        let (index, bad) = of_channels.min_by_key(|(index, bad)| (bad.row, *index))?;
        let channel = shortened(&plans[index].name);
        let (problem, help) = if bad.value == Value::Other {
            let help = has_decimal_comma(&bad.found).then(|| "write decimals with a point, not a comma".to_owned());
            let help =
                help.or_else(|| Some(format!("if `{channel}` is not to be learned, name the others with `channels`")));
            (LineProblem::NotANumber { found: bad.found, column: channel }, help)
        } else {
            let (sequence, sample) = assembly.place(bad.row);
            let found = if bad.found.is_empty() { "missing".to_owned() } else { bad.found };
            let help = match bad.value {
                Value::Missing => "`missing = \"refuse\"` is set: without it, what is missing is learned around",
                _ => "every sample must be a finite number; one that is missing is empty or NaN",
            };
            let help = help.to_owned();
            (LineProblem::NotFinite { sequence: shortened(sequence), sample, channel, found }, Some(help))
        };
        Some(self.error(bad.line, bad.span, problem, help))
    }
}

#[cfg(test)]
mod tests;
