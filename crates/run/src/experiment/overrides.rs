//! `--set key=value`: a dotted key and a TOML value that replace what the experiment file says.

use std::str::FromStr;

use toml::{Table, Value};

/// Most parts of a key: no key of an experiment has as many.
const DEEPEST: usize = 16;

/// One `--set`, or a shorthand for one.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// The key's parts. A group is addressed by its name: `network.groups.fast.units`.
    pub path: Vec<String>,
    /// The new value.
    pub value: Value,
    /// The option as it was typed, to show in errors.
    pub typed: String,
    /// A key beside it that says the same in another way, and goes.
    pub instead_of: Option<&'static str>,
}

impl Override {
    /// A shorthand option such as `--epochs`.
    pub fn shorthand(option: &str, key: &str, value: u64) -> Result<Self, String> {
        let number = i64::try_from(value).map_err(|_| format!("{value} is too large for an experiment"))?;
        let path = key.split('.').map(str::to_owned).collect();
        Ok(Self { path, value: Value::Integer(number), typed: format!("{option} {value}"), instead_of: None })
    }

    /// A shorthand option whose value is text.
    pub fn text(option: &str, key: &str, value: &str) -> Self {
        let path = key.split('.').map(str::to_owned).collect();
        Self { path, value: Value::String(value.to_owned()), typed: format!("{option} {value}"), instead_of: None }
    }

    /// A shorthand option whose value is a number.
    pub fn number(option: &str, key: &str, value: f64) -> Self {
        Self { value: Value::Float(value), ..Self::text(option, key, &value.to_string()) }
    }

    /// A shorthand option whose value is a list of texts.
    pub fn list(option: &str, key: &str, values: &[String]) -> Self {
        let value = Value::Array(values.iter().cloned().map(Value::String).collect());
        Self { value, ..Self::text(option, key, &values.join(",")) }
    }

    /// The same, in place of what `key` beside it says.
    pub fn instead_of(self, key: &'static str) -> Self {
        Self { instead_of: Some(key), ..self }
    }

    /// Puts the value in its place.
    ///
    /// # Errors
    /// A sentence, if the key leads through something that has no keys.
    pub fn apply(&self, table: &mut Table) -> Result<(), String> {
        let (last, parents) = self.path.split_last().ok_or("the key is empty")?;
        let mut place = table;
        for (depth, part) in parents.iter().enumerate() {
            let so_far = self.path[..=depth].join(".");
            let next = place.entry(part.as_str()).or_insert_with(|| Value::Table(Table::new()));
            place = match next {
                Value::Table(table) => table,
                Value::Array(groups) => {
                    return self.apply_to_group(groups, depth + 1);
                }
                other => return Err(format!("`{so_far}` is {}, it has no keys", other.type_str())),
            };
        }
        if let Some(other) = self.instead_of {
            place.remove(other);
        }
        place.insert(last.clone(), self.value.clone());
        Ok(())
    }

    /// Goes on below the array `groups`, whose tables are told apart by their names.
    fn apply_to_group(&self, groups: &mut [Value], depth: usize) -> Result<(), String> {
        let named = |group: &Value| group.get("name").and_then(Value::as_str).map(str::to_owned);
        let names: Vec<String> = groups.iter().filter_map(named).collect();
        let list = || names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let array = self.path[..depth].join(".");
        let wanted = &self.path[depth];
        let Some(Value::Table(group)) = groups.iter_mut().find(|group| named(group).as_ref() == Some(wanted)) else {
            return Err(if names.is_empty() {
                format!("`{array}` is a list, it has no keys")
            } else {
                format!("`{array}` has no `{wanted}`; there are {}", list())
            });
        };
        if depth + 1 == self.path.len() {
            return Err(format!("`{}` needs the key to change, e.g. `.units`", self.path.join(".")));
        }
        Self { path: self.path[depth + 1..].to_vec(), ..self.clone() }.apply(group)
    }
}

/// What is no TOML: a number as people type it, `.1` or `1.`, or text.
fn bare(value: &str) -> Value {
    let is_word = !value.contains(|c: char| c.is_ascii_digit());
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() && !is_word => Value::Float(number),
        _ => Value::String(value.to_owned()),
    }
}

impl FromStr for Override {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) =
            text.split_once('=').ok_or_else(|| format!("`{text}` has no `=`; write e.g. training.adam.rate=0.001"))?;
        let path: Vec<String> = key.trim().split('.').map(|part| part.trim().to_owned()).collect();
        if path.iter().any(String::is_empty) || path.len() > DEEPEST {
            let shown = crate::channels::shown(key);
            return Err(format!("`{shown}` is not a key; write e.g. training.adam.rate=0.001"));
        }
        let value = value.trim();
        let value = value.parse::<Value>().unwrap_or_else(|_| bare(value));
        Ok(Self { path, value, typed: format!("--set {text}"), instead_of: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applied(text: &str) -> Result<Table, String> {
        let file = "[training]\nepochs = 10\n[[network.groups]]\nname = \"fast\"\nunits = 3\n";
        let mut table: Table = toml::from_str(file).unwrap();
        text.parse::<Override>()?.apply(&mut table)?;
        Ok(table)
    }

    #[test]
    fn a_value_replaces_or_adds_a_key() {
        assert_eq!(applied("training.epochs=7").unwrap()["training"]["epochs"], Value::Integer(7));
        assert_eq!(applied("training.adam.rate=1e-3").unwrap()["training"]["adam"]["rate"], Value::Float(1e-3));
    }

    #[test]
    fn an_option_goes_in_place_of_a_key_beside_it() {
        let mut table: Table = toml::from_str("[data]\ntopics = [\"/a\", \"/b\"]\n").unwrap();
        Override::text("--topic", "data.topic", "/c").instead_of("topics").apply(&mut table).unwrap();
        assert_eq!(table["data"].to_string(), "{ topic = \"/c\" }");
        Override::list("--topic", "data.topics", &["/a".into()]).instead_of("topic").apply(&mut table).unwrap();
        Override::number("--period", "data.period", 0.5).apply(&mut table).unwrap();
        assert_eq!(table["data"].to_string(), "{ period = 0.5, topics = [\"/a\"] }");
    }

    #[test]
    fn keys_within_keys_without_end_are_no_keys() {
        for parts in [17, 30_000] {
            let told = applied(&format!("{}=1", vec!["a"; parts].join("."))).unwrap_err();
            assert!(told.contains("is not a key") && told.len() < 200, "{told}");
        }
    }

    #[test]
    fn a_value_that_is_not_toml_is_a_string() {
        assert_eq!(applied("data.task=limit-cycle").unwrap()["data"]["task"], Value::String("limit-cycle".into()));
    }

    #[test]
    fn numbers_may_lack_a_digit_before_or_after_the_point() {
        for (typed, number) in [(".1", 0.1), ("-.5", -0.5), ("2.", 2.0), (".1e-3", 1e-4), ("5.e2", 500.0)] {
            let found = applied(&format!("training.adam.rate={typed}")).unwrap();
            assert_eq!(found["training"]["adam"]["rate"], Value::Float(number));
        }
        for text in [".", ".1e999", "infinity", "1.2.3"] {
            assert_eq!(applied(&format!("name={text}")).unwrap()["name"], Value::String(text.into()));
        }
    }

    #[test]
    fn a_group_is_found_by_its_name() {
        assert_eq!(applied("network.groups.fast.units=9").unwrap()["network"]["groups"][0]["units"], Value::Integer(9));
        assert!(applied("network.groups.slow.units=9").unwrap_err().contains("there are `fast`"));
        assert!(applied("network.groups.fast=9").unwrap_err().contains("needs the key"));
    }

    #[test]
    fn senseless_keys_are_refused() {
        assert!(applied("training.epochs.more=7").unwrap_err().contains("has no keys"));
        assert!(applied("training..epochs=7").is_err());
        assert!(applied("training").unwrap_err().contains("no `=`"));
    }
}
