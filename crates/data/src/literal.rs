//! Python's literals, as far as the header of a numpy array has them.

/// How deep they may be nested.
const DEPTH: usize = 12;

/// A literal.
#[derive(Debug, Clone, PartialEq)]
pub enum Literal {
    /// `'text'`, with or without a letter before it.
    Text(String),
    /// A whole number.
    Number(u64),
    /// `True` or `False`.
    Truth(bool),
    /// `(...)` or `[...]`.
    List(Vec<Literal>),
    /// `{...}`.
    Dictionary(Vec<(Literal, Literal)>),
}

impl Literal {
    /// The whole text as one literal.
    pub fn parse(text: &str) -> Option<Self> {
        let mut rest = text;
        let literal = value(&mut rest, DEPTH)?;
        rest.trim().is_empty().then_some(literal)
    }

    /// The entry of a dictionary.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dictionary(entries) = self else { return None };
        entries.iter().find(|(name, _)| name.text() == Some(key)).map(|(_, value)| value)
    }

    /// A text's characters.
    pub fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// A list's entries.
    pub fn list(&self) -> Option<&[Self]> {
        if let Self::List(list) = self { Some(list) } else { None }
    }

    /// A list of whole numbers, or a single one.
    pub fn lengths(&self) -> Option<Vec<usize>> {
        let number =
            |literal: &Self| if let Self::Number(number) = literal { usize::try_from(*number).ok() } else { None };
        match self {
            Self::List(list) => list.iter().map(number).collect(),
            other => number(other).map(|length| vec![length]),
        }
    }
}

fn value(rest: &mut &str, depth: usize) -> Option<Literal> {
    let depth = depth.checked_sub(1)?;
    *rest = rest.trim_start();
    let mut chars = rest.chars();
    match chars.next()? {
        open @ ('(' | '[') => {
            *rest = &rest[1..];
            let close = if open == '(' { ')' } else { ']' };
            let mut list = Vec::new();
            while !ends(rest, close) {
                list.push(value(rest, depth)?);
                comma(rest, close)?;
            }
            Some(Literal::List(list))
        }
        '{' => {
            *rest = &rest[1..];
            let mut entries = Vec::new();
            while !ends(rest, '}') {
                let key = value(rest, depth)?;
                *rest = rest.trim_start().strip_prefix(':')?;
                entries.push((key, value(rest, depth)?));
                comma(rest, '}')?;
            }
            Some(Literal::Dictionary(entries))
        }
        'u' | 'b' if matches!(chars.next(), Some('\'' | '"')) => {
            *rest = &rest[1..];
            text(rest)
        }
        '\'' | '"' => text(rest),
        '0'..='9' => {
            let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let number = rest[..digits].parse().ok()?;
            // Python 2 wrote long integers as 12L.
            *rest = rest[digits..].strip_prefix('L').unwrap_or(&rest[digits..]);
            Some(Literal::Number(number))
        }
        _ => {
            for (word, truth) in [("True", true), ("False", false)] {
                if let Some(after) = rest.strip_prefix(word) {
                    *rest = after;
                    return Some(Literal::Truth(truth));
                }
            }
            None
        }
    }
}

fn text(rest: &mut &str) -> Option<Literal> {
    let quote = rest.chars().next()?;
    let mut out = String::new();
    let mut chars = rest[1..].char_indices();
    while let Some((at, c)) = chars.next() {
        match c {
            '\\' => out.push(chars.next()?.1),
            c if c == quote => {
                *rest = &rest[at + 2..];
                return Some(Literal::Text(out));
            }
            c => out.push(c),
        }
    }
    None
}

fn ends(rest: &mut &str, close: char) -> bool {
    *rest = rest.trim_start();
    match rest.strip_prefix(close) {
        Some(after) => {
            *rest = after;
            true
        }
        None => false,
    }
}

fn comma(rest: &mut &str, close: char) -> Option<()> {
    *rest = rest.trim_start();
    match rest.strip_prefix(',') {
        Some(after) => *rest = after,
        None => rest.starts_with(close).then_some(())?,
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_numpy_are_read() {
        let header = Literal::parse(
            "{'descr': [('a', '<f8'), (\"b\", '<f4', (3L,))], 'fortran_order': False, 'shape': (60,), } ",
        )
        .unwrap();
        assert_eq!(header.get("shape").and_then(Literal::lengths), Some(vec![60]));
        assert_eq!(header.get("fortran_order"), Some(&Literal::Truth(false)));
        let fields = header.get("descr").unwrap().list().unwrap();
        assert_eq!(fields[1].list().unwrap()[2].lengths(), Some(vec![3]));
        assert_eq!(Literal::parse("()"), Some(Literal::List(vec![])));
        for bad in ["", "(", "{'a'}", "[1 2]", "'a", "nan", "1 2", "99999999999999999999", &"[".repeat(100)] {
            assert_eq!(Literal::parse(bad), None, "{bad}");
        }
    }
}
