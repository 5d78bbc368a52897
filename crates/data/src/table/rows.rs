//! The rows of a table, read once: numbers, exact times, labels. What is wrong in a cell is kept until it is known whether
//! the cell's column is wanted.

use std::collections::HashMap;
use std::ops::Range;

use crate::Selection;
use crate::budget::{Budget, OverBudget};

use super::dates::{Moment, moment};
use super::fields::{Field, Separator, split};
use super::header::{Holds, Layout};
use super::lines::{Kind, Line, lines};
use super::numbers::{Notation, Value, list, truth};
use super::roles::{Role, role};

/// The time of a cell that has none.
pub const NO_TIME: i128 = i128::MIN;

/// What is done with a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    /// Its name, given or made.
    pub name: String,
    /// What it may be.
    pub role: Option<Role>,
    /// Whether it is asked for by name.
    pub asked: bool,
    /// Whether it is a channel if it turns out to be nothing else.
    pub numbers: bool,
    /// Whether exact times are kept.
    pub times: bool,
    /// Whether labels are kept.
    pub labels: bool,
    /// How many numbers a cell holds.
    pub parts: usize,
}

/// A cell that is no finite number.
#[derive(Debug, Clone)]
pub struct Bad {
    /// The row, from 0.
    pub row: usize,
    /// The line's number and where it begins.
    pub line: (usize, usize),
    /// The cell in its line.
    pub span: Range<usize>,
    /// What it is.
    pub value: Value,
    /// What stands there.
    pub found: String,
}

/// One column's part of the rows.
#[derive(Debug, Default)]
pub struct Kept {
    /// Where its numbers are in a row of [`Rows::numbers`].
    pub slots: Range<usize>,
    /// Exact times in billionths of what the column counts in; nanoseconds for dates.
    pub times: Vec<i128>,
    /// Most digits behind the point among the times.
    pub decimals: usize,
    /// What kind of moments there were, if any: the first.
    pub moment: Option<Shape>,
    /// For each row the place of its label in `texts`.
    pub labels: Vec<u32>,
    /// The labels, each once, in the order of the rows.
    pub texts: Vec<String>,
    /// Whether any number was there.
    pub any: bool,
    /// The first cell that is missing or infinite, and the first that is no number at all.
    pub bad: [Option<Box<Bad>>; 2],
}

/// What kind of moment stands in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A day with a time.
    Stamp,
    /// A day.
    Day,
    /// A time of day.
    Clock,
}

/// All rows.
#[derive(Debug, Default)]
pub struct Rows {
    /// Number of rows.
    pub count: usize,
    /// Numbers of a row side by side, `width` of them.
    pub numbers: Vec<f64>,
    /// Numbers of a row.
    pub width: usize,
    /// What was kept of each column.
    pub columns: Vec<Kept>,
    /// First row and name of each block of lines.
    pub blocks: Vec<(usize, Option<String>)>,
    /// Blocks that ended at a blank line.
    pub blank: usize,
    /// Rows at which the header was repeated.
    pub repeated: Vec<usize>,
    /// Lines whose remarks at the end were passed over.
    pub trailing_comments: usize,
}

/// Why rows cannot be read.
pub enum Stop<'a> {
    /// A line with another number of fields.
    Count(Line<'a>, usize),
    /// Too much.
    Budget(OverBudget),
}

impl From<OverBudget> for Stop<'_> {
    fn from(over: OverBudget) -> Self {
        Self::Budget(over)
    }
}

/// What is to be done with each column.
pub fn plans(layout: &Layout, selection: &Selection) -> Vec<Plan> {
    let mut channels = 0;
    let wanted = selection.channels.as_deref();
    let plan = |(index, column): (usize, &super::header::Column)| {
        let given = column.name.as_deref();
        let role = given.and_then(|name| role(index, name));
        channels += usize::from(role.is_none());
        let name = match given {
            Some(name) if !name.is_empty() || role.is_some() => super::writing::unguarded(name).to_owned(),
            _ => format!("y{channels}"),
        };
        let parts = if let Holds::Lists(parts) = column.holds { parts } else { 1 };
        let asked = wanted.is_some_and(|wanted| {
            let part_of = |wanted: &String| wanted.strip_prefix(&name).is_some_and(|rest| rest.starts_with('.'));
            wanted.contains(&name) || parts > 1 && wanted.iter().any(part_of)
        });
        let may_be_channel =
            wanted.is_none() && column.set_aside.is_none() && !matches!(column.holds, Holds::Words | Holds::Moments);
        let moments = column.holds == Holds::Moments;
        let times = moments
            || column.holds != Holds::Words
                && matches!(role, Some(Role::Clock { .. } | Role::Seconds(_) | Role::Nanoseconds(_)));
        let labels = matches!(role, Some(Role::Label { .. })) || column.holds == Holds::Words && !asked;
        let counts = matches!(role, Some(Role::Counter { .. } | Role::Label { .. })) && column.holds == Holds::Numbers;
        Plan { name, role, asked, numbers: asked || may_be_channel || counts, times, labels, parts }
    };
    layout.columns.iter().enumerate().map(plan).collect()
}

impl Rows {
    /// Reads the rows of a text.
    pub fn read<'a>(text: &'a str, layout: &Layout, plans: &[Plan], budget: &Budget) -> Result<Self, Stop<'a>> {
        let separator = layout.separator.unwrap_or(Separator::Whitespace);
        let mut rows = Self { columns: plans.iter().map(|_| Kept::default()).collect(), ..Self::default() };
        for (kept, plan) in rows.columns.iter_mut().zip(plans) {
            let parts = if plan.numbers { plan.parts } else { 0 };
            kept.slots = rows.width..rows.width + parts;
            rows.width += parts;
        }
        let kept_of_row =
            plans.iter().map(|plan| 16 * usize::from(plan.times) + 4 * usize::from(plan.labels)).sum::<usize>();
        let mut labels: Vec<HashMap<String, u32>> = plans.iter().map(|_| HashMap::new()).collect();
        let mut fields = Vec::new();
        let (mut begins, mut name, mut after_blank) = (true, None, false);
        for line in lines(text) {
            match line.kind() {
                Kind::Blank => (begins, after_blank) = (true, true),
                Kind::Comment(comment) => {
                    if let Some(given) = comment.strip_prefix("sequence:") {
                        (begins, name) = (true, Some(given.trim().to_owned()));
                    }
                }
                Kind::Content if line.number < layout.first => {}
                Kind::Content if layout.header.as_deref() == Some(line.text) => {
                    rows.repeated.push(rows.count);
                    begins = true;
                }
                Kind::Content => {
                    split(line.text, separator, &mut fields);
                    if fields.len() != expected(layout) && !rows.mend(&line, layout, separator, &mut fields) {
                        return Err(Stop::Count(line, fields.len()));
                    }
                    // A vector grows by doubling: what it may hold is taken before.
                    budget.take(2 * (8 * rows.width + kept_of_row))?;
                    if std::mem::take(&mut begins) {
                        budget.take(64)?;
                        rows.blank += usize::from(after_blank && rows.count > 0);
                        rows.blocks.push((rows.count, name.take()));
                    }
                    after_blank = false;
                    rows.push(&line, layout, plans, &fields, &mut labels, budget)?;
                }
            }
        }
        Ok(rows)
    }

    /// Makes a line with another number of fields fit, if it is certain how.
    fn mend<'a>(
        &mut self,
        line: &Line<'a>,
        layout: &Layout,
        separator: Separator,
        fields: &mut Vec<Field<'a>>,
    ) -> bool {
        let needed = expected(layout);
        if fields.len() > needed && fields[needed..].iter().all(|field| field.text.is_empty()) {
            fields.truncate(needed);
            return true;
        }
        // A remark behind the samples.
        if let Some(at) = line.text.find(" #").or_else(|| line.text.find("\t#")) {
            let mut before = Vec::new();
            split(&line.text[..at], separator, &mut before);
            if before.len() == needed {
                self.trailing_comments += 1;
                *fields = before;
                return true;
            }
        }
        false
    }

    fn push(
        &mut self,
        line: &Line<'_>,
        layout: &Layout,
        plans: &[Plan],
        fields: &[Field<'_>],
        labels: &mut [HashMap<String, u32>],
        budget: &Budget,
    ) -> Result<(), OverBudget> {
        let row = self.count;
        self.count += 1;
        if layout.joined {
            for (index, (plan, pair)) in plans.iter().zip(fields.chunks(2)).enumerate() {
                let text = pair.iter().map(|field| field.text.as_ref()).collect::<Vec<_>>().join(".");
                let span = pair[0].span.start..pair[pair.len() - 1].span.end;
                self.cell(index, plan, &text, &text, layout.notation, (row, line, span));
            }
            return Ok(());
        }
        for (index, (plan, field)) in plans.iter().zip(fields).enumerate() {
            let text = field.text.as_ref();
            if plan.labels {
                let text = super::writing::unguarded(text);
                let known = labels[index].get(text).copied();
                let label = match known {
                    Some(label) => label,
                    None => {
                        let texts = &mut self.columns[index].texts;
                        let label = u32::try_from(texts.len()).unwrap_or(u32::MAX);
                        texts.push(budget.text(text)?);
                        labels[index].insert(budget.text(text)?, label);
                        label
                    }
                };
                self.columns[index].labels.push(label);
            }
            if plan.times {
                self.columns[index].time(text, layout.notation);
            }
            if plan.numbers {
                let without_remark = || text.find(" #").map_or(text, |at| text[..at].trim_end());
                self.cell(index, plan, text, without_remark(), layout.notation, (row, line, field.span.clone()));
            }
        }
        Ok(())
    }

    /// Appends the numbers of a cell.
    fn cell(
        &mut self,
        index: usize,
        plan: &Plan,
        text: &str,
        bare: &str,
        notation: Notation,
        place: (usize, &Line<'_>, Range<usize>),
    ) {
        if plan.parts > 1 || text.starts_with('[') {
            let before = self.numbers.len();
            if let Some(parts) = list(text) {
                self.numbers.extend(parts.map(|part| match Value::of(part) {
                    Value::Number(number) => number,
                    Value::Infinite => f64::INFINITY,
                    _ => f64::NAN,
                }));
            }
            let fits = self.numbers.len() == before + plan.parts;
            self.numbers.resize(before + plan.parts, f64::NAN);
            let finite = self.numbers[before..].iter().all(|value| value.is_finite());
            self.columns[index].any |= fits;
            if !fits || !finite {
                let value = if !fits && !text.is_empty() { Value::Other } else { Value::Missing };
                self.columns[index].note(value, text, place);
            }
            return;
        }
        let value = match Value::in_notation(text, notation) {
            Value::Other => match truth(text) {
                Some(number) => Value::Number(number),
                None if bare.len() < text.len() => {
                    let value = Value::in_notation(bare, notation);
                    self.trailing_comments += usize::from(value != Value::Other);
                    value
                }
                None => Value::Other,
            },
            value => value,
        };
        self.numbers.push(match value {
            Value::Number(number) => number,
            Value::Infinite => f64::INFINITY,
            Value::Missing | Value::Other => f64::NAN,
        });
        match value {
            Value::Number(_) => self.columns[index].any = true,
            _ => self.columns[index].note(value, text, place),
        }
    }
}

/// Fields of a line.
fn expected(layout: &Layout) -> usize {
    layout.columns.len() * if layout.joined { 2 } else { 1 }
}

impl Kept {
    fn note(&mut self, value: Value, text: &str, (row, line, span): (usize, &Line<'_>, Range<usize>)) {
        let bad = &mut self.bad[usize::from(value == Value::Other)];
        if bad.is_none() {
            *bad = Some(Box::new(Bad {
                row,
                line: (line.number, line.start),
                span,
                value,
                found: crate::excerpt::shortened(text),
            }));
        }
    }

    /// Appends the time in a cell.
    fn time(&mut self, text: &str, notation: Notation) {
        let exact = match notation {
            Notation::Point => exact(text),
            Notation::Comma => exact(&text.replacen(',', ".", 1)),
            Notation::Thousands => exact(&text.replace(',', "")),
        };
        let time = match (exact, moment(text)) {
            (Some((time, decimals)), _) => {
                self.decimals = self.decimals.max(decimals);
                time
            }
            (None, Some(found)) => {
                self.moment.get_or_insert(match found {
                    Moment::Stamp(_) => Shape::Stamp,
                    Moment::Day(_) => Shape::Day,
                    Moment::Clock(_) => Shape::Clock,
                });
                let digits = text.rsplit(['.', ',']).next().filter(|rest| rest.len() < text.len());
                let digits = digits.map_or(0, |rest| rest.bytes().take_while(u8::is_ascii_digit).count());
                self.decimals = self.decimals.max(digits.min(9));
                match found {
                    Moment::Stamp(time) | Moment::Day(time) | Moment::Clock(time) => time,
                }
            }
            (None, None) => NO_TIME,
        };
        self.times.push(time);
    }
}

/// A decimal number in billionths, and how many digits it has behind the point.
fn exact(text: &str) -> Option<(i128, usize)> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let is_digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if is_digits(whole) && is_digits(fraction) && digits.len() > usize::from(digits.contains('.')) && whole.len() <= 20
    {
        let whole: i128 = if whole.is_empty() { 0 } else { whole.parse().ok()? };
        let mut nine = fraction.bytes().chain(std::iter::repeat(b'0'));
        let billionths = (0..9).fold(0, |sum, _| 10 * sum + i128::from(nine.next().unwrap_or(b'0') - b'0'));
        let round = i128::from(fraction.as_bytes().get(9).is_some_and(|digit| *digit >= b'5'));
        return Some((
            sign * (whole * 1_000_000_000 + billionths + round),
            fraction.trim_end_matches('0').len().min(9),
        ));
    }
    // Scientific notation, as numpy.savetxt writes, or Fortran: as exact as the number.
    let Value::Number(number) = Value::of(text) else { return None };
    (number.abs() < 1e20).then(|| ((number * 1e9).round() as i128, 9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_to_the_nanosecond() {
        assert_eq!(exact("1766147454233218075"), Some((1_766_147_454_233_218_075_000_000_000, 0)));
        assert_eq!(exact("1766147454.2332180"), Some((1_766_147_454_233_218_000, 6)));
        assert_eq!(exact("-0.06666666666666667"), Some((-66_666_667, 9)));
        assert_eq!(exact("2.000000000000000042e-02"), Some((20_000_000, 9)));
        assert_eq!(exact("2.5D-02"), Some((25_000_000, 9)));
        for text in ["", ".", "-", "1x", "nan", "inf", "1e300"] {
            assert_eq!(exact(text), None, "{text}");
        }
        assert_eq!(exact(".5"), Some((500_000_000, 1)));
    }
}
