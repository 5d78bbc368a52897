//! How to regress, as options of the command line.

use std::time::Duration;

use clap::{Args, ValueEnum};
use scrnn::error_regression::ErrorRegressionOptions;

use scrnn_run::failure::{Failure, Result};
use scrnn_run::following::{Conflict, Deadline, Rule, Wanted};

/// Options of error regression.
#[derive(Debug, Args)]
#[command(next_help_heading = "Error regression")]
pub struct RegressionArguments {
    /// Steps in the sliding window, 1 to 1000000 [default: 50]
    #[arg(long, value_name = "W", value_parser = crate::args::count(1, 1_000_000))]
    window: Option<usize>,
    /// Updates of the internal state for each sample, 0 to 1000000 [default: 15 with lbfgs, 10 with the others]
    #[arg(long, value_name = "N", value_parser = crate::args::count(0, 1_000_000))]
    steps: Option<usize>,
    /// How the internal state is moved [default: lbfgs; adam to simulate, and with --rate or --max-norm; momentum with --momentum]
    #[arg(long, value_enum)]
    optimiser: Option<Optimiser>,
    /// Momentum of the ascent, 0 to 0.9999 [default: 0.9]
    #[arg(long, value_name = "M", value_parser = crate::args::number(0.0, 0.9999))]
    momentum: Option<f64>,
    /// Longest gradient, 0 to 1e12; 0 leaves it as it is
    #[arg(long, value_name = "NORM", value_parser = crate::args::number(0.0, 1e12))]
    max_norm: Option<f64>,
    /// Keep the best state that was met, be it the one before the first update; lbfgs does so anyway
    #[arg(long)]
    keep_best: bool,
    /// End with an update that changes ln L of the window by less than NATS a step, 0 to 1e6 [default: 2e-5 for lbfgs, 0 for the others]
    #[arg(long, value_name = "NATS", value_parser = crate::args::number(0.0, 1e6))]
    tolerance: Option<f64>,
    /// Go on from the state without regression where its predictions made the window more likely than regression does
    /// [default: on for lbfgs, off for the others]
    #[arg(long, value_enum)]
    guard: Option<Guard>,
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
    /// L-BFGS: no update leads downhill, and the last samples' curvature is known
    Lbfgs,
}

/// Whether the network without regression runs beside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Guard {
    /// Compare with it
    On,
    /// Regress whatever comes of it
    Off,
}

impl RegressionArguments {
    /// Whether any of them was given.
    pub fn given(&self) -> bool {
        let Self { window, steps, optimiser, momentum, max_norm, keep_best, tolerance, guard, deadline } = self;
        let numbers = momentum.or(*max_norm).or(*tolerance).or(*deadline);
        window.or(*steps).is_some() || optimiser.is_some() || guard.is_some() || *keep_best || numbers.is_some()
    }

    /// Changes of `default`, which says the number of channels.
    pub fn options(&self, default: ErrorRegressionOptions, rate: Option<f64>) -> Result<ErrorRegressionOptions> {
        let mut options = default;
        options.window = self.window.unwrap_or(options.window);
        let rule = self.optimiser.map(|optimiser| match optimiser {
            Optimiser::Momentum => Rule::Momentum,
            Optimiser::Adam => Rule::Adam,
            Optimiser::Lbfgs => Rule::Lbfgs,
        });
        let wanted = Wanted { rule, rate, momentum: self.momentum, max_norm: self.max_norm, iterations: self.steps };
        wanted.change(&mut options).map_err(|Conflict { what, rule }| {
            let message = format!("--{} does not go with --optimiser {}", what.replace('_', "-"), rule.name());
            Failure::input(message, "leave one of them out")
        })?;
        options.keep_best = self.keep_best;
        options.tolerance = self.tolerance;
        options.guard = self.guard.map(|guard| guard == Guard::On);
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
