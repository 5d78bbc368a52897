//! A page of sections, and its HTML.

use std::fmt::Write as _;

use super::chart::{Chart, on_white, themed};
use super::escape::escaped;
#[cfg(feature = "scenes")]
use super::picture::Pictures;
use super::words::is_number;

/// The page's file.
pub const PAGE: &str = "report.html";
/// Where each figure lies as SVG, and its numbers as CSV.
pub const FIGURES: &str = "figures";

const STYLE: &str = include_str!("page.css");

/// All of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// Its title.
    pub title: String,
    /// What it is, in a sentence or two.
    pub lede: String,
    /// Its sections.
    pub sections: Vec<Section>,
}

/// A part of a page under a heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// What stands in it.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// Text as it is, e.g. settings.
    Verbatim(String),
    /// A table.
    Sheet(Sheet),
    /// A figure.
    Figure(Box<Figure>),
    /// Links to files beside the page: texts with their paths.
    Links(Vec<(String, String)>),
    /// What it all comes to, in a line that stands out.
    Verdict(String),
    /// Something to play with.
    Applet(Box<Applet>),
}

/// A part of a page that a script brings to life. Its data stand in the page, and nothing is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Applet {
    /// Unique in the page. The data are the text of the element `NAME-data`.
    pub name: String,
    /// What it is, in a few words.
    pub title: String,
    /// What to do with it and what to see.
    pub caption: String,
    /// Its elements, as HTML that is taken as it is.
    pub body: String,
    /// Its own style.
    pub style: &'static str,
    /// What brings it to life.
    pub script: &'static str,
    /// What the script reads, as JSON.
    pub data: String,
}

/// A table. Columns of numbers stand to the right; the words "met" and "missed" are coloured.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// Stands above it.
    pub caption: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
    /// Stands below it; may be empty.
    pub note: String,
}

/// What a figure shows.
#[derive(Debug, Clone, PartialEq)]
pub enum Drawing {
    /// Numbers.
    Chart(Chart),
    /// Scenes.
    #[cfg(feature = "scenes")]
    Pictures(Pictures),
}

impl From<Chart> for Drawing {
    fn from(chart: Chart) -> Self {
        Self::Chart(chart)
    }
}

#[cfg(feature = "scenes")]
impl From<Pictures> for Drawing {
    fn from(pictures: Pictures) -> Self {
        Self::Pictures(pictures)
    }
}

impl Drawing {
    fn svg(&self, title: &str) -> String {
        match self {
            Self::Chart(chart) => chart.svg(title),
            #[cfg(feature = "scenes")]
            Self::Pictures(pictures) => pictures.svg(title),
        }
    }
}

/// A drawing with its words.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of its files, without extension.
    pub file: String,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// What the thesis' figure shows; may be empty.
    pub thesis: String,
    /// The drawing.
    pub drawing: Drawing,
}

impl Page {
    /// The page as files: paths relative to its folder, and their texts. The page itself is the last, so that whoever writes
    /// them in this order never leaves a page without its figures.
    pub fn files(&self) -> impl Iterator<Item = (String, String)> {
        let figures = self.figures().flat_map(|figure| {
            let place = |ending: &str| format!("{FIGURES}/{}.{ending}", figure.file);
            [(place("svg"), figure.file_svg()), (place("csv"), figure.csv())]
        });
        figures.chain(std::iter::once_with(|| (PAGE.to_owned(), self.html())))
    }

    /// All figures.
    pub fn figures(&self) -> impl Iterator<Item = &Figure> {
        self.sections.iter().flat_map(|section| &section.blocks).filter_map(|block| match block {
            Block::Figure(figure) => Some(&**figure),
            _ => None,
        })
    }

    /// The page as HTML that may ask the server it came from, and nobody else, for more.
    #[must_use]
    pub fn live_html(&self) -> String {
        self.html().replacen("img-src data:\">", "img-src data:; connect-src 'self'\">", 1)
    }

    /// The page as HTML.
    pub fn html(&self) -> String {
        let mut out = String::new();
        let (title, lede) = (escaped(&self.title), escaped(&self.lede));
        let blocks = || self.sections.iter().flat_map(|section| &section.blocks);
        let scripts =
            if blocks().any(|block| matches!(block, Block::Applet(_))) { "'unsafe-inline'" } else { "'none'" };
        write!(
            out,
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
             script-src {scripts}; img-src data:\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n\
             <p class=\"lede\">{lede}</p>\n</header>\n<nav aria-label=\"Sections\">"
        )
        .expect("a string takes all");
        for (k, section) in self.sections.iter().enumerate() {
            out += &format!("<a href=\"#s{k}\">{}</a>", escaped(&section.title));
        }
        out += "</nav>\n<main>\n";
        for (k, section) in self.sections.iter().enumerate() {
            out += &format!("<section aria-labelledby=\"s{k}\">\n<h2 id=\"s{k}\">{}</h2>\n", escaped(&section.title));
            section.blocks.iter().for_each(|block| block.html(&mut out));
            out += "</section>\n";
        }
        out += "</main>\n</body>\n</html>\n";
        out
    }
}

impl Block {
    fn html(&self, out: &mut String) {
        match self {
            Self::Text(text) => *out += &format!("<p>{}</p>\n", escaped(text)),
            Self::Verbatim(text) => *out += &format!("<pre>{}</pre>\n", escaped(text)),
            Self::Sheet(sheet) => sheet.html(out),
            Self::Figure(figure) => figure.html(out),
            Self::Links(links) => {
                let link = |(text, path): &(String, String)| {
                    format!("<a href=\"{}\">{}</a>\n", escaped(&address(path)), escaped(text))
                };
                *out += &format!("<p class=\"links\">\n{}</p>\n", links.iter().map(link).collect::<String>());
            }
            Self::Verdict(text) => *out += &format!("<p class=\"verdict\">{}</p>\n", escaped(text)),
            Self::Applet(applet) => applet.html(out),
        }
    }
}

/// A path as an address that starts from the page: what would mean something else in it is written by its bytes.
fn address(path: &str) -> String {
    let mut out = "./".to_owned();
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' | b'=' | b',' | b'+' => {
                out.push(char::from(byte))
            }
            byte => out += &format!("%{byte:02X}"),
        }
    }
    out
}

impl Applet {
    fn html(&self, out: &mut String) {
        let Self { title, caption, body, style, script, data, .. } = self;
        let (name, title, caption) = (escaped(&self.name), escaped(title), escaped(caption));
        // In a script's element only its own end tag ends it; in JSON these letters stand in texts alone.
        let data = data.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
        *out += &format!(
            "<div id=\"{name}\" class=\"applet\" role=\"group\" aria-label=\"{title}\">\n<style>\n{style}</style>\n{body}\n\
             <p class=\"words\"><b>{title}</b>{caption}</p>\n<script type=\"application/json\" id=\"{name}-data\">{data}</script>\n\
             <script>\n{script}</script>\n</div>\n"
        );
    }
}

impl Sheet {
    fn html(&self, out: &mut String) {
        let short = if self.rows.len() <= 14 { " short" } else { "" };
        // A column of numbers stands to the right.
        let numbers = |column: usize| self.rows.iter().all(|row| row.get(column).is_some_and(|cell| is_number(cell)));
        *out += &format!(
            "<div class=\"sheet{short}\" role=\"region\" aria-label=\"{0}\" tabindex=\"0\"><table>\n<caption>{0}</caption>\n",
            escaped(&self.caption)
        );
        if !self.head.is_empty() {
            *out += "<thead><tr>";
            for (column, cell) in self.head.iter().enumerate() {
                let class = if numbers(column) { " class=\"n\"" } else { "" };
                *out += &format!("<th scope=\"col\"{class}>{}</th>", escaped(cell));
            }
            *out += "</tr></thead>\n";
        }
        *out += "<tbody>\n";
        for row in &self.rows {
            *out += "<tr>";
            for (column, cell) in row.iter().enumerate() {
                let class = match cell.as_str() {
                    "met" => " class=\"passed\"",
                    "missed" => " class=\"failed\"",
                    _ if numbers(column) => " class=\"n\"",
                    _ => "",
                };
                *out += &format!("<td{class}>{}</td>", escaped(cell));
            }
            *out += "</tr>\n";
        }
        *out += "</tbody></table></div>\n";
        if !self.note.is_empty() {
            *out += &format!("<p class=\"note\">{}</p>\n", escaped(&self.note));
        }
    }
}

impl Figure {
    /// The drawing as an SVG element whose colours follow the page's theme.
    fn inline_svg(&self) -> String {
        themed(self.drawing.svg(&self.title))
    }

    /// The drawing as a file of its own, in light colours on white.
    pub fn file_svg(&self) -> String {
        on_white(&self.drawing.svg(&self.title))
    }

    /// As an SVG file so many millimetres wide, with text in the size of print.
    #[must_use]
    pub fn svg_in_print(&self, millimetres: f64) -> String {
        match &self.drawing {
            Drawing::Chart(chart) => chart.svg_in_print(&self.title, millimetres),
            #[cfg(feature = "scenes")]
            Drawing::Pictures(_) => self.file_svg().replacen("<svg ", &format!("<svg width=\"{millimetres}mm\" "), 1),
        }
    }

    /// As a PDF file so many millimetres wide, with text in the size of print; none of pictures of scenes.
    #[must_use]
    pub fn pdf(&self, millimetres: f64) -> Option<Vec<u8>> {
        match &self.drawing {
            Drawing::Chart(chart) => Some(chart.pdf(&self.title, millimetres)),
            #[cfg(feature = "scenes")]
            Drawing::Pictures(_) => None,
        }
    }

    /// Whether there is so much side by side that a phone had better show a part of it.
    fn is_wide(&self) -> bool {
        match &self.drawing {
            Drawing::Chart(chart) => chart.columns > 2,
            #[cfg(feature = "scenes")]
            Drawing::Pictures(pictures) => pictures.columns > 2,
        }
    }

    /// The numbers that it is drawn from.
    pub fn csv(&self) -> String {
        match &self.drawing {
            Drawing::Chart(chart) => chart.csv(),
            #[cfg(feature = "scenes")]
            Drawing::Pictures(pictures) => pictures.csv(),
        }
    }

    fn html(&self, out: &mut String) {
        let Self { file, title, caption, thesis, .. } = self;
        let name = escaped(file);
        let many = if self.is_wide() { " many" } else { "" };
        *out += &format!("<figure id=\"{name}\">\n<div class=\"plot{many}\">\n{}</div>\n", self.inline_svg());
        *out += &format!("<figcaption><b>{}</b>{}", escaped(title), escaped(caption));
        if !thesis.is_empty() {
            *out += &format!("<span class=\"thesis\">Thesis: {}</span>", escaped(thesis));
        }
        let folder = super::FIGURES;
        *out += &format!("<span class=\"files\">{folder}/{0}.svg, {folder}/{0}.csv</span>", escaped(file));
        *out += "</figcaption>\n</figure>\n";
    }
}

#[cfg(test)]
mod tests {
    use super::super::chart::{Panel, Series, Tone};
    use super::*;

    #[test]
    fn a_page_stands_on_its_own() {
        let series = vec![Series::line("", Tone::Ours, vec![(0.0, 1.0), (1.0, 2.0)])];
        let panels = vec![Panel::spanning("p", series)];
        let chart = Chart { columns: 1, aspect: 2.0, x_label: "t".into(), y_label: String::new(), panels };
        let figure = Figure {
            file: "wave".into(),
            title: "A <wave>".into(),
            caption: "Read it.".into(),
            thesis: "Fig. 1".into(),
            drawing: chart.into(),
        };
        let sheet = Sheet {
            caption: "T".into(),
            head: vec!["a".into()],
            rows: vec![vec!["1.5".into(), "met".into(), "0.1 \u{b1} 0.2".into()]],
            note: String::new(),
        };
        let blocks = vec![
            Block::Text("x < y".into()),
            Block::Verbatim("a = 1".into()),
            Block::Sheet(sheet),
            Block::Figure(Box::new(figure)),
            Block::Links(vec![
                ("a <run>".into(), "x=1,y z/seed-1/report.html".into()),
                ("b".into(), "javascript:alert(1)".into()),
            ]),
        ];
        let sections = vec![Section { title: "One & two".into(), blocks }];
        let page = Page { title: "P".into(), lede: "L".into(), sections };
        let html = page.html();
        for part in [
            "<title>A &lt;wave&gt;</title>",
            "x &lt; y",
            "One &amp; two",
            "<td class=\"n\">1.5</td><td class=\"passed\">met</td><td class=\"n\">0.1",
            "Thesis: Fig. 1",
            "<a href=\"./x=1,y%20z/seed-1/report.html\">a &lt;run&gt;</a>",
            "<a href=\"./javascript%3Aalert%281%29\">b</a>",
            "prefers-color-scheme:dark",
        ] {
            assert!(html.contains(part), "{part} is missing in\n{html}");
        }
        assert!(html.contains("script-src 'none'"));
        let beyond = html.replace("http://www.w3.org/2000/svg", "");
        for part in ["://", "<script", "@import", "url(", "src="] {
            assert!(!beyond.contains(part), "{part}");
        }
        assert_eq!(page.figures().count(), 1);
    }

    #[test]
    fn what_an_applet_reads_cannot_end_its_element() {
        let applet = Applet {
            name: "play".into(),
            title: "A & b".into(),
            caption: "Drag.".into(),
            body: "<canvas></canvas>".into(),
            style: "",
            script: "1;\n",
            data: "{\"name\":\"</script><img src=x>\"}".into(),
        };
        let blocks = vec![Block::Verdict("It is > 0".into()), Block::Applet(Box::new(applet))];
        let sections = vec![Section { title: "S".into(), blocks }];
        let html = Page { title: "P".into(), lede: "L".into(), sections }.html();
        assert!(html.contains("script-src 'unsafe-inline'") && html.contains("default-src 'none'"));
        assert!(html.contains("<p class=\"verdict\">It is &gt; 0</p>") && !html.contains("<img"), "{html}");
        assert!(html.contains("{\"name\":\"\\u003c/script>") && html.matches("</script>").count() == 2, "{html}");
    }
}
