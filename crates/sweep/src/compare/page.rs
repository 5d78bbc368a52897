//! The page of a comparison.

use scrnn_report::{Block, Page, Section, Sheet};

use super::collected::Collected;
use super::figures::{learning, measure as figure_of, networks_beside_each_other, short};
use super::learned::LearnedData;
use super::playing::{Room, networks_to_play_with};
use super::statistics::{Best, Pair, ranked, tests};
use crate::measures::{Better, Measure};

/// Settings of a table; metrics.csv has all.
const ROWS: usize = 200;
/// Measures that have figures of their own.
const FIGURES: usize = 8;
/// Tests of a table.
const TESTS: usize = 60;
/// Links to pages.
const LINKS: usize = 5000;
/// Bytes of a page; what says which networks are left out comes on top.
const BYTES: usize = 4_900_000;
/// Runs that came to nothing, one by one.
const LOST: usize = 100;

/// Everything on one page, with so many networks in it to be played with.
pub fn page(collected: &Collected, best: Option<&Best>, networks: usize) -> Page {
    let whole = collected.runs.iter().filter(|run| run.is_whole).count();
    let (runs, settings) = (collected.runs.len(), collected.settings.len());
    let lede = format!(
        "{whole} of {runs} networks are finished, of {settings} setting{}{}. All numbers are in metrics.csv.",
        if settings == 1 { "" } else { "s" },
        match collected.knobs.as_slice() {
            [] => String::new(),
            knobs => format!(" that differ in {}", knobs.join(", ")),
        }
    );
    let shown: Vec<&'static Measure> = {
        let telling = |measure: &&&'static Measure| measure.better != Better::Neither;
        collected.measures.iter().filter(telling).take(FIGURES).copied().collect()
    };
    // The best first, then those without values.
    let mut order: Vec<usize> = collected
        .measures
        .first()
        .map_or(Vec::new(), |measure| ranked(collected, measure).into_iter().map(|one| one.0).collect());
    order.extend((0..settings).filter(|setting| !order.contains(setting)).collect::<Vec<_>>());

    let mut sections = Vec::new();
    let mut push = |title: &str, blocks: Vec<Block>| {
        if !blocks.is_empty() {
            sections.push(Section { title: title.to_owned(), blocks });
        }
    };
    // First the picture that answers the question, then the answer.
    let mut figures = shown.iter().filter_map(|measure| figure_of(collected, measure));
    push("Which setting is best", figures.next().into_iter().chain(verdict(collected, best)).collect());
    push("Other measures", figures.collect());
    push("Settings", sheet_of_settings(collected, &order));
    push(
        "Differences between settings",
        shown.iter().take(3).filter_map(|measure| sheet_of_tests(collected, measure)).collect(),
    );
    push("Learning", learning(collected, &order).into_iter().collect());
    let mut learned = LearnedData::default();
    push("Networks", networks_beside_each_other(collected, &order, &mut learned));
    push("Runs", links(collected));
    let mut page = Page { title: format!("Comparison: {}", collected.name), lede, sections };
    // What all the rest leaves of the page is for networks to play with, and stands before the links.
    let bytes = BYTES.saturating_sub(page.html().len());
    let blocks = networks_to_play_with(collected, &order, &mut learned, Room { networks, bytes });
    if !blocks.is_empty() {
        page.sections.insert(page.sections.len() - 1, Section { title: "Play with them".into(), blocks });
    }
    page
}

fn verdict(collected: &Collected, best: Option<&Best>) -> Vec<Block> {
    let Some(best) = best else {
        let text = "Nothing tells which setting is best: no setting has all its networks finished, or no measure says which way is better.";
        return vec![Block::Text(text.to_owned())];
    };
    let Best { setting, summary, luckiest, as_good, left_out, .. } = best;
    let label = collected.measures.first().map_or("", |measure| measure.label);
    let spread = match summary.deviation.is_finite() {
        true => format!(" \u{b1} {} (standard deviation)", short(summary.deviation)),
        false => String::new(),
    };
    let mut text = match collected.settings.len() {
        1 => format!("{label}: {}{spread} over {} networks.", short(summary.mean), summary.count),
        _ => format!(
            "Over all seeds the best setting is {setting}: {label} {}{spread}, mean of {} networks, {} to {}.",
            short(summary.mean),
            summary.count,
            short(summary.least),
            short(summary.greatest)
        ),
    };
    if let Some((other, seed, value)) = luckiest {
        text += &format!(
            " The single best network is another setting's, {other} with seed {seed} ({}): that is the luck of one seed, the setting is worse on \
             average.",
            short(*value)
        );
    }
    let list = |names: &[String]| {
        let shown = names.iter().take(8).map(String::as_str).collect::<Vec<_>>().join("; ");
        if names.len() > 8 { format!("{shown}; and {} more", names.len() - 8) } else { shown }
    };
    let mut blocks = vec![Block::Verdict(text)];
    if !as_good.is_empty() {
        blocks.push(Block::Text(format!(
            "Not to be told from it at 5 % (Welch's t-test, Holm's correction): {}.",
            list(as_good)
        )));
    }
    if summary.count == 1 && collected.settings.len() > 1 {
        blocks.push(Block::Text(
            "Each setting has one network only: a difference may be chance. Give it more `seeds`.".into(),
        ));
    }
    if !left_out.is_empty() {
        blocks
            .push(Block::Text(format!("Left out, since not all of their networks are finished: {}.", list(left_out))));
    }
    blocks
}

/// A row for each setting, the best first.
fn sheet_of_settings(collected: &Collected, order: &[usize]) -> Vec<Block> {
    let measures: Vec<&Measure> = collected.measures.iter().take(FIGURES).copied().collect();
    let head = ["number", "setting", "networks"].into_iter().chain(measures.iter().map(|measure| measure.key));
    let row = |&setting: &usize| {
        let (all, whole) = (collected.of(setting).count(), collected.of(setting).filter(|run| run.is_whole).count());
        let networks = if all == whole { all.to_string() } else { format!("{whole} of {all}") };
        let cell = |measure: &&Measure| match super::Summary::of(&collected.values(setting, measure)) {
            None => "\u{2013}".to_owned(),
            Some(one) if one.deviation.is_finite() => format!("{} \u{b1} {}", short(one.mean), short(one.deviation)),
            Some(one) => short(one.mean),
        };
        let words = [(setting + 1).to_string(), collected.called(setting).to_owned(), networks];
        words.into_iter().chain(measures.iter().map(cell)).collect()
    };
    let more = order.len().saturating_sub(ROWS);
    let mut note = "Mean and standard deviation over seeds; the best setting first.".to_owned();
    if more > 0 {
        note += &format!(" {more} more settings are in metrics.csv.");
    }
    let key =
        measures.iter().map(|measure| format!("{}: {}", measure.key, measure.label)).collect::<Vec<_>>().join("; ");
    let sheet = Sheet {
        caption: "All settings".into(),
        head: head.map(str::to_owned).collect(),
        rows: order.iter().take(ROWS).map(row).collect(),
        note,
    };
    vec![Block::Sheet(sheet), Block::Text(format!("{key}."))]
}

fn sheet_of_tests(collected: &Collected, measure: &Measure) -> Option<Block> {
    let pairs = tests(collected, measure);
    if pairs.is_empty() {
        return None;
    }
    let row = |Pair { settings: (a, b), test, corrected }: &Pair| {
        let p = |p: f64| if p < 1e-3 { format!("{p:.1e}") } else { format!("{p:.3}") };
        vec![
            format!("{} against {}", collected.called(*a), collected.called(*b)),
            // Second, so that a phone shows it.
            if *corrected < 0.05 { "yes" } else { "no" }.to_owned(),
            short(test.difference),
            format!("{:.2}", test.t),
            format!("{:.1}", test.degrees),
            p(test.p),
            p(*corrected),
        ]
    };
    let count = pairs.len();
    let mut note = format!("Welch's t-test; p is corrected by Holm's method for all {count} tests of this measure.");
    if count > TESTS {
        note += &format!(" {} more are left out.", count - TESTS);
    }
    Some(Block::Sheet(Sheet {
        caption: measure.label.to_owned(),
        head: ["settings", "differ at 5 %", "difference", "t", "degrees", "p", "corrected p"]
            .map(String::from)
            .to_vec(),
        rows: pairs.iter().take(TESTS).map(row).collect(),
        note,
    }))
}

/// Links to the runs' pages, and what came to nothing.
fn links(collected: &Collected) -> Vec<Block> {
    let links: Vec<(String, String)> =
        collected.runs.iter().filter_map(|run| Some((run.name.clone(), run.link.clone()?))).take(LINKS).collect();
    let lost: Vec<_> = collected.runs.iter().filter(|run| !run.is_whole).collect();
    let mut blocks = Vec::new();
    if links.is_empty() {
        blocks.push(Block::Text(
            "No run has a page of its own; `scrnn report RUN` makes one, and so does `report = true` under [then]."
                .into(),
        ));
    } else {
        blocks.push(Block::Links(links));
    }
    if !lost.is_empty() {
        let row =
            |run: &&&super::Row| vec![run.name.clone(), run.state.to_owned(), run.message.clone().unwrap_or_default()];
        let note = match lost.len() > LOST {
            true => format!("{} more are in metrics.csv.", lost.len() - LOST),
            false => String::new(),
        };
        blocks.push(Block::Sheet(Sheet {
            caption: "Networks that are not finished".into(),
            head: ["run", "state", ""].map(String::from).to_vec(),
            rows: lost.iter().take(LOST).map(|run| row(&run)).collect(),
            note,
        }));
    }
    blocks
}
