//! The bytes of a table as text: UTF-8, UTF-16, and what older programs wrote.

use std::borrow::Cow;

use crate::FileError;

/// What a text says, and what had to be done to read it.
#[derive(Debug)]
pub struct Decoded<'a> {
    /// The text, without a mark at its beginning, in line ends that [`str::lines`] knows.
    pub text: Cow<'a, str>,
    /// How it was encoded if not in UTF-8.
    pub from: Option<&'static str>,
}

/// Reads the bytes of the file called `path`.
///
/// # Errors
/// [`FileError::NotText`] for what is no text in any encoding.
pub fn decode<'a>(path: &str, bytes: &'a [u8]) -> Result<Decoded<'a>, FileError> {
    let not_text = |found| FileError::NotText { path: path.to_owned(), found };
    let (text, from) = if let Some(rest) = bytes.strip_prefix(b"\xff\xfe") {
        (utf16(rest, u16::from_le_bytes).ok_or(not_text("is damaged UTF-16"))?, Some("UTF-16"))
    } else if let Some(rest) = bytes.strip_prefix(b"\xfe\xff") {
        (utf16(rest, u16::from_be_bytes).ok_or(not_text("is damaged UTF-16"))?, Some("UTF-16"))
    } else {
        match std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)) {
            Ok(text) => (Cow::Borrowed(text), None),
            Err(_) => (Cow::Owned(line_by_line(bytes)), Some("Latin-1")),
        }
    };
    if text.contains('\0') {
        return Err(not_text("holds zero bytes"));
    }
    let old_mac = text.contains('\r') && !text.contains('\n');
    Ok(Decoded { text: if old_mac { text.replace('\r', "\n").into() } else { text }, from })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<Cow<'static, str>> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let units = pairs.iter().map(|pair| unit(*pair));
    let text: String = char::decode_utf16(units).collect::<Result<_, _>>().ok()?;
    rest.is_empty().then_some(text.into())
}

/// Lines that are not UTF-8 are Latin-1, in which every byte is a character: a stray line does not spoil the others.
fn line_by_line(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len() + bytes.len() / 8);
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        match std::str::from_utf8(line) {
            Ok(line) => text.push_str(line),
            Err(_) => text.extend(line.iter().map(|&byte| char::from(byte))),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &[u8]) -> String {
        decode("x", bytes).unwrap().text.into_owned()
    }

    #[test]
    fn texts_of_other_programs_are_read() {
        assert_eq!(text(b"\xef\xbb\xbfa"), "a");
        assert_eq!(text(b"\xff\xfea\0\xe9\0"), "a\u{e9}");
        assert_eq!(text(b"\xfe\xff\0a"), "a");
        assert_eq!(text(b"W\xe4nde\n\xc3\xa9\n"), "W\u{e4}nde\n\u{e9}\n");
        assert_eq!(text(b"a\rb"), "a\nb");
        for bad in [&b"\xff\xfea"[..], b"\xff\xfe\x00\xd8", b"PK\0"] {
            assert!(decode("x", bad).is_err(), "{bad:?}");
        }
    }
}
