//! Definitions as `.msg` files write them: the message's own first, those of the types it needs after lines of `=`.
//!
//! ```text
//! std_msgs/Header header
//! string<=10[<=5] name          # text of up to 10 bytes, up to 5 times
//! float64[9] covariance [0, 0, 0, 0, 0, 0, 0, 0, 0]
//! uint8 OK=0                    # a constant takes no room
//! ====================
//! MSG: std_msgs/Header
//! ...
//! ```

use super::definition::{Count, Field, Kind, Types, plain};
use crate::recording::tree::Number;

/// Longest name of a type with its package, in bytes: each field may have one.
const LONGEST_NAME: usize = 1000;

/// Reads the definition of `name` and those that stand behind it.
///
/// # Errors
/// What cannot be understood, as the end of a sentence.
pub fn parse(name: &str, text: &str) -> Result<Types, String> {
    let mut types = Types::new();
    let (mut of, mut fields) = (plain(name), Vec::new());
    let mut head = false;
    if of.len() > LONGEST_NAME {
        return Err(endless());
    }
    for line in text.lines() {
        let line = line.trim();
        if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
            types.entry(of).or_insert(fields);
            (of, fields, head) = (String::new(), Vec::new(), true);
            continue;
        }
        if head && let Some(name) = line.strip_prefix("MSG:") {
            (of, head) = (plain(name.trim()), false);
            if of.len() > LONGEST_NAME {
                return Err(endless());
            }
            continue;
        }
        let package = of.split('/').next().unwrap_or_default();
        if let Some(field) = field(line, package)? {
            fields.push(field);
        }
    }
    types.entry(of).or_insert(fields);
    Ok(types)
}

fn endless() -> String {
    format!("have a definition with a type's name of more than {LONGEST_NAME} bytes")
}

/// The field of a line, if it has one.
fn field(line: &str, package: &str) -> Result<Option<Field>, String> {
    let line = line.split('#').next().unwrap_or_default().trim();
    if line.is_empty() {
        return Ok(None);
    }
    let odd = || format!("have a definition with the line `{}`, which makes no sense", crate::excerpt::shortened(line));
    let (of, rest) = line.split_once(char::is_whitespace).ok_or_else(odd)?;
    let rest = rest.trim_start();
    let name = &rest[..rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())];
    // A name and `=`, but no default value, which might hold one: `string greeting "a=b"`.
    if rest[name.len()..].trim_start().starts_with('=') {
        return Ok(None);
    }
    if name.is_empty() || !(rest.len() == name.len() || rest[name.len()..].starts_with(char::is_whitespace)) {
        return Err(odd());
    }
    let (of, count) = counted(of).ok_or_else(odd)?;
    let kind = kind(of, package);
    Ok(Some(Field { name: name.to_owned(), kind, count }))
}

/// Splits `float64[9]` into the type and how often it is there.
fn counted(of: &str) -> Option<(&str, Count)> {
    let Some(open) = of.strip_suffix(']') else { return Some((of, Count::One)) };
    let (of, inside) = open.rsplit_once('[')?;
    let count = match inside.strip_prefix("<=") {
        Some(bound) => Count::Counted(Some(bound.parse().ok()?)),
        None if inside.is_empty() => Count::Counted(None),
        None => Count::Fixed(inside.parse().ok().filter(|&count| count > 0)?),
    };
    Some((of, count))
}

fn kind(of: &str, package: &str) -> Kind {
    let bare = of.split("<=").next().unwrap_or_default();
    match bare {
        "string" => Kind::Text,
        "wstring" => Kind::WideText,
        "Header" => Kind::Type("std_msgs/Header".to_owned()),
        _ => match number(bare) {
            Some(number) => Kind::Number(number),
            None if bare.contains('/') => Kind::Type(plain(bare)),
            None => Kind::Type(format!("{package}/{bare}")),
        },
    }
}

fn number(of: &str) -> Option<Number> {
    Some(match of {
        "bool" => Number::Bool,
        "byte" | "char" | "uint8" => Number::Unsigned(1),
        "int8" => Number::Signed(1),
        "int16" => Number::Signed(2),
        "uint16" => Number::Unsigned(2),
        "int32" => Number::Signed(4),
        "uint32" => Number::Unsigned(4),
        "int64" => Number::Signed(8),
        "uint64" => Number::Unsigned(8),
        "float32" => Number::Single,
        "float64" => Number::Double,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(line: &str) -> Result<Option<(Kind, Count)>, String> {
        Ok(field(line, "pkg")?.map(|field| (field.kind, field.count)))
    }

    #[test]
    fn fields_have_types_counts_and_defaults_and_constants_are_none() {
        let double = Kind::Number(Number::Double);
        assert_eq!(one("float64 x"), Ok(Some((double.clone(), Count::One))));
        assert_eq!(one("float64[9]   c [1, 2]  # nine"), Ok(Some((double.clone(), Count::Fixed(9)))));
        assert_eq!(one("float64[<=9] c"), Ok(Some((double.clone(), Count::Counted(Some(9))))));
        assert_eq!(one("float64[] c"), Ok(Some((double, Count::Counted(None)))));
        assert_eq!(one("string<=10[<=5] s"), Ok(Some((Kind::Text, Count::Counted(Some(5))))));
        assert_eq!(one("wstring<=10 s"), Ok(Some((Kind::WideText, Count::One))));
        assert_eq!(one("Header h"), Ok(Some((Kind::Type("std_msgs/Header".into()), Count::One))));
        assert_eq!(one("other/msg/Thing h"), Ok(Some((Kind::Type("other/Thing".into()), Count::One))));
        assert_eq!(one("Thing[2] h"), Ok(Some((Kind::Type("pkg/Thing".into()), Count::Fixed(2)))));
        assert_eq!(one("string greeting \"a=b\""), Ok(Some((Kind::Text, Count::One))));
        for none in ["", "  # only words", "uint8 OK=0", "uint8 OK = 0", "string NAME=\"a b\""] {
            assert_eq!(one(none), Ok(None), "{none}");
        }
        for odd in ["float64", "float64[0] x", "float64[a] x", "float64] x", "float64 -x", "float64 x-y"] {
            assert!(one(odd).unwrap_err().contains("makes no sense"), "{odd}");
        }
    }

    #[test]
    fn types_stand_behind_lines() {
        let text = "std_msgs/Header header\nfloat64 x\n====\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n=====\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec";
        let types = parse("a/msg/B", text).unwrap();
        assert_eq!(types.keys().collect::<Vec<_>>(), ["a/B", "builtin_interfaces/Time", "std_msgs/Header"]);
        assert_eq!(types["builtin_interfaces/Time"].len(), 2);
    }
}
