//! A training run as a page: how it learned, how it predicts, how it runs on its own.

use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn::dataset::{Dataset, Sequence};
use scrnn::engine::Engine;
use scrnn::generation::{Feedback, Generated, GenerationOptions};

use scrnn_report::{Block, Chart, Figure, Mark, Page, Panel, Section, Series, Sheet, Tone};
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_run::channel_scores::{ChannelScore, channel_scores};
use scrnn_run::evaluation::Member;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::Result;
use scrnn_run::held_out::{Judgement, Watch};
use scrnn_run::history::Row;
use scrnn_run::source::Source;
use scrnn_run::trained::Trained;

use crate::chosen::{Chosen, MANY, chosen, kinds, planes};
use crate::{calibration_blocks, held_out, learning_curves, playground};

/// Samples of each sequence that are drawn at most, and of all figures of one kind together.
const SAMPLES: (usize, usize) = (600, 40_000);
/// Panels over time of all channels together, where each has four or more.
const PANELS: usize = 36;
/// Channels that are drawn.
const CHANNELS: usize = 24;

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
    let ahead = ahead_in_words(delay);
    let lede = format!(
        "{} sequences on {} ({}), {} context units, after {} epochs. Predictions reach {ahead}.",
        data.sequences().len(),
        if n == 1 { "one channel".to_owned() } else { format!("{n} channels") },
        data.channels().join(", "),
        network.topology().context_units(),
        checkpoint.epoch,
    );
    let scores = channel_scores(&scaled, &open, delay, &checkpoint.scaling);
    let judgement = match (&watch, &experiment) {
        (Some(watch), Some(experiment)) => {
            Some(watch.judge(&members, checkpoint.epoch, experiment.network.initial_state_variance)?)
        }
        _ => None,
    };
    let canvas = Canvas::new(trained, source);
    let mut alone = canvas.planes(&closed);
    alone.extend(canvas.over_time(&closed, false));
    // The picture that answers the question comes first, then what it comes to.
    let verdict = verdict(&scores, &assessment, judgement.as_ref(), canvas.outside(&closed));
    alone.insert(1.min(alone.len()), Block::Verdict(verdict));
    let mut predicted = canvas.over_time(&open, true);
    predicted.push(channel_sheet(&scores, &ahead));
    predicted.extend(calibration_blocks(&assessment));
    let runs = [("this run".to_owned(), rows)];
    let mut learning = vec![learning_curves("learning", "Learning curve", &runs, assessment.entropy_of_noise)];
    if let Some(score) = trained.notes.as_ref().and_then(|notes| notes.score) {
        let rows = vec![
            vec!["epoch".to_owned(), score.epoch.to_string()],
            vec!["nll".into(), score.nll.map_or("\u{2013}".into(), |nll| format!("{nll:.4}"))],
            vec!["squared error".into(), format!("{:.3e}", score.mse)],
        ];
        let note = "Per step and channel, in scaled units.".into();
        learning.push(Block::Sheet(Sheet { caption: "At the end".into(), head: Vec::new(), rows, note }));
    }
    let mut sections = vec![Section { title: "On its own".into(), blocks: alone }];
    sections.extend(playground::section(std::slice::from_ref(trained), data));
    sections.push(Section { title: capital(&ahead), blocks: predicted });
    sections.extend(judgement.as_ref().map(held_out::section));
    sections.extend(initial_state_plane(trained));
    sections.push(Section { title: "Learning".into(), blocks: learning });
    if let Some(experiment) = &experiment {
        let text = toml::to_string(experiment).unwrap_or_default();
        sections.push(Section { title: "Settings".into(), blocks: vec![Block::Verbatim(text)] });
    }
    Ok(Page { title: format!("Run: {name}"), lede, sections })
}

/// How far predictions reach.
fn ahead_in_words(delay: usize) -> String {
    if delay == 1 { "one step ahead".to_owned() } else { format!("{delay} steps ahead") }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// What the run comes to, in a line.
fn verdict(
    scores: &[ChannelScore],
    assessment: &Assessment,
    judgement: Option<&Judgement>,
    (outside, of): (usize, usize),
) -> String {
    let mut parts = Vec::new();
    if let Some(judgement) = judgement {
        parts.push(match judgement.closed_loop.leaves_the_data() {
            true => "on its own it leaves new data: the channels' means would be nearer".to_owned(),
            false => "on its own it stays nearer to new data than the channels' means".to_owned(),
        });
    } else {
        parts.push(match outside {
            0 => "on its own it stays where its data are".to_owned(),
            outside => format!("on its own it leaves the range of its data in {outside} of {of} sequences"),
        });
    }
    let shares: Vec<(f64, &str)> =
        scores.iter().filter_map(|score| Some((score.explained?, score.channel.as_str()))).collect();
    if let Some((worst, channel)) = shares.iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
        let which = if shares.len() > 1 {
            format!(" of every channel's variance or more (least of {channel})")
        } else {
            " of the variance".to_owned()
        };
        parts.push(format!("its predictions explain {:.0} %{which}", 100.0 * worst));
    }
    if let Some(calibration) = &assessment.calibration {
        let whose = if assessment.nll_held_out.is_some() { "held-out" } else { "learned" };
        parts.push(format!(
            "{:.0} % of {whose} errors lie within one predicted sd (68 % would be right)",
            100.0 * calibration.within_one
        ));
    }
    format!("{}.", capital(&parts.join("; ")))
}

/// How each channel is predicted, in its own units.
fn channel_sheet(scores: &[ChannelScore], ahead: &str) -> Block {
    let row = |score: &ChannelScore| vec![score.channel.clone(), score.share(), score.error()];
    Block::Sheet(Sheet {
        caption: format!("Each channel, {ahead}, on the sequences that it learned"),
        head: ["channel", "variance explained", "rms error"].map(String::from).to_vec(),
        rows: scores.iter().map(row).collect(),
        note:
            "Errors are in the data's units. 100 % would be right throughout; at 0 % the channel's mean does as well."
                .into(),
    })
}

/// What is drawn of a run's sequences, in the data's units.
struct Canvas<'a> {
    trained: &'a Trained,
    data: &'a Dataset,
    /// Sequences that are drawn in planes, and over time: the latter are a figure for each channel.
    many: Chosen,
    few: Chosen,
    /// Samples of each sequence.
    samples: usize,
    /// Seconds between samples, where that is known.
    period: Option<f64>,
}

impl<'a> Canvas<'a> {
    fn new(trained: &'a Trained, source: &'a Source) -> Self {
        let data = &source.data;
        let names: Vec<&str> = data.sequences().iter().map(|sequence| sequence.name.as_str()).collect();
        let few = chosen(&names, (PANELS / data.channels().len().max(1)).clamp(4, MANY));
        let lines = few.sequences.len() * data.channels().len().min(CHANNELS);
        // Panels side by side have room for fewer.
        let most = if few.sequences.len() > 3 { SAMPLES.0 / 3 } else { SAMPLES.0 };
        let samples = (SAMPLES.1 / lines.max(1)).clamp(60, most);
        Self { trained, data, many: chosen(&names, MANY), few, samples, period: source.period }
    }

    fn delay(&self) -> usize {
        self.trained.checkpoint.topology.delay()
    }

    /// When a sample was taken.
    fn at(&self, sample: usize) -> f64 {
        self.period.map_or((sample + 1) as f64, |period| sample as f64 * period)
    }

    /// Which sequences are drawn, and how much of them.
    fn words(&self, chosen: &Chosen) -> String {
        let longest = self.data.sequences().iter().map(Sequence::len).max().unwrap_or(0);
        let cut = if longest > self.samples {
            format!(" The first {} samples of each.", self.samples)
        } else {
            String::new()
        };
        format!("{}{cut}", chosen.words)
    }

    fn these<'b>(
        &'b self,
        chosen: &'b Chosen,
        generated: &'b [Generated],
    ) -> impl Iterator<Item = (&'b Sequence, &'b Generated)> {
        chosen.sequences.iter().filter_map(|&s| Some((self.data.sequences().get(s)?, generated.get(s)?)))
    }

    /// In how many sequences some channel goes half of its range beyond it, and of how many.
    fn outside(&self, generated: &[Generated]) -> (usize, usize) {
        let n = self.data.channels().len();
        let scaling = &self.trained.checkpoint.scaling;
        let of_channel = |i: usize| {
            let values =
                self.data.sequences().iter().flat_map(move |sequence| sequence.values().iter().skip(i).step_by(n));
            let values = values.filter(|value| value.is_finite());
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)))
        };
        let ranges: Vec<(f64, f64)> = (0..n).map(of_channel).collect();
        let leaves = |one: &Generated| {
            one.sample.iter().enumerate().any(|(at, &value)| {
                let ((low, high), value) = (ranges[at % n], scaling.to_raw(at % n, value));
                let margin = 0.5 * (high - low);
                !(low - margin..=high + margin).contains(&value)
            })
        };
        (generated.iter().filter(|one| leaves(one)).count(), generated.len())
    }

    /// Channels that lie in a plane, one over the other: what was recorded, and what the network does on its own.
    fn planes(&self, closed: &[Generated]) -> Vec<Block> {
        let (n, delay, scaling) = (self.data.channels().len(), self.delay(), &self.trained.checkpoint.scaling);
        let figure = |(a, b, one_unit): (usize, usize, bool)| {
            let panel = |(sequence, generated): (&Sequence, &Generated)| {
                let count = sequence.len().min(self.samples);
                let recorded = (0..count).map(|k| (sequence.sample(k)[a], sequence.sample(k)[b])).collect();
                let steps = count.saturating_sub(delay).min(generated.sample.len() / n.max(1));
                let raw = |k: usize, i: usize| scaling.to_raw(i, generated.sample[k * n + i]);
                let own = (0..steps).map(|k| (raw(k, a), raw(k, b))).collect();
                (
                    sequence.name.clone(),
                    vec![
                        Series::line("the network on its own", Tone::Ours, own),
                        Series::line("recorded", Tone::Truth, recorded),
                    ],
                )
            };
            let panels: Vec<(String, Vec<Series>)> = self.these(&self.many, closed).map(panel).collect();
            // All panels have the same axes, those of what was recorded with some room.
            let recorded: Vec<Series> = panels.iter().map(|(_, series)| series[1].clone()).collect();
            let whole = Panel::spanning("", recorded);
            let room = |(low, high): (f64, f64)| (low - 0.1 * (high - low), high + 0.1 * (high - low));
            let equal = one_unit || {
                let ratio = (whole.x.1 - whole.x.0) / (whole.y.1 - whole.y.0);
                (0.5..2.0).contains(&ratio)
            };
            let panel = |(name, series): (String, Vec<Series>)| Panel {
                x: room(whole.x),
                y: room(whole.y),
                equal,
                ..Panel::spanning(name, series)
            };
            let panels: Vec<Panel> = panels.into_iter().map(panel).collect();
            let (name_a, name_b) = (&self.data.channels()[a], &self.data.channels()[b]);
            let columns = match panels.len() {
                1 => 1,
                2 | 4 => 2,
                3 | 5 | 6 => 3,
                _ => 4,
            };
            let aspect = if columns == 1 { 1.6 } else { 1.0 };
            let (x_label, y_label) = (name_a.clone(), name_b.clone());
            Block::Figure(Box::new(Figure {
                file: format!("plane-{}-{}", a + 1, b + 1),
                title: format!("{name_b} over {name_a}: on its own beside the recording"),
                caption: format!(
                    "The network fed with its own predictions and their noise, from the initial state that it learned for each \
                     sequence. It need not follow the recording, but should look like it. {}",
                    self.words(&self.many)
                ),
                thesis: String::new(),
                drawing: Chart { columns, aspect, x_label, y_label, panels }.into(),
            }))
        };
        planes(self.data.channels()).into_iter().map(figure).collect()
    }

    /// The chosen sequences over time, a figure for each channel.
    fn over_time(&self, generated: &[Generated], open: bool) -> Vec<Block> {
        let channels = self.data.channels();
        let mut blocks: Vec<Block> =
            (0..channels.len().min(CHANNELS)).map(|i| self.channel(generated, open, i)).collect();
        if channels.len() > CHANNELS {
            let left = channels[CHANNELS..].join(", ");
            blocks.push(Block::Text(format!("Not drawn are {} more channels: {left}.", channels.len() - CHANNELS)));
        }
        blocks
    }

    fn channel(&self, generated: &[Generated], open: bool, i: usize) -> Block {
        let (n, delay, scaling) = (self.data.channels().len(), self.delay(), &self.trained.checkpoint.scaling);
        let panel = |(sequence, generated): (&Sequence, &Generated)| {
            let count = sequence.len().min(self.samples);
            let recorded = (0..count).map(|k| (self.at(k), sequence.sample(k)[i])).collect();
            let steps = count.saturating_sub(delay).min(generated.mean.len() / n.max(1));
            let line = |of: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
                (0..steps).map(|k| (self.at(k + delay), of(k * n + i))).collect()
            };
            let mean = |at: usize| scaling.to_raw(i, generated.mean[at]);
            let mut series = Vec::new();
            if open {
                if !generated.variance.is_empty() {
                    let deviation = |at: usize| scaling.variance_to_raw(i, generated.variance[at]).sqrt();
                    let band = (0..steps).map(|k| {
                        let (at, two) = (k * n + i, 2.0 * deviation(k * n + i));
                        (self.at(k + delay), mean(at) - two, mean(at) + two)
                    });
                    series.push(Series::band("two predicted sd", Tone::Ours, band));
                }
                series.push(Series::line("predicted", Tone::Ours, line(&mean)));
                series.push(Series::line("recorded", Tone::Truth, recorded));
            } else {
                let sample = |at: usize| scaling.to_raw(i, generated.sample[at]);
                series.push(Series::line("the network on its own", Tone::Ours, line(&sample)));
                series.push(Series::line("recorded", Tone::Truth, recorded));
            }
            Panel::spanning(sequence.name.clone(), series)
        };
        let panels: Vec<Panel> = self.these(&self.few, generated).map(panel).collect();
        let channel = &self.data.channels()[i];
        let (columns, aspect) = if panels.len() > 3 { (2, 2.0) } else { (1, 3.6) };
        let x_label = if self.period.is_some() { "seconds" } else { "sample" };
        let (file, title, caption) = if open {
            let ahead = ahead_in_words(delay);
            let caption = format!(
                "Recorded samples, and what the network predicted for each from those {ahead_of} it, with a band of two predicted \
                 standard deviations: 95 of 100 samples should lie within. {}",
                self.words(&self.few),
                ahead_of = if delay == 1 { "before".to_owned() } else { format!("{delay} steps and more before") },
            );
            (format!("ahead-{}", i + 1), format!("{channel}, {ahead}"), caption)
        } else {
            let caption = format!(
                "The network fed with its own predictions and their noise, from the initial state that it learned for each \
                 sequence. It need not follow the recording, but should look like it. {}",
                self.words(&self.few)
            );
            (format!("on-its-own-{}", i + 1), format!("{channel}, on its own beside the recording"), caption)
        };
        let chart = Chart { columns, aspect, x_label: x_label.into(), y_label: channel.clone(), panels };
        Block::Figure(Box::new(Figure { file, title, caption, thesis: String::new(), drawing: chart.into() }))
    }
}

/// Initial states in the plane of their first two components, where there are enough of them.
fn initial_state_plane(trained: &Trained) -> Option<Section> {
    let checkpoint = &trained.checkpoint;
    let states = &checkpoint.initial_states;
    if states.sequences() < 3 || checkpoint.topology.context_units() < 2 {
        return None;
    }
    let components = PrincipalComponents::of(states.values(), checkpoint.topology.context_units())?;
    let points: Vec<(f64, f64)> = components.first(2).chunks_exact(2).map(|point| (point[0], point[1])).collect();
    let names: Vec<&str> = checkpoint.sequences.iter().map(String::as_str).collect();
    let kinds = kinds(&names);
    // A kind has a colour; where there are too many of them, or none, all have the same.
    let groups: Vec<(String, Tone, Vec<usize>)> = match kinds.len() {
        2..=8 if kinds.iter().map(|(_, own)| own.len()).sum::<usize>() == names.len() && kinds.len() < names.len() => {
            kinds.into_iter().enumerate().map(|(k, (kind, own))| (kind, Tone::Level(k), own)).collect()
        }
        _ => vec![("sequence".into(), Tone::Ours, (0..names.len()).collect())],
    };
    let series = groups.into_iter().map(|(name, tone, own)| Series {
        name,
        tone,
        mark: Mark::Named(own.iter().map(|&s| names[s].to_owned()).collect()),
        points: own.into_iter().filter_map(|s| points.get(s).copied()).collect(),
    });
    let series = series.collect();
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
             variance. Sequences whose points are close together start alike. A point's name shows where the pointer rests on it.",
            100.0 * components.share(2)
        ),
        thesis: String::new(),
        drawing: chart.into(),
    };
    Some(Section { title: "Initial states".into(), blocks: vec![Block::Figure(Box::new(figure))] })
}
