//! The page of a reproduction: what all experiments have in common, around each one's own sections.

use std::time::Duration;

use super::metrics::Metrics;
use super::study::{Learned, Study};
use scrnn_pages::learning_curves;
use scrnn_report::in_words;
use scrnn_report::{Block, Page, Section, Sheet};
use scrnn_run::assessment::entropy_of_noise;
use scrnn_run::history::Row;

/// The whole page. Figures show the first seed.
pub fn page<S: Study>(
    study: &S,
    metrics: &Metrics<S::Findings>,
    networks: &[Vec<Learned>],
    material: &S::Material,
) -> Page {
    let first = &metrics.seeds[0];
    let mut sections = vec![results(metrics)];
    sections.extend(study.sections(first, material));
    sections.push(learning(networks));
    sections.push(circumstances(metrics));
    let title = match metrics.experiment {
        "lissajous" => "Twelve fluctuating Lissajous curves",
        "patterns" => "144 fluctuating patterns",
        "sinusoid" => "A sine wave with noise that changes over time",
        "reach" => "NAO learns to reach",
        _ => "An oscillator driven by noise that depends on its state",
    };
    let seeds = match metrics.seeds.len() {
        1 => format!("seed {}", first.seed),
        count => format!("{count} seeds from {} on; figures and single tables show seed {}", first.seed, first.seed),
    };
    let lede = format!(
        "Murata's thesis (2016), reproduced with {} on {}. Preset {}, {seeds}. Each seed has data and initial weights of its \
         own, and none was chosen.",
        metrics.command,
        metrics.machine.told(),
        metrics.preset,
    );
    Page { title: title.to_owned(), lede, sections }
}

/// Measures and verdicts, seed by seed.
fn results<F>(metrics: &Metrics<F>) -> Section {
    let seeds: Vec<String> = metrics.seeds.iter().map(|seed| format!("seed {}", seed.seed)).collect();
    let several = seeds.len() > 1;
    let mut head = vec!["goal".to_owned(), "needed".to_owned()];
    head.extend(seeds.clone());
    head.push("verdict".into());
    let rows = metrics.verdicts.iter().map(|verdict| {
        let mut row = vec![verdict.goal.clone(), verdict.needed.clone()];
        row.extend(verdict.seeds.iter().map(|seed| match seed.met || !several {
            true => seed.found.clone(),
            false => format!("{} (missed)", seed.found),
        }));
        row.push(verdict.word().to_owned());
        row
    });
    let verdicts = Sheet { caption: "Goals".into(), head, rows: rows.collect(), note: String::new() };

    let mut head = vec![
        "measure".to_owned(),
        "thesis".to_owned(),
        if several { "ours, mean \u{b1} sd".into() } else { "ours".into() },
    ];
    if several {
        head.extend(seeds);
    }
    let or_dash = |text: &str| if text.is_empty() { "\u{2013}".to_owned() } else { text.to_owned() };
    let rows = metrics.summary.iter().map(|summary| {
        let label = format!("{}: {}", summary.label, summary.explanation);
        let mut row = vec![label, or_dash(summary.thesis), summary.shown_mean()];
        if several {
            row.extend(summary.values.iter().map(|&value| summary.shown(value)));
        }
        row
    });
    let measures = Sheet { caption: "Measures".into(), head, rows: rows.collect(), note: String::new() };
    let reading = "A goal is met if every seed reaches it, unless it says otherwise. Where the thesis has no number, its \
                   words stand in quotation marks.";
    let blocks = vec![Block::Text(reading.into()), Block::Sheet(verdicts), Block::Sheet(measures)];
    Section { title: "Results".into(), blocks }
}

/// Learning curves of every network, and how long it took.
fn learning(networks: &[Vec<Learned>]) -> Section {
    let mut blocks = Vec::new();
    for (k, first) in networks[0].iter().enumerate() {
        let runs: Vec<(String, &[Row])> = networks
            .iter()
            .map(|own| (format!("seed {}", own[k].experiment.seed), own[k].history.as_slice()))
            .collect();
        let floor = first
            .source
            .truth
            .as_ref()
            .and_then(|truth| entropy_of_noise(&truth.variances, first.network.topology.delay()));
        let file = format!("learning-{}", first.name.to_lowercase().replace(' ', "-"));
        blocks.push(learning_curves(&file, &format!("Learning curve of the {}", first.name), &runs, floor));
    }
    let rows = networks.iter().flatten().map(|network| {
        let facts = &network.training;
        let number = |value: Option<f64>| value.map_or("\u{2013}".to_owned(), |value| format!("{value:.4}"));
        vec![
            facts.folder.clone(),
            facts.network.to_owned(),
            facts.epochs.to_string(),
            number(facts.nll),
            facts.mse.map_or("\u{2013}".to_owned(), |mse| format!("{mse:.3e}")),
            in_words(Duration::from_secs_f64(facts.seconds)),
        ]
    });
    blocks.push(Block::Sheet(Sheet {
        caption: "Trainings".into(),
        head: ["run folder", "network", "epochs", "nll", "squared error", "time"].map(String::from).to_vec(),
        rows: rows.collect(),
        note: "nll in nats per step and channel; time of training alone.".into(),
    }));
    Section { title: "Learning".into(), blocks }
}

/// Settings, machine, time.
fn circumstances<F>(metrics: &Metrics<F>) -> Section {
    let time = in_words(Duration::from_secs_f64(metrics.seconds));
    let mut rows = vec![
        vec!["command".to_owned(), metrics.command.clone()],
        vec!["version".into(), format!("scrnn {}", metrics.version)],
        vec!["machine".into(), metrics.machine.told()],
        vec!["time of this call".into(), time],
    ];
    for seed in &metrics.seeds {
        let time = in_words(Duration::from_secs_f64(seed.seconds));
        let threads = if seed.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", seed.threads) };
        rows.push(vec![format!("seed {}", seed.seed), format!("{time} with {threads}, training and evaluation")]);
    }
    let sheet = Sheet { caption: "Circumstances".into(), head: Vec::new(), rows, note: String::new() };
    let mut blocks = vec![Block::Sheet(sheet)];
    for settings in &metrics.settings {
        blocks.push(Block::Verbatim(toml::to_string(settings).unwrap_or_default()));
    }
    Section { title: "Settings, machine, time".into(), blocks }
}
