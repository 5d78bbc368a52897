//! protobuf against bytes that are put together here by the published wire format.

use super::*;
use crate::recording::ros::Dice;
use crate::recording::tree::Tree;

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 0x7f {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

fn number(field: u64, value: u64) -> Vec<u8> {
    [varint(field << 3), varint(value)].concat()
}

fn bytes(field: u64, bytes: &[u8]) -> Vec<u8> {
    [varint(field << 3 | 2), varint(bytes.len() as u64), bytes.to_vec()].concat()
}

fn double(field: u64, value: f64) -> Vec<u8> {
    [varint(field << 3 | 1), value.to_le_bytes().to_vec()].concat()
}

/// A field's descriptor: name, number, label (1 one, 3 many), type, type's name.
fn field(name: &str, at: u64, label: u64, kind: u64, of: &str) -> Vec<u8> {
    let mut field = [bytes(1, name.as_bytes()), number(3, at), number(4, label), number(5, kind)].concat();
    if !of.is_empty() {
        field.extend(bytes(6, of.as_bytes()));
    }
    field
}

fn message(name: &str, fields: &[Vec<u8>]) -> Vec<u8> {
    [bytes(1, name.as_bytes()), fields.iter().flat_map(|field| bytes(2, field)).collect()].concat()
}

fn set(messages: &[Vec<u8>]) -> Vec<u8> {
    let messages: Vec<u8> = messages.iter().flat_map(|message| bytes(4, message)).collect();
    bytes(1, &[bytes(2, b"a"), messages, bytes(12, b"proto3")].concat())
}

fn descriptors() -> Vec<u8> {
    let time =
        bytes(1, &[bytes(2, b"google.protobuf"), bytes(4, &message("Timestamp", &[])), bytes(12, b"proto3")].concat());
    let own = set(&[
        message(
            "All",
            &[
                field("stamp", 1, 1, 11, ".google.protobuf.Timestamp"),
                field("x", 2, 1, 1, ""),
                field("list", 3, 3, 1, ""),
                field("whole", 4, 1, 17, ""),
                field("inner", 5, 3, 11, ".a.Inner"),
                field("flag", 6, 1, 8, ""),
                field("counts", 7, 3, 5, ""),
                [field("maybe", 8, 1, 1, ""), number(9, 0)].concat(),
                field("text", 9, 1, 9, ""),
            ],
        ),
        message("Inner", &[field("name", 1, 1, 9, ""), field("position", 2, 1, 1, "")]),
    ]);
    [time, own].concat()
}

fn read_all(descriptors: &Descriptors, message: &[u8]) -> String {
    format!("{:?}", read(descriptors, message).unwrap())
}

#[test]
fn fields_are_read_by_their_numbers_and_absent_ones_are_zero() {
    let descriptors = Descriptors::parse("a.All", &descriptors()).unwrap();
    let stamp = bytes(1, &[number(1, 12), number(2, 34)].concat());
    let packed = [1.0_f64, 2.0].map(f64::to_le_bytes).concat();
    let inner = bytes(5, &[bytes(1, b"j"), double(2, 0.5)].concat());
    let counts = bytes(7, &[varint(3), varint(u64::MAX)].concat());
    let whole =
        [stamp, double(2, -1.5), bytes(3, &packed), number(4, 5), inner, number(6, 1), counts, number(99, 1)].concat();
    let tree = read(&descriptors, &whole).unwrap();
    assert_eq!(tree.get("x"), Some(&Tree::Number(-1.5)));
    let Some(Tree::Array(list)) = tree.get("list") else { panic!("{tree:?}") };
    assert_eq!(list.values().collect::<Vec<_>>(), [1.0, 2.0]);
    assert_eq!(tree.get("whole"), Some(&Tree::Whole(-3)));
    assert_eq!(tree.get("flag"), Some(&Tree::Truth(true)));
    assert_eq!(tree.get("counts"), Some(&Tree::List(vec![Tree::Whole(3), Tree::Whole(-1)])));
    assert_eq!(tree.get("maybe"), None);
    assert_eq!(tree.get("inner").unwrap().list().unwrap()[0].get("position"), Some(&Tree::Number(0.5)));
    assert_eq!(
        crate::recording::numbers::stamp(&tree),
        Some(crate::recording::numbers::Stamp::Nanoseconds(12_000_000_034))
    );
    let empty = read(&descriptors, &[]).unwrap();
    assert_eq!((empty.get("x"), empty.get("whole")), (Some(&Tree::Number(0.0)), Some(&Tree::Whole(0))));
    assert_eq!((empty.get("list"), empty.get("text")), (Some(&Tree::List(vec![])), None));
    // One by one, and in pieces.
    let single = [double(3, 1.0), double(3, 2.0), bytes(3, &packed)].concat();
    let many = [1.0, 2.0, 1.0, 2.0].map(Tree::Number).to_vec();
    assert_eq!(read(&descriptors, &single).unwrap().get("list"), Some(&Tree::List(many)));
}

#[test]
fn damaged_messages_and_descriptors_end() {
    let set = descriptors();
    let good = Descriptors::parse("a.All", &set).unwrap();
    let inner = bytes(5, &[bytes(1, b"j"), double(2, 0.5)].concat());
    let whole = [double(2, -1.5), bytes(3, &[0; 16]), number(4, 5), inner].concat();
    let mut dice = Dice(5);
    for _ in 0..20_000 {
        let mut damaged = whole.clone();
        let at = dice.roll(damaged.len());
        damaged[at] ^= 1 << dice.roll(8);
        let _ = read(&good, &damaged);
        let _ = read(&good, &damaged[..at]);
        let mut damaged = set.clone();
        let at = dice.roll(damaged.len());
        damaged[at] ^= 1 << dice.roll(8);
        if let Ok(descriptors) = Descriptors::parse("a.All", &damaged) {
            let _ = read(&descriptors, &whole);
        }
    }
    assert!(Descriptors::parse("a.Other", &set).unwrap_err().contains("`a.Other`, which the descriptors"));
    assert!(Descriptors::parse("a.All", &set[..40]).is_err());
    assert!(!read_all(&good, &whole).is_empty());
}

#[test]
fn messages_in_themselves_and_empty_ones_without_number_are_refused() {
    let fields: Vec<_> = (2..200).map(|at| field(&format!("f{at}"), at, 1, 1, "")).collect();
    let own = message("Own", &[vec![field("own", 1, 3, 11, ".a.Own")], fields].concat());
    let descriptors = Descriptors::parse("a.Own", &set(&[own])).unwrap();
    let mut deep = Vec::new();
    for _ in 0..100 {
        deep = bytes(1, &deep);
    }
    assert!(read(&descriptors, &deep).unwrap_err().contains("64 messages deep"));
    // Two bytes each, which stand for hundreds of zeros.
    assert!(read(&descriptors, &bytes(1, &[]).repeat(5000)).unwrap_err().contains("more than"));
}
