//! A mixture of networks as a page: how its members learned, and how they do together on what none of them learned.

use scrnn::engine::Engine;
use scrnn_report::{Block, Page, Section, Sheet};
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::Result;
use scrnn_run::history::Row;
use scrnn_run::members;
use scrnn_run::notes::Score;
use scrnn_run::trained::Trained;

use crate::{held_out, learning_curves, playground};

/// The page about the mixture of these networks; `rows` of the history of each.
///
/// # Errors
/// What is wrong with the run's data.
pub fn page(all: &[Trained], rows: &[Vec<Row>], engine: &Engine) -> Result<Page> {
    let runs: Vec<(String, &[Row])> =
        rows.iter().enumerate().map(|(k, rows)| (format!("member {}", k + 1), rows.as_slice())).collect();
    let mut sections = vec![Section {
        title: "Learning".into(),
        blocks: vec![learning_curves("learning", "Learning curves", &runs, None), Block::Sheet(members_sheet(all))],
    }];
    let notes = all.first().and_then(|one| one.notes.as_ref());
    let experiment: Option<Experiment> = notes.and_then(|notes| serde_json::from_value(notes.experiment.clone()).ok());
    let mut name = "a mixture".to_owned();
    // Data that are gone are no reason to show nothing of the networks.
    if let Some(Ok(source)) = all.first().map(|first| first.source(engine.threads())) {
        sections.extend(playground::section(all, &source.data));
    }
    if let Some(experiment) = &experiment {
        name.clone_from(&experiment.name);
        if let Some(judgement) = members::judge(all, experiment, engine)? {
            sections.push(held_out::section(&judgement));
        }
        let text = toml::to_string(experiment).unwrap_or_default();
        sections.push(Section { title: "Settings of the first member".into(), blocks: vec![Block::Verbatim(text)] });
    }
    let lede = format!(
        "A mixture of {} networks: its density is the mean of theirs. `scrnn report` of a member's folder draws what that network \
         does.",
        all.len()
    );
    Ok(Page { title: format!("Run: {name}"), lede, sections })
}

/// Where each member stands.
fn members_sheet(all: &[Trained]) -> Sheet {
    let shown = |value: Option<f64>| value.map_or("\u{2013}".to_owned(), |value| format!("{value:.4}"));
    let row = |(k, one): (usize, &Trained)| {
        let score: Option<Score> = one.notes.as_ref().and_then(|notes| notes.score);
        let held_out = one.notes.as_ref().and_then(|notes| notes.best).and_then(|best| best.held_out);
        vec![
            (k + 1).to_string(),
            one.checkpoint.epoch.to_string(),
            shown(score.and_then(|score| score.nll)),
            shown(held_out.and_then(|held_out| held_out.nll)),
        ]
    };
    Sheet {
        caption: "Members".into(),
        head: ["member", "epoch", "nll", "best nll on what is held out"].map(String::from).to_vec(),
        rows: all.iter().enumerate().map(row).collect(),
        note: "Per step and channel, in scaled units.".into(),
    }
}
