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
const SCRIPT: &str = concat!(include_str!("step.js"), include_str!("play.js"));

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

/// The section, or why there is none.
pub fn section(trained: &Trained, source: &Source) -> Option<Section> {
    let with = |blocks| Some(Section { title: "Play with it".into(), blocks });
    match applet(trained, source)? {
        Ok(applet) => with(vec![Block::Applet(Box::new(applet))]),
        Err(why) => with(vec![Block::Text(why)]),
    }
}

/// None for what is no single network; a sentence where it is too large for a page, or its initial states lie in no plane.
fn applet(trained: &Trained, source: &Source) -> Option<Result<Applet, String>> {
    let (checkpoint, data) = (&trained.checkpoint, &source.data);
    let (units, n, delay) = (checkpoint.topology.context_units(), data.channels().len(), checkpoint.topology.delay());
    let states = &checkpoint.initial_states;
    let network = OneStep::of(std::slice::from_ref(trained), None).ok()?.json();
    let size = network.to_string().len();
    if size > LARGEST {
        return Some(Err(format!(
            "The network's numbers take {:.1} MB as text, which is too much for a page: there is nothing to play with here.",
            size as f64 / 1e6
        )));
    }
    let count = states.sequences().min(data.sequences().len());
    let components = PrincipalComponents::of(states.values(), units);
    let coordinates = match &components {
        Some(components) if units >= 2 && count >= 3 => components.first(2),
        _ => {
            let why = "There is nothing to play with here: initial states have no plane, as fewer than three were learned, or all are the same.";
            return Some(Err(why.into()));
        }
    };
    let mean: Vec<f64> = (0..units)
        .map(|i| (0..states.sequences()).map(|s| states.sequence(s)[i]).sum::<f64>() / states.sequences() as f64)
        .collect();
    // What a step along a component is in the space of states: the regression of the states on it.
    let axis = |component: usize| -> Vec<f64> {
        let along: Vec<f64> = coordinates.iter().skip(component).step_by(2).copied().collect();
        let length = along.iter().map(|a| a * a).sum::<f64>();
        let of = |i: usize| along.iter().enumerate().map(|(s, a)| a * (states.sequence(s)[i] - mean[i])).sum::<f64>();
        (0..units).map(|i| if length > 0.0 { of(i) / length } else { 0.0 }).collect()
    };
    let names: Vec<&str> = checkpoint.sequences.iter().map(String::as_str).collect();
    let kinds = kinds(&names);
    let kind = |s: usize| kinds.iter().position(|(_, own)| own.contains(&s)).unwrap_or(0);
    let every = count.div_ceil(STATES);
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
    let longest = data.sequences().iter().map(|sequence| sequence.len().saturating_sub(delay)).max().unwrap_or(1);
    let pair = planes(data.channels()).first().map(|&(a, b, _)| [a, b]);
    let value = json!({
        "network": network,
        "steps": longest.clamp(1, STEPS),
        "ranges": (0..n).map(range).collect::<Vec<_>>(),
        "pair": pair,
        "plane": {
            "mean": mean,
            "axes": [axis(0), axis(1)],
            "points": shown.iter().map(|&s| [coordinates[2 * s], coordinates[2 * s + 1]]).collect::<Vec<_>>(),
            "names": shown.iter().map(|&s| names.get(s).copied().unwrap_or_default()).collect::<Vec<_>>(),
            "kinds": shown.iter().map(|&s| kind(s)).collect::<Vec<_>>(),
            "internals": shown.iter().map(|&s| states.sequence(s)).collect::<Vec<_>>(),
            "begins": shown.iter().map(|&s| begin(s)).collect::<Vec<_>>(),
        },
    });
    let noise = if checkpoint.topology.has_variance() {
        NOISE
    } else {
        "<button class=\"again\" type=\"button\" hidden></button>\n"
    };
    let body = BODY.replace("ORBIT", if pair.is_some() { ORBIT } else { "" }).replace("NOISE", noise);
    Some(Ok(Applet {
        name: "playground".into(),
        title: "The network itself".into(),
        caption: "Drag the large dot over the initial states that were learned: the network runs from there in this page, fed with its \
                  own predictions. The band is two predicted standard deviations; a push adds to one input once. In places between the \
                  learned states only the first two components change. Its first inputs are those of the nearest learned sequence."
            .into(),
        body,
        style: include_str!("play.css"),
        script: SCRIPT,
        data: value.to_string(),
    }))
}
