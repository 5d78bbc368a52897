//! CDR against a writer of its own: every kind of field, both orders of bytes, random and damaged messages.

use super::cdr;
use super::definition::{Count, Definition, Part};
use crate::recording::tree::{Number, Tree};

/// Numbers that are the same in every run.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % below
    }
}

/// Writes CDR by a definition, with random contents, and the numbers that should be read.
struct Writer {
    bytes: Vec<u8>,
    big: bool,
    widest: usize,
    dice: Dice,
    expected: Vec<f64>,
}

impl Writer {
    fn align(&mut self, size: usize) {
        while !(self.bytes.len() - 4).is_multiple_of(size.min(self.widest)) {
            self.bytes.push(0xcd);
        }
    }

    fn put(&mut self, little: &[u8]) {
        self.align(little.len());
        if self.big { self.bytes.extend(little.iter().rev()) } else { self.bytes.extend(little) }
    }

    fn object(&mut self, definition: &Definition, of: usize) {
        for (_, part, count) in &definition.types[of].fields {
            let times = match count {
                Count::One => 1,
                Count::Fixed(count) => *count,
                Count::Counted(bound) => {
                    let count = self.dice.roll(bound.unwrap_or(4) + 1);
                    self.put(&(count as u32).to_le_bytes());
                    count
                }
            };
            for _ in 0..times {
                self.one(definition, *part);
            }
        }
    }

    fn one(&mut self, definition: &Definition, part: Part) {
        let roll = self.dice.roll(200) as i64 - 100;
        let number = |value: f64, writer: &mut Self| writer.expected.push(value);
        match part {
            Part::Number(Number::Bool) => {
                self.put(&[u8::from(roll > 0)]);
                number(f64::from(roll > 0), self);
            }
            Part::Number(Number::Single) => {
                self.put(&(roll as f32 / 4.0).to_le_bytes());
                number(roll as f64 / 4.0, self);
            }
            Part::Number(Number::Double) => {
                self.put(&(roll as f64 / 3.0).to_le_bytes());
                number(roll as f64 / 3.0, self);
            }
            Part::Number(Number::Quadruple) => {
                self.align(16);
                self.bytes.extend([0; 16]);
                number(f64::NAN, self);
            }
            Part::Number(Number::Signed(size)) => {
                self.put(&roll.to_le_bytes()[..usize::from(size)]);
                number(roll as f64, self);
            }
            Part::Number(Number::Unsigned(size)) => {
                self.put(&roll.abs().to_le_bytes()[..usize::from(size)]);
                number(roll.abs() as f64, self);
            }
            Part::Text => {
                let text = "x".repeat(self.dice.roll(6));
                self.put(&(text.len() as u32 + 1).to_le_bytes());
                self.bytes.extend(text.as_bytes());
                self.bytes.push(0);
            }
            Part::WideText => {
                let count = self.dice.roll(4);
                self.put(&(count as u32).to_le_bytes());
                self.bytes.extend(std::iter::repeat_n(0x41, 2 * count));
            }
            Part::Type(place) => self.object(definition, place),
        }
    }
}

fn leaves(tree: &Tree<'_>, found: &mut Vec<f64>) {
    match tree {
        Tree::Number(number) => found.push(*number),
        Tree::Whole(whole) => found.push(*whole as f64),
        Tree::Truth(truth) => found.push(f64::from(*truth)),
        Tree::Array(array) => found.extend(array.values()),
        Tree::List(list) => list.iter().for_each(|tree| leaves(tree, found)),
        Tree::Object(entries) => entries.iter().for_each(|(_, tree)| leaves(tree, found)),
        Tree::Text(_) | Tree::Null => {}
    }
}

const EVERYTHING: &str = "bool a\nbyte b\nint8 c\nuint16 d\nstring e\nint64 f\nwstring g\nfloat32 h\nfloat64[] i\nOther[2] j\nuint8[3] k\nOther[] l\nstring<=3[<=2] m\nEmpty n\nuint64 o\nfloat32[<=5] p\nuint8 q\nfloat64 r\n===\nMSG: pkg/Other\nint16 x\nfloat64 y\nbool[] z\n===\nMSG: pkg/Empty\nuint8 ONLY=1\n";

#[test]
fn what_is_written_at_random_is_read_in_both_orders_of_bytes() {
    let everything = super::definition("pkg/msg/All", "ros2msg", EVERYTHING).unwrap();
    for seed in 0..400 {
        for (kind, big, widest) in [(0, true, 8), (1, false, 8), (6, true, 4), (0x11, false, 4)] {
            let mut writer = Writer { bytes: vec![0, kind, 0, 0], big, widest, dice: Dice(seed), expected: Vec::new() };
            writer.object(&everything, 0);
            let mut found = Vec::new();
            leaves(&cdr::read(&everything, &writer.bytes).unwrap(), &mut found);
            assert_eq!(found, writer.expected, "seed {seed}, kind {kind}");
            // Cut anywhere, it is refused; damaged anywhere, it ends.
            let cut = writer.dice.roll(writer.bytes.len() - 1);
            assert!(cdr::read(&everything, &writer.bytes[..cut]).is_err(), "seed {seed}, cut at {cut}");
            for _ in 0..20 {
                let at = writer.dice.roll(writer.bytes.len());
                writer.bytes[at] ^= 1 << writer.dice.roll(8);
                let _ = cdr::read(&everything, &writer.bytes);
            }
        }
    }
}

#[test]
fn alignment_counts_from_behind_the_header() {
    let definition = super::definition("a/B", "ros2msg", "uint8 x\nfloat64 y").unwrap();
    let message = |pad: usize| [&[0, 1, 0, 0, 7][..], &vec![0; pad], &2.5_f64.to_le_bytes()].concat();
    let y = |message: &[u8]| cdr::read(&definition, message).ok()?.get("y")?.number();
    assert_eq!(y(&message(7)), Some(2.5));
    assert_eq!(y(&message(3)), None);
    let mut second = message(3);
    second[1] = 7;
    assert_eq!(y(&second), Some(2.5), "XCDR2 aligns to four bytes");
}

#[test]
fn a_message_says_what_is_wrong_with_it() {
    let definition = super::definition("a/B", "ros2msg", "float64[<=2] x").unwrap();
    let said = |message: &[u8]| cdr::read(&definition, message).unwrap_err();
    assert_eq!(said(&[0, 1]), "is shorter than a CDR header");
    assert!(said(&[0, 3, 0, 0, 0]).contains("kind 0x0003"));
    assert!(said(&[0, 1, 0, 0, 3, 0, 0, 0]).contains("3 entries, which may have 2"));
    assert!(said(&[0, 1, 0, 0, 1, 0, 0, 0]).contains("ends before"));
    assert!(said(&[[0, 1, 0, 0, 0, 0, 0, 0], [9; 8]].concat()).contains("8 bytes more"));
    let empty = super::definition("a/B", "ros2msg", "float64[] x").unwrap();
    assert!(cdr::read(&empty, &[0, 1, 0, 0, 0, 0, 0, 0]).is_ok());
}

#[test]
fn definitions_that_never_end_or_explode_are_refused() {
    let said = |text: &str| super::definition("a/A", "ros2msg", text).unwrap_err();
    assert!(said("B b\n===\nMSG: a/B\nA a\n").contains("contains itself"));
    assert!(said("B b\n").contains("need the type `a/B`"));
    let mut bomb = String::from("T0 x\n");
    for level in 0..12 {
        bomb += &format!("===\nMSG: a/T{level}\n");
        (0..10).for_each(|field| bomb += &format!("T{} f{field}\n", level + 1));
    }
    bomb += "===\nMSG: a/T12\nuint8 x\n";
    assert!(said(&bomb).contains("more than 65536 fields"), "{}", said(&bomb));
    let deep: String = (0..40).map(|level| format!("===\nMSG: a/T{level}\nT{} x\n", level + 1)).collect();
    assert!(said(&format!("T0 x\n{deep}")).contains("32 types deep"));
    assert!(super::definition("b/Unheard", "", "").unwrap_err().contains("neither in the recording nor known"));
    assert!(super::definition("a/B", "omgidl", "x").unwrap_err().contains("known: ros2msg, ros2idl"));
    // Lists that promise more than there is.
    let definition = super::definition("a/A", "ros2msg", "string[] x\nB[] y\n===\nMSG: a/B\nuint8 z").unwrap();
    let promise = [[0, 1, 0, 0], [0xff, 0xff, 0xff, 0x7f]].concat();
    assert!(cdr::read(&definition, &promise).is_err());
}
