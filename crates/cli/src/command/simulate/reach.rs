//! `scrnn simulate reach`: touch and retract, again and again (thesis 4.2.3).

use std::io::Cursor;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use scrnn_sim::reach::agent::{Decision, NetworkDriver, Noise, Performance, Snapshot, perform};
use scrnn_sim::reach::channels::REACHING;
use scrnn_sim::reach::recording::ReachingRecording;
use scrnn_sim::reach::stage::{CYCLE, POSITIONS};
use scrnn_sim::reach::touching::Cycle;
use scrnn_sim::world::WorldOptions;
use serde::Serialize;

use crate::args::Shared;
use crate::command::view;
use crate::output;
use crate::outputs::check_distinct;
use crate::watching::Watch;
use scrnn_data as files;
use scrnn_pages::live::{Frame, Heading, Paced, Sample};
use scrnn_report::Table;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_run::trained::Trained;

/// Seconds in the world between two pictures on a page.
const PICTURES: f64 = 0.05;

/// Let a network that learned to reach touch the sphere
///
/// The network senses where the head looks, and runs on its own prediction of the arm, with noise of the predicted variance;
/// that prediction is where the joints go. It starts from the mean of the learned initial states. The table has a row for
/// each cycle of touch and retraction: when hand and sphere were nearest, how far apart they were then (negative in
/// contact), how far the hand was from where it was taught to be, and whether it was a touch.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn train assets/experiments/reaching_fast.toml
  scrnn simulate reach runs/reaching_fast --position 2
  scrnn simulate reach runs/reaching_fast --position -0.105 --cycles 30 --mcap between.mcap
  scrnn simulate reach runs/reaching_fast --position 1 --shift-at 60 --to 3 --json
  scrnn simulate reach runs/reaching_fast --watch                    in a browser, as it goes on")]
pub struct Arguments {
    /// A run folder or a checkpoint file
    run: PathBuf,
    /// Where the sphere lies: position 1, 2 or 3, or a place across in metres, from -0.14 (1) to 0 (3)
    #[arg(long, value_name = "1|2|3|Y", default_value = "1", allow_hyphen_values = true)]
    position: Place,
    /// Put the sphere elsewhere when this many samples are over, 0 to 1000000000; a sample lasts half a second
    #[arg(long, value_name = "STEP", requires = "to", value_parser = crate::args::count(0, 1_000_000_000))]
    shift_at: Option<usize>,
    /// Where to put it
    #[arg(long, value_name = "1|2|3|Y", requires = "shift_at", allow_hyphen_values = true)]
    to: Option<Place>,
    /// For how many cycles of 12 samples, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    cycles: u32,
    /// No noise: the network runs on its predicted means
    #[arg(long)]
    no_noise: bool,
    /// Seed of the noise, 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = crate::args::seed())]
    seed: u64,
    /// Use the run's best network instead of its newest
    #[arg(long)]
    best: bool,
    /// Write a recording of all that happened
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Write a page that plays what happened, in any browser
    #[arg(long, value_name = "PAGE.html")]
    view: Option<PathBuf>,
    #[command(flatten)]
    watch: Watch,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// A place of the sphere, across in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place(f64);

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let y = match text {
            "1" => POSITIONS[0],
            "2" => POSITIONS[1],
            "3" => POSITIONS[2],
            other => other.parse().map_err(|_| "needed: 1, 2, 3 or a number of metres, like -0.105".to_owned())?,
        };
        match (POSITIONS[0] - 0.02..=POSITIONS[2] + 0.02).contains(&y) {
            true => Ok(Self(y)),
            false => Err("the sphere lies between positions 1 and 3: -0.14 to 0 m, and 0.02 m beyond at most".into()),
        }
    }
}

/// What came of it.
#[derive(Debug, Serialize)]
struct Outcome<'a> {
    /// Where the sphere lay first, in metres.
    position: f64,
    /// When it was put elsewhere, and where to.
    shift: Option<(usize, f64)>,
    /// Samples gone through.
    samples: usize,
    /// Seed of the noise.
    seed: u64,
    /// Cycles that were to be expected.
    expected: u32,
    /// Cycles that were touches.
    touched: usize,
    /// Joint targets beyond limits, which were cut.
    beyond_limits: usize,
    /// Samples within which links of the robot touched that should not.
    self_collisions: usize,
    /// Each cycle.
    cycles: &'a [Cycle],
}

/// Simulates.
pub fn run(arguments: &Arguments, shared: &Shared) -> Result<Ending> {
    let outputs = [("--mcap", arguments.mcap.as_deref()), ("--view", arguments.view.as_deref())];
    check_distinct(&outputs, &[("RUN", Some(&arguments.run))])?;
    let trained = Trained::open(&arguments.run, arguments.best)?;
    shared.say_of(&trained);
    let checkpoint = &trained.checkpoint;
    if checkpoint.channels != REACHING {
        let message = format!("{} predicts {}", trained.path.display(), checkpoint.channels.join(", "));
        let help = format!("needed: a network that learned {}, as from `scrnn data reach`", REACHING.join(", "));
        return Err(Failure::input(message, help));
    }
    let noise = if arguments.no_noise { Noise::Off } else { Noise::Predicted };
    let mut driver = NetworkDriver::new(
        &trained.network(),
        checkpoint.initial_states.mean(),
        &checkpoint.scaling,
        &noise,
        arguments.seed,
        &shared.engine()?,
    )?;
    let shift = arguments.shift_at.zip(arguments.to.map(|place| place.0));
    let samples = arguments.cycles as usize * CYCLE;
    if let Some((at, _)) = shift.filter(|(at, _)| *at >= samples) {
        let message = format!("--shift-at {at} is after the last of {samples} samples");
        return Err(Failure::input(message, "shift earlier, or ask for more --cycles"));
    }
    let performance =
        Performance { y: arguments.position.0, samples, shift, frozen: None, world: WorldOptions::default() };
    let mut recording = match arguments.mcap.as_ref().or(arguments.view.as_ref()) {
        Some(_) => Some(recording(&trained, arguments)?),
        None => None,
    };
    let mut shown = Shown::start(arguments, &trained)?;
    let mut look = |snapshot: &Snapshot<'_>| -> Result<()> {
        if let Some(shown) = &mut shown {
            shown.snapshot(snapshot);
        }
        match &mut recording {
            Some(recording) => Ok(recording.snapshot(snapshot)?),
            None => Ok(()),
        }
    };
    let performed = perform(&performance, &mut driver, &mut look)?;
    if let Some(shown) = shown {
        shown.watching.finish();
    }
    if let Some(recording) = recording {
        let bytes = recording.finish()?.into_inner();
        if let Some(path) = &arguments.mcap {
            files::replace(path, &bytes)?;
            shared.say(format_args!("recording: {}", path.display()));
        }
        if let Some(page) = &arguments.view {
            view::write(page, &bytes)?;
            shared.say(format_args!("page that plays it: {}", page.display()));
        }
    }
    let result = Outcome {
        position: performance.y,
        shift,
        samples,
        seed: arguments.seed,
        expected: arguments.cycles,
        touched: performed.cycles.iter().filter(|cycle| cycle.touched).count(),
        beyond_limits: performed.beyond_limits,
        self_collisions: performed.self_collisions,
        cycles: &performed.cycles,
    };
    match arguments.json {
        true => output::print_json(&result)?,
        false => output::print(&told(&result))?,
    }
    Ok(Ending::Done)
}

/// A performance on a page, as it goes on.
#[derive(Debug)]
struct Shown {
    watching: Paced,
    /// What was decided on the last sample, and so what the next one was predicted as.
    expected: Decision,
    /// Pictures that were taken.
    pictures: u64,
}

impl Shown {
    fn start(arguments: &Arguments, trained: &Trained) -> Result<Option<Self>> {
        let (channels, scaling) = (&trained.checkpoint.channels, &trained.checkpoint.scaling);
        let heading = Heading { title: "NAO reaches", channels, scaling, unit: "s", pace: None };
        let watching = arguments.watch.start(&heading, Some(1.0))?;
        Ok(watching.map(|watching| Self { watching, expected: Decision::default(), pictures: 0 }))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        let time = snapshot.stage.world().time();
        let is_due = time + 1e-9 >= self.pictures as f64 * PICTURES;
        if !is_due && snapshot.decision.is_none() && snapshot.contact.is_none() {
            return;
        }
        if is_due {
            self.pictures += 1;
        }
        let event = snapshot.contact.map(|cycle| format!("touch {}", cycle + 1));
        let sample = snapshot.decision.map(|(sensed, _)| Sample {
            sensed,
            mean: &self.expected.mean,
            variance: &self.expected.variance,
        });
        let scene = snapshot.stage.world().scene();
        self.watching.frame(&Frame { time, scene: Some(&scene), sample, event: event.as_deref() });
        if let Some((_, decision)) = snapshot.decision {
            self.expected = decision.clone();
        }
    }
}

fn recording(trained: &Trained, arguments: &Arguments) -> Result<ReachingRecording<Cursor<Vec<u8>>>> {
    let experiment = trained.notes.as_ref().and_then(|notes| notes.experiment().ok());
    let experiment = experiment.and_then(|experiment| toml::to_string(&experiment).ok());
    let (seed, position) = (arguments.seed.to_string(), arguments.position.0.to_string());
    let notes = [("task", "reach"), ("seed", seed.as_str()), ("position", position.as_str())];
    let mut recording = ReachingRecording::new(Cursor::new(Vec::new()), experiment.as_deref(), &notes)?;
    recording.begin_sequence(0.0, "reach")?;
    Ok(recording)
}

/// In words and a table.
fn told(result: &Outcome<'_>) -> String {
    let mut table = Table::new(&["cycle", "seconds", "gap mm", "off mm", "away mm", "touch"]);
    for (index, cycle) in result.cycles.iter().enumerate() {
        table.row(vec![
            (index + 1).to_string(),
            format!("{:.2}", cycle.touch.time),
            format!("{:.1}", 1e3 * cycle.touch.gap),
            format!("{:.1}", 1e3 * cycle.touch.aim),
            cycle.retraction.map_or("\u{2013}".to_owned(), |moment| format!("{:.0}", 1e3 * moment.gap)),
            if cycle.touched { "yes" } else { "no" }.to_owned(),
        ]);
    }
    let Outcome { touched, expected, beyond_limits, self_collisions, .. } = result;
    let mut text = format!("{table}\ntouched {touched} times in {expected} cycles");
    if *beyond_limits > 0 {
        text += &format!("; {beyond_limits} joint targets were beyond their limits, and cut");
    }
    if *self_collisions > 0 {
        text += &format!("; the robot touched itself in {self_collisions} samples");
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_positions_or_metres() {
        assert_eq!("2".parse(), Ok(Place(-0.07)));
        assert_eq!("-0.105".parse(), Ok(Place(-0.105)));
        assert!("4".parse::<Place>().unwrap_err().contains("between positions 1 and 3"));
        assert!("left".parse::<Place>().unwrap_err().contains("1, 2, 3 or a number"));
    }
}
