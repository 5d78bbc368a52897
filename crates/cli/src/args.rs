//! The options that commands share.

use std::path::Path;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use scrnn::engine::{Engine, InstructionSet};
use scrnn_data::{Axes, Selection, TimeSource};
use scrnn_run::experiment::Override;
use scrnn_run::failure::Result;
use scrnn_run::messages::Messages;
use scrnn_run::trained::Trained;
use scrnn_tasks::TaskName;

use crate::output;

/// Where the options of every command stand in the help.
const SHARED: &str = "Options of every command";

/// Where options for reading data stand.
const FILES: &str = "Options for data files";

/// Options of every command.
#[derive(Debug, Args)]
pub struct Shared {
    /// Threads to work with, 0 to 1024; 0 takes one for each core. The result is the same to the bit
    #[arg(long, global = true, value_name = "N", default_value_t = 0, hide_default_value = true, help_heading = SHARED,
        value_parser = count(0, 1024))]
    pub threads: usize,
    /// The vector instructions to use; by default the fastest that the processor has
    #[arg(long, global = true, value_name = "NAME", hide_short_help = true, help_heading = SHARED)]
    pub instruction_set: Option<InstructionSet>,
    /// No progress and no messages, only results and errors
    #[arg(long, short, global = true, help_heading = SHARED)]
    pub quiet: bool,
}

impl Shared {
    /// The machine to compute on.
    pub fn engine(&self) -> Result<Engine> {
        Ok(Engine::new(self.threads, self.instruction_set())?)
    }

    /// The vector instructions in use.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set.unwrap_or_else(InstructionSet::best)
    }

    /// Says what is to be known of a network before its variances are used.
    pub fn say_of(&self, trained: &Trained) {
        if let Some(remark) = trained.remark() {
            self.say(remark);
        }
    }

    /// Says something on stderr, unless told to be quiet.
    pub fn say(&self, message: impl std::fmt::Display) {
        if !self.quiet {
            output::say(message);
        }
    }
}

impl Messages for Shared {
    fn say(&self, message: &str) {
        Shared::say(self, message);
    }
}

/// Which part of data files is meant, and how it is to be taken.
#[derive(Debug, Clone, Default, Args)]
pub struct Part {
    /// In recordings, the topic whose messages are samples; several are joined [default: /sensed, or the only one]
    #[arg(long, help_heading = FILES, value_name = "TOPIC,...", value_delimiter = ',')]
    pub topic: Vec<String>,
    /// What tells when a sample was taken; `rows` takes rows and messages as even steps [default: the best there is]
    #[arg(long, help_heading = FILES, value_name = "CLOCK", value_parser = clocks())]
    pub time: Option<TimeSource>,
    /// Bring recordings, and tables with a clock, to samples this many seconds apart, 1e-9 to 1e9, on straight lines between them
    #[arg(long, help_heading = FILES, value_name = "SECONDS", value_parser = number(1e-9, 1e9))]
    pub period: Option<f64>,
    /// The channels to take, by their names [default: all]
    #[arg(long, help_heading = FILES, value_name = "NAME,...", value_delimiter = ',')]
    pub channels: Option<Vec<String>>,
    /// Of files with several arrays or data sets, those to take, by name or path [default: the reader chooses]
    #[arg(long, help_heading = FILES, value_name = "NAME,...", value_delimiter = ',')]
    pub arrays: Vec<String>,
    /// What the axes of an array are, a letter for each: `n` sequences, `t` steps, `c` channels, e.g. nct
    #[arg(long, help_heading = FILES, value_name = "LETTERS")]
    pub axes: Option<Axes>,
    /// Channels that are angles: their jumps of a whole turn are taken out
    #[arg(long, help_heading = FILES, value_name = "NAME,...", value_delimiter = ',')]
    pub unwrap: Vec<String>,
}

/// The largest whole number of a TOML file: experiments cannot note larger ones.
pub const MOST_IN_TOML: u64 = i64::MAX as u64;

/// A parser for numbers of things, which says its range.
pub fn count(least: usize, most: usize) -> impl Fn(&str) -> std::result::Result<usize, String> + Clone + Send + Sync {
    move |text| match text.parse::<usize>() {
        Ok(count) if (least..=most).contains(&count) => Ok(count),
        _ => Err(format!("give a whole number from {least} to {most}")),
    }
}

/// A parser for whole numbers that may be large, which says their range.
pub fn whole(least: u64, most: u64) -> impl Fn(&str) -> std::result::Result<u64, String> + Clone + Send + Sync {
    move |text| match text.parse::<u64>() {
        Ok(number) if (least..=most).contains(&number) => Ok(number),
        _ => Err(format!("give a whole number from {least} to {most}")),
    }
}

/// A parser for seeds: any number of 64 bits.
pub fn seed() -> impl Fn(&str) -> std::result::Result<u64, String> + Clone + Send + Sync {
    whole(0, u64::MAX)
}

/// A parser for numbers between two, which says its range.
pub fn number(least: f64, most: f64) -> impl Fn(&str) -> std::result::Result<f64, String> + Clone + Send + Sync {
    move |text| match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("give a number from {} to {}", plain(least), plain(most))),
    }
}

/// A number as people write it.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// A parser for positive numbers up to a bound, which says its range.
pub fn positive(most: f64) -> impl Fn(&str) -> std::result::Result<f64, String> + Clone + Send + Sync {
    move |text| match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= most => Ok(value),
        _ => Err(format!("give a number above 0, at most {most:e}")),
    }
}

impl Part {
    /// What it selects in the file at `path`; where it is silent, what `learned` of its training's data says.
    pub fn of(&self, path: &Path, learned: Option<Selection>) -> Selection {
        let own = Selection {
            topics: self.topic.clone(),
            time: self.time,
            period: self.period,
            channels: self.channels.clone(),
            arrays: self.arrays.clone(),
            axes: self.axes,
            unwrap: self.unwrap.clone(),
            ..Selection::default()
        };
        own.or_as_learned(path, learned.unwrap_or_default())
    }

    /// The same as replacements of an experiment's keys.
    pub fn overrides(&self) -> Vec<Override> {
        let mut all = Vec::new();
        all.extend(match self.topic.as_slice() {
            [] => None,
            [only] => Some(Override::text("--topic", "data.topic", only).instead_of("topics")),
            several => Some(Override::list("--topic", "data.topics", several).instead_of("topic")),
        });
        all.extend(self.time.map(|time| Override::text("--time", "data.time", time.word())));
        all.extend(self.period.map(|period| Override::number("--period", "data.period", period)));
        all.extend(self.axes.map(|axes| Override::text("--axes", "data.axes", &axes.to_string())));
        let channels = self.channels.as_deref().unwrap_or_default();
        for (option, key, names) in [
            ("--channels", "data.channels", channels),
            ("--arrays", "data.arrays", &self.arrays),
            ("--unwrap", "data.unwrap", &self.unwrap),
        ] {
            all.extend((!names.is_empty()).then(|| Override::list(option, key, names)));
        }
        all
    }
}

/// A parser for what tells the time.
fn clocks() -> impl TypedValueParser<Value = TimeSource> {
    let word = |time: TimeSource| PossibleValue::new(time.word()).help(time.about());
    PossibleValuesParser::new(TimeSource::ALL.map(word)).try_map(|word| word.parse::<TimeSource>())
}

/// A parser for the names of tasks, which also tells the shell and the help what there is.
pub fn task_names() -> impl TypedValueParser<Value = TaskName> {
    let name = |name: TaskName| PossibleValue::new(name.word()).help(name.about());
    PossibleValuesParser::new(TaskName::ALL.map(name)).try_map(|word| word.parse::<TaskName>())
}
