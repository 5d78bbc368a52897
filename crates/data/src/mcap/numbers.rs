//! A JSON message as numbers by name.
//!
//! | message | names | values |
//! |---|---|---|
//! | `{"joints": [{"name": "elbow", "position": 0.1, ...}, ...]}`, as `foxglove.JointStates` | of the joints | positions |
//! | `{"name": ["elbow", ...], "position": [0.1, ...]}`, as ROS' `JointState` | of the joints | positions |
//! | anything else, e.g. `{"x": 1, "arm": {"elbow": 0.1}, "touch": [0, 1]}` | `x`, `arm.elbow`, `touch.0`, `touch.1` | all numbers |
//!
//! Times, text and truth values are passed over.

use std::collections::HashSet;

use super::json::Json;

/// Names and values, in the message's order.
pub type Numbers = Vec<(String, f64)>;

/// Reads a message.
///
/// # Errors
/// What is wrong with it, as the end of a sentence.
pub fn parse(data: &[u8]) -> Result<Numbers, String> {
    let message: Json = serde_json::from_slice(data).map_err(|error| format!("is not JSON: {error}"))?;
    let Json::Object(_) = message else { return Err("is no JSON object".to_owned()) };
    let joints = joints(&message).or_else(|| columns(&message));
    let numbers = joints.unwrap_or_else(|| {
        let mut numbers = Vec::new();
        leaves("", &message, &mut numbers).map(|()| numbers)
    })?;
    let mut seen = HashSet::new();
    match numbers.iter().find(|(name, _)| !seen.insert(name.as_str())) {
        Some((twice, _)) => Err(format!("holds `{twice}` twice")),
        None => Ok(numbers),
    }
}

/// A list of joints, each with its name and position.
fn joints(message: &Json) -> Option<Result<Numbers, String>> {
    let list = message.get("joints")?.list()?;
    let pair = |joint: &Json| position(joint.get("name"), joint.get("position"));
    Some(list.iter().map(pair).collect())
}

/// A list of names beside a list of positions.
fn columns(message: &Json) -> Option<Result<Numbers, String>> {
    let (names, positions) = (message.get("name")?.list()?, message.get("position")?.list()?);
    if names.len() != positions.len() {
        return Some(Err(format!("holds {} names, but {} positions", names.len(), positions.len())));
    }
    Some(names.iter().zip(positions).map(|(name, value)| position(Some(name), Some(value))).collect())
}

fn position(name: Option<&Json>, position: Option<&Json>) -> Result<(String, f64), String> {
    let name = name.and_then(Json::text).ok_or("holds a joint without a name")?;
    let position = position.and_then(Json::number);
    position.map(|position| (name.to_owned(), position)).ok_or_else(|| format!("holds no position of joint `{name}`"))
}

/// All numbers below a value, by the path that leads to them.
fn leaves(name: &str, value: &Json, numbers: &mut Numbers) -> Result<(), String> {
    let below = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Json::Number(number) => numbers.push((name.to_owned(), *number)),
        Json::Null => return Err(format!("holds no value of `{name}`; missing samples are not supported")),
        Json::Object(entries) if is_time(entries) => {}
        Json::Object(entries) => entries.iter().try_for_each(|(part, value)| leaves(&below(part), value, numbers))?,
        Json::List(list) => {
            let mut indexed = list.iter().enumerate();
            indexed.try_for_each(|(index, value)| leaves(&below(&index.to_string()), value, numbers))?;
        }
        Json::Truth | Json::Text(_) => {}
    }
    Ok(())
}

/// A time as Foxglove (`sec`, `nsec`) or ROS 2 (`sec`, `nanosec`) writes it.
fn is_time(entries: &[(String, Json)]) -> bool {
    matches!(entries, [(sec, _), (nsec, _)] if sec == "sec" && (nsec == "nsec" || nsec == "nanosec"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Result<Numbers, String> {
        parse(text.as_bytes())
    }

    fn named(pairs: &[(&str, f64)]) -> Result<Numbers, String> {
        Ok(pairs.iter().map(|&(name, value)| (name.to_owned(), value)).collect())
    }

    #[test]
    fn joints_go_by_their_names() {
        let foxglove = r#"{"timestamp":{"sec":1,"nsec":2},"joints":[{"name":"b","position":1,"velocity":9},{"name":"a","position":-0.5}]}"#;
        assert_eq!(numbers(foxglove), named(&[("b", 1.0), ("a", -0.5)]));
        let ros = r#"{"header":{"stamp":{"sec":1,"nanosec":2}},"name":["b","a"],"position":[1,2.5],"velocity":[],"effort":[]}"#;
        assert_eq!(numbers(ros), named(&[("b", 1.0), ("a", 2.5)]));
        assert_eq!(numbers(r#"{"joints":[{"name":"b"}]}"#), Err("holds no position of joint `b`".into()));
        assert_eq!(numbers(r#"{"joints":[{"position":1}]}"#), Err("holds a joint without a name".into()));
        assert_eq!(numbers(r#"{"name":["a"],"position":[]}"#), Err("holds 1 names, but 0 positions".into()));
        let twice = r#"{"joints":[{"name":"b","position":1},{"name":"b","position":2}]}"#;
        assert_eq!(numbers(twice), Err("holds `b` twice".into()));
    }

    #[test]
    fn numbers_go_by_the_path_that_leads_to_them() {
        let text = r#"{"z":{"b":1,"ok":true},"c":[2,[3]],"stamp":{"sec":1,"nsec":2},"text":"4"}"#;
        assert_eq!(numbers(text), named(&[("z.b", 1.0), ("c.0", 2.0), ("c.1.0", 3.0)]));
        assert_eq!(numbers(r#"{"a":1,"a":2}"#), Err("holds `a` twice".into()));
        assert_eq!(numbers("{}"), named(&[]));
        assert_eq!(numbers(r#"{"a":null}"#), Err("holds no value of `a`; missing samples are not supported".into()));
        assert!(numbers("[1]").unwrap_err().contains("no JSON object"));
        assert!(numbers("{").unwrap_err().starts_with("is not JSON: EOF"));
        assert!(numbers(&format!("{}1{}", "{\"a\":".repeat(200), "}".repeat(200))).unwrap_err().contains("recursion"));
    }
}
