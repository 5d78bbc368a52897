//! Sequences from lines of text.
//!
//! - Fields stand between commas, semicolons, tabs or spaces; the first line of numbers tells which.
//! - Lines that begin with `#` are comments. `# columns: NAME ...` and `# sequence: NAME` in them give names.
//! - The first line is a header if a field of it is not a number. It names the channels. Columns called `step` or `time`
//!   and an unnamed first one, as pandas writes its index, are no channels: they are skipped.
//! - Rows belong together that have the same label in the column `sequence`, whatever the label and wherever they
//!   stand. Without such a column a blank line ends a sequence. Rows keep the order they have in the file.
//! - Sequences may differ in length. Without a name they are called 1, 2, ...

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

use scrnn::dataset::Dataset;

use super::excerpt::{excerpt, shortened};
pub use super::fields::DetectionOrder;
use super::fields::{Field, Separator, Value, split};
use crate::format::Source;
use crate::samples::Samples;
use crate::{FileError, LineError, LineProblem, Selection};

/// Reads a table whose fields stand between commas, or whatever else is found.
pub fn read_csv(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    read(source.name(), &source.bytes()?, DetectionOrder::CommaFirst, selection)
}

/// Reads a table whose fields stand between tabs, or whatever else is found.
pub fn read_tsv(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    read(source.name(), &source.bytes()?, DetectionOrder::TabFirst, selection)
}

/// Reads the text file called `path`.
fn read(path: &str, bytes: &[u8], order: DetectionOrder, _: &Selection) -> Result<Samples, FileError> {
    let text = decode(path, bytes)?;
    let layout = Layout::find(path, &text, order)?;
    let mut rows = Rows { path, text: &text, layout: &layout, sequences: Vec::new(), by_label: HashMap::new() };
    rows.read()?;
    let sequences = rows.sequences;
    if sequences.is_empty() {
        return Err(FileError::Empty { path: path.to_owned() });
    }
    let named = layout.header.is_some();
    let mut samples = Samples::named(layout.channels(), sequences);
    samples.facts.named = named;
    Ok(samples)
}

/// UTF-8 without its mark, as far as it is; in line ends that [`str::lines`] knows.
fn decode<'a>(path: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, FileError> {
    let not_text = |found| FileError::NotText { path: path.to_owned(), found };
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(not_text("is encoded in UTF-16"));
    }
    if bytes.contains(&0) {
        return Err(not_text("holds zero bytes"));
    }
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    Ok(if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n").into() } else { text })
}

/// A line with its place in the file.
#[derive(Debug, Clone, Copy)]
struct Line<'a> {
    number: usize,
    start: usize,
    text: &'a str,
}

enum Kind<'a> {
    Blank,
    Comment(&'a str),
    Content,
}

impl<'a> Line<'a> {
    fn kind(&self) -> Kind<'a> {
        let text = self.text.trim();
        match text.strip_prefix('#') {
            _ if text.is_empty() => Kind::Blank,
            Some(comment) => Kind::Comment(comment.trim()),
            None => Kind::Content,
        }
    }
}

fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut start = 0;
    text.split_inclusive('\n').enumerate().map(move |(index, with_end)| {
        let line = Line { number: index + 1, start, text: with_end.trim_end_matches(['\n', '\r']) };
        start += with_end.len();
        line
    })
}

/// What a column holds.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Column {
    Channel(String),
    Sequence,
    Skipped,
}

/// How the lines of a file are to be read.
#[derive(Debug)]
struct Layout {
    separator: Separator,
    /// Number of the line that is the header.
    header: Option<usize>,
    /// Number of the line that the number of columns was taken from.
    first: usize,
    columns: Vec<Column>,
}

impl Layout {
    fn find(path: &str, text: &str, order: DetectionOrder) -> Result<Self, FileError> {
        let mut content = lines(text).filter(|line| matches!(line.kind(), Kind::Content));
        let Some(first) = content.next() else {
            return Err(FileError::Empty { path: path.to_owned() });
        };
        let mut fields = Vec::new();
        let mut separator = Separator::detect(first.text, order);
        split(first.text, separator, &mut fields);
        if is_header(&fields) {
            // A header may hold any character: the numbers below it tell the separator.
            if let Some(second) = content.next() {
                separator = Separator::detect(second.text, order);
                split(first.text, separator, &mut fields);
            }
        }
        let header = is_header(&fields).then_some(first.number);
        let names: Option<Vec<Cow<'_, str>>> = match header {
            Some(_) => Some(fields.iter().map(|field| field.text.clone()).collect()),
            None => names_in_comment(text, separator).filter(|names| names.len() == fields.len()),
        };
        let columns = match names {
            Some(names) => columns_called(&names),
            None => Dataset::numbered_channels(fields.len()).into_iter().map(Column::Channel).collect(),
        };
        let layout = Self { separator, header, first: first.number, columns };
        if layout.channels().is_empty() {
            let columns = shortened(first.text.trim());
            return Err(FileError::NoChannel { path: path.to_owned(), columns });
        }
        Ok(layout)
    }

    fn channels(&self) -> Vec<String> {
        let name = |column: &Column| match column {
            Column::Channel(name) => Some(name.clone()),
            _ => None,
        };
        self.columns.iter().filter_map(name).collect()
    }
}

/// Whether the fields name columns. A typing error in a line of samples is not to swallow the line: next to numbers
/// with a decimal point, a header must have a column that only headers have.
fn is_header(fields: &[Field<'_>]) -> bool {
    if fields.iter().enumerate().any(|(index, field)| !field.text.is_empty() && role(index, &field.text).is_some()) {
        return true;
    }
    let names_a_column = |(index, field): (usize, &Field<'_>)| {
        Value::of(&field.text) == Value::Other || role(index, &field.text).is_some()
    };
    let is_sample = |field: &Field<'_>| {
        let number = matches!(Value::of(&field.text), Value::Number(_));
        number && field.text.contains(['.', 'e', 'E']) || has_decimal_comma(&field.text)
    };
    fields.iter().enumerate().any(names_a_column) && !fields.iter().any(is_sample)
}

/// Whether the text would be a number if its comma were a point.
fn has_decimal_comma(text: &str) -> bool {
    text.contains(',') && matches!(Value::of(&text.replacen(',', ".", 1)), Value::Number(_))
}

/// What a column of this name holds other than samples.
fn role(index: usize, name: &str) -> Option<Column> {
    let is = |wanted: &str| name.eq_ignore_ascii_case(wanted);
    if is("sequence") {
        return Some(Column::Sequence);
    }
    // An index that pandas wrote, and one that it wrote, read and wrote again.
    let is_index = index == 0 && (name.is_empty() || name == "Unnamed: 0");
    (is("step") || is("time") || is_index).then_some(Column::Skipped)
}

fn columns_called(names: &[Cow<'_, str>]) -> Vec<Column> {
    let mut channels = 0;
    let mut column = |(index, name): (usize, &Cow<'_, str>)| {
        role(index, name).unwrap_or_else(|| {
            channels += 1;
            let name = if name.is_empty() { format!("y{channels}") } else { name.clone().into_owned() };
            Column::Channel(name)
        })
    };
    names.iter().enumerate().map(&mut column).collect()
}

/// The names in a comment `# columns: ...` above the first line of numbers.
fn names_in_comment(text: &str, separator: Separator) -> Option<Vec<Cow<'_, str>>> {
    let above = lines(text).map_while(|line| match line.kind() {
        Kind::Content => None,
        Kind::Comment(comment) => Some(comment),
        Kind::Blank => Some(""),
    });
    let names = above.filter_map(|comment| comment.strip_prefix("columns:")).next()?;
    let mut fields = Vec::new();
    split(names.trim(), separator, &mut fields);
    Some(fields.into_iter().map(|field| field.text).collect())
}

/// The lines of samples, in sequences.
struct Rows<'a> {
    path: &'a str,
    text: &'a str,
    layout: &'a Layout,
    sequences: Vec<(String, Vec<f64>)>,
    by_label: HashMap<String, usize>,
}

impl<'a> Rows<'a> {
    fn read(&mut self) -> Result<(), FileError> {
        let labelled = self.layout.columns.contains(&Column::Sequence);
        let mut fields = Vec::new();
        let mut current = None;
        let mut name = None;
        for line in lines(self.text) {
            match line.kind() {
                Kind::Blank => current = None,
                Kind::Comment(comment) => {
                    if let Some(given) = comment.strip_prefix("sequence:") {
                        (current, name) = (None, Some(given.trim().to_owned()));
                    }
                }
                Kind::Content if Some(line.number) == self.layout.header => {}
                Kind::Content => {
                    split(line.text, self.layout.separator, &mut fields);
                    self.check_count(line, &fields)?;
                    let index = match current {
                        _ if labelled => self.labelled(&fields),
                        Some(index) => index,
                        None => self.start(name.take()),
                    };
                    current = Some(index);
                    self.append(index, line, &fields)?;
                }
            }
        }
        Ok(())
    }

    /// The sequence that the row's label belongs to.
    fn labelled(&mut self, fields: &[Field<'_>]) -> usize {
        let column = self.layout.columns.iter().position(|column| *column == Column::Sequence);
        let label = column.map_or("", |column| &fields[column].text);
        if let Some(&index) = self.by_label.get(label) {
            return index;
        }
        let index = self.start(Some(label.to_owned()));
        self.by_label.insert(label.to_owned(), index);
        index
    }

    /// A new sequence.
    fn start(&mut self, name: Option<String>) -> usize {
        let index = self.sequences.len();
        self.sequences.push((name.unwrap_or_else(|| (index + 1).to_string()), Vec::new()));
        index
    }

    fn check_count(&self, line: Line<'_>, fields: &[Field<'_>]) -> Result<(), FileError> {
        let (found, needed) = (fields.len(), self.layout.columns.len());
        if found == needed {
            return Ok(());
        }
        let problem = LineProblem::FieldCount { found, needed, first: self.layout.first };
        let help = format!("fields stand between {} in this file", self.layout.separator.name());
        Err(self.error(line, 0..line.text.trim_end().len(), problem, Some(help)))
    }

    fn append(&mut self, index: usize, line: Line<'_>, fields: &[Field<'_>]) -> Result<(), FileError> {
        for (field, column) in fields.iter().zip(&self.layout.columns) {
            let Column::Channel(channel) = column else { continue };
            match Value::of(&field.text) {
                Value::Number(number) => self.sequences[index].1.push(number),
                Value::NotFinite => {
                    let (name, values) = &self.sequences[index];
                    let channels = self.layout.columns.iter().filter(|c| matches!(c, Column::Channel(_))).count();
                    let found = if field.text.is_empty() { "missing".to_owned() } else { shortened(&field.text) };
                    let problem = LineProblem::NotFinite {
                        sequence: shortened(name),
                        sample: values.len() / channels + 1,
                        channel: shortened(channel),
                        found,
                    };
                    let help = "every sample must be a finite number; missing samples are not supported".to_owned();
                    return Err(self.error(line, field.span.clone(), problem, Some(help)));
                }
                Value::Other => {
                    let problem = LineProblem::NotANumber { found: shortened(&field.text), column: shortened(channel) };
                    let help =
                        has_decimal_comma(&field.text).then(|| "write decimals with a point, not a comma".to_owned());
                    return Err(self.error(line, field.span.clone(), problem, help));
                }
            }
        }
        Ok(())
    }

    fn error(&self, line: Line<'_>, span: Range<usize>, problem: LineProblem, help: Option<String>) -> FileError {
        let (text, span) = excerpt(self.path, self.text, line.start + span.start..line.start + span.end);
        FileError::Line(Box::new(LineError {
            path: self.path.to_owned(),
            line: line.number,
            problem,
            help,
            text,
            span,
        }))
    }
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
