//! What is drawn of the first network of each condition: Figs. 5.3, 5.5, 5.6, 5.9 and 5.10.

use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn::dataset::Sequence;
use scrnn::error_regression::ErrorRegressionOptions;
use scrnn::generation::Generated;
use scrnn_sim::interact::Followed;
use scrnn_sim::interact::branchings;

use super::trials::{SHOWN_LOOP, Subject};
use super::world::{SHOWN, Snapshot};
use crate::framework::Result;
use scrnn_report::{Chart, Figure, Panel, Series, Tone};
use scrnn_tasks::interact::BRANCHES;

/// Channels that the thesis draws: the object's column, the head's yaw, the shoulder's pitch, the elbow's yaw.
const DRAWN: [(usize, &str); 4] = [(0, "object x"), (2, "head yaw"), (4, "shoulder pitch"), (6, "elbow yaw")];
/// Samples around the modification that Fig. 5.10 shows, before and after.
const AROUND: (usize, usize) = (46, 44);
/// Samples from one of its moments to the next.
const APART: usize = 3;

/// Of one network, in its units.
#[derive(Debug)]
pub struct Material {
    condition: &'static str,
    delay: usize,
    /// Fast and slow units to draw, by their places.
    units: [Vec<usize>; 2],
    /// Initial states of the slow units, row by row.
    states: Vec<f64>,
    names: Vec<String>,
    recording: Sequence,
    closed: Generated,
    order: String,
    world: Followed,
    regressed: Option<(Followed, Vec<Snapshot>)>,
    deviation_of_states: f64,
    /// Offset and scale of the object's column.
    column: (f64, f64),
}

impl Material {
    /// Runs what is drawn.
    pub fn of(condition: &'static str, subject: &Subject<'_>) -> Result<Self> {
        let shown = subject.data.sequences().iter().position(|one| one.name == SHOWN).unwrap_or(0);
        subject.desk.at(|| "what is drawn".to_owned())?;
        let closed = subject.on_its_own(|s| s, SHOWN_LOOP, true)?.swap_remove(shown);
        let state = subject.states.sequence(subject.other());
        let options = ErrorRegressionOptions::adam(subject.data.channels().len());
        let quiet = {
            let mut it = options.clone();
            it.iterations = 0;
            it
        };
        let topology = &subject.network.topology();
        let learned: Vec<bool> = topology.per_unit(|group| group.learns_initial_state).collect();
        let places = |slow: bool| (0..learned.len()).filter(|&i| learned[i] == slow).collect::<Vec<_>>();
        let slow = places(true);
        let of_slow = |s: usize| slow.iter().map(move |&i| (s, i));
        let sequences = subject.states.sequences();
        let states: Vec<f64> = (0..sequences).flat_map(of_slow).map(|(s, i)| subject.states.sequence(s)[i]).collect();
        let components = PrincipalComponents::of(&states, slow.len());
        let variances = components.map(|components| components.variances).unwrap_or_default();
        let variance = variances.iter().sum::<f64>() / slow.len() as f64;
        Ok(Self {
            condition,
            delay: topology.delay(),
            units: [places(false), slow.clone()].map(|mut list| {
                list.truncate(5);
                list
            }),
            states,
            names: subject.data.sequences().iter().map(|one| one.name.clone()).collect(),
            recording: subject.data.sequences()[shown].clone(),
            order: subject.order_of(&closed),
            closed,
            world: subject.shown(state, &quiet)?.0,
            regressed: if condition == "wide" { Some(subject.shown(state, &options)?) } else { None },
            deviation_of_states: variance.sqrt(),
            column: (subject.scaling.offset()[0], subject.scaling.scale()[0]),
        })
    }
}

fn samples() -> usize {
    branchings(BRANCHES + 1)[BRANCHES]
}

/// Lines of some columns of rows; row k stands for sample `first` + k.
fn lines(rows: &[f64], width: usize, columns: &[(usize, String)], first: usize, until: usize) -> Vec<Series> {
    let line = |(k, (column, name)): (usize, &(usize, String))| {
        let points = rows.chunks_exact(width).enumerate().map(|(row, values)| ((first + row) as f64, values[*column]));
        Series::line(name.clone(), Tone::Level(k), points.filter(|(x, _)| *x < until as f64).collect())
    };
    columns.iter().enumerate().map(line).collect()
}

fn drawn() -> Vec<(usize, String)> {
    DRAWN.map(|(channel, name)| (channel, name.to_owned())).to_vec()
}

fn unnamed(units: &[usize]) -> Vec<(usize, String)> {
    units.iter().map(|&unit| (unit, String::new())).collect()
}

/// A panel over all samples, with a line at each branching.
fn over_time(title: &str, y: Option<(f64, f64)>, series: Vec<Series>) -> Panel {
    let mut panel = Panel::spanning(title, series);
    panel.y = y.unwrap_or(panel.y);
    panel.x = (0.0, samples() as f64);
    let (low, high) = panel.y;
    let mark = |at: usize| Series::line("", Tone::Grid, vec![(at as f64, low), (at as f64, high)]);
    panel.series.splice(0..0, branchings(BRANCHES).into_iter().map(mark));
    panel
}

/// Mean and context of one sample.
type Held<'a> = (&'a Vec<f64>, &'a Vec<f64>);

const RANGE: Option<(f64, f64)> = Some((-1.0, 1.0));

fn figure(
    file: &str,
    title: &str,
    caption: String,
    thesis: &str,
    columns: usize,
    aspect: f64,
    panels: Vec<Panel>,
) -> Figure {
    let chart = Chart { columns, aspect, x_label: "sample".into(), y_label: String::new(), panels };
    Figure { file: file.into(), title: title.into(), caption, thesis: thesis.into(), drawing: chart.into() }
}

/// Fig. 5.3.
pub fn initial_states(materials: &[&Material]) -> Figure {
    let panels = materials.iter().map(|material| {
        let dimensions = material.states.len() / material.names.len();
        let components = PrincipalComponents::of(&material.states, dimensions);
        let plane = components.map(|components| components.first(2)).unwrap_or_default();
        let side = |letter: char| -> Vec<(f64, f64)> {
            let points = plane.chunks_exact(2).zip(&material.names);
            points.filter(|(_, name)| name.starts_with(letter)).map(|(point, _)| (point[0], point[1])).collect()
        };
        let title = format!("{}: sd {:.1e} a unit", material.condition, material.deviation_of_states);
        let series = vec![
            Series::dots("first to the left", Tone::Level(0), side('L')),
            Series::dots("first to the right", Tone::Level(2), side('R')),
        ];
        let mut panel = Panel::spanning(title, series);
        let widest = |(low, high): (f64, f64)| low.abs().max(high.abs());
        let reach = widest(panel.x).max(widest(panel.y));
        (panel.x, panel.y) = ((-reach, reach), (-reach, reach));
        panel
    });
    figure(
        "initial-states",
        "Initial states of the slow units",
        "Each dot is the learned initial state of one order, in the plane of its condition's first two principal components. Note the \
         axes: the narrow states lie thousands of times closer together."
            .into(),
        "Fig. 5.3: in one point for the narrow condition, spread out for the wide one.",
        2,
        1.2,
        panels.collect(),
    )
}

/// Fig. 5.5.
pub fn on_its_own(materials: &[&Material]) -> Figure {
    let (until, n) = (samples(), 8);
    let mut rows: [Vec<Panel>; 5] = Default::default();
    for material in materials {
        let (closed, context) = (&material.closed, material.closed.contexts.len() / (material.closed.mean.len() / n));
        let contexts = |units: &[usize]| lines(&closed.contexts, context, &unnamed(units), material.delay, until);
        let targets = lines(material.recording.values(), n, &drawn(), 0, until);
        rows[0].push(over_time(&format!("{}: recording {SHOWN}", material.condition), RANGE, targets));
        let means = lines(&closed.mean, n, &drawn(), material.delay, until);
        rows[1].push(over_time(&format!("its own: {}", material.order), RANGE, means));
        let variances = lines(&closed.variance, n, &drawn(), material.delay, until);
        rows[2].push(over_time("predicted variance", None, variances).with_zero());
        rows[3].push(over_time("slow units", RANGE, contexts(&material.units[1])));
        rows[4].push(over_time("fast units", RANGE, contexts(&material.units[0])));
    }
    figure(
        "on-its-own",
        "The network on its own",
        format!(
            "Started from the state of {SHOWN} and fed with its own predictions and their noise. Vertical lines stand where the \
             recording branches; five units of each group are drawn."
        ),
        "Fig. 5.5: the narrow network gives another order, with a peak of variance at each branching; the wide one gives the \
         order that it was started for, with nearly no variance.",
        materials.len().max(1),
        2.0,
        rows.into_iter().flatten().collect(),
    )
}

/// The panels of one interaction in the world.
fn world_panels(title: &str, material: &Material, followed: &Followed) -> Vec<Panel> {
    let (until, n) = (samples(), 8);
    let predicted: Vec<f64> = followed.steps.iter().filter_map(|moment| moment.predicted).flatten().collect();
    let variance: Vec<f64> = followed.steps.iter().flat_map(|moment| moment.variance.iter().copied()).collect();
    let error: Vec<(f64, f64)> =
        followed.steps.iter().enumerate().map(|(k, moment)| ((k + 1) as f64, moment.error)).collect();
    let hand: Vec<(f64, f64)> = followed.steps.iter().enumerate().map(|(k, moment)| (k as f64, moment.hand)).collect();
    let context: Vec<f64> = followed.steps.iter().flat_map(|moment| moment.context.iter().copied()).collect();
    let units = followed.steps.first().map_or(1, |moment| moment.context.len());
    let mut hands = vec![Series::line("", Tone::Ours, hand)];
    let hits =
        |(k, moment): (usize, &scrnn_sim::interact::ControlStep)| moment.collision.map(|_| (k as f64, moment.hand));
    let hits: Vec<(f64, f64)> = followed.steps.iter().enumerate().filter_map(hits).collect();
    if !hits.is_empty() {
        hands.push(Series::dots("collision", Tone::Failed, hits));
    }
    vec![
        over_time(title, RANGE, lines(&predicted, n, &drawn(), material.delay, until)),
        over_time("predicted variance", None, lines(&variance, n, &drawn(), material.delay, until)).with_zero(),
        over_time("the arm's error", None, vec![Series::line("", Tone::Failed, error)]).with_zero(),
        over_time("the hand: left 1, right -1", Some((-1.3, 1.3)), hands),
        over_time("slow units", RANGE, lines(&context, units, &unnamed(&material.units[1]), 1, until)),
        over_time("fast units", RANGE, lines(&context, units, &unnamed(&material.units[0]), 1, until)),
    ]
}

/// Side by side: the n-th panels of all columns make the n-th row.
fn in_rows(columns: Vec<Vec<Panel>>) -> Vec<Panel> {
    let mut columns: Vec<_> = columns.into_iter().map(Vec::into_iter).collect();
    let mut panels = Vec::new();
    loop {
        let row: Vec<Panel> = columns.iter_mut().filter_map(Iterator::next).collect();
        if row.is_empty() {
            return panels;
        }
        panels.extend(row);
    }
}

/// Fig. 5.6.
pub fn in_world(materials: &[&Material]) -> Figure {
    let column =
        |material: &&Material| world_panels(&format!("{}: predicted", material.condition), material, &material.world);
    figure(
        "in-the-world",
        "In the world, without error regression",
        format!(
            "Started from the state of LLRRL while the other robot moves {SHOWN}. The object is on the side that its order says."
        ),
        "Fig. 5.6: the narrow network follows every move; the wide one is late, and once the hands collide.",
        materials.len().max(1),
        2.0,
        in_rows(materials.iter().map(column).collect()),
    )
}

/// Fig. 5.9.
pub fn regressed(materials: &[&Material]) -> Option<Figure> {
    let (material, (followed, _)) = materials.iter().find_map(|&one| Some((one, one.regressed.as_ref()?)))?;
    Some(figure(
        "regressed",
        "In the world, with error regression",
        format!(
            "The wide network again, from the state of LLRRL while the other robot moves {SHOWN}; now its slow units jump when errors arise."
        ),
        "Fig. 5.9: errors are suppressed at once, and the slow units change in jumps.",
        2,
        2.0,
        world_panels("wide: predicted", material, followed),
    ))
}

/// The sample after which the tail jumped most, far enough from the ends.
fn modification(snapshots: &[Snapshot]) -> Option<usize> {
    let jump = |k: usize| -> f64 {
        // The tail slides by one step between samples: a jump is what is beyond the usual change.
        snapshots[k].tail.iter().zip(&snapshots[k - 1].tail).map(|(a, b)| (a - b).powi(2)).sum()
    };
    (AROUND.0 + APART..snapshots.len().checked_sub(AROUND.1)?).max_by(|&a, &b| jump(a).total_cmp(&jump(b)))
}

/// Fig. 5.10.
pub fn window(materials: &[&Material]) -> Option<Figure> {
    let (material, (followed, snapshots)) = materials.iter().find_map(|&one| Some((one, one.regressed.as_ref()?)))?;
    let centre = modification(snapshots)?;
    let (from, to) = (centre - AROUND.0, centre + AROUND.1);
    let mut columns = Vec::new();
    for (word, now) in [("before", centre - APART), ("modification", centre), ("after", centre + APART)] {
        // Each sample as the last window that held it left it, or as it is forecast.
        let held = |sample: usize| -> Option<Held<'_>> {
            let first = |k: usize| k + 1 - snapshots[k].window;
            let k = (0..=now).rev().find(|&k| first(k) <= sample && sample - first(k) < snapshots[k].means.len())?;
            let place = sample - first(k);
            // Only the present moment speaks about the future.
            (sample <= k || k == now).then(|| (&snapshots[k].means[place], &snapshots[k].contexts[place]))
        };
        let points = |of: &dyn Fn(&Held<'_>) -> f64, range: std::ops::Range<usize>| -> Vec<(f64, f64)> {
            range.filter_map(|sample| held(sample).map(|pair| (sample as f64, of(&pair)))).collect()
        };
        let (tail, head) = (now + 1 - snapshots[now].window, now + 1);
        let series = |of: &dyn Fn(&Held<'_>, usize) -> f64, columns: &[(usize, String)]| -> Vec<Series> {
            let mut all = Vec::new();
            for (k, (column, name)) in columns.iter().enumerate() {
                let past = points(&|pair| of(pair, *column), from..head);
                // The future is drawn by every second sample.
                let future = points(&|pair| of(pair, *column), head..to).into_iter().step_by(2).collect();
                all.push(Series::line(name.clone(), Tone::Level(k), past));
                all.push(Series::dots("", Tone::Level(k), future));
            }
            all
        };
        let sensed = |sample: usize| followed.steps.get(sample).map(|moment| moment.sensed);
        let panel = |title: String, y: (f64, f64), series: Vec<Series>| {
            let mut all: Vec<Series> = [tail, head]
                .map(|at| Series::line("", Tone::Grid, vec![(at as f64 - 0.5, y.0), (at as f64 - 0.5, y.1)]))
                .to_vec();
            all.extend(series);
            Panel { title, x: (from as f64, to as f64), y, series: all, failed: false, equal: false }
        };
        let mean = |pair: &Held<'_>, column: usize| pair.0[column];
        let context = |pair: &Held<'_>, column: usize| pair.1[column];
        let (offset, scale) = material.column;
        let error: Vec<(f64, f64)> = (from..head)
            .filter_map(|sample| {
                let (means, _) = held(sample)?;
                Some((sample as f64, (sensed(sample)?[0] - offset) * scale - means[0]))
            })
            .collect();
        columns.push(vec![
            panel(format!("{word}: now {now}"), (-1.0, 1.0), series(&mean, &drawn())),
            panel("error of object x".into(), (-0.8, 0.8), vec![Series::line("", Tone::Failed, error)]),
            panel("slow units".into(), (-1.0, 1.0), series(&context, &unnamed(&material.units[1]))),
            panel("fast units".into(), (-1.0, 1.0), series(&context, &unnamed(&material.units[0]))),
        ]);
    }
    Some(figure(
        "window",
        "The window before, during and after a modification",
        "What the network holds of past and future at three moments around the largest jump. Between the two vertical lines lies the \
         window; lines are the past as it stands at that moment, dots the forecast."
            .into(),
        "Fig. 5.10: at the modification the past in the window is overwritten, its error vanishes, and the future turns to the \
         other side; the past before the window stays.",
        3,
        1.5,
        in_rows(columns),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_modification_is_the_largest_jump_that_has_room_around_it() {
        let snapshot =
            |tail: f64| Snapshot { window: 1, means: Vec::new(), contexts: Vec::new(), tail: vec![tail, 0.0] };
        let mut tails = vec![0.0; 150];
        tails[10..].iter_mut().for_each(|tail| *tail += 9.0);
        tails[80..].iter_mut().for_each(|tail| *tail -= 2.0);
        tails[90..].iter_mut().for_each(|tail| *tail += 1.0);
        let snapshots: Vec<Snapshot> = tails.into_iter().map(snapshot).collect();
        assert_eq!(modification(&snapshots), Some(80));
        assert_eq!(modification(&snapshots[..60]), None);
    }

    #[test]
    fn columns_become_rows() {
        let panel = |title: &str| Panel::spanning(title, Vec::new());
        let panels = in_rows(vec![vec![panel("a"), panel("b")], vec![panel("c"), panel("d")]]);
        let titles: Vec<&str> = panels.iter().map(|panel| panel.title.as_str()).collect();
        assert_eq!(titles, ["a", "c", "b", "d"]);
    }
}
