//! Text as it may stand in HTML and SVG.

/// A text of characters that XML may hold: names from files may have others, which are shown by their numbers.
pub(super) fn printable(text: &str) -> std::borrow::Cow<'_, str> {
    let foreign = |c: char| c.is_control() && !"\n\t\r".contains(c) || matches!(c, '\u{fffe}' | '\u{ffff}');
    if !text.contains(foreign) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match foreign(c) {
            true => shown.extend(c.escape_unicode()),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// A text in which nothing is read as a tag.
pub(super) fn escaped(text: &str) -> String {
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
