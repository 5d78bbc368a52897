//! The options that commands share.

use std::path::Path;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use scrnn::engine::{Engine, InstructionSet};
use scrnn_data::Selection;
use scrnn_run::failure::Result;
use scrnn_run::messages::Messages;
use scrnn_tasks::TaskName;

use crate::output;

/// Where the options of every command stand in the help.
const SHARED: &str = "Options of every command";

/// Options of every command.
#[derive(Debug, Args)]
pub struct Shared {
    /// Threads to work with, at most 1024; 0 takes one for each core. The result is the same to the bit
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

/// Which part of data files is meant.
#[derive(Debug, Clone, Default, Args)]
pub struct Part {
    /// In .mcap files, the topic whose messages are samples [default: /sensed, or the only one that is JSON]
    #[arg(long, value_name = "TOPIC")]
    pub topic: Option<String>,
    /// In .mcap files, bring the messages to samples this many seconds apart, on straight lines between them
    #[arg(long, value_name = "SECONDS", value_parser = period)]
    pub period: Option<f64>,
    /// The channels to take, by their names [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub channels: Option<Vec<String>>,
}

/// A parser for numbers of things, which says its range.
pub fn count(least: usize, most: usize) -> impl Fn(&str) -> std::result::Result<usize, String> + Clone + Send + Sync {
    move |text| match text.parse::<usize>() {
        Ok(count) if (least..=most).contains(&count) => Ok(count),
        _ => Err(format!("give a whole number from {least} to {most}")),
    }
}

/// A parser for positive numbers up to a bound, which says its range.
pub fn positive(most: f64) -> impl Fn(&str) -> std::result::Result<f64, String> + Clone + Send + Sync {
    move |text| match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= most => Ok(value),
        _ => Err(format!("give a number above 0, at most {most:e}")),
    }
}

fn period(text: &str) -> std::result::Result<f64, String> {
    let period: f64 = text.parse().map_err(|_| "give a number of seconds".to_owned())?;
    let fits = (1e-9..=1e9).contains(&period);
    if fits { Ok(period) } else { Err("give a number of seconds from 1e-9 to 1e9".to_owned()) }
}

impl Part {
    /// What it selects in the file at `path`; where it is silent, what `learned` of its training's data says.
    pub fn of(&self, path: &Path, learned: Option<Selection>) -> Selection {
        let Selection { topics, period, channels, arrays, unwrap, .. } = learned.unwrap_or_default();
        let is = |wanted: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted));
        let recording = path.is_dir() || is("mcap") || is("db3");
        Selection {
            topics: match &self.topic {
                Some(topic) => vec![topic.clone()],
                None if recording => topics,
                None => Vec::new(),
            },
            period: self.period.or(period.filter(|_| recording)),
            channels: self.channels.clone().or(channels),
            arrays: if ["npz", "hdf5", "h5", "mat"].into_iter().any(is) { arrays } else { Vec::new() },
            unwrap,
            ..Selection::default()
        }
    }
}

/// A parser for the names of tasks, which also tells the shell and the help what there is.
pub fn task_names() -> impl TypedValueParser<Value = TaskName> {
    let name = |name: TaskName| PossibleValue::new(name.word()).help(name.about());
    PossibleValuesParser::new(TaskName::ALL.map(name)).try_map(|word| word.parse::<TaskName>())
}
