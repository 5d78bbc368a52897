//! The result as tables of text.

use std::path::Path;
use std::time::Duration;

use scrnn_report::{FIGURES, PAGE, Table, in_words};

use super::measure::Summary;
use super::metrics::{METRICS, Metrics};

/// Measures, goals and times.
pub fn text<F>(metrics: &Metrics<'_, F>, folder: &Path) -> String {
    let took = in_words(Duration::from_secs_f64(metrics.seconds));
    let (measures, goals, times) = (measures(metrics), goals(metrics), times(metrics));
    let folder = folder.display();
    format!("{measures}\n{goals}\n{times}\nafter {took}: {folder}/{PAGE}, {folder}/{METRICS}, {folder}/{FIGURES}/\n")
}

/// A column for each seed, unless there are several conditions: then there are too many.
fn with_seeds<F>(metrics: &Metrics<'_, F>, head: &[&str], tail: &[&str]) -> Table {
    let numbers: Vec<String> = if single(metrics) {
        metrics.results.jobs.iter().map(|job| format!("seed {}", job.seed)).collect()
    } else {
        Vec::new()
    };
    let cells: Vec<&str> =
        head.iter().copied().chain(numbers.iter().map(String::as_str)).chain(tail.iter().copied()).collect();
    Table::new(&cells)
}

fn single<F>(metrics: &Metrics<'_, F>) -> bool {
    metrics.results.conditions.len() == 1
}

fn measures<F>(metrics: &Metrics<'_, F>) -> Table {
    let mut table = with_seeds(metrics, &["measure", "thesis"], &["mean"]);
    for summary in metrics.results.summary.iter().filter(|summary| !summary.values.is_empty()) {
        let mut row = vec![summary.label.to_owned(), summary.thesis.to_owned()];
        row.extend(values(metrics, summary));
        row.push(summary.shown_mean());
        table.row(row);
    }
    table
}

fn values<F>(metrics: &Metrics<'_, F>, summary: &Summary) -> Vec<String> {
    match single(metrics) {
        true => summary.values.iter().map(|&value| summary.shown(value)).collect(),
        false => Vec::new(),
    }
}

/// What each seed found, and what all of them found together.
fn goals<F>(metrics: &Metrics<'_, F>) -> Table {
    let together = metrics.verdicts.iter().any(|verdict| verdict.found.is_some());
    let tail: &[&str] = if together { &["found", "verdict"] } else { &["verdict"] };
    let mut table = with_seeds(metrics, &["goal", "needed"], tail);
    for verdict in &metrics.verdicts {
        let mut row = vec![verdict.goal.clone(), verdict.needed.clone()];
        row.extend(verdict.seeds.iter().map(|seed| seed.found.clone()));
        if together {
            row.push(verdict.found.clone().unwrap_or_default());
        }
        row.push(verdict.word().to_owned());
        table.row(row);
    }
    table
}

/// Reported, and not judged.
fn times<F>(metrics: &Metrics<'_, F>) -> Table {
    let mut table = with_seeds(metrics, &["time"], &["mean"]);
    for summary in metrics.results.times.iter().filter(|summary| !summary.known().is_empty()) {
        let mut row = vec![summary.label.to_owned()];
        row.extend(values(metrics, summary));
        row.push(summary.shown_mean());
        table.row(row);
    }
    table
}
