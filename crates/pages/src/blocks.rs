//! An assessment and learning curves as parts of a page.

use scrnn::analysis::calibration::{WITHIN_ONE, WITHIN_TWO};

use scrnn_report::{Block, Chart, Figure, Panel, Series, Sheet, Tone};
use scrnn_run::assessment::Assessment;
use scrnn_run::history::Row;

/// nll against epochs, or the squared error where there is no variance. `floor` is the entropy of the noise.
pub fn learning_curves(file: &str, title: &str, runs: &[(String, &[Row])], floor: Option<f64>) -> Block {
    let with_variance = runs.iter().all(|(_, rows)| rows.iter().all(|row| row.nll.is_some()));
    let value = |row: &Row| if with_variance { row.nll.unwrap_or(f64::NAN) } else { row.mse.log10() };
    let mut series: Vec<Series> = runs
        .iter()
        .enumerate()
        .map(|(k, (name, rows))| {
            let points = rows.iter().map(|row| (row.epoch as f64, value(row))).collect();
            // Four colours can be told apart; more seeds than that are a bundle.
            match runs.len() {
                1 => Series::line(name.clone(), Tone::Ours, points),
                2..=4 => Series::line(name.clone(), Tone::Level(k), points),
                _ => Series::line("each seed", Tone::Ours, points),
            }
        })
        .collect();
    if let [(_, rows)] = runs {
        let held_out = |row: &Row| row.held_out.map(|held_out| if with_variance { held_out } else { held_out.log10() });
        let points: Vec<(f64, f64)> = rows.iter().filter_map(|row| Some((row.epoch as f64, held_out(row)?))).collect();
        if !points.is_empty() {
            series.push(Series::line("sequences that are held out", Tone::Level(2), points));
        }
    }
    let last = series.iter().filter_map(|series| series.points.last()).map(|point| point.0).fold(1.0, f64::max);
    if let Some(floor) = floor.filter(|_| with_variance) {
        series.push(Series::line("entropy of the noise", Tone::Truth, vec![(0.0, floor), (last, floor)]));
    }
    let mut panel = Panel::spanning("", series);
    panel.x = (0.0, last);
    // What the first few epochs come down from would flatten all the rest.
    let early = |rows: &&[Row]| rows.get(rows.len() / 50).map(value);
    let top = runs.iter().filter_map(|(_, rows)| early(rows)).fold(f64::NEG_INFINITY, f64::max);
    if top.is_finite() && top > panel.y.0 {
        panel.y.1 = panel.y.1.min(top + 0.05 * (top - panel.y.0));
    }
    let caption = if with_variance {
        "How unexpected each next sample is, in nats per step and channel: lower is better. The entropy of the noise is the \
         nll of the true means and variances. Below it, a network has memorised single samples."
    } else {
        "Mean squared error per step and channel, as a power of ten: lower is better."
    };
    let caption = format!("{caption}{}", recoveries_in_words(runs));
    let y_label = if with_variance { "nll, nats" } else { "log10 of the squared error" };
    let chart =
        Chart { columns: 1, aspect: 2.2, x_label: "epoch".into(), y_label: y_label.into(), panels: vec![panel] };
    let (file, title, thesis) = (file.to_owned(), title.to_owned(), String::new());
    Block::Figure(Box::new(Figure { file, title, caption, thesis, drawing: chart.into() }))
}

/// Which runs became unstable and were reset to their best network, and when.
fn recoveries_in_words(runs: &[(String, &[Row])]) -> String {
    let mut text = String::new();
    for (name, rows) in runs {
        let pairs = rows.iter().zip(rows.iter().skip(1));
        let epochs: Vec<String> =
            pairs.filter(|(a, b)| b.recoveries > a.recoveries).map(|(_, b)| b.epoch.to_string()).collect();
        let times = rows.last().map_or(0, |row| row.recoveries);
        if times > 0 {
            let list = if epochs.len() > 8 { format!("{}, ...", epochs[..8].join(", ")) } else { epochs.join(", ") };
            text += &format!(
                " Of {name}, training became unstable {times} times (epochs {list}). Each time it went back to the best \
                 network and on at half the rate."
            );
        }
    }
    text
}

/// The nll beside simple models, and predicted beside observed standard deviations.
pub fn calibration_blocks(assessment: &Assessment) -> Vec<Block> {
    let shown = |nll: Option<f64>| nll.map_or("\u{2013}".to_owned(), |nll| format!("{nll:.4}"));
    let mut rows = vec![vec!["this network, learned sequences".to_owned(), shown(assessment.nll)]];
    if assessment.nll_held_out.is_some() {
        rows.push(vec!["this network, new sequences".into(), shown(assessment.nll_held_out)]);
    }
    if assessment.entropy_of_noise.is_some() {
        rows.push(vec!["the truth: entropy of the noise".into(), shown(assessment.entropy_of_noise)]);
    }
    rows.extend(assessment.baselines.iter().map(|baseline| vec![baseline.model.to_owned(), shown(baseline.nll)]));
    // Whatever is new to the network says more than what it learned.
    let judged = match assessment.nll_held_out {
        Some(_) => "the sequences that were held out",
        None => "the sequences that it learned",
    };
    let mut blocks = vec![Block::Sheet(Sheet {
        caption: "nll in nats per step and channel".into(),
        head: vec!["model".into(), "nll".into()],
        rows,
        note: "Simple models have, for each channel, the variance that suits them best on the learned sequences."
            .into(),
    })];
    let Some(calibration) = &assessment.calibration else { return blocks };
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    blocks.push(Block::Sheet(Sheet {
        caption: format!("Are errors as large as predicted? On {judged}"),
        head: ["", "here", "Gaussian"].map(String::from).to_vec(),
        rows: vec![
            vec![
                "errors within one predicted standard deviation".into(),
                percent(calibration.within_one),
                percent(WITHIN_ONE),
            ],
            vec!["errors within two".into(), percent(calibration.within_two), percent(WITHIN_TWO)],
            vec!["mean of squared error over variance".into(), format!("{:.3}", calibration.mean_square), "1".into()],
        ],
        note: String::new(),
    }));
    let points: Vec<(f64, f64)> = calibration.bins.iter().map(|bin| (bin.predicted, bin.observed)).collect();
    let largest = points.iter().flat_map(|&(x, y)| [x, y]).fold(0.0, f64::max) * 1.08;
    let series = vec![
        Series::line("as large as predicted", Tone::Truth, vec![(0.0, 0.0), (largest, largest)]),
        Series::dots("observed", Tone::Ours, points),
    ];
    let panel =
        Panel { title: String::new(), x: (0.0, largest), y: (0.0, largest), series, failed: false, equal: false };
    let chart = Chart {
        columns: 1,
        aspect: 1.7,
        x_label: "predicted standard deviation, scaled units".into(),
        y_label: "observed".into(),
        panels: vec![panel],
    };
    blocks.push(Block::Figure(Box::new(Figure {
        file: "calibration".into(),
        title: format!("Predicted against observed standard deviation, on {judged}"),
        caption: "Steps are put into groups of similar predicted variance; each dot is a group, with the root mean \
                  square of its errors. On the line, predictions are right; above it, errors are larger than predicted."
            .into(),
        thesis: String::new(),
        drawing: chart.into(),
    })));
    blocks
}
