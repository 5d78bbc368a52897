//! Tables as text, such that [`super`] reads the same data again.

use std::collections::HashSet;
use std::fmt::Write;

use scrnn::dataset::Dataset;

use crate::{Field, FileError};

/// The bytes of a `.csv`.
pub fn write_csv(_: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    Ok(csv(fields, ',').into_bytes())
}

/// The bytes of a `.tsv`.
pub fn write_tsv(_: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    Ok(csv(fields, '\t').into_bytes())
}

/// The bytes of a `.txt`.
pub fn write_blocks(_: &str, fields: &[Field<'_>]) -> Result<Vec<u8>, FileError> {
    Ok(blocks(fields).into_bytes())
}

/// A table with a header: the sequence, the step in it from 1, then each field's channels.
pub fn csv(fields: &[Field<'_>], separator: char) -> String {
    let mut out = String::from("sequence");
    out.push(separator);
    out.push_str("step");
    for name in columns(fields) {
        out.push(separator);
        out.push_str(&quoted(&name));
    }
    out.push('\n');
    each_row(fields, |row| {
        let (label, step) = (quoted(row.label), row.step);
        write(&mut out, format_args!("{label}{separator}{step}"));
        for value in row.values() {
            write(&mut out, format_args!("{separator}{value:?}"));
        }
        out.push('\n');
    });
    out
}

/// Blocks of lines with a blank line between two sequences. Names stand in comments that the reader knows.
pub fn blocks(fields: &[Field<'_>]) -> String {
    let mut out = String::from("# columns:");
    for name in columns(fields) {
        write(&mut out, format_args!(" {}", quoted(&name)));
    }
    out.push('\n');
    each_row(fields, |row| {
        if row.step == 1 {
            if row.sequence > 0 {
                out.push('\n');
            }
            write(&mut out, format_args!("# sequence: {}\n", row.label));
        }
        for (i, value) in row.values().enumerate() {
            let space = if i == 0 { "" } else { " " };
            write(&mut out, format_args!("{space}{value:?}"));
        }
        out.push('\n');
    });
    out
}

/// One sample of every field.
struct Row<'a> {
    fields: &'a [Field<'a>],
    sequence: usize,
    label: &'a str,
    step: usize,
}

impl<'a> Row<'a> {
    fn values(&self) -> impl Iterator<Item = f64> + use<'a> {
        let (sequence, index) = (self.sequence, self.step - 1);
        self.fields.iter().flat_map(move |field| field.data.sequences()[sequence].sample(index).iter().copied())
    }
}

/// Calls `write` with each row that all fields have.
fn each_row<'a>(fields: &'a [Field<'a>], mut write: impl FnMut(Row<'_>)) {
    let Some(first) = fields.first() else { return };
    for (sequence, label) in labels(first.data).iter().enumerate() {
        let lengths = fields.iter().map(|field| field.data.sequences().get(sequence).map_or(0, |rows| rows.len()));
        for step in 1..=lengths.min().unwrap_or(0) {
            write(Row { fields, sequence, label, step });
        }
    }
}

fn write(out: &mut String, what: std::fmt::Arguments<'_>) {
    out.write_fmt(what).expect("a string takes all that is written to it");
}

/// The channels' names behind the field's.
fn columns(fields: &[Field<'_>]) -> Vec<String> {
    let of_field = |field: &Field<'_>| {
        let prefix = if field.name.is_empty() { String::new() } else { format!("{}_", field.name) };
        field.data.channels().iter().map(move |channel| prefix.clone() + channel).collect::<Vec<_>>()
    };
    fields.iter().flat_map(of_field).collect()
}

/// The sequences' names on one line each, or their numbers if the names would not tell them apart.
fn labels(data: &Dataset) -> Vec<String> {
    let clean = |name: &str| name.replace(char::is_control, " ").trim().to_owned();
    let names: Vec<String> = data.sequences().iter().map(|sequence| clean(&sequence.name)).collect();
    let mut seen = HashSet::new();
    if names.iter().all(|name| !name.is_empty() && seen.insert(name)) {
        return names;
    }
    (1..=names.len()).map(|number| number.to_string()).collect()
}

/// A name in quotes if it holds anything that could be taken for something else.
fn quoted(name: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_-+./:()[]".contains(c);
    if !name.is_empty() && name.chars().all(plain) && !is_formula(name) {
        return name.to_owned();
    }
    let guard = if is_formula(name) { "'" } else { "" };
    format!("\"{guard}{}\"", name.replace(char::is_control, " ").replace('"', "\"\""))
}

/// Whether a spreadsheet would take the text for a formula, and run what it says. An apostrophe before it prevents that.
fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@']) && text.parse::<f64>().is_err()
}

/// The name without the apostrophe that was put before a formula.
pub fn unguarded(name: &str) -> &str {
    name.strip_prefix('\'').filter(|rest| is_formula(rest)).unwrap_or(name)
}
