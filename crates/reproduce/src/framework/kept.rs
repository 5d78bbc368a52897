//! Parts of evaluations in a file, so that what was finished before an interruption is not done again.
//!
//! The file lies in the run folder of a job's first network. It names, as a digest, everything that decides the parts'
//! results; a file of another digest is not used. Parts are written as TOML, which has a word for numbers that are not finite.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use scrnn_run::failure::{Failure, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// The file's name.
pub const EVALUATION: &str = "evaluation.toml";

/// Everything that decides the result of an evaluation.
#[derive(Debug, Clone, Default)]
pub struct Decides(Sha256);

impl Decides {
    /// Takes something up; order counts.
    pub fn add(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// The digest.
    pub fn digest(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// A finished part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Part {
    /// How long it took.
    seconds: f64,
    value: toml::Value,
}

/// TOML has no word for nothing, but a key can be missing.
#[derive(Debug, Serialize, Deserialize)]
struct Wrapped<T> {
    it: T,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Content {
    decided_by: String,
    #[serde(default)]
    parts: BTreeMap<String, Part>,
}

/// The parts of one evaluation.
#[derive(Debug)]
pub struct Kept {
    path: PathBuf,
    content: Mutex<Content>,
}

impl Kept {
    /// Those in `folder` that were decided by the same; none if the file is of another version, or damaged.
    pub fn open(folder: &Path, decided_by: String) -> Self {
        let path = folder.join(EVALUATION);
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let found = toml::from_str::<Content>(&text).ok().filter(|found| found.decided_by == decided_by);
        let content = found.unwrap_or(Content { decided_by, parts: BTreeMap::new() });
        Self { path, content: Mutex::new(content) }
    }

    /// A finished part and the seconds that it took.
    pub fn get<T: DeserializeOwned>(&self, name: &str) -> Option<(T, f64)> {
        let content = self.lock();
        let Part { seconds, value } = content.parts.get(name)?.clone();
        let Wrapped { it } = value.try_into().ok()?;
        Some((it, seconds))
    }

    /// Keeps a part. What TOML cannot say is left out, and will be done again.
    ///
    /// # Errors
    /// What the disk refuses.
    pub fn put<T: Serialize>(&self, name: &str, value: &T, seconds: f64) -> Result<()> {
        let Ok(value) = toml::Value::try_from(Wrapped { it: value }) else { return Ok(()) };
        let mut content = self.lock();
        content.parts.insert(name.to_owned(), Part { seconds, value });
        let text = toml::to_string(&*content)
            .map_err(|error| Failure::input(format!("parts of the evaluation cannot be written: {error}"), ""))?;
        Ok(scrnn_data::replace(&self.path, text.as_bytes())?)
    }

    /// A thread that panicked did so before it changed anything.
    fn lock(&self) -> MutexGuard<'_, Content> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    struct Numbers {
        all: Vec<f64>,
        pairs: Vec<(usize, f64)>,
        none: Option<f64>,
        nested: Option<Box<Numbers>>,
    }

    #[test]
    fn numbers_come_back_to_the_bit_whatever_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let all = vec![0.1, -0.0, 1e300, 5e-324, 1.0 / 3.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 3.0];
        let inner = Numbers { all: vec![2.0], pairs: vec![(7, 0.5)], none: None, nested: None };
        let put = Numbers { all, pairs: vec![(1, 2.0), (3, f64::NAN)], none: None, nested: Some(Box::new(inner)) };
        Kept::open(folder.path(), "a".into()).put("part one", &put, 2.5).unwrap();
        let (got, seconds) = Kept::open(folder.path(), "a".into()).get::<Numbers>("part one").unwrap();
        let bits = |numbers: &Numbers| numbers.all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&got), seconds), (bits(&put), 2.5));
        assert!(got.pairs[1].1.is_nan() && got.nested == put.nested);
        Kept::open(folder.path(), "a".into()).put("part two", &None::<f64>, 1.0).unwrap();
        assert_eq!(Kept::open(folder.path(), "a".into()).get::<Option<f64>>("part two"), Some((None, 1.0)));
    }

    #[test]
    fn what_something_else_decided_or_a_damaged_file_is_not_used() {
        let folder = tempfile::tempdir().unwrap();
        Kept::open(folder.path(), "a".into()).put("part", &7_u64, 1.0).unwrap();
        assert_eq!(Kept::open(folder.path(), "a".into()).get::<u64>("part"), Some((7, 1.0)));
        assert_eq!(Kept::open(folder.path(), "a".into()).get::<u64>("other"), None);
        assert_eq!(Kept::open(folder.path(), "b".into()).get::<u64>("part"), None);
        std::fs::write(folder.path().join(EVALUATION), "decided_by = \"a\"\n[parts.part").unwrap();
        assert_eq!(Kept::open(folder.path(), "a".into()).get::<u64>("part"), None);
    }

    #[test]
    fn what_decides_is_more_than_its_bytes_in_a_row() {
        let digest = |parts: &[&str]| {
            let mut decides = Decides::default();
            parts.iter().for_each(|part| {
                decides.add(part.as_bytes());
            });
            decides.digest()
        };
        assert_ne!(digest(&["ab", "c"]), digest(&["a", "bc"]));
        assert_eq!(digest(&["ab", "c"]), digest(&["ab", "c"]));
    }
}
