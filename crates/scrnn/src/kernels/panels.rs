//! Products of a matrix with a few columns: the recurrence, where a block's sequences are the columns.
//!
//! ```text
//! out[row, column] = start[row] + sum_p sum_k matrix_p[row, k] * source_p[column, k]
//! ```
//!
//! The matrix is cut into panels as tall as a tile of the instruction set; within a panel the values of one k lie side
//! by side, so a product reads it front to back. A tile of a panel and a few columns keeps all of its sums in registers. Sums run over
//! k in ascending order; few rows are summed in two interleaved chains, because a short sum would otherwise wait for its
//! own latency. Neither depends on the number of columns.

#![allow(clippy::needless_range_loop, reason = "loops over the constant sides of a tile unroll; indices say which")]

use std::hint::black_box;

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::element::{Element, lanes};
use super::{accumulators, is_used};
use crate::engine::InstructionSet;

/// Values of a cache line.
const LINE: usize = 8;

/// A matrix in panels, zero-padded to whole vectors of rows.
#[derive(Debug, Clone)]
pub struct Panels<E = f64> {
    rows: usize,
    inner: usize,
    chains: usize,
    /// First row and height of each panel.
    panels: Vec<(usize, usize)>,
    values: AVec<E>,
}

/// First row and height of the panels of a matrix of `rows` rows (a multiple of `group`), at most `tallest` high: as
/// even as can be.
fn panels(rows: usize, tallest: usize, group: usize) -> Vec<(usize, usize)> {
    let groups = rows / group;
    let count = rows.div_ceil(tallest).max(1);
    let mut start = 0;
    let next = |p: usize| {
        let height = (groups / count + usize::from(p < groups % count)) * group;
        start += height;
        (start - height, height)
    };
    (0..count).map(next).collect()
}

/// Interleaved chains for a matrix of `rows` rows: up to six vectors of rows are too few to hide a sum's latency.
#[must_use]
pub fn chains_for<E: Element>(rows: usize) -> usize {
    if E::padded(rows) <= 6 * E::ROWS { 2 } else { 1 }
}

impl<E: Element> Panels<E> {
    /// Room for `rows` x `inner`, all zeros, in panels for an instruction set.
    #[must_use]
    pub fn zeros(rows: usize, inner: usize, chains: usize, set: InstructionSet) -> Self {
        let rows = E::padded(rows);
        let tallest = match set {
            InstructionSet::Avx512 => 4 * E::ROWS,
            InstructionSet::Avx2 | InstructionSet::Neon | InstructionSet::Portable => E::ROWS,
        };
        let values = AVec::from_iter(64, std::iter::repeat_n(E::ZERO, rows * inner));
        Self { rows, inner, chains, panels: panels(rows, tallest, E::ROWS), values }
    }

    /// Writes `value(row, k)` everywhere; rows beyond `rows` stay 0.
    pub fn fill(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        for &(start, height) in &self.panels {
            let panel = &mut self.values[start * self.inner..(start + height) * self.inner];
            for (k, out) in panel.chunks_exact_mut(height).enumerate() {
                for (r, out) in out.iter_mut().enumerate().take(rows.saturating_sub(start)) {
                    *out = E::from_f64(value(start + r, k));
                }
            }
        }
    }

    /// Rows, padded.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }
}

/// Columns of a factor: column `c` is `values[c * stride..][..inner]`.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a, E = f64> {
    /// All columns.
    pub values: &'a [E],
    /// Distance between columns.
    pub stride: usize,
}

/// What is multiplied; all matrices have the same rows. `start` holds one value a row.
#[derive(Clone, Copy)]
pub struct Product<'a, const P: usize, E = f64> {
    /// The matrices.
    pub matrices: [&'a Panels<E>; P],
    /// The columns that each is multiplied with.
    pub sources: [Columns<'a, E>; P],
    /// How many columns.
    pub columns: usize,
    /// What the sums start from.
    pub start: &'a [E],
    /// What will be needed next and may be far away: the product reads it on the way, and so fetches it while it computes.
    pub ahead: &'a [E],
}

/// Multiplies: `out` holds one row of as many values as the matrices have rows for each column.
#[inline(always)]
pub fn multiply<S: Simd, E: Element, const P: usize>(simd: S, product: Product<'_, P, E>, out: &mut [E]) {
    match product.matrices[0].chains {
        2 => bands::<S, E, P, 2>(simd, &product, out),
        _ => bands::<S, E, P, 1>(simd, &product, out),
    }
}

#[inline(always)]
fn bands<S: Simd, E: Element, const P: usize, const K: usize>(simd: S, product: &Product<'_, P, E>, out: &mut [E]) {
    for &(row, height) in &product.matrices[0].panels {
        match height / lanes::<S, E>() {
            4 => tiles::<S, E, P, 4, K>(simd, product, row, out),
            3 => tiles::<S, E, P, 3, K>(simd, product, row, out),
            2 => tiles::<S, E, P, 2, K>(simd, product, row, out),
            _ => tiles::<S, E, P, 1, K>(simd, product, row, out),
        }
    }
}

/// The panel that starts at `row`: as few and as even tiles as the registers allow.
#[inline(always)]
fn tiles<S: Simd, E: Element, const P: usize, const M: usize, const K: usize>(
    simd: S,
    product: &Product<'_, P, E>,
    row: usize,
    out: &mut [E],
) {
    let widest = (accumulators::<S>() / (M * K)).clamp(1, 6);
    let tiles = product.columns.div_ceil(widest);
    let mut first = 0;
    for tile in 0..tiles {
        // No division where there is one tile: it would take longer than a small tile does.
        let width = match tiles {
            1 => product.columns,
            _ => product.columns / tiles + usize::from(tile < product.columns % tiles),
        };
        match width {
            6 => enter::<S, E, P, M, 6, K>(simd, product, row, first, out),
            5 => enter::<S, E, P, M, 5, K>(simd, product, row, first, out),
            4 => enter::<S, E, P, M, 4, K>(simd, product, row, first, out),
            3 => enter::<S, E, P, M, 3, K>(simd, product, row, first, out),
            2 => enter::<S, E, P, M, 2, K>(simd, product, row, first, out),
            1 => enter::<S, E, P, M, 1, K>(simd, product, row, first, out),
            _ => {}
        }
        first += width;
    }
}

/// Each tile is a function of its own: inlined into one, the many shapes would take minutes to compile.
#[inline(never)]
fn enter<S: Simd, E: Element, const P: usize, const M: usize, const N: usize, const K: usize>(
    simd: S,
    product: &Product<'_, P, E>,
    row: usize,
    first: usize,
    out: &mut [E],
) {
    // A single chain is for seven vectors and more, which split into panels of three and four.
    if is_used::<S, E>(M, N, K) && (K == 2 || M >= 3 || lanes::<S, E>() < E::ROWS || S::REGISTER_COUNT < 16) {
        simd.vectorize(Tile::<E, P, M, N, K> { product, row, first, out });
    }
}

/// M vectors of rows by N columns, in K interleaved chains.
struct Tile<'a, E, const P: usize, const M: usize, const N: usize, const K: usize> {
    product: &'a Product<'a, P, E>,
    row: usize,
    first: usize,
    out: &'a mut [E],
}

impl<E: Element, const P: usize, const M: usize, const N: usize, const K: usize> WithSimd for Tile<'_, E, P, M, N, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { product, row, first, out } = self;
        let height = M * lanes::<S, E>();
        let mut ahead = product.ahead.as_chunks::<LINE>().0.iter().skip(row);
        let mut fetched = E::ZERO;
        let mut sums = [[[E::splat(simd, E::ZERO); N]; M]; K];
        let starts = E::vectors::<S>(&product.start[row..row + height]);
        for m in 0..M {
            for n in 0..N {
                sums[0][m][n] = starts[m];
            }
        }
        for p in 0..P {
            let inner = product.matrices[p].inner;
            let panel = E::vectors::<S>(&product.matrices[p].values[row * inner..(row + height) * inner]);
            let (weights, _) = panel.as_chunks::<M>();
            let (pairs, rest) = weights.as_chunks::<2>();
            let source = product.sources[p];
            let mut column = [[].as_slice(); N];
            for n in 0..N {
                column[n] = &source.values[(first + n) * source.stride..][..inner];
            }
            let mut paired = [[].as_slice(); N];
            for n in 0..N {
                paired[n] = &column[n].as_chunks::<2>().0[..pairs.len()];
            }
            for k in 0..pairs.len() {
                if let Some(line) = ahead.next() {
                    fetched += line[0];
                }
                for half in 0..2 {
                    for n in 0..N {
                        let x = E::splat(simd, paired[n][k][half]);
                        for m in 0..M {
                            let sum = &mut sums[half % K][m][n];
                            *sum = E::mul_add(simd, pairs[k][half][m], x, *sum);
                        }
                    }
                }
            }
            if let [last] = rest {
                for n in 0..N {
                    let x = E::splat(simd, column[n][inner - 1]);
                    for m in 0..M {
                        sums[0][m][n] = E::mul_add(simd, last[m], x, sums[0][m][n]);
                    }
                }
            }
        }
        black_box(fetched);
        let rows = product.matrices[0].rows;
        for n in 0..N {
            let out = E::vectors_mut::<S>(&mut out[(first + n) * rows + row..][..height]);
            for m in 0..M {
                out[m] = if K == 2 { E::add(simd, sums[0][m][n], sums[K - 1][m][n]) } else { sums[0][m][n] };
            }
        }
    }
}
