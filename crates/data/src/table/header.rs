//! How the lines of a table are to be read: separator, header, notation, what each column holds.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use crate::remark::Remark;

use super::fields::{DetectionOrder, Field, Separator, split};
use super::lines::{Kind, Line, lines};
use super::markers;
use super::numbers::{Cell, Notation, Value, has_decimal_comma, has_thousands};
use super::roles::{is_unit, nanoseconds_in, role, without_unit};

/// Lines that are looked at to find the header.
const HEAD: usize = 60;
/// Lines of samples that are looked at to find what a column holds.
const WINDOW: usize = 200;

/// How the lines of a file are to be read.
#[derive(Debug, Default)]
pub struct Layout {
    /// What stands between fields.
    pub separator: Option<Separator>,
    /// How numbers are written.
    pub notation: Notation,
    /// Every two fields are one number, with a decimal comma between them.
    pub joined: bool,
    /// Number of the first line of samples.
    pub first: usize,
    /// Number of the line that the number of columns was taken from.
    pub counted: usize,
    /// Text of the header's last line, to know it again.
    pub header: Option<String>,
    /// Whether the columns have names of their own.
    pub named: bool,
    /// Samples a second, if the lines above tell it.
    pub rate: Option<f64>,
    /// The columns.
    pub columns: Vec<Column>,
    /// What was understood on the way.
    pub remarks: Vec<Remark>,
}

/// One column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name; none if it has none.
    pub name: Option<String>,
    /// Its unit, if the file tells.
    pub unit: Option<String>,
    /// What its cells are.
    pub holds: Holds,
    /// Left out unless it is asked for, and why.
    pub set_aside: Option<&'static str>,
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// Numbers.
    Numbers,
    /// `True` and `False`.
    Truths,
    /// Lists of so many numbers.
    Lists(usize),
    /// Dates, times of day, or both.
    Moments,
    /// Words.
    Words,
    /// Nothing, as far as was looked.
    Nothing,
}

/// Why a file has no layout.
#[derive(Debug)]
pub enum Unclear<'a> {
    /// It has no content.
    Empty,
    /// A line that does not go with the header, with the numbers of fields found and needed, the header's line, and what to do.
    Line(Line<'a>, usize, usize, usize, String),
    /// A line that could mean several things.
    Ambiguous(Line<'a>, &'static str),
}

type Fields<'a> = Vec<Field<'a>>;

fn fields_of<'a>(line: &Line<'a>, separator: Separator) -> Fields<'a> {
    let mut fields = Vec::new();
    split(line.text, separator, &mut fields);
    fields
}

impl Layout {
    /// Finds how a text is laid out.
    pub fn find(text: &str, order: DetectionOrder) -> Result<Self, Unclear<'_>> {
        let mut layout = Self::default();
        let mut content = lines(text).filter(|line| line.kind() == Kind::Content).peekable();
        let told = content.peek().and_then(|line| told_separator(line.text));
        if told.is_some() {
            content.next();
        }
        let head: Vec<Line<'_>> = content.take(HEAD).collect();
        let Some(&first) = head.first() else { return Err(Unclear::Empty) };
        let detect = |line: &Line<'_>| told.unwrap_or_else(|| Separator::detect(line.text, order));

        let data = first_of_samples(&head, detect);
        let line = head[data.min(head.len() - 1)];
        let mut separator = detect(&line);
        if data == head.len() {
            // Nothing but words: the error will show the line below the first.
            separator = detect(head.get(1).unwrap_or(&first));
        }
        layout.separator = Some(separator);
        let data = if data == head.len() { 1.min(head.len() - 1) } else { data };
        let samples: Vec<Line<'_>> = head[data..].to_vec();
        let mut above: Vec<(Line<'_>, Fields<'_>)> =
            head[..data].iter().map(|line| (*line, fields_of(line, separator))).collect();
        if data == 0 && is_header(&fields_of(&first, separator), 0) {
            above.push((first, fields_of(&first, separator)));
            layout.first = first.number + 1;
        } else {
            layout.first = samples[0].number;
        }
        if above.is_empty() && samples.len() > 1 && counts_columns(&samples, separator) {
            above.push((first, fields_of(&first, separator)));
            layout.first = samples[1].number;
            layout.remarks.push(Remark::Understood {
                what: format!(
                    "line {}, `{}`, was taken for a header: the numbers below do not follow it",
                    first.number,
                    short(first.text)
                ),
            });
        }
        let row = samples.iter().find(|line| line.number >= layout.first).copied();
        let count = row.map(|line| trimmed(&fields_of(&line, separator)));
        layout.name(text, &above, row, count, separator)?;
        if !layout.named && stamped(&samples, separator) && layout.columns.len() > 2 {
            for (column, name) in layout.columns.iter_mut().zip(["stamp.sec", "stamp.nanosec"]) {
                column.name = Some(name.to_owned());
            }
            let what = "the first two columns, which have no names, are the seconds and nanoseconds of a stamp";
            layout.remarks.push(Remark::Understood { what: what.to_owned() });
        }
        layout.look(text, separator);
        layout.number_doubles();
        layout.notation(text, separator)?;
        Ok(layout)
    }

    /// Takes the names from the lines above the first row, or from a comment.
    fn name<'a>(
        &mut self,
        text: &'a str,
        above: &[(Line<'a>, Fields<'a>)],
        row: Option<Line<'a>>,
        count: Option<usize>,
        separator: Separator,
    ) -> Result<(), Unclear<'a>> {
        let Some((last, names)) = above.last() else {
            let row = row.ok_or(Unclear::Empty)?;
            let count = fields_of(&row, separator).len();
            self.counted = row.number;
            let names = names_in_comments(text, separator, count);
            self.named = names.is_some();
            let names = names.unwrap_or_else(|| vec![None; count]);
            self.columns = names.into_iter().map(column).collect();
            return Ok(());
        };
        self.counted = last.number;
        self.named = true;
        self.header = Some(last.text.to_owned());
        self.rate = markers::rate(above);
        if let Some(listed) =
            count.filter(|count| trimmed(names) != *count).and_then(|count| markers::names(above, count))
        {
            let what = "the columns are called after the markers in the lines above".to_owned();
            self.remarks.push(Remark::Understood { what });
            self.columns = listed.into_iter().map(|name| column(Some(name))).collect();
            return Ok(());
        }
        let mut names: Vec<Cow<'_, str>> = names.iter().map(|field| field.text.clone()).collect();
        if let (Some(row), Some(count)) = (row, count) {
            let cells = fields_of(&row, separator);
            while names.len() > cells.len() && names.last().is_some_and(|name| name.is_empty()) {
                names.pop();
            }
            if names.len() < count {
                self.insert_missing(&mut names, &cells, *last, row)?;
            }
        }
        if self.joined {
            self.columns = names.into_iter().map(|name| column(Some(name.into_owned()))).collect();
            return Ok(());
        }
        // Names that stand over groups of columns may end early, and begin late.
        let grouped = |fields: &Fields<'_>| {
            fields.first().is_some_and(|field| field.text.is_empty()) && fields.len() <= names.len()
        };
        let fitting = |(_, fields): &&(Line<'_>, Fields<'_>)| {
            trimmed(fields) > 1 && (fields.len().abs_diff(names.len()) <= 1 || grouped(fields))
        };
        let mut levels: Vec<Vec<Cow<'_, str>>> = above[..above.len() - 1]
            .iter()
            .rev()
            .take_while(|level| names.len() > 1 && fitting(level))
            .map(|(_, fields)| fields.iter().map(|field| field.text.clone()).collect())
            .collect();
        levels.reverse();
        let skipped = above.len() - 1 - levels.len();
        if skipped > 0 {
            let what = format!("the first {skipped} lines do not belong to the table and were passed over");
            self.remarks.push(Remark::Understood { what });
        }
        levels.push(names);
        self.units_and_names(levels);
        Ok(())
    }

    /// A header of fewer names than the first row has cells.
    fn insert_missing<'a>(
        &mut self,
        names: &mut Vec<Cow<'_, str>>,
        cells: &[Field<'_>],
        header: Line<'a>,
        row: Line<'a>,
    ) -> Result<(), Unclear<'a>> {
        let cell = |index: usize| Cell::of(&cells[index].text, Notation::Point);
        let (found, needed) = (cells.len(), names.len());
        if found == needed + 1 {
            // R names its rows without naming the column.
            let quoted = cells[0].span.len() > cells[0].text.len();
            if quoted || cells[0].text == "1" && names.iter().all(|name| role(1, name).is_none()) {
                names.insert(0, "".into());
                return Ok(());
            }
            // A date and a time of day under one name.
            if let Some(at) = (0..needed).find(|&k| {
                matches!((cell(k), cell(k + 1)), (Cell::Moment(super::dates::Moment::Day(_)), Cell::Moment(_)))
            }) {
                names.insert(at, "date".into());
                return Ok(());
            }
        }
        let whole = |text: &str| !text.is_empty() && text.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit());
        if found == 2 * needed
            && cells.iter().all(|cell| whole(&cell.text))
            && self.separator == Some(Separator::Character(','))
        {
            self.joined = true;
            self.remarks.push(Remark::Understood {
                what: format!("every two fields were taken as one number with a decimal comma: the header names {needed} columns, the lines have {found}"),
            });
            return Ok(());
        }
        let help =
            format!("the header (line {}) names {needed} columns: give each of the {found} a name", header.number);
        Err(Unclear::Line(row, found, needed, header.number, help))
    }

    /// One name for each column from one or several lines, and their units.
    fn units_and_names(&mut self, mut levels: Vec<Vec<Cow<'_, str>>>) {
        let mut units = Vec::new();
        let is_units = |level: &[Cow<'_, str>]| {
            let mut some = level.iter().filter(|text| !text.is_empty()).peekable();
            some.peek().is_some() && some.all(|text| is_unit(text))
        };
        if levels.len() > 1 && levels.last().is_some_and(|level| is_units(level)) {
            units = levels.pop().unwrap_or_default();
        }
        let tracker = levels.len() == 3
            && levels
                .iter()
                .zip(["scorer", "bodyparts", "coords"])
                .all(|(level, title)| level.first().is_some_and(|text| text == title));
        let columns = levels.last().map_or(0, Vec::len);
        let depth = levels.len();
        for level in &mut levels[..depth - 1] {
            level.resize(columns, "".into());
            // Merged cells: the name stands over the first column of a group.
            let start = level.iter().position(|text| !text.is_empty()).unwrap_or(0);
            for index in start + 1..columns {
                if level[index].is_empty() {
                    level[index] = level[index - 1].clone();
                }
            }
        }
        let last = levels.pop().unwrap_or_default();
        let is_channel = |index: usize| role(index, &last[index]).is_none() && !(tracker && index == 0);
        let telling = |level: &&Vec<Cow<'_, str>>| {
            let over: HashSet<&str> =
                (0..columns).filter(|&index| is_channel(index)).map(|index| level[index].as_ref()).collect();
            over.len() > 1
        };
        let telling: Vec<&Vec<Cow<'_, str>>> = levels.iter().filter(telling).collect();
        let joined = |index: usize| {
            if !is_channel(index) {
                return last[index].clone().into_owned();
            }
            let parts = telling.iter().map(|level| level[index].as_ref()).chain([last[index].as_ref()]);
            parts.filter(|part| !part.is_empty()).collect::<Vec<_>>().join(".")
        };
        self.columns = (0..columns)
            .map(|index| {
                let name = if tracker && index == 0 { "frame".to_owned() } else { joined(index) };
                let set_aside = (tracker && last[index] == "likelihood").then_some("how sure the tracker is");
                let mut column = column(Some(name));
                if let Some(unit) = units.get(index).filter(|unit| !unit.is_empty()) {
                    column.unit = Some(unit.trim_matches(['[', ']', '(', ')']).to_owned());
                }
                Column { set_aside, ..column }
            })
            .collect();
        if depth > 1 {
            self.remarks
                .push(Remark::Understood { what: format!("the names stand in {depth} lines, which were joined") });
        }
    }

    /// Looks at the first rows to find what each column holds.
    fn look(&mut self, text: &str, separator: Separator) {
        let mut tallies = vec![Tally::default(); self.columns.len()];
        let mut fields = Vec::new();
        for line in samples(text, self.first).take(WINDOW) {
            split(line.text, separator, &mut fields);
            if self.header.as_deref() == Some(line.text) {
                continue;
            }
            for (tally, field) in tallies.iter_mut().zip(&fields) {
                tally.add(&field.text);
            }
        }
        for (column, tally) in self.columns.iter_mut().zip(tallies) {
            column.holds = if self.joined { Holds::Numbers } else { tally.holds(column.name.is_some()) };
        }
    }

    /// Gives every name once.
    fn number_doubles(&mut self) {
        let mut places: HashMap<&str, Vec<usize>> = HashMap::new();
        for (index, column) in self.columns.iter().enumerate() {
            if let Some(name) = column.name.as_deref().filter(|name| !name.is_empty()) {
                places.entry(name).or_default().push(index);
            }
        }
        let mut taken: HashSet<String> = places.keys().map(|name| (*name).to_owned()).collect();
        let mut doubled: Vec<(String, Vec<usize>)> = places
            .into_iter()
            .filter(|(_, places)| places.len() > 1)
            .map(|(name, places)| (name.to_owned(), places))
            .collect();
        doubled.sort_by_key(|(_, places)| places[0]);
        for (name, places) in doubled {
            let mut number = 0;
            let mut now = Vec::new();
            for place in places {
                let fresh = loop {
                    number += 1;
                    let fresh = format!("{name}.{number}");
                    if taken.insert(fresh.clone()) {
                        break fresh;
                    }
                };
                now.push(fresh.clone());
                self.columns[place].name = Some(fresh);
            }
            if role(1, &name).is_none() {
                self.remarks.push(Remark::NamesNumbered { name, now: now.join(", ") });
            }
        }
    }

    /// Finds how numbers with commas are meant.
    fn notation<'a>(&mut self, text: &'a str, separator: Separator) -> Result<(), Unclear<'a>> {
        if self.joined {
            self.notation = Notation::Comma;
            return Ok(());
        }
        let (mut first, mut comma, mut thousands, mut grouped) = (None, 0_usize, 0_usize, 0_usize);
        let mut leading_zero = None;
        let mut fields = Vec::new();
        for line in samples(text, self.first).take(WINDOW) {
            split(line.text, separator, &mut fields);
            for field in fields.iter().filter(|field| field.text.contains(',')) {
                let text = &field.text;
                let many = has_thousands(text);
                if many && (text.contains('.') || text.matches(',').count() > 1) {
                    thousands += 1;
                } else if many {
                    grouped += 1;
                } else if has_decimal_comma(text) {
                    comma += 1;
                } else {
                    continue;
                }
                first.get_or_insert(line);
            }
            if separator == Separator::Character(',') && fields.len() > 1 && leading_zero.is_none() {
                let padded = |field: &Field<'_>| {
                    field.text.len() > 1
                        && field.text.starts_with('0')
                        && field.text.bytes().all(|b| b.is_ascii_digit())
                };
                let whole = fields.iter().all(|field| !field.text.contains('.'));
                leading_zero =
                    (whole && fields.iter().skip(1).step_by(2).any(padded) && !fields.iter().step_by(2).any(padded))
                        .then_some(line);
            }
        }
        let ambiguous =
            "a comma could stand before decimals or thousands: write decimals with a point, and no other commas";
        match (first, comma, thousands, grouped) {
            (None, ..) => {
                if let Some(line) =
                    leading_zero.filter(|_| self.columns.iter().all(|column| column.holds == Holds::Numbers))
                {
                    let what = "numbers of which every second begins with zeros: they seem to be decimals behind a comma. Write decimals with a point, or separate the columns with semicolons";
                    return Err(Unclear::Ambiguous(line, what));
                }
            }
            (_, 0, 1.., _) => {
                self.notation = Notation::Thousands;
                self.remarks
                    .push(Remark::Understood { what: "commas were taken for separators of thousands".to_owned() });
            }
            (Some(line), 1.., 1.., _) => return Err(Unclear::Ambiguous(line, ambiguous)),
            (_, 1.., 0, _) => self.decimal_commas(),
            // Three digits behind every comma. Only who writes decimals so has to separate columns by semicolons.
            (_, 0, 0, _) if separator == Separator::Character(';') => self.decimal_commas(),
            (Some(line), ..) => return Err(Unclear::Ambiguous(line, ambiguous)),
        }
        Ok(())
    }

    fn decimal_commas(&mut self) {
        self.notation = Notation::Comma;
        self.remarks.push(Remark::Understood { what: "commas were taken for decimal points".to_owned() });
    }
}

fn column(name: Option<String>) -> Column {
    let unit = name
        .as_deref()
        .and_then(|name| without_unit(name).1)
        .filter(|unit| is_unit(unit) || nanoseconds_in(unit).is_some());
    Column { unit: unit.map(str::to_owned), name, holds: Holds::Nothing, set_aside: None }
}

fn short(text: &str) -> String {
    crate::excerpt::shortened(text.trim())
}

/// `sep=;` in the first line, as Excel has it.
fn told_separator(text: &str) -> Option<Separator> {
    let told = text.trim_start().trim_start_matches('"');
    let is_told = told.get(..4).is_some_and(|front| front.eq_ignore_ascii_case("sep="));
    let told = is_told.then(|| told[4..].trim_end_matches('"').chars().next().unwrap_or('\t'))?;
    Some(if told == ' ' { Separator::Whitespace } else { Separator::Character(told) })
}

/// The lines of content from this number on.
pub fn samples(text: &str, first: usize) -> impl Iterator<Item = Line<'_>> {
    lines(text).filter(move |line| line.number >= first && line.kind() == Kind::Content)
}

/// Fields without the empty ones at the end.
fn trimmed(fields: &[Field<'_>]) -> usize {
    fields.iter().rposition(|field| !field.text.is_empty()).map_or(0, |last| last + 1)
}

/// Index of the first line of samples; the number of lines if there is none.
fn first_of_samples(head: &[Line<'_>], detect: impl Fn(&Line<'_>) -> Separator) -> usize {
    let shape = |line: &Line<'_>| {
        let separator = detect(line);
        (separator, trimmed(&fields_of(line, separator)))
    };
    // What most of the later lines look like, where there are enough to tell.
    let later: Vec<_> = head[head.len() / 2..].iter().map(shape).collect();
    let usual = later
        .iter()
        .find(|shape| later.len() >= 4 && 2 * later.iter().filter(|other| other == shape).count() > later.len())
        .copied();
    for (index, line) in head.iter().enumerate() {
        let fields = fields_of(line, detect(line));
        if is_header(&fields, index) {
            continue;
        }
        // A title or a setting above the table; a rate alone above its header.
        let is_word =
            |field: &Field<'_>| Cell::of(&field.text, Notation::Point) == Cell::Word && !has_decimal_comma(&field.text);
        let names_follow = || head[index + 1..].iter().any(|line| is_header(&fields_of(line, detect(line)), index + 1));
        let is_title = usual.is_some_and(|usual| shape(line) != usual)
            && (fields.iter().any(is_word) || trimmed(&fields) == 1 && names_follow());
        if !is_title {
            return index;
        }
    }
    head.len()
}

/// Whether the fields of the line at `index` name columns. A typing error in a line of samples is not to swallow the line:
/// next to numbers with a decimal point, a header must have a column that only headers have.
fn is_header(fields: &[Field<'_>], index: usize) -> bool {
    let has_role = |(index, field): (usize, &Field<'_>)| !field.text.is_empty() && role(index, &field.text).is_some();
    if fields.iter().enumerate().any(has_role) {
        return true;
    }
    let cells = || fields.iter().map(|field| (field, Cell::of(&field.text, Notation::Point)));
    let is_sample = |(field, cell): (&Field<'_>, Cell)| match cell {
        Cell::Number => field.text.contains(['.', 'e', 'E']),
        Cell::Truth | Cell::List(_) | Cell::Moment(_) => true,
        Cell::Word => has_decimal_comma(&field.text),
        Cell::Missing => false,
    };
    let words = cells().filter(|(_, cell)| *cell == Cell::Word).count();
    let numbers = cells().filter(|(_, cell)| *cell == Cell::Number).count();
    // Below a header, words may stand beside whole numbers.
    let below = index > 0 && numbers >= 1 && fields.len() > 1 && numbers + 1 >= words;
    let unnamed_index = fields.len() > 1 && fields[0].text.is_empty() && index == 0;
    (words > 0 || unnamed_index && words + numbers == fields.len() - 1) && !cells().any(is_sample) && !below
}

/// Whether the first line holds the numbers of the columns, as pandas writes a header for an array: 0, 1, ... above
/// decimals that do not follow from them.
fn counts_columns(samples: &[Line<'_>], separator: Separator) -> bool {
    let first = fields_of(&samples[0], separator);
    let counted =
        |start: usize| first.iter().enumerate().all(|(index, field)| field.text == (index + start).to_string());
    if first.len() < 2 || !(counted(0) || counted(1)) {
        return false;
    }
    let rows: Vec<Vec<f64>> = samples[1..]
        .iter()
        .take(30)
        .map(|line| {
            fields_of(line, separator)
                .iter()
                .map(|field| match Value::of(&field.text) {
                    Value::Number(number) => number,
                    _ => f64::NAN,
                })
                .collect()
        })
        .filter(|row: &Vec<f64>| row.len() == first.len())
        .collect();
    let decimals = samples[1..].iter().take(30).all(|line| line.text.contains('.'));
    let Some(second) = rows.first().filter(|_| decimals && rows.len() > 1) else { return false };
    // A row of samples is about as far from the next as others are from theirs.
    let largest =
        |column: usize| rows.windows(2).map(|pair| (pair[1][column] - pair[0][column]).abs()).fold(0.0, f64::max);
    (0..first.len()).any(|column| {
        let jump = (first[column].text.parse().unwrap_or(0.0) - second[column]).abs();
        jump > 3.0 * largest(column)
    })
}

/// Whether rows without a header begin with seconds and nanoseconds, as ROS prints a stamp: whole numbers, of which the second
/// stays below a billion and reaches the millions, and which rise together.
fn stamped(samples: &[Line<'_>], separator: Separator) -> bool {
    let whole = |field: Option<&Field<'_>>| field.and_then(|field| field.text.parse::<u64>().ok());
    let stamp = |line: &Line<'_>| {
        let fields = fields_of(line, separator);
        whole(fields.first()).zip(whole(fields.get(1))).filter(|(_, nanoseconds)| *nanoseconds < 1_000_000_000)
    };
    let stamps: Option<Vec<(u64, u64)>> = samples.iter().map(stamp).collect();
    stamps.is_some_and(|stamps| {
        stamps.len() > 4
            && stamps.windows(2).all(|pair| pair[0] < pair[1])
            && stamps.iter().any(|(_, nanoseconds)| *nanoseconds >= 1_000_000)
            && stamps.windows(2).all(|pair| pair[1].0 - pair[0].0 < 1000)
    })
}

/// The names in a comment above the first row: behind `columns:`, or a comment of as many words as there are columns, right
/// above them or at the top, that is no sentence.
fn names_in_comments(text: &str, separator: Separator, count: usize) -> Option<Vec<Option<String>>> {
    let above: Vec<&str> = lines(text)
        .map_while(|line| match line.kind() {
            Kind::Content => None,
            Kind::Comment(comment) => Some(comment),
            Kind::Blank => Some(""),
        })
        .collect();
    let parts = |names: &str| -> Vec<String> {
        let mut fields = Vec::new();
        split(names.trim(), separator, &mut fields);
        fields.into_iter().map(|field| field.text.into_owned()).collect()
    };
    let told = above.iter().find_map(|comment| comment.strip_prefix("columns:")).map(parts);
    let guessed = || {
        let near = above.iter().rev().filter(|comment| !comment.is_empty());
        near.map(|comment| parts(comment)).find(|names| names.len() == count && are_names(names, separator))
    };
    let names = told.filter(|names| names.len() == count).or_else(guessed)?;
    Some(names.into_iter().map(Some).collect())
}

/// Whether these are names, not a sentence that happens to have as many words, nor samples that were commented out.
fn are_names(names: &[String], separator: Separator) -> bool {
    if names.iter().any(|name| name.is_empty() || Value::of(name) != Value::Other) {
        return false;
    }
    if names.iter().enumerate().any(|(index, name)| role(index, name).is_some()) {
        return true;
    }
    if separator != Separator::Whitespace {
        return names.len() > 1;
    }
    const PROSE: &[&str] =
        &["the", "from", "of", "is", "for", "by", "with", "and", "to", "are", "on", "at", "this", "was", "an"];
    let prose =
        |name: &String| PROSE.contains(&name.to_lowercase().as_str()) || name.ends_with([',', '.', ':', ';', '!']);
    let article = names.iter().any(|name| name == "a" || name == "A") && names.iter().any(|name| name.len() > 2);
    names.len() > 1 && !article && !names.iter().any(prose)
}

/// What was seen of a column.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    numbers: usize,
    missing: usize,
    truths: usize,
    moments: usize,
    words: usize,
    lists: usize,
    length: usize,
}

impl Tally {
    fn add(&mut self, text: &str) {
        match Cell::of(text, Notation::Point) {
            Cell::Number => self.numbers += 1,
            Cell::Missing => self.missing += 1,
            Cell::Truth => self.truths += 1,
            Cell::Moment(_) => self.moments += 1,
            Cell::List(length) if self.lists == 0 || self.length == length => {
                self.lists += 1;
                self.length = length;
            }
            _ if has_decimal_comma(text) || has_thousands(text) => self.numbers += 1,
            _ => self.words += 1,
        }
    }

    fn holds(self, named: bool) -> Holds {
        let most = self.numbers.max(self.truths).max(self.moments).max(self.lists).max(self.words);
        // One word in a column without a name is a typing error, not a column of words.
        if most == 0 {
            Holds::Nothing
        } else if most == self.numbers {
            Holds::Numbers
        } else if most == self.lists {
            Holds::Lists(self.length)
        } else if most == self.truths {
            Holds::Truths
        } else if most == self.moments {
            Holds::Moments
        } else if self.numbers == 0 && (named || self.words > 1) {
            Holds::Words
        } else {
            Holds::Numbers
        }
    }
}
