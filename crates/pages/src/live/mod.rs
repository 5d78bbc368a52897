//! A training while it goes on, as a page on this machine: how it learns, what its best network does on its own, time left.
//!
//! What the page shows is what a [`Progress`] is told anyway, and what stands in the run folder: nothing is asked of the
//! training, and no number in it changes.

use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime};

use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::generation::{Feedback, GenerationOptions};
use scrnn::learning::EpochReport;
use scrnn_report::{Applet, Block, Page, Section};
use scrnn_run::assessment;
use scrnn_run::failure::Result;
use scrnn_run::held_out::Glance;
use scrnn_run::messages::Progress;
use scrnn_run::run_folder::BEST;
use scrnn_run::trained::{Trained, read_checkpoint};
use serde_json::{Value, json};

mod many;
mod motion;
mod paced;
mod sample_by_sample;
mod server;

pub use many::{Ends, LookAtAll, Many, OneOfMany, Stands};
pub use motion::{Frame, Heading, Look, Motion, Sample};
pub use paced::Paced;
pub use sample_by_sample::SampleBySample;
use server::served;
pub use server::{Answer, Server};

/// Points of a learning curve; beyond, every second one goes.
const POINTS: usize = 1_000;
/// Sequences of the closed loop, and samples of each.
const LOOPS: (usize, usize) = (4, 200);
/// Channels of each.
const CHANNELS: usize = 6;

/// What is known of a training.
#[derive(Debug)]
struct State {
    name: String,
    epochs: u64,
    epoch: u64,
    begun: Option<(u64, Instant)>,
    /// Epoch and nll, or the logarithm of the squared error.
    curve: Curve,
    held_out: Curve,
    with_variance: bool,
    calibration: Option<(f64, f64)>,
    said: Vec<String>,
    finished: bool,
}

/// A curve that grows, and stays short.
#[derive(Debug, Default)]
struct Curve {
    points: Vec<(u64, f64)>,
    /// How many come before one is kept.
    every: usize,
    skipped: usize,
}

impl Curve {
    fn push(&mut self, epoch: u64, value: f64) {
        self.skipped += 1;
        if self.skipped < self.every || !value.is_finite() {
            return;
        }
        self.skipped = 0;
        self.points.push((epoch, value));
        if self.points.len() > POINTS {
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 0
            });
            self.every = (2 * self.every).max(2);
        }
    }
}

/// A page about a training, for as long as this lives.
#[derive(Debug)]
pub struct Live {
    state: Arc<Mutex<State>>,
    server: Server,
}

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    // A reader that panicked left the numbers as they are.
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Live {
    /// Serves a page about the training of `name` in a run folder. Of `data` it draws a few sequences beside the best network.
    ///
    /// # Errors
    /// A port that is taken.
    pub fn start(port: u16, (name, epochs): (&str, u64), folder: PathBuf, data: &Dataset) -> Result<Self> {
        let state = State {
            name: name.to_owned(),
            epochs,
            epoch: 0,
            begun: None,
            curve: Curve::default(),
            held_out: Curve::default(),
            with_variance: true,
            calibration: None,
            said: Vec::new(),
            finished: false,
        };
        let state = Arc::new(Mutex::new(state));
        let loops = Mutex::new(Loops::new(folder, data));
        let (page, told) = (page(name).live_html(), Arc::clone(&state));
        let answer = move |path: &str| match path {
            "/" => Some(("text/html", page.clone().into_bytes())),
            "/data.json" => {
                let mut value = locked(&told).json();
                // Another reader is at it: the last one will do.
                if let Ok(mut loops) = loops.try_lock() {
                    value["loop"] = loops.newest();
                }
                Some(("application/json", value.to_string().into_bytes()))
            }
            _ => None,
        };
        Ok(Self { state, server: served(port, Box::new(answer))? })
    }

    /// Where it is read.
    #[must_use]
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// Tells the page what another progress is told.
    #[must_use]
    pub fn watching(&self, inner: Box<dyn Progress>) -> Box<dyn Progress> {
        Box::new(Watched { inner, state: Arc::clone(&self.state) })
    }
}

/// A progress that the page hears as well.
struct Watched {
    inner: Box<dyn Progress>,
    state: Arc<Mutex<State>>,
}

impl fmt::Debug for Watched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Watched").field(&self.inner).finish()
    }
}

impl Progress for Watched {
    fn epoch(&mut self, report: &EpochReport) {
        {
            let state = &mut *locked(&self.state);
            state.epoch = report.epoch;
            state.begun.get_or_insert((report.epoch, Instant::now()));
            state.with_variance = report.nll.is_some();
            state.curve.push(report.epoch, report.nll.unwrap_or_else(|| report.mse.log10()));
        }
        self.inner.epoch(report);
    }

    fn held_out(&mut self, glance: &Glance) {
        {
            let state = &mut *locked(&self.state);
            let value = glance.one_step.nll.unwrap_or_else(|| glance.one_step.mse.log10());
            let epoch = state.epoch + 1;
            state.held_out.push(epoch, value);
            state.calibration = glance.closed_loop.within_one.zip(glance.closed_loop.within_two);
        }
        self.inner.held_out(glance);
    }

    fn trying(&mut self, what: &str, epoch: u64, epochs: u64) {
        self.inner.trying(what, epoch, epochs);
    }

    fn expect(&mut self, total: u64) {
        locked(&self.state).epochs = total;
        self.inner.expect(total);
    }

    fn say(&self, message: &str) {
        {
            let said = &mut locked(&self.state).said;
            said.push(message.to_owned());
            let much = said.len().saturating_sub(20);
            said.drain(..much);
        }
        self.inner.say(message);
    }

    fn finish(&self) {
        locked(&self.state).finished = true;
        self.inner.finish();
    }
}

impl State {
    fn json(&self) -> Value {
        let passed =
            self.begun.map(|(first, at)| ((self.epoch - first.min(self.epoch)) as f64, at.elapsed().as_secs_f64()));
        let speed = passed.map(|(epochs, seconds)| epochs / seconds.max(1e-9)).filter(|speed| *speed > 0.0);
        json!({
            "name": self.name, "epochs": self.epochs, "epoch": self.epoch, "finished": self.finished,
            "with_variance": self.with_variance, "speed": speed,
            "left": speed.map(|speed| self.epochs.saturating_sub(self.epoch) as f64 / speed),
            "curve": self.curve.points, "held_out": self.held_out.points, "calibration": self.calibration, "said": self.said,
        })
    }
}

/// The closed loop of the best network that the run folder has, made anew when that file changes.
struct Loops {
    folder: PathBuf,
    channels: Vec<String>,
    sequences: HashMap<String, Sequence>,
    order: Vec<String>,
    made: Option<(SystemTime, Value)>,
}

impl Loops {
    fn new(folder: PathBuf, data: &Dataset) -> Self {
        // Some may be held out, and are passed over later.
        let few: Vec<&Sequence> = data.sequences().iter().take(4 * LOOPS.0).collect();
        Self {
            folder,
            channels: data.channels().to_vec(),
            sequences: few.iter().map(|one| (one.name.clone(), one.truncated(4 * LOOPS.1))).collect(),
            order: few.iter().map(|one| one.name.clone()).collect(),
            made: None,
        }
    }

    fn newest(&mut self) -> Value {
        let path = self.folder.join(BEST);
        let Ok(changed) = std::fs::metadata(&path).and_then(|found| found.modified()) else { return Value::Null };
        match &self.made {
            Some((at, value)) if *at == changed => value.clone(),
            _ => {
                // A file that cannot be read is told by the training itself.
                let value = self.make(path).unwrap_or(Value::Null);
                self.made = Some((changed, value.clone()));
                value
            }
        }
    }

    fn make(&self, path: PathBuf) -> Option<Value> {
        let trained = Trained::of(path.clone(), read_checkpoint(&path).ok()?).ok()?;
        let checkpoint = &trained.checkpoint;
        let delay = checkpoint.topology.delay();
        let found = self.order.iter().filter_map(|name| {
            let place = checkpoint.sequences.iter().position(|learned| learned == name)?;
            let sequence = self.sequences.get(name).filter(|sequence| sequence.len() > delay)?;
            Some((place, sequence.clone()))
        });
        let found: Vec<(usize, Sequence)> = found.take(LOOPS.0).collect();
        if found.is_empty() || checkpoint.channels != self.channels {
            return None;
        }
        let (states, sequences): (Vec<&[f64]>, Vec<Sequence>) =
            found.into_iter().map(|(place, sequence)| (checkpoint.initial_states.sequence(place), sequence)).unzip();
        let data = Dataset::new(self.channels.clone(), sequences).ok()?;
        let scaled = checkpoint.scaling.apply(&data).ok()?;
        let n = self.channels.len();
        let feedback = Feedback::closed(n, checkpoint.topology.has_variance());
        let options = GenerationOptions::new(LOOPS.1.min(assessment::longest(&scaled, delay)), feedback).seed(1);
        // One thread, of its own: the training keeps its pool.
        let engine = Engine::new(1, InstructionSet::best()).ok()?;
        let loops = assessment::run(&trained.network(), &states, &scaled, &options, &engine).ok()?;
        let one = |(sequence, own): (&Sequence, &scrnn::generation::Generated)| {
            let channel = |i: usize| {
                let known = |value: f64| if value.is_finite() { json!(value) } else { Value::Null };
                let recorded =
                    sequence.values().iter().skip(i).step_by(n).take(LOOPS.1 + delay).map(|&value| known(value));
                let own = own.sample.iter().skip(i).step_by(n).map(|&value| known(checkpoint.scaling.to_raw(i, value)));
                json!({ "recorded": recorded.collect::<Vec<_>>(), "own": own.collect::<Vec<_>>() })
            };
            json!({ "name": sequence.name, "channels": (0..n.min(CHANNELS)).map(channel).collect::<Vec<_>>() })
        };
        let sequences: Vec<Value> = data.sequences().iter().zip(&loops).map(one).collect();
        let names = &self.channels[..n.min(CHANNELS)];
        Some(json!({ "epoch": checkpoint.epoch, "delay": delay, "channels": names, "sequences": sequences }))
    }
}

const BODY: &str = r#"<p class="verdict stand" role="status" aria-live="polite">Waiting for the first epoch.</p>
<svg class="curve" viewBox="0 0 720 300" role="img" aria-label="Learning curve"></svg>
<p class="calibration"></p>
<h3 class="best"></h3>
<div class="loops"></div>
<pre class="said" hidden></pre>"#;

fn page(name: &str) -> Page {
    let applet = Applet {
        name: "live".into(),
        title: "The training".into(),
        caption: "Lower is better. The closed loop is that of the best network whose file is written; recorded samples are dashed. The page \
                  asks every second, and only this machine; when the training ends it stays as it was."
            .into(),
        body: BODY.into(),
        style: include_str!("live.css"),
        script: concat!(include_str!("../common.js"), include_str!("live.js")),
        data: "{}".into(),
    };
    let blocks = vec![Block::Applet(Box::new(applet))];
    let sections = vec![Section { title: "Learning".into(), blocks }];
    Page { title: format!("Training: {name}"), lede: "As it goes on, on this machine.".into(), sections }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_stay_short_and_keep_their_newest_points() {
        let mut curve = Curve::default();
        (0..100_000).for_each(|epoch| curve.push(epoch, epoch as f64));
        assert!(curve.points.len() <= POINTS && curve.points.len() > POINTS / 4);
        assert!(curve.points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(curve.points.last().unwrap().0 > 99_000);
    }
}
