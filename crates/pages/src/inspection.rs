//! What is in a run folder, a checkpoint or a data file: as text, and as JSON.

use std::path::Path;

use scrnn::checkpoint::Checkpoint;
use scrnn::dataset::{Dataset, Sequence};
use scrnn_data::{Level, Reading, Remark};
use scrnn_report::Table;
use scrnn_run::notes::Score;
use scrnn_run::trained::Trained;
use serde_json::{Value, json};

/// A network as JSON.
#[must_use]
pub fn network_object(trained: &Trained) -> Value {
    let Trained { checkpoint, notes, .. } = trained;
    let topology = &checkpoint.topology;
    let groups: Vec<Value> = topology
        .groups()
        .iter()
        .map(|group| {
            json!({
                "name": group.name,
                "units": group.units,
                "time_constant": group.time_constant,
                "receives_input": group.receives_input,
                "drives_output": group.drives_output,
                "learns_initial_state": group.learns_initial_state,
            })
        })
        .collect();
    let notes = notes.as_ref();
    json!({
        "kind": "network",
        "epoch": checkpoint.epoch,
        "score": notes.and_then(|notes| notes.score),
        "best": notes.and_then(|notes| notes.best),
        "delay": topology.delay(),
        "variance": topology.has_variance(),
        "variance_floor": topology.variance_floor(),
        "groups": groups,
        "parameters": checkpoint.parameters.as_slice().len(),
        "channels": (0..checkpoint.channels.len()).map(|i| {
            let (low, high) = reach(checkpoint, i);
            json!({ "name": checkpoint.channels[i], "low": low, "high": high })
        }).collect::<Vec<_>>(),
        "sequences": checkpoint.sequences,
        "held_out": notes.and_then(|notes| notes.data.held_out.as_ref()).map(|held_out| &held_out.names),
        "variance_factor": notes.and_then(|notes| notes.variance_factor.as_ref()),
        "lengths": notes.map(|notes| &notes.data.lengths),
        "experiment": notes.map(|notes| &notes.experiment),
    })
}

/// A network in lines of text.
#[must_use]
pub fn network_text(trained: &Trained, path: &Path) -> String {
    let Trained { checkpoint, notes, .. } = trained;
    let topology = &checkpoint.topology;
    let mut table = Table::new(&[]);
    let mut line = |what: &str, text: String| table.row(vec![format!("  {what}"), text]);
    let experiment = notes.as_ref().map(|notes| &notes.experiment);
    let epochs = experiment.and_then(|experiment| experiment["training"]["epochs"].as_u64());
    let of = epochs.map_or(String::new(), |epochs| format!(" of {epochs}"));
    line("epoch", format!("{}{of}", checkpoint.epoch));
    if let Some(notes) = notes {
        if let Some(score) = notes.score {
            line("score", told(score));
        }
        if let Some(best) = notes.best {
            line("best", format!("{}, at epoch {}", told(best), best.epoch));
        }
    }
    let kind = match topology.has_variance() {
        true => format!("mean and variance (floor {})", topology.variance_floor()),
        false => "the mean".to_owned(),
    };
    line("predicts", format!("{kind}, {} ahead", counted(topology.delay(), "step")));
    for group in topology.groups() {
        let mut rules = String::new();
        for (holds, rule) in [
            (group.receives_input, ", sees no input"),
            (group.drives_output, ", drives no output"),
            (group.learns_initial_state, ", starts from 0"),
        ] {
            rules += if holds { "" } else { rule };
        }
        line(
            "group",
            format!("{}: {}, time constant {}{rules}", group.name, counted(group.units, "unit"), group.time_constant),
        );
    }
    line("parameters", checkpoint.parameters.as_slice().len().to_string());
    for (i, name) in checkpoint.channels.iter().enumerate() {
        let (low, high) = reach(checkpoint, i);
        line("channel", format!("{name}: predictions reach from {low:.4} to {high:.4}"));
    }
    let lengths = notes.as_ref().map(|notes| lengths(&notes.data.lengths)).unwrap_or_default();
    line("sequences", format!("{}{lengths}", checkpoint.sequences.len()));
    if let Some(held_out) = notes.as_ref().and_then(|notes| notes.data.held_out.as_ref()) {
        line("held out", held_out.names.join(", "));
    }
    if let Some(factor) = notes.as_ref().and_then(|notes| notes.variance_factor.as_ref()) {
        line("calibrated", factor.in_words(&checkpoint.channels));
    }
    if let Some(optimiser) = experiment.and_then(|experiment| experiment["training"]["optimiser"].as_str()) {
        let refined = experiment.is_some_and(|experiment| experiment["training"]["lbfgs"].is_object());
        line("optimiser", format!("{optimiser}{}", if refined { ", then L-BFGS" } else { "" }));
    }
    let name = experiment.and_then(|experiment| experiment["name"].as_str()).unwrap_or("a network");
    format!("{}: {name}\n{}", path.display(), table.to_string().trim_start_matches('\n'))
}

/// The raw values that the mean unit of a channel can reach, -1 to 1 in scaled units.
fn reach(checkpoint: &Checkpoint, channel: usize) -> (f64, f64) {
    let (a, b) = (checkpoint.scaling.to_raw(channel, -1.0), checkpoint.scaling.to_raw(channel, 1.0));
    (a.min(b), a.max(b))
}

fn told(score: Score) -> String {
    let one = |nll: Option<f64>, mse: f64| match nll {
        Some(nll) => format!("nll {nll:.4} nats per step and channel, mse {mse:.4e}"),
        None => format!("mse {mse:.4e} per step and channel"),
    };
    let held_out = score.held_out.map(|held_out| format!("; held out: {}", one(held_out.nll, held_out.mse)));
    format!("{}{}", one(score.nll, score.mse), held_out.unwrap_or_default())
}

/// Data as JSON.
#[must_use]
pub fn reading_object(reading: &Reading) -> Value {
    let mut object = data_object(&reading.data);
    object["period"] = json!(reading.period);
    object["remarks"] = reading.remarks.iter().map(Remark::json).collect();
    object["facts"] = json!(reading.facts);
    object
}

/// The data, then what is known of the file, then what is worth saying.
#[must_use]
pub fn reading_text(reading: &Reading, path: &Path) -> String {
    let mut text = data_text(&reading.data, path);
    text += &format!("format: {}\n", reading.facts.format);
    if let Some(period) = reading.period {
        let clock = reading.facts.clock.as_ref().map_or(String::new(), |clock| format!(", by {clock}"));
        text += &format!("a sample every {period} s ({} Hz){clock}\n", (1e3 / period).round() / 1e3);
    }
    for topic in &reading.facts.topics {
        let taken = if topic.taken { "taken" } else { "not taken" };
        let rate = topic.rate.map_or(String::new(), |rate| format!(", {} Hz", (1e3 * rate).round() / 1e3));
        text += &format!("  {} ({}): {}{rate}, {taken}\n", topic.name, topic.of, topic.count);
    }
    for gap in &reading.facts.gaps {
        text += &format!("gap in {} after sample {}: {} s\n", gap.sequence, gap.after, gap.seconds);
    }
    for remark in &reading.remarks {
        let kind = if remark.level() == Level::Warning { "warning" } else { "note" };
        let help = remark.help().map_or(String::new(), |help| format!(" ({help})"));
        text += &format!("{kind}: {remark}{help}\n");
    }
    text
}

fn data_object(data: &Dataset) -> Value {
    let moments = data.channel_moments();
    let channels: Vec<Value> = data
        .channels()
        .iter()
        .enumerate()
        .map(|(i, name)| {
            let ((low, high), (mean, variance)) = (range(data, i), moments[i]);
            json!({ "name": name, "low": low, "high": high, "mean": mean, "variance": variance })
        })
        .collect();
    let sequence = |sequence: &Sequence| json!({ "name": sequence.name, "samples": sequence.len() });
    json!({
        "kind": "data",
        "channels": channels,
        "sequences": data.sequences().iter().map(sequence).collect::<Vec<_>>(),
        "samples": data.total_samples(),
    })
}

fn data_text(data: &Dataset, path: &Path) -> String {
    let all: Vec<usize> = data.sequences().iter().map(Sequence::len).collect();
    let mut table = Table::new(&["  channel", "from", "to", "mean", "sd"]);
    for (i, (name, (mean, variance))) in data.channels().iter().zip(data.channel_moments()).enumerate() {
        let (low, high) = range(data, i);
        let shown = |value: f64| if value.is_finite() { format!("{value:.6}") } else { "-".to_owned() };
        let cells = [low, high, mean, variance.sqrt()].map(shown);
        table.row([vec![format!("  {name}")], cells.to_vec()].concat());
    }
    let count = counted(all.len(), "sequence");
    let channels = counted(data.channels().len(), "channel");
    format!("{}: {count}{}, {channels}\n{table}", path.display(), lengths(&all))
}

/// Smallest and largest sample of a channel.
fn range(data: &Dataset, channel: usize) -> (f64, f64) {
    let n = data.channels().len();
    let samples = data.sequences().iter().flat_map(|sequence| sequence.values().chunks_exact(n)).map(|x| x[channel]);
    samples.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// `1 step`, `2 steps`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// How long sequences are.
pub(crate) fn lengths(all: &[usize]) -> String {
    match (all.iter().min(), all.iter().max()) {
        (Some(shortest), Some(longest)) if shortest == longest => format!(" of {}", counted(*longest, "sample")),
        (Some(shortest), Some(longest)) => format!(" of {shortest} to {longest} samples"),
        _ => String::new(),
    }
}
