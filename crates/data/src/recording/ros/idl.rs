//! Definitions as `.idl` files write them, as far as ROS 2 uses the language.
//!
//! ```text
//! module sensor_msgs { module msg {
//!   typedef double double__9[9];
//!   struct Imu { std_msgs::msg::Header header; @unit (value="m") double__9 covariance; sequence<float, 3> x; };
//! }; };
//! ```

use std::collections::BTreeMap;

use super::definition::{Count, Field, Kind, Types, plain};
use crate::recording::tree::Number;

/// Most words of a definition: what is longer is no message's.
const MOST_WORDS: usize = 1 << 20;
/// Longest name with its modules, in bytes: each type and each field has one.
const LONGEST_NAME: usize = 1000;

/// Reads all structs of a text.
///
/// # Errors
/// What cannot be understood, as the end of a sentence.
pub fn parse(text: &str) -> Result<Types, String> {
    let mut parser =
        Parser { words: words(text)?, at: 0, modules: Vec::new(), types: Types::new(), aliases: BTreeMap::new() };
    while parser.at < parser.words.len() {
        parser.definition()?;
    }
    Ok(parser.types)
}

/// Words, signs and quoted texts (which are kept as a quote alone).
fn words(text: &str) -> Result<Vec<&str>, String> {
    let mut words = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let Some(first) = rest.chars().next() else { return Ok(words) };
        if words.len() == MOST_WORDS {
            return Err(format!("have a definition of more than {MOST_WORDS} words"));
        }
        let after_line = |rest: &'_ str| rest.find('\n').unwrap_or(rest.len());
        let length = if rest.starts_with("//") || first == '#' || rest.starts_with("====") {
            rest = &rest[after_line(rest)..];
            continue;
        } else if rest.starts_with("/*") {
            rest = rest.split_once("*/").map_or("", |(_, after)| after);
            continue;
        } else if rest.starts_with("IDL:") {
            rest = &rest[after_line(rest)..];
            continue;
        } else if first == '"' {
            words.push("\"");
            rest = after_quote(&rest[1..]);
            continue;
        } else if first.is_alphanumeric() || first == '_' {
            rest.find(|c: char| !c.is_alphanumeric() && c != '_' && c != '.').unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        words.push(&rest[..length]);
        rest = &rest[length..];
    }
}

/// What stands behind the closing quote.
fn after_quote(text: &str) -> &str {
    let mut escaped = false;
    for (at, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return &text[at + 1..],
            _ => {}
        }
    }
    ""
}

struct Parser<'a> {
    words: Vec<&'a str>,
    at: usize,
    modules: Vec<&'a str>,
    types: Types,
    /// What typedefs and enumerations stand for.
    aliases: BTreeMap<String, (Kind, Count)>,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> &'a str {
        self.words.get(self.at).copied().unwrap_or_default()
    }

    fn next(&mut self) -> &'a str {
        let word = self.peek();
        self.at += 1;
        word
    }

    fn takes(&mut self, word: &str) -> bool {
        let is = self.peek() == word;
        self.at += usize::from(is);
        is
    }

    fn need(&mut self, word: &str) -> Result<(), String> {
        match self.next() {
            found if found == word => Ok(()),
            found => Err(odd(&format!("`{}` instead of `{word}`", crate::excerpt::shortened(found)))),
        }
    }

    fn definition(&mut self) -> Result<(), String> {
        self.annotations();
        match self.next() {
            "module" => {
                self.modules.push(self.words.get(self.at).copied().unwrap_or_default());
                if self.modules.len() > 32 {
                    return Err(odd("modules more than 32 deep"));
                }
                self.at += 1;
                self.need("{")
            }
            // The end of a module; what else has a body is read as a whole.
            "}" => {
                self.modules.pop();
                self.takes(";");
                Ok(())
            }
            "struct" => self.structure(),
            "typedef" => {
                let (kind, count) = self.kind()?;
                let name = self.next();
                let count = self.dimensions(count)?;
                self.aliases.insert(self.full(name)?, (kind, count));
                self.need(";")
            }
            "enum" => {
                let name = self.next();
                self.aliases.insert(self.full(name)?, (Kind::Number(Number::Unsigned(4)), Count::One));
                self.skip_past(";");
                Ok(())
            }
            "const" => {
                self.skip_past(";");
                Ok(())
            }
            ";" => Ok(()),
            other => Err(odd(&format!("`{}`", crate::excerpt::shortened(other)))),
        }
    }

    fn structure(&mut self) -> Result<(), String> {
        let name = self.next();
        let name = self.full(name)?;
        self.need("{")?;
        let mut fields = Vec::new();
        loop {
            self.annotations();
            if self.takes("}") {
                break;
            }
            let (kind, count) = self.kind()?;
            loop {
                let name = self.next().to_owned();
                if name.is_empty() {
                    return Err(odd("a struct without an end"));
                }
                let count = self.dimensions(count)?;
                fields.push(Field { name, kind: kind.clone(), count });
                if !self.takes(",") {
                    break;
                }
            }
            self.need(";")?;
        }
        self.takes(";");
        self.types.insert(plain(&name), fields);
        Ok(())
    }

    /// A type, and how often it stands there.
    fn kind(&mut self) -> Result<(Kind, Count), String> {
        let number = |number| Ok((Kind::Number(number), Count::One));
        match self.next() {
            "boolean" => number(Number::Bool),
            "octet" | "char" | "uint8" => number(Number::Unsigned(1)),
            "int8" => number(Number::Signed(1)),
            "wchar" | "uint16" => number(Number::Unsigned(2)),
            "short" | "int16" => number(Number::Signed(2)),
            "int32" => number(Number::Signed(4)),
            "uint32" => number(Number::Unsigned(4)),
            "int64" => number(Number::Signed(8)),
            "uint64" => number(Number::Unsigned(8)),
            "float" => number(Number::Single),
            "double" => number(Number::Double),
            "long" if self.takes("double") => number(Number::Quadruple),
            "long" if self.takes("long") => number(Number::Signed(8)),
            "long" => number(Number::Signed(4)),
            "unsigned" => match self.next() {
                "short" => number(Number::Unsigned(2)),
                "long" if self.takes("long") => number(Number::Unsigned(8)),
                "long" => number(Number::Unsigned(4)),
                other => Err(odd(&format!("`unsigned {}`", crate::excerpt::shortened(other)))),
            },
            "string" => {
                self.bound()?;
                Ok((Kind::Text, Count::One))
            }
            "wstring" => {
                self.bound()?;
                Ok((Kind::WideText, Count::One))
            }
            "sequence" => {
                self.need("<")?;
                let (kind, count) = self.kind()?;
                if count != Count::One {
                    return Err("have lists of lists, which are not read".to_owned());
                }
                let bound = if self.takes(",") { Some(self.number()?) } else { None };
                self.need(">")?;
                Ok((kind, Count::Counted(bound)))
            }
            name => {
                let mut name = if name == "::" { self.next().to_owned() } else { name.to_owned() };
                if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') {
                    return Err(odd(&format!("`{}` for a type", crate::excerpt::shortened(&name))));
                }
                while self.takes("::") {
                    name = format!("{name}::{}", self.next());
                    if name.len() > LONGEST_NAME {
                        return Err(odd("a name that does not end"));
                    }
                }
                let full = if name.contains("::") { name } else { self.full(&name)? };
                Ok(self.aliases.get(&full).cloned().unwrap_or_else(|| (Kind::Type(plain(&full)), Count::One)))
            }
        }
    }

    /// `<10>` behind `string`.
    fn bound(&mut self) -> Result<(), String> {
        if self.takes("<") {
            self.number()?;
            self.need(">")?;
        }
        Ok(())
    }

    /// `[9]` behind a name.
    fn dimensions(&mut self, mut count: Count) -> Result<Count, String> {
        while self.takes("[") {
            let dimension = self.number()?;
            self.need("]")?;
            count = match count {
                Count::One => Count::Fixed(dimension),
                Count::Fixed(before) => Count::Fixed(before.saturating_mul(dimension)),
                Count::Counted(_) => return Err("have lists of lists, which are not read".to_owned()),
            };
        }
        Ok(count)
    }

    fn number(&mut self) -> Result<usize, String> {
        let word = self.next();
        let number = word.parse().ok().filter(|&number| number > 0);
        number.ok_or_else(|| odd(&format!("`{}` for a number", crate::excerpt::shortened(word))))
    }

    /// `@verbatim (language="comment", text= "..." "...")` and the like.
    fn annotations(&mut self) {
        while self.takes("@") {
            self.at += 1;
            while self.takes("::") {
                self.at += 1;
            }
            if self.takes("(") {
                let mut open = 1;
                while open > 0 && self.at < self.words.len() {
                    match self.next() {
                        "(" => open += 1,
                        ")" => open -= 1,
                        _ => {}
                    }
                }
            }
        }
    }

    fn skip_past(&mut self, word: &str) {
        while self.at < self.words.len() && self.next() != word {}
    }

    /// The name with its modules.
    fn full(&self, name: &str) -> Result<String, String> {
        let length = self.modules.iter().map(|module| module.len() + 2).sum::<usize>() + name.len();
        match length <= LONGEST_NAME {
            true => Ok(self.modules.iter().chain([&name]).copied().collect::<Vec<_>>().join("::")),
            false => Err(odd("a name that does not end")),
        }
    }
}

fn odd(what: &str) -> String {
    format!("have a definition that makes no sense: it has {what}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        // generated
        #include "std_msgs/msg/Header.idl"
        module a { module msg {
            module B_Constants { @verbatim (language="comment", text="x; \"y\" }" "more") const uint8 OK = 3; };
            typedef double double__9[9];
            enum Mode { SLOW, FAST };
            @verbatim (language="comment", text="x;\"}")
            struct B {
                std_msgs::msg::Header header;
                @unit (value="m") double__9 covariance;
                sequence<float, 3> x;
                sequence<string<4>> names;
                unsigned long long big; long small, smaller;
                Mode mode;
                C inner[2][3];
                wstring wide;
            };
            struct C { boolean flag; };
        }; };
        ================================================================================
        IDL: std_msgs/msg/Header
        module std_msgs { module msg { struct Header { long double odd; }; }; };
    "#;

    #[test]
    fn structs_typedefs_enumerations_and_sequences_are_read() {
        let types = parse(TEXT).unwrap();
        assert_eq!(types.keys().collect::<Vec<_>>(), ["a/B", "a/C", "std_msgs/Header"]);
        let fields: Vec<_> =
            types["a/B"].iter().map(|field| (field.name.as_str(), field.kind.clone(), field.count)).collect();
        let number = Kind::Number;
        assert_eq!(
            fields,
            [
                ("header", Kind::Type("std_msgs/Header".into()), Count::One),
                ("covariance", number(Number::Double), Count::Fixed(9)),
                ("x", number(Number::Single), Count::Counted(Some(3))),
                ("names", Kind::Text, Count::Counted(None)),
                ("big", number(Number::Unsigned(8)), Count::One),
                ("small", number(Number::Signed(4)), Count::One),
                ("smaller", number(Number::Signed(4)), Count::One),
                ("mode", number(Number::Unsigned(4)), Count::One),
                ("inner", Kind::Type("a/C".into()), Count::Fixed(6)),
                ("wide", Kind::WideText, Count::One),
            ]
        );
        assert_eq!(types["std_msgs/Header"][0].kind, number(Number::Quadruple));
    }

    #[test]
    fn what_makes_no_sense_is_refused_and_ends() {
        for text in [
            "struct",
            "struct A {",
            "struct A { float",
            "union A {};",
            "module",
            "struct A { unsigned x; };",
            "struct A { sequence<sequence<float>> x; };",
            "struct A { float x[0]; };",
            "typedef float",
            "@",
            "@a(",
            "\"",
            "struct A { a::",
            "/*",
        ] {
            let outcome = parse(text);
            assert!(outcome.is_err() || outcome.is_ok_and(|types| types.is_empty()), "{text}");
        }
        for end in 0..TEXT.len() {
            let _ = parse(&TEXT[..end]);
        }
    }
}
