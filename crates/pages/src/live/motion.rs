//! A robot that acts, or a network that follows samples, while it goes on, as a page on this machine: the world, what is sensed, what was
//! expected of it, what is expected next, and how far off that was.
//!
//! Whoever acts must not wait for whoever looks. A frame is put down where readers take it, if nobody is there at that moment, else with
//! the next one; old frames are thrown away, whether somebody has seen them or not. Texts are made by the threads of readers.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use scrnn::scaling::Scaling;
use scrnn_report::{Applet, Block, Page, Section};
use scrnn_run::failure::Result;
use scrnn_sim::world::scene::{Form, Part, Primitive, Scene};
use serde_json::{Value, json};

use super::server::{Server, served, this_run};
use crate::view::base64;

/// Frames that are kept for readers.
const KEPT: usize = 1_200;
/// Frames that wait for a moment at which no reader is there.
const WAITING: usize = 100;
/// Frames in one answer.
const AT_A_TIME: usize = 300;
/// Channels that are shown.
const CHANNELS: usize = 24;
/// Between two looks ahead: what comes faster nobody sees.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// A reader that asked so long ago is gone.
const GONE: Duration = Duration::from_secs(2);

/// What the page is about.
#[derive(Debug, Clone, Copy)]
pub struct Heading<'a> {
    /// Its title.
    pub title: &'a str,
    /// The network's channels.
    pub channels: &'a [String],
    /// Leads from the data's units to the network's, in which errors are told.
    pub scaling: &'a Scaling,
    /// What time is counted in: "s", or "samples".
    pub unit: &'static str,
    /// How many of these go by in a second, where that is meant to be even.
    pub pace: Option<f64>,
}

/// One moment.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frame<'a> {
    /// Since all began.
    pub time: f64,
    /// All that can be seen.
    pub scene: Option<&'a Scene>,
    /// What was sensed.
    pub sample: Option<Sample<'a>>,
    /// What happened.
    pub event: Option<&'a str>,
}

/// What was sensed, in the data's units, and what it was predicted as.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sample<'a> {
    /// A value for each channel, not finite where there is none.
    pub sensed: &'a [f64],
    /// The mean that was predicted for it; empty where nothing was.
    pub mean: &'a [f64],
    /// The variance that was predicted for it; empty where none was.
    pub variance: &'a [f64],
}

/// What the network makes of the last samples and of those to come, in the data's units.
#[derive(Debug, Clone, Default)]
pub struct Look {
    /// The time of the first row of `smoothed`.
    pub from: f64,
    /// The window, row after row.
    pub smoothed: Vec<Vec<f64>>,
    /// What is to come.
    pub forecast: Vec<Vec<f64>>,
    /// Its variance; empty where none is known.
    pub variance: Vec<Vec<f64>>,
}

/// A frame as it is kept.
#[derive(Debug, Default)]
struct Kept {
    time: f64,
    places: Vec<f32>,
    sensed: Vec<f64>,
    mean: Vec<f64>,
    variance: Vec<f64>,
    error: Option<f64>,
    event: Option<String>,
}

/// A body without its place.
#[derive(Debug, Clone, PartialEq)]
struct Body {
    name: String,
    form: Form,
    part: Part,
    size: [f64; 3],
}

#[derive(Debug, Default)]
struct State {
    bodies: Arc<Vec<Body>>,
    /// The number of the first frame with these bodies.
    bodies_from: u64,
    /// The frames with the numbers up to `next`.
    frames: VecDeque<Arc<Kept>>,
    next: u64,
    look: Option<Arc<Look>>,
    note: String,
    finished: bool,
    asked: Option<Instant>,
    told_the_end: bool,
}

/// What is served beside the state.
#[derive(Debug)]
struct About {
    /// Another for each run of the program: who finds another begins anew.
    run: String,
    channels: Vec<String>,
    unit: &'static str,
    pace: Option<f64>,
}

/// A page about a robot or a stream, for as long as this lives.
#[derive(Debug)]
pub struct Motion {
    state: Arc<Mutex<State>>,
    server: Server,
    scaling: Scaling,
    /// What could not be put down yet.
    waiting: VecDeque<Kept>,
    bodies: Arc<Vec<Body>>,
    bodies_changed: bool,
    look: Option<Look>,
    note: Option<String>,
    looked: Option<Instant>,
}

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Motion {
    /// Serves a page on the loopback address.
    ///
    /// # Errors
    /// [`Failure::Input`](scrnn_run::failure::Failure::Input) for a port that is taken.
    pub fn start(port: u16, heading: &Heading<'_>) -> Result<Self> {
        let state = Arc::new(Mutex::new(State::default()));
        let about = About {
            run: this_run(),
            channels: heading.channels.iter().take(CHANNELS).cloned().collect(),
            unit: heading.unit,
            pace: heading.pace,
        };
        let (page, told) = (page(heading).live_html(), Arc::clone(&state));
        let answer = move |path: &str| match path {
            "/" => Some(("text/html", page.clone().into_bytes())),
            _ => {
                let wanted = path.strip_prefix("/data/")?.strip_suffix(".json")?.parse().ok()?;
                Some(("application/json", about.answer(&told, wanted).to_string().into_bytes()))
            }
        };
        Ok(Self {
            state,
            server: served(port, Box::new(answer))?,
            scaling: heading.scaling.clone(),
            waiting: VecDeque::new(),
            bodies: Arc::default(),
            bodies_changed: false,
            look: None,
            note: None,
            looked: None,
        })
    }

    /// Where it is read.
    #[must_use]
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// Shows a moment. Never waits.
    pub fn frame(&mut self, frame: &Frame<'_>) {
        let Frame { time, scene, sample, event } = *frame;
        let Sample { sensed, mean, variance } = sample.unwrap_or_default();
        let error = self.error(sensed, mean);
        let few = |values: &[f64]| values.iter().take(CHANNELS).copied().collect();
        let places = scene.map_or_else(Vec::new, |scene| self.places(scene));
        let event = event.map(str::to_owned);
        self.waiting.push_back(Kept {
            time,
            places,
            sensed: few(sensed),
            mean: few(mean),
            variance: few(variance),
            error,
            event,
        });
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
        }
        self.put_down();
    }

    /// Whether it is time for another [`Motion::look`].
    #[must_use]
    pub fn wants_look(&self) -> bool {
        self.looked.is_none_or(|looked| looked.elapsed() >= BETWEEN_LOOKS)
    }

    /// Shows what the network makes of it, with a sentence about that. Comes before the frame that it belongs to.
    pub fn look(&mut self, look: Look, note: String) {
        self.looked = Some(Instant::now());
        self.look = Some(look);
        self.note = Some(note);
    }

    /// Nothing more will come. A reader who is there gets the end, if he takes it soon.
    pub fn finish(mut self) {
        let state = Arc::clone(&self.state);
        {
            let mut state = locked(&state);
            self.move_into(&mut state);
            state.finished = true;
        }
        let begun = Instant::now();
        while begun.elapsed() < GONE {
            let state = locked(&state);
            if state.told_the_end || state.asked.is_none_or(|asked| asked.elapsed() > GONE) {
                break;
            }
            drop(state);
            std::thread::sleep(Duration::from_millis(20));
        }
        // The answer with the end is on its way.
        std::thread::sleep(Duration::from_millis(50));
    }

    /// The root of the mean square over all channels with a value and a prediction, in the network's units.
    fn error(&self, sensed: &[f64], mean: &[f64]) -> Option<f64> {
        let off = |(i, (a, b)): (usize, (&f64, &f64))| self.scaling.to_scaled(i, *a) - self.scaling.to_scaled(i, *b);
        let squares = sensed.iter().zip(mean).enumerate().map(off).map(|off| off * off);
        let squares: Vec<f64> = squares.filter(|square| square.is_finite()).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// Where all forms are: x, y, z and the quaternion x, y, z, w of each. Notes which they are where these are others than before.
    fn places(&mut self, scene: &Scene) -> Vec<f32> {
        let (mut places, mut same, mut count) = (Vec::with_capacity(7 * self.bodies.len()), true, 0);
        for body in &scene.bodies {
            for Primitive { form, size, world_from_form } in body.primitives() {
                let (at, turn) = (world_from_form.translation.vector, world_from_form.rotation.coords);
                places.extend([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w].map(|value| value as f32));
                let known = self.bodies.get(count);
                same &= known.is_some_and(|known| known.form == form && known.size == size && known.name == body.name);
                count += 1;
            }
        }
        if !same || count != self.bodies.len() {
            let all = scene.bodies.iter().flat_map(|body| {
                let one = |Primitive { form, size, .. }| Body { name: body.name.clone(), form, part: body.part, size };
                body.primitives().into_iter().map(one).collect::<Vec<_>>()
            });
            self.bodies = Arc::new(all.collect());
            self.bodies_changed = true;
            // What waits speaks of others.
            self.waiting.clear();
        }
        places
    }

    /// Unless a reader is there at this moment.
    fn put_down(&mut self) {
        let state = Arc::clone(&self.state);
        match state.try_lock() {
            Ok(mut state) => self.move_into(&mut state),
            Err(TryLockError::Poisoned(poisoned)) => self.move_into(&mut poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => {}
        };
    }

    fn move_into(&mut self, state: &mut State) {
        if std::mem::take(&mut self.bodies_changed) {
            state.bodies = Arc::clone(&self.bodies);
            state.bodies_from = state.next;
        }
        for kept in self.waiting.drain(..) {
            state.frames.push_back(Arc::new(kept));
            state.next += 1;
        }
        let much = state.frames.len().saturating_sub(KEPT);
        state.frames.drain(..much);
        if let Some(look) = self.look.take() {
            state.look = Some(Arc::new(look));
        }
        if let Some(note) = self.note.take() {
            state.note = note;
        }
    }
}

impl About {
    /// What a reader who wants the frames from this number on is told. Only what it takes to hold on to the frames is done under the lock.
    fn answer(&self, state: &Mutex<State>, wanted: u64) -> Value {
        let (frames, first, next, bodies, look, note, finished) = {
            let mut state = locked(state);
            state.asked = Some(Instant::now());
            state.told_the_end |= state.finished;
            // Who wants what has not been yet has seen another run.
            let wanted = if wanted > state.next { 0 } else { wanted };
            let oldest = state.next - state.frames.len() as u64;
            let first = wanted.max(oldest).max(state.next.saturating_sub(AT_A_TIME as u64));
            let skipped = usize::try_from(first - oldest).unwrap_or(usize::MAX);
            let frames: Vec<Arc<Kept>> = state.frames.iter().skip(skipped).cloned().collect();
            let bodies = (wanted <= state.bodies_from || wanted == 0).then(|| Arc::clone(&state.bodies));
            let (look, note) = (state.look.clone(), state.note.clone());
            (frames, first, state.next, bodies, look, note, state.finished)
        };
        let bodies = bodies.filter(|bodies| !bodies.is_empty());
        json!({
            "run": self.run, "channels": self.channels, "unit": self.unit, "pace": self.pace, "first": first, "next": next,
            "finished": finished, "note": note,
            "bodies": bodies.map(|bodies| bodies.iter().map(Body::json).collect::<Vec<_>>()),
            "frames": frames.iter().map(|kept| kept.json()).collect::<Vec<_>>(),
            "look": look.map(|look| look.json()),
        })
    }
}

/// As many digits as a curve can show; null for what is not finite.
fn short(values: &[f64]) -> Vec<Value> {
    let one = |value: &f64| json!(format!("{value:.6e}").parse::<f64>().ok().filter(|value| value.is_finite()));
    values.iter().map(one).collect()
}

fn rows(rows: &[Vec<f64>]) -> Vec<Vec<Value>> {
    rows.iter().map(|row| short(&row[..row.len().min(CHANNELS)])).collect()
}

impl Kept {
    fn json(&self) -> Value {
        let mut value = json!({ "t": self.time });
        if !self.places.is_empty() {
            let bytes: Vec<u8> = self.places.iter().flat_map(|value| value.to_le_bytes()).collect();
            value["p"] = base64(&bytes).into();
        }
        for (key, values) in [("s", &self.sensed), ("m", &self.mean), ("v", &self.variance)] {
            if !values.is_empty() {
                value[key] = short(values).into();
            }
        }
        if let Some(error) = self.error {
            value["e"] = json!(error);
        }
        if let Some(event) = &self.event {
            value["w"] = json!(event);
        }
        value
    }
}

impl Look {
    fn json(&self) -> Value {
        let Self { from, smoothed, forecast, variance } = self;
        json!({ "from": from, "smoothed": rows(smoothed), "forecast": rows(forecast), "variance": rows(variance) })
    }
}

impl Body {
    fn json(&self) -> Value {
        let Self { name, form, part, size } = self;
        let form = match form {
            Form::Cuboid => "box",
            Form::Sphere => "sphere",
            Form::Cylinder => "cylinder",
        };
        let [r, g, b, _] = part.colour();
        json!({ "name": name, "form": form, "size": size, "colour": [r, g, b], "stands": *part == Part::Furniture })
    }
}

const BODY: &str = r#"<p class="verdict stand" role="status" aria-live="polite">Waiting for the first sample.</p>
<canvas class="world" hidden tabindex="0" role="img" title="Drag to turn, wheel to come nearer" aria-label="The robots in 3-D. Drag to turn, wheel to come nearer; or arrow keys, plus and minus"></canvas>
<p class="missing" role="status" hidden></p>
<div class="controls">
<button class="play" type="button" aria-pressed="false">hold</button>
<button class="home" type="button" hidden>view from the front</button>
<output class="clock"></output>
</div>
<p class="now" aria-live="off"></p>
<div class="signals"></div>
<svg class="error" viewBox="0 0 720 150" role="img" aria-label="Error of the prediction"></svg>"#;

fn page(heading: &Heading<'_>) -> Page {
    let left_out = heading.channels.len().saturating_sub(CHANNELS);
    let left_out = if left_out > 0 { format!(" The last {left_out} channels are not drawn.") } else { String::new() };
    let applet = Applet {
        name: "motion".into(),
        title: "As it goes on".into(),
        caption: format!(
            "What was sensed is dashed; the line is what the network expected of it one step before, the band two of its standard deviations. \
             To the right of the upright line is what it expects to come; what it now makes of the past is drawn in green where it revises that. \
             The error is the root of the mean square over all channels, in the network's units.{left_out}"
        ),
        body: BODY.into(),
        style: include_str!("motion.css"),
        script: concat!(include_str!("../common.js"), include_str!("../view/scene.js"), include_str!("motion.js")),
        data: "{}".into(),
    };
    let blocks = vec![Block::Applet(Box::new(applet))];
    let sections = vec![Section { title: "Now".into(), blocks }];
    Page { title: heading.title.to_owned(), lede: "As it goes on, on this machine.".into(), sections }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use scrnn_sim::world::scene::{Body, Shape};

    use super::*;

    fn motion() -> Motion {
        let channels = ["a".to_owned(), "b".to_owned()];
        let scaling = Scaling::new(vec![0.0, 0.0], vec![2.0, 2.0]).unwrap();
        Motion::start(0, &Heading { title: "T", channels: &channels, scaling: &scaling, unit: "s", pace: None })
            .unwrap()
    }

    fn about() -> About {
        About { run: "1".into(), channels: Vec::new(), unit: "s", pace: None }
    }

    fn scene(x: f64, names: &[&str]) -> Scene {
        let body = |name: &&str| Body {
            name: (*name).to_owned(),
            part: Part::Hand,
            shape: Shape::Sphere { radius: 0.1 },
            world_from_shape: Isometry3::translation(x, 0.0, 0.0),
        };
        Scene { bodies: names.iter().map(body).collect(), frames: Vec::new() }
    }

    #[test]
    fn memory_is_bounded_and_a_reader_that_is_late_gets_the_newest() {
        let mut motion = motion();
        for k in 0..10_000 {
            motion.frame(&Frame { time: f64::from(k), scene: Some(&scene(0.0, &["hand"])), ..Frame::default() });
        }
        assert_eq!(locked(&motion.state).frames.len(), KEPT);
        let told = about().answer(&motion.state, 0);
        let frames = told["frames"].as_array().unwrap();
        assert_eq!(
            (frames.len(), &frames[AT_A_TIME - 1]["t"], &told["next"]),
            (AT_A_TIME, &json!(9999.0), &json!(10_000))
        );
        assert_eq!(told["bodies"].as_array().unwrap().len(), 1);
        // Who has all gets nothing, and who comes from another run gets what there is.
        let told = about().answer(&motion.state, 10_000);
        assert!(told["frames"].as_array().unwrap().is_empty() && told["bodies"].is_null(), "{told}");
        assert_eq!(about().answer(&motion.state, 77_777)["frames"].as_array().unwrap().len(), AT_A_TIME);
    }

    #[test]
    fn a_reader_that_stands_still_holds_nobody_up_and_what_waits_is_put_down_later() {
        let mut motion = motion();
        let state = Arc::clone(&motion.state);
        let held = locked(&state);
        let begun = Instant::now();
        for k in 0..1_000 {
            motion.frame(&Frame { time: f64::from(k), ..Frame::default() });
        }
        assert!(begun.elapsed() < Duration::from_secs(1) && motion.waiting.len() == WAITING);
        drop(held);
        motion.frame(&Frame { time: 1000.0, ..Frame::default() });
        let held = locked(&state);
        assert_eq!((held.frames.len(), held.frames.back().unwrap().time), (WAITING, 1000.0));
    }

    #[test]
    fn errors_are_in_the_networks_units_and_other_bodies_are_told() {
        let mut motion = motion();
        let sample = Sample { sensed: &[1.0, f64::NAN], mean: &[1.5, 2.0], variance: &[0.1, 0.1] };
        motion.frame(&Frame { scene: Some(&scene(0.5, &["hand"])), sample: Some(sample), ..Frame::default() });
        motion.frame(&Frame { time: 1.0, scene: Some(&scene(0.5, &["hand", "ball"])), ..Frame::default() });
        let told = about().answer(&motion.state, 1);
        assert_eq!(told["bodies"].as_array().unwrap().len(), 2, "{told}");
        let told = about().answer(&motion.state, 0);
        let first = &told["frames"][0];
        assert_eq!((&first["e"], &first["s"]), (&json!(1.0), &json!([1.0, null])));
        let place: Vec<u8> = [0.5_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!(first["p"], json!(base64(&place)));
        assert_eq!(told["frames"][1]["p"].as_str().unwrap().len(), 76);
    }
}
