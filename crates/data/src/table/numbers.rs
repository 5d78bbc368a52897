//! A field as a number, in the ways that programs write numbers.

use std::borrow::Cow;

use super::dates::{Moment, moment};

/// How numbers are written in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Notation {
    /// `1274.54`.
    #[default]
    Point,
    /// `1274,54`.
    Comma,
    /// `1,274.54`.
    Thousands,
}

/// A field that should be a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A finite number.
    Number(f64),
    /// NaN, nothing, or how programs write that a value is missing.
    Missing,
    /// Infinity, or a number beyond all that can be held.
    Infinite,
    /// Something else.
    Other,
}

impl Value {
    /// What `text` means, with decimal points.
    pub fn of(text: &str) -> Self {
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Self::Number(number),
            Ok(number) if number.is_nan() => Self::Missing,
            Ok(_) => Self::Infinite,
            Err(_) if text.is_empty() => Self::Missing,
            Err(_) => {
                let missing = ["na", "n/a", "#n/a", "<na>", "null", "none", "-nan(ind)", "nan(ind)"];
                if missing.iter().any(|missing| text.eq_ignore_ascii_case(missing)) {
                    return Self::Missing;
                }
                match repaired(text).map(|text| text.parse::<f64>()) {
                    Some(Ok(number)) if number.is_finite() => Self::Number(number),
                    Some(Ok(_)) => Self::Infinite,
                    _ => Self::Other,
                }
            }
        }
    }

    /// What `text` means in this notation.
    pub fn in_notation(text: &str, notation: Notation) -> Self {
        match notation {
            Notation::Comma if text.contains(',') => match Self::of(&text.replacen(',', ".", 1)) {
                _ if text.contains('.') => Self::Other,
                value => value,
            },
            Notation::Thousands if has_thousands(text) => Self::of(&text.replace(',', "")),
            _ => Self::of(text),
        }
    }
}

/// Fortran's exponents (`1.5D-03`) and the typographer's minus, as a number is written elsewhere.
fn repaired(text: &str) -> Option<Cow<'_, str>> {
    let minus = text.contains('\u{2212}');
    let plain: Cow<'_, str> = if minus { text.replace('\u{2212}', "-").into() } else { text.into() };
    let exponent = plain.find(['d', 'D']).filter(|&at| {
        let (mantissa, exponent) = (&plain[..at], &plain[at + 1..]);
        let number = mantissa.bytes().all(|b| b.is_ascii_digit() || b"+-.".contains(&b));
        number && mantissa.contains('.') && exponent.trim_start_matches(['+', '-']).bytes().all(|b| b.is_ascii_digit())
    });
    match exponent {
        Some(at) => Some(format!("{}e{}", &plain[..at], &plain[at + 1..]).into()),
        None => minus.then_some(plain),
    }
}

/// Whether commas stand before groups of three digits, and before the point, if there is one.
pub fn has_thousands(text: &str) -> bool {
    let whole = text.split('.').next().unwrap_or(text).trim_start_matches(['+', '-']);
    let mut groups = whole.split(',');
    let first = groups.next().unwrap_or("");
    let digits = |group: &str| group.bytes().all(|b| b.is_ascii_digit());
    let mut rest = groups.peekable();
    rest.peek().is_some()
        && (1..=3).contains(&first.len())
        && digits(first)
        && !first.starts_with('0')
        && rest.all(|group| group.len() == 3 && digits(group))
}

/// Whether the text would be a number if its comma were a point.
pub fn has_decimal_comma(text: &str) -> bool {
    let digits = text.split_once(',').is_some_and(|(_, rest)| rest.starts_with(|c: char| c.is_ascii_digit()));
    digits && matches!(Value::of(&text.replacen(',', ".", 1)), Value::Number(_))
}

/// What a cell of a table is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// A number, or one with a comma.
    Number,
    /// A missing value.
    Missing,
    /// `True` or `False`.
    Truth,
    /// A list of so many numbers.
    List(usize),
    /// A date, a time of day or both.
    Moment(Moment),
    /// Anything else.
    Word,
}

impl Cell {
    /// What `text` is in this notation.
    pub fn of(text: &str, notation: Notation) -> Self {
        match Value::in_notation(text, notation) {
            Value::Number(_) | Value::Infinite => Self::Number,
            Value::Missing => Self::Missing,
            Value::Other => match (truth(text), list(text)) {
                (Some(_), _) => Self::Truth,
                (None, Some(list)) => Self::List(list.count()),
                (None, None) => moment(text).map_or(Self::Word, Self::Moment),
            },
        }
    }
}

/// 1 or 0 of `True` or `False`.
pub fn truth(text: &str) -> Option<f64> {
    let is = |word: &str| text.eq_ignore_ascii_case(word);
    if is("true") { Some(1.0) } else { is("false").then_some(0.0) }
}

/// The parts of `[1, 2]`, `[1 2]`, `(1, 2)`, if all are numbers.
pub fn list(text: &str) -> Option<impl Iterator<Item = &str>> {
    let inside = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let inside = inside.or_else(|| text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')))?;
    let parts =
        move || inside.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|part| !part.is_empty());
    let numbers = parts().next().is_some() && parts().all(|part| Value::of(part) != Value::Other);
    numbers.then(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_values_are_told_from_words() {
        for text in ["nan", "NaN", "", "NA", "#N/A", "null"] {
            assert_eq!(Value::of(text), Value::Missing, "{text}");
        }
        for text in ["inf", "-Infinity", "1e999", "1.0D999"] {
            assert_eq!(Value::of(text), Value::Infinite, "{text}");
        }
        for text in ["y1", "1,5", "0x10", "1.2.3", "--1", ".", "1d5", "3D", "D", "\u{2212}", "-"] {
            assert_eq!(Value::of(text), Value::Other, "{text}");
        }
        assert_eq!(Value::of("-1.5e-3"), Value::Number(-1.5e-3));
        assert_eq!(Value::of("-1.5D-03"), Value::Number(-1.5e-3));
        assert_eq!(Value::of("1.5d+00"), Value::Number(1.5));
        assert_eq!(Value::of("\u{2212}0.25"), Value::Number(-0.25));
    }

    #[test]
    fn commas_mean_what_the_notation_says() {
        let of = Value::in_notation;
        assert_eq!(of("40,038", Notation::Comma), Value::Number(40.038));
        assert_eq!(of("-3,5e2", Notation::Comma), Value::Number(-350.0));
        assert_eq!(of("1,274.5", Notation::Comma), Value::Other);
        assert_eq!(of("1,274.54", Notation::Thousands), Value::Number(1274.54));
        assert_eq!(of("-1,274,000", Notation::Thousands), Value::Number(-1_274_000.0));
        assert_eq!(of("1,27", Notation::Thousands), Value::Other);
        assert_eq!(of("1,5", Notation::Point), Value::Other);
        assert!(!has_thousands("0,038") && !has_thousands("12.5") && has_thousands("40,038"));
    }

    #[test]
    fn cells_are_told_apart() {
        let of = |text| Cell::of(text, Notation::Point);
        assert_eq!(of("True"), Cell::Truth);
        assert_eq!(of("[0.1, 2 nan]"), Cell::List(3));
        assert_eq!(of("[a]"), Cell::Word);
        assert_eq!(of("[]"), Cell::Word);
        assert!(matches!(of("2024-05-01T10:00:00Z"), Cell::Moment(_)));
        assert_eq!((of("1e5"), of(""), of("left")), (Cell::Number, Cell::Missing, Cell::Word));
    }
}
