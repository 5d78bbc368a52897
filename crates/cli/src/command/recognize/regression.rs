//! How to regress, as options of the command line.

use std::time::Duration;

use clap::{Args, ValueEnum};
use scrnn::error_regression::{Ascent, ErrorRegressionOptions};

use scrnn_run::failure::{Failure, Result};
use scrnn_run::following::Deadline;

/// Options of error regression.
#[derive(Debug, Args)]
#[command(next_help_heading = "Error regression")]
pub struct RegressionArguments {
    /// Steps in the sliding window, 1 to 1000000 [default: 50]
    #[arg(long, value_name = "W", value_parser = crate::args::count(1, 1_000_000))]
    window: Option<usize>,
    /// Updates of the internal state for each sample, 0 to 1000000 [default: 10]
    #[arg(long, value_name = "N", value_parser = crate::args::count(0, 1_000_000))]
    steps: Option<usize>,
    /// How the internal state is moved [default: what is safe for most networks]
    #[arg(long, value_enum)]
    optimiser: Option<Optimiser>,
    /// Momentum of the ascent, 0 to 0.9999 [default: 0.9]
    #[arg(long, value_name = "M", value_parser = crate::args::number(0.0, 0.9999))]
    momentum: Option<f64>,
    /// Longest gradient, 0 to 1e12; 0 leaves it as it is
    #[arg(long, value_name = "NORM", value_parser = crate::args::number(0.0, 1e12))]
    max_norm: Option<f64>,
    /// Milliseconds that each sample may take, more than 0, at most 1e9: updates that do not fit are left out
    #[arg(long, value_name = "MS", value_parser = crate::args::positive(1e9))]
    deadline: Option<f64>,
}

/// How the internal state is moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Optimiser {
    /// Gradient ascent with momentum, as in the thesis
    Momentum,
    /// Adam
    Adam,
}

/// The momentum ascent's rate for one channel: divided by their number it is the one that the thesis' chapter 5 has.
const THESIS_RATE: f64 = 1e-4;

impl RegressionArguments {
    /// Whether any of them was given.
    pub fn given(&self) -> bool {
        let Self { window, steps, optimiser, momentum, max_norm, deadline } = self;
        window.or(*steps).is_some() || optimiser.is_some() || momentum.or(*max_norm).or(*deadline).is_some()
    }

    /// For a network on so many channels.
    pub fn options(&self, rate: Option<f64>, channels: usize) -> Result<ErrorRegressionOptions> {
        let mut options = ErrorRegressionOptions::new(channels);
        options.window = self.window.unwrap_or(options.window);
        options.iterations = self.steps.unwrap_or(options.iterations);
        match (self.optimiser, self.momentum) {
            (Some(Optimiser::Adam), Some(_)) => {
                return Err(Failure::input("--momentum does not go with --optimiser adam", "leave one of them out"));
            }
            (Some(Optimiser::Momentum), _) | (None, Some(_)) => {
                let momentum = self.momentum.unwrap_or(0.9);
                (options.ascent, options.max_norm) =
                    (Ascent::Momentum { rate: THESIS_RATE / channels as f64, momentum }, None);
            }
            (Some(Optimiser::Adam), None) => (options.ascent, options.max_norm) = (Ascent::Adam { rate: 0.05 }, None),
            (None, None) => {}
        }
        if let Some(given) = rate {
            options.ascent = options.ascent.with_rate(given);
        }
        if let Some(norm) = self.max_norm {
            options.max_norm = Some(norm).filter(|&norm| norm != 0.0);
        }
        Ok(options)
    }

    /// The clock of the control loop.
    pub fn clock(&self) -> Result<Deadline> {
        let Some(ms) = self.deadline else { return Ok(Deadline::new(None)) };
        match Duration::try_from_secs_f64(ms / 1e3) {
            Ok(limit) if ms > 0.0 => Ok(Deadline::new(Some(limit))),
            _ => Err(Failure::input(format!("--deadline is {ms}"), "give milliseconds, more than 0")),
        }
    }
}
