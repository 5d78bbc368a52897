//! Networks in the page: their numbers as JSON, and a step in script, so that a reader can move the initial state, switch the noise
//! on, push, and see what the closed loop makes of it. Of several networks one is chosen on the page.

use scrnn::dataset::Dataset;
use scrnn_report::{Applet, Block, Section};
use scrnn_run::export::OneStep;
use scrnn_run::trained::Trained;
use serde_json::{Value, json};

use crate::chosen::{kinds, planes};

mod plane;

use plane::Plane;

/// Largest network of a page about it alone, in bytes of JSON: the page stays small.
const LARGEST: usize = 2_000_000;
/// Steps that are shown at most; each drag runs them all.
const STEPS: usize = 300;
/// Learned states that are shown at most.
const STATES: usize = 200;

/// One step of a network in script: `scrnnStep(NETWORK)` with a network of [`OneStep::json`] gives `begin` and `step`.
pub const STEP: &str = include_str!("step.js");
const SCRIPT: &str = concat!(include_str!("../common.js"), include_str!("step.js"), include_str!("play.js"));

/// What is in the page before the script draws.
const BODY: &str = r#"<div class="controls which" hidden><label>network <select class="network" aria-label="network to play with"></select></label></div>
<div class="controls">
<label class="noisy"><input class="noise" type="checkbox"> noise</label>
<button class="again noisy" type="button">other noise</button>
<label>push <select class="channel" aria-label="channel that is pushed"></select></label>
<label>by <input class="push" type="range" min="-100" max="100" value="0" aria-label="size of the push, in percent of the channel's range"></label>
<label>at step <input class="when" type="range" min="0" value="20" aria-label="step of the push"></label>
</div>
<p class="where" aria-live="polite"></p>
<div class="panes">
<svg class="plane" viewBox="0 0 320 300" role="group" aria-label="Initial states; drag, or use the arrow keys"></svg>
<svg class="orbit" viewBox="0 0 320 300" role="img" aria-label="What the network does from there, in the plane"></svg>
<svg class="time wide" viewBox="0 0 480 320" role="img" aria-label="What the network does from there, over time"></svg>
<svg class="contexts wide" viewBox="0 0 480 140" role="img" aria-label="Its context units over time"></svg>
</div>
<p class="about"></p>"#;

/// The section about a network or the members of a mixture, or why there is none.
pub fn section(all: &[Trained], data: &Dataset) -> Option<Section> {
    let mut playground = Playground::default();
    let blocks = match playground.add("", all, data, LARGEST) {
        Ok(()) => vec![playground.block()?],
        Err(Unplayable::NoMixture) => return None,
        Err(why @ Unplayable::TooLarge(_)) => {
            vec![Block::Text(format!("The network's numbers {why}: there is nothing to play with here."))]
        }
        Err(why @ Unplayable::OneUnit) => vec![Block::Text(format!("There is nothing to play with here: {why}."))],
    };
    Some(Section { title: "Play with it".into(), blocks })
}

/// Networks that a page holds, one after the other.
#[derive(Debug, Default)]
pub struct Playground {
    /// Each as JSON.
    networks: Vec<String>,
}

/// Why a page does not hold a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unplayable {
    /// Its numbers take so many bytes, and there is no room for them.
    TooLarge(usize),
    /// A single context unit has no plane of initial states.
    OneUnit,
    /// The networks did not learn the same sequences, or do not run beside each other.
    NoMixture,
}

impl std::fmt::Display for Unplayable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::TooLarge(bytes) => {
                write!(f, "take {:.1} MB as text, which is too much for a page", *bytes as f64 / 1e6)
            }
            Self::OneUnit => f.write_str("a single context unit has no plane of initial states"),
            Self::NoMixture => f.write_str("its members do not make a mixture that runs in a page"),
        }
    }
}

impl Playground {
    /// Takes in a network, or the members of a mixture, with the sequences that were learned, if that needs no more than `room` bytes of the
    /// page.
    ///
    /// # Errors
    /// Why it cannot be played with; what was taken in before stays.
    pub fn add(&mut self, name: &str, all: &[Trained], data: &Dataset, room: usize) -> Result<(), Unplayable> {
        let value = playable(name, all, data)?.to_string();
        if value.len() > room {
            return Err(Unplayable::TooLarge(value.len()));
        }
        self.networks.push(value);
        Ok(())
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.networks.len()
    }

    /// Bytes that their numbers take in the page.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.networks.iter().map(|one| one.len() + 1).sum()
    }

    /// To be put on a page, once; none without a network.
    #[must_use]
    pub fn block(&self) -> Option<Block> {
        let (what, choose) = match self.count() {
            0 => return None,
            1 => ("The network itself", ""),
            _ => (
                "The networks themselves",
                "Choose a network; another one begins from its own state of the same sequence. ",
            ),
        };
        Some(Block::Applet(Box::new(Applet {
            name: "playground".into(),
            title: what.into(),
            caption: format!(
                "{choose}Drag the large dot over the initial states that were learned: the network runs from there in this page, fed with \
                 its own predictions. The band is two predicted standard deviations; a push adds to one input once. Its first inputs are \
                 those of the nearest learned sequence."
            ),
            body: BODY.into(),
            style: include_str!("play.css"),
            script: SCRIPT,
            data: format!("{{\"networks\":[{}]}}", self.networks.join(",")),
        })))
    }
}

/// What the script needs of a network.
fn playable(name: &str, all: &[Trained], data: &Dataset) -> Result<Value, Unplayable> {
    let checkpoint = &all.first().ok_or(Unplayable::NoMixture)?.checkpoint;
    let (units, n, delay) = (checkpoint.topology.context_units(), data.channels().len(), checkpoint.topology.delay());
    let states = &checkpoint.initial_states;
    let network = OneStep::of(all, None).map_err(|_| Unplayable::NoMixture)?.json();
    let same = |one: &Trained| one.checkpoint.sequences == checkpoint.sequences;
    if !all.iter().all(same) {
        return Err(Unplayable::NoMixture);
    }
    let count = states.sequences().min(data.sequences().len());
    let weights = network["members"][0]["mean_from_context"].as_array().into_iter().flatten();
    let weights: Vec<f64> = weights.filter_map(Value::as_f64).collect();
    let influence: Vec<f64> = (0..units).map(|i| weights.iter().skip(i).step_by(units).map(|w| w * w).sum()).collect();
    let plane = Plane::of(states.values(), count, &influence).ok_or(Unplayable::OneUnit)?;
    let names: Vec<&str> = checkpoint.sequences.iter().map(String::as_str).collect();
    let kinds = kinds(&names);
    let kind = |s: usize| kinds.iter().position(|(_, own)| own.contains(&s)).unwrap_or(0);
    let every = count.div_ceil((STATES / all.len()).max(1));
    let shown: Vec<usize> = (0..count).step_by(every).collect();
    let known = |value: f64| if value.is_finite() { json!(value) } else { json!(null) };
    let begin = |s: usize| -> Vec<Vec<Value>> {
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
    let mixture = match all.len() {
        1 => "",
        _ => {
            " All members run side by side on the mixture's prediction; the plane and the contexts are the first member's, the others begin \
             from their own states of the nearest sequence."
        }
    };
    Ok(json!({
        "name": name,
        "about": format!("{}{mixture}", plane.about),
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
    }))
}
