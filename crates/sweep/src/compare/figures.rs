//! Figures of a comparison: a curve or a heat map for each measure, learning curves over each other, closed loops and initial states.

use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn_report::{Block, Chart, Figure, Mark, Panel, Series, Tone};
use scrnn_run::generating::{Generating, generating};
use scrnn_run::trained::Trained;
use serde_json::Value;

use super::collected::{Collected, Row};
use super::learned::LearnedData;
use super::statistics::{Summary, ranked};
use crate::measures::{Better, Measure};
use crate::plan::shown;

/// Points of all learning curves of a page, and fewest and most of one.
const POINTS: usize = 24_000;
const OF_CURVE: (usize, usize) = (12, 150);
/// Learning curves that are drawn.
const CURVES: usize = 1000;
/// Settings that have panels of their own.
const PANELS: usize = 24;
/// Settings whose closed loops and initial states are drawn.
const LOOPS: usize = 12;
/// Steps of a closed loop.
const STEPS: usize = 300;
/// Most columns and rows of a heat map.
const CELLS: usize = 24;
/// Columns of a heat map that leave room for numbers.
const WITH_NUMBERS: usize = 8;

fn figure(file: &str, title: &str, caption: String, chart: Chart) -> Block {
    Block::Figure(Box::new(Figure {
        file: file.into(),
        title: title.into(),
        caption,
        thesis: String::new(),
        drawing: chart.into(),
    }))
}

/// A number on a page.
pub fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.3e}"),
        size if size >= 100.0 => format!("{value:.1}"),
        _ => format!("{value:.4}"),
    }
}

/// One measure of all settings: against the only knob, as a map of two, or setting by setting.
pub fn measure(collected: &Collected, measure: &Measure) -> Option<Block> {
    let summaries: Vec<(usize, Summary)> = {
        let mut all = ranked(collected, measure);
        all.sort_by_key(|(setting, _)| *setting);
        all
    };
    if summaries.is_empty() {
        return None;
    }
    let file = format!("measure-{}", measure.key.replace('.', "-"));
    let block = match collected.knobs.len() {
        1 if !collected.has_conditions => curve(collected, measure, &summaries, &file),
        2 if !collected.has_conditions => heat_map(collected, measure, &summaries, &file),
        _ => None,
    };
    Some(block.unwrap_or_else(|| side_by_side(collected, measure, &summaries, &file)))
}

/// Each network and the mean over seeds with its standard deviation, at these places.
fn series(collected: &Collected, measure: &Measure, places: &[(f64, usize, Summary)], joined: bool) -> Vec<Series> {
    let dots = places
        .iter()
        .flat_map(|&(x, setting, _)| collected.values(setting, measure).into_iter().map(move |value| (x, value)));
    let mut all = vec![Series::dots("each network", Tone::Data, dots.collect())];
    for &(x, _, one) in places.iter().filter(|(_, _, one)| one.deviation.is_finite()) {
        let ends = vec![(x, one.mean - one.deviation), (x, one.mean + one.deviation)];
        all.push(Series::line("one sd over seeds", Tone::Level(2), ends));
    }
    let means: Vec<(f64, f64)> = places.iter().map(|&(x, _, one)| (x, one.mean)).collect();
    all.push(match joined && means.len() > 1 {
        true => Series::line("mean over seeds", Tone::Ours, means),
        false => Series::dots("mean over seeds", Tone::Ours, means),
    });
    all
}

fn better(measure: &Measure) -> &'static str {
    match measure.better {
        Better::Lower => " Lower is better.",
        Better::Higher => " Higher is better.",
        Better::Neither => "",
    }
}

/// Numbers that span so much are drawn by their logarithm.
fn is_logarithmic(values: &[f64]) -> bool {
    let (least, greatest) = values.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &value| (a.min(value), b.max(value)));
    least > 0.0 && greatest / least >= 50.0
}

/// Against the only knob, whose values are numbers.
fn curve(collected: &Collected, measure: &Measure, summaries: &[(usize, Summary)], file: &str) -> Option<Block> {
    let numbers: Vec<f64> =
        summaries.iter().map(|(setting, _)| collected.settings[*setting].1[0].as_f64()).collect::<Option<_>>()?;
    let log = is_logarithmic(&numbers);
    let mut places: Vec<(f64, usize, Summary)> = (summaries.iter().zip(&numbers))
        .map(|(&(setting, one), &value)| (if log { value.log10() } else { value }, setting, one))
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let knob = &collected.knobs[0];
    let chart = Chart {
        columns: 1,
        aspect: 1.9,
        x_label: if log { format!("log10 of {knob}") } else { knob.clone() },
        y_label: measure.key.to_owned(),
        panels: vec![Panel::spanning("", series(collected, measure, &places, true))],
    };
    let caption = format!(
        "Every network, and mean and standard deviation over the seeds of each value of {knob}.{}",
        better(measure)
    );
    Some(figure(file, measure.label, caption, chart))
}

/// The values of a knob, in order.
fn values_of(collected: &Collected, knob: usize) -> Vec<Value> {
    let mut values: Vec<Value> = Vec::new();
    for (_, all) in &collected.settings {
        if !values.contains(&all[knob]) {
            values.push(all[knob].clone());
        }
    }
    values.sort_by(|a, b| match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => a.total_cmp(&b),
        _ => std::cmp::Ordering::Equal,
    });
    values
}

/// Two knobs as columns and rows.
fn heat_map(collected: &Collected, measure: &Measure, summaries: &[(usize, Summary)], file: &str) -> Option<Block> {
    let (columns, rows) = (values_of(collected, 0), values_of(collected, 1));
    if columns.len() > CELLS || rows.len() > CELLS || columns.len() < 2 || rows.len() < 2 {
        return None;
    }
    let means = summaries.iter().map(|(_, one)| one.mean);
    let (least, greatest) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), mean| (a.min(mean), b.max(mean)));
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for &(setting, one) in summaries {
        let values = &collected.settings[setting].1;
        let place =
            |all: &[Value], value: &Value| all.iter().position(|other| other == value).unwrap_or(0) as f64 + 1.0;
        points.push((place(&columns, &values[0]), place(&rows, &values[1])));
        let strength = if greatest > least { (one.mean - least) / (greatest - least) } else { 0.5 };
        let strength = if measure.better == Better::Lower { 1.0 - strength } else { strength };
        cells.push((strength, if columns.len() <= WITH_NUMBERS { short(one.mean) } else { String::new() }));
    }
    let cells = Series { name: measure.key.to_owned(), tone: Tone::Ours, mark: Mark::Cells(cells), points };
    let (width, height) = (columns.len() as f64, rows.len() as f64);
    // Room for the rows' names, in units of cells.
    let left = -(0.35 + 0.12 * width);
    let texts = |values: &[Value]| values.iter().map(shown).collect::<Vec<_>>();
    let names = vec![
        Series {
            name: String::new(),
            tone: Tone::Ink,
            mark: Mark::Texts(texts(&columns)),
            points: (1..=columns.len()).map(|k| (k as f64, 0.1)).collect(),
        },
        Series {
            name: String::new(),
            tone: Tone::Ink,
            mark: Mark::Texts(texts(&rows)),
            points: (1..=rows.len()).map(|k| (f64::midpoint(left, 0.5), k as f64)).collect(),
        },
    ];
    let panel = Panel {
        title: String::new(),
        x: (left, width + 0.5),
        y: (-0.3, height + 0.5),
        series: std::iter::once(cells).chain(names).collect(),
        failed: false,
        equal: false,
    };
    let (across, up) = (&collected.knobs[0], &collected.knobs[1]);
    let chart = Chart {
        columns: 1,
        aspect: (1.6 * (width + 1.5) / (height + 1.0)).clamp(0.7, 2.6),
        x_label: across.clone(),
        y_label: up.clone(),
        panels: vec![panel],
    };
    let caption = format!(
        "Means over seeds: {across} from left to right, {up} from below to above; the stronger the colour, the {}.",
        match measure.better {
            Better::Neither => "larger",
            _ => "better",
        }
    );
    Some(figure(file, measure.label, caption, chart))
}

/// Setting by setting, in the order of the table.
fn side_by_side(collected: &Collected, measure: &Measure, summaries: &[(usize, Summary)], file: &str) -> Block {
    let places: Vec<(f64, usize, Summary)> =
        summaries.iter().map(|&(setting, one)| (setting as f64 + 1.0, setting, one)).collect();
    let mut panel = Panel::spanning("", series(collected, measure, &places, false));
    panel.x = (0.4, collected.settings.len() as f64 + 0.6);
    let chart = Chart {
        columns: 1,
        aspect: 1.9,
        x_label: "setting, by its number in the table".into(),
        y_label: measure.key.to_owned(),
        panels: vec![panel],
    };
    let caption =
        format!("Every network, and mean and standard deviation over the seeds of each setting.{}", better(measure));
    figure(file, measure.label, caption, chart)
}

/// At most so many points of a curve, evenly, with its last.
fn thinned(curve: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    let every = curve.len().div_ceil(most.max(2) - 1).max(1);
    let mut thin: Vec<(f64, f64)> = curve.iter().copied().step_by(every).collect();
    if let Some(last) = curve.last().filter(|last| thin.last() != Some(*last)) {
        thin.push(*last);
    }
    thin
}

/// The setting of a run, its learning curve, and whether that is the nll.
type Curve = (usize, Vec<(f64, f64)>, bool);

/// Learning curves over each other: a colour for each of a few settings, a panel for each of several.
pub fn learning(collected: &Collected, order: &[usize]) -> Option<Block> {
    let drawn: Vec<usize> = order.iter().copied().take(PANELS).collect();
    let runs: Vec<&Row> = drawn.iter().flat_map(|&setting| collected.of(setting)).take(CURVES).collect();
    let most = (POINTS / runs.len().max(1)).clamp(OF_CURVE.0, OF_CURVE.1);
    let curves: Vec<Curve> = (runs.iter())
        .map(|run| {
            let (curve, with_variance) = run.curve();
            (run.setting, thinned(&curve, most), with_variance)
        })
        .filter(|(_, curve, _)| curve.len() > 1)
        .collect();
    let with_variance = curves.iter().all(|(_, _, with_variance)| *with_variance);
    // What the first epochs come down from would flatten all the rest.
    let late = curves.iter().flat_map(|(_, curve, _)| &curve[(curve.len() / 10).max(1).min(curve.len() - 1)..]);
    let (low, high) = late
        .filter(|(_, y)| y.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &(_, y)| (a.min(y), b.max(y)));
    let last = curves.iter().filter_map(|(_, curve, _)| curve.last()).map(|point| point.0).fold(0.0, f64::max);
    if curves.is_empty() || low > high {
        return None;
    }
    let room = 0.05 * (high - low).max(1e-9);
    let panel = |title: &str, series: Vec<Series>| Panel {
        title: title.to_owned(),
        x: (0.0, last),
        y: (low - room, high + room),
        series,
        failed: false,
        equal: false,
    };
    let of = |setting: usize, name: &str, tone: Tone| -> Vec<Series> {
        let own = curves.iter().filter(|(other, _, _)| *other == setting);
        own.map(|(_, curve, _)| Series::line(name, tone, curve.clone())).collect()
    };
    let (columns, panels) = if drawn.len() <= 4 {
        let all = (0..).zip(&drawn).flat_map(|(k, &setting)| of(setting, collected.called(setting), Tone::Level(k)));
        (1, vec![panel("", all.collect())])
    } else {
        (3, drawn.iter().map(|&setting| panel(collected.called(setting), of(setting, "", Tone::Ours))).collect())
    };
    let y_label = if with_variance { "nll" } else { "log10 of the squared error" };
    let more = match order.len() > drawn.len() {
        true => format!(" The {} best settings of {}.", drawn.len(), order.len()),
        false => String::new(),
    };
    let caption = format!(
        "How each network learned, to epoch {last}, every seed of a setting over the others: {y_label} per step and channel of the learned \
         sequences. All panels have the same axes.{more}"
    );
    let chart = Chart {
        columns,
        aspect: if columns == 1 { 2.0 } else { 1.3 },
        x_label: "epoch".into(),
        y_label: y_label.into(),
        panels,
    };
    Some(figure("learning", "Learning curves", caption, chart))
}

/// One network of each setting: that of the first seed which is finished.
fn networks(collected: &Collected, order: &[usize]) -> Vec<(usize, Trained)> {
    let of = |&setting: &usize| {
        let run = collected.of(setting).find(|run| run.is_whole)?;
        Some((setting, Trained::open(&run.path, false).ok()?))
    };
    order.iter().filter_map(of).take(LOOPS).collect()
}

/// Closed loops and initial states of the settings beside each other.
pub fn networks_beside_each_other(collected: &Collected, order: &[usize], learned: &mut LearnedData) -> Vec<Block> {
    let networks = networks(collected, order);
    let (mut loops, mut planes) = (Vec::new(), Vec::new());
    for (setting, trained) in &networks {
        let name = collected.called(*setting);
        loops.extend(closed_loop(trained, learned.of(trained), name));
        planes.extend(plane(trained, name));
    }
    let more = match order.len() > networks.len() {
        true => format!(" The {} best settings that have a finished network.", networks.len()),
        false => String::new(),
    };
    let mut blocks = Vec::new();
    if !loops.is_empty() {
        let caption = format!(
            "The first learned sequence on its first channel, and the network of the setting's first seed on its own from the state that it \
             learned for it, without noise.{more}"
        );
        let columns = if loops.len() > 1 { 3 } else { 1 };
        let chart = Chart { columns, aspect: 1.4, x_label: "sample".into(), y_label: "value".into(), panels: loops };
        blocks.push(figure("closed-loops", "Closed loops", caption, chart));
    }
    if !planes.is_empty() {
        let caption = format!(
            "The initial states of all learned sequences in the plane of their first two principal components, of the same networks. Each panel \
             has axes of its own.{more}"
        );
        let columns = if planes.len() > 1 { 3 } else { 1 };
        let chart = Chart {
            columns,
            aspect: 1.2,
            x_label: "first component".into(),
            y_label: "second component".into(),
            panels: planes,
        };
        blocks.push(figure("initial-states", "Initial states", caption, chart));
    }
    blocks
}

fn closed_loop(trained: &Trained, data: Option<&Dataset>, name: &str) -> Option<Panel> {
    let checkpoint = &trained.checkpoint;
    let how = Generating::with(|it| (it.noise, it.steps) = (false, Some(STEPS)));
    let again = Trained::of(trained.path.clone(), checkpoint.clone()).ok()?;
    let generated = generating(&[again], &how, &Engine::serial()).ok()?;
    let (_, means) = generated.iter().find(|(name, _)| *name == "mean")?;
    let (n, delay) = (checkpoint.channels.len(), checkpoint.topology.delay());
    let own = means.sequences().first()?.values().iter().step_by(n).enumerate();
    let mut series = Vec::new();
    if let Some(sequence) = data.and_then(|data| data.sequences().first()) {
        let recorded = sequence.values().iter().step_by(n).take(STEPS).enumerate();
        series.push(Series::line("learned", Tone::Data, recorded.map(|(k, &value)| (k as f64 + 1.0, value)).collect()));
    }
    series.push(Series::line(
        "on its own",
        Tone::Ours,
        own.map(|(k, &value)| ((k + delay) as f64 + 1.0, value)).collect(),
    ));
    Some(Panel::spanning(name, series))
}

fn plane(trained: &Trained, name: &str) -> Option<Panel> {
    let states = &trained.checkpoint.initial_states;
    let units = trained.checkpoint.topology.context_units();
    if states.sequences() < 3 || units < 2 {
        return None;
    }
    let components = PrincipalComponents::of(states.values(), units)?;
    let points = components.first(2).chunks_exact(2).map(|point| (point[0], point[1])).collect();
    Some(Panel::spanning(name, vec![Series::dots("sequence", Tone::Ours, points)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_curves_keep_their_ends() {
        let curve: Vec<(f64, f64)> = (0..1001).map(|k| (f64::from(k), f64::from(k * k))).collect();
        let thin = thinned(&curve, 20);
        assert!(thin.len() <= 20 && thin[0] == curve[0] && thin.last() == curve.last(), "{}", thin.len());
        assert_eq!(thinned(&curve[..3], 20), curve[..3]);
    }

    #[test]
    fn values_over_many_magnitudes_are_drawn_by_their_logarithm() {
        assert!(is_logarithmic(&[1e-5, 1e-3, 10.0]));
        assert!(!is_logarithmic(&[10.0, 20.0, 30.0]) && !is_logarithmic(&[0.0, 1.0, 1000.0]));
    }

    #[test]
    fn numbers_on_a_page_are_short() {
        assert_eq!([0.0, -1.23456, 1234.5678, 1.5e-7].map(short), ["0", "-1.2346", "1234.6", "1.500e-7"]);
    }
}
