//! Which sequences are drawn where there are too many of them, and in which planes their channels lie.

use scrnn_run::evaluation::labels::label;

/// Sequences that are drawn where there is room for many.
pub const MANY: usize = 12;

/// Some of a run's sequences.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chosen {
    /// Their places, in order.
    pub sequences: Vec<usize>,
    /// Which they are, as a sentence.
    pub words: String,
}

/// All sequences where they are no more than `most`, which is at least 2; else as many of each kind as there is room for. Kinds are read
/// from names.
pub fn chosen(names: &[&str], most: usize) -> Chosen {
    let count = names.len();
    if count <= most {
        let words = if count == 1 { "The only sequence.".into() } else { format!("All {count} sequences.") };
        return Chosen { sequences: (0..count).collect(), words };
    }
    let kinds = kinds(names);
    if kinds.len() < 2 || kinds.len() > most {
        // Evenly over all of them, the first and the last among them.
        let sequences = (0..most).map(|k| k * (count - 1) / (most - 1)).collect();
        return Chosen { sequences, words: format!("{most} of {count} sequences, evenly over all of them.") };
    }
    let each = most / kinds.len();
    let mut sequences: Vec<usize> = kinds.iter().flat_map(|(_, own)| own.iter().take(each).copied()).collect();
    sequences.sort_unstable();
    let list: Vec<String> =
        kinds.iter().map(|(kind, own)| format!("{kind} ({} of {})", each.min(own.len()), own.len())).collect();
    let words = format!("{} of {count} sequences, some of each kind: {}.", sequences.len(), list.join(", "));
    Chosen { sequences, words }
}

/// Kinds by their names, each with its sequences; what has no letters is of no kind.
pub fn kinds(names: &[&str]) -> Vec<(String, Vec<usize>)> {
    let mut kinds: Vec<(String, Vec<usize>)> = Vec::new();
    for (s, name) in names.iter().enumerate() {
        let Some(own) = label(name) else { continue };
        match kinds.iter_mut().find(|(kind, _)| *kind == own) {
            Some((_, sequences)) => sequences.push(s),
            None => kinds.push((own, vec![s])),
        }
    }
    kinds
}

/// Pairs of channels that are places in a plane: `x` and `y`, `hand_x` and `hand_y`, `left.x` and `left.y`; and two channels that are
/// all there are. Whether both have one unit comes with them.
pub fn planes(channels: &[String]) -> Vec<(usize, usize, bool)> {
    let other = |name: &str| -> Option<String> {
        let (rest, last) = (name.strip_suffix(['x', 'X'])?, if name.ends_with('x') { 'y' } else { 'Y' });
        let apart = rest.chars().next_back().is_none_or(|c| !c.is_alphabetic());
        apart.then(|| format!("{rest}{last}"))
    };
    let pair = |(i, name): (usize, &String)| {
        let other = other(name)?;
        Some((i, channels.iter().position(|channel| *channel == other)?, true))
    };
    let pairs: Vec<_> = channels.iter().enumerate().filter_map(pair).collect();
    if pairs.is_empty() && channels.len() == 2 { vec![(0, 1, false)] } else { pairs }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_drawn_and_named() {
        let names: Vec<String> = (0..40).map(|k| format!("{}_{k}", ["arc", "line", "loop"][k % 3])).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let found = chosen(&names, MANY);
        assert_eq!(found.sequences, (0..12).collect::<Vec<_>>());
        assert_eq!(
            found.words,
            "12 of 40 sequences, some of each kind: arc (4 of 14), line (4 of 13), loop (4 of 13)."
        );
        assert_eq!(chosen(&names[..2], MANY).words, "All 2 sequences.");
        let numbers: Vec<String> = (0..100).map(|k| k.to_string()).collect();
        let found = chosen(&numbers.iter().map(String::as_str).collect::<Vec<_>>(), MANY);
        assert_eq!((found.sequences.len(), found.sequences[0], found.sequences[11]), (12, 0, 99));
    }

    #[test]
    fn planes_are_found_by_the_names_of_their_channels() {
        let planes = |names: &[&str]| planes(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(planes(&["t", "x", "y", "hand_x", "hand_y", "max", "may"]), [(1, 2, true), (3, 4, true)]);
        assert_eq!(planes(&["a", "b"]), [(0, 1, false)]);
        assert_eq!(planes(&["a", "b", "c"]), []);
    }
}
