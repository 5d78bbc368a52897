//! A page with a table and a chart, on stdout.
//!
//! ```console
//! cargo run -p scrnn-report --example page > page.html
//! ```

use scrnn_report::{Block, Chart, Figure, Page, Panel, Section, Series, Sheet, Tone};

fn main() {
    let wave = (0..100).map(|t| (f64::from(t), (0.2 * f64::from(t)).sin())).collect();
    let chart = Chart {
        columns: 1,
        aspect: 2.5,
        x_label: "step".into(),
        y_label: "y".into(),
        panels: vec![Panel::spanning("", vec![Series::line("a wave", Tone::Ours, wave)])],
    };
    let figure = Figure {
        file: "wave".into(),
        title: "A wave".into(),
        caption: "It goes up and down.".into(),
        thesis: String::new(),
        drawing: chart.into(),
    };
    let sheet = Sheet {
        caption: "In numbers".into(),
        head: vec!["period".into(), "steps".into()],
        rows: vec![vec!["31.4".into(), "100".into()]],
        note: String::new(),
    };
    let blocks = vec![Block::Figure(Box::new(figure)), Block::Sheet(sheet)];
    let sections = vec![Section { title: "Wave".into(), blocks }];
    print!("{}", Page { title: "An example".into(), lede: "What a page is made of.".into(), sections }.html());
}
