//! A line of text in fields, and a field as a number.

use std::borrow::Cow;
use std::ops::Range;

use super::numbers::{Value, has_decimal_comma};

/// What stands between two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// This character, with or without spaces.
    Character(char),
    /// Any number of spaces and tabs.
    Whitespace,
}

/// Which separator is looked for first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DetectionOrder {
    /// Semicolon, comma, tab, whitespace.
    CommaFirst,
    /// Tab, semicolon, comma, whitespace.
    TabFirst,
}

impl Separator {
    /// The first separator of the order that stands in the line outside of quotes and lists.
    pub fn detect(line: &str, order: DetectionOrder) -> Self {
        let candidates = match order {
            DetectionOrder::CommaFirst => [';', ',', '\t'],
            DetectionOrder::TabFirst => ['\t', ';', ','],
        };
        let mut outside = [false; 3];
        let (mut quoted, mut listed, mut begins) = (false, false, true);
        // Some close each line with a semicolon.
        for c in line.trim_end().trim_end_matches(';').chars() {
            quoted ^= c == '"';
            // A list in a cell; brackets within a name are part of it.
            listed = (listed || begins && c == '[') && c != ']';
            if !quoted && !listed {
                candidates.iter().zip(&mut outside).for_each(|(candidate, found)| *found |= *candidate == c);
                begins = c.is_whitespace() || candidates.contains(&c);
            }
        }
        let found = candidates.into_iter().zip(outside).find(|(_, found)| *found);
        let found = match found {
            Some((candidate, _)) => Self::Character(candidate),
            None if line.trim_end().ends_with(';') && !are_numbers(line.trim_end().trim_end_matches(';')) => {
                Self::Character(';')
            }
            None => Self::Whitespace,
        };
        // Between tabs or spaces, commas may be decimal ones: if all that stands there are numbers then.
        if found == Self::Character(',') {
            let others = [Self::Character('\t'), Self::Whitespace];
            return others.into_iter().find(|&other| has_decimal_commas(line, other)).unwrap_or(found);
        }
        found
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Character(';') => "semicolons",
            Self::Character('\t') => "tabs",
            Self::Character(_) => "commas",
            Self::Whitespace => "spaces or tabs",
        }
    }
}

/// Whether the line is several numbers with spaces between them.
fn are_numbers(line: &str) -> bool {
    let number = |text: &str| matches!(Value::of(text), Value::Number(_));
    line.split_whitespace().count() > 1 && line.split_whitespace().all(number)
}

/// Whether the line has several fields between these separators, all of them numbers, some with a decimal comma.
fn has_decimal_commas(line: &str, separator: Separator) -> bool {
    let mut fields = Vec::new();
    split(line, separator, &mut fields);
    let with_comma = |field: &Field<'_>| has_decimal_comma(&field.text);
    let is_number = |field: &Field<'_>| with_comma(field) || matches!(Value::of(&field.text), Value::Number(_));
    fields.len() > 1 && fields.iter().any(with_comma) && fields.iter().all(is_number)
}

/// One field of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field<'a> {
    /// Where it stands in the line, with its quotes.
    pub span: Range<usize>,
    /// What it says, without quotes.
    pub text: Cow<'a, str>,
}

/// Splits a line; `into` is cleared first.
pub fn split<'a>(line: &'a str, separator: Separator, into: &mut Vec<Field<'a>>) {
    into.clear();
    let mut line = line.trim_end();
    if separator != Separator::Character(';') {
        line = line.strip_suffix(';').unwrap_or(line);
    }
    let ends_field = |c: char| match separator {
        Separator::Character(separator) => c == separator,
        Separator::Whitespace => c.is_whitespace(),
    };
    let pads_field = |c: char| c.is_whitespace() && separator != Separator::Character(c);
    let mut at = 0;
    // Where no bracket closes any more, none is looked for again: the time is that of the line's length.
    let mut lists_end = true;
    loop {
        let start = at + (line.len() - at - line[at..].trim_start_matches(pads_field).len());
        if start == line.len() && separator == Separator::Whitespace {
            return;
        }
        let closing = line[start..].strip_prefix('"').and_then(closing_quote).map(|length| start + 1 + length);
        let list = match line[start..].strip_prefix('[') {
            Some(rest) if lists_end => {
                let end = rest.find(']');
                lists_end = end.is_some();
                end.map(|length| start + 1 + length)
            }
            _ => None,
        };
        let searched = closing.or(list).map_or(start, |closing| closing + 1);
        let end = line[searched..].find(ends_field).map_or(line.len(), |length| searched + length);
        let trimmed = start + line[start..end].trim_end().len();
        let text = match closing {
            // Anything behind the closing quote spoils the quotation.
            Some(closing) if closing + 1 == trimmed => unquoted(&line[start + 1..closing]),
            _ => Cow::Borrowed(&line[start..trimmed]),
        };
        into.push(Field { span: start..trimmed, text });
        let Some(c) = line[end..].chars().next() else { return };
        at = end + c.len_utf8();
    }
}

/// Bytes up to the closing quote; two quotes in a row stand for one.
fn closing_quote(quoted: &str) -> Option<usize> {
    let mut at = 0;
    loop {
        at += quoted[at..].find('"')?;
        if !quoted[at + 1..].starts_with('"') {
            return Some(at);
        }
        at += 2;
    }
}

fn unquoted(text: &str) -> Cow<'_, str> {
    if text.contains('"') { Cow::Owned(text.replace("\"\"", "\"")) } else { Cow::Borrowed(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(line: &str, separator: Separator) -> Vec<String> {
        let mut fields = Vec::new();
        split(line, separator, &mut fields);
        fields.into_iter().map(|field| field.text.into_owned()).collect()
    }

    #[test]
    fn the_separator_is_found_outside_of_quotes() {
        let detect = |line| Separator::detect(line, DetectionOrder::CommaFirst);
        assert_eq!(detect("1,2"), Separator::Character(','));
        assert_eq!(detect("1,5;2,5"), Separator::Character(';'));
        assert_eq!(detect("1\t2"), Separator::Character('\t'));
        assert_eq!(detect("1,\t2"), Separator::Character(','));
        assert_eq!(detect("40,038\t53,489"), Separator::Character('\t'));
        assert_eq!(detect("1, 2"), Separator::Character(','));
        assert_eq!(
            (detect("1,2;"), detect("1;"), detect("1;2;")),
            (Separator::Character(','), Separator::Character(';'), Separator::Character(';'))
        );
        assert_eq!(fields("1,2;", Separator::Character(',')), ["1", "2"]);
        assert_eq!(detect("1,5 2,5"), Separator::Whitespace);
        assert_eq!(detect("\"a, b\" 2"), Separator::Whitespace);
        assert_eq!(Separator::detect("a, b\t2", DetectionOrder::TabFirst), Separator::Character('\t'));
    }

    #[test]
    fn fields_lose_padding_and_quotes() {
        let comma = Separator::Character(',');
        assert_eq!(fields(" 1 , \"a, \"\"b\"\"\" ,,3 ", comma), ["1", "a, \"b\"", "", "3"]);
        assert_eq!(fields(",2", comma), ["", "2"]);
        assert_eq!(fields("\"a\"b,\"open", comma), ["\"a\"b", "\"open"]);
        assert_eq!(fields("\ty1\ty2", Separator::Character('\t')), ["", "y1", "y2"]);
        assert_eq!(fields("  1 \t \"b c\"  3 ", Separator::Whitespace), ["1", "b c", "3"]);
    }

    #[test]
    fn spans_point_at_the_field_in_its_line() {
        let line = " 1 , \"a\" ";
        let mut split_up = Vec::new();
        split(line, Separator::Character(','), &mut split_up);
        assert_eq!(split_up.iter().map(|field| &line[field.span.clone()]).collect::<Vec<_>>(), ["1", "\"a\""]);
    }

    #[test]
    fn a_list_is_one_field() {
        let detect = |line| Separator::detect(line, DetectionOrder::CommaFirst);
        assert_eq!(detect("[0.1 0.2]"), Separator::Whitespace);
        assert_eq!(detect("[0.1, 0.2];3"), Separator::Character(';'));
        assert_eq!(detect("a [deg, rad] b"), Separator::Whitespace);
        assert_eq!(detect("elbow[deg],b"), Separator::Character(','));
        assert_eq!(fields("[0.1 0.2] 3", Separator::Whitespace), ["[0.1 0.2]", "3"]);
        assert_eq!(fields("1,[0.1,0.2],[ 3", Separator::Character(',')), ["1", "[0.1,0.2]", "[ 3"]);
    }
}
