//! What differs between two experiments, key by key.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::Value;

/// A key whose value changed; `None` where there was or is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The dotted key.
    pub key: String,
    /// The value before.
    pub old: Option<Value>,
    /// The value now.
    pub new: Option<Value>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let show = |value: &Option<Value>| value.as_ref().map_or("nothing".to_owned(), Value::to_string);
        write!(f, "{}: {} -> {}", self.key, show(&self.old), show(&self.new))
    }
}

/// All keys whose values differ, in alphabetical order.
pub fn differences(old: &Value, new: &Value) -> Vec<Difference> {
    let (mut before, mut after) = (BTreeMap::new(), BTreeMap::new());
    flatten("", old, &mut before);
    flatten("", new, &mut after);
    let keys: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    keys.into_iter()
        .filter(|key| before.get(*key) != after.get(*key))
        .map(|key| Difference { key: key.clone(), old: before.get(key).cloned(), new: after.get(key).cloned() })
        .collect()
}

/// Lists the leaves below `value`. An entry of a list that has a name is addressed by it.
fn flatten(key: &str, value: &Value, leaves: &mut BTreeMap<String, Value>) {
    let below = |part: &str| if key.is_empty() { part.to_owned() } else { format!("{key}.{part}") };
    match value {
        Value::Object(entries) => entries.iter().for_each(|(part, entry)| flatten(&below(part), entry, leaves)),
        Value::Array(entries) if entries.iter().any(Value::is_object) => {
            for (index, entry) in entries.iter().enumerate() {
                let name = entry["name"].as_str().map_or_else(|| (index + 1).to_string(), str::to_owned);
                flatten(&below(&name), entry, leaves);
            }
        }
        leaf => drop(leaves.insert(key.to_owned(), leaf.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn changed_new_and_lost_keys_are_shown_old_to_new() {
        let old = json!({ "seed": 1, "network": { "groups": [{ "name": "a", "units": 3 }] }, "adam": { "rate": 0.1 } });
        let new =
            json!({ "seed": 2, "network": { "groups": [{ "name": "a", "units": 4 }] }, "momentum": { "rate": 1.0 } });
        let shown: Vec<String> = differences(&old, &new).iter().map(ToString::to_string).collect();
        let expected = [
            "adam.rate: 0.1 -> nothing",
            "momentum.rate: nothing -> 1.0",
            "network.groups.a.units: 3 -> 4",
            "seed: 1 -> 2",
        ];
        assert_eq!(shown, expected);
        assert_eq!(differences(&old, &old), []);
    }
}
