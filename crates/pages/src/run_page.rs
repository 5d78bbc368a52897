//! A training run as a page: how it learned, how it predicts, how it runs on its own.

use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, Generated, GenerationOptions};

use scrnn_report::{Block, Chart, Figure, Mark, Page, Panel, Section, Series, Sheet, Tone};
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_run::channel_scores::{ChannelScore, channel_scores};
use scrnn_run::evaluation::Member;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::Result;
use scrnn_run::held_out::Watch;
use scrnn_run::history::Row;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;

use crate::{calibration_blocks, held_out, learning_curves};

/// Sequences that are drawn over time.
const DRAWN: usize = 4;
/// Samples of each.
const SAMPLES: usize = 300;

/// The page about a run: how it learned (`rows` of its history), how it predicts the sequences of `source`, those that it learned
/// and those that were held out, and how it runs on its own with noise of this seed.
///
/// # Errors
/// What is wrong with the run's data.
pub fn page(trained: &Trained, source: &Source, rows: &[Row], seed: u64, engine: &Engine) -> Result<Page> {
    let data = &source.data;
    let (checkpoint, network) = (&trained.checkpoint, trained.network());
    let scaled = checkpoint.scaling.apply(data)?;
    let (n, delay) = (scaled.channels().len(), network.topology().delay());
    let initial_states = &checkpoint.initial_states;
    let states: Vec<&[f64]> = (0..initial_states.sequences()).map(|s| initial_states.sequence(s)).collect();
    let open = assessment::open_loop(&network, &states, &scaled, engine)?;
    let options = GenerationOptions::new(
        assessment::longest(&scaled, delay),
        Feedback::closed(n, network.topology().has_variance()),
    )
    .seed(seed);
    let closed = assessment::run(&network, &states, &scaled, &options, engine)?;

    let experiment = trained.notes.as_ref().map(|notes| &notes.experiment);
    let experiment: Option<Experiment> = experiment.and_then(|value| serde_json::from_value(value.clone()).ok());
    let watch = match &experiment {
        Some(experiment) => Watch::new(experiment, (source, &checkpoint.scaling, &scaled), delay, engine)?,
        None => None,
    };
    let members = [Member { network: &network, states: initial_states }];
    let new = watch.as_ref().map(|watch| watch.predictions(&members)).transpose()?;
    let mut assessment = Assessment::new(&scaled, &Predictions::of(&open, &scaled, delay), new.as_ref(), delay);
    if let Some(truth) = &source.truth {
        // In scaled units, as all of the assessment.
        let scale = checkpoint.scaling.scale();
        let variances = truth.variances.map(|channel, v| v * scale[channel].powi(2));
        assessment = assessment.with_truth(&variances, delay);
    }
    let name = experiment.as_ref().map_or("a network", |experiment| &experiment.name).to_owned();
    let lede = format!(
        "{} sequences on {} ({}), {} context units, after {} epochs. Predictions reach {} ahead.",
        data.sequences().len(),
        if n == 1 { "one channel".to_owned() } else { format!("{n} channels") },
        data.channels().join(", "),
        network.topology().context_units(),
        checkpoint.epoch,
        if delay == 1 { "one step".to_owned() } else { format!("{delay} steps") },
    );
    let runs = [("this run".to_owned(), rows)];
    let mut learning = vec![learning_curves("learning", "Learning curve", &runs, assessment.entropy_of_noise)];
    let mut ahead: Vec<Block> = drawn(data, trained, &open, true);
    ahead.push(channel_sheet(&channel_scores(&scaled, &open, delay, &checkpoint.scaling)));
    ahead.extend(calibration_blocks(&assessment));
    if let Some(score) = trained.notes.as_ref().and_then(|notes| notes.score) {
        let rows = vec![
            vec!["epoch".to_owned(), score.epoch.to_string()],
            vec!["nll".into(), score.nll.map_or("\u{2013}".into(), |nll| format!("{nll:.4}"))],
            vec!["squared error".into(), format!("{:.3e}", score.mse)],
        ];
        let note = "Per step and channel, in scaled units.".into();
        learning.push(Block::Sheet(Sheet { caption: "At the end".into(), head: Vec::new(), rows, note }));
    }
    let mut sections = vec![
        Section { title: "Learning".into(), blocks: learning },
        Section { title: "One step ahead".into(), blocks: ahead },
        Section { title: "On its own".into(), blocks: drawn(data, trained, &closed, false) },
    ];
    if let (Some(watch), Some(experiment)) = (&watch, &experiment) {
        let variance = experiment.network.initial_state_variance;
        let judgement = watch.judge(&members, checkpoint.epoch, variance)?;
        sections.insert(2, held_out::section(&judgement));
    }
    sections.extend(initial_state_plane(trained));
    if let Some(experiment) = &experiment {
        let text = toml::to_string(experiment).unwrap_or_default();
        sections.push(Section { title: "Settings".into(), blocks: vec![Block::Verbatim(text)] });
    }
    Ok(Page { title: format!("Run: {name}"), lede, sections })
}

/// How each channel is predicted, in its own units.
fn channel_sheet(scores: &[ChannelScore]) -> Block {
    let row = |score: &ChannelScore| vec![score.channel.clone(), score.share(), score.error()];
    Block::Sheet(Sheet {
        caption: "Each channel, one step ahead".into(),
        head: ["channel", "variance explained", "rms error"].map(String::from).to_vec(),
        rows: scores.iter().map(row).collect(),
        note:
            "Errors are in the data's units. 100 % would be right throughout; at 0 % the channel's mean does as well."
                .into(),
    })
}

/// The first sequences over time, a figure for each channel, in the data's units.
fn drawn(data: &Dataset, trained: &Trained, generated: &[Generated], open: bool) -> Vec<Block> {
    let (n, delay) = (data.channels().len(), trained.checkpoint.topology.delay());
    let scaling = &trained.checkpoint.scaling;
    let figure = |i: usize| {
        let channel = &data.channels()[i];
        let panels = data.sequences().iter().zip(generated).take(DRAWN).map(|(sequence, generated)| {
            let count = sequence.len().min(SAMPLES);
            let recorded = (0..count).map(|k| ((k + 1) as f64, sequence.sample(k)[i])).collect();
            let steps = count.saturating_sub(delay);
            let predicted = |of: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
                (0..steps).map(|k| ((k + delay + 1) as f64, of(k * n + i))).collect()
            };
            let mean = |at: usize| scaling.to_raw(i, generated.mean[at]);
            let deviation = |at: usize| scaling.variance_to_raw(i, generated.variance[at]).sqrt();
            let mut series = vec![Series::line("recorded", Tone::Data, recorded)];
            if open {
                series.push(Series::line("predicted", Tone::Ours, predicted(&mean)));
                if !generated.variance.is_empty() {
                    series.push(Series::line(
                        "two sd",
                        Tone::Level(2),
                        predicted(&|at| mean(at) + 2.0 * deviation(at)),
                    ));
                    series.push(Series::line(
                        "two sd",
                        Tone::Level(2),
                        predicted(&|at| mean(at) - 2.0 * deviation(at)),
                    ));
                }
            } else {
                let sample = |at: usize| scaling.to_raw(i, generated.sample[at]);
                series.push(Series::line("generated", Tone::Ours, predicted(&sample)));
            }
            Panel::spanning(sequence.name.clone(), series)
        });
        let chart = Chart {
            columns: 1,
            aspect: 3.2,
            x_label: "sample".into(),
            y_label: channel.clone(),
            panels: panels.collect(),
        };
        let (file, title, caption) = if open {
            let caption = "Recorded samples, and what the network predicted for each from those before it, with a band of two \
                           predicted standard deviations.";
            (format!("ahead-{}", i + 1), format!("{channel}, one step ahead"), caption)
        } else {
            let caption = "The network fed with its own predictions and their noise, from the initial state that it learned for \
                           each sequence. It need not follow the recording, but should look like it.";
            (format!("on-its-own-{}", i + 1), format!("{channel}, generated"), caption)
        };
        Block::Figure(Box::new(Figure {
            file,
            title,
            caption: caption.into(),
            thesis: String::new(),
            drawing: chart.into(),
        }))
    };
    (0..n).map(figure).collect()
}

/// Initial states in the plane of their first two components, where there are enough of them.
fn initial_state_plane(trained: &Trained) -> Option<Section> {
    let checkpoint = &trained.checkpoint;
    let states = &checkpoint.initial_states;
    if states.sequences() < 3 || checkpoint.topology.context_units() < 2 {
        return None;
    }
    let components = PrincipalComponents::of(states.values(), checkpoint.topology.context_units())?;
    let points = components.first(2).chunks_exact(2).map(|point| (point[0], point[1])).collect();
    let mark = match states.sequences() {
        ..=30 => Mark::Texts(checkpoint.sequences.clone()),
        _ => Mark::Dots,
    };
    let series = vec![Series { name: "sequence".into(), tone: Tone::Ours, mark, points }];
    let chart = Chart {
        columns: 1,
        aspect: 1.6,
        x_label: "first component".into(),
        y_label: "second component".into(),
        panels: vec![Panel::spanning("", series)],
    };
    let figure = Figure {
        file: "initial-states".into(),
        title: "Initial states".into(),
        caption: format!(
            "Each sequence's initial state in the plane of the first two principal components, which hold {:.0} % of their \
             variance. Sequences whose points are close together start alike.",
            100.0 * components.share(2)
        ),
        thesis: String::new(),
        drawing: chart.into(),
    };
    Some(Section { title: "Initial states".into(), blocks: vec![Block::Figure(Box::new(figure))] })
}
