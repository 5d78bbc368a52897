//! Predicted variance over the cycle, as a figure and a table.

use scrnn_report::{Block, Chart, Panel, Series, Sheet, Tone};

use super::variance::ByPhase;
use crate::framework::shapes::figure;

/// Both.
pub fn blocks(by_phase: &ByPhase) -> Vec<Block> {
    vec![variance(by_phase), variance_table(by_phase)]
}

/// Over the cycle.
fn variance(by_phase: &ByPhase) -> Block {
    let line = |name: &str, tone, values: &[f64]| {
        let points = by_phase.phase.iter().zip(values).map(|(&phase, &v)| (f64::from(phase), v.log10())).collect();
        Series::line(name, tone, points)
    };
    let series = vec![
        line("predicted one step ahead", Tone::Ours, &by_phase.predicted),
        line("squared error of the prediction", Tone::Truth, &by_phase.residual),
        line("of the demonstrations, within a sequence", Tone::Data, &by_phase.within),
        line("predicted while driving the robot", Tone::Level(2), &by_phase.driving),
    ];
    let panels = vec![Panel::spanning("", series)];
    let chart = Chart {
        columns: 1,
        aspect: 2.6,
        x_label: "samples from the touch".into(),
        y_label: "log10 of variance".into(),
        panels,
    };
    figure(
        "variance-by-phase",
        "Predicted variance over the cycle",
        "Mean over the arm's four channels, in the network's units. The network predicts the variance of its next error. \
         That is less than the variance between demonstrations, because much of it is known half a second before.",
        "4.3.1: the variance decreases to the minimum at the very moment of touching the object and increases after the robot \
         retracts its arm.",
        chart,
    )
}

/// The same in numbers.
fn variance_table(v: &ByPhase) -> Block {
    let row = |k: usize| {
        let cell = |value: f64| format!("{value:.2e}");
        vec![
            v.phase[k].to_string(),
            cell(v.predicted[k]),
            cell(v.residual[k]),
            format!("{:.2}", v.predicted[k] / v.residual[k]),
            cell(v.within[k]),
            cell(v.driving[k]),
        ]
    };
    Block::Sheet(Sheet {
        caption: "The same in numbers".into(),
        head: ["samples from the touch", "predicted", "squared error", "ratio", "demonstrations", "while driving"]
            .map(String::from)
            .to_vec(),
        rows: (0..v.phase.len()).map(row).collect(),
        note: String::new(),
    })
}
