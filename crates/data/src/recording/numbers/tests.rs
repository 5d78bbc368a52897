//! Messages as numbers by name.

use super::*;
use crate::recording::tree::{Number, from_json};

const JSON: Manner = Manner { brackets: false, truths: false, all: false };

fn of(text: &str, manner: Manner, field: Option<&str>) -> Result<Vec<(String, f64)>, String> {
    let mut numbers = Numbers::default();
    take(&from_json(text.as_bytes())?, manner, field, &mut numbers)?;
    assert_eq!(numbers.values.len(), numbers.discrete.len());
    Ok(numbers.names().map(str::to_owned).zip(numbers.values.iter().copied()).collect())
}

fn numbers(text: &str) -> Result<Vec<(String, f64)>, String> {
    of(text, JSON, None)
}

fn named(pairs: &[(&str, f64)]) -> Result<Vec<(String, f64)>, String> {
    Ok(pairs.iter().map(|&(name, value)| (name.to_owned(), value)).collect())
}

#[test]
fn joints_go_by_their_names() {
    let foxglove = r#"{"timestamp":{"sec":1,"nsec":2},"joints":[{"name":"b","position":1,"velocity":9},{"name":"a","position":-0.5}]}"#;
    assert_eq!(numbers(foxglove), named(&[("b", 1.0), ("a", -0.5)]));
    let ros =
        r#"{"header":{"stamp":{"sec":1,"nanosec":2}},"name":["b","a"],"position":[1,2.5],"velocity":[],"effort":[]}"#;
    assert_eq!(numbers(ros), named(&[("b", 1.0), ("a", 2.5)]));
    assert_eq!(numbers(r#"{"joints":[{"name":"b"}]}"#), Err("holds no position of joint `b`".into()));
    assert_eq!(numbers(r#"{"joints":[{"position":1}]}"#), Err("holds a joint without a name".into()));
    assert_eq!(numbers(r#"{"name":["a"],"position":[]}"#), Err("holds 1 names, but 0 positions".into()));
    assert_eq!(numbers(r#"{"name":[],"position":[]}"#), named(&[]));
}

#[test]
fn of_joints_the_first_quantity_that_is_there_is_taken_or_the_one_that_is_asked_for() {
    let wheels = r#"{"name":["l","r"],"position":[],"velocity":[1,2],"effort":[3,4]}"#;
    assert_eq!(numbers(wheels), named(&[("l", 1.0), ("r", 2.0)]));
    assert_eq!(of(wheels, JSON, Some("effort")), named(&[("l", 3.0), ("r", 4.0)]));
    assert_eq!(of(wheels, JSON, Some("position")), Err("holds 2 names, but 0 positions".into()));
    let all = of(wheels, Manner { all: true, ..JSON }, None);
    let expected =
        [("l", 1.0), ("r", 2.0), ("velocity.l", 1.0), ("velocity.r", 2.0), ("effort.l", 3.0), ("effort.r", 4.0)];
    assert_eq!(all, named(&expected));
    let list = r#"{"joints":[{"name":"l","velocity":1},{"name":"r","velocity":2}]}"#;
    assert_eq!(numbers(list), named(&[("l", 1.0), ("r", 2.0)]));
}

#[test]
fn numbers_go_by_the_path_that_leads_to_them() {
    let text = r#"{"z":{"b":1,"ok":true},"c":[2,[3]],"stamp":{"sec":1,"nsec":2},"text":"4"}"#;
    assert_eq!(numbers(text), named(&[("z.b", 1.0), ("c.0", 2.0), ("c.1.0", 3.0)]));
    let ros = Manner { brackets: true, truths: true, all: false };
    assert_eq!(of(text, ros, None), named(&[("z.b", 1.0), ("z.ok", 1.0), ("c[0]", 2.0), ("c[1][0]", 3.0)]));
    assert_eq!(of(text, JSON, Some("z")), named(&[("z.b", 1.0)]));
    assert_eq!(of(text, JSON, Some("z.q")), Err("holds no field `z.q`".into()));
    assert_eq!(numbers("{}"), named(&[]));
    let null = numbers(r#"{"a":null}"#).unwrap();
    assert!(null[0].0 == "a" && null[0].1.is_nan());
    assert!(numbers("[1]").unwrap_err().contains("no object"));
}

#[test]
fn things_go_by_their_names_and_what_is_no_movement_is_passed_over() {
    let tf = r#"{"transforms":[{"header":{"stamp":{"sec":1,"nanosec":0},"frame_id":"w"},"child_frame_id":"hand","transform":{"x":1}}]}"#;
    assert_eq!(numbers(tf), named(&[("transforms.hand.transform.x", 1.0)]));
    let controller = r#"{"joint_names":["a","b"],"feedback":{"positions":[1,2],"velocities":[]},"other":[7]}"#;
    let expected = [("feedback.positions.a", 1.0), ("feedback.positions.b", 2.0), ("other.0", 7.0)];
    assert_eq!(numbers(controller), named(&expected));
    let odd = r#"{"header":{"seq":3,"stamp":{"secs":1,"nsecs":0}},"layout":{"dim":[{"size":3}],"data_offset":0},"pose_covariance":[1],"data":[5]}"#;
    assert_eq!(numbers(odd), named(&[("data.0", 5.0)]));
    let all = of(odd, Manner { all: true, ..JSON }, None);
    assert_eq!(all, named(&[("pose_covariance.0", 1.0), ("data.0", 5.0)]));
}

#[test]
fn stamps_are_found_where_they_stand() {
    let of = |text: &str| stamp(&from_json(text.as_bytes()).unwrap());
    let second = Some(Stamp::Nanoseconds(1_000_000_002));
    assert_eq!(of(r#"{"header":{"stamp":{"sec":1,"nanosec":2}}}"#), second);
    assert_eq!(of(r#"{"x":1,"timestamp":{"sec":1,"nsec":2}}"#), second);
    assert_eq!(of(r#"{"transforms":[{"header":{"stamp":{"sec":1,"nanosec":2}}}]}"#), second);
    assert_eq!(of(r#"{"timestamp":1766147454233218075}"#), Some(Stamp::Whole(1_766_147_454_233_218_075)));
    assert_eq!(of(r#"{"Time":0.25}"#), Some(Stamp::Nanoseconds(250_000_000)));
    assert_eq!(of(r#"{"time_s":3}"#), Some(Stamp::Nanoseconds(3_000_000_000)));
    assert_eq!(of(r#"{"time":"now","x":1}"#), None);
    assert_eq!(of(r#"{"time":1e300}"#), None);
}

#[test]
fn names_and_numbers_have_a_bound() {
    let mut numbers = Numbers::default();
    let bytes = vec![0; 8 * MOST_NUMBERS + 8];
    let array = Tree::Array(Array { number: Number::Double, big: false, bytes: &bytes });
    let message = Tree::Object(vec![("data".into(), array)]);
    assert!(take(&message, JSON, None, &mut numbers).unwrap_err().contains("more than 65536 numbers"));
    let long = format!("{{\"{}\":[{}0]}}", "x".repeat(100_000), "0,".repeat(60_000));
    assert!(self::numbers(&long).unwrap_err().contains("4 MB"));
    // Deep and wide: a hundred long names above each of many numbers.
    let name = "y".repeat(1000);
    let deep = format!("{}[{}0]{}", format!("{{\"{name}\":").repeat(100), "0,".repeat(60_000), "}".repeat(100));
    assert!(self::numbers(&deep).unwrap_err().contains("4 MB"));
}
