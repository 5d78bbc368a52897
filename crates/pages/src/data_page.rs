//! Data as a page, as a person would want to see them before training: all sequences of each channel over each other, with
//! what is missing.

use std::path::Path;

use scrnn::dataset::Sequence;
use scrnn_data::{Gap, Reading};
use scrnn_report::{Block, Chart, Figure, Page, Panel, Section, Series, Tone};

use crate::inspection::{counted, lengths, reading_text};

/// Points of a page, over all channels.
const POINTS: usize = 600_000;
/// Fewest and most points of a channel.
const OF_CHANNEL: (usize, usize) = (4_000, 40_000);
/// Fewest and most pieces that a sequence is drawn in; two points each.
const PIECES: (usize, usize) = (50, 500);
/// Sequences that have names of their own in the legend.
const NAMED: usize = 4;
/// Channels that are drawn.
const CHANNELS: usize = 100;

/// The page about what stands at `path`.
#[must_use]
pub fn data_page(reading: &Reading, path: &Path) -> Page {
    let data = &reading.data;
    let all: Vec<usize> = data.sequences().iter().map(Sequence::len).collect();
    let n = data.channels().len();
    let lede = format!(
        "{}{} on {}{}.",
        counted(all.len(), "sequence"),
        lengths(&all),
        counted(n, "channel"),
        reading.period.map_or(String::new(), |period| format!(", a sample every {period} s"))
    );
    let drawn = n.min(CHANNELS);
    let mut blocks: Vec<Block> = (0..drawn).map(|channel| figure(reading, channel, drawn)).collect();
    if drawn < n {
        blocks.push(Block::Text(format!("{} more channels are not drawn; --channels chooses.", n - drawn)));
    }
    let sections = vec![
        Section { title: "Channels".into(), blocks },
        Section { title: "How it was read".into(), blocks: vec![Block::Verbatim(reading_text(reading, path))] },
    ];
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Page { title: format!("Data: {name}"), lede, sections }
}

/// One channel: every sequence, or every few, over each other.
fn figure(reading: &Reading, channel: usize, channels: usize) -> Block {
    let data = &reading.data;
    let (name, count) = (&data.channels()[channel], data.sequences().len());
    let points = (POINTS / channels.max(1)).clamp(OF_CHANNEL.0, OF_CHANNEL.1);
    let most = points / (2 * PIECES.0);
    let every = count.div_ceil(most);
    let pieces = (points / (2 * count.div_ceil(every))).clamp(PIECES.0, PIECES.1);
    let at = |step: f64| reading.period.map_or(step + 1.0, |period| step * period);
    let (mut series, mut missing, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
    for (place, sequence) in data.sequences().iter().enumerate().step_by(every) {
        let label = if count <= NAMED { sequence.name.clone() } else { String::new() };
        let values: Vec<f64> = sequence.values().iter().skip(channel).step_by(data.channels().len()).copied().collect();
        for run in runs(&values) {
            let thin = thinned(&values[run.clone()], pieces);
            let points: Vec<(f64, f64)> =
                thin.into_iter().map(|(step, value)| (at((run.start + step) as f64), value)).collect();
            // A sample between two that are missing is a line of no length.
            series.push(match points.len() {
                1 => Series::dots(label.clone(), Tone::Level(place / every), points),
                _ => Series::line(label.clone(), Tone::Level(place / every), points),
            });
        }
        missing.extend((0..values.len()).filter(|&step| !values[step].is_finite()).map(|step| at(step as f64)));
        gaps.extend(
            reading
                .facts
                .gaps
                .iter()
                .filter(|gap| gap.sequence == sequence.name)
                .map(|gap: &Gap| at(gap.after as f64 - 0.5)),
        );
    }
    let mut panel = Panel::spanning("", series);
    let (bottom, top) = panel.y;
    let caption = caption(count, every, missing.len(), gaps.len());
    thin_out(&mut missing, points / 8);
    thin_out(&mut gaps, 200);
    if !missing.is_empty() {
        let points = missing.into_iter().map(|x| (x, bottom + 0.02 * (top - bottom))).collect();
        panel.series.push(Series::dots("missing", Tone::Failed, points));
    }
    for x in gaps {
        panel.series.push(Series::line("gap in time", Tone::Failed, vec![(x, bottom), (x, top)]));
    }
    let unit = reading.facts.units.get(channel).cloned().flatten();
    let chart = Chart {
        columns: 1,
        aspect: 2.6,
        x_label: if reading.period.is_some() { "seconds".into() } else { "sample".into() },
        y_label: unit.map_or(name.clone(), |unit| format!("{name} ({unit})")),
        panels: vec![panel],
    };
    Block::Figure(Box::new(Figure {
        file: format!("channel-{}", channel + 1),
        title: name.clone(),
        caption,
        thesis: String::new(),
        drawing: chart.into(),
    }))
}

fn caption(count: usize, every: usize, missing: usize, gaps: usize) -> String {
    let mut text = match (count, every) {
        (1, _) => "The only sequence.".to_owned(),
        (_, 1) => format!("All {count} sequences over each other."),
        _ => format!("Every {every}th of {count} sequences, over each other."),
    };
    if missing > 0 {
        text += &format!(" {missing} samples are missing: red dots at the bottom.");
    }
    if gaps > 0 {
        text += &format!(" At {gaps} places time was lost: red lines.");
    }
    text
}

/// Stretches of samples without a missing one.
fn runs(values: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut begin = 0;
    for end in (0..=values.len()).filter(|&step| values.get(step).is_none_or(|value| !value.is_finite())) {
        if begin < end {
            runs.push(begin..end);
        }
        begin = end + 1;
    }
    runs
}

/// The least and the greatest value of each of so many pieces: what a line through all of them would show.
fn thinned(values: &[f64], pieces: usize) -> Vec<(usize, f64)> {
    if values.len() <= 2 * pieces {
        return values.iter().copied().enumerate().collect();
    }
    let mut thin = Vec::with_capacity(2 * pieces);
    for piece in 0..pieces {
        let (from, to) = (piece * values.len() / pieces, (piece + 1) * values.len() / pieces);
        let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let (Some(low), Some(high)) = ((from..to).min_by(by), (from..to).max_by(by)) else { continue };
        thin.push((low.min(high), values[low.min(high)]));
        if low != high {
            thin.push((low.max(high), values[low.max(high)]));
        }
    }
    thin
}

/// Leaves at most so many, evenly.
fn thin_out(places: &mut Vec<f64>, most: usize) {
    let every = places.len().div_ceil(most.max(1)).max(1);
    let mut index = 0;
    places.retain(|_| {
        index += 1;
        (index - 1) % every == 0
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_where_samples_are_missing() {
        let nan = f64::NAN;
        assert_eq!(runs(&[1.0, nan, 2.0, 3.0, nan, nan, 4.0]), [0..1, 2..4, 6..7]);
        assert_eq!((runs(&[]), runs(&[nan]), runs(&[1.0, 2.0])), (vec![], vec![], std::iter::once(0..2).collect()));
    }

    #[test]
    fn thinned_lines_keep_their_peaks() {
        let mut values: Vec<f64> = (0..10_000).map(|k| (f64::from(k) * 0.01).sin()).collect();
        values[1234] = 50.0;
        let thin = thinned(&values, 100);
        assert!(thin.len() <= 200 && thin.contains(&(1234, 50.0)));
        assert!(thin.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(thinned(&[1.0, 2.0], 100), [(0, 1.0), (1, 2.0)]);
    }

    #[test]
    fn the_page_shows_every_sequence_of_a_channel_and_marks_gaps() {
        let text = "sequence,time,a,b\nx,0.0,1,2\nx,0.1,2,3\nx,0.2,1,4\ny,0.0,5,6\ny,0.1,7,8\ny,0.2,7,9\n";
        let mut reading =
            scrnn_data::inspect_bytes(Path::new("my.csv"), text.as_bytes(), &scrnn_data::Selection::default()).unwrap();
        reading.facts.gaps.push(Gap { sequence: "y".into(), after: 2, seconds: 1.0 });
        let page = data_page(&reading, Path::new("in/my.csv"));
        assert_eq!(page.title, "Data: my.csv");
        assert!(page.lede.starts_with("2 sequences of 3 samples on 2 channels, a sample every 0.1 s"), "{}", page.lede);
        let figures: Vec<&Figure> = page.figures().collect();
        assert_eq!((figures.len(), figures[1].title.as_str()), (2, "b"));
        assert!(figures[0].caption.contains("All 2 sequences") && figures[0].caption.contains("At 1 places time"));
        let html = page.html();
        assert!(html.contains("gap in time") && html.contains("seconds") && html.contains("my.csv"), "{html}");
    }
}
