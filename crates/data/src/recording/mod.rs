//! Recordings: MCAP files, rosbag2's databases, and the folders in which bags keep them.
//!
//! | step | where |
//! |---|---|
//! | the files of a recording, in their order | [`files`] |
//! | messages out of a file | [`container`], [`sqlite`] |
//! | a message as a tree, by what the recording says of its type | [`decoding`]: JSON ([`tree`]), CDR ([`ros`]), [`protobuf`] |
//! | its numbers by name, and its stamp | [`numbers`] |
//! | which topics are meant | [`topics`] |
//! | messages of the same names, side by side | [`collecting`] |
//! | when they were made | [`clocks`] |
//! | rows at even times | [`joining`] |
//! | all messages as they are, to be shown | [`playing`] |
//!
//! A recording is a sequence; one that `scrnn` wrote may hold several, told apart by its topic `/sequence`.

mod clocks;
mod collecting;
mod container;
mod decoding;
mod files;
mod joining;
mod message;
mod naming;
mod numbers;
mod playing;
mod problem;
mod protobuf;
mod ros;
mod sqlite;
mod topics;
mod tree;

use std::path::Path;

use clocks::Clock;
use collecting::{Collecting, Track};
use files::Files;
use joining::{Channels, Refusal, Series, join};
use message::Trouble;
use topics::{Findings, find};

use crate::remark::Remark;
use crate::samples::{self, Samples};
use crate::source::Source;
use crate::{FileError, Selection, TimeSource, Topic};

pub use files::is_bag;
pub use playing::{Told, play};
pub use problem::RecordingProblem;

/// Reads a file or a folder.
///
/// # Errors
/// [`FileError`] tells what is wrong, and where.
pub fn read(source: &Source<'_>, selection: &Selection) -> Result<Samples, FileError> {
    let name = source.name();
    let files = Files::of(source)?;
    let wanted = selection.channels.as_deref();
    let mut findings = find(&files, &selection.topics, wanted)
        .map_err(|(file, trouble)| refusal_of(if file.is_empty() { name } else { &file }, trouble))?;
    let mut samples = Samples::default();
    samples.facts.named = true;
    samples.facts.topics = facts(&findings);
    remark_on_topics(&findings, selection, &mut samples.remarks);
    for lane in &mut findings.lanes {
        let (clocks, counters) = clocks::without_clocks(&mut lane.collecting);
        samples.remarks.extend(clocks.into_iter().map(|column| Remark::Clock { column }));
        samples.remarks.extend(counters.into_iter().map(|column| Remark::Counter { column }));
    }
    let taken = match findings.lanes.as_slice() {
        [only] => format!("{name}, topic {}", only.topic),
        _ => name.to_owned(),
    };
    let named = naming::names(&findings.lanes, wanted);
    let naming::Named { names, places, available } = named.map_err(|problem| refusal(&taken, problem))?;
    if names.is_empty() {
        return Err(refusal(&taken, RecordingProblem::NoNumbers));
    }
    samples.channels = names;
    samples.facts.available = available;
    let mut sections = sections(&mut findings);
    // What a section holds is not needed once it is joined.
    for (sequence, lanes) in sections.drain(..) {
        section(name, &files, &findings, sequence, lanes, &places, selection, &mut samples)?;
    }
    for index in 0..samples.channels.len() {
        remark_on_stairs(&mut samples, index, &places, &findings);
    }
    Ok(samples)
}

/// A bag of ROS 1: the way out of it.
///
/// # Errors
/// Always.
pub fn refuse_ros1(source: &Source<'_>, _: &Selection) -> Result<Samples, FileError> {
    let stem = source.path().with_extension("").display().to_string();
    Err(refusal(source.name(), RecordingProblem::Ros1 { stem }))
}

fn refusal(path: &str, problem: RecordingProblem) -> FileError {
    FileError::Recording { path: path.to_owned(), help: problem.help(), problem: Box::new(problem) }
}

fn refusal_of(path: &str, trouble: Trouble) -> FileError {
    match trouble {
        Trouble::Problem(problem) => refusal(path, *problem),
        Trouble::Topic(topic, problem) => {
            refusal(&format!("{path}, topic {}", crate::excerpt::shortened(&topic)), *problem)
        }
        Trouble::File(error) => *error,
        Trouble::Memory(problem) => FileError::OverBudget { path: path.to_owned(), problem },
        Trouble::Disk(error) => FileError::disk("read", Path::new(path), error),
    }
}

/// What `inspect` shows of the topics.
fn facts(findings: &Findings) -> Vec<Topic> {
    let fact = |topic: &topics::Topic| {
        let span = topic.last.saturating_sub(topic.first) as f64 / 1e9;
        Topic {
            name: topic.channel.topic.clone(),
            of: topic.channel.schema.name.clone(),
            encoding: topic.channel.encoding.clone(),
            count: topic.messages,
            rate: (span > 0.0).then(|| (topic.messages - 1) as f64 / span),
            taken: topic.taken,
        }
    };
    findings.topics.values().map(fact).collect()
}

fn remark_on_topics(findings: &Findings, selection: &Selection, remarks: &mut Vec<Remark>) {
    let names = |taken: bool| {
        let topics =
            findings.topics.values().filter(|topic| topic.taken == taken && topic.channel.topic != "/sequence");
        topics.take(10).map(|topic| topic.channel.topic.as_str()).collect::<Vec<_>>().join(", ")
    };
    let others = names(false);
    if selection.topics.is_empty() && !others.is_empty() {
        remarks.push(Remark::Chosen { taken: names(true), others });
    }
    for lane in &findings.lanes {
        let Collecting { columns, empty, .. } = &lane.collecting;
        let joints = columns.iter().filter_map(|column| column.quantity).min();
        if let Some(quantity @ 1..) = joints {
            let quantity = numbers::QUANTITIES[usize::from(quantity)];
            let what =
                format!("{}: the messages hold no positions; the {quantity} of each joint was taken", lane.topic);
            remarks.push(Remark::Understood { what });
        }
        if *empty > 0 {
            let what = format!("{}: {empty} messages hold none of the channels, and were passed over", lane.topic);
            remarks.push(Remark::Understood { what });
        }
    }
}

/// What a lane holds of one sequence, with the number of the lane.
type Part = (usize, Vec<Track>);

/// The sequences, and what each lane holds of them.
fn sections(findings: &mut Findings) -> Vec<(String, Vec<Part>)> {
    let lanes: Vec<Vec<Track>> =
        findings.lanes.iter_mut().map(|lane| std::mem::take(&mut lane.collecting.tracks)).collect();
    if findings.begins.is_empty() {
        return vec![("1".to_owned(), lanes.into_iter().enumerate().collect())];
    }
    findings.begins.sort_by_key(|(time, _)| *time);
    // What comes before the first begin has no name.
    let names = std::iter::once("1".to_owned()).chain(findings.begins.iter().map(|(_, name)| name.clone()));
    let mut sections: Vec<(String, Vec<Part>)> = names.map(|name| (name, Vec::new())).collect();
    for (lane, tracks) in lanes.into_iter().enumerate() {
        for track in tracks {
            for (section, part) in track.cut(&findings.begins) {
                match sections[section].1.last_mut() {
                    Some((last, parts)) if *last == lane => parts.push(part),
                    _ => sections[section].1.push((lane, vec![part])),
                }
            }
        }
    }
    sections.retain(|(_, parts)| !parts.is_empty());
    sections
}

/// Joins what the lanes hold of one sequence.
#[expect(clippy::too_many_arguments, reason = "one step of `read`, which has all of it at hand")]
fn section(
    name: &str,
    files: &Files<'_>,
    findings: &Findings,
    sequence: String,
    lanes: Vec<Part>,
    places: &[Vec<Option<usize>>],
    selection: &Selection,
    samples: &mut Samples,
) -> Result<(), FileError> {
    let wish = match selection.time {
        // The sequences are told apart by when they were logged.
        None if !findings.begins.is_empty() => Some(TimeSource::Log),
        wish => wish,
    };
    let mut remarks = Vec::new();
    let mut clocks = clocks_of(&lanes, findings, wish, &mut remarks)
        .map_err(|(topic, why)| refusal(&format!("{name}, topic {topic}"), RecordingProblem::NoStamps { why }))?;
    let mut series = Vec::new();
    let mut bursts = None;
    for ((lane, tracks), clock) in lanes.into_iter().zip(&mut clocks) {
        bursts = bursts.or(clock.bursts);
        for (track, times) in tracks.into_iter().zip(clock.times.drain(..)) {
            let columns = track.columns.iter().filter_map(|&column| places[lane][column as usize]).collect();
            let mut part = Series { columns, times, values: track.values };
            part.sort();
            series.push(part);
        }
    }
    let kinds = series.len();
    if let Some(burst) = bursts.filter(|_| selection.period.is_none() && !selection.ignores_time()) {
        return Err(refusal(name, RecordingProblem::Bursts { sequence, burst }));
    }
    if kinds > 1 && selection.ignores_time() {
        return Err(refusal(name, RecordingProblem::RowsOfSeveral));
    }
    let discrete = discrete(findings, places, &series, samples.channels.len());
    let period = selection.period_in_nanoseconds().and_then(|period| i64::try_from(period).ok());
    let period = period.filter(|_| !selection.ignores_time());
    let channels = Channels { names: &samples.channels, discrete: &discrete };
    let before = series.first().and_then(|series| joining::middle_interval(&series.times));
    gaps(&series, &sequence, &mut samples.facts.gaps);
    let joined = join(series, channels, period, &files.budget).map_err(|refused| match refused {
        Refusal::Said(message) => refusal(name, RecordingProblem::Resampling { sequence: sequence.clone(), message }),
        Refusal::Memory(problem) => FileError::OverBudget { path: name.to_owned(), problem },
    })?;
    if let Some(period) = joined.period {
        samples.period = Some(period as f64 / 1e9);
        let found = match before {
            _ if kinds > 1 => format!("{kinds} kinds of messages"),
            Some(before) if before > 0 && before != period => {
                format!("messages every {} s", crate::times::seconds(before))
            }
            _ => String::new(),
        };
        if !found.is_empty() {
            remarks.push(Remark::Resampled { period: period as f64 / 1e9, found });
        }
        if joined.cut > period.saturating_mul(10) {
            let what = format!(
                "sequence {sequence}: {} s were cut off at its ends, where not all channels are there",
                crate::times::seconds(joined.cut)
            );
            remarks.push(Remark::Understood { what });
        }
    } else {
        // The times of the rows go on to be judged with those of all formats.
        samples.facts.gaps.clear();
    }
    for remark in remarks {
        if !samples.remarks.contains(&remark) {
            samples.remarks.push(remark);
        }
    }
    samples.tracks.push(samples::Track { name: sequence, values: joined.values, times: joined.times });
    Ok(())
}

/// When the messages of each lane were made. Stamps are only mixed with other times if they are of the same clock.
fn clocks_of(
    lanes: &[Part],
    findings: &Findings,
    wish: Option<TimeSource>,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Clock>, (String, String)> {
    let one = |(lane, tracks): &Part, wish| {
        let lane = &findings.lanes[*lane];
        Clock::of(tracks, lane.collecting.whole_stamps, wish).map_err(|why| (lane.topic.clone(), why))
    };
    let mut clocks = lanes.iter().map(|part| one(part, wish)).collect::<Result<Vec<_>, _>>()?;
    let is_stamped = |clock: &Clock| clock.source == TimeSource::Header;
    let mixed = clocks.iter().any(is_stamped) && !clocks.iter().all(is_stamped);
    let far = |(clock, (_, tracks)): (&Clock, &Part)| {
        let apart =
            clock.times.iter().zip(tracks).filter_map(|(times, track)| {
                Some(times.first()?.saturating_sub(*track.logged.first()?).saturating_abs())
            });
        is_stamped(clock) && apart.max().is_some_and(|apart| apart > 1_000_000_000)
    };
    if mixed && wish.is_none() && clocks.iter().zip(lanes).any(far) {
        let what =
            "stamps are of another clock than the times of logging, and not all topics have them: all go by logging";
        remarks.push(Remark::Understood { what: what.to_owned() });
        clocks = lanes.iter().map(|part| one(part, Some(TimeSource::Log))).collect::<Result<Vec<_>, _>>()?;
    }
    for (clock, (lane, tracks)) in clocks.iter().zip(lanes) {
        let topic = findings.lanes[*lane].topic.clone();
        let source_name = match clock.source {
            TimeSource::Header => "the header stamp",
            TimeSource::Publish => "publishing",
            TimeSource::Log | TimeSource::Rows => "logging",
        };
        let messages = tracks.iter().map(|track| track.logged.len()).sum();
        match (clock.bursts, clock.logged_in_bursts) {
            (Some(burst), _) => remarks.push(Remark::Bursts { topic: topic.clone(), messages, burst }),
            (None, Some(burst)) => {
                let what = format!(
                    "{topic}: the messages were logged in bursts of about {burst}; other times tell when they were made"
                );
                remarks.push(Remark::Understood { what });
            }
            (None, None) => {}
        }
        if let Some(why) = clock.spurned {
            let what = format!("{topic}: the stamps in the messages were not used: {why}");
            remarks.push(Remark::Understood { what });
        }
        remarks.push(Remark::TimeSource { topic, source_name: source_name.to_owned() });
    }
    Ok(clocks)
}

/// Which channels hold what has nothing between two values: by their type, or because they are only 0 and 1.
fn discrete(findings: &Findings, places: &[Vec<Option<usize>>], series: &[Series], channels: usize) -> Vec<bool> {
    let mut discrete = vec![false; channels];
    for (lane, places) in findings.lanes.iter().zip(places) {
        for (column, place) in lane.collecting.columns.iter().zip(places) {
            if let Some(place) = *place {
                discrete[place] = column.discrete;
            }
        }
    }
    let mut binary = vec![(true, 0_usize); channels];
    for series in series {
        for row in series.values.chunks_exact(series.columns.len().max(1)) {
            for (&column, &value) in series.columns.iter().zip(row) {
                let (is, count) = &mut binary[column];
                *is &= value == 0.0 || value == 1.0 || value.is_nan();
                *count += 1;
            }
        }
    }
    let is_binary = binary.into_iter().map(|(is, count)| is && count > 2);
    discrete.into_iter().zip(is_binary).map(|(by_type, by_values)| by_type || by_values).collect()
}

/// Where time was lost: intervals of over one and a half middle ones.
fn gaps(series: &[Series], sequence: &str, gaps: &mut Vec<crate::Gap>) {
    for series in series {
        let Some(middle) = joining::middle_interval(&series.times).filter(|&middle| middle > 0) else { continue };
        for (index, pair) in series.times.windows(2).enumerate() {
            let interval = pair[1].saturating_sub(pair[0]);
            if interval as f64 > 1.5 * middle as f64 && gaps.len() < 1000 {
                gaps.push(crate::Gap {
                    sequence: sequence.to_owned(),
                    after: index + 1,
                    seconds: interval as f64 / 1e9,
                });
            }
        }
    }
}

/// Notices a channel that holds each value for several samples.
fn remark_on_stairs(samples: &mut Samples, channel: usize, places: &[Vec<Option<usize>>], findings: &Findings) {
    const FEWEST_STEPS: usize = 5;
    let columns =
        findings.lanes.iter().zip(places).flat_map(|(lane, places)| lane.collecting.columns.iter().zip(places));
    if columns.into_iter().any(|(column, place)| *place == Some(channel) && column.discrete) {
        return;
    }
    let (mut runs, mut held, mut alike) = (0_usize, 0_usize, Vec::new());
    let mut levels = std::collections::HashSet::new();
    for track in &samples.tracks {
        let mut values =
            track.values.iter().skip(channel).step_by(samples.channels.len()).filter(|value| !value.is_nan());
        let Some(mut last) = values.next() else { continue };
        let mut run = 1;
        for value in values {
            if value == last {
                run += 1;
                continue;
            }
            // The first run may have been cut.
            if levels.len() < 100 {
                levels.insert(value.to_bits());
            }
            (runs, held) = (runs + 1, held + run);
            if alike.len() < 10_000 {
                alike.push(run);
            }
            (last, run) = (value, 1);
        }
    }
    if runs < FEWEST_STEPS || levels.len() < FEWEST_STEPS || held < 2 * runs {
        return;
    }
    let every = (held as f64 / runs as f64).round() as usize;
    let regular = alike.iter().filter(|&&run| run.abs_diff(every) <= 1).count();
    if every > 1 && regular * 5 >= alike.len() * 4 {
        samples.remarks.push(Remark::Staircase { channel: samples.channels[channel].clone(), every });
    }
}

#[cfg(test)]
mod bounds_tests;
#[cfg(test)]
pub mod tests;
