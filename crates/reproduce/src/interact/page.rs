//! The page on the thesis' chapter 5.

use std::time::Duration;

use super::conditions::Condition;
use super::figures::{self, Material};
use super::findings::{Findings, of};
use super::{Metrics, conditions};
use scrnn_report::in_words;
use scrnn_report::{Block, Chart, Figure, Page, Panel, Section, Series, Sheet, Tone};

/// All of it.
pub fn page(metrics: &Metrics, conditions: &[Condition], materials: &[Material]) -> Page {
    let networks = metrics.networks.iter().filter(|one| one.condition == "narrow").count();
    let lede = format!(
        "Murata's thesis (2016), chapter 5, reproduced with {} on {}. Preset {}, {networks} networks a condition; figures of \
         single networks show the first. All networks are counted, and none was chosen.",
        metrics.command,
        metrics.machine.told(),
        metrics.preset,
    );
    let mut sections = vec![
        goals(metrics),
        measures(metrics),
        Section {
            title: "Two ways to treat what cannot be foreseen".into(),
            blocks: vec![
                Block::Figure(Box::new(figures::initial_states(materials))),
                Block::Figure(Box::new(figures::on_its_own(materials))),
                Block::Figure(Box::new(figures::in_world(materials))),
            ],
        },
        reactions(metrics),
        regression(metrics, materials),
    ];
    if conditions.iter().any(|condition| !condition.of_thesis) {
        sections.push(beyond(metrics, conditions));
    }
    sections.push(learning(metrics));
    Page { title: "Two robots interact".into(), lede, sections }
}

fn goals(metrics: &Metrics) -> Section {
    let rows = metrics.overall.goals.iter().map(|goal| {
        let verdict = if goal.met { "met" } else { "missed" };
        vec![goal.goal.to_owned(), goal.needed.to_owned(), goal.found.clone(), verdict.to_owned()]
    });
    let sheet = Sheet {
        caption: "Goals".into(),
        head: ["goal", "needed", "found", "verdict"].map(String::from).to_vec(),
        rows: rows.collect(),
        note: "Found: mean over networks, and the smallest and largest; of comparisons the difference of the means."
            .into(),
    };
    Section { title: "Results".into(), blocks: vec![Block::Sheet(sheet)] }
}

fn measures(metrics: &Metrics) -> Section {
    let several = metrics.overall.summary.iter().any(|summary| summary.values.len() > 1);
    let rows = metrics.overall.summary.iter().filter(|summary| !summary.values.is_empty()).map(|summary| {
        let mean = match several {
            true => format!("{:.2} \u{b1} {:.2}", summary.mean, summary.deviation),
            false => format!("{:.2}", summary.mean),
        };
        let values: Vec<String> = summary.values.iter().map(|value| format!("{value:.1}")).collect();
        let thesis = if summary.thesis.is_empty() { "\u{2013}" } else { summary.thesis };
        vec![summary.label.to_owned(), thesis.to_owned(), mean, values.join(" ")]
    });
    let sheet = Sheet {
        caption: "Measures".into(),
        head: ["measure", "thesis", "ours", "each network"].map(String::from).to_vec(),
        rows: rows.collect(),
        note: "Reaction times in samples of 100 ms, means over 160 branchings; 90 where the arm never recovered."
            .into(),
    };
    let rows = metrics.overall.comparisons.iter().map(|one| {
        let found = &one.found;
        vec![
            one.what.to_owned(),
            one.thesis.to_owned(),
            one.test.to_owned(),
            format!("{:.2}", found.difference),
            format!("t({:.1}) = {:.2}", found.degrees, found.t),
            format!("{:.1e}", found.p),
            one.p_of_equivalence.map_or(String::new(), |p| format!("{p:.1e}")),
        ]
    });
    let comparisons = Sheet {
        caption: "Comparisons".into(),
        head: ["reaction times", "thesis", "test", "difference", "t", "p", "p of half a step or more"]
            .map(String::from)
            .to_vec(),
        rows: rows.collect(),
        note: "Paired where both lists are of the same networks, Welch's test otherwise.".into(),
    };
    Section { title: "Measures".into(), blocks: vec![Block::Sheet(sheet), Block::Sheet(comparisons)] }
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
    Panel { title: format!("{title}: {mean:.1}"), x: (0.0, n + 1.0), y: (0.0, high), series, failed: false }
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

fn reactions(metrics: &Metrics) -> Section {
    let times = |key: &str, of_one: &dyn Fn(&Findings) -> f64| {
        of(&metrics.networks, key).into_iter().map(of_one).collect::<Vec<f64>>()
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

fn regression(metrics: &Metrics, materials: &[Material]) -> Section {
    let wide = of(&metrics.networks, "wide");
    let regressed = |of: &dyn Fn(&super::findings::Regression) -> f64| {
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
    let rows = metrics.overall.scan.iter().map(|one| {
        let values: Vec<String> = one.values.iter().map(|value| format!("{value:.1}")).collect();
        vec![
            one.setting.clone(),
            one.window.to_string(),
            one.iterations.to_string(),
            format!("{:.2}", one.mean),
            format!("{:.2}", one.deviation),
            format!("{:.2}", one.worst),
            format!("{:.3}", one.milliseconds),
            values.join(" "),
        ]
    });
    blocks.push(Block::Sheet(Sheet {
        caption: "Which settings are safe for all networks?".into(),
        head: ["setting", "window", "steps", "mean", "sd", "slowest network", "ms", "each network"].map(String::from).to_vec(),
        rows: rows.collect(),
        note: "Mean reaction times over 8 of the 32 recordings, all from the state of LLRRL. ms: median time of a control step."
            .into(),
    }));
    Section { title: "Error regression".into(), blocks }
}

fn beyond(metrics: &Metrics, conditions: &[Condition]) -> Section {
    let mut rows = Vec::new();
    for condition in conditions {
        for one in of(&metrics.networks, condition.key) {
            let variance = conditions::variance_of(condition, &metrics.settings);
            rows.push(vec![
                condition.label.to_owned(),
                variance.map_or(String::new(), |variance| format!("{variance:.0e}")),
                one.seed.to_string(),
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

fn learning(metrics: &Metrics) -> Section {
    let rows = metrics.networks.iter().map(|one| {
        let facts = &one.training;
        vec![
            facts.folder.clone(),
            facts.epochs.to_string(),
            facts.nll.map_or("\u{2013}".to_owned(), |nll| format!("{nll:.4}")),
            facts.mse.map_or("\u{2013}".to_owned(), |mse| format!("{mse:.3e}")),
            in_words(Duration::from_secs_f64(facts.seconds)),
        ]
    });
    let trainings = Sheet {
        caption: "Trainings".into(),
        head: ["run folder", "epochs", "nll", "squared error", "time"].map(String::from).to_vec(),
        rows: rows.collect(),
        note: "nll in nats per step and channel; time of training alone, on one core.".into(),
    };
    let rows = vec![
        vec!["command".to_owned(), metrics.command.clone()],
        vec!["version".into(), format!("scrnn {}", metrics.version)],
        vec!["machine".into(), metrics.machine.told()],
        vec!["time of this call".into(), in_words(Duration::from_secs_f64(metrics.seconds))],
    ];
    let circumstances = Sheet { caption: "Circumstances".into(), head: Vec::new(), rows, note: String::new() };
    let mut blocks = vec![Block::Sheet(trainings), Block::Sheet(circumstances)];
    blocks
        .extend(metrics.settings.iter().map(|settings| Block::Verbatim(toml::to_string(settings).unwrap_or_default())));
    Section { title: "Learning, settings, machine".into(), blocks }
}
