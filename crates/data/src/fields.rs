//! A line of text in fields, and a field as a number.

use std::borrow::Cow;
use std::ops::Range;

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
    /// The first separator of the order that stands in the line outside of quotes.
    pub fn detect(line: &str, order: DetectionOrder) -> Self {
        let candidates = match order {
            DetectionOrder::CommaFirst => [';', ',', '\t'],
            DetectionOrder::TabFirst => ['\t', ';', ','],
        };
        let outside = |wanted: char| {
            let mut quoted = false;
            line.trim_end().chars().any(|c| {
                quoted ^= c == '"';
                c == wanted && !quoted
            })
        };
        candidates.into_iter().find(|&c| outside(c)).map_or(Self::Whitespace, Self::Character)
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
    let line = line.trim_end();
    let ends_field = |c: char| match separator {
        Separator::Character(separator) => c == separator,
        Separator::Whitespace => c.is_whitespace(),
    };
    let pads_field = |c: char| c.is_whitespace() && separator != Separator::Character(c);
    let mut at = 0;
    loop {
        let start = at + (line.len() - at - line[at..].trim_start_matches(pads_field).len());
        if start == line.len() && separator == Separator::Whitespace {
            return;
        }
        let closing = line[start..].strip_prefix('"').and_then(closing_quote).map(|length| start + 1 + length);
        let searched = closing.map_or(start, |closing| closing + 1);
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

/// A field that should be a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A finite number.
    Number(f64),
    /// NaN, infinity, or how programs write that a value is missing.
    NotFinite,
    /// Something else.
    Other,
}

impl Value {
    /// What `text` means.
    pub fn of(text: &str) -> Self {
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Self::Number(number),
            Ok(_) => Self::NotFinite,
            Err(_) if text.is_empty() => Self::NotFinite,
            Err(_) => {
                let missing = ["na", "n/a", "#n/a", "<na>", "null", "none", "-nan(ind)", "nan(ind)"];
                let is_missing = missing.iter().any(|missing| text.eq_ignore_ascii_case(missing));
                if is_missing { Self::NotFinite } else { Self::Other }
            }
        }
    }
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
    fn missing_values_are_told_from_words() {
        for text in ["nan", "NaN", "inf", "-Infinity", "1e999", "", "NA", "#N/A", "null"] {
            assert_eq!(Value::of(text), Value::NotFinite, "{text}");
        }
        for text in ["y1", "1,5", "0x10", "1.2.3", "--1", "."] {
            assert_eq!(Value::of(text), Value::Other, "{text}");
        }
        assert_eq!(Value::of("-1.5e-3"), Value::Number(-1.5e-3));
    }
}
