//! The numbers of one topic's messages, kept as they come: messages that hold the same names side by side in one track.
//!
//! Several programs may publish on one topic, each with some of the names, each in an order of its own: names decide.

use std::collections::HashMap;
use std::rc::Rc;

use super::message::{Message, Trouble};
use super::numbers::{MOST_NUMBERS, Manner, Numbers, OwnedShape, QUANTITIES, Stamp, is_clock, stamp, take};
use super::tree::Tree;
use crate::budget::Budget;

/// Messages may hold so many different sets of names; beyond them each name has a track of its own.
const MOST_TRACKS: usize = 64;
/// Bytes of all shapes that are remembered.
const MOST_SHAPE_BYTES: usize = 1 << 20;
/// A message without a stamp.
pub const NO_STAMP: i64 = i64::MIN;

/// What one name stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The name, as it is in the messages or as it was asked for.
    pub name: String,
    /// Whether what lies between two values makes no sense.
    pub discrete: bool,
    /// Which quantity of a joint it is.
    pub quantity: Option<u8>,
    /// Whether it may be a clock, by its name.
    pub clock: bool,
}

/// Messages that hold the same names.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Track {
    /// Which columns they hold.
    pub columns: Rc<[u32]>,
    /// When they were logged.
    pub logged: Vec<i64>,
    /// When they were published; empty if always when they were logged.
    pub published: Vec<i64>,
    /// When they were made, or [`NO_STAMP`]; empty if nothing tells it.
    pub stamps: Vec<i64>,
    /// Messages x columns.
    pub values: Vec<f64>,
}

/// How a message's values go to a track.
#[derive(Debug)]
struct Part {
    track: usize,
    /// For each column of the track, which value of the message it is.
    order: Box<[u32]>,
    /// Whether these are all values as they stand.
    straight: bool,
}

/// A shape that was met, and where its values go.
#[derive(Debug)]
struct Known {
    shape: OwnedShape,
    parts: Vec<Part>,
}

/// What is collected of a topic.
#[derive(Debug)]
pub struct Collecting {
    /// The field below which numbers are taken.
    field: Option<String>,
    /// Names that are wanted, as [`canonical`] ones, and how they were written. None: all.
    wanted: Option<HashMap<String, String>>,
    /// The names.
    pub columns: Vec<Column>,
    /// The messages.
    pub tracks: Vec<Track>,
    /// Names that could be had: of the first message, when some are wanted.
    pub available: Vec<String>,
    /// Whether the stamps are numbers of an unknown unit.
    pub whole_stamps: bool,
    /// Messages without any numbers that are wanted.
    pub empty: usize,
    places: HashMap<String, u32>,
    tracks_by_columns: HashMap<Rc<[u32]>, usize>,
    /// Shapes by their keys, which two may share: the latest then stays.
    shapes: HashMap<u64, Rc<Known>>,
    shape_bytes: usize,
    last: Option<Rc<Known>>,
    numbers: Numbers,
}

impl Collecting {
    /// Nothing yet. `wanted` are names in the messages, and what they are to be called.
    pub fn new(field: Option<&str>, wanted: Option<Vec<(String, String)>>) -> Self {
        let wanted = wanted.map(|names| names.into_iter().map(|(name, asked)| (canonical(&name), asked)).collect());
        Self {
            field: field.map(str::to_owned),
            wanted,
            columns: Vec::new(),
            tracks: Vec::new(),
            available: Vec::new(),
            whole_stamps: false,
            empty: 0,
            places: HashMap::new(),
            tracks_by_columns: HashMap::new(),
            shapes: HashMap::new(),
            shape_bytes: 0,
            last: None,
            numbers: Numbers::default(),
        }
    }

    /// Whether everything is looked at that could be asked for.
    pub fn takes_all(&self) -> bool {
        self.wanted.is_some()
    }

    /// How many numbers the last message held.
    pub fn taken(&self) -> usize {
        self.numbers.values.len()
    }

    /// Takes the numbers of a message.
    ///
    /// # Errors
    /// What is wrong with it, as the end of a sentence, inside of a result for what is beyond a message.
    pub fn take(
        &mut self,
        message: &Message<'_>,
        tree: &Tree<'_>,
        manner: Manner,
        budget: &Budget,
    ) -> Result<Result<(), String>, Trouble> {
        let mut numbers = std::mem::take(&mut self.numbers);
        let outcome = match take(tree, manner, self.field.as_deref(), &mut numbers) {
            Ok(()) => self.add(message, tree, &numbers, budget),
            Err(why) => Ok(Err(why)),
        };
        self.numbers = numbers;
        outcome
    }

    fn add(
        &mut self,
        message: &Message<'_>,
        tree: &Tree<'_>,
        numbers: &Numbers,
        budget: &Budget,
    ) -> Result<Result<(), String>, Trouble> {
        let known = match self.parts(numbers, budget)? {
            Ok(known) => known,
            Err(why) => return Ok(Err(why)),
        };
        self.empty += usize::from(known.parts.is_empty());
        let stamp = match stamp(tree) {
            Some(Stamp::Nanoseconds(time)) => time,
            Some(Stamp::Whole(time)) => {
                self.whole_stamps = true;
                time
            }
            None => NO_STAMP,
        };
        for part in &known.parts {
            budget.take_values::<f64>(part.order.len() + 3)?;
            let track = &mut self.tracks[part.track];
            if track.logged.is_empty() {
                track.expect(message.expected, stamp, budget);
            }
            let start = track.values.len();
            if part.straight {
                track.values.extend_from_slice(&numbers.values);
            } else {
                track.values.extend(part.order.iter().map(|&place| numbers.values[place as usize]));
            }
            if let Some(index) = track.values[start..].iter().position(|value| value.is_infinite()) {
                let name = &self.columns[track.columns[index] as usize].name;
                return Ok(Err(format!("holds `{name}` as {}", track.values[start + index])));
            }
            track.add_times(message, stamp);
        }
        Ok(Ok(()))
    }

    /// Where the values of a message go.
    fn parts(&mut self, numbers: &Numbers, budget: &Budget) -> Result<Result<Rc<Known>, String>, Trouble> {
        let shape = numbers.shape();
        if let Some(last) = &self.last
            && shape.is(&last.shape)
        {
            return Ok(Ok(Rc::clone(last)));
        }
        let key = shape.key();
        if let Some(known) = self.shapes.get(&key)
            && shape.is(&known.shape)
        {
            let known = Rc::clone(known);
            self.last = Some(Rc::clone(&known));
            return Ok(Ok(known));
        }
        let parts = match self.new_shape(numbers, budget)? {
            Ok(parts) => parts,
            Err(why) => return Ok(Err(why)),
        };
        let known = Rc::new(Known { shape: shape.to_owned(), parts });
        // The orders of its parts count too.
        let bytes = shape.bytes() + 8 * numbers.values.len();
        if self.shape_bytes + bytes > MOST_SHAPE_BYTES {
            self.shapes.clear();
            self.shape_bytes = 0;
        }
        if bytes <= MOST_SHAPE_BYTES {
            self.shape_bytes += bytes;
            self.shapes.insert(key, Rc::clone(&known));
        }
        self.last = Some(Rc::clone(&known));
        Ok(Ok(known))
    }

    /// Takes columns out.
    pub fn remove(&mut self, gone: &[bool]) {
        let mut places = Vec::with_capacity(gone.len());
        let mut kept = 0;
        for &gone in gone {
            places.push(kept);
            kept += u32::from(!gone);
        }
        for track in &mut self.tracks {
            let stays: Vec<bool> = track.columns.iter().map(|&column| !gone[column as usize]).collect();
            let mut stay = stays.iter().cycle();
            track.values.retain(|_| stay.next() == Some(&true));
            let columns = track.columns.iter().filter(|&&column| !gone[column as usize]);
            track.columns = columns.map(|&column| places[column as usize]).collect();
        }
        self.tracks.retain(|track| !track.columns.is_empty());
        let mut gone = gone.iter();
        self.columns.retain(|_| gone.next() == Some(&false));
    }

    /// Finds columns and tracks for names in an order that was not met before.
    fn new_shape(&mut self, numbers: &Numbers, budget: &Budget) -> Result<Result<Vec<Part>, String>, Trouble> {
        // Pairs of column and value.
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(numbers.values.len());
        if self.wanted.is_some() && self.available.len() < numbers.values.len() {
            // What was taken of joints goes by their names alone.
            let taken = numbers.quantity.map_or("", |quantity| QUANTITIES[usize::from(quantity)]);
            let again =
                |name: &&str| !taken.is_empty() && name.strip_prefix(taken).is_some_and(|rest| rest.starts_with('.'));
            self.available = numbers.names().filter(|name| !again(name)).take(1000).map(str::to_owned).collect();
        }
        for (place, name) in numbers.names().enumerate() {
            let column = match (self.places.get(name), &self.wanted) {
                (Some(&column), _) => column,
                (None, Some(wanted)) => match wanted.get(&canonical(name)) {
                    Some(asked) => {
                        let asked = asked.clone();
                        self.new_column(name, asked, false, budget)?
                    }
                    None => continue,
                },
                (None, None) => self.new_column(name, name.to_owned(), is_clock(name), budget)?,
            };
            let known = &mut self.columns[column as usize];
            known.discrete &= numbers.discrete[place];
            // `velocity.elbow` says itself what it is.
            let tells = |quantity: &str| name.strip_prefix(quantity).is_some_and(|rest| rest.starts_with('.'));
            let quantity = numbers.quantity.filter(|_| !QUANTITIES.into_iter().any(tells));
            if known.quantity.is_none() {
                known.quantity = quantity;
            } else if known.quantity != quantity {
                let said =
                    |quantity: Option<u8>| quantity.map_or("value", |quantity| QUANTITIES[usize::from(quantity)]);
                return Ok(Err(format!(
                    "holds the {} of `{name}`, but messages before it the {}",
                    said(numbers.quantity),
                    said(known.quantity)
                )));
            }
            pairs.push((column, place as u32));
        }
        if self.columns.len() > MOST_NUMBERS {
            return Ok(Err(format!("is the one with which there are more than {MOST_NUMBERS} different names")));
        }
        pairs.sort_unstable();
        if let Some(pair) = pairs.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Ok(Err(format!("holds `{}` twice", self.columns[pair[0].0 as usize].name)));
        }
        if pairs.is_empty() {
            return Ok(Ok(Vec::new()));
        }
        let columns: Rc<[u32]> = pairs.iter().map(|pair| pair.0).collect();
        let order: Box<[u32]> = pairs.iter().map(|pair| pair.1).collect();
        let known = self.tracks_by_columns.get(&columns).copied();
        if known.is_some() || self.tracks.len() < MOST_TRACKS {
            let straight = order.len() == numbers.values.len() && order.is_sorted();
            let track = known.map_or_else(|| self.track(columns, budget), Ok)?;
            return Ok(Ok(vec![Part { track, order, straight }]));
        }
        let mut alone = Vec::with_capacity(pairs.len());
        for (column, place) in pairs {
            let track = self.track(Rc::new([column]), budget)?;
            alone.push(Part { track, order: Box::new([place]), straight: false });
        }
        Ok(Ok(alone))
    }

    fn new_column(&mut self, found: &str, name: String, clock: bool, budget: &Budget) -> Result<u32, Trouble> {
        budget.take(2 * found.len() + name.len() + 200)?;
        let column = self.columns.len() as u32;
        self.places.insert(found.to_owned(), column);
        self.columns.push(Column { name, discrete: true, quantity: None, clock });
        Ok(column)
    }

    fn track(&mut self, columns: Rc<[u32]>, budget: &Budget) -> Result<usize, Trouble> {
        if let Some(&track) = self.tracks_by_columns.get(&columns) {
            return Ok(track);
        }
        budget.take(4 * columns.len() + 300)?;
        let track = self.tracks.len();
        self.tracks_by_columns.insert(Rc::clone(&columns), track);
        self.tracks.push(Track { columns, ..Track::default() });
        Ok(track)
    }
}

impl Track {
    /// The messages between the times at which sequences begin: with the number of the begins before them.
    pub fn cut(self, begins: &[(i64, String)]) -> Vec<(usize, Self)> {
        let mut parts: Vec<(usize, Self)> = Vec::new();
        let mut order: Vec<usize> = (0..self.logged.len()).collect();
        order.sort_by_key(|&index| self.logged[index]);
        let width = self.columns.len();
        let mut section = 0;
        for index in order {
            while begins.get(section).is_some_and(|(begin, _)| *begin <= self.logged[index]) {
                section += 1;
            }
            if parts.last().is_none_or(|(last, _)| *last != section) {
                parts.push((section, Self { columns: Rc::clone(&self.columns), ..Self::default() }));
            }
            let Some((_, part)) = parts.last_mut() else { continue };
            part.logged.push(self.logged[index]);
            part.published.extend(self.published.get(index));
            part.stamps.extend(self.stamps.get(index));
            part.values.extend_from_slice(&self.values[index * width..(index + 1) * width]);
        }
        parts
    }

    /// Makes room for as many messages as the file tells of, if that is in proportion to it: no more is then ever held.
    fn expect(&mut self, messages: u64, stamp: i64, budget: &Budget) {
        let width = self.columns.len();
        let Ok(messages) = usize::try_from(messages) else { return };
        let values = messages.saturating_mul(width);
        // A four-hundredth of what the file may be turned into is some times its size.
        let bytes = 8_u64.saturating_mul((values as u64).saturating_add(messages as u64));
        if bytes <= budget.left() / 400 {
            self.values.reserve_exact(values);
            self.logged.reserve_exact(messages);
            self.stamps.reserve_exact(if stamp == NO_STAMP { 0 } else { messages });
        }
    }

    fn add_times(&mut self, message: &Message<'_>, stamp: i64) {
        let before = self.logged.len();
        self.logged.push(message.logged);
        if message.published != message.logged && self.published.is_empty() {
            self.published.extend_from_slice(&self.logged[..before]);
        }
        if message.published != message.logged || !self.published.is_empty() {
            self.published.push(message.published);
        }
        if stamp != NO_STAMP && self.stamps.is_empty() {
            self.stamps.resize(before, NO_STAMP);
        }
        if stamp != NO_STAMP || !self.stamps.is_empty() {
            self.stamps.push(stamp);
        }
    }
}

/// A name in which `data[3]` and `data.3` are the same.
pub fn canonical(name: &str) -> String {
    let mut plain = String::with_capacity(name.len());
    let mut rest = name;
    while let Some((before, after)) = rest.split_once('[') {
        plain.push_str(before);
        match after.split_once(']') {
            Some((index, after)) if !index.is_empty() && index.bytes().all(|byte| byte.is_ascii_digit()) => {
                plain.push('.');
                plain.push_str(index);
                rest = after;
            }
            _ => {
                plain.push('[');
                rest = after;
            }
        }
    }
    plain.push_str(rest);
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::message::Channel;
    use crate::recording::tree::from_json;

    const JSON: Manner = Manner { brackets: false, truths: false, all: false };

    fn add(collecting: &mut Collecting, time: i64, text: &str) -> Result<(), String> {
        let channel = Rc::new(Channel::default());
        let message = Message { channel: &channel, logged: time, published: time, number: 1, expected: 0, data: &[] };
        let manner = Manner { all: collecting.takes_all(), ..JSON };
        let tree = from_json(text.as_bytes()).unwrap();
        collecting.take(&message, &tree, manner, &Budget::of(1 << 30)).unwrap()
    }

    #[test]
    fn names_decide_whatever_their_order() {
        let mut all = Collecting::new(None, None);
        add(&mut all, 1, r#"{"name":["a","b"],"position":[1,2]}"#).unwrap();
        add(&mut all, 2, r#"{"name":["b","a"],"position":[3,4]}"#).unwrap();
        add(&mut all, 3, r#"{"name":["c"],"position":[5]}"#).unwrap();
        add(&mut all, 4, r#"{"name":[],"position":[]}"#).unwrap();
        assert_eq!(all.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>(), ["a", "b", "c"]);
        assert_eq!((&all.tracks[0].values[..], &all.tracks[0].logged[..]), (&[1.0, 2.0, 4.0, 3.0][..], &[1, 2][..]));
        assert_eq!((&all.tracks[1].values[..], all.empty), (&[5.0][..], 1));
        assert_eq!(add(&mut all, 5, r#"{"name":["a","a"],"position":[1,2]}"#), Err("holds `a` twice".into()));
        let velocity = add(&mut all, 5, r#"{"name":["a"],"velocity":[1]}"#);
        assert_eq!(velocity, Err("holds the velocity of `a`, but messages before it the position".into()));
    }

    #[test]
    fn only_what_is_wanted_is_kept() {
        let mut some =
            Collecting::new(None, Some(vec![("velocity.b".into(), "b".into()), ("x[1]".into(), "x1".into())]));
        add(&mut some, 1, r#"{"name":["a","b"],"position":[1,2],"velocity":[3,4]}"#).unwrap();
        assert_eq!((some.columns[0].name.as_str(), &some.tracks[0].values[..]), ("b", &[4.0][..]));
        assert_eq!(some.available, ["a", "b", "velocity.a", "velocity.b"]);
        add(&mut some, 1, r#"{"x":[1,2]}"#).unwrap();
        assert_eq!((some.columns[1].name.as_str(), &some.tracks[1].values[..]), ("x1", &[2.0][..]));
    }

    #[test]
    fn thousands_of_sets_of_names_need_no_thousands_of_tracks() {
        let mut all = Collecting::new(None, None);
        let mut held = 0;
        for k in 1_u32..2000 {
            let names: Vec<_> = (0..11).filter(|bit| k >> bit & 1 == 1).map(|bit| format!("\"n{bit}\":{k}")).collect();
            held += names.len();
            add(&mut all, i64::from(k), &format!("{{{}}}", names.join(","))).unwrap();
        }
        assert!(all.tracks.len() <= MOST_TRACKS + 11, "{}", all.tracks.len());
        assert_eq!(all.tracks.iter().map(|track| track.values.len()).sum::<usize>(), held);
    }

    #[test]
    fn indices_in_brackets_and_behind_points_are_the_same() {
        for (name, plain) in
            [("data[3]", "data.3"), ("a[0].b[12]", "a.0.b.12"), ("a[x]", "a[x]"), ("a[", "a["), ("", "")]
        {
            assert_eq!(canonical(name), plain);
        }
    }
}
