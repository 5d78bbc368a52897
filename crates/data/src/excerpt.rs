//! The text that stands beside an error: all of a small file, a few lines of a large one.

use std::ops::Range;

use miette::{NamedSource, SourceSpan};

/// Files up to this many bytes are shown with their own line numbers.
const WHOLE: usize = 1 << 20;
/// Bytes that are shown on either side of the place otherwise, and of the place itself.
const AROUND: usize = 200;

/// What to show of `text` for the bytes at `span`, and where they are in it.
///
/// Around the place in a large file, or in a file of very long lines, miette's own line numbers mean nothing: messages
/// name the line themselves.
pub fn excerpt(path: &str, text: &str, span: Range<usize>) -> (NamedSource<String>, SourceSpan) {
    let line_start = text[..span.start].rfind('\n').map_or(0, |index| index + 1);
    let line_end = text[span.start..].find('\n').map_or(text.len(), |index| span.start + index);
    let (shown, span) = if text.len() <= WHOLE && line_end - line_start <= 5 * AROUND {
        (0..text.len(), span)
    } else {
        let end = text.floor_char_boundary(span.end.min(span.start + AROUND)).max(span.start);
        let from = text.ceil_char_boundary(span.start.saturating_sub(AROUND)).min(span.start);
        let to = text.floor_char_boundary(end.saturating_add(AROUND).min(text.len())).max(end);
        (from..to, span.start - from..end - from)
    };
    (NamedSource::new(path, printable(&text[shown])), span.into())
}

/// The text without characters that would steer a terminal, each byte in its place.
pub fn printable(text: &str) -> String {
    let mut clean = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => clean.push(c),
            '\r' => clean.push(' '),
            c if c.is_control() => clean.extend(std::iter::repeat_n('?', c.len_utf8())),
            c => clean.push(c),
        }
    }
    clean
}

/// A field as messages show it: on one line, and not too long.
pub fn shortened(field: &str) -> String {
    let mut short: String = printable(field).chars().take(40).collect();
    if short.len() < field.len() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::SourceCode;

    fn shown(text: &str, span: Range<usize>) -> (String, String) {
        let (source, span) = excerpt("x.csv", text, span);
        let marked = source.inner().read_span(&span, 0, 0).unwrap().span().len();
        let start = span.offset();
        (source.inner().clone(), source.inner()[start..start + marked].to_owned())
    }

    #[test]
    fn a_small_file_is_shown_whole() {
        assert_eq!(shown("a\nbc\n", 2..3), ("a\nbc\n".into(), "b".into()));
    }

    #[test]
    fn of_a_large_file_only_the_surroundings_are_kept() {
        let text = format!("{}BAD,1\n{}", "1,2\n".repeat(400_000), "3,4\n".repeat(1000));
        let (source, marked) = shown(&text, 1_600_000..1_600_003);
        assert!(source.len() <= 3 * AROUND, "{}", source.len());
        assert_eq!(marked, "BAD");
    }

    #[test]
    fn a_long_line_is_cut_between_characters() {
        let text = "\u{e9}".repeat(5000);
        let (source, marked) = shown(&text, 1000..9000);
        assert!(source.len() <= 3 * AROUND && marked.len() <= AROUND, "{} {}", source.len(), marked.len());
    }

    #[test]
    fn nothing_that_steers_a_terminal_is_shown() {
        assert_eq!(printable("\u{1b}[2Jx\u{9b}1\r\n"), "?[2Jx??1 \n");
        assert_eq!(shortened(&"y".repeat(50)), format!("{}...", "y".repeat(40)));
    }
}
