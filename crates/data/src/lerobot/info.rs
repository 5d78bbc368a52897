//! `meta/info.json`: how often frames come, and how the values of each feature are called.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::problem::FormatProblem;

/// Where it stands in a data set.
pub const PLACE: &str = "meta/info.json";

/// What is needed of `meta/info.json`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Info {
    #[serde(default)]
    fps: Option<f64>,
    #[serde(default)]
    features: BTreeMap<String, Feature>,
    #[serde(default)]
    total_episodes: Option<usize>,
    #[serde(default)]
    total_frames: Option<usize>,
}

/// What a feature is.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct Feature {
    /// The type of its values, or `video`, `image`, `string`.
    #[serde(default)]
    pub dtype: String,
    #[serde(default)]
    names: Names,
}

/// Names in whatever structure they stand: a list, lists in a list, or an object of lists (`{"motors": [...]}`).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Names(Vec<String>);

impl Info {
    /// Reads the file's text.
    ///
    /// # Errors
    /// [`FormatProblem::Line`] if it is not JSON, or has a feature without a type.
    pub fn parse(text: &str) -> Result<Self, FormatProblem> {
        serde_json::from_str(text).map_err(|error| FormatProblem::Line {
            line: error.line(),
            found: error.to_string(),
            needed: "JSON as LeRobot writes it, with `fps` and `features`".to_owned(),
        })
    }

    /// Seconds between frames.
    pub fn period(&self) -> Option<f64> {
        self.fps.filter(|fps| fps.is_finite() && *fps > 0.0).map(|fps| 1.0 / fps)
    }

    /// A feature, by its name.
    pub fn feature(&self, name: &str) -> Option<&Feature> {
        self.features.get(name)
    }

    /// How many episodes and frames there should be.
    pub fn totals(&self) -> Option<(usize, usize)> {
        self.total_episodes.zip(self.total_frames).filter(|&(_, frames)| frames > 0)
    }
}

impl Feature {
    /// The names of its values, if it has as many.
    pub fn names(&self, count: usize) -> Option<&[String]> {
        Some(self.names.0.as_slice()).filter(|names| names.len() == count)
    }
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All;
        impl<'de> Visitor<'de> for All {
            type Value = Names;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("names")
            }

            fn visit_str<E>(self, name: &str) -> Result<Names, E> {
                Ok(Names(vec![name.to_owned()]))
            }

            fn visit_u64<E>(self, name: u64) -> Result<Names, E> {
                Ok(Names(vec![name.to_string()]))
            }

            fn visit_unit<E>(self) -> Result<Names, E> {
                Ok(Names::default())
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Names, A::Error> {
                let mut all = Names::default();
                while let Some(Names(names)) = list.next_element()? {
                    all.0.extend(names);
                }
                Ok(all)
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Names, A::Error> {
                let mut all = Names::default();
                while let Some((IgnoredAny, Names(names))) = map.next_entry()? {
                    all.0.extend(names);
                }
                Ok(all)
            }
        }
        deserializer.deserialize_any(All)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_every_structure() {
        let names = |json: &str| {
            let info =
                Info::parse(&format!(r#"{{"fps": 30, "features": {{"a": {{"dtype": "float32", "names": {json}}}}}}}"#));
            info.unwrap().feature("a").unwrap().names(2).map(<[String]>::to_vec)
        };
        let both = Some(vec!["y".to_owned(), "x".to_owned()]);
        for json in
            [r#"["y", "x"]"#, r#"[["y", "x"]]"#, r#"{"motors": ["y", "x"]}"#, r#"{"right": ["y"], "left": ["x"]}"#]
        {
            assert_eq!(names(json), both, "{json}");
        }
        assert_eq!(names("null"), None);
        assert_eq!(names(r#"["y"]"#), None);
    }

    #[test]
    fn a_broken_file_is_refused_with_its_line() {
        let problem = Info::parse("{\n\"fps\": ,}").unwrap_err();
        assert!(matches!(problem, FormatProblem::Line { line: 2, .. }), "{problem}");
        assert_eq!(Info::parse("{}").unwrap().period(), None);
        assert_eq!(Info::parse(r#"{"fps": 50}"#).unwrap().period(), Some(0.02));
        assert_eq!(Info::parse(r#"{"fps": 0}"#).unwrap().period(), None);
    }
}
