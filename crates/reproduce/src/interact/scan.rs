//! Error regression over window, iterations, optimiser and rate: which settings are safe for every network?

use scrnn::error_regression::{Ascent, ErrorRegressionOptions};
use scrnn::evaluation::mean_and_deviation;

use super::trials::Subject;
use crate::framework::{Cell, Column, Result, Table};

/// Of the 32 recordings, every how many-th is taken: all settings have to be run on all networks.
const EVERY: usize = 4;

/// One setting.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// As it is shown.
    pub name: String,
    /// The options.
    pub options: ErrorRegressionOptions,
}

/// What is tried: the study's default, and departures from it; then what is the default elsewhere, and departures from that.
pub fn settings(channels: usize) -> Vec<Setting> {
    let default = ErrorRegressionOptions::adam(channels);
    let of = |name: &str, change: &dyn Fn(&mut ErrorRegressionOptions)| {
        let mut options = default.clone();
        change(&mut options);
        Setting { name: name.to_owned(), options }
    };
    let momentum = |rate: f64, max_norm: Option<f64>| {
        move |options: &mut ErrorRegressionOptions| {
            (options.ascent, options.max_norm) = (Ascent::Momentum { rate, momentum: 0.9 }, max_norm);
        }
    };
    let adam = |rate: f64| {
        move |options: &mut ErrorRegressionOptions| (options.ascent, options.max_norm) = (Ascent::Adam { rate }, None)
    };
    // What whoever follows a stream gets.
    let lbfgs = |options: &mut ErrorRegressionOptions| *options = ErrorRegressionOptions::new(channels);
    let thesis = 1e-4 / channels as f64;
    vec![
        of("default", &|_| {}),
        of("window 5", &|options| options.window = 5),
        of("window 10", &|options| options.window = 10),
        of("window 20", &|options| options.window = 20),
        of("window 30", &|options| options.window = 30),
        of("window 70", &|options| options.window = 70),
        of("1 step", &|options| options.iterations = 1),
        of("3 steps", &|options| options.iterations = 3),
        of("30 steps", &|options| options.iterations = 30),
        of("momentum, the thesis' rate", &momentum(thesis, None)),
        of("momentum, 10 times that", &momentum(10.0 * thesis, None)),
        of("momentum, 100 times that", &momentum(100.0 * thesis, None)),
        of("momentum, 10 times that, window 20", &|options| {
            momentum(10.0 * thesis, None)(options);
            options.window = 20;
        }),
        of("momentum 1e-3, gradient to 10", &momentum(1e-3, Some(10.0))),
        of("momentum 1e-3, gradient to 100", &momentum(1e-3, Some(100.0))),
        of("momentum 1e-2, gradient to 1", &momentum(1e-2, Some(1.0))),
        of("momentum 1e-2, gradient to 20", &momentum(1e-2, Some(20.0))),
        of("Adam 0.02", &adam(0.02)),
        of("Adam 0.1", &adam(0.1)),
        of("L-BFGS, as for a stream", &lbfgs),
        of("L-BFGS, window 20", &|options| {
            lbfgs(options);
            options.window = 20;
        }),
        of("L-BFGS, window 70", &|options| {
            lbfgs(options);
            options.window = 70;
        }),
        of("L-BFGS, 5 steps", &|options| {
            lbfgs(options);
            options.iterations = 5;
        }),
        of("L-BFGS, no guard", &|options| {
            lbfgs(options);
            options.guard = Some(false);
        }),
    ]
}

/// One network's mean reaction time and median milliseconds for each of the first `most` settings.
pub fn one(subject: &Subject<'_>, state: &[f64], most: usize) -> Result<Vec<(f64, f64)>> {
    let run = |setting: Setting| {
        let name = format!("scan, {}", setting.name);
        subject.desk.part(&name, || {
            let found = subject.regressed(&name, state, &subject.regression(setting.options), EVERY)?;
            Ok((found.reactions.mean, found.milliseconds[0]))
        })
    };
    settings(subject.data.channels().len()).into_iter().take(most).map(run).collect()
}

/// All networks together; none where no network was scanned.
pub fn table(channels: usize, networks: &[&[(f64, f64)]]) -> Option<Table> {
    let column = |key, label, digits| Column { key, label, digits };
    let row = |(k, setting): (usize, Setting)| {
        let values: Vec<f64> = networks.iter().filter_map(|network| network.get(k)).map(|found| found.0).collect();
        let times: Vec<f64> = networks.iter().filter_map(|network| network.get(k)).map(|found| found.1).collect();
        let (mean, deviation) = mean_and_deviation(&values);
        vec![
            Cell::Text(setting.name),
            Cell::Count(setting.options.window as u64),
            Cell::Count(setting.options.iterations as u64),
            Cell::Number(mean),
            Cell::Number(deviation),
            Cell::Number(values.iter().copied().fold(0.0, f64::max)),
            Cell::Number(mean_and_deviation(&times).0),
            Cell::Numbers(values),
        ]
    };
    (!networks.is_empty()).then(|| Table {
        key: "scan",
        caption: "Which settings are safe for all networks?",
        columns: vec![
            column("setting", "setting", 0),
            column("window", "window", 0),
            column("iterations", "steps", 0),
            column("mean", "mean", 2),
            column("deviation", "sd", 2),
            column("worst", "slowest network", 2),
            column("milliseconds", "ms", 3),
            column("values", "each network", 1),
        ],
        rows: settings(channels).into_iter().enumerate().map(row).collect(),
        note: "Mean reaction times over 8 of the 32 recordings, all from the state of LLRRL. The default is the study's, Adam; L-BFGS is guarded. ms: median time of a control step.",
    })
}
