//! What kind of movement a sequence is, by its name: `reach_left_03`, `arc7`, `12 walk` and `walk_2/1` are of the kinds `reach left`, `arc`,
//! `walk` and `walk`.

use serde::Serialize;

/// Letters of the name's last part that has any, without numbers; none where there are no letters.
pub fn label(name: &str) -> Option<String> {
    let part = name.rsplit('/').find(|part| part.chars().any(char::is_alphabetic))?;
    let words = part.split(|c: char| !c.is_alphanumeric()).map(|word| word.trim_matches(|c: char| c.is_numeric()));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    (!words.is_empty()).then(|| words.join(" "))
}

/// How often a sequence was taken for one of its own kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recognised {
    /// Sequences whose most likely learned sequence is of their kind.
    pub right: usize,
    /// Sequences of kinds that were learned.
    pub of: usize,
    /// The same for each kind.
    pub kinds: Vec<Kind>,
}

/// One kind of sequence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Kind {
    /// What their names have in common.
    pub label: String,
    /// How many were taken for their own kind.
    pub right: usize,
    /// How many there are.
    pub of: usize,
}

impl Recognised {
    /// Of the names of sequences and those of the learned sequences that they were taken for. None unless at least two kinds were learned
    /// and some sequence is of one of them.
    pub fn of(taken: &[(&str, &str)], learned: &[String]) -> Option<Self> {
        let known: Vec<String> = learned.iter().filter_map(|name| label(name)).collect();
        let first = known.first()?;
        if known.iter().all(|label| label == first) {
            return None;
        }
        let mut kinds: Vec<Kind> = Vec::new();
        for (name, taken) in taken {
            let Some(own) = label(name).filter(|own| known.contains(own)) else { continue };
            let right = usize::from(label(taken).as_ref() == Some(&own));
            match kinds.iter_mut().find(|kind| kind.label == own) {
                Some(kind) => (kind.right, kind.of) = (kind.right + right, kind.of + 1),
                None => kinds.push(Kind { label: own, right, of: 1 }),
            }
        }
        let sum = |of: fn(&Kind) -> usize| kinds.iter().map(of).sum();
        (!kinds.is_empty()).then(|| Self {
            right: sum(|kind| kind.right),
            of: sum(|kind| kind.of),
            kinds: kinds.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_read_from_names() {
        let kinds = ["reach_left_03", "arc7", "12 walk", "walk_2/1", "train/3 walk", "17", ""].map(label);
        let expected = ["reach left", "arc", "walk", "walk", "walk"].map(|label| Some(label.to_owned()));
        assert_eq!(kinds[..5], expected);
        assert_eq!(kinds[5..], [None, None]);
    }

    #[test]
    fn sequences_are_counted_by_their_own_kind() {
        let learned = ["walk1", "wave1"].map(String::from);
        let found = Recognised::of(&[("walk7", "walk1"), ("wave9", "walk1"), ("jump1", "walk1")], &learned).unwrap();
        assert_eq!((found.right, found.of, found.kinds.len()), (1, 2, 2));
        assert_eq!(Recognised::of(&[("walk7", "walk1")], &learned[..1]), None);
    }
}
