//! The network in the page: its numbers as JSON, and a step in script, so that a reader can move the initial state, switch the noise
//! on, push, and see what the closed loop makes of it.

use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn_report::{Applet, Block, Section};
use scrnn_run::export::OneStep;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;
use serde_json::json;

use crate::chosen::{kinds, planes};

/// Largest network, in bytes of JSON: a page stays small.
const LARGEST: usize = 1_500_000;
/// Steps that are shown at most; each drag runs them all.
const STEPS: usize = 300;
/// Learned states that are shown at most.
const STATES: usize = 200;

/// One step of a network in script: `scrnnStep(NETWORK)` with a network of [`OneStep::json`] gives `begin` and `step`.
pub const STEP: &str = include_str!("step.js");
const SCRIPT: &str = concat!(include_str!("../common.js"), include_str!("step.js"), include_str!("play.js"));

/// What is in the page before the script draws.
const BODY: &str = r#"<div class="controls">
NOISE<label>push <select class="channel" aria-label="channel that is pushed"></select></label>
<label>by <input class="push" type="range" min="-100" max="100" value="0" aria-label="size of the push, in percent of the channel's range"></label>
<label>at step <input class="when" type="range" min="0" value="20" aria-label="step of the push"></label>
</div>
<p class="where" aria-live="polite"></p>
<div class="panes">
<svg class="plane" viewBox="0 0 320 300" role="group" aria-label="Initial states; drag, or use the arrow keys"></svg>
ORBIT<svg class="time wide" viewBox="0 0 480 320" role="img" aria-label="What the network does from there, over time"></svg>
<svg class="contexts wide" viewBox="0 0 480 140" role="img" aria-label="Its context units over time"></svg>
</div>"#;
const NOISE: &str = r#"<label><input class="noise" type="checkbox"> noise</label>
<button class="again" type="button">other noise</button>
"#;
const ORBIT: &str = r#"<svg class="orbit" viewBox="0 0 320 300" role="img" aria-label="What the network does from there, in the plane"></svg>
"#;

/// The section about a network or the members of a mixture, or why there is none.
pub fn section(all: &[Trained], source: &Source) -> Option<Section> {
    let with = |blocks| Some(Section { title: "Play with it".into(), blocks });
    match applet(all, source)? {
        Ok(applet) => with(vec![Block::Applet(Box::new(applet))]),
        Err(why) => with(vec![Block::Text(why)]),
    }
}

/// A plane in the space of initial states.
struct Plane {
    mean: Vec<f64>,
    axes: [Vec<f64>; 2],
    /// Of each learned state, along the two axes.
    points: Vec<[f64; 2]>,
    /// What it is.
    label: &'static str,
    /// What dragging changes.
    about: &'static str,
}

impl Plane {
    /// Through the first `count` of all states: that of their first two components. Where they have none, one that goes through them, and
    /// along the units that the outputs listen to most, by `influence`. None for a single unit.
    fn of(states: &[f64], count: usize, influence: &[f64]) -> Option<Self> {
        let units = influence.len();
        if units < 2 || count == 0 {
            return None;
        }
        let all = states.len() / units;
        let state = |s: usize| &states[s * units..(s + 1) * units];
        let mean_of = |count: usize, i: usize| (0..count).map(|s| state(s)[i]).sum::<f64>() / count as f64;
        if let Some(components) = PrincipalComponents::of(states, units).filter(|_| count >= 3) {
            let coordinates = components.first(2);
            let mean: Vec<f64> = (0..units).map(|i| mean_of(all, i)).collect();
            // What a step along a component is in the space of states: the regression of the states on it.
            let axis = |component: usize| -> Vec<f64> {
                let along: Vec<f64> = coordinates.iter().skip(component).step_by(2).copied().collect();
                let length = along.iter().map(|a| a * a).sum::<f64>();
                let of = |i: usize| along.iter().enumerate().map(|(s, a)| a * (state(s)[i] - mean[i])).sum::<f64>();
                (0..units).map(|i| if length > 0.0 { of(i) / length } else { 0.0 }).collect()
            };
            return Some(Self {
                axes: [axis(0), axis(1)],
                mean,
                points: (0..count).map(|s| [coordinates[2 * s], coordinates[2 * s + 1]]).collect(),
                label: "initial states: first component across, second up",
                about: "In places between the learned states only the first two components change.",
            });
        }
        let mut order: Vec<usize> = (0..units).collect();
        order.sort_by(|&a, &b| influence[b].total_cmp(&influence[a]));
        let along = |i: usize| (0..units).map(|k| f64::from(u8::from(k == i))).collect::<Vec<f64>>();
        let mean: Vec<f64> = (0..units).map(|i| mean_of(count, i)).collect();
        let way: Vec<f64> = (0..units).map(|i| state(count - 1)[i] - state(0)[i]).collect();
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (axes, label, about) = if length > 0.0 {
            let first: Vec<f64> = way.iter().map(|x| x / length).collect();
            // Of two units one at least does not lie along the way between the states.
            let i = order.into_iter().find(|&i| first[i].abs() < 0.9)?;
            let mut second = along(i);
            second.iter_mut().zip(&first).for_each(|(a, b)| *a -= first[i] * b);
            let size = second.iter().map(|x| x * x).sum::<f64>().sqrt();
            second.iter_mut().for_each(|a| *a /= size);
            let label = "initial states: across, between the two; up, one unit";
            (
                [first, second],
                label,
                "Two states have a line, and no plane: up and down one context unit changes besides.",
            )
        } else {
            let label = "initial state: across and up, the two strongest units";
            (
                [along(order[0]), along(order[1])],
                label,
                "There is one learned state: its two strongest context units change.",
            )
        };
        let points = (0..count).map(|s| {
            let off = state(s).iter().zip(&mean).map(|(u, mean)| u - mean).collect::<Vec<f64>>();
            // What rounding leaves is no extent that anything could be drawn along.
            let along = [0, 1].map(|k| axes[k].iter().zip(&off).map(|(a, u)| a * u).sum::<f64>());
            along.map(|place| if place.abs() < 1e-9 { 0.0 } else { place })
        });
        Some(Self { points: points.collect(), mean, axes, label, about })
    }
}

/// None for members that are no mixture; a sentence where it is too large for a page, or has a single unit.
fn applet(all: &[Trained], source: &Source) -> Option<Result<Applet, String>> {
    let (checkpoint, data) = (&all.first()?.checkpoint, &source.data);
    let (units, n, delay) = (checkpoint.topology.context_units(), data.channels().len(), checkpoint.topology.delay());
    let states = &checkpoint.initial_states;
    let network = OneStep::of(all, None).ok()?.json();
    let size = network.to_string().len();
    if size > LARGEST {
        return Some(Err(format!(
            "The network's numbers take {:.1} MB as text, which is too much for a page: there is nothing to play with here.",
            size as f64 / 1e6
        )));
    }
    let same = |one: &Trained| one.checkpoint.sequences == checkpoint.sequences;
    if !all.iter().all(same) {
        return None;
    }
    let count = states.sequences().min(data.sequences().len());
    let weights: Vec<f64> =
        network["members"][0]["mean_from_context"].as_array()?.iter().filter_map(serde_json::Value::as_f64).collect();
    let influence: Vec<f64> = (0..units).map(|i| weights.iter().skip(i).step_by(units).map(|w| w * w).sum()).collect();
    let Some(plane) = Plane::of(states.values(), count, &influence) else {
        return Some(Err(
            "There is nothing to play with here: a single context unit has no plane of initial states.".into()
        ));
    };
    let names: Vec<&str> = checkpoint.sequences.iter().map(String::as_str).collect();
    let kinds = kinds(&names);
    let kind = |s: usize| kinds.iter().position(|(_, own)| own.contains(&s)).unwrap_or(0);
    let every = count.div_ceil((STATES / all.len()).max(1));
    let shown: Vec<usize> = (0..count).step_by(every).collect();
    let known = |value: f64| if value.is_finite() { json!(value) } else { json!(null) };
    let begin = |s: usize| -> Vec<Vec<serde_json::Value>> {
        let sequence = &data.sequences()[s];
        (0..delay).map(|k| sequence.sample(k).iter().map(|&value| known(value)).collect()).collect()
    };
    let range = |i: usize| {
        let values = data.sequences().iter().flat_map(|sequence| sequence.values().iter().skip(i).step_by(n));
        let values = values.filter(|value| value.is_finite());
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &value| (a.min(value), b.max(value)));
        let room = (0.2 * (high - low)).max(1e-9);
        [low - room, high + room]
    };
    let others =
        |s: usize| -> Vec<&[f64]> { all[1..].iter().map(|one| one.checkpoint.initial_states.sequence(s)).collect() };
    let longest = data.sequences().iter().map(|sequence| sequence.len().saturating_sub(delay)).max().unwrap_or(1);
    let pair = planes(data.channels()).first().map(|&(a, b, _)| [a, b]);
    let value = json!({
        "network": network,
        "steps": longest.clamp(1, STEPS),
        "ranges": (0..n).map(range).collect::<Vec<_>>(),
        "pair": pair,
        "plane": {
            "mean": plane.mean,
            "axes": plane.axes,
            "label": plane.label,
            "points": shown.iter().map(|&s| plane.points[s]).collect::<Vec<_>>(),
            "names": shown.iter().map(|&s| names.get(s).copied().unwrap_or_default()).collect::<Vec<_>>(),
            "kinds": shown.iter().map(|&s| kind(s)).collect::<Vec<_>>(),
            "internals": shown.iter().map(|&s| states.sequence(s)).collect::<Vec<_>>(),
            "others": shown.iter().map(|&s| others(s)).collect::<Vec<_>>(),
            "begins": shown.iter().map(|&s| begin(s)).collect::<Vec<_>>(),
        },
    });
    let noise = if checkpoint.topology.has_variance() {
        NOISE
    } else {
        "<button class=\"again\" type=\"button\" hidden></button>\n"
    };
    let mixture = match all.len() {
        1 => "",
        _ => {
            " All members run side by side on the mixture's prediction; the plane and the contexts are the first member's, the others begin \
             from their own states of the nearest sequence."
        }
    };
    let body = BODY.replace("ORBIT", if pair.is_some() { ORBIT } else { "" }).replace("NOISE", noise);
    Some(Ok(Applet {
        name: "playground".into(),
        title: "The network itself".into(),
        caption: format!(
            "Drag the large dot over the initial states that were learned: the network runs from there in this page, fed with its own \
             predictions. The band is two predicted standard deviations; a push adds to one input once. {} Its first inputs are those of \
             the nearest learned sequence.{mixture}",
            plane.about
        ),
        body,
        style: include_str!("play.css"),
        script: SCRIPT,
        data: value.to_string(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The learned states lie where the plane has them.
    fn leads_back(plane: &Plane, states: &[f64]) {
        for (s, point) in plane.points.iter().enumerate() {
            let units = plane.mean.len();
            for (i, u) in states[s * units..(s + 1) * units].iter().enumerate() {
                let found = plane.mean[i] + point[0] * plane.axes[0][i] + point[1] * plane.axes[1][i];
                assert!((found - u).abs() < 1e-12, "state {s}, unit {i}: {found}, not {u}");
            }
        }
    }

    #[test]
    fn one_or_two_states_have_a_plane_too_and_a_single_unit_has_none() {
        let influence = [0.1, 2.0, 1.0];
        for rows in [&[&[0.5, -0.2, 0.1][..]][..], &[&[0.5, -0.2, 0.1], &[0.5, 0.4, 0.1]], &[&[1.0; 3], &[1.0; 3]]] {
            let states = rows.concat();
            let plane = Plane::of(&states, rows.len(), &influence).unwrap();
            leads_back(&plane, &states);
            assert!(plane.points.iter().all(|point| point[1] == 0.0), "{:?}", plane.points);
            let dot =
                |a: usize, b: usize| -> f64 { plane.axes[a].iter().zip(&plane.axes[b]).map(|(x, y)| x * y).sum() };
            assert!((dot(0, 0) - 1.0).abs() < 1e-12 && (dot(1, 1) - 1.0).abs() < 1e-12 && dot(0, 1).abs() < 1e-12);
        }
        // The difference lies along the strongest unit: up goes the next.
        let plane = Plane::of(&[0.0, -1.0, 0.0, 0.0, 1.0, 0.0], 2, &influence).unwrap();
        assert_eq!((plane.axes[0][1], plane.axes[1][2]), (1.0, 1.0));
        assert!(Plane::of(&[0.5, 0.6], 2, &[1.0]).is_none());
    }
}
