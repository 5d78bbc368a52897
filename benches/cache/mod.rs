//! How fast one thread reads from the cache that holds an array of a given size.

use std::hint::black_box;
use std::time::Duration;

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};
use scrnn::engine::InstructionSet;

use crate::machine::{on, seconds_per_call};

/// Bytes a second, in units of 1e9, that one thread reads from an array of `bytes` bytes, over and over.
pub fn read_gbytes(set: InstructionSet, bytes: usize) -> f64 {
    let values = AVec::<f64>::from_iter(64, std::iter::repeat_n(1.0, bytes.next_multiple_of(READ_AT_ONCE * 64) / 8));
    let read = |rounds| {
        on(set, Reads { values: &values, rounds });
    };
    let seconds = seconds_per_call(Duration::from_millis(4), read);
    8.0 * values.len() as f64 / seconds / 1e9
}

/// Vectors that are read by one round of independent additions.
const READ_AT_ONCE: usize = 12;

struct Reads<'a> {
    values: &'a [f64],
    rounds: u32,
}

impl WithSimd for Reads<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut sums = [simd.splat_f64s(0.0); READ_AT_ONCE];
        for _ in 0..self.rounds {
            let (vectors, _) = S::as_simd_f64s(black_box(self.values));
            for group in vectors.as_chunks::<READ_AT_ONCE>().0 {
                for (sum, vector) in sums.iter_mut().zip(group) {
                    *sum = simd.add_f64s(*sum, *vector);
                }
            }
        }
        black_box(sums.iter().fold(0.0, |total, sum| total + simd.reduce_sum_f64s(*sum)));
    }
}
