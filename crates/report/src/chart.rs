//! A chart of one or more panels: what is drawn, and how it becomes SVG and CSV.
//!
//! Colours are tones with a meaning. In a page they follow the reader's light or dark theme; in a file of its own a chart
//! has the light ones on white. Text is text, in whatever sans-serif font the reader has.

use std::fmt::Write as _;

use super::axis::Axis;
use super::paper::{Anchor, Form, OPACITY, Paper, text_width};

/// What a colour stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Text and axes.
    Ink,
    /// Lines to measure by.
    Grid,
    /// What the network gives.
    Ours,
    /// What is true or recorded; its lines are dashed.
    Truth,
    /// What was learned from.
    Data,
    /// Failure.
    Failed,
    /// Groups, e.g. levels of noise, from 0.
    Level(usize),
}

/// Name of the theme's variable, and the colour in the light theme. No two are the same.
const TONES: [(&str, [u8; 3]); 10] = [
    ("ink", [0x22, 0x26, 0x2B]),
    ("grid", [0xDD, 0xE0, 0xE4]),
    ("ours", [0x00, 0x62, 0xB1]),
    ("truth", [0xC4, 0x45, 0x00]),
    ("data", [0x6B, 0x72, 0x7B]),
    ("failed", [0xC8, 0x00, 0x2E]),
    ("level-0", [0x00, 0x5A, 0xA7]),
    ("level-1", [0x00, 0x8A, 0x63]),
    ("level-2", [0xB0, 0x72, 0x00]),
    ("level-3", [0xA8, 0x2C, 0x7C]),
];

impl Tone {
    fn entry(self) -> (&'static str, [u8; 3]) {
        let index = match self {
            Self::Ink => 0,
            Self::Grid => 1,
            Self::Ours => 2,
            Self::Truth => 3,
            Self::Data => 4,
            Self::Failed => 5,
            Self::Level(level) => 6 + level % 4,
        };
        TONES[index]
    }

    /// The colour in the light theme.
    pub(super) fn rgb(self) -> [u8; 3] {
        self.entry().1
    }

    /// The colour in the light theme, as SVG writes it.
    pub(super) fn hex(self) -> String {
        hex(self.rgb())
    }
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// A drawing in light colours, in those of the page's theme.
pub(super) fn themed(mut svg: String) -> String {
    for (name, colour) in TONES {
        let hex = hex(colour);
        svg = svg.replace(&format!("\"{hex}\""), &format!("\"var(--{name},{hex})\""));
    }
    svg
}

/// A drawing in light colours, on white.
pub(super) fn on_white(svg: &str) -> String {
    let end = svg.find("</title>").map_or(0, |at| at + "</title>\n".len());
    let (head, rest) = svg.split_at(end);
    format!("{head}<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n{rest}")
}

/// A text as a field of a CSV file.
pub(super) fn csv_field(text: &str) -> String {
    // A spreadsheet would take these for formulas, and run what they say.
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text != "-" && !super::words::is_number(text);
    let formula = if formula { "'" } else { "" };
    let text = &format!("{formula}{}", super::escape::printable(text));
    match text.contains([',', '"', '\n', '\'', '\t', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// How points are drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A line through them.
    Line,
    /// A dot at each.
    Dots,
    /// A dot at each, with a text beside it where there is room, and in any case where the pointer rests on it.
    Named(Vec<String>),
    /// All between a line through them, from below, and one through these values, from above.
    Band(Vec<f64>),
    /// A text at each, and nothing else.
    Texts(Vec<String>),
    /// A square around each, one unit wide and high, filled as strongly as said (0 to 1), with a text in it. Axes then have no numbers.
    Cells(Vec<(f64, String)>),
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// For the legend and the CSV.
    pub name: String,
    /// Its colour.
    pub tone: Tone,
    /// How it is drawn.
    pub mark: Mark,
    /// x and y. Points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// A line.
    pub fn line(name: impl Into<String>, tone: Tone, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), tone, mark: Mark::Line, points }
    }

    /// Dots.
    pub fn dots(name: impl Into<String>, tone: Tone, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), tone, mark: Mark::Dots, points }
    }

    /// A band of what lies between two values at each place: x, from, to.
    pub fn band(name: impl Into<String>, tone: Tone, places: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        let (points, tops) = places.into_iter().map(|(x, low, high)| ((x, low), high)).unzip();
        Self { name: name.into(), tone, mark: Mark::Band(tops), points }
    }

    /// The upper ends of a band.
    fn tops(&self) -> Vec<(f64, f64)> {
        match &self.mark {
            Mark::Band(tops) => self.points.iter().zip(tops).map(|(&(x, _), &top)| (x, top)).collect(),
            _ => Vec::new(),
        }
    }
}

/// One pair of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Stands above it.
    pub title: String,
    /// From and to; what lies outside is drawn at the edge.
    pub x: (f64, f64),
    /// From and to.
    pub y: (f64, f64),
    /// What is drawn, first things first.
    pub series: Vec<Series>,
    /// Whether a large cross says that this failed.
    pub failed: bool,
    /// Whether a step across is drawn as long as a step up, as for places in a plane.
    pub equal: bool,
}

impl Panel {
    /// A panel whose axes span all that is drawn.
    pub fn spanning(title: impl Into<String>, series: Vec<Series>) -> Self {
        let range = |of: &dyn Fn(&(f64, f64)) -> f64| {
            let tops = series.iter().flat_map(Series::tops);
            let points = series.iter().flat_map(|series| &series.points).copied();
            let values = points.chain(tops).map(|point| of(&point)).filter(|value| value.is_finite());
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
            match high - low {
                span if span > 0.0 => (low - 0.04 * span, high + 0.04 * span),
                _ if low.is_finite() => (low - 0.5, high + 0.5),
                _ => (0.0, 1.0),
            }
        };
        let (x, y) = (range(&|point| point.0), range(&|point| point.1));
        Self { title: title.into(), x, y, series, failed: false, equal: false }
    }

    /// The same with its vertical axis from 0.
    pub fn with_zero(mut self) -> Self {
        self.y.0 = 0.0;
        self
    }
}

/// Panels in rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Panels in a row.
    pub columns: usize,
    /// Width over height of a panel.
    pub aspect: f64,
    /// Under each panel of the last row; may be empty.
    pub x_label: String,
    /// Beside the first panel of each row; may be empty.
    pub y_label: String,
    /// The panels.
    pub panels: Vec<Panel>,
}

/// A name in the legend, and where it stands.
struct Entry<'a> {
    series: &'a Series,
    x: f64,
    y: f64,
}

/// Width of all charts of a page in the SVG's own units: two for each of the page's.
pub(super) const WIDTH: u32 = 1360;
/// Height of text: readable where a phone shows the chart at a quarter of its size.
pub(super) const TEXT: f64 = 34.0;
/// Height of text in print, in millimetres: 7.5 points.
const TEXT_IN_PRINT: f64 = 2.65;
const LEGEND_ROW: f64 = 52.0;
/// Points of a panel that can have labels.
const LABELLED: usize = 300;

/// Where a point of a panel lies on the paper.
type Placing<'a> = &'a dyn Fn((f64, f64)) -> (f64, f64);

/// What all panels of a chart have in common.
struct Layout {
    /// Of tick labels and titles.
    size: f64,
    top: f64,
    /// Left of the first column, and of others.
    left: (f64, f64),
    right: f64,
    /// Below the last row, and below others.
    bottom: (f64, f64),
    plot: (f64, f64),
    legend: f64,
    /// Whether all panels have the same numbers across, and up.
    shared: (bool, bool),
    ticks: (usize, usize),
}

impl Chart {
    /// All points: panel, series, x, y.
    pub(super) fn csv(&self) -> String {
        let mut text = "panel,series,x,y\n".to_owned();
        for panel in &self.panels {
            let mut rows = |name: &str, points: &mut dyn Iterator<Item = (f64, f64)>| {
                for (x, y) in points {
                    let (panel, name) = (csv_field(&panel.title), csv_field(name));
                    writeln!(text, "{panel},{name},{x:?},{y:?}").expect("a string takes all");
                }
            };
            for Series { name, mark, points, .. } in &panel.series {
                match mark {
                    Mark::Named(texts) | Mark::Texts(texts) => {
                        for (&point, text) in points.iter().zip(texts) {
                            rows(&format!("{name} {text}"), &mut std::iter::once(point));
                        }
                    }
                    Mark::Cells(cells) => {
                        for (&point, (_, text)) in points.iter().zip(cells) {
                            rows(&format!("{name} {text}"), &mut std::iter::once(point));
                        }
                    }
                    Mark::Band(tops) => {
                        rows(&format!("{name}, from"), &mut points.iter().copied());
                        let tops = points.iter().zip(tops).map(|(&(x, _), &top)| (x, top));
                        rows(&format!("{name}, to"), &mut tops.into_iter());
                    }
                    Mark::Line | Mark::Dots => rows(name, &mut points.iter().copied()),
                }
            }
        }
        text
    }

    /// The chart as an SVG element in light colours, with `title` for those who cannot see it.
    pub(super) fn svg(&self, title: &str) -> String {
        self.paper(f64::from(WIDTH)).svg(title, "")
    }

    /// As an SVG file so many millimetres wide, its text in the size of print.
    pub(super) fn svg_in_print(&self, title: &str, millimetres: f64) -> String {
        let paper = self.in_print(millimetres);
        let height = millimetres * paper.height / paper.width;
        on_white(&paper.svg(title, &format!(" width=\"{millimetres}mm\" height=\"{height:.2}mm\"")))
    }

    /// As a PDF file so many millimetres wide, its text in the size of print.
    pub(super) fn pdf(&self, title: &str, millimetres: f64) -> Vec<u8> {
        self.in_print(millimetres).pdf(title, millimetres)
    }

    fn in_print(&self, millimetres: f64) -> Paper {
        self.paper(millimetres * TEXT / TEXT_IN_PRINT)
    }

    fn small(&self) -> bool {
        self.columns > 2
    }

    fn rows(&self) -> usize {
        self.panels.len().div_ceil(self.columns.max(1))
    }

    /// Names and tones of the series, each name once, in rows, and how high they are. A single one needs no legend.
    fn legend(&self, width: f64) -> (Vec<Entry<'_>>, f64) {
        let mut entries: Vec<Entry<'_>> = Vec::new();
        let (mut x, mut y) = (16.0, 0.0);
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if series.name.is_empty() || entries.iter().any(|entry| entry.series.name == series.name) {
                continue;
            }
            let own = 68.0 + text_width(&series.name, TEXT);
            if x > 16.0 && x + own > width {
                (x, y) = (16.0, y + LEGEND_ROW);
            }
            entries.push(Entry { series, x, y });
            x += own + 36.0;
        }
        if entries.len() > 1 { (entries, y + LEGEND_ROW) } else { (Vec::new(), 8.0) }
    }

    fn layout(&self, width: f64) -> Layout {
        let size = TEXT
            * match self.columns {
                0..=2 => 1.0,
                3..=6 => 0.8,
                _ => 0.62,
            };
        let same = |of: &dyn Fn(&Panel) -> (f64, f64)| {
            let mut ranges = self.panels.iter().map(|panel| Axis::of(of(panel)));
            let first = ranges.next();
            self.small() && ranges.all(|range| Some(range) == first)
        };
        let shared = (same(&|panel| panel.x), same(&|panel| panel.y));
        // How many ticks there will be depends on the room that their labels leave.
        let widest = |of: &dyn Fn(&Panel) -> (f64, f64), most: usize| {
            let of = |panel: &Panel| {
                let axis = Axis::of(of(panel));
                let labels =
                    (2..=most).flat_map(|most| axis.ticks(most).into_iter().map(move |tick| axis.shown(tick, most)));
                labels.map(|label| text_width(&label, size)).fold(0.0, f64::max)
            };
            self.panels.iter().map(of).fold(0.0, f64::max)
        };
        let labels = 14.0 + widest(&|panel| panel.y, 6);
        let y_label = if self.y_label.is_empty() { 0.0 } else { 1.35 * size };
        let narrow = if self.columns > 6 { 4.0 } else { 10.0 };
        let left = (labels + y_label, if shared.1 { narrow } else { labels });
        let right = (0.5 * widest(&|panel| panel.x, 8)).max(narrow);
        let titled = self.panels.iter().any(|panel| !panel.title.is_empty());
        let top = if titled { 1.5 * size } else { 0.6 * size };
        let x_label = if self.x_label.is_empty() { 0.0 } else { 1.3 * size };
        let numbers = 1.5 * size;
        let bottom = (numbers + x_label + 8.0, if shared.0 { narrow } else { numbers + 8.0 });
        let columns = self.columns.max(1) as f64;
        let across = (width - left.0 - (columns - 1.0) * left.1 - columns * right).max(40.0 * columns) / columns;
        let up = across / self.aspect.max(0.05);
        let ticks = (((across / (4.2 * size)) as usize).clamp(2, 8), ((up / (2.0 * size)) as usize).clamp(2, 6));
        Layout { size, top, left, right, bottom, plot: (across, up), legend: self.legend(width).1, shared, ticks }
    }

    /// The chart on paper so wide.
    fn paper(&self, width: f64) -> Paper {
        let layout = self.layout(width);
        let rows = self.rows();
        let row = layout.top + layout.plot.1;
        let below = if rows == 0 { 0.0 } else { layout.bottom.0 + layout.bottom.1 * (rows - 1) as f64 };
        let mut paper = Paper::new(width, layout.legend + row * rows as f64 + below);
        for Entry { series, x, y } in self.legend(width).0 {
            let middle = y + 0.48 * LEGEND_ROW;
            match series.mark {
                Mark::Line => paper.draw(series.tone, series.line_form(vec![(x, middle), (x + 56.0, middle)], 5.0)),
                Mark::Band(_) => {
                    let (top, bottom) = (middle - 14.0, middle + 14.0);
                    let outline = vec![(x, top), (x + 56.0, top), (x + 56.0, bottom), (x, bottom)];
                    paper.draw(series.tone, Form::Area { outline, opacity: OPACITY });
                }
                _ => paper.draw(series.tone, Form::Disc { centre: (x + 40.0, middle), radius: 9.0 }),
            }
            paper.text(Tone::Ink, (x + 68.0, middle + 0.34 * TEXT), TEXT, Anchor::Start, &series.name);
        }
        for (index, panel) in self.panels.iter().enumerate() {
            let (column, row_index) = (index % self.columns.max(1), index / self.columns.max(1));
            let left = layout.left.0 + column as f64 * (layout.plot.0 + layout.right + layout.left.1);
            let top = layout.legend + layout.top + row_index as f64 * (row + layout.bottom.1);
            self.draw_panel(&mut paper, panel, &layout, (left, top), index);
        }
        paper
    }

    fn draw_panel(&self, paper: &mut Paper, panel: &Panel, layout: &Layout, (left, top): (f64, f64), index: usize) {
        let Layout { size, plot: (across, up), .. } = *layout;
        let (first, last) = (index.is_multiple_of(self.columns.max(1)), index + self.columns >= self.panels.len());
        let (mut x, mut y) = (Axis::of(panel.x), Axis::of(panel.y));
        if panel.equal {
            let (per_x, per_y) = (across / x.span(), up / y.span());
            if per_x > per_y { x = x.longer(per_x / per_y) } else { y = y.longer(per_y / per_x) }
        }
        let bottom = top + up;
        let at = |(a, b): (f64, f64)| (left + across * x.share(a), bottom - up * y.share(b));
        if !panel.title.is_empty() {
            let room = across + layout.right;
            let shown = fitting(&panel.title, room, size);
            paper.text(Tone::Ink, (left, top - 0.4 * size), shown.1, Anchor::Start, &shown.0);
            if let Some(mark) = paper.marks.last_mut() {
                mark.title.clone_from(&panel.title);
            }
        }
        if panel.series.is_empty() && !panel.failed {
            return;
        }
        let in_cells = panel.series.iter().any(|series| matches!(series.mark, Mark::Cells(_)));
        let ticks = if in_cells { (0, 0) } else { layout.ticks };
        let of = |axis: &Axis, count: usize| if count == 0 { Vec::new() } else { axis.ticks(count) };
        for tick in of(&x, ticks.0) {
            let (place, _) = at((tick, y.low));
            paper.line(Tone::Grid, 1.5, &[(place, top), (place, bottom)]);
            if last || !layout.shared.0 {
                let below = (place, bottom + 1.15 * size);
                paper.text(Tone::Ink, below, 0.92 * size, Anchor::Middle, &x.shown(tick, layout.ticks.0));
            }
        }
        for tick in of(&y, ticks.1) {
            let (_, place) = at((x.low, tick));
            paper.line(Tone::Grid, 1.5, &[(left, place), (left + across, place)]);
            if first || !layout.shared.1 {
                let beside = (left - 10.0, place + 0.33 * size);
                paper.text(Tone::Ink, beside, 0.92 * size, Anchor::End, &y.shown(tick, layout.ticks.1));
            }
        }
        if !in_cells {
            paper.line(Tone::Data, 1.5, &[(left, top), (left, bottom), (left + across, bottom)]);
        }
        if last && !self.x_label.is_empty() {
            let below = (left + 0.5 * across, bottom + 2.45 * size);
            paper.text(Tone::Ink, below, size, Anchor::Middle, &self.x_label);
        }
        if first && !self.y_label.is_empty() {
            let (text, size) = fitting(&self.y_label, up + layout.top, size);
            let beside = (0.9 * size, top + 0.5 * up);
            paper.draw(Tone::Ink, Form::Text { at: beside, size, anchor: Anchor::Middle, upwards: true, text });
        }
        for series in &panel.series {
            let points = series.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).map(|&point| at(point));
            match &series.mark {
                Mark::Line => {
                    let width = if self.small() { 2.0 } else { 3.0 };
                    paper.draw(series.tone, series.line_form(points.collect(), width));
                }
                Mark::Dots => {
                    let radius = if self.small() { 3.0 } else { 5.0 };
                    points.for_each(|centre| paper.draw(series.tone, Form::Disc { centre, radius }));
                }
                Mark::Band(tops) => {
                    let whole = series.points.iter().zip(tops);
                    let whole = whole.filter(|((x, y), top)| x.is_finite() && y.is_finite() && top.is_finite());
                    let (low, high): (Vec<_>, Vec<_>) = whole.map(|(&(x, y), &top)| (at((x, y)), at((x, top)))).unzip();
                    let outline: Vec<(f64, f64)> = low.into_iter().chain(high.into_iter().rev()).collect();
                    paper.draw(series.tone, Form::Area { outline, opacity: OPACITY });
                }
                Mark::Cells(cells) => {
                    for (&(a, b), (strength, text)) in series.points.iter().zip(cells) {
                        let corner = |(dx, dy): (f64, f64)| at((a + dx, b + dy));
                        let outline = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(corner).to_vec();
                        // Text has to stay readable on it, in both themes.
                        let opacity = 0.05 + 0.5 * strength.clamp(0.0, 1.0);
                        paper.draw(series.tone, Form::Area { outline, opacity });
                        let (x, y) = at((a, b));
                        paper.text(Tone::Ink, (x, y + 0.33 * size), 0.92 * size, Anchor::Middle, text);
                    }
                }
                Mark::Texts(texts) => {
                    for ((x, y), text) in points.zip(texts) {
                        paper.text(series.tone, (x, y + 0.33 * size), 0.92 * size, Anchor::Middle, text);
                    }
                }
                Mark::Named(_) => {}
            }
        }
        self.draw_named(paper, panel, (size, &at), (left, top, left + across, bottom));
        if panel.failed {
            for (from, to) in [(top, bottom), (bottom, top)] {
                paper.line(Tone::Failed, 4.0, &[(left, from), (left + across, to)]);
            }
        }
    }

    /// Dots with names. A name is written where it covers neither another name nor a dot.
    fn draw_named(
        &self,
        paper: &mut Paper,
        panel: &Panel,
        (size, at): (f64, Placing<'_>),
        (left, top, right, bottom): (f64, f64, f64, f64),
    ) {
        let radius = if self.small() { 5.0 } else { 8.0 };
        let mut named = Vec::new();
        for series in &panel.series {
            let Mark::Named(names) = &series.mark else { continue };
            for (&point, name) in series.points.iter().zip(names) {
                if point.0.is_finite() && point.1.is_finite() {
                    let centre = at(point);
                    paper.draw(series.tone, Form::Disc { centre, radius });
                    if let Some(mark) = paper.marks.last_mut() {
                        mark.title.clone_from(name);
                    }
                    named.push((centre, name, series.tone));
                }
            }
        }
        if named.len() > LABELLED {
            return;
        }
        // Corners of what is covered: left, top, right, bottom.
        let around = |((x, y), ..): &((f64, f64), &String, Tone)| (x - radius, y - radius, x + radius, y + radius);
        let mut covered: Vec<(f64, f64, f64, f64)> = named.iter().map(around).collect();
        let size = 0.8 * size;
        for ((x, y), name, tone) in named {
            let (width, height, gap) = (text_width(name, size), 0.8 * size, radius + 4.0);
            let corners = [
                (x + gap, y - 0.5 * height),
                (x - gap - width, y - 0.5 * height),
                (x - 0.5 * width, y - gap - height),
                (x - 0.5 * width, y + gap),
                (x + 0.7 * gap, y - 0.7 * gap - height),
                (x - 0.7 * gap - width, y + 0.7 * gap),
            ];
            let free = |&(a, b): &(f64, f64)| {
                let own = (a, b, a + width, b + height);
                let inside = own.0 >= left && own.1 >= top && own.2 <= right && own.3 <= bottom;
                let apart = |other: &(f64, f64, f64, f64)| {
                    own.2 < other.0 || other.2 < own.0 || own.3 < other.1 || other.3 < own.1
                };
                inside && covered.iter().all(apart)
            };
            if let Some((a, b)) = corners.into_iter().find(free) {
                covered.push((a, b, a + width, b + height));
                paper.text(tone, (a, b + 0.92 * height), size, Anchor::Start, name);
            }
        }
    }
}

impl Series {
    fn line_form(&self, points: Vec<(f64, f64)>, width: f64) -> Form {
        // Truth is dashed, and so is what has the same colour as another.
        let dashed = match self.tone {
            Tone::Truth => true,
            Tone::Level(level) => level % 8 >= 4,
            _ => false,
        };
        Form::Line { points, width, dashed }
    }
}

/// A text that fits into so much room, and its size: smaller where it has to be, and cut if that does not help.
fn fitting(text: &str, room: f64, size: f64) -> (String, f64) {
    let wide = text_width(text, size);
    if wide <= room {
        return (text.to_owned(), size);
    }
    let size = size * (room / wide).max(0.78);
    let letters = (room / text_width("x", size)) as usize;
    match text.chars().count() > letters {
        true => (text.chars().take(letters.saturating_sub(2)).chain("..".chars()).collect(), size),
        false => (text.to_owned(), size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let wave = (0..50).map(|k| (f64::from(k), (0.3 * f64::from(k)).sin())).collect::<Vec<_>>();
        let panel = |title: &str, failed| Panel {
            failed,
            ..Panel::spanning(
                title,
                vec![
                    Series::line("output", Tone::Ours, wave.clone()),
                    Series::line("truth", Tone::Truth, vec![(0.0, f64::NAN), (1.0, 0.5), (49.0, 9.0)]),
                ],
            )
        };
        let panels = vec![panel("a, b", false), panel("c", true)];
        Chart { columns: 2, aspect: 1.5, x_label: "step".into(), y_label: "y".into(), panels }
    }

    #[test]
    fn names_are_no_formulas_and_no_control_characters() {
        for (name, field) in [
            ("=cmd|'/c calc'!A1", "\"'=cmd|'/c calc'!A1\""),
            ("@SUM(1)", "\"'@SUM(1)\""),
            ("-0.5", "-0.5"),
            ("-1+cmd", "\"'-1+cmd\""),
            ("-", "-"),
            ("plain", "plain"),
            ("a\u{1b}[31m", "a\\u{1b}[31m"),
        ] {
            assert_eq!(csv_field(name), field);
        }
        let mut evil = chart();
        evil.panels[0].title = "a\u{1b}]0;pwn\u{7}\u{fffe}".to_owned();
        let svg = evil.svg("b\u{1b}");
        assert!(svg.contains("a\\u{1b}]0;pwn\\u{7}\\u{fffe}") && svg.contains("<title>b\\u{1b}</title>"), "{svg}");
    }

    #[test]
    fn a_chart_has_a_title_text_and_colours_of_the_theme() {
        let svg = themed(chart().svg("Waves & more"));
        assert!(svg.starts_with("<svg viewBox=") && svg.trim_end().ends_with("</svg>"), "{svg}");
        for part in [
            "<title>Waves &amp; more</title>",
            "<text",
            "var(--ours,#0062B1)",
            "var(--failed,",
            "dasharray",
            "sans-serif",
        ] {
            assert!(svg.contains(part), "{part} is missing in\n{svg}");
        }
        assert!(!svg.contains("NaN"));
        // Every colour is one of the theme.
        assert!(!svg.contains("\"#"), "{svg}");
    }

    #[test]
    fn a_file_is_light_on_white_and_names_no_variable() {
        let svg = on_white(&chart().svg("x"));
        assert!(svg.contains("fill=\"#FFFFFF\"") && !svg.contains("var("));
    }

    #[test]
    fn the_csv_has_every_point() {
        let csv = chart().csv();
        assert!(csv.starts_with("panel,series,x,y\n\"a, b\",output,0.0,0.0\n"), "{csv}");
        assert_eq!(csv.lines().count(), 1 + 2 * 53);
    }

    #[test]
    fn axes_that_no_number_lies_on_are_drawn_all_the_same() {
        let ends = [1e308, -1e308, 5e-324, 0.0, 1e17, f64::MAX, f64::INFINITY, f64::NAN];
        for (low, high) in ends.into_iter().flat_map(|low| ends.map(|high| (low, high))) {
            let points = vec![(low, high), (high, low), (0.0, 1.0)];
            let mut chart = chart();
            chart.panels[0] = Panel::spanning("ends", vec![Series::line("y", Tone::Ours, points)]);
            let svg = chart.svg("ends");
            assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"), "{low} {high}");
            let Axis { low, high } = Axis::of((low, high));
            assert!(low < high && (high - low).is_finite() && f64::midpoint(low, high) > low);
        }
    }

    #[test]
    fn names_stand_beside_their_dots_and_never_over_each_other() {
        let names: Vec<String> = (0..40).map(|k| format!("sequence {k}")).collect();
        let crowd = (0..40).map(|k| (f64::from(k % 7), f64::from(k / 7) + 0.01 * f64::from(k))).collect();
        let series = Series { name: "s".into(), tone: Tone::Ours, mark: Mark::Named(names), points: crowd };
        let panels = vec![Panel::spanning("", vec![series])];
        let chart = Chart { columns: 1, aspect: 1.6, x_label: String::new(), y_label: String::new(), panels };
        let paper = chart.paper(f64::from(WIDTH));
        // Every dot says its name where the pointer rests.
        assert_eq!(paper.marks.iter().filter(|mark| mark.title.starts_with("sequence")).count(), 40);
        let boxes: Vec<(f64, f64, f64, f64)> = paper
            .marks
            .iter()
            .filter_map(|mark| match &mark.form {
                Form::Text { at: (x, y), size, text, .. } if text.starts_with("sequence") => {
                    Some((*x, y - 0.7 * size, x + text_width(text, *size), *y))
                }
                _ => None,
            })
            .collect();
        assert!(boxes.len() > 20, "{} names have room", boxes.len());
        for (k, a) in boxes.iter().enumerate() {
            assert!(a.0 >= 0.0 && a.2 <= f64::from(WIDTH));
            for b in &boxes[k + 1..] {
                assert!(a.2 <= b.0 || b.2 <= a.0 || a.3 <= b.1 || b.3 <= a.1, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn a_plane_is_drawn_without_distortion_and_a_band_is_filled() {
        let square = vec![(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let line = Series::line("", Tone::Ours, square);
        let panels = vec![Panel { equal: true, ..Panel::spanning("", vec![line]) }];
        let chart = Chart { columns: 1, aspect: 2.0, x_label: String::new(), y_label: String::new(), panels };
        let paper = chart.paper(f64::from(WIDTH));
        let corners = paper.marks.iter().find_map(|mark| match &mark.form {
            Form::Line { points, width, .. } if points.len() == 4 && *width == 3.0 => Some(points.clone()),
            _ => None,
        });
        let corners = corners.expect("the square");
        let (across, up) = (corners[1].0 - corners[0].0, corners[1].1 - corners[2].1);
        assert!((across - up).abs() < 1e-9 && across > 100.0, "{corners:?}");

        let band = Series::band("two sd", Tone::Ours, [(0.0, -1.0, 1.0), (1.0, -2.0, 2.0)]);
        let panel = Panel::spanning("", vec![band]);
        assert!(panel.y.0 < -2.0 && panel.y.1 > 2.0);
        let chart = Chart { panels: vec![panel], ..chart };
        assert!(
            chart.svg("").contains("<polygon")
                && chart.csv().contains("\",\"two sd, to\",1.0,2.0".trim_start_matches("\","))
        );
    }

    #[test]
    fn labels_of_ticks_stay_on_the_paper() {
        for columns in [1, 2, 4, 12] {
            for range in [(-1.1, 1.1), (-1234.0, 88.0), (0.0, 1e-7), (-0.031, 0.02)] {
                let line = || vec![Series::line("", Tone::Ours, vec![(range.0, range.0), (range.1, range.1)])];
                let panels = (0..columns).map(|k| Panel::spanning(k.to_string(), line())).collect();
                let chart = Chart { columns, aspect: 1.0, x_label: "a".into(), y_label: String::new(), panels };
                let paper = chart.paper(f64::from(WIDTH));
                for mark in &paper.marks {
                    if let Form::Text { at, size, anchor: Anchor::End, text, .. } = &mark.form {
                        assert!(at.0 - text_width(text, *size) >= 0.0, "{columns} {text}");
                    }
                }
            }
        }
    }

    #[test]
    fn titles_of_small_panels_do_not_reach_into_their_neighbours() {
        let series = || vec![Series::line("", Tone::Ours, vec![(0.0, 0.0), (1.0, 1.0)])];
        let title = "shoulder, output, between 1 and 2, and more words than there is room for";
        let panels = vec![Panel::spanning(title, series()); 10];
        let chart = Chart { columns: 5, aspect: 1.0, x_label: "a".into(), y_label: "b".into(), panels };
        let paper = chart.paper(f64::from(WIDTH));
        let titles = paper.marks.iter().filter(|mark| mark.title == title);
        for mark in titles.clone() {
            let Form::Text { size, text, .. } = &mark.form else { panic!("a title is text") };
            assert!(text_width(text, *size) < 272.0, "{text}");
        }
        assert_eq!(titles.count(), 10);
        let ticks = paper
            .marks
            .iter()
            .filter(|mark| matches!(&mark.form, Form::Text { text, .. } if text == "0" || text.starts_with('1')));
        assert!(ticks.count() >= 8, "rows and columns have ticks");
    }

    #[test]
    fn figures_in_print_have_text_of_one_size() {
        for (millimetres, units) in [(85.0, 1090.6), (170.0, 2181.1)] {
            let svg = chart().svg_in_print("x", millimetres);
            assert!(svg.contains(&format!(" width=\"{millimetres}mm\"")), "{svg}");
            assert!(svg.contains(&format!("viewBox=\"0 0 {units:.0} ")), "{svg}");
            assert!(chart().pdf("x", millimetres).starts_with(b"%PDF"));
        }
    }

    /// Lightness and two axes of colour (CIE Lab) of a colour as somebody sees it whose cones are those of `cones`.
    fn seen(hex: &str, cones: &[[f64; 3]; 3]) -> [f64; 3] {
        let part = |k: usize| f64::from(u8::from_str_radix(&hex[k..k + 2], 16).unwrap()) / 255.0;
        let linear =
            [0, 2, 4].map(part).map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
        let times = |m: &[[f64; 3]; 3], v: [f64; 3]| m.map(|row| (0..3).map(|k| row[k] * v[k]).sum::<f64>());
        let rgb = times(cones, linear).map(|c| c.clamp(0.0, 1.0));
        let xyz = times(&[[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], rgb);
        let white = [0.950_47, 1.0, 1.088_83];
        let f: Vec<f64> = (0..3).map(|k| (xyz[k] / white[k]).max(0.0089)).map(f64::cbrt).collect();
        [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])]
    }

    #[test]
    fn colours_are_told_apart_by_the_colour_blind_in_light_and_in_dark() {
        // Machado, Oliveira and Fernandes 2009, severity 1: without red, green or blue cones.
        let blind = [
            [
                [0.152_286, 1.052_583, -0.204_868],
                [0.114_503, 0.786_281, 0.099_216],
                [-0.003_882, -0.048_116, 1.051_998],
            ],
            [[0.367_322, 0.860_646, -0.227_968], [0.280_085, 0.672_501, 0.047_413], [-0.011_820, 0.042_940, 0.968_881]],
            [
                [1.255_528, -0.076_749, -0.178_779],
                [-0.078_411, 0.930_809, 0.147_602],
                [0.004_733, 0.691_367, 0.303_900],
            ],
        ];
        let style = include_str!("page.css");
        for theme in style.split(":root{").skip(1).take(2) {
            let colour = |name: &str| {
                let after = theme.split(&format!("--{name}:#")).nth(1).unwrap_or_else(|| panic!("{name}"));
                after[..6].to_owned()
            };
            for group in [["level-0", "level-1", "level-2", "level-3"], ["ours", "truth", "data", "failed"]] {
                for (k, a) in group.iter().enumerate() {
                    for b in &group[k + 1..] {
                        for cones in &blind {
                            let (p, q) = (seen(&colour(a), cones), seen(&colour(b), cones));
                            let apart = (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                            assert!(apart > 14.0, "{a} and {b} in {theme:.40}: {apart:.1}");
                        }
                    }
                }
            }
        }
        // Files have the colours of the light theme.
        let light = style.split(":root{").nth(1).unwrap();
        for (name, rgb) in TONES {
            assert!(light.contains(&format!("--{name}:{}", hex(rgb).to_lowercase())), "{name}");
        }
    }

    #[test]
    fn cells_are_filled_in_colours_of_the_theme_and_hold_their_texts() {
        let cells = vec![(0.0, "one".to_owned()), (2.0, "two & more".to_owned())];
        let series = Series {
            name: "nll".into(),
            tone: Tone::Ours,
            mark: Mark::Cells(cells),
            points: vec![(1.0, 1.0), (2.0, 1.0)],
        };
        let panel = Panel {
            title: String::new(),
            x: (0.5, 2.5),
            y: (0.5, 1.5),
            series: vec![series],
            failed: false,
            equal: false,
        };
        let chart = Chart { columns: 1, aspect: 2.0, x_label: "a".into(), y_label: "b".into(), panels: vec![panel] };
        let svg = themed(chart.svg("Cells"));
        assert!(svg.matches("<polygon").count() == 2 && svg.contains("opacity=\"0.55\""), "{svg}");
        assert!(svg.contains("two &amp; more") && !svg.contains("\"#"), "{svg}");
        assert!(chart.csv().contains("nll one,1.0,1.0\n"), "{}", chart.csv());
        assert!(String::from_utf8(chart.pdf("Cells", 85.0)).unwrap().contains("(two & more) Tj"));
    }
}
