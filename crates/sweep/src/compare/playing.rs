//! The networks that the page of a comparison holds, to be played with: the best of each setting first, as many as fit.

use scrnn_pages::{Playground, Unplayable};
use scrnn_report::Block;
use scrnn_run::members;

use super::collected::{Collected, Row};
use super::learned::LearnedData;
use super::statistics::sign;

/// Names that are listed of those that are left out for one reason.
const NAMES: usize = 8;

/// How many networks, and how much of the page is left for them.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Networks at most.
    pub networks: usize,
    /// Bytes.
    pub bytes: usize,
}

/// All finished runs: the best of each setting, in the order of the settings, then the second best of each, and so on.
fn in_order<'a>(collected: &'a Collected, order: &[usize]) -> Vec<&'a Row> {
    let deciding = collected.measures.first();
    let ranked = |&setting: &usize| {
        let mut own: Vec<&Row> = collected.of(setting).filter(|run| run.is_whole).collect();
        if let Some(measure) = deciding {
            let loss = |run: &Row| run.measures.get(measure.key).map_or(f64::INFINITY, |value| sign(measure) * value);
            own.sort_by(|a, b| loss(a).total_cmp(&loss(b)));
        }
        own
    };
    let all: Vec<Vec<&Row>> = order.iter().map(ranked).collect();
    let most = all.iter().map(Vec::len).max().unwrap_or(0);
    (0..most).flat_map(|rank| all.iter().filter_map(move |own| own.get(rank).copied())).collect()
}

/// Who is left out, by the reason.
#[derive(Debug, Default)]
struct LeftOut(Vec<(&'static str, Vec<String>)>);

impl LeftOut {
    fn put(&mut self, why: &'static str, name: String) {
        match self.0.iter_mut().find(|(other, _)| *other == why) {
            Some((_, names)) => names.push(name),
            None => self.0.push((why, vec![name])),
        }
    }

    /// One sentence for each reason.
    fn words(&self) -> impl Iterator<Item = Block> {
        self.0.iter().map(|(why, names)| {
            let (shown, more) = (names.iter().take(NAMES), names.len().saturating_sub(NAMES));
            let list = shown.map(String::as_str).collect::<Vec<_>>().join("; ");
            let more = if more > 0 { format!("; and {more} more") } else { String::new() };
            Block::Text(format!("Not among them, since {why}: {list}{more}."))
        })
    }
}

/// The networks, and which are not among them and why. Nothing where no network is wanted, or none is finished.
pub fn networks_to_play_with(
    collected: &Collected,
    order: &[usize],
    learned: &mut LearnedData,
    room: Room,
) -> Vec<Block> {
    let runs = in_order(collected, order);
    if room.networks == 0 || runs.is_empty() {
        return Vec::new();
    }
    let (mut playground, mut left_out, mut tried) = (Playground::default(), LeftOut::default(), 0);
    for run in &runs {
        if playground.count() == room.networks || tried == 2 * room.networks {
            break;
        }
        tried += 1;
        let Ok(all) = members::open(&run.path, false) else {
            left_out.put("they cannot be read", run.name.clone());
            continue;
        };
        if !learned.is_near(&all[0]) {
            left_out.put(
                "a robot would have to be simulated anew for what they learned (their own pages have them)",
                run.name.clone(),
            );
            continue;
        }
        let Some(data) = learned.of(&all[0]) else {
            left_out.put("what they learned cannot be made or read again", run.name.clone());
            continue;
        };
        let left = room.bytes.saturating_sub(playground.bytes());
        match playground.add(&run.name, &all, data, left) {
            Ok(()) => {}
            Err(Unplayable::TooLarge(bytes)) => left_out.put(
                "there is no room for their numbers in a page of less than 5 MB",
                format!("{} ({:.1} MB)", run.name, bytes as f64 / 1e6),
            ),
            Err(Unplayable::OneUnit) => {
                left_out.put("a single context unit has no plane of initial states", run.name.clone());
            }
            Err(Unplayable::NoMixture) => {
                left_out.put("their members do not make a mixture that runs in a page", run.name.clone());
            }
        }
    }
    let untried = runs.len() - tried;
    let mut blocks: Vec<Block> = playground.block().into_iter().collect();
    blocks.push(Block::Text(match (playground.count(), runs.len()) {
        (0, _) => "There is nothing to play with here.".to_owned(),
        (all, finished) if all == finished => format!("The page holds all {all} finished networks, as they were saved last."),
        (count, finished) => format!(
            "The page holds {count} of {finished} finished networks, as they were saved last: the best of each setting first, then the second \
             best of each.{}",
            if untried > 0 {
                format!(" {untried} more were not tried: `--networks` says how many a page has, here {} at most.", room.networks)
            } else {
                String::new()
            }
        ),
    }));
    blocks.extend(left_out.words());
    blocks
}
