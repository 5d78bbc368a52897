//! The experiments of Murata's thesis (2016), chapters 3 to 5, each from data to page.
//!
//! [`STUDIES`] lists them. [`Experiment::run`] makes the data, trains, generates, recognises and evaluates. Its folder receives
//! `report.html`, one page that needs nothing else; `metrics.json`, all numbers; `figures/`, each figure as SVG with its
//! numbers as CSV; and a run folder for each training. Trainings that are finished are not repeated, nor are parts of
//! evaluations, and what was interrupted goes on.
//!
//! | module | what it holds |
//! |---|---|
//! | `framework` | what all studies have in common: jobs side by side, kept evaluations, measures, verdicts, the page |
//! | `curves` | twelve Lissajous curves (thesis 3.2), and 144 patterns (thesis 6.2.3) |
//! | `sinusoid` | a sine wave whose noise changes over time (thesis 3.3) |
//! | `limit_cycle` | an oscillator that is driven by noise which depends on its state (thesis 3.4) |
//! | `reach` | NAO learns to touch a sphere (4) |
//! | `interact` | two robots (5) |
//!
//! A study is one folder here, and a line in [`STUDIES`].

mod curves;
mod framework;
mod interact;
mod limit_cycle;
mod reach;
mod sinusoid;

use scrnn_run::failure::Result;

pub use framework::context::{Context, ProgressOf};
pub use framework::metrics::METRICS;
pub use framework::options::{Options, Reproduced};
pub use framework::preset::Preset;
use framework::reproduce;

/// One of the thesis' experiments.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// Its word on the command line and in metrics.json.
    pub word: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    run: fn(&'static str, &Options, &Context<'_>) -> Result<Reproduced>,
}

impl Experiment {
    /// Reproduces it.
    ///
    /// # Errors
    /// What is wrong with the settings, and whatever the disk refuses.
    pub fn run(&self, options: &Options, context: &Context<'_>) -> Result<Reproduced> {
        (self.run)(self.word, options, context)
    }
}

/// All experiments, in the order of the thesis.
pub static STUDIES: [Experiment; 6] = [
    Experiment {
        word: "lissajous",
        about: "Twelve Lissajous curves, each with noise of its own (3.2)",
        run: |word, options, context| reproduce(word, &curves::LISSAJOUS, options, context),
    },
    Experiment {
        word: "patterns",
        about: "144 patterns in one network (6.2.3)",
        run: |word, options, context| reproduce(word, &curves::PATTERNS, options, context),
    },
    Experiment {
        word: "sinusoid",
        about: "A sine wave whose noise changes over time (3.3)",
        run: |word, options, context| reproduce(word, &sinusoid::Sinusoid, options, context),
    },
    Experiment {
        word: "limit-cycle",
        about: "An oscillator that is driven by noise which depends on its state (3.4)",
        run: |word, options, context| reproduce(word, &limit_cycle::LimitCycle, options, context),
    },
    Experiment {
        word: "reach",
        about: "NAO learns to touch a sphere from demonstrations, in simulation (4)",
        run: |word, options, context| reproduce(word, &reach::REACH, options, context),
    },
    Experiment {
        word: "interact",
        about: "Two robots interact: reactive and proactive behaviour, and error regression (5)",
        run: |word, options, context| reproduce(word, &interact::INTERACT, options, context),
    },
];
