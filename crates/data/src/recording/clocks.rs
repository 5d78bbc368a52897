//! Which of a message's times tells when it was made: its stamp, when it was published, when it was logged.
//!
//! Without a wish, the stamps are taken if every message has one and they behave as times do; else the times of
//! publishing if those of logging come in bursts and they do not; else the times of logging.

use super::collecting::{Collecting, NO_STAMP, Track};
use crate::TimeSource;

/// Stamps may fall back this far, as where several programs publish: nanoseconds.
const MOST_BACK: i64 = 1_000_000_000;
/// Messages from which on bursts are told from chance.
const FEWEST: usize = 10;

/// Times of a topic's tracks, and what is to be said of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// Where they are from.
    pub source: TimeSource,
    /// For each track, when its messages were made.
    pub times: Vec<Vec<i64>>,
    /// How many messages were logged at once, if they were logged in bursts.
    pub logged_in_bursts: Option<usize>,
    /// How many of the times that were taken come at once.
    pub bursts: Option<usize>,
    /// Why the stamps were not taken, though there are some.
    pub spurned: Option<&'static str>,
}

impl Clock {
    /// Chooses the times of a topic's tracks.
    ///
    /// # Errors
    /// Why the wish cannot be granted, as the end of a sentence that begins with its messages.
    pub fn of(tracks: &[Track], whole_stamps: bool, wish: Option<TimeSource>) -> Result<Self, String> {
        let logged_in_bursts = tracks.iter().find_map(|track| burst(&track.logged));
        let stamps = stamps(tracks, whole_stamps);
        let logged = || tracks.iter().map(|track| track.logged.clone()).collect::<Vec<_>>();
        let published = || {
            let times =
                |track: &Track| if track.published.is_empty() { &track.logged } else { &track.published }.clone();
            tracks.iter().map(times).collect::<Vec<_>>()
        };
        let clock = |source, times: Vec<Vec<i64>>, spurned| {
            let bursts = times.iter().find_map(|times| burst(times));
            Ok(Self { source, times, logged_in_bursts, bursts, spurned })
        };
        match (wish, stamps) {
            (Some(TimeSource::Header), Ok(stamps)) | (None, Ok(stamps)) => clock(TimeSource::Header, stamps, None),
            (Some(TimeSource::Header), Err(why)) => Err(format!("carry no stamps that could be used: {why}")),
            (Some(TimeSource::Publish), _) => clock(TimeSource::Publish, published(), None),
            (Some(TimeSource::Log | TimeSource::Rows), _) => clock(TimeSource::Log, logged(), None),
            (None, Err(why)) => {
                let spurned = tracks.iter().any(|track| !track.stamps.is_empty()).then_some(why);
                let published = published();
                let behaves = |times: &Vec<i64>| times.last() > times.first() && burst(times).is_none();
                if logged_in_bursts.is_some() && published.iter().all(behaves) {
                    clock(TimeSource::Publish, published, spurned)
                } else {
                    clock(TimeSource::Log, logged(), spurned)
                }
            }
        }
    }
}

/// The stamps of all tracks in nanoseconds, if they behave as times do.
fn stamps(tracks: &[Track], whole: bool) -> Result<Vec<Vec<i64>>, &'static str> {
    for track in tracks {
        if track.stamps.is_empty() {
            return Err("there are none");
        }
        if track.stamps.len() < track.logged.len() || track.stamps.contains(&NO_STAMP) {
            return Err("some messages have none");
        }
    }
    let unit = if whole { unit(tracks) } else { 1 };
    let in_nanoseconds = |track: &Track| track.stamps.iter().map(|stamp| stamp.saturating_mul(unit)).collect();
    let stamps: Vec<Vec<i64>> = tracks.iter().map(in_nanoseconds).collect();
    let all = stamps.iter().flatten();
    if all.clone().all(|&stamp| stamp == 0) {
        return Err("all are zero");
    }
    let (mut steps, mut still) = (0, 0);
    for times in &stamps {
        for pair in times.windows(2) {
            steps += 1;
            still += usize::from(pair[0] == pair[1]);
            if pair[1] < pair[0].saturating_sub(MOST_BACK) {
                return Err("they begin again");
            }
        }
    }
    if 2 * still > steps { Err("most are those of the message before") } else { Ok(stamps) }
}

/// Nanoseconds of the unit with which the stamps go as long as the times of logging.
fn unit(tracks: &[Track]) -> i64 {
    const UNITS: [i64; 4] = [1, 1_000, 1_000_000, 1_000_000_000];
    let span = |times: &[i64]| {
        let (least, most) = (times.iter().min()?, times.iter().max()?);
        Some(i128::from(*most) - i128::from(*least)).filter(|&span| span > 0)
    };
    let longest = tracks.iter().max_by_key(|track| track.logged.len());
    let spans = longest.and_then(|track| Some((span(&track.logged)?, span(&track.stamps)?)));
    match spans {
        Some((logged, stamped)) => {
            let wanted = (logged as f64 / stamped as f64).log10();
            let distance = |unit: &i64| ((*unit as f64).log10() - wanted).abs();
            UNITS.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(1)
        }
        // A single message: it does not matter.
        None => 1,
    }
}

/// How many messages come at once, if they come in bursts: most right behind each other, and then none for long.
pub fn burst(times: &[i64]) -> Option<usize> {
    let (first, last) = (times.first()?, times.last()?);
    if times.len() < FEWEST || last <= first {
        return None;
    }
    let intervals = (times.len() - 1) as f64;
    let mean = (i128::from(*last) - i128::from(*first)) as f64 / intervals;
    let (mut short, mut long) = (0_usize, 0_usize);
    for pair in times.windows(2) {
        let interval = (i128::from(pair[1]) - i128::from(pair[0])) as f64;
        short += usize::from(interval < 0.1 * mean);
        long += usize::from(interval > 1.9 * mean);
    }
    let bursts = (short as f64 >= 0.5 * intervals && long >= 2).then_some(long + 1)?;
    Some((times.len() as f64 / bursts as f64).round() as usize).filter(|&burst| burst > 1)
}

/// Takes columns out that tell the time or count, and says which.
pub fn without_clocks(collected: &mut Collecting) -> (Vec<String>, Vec<String>) {
    let grows = |column: u32, even: bool| {
        let mut steps = 0;
        let all = collected.tracks.iter().all(|track| {
            let Ok(place) = track.columns.binary_search(&column) else { return true };
            let values: Vec<f64> = track.values.iter().skip(place).step_by(track.columns.len()).copied().collect();
            steps += values.len().saturating_sub(1);
            values.windows(2).all(|pair| if even { pair[1] - pair[0] == 1.0 } else { pair[1] >= pair[0] })
                && (even || values.last() > values.first() || values.len() < 2)
        });
        all && steps >= if even { 3 } else { 1 }
    };
    let named = |names: &[&str], name: &str| names.iter().any(|known| name.eq_ignore_ascii_case(known));
    let (mut clocks, mut counters) = (Vec::new(), Vec::new());
    let mut gone = vec![false; collected.columns.len()];
    for (index, column) in collected.columns.iter().enumerate() {
        if column.clock && grows(index as u32, false) {
            clocks.push(column.name.clone());
            gone[index] = true;
        } else if !collected.takes_all() && named(&COUNTERS, &column.name) && grows(index as u32, true) {
            counters.push(column.name.clone());
            gone[index] = true;
        }
    }
    if gone.contains(&true) && gone.contains(&false) {
        collected.remove(&gone);
        (clocks, counters)
    } else {
        (Vec::new(), Vec::new())
    }
}

/// Names of what counts messages.
const COUNTERS: [&str; 8] = ["seq", "sequence", "index", "frame", "frame_index", "counter", "count", "step"];

#[cfg(test)]
mod tests {
    use super::*;

    fn track(logged: Vec<i64>, stamps: Vec<i64>) -> Track {
        Track { values: vec![0.0; logged.len()], columns: [0].into(), logged, stamps, published: Vec::new() }
    }

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn stamps_that_behave_are_taken_and_others_are_not() {
        let logged: Vec<i64> = (0..20).map(|k| k * SECOND / 10).collect();
        let early: Vec<i64> = logged.iter().map(|time| time + 5).collect();
        let of = |stamps: Vec<i64>| Clock::of(&[track(logged.clone(), stamps)], false, None).unwrap();
        let clock = of(early.clone());
        assert_eq!((clock.source, &clock.times[0]), (TimeSource::Header, &early));
        for (stamps, why) in [
            (vec![0; 20], "all are zero"),
            (vec![7; 20], "most are those of the message before"),
            ((0..20).map(|k| if k == 3 { NO_STAMP } else { k }).collect(), "some messages have none"),
            ((0..20).map(|k| (k % 10) * SECOND).collect(), "they begin again"),
        ] {
            let clock = of(stamps);
            assert_eq!((clock.source, clock.spurned), (TimeSource::Log, Some(why)));
        }
        assert_eq!((of(Vec::new()).source, of(Vec::new()).spurned), (TimeSource::Log, None));
        let refused = Clock::of(&[track(logged.clone(), vec![0; 20])], false, Some(TimeSource::Header)).unwrap_err();
        assert!(refused.contains("all are zero"));
        let wished = Clock::of(&[track(logged.clone(), early)], false, Some(TimeSource::Log)).unwrap();
        assert_eq!((wished.source, &wished.times[0]), (TimeSource::Log, &logged));
    }

    #[test]
    fn the_unit_of_whole_stamps_is_that_of_the_times_of_logging() {
        let logged: Vec<i64> = (0..20).map(|k| k * SECOND / 10).collect();
        for unit in [1, 1000, 1_000_000, 100_000_000] {
            let stamps = logged.iter().map(|time| time / unit + 3).collect();
            let clock = Clock::of(&[track(logged.clone(), stamps)], true, None).unwrap();
            let unit = if unit == 100_000_000 { SECOND } else { unit };
            assert_eq!(clock.times[0][1] - clock.times[0][0], if unit == SECOND { SECOND } else { SECOND / 10 });
        }
    }

    #[test]
    fn bursts_are_noticed_and_times_of_publishing_taken_instead() {
        let bursts: Vec<i64> = (0..50).map(|k| (k / 5) * 100_000 + (k % 5) * 300).collect();
        let even: Vec<i64> = (0..50).map(|k| k * 20_000).collect();
        assert_eq!((burst(&bursts), burst(&even)), (Some(5), None));
        let wavering: Vec<i64> = (0..50).map(|k| k * 20_000 + (k * 7919) % 15_000).collect();
        assert_eq!(burst(&wavering), None);
        let one_gap: Vec<i64> = (0..50).map(|k| k * 20_000 + (k / 25) * 900_000).collect();
        assert_eq!(burst(&one_gap), None);
        let both = Track { published: even.clone(), ..track(bursts.clone(), Vec::new()) };
        let clock = Clock::of(&[both], false, None).unwrap();
        assert_eq!((clock.source, clock.logged_in_bursts, clock.bursts), (TimeSource::Publish, Some(5), None));
        let clock = Clock::of(&[track(bursts, Vec::new())], false, None).unwrap();
        assert_eq!((clock.source, clock.bursts), (TimeSource::Log, Some(5)));
    }
}
