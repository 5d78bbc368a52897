//! Channels of new data beside those that a network learned: names decide, not positions.

use std::borrow::Cow;
use std::collections::HashSet;
use std::collections::hash_map::{Entry, HashMap};

use scrnn::dataset::{Dataset, Sequence};

use crate::failure::{Failure, Result};

/// Most names that a message lists: a file may have thousands.
const NAMED: usize = 20;

/// Most characters of a name that a message shows.
const SHOWN: usize = 60;

/// Brings `data`, which come from `place`, to the channels that were learned, in their order.
///
/// Where both sides have names, channels are matched by them, whatever their order. Data without names (a table without a
/// header, a numpy array; their channels are called `y1`, `y2`, ...) are taken by position, and so are data for a network that
/// learned from such a file.
///
/// # Errors
/// [`Failure::Input`] with the list of names that are missing, unknown or doubled, or with the two counts.
pub fn matched(data: Dataset, learned: &[String], place: &str) -> Result<Dataset> {
    let found = data.channels();
    if found == learned {
        return Ok(data);
    }
    let count = |channels: &[String]| format!("{} ({})", channels.len(), channels.join(", "));
    if nameless(found) || nameless(learned) {
        if found.len() == learned.len() {
            return renamed(&data, learned);
        }
        let message = format!("{place} has {} channels", count(found));
        return Err(Failure::input(message, format!("the network learned {}", count(learned))));
    }
    let columns =
        by_name(found, learned).map_err(|what| Failure::input(format!("{place} {what}"), help(found, learned)))?;
    let sequences = data.sequences().iter().map(|sequence| {
        let rows = sequence.values().chunks_exact(found.len());
        let values = rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect();
        Sequence::new(sequence.name.clone(), learned.len(), values)
    });
    Ok(Dataset::new(learned.to_vec(), sequences.collect::<scrnn::error::Result<_>>()?)?)
}

/// The beginning of a text from a file, which may be long, as a message shows it.
pub fn shown(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]).into(),
        None => text.into(),
    }
}

/// Whether the channels have no names of their own.
pub fn nameless(channels: &[String]) -> bool {
    channels == Dataset::numbered_channels(channels.len())
}

/// The same samples by other names.
fn renamed(data: &Dataset, names: &[String]) -> Result<Dataset> {
    Ok(Dataset::new(names.to_vec(), data.sequences().to_vec())?)
}

/// For each channel that was learned, where it stands among those that were found; or what is wrong with them.
pub fn by_name<S: AsRef<str>>(found: &[S], learned: &[String]) -> std::result::Result<Vec<usize>, String> {
    let quoted = |names: &[&str]| {
        let list = names.iter().take(NAMED).map(|name| format!("`{}`", shown(name))).collect::<Vec<_>>().join(", ");
        if names.len() > NAMED { format!("{list} and {} more", names.len() - NAMED) } else { list }
    };
    let names: Vec<&str> = found.iter().map(AsRef::as_ref).collect();
    let (mut places, mut doubled) = (HashMap::new(), Vec::new());
    for (place, &name) in names.iter().enumerate() {
        match places.entry(name) {
            Entry::Vacant(entry) => _ = entry.insert(place),
            Entry::Occupied(_) => doubled.push(name),
        }
    }
    doubled.dedup();
    let needed: HashSet<&str> = learned.iter().map(String::as_str).collect();
    let missing: Vec<&str> = learned.iter().map(String::as_str).filter(|name| !places.contains_key(name)).collect();
    let unknown: Vec<&str> = names.iter().copied().filter(|name| !needed.contains(name)).collect();
    let mut wrong = Vec::new();
    if !missing.is_empty() {
        wrong.push(format!("has no channel {}", quoted(&missing)));
    }
    if !unknown.is_empty() {
        wrong.push(format!("has {}, which the network did not learn", quoted(&unknown)));
    }
    if !doubled.is_empty() {
        wrong.push(format!("has {} more than once", quoted(&doubled)));
    }
    if !wrong.is_empty() {
        return Err(wrong.join(", and "));
    }
    Ok(learned.iter().map(|name| places.get(name.as_str()).copied().unwrap_or_default()).collect())
}

/// What to do about channels that do not match.
fn help(found: &[String], learned: &[String]) -> String {
    let list = learned.join(",");
    match learned.iter().all(|name| found.contains(name)) {
        true => format!("take only what it learned: --channels {list}"),
        false => format!(
            "the network learned {}; rename the columns, or leave the header out if their order is that",
            learned.join(", ")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(channels: &[&str], values: &[f64]) -> Dataset {
        let sequence = Sequence::new("a", channels.len(), values.to_vec()).unwrap();
        Dataset::new(channels.iter().map(|&name| name.to_owned()).collect(), vec![sequence]).unwrap()
    }

    fn learned(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn columns_in_another_order_are_found_by_their_names() {
        let swapped = set(&["elbow", "shoulder"], &[1.0, 2.0, 3.0, 4.0]);
        let data = matched(swapped, &learned(&["shoulder", "elbow"]), "new.csv").unwrap();
        assert_eq!(data.channels(), ["shoulder", "elbow"]);
        assert_eq!(data.sequences()[0].values(), [2.0, 1.0, 4.0, 3.0]);
    }

    #[test]
    fn names_that_were_not_learned_are_refused_with_both_lists() {
        let other = set(&["knee", "hip"], &[1.0, 2.0]);
        let text = matched(other, &learned(&["shoulder", "elbow"]), "new.csv").unwrap_err().to_string();
        assert_eq!(
            text,
            "new.csv has no channel `shoulder`, `elbow`, and has `knee`, `hip`, which the network did not learn"
        );
        let doubled = set(&["a", "b", "a"], &[1.0, 2.0, 3.0]);
        let text = matched(doubled, &learned(&["a", "b"]), "new.csv").unwrap_err().to_string();
        assert_eq!(text, "new.csv has `a` more than once");
        let extra = set(&["a", "b", "c"], &[1.0, 2.0, 3.0]);
        let text = matched(extra, &learned(&["a", "b"]), "new.csv").unwrap_err().to_string();
        assert_eq!(text, "new.csv has `c`, which the network did not learn");
    }

    #[test]
    fn only_channels_without_names_are_taken_by_position() {
        let nameless = set(&["y1", "y2"], &[1.0, 2.0]);
        let data = matched(nameless.clone(), &learned(&["shoulder", "elbow"]), "new.csv").unwrap();
        assert_eq!(
            (data.channels(), data.sequences()[0].values()),
            (&learned(&["shoulder", "elbow"])[..], &[1.0, 2.0][..])
        );
        assert!(
            matched(nameless, &learned(&["a", "b", "c"]), "new.npy").unwrap_err().to_string().contains("2 (y1, y2)")
        );
        let named = set(&["a", "b"], &[1.0, 2.0]);
        assert_eq!(matched(named, &learned(&["y1", "y2"]), "new.csv").unwrap().channels(), ["y1", "y2"]);
    }
}
