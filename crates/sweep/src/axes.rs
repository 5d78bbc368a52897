//! Values of a knob: a list, a range, or what is drawn from either.

use rand::{Rng, RngExt};
use scrnn_run::failure::{Failure, Result};
use serde::Deserialize;
use toml::{Table, Value};

/// Most values of a knob.
const MOST: usize = 100_000;
/// Digits of a value of a range: all that a person would have typed, and no dust of the arithmetic.
const DIGITS: usize = 12;
/// Digits of a value that is drawn: enough to tell draws apart, and few enough for a name.
const DRAWN_DIGITS: usize = 4;

/// A knob: a key of the experiment, and its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The parts of the dotted key; a group is addressed by its name.
    pub key: Vec<String>,
    /// Its values.
    pub values: Values,
}

/// Where values come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// These.
    List(Vec<Value>),
    /// Between two numbers.
    Range(Range),
}

/// Numbers between two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    from: f64,
    to: f64,
    count: Option<usize>,
    log: bool,
    /// Whether all are whole numbers, since both ends are.
    whole: bool,
}

/// As it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    from: Value,
    to: Value,
    count: Option<usize>,
    #[serde(default)]
    scale: Scale,
}

#[derive(Deserialize, Default, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum Scale {
    #[default]
    Linear,
    Log,
}

/// The knobs of a table, whose keys are dotted, quoted or nested. `table` is its name in the file.
///
/// # Errors
/// [`Failure::Input`] for what is neither a list nor a range.
pub fn axes(table: &str, content: &Table) -> Result<Vec<Axis>> {
    let mut axes = Vec::new();
    collect(table, &mut Vec::new(), content, &mut axes)?;
    Ok(axes)
}

fn collect(table: &str, above: &mut Vec<String>, content: &Table, axes: &mut Vec<Axis>) -> Result<()> {
    for (key, value) in content {
        let depth = above.len();
        above.extend(key.split('.').map(|part| part.trim().to_owned()));
        let place = format!("{table}.{}", above.join("."));
        if above.iter().any(String::is_empty) {
            return Err(Failure::input(format!("`{place}` is not a key"), "write e.g. \"training.adam.rate\""));
        }
        match value {
            Value::Array(list) if list.is_empty() => {
                return Err(Failure::input(
                    format!("`{place}` is an empty list"),
                    "give at least one value, or leave it out",
                ));
            }
            Value::Array(list) => axes.push(Axis { key: above.clone(), values: Values::List(list.clone()) }),
            Value::Table(range) if range.contains_key("from") || range.contains_key("to") => {
                axes.push(Axis { key: above.clone(), values: Values::Range(Range::read(&place, range)?) });
            }
            Value::Table(below) => collect(table, above, below, axes)?,
            other => {
                let message = format!("`{place}` is {}: {other}", of_type(other));
                let help = format!(
                    "give a list, as [{other}], or a range, as {{ from = 1e-4, to = 1e-1, count = 4, scale = \"log\" }}; \
                     what is the same for all networks goes under [set]"
                );
                return Err(Failure::input(message, help));
            }
        }
        above.truncate(depth);
    }
    Ok(())
}

/// A type with its article.
fn of_type(value: &Value) -> String {
    let word = value.type_str();
    format!("{} {word}", if word.starts_with(['a', 'i']) { "an" } else { "a" })
}

impl Range {
    fn read(place: &str, table: &Table) -> Result<Self> {
        let complaint = |message: String, help: &str| Err(Failure::input(format!("`{place}`: {message}"), help));
        let example = "write e.g. { from = 1e-4, to = 1e-1, count = 4, scale = \"log\" }";
        let Written { from, to, count, scale } = match table.clone().try_into() {
            Ok(written) => written,
            Err(error) => return complaint(toml::de::Error::message(&error).to_owned(), example),
        };
        let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
        let (Some(low), Some(high)) = (number(&from), number(&to)) else {
            return complaint("`from` and `to` are numbers".to_owned(), example);
        };
        let (log, whole) = (scale == Scale::Log, from.is_integer() && to.is_integer());
        if !low.is_finite() || !high.is_finite() || low >= high {
            return complaint(format!("it goes from {from} to {to}"), "give a `from` that is less than `to`");
        }
        if log && low <= 0.0 {
            return complaint(format!("a logarithmic range begins at {from}"), "give a `from` above 0");
        }
        if count.is_some_and(|count| !(2..=MOST).contains(&count)) {
            return complaint(format!("count is {}", count.unwrap_or(0)), "give a count from 2 to 100000");
        }
        Ok(Self { from: low, to: high, count, log, whole })
    }

    /// What lies at this share of the way.
    fn at(self, share: f64) -> f64 {
        match self.log {
            false => self.from + (self.to - self.from) * share,
            true => self.from * (self.to / self.from).powf(share),
        }
    }

    fn all(self, place: &str) -> Result<Vec<Value>> {
        let Some(count) = self.count else {
            let help = "a grid needs `count`; [random] draws from a range without it";
            return Err(Failure::input(format!("`{place}` does not say how many values it has"), help));
        };
        let value = |k: usize| match k {
            0 => self.from,
            k if k == count - 1 => self.to,
            k => self.at(k as f64 / (count - 1) as f64),
        };
        let values: Vec<Value> = (0..count).map(|k| self.value(value(k), DIGITS)).collect();
        if let Some(twice) = (1..count).find(|&k| values[k] == values[k - 1]) {
            let message = format!("`{place}` has {count} values, and {} comes twice", values[twice]);
            return Err(Failure::input(message, "give a smaller count, or ends that are not whole numbers (10.0)"));
        }
        Ok(values)
    }

    fn value(self, value: f64, digits: usize) -> Value {
        if self.whole {
            return Value::Integer(value.round() as i64);
        }
        let rounded = format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
        Value::Float(f64::clamp(rounded, self.from, self.to))
    }

    fn draw(self, rng: &mut impl Rng) -> Value {
        let share: f64 = rng.random();
        if self.whole && !self.log {
            // Each of them is as likely as any other.
            let value = (self.from + share * (self.to - self.from + 1.0)).floor().min(self.to);
            return Value::Integer(value as i64);
        }
        self.value(self.at(share), DRAWN_DIGITS)
    }
}

impl Axis {
    /// The dotted key.
    #[must_use]
    pub fn name(&self) -> String {
        self.key.join(".")
    }

    /// All values, in order.
    ///
    /// # Errors
    /// [`Failure::Input`] for a range that does not say how many, or has one twice.
    pub fn all(&self) -> Result<Vec<Value>> {
        match &self.values {
            Values::List(values) => Ok(values.clone()),
            Values::Range(range) => range.all(&self.name()),
        }
    }

    /// One of the values.
    pub fn draw(&self, rng: &mut impl Rng) -> Value {
        match &self.values {
            Values::List(values) => {
                let share: f64 = rng.random();
                values[((share * values.len() as f64) as usize).min(values.len() - 1)].clone()
            }
            Values::Range(range) => range.draw(rng),
        }
    }
}

#[cfg(test)]
mod tests {
    use scrnn::streams::{Purpose, stream};

    use super::*;

    fn read(text: &str) -> Result<Vec<Axis>> {
        axes("grid", &toml::from_str(text).unwrap())
    }

    fn values(text: &str) -> Vec<String> {
        let all = read(&format!("a = {text}")).unwrap()[0].all().unwrap();
        all.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn keys_are_dotted_quoted_or_nested() {
        let text = "\"a.b\" = [1]\nc.d.e = [2]\n[f]\ng = { from = 1, to = 2, count = 2 }\n";
        let names: Vec<String> = read(text).unwrap().iter().map(Axis::name).collect();
        assert_eq!(names, ["a.b", "c.d.e", "f.g"]);
    }

    #[test]
    fn ranges_have_their_ends_and_no_dust() {
        assert_eq!(values("{ from = 1e-4, to = 0.1, count = 4, scale = \"log\" }"), ["0.0001", "0.001", "0.01", "0.1"]);
        assert_eq!(values("{ from = 0.0, to = 0.3, count = 4 }"), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(values("{ from = 10, to = 50, count = 5 }"), ["10", "20", "30", "40", "50"]);
        assert_eq!(values("{ from = 1, to = 64, count = 7, scale = \"log\" }"), ["1", "2", "4", "8", "16", "32", "64"]);
    }

    #[test]
    fn what_is_no_axis_is_refused_in_words() {
        for (text, needed) in [
            ("a = 3", "a list, as [3]"),
            ("a = []", "at least one value"),
            ("a = { from = 2, to = 1, count = 3 }", "less than `to`"),
            ("a = { from = 0, to = 1, scale = \"log\" }", "above 0"),
            ("a = { from = 1, to = 2, cuont = 3 }", "{ from = 1e-4"),
            ("a = { from = 1, to = 2, count = 1 }", "2 to 100000"),
            ("a = { from = \"x\", to = 2, count = 3 }", "{ from = 1e-4"),
            ("\"a..b\" = [1]", "write e.g."),
        ] {
            let error = format!("{:?}", read(text).unwrap_err());
            assert!(error.contains(needed), "{text}: {error}");
        }
        for text in ["{ from = 1.0, to = 2.0 }", "{ from = 1, to = 3, count = 9 }"] {
            assert!(read(&format!("a = {text}")).unwrap()[0].all().is_err(), "{text}");
        }
    }

    #[test]
    fn draws_lie_in_their_range_and_reach_all_of_it() {
        let mut rng = stream(1, Purpose::SweepDraws, 0);
        let mut draw = |text: &str| -> Vec<Value> {
            let axis = read(&format!("a = {text}")).unwrap().remove(0);
            (0..2000).map(|_| axis.draw(&mut rng)).collect()
        };
        let rates: Vec<f64> =
            draw("{ from = 1e-4, to = 1e-1, scale = \"log\" }").iter().filter_map(Value::as_float).collect();
        assert_eq!(rates.len(), 2000);
        assert!(rates.iter().all(|rate| (1e-4..=1e-1).contains(rate)));
        // A third of them in each decade; five deviations.
        let low = rates.iter().filter(|&&rate| rate < 1e-3).count();
        assert!(low.abs_diff(667) < 105, "{low}");
        assert!(rates.iter().all(|rate| rate.to_string().trim_start_matches(['0', '.']).len() <= DRAWN_DIGITS));
        let whole = draw("{ from = 1, to = 4 }");
        for value in 1..=4 {
            let count = whole.iter().filter(|&one| *one == Value::Integer(value)).count();
            assert!(count.abs_diff(500) < 100, "{value}: {count}");
        }
        assert!(draw("[\"x\", \"y\"]").iter().any(|one| one.as_str() == Some("y")));
    }
}
