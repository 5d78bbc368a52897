//! The page of a reproduction: what all studies have in common, around each one's own sections.

use std::time::Duration;

use scrnn_pages::learning_curves;
use scrnn_report::in_words;
use scrnn_report::{Block, Page, Section, Sheet};
use scrnn_run::assessment::entropy_of_noise;
use scrnn_run::history::Row;

use super::measure::Summary;
use super::metrics::Metrics;
use super::results::Results;
use super::study::{Learned, Study};

/// The whole page. Networks and materials come in the order of the jobs; `films` leads to what can be watched.
pub fn page<S: Study>(
    study: &S,
    metrics: &Metrics<'_, S::Findings>,
    (networks, materials): (&[Vec<Learned>], &[S::Material]),
    films: Option<Block>,
) -> Page {
    let mut sections = Vec::new();
    if let Some(links) = films {
        let text = "What the first network does, on pages that play it:";
        let blocks = vec![Block::Text(text.into()), links];
        sections.push(Section { title: "The robot at work".into(), blocks });
    }
    sections.push(goals_and_measures(metrics));
    sections.extend(study.sections(metrics.results, materials));
    sections.push(learning(metrics.results, networks));
    sections.push(circumstances(metrics));
    Page { title: study.title().to_owned(), lede: lede(study, metrics), sections }
}

/// What was done with what.
fn lede<S: Study>(study: &S, metrics: &Metrics<'_, S::Findings>) -> String {
    let results = metrics.results;
    let first = results.jobs.first().map_or(0, |job| job.seed);
    let seeds = results.conditions.first().map_or(0, |condition| results.of(condition.key).count());
    let seeds = match (results.conditions.len(), seeds) {
        (1, 1) => format!("seed {first}"),
        (1, count) => format!("{count} seeds from {first} on; figures that do not say otherwise show seed {first}"),
        (_, count) => format!("{count} networks a condition; figures of single networks show the first"),
    };
    format!(
        "Murata's thesis (2016), reproduced with {} on {}. Preset {}, {seeds}. Each seed has {}, and none was chosen.",
        metrics.command,
        metrics.machine.in_words(),
        metrics.preset,
        study.seed_draws(),
    )
}

fn or_dash(text: &str) -> String {
    if text.is_empty() { "\u{2013}".to_owned() } else { text.to_owned() }
}

/// Goals, measures and comparisons.
fn goals_and_measures<F>(metrics: &Metrics<'_, F>) -> Section {
    let results = metrics.results;
    let mut notes = vec![
        "A goal is met if every seed reaches it, unless it says otherwise.",
        "Where the thesis has no number, its words stand in quotation marks.",
    ];
    if metrics.verdicts.iter().any(|verdict| verdict.found.is_some()) {
        notes.push(
            "What was found for all networks together: the mean, and the smallest and largest value; of comparisons the \
             difference of the means.",
        );
    }
    let mut blocks = vec![Block::Text(notes.join(" ")), Block::Sheet(goals(metrics)), Block::Sheet(measures(results))];
    if !results.comparisons.is_empty() {
        blocks.push(Block::Sheet(comparisons(results)));
    }
    Section { title: "Results".into(), blocks }
}

fn goals<F>(metrics: &Metrics<'_, F>) -> Sheet {
    let jobs = &metrics.results.jobs;
    let together = metrics.verdicts.iter().any(|verdict| verdict.found.is_some());
    let each = metrics.verdicts.iter().any(|verdict| !verdict.seeds.is_empty());
    let mut head = vec!["goal".to_owned(), "needed".to_owned()];
    if each {
        head.extend(jobs.iter().map(|job| job.called()));
    }
    if together {
        head.push("found".into());
    }
    head.push("verdict".into());
    let rows = metrics.verdicts.iter().map(|verdict| {
        let mut row = vec![verdict.goal.clone(), verdict.needed.clone()];
        if each {
            let found = verdict.seeds.iter().map(|seed| match seed.met || jobs.len() == 1 {
                true => seed.found.clone(),
                false => format!("{} (missed)", seed.found),
            });
            row.extend(found);
            row.resize(2 + jobs.len(), String::new());
        }
        if together {
            row.push(verdict.found.clone().unwrap_or_default());
        }
        row.push(verdict.word().to_owned());
        row
    });
    Sheet { caption: "Goals".into(), head, rows: rows.collect(), note: String::new() }
}

/// Measures: a column for each seed of a single condition, one for all seeds otherwise.
fn measures<F>(results: &Results<F>) -> Sheet {
    let several = results.summary.iter().any(|summary| summary.values.len() > 1);
    let ours = if several { "ours, mean \u{b1} sd" } else { "ours" };
    let mut head = vec!["measure".to_owned(), "thesis".to_owned(), ours.into()];
    head.extend(heads_of_values(results, several));
    let rows = results.summary.iter().filter(|summary| !summary.values.is_empty()).map(|summary| {
        let mut row = vec![summary.explained(), or_dash(summary.thesis), summary.shown_mean()];
        row.extend(values(results, summary, several));
        row
    });
    Sheet { caption: "Measures".into(), head, rows: rows.collect(), note: String::new() }
}

fn heads_of_values<F>(results: &Results<F>, several: bool) -> Vec<String> {
    match results.conditions.len() {
        _ if !several => Vec::new(),
        1 => results.jobs.iter().map(|job| job.called()).collect(),
        _ => vec!["each network".to_owned()],
    }
}

fn values<F>(results: &Results<F>, summary: &Summary, several: bool) -> Vec<String> {
    let shown = summary.values.iter().map(|&value| summary.shown(value));
    match results.conditions.len() {
        _ if !several => Vec::new(),
        1 => shown.collect(),
        _ => vec![shown.collect::<Vec<_>>().join(" ")],
    }
}

fn comparisons<F>(results: &Results<F>) -> Sheet {
    let rows = results.comparisons.iter().map(|one| {
        let found = &one.found;
        vec![
            one.what.to_owned(),
            or_dash(one.thesis),
            one.test.word().to_owned(),
            format!("{:.2}", found.difference),
            format!("t({:.1}) = {:.2}", found.degrees, found.t),
            format!("{:.1e}", found.p),
            one.p_of_equivalence.map_or(String::new(), |p| format!("{p:.1e}")),
        ]
    });
    let head = ["what", "thesis", "test", "difference", "t", "p", "p of a difference of the margin or more"];
    Sheet {
        caption: "Comparisons".into(),
        head: head.map(String::from).to_vec(),
        rows: rows.collect(),
        note: "Paired where both lists are of the same networks, Welch's test otherwise.".into(),
    }
}

/// Learning curves of every network, and the result of each training.
fn learning<F>(results: &Results<F>, networks: &[Vec<Learned>]) -> Section {
    let mut blocks = Vec::new();
    for condition in &results.conditions {
        let own: Vec<(u64, &Vec<Learned>)> = results
            .jobs
            .iter()
            .zip(networks)
            .filter(|(job, _)| job.condition.unwrap_or("") == condition.key)
            .map(|(job, own)| (job.seed, own))
            .collect();
        let Some(&(_, first)) = own.first() else { continue };
        for (k, first) in first.iter().enumerate() {
            let runs: Vec<(String, &[Row])> =
                own.iter().map(|(seed, own)| (format!("seed {seed}"), own[k].history.as_slice())).collect();
            let truth = first.source.truth.as_ref();
            let floor = truth.and_then(|truth| entropy_of_noise(&truth.variances, first.network.topology().delay()));
            let mut file = format!("learning-{}", first.name.to_lowercase().replace(' ', "-"));
            let mut title = format!("Learning curve of the {}", first.name);
            if !condition.key.is_empty() {
                file += &format!("-{}", condition.key);
                title += &format!(", {}", condition.label);
            }
            blocks.push(learning_curves(&file, &title, &runs, floor));
        }
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
fn circumstances<F>(metrics: &Metrics<'_, F>) -> Section {
    let results = metrics.results;
    let time = in_words(Duration::from_secs_f64(metrics.seconds));
    let rows = vec![
        vec!["command".to_owned(), metrics.command.clone()],
        vec!["version".into(), format!("scrnn {}", metrics.version)],
        vec!["machine".into(), metrics.machine.in_words()],
        vec!["time of this call".into(), time],
    ];
    let sheet = Sheet { caption: "Circumstances".into(), head: Vec::new(), rows, note: String::new() };
    let mut blocks = vec![Block::Sheet(sheet), Block::Sheet(times(results))];
    for settings in results.settings.iter().flatten() {
        blocks.push(Block::Verbatim(toml::to_string(settings).unwrap_or_default()));
    }
    Section { title: "Settings, machine, time".into(), blocks }
}

/// Times over seeds. No goal asks for them.
fn times<F>(results: &Results<F>) -> Sheet {
    let several = results.jobs.len() > 1;
    let mut head = vec!["time".to_owned(), if several { "mean \u{b1} sd".into() } else { "ours".to_owned() }];
    head.extend(heads_of_values(results, several));
    let mut rows: Vec<Vec<String>> = results
        .times
        .iter()
        .filter(|summary| !summary.known().is_empty())
        .map(|summary| {
            let mut row = vec![summary.explained(), summary.shown_mean()];
            row.extend(values(results, summary, several));
            row
        })
        .collect();
    if results.conditions.len() == 1 {
        let mut row = vec!["Threads".to_owned(), String::new()];
        row.extend(results.jobs.iter().filter(|_| several).map(|job| job.threads.to_string()));
        if !several {
            row[1] = results.jobs[0].threads.to_string();
        }
        rows.push(row);
    }
    Sheet {
        caption: "Times".into(),
        head,
        rows,
        note:
            "Times depend on the machine and on what else it has to do: they are reported, and no goal asks for them."
                .into(),
    }
}
