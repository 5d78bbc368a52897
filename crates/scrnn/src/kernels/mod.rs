//! Arithmetic on slices, in safe SIMD; a plain reference stands beside every fast version.
//!
//! Nothing here knows a network. Vectors run over rows (units); a block's columns (sequences, starts, samples) lie side
//! by side. Row counts are padded to [`ROWS`], so that memory looks the same under every instruction set, and every
//! element is summed in one fixed order of fused multiply-adds: all instruction sets give the same bits.

pub mod activation;
pub mod element;
pub mod outer;
pub mod panels;
pub mod reference;

use element::{Element, lanes};

/// Rows are padded to a multiple of this: the widest vector, eight f64.
pub const ROWS: usize = 8;

/// `count` rounded up to whole vectors.
#[must_use]
pub const fn padded(count: usize) -> usize {
    count.next_multiple_of(ROWS)
}

/// A row stride for `count` values: whole vectors, and an odd number of cache lines, so that rows far apart do not
/// fall into the same cache set.
#[must_use]
pub const fn stride(count: usize) -> usize {
    let lines = count.div_ceil(ROWS);
    (lines | 1) * ROWS
}

/// Copies a few values; a call of memcpy would cost more than the values.
#[inline(always)]
pub fn copy_few<T: Copy>(to: &mut [T], from: &[T]) {
    match (to, from) {
        ([a], [x]) => *a = *x,
        ([a, b], [x, y]) => (*a, *b) = (*x, *y),
        ([a, b, c], [x, y, z]) => (*a, *b, *c) = (*x, *y, *z),
        (to, from) => to.copy_from_slice(from),
    }
}

/// Asks for the cache line at `from`, so that it is near when it is read or written. Nothing waits for it, and any address will do:
/// the instruction reads nothing that a program could see. Where it cannot be had without `unsafe`, nothing happens.
#[inline(always)]
pub(crate) fn fetch<S: pulp::Simd, E>(simd: S, from: *const E) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::_MM_HINT_T0;
        // The type is known when this is compiled: what is left is the instruction.
        let simd: &dyn std::any::Any = &simd;
        if let Some(simd) = simd.downcast_ref::<pulp::x86::V4>() {
            simd.sse._mm_prefetch::<_MM_HINT_T0>(from.cast());
        } else if let Some(simd) = simd.downcast_ref::<pulp::x86::V3>() {
            simd.sse._mm_prefetch::<_MM_HINT_T0>(from.cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (simd, from);
}

/// How many accumulators a tile may hold: three quarters of the registers, the rest is for operands. Where there are no
/// vector registers at all, one: then a tile is only code to compile.
const fn accumulators<S: pulp::Simd>() -> usize {
    match S::REGISTER_COUNT {
        32.. => 24,
        16..32 => 12,
        _ => 1,
    }
}

/// Vectors of rows that a tile covers at most.
const fn tallest<S: pulp::Simd>() -> usize {
    match S::REGISTER_COUNT {
        32.. => 4,
        16..32 => 2,
        _ => 1,
    }
}

/// Whether a tile of so many vectors and columns is ever asked for, with `chains` interleaved sums: all others need not
/// be compiled.
const fn is_used<S: pulp::Simd, E: Element>(vectors: usize, columns: usize, chains: usize) -> bool {
    // Rows come in whole groups of ROWS: narrow vectors always fill a tile.
    let group = E::ROWS / lanes::<S, E>();
    let least = if group < tallest::<S>() { group } else { tallest::<S>() };
    vectors <= tallest::<S>()
        && vectors.is_multiple_of(least)
        && (columns == 1 || vectors * columns * chains <= accumulators::<S>())
}
