//! What is packed, unpacked: never to more than was promised, and never on the promise's word alone.

use std::borrow::Cow;
use std::io::Read;

use super::front::Front;

/// What a zstd decoder may look back on: what every decoder grants (RFC 8878).
const WINDOW: u64 = 8 << 20;
/// Nothing that is packed byte by byte unpacks to more than about this many times its size (lz4: 255, snappy: 22).
const MOST_PER_BYTE: usize = 256;

/// How bytes are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// Not at all.
    Plain,
    /// Snappy, one block.
    Snappy,
    /// Gzip members.
    Gzip,
    /// A zlib stream.
    Zlib,
    /// Zstandard frames.
    Zstd,
    /// One block of LZ4.
    Lz4,
}

impl Packing {
    /// Unpacks to exactly `size` bytes, else nothing.
    pub fn unpack(self, packed: &[u8], size: usize) -> Option<Cow<'_, [u8]>> {
        let most = size as u64 + 1;
        let read = |stream: &mut dyn Read| {
            let mut out = Vec::new();
            stream.take(most).read_to_end(&mut out).ok().map(|_| out)
        };
        let out = match self {
            Self::Plain => Cow::Borrowed(packed),
            Self::Snappy => Cow::Owned(snappy(packed, size)?),
            Self::Gzip => Cow::Owned(read(&mut flate2::read::MultiGzDecoder::new(packed))?),
            Self::Zlib => Cow::Owned(read(&mut flate2::read::ZlibDecoder::new(packed))?),
            Self::Zstd => {
                let window = WINDOW.min(most.next_power_of_two().max(1 << 17));
                let stream = ruzstd::decoding::StreamingDecoder::new_with_max_window_size(packed, window.max(WINDOW));
                Cow::Owned(read(&mut stream.ok()?)?)
            }
            Self::Lz4 if size / MOST_PER_BYTE > packed.len() => return None,
            Self::Lz4 => Cow::Owned(lz4_flex::block::decompress(packed, size).ok()?),
        };
        (out.len() == size).then_some(out)
    }
}

/// Unpacks a zlib stream of which nobody says how long it is, if that is at most `most` bytes.
pub fn zlib_to_its_end(packed: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let mut stream = flate2::read::ZlibDecoder::new(packed).take(most as u64 + 1);
    stream.read_to_end(&mut out).ok().filter(|_| out.len() <= most)?;
    Some(out)
}

/// Unpacks a block of snappy: its length, then stretches of bytes and copies of what came before.
fn snappy(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut packed = Front(packed);
    if packed.varint()? != size as u64 || size / MOST_PER_BYTE > packed.0.len() {
        return None;
    }
    let mut out: Vec<u8> = Vec::with_capacity(size);
    while let Some(tag) = packed.u8() {
        let high = usize::from(tag >> 2);
        let (length, distance) = match tag & 3 {
            0 => {
                let length = if high < 60 { high } else { packed.number(high - 59)? as usize };
                if length >= size - out.len() {
                    return None;
                }
                out.extend(packed.take(length + 1)?);
                continue;
            }
            1 => ((high & 7) + 4, usize::from(tag >> 5) << 8 | usize::from(packed.u8()?)),
            2 => (high + 1, usize::from(packed.u16()?)),
            _ => (high + 1, packed.u32()? as usize),
        };
        let from = out.len().checked_sub(distance)?;
        if distance == 0 || length > size - out.len() {
            return None;
        }
        if distance >= length {
            out.extend_from_within(from..from + length);
        } else {
            // The copy reaches into itself: a pattern that repeats.
            for at in from..from + length {
                out.push(out[at]);
            }
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn snappy_knows_stretches_and_copies() {
        // "ab", then 6 bytes from 2 before, then "c".
        let packed = [9, 1 << 2, b'a', b'b', 2 << 2 | 1, 2, 0, b'c'];
        assert_eq!(
            Packing::Snappy.unpack(&packed, 9).unwrap().as_ref(),
            b"abababab c".map(|b| b).split(|b| *b == b' ').collect::<Vec<_>>().concat()
        );
        // A stretch of 61 bytes has its length behind the tag.
        let mut long = vec![61, 60 << 2, 60];
        long.extend([7; 61]);
        assert_eq!(Packing::Snappy.unpack(&long, 61).unwrap().as_ref(), [7; 61]);
        for damaged in [&packed[..7], &[9, 1, 5], &[2, 0, 1], &[200, 1, 0, 1]] {
            assert_eq!(Packing::Snappy.unpack(damaged, 9), None, "{damaged:?}");
        }
        assert_eq!(Packing::Snappy.unpack(&packed, 8), None);
    }

    #[test]
    fn streams_come_back_if_they_hold_what_they_say() {
        let plain = b"to and fro and to and fro".repeat(20);
        let level = flate2::Compression::default();
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), level);
        gzip.write_all(&plain).unwrap();
        let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), level);
        zlib.write_all(&plain).unwrap();
        let zstd = ruzstd::encoding::compress_to_vec(&plain[..], ruzstd::encoding::CompressionLevel::Fastest);
        let packed = [
            (Packing::Gzip, gzip.finish().unwrap()),
            (Packing::Zlib, zlib.finish().unwrap()),
            (Packing::Zstd, zstd),
            (Packing::Lz4, lz4_flex::block::compress(&plain)),
            (Packing::Plain, plain.clone()),
        ];
        for (packing, packed) in packed {
            assert_eq!(packing.unpack(&packed, plain.len()).unwrap().as_ref(), plain, "{packing:?}");
            assert_eq!(packing.unpack(&packed, plain.len() - 1), None, "{packing:?}");
            assert_eq!(packing.unpack(&packed, 1 << 40), None, "{packing:?}");
        }
    }
}
