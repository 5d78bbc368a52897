//! A chart of one or more panels: what is drawn, and how it becomes SVG and CSV.
//!
//! Colours are tones with a meaning. In a page they follow the reader's light or dark theme; in a file of its own a chart
//! has the light ones on white. Text is text, in whatever sans-serif font the reader has.

use std::fmt::Write as _;

use plotters::coord::Shift;
use plotters::prelude::*;

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
const TONES: [(&str, RGBColor); 10] = [
    ("ink", RGBColor(0x22, 0x26, 0x2B)),
    ("grid", RGBColor(0xDD, 0xE0, 0xE4)),
    ("ours", RGBColor(0x00, 0x62, 0xB1)),
    ("truth", RGBColor(0xC4, 0x45, 0x00)),
    ("data", RGBColor(0x6B, 0x72, 0x7B)),
    ("failed", RGBColor(0xC8, 0x00, 0x2E)),
    ("level-0", RGBColor(0x00, 0x5A, 0xA7)),
    ("level-1", RGBColor(0x00, 0x8A, 0x63)),
    ("level-2", RGBColor(0xB0, 0x72, 0x00)),
    ("level-3", RGBColor(0xA8, 0x2C, 0x7C)),
];

impl Tone {
    fn entry(self) -> (&'static str, RGBColor) {
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

    fn colour(self) -> RGBColor {
        self.entry().1
    }

    /// The colour in the light theme, as SVG writes it.
    pub(super) fn hex(self) -> String {
        hex(self.colour())
    }
}

fn hex(RGBColor(r, g, b): RGBColor) -> String {
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
    /// A text at each.
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
}

/// Numbers farther from 0 than this are drawn here: ticks have to be found between them.
const FARTHEST: f64 = 1e100;

/// A range that an axis can have: its ends are finite, and far enough apart that numbers lie between them.
fn sound((low, high): (f64, f64)) -> (f64, f64) {
    let near = |end: f64| if end.is_nan() { 0.0 } else { end.clamp(-FARTHEST, FARTHEST) };
    let (low, high) = (near(low), near(high));
    let least = (1e-9 * low.abs().max(high.abs())).max(1.0 / FARTHEST);
    let middle = f64::midpoint(low, high);
    if high - low >= least { (low, high) } else { (middle - least, middle + least) }
}

impl Panel {
    /// A panel whose axes span all that is drawn.
    pub fn spanning(title: impl Into<String>, series: Vec<Series>) -> Self {
        let range = |of: &dyn Fn(&(f64, f64)) -> f64| {
            let values = series.iter().flat_map(|series| &series.points).map(of).filter(|value| value.is_finite());
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
            match high - low {
                span if span > 0.0 => (low - 0.04 * span, high + 0.04 * span),
                _ if low.is_finite() => (low - 0.5, high + 0.5),
                _ => (0.0, 1.0),
            }
        };
        let (x, y) = (range(&|point| point.0), range(&|point| point.1));
        Self { title: title.into(), x, y, series, failed: false }
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
    name: &'a str,
    tone: Tone,
    line: bool,
    x: i32,
    y: i32,
}

/// Width of all charts in the SVG's own units: two for each of the page's.
pub(super) const WIDTH: u32 = 1360;
/// Height of text: readable where a phone shows the chart at a quarter of its size.
pub(super) const TEXT: f64 = 38.0;
const LEGEND_ROW: i32 = 58;
const FONT: &str = "sans-serif";

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

impl Chart {
    /// All points: panel, series, x, y.
    pub(super) fn csv(&self) -> String {
        let mut text = "panel,series,x,y\n".to_owned();
        for panel in &self.panels {
            for series in &panel.series {
                for (k, (x, y)) in series.points.iter().enumerate() {
                    let name = match &series.mark {
                        Mark::Texts(texts) => csv_field(&format!("{} {}", series.name, texts[k])),
                        Mark::Cells(cells) => csv_field(&format!("{} {}", series.name, cells[k].1)),
                        _ => csv_field(&series.name),
                    };
                    writeln!(text, "{},{name},{x:?},{y:?}", csv_field(&panel.title)).expect("a string takes all");
                }
            }
        }
        text
    }

    /// The chart as an SVG element in light colours, with `title` for those who cannot see it.
    pub(super) fn svg(&self, title: &str) -> String {
        let rows = self.panels.len().div_ceil(self.columns);
        let width = f64::from(WIDTH) / self.columns as f64;
        let furniture = match self.columns {
            0..=2 => 132.0,
            3..=6 => 64.0,
            _ => 0.0,
        };
        let legend = match self.legend().last() {
            Some(entry) => entry.y + LEGEND_ROW,
            None => 8,
        } as u32;
        let height = legend + ((width / self.aspect + furniture) * rows as f64) as u32;
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
            // Drawing into a string fails for no reason that a reader could do anything about.
            self.draw(&root, legend).expect("a string takes all");
            root.present().expect("a string takes all");
        }
        let svg = super::escape::printable(&svg);
        let body = svg.split_once(">\n").map_or("", |(_, body)| body);
        let dashed = format!("stroke=\"{}\"", Tone::Truth.hex());
        let body = body.replace(&dashed, &format!("{dashed} stroke-dasharray=\"14 9\""));
        let title = super::escape::escaped(title);
        format!(
            "<svg viewBox=\"0 0 {WIDTH} {height}\" xmlns=\"http://www.w3.org/2000/svg\" role=\"img\">\n<title>{title}</title>\n{body}"
        )
    }

    /// Names and tones of the series, each name once, in rows. A single one needs no legend.
    fn legend(&self) -> Vec<Entry<'_>> {
        let mut entries: Vec<Entry<'_>> = Vec::new();
        let (mut x, mut y) = (16, 0);
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if series.name.is_empty() || entries.iter().any(|entry| entry.name == series.name) {
                continue;
            }
            let width = 68 + (series.name.chars().count() as f64 * TEXT * 0.47) as i32;
            if x > 16 && x + width > WIDTH as i32 {
                (x, y) = (16, y + LEGEND_ROW);
            }
            entries.push(Entry { name: &series.name, tone: series.tone, line: series.mark == Mark::Line, x, y });
            x += width + 40;
        }
        if entries.len() > 1 { entries } else { Vec::new() }
    }

    fn draw(&self, root: &Area<'_>, legend_height: u32) -> Drawn {
        let (legend, body) = root.split_vertically(legend_height);
        let text = (FONT, TEXT).into_font().color(&Tone::Ink.colour());
        for Entry { name, tone, line, x, y } in self.legend() {
            let middle = y + 28;
            if line {
                legend.draw(&PathElement::new([(x, middle), (x + 56, middle)], tone.colour().stroke_width(5)))?;
            } else {
                legend.draw(&Circle::new((x + 40, middle), 9, tone.colour().filled()))?;
            }
            legend.draw(&Text::new(name.to_owned(), (x + 68, middle - 16), text.clone()))?;
        }
        let rows = self.panels.len().div_ceil(self.columns);
        let areas = body.split_evenly((rows, self.columns));
        for (index, (panel, area)) in self.panels.iter().zip(&areas).enumerate() {
            self.draw_panel(panel, area, index % self.columns == 0, index + self.columns >= self.panels.len())?;
        }
        Ok(())
    }

    fn draw_panel(&self, panel: &Panel, area: &Area<'_>, first: bool, last: bool) -> Drawn {
        let (x, y) = (sound(panel.x), sound(panel.y));
        let (small, tiny) = (self.columns > 2, self.columns > 6);
        let ink = Tone::Ink.colour();
        let size = if small { 0.86 * TEXT } else { TEXT };
        let (left, bottom) = match small {
            true if tiny => (0, 0),
            true => (if self.y_label.is_empty() { 12 } else { 100 }, 12),
            false => (128, if last { 104 } else { 56 }),
        };
        let mut builder = ChartBuilder::on(area);
        builder.margin(if tiny { 3 } else { 6 });
        if !small {
            builder.margin_right(54);
        }
        builder.set_label_area_size(LabelAreaPosition::Left, left);
        builder.set_label_area_size(LabelAreaPosition::Bottom, bottom);
        if !panel.title.is_empty() && !tiny {
            builder.caption(&panel.title, (FONT, size).into_font().color(&ink));
        }
        let mut chart = builder.build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        let (x_span, y_span) = (x.1 - x.0, y.1 - y.0);
        let format_x = move |value: &f64| shown(*value, x_span);
        let format_y = move |value: &f64| shown(*value, y_span);
        let mut mesh = chart.configure_mesh();
        mesh.axis_style(Tone::Data.colour())
            .light_line_style(TRANSPARENT)
            .bold_line_style(Tone::Grid.colour())
            .label_style((FONT, size * 0.92).into_font().color(&ink))
            .x_labels(if small { 0 } else { 8 })
            .y_labels(if small { 3 } else { 5 })
            .x_label_formatter(&format_x)
            .y_label_formatter(&format_y);
        if panel.series.iter().any(|series| matches!(series.mark, Mark::Cells(_))) {
            mesh.x_labels(0).y_labels(0).disable_mesh();
        }
        if small && self.y_label.is_empty() {
            mesh.y_labels(0);
        }
        if last && !small {
            mesh.x_desc(&self.x_label).axis_desc_style((FONT, TEXT).into_font().color(&ink));
        }
        if first && !small {
            mesh.y_desc(&self.y_label).axis_desc_style((FONT, TEXT).into_font().color(&ink));
        }
        mesh.draw()?;
        let inside = |at: (f64, f64)| (at.0.clamp(x.0, x.1), at.1.clamp(y.0, y.1));
        for series in &panel.series {
            let points = || series.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).map(|&at| inside(at));
            let colour = series.tone.colour();
            match &series.mark {
                Mark::Line => {
                    let width = if small { 2 } else { 3 };
                    chart.draw_series(LineSeries::new(points(), colour.stroke_width(width)))?;
                }
                Mark::Dots => {
                    chart
                        .draw_series(points().map(|at| Circle::new(at, if small { 3 } else { 5 }, colour.filled())))?;
                }
                Mark::Cells(cells) => {
                    let style = (FONT, TEXT).into_font().color(&ink).pos(centred());
                    for (&(x, y), (strength, text)) in series.points.iter().zip(cells) {
                        let corners = [inside((x - 0.5, y - 0.5)), inside((x + 0.5, y + 0.5))];
                        // Text has to stay readable on it, in both themes.
                        let fill = colour.mix(0.05 + 0.5 * strength.clamp(0.0, 1.0));
                        chart.draw_series([Rectangle::new(corners, fill.filled())])?;
                        chart.draw_series([Text::new(text.clone(), inside((x, y)), style.clone())])?;
                    }
                }
                Mark::Texts(texts) => {
                    let style = (FONT, TEXT).into_font().color(&colour);
                    let style = style.pos(centred());
                    chart.draw_series(
                        points().zip(texts).map(|(at, text)| Text::new(text.clone(), at, style.clone())),
                    )?;
                }
            }
        }
        if panel.failed {
            let ((left, right), (low, high)) = (x, y);
            for (from, to) in [(low, high), (high, low)] {
                let cross = [(left, from), (right, to)];
                chart.draw_series([PathElement::new(cross, Tone::Failed.colour().stroke_width(4))])?;
            }
        }
        Ok(())
    }
}

/// In the middle of its place.
fn centred() -> plotters::style::text_anchor::Pos {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    Pos::new(HPos::Center, VPos::Center)
}

/// A number on an axis of this length, with as many digits as its neighbours need to differ.
fn shown(value: f64, span: f64) -> String {
    if span < 0.003 && value != 0.0 {
        return format!("{value:.0e}");
    }
    let digits = match span {
        20.0.. => 0,
        2.0.. => 1,
        _ => (1.0 - span.log10()).ceil().clamp(1.0, 6.0) as usize,
    };
    let text = format!("{value:.digits$}");
    // No "-0.0".
    if text.trim_start_matches('-').chars().all(|c| matches!(c, '0' | '.')) { "0".to_owned() } else { text }
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
    fn cells_are_filled_in_colours_of_the_theme_and_hold_their_texts() {
        let cells = vec![(0.0, "one".to_owned()), (2.0, "two & more".to_owned())];
        let series = Series {
            name: "nll".into(),
            tone: Tone::Ours,
            mark: Mark::Cells(cells),
            points: vec![(1.0, 1.0), (2.0, 1.0)],
        };
        let panel = Panel { title: String::new(), x: (0.5, 2.5), y: (0.5, 1.5), series: vec![series], failed: false };
        let chart = Chart { columns: 1, aspect: 2.0, x_label: "a".into(), y_label: "b".into(), panels: vec![panel] };
        let svg = themed(chart.svg("Cells"));
        assert!(svg.matches("<rect").count() >= 2 && svg.contains("opacity=\"0.55\""), "{svg}");
        assert!(svg.contains("two &amp; more") && !svg.contains("\"#"), "{svg}");
        assert!(chart.csv().contains("nll one,1.0,1.0\n"), "{}", chart.csv());
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
            let (low, high) = sound((low, high));
            assert!(low < high && (high - low).is_finite() && f64::midpoint(low, high) > low);
        }
    }

    #[test]
    fn numbers_on_axes_are_short() {
        let all = [shown(5e-4, 0.001), shown(0.25, 0.9), shown(-0.0, 2.0), shown(500.0, 1e3), shown(0.01, 0.02)];
        assert_eq!(all, ["5e-4", "0.25", "0", "500", "0.010"]);
    }
}
