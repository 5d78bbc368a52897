//! `scrnn recognize --online`: error regression while samples arrive (thesis 2.10.2).

use std::fmt::Write as _;
use std::io::{self, BufReader};
use std::path::Path;
use std::time::Duration;

use clap::{Args, ValueEnum};
use scrnn::dataset::{Dataset, Sequence};
use scrnn::error_regression::{Ascent, ErrorRegression, ErrorRegressionOptions, Regression};
use serde::Serialize;
use serde_json::{Value, json};

use super::deadline::{Deadline, Latency};
use super::stream::{Arrival, Stream};
use crate::args::Shared;
use crate::command::generate::unit_names;
use crate::failure::{Ending, Failure, Result};
use crate::files::{self, Field};
use crate::output;
use crate::table::Table;
use crate::trained::Trained;

const HEADING: &str = "Options of --online";

/// How to regress.
#[derive(Debug, Args)]
#[command(next_help_heading = HEADING)]
pub struct Online {
    /// Follow the samples one by one: regress over a sliding window whenever one arrives, and predict the next
    #[arg(long, conflicts_with_all = ["observed", "completed", "starts", "epochs", "seed"])]
    online: bool,
    /// Steps in the window
    #[arg(long, value_name = "W", default_value_t = 20, requires = "online")]
    window: usize,
    /// Updates of the internal state for each sample
    #[arg(long, value_name = "N", default_value_t = 10, requires = "online")]
    steps: usize,
    /// How the internal state is moved
    #[arg(long, value_enum, requires = "online")]
    optimiser: Option<Optimiser>,
    /// Momentum of the ascent [default: 0.9]
    #[arg(long, value_name = "M", requires = "online")]
    momentum: Option<f64>,
    /// Longest gradient; 0 leaves it as it is
    #[arg(long, value_name = "NORM", requires = "online")]
    max_norm: Option<f64>,
    /// Milliseconds that each sample may take: updates that do not fit are left out
    #[arg(long, value_name = "MS", requires = "online")]
    deadline: Option<f64>,
    /// Samples to predict beyond the next one
    #[arg(long, value_name = "N", default_value_t = 10, requires = "online")]
    ahead: usize,
    /// Channels whose input is the network's own prediction, as those of an arm that it moves
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "online")]
    closed_channels: Vec<String>,
    /// Channels whose errors are not regressed on
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "online")]
    unheeded_channels: Vec<String>,
    /// Start from the state of the K-th learned sequence, counted from 1 [default: their mean]
    #[arg(long, value_name = "K", requires = "online")]
    sequence: Option<usize>,
    /// In the JSON object, show window and future at these samples, counted from 1
    #[arg(long, value_name = "K,...", value_delimiter = ',', requires_all = ["online", "json"])]
    at: Vec<usize>,
}

/// How the internal state is moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Optimiser {
    /// Gradient ascent with momentum, as in the thesis
    Momentum,
    /// Adam
    Adam,
}

impl Online {
    /// Whether it is asked for.
    pub fn wanted(&self) -> bool {
        self.online
    }

    fn options(&self, rate: Option<f64>, trained: &Trained) -> Result<ErrorRegressionOptions> {
        let channels = &trained.checkpoint.channels;
        let mut options = ErrorRegressionOptions::new(channels.len());
        options.window = self.window;
        options.iterations = self.steps;
        options.ahead = self.ahead;
        let given = match (self.optimiser, self.momentum) {
            (Some(Optimiser::Adam), Some(_)) => {
                return Err(Failure::input("--momentum does not go with --optimiser adam", "leave one of them out"));
            }
            (Some(Optimiser::Momentum), momentum) | (None, momentum @ Some(_)) => {
                Some(Ascent::Momentum { rate: THESIS_RATE / channels.len() as f64, momentum: momentum.unwrap_or(0.9) })
            }
            (Some(Optimiser::Adam), None) => Some(Ascent::Adam { rate: ADAM_RATE }),
            (None, None) => None,
        };
        if let Some(ascent) = given {
            (options.ascent, options.max_norm) = (ascent, None);
        }
        if let Some(given) = rate {
            let (Ascent::Momentum { rate, .. } | Ascent::Adam { rate }) = &mut options.ascent;
            *rate = given;
        }
        if let Some(norm) = self.max_norm {
            options.max_norm = Some(norm).filter(|&norm| norm != 0.0);
        }
        for (names, shares) in
            [(&self.closed_channels, &mut options.sensed), (&self.unheeded_channels, &mut options.heeded)]
        {
            for name in names {
                let channel = channels.iter().position(|channel| channel == name).ok_or_else(|| {
                    let help = format!("the channels are {}", channels.join(", "));
                    Failure::input(format!("the network has no channel `{name}`"), help)
                })?;
                shares[channel] = 0.0;
            }
        }
        Ok(options)
    }

    fn start<'a>(&self, trained: &'a Trained) -> Result<&'a [f64]> {
        let learned = &trained.checkpoint.initial_states;
        match self.sequence {
            None => Ok(learned.mean()),
            Some(k) if (1..=learned.sequences()).contains(&k) => Ok(learned.sequence(k - 1)),
            Some(k) => {
                let help = format!("the network learned {}, counted from 1", learned.sequences());
                Err(Failure::input(format!("there is no learned sequence {k}"), help))
            }
        }
    }

    fn limit(&self) -> Result<Option<Duration>> {
        let limit = |ms: f64| match ms > 0.0 {
            true => Duration::try_from_secs_f64(ms / 1e3).ok(),
            false => None,
        };
        match self.deadline.map(|ms| limit(ms).ok_or(ms)) {
            None => Ok(None),
            Some(Ok(limit)) => Ok(Some(limit)),
            Some(Err(ms)) => Err(Failure::input(format!("--deadline is {ms}"), "give milliseconds, more than 0")),
        }
    }
}
