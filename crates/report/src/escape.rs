//! Text as it may stand in HTML and SVG.

/// A text in which nothing is read as a tag.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
