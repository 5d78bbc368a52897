//! Figures and tables of the thesis' chapter 5.

use super::conditions::setting;
use super::figures::{self, Material};
use super::findings::{Findings, Regression};
use crate::framework::Results;
use scrnn_report::{Block, Chart, Figure, Panel, Section, Series, Sheet, Tone};

/// All sections.
pub fn sections(results: &Results<Findings>, materials: &[&Material]) -> Vec<Section> {
    let mut sections = vec![
        Section {
            title: "Two ways to treat what cannot be predicted".into(),
            blocks: vec![
                Block::Figure(Box::new(figures::initial_states(materials))),
                Block::Figure(Box::new(figures::on_its_own(materials))),
                Block::Figure(Box::new(figures::in_world(materials))),
                Block::Text(
                    "To see both robots at work, in 3-D, type this in the folder of this page and open interact.html: \
                     scrnn simulate interact wide-1 --best --ers --view interact.html"
                        .into(),
                ),
            ],
        },
        reactions(results),
        regression(results, materials),
    ];
    if results.conditions.iter().any(|condition| !setting(condition.key).of_thesis) {
        sections.push(beyond(results));
    }
    sections
}

/// A dot for each network, and a line at their mean.
fn dots(title: &str, values: &[f64], high: f64) -> Panel {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let points = values.iter().enumerate().map(|(k, &value)| (k as f64 + 1.0, value)).collect();
    let series = vec![
        Series::line("mean", Tone::Ink, vec![(0.5, mean), (n + 0.5, mean)]),
        Series::dots("a network", Tone::Ours, points),
    ];
    Panel {
        title: format!("{title}: {mean:.1}"),
        x: (0.0, n + 1.0),
        y: (0.0, high),
        series,
        failed: false,
        equal: false,
    }
}

fn bars(file: &str, title: &str, thesis: &str, panels: Vec<(&str, Vec<f64>)>) -> Block {
    let most = panels.iter().flat_map(|(_, values)| values).copied().fold(1.0, f64::max);
    let columns = panels.len().max(1);
    let panels = panels.into_iter().map(|(title, values)| dots(title, &values, 1.1 * most)).collect();
    let chart = Chart { columns, aspect: 0.9, x_label: "network".into(), y_label: "samples".into(), panels };
    let caption = "Mean reaction time of each network over 160 branchings.".into();
    Block::Figure(Box::new(Figure {
        file: file.into(),
        title: title.into(),
        caption,
        thesis: thesis.into(),
        drawing: chart.into(),
    }))
}

fn reactions(results: &Results<Findings>) -> Section {
    let times = |key: &str, of_one: &dyn Fn(&Findings) -> f64| {
        results.of(key).map(|job| of_one(&job.findings)).collect::<Vec<f64>>()
    };
    let figure = bars(
        "reaction-times",
        "Reaction times",
        "Fig. 5.7: 17.77, 17.80; 0.004, 36.64.",
        vec![
            ("narrow, own", times("narrow", &|one| one.corresponding.mean)),
            ("narrow, other", times("narrow", &|one| one.other.mean)),
            ("wide, own", times("wide", &|one| one.corresponding.mean)),
            ("wide, other", times("wide", &|one| one.other.mean)),
        ],
    );
    let text = "Object and head come from the recordings, the arm from the network's own predictions. Own: from the state of the \
                recording's order; other: from that of LLRRL, whatever the order. A reaction begins with the first error \
                above 0.01 within 50 samples of the branching, and ends with the first of five below it.";
    Section { title: "Reaction times".into(), blocks: vec![Block::Text(text.into()), figure] }
}

fn regression(results: &Results<Findings>, materials: &[&Material]) -> Section {
    let wide: Vec<&Findings> = results.of("wide").map(|job| &job.findings).collect();
    let regressed = |of: &dyn Fn(&Regression) -> f64| {
        wide.iter().filter_map(|one| one.regression.as_ref()).map(of).collect::<Vec<f64>>()
    };
    let mut blocks = vec![bars(
        "reaction-times-regression",
        "Reaction times with and without error regression",
        "Fig. 5.11: 36.64 without, 8.22 with error regression.",
        vec![
            ("without", wide.iter().map(|one| one.other.mean).collect()),
            ("with", regressed(&|one| one.default.reactions.mean)),
            ("causal", regressed(&|one| one.default.causal.mean)),
            ("thesis' rate", regressed(&|one| one.thesis.reactions.mean)),
        ],
    )];
    blocks.extend(figures::regressed(materials).map(|figure| Block::Figure(Box::new(figure))));
    blocks.extend(figures::window(materials).map(|figure| Block::Figure(Box::new(figure))));
    blocks.extend(results.table("scan").map(|scan| Block::Sheet(scan.sheet())));
    Section { title: "Error regression".into(), blocks }
}

fn beyond(results: &Results<Findings>) -> Section {
    let mut rows = Vec::new();
    for (condition, settings) in results.conditions.iter().zip(&results.settings) {
        for job in results.of(condition.key) {
            let one = &job.findings;
            let variance = settings.first().map(|settings| settings.network.initial_state_variance);
            rows.push(vec![
                condition.label.to_owned(),
                variance.map_or(String::new(), |variance| format!("{variance:.0e}")),
                job.seed.to_string(),
                one.closed_loop.regenerated.to_string(),
                one.closed_loop.distinct_from_one.to_string(),
                format!("{:.2}", one.closed_loop.variance_open.over_median),
                format!("{:.1}", one.corresponding.mean),
                format!("{:.1}", one.other.mean),
                format!("{:.1}", one.other.by_side[0]),
                format!("{:.1}", one.other.by_side[1]),
                format!("{:.0}", 100.0 * left_share(&one.closed_loop.orders_from_one)),
            ]);
        }
    }
    let head = [
        "condition",
        "variance",
        "network",
        "own orders of 32",
        "orders from one state",
        "peak / median",
        "reaction, own",
        "reaction, other",
        "other, left",
        "other, right",
        "left, %",
    ];
    let sheet = Sheet {
        caption: "Variances in between, and a bias".into(),
        head: head.map(String::from).to_vec(),
        rows,
        note: "With a bias, 32 orders are drawn at random, 80 % of their branchings to the left. The last column is the share of left \
               moves that the network makes on its own from one initial state."
            .into(),
    };
    Section { title: "Beyond the thesis".into(), blocks: vec![Block::Sheet(sheet)] }
}

fn left_share(orders: &[String]) -> f64 {
    let letters: Vec<char> = orders.iter().flat_map(|order| order.chars()).collect();
    letters.iter().filter(|letter| **letter == 'L').count() as f64 / letters.len().max(1) as f64
}
