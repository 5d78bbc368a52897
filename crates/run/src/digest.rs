//! A fingerprint of data.

use scrnn::dataset::Dataset;
use sha2::{Digest, Sha256};

/// A fingerprint of names, lengths and the bits of all samples.
pub fn digest(data: &Dataset) -> String {
    let mut hash = Sha256::new();
    let text = |hash: &mut Sha256, text: &str| {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    };
    hash.update((data.channels().len() as u64).to_le_bytes());
    data.channels().iter().for_each(|name| text(&mut hash, name));
    for sequence in data.sequences() {
        text(&mut hash, &sequence.name);
        hash.update((sequence.len() as u64).to_le_bytes());
        for value in sequence.values() {
            hash.update(value.to_bits().to_le_bytes());
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use scrnn::dataset::Sequence;

    use super::*;

    #[test]
    fn the_digest_sees_each_bit_the_split_and_the_names() {
        let set = |name: &str, parts: &[&[f64]]| {
            let sequences = parts.iter().map(|part| Sequence::new(name, 1, part.to_vec()).unwrap()).collect();
            digest(&Dataset::new(vec!["y".into()], sequences).unwrap())
        };
        let one = set("a", &[&[1.0, 2.0, 3.0]]);
        assert_eq!(one, set("a", &[&[1.0, 2.0, 3.0]]));
        for other in [
            set("b", &[&[1.0, 2.0, 3.0]]),
            set("a", &[&[1.0, 2.0], &[3.0]]),
            set("a", &[&[1.0, 2.0, 3.0_f64.next_up()]]),
        ] {
            assert_ne!(one, other);
        }
    }
}
