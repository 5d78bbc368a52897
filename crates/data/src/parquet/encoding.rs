//! How values lie in a page.

use super::schema::{Leaf, Physical};
use crate::front::Front;

/// Numbers of few bits, as runs of one number and stretches in which all stand (the hybrid of RLE and bit packing).
///
/// ```text
/// run      2 n as a varint, the number in whole bytes: n times
/// stretch  2 n + 1 as a varint, 8 n numbers of `width` bits each, the lowest bit first
/// ```
pub fn hybrid(mut front: Front<'_>, width: u32, count: usize, mut each: impl FnMut(u32)) -> Option<()> {
    let bytes = width.div_ceil(8) as usize;
    let mut left = count;
    while left > 0 {
        let head = front.varint()?;
        let length = usize::try_from(head >> 1).ok()?;
        if head & 1 == 0 {
            let number = front.number(bytes)?;
            let number = u32::try_from(number).ok().filter(|_| width == 32 || number >> width == 0)?;
            if length == 0 {
                return None;
            }
            let length = length.min(left);
            (0..length).for_each(|_| each(number));
            left -= length;
        } else {
            let numbers = length.checked_mul(8).filter(|&numbers| numbers > 0)?;
            // Some writers leave out the bytes behind the last number that is needed.
            let needed = (numbers.min(left) * width as usize).div_ceil(8);
            let packed = front.take(length.checked_mul(width as usize)?.min(front.0.len()).max(needed))?;
            let here = numbers.min(left);
            bits(packed, width, here, &mut each);
            left -= here;
        }
    }
    Some(())
}

/// Calls `each` with `count` numbers of `width` bits that lie behind each other, the lowest bit first.
fn bits(packed: &[u8], width: u32, count: usize, mut each: impl FnMut(u32)) {
    let mask = (1_u64 << width) - 1;
    let (mut held, mut filled) = (0_u64, 0_u32);
    let mut bytes = packed.iter();
    for _ in 0..count {
        while filled < width {
            held |= u64::from(bytes.next().copied().unwrap_or(0)) << filled;
            filled += 8;
        }
        each((held & mask) as u32);
        held >>= width;
        filled -= width;
    }
}

/// The number in the bytes of one value.
fn number(leaf: &Leaf, bytes: &[u8]) -> f64 {
    let low = || bytes.iter().rev().fold(0_u64, |number, &byte| number << 8 | u64::from(byte));
    match leaf.physical {
        Physical::Int32 => whole(leaf, i64::from(low() as u32 as i32)),
        Physical::Int64 => whole(leaf, low() as i64),
        Physical::Float => f64::from(f32::from_bits(low() as u32)),
        Physical::Double => f64::from_bits(low()),
        Physical::Half => half(low() as u16),
        Physical::Boolean | Physical::Other => f64::NAN,
    }
}

/// A whole number, with the sign that it has.
fn whole(leaf: &Leaf, number: i64) -> f64 {
    match (leaf.unsigned, leaf.physical) {
        (true, Physical::Int32) => f64::from(number as u32),
        (true, _) => number as u64 as f64,
        (false, _) => number as f64,
    }
}

/// A float of 16 bits (IEEE 754 binary16).
pub fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    match exponent {
        0 => sign * fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => sign * f64::INFINITY,
        31 => f64::NAN,
        _ => sign * (1.0 + fraction / 1024.0) * 2_f64.powi(exponent - 15),
    }
}

/// Bytes of one value.
fn width(leaf: &Leaf) -> usize {
    match leaf.physical {
        Physical::Half => 2,
        Physical::Int32 | Physical::Float => 4,
        _ => 8,
    }
}

/// Values behind each other (PLAIN).
pub fn plain(leaf: &Leaf, data: &[u8], count: usize, out: &mut Vec<f64>) -> Option<()> {
    if leaf.physical == Physical::Boolean {
        let data = data.get(..count.div_ceil(8))?;
        bits(data, 1, count, |bit| out.push(f64::from(bit)));
        return Some(());
    }
    let data = data.get(..count.checked_mul(width(leaf))?)?;
    match leaf.physical {
        // The two kinds that robots' tables consist of.
        Physical::Float => out.extend(data.as_chunks().0.iter().map(|&bytes| f64::from(f32::from_le_bytes(bytes)))),
        Physical::Double => out.extend(data.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes))),
        _ => out.extend(data.chunks_exact(width(leaf)).map(|bytes| number(leaf, bytes))),
    }
    Some(())
}

/// First all values' first bytes, then all second bytes, and so on (BYTE_STREAM_SPLIT).
pub fn byte_streams(leaf: &Leaf, data: &[u8], count: usize, out: &mut Vec<f64>) -> Option<()> {
    let width = width(leaf);
    let data = data.get(..count.checked_mul(width)?)?;
    let mut bytes = [0; 8];
    for value in 0..count {
        for (place, byte) in bytes[..width].iter_mut().enumerate() {
            *byte = data[place * count + value];
        }
        out.push(number(leaf, &bytes[..width]));
    }
    Some(())
}

/// Whole numbers by their differences (DELTA_BINARY_PACKED).
///
/// ```text
/// block size, miniblocks in a block, count (varints), the first value (zigzag)
/// block: least difference (zigzag), a width in bits for each miniblock, the differences above the least
/// ```
pub fn deltas(leaf: &Leaf, data: &[u8], count: usize, out: &mut Vec<f64>) -> Option<()> {
    let mut front = Front(data);
    let block = usize::try_from(front.varint()?).ok()?;
    let miniblocks = usize::try_from(front.varint()?).ok()?;
    let said = usize::try_from(front.varint()?).ok()?;
    let mut value = front.zigzag()?;
    if said != count || count == 0 {
        return (said == count).then_some(());
    }
    let each = block.checked_div(miniblocks).filter(|&each| each > 0 && each % 8 == 0 && each <= 1 << 16)?;
    let narrow = leaf.physical == Physical::Int32;
    let mut push = |value: i64| out.push(whole(leaf, if narrow { i64::from(value as i32) } else { value }));
    push(value);
    let mut left = count - 1;
    while left > 0 {
        let least = front.zigzag()?;
        let widths = front.take(miniblocks)?;
        for &width in widths {
            if left == 0 {
                break;
            }
            let width = u32::from(width);
            let here = each.min(left);
            let packed = front.take((each * width as usize / 8).min(front.0.len()))?;
            if width > 64 || packed.len() < (here * width as usize).div_ceil(8) {
                return None;
            }
            for index in 0..here {
                let above = wide_bits(packed, index * width as usize, width);
                value = value.wrapping_add(least).wrapping_add(above as i64);
                push(value);
            }
            left -= here;
        }
    }
    Some(())
}

/// The number of up to 64 bits that begins at a bit.
fn wide_bits(packed: &[u8], bit: usize, width: u32) -> u64 {
    let from = bit / 8;
    let bytes = packed.iter().skip(from).take(9).rev().fold(0_u128, |held, &byte| held << 8 | u128::from(byte));
    let mask = (1_u128 << width) - 1;
    (bytes >> (bit % 8) & mask) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf(physical: Physical) -> Leaf {
        Leaf { name: "x".into(), physical, unsigned: false, per_second: None, lists: 0, optional: 0, inner: 0 }
    }

    #[test]
    fn runs_and_stretches_follow_each_other() {
        // Four times 1, then the numbers 0 to 7 in three bits each (the example of the format's description).
        let packed = [4 << 1, 1, 3, 0b1000_1000, 0b1100_0110, 0b1111_1010];
        let mut out = Vec::new();
        hybrid(Front(&packed), 3, 12, |number| out.push(number)).unwrap();
        assert_eq!(out, [1, 1, 1, 1, 0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(hybrid(Front(&packed[..5]), 3, 12, |_| ()), None);
        assert_eq!(hybrid(Front(&[0, 0]), 1, 2, |_| ()), None);
        assert_eq!(hybrid(Front(&[4, 9]), 3, 2, |_| ()), None);
    }

    #[test]
    fn numbers_of_no_bits_are_zeros() {
        let mut out = Vec::new();
        hybrid(Front(&[6]), 0, 3, |number| out.push(number)).unwrap();
        assert_eq!(out, [0, 0, 0]);
    }

    #[test]
    fn halves_are_exact() {
        let cases =
            [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_953_125), (0x0001, 2_f64.powi(-24)), (0x7bff, 65504.0)];
        for (bits, value) in cases {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan());
    }

    #[test]
    fn differences_add_up() {
        // 7, 5, 3, 1, 2, 3, 4, 5: the second example of the format's description, in blocks of 8 here.
        let data = [8, 1, 8, 14, 3, 2, 0b1100_0000, 0b0011_1111];
        let mut out = Vec::new();
        deltas(&leaf(Physical::Int64), &data, 8, &mut out).unwrap();
        assert_eq!(out, [7., 5., 3., 1., 2., 3., 4., 5.]);
        assert_eq!(deltas(&leaf(Physical::Int64), &data[..7], 8, &mut out), None);
        assert_eq!(deltas(&leaf(Physical::Int64), &[0, 0, 2, 0], 2, &mut out), None);
    }

    #[test]
    fn streams_of_bytes_are_put_together() {
        let values = [1.5_f32, -2.25];
        let data: Vec<u8> = (0..4).flat_map(|place| values.map(|value| value.to_le_bytes()[place])).collect();
        let mut out = Vec::new();
        byte_streams(&leaf(Physical::Float), &data, 2, &mut out).unwrap();
        assert_eq!(out, [1.5, -2.25]);
    }
}
