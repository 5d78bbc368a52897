//! Products of a matrix with a few columns: the recurrence, where a block's sequences are the columns.
//!
//! ```text
//! out[row, column] = start[row] + sum_p sum_k matrix_p[row, k] * source_p[column, k]
//! ```
//!
//! The matrix is cut into panels of a few vectors of rows; within a panel the values of one k lie side by side, so a
//! product reads it front to back. A tile of a panel and a few columns keeps all of its sums in registers. Sums run over
//! k in ascending order; few rows are summed in two interleaved chains, because a short sum would otherwise wait for its
//! own latency. Neither depends on the number of columns.

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::{ROWS, accumulators, is_used, padded, tallest};

/// Rows of a panel under the widest instructions: four vectors of eight.
const PANEL: usize = 4 * ROWS;

/// A matrix in panels, zero-padded to whole vectors of rows.
#[derive(Debug, Clone)]
pub struct Panels {
    rows: usize,
    inner: usize,
    chains: usize,
    values: AVec<f64>,
}

/// The heights in rows of the panels of a matrix of `rows` rows (a multiple of [`ROWS`]): as even as can be.
fn heights(rows: usize) -> impl Iterator<Item = usize> {
    let vectors = rows / ROWS;
    let count = rows.div_ceil(PANEL).max(1);
    (0..count).map(move |p| (vectors / count + usize::from(p < vectors % count)) * ROWS)
}

/// Interleaved chains for a matrix of `rows` rows: up to six vectors of rows are too few to hide a sum's latency.
#[must_use]
pub const fn chains_for(rows: usize) -> usize {
    if padded(rows) <= 6 * ROWS { 2 } else { 1 }
}

impl Panels {
    /// Room for `rows` x `inner`, all zeros.
    #[must_use]
    pub fn zeros(rows: usize, inner: usize, chains: usize) -> Self {
        let rows = padded(rows);
        Self { rows, inner, chains, values: AVec::from_iter(64, std::iter::repeat_n(0.0, rows * inner)) }
    }

    /// Writes `value(row, k)` everywhere; rows beyond `rows` stay 0.
    pub fn fill(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        let mut start = 0;
        for height in heights(self.rows) {
            let panel = &mut self.values[start * self.inner..(start + height) * self.inner];
            for (k, out) in panel.chunks_exact_mut(height).enumerate() {
                for (r, out) in out.iter_mut().enumerate().take(rows.saturating_sub(start)) {
                    *out = value(start + r, k);
                }
            }
            start += height;
        }
    }

    /// Rows, padded.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Terms of each sum.
    #[must_use]
    pub fn inner(&self) -> usize {
        self.inner
    }
}

/// Columns of a factor: column `c` is `values[c * stride..][..inner]`.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a> {
    /// All columns.
    pub values: &'a [f64],
    /// Distance between columns.
    pub stride: usize,
}

/// Receives the sums: a vector of rows of one column at a time.
pub trait Finish<S: Simd> {
    /// `sum` holds rows `row..row + lanes` of column `column`.
    fn finish(&mut self, simd: S, column: usize, row: usize, sum: S::f64s);
}

/// What is multiplied; all matrices have the same rows. `start` holds one value a row.
#[derive(Clone, Copy)]
pub struct Product<'a, const P: usize> {
    /// The matrices.
    pub matrices: [&'a Panels; P],
    /// The columns that each is multiplied with.
    pub sources: [Columns<'a>; P],
    /// How many columns.
    pub columns: usize,
    /// What the sums start from.
    pub start: &'a [f64],
}

/// Multiplies.
#[inline(always)]
pub fn multiply<S: Simd, const P: usize>(simd: S, product: Product<'_, P>, finish: &mut impl Finish<S>) {
    match product.matrices[0].chains {
        2 => bands::<S, P, 2>(simd, &product, finish),
        _ => bands::<S, P, 1>(simd, &product, finish),
    }
}

/// Some rows of a panel: those that one tile covers.
#[derive(Clone, Copy)]
struct Band {
    /// First row of the panel.
    panel_start: usize,
    /// Rows of the panel.
    height: usize,
    /// First row of the band, within the panel.
    band: usize,
    /// First row of the band, within the matrix.
    row: usize,
}

/// Narrow instruction sets cut a panel into bands of as many vectors as their registers hold.
#[inline(always)]
fn bands<S: Simd, const P: usize, const K: usize>(simd: S, product: &Product<'_, P>, finish: &mut impl Finish<S>) {
    let mut panel_start = 0;
    for height in heights(product.matrices[0].rows) {
        let mut band = 0;
        while band < height {
            let vectors = ((height - band) / S::F64_LANES).min(tallest::<S>());
            let job = Band { panel_start, height, band, row: panel_start + band };
            match vectors {
                4 => tiles::<S, P, 4, K>(simd, product, job, finish),
                3 => tiles::<S, P, 3, K>(simd, product, job, finish),
                2 => tiles::<S, P, 2, K>(simd, product, job, finish),
                _ => tiles::<S, P, 1, K>(simd, product, job, finish),
            }
            band += vectors.max(1) * S::F64_LANES;
        }
        panel_start += height;
    }
}

/// As few and as even tiles as the registers allow.
#[inline(always)]
fn tiles<S: Simd, const P: usize, const M: usize, const K: usize>(
    simd: S,
    product: &Product<'_, P>,
    band: Band,
    finish: &mut impl Finish<S>,
) {
    let widest = (accumulators::<S>() / (M * K)).clamp(1, 6);
    let tiles = product.columns.div_ceil(widest).max(1);
    let mut first = 0;
    for tile in 0..tiles {
        let width = product.columns / tiles + usize::from(tile < product.columns % tiles);
        match width {
            6 => enter::<S, _, P, M, 6, K>(simd, product, band, first, finish),
            5 => enter::<S, _, P, M, 5, K>(simd, product, band, first, finish),
            4 => enter::<S, _, P, M, 4, K>(simd, product, band, first, finish),
            3 => enter::<S, _, P, M, 3, K>(simd, product, band, first, finish),
            2 => enter::<S, _, P, M, 2, K>(simd, product, band, first, finish),
            1 => enter::<S, _, P, M, 1, K>(simd, product, band, first, finish),
            _ => {}
        }
        first += width;
    }
}

/// Each tile is a function of its own: inlined into one, the many shapes would take minutes to compile.
#[inline(never)]
fn enter<S: Simd, F: Finish<S>, const P: usize, const M: usize, const N: usize, const K: usize>(
    simd: S,
    product: &Product<'_, P>,
    band: Band,
    first: usize,
    finish: &mut F,
) {
    // A single chain is for seven vectors and more, which split into panels of three and four.
    if is_used::<S>(M, N, K) && (K == 2 || M >= 3 || S::F64_LANES < ROWS || tallest::<S>() == 1) {
        simd.vectorize(Tile::<S, F, P, M, N, K> { simd, product, band, first, finish });
    }
}

/// M vectors of rows by N columns, in K interleaved chains.
struct Tile<'a, S, F, const P: usize, const M: usize, const N: usize, const K: usize> {
    simd: S,
    product: &'a Product<'a, P>,
    band: Band,
    first: usize,
    finish: &'a mut F,
}

impl<S: Simd, F: Finish<S>, const P: usize, const M: usize, const N: usize, const K: usize> WithSimd
    for Tile<'_, S, F, P, M, N, K>
{
    type Output = ();

    #[inline(always)]
    fn with_simd<Same: Simd>(self, _: Same) {
        let Self { simd, product, band, first, finish } = self;
        let lanes = S::F64_LANES;
        let mut sums = [[[simd.splat_f64s(0.0); N]; M]; K];
        let (starts, _) = S::as_simd_f64s(&product.start[band.row..band.row + M * lanes]);
        for m in 0..M {
            sums[0][m] = [starts[m]; N];
        }
        for p in 0..P {
            let inner = product.matrices[p].inner;
            let panel = &product.matrices[p].values[band.panel_start * inner..(band.panel_start + band.height) * inner];
            let (panel, _) = S::as_simd_f64s(panel);
            let (step, offset) = (band.height / lanes, band.band / lanes);
            let source = product.sources[p];
            let column: [&[f64]; N] = std::array::from_fn(|c| &source.values[(first + c) * source.stride..][..inner]);
            let add = |sums: &mut [[S::f64s; N]; M], weights: &[S::f64s], k: usize| {
                let weights = &weights[offset..offset + M];
                for n in 0..N {
                    let x = simd.splat_f64s(column[n][k]);
                    for m in 0..M {
                        sums[m][n] = simd.mul_add_f64s(weights[m], x, sums[m][n]);
                    }
                }
            };
            let mut k = 0;
            let groups = panel.chunks_exact(step * K);
            let rest = groups.remainder();
            for group in groups {
                for chain in 0..K {
                    add(&mut sums[chain], &group[chain * step..], k + chain);
                }
                k += K;
            }
            if K == 2 && !rest.is_empty() {
                add(&mut sums[0], rest, k);
            }
        }
        for m in 0..M {
            for n in 0..N {
                let sum = if K == 2 { simd.add_f64s(sums[0][m][n], sums[K - 1][m][n]) } else { sums[0][m][n] };
                finish.finish(simd, first + n, band.row + m * lanes, sum);
            }
        }
    }
}
