//! Marks on paper: what a chart is made of, and how they become SVG or PDF.
//!
//! Places are in units of the paper, from its upper left corner; y points down. A line of text is placed by its baseline.

use std::fmt::Write as _;

use super::chart::Tone;
use super::escape::{escaped, printable};

/// Which point of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A form.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Form {
    /// A line through points.
    Line { points: Vec<(f64, f64)>, width: f64, dashed: bool },
    /// What lies within an outline.
    Area { outline: Vec<(f64, f64)>, opacity: f64 },
    /// A full circle.
    Disc { centre: (f64, f64), radius: f64 },
    /// A line of text, from left to right or upwards.
    Text { at: (f64, f64), size: f64, anchor: Anchor, upwards: bool, text: String },
}

/// A form in a colour.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mark {
    pub form: Form,
    pub tone: Tone,
    /// What is said of it where the pointer rests; may be empty.
    pub title: String,
}

/// Marks, first things first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Paper {
    pub width: f64,
    pub height: f64,
    pub marks: Vec<Mark>,
}

/// Lengths of dashes and of what is between them.
const DASHES: (f64, f64) = (14.0, 9.0);
/// Width over height of a letter, on average, in common fonts.
const LETTER: f64 = 0.52;

/// How wide a text is, as nearly as one can know without its font.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * size * LETTER
}

/// Places as `x,y x,y`, with a tenth of a unit. Points that fall on their neighbours are left out.
fn places(points: &[(f64, f64)]) -> String {
    let mut out = String::new();
    let mut last = String::new();
    for (k, (x, y)) in points.iter().enumerate() {
        let place = format!("{x:.1},{y:.1}");
        if place != last || (k == 1 && points.len() == 2) {
            if !out.is_empty() {
                out.push(' ');
            }
            out += &place;
        }
        last = place;
    }
    out
}

impl Paper {
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: Vec::new() }
    }

    pub fn draw(&mut self, tone: Tone, form: Form) {
        self.marks.push(Mark { form, tone, title: String::new() });
    }

    pub fn line(&mut self, tone: Tone, width: f64, points: &[(f64, f64)]) {
        self.draw(tone, Form::Line { points: points.to_vec(), width, dashed: false });
    }

    pub fn text(&mut self, tone: Tone, at: (f64, f64), size: f64, anchor: Anchor, text: &str) {
        self.draw(tone, Form::Text { at, size, anchor, upwards: false, text: text.to_owned() });
    }

    /// As one SVG element; `size` are attributes that say how large it is shown.
    pub fn svg(&self, title: &str, size: &str) -> String {
        let Self { width, height, marks } = self;
        let title = escaped(title);
        let mut out = format!(
            "<svg viewBox=\"0 0 {width:.0} {height:.0}\"{size} xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" \
             aria-label=\"{title}\" font-family=\"sans-serif\">\n<title>{title}</title>\n"
        );
        marks.iter().for_each(|mark| mark.svg(&mut out));
        out += "</svg>\n";
        out
    }

    /// As a PDF file of one page so many millimetres wide. Letters that Latin-1 does not have become question marks.
    pub fn pdf(&self, title: &str, millimetres: f64) -> Vec<u8> {
        let scale = millimetres / 25.4 * 72.0 / self.width;
        let (width, height) = (self.width * scale, self.height * scale);
        // Points from the lower left corner are what PDF counts in.
        let mut content = format!("{scale:.6} 0 0 {:.6} 0 {height:.4} cm 1 j 1 J\n", -scale);
        self.marks.iter().for_each(|mark| mark.pdf(&mut content));
        let objects = [
            "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.3} {height:.3}] /Contents 4 0 R /Resources << /Font << /F 5 0 R >> \
                 /ExtGState << /A << /ca {OPACITY} >> >> >> >>"
            ),
            format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
            "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>".to_owned(),
            format!("<< /Title {} /Producer (scrnn {}) >>", pdf_string(title), env!("CARGO_PKG_VERSION")),
        ];
        let mut out = "%PDF-1.4\n".to_owned();
        let mut offsets = Vec::new();
        for (k, object) in objects.iter().enumerate() {
            offsets.push(out.len());
            let _ = write!(out, "{} 0 obj\n{object}\nendobj\n", k + 1);
        }
        let begin = out.len();
        let count = objects.len() + 1;
        let _ = write!(out, "xref\n0 {count}\n0000000000 65535 f \n");
        for offset in offsets {
            let _ = writeln!(out, "{offset:010} 00000 n ");
        }
        let _ = write!(out, "trailer\n<< /Size {count} /Root 1 0 R /Info 6 0 R >>\nstartxref\n{begin}\n%%EOF\n");
        out.into_bytes()
    }
}

/// How much of a band's colour covers what lies below.
pub(super) const OPACITY: f64 = 0.25;

impl Mark {
    fn svg(&self, out: &mut String) {
        let colour = self.tone.hex();
        let (open, name) = match &self.form {
            Form::Line { points, width, dashed } => {
                let dashes = match dashed {
                    true => format!(" stroke-dasharray=\"{} {}\"", DASHES.0, DASHES.1),
                    false => String::new(),
                };
                let open = format!(
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" \
                     stroke-linecap=\"round\"{dashes}",
                    places(points)
                );
                (open, "polyline")
            }
            Form::Area { outline, opacity } => {
                (format!("<polygon points=\"{}\" fill=\"{colour}\" opacity=\"{opacity}\"", places(outline)), "polygon")
            }
            Form::Disc { centre: (x, y), radius } => {
                (format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{colour}\""), "circle")
            }
            Form::Text { at: (x, y), size, anchor, upwards, text } => {
                let anchor = match anchor {
                    Anchor::Start => "",
                    Anchor::Middle => " text-anchor=\"middle\"",
                    Anchor::End => " text-anchor=\"end\"",
                };
                let turn = if *upwards { format!(" transform=\"rotate(-90 {x:.1} {y:.1})\"") } else { String::new() };
                let _ = writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size:.0}\" fill=\"{colour}\"{anchor}{turn}>{}</text>",
                    escaped(text)
                );
                return;
            }
        };
        let _ = match self.title.as_str() {
            "" => writeln!(out, "{open}/>"),
            title => writeln!(out, "{open}><title>{}</title></{name}>", escaped(title)),
        };
    }

    fn pdf(&self, out: &mut String) {
        let [r, g, b] = self.tone.rgb().map(|part| f64::from(part) / 255.0);
        let colour = format!("{r:.3} {g:.3} {b:.3}");
        let path = |points: &[(f64, f64)], out: &mut String| {
            for (k, (x, y)) in points.iter().enumerate() {
                let _ = writeln!(out, "{x:.2} {y:.2} {}", if k == 0 { 'm' } else { 'l' });
            }
        };
        match &self.form {
            Form::Line { points, .. } if points.is_empty() => {}
            Form::Line { points, width, dashed } => {
                let dashes = if *dashed { format!("[{} {}]", DASHES.0, DASHES.1) } else { "[]".to_owned() };
                let _ = writeln!(out, "{colour} RG {width} w {dashes} 0 d");
                path(points, out);
                out.push_str("S\n");
            }
            Form::Area { outline, .. } if outline.is_empty() => {}
            Form::Area { outline, opacity } if *opacity != OPACITY => {
                // As it looks on white.
                let [r, g, b] = [r, g, b].map(|part| 1.0 - opacity * (1.0 - part));
                let _ = writeln!(out, "q {r:.3} {g:.3} {b:.3} rg");
                path(outline, out);
                out.push_str("f Q\n");
            }
            Form::Area { outline, .. } => {
                let _ = writeln!(out, "q /A gs {colour} rg");
                path(outline, out);
                out.push_str("f Q\n");
            }
            Form::Disc { centre: (x, y), radius } => {
                // A line of no length with round ends.
                let _ = writeln!(out, "{colour} RG {} w [] 0 d {x:.2} {y:.2} m {x:.2} {y:.2} l S", 2.0 * radius);
            }
            Form::Text { at: (x, y), size, anchor, upwards, text } => {
                let width = helvetica_width(text) * size;
                let back = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => width / 2.0,
                    Anchor::End => width,
                };
                // The page is upside down, and text is turned back.
                let (matrix, x, y) = if *upwards { ("0 -1 -1 0", *x, y + back) } else { ("1 0 0 -1", x - back, *y) };
                let _ = writeln!(
                    out,
                    "BT {colour} rg /F {size:.0} Tf {matrix} {x:.2} {y:.2} Tm {} Tj ET",
                    pdf_string(text)
                );
            }
        }
    }
}

/// A text as PDF writes it, in Latin-1 by its octal codes.
fn pdf_string(text: &str) -> String {
    let mut out = String::from("(");
    for c in printable(text).chars() {
        match c {
            '(' | ')' | '\\' => out.extend(['\\', c]),
            ' '..='~' => out.push(c),
            '\u{2013}' => out.push_str("\\226"),
            '\u{a0}'..='\u{ff}' => {
                let _ = write!(out, "\\{:03o}", u32::from(c));
            }
            _ => out.push('?'),
        }
    }
    out + ")"
}

/// Width of a text in Helvetica of size 1.
fn helvetica_width(text: &str) -> f64 {
    let of = |c: char| match c {
        'i' | 'j' | 'l' | '\'' => 0.222,
        ' ' | 'f' | 't' | 'I' | '.' | ',' | ':' | ';' | '/' | '!' | '[' | ']' | '\\' => 0.278,
        '(' | ')' | '-' | 'r' => 0.333,
        'c' | 'k' | 's' | 'v' | 'x' | 'y' | 'z' | 'J' => 0.5,
        'm' => 0.833,
        'w' | 'C' | 'D' | 'H' | 'N' | 'R' | 'U' => 0.722,
        'A' | 'B' | 'E' | 'K' | 'P' | 'S' | 'V' | 'X' | 'Y' => 0.667,
        'G' | 'O' | 'Q' => 0.778,
        'F' | 'T' | 'Z' => 0.611,
        'M' => 0.833,
        'W' => 0.944,
        _ => 0.556,
    };
    text.chars().map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pdf_says_where_each_of_its_objects_begins() {
        let mut paper = Paper::new(1000.0, 500.0);
        paper.line(Tone::Ours, 3.0, &[(0.0, 0.0), (10.0, 10.0)]);
        paper.draw(Tone::Ours, Form::Area { outline: vec![(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)], opacity: OPACITY });
        paper.draw(Tone::Data, Form::Disc { centre: (5.0, 5.0), radius: 2.0 });
        paper.text(Tone::Ink, (5.0, 5.0), 30.0, Anchor::End, "a (b) \u{e4} \u{3b1}");
        let bytes = paper.pdf("T", 85.0);
        let text = String::from_utf8(bytes).expect("the file is ASCII");
        assert!(text.starts_with("%PDF-1.4\n") && text.ends_with("%%EOF\n") && text.is_ascii());
        assert!(text.contains("(a \\(b\\) \\344 ?) Tj") && text.contains("/MediaBox [0 0 240.945 120.472]"), "{text}");
        let begin: usize = text.rsplit("startxref\n").next().unwrap().lines().next().unwrap().parse().unwrap();
        assert!(text[begin..].starts_with("xref\n0 7\n"));
        for (k, line) in text[begin..].lines().skip(3).take(6).enumerate() {
            let offset: usize = line[..10].parse().unwrap();
            assert!(text[offset..].starts_with(&format!("{} 0 obj\n", k + 1)), "{line}");
        }
        let length: usize = text.split("/Length ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        let content = text.split_once("stream\n").unwrap().1.split("endstream").next().unwrap();
        assert_eq!(content.len(), length);
    }

    #[test]
    fn points_that_fall_on_each_other_are_written_once() {
        assert_eq!(places(&[(0.0, 0.0), (0.01, 0.0), (1.0, 0.0)]), "0.0,0.0 1.0,0.0");
        // A dot of a line stays one.
        assert_eq!(places(&[(1.0, 1.0), (1.0, 1.0)]), "1.0,1.0 1.0,1.0");
    }
}
