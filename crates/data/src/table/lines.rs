//! The lines of a text, each with its place.

/// A line with its place in the file.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// Its number, from 1.
    pub number: usize,
    /// Where it begins, in bytes.
    pub start: usize,
    /// What stands there, without its end.
    pub text: &'a str,
}

/// What a line is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind<'a> {
    /// Nothing.
    Blank,
    /// What stands behind `#`, or `%` as MATLAB has it.
    Comment(&'a str),
    /// Fields.
    Content,
}

impl<'a> Line<'a> {
    /// What it is.
    pub fn kind(&self) -> Kind<'a> {
        let text = self.text.trim();
        match text.strip_prefix(['#', '%']) {
            _ if text.is_empty() => Kind::Blank,
            // `rostopic echo -p` calls its first column so.
            Some(comment) if text.starts_with("%time") => Kind::Comment(&text[text.len() - comment.len() - 1..]),
            Some(comment) => Kind::Comment(comment.trim()),
            None => Kind::Content,
        }
    }
}

/// All lines of a text.
pub fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut start = 0;
    text.split_inclusive('\n').enumerate().map(move |(index, with_end)| {
        let line = Line { number: index + 1, start, text: with_end.trim_end_matches(['\n', '\r']) };
        start += with_end.len();
        line
    })
}
