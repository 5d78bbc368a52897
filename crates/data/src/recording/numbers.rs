//! A message as numbers by name, and the stamp it carries.
//!
//! | message | names | values |
//! |---|---|---|
//! | `joints: [{name: elbow, position: 0.1, ...}, ...]`, as `foxglove.JointStates` | of the joints | see below |
//! | `name: [elbow, ...], position: [0.1, ...], ...`, as ROS' `JointState` | of the joints | see below |
//! | lists beside `joint_names: [elbow, ...]` | `feedback.positions.elbow` | all numbers |
//! | lists of things with a `name` or `child_frame_id` | `transforms.hand.transform.translation.x` | all numbers |
//! | anything else | `arm.elbow`, `touch[0]` (in JSON `touch.0`) | all numbers |
//!
//! Of joints the positions are taken, else the velocities, else the efforts: the first that the message holds. Text, times,
//! headers, the layout of an array and covariances are passed over; covariances, and the other quantities of joints
//! (`velocity.elbow`), are there for who asks for them.

use super::tree::{Array, Tree};

/// Most numbers that one message may hold.
pub const MOST_NUMBERS: usize = 1 << 16;
/// Most bytes of all names of one message.
const MOST_NAME_BYTES: usize = 4 << 20;

/// What is taken of joints, the first that is there.
pub const QUANTITIES: [&str; 3] = ["position", "velocity", "effort"];
/// Lists of names that go with lists of numbers beside them.
const NAME_LISTS: [&str; 4] = ["name", "names", "joint_names", "interface_names"];
/// What tells the things of a list apart.
const NAMES_OF_THINGS: [&str; 2] = ["name", "child_frame_id"];
/// Names of a clock in a message, if it stands at the top.
const CLOCKS: [&str; 16] = [
    "timestamp",
    "time",
    "stamp",
    "t",
    "ts",
    "timestamp_ns",
    "timestamp_us",
    "timestamp_ms",
    "timestamp_s",
    "time_ns",
    "time_us",
    "time_ms",
    "time_s",
    "stamp_ns",
    "unix_time",
    "time_stamp",
];

/// How messages of an encoding are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Manner {
    /// Whether entries of lists are called `touch[0]`, not `touch.0`.
    pub brackets: bool,
    /// Whether truth values are numbers.
    pub truths: bool,
    /// Whether everything is taken that could be asked for.
    pub all: bool,
}

/// Numbers of a message, in its order. Made once and filled again for each message.
#[derive(Debug, Default)]
pub struct Numbers {
    names: String,
    ends: Vec<usize>,
    /// The values.
    pub values: Vec<f64>,
    /// For each value, whether what lies between two of its kind makes no sense.
    pub discrete: Vec<bool>,
    /// Which of [`QUANTITIES`] the joints have.
    pub quantity: Option<u8>,
}

impl Numbers {
    /// The names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.names[start..end])
    }

    /// What two messages have in common whose values have the same names and meanings.
    pub fn shape(&self) -> Shape<'_> {
        Shape { names: &self.names, ends: &self.ends, quantity: self.quantity }
    }

    fn clear(&mut self) {
        self.names.clear();
        self.ends.clear();
        self.values.clear();
        self.discrete.clear();
        self.quantity = None;
    }

    fn push(&mut self, name: &str, value: f64, discrete: bool) -> Result<(), String> {
        self.push_parts(&[name], value, discrete)
    }

    /// A value whose name has several parts.
    fn push_parts(&mut self, name: &[&str], value: f64, discrete: bool) -> Result<(), String> {
        let length: usize = name.iter().map(|part| part.len()).sum();
        if self.values.len() == MOST_NUMBERS {
            return Err(format!("holds more than {MOST_NUMBERS} numbers"));
        }
        if self.names.len() + length > MOST_NAME_BYTES {
            return Err(format!("holds numbers whose names fill more than {} MB", MOST_NAME_BYTES >> 20));
        }
        name.iter().for_each(|part| self.names.push_str(part));
        self.ends.push(self.names.len());
        self.values.push(value);
        self.discrete.push(discrete);
        Ok(())
    }
}

/// Names and meanings of a message's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape<'a> {
    names: &'a str,
    ends: &'a [usize],
    quantity: Option<u8>,
}

/// A shape that is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnedShape {
    names: Box<str>,
    ends: Box<[usize]>,
    quantity: Option<u8>,
}

impl Shape<'_> {
    /// Whether it is `other`.
    pub fn is(&self, other: &OwnedShape) -> bool {
        self.quantity == other.quantity && *self.ends == *other.ends && *self.names == *other.names
    }

    /// A number that is nearly always another for other names.
    pub fn key(&self) -> u64 {
        const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
        let (words, rest) = self.names.as_bytes().as_chunks::<8>();
        let start = (self.ends.len() as u64) << 8 | u64::from(self.quantity.unwrap_or(u8::MAX));
        let mix = |key: u64, word: u64| {
            let key = (key ^ word).wrapping_mul(FACTOR);
            key ^ key >> 29
        };
        let key = words.iter().fold(start, |key, &word| mix(key, u64::from_le_bytes(word)));
        rest.iter().fold(key, |key, &byte| mix(key, u64::from(byte)))
    }

    /// A copy.
    pub fn to_owned(self) -> OwnedShape {
        OwnedShape { names: self.names.into(), ends: self.ends.into(), quantity: self.quantity }
    }

    /// Bytes of a copy.
    pub fn bytes(&self) -> usize {
        self.names.len() + size_of_val(self.ends) + size_of::<OwnedShape>()
    }
}

/// Takes the numbers out of a message; with a field, only those below it, e.g. `velocity` or `pose.pose.position`.
///
/// # Errors
/// What is wrong with it, as the end of a sentence.
pub fn take(message: &Tree<'_>, manner: Manner, field: Option<&str>, numbers: &mut Numbers) -> Result<(), String> {
    numbers.clear();
    let Tree::Object(_) = message else { return Err("is no object with named entries".to_owned()) };
    let mut walk = Walk { manner, numbers, path: String::new(), wanted: None };
    walk.wanted = field.and_then(|field| QUANTITIES.iter().position(|quantity| *quantity == field));
    if walk.joint_list(message)? || walk.joint_lists(message)? {
        return Ok(());
    }
    walk.wanted = None;
    match field {
        None => walk.leaves(message, None),
        Some(field) => walk.below(message, field),
    }
}

struct Walk<'n> {
    manner: Manner,
    numbers: &'n mut Numbers,
    path: String,
    /// The quantity of joints that is asked for.
    wanted: Option<usize>,
}

impl Walk<'_> {
    /// Joints in a list, each with its name and quantities.
    fn joint_list(&mut self, message: &Tree<'_>) -> Result<bool, String> {
        let Some(list) = message.get("joints").and_then(Tree::list) else { return Ok(false) };
        // Numbers without names, or names without numbers, are no joints in this sense.
        if !list.iter().all(|joint| matches!(joint, Tree::Object(_))) {
            return Ok(false);
        }
        let has = |quantity: &str| list.iter().any(|joint| joint.get(quantity).and_then(Tree::number).is_some());
        let first = self.wanted.or_else(|| QUANTITIES.iter().position(|quantity| has(quantity))).unwrap_or(0);
        self.numbers.quantity = Some(first as u8);
        for joint in list {
            let name = joint.get("name").and_then(Tree::text).ok_or("holds a joint without a name")?;
            let value = joint.get(QUANTITIES[first]).and_then(Tree::number);
            let value = value.ok_or_else(|| format!("holds no {} of joint `{name}`", QUANTITIES[first]))?;
            self.numbers.push(name, value, false)?;
            if self.manner.all {
                for quantity in QUANTITIES {
                    if let Some(value) = joint.get(quantity).and_then(Tree::number) {
                        self.numbers.push_parts(&[quantity, ".", name], value, false)?;
                    }
                }
            }
        }
        Ok(true)
    }

    /// A list of names beside lists of quantities.
    fn joint_lists(&mut self, message: &Tree<'_>) -> Result<bool, String> {
        let Some(names) = message.get("name").and_then(Tree::list) else { return Ok(false) };
        let lists = QUANTITIES.map(|quantity| message.get(quantity).and_then(Values::of));
        if lists.iter().all(Option::is_none) {
            return Ok(false);
        }
        let filled = |list: &Option<Values<'_>>| list.as_ref().is_some_and(|values| values.len() > 0);
        let first = self.wanted.or_else(|| lists.iter().position(filled)).unwrap_or(0);
        let count = lists[first].as_ref().map_or(0, Values::len);
        if count != names.len() {
            let plural = ["positions", "velocities", "efforts"][first];
            return Err(format!("holds {} names, but {count} {plural}", names.len()));
        }
        self.numbers.quantity = Some(first as u8);
        for name in names {
            let name = name.text().ok_or("holds a joint without a name")?;
            self.numbers.push(name, 0.0, false)?;
        }
        if let Some(values) = &lists[first] {
            self.numbers.values.clear();
            let missing = values.append_to(&mut self.numbers.values);
            if let Some(index) = missing {
                let name = names[index].text().unwrap_or_default();
                return Err(format!("holds no {} of joint `{name}`", QUANTITIES[first]));
            }
        }
        if self.manner.all {
            for (quantity, values) in QUANTITIES.iter().zip(&lists) {
                let Some(values) = values.as_ref().filter(|values| values.len() == names.len()) else { continue };
                let mut read = Vec::with_capacity(values.len());
                if values.append_to(&mut read).is_none() {
                    for (name, value) in names.iter().zip(read) {
                        self.numbers.push_parts(&[quantity, ".", name.text().unwrap_or_default()], value, false)?;
                    }
                }
            }
        }
        Ok(true)
    }

    /// The numbers below a field.
    fn below(&mut self, message: &Tree<'_>, field: &str) -> Result<(), String> {
        let mut at = message;
        for part in field.split('.') {
            at = at.get(part).ok_or_else(|| format!("holds no field `{field}`"))?;
        }
        self.path.push_str(field);
        let keys = names_beside(message);
        self.leaves(at, keys)
    }

    /// All numbers below a value, by the path that leads to them. `keys` are names of the entries of lists.
    fn leaves(&mut self, value: &Tree<'_>, keys: Option<&[Tree<'_>]>) -> Result<(), String> {
        match value {
            Tree::Number(number) => self.numbers.push(&self.path, *number, false),
            Tree::Whole(whole) => self.numbers.push(&self.path, *whole as f64, self.manner.brackets),
            Tree::Null => self.numbers.push(&self.path, f64::NAN, false),
            Tree::Truth(truth) if self.manner.truths => self.numbers.push(&self.path, f64::from(*truth), true),
            Tree::Truth(_) | Tree::Text(_) => Ok(()),
            Tree::Object(entries) => {
                if time_of(value).is_some() {
                    return Ok(());
                }
                let keys = names_beside(value).or(keys);
                entries.iter().try_for_each(|(name, value)| match self.is_taken(name, value) {
                    true => self.down(Step::Name(name), |walk| walk.leaves(value, keys)),
                    false => Ok(()),
                })
            }
            Tree::List(list) => {
                let keys = keys.filter(|keys| keys.len() == list.len() && keys.iter().all(|key| key.text().is_some()));
                list.iter().enumerate().try_for_each(|(index, value)| {
                    let own = || NAMES_OF_THINGS.iter().find_map(|name| value.get(name)?.text());
                    let key = keys.and_then(|keys| keys[index].text()).or_else(own);
                    self.down(key.map_or(Step::Index(index), Step::Name), |walk| walk.leaves(value, None))
                })
            }
            Tree::Array(array) => {
                if array.len() > MOST_NUMBERS {
                    return Err(format!("holds more than {MOST_NUMBERS} numbers"));
                }
                let keys = keys.filter(|keys| keys.len() == array.len());
                let discrete = array.number.is_discrete();
                array.values().enumerate().try_for_each(|(index, value)| {
                    let key = keys.and_then(|keys| keys[index].text());
                    self.down(key.map_or(Step::Index(index), Step::Name), |walk| {
                        walk.numbers.push(&walk.path, value, discrete)
                    })
                })
            }
        }
    }

    fn is_taken(&self, name: &str, value: &Tree<'_>) -> bool {
        match name {
            "header" => stamp_in_header(value).is_none(),
            "layout" => value.get("dim").is_none(),
            _ => self.manner.all || !name.ends_with("covariance"),
        }
    }

    fn down<R>(&mut self, step: Step<'_>, inside: impl FnOnce(&mut Self) -> R) -> R {
        let length = self.path.len();
        match step {
            Step::Name(name) => {
                if length > 0 {
                    self.path.push('.');
                }
                self.path.push_str(name);
            }
            Step::Index(index) if self.manner.brackets => {
                self.path.push('[');
                push_number(&mut self.path, index);
                self.path.push(']');
            }
            Step::Index(index) => {
                if length > 0 {
                    self.path.push('.');
                }
                push_number(&mut self.path, index);
            }
        }
        let result = inside(self);
        self.path.truncate(length);
        result
    }
}

enum Step<'a> {
    Name(&'a str),
    Index(usize),
}

fn push_number(text: &mut String, number: usize) {
    use std::fmt::Write;
    // Writing to a string cannot fail.
    let _ = write!(text, "{number}");
}

/// The names that stand beside lists of numbers.
fn names_beside<'t, 'm>(object: &'t Tree<'m>) -> Option<&'t [Tree<'m>]> {
    NAME_LISTS.iter().find_map(|name| object.get(name)?.list()).filter(|names| !names.is_empty())
}

/// Numbers of a list, however they are held.
enum Values<'t> {
    Array(Array<'t>),
    List(&'t [Tree<'t>]),
}

impl<'t> Values<'t> {
    fn of(tree: &'t Tree<'t>) -> Option<Self> {
        match tree {
            Tree::Array(array) => Some(Self::Array(*array)),
            Tree::List(list) => Some(Self::List(list)),
            _ => None,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Array(array) => array.len(),
            Self::List(list) => list.len(),
        }
    }

    /// Appends the values, up to one that is no number: its index.
    fn append_to(&self, values: &mut Vec<f64>) -> Option<usize> {
        match self {
            Self::Array(array) => array.append_to(values),
            Self::List(list) => {
                for (index, value) in list.iter().enumerate() {
                    let Some(value) = value.number() else { return Some(index) };
                    values.push(value);
                }
            }
        }
        None
    }
}

/// When a message says that it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamp {
    /// In nanoseconds.
    Nanoseconds(i64),
    /// A whole number of a unit that nobody names.
    Whole(i64),
}

/// The stamp of a message: of its header, its `timestamp`, or the header of the first thing in it.
pub fn stamp(message: &Tree<'_>) -> Option<Stamp> {
    let Tree::Object(entries) = message else { return None };
    if let Some(time) = message.get("header").and_then(stamp_in_header) {
        return Some(Stamp::Nanoseconds(time));
    }
    for (name, value) in entries.iter().filter(|(name, _)| is_clock(name)) {
        if let Some(time) = time_of(value) {
            return Some(Stamp::Nanoseconds(time));
        }
        match value {
            Tree::Whole(whole) if !name.ends_with("_s") => return Some(Stamp::Whole(*whole)),
            Tree::Whole(_) | Tree::Number(_) => {
                let seconds = value.number().filter(|seconds| seconds.abs() < 9e9)?;
                return Some(Stamp::Nanoseconds((seconds * 1e9).round() as i64));
            }
            _ => {}
        }
    }
    // A list of stamped things, as tf2's.
    let first = entries.first().and_then(|(_, value)| value.list()).and_then(<[Tree<'_>]>::first);
    first.and_then(|thing| thing.get("header")).and_then(stamp_in_header).map(Stamp::Nanoseconds)
}

/// Whether a value of this name at the top of a message tells the time, if it grows.
pub fn is_clock(name: &str) -> bool {
    CLOCKS.iter().any(|clock| name.eq_ignore_ascii_case(clock))
}

fn stamp_in_header(header: &Tree<'_>) -> Option<i64> {
    header.get("stamp").and_then(time_of)
}

/// A time as Foxglove (`sec`, `nsec`), ROS 2 (`sec`, `nanosec`), ROS 1 or protobuf write it, in nanoseconds.
fn time_of(value: &Tree<'_>) -> Option<i64> {
    let Tree::Object(entries) = value else { return None };
    let [(seconds, whole), (rest, part)] = entries.as_slice() else { return None };
    let names = [("sec", "nsec"), ("sec", "nanosec"), ("secs", "nsecs"), ("seconds", "nanos")];
    if !names.contains(&(seconds, rest)) {
        return None;
    }
    let (whole, part) = (whole.whole().unwrap_or(0), part.whole().unwrap_or(0));
    Some(whole.saturating_mul(1_000_000_000).saturating_add(part))
}

#[cfg(test)]
mod tests;
